"""Friction without a law: what is read of it against its making, and the bound for bristles with
damping.
"""

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
from robust import friction_plant, prove_friction
from robust.friction import Bounded
from robust.friction.reading.force import read_friction_force

GRID = {"fs": 4000, "n_samples": 4000}
LUGRE = {"sigma0": 2e6, "sigma2": 0.0, "Fc": 15.4, "Fs": 20.0, "vs": 0.01}
LAWS = {
    "Maxwell slip": None,
    "LuGre": nlfrf.friction.LuGre(sigma1=2000.0, **LUGRE),
    "Dahl": nlfrf.friction.Dahl(sigma0=2e6, Fc=20.0),
}


def played(law, levels=(0.5, 60), count=9, resolution=50e-9):
    """Records of the linear motor, 12 kg and 0.55 ms, with a law: in motion at 0.1 m/s both ways,
    and at rest.
    """
    axis = nlfrf.servo_axis("linear motor")
    axis = replace(axis, motor_friction=LAWS[law] or axis.motor_friction, resolution=resolution)
    return records_of(axis, np.geomspace(*levels, count))


def records_of(axis, levels, highest=100):
    """Records of an axis, in motion at 0.1 m/s both ways, and at rest at levels [N], of lines up to
    `highest` [Hz].
    """
    fast, slow = (
        {"f_min": f_min, "f_max": f_max, **GRID} for f_min, f_max in ((5, 200), (2, highest))
    )
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        ms = nlfrf.multisine(rms=15.0, rng=1, **fast)
        moving = [
            nlfrf.rig.simulate_servo(axis, ms, base_velocity=v, n_periods=2) for v in (0.1, -0.1)
        ]
        at_rest = [
            nlfrf.rig.simulate_servo(axis, nlfrf.multisine(rms=rms, rng=2, **slow), n_periods=2)
            for rms in levels
        ]
    return moving, at_rest


@pytest.mark.parametrize("law", LAWS)
def test_machine_and_force_are_read_whatever_the_law(law):
    moving, at_rest = played(law, levels=(0.5, 100 if law == "Dahl" else 60), count=10)
    found = read_friction_force(moving, (0.1, -0.1), at_rest)
    assert found.sliding.mass == pytest.approx(12.0, rel=0.005)
    assert found.sliding.delay == pytest.approx(0.55e-3, abs=2e-6)
    assert found.Fs[0] < 20.0 < found.Fs[1] < 1.5 * 20.0
    assert found.reason == ""
    assert 0.93 * 2e6 < found.K0[0] < 2e6 < 1.02 * found.K0[1] < 1.1 * 2e6
    if law == "LuGre":  # 2000 Ns/m of 2 N/um, and what creeps besides
        assert 1e-3 < found.bristle_time < 2.5e-3
    assert "break-away force" in str(found)


def test_the_speed_over_which_friction_falls_is_read_where_the_axis_slides(monkeypatch):
    monkeypatch.setitem(LAWS, "steep", replace(LAWS["LuGre"], Fs=40.0, vs=0.01))
    for law, highest, shown in (("steep", 150, True), ("steep", 10, False), ("Dahl", 150, False)):
        moving, at_rest = played(law, levels=(2, highest), count=6)
        found = read_friction_force(moving, (0.1, -0.1), at_rest)
        assert np.isfinite(found.stribeck).all() == shown
        assert ("falls with speed over" in str(found)) == shown
        if shown:
            assert found.stribeck[0] < 0.01 < found.stribeck[1] < 10 * found.stribeck[0]


def test_friction_that_falls_at_the_speed_of_the_motion_is_no_creep(monkeypatch):
    """Its slope is in the viscous friction of the motion, which is below that of the machine at
    rest.
    """
    k, deflection = np.full(4, 1e5), np.array([0.25, 0.5, 1.0, 2.0])
    strength = 40.0 * deflection / deflection.sum()
    falls = nlfrf.friction.VaryingSliders(stiffness=k, strength=strength, stiction=2.5, vs=0.06)
    for law, creeps in ((falls, False), (LAWS["LuGre"], True)):
        monkeypatch.setitem(LAWS, "played", law)
        moving, at_rest = played("played", levels=(0.1, 120), count=14, resolution=1e-9)
        found = read_friction_force(moving, (0.1, -0.1), at_rest)
        assert found.creeps == creeps
        assert (found.sliding.damping < 0) == (law is falls)


