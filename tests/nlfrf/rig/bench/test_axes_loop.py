"""A controller matrix around several axes: against the closed loop of linear theory and the loop of
one axis.
"""

from types import SimpleNamespace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf import paper_rig
from nlfrf.rig import Controller, Rig, Trajectory, run, run_loops, two_axis_stage

FS, N = 1024.0, 400
RNG = np.random.default_rng(0)
FULL = control.ss(
    np.diag([0.9, 0.8]) + 0.05,
    RNG.standard_normal((2, 2)),
    300 * RNG.standard_normal((2, 2)),
    [[2000.0, 100.0], [50.0, 4000.0]],
    1 / FS,
)
DECENTRALISED = control.append(
    robust.shaping.pid(2e3, 4e4, dt=1 / FS), robust.shaping.pid(5e3, 8e4, dt=1 / FS)
)


@pytest.mark.parametrize("K", [FULL, DECENTRALISED], ids=["full", "decentralised"])
def test_a_linear_stage_in_a_loop_is_the_closed_loop(K):
    stage, rng = two_axis_stage("none"), np.random.default_rng(1)
    r, noise = 1e-3 * rng.standard_normal((2, N)), 1e-5 * rng.standard_normal((2, N))
    disturbance = rng.standard_normal((2, N))
    response = run(stage, r, K, disturbance=disturbance, noise=noise, oversampling=16)
    zero, mass = np.zeros((2, 2)), stage.mass
    plant = control.ss(
        np.block(
            [
                [zero, np.eye(2)],
                [-np.linalg.solve(mass, stage.stiffness), -np.linalg.solve(mass, stage.damping)],
            ]
        ),
        np.vstack([zero, np.linalg.inv(mass)]),
        np.hstack([stage.sensors, zero]),
        zero,
    )
    G = control.c2d(plant, 1 / FS)
    y = control.forced_response(control.feedback(G * K, np.eye(2)), U=r - noise).y
    y += control.forced_response(control.feedback(G, K), U=disturbance).y
    assert not response.diverged
    assert np.abs(response.x - y).max() < 1e-7 * np.abs(y).max()
    assert np.allclose(response.y - response.x, noise, atol=1e-15)
    assert np.allclose(response.e, r - response.x)


PI = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[200.0]], D=[[3e3]], dt=1 / 2000)


@pytest.mark.parametrize(
    "law",
    [paper_rig().friction, nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01)],
    ids=["Leuven", "Coulomb"],
)
@pytest.mark.parametrize("delay", [0.0, 0.25e-3, 1.1e-3])
def test_loops_around_axes_that_do_not_meet_are_loops_of_one_axis(law, delay):
    r = 2e-4 * np.sin(2 * np.pi * 20 * np.arange(600) / 2000)
    options = {"delay": delay, "resolution": 1e-7, "saturation": 20.0}
    single = run(Rig(1.0, 80e3, law, 0.4), r, Controller(PI, **options), initial=(1e-5, 0.02))
    rig = Rig(np.diag([1.0, 2.0]), np.diag([80e3, 90e3]), [law, None], np.diag([0.4, 5.0]))
    both = control.append(
        control.ss(PI.A, PI.B, PI.C, PI.D, PI.dt), control.ss([], [], [], [[50.0]], PI.dt)
    )
    response = run(
        rig, np.stack([r, 0 * r]), Controller(both, **options), initial=[[1e-5, 1e-6], [0.02, 0.0]]
    )
    assert np.abs(response.x[0] - single.x).max() < 1e-6 * np.abs(single.x).max()
    assert np.abs(response.u[0] - single.u).max() < 1e-3  # one step of the sensor now and then
    assert np.abs(response.friction[0] - single.friction).max() < 0.02
    assert (response.x[:, 0] == [1e-5, 1e-6]).all()
    assert (response.v[:, 0] == [0.02, 0.0]).all()


def test_limits_act_channel_by_channel():
    r = np.outer([1e-4, 2e-4], np.ones(300))
    response = run(
        two_axis_stage(), r, Controller(FULL, saturation=[0.15, np.inf], resolution=[1e-6, 0.0])
    )
    assert np.abs(response.u[0]).max() == 0.15
    assert np.abs(response.u[1]).max() > 0.5
    assert np.allclose(response.y[0] / 1e-6, np.round(response.y[0] / 1e-6), atol=1e-9)
    assert np.array_equal(response.y[1], response.x[1])


def test_friction_stops_what_a_proportional_loop_would_finish():
    r = np.outer([50e-6, 0.0], np.ones(1500))
    K = control.append(
        robust.shaping.pid(2e3, 0.0, dt=1 / FS), robust.shaping.pid(2e3, 0.0, dt=1 / FS)
    )
    rest, free = (run(two_axis_stage(kind), r, K) for kind in ("friction", "none"))
    assert rest.outcome(0.2) == "settled"
    stiff = 1 / (two_axis_stage().stiffness[0, 0] / 2e3 + 1)
    assert free.x[0, -1] == pytest.approx(50e-6 * stiff, rel=0.1)
    assert rest.x[0, -1] < 0.7 * free.x[0, -1]
    assert rest.friction[0, -1] > 0.02


