"""A seeded part of the harness: bursts at what is proved, with frictions of the class; springs that refute, played."""

import numpy as np

from benchmarks.bench_friction_proof import attacked, moving, samples_needed, spring_oscillates, verdicts
from nlfrf.friction import VaryingSliders
from tests.support.friction_loops import ORACLES, T, pid

LOOPS = [(pid(Kp, Ki, Kd), delay) for (Kp, Ki, Kd, delay), _, _ in ORACLES.values()]


def test_nothing_that_is_proved_keeps_moving():
    proofs, _ = verdicts(LOOPS, 1.05)
    assert [proof.verdict for proof in proofs] == ["proved"] * 4
    quick = [loop for loop in LOOPS if samples_needed(*loop) < 6000]
    assert len(quick) >= 3
    total, found = attacked(quick, 8, 1.05, np.random.default_rng(4))
    assert total == 12 * len(quick)
    assert not found


def test_the_harness_sees_what_moves():
    force = np.where(np.arange(2000) < 5, 0.1, 0.0)
    element = VaryingSliders(stiffness=[64e3], strength=[1.0])
    assert moving(element, pid(80e3, 1e5, 240.0), T, force, np.zeros(2))
    assert not moving(element, LOOPS[3][0], 0.0, force, np.zeros(2))


def test_a_spring_that_refutes_oscillates():
    assert spring_oscillates(pid(80e3, 1e5, 240.0), T, 64e3)
