"""The friction limit: its mobility against that of the proof, its slopes, and `prove_friction` on
what comes out.
"""

import control
import numpy as np
import pytest

import robust
from robust import friction_plant, tuning
from robust.friction import Bounded, MaxwellSlip
from robust.friction.loop import friction_loop, mobility
from robust.lti.sampling import sampled
from robust.synthesis.tuning.friction import FrictionChannel
from tests.robust.synthesis.tuning.test_gradients import differences, on_clock, problem_of

T = 1e-3
RIG, AXIS = friction_plant(1.0, 80e3), friction_plant(1.0, 0.0)


ERROR, FORCE = control.summing_junction(["r", "-y"], "e"), control.summing_junction(["u", "d"], "f")


def pid_on_the_rig(*limits, delay=1e-3, **options):
    """Arguments of `tune`: a PID on a mass on a spring, sliding and stuck."""
    G = [control.ss(control.tf([1], [1, 0, k])) for k in (80e3, 144e3)]
    return {
        "system": [on_clock(ERROR, T), on_clock(FORCE, T)],
        "plant": tuning.Plants(G, inputs="f", outputs="y"),
        "blocks": {
            "K": tuning.Pid(kp=5e3, ki=5e4, kd=20.0, filter_time=1e-3, reads="e", drives="u")
        },
        "hard": [tuning.Limit("d", "f", 2.0), *limits],
        "soft": [tuning.Limit("r", "e", lambda omega: np.maximum(omega, 1.0) / 30, band=(0, 30))],
        "dt": T,
        "delay": delay,
        **options,
    }


@pytest.mark.parametrize("delay", [0.0, 0.5e-3, 2e-3])
@pytest.mark.parametrize("machine", [RIG, AXIS])
def test_the_mobility_is_that_of_the_proof(machine, delay):
    """From the sensitivity alone, and from the flow and the jumps of the hybrid loop."""
    K = control.ss([[0.0]], [[1.0]], [[-6e3]], [[8e3]], T)
    omega = np.array([1.0, 50.0, 200.0, 900.0, 3000.0])
    G = control.ss(machine.A, machine.B_force[:, None], machine.C_measured[None], 0)
    G_d, z = sampled(G, T, delay), np.exp(1j * omega * T)
    channel = FrictionChannel(
        limit=tuning.FrictionLimit(machine, MaxwellSlip(64e3)),
        index=0,
        machine=machine,
        place=(0, 0),
        plant=G_d,
        dt=T,
        delay=delay,
    )
    S = 1 / (1 + K(z) * G_d(z))
    expected = mobility(friction_loop(machine, K, delay), omega)
    assert np.allclose(channel.mobility(omega, S[:, None, None]), expected, rtol=1e-6)


def test_slopes_of_the_limit():
    """At fixed frequencies, multipliers kept: against differences, 1e-7 of the largest."""
    limit = tuning.FrictionLimit(RIG, MaxwellSlip(64e3, 1.2))
    problem = problem_of({**pid_on_the_rig(limit), "blocks": pid_on_the_rig()["blocks"]})
    controller, x = problem.controller, problem.controller.start
    (scene,) = (scene for scene in problem.scenes if scene.has_friction)
    (channel,), slopes = scene.channels, controller.slopes(x)
    scene.refit_scalings(scene.close(controller.matrix(x)))
    for omega in (3.0, 60.0, 500.0, 1e5):
        loop = scene.close(controller.matrix(x))
        (peak,) = scene.peaks_at(channel, omega, loop.sensitivity_factors(omega), slopes)

        def level(x, omega=omega):
            H = scene.close(controller.matrix(x)).responses_by_elimination(np.array([omega]))
            return np.log(scene.levels(channel, np.array([omega]), H)[0])

        expected = differences(level, x)
        assert peak.level == pytest.approx(level(x), abs=1e-9)
        assert np.abs(peak.gradient - expected).max() <= 1e-7 * max(1.0, np.abs(expected).max())