@pytest.mark.parametrize("law", ["LuGre", "Dahl"])
def test_friction_that_grows_between_the_traces_is_told_and_held(law, monkeypatch):
    """By 30 % before the axis moves: the traces contradict each other, and the interval holds both
    frictions.
    """
    now = LAWS[law]
    grown = {name: 1.3 * getattr(now, name) for name in ("Fc", "Fs") if hasattr(now, name)}
    monkeypatch.setitem(LAWS, "grown", replace(now, **grown))
    _, at_rest = played(law, levels=(2, 150), count=7)
    for name, share in (("grown", 1.3), (law, 1.0)):
        moving, _ = played(name, levels=(2, 3), count=1)
        found = read_friction_force(moving, (0.1, -0.1), at_rest)
        assert ("has grown between the traces" in found.contradiction) == (share > 1)
        assert found.Fs[0] < 20.0 <= share * 20.0 < found.Fs[1] < 1.6 * share * 20.0
    stuck = [one for one in at_rest if np.std(one.u) < 4]
    assert (
        read_friction_force(moving, (0.1, -0.1), stuck).contradiction == ""
    )  # none of them slides


@pytest.mark.parametrize(
    "law", [nlfrf.friction.Dahl(sigma0=1e6, Fc=10.0), nlfrf.friction.Coulomb.constant(10.0)]
)
def test_friction_of_motor_and_load_is_read_as_one(law):
    """A sharp filter below the antiresonance overshot by up to 18 %, and a coupling passed for a
    stiffness of friction.

    10 N on each, and 1 N/um on each of Dahl's: rigid friction has none.
    """
    axis = replace(nlfrf.servo_axis("belt"), motor_friction=law, load_friction=law, resolution=1e-8)
    moving, at_rest = records_of(axis, np.geomspace(8, 60, 6), highest=12)
    found = read_friction_force(moving, (0.1, -0.1), at_rest, masses=2)
    assert (
        found.contradiction == ""
    )  # slides that the filter mixes with their neighbours are smaller
    assert 0.85 * 20 < found.Fs[0] < 20.0 < found.Fs[1] < 1.25 * 20
    if isinstance(law, nlfrf.friction.Dahl):
        assert found.K0[0] < 2e6 < found.K0[1]
    else:
        assert found.K0[1] == np.inf or np.isnan(found.K0[1])
    assert not found.Fs[0] > found.sliding.interval("coulomb")[1]  # neither has stiction


@pytest.mark.parametrize(("masses", "stiffness"), [(1, 4e5), (2, 4e5), (2, 1.2e6)])
def test_the_stiffness_of_a_load_that_sticks_is_behind_its_coupling(masses, stiffness):
    """The motor shows K1 + k K2 / (k + K2) of K1 and K2: the sum is largest with K1 = 0."""
    s = 2j * np.pi * np.fft.rfftfreq(4000, 1 / 4000)
    link, motor, load = 1e6 + 100.0 * s, 7.0, 5.0
    machine = motor * s**2 + 20.0 * s + link * load * s**2 / (link + load * s**2)
    if masses == 1:
        machine = (motor + load) * s**2 + 20.0 * s
    fast, slow = (nlfrf.multisine(f_min=2, f_max=f_max, rng=1, **GRID) for f_max in (200, 20))

    def record(ms, force, size, mean=0.0):
        y = size * ms.u[0]
        u = np.fft.irfft(np.fft.rfft(y) * force) + mean
        u, y = (np.tile(one, (2, 1))[None] for one in (u, y))
        return nlfrf.Record(u=u, y=y, fs=4000, lines=ms.lines, hold="band-limited")

    moving = [record(fast, machine, 1e-3, sign * 10.0) for sign in (1, -1)]
    at_rest = [record(slow, machine + stiffness, size) for size in (1e-9, 1e-8, 1e-6)]
    found = read_friction_force(moving, (0.1, -0.1), at_rest, masses=masses)
    K2 = np.linspace(0, 1e8, 1_000_001)
    K1 = stiffness - 1e6 * K2 / (1e6 + K2)
    expected = stiffness
    if masses == 2:
        expected = (K1 + K2)[K1 >= 0].max() if K1[-1] < 0 else np.inf
    assert pytest.approx([stiffness, expected], rel=3e-3) == found.K0


def test_levels_that_stick_show_no_break_away():
    moving, at_rest = played("LuGre", levels=(0.5, 4), count=4)
    found = read_friction_force(moving, (0.1, -0.1), at_rest)
    assert np.isnan(found.Fs).all()
    assert "still rises with the level" in found.reason
    assert "break-away" not in str(found)
    found = read_friction_force(moving, (0.1, -0.1), at_rest[:1])
    assert "two levels or more at rest, got 1" in found.reason


