"""A seeded part of the harness: bursts at what is proved, with frictions of the class; springs that
refute, played.
"""

import numpy as np
import pytest

import nlfrf
import robust
from benchmarks.bench_friction_proof import (
    attacked,
    bristles,
    moving,
    samples_needed,
    spring_oscillates,
    verdicts,
)
from tests.support.friction_loops import ORACLES, T, pd, pid

LOOPS = [(pid(Kp, Ki, Kd), delay) for (Kp, Ki, Kd, delay), _, _ in ORACLES.values()]


@pytest.mark.parametrize("n_bursts", [2, pytest.param(8, marks=pytest.mark.attack)])
def test_nothing_that_is_proved_keeps_moving(n_bursts):
    proofs, _ = verdicts(LOOPS, robust.friction.MaxwellSlip(64e3, 1.05))
    assert [proof.verdict for proof in proofs] == ["proved"] * 4
    quick = [loop for loop in LOOPS if samples_needed(*loop) < 6000]
    assert len(quick) >= 3
    total, found = attacked(quick, n_bursts, 1.05, np.random.default_rng(4))
    assert total == 1.5 * n_bursts * len(quick)
    assert not found


def test_the_harness_sees_what_moves():
    force = np.where(np.arange(2000) < 5, 0.1, 0.0)
    element = nlfrf.friction.VaryingSliders(stiffness=[64e3], strength=[1.0])
    assert moving(element, pid(80e3, 1e5, 240.0), T, force, np.zeros(2))
    assert not moving(element, LOOPS[3][0], 0.0, force, np.zeros(2))


def test_a_spring_that_refutes_oscillates():
    assert spring_oscillates(pid(80e3, 1e5, 240.0), T, 64e3)


def test_no_bristle_keeps_a_proved_loop_moving():
    """LuGre, the friction of the paper and Leuven laws of every curve."""
    PD = pd(20e3, 60.0)
    proofs, _ = verdicts([(PD, 0.0)], robust.friction.Bristle(64e3, 1 / 0.7, 13.0))
    assert proofs[0].verdict == "proved"
    total, found = attacked([(PD, 0.0)], 16, 1 / 0.7, np.random.default_rng(5), bristles)
    assert total >= 8
    assert not found