def test_a_stage_that_runs_away_is_a_result():
    K = control.ss([], [], [], -3e5 * np.eye(2), 1 / FS)
    response = run(two_axis_stage(), 1e-3 * np.ones((2, 2000)), K)
    assert response.diverged
    assert 5 < response.x.shape[1] < 2000
    assert np.isfinite(response.x).all()
    assert response.outcome(0.1) == "ran away"


def test_a_small_axis_that_goes_on_is_seen_beside_a_large_one_that_settles():
    t = np.arange(4000) / 1000
    large = 1e-3 * np.where(t < 1, np.sin(9 * t), np.exp(-2.2 * (t - 1)) * np.sin(50 * t))
    channels, rows = np.stack([large, 1e-6 * np.sin(60 * t)]), np.zeros((2, 4000))
    told = Trajectory(t=t, signals={"r": channels, "x": rows, "friction": rows}, units={})
    assert told.outcome(1.0) == "limit cycle"
    assert told.residual(1.0) == pytest.approx(1.0, rel=1e-3)


def test_outcome_is_that_of_the_channel_that_swings_most():
    t = np.arange(4000) / 2000
    channels = np.where(
        t < 0.5, np.sin(300 * t), np.stack([0.1 * np.sin(300 * t), np.zeros(t.size)])
    )
    rows = np.zeros((2, 4000))
    told = Trajectory(t=t, signals={"r": channels, "x": rows, "friction": rows}, units={})
    assert told.outcome(0.5) == "limit cycle"
    assert told.residual(0.5) == pytest.approx(0.1, rel=0.01)


def limited(K, options):
    """The controller with its limits, which are taken out of the options."""
    return Controller(
        K,
        **{
            name: options.pop(name)
            for name in ("delay", "saturation", "resolution")
            if name in options
        },
    )


@pytest.mark.parametrize(
    ("K", "options", "message"),
    [
        (
            robust.shaping.pid(1.0, 0.0, dt=1 / FS),
            {},
            "K must have 2 inputs and 2 outputs, got 1 and 1",
        ),
        (
            control.ss([], [], [], np.ones((3, 2)), 1 / FS),
            {},
            "K must have 2 inputs and 2 outputs, got 2 and 3",
        ),
        (
            FULL,
            {"saturation": [1.0, 2.0, 3.0]},
            r"saturation must be one number or 2, one per channel, got shape",
        ),
        (FULL, {"saturation": [1.0, -2.0]}, "saturation must be positive, got -2"),
        (FULL, {"resolution": -1.0}, "resolution must be zero or positive, got -1"),
        (FULL, {"noise": np.zeros(10)}, "noise must have 2 channels, like the rig, got 1"),
        (
            FULL,
            {"disturbance": np.zeros((2, 9))},
            "disturbance must have one value for each of the 10 samples",
        ),
        (
            FULL,
            {"initial": np.zeros(3)},
            r"initial must hold positions and velocities, shape \(2, 2\), got .*\(3,\)",
        ),
        (FULL, {"oversampling": 0}, "oversampling must be a whole number of at least 1, got 0"),
    ],
)
def test_refusals_name_the_parameter(K, options, message):
    with pytest.raises(ValueError, match=message):
        run(two_axis_stage(), np.zeros((2, 10)), limited(K, options), **options)


def test_references_and_stacks_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match=r"signal must have 2 axes, got shape \(10,\)"):
        run(two_axis_stage(), np.zeros(10), FULL)
    with pytest.raises(ValueError, match="signal must have 2 channels, like the rig, got 3"):
        run(two_axis_stage(), np.zeros((3, 10)), FULL)
    with pytest.raises(
        ValueError, match="rig must have one axis in a stack of loops, got a rig of matrices with 2"
    ):
        run_loops(two_axis_stage(), np.zeros((2, 10)), [FULL])


def test_bristles_of_one_axis_are_a_spring_to_small_motion():
    """LuGre at nanometres: the stage with its bristles' stiffness and damping, on one axis only."""
    law = nlfrf.friction.LuGre(sigma0=3e4, sigma1=13.0, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)
    stage = two_axis_stage("none")
    parts = {"mass": stage.mass, "sensors": stage.sensors}
    stuck = Rig(
        stiffness=stage.stiffness + np.diag([3e4, 0]),
        damping=stage.damping + np.diag([13.4, 0]),
        friction=[None] * 2,
        **parts,
    )
    bristled = Rig(stiffness=stage.stiffness, damping=stage.damping, friction=[law, None], **parts)
    r = 1e-10 * np.ones((2, 300))
    small, linear = (run(rig, r, FULL, oversampling=8) for rig in (bristled, stuck))
    assert np.abs(small.x - linear.x).max() < 1e-5 * np.abs(linear.x).max()