def read_peaks(forces, coulomb):
    """The friction force of 12 kg with a Coulomb friction, from peaks of the force at rest [N].

    At level k, 2**k, the axis moves by one step of its encoder, 1 nm, when the force changes sign.
    """
    ms = nlfrf.multisine(f_min=2, f_max=20, rng=1, **GRID)
    s, x = 2j * np.pi * np.fft.rfftfreq(4000, 1 / 4000), 1e-3 * ms.u[0]
    u = np.fft.irfft(np.fft.rfft(x) * (12.0 * s**2 + 20.0 * s))
    sine = np.sin(2 * np.pi * 2 * np.arange(4000) / 4000)

    def record(u, y, r):
        u, y, r = (np.tile(one, (2, 1))[None] for one in (u, y, r))
        return nlfrf.Record(u=u, y=y, r=r, fs=4000, lines=ms.lines, hold="band-limited")

    moving = [record(u + sign * (coulomb + 2.0), x, ms.u[0]) for sign in (1, -1)]
    at_rest = [
        record(peak * sine, 1e-9 * (sine > 0), 2.0**k * np.sqrt(2) * sine)
        for k, peak in enumerate(forces)
    ]
    return read_friction_force(moving, (0.1, -0.1), at_rest)


def test_a_force_that_stops_to_rise_below_coulomb_friction_is_no_break_away():
    """Where the axis moves by a step of its encoder now and then, the force is that of the step at
    any level.
    """
    forces = (0.4, 0.4, 0.4, 1.8, 8.0, 10.0, 10.1, 10.2)
    found = read_peaks(forces, 8.0)
    low, high = found.Fs
    assert found.sliding.coulomb == pytest.approx(8.0, rel=1e-4)
    assert 9 < low < 10 < high < 11.5
    # peaks that fall with the level were taken where stiction has fallen
    assert read_peaks([*forces[:-1], 0.8 * 10], 4.0).Fs[1] > 14


def test_the_bound_for_bristles_with_damping_is_the_integral_of_the_kernel():
    """In continuous time it is int |h + tau h'|, from the impulse response by python-control."""
    plant, controller = friction_plant(1.0, 0.0, 0.4), control.tf([100.0, 2000.0], [1.0, 200.0])
    closed = control.feedback(control.ss(control.tf([1], [1, 0.4, 0])), control.ss(controller))
    t, h = control.impulse_response(closed, np.linspace(0, 20, 200001))
    for tau in (0.0, 0.01, 0.1, 0.3):
        proof = prove_friction(plant, controller, Bounded(2.0, tau))
        ends = (np.trapezoid(np.abs(h + end * np.gradient(h, t)), t) for end in (0.0, tau))
        assert proof.error_bound == pytest.approx(2 * max(ends), rel=2e-3)
        assert ("on bristles with a damping of up to" in proof.claim) == (tau > 0)


@pytest.mark.parametrize("tau", [0.002, 0.05])
def test_no_bristles_of_a_sampled_loop_pass_the_bound(tau):
    """The worst s of a sampled loop, found through its impulse responses, comes near the bound and
    not above it.
    """
    T, mass, steps = 0.01, 1.0, 40
    plant = friction_plant(mass, 0.0, 0.4)
    controller = control.ss(control.tf([300.0, -270.0], [1.0, -0.4], T))
    bound = prove_friction(plant, controller, Bounded(1.0, tau)).error_bound
    h, periods = T / steps, 400
    flow = np.array([[1.0, (1 - np.exp(-0.4 * h)) / 0.4], [0.0, np.exp(-0.4 * h)]])
    push = np.array([(h - flow[0, 1]) / 0.4, flow[0, 1]]) / mass

    # the kernel of a force that lasts one step, by time invariance from period to period: one run
    # for each offset
    kernel = np.zeros(periods * steps)
    for offset in range(steps):
        x, k, u = np.zeros(2), np.zeros(controller.nstates), 0.0
        for n in range(periods * steps):
            if n % steps == 0:
                u = float(-(controller.C @ k + controller.D[0] * x[0])[0])
                k = controller.A @ k + controller.B[:, 0] * x[0]
            x = flow @ x + push * (u - (n == offset))
            if n % steps == steps - 1:
                kernel[n - offset] = x[
                    0
                ]  # at the end of a period, of a force n - offset steps before
    derivative = np.gradient(kernel / h, h)
    worst = h * np.abs(kernel / h + tau * derivative).sum()
    assert worst < 1.01 * bound
    assert worst > 0.85 * bound