@pytest.mark.attack
def test_a_design_is_proved_with_the_limit_and_not_without():
    """Late by a sample, with stiction: the stiffest PID is not proved, the one that keeps the limit
    is.
    """
    friction = MaxwellSlip(64e3, 1.5)
    limit = tuning.FrictionLimit(RIG, friction)
    designs = [robust.tune(**pid_on_the_rig(*more), n_starts=1, rng=1) for more in ((), (limit,))]
    proofs = [
        robust.prove_friction(RIG, one.controller("y", "f"), friction, delay=1e-3)
        for one in designs
    ]
    assert [one.met for one in designs] == [True, True]
    assert [proof.verdict.is_proved for proof in proofs] == [False, True]
    found = next(one for one in designs[1].limits if one.limit is limit)
    assert found.ratio == pytest.approx(
        1.0, abs=1e-4
    )  # it binds: stiffness is given away for the proof
    assert found.n_lines
    assert str(found).startswith("hard  comes to rest with friction up to 64 kN/m on plant 2")
    assert designs[1].gamma > designs[0].gamma


def test_a_cascade_on_a_servo_axis_is_proved():
    """Position P over velocity PI on a free mass, with stiction of a fifth."""
    friction = MaxwellSlip(1e5, 1.2)
    velocity = control.tf([1 / T, -1 / T], [1, 0], T, inputs="y", outputs="v")
    junctions = [
        on_clock(control.summing_junction(a, b), T)
        for a, b in ((["r", "-y"], "e_x"), (["v_r", "-v"], "e_v"))
    ]
    design = robust.tune(
        [*junctions, on_clock(FORCE, T), velocity],
        tuning.Plants(control.tf([1], [1, 0, 0]), inputs="f", outputs="y"),
        {
            "K_x": tuning.Pid(kp=31.0, reads="e_x", drives="v_r"),
            "K_v": tuning.Pid(kp=126.0, ki=3150.0, reads="e_v", drives="u"),
        },
        hard=[
            tuning.Limit("d", "f", 1.8),
            tuning.Limit("d", "y", 3e-6, band=(0, 2.0)),
            tuning.FrictionLimit(AXIS, friction),
        ],
        soft=[tuning.Limit("d", "y", 1e-6)],
        dt=T,
        delay=0.5e-3,
        n_starts=1,
        rng=1,
    )
    assert design.met
    assert robust.prove_friction(
        AXIS, design.controller("y", "f"), friction, delay=0.5e-3
    ).verdict.is_proved


@pytest.mark.parametrize(
    ("match", "call"),
    [
        (
            "friction must be of type MaxwellSlip",
            lambda: tuning.FrictionLimit(RIG, Bounded(1.0)),
        ),
        (
            "margin must lie between 0 and 1",
            lambda: tuning.FrictionLimit(RIG, MaxwellSlip(1e4), margin=1.0),
        ),
        (
            "soft must hold robust.tuning.Limit",
            lambda: robust.tune(
                **pid_on_the_rig() | {"soft": [tuning.FrictionLimit(RIG, MaxwellSlip(1e4))]}
            ),
        ),
        (
            "dt must be given for a friction limit with a delay",
            lambda: robust.tune(
                **pid_on_the_rig(tuning.FrictionLimit(RIG, MaxwellSlip(1e4)))
                | {"system": [on_clock(ERROR, 0), on_clock(FORCE, 0)], "dt": 0.0}
            ),
        ),
        (
            "friction limits for a plant with one input and one output only",
            lambda: robust.tune(
                [],
                tuning.Plants(
                    control.ss([[-1.0]], [[1.0]], [[1.0], [1.0]], 0), inputs="u", outputs=["x", "y"]
                ),
                {"K": tuning.Gain(K=-1.0, reads="y", drives="u")},
                hard=[tuning.FrictionLimit(RIG, MaxwellSlip(1e4))],
            ),
        ),
    ],
)
def test_refusals(match, call):
    with pytest.raises(ValueError, match=match):
        call()
