"""The rig against linear theory, an independent integrator, and its own symmetry."""

import re

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import nlfrf
from nlfrf._base.arguments import DataWarning
from nlfrf.rig import run
from nlfrf.rig.bench.rig import Rig, paper_rig
from tests.support.virgin_curves import chord_elements, virgin

LUGRE = {"sigma1": 13.0, "sigma2": 0.4, "Fc": 0.7, "Fs": 1.0, "vs": 0.01}


def force(n, *, rms, rng=3):
    """A smooth random force: lines 1..140 of a 1 s period."""
    generator = np.random.default_rng(rng)
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    spectrum[1:141] = np.exp(2j * np.pi * generator.uniform(size=140))
    u = np.fft.irfft(spectrum, n)
    return rms * u / u.std()


def test_lugre_agrees_with_an_independent_integrator():
    sigma0, fs, n = 64e3, 4096.0, 1024
    rig = Rig(1.0, 80e3, nlfrf.friction.LuGre(sigma0=sigma0, **LUGRE))
    u = force(4096, rms=2.0)[:n]
    motion = run(rig, u, fs=fs, oversampling=16)

    def derivative(t, state):
        x, v, z = state
        s = 0.7 + 0.3 * np.exp(-((v / 0.01) ** 2))
        dz = v - sigma0 * abs(v) / s * z
        return v, np.interp(t, motion.t, u) - 80e3 * x - (sigma0 * z + 13.0 * dz + 0.4 * v), dz

    exact = solve_ivp(
        derivative,
        (0, (n - 1) / fs),
        [0, 0, 0],
        method="DOP853",
        rtol=1e-10,
        atol=1e-14,
        max_step=1 / fs,
        t_eval=motion.t,
    )
    assert np.abs(motion.v).max() > 0.02  # it slides
    assert np.abs(motion.x - exact.y[0]).max() < 2e-6 * np.abs(motion.x).max()
    assert np.abs(motion.z - exact.y[2]).max() < 1e-5 * np.abs(motion.z).max()


@pytest.mark.parametrize(
    "curve",
    [
        nlfrf.hysteresis.Linear(64e3),
        nlfrf.hysteresis.MaxwellSlip([64e3], [1e6]),
        nlfrf.hysteresis.ElasticPlastic(64e3, 1e6),
    ],
)
def test_leuven_with_a_straight_curve_is_lugre(curve):
    u = force(4096, rms=2.5)
    lugre = run(
        Rig(1.0, 80e3, nlfrf.friction.LuGre(sigma0=64e3, **LUGRE)), u, fs=4096.0, oversampling=2
    )
    leuven = run(Rig(1.0, 80e3, nlfrf.friction.Leuven(curve=curve)), u, fs=4096.0, oversampling=2)
    assert np.allclose(leuven.x, lugre.x, atol=1e-11 * np.abs(lugre.x).max())
    assert np.allclose(leuven.friction, lugre.friction, atol=1e-9)


@pytest.mark.parametrize("rms", [0.1, 0.5, 2.0])
def test_elements_and_stack_move_the_rig_alike(rms):
    elements = chord_elements(nlfrf.hysteresis.Tanh(64e3, 1.0), np.geomspace(5e-7, 5e-5, 8))
    knots = np.sort(elements.strength / elements.stiffness)
    table = nlfrf.hysteresis.Table(knots, virgin(elements, knots))
    u = force(4096, rms=rms)
    stack, slip = (
        run(Rig(1.0, 80e3, nlfrf.friction.Leuven(curve=curve)), u, fs=4096.0)
        for curve in (table, elements)
    )
    assert np.abs(stack.x - slip.x).max() < 1e-12 * np.abs(stack.x).max()
    assert np.abs(stack.friction - slip.friction).max() < 1e-12


def test_leuven_agrees_with_an_independent_integrator():
    # every element a state of its own, which stops where it slips: no stack, no turning points
    k, w = np.array([24e3, 20e3, 20e3]), np.array([0.1, 0.3, 0.65])
    law = nlfrf.friction.Leuven(curve=nlfrf.hysteresis.MaxwellSlip(k, w), n=2.0)
    fs, n = 4096.0, 600
    u = force(4096, rms=1.0)[:n]
    motion = run(Rig(1.0, 80e3, law), u, fs=fs, oversampling=64)

    def derivative(t, state):
        x, v, f = state[0], state[1], state[2:]
        g = 0.7 + 0.3 * np.exp(-((v / 0.01) ** 2))
        fh = f.sum()
        dz = v * (1 - np.sign(fh * v) * (abs(fh) / g) ** 2)
        df = np.where((np.abs(f) >= w) & (f * dz > 0), 0.0, k * dz)
        return [v, np.interp(t, motion.t, u) - 80e3 * x - (fh + 13.0 * dz + 0.4 * v), *df]

    exact = solve_ivp(
        derivative,
        (0, (n - 1) / fs),
        np.zeros(5),
        rtol=1e-8,
        atol=1e-12,
        max_step=0.1 / fs,
        t_eval=motion.t,
    )
    assert np.abs(motion.x).max() > 2e-5  # elements slip, and turn
    assert np.abs(motion.x - exact.y[0]).max() < 5e-6 * np.abs(motion.x).max()


def test_small_motion_is_that_of_the_stuck_spring():
    fs, frequency, amplitude = 4096.0, 20.0, 1e-6
    t = np.arange(4 * 4096) / fs
    motion = run(paper_rig(), amplitude * np.sin(2 * np.pi * frequency * t), fs=fs)
    s = 2j * np.pi * frequency
    gain = 1 / (s**2 + (13.0 + 0.4) * s + 80e3 + 64e3)
    last = slice(3 * 4096, None)
    measured = np.mean(motion.x[last] * np.exp(-s * t[last])) * 2j / amplitude
    assert abs(measured / gain - 1) < 2e-4  # the chord between samples costs 1e-4


def test_force_turned_around_turns_the_motion_around_to_the_last_bit():
    u = force(2048, rms=2.0)
    sliding = {"Fs": 1.0, "Fc": 0.7, "vs": 0.01}
    gms = nlfrf.friction.GeneralizedMaxwellSlip(
        stiffness=[30e3, 34e3], alpha=[0.3, 0.7], C=20.0, **sliding
    )
    frictions = [
        nlfrf.friction.Leuven(),
        nlfrf.friction.Leuven(n=2.0),
        nlfrf.friction.Dahl(sigma0=64e3, Fc=1.0, n=1.5),
        gms,
    ]
    for friction in (*frictions, nlfrf.friction.Coulomb(**sliding)):
        rig = Rig(1.0, 80e3, friction)
        assert np.array_equal(
            run(rig, -u, fs=2048.0, oversampling=4).x, -run(rig, u, fs=2048.0, oversampling=4).x
        )


def test_dahl_yields_at_the_coulomb_force():
    rig = Rig(1.0, 1000.0, nlfrf.friction.Dahl(sigma0=64e3, Fc=0.7))
    motion = run(rig, np.linspace(0, 5, 4000), fs=1000.0, oversampling=4)
    assert motion.friction[-1] == pytest.approx(0.7, rel=1e-6)


@pytest.mark.parametrize(
    ("curve", "worst", "order"),
    [
        (nlfrf.hysteresis.Linear(64e3), 5e-6, 3.8),
        (nlfrf.hysteresis.Tanh(64e3, 1.0), 5e-6, 3.5),
        (nlfrf.hysteresis.Exponential(64e3, 1.0), 5e-6, 3.5),
        (nlfrf.hysteresis.Parabola(64e3, 1.0), 5e-6, 3.5),
        (nlfrf.hysteresis.MaxwellSlip([20e3, 20e3, 24e3], [0.1, 0.3, 0.6]), 5e-5, 1.7),
    ],
    ids=lambda c: type(c).__name__,
)
def test_refinement_converges(curve, worst, order):
    # fourth order where the curve is smooth, as steps are divided where its branches meet; else
    # second
    u = force(2048, rms=1.0)
    rig = Rig(1.0, 80e3, nlfrf.friction.Leuven(curve=curve))
    x = [run(rig, u, fs=2048.0, oversampling=steps).x for steps in (2, 8, 64)]
    errors = [np.sqrt(np.mean((x[i] - x[2]) ** 2)) / x[2].std() for i in range(2)]
    assert errors[0] < worst
    assert errors[0] / errors[1] > 4**order


@pytest.mark.parametrize(
    ("friction", "worst", "order"),
    [
        (nlfrf.friction.Coulomb(Fc=0.7, Fs=1.0, vs=0.01, sigma2=0.4), 1e-5, 3.5),
        (
            nlfrf.friction.GeneralizedMaxwellSlip(
                stiffness=[20e3, 20e3, 24e3],
                alpha=[0.2, 0.3, 0.5],
                C=20.0,
                Fs=1.0,
                Fc=0.7,
                vs=0.01,
                sigma2=0.4,
            ),
            1.5e-4,
            1.7,
        ),
    ],
    ids=["Coulomb", "GMS"],
)
def test_refinement_converges_for_laws_that_switch(friction, worst, order):
    u = force(2048, rms=2.5)
    rig = Rig(1.0, 80e3, friction)
    x = [run(rig, u, fs=2048.0, oversampling=steps).x for steps in (2, 8, 64)]
    errors = [np.sqrt(np.mean((x[i] - x[2]) ** 2)) / x[2].std() for i in range(2)]
    assert errors[0] < worst
    assert errors[0] / errors[1] > 4**order


def test_too_long_a_step_is_refused_with_one_that_would_do():
    with pytest.raises(
        ValueError, match=r"oversampling must be at least (\d+) for a stable integration step"
    ) as refused:
        run(paper_rig(), np.ones(100), fs=100.0)
    enough = int(str(refused.value).split("at least ")[1].split()[0])
    with pytest.warns(DataWarning, match="the integration step is coarse"):  # stable, but no more
        assert np.isfinite(run(paper_rig(), np.ones(100), fs=100.0, oversampling=enough).x).all()


def test_coarse_step_is_announced_with_its_error():
    # the stuck rig at its resonance: what the warning says is what is measured
    fs, frequency = 512.0, np.sqrt(144e3) / 2 / np.pi
    t = np.arange(8 * 512) / fs
    force = 1e-8 * np.sin(2 * np.pi * frequency * t)
    with pytest.warns(
        DataWarning, match=r"is wrong by (\d+) %. Use an oversampling of (\d+)"
    ) as warned:
        coarse = run(paper_rig(), force, fs=fs)
    said, enough = (
        float(word) for word in re.search(r"by (\d+) %.*of (\d+)", str(warned[0].message)).groups()
    )
    fine, held = (run(paper_rig(), force, fs=fs, oversampling=n) for n in (32, int(enough)))
    late = slice(6 * 512, None)

    def error(motion):
        return np.sqrt(np.mean((motion.x - fine.x)[late] ** 2)) / fine.x[late].std()

    assert error(coarse) == pytest.approx(said / 100, rel=0.5)
    assert error(held) < 0.012


def test_step_too_long_for_sliding_is_refused_with_one_that_was_tried():
    rig = Rig(1.0, 80e3, nlfrf.friction.Leuven(curve=nlfrf.hysteresis.Tanh(64e3, 1.0), n=3.0))
    u = 60.0 * np.sin(2 * np.pi * 40 * np.arange(4096) / 4096)
    with pytest.raises(
        ValueError, match=r"oversampling must be about (\d+) for a stable .* in sliding"
    ) as refused:
        run(rig, u, fs=4096.0)
    enough = int(str(refused.value).split("about ")[1].split()[0])
    assert np.isfinite(run(rig, u, fs=4096.0, oversampling=enough).x).all()


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((0.0, 1.0, nlfrf.friction.Leuven()), "mass must be positive, got 0"),
        ((1.0, -1.0, nlfrf.friction.Leuven()), "stiffness must be zero or positive, got -1"),
        ((1.0, 1.0, nlfrf.friction.Leuven(), -2.0), "damping must be zero or positive, got -2"),
        ((1.0, 1.0, "Leuven"), "friction must be one of the laws of nlfrf.friction, got 'Leuven'"),
    ],
)
def test_rigs_that_make_no_sense_are_refused(arguments, message):
    with pytest.raises(ValueError, match=message):
        Rig(*arguments)


def test_run_refuses_bad_arguments():
    with pytest.raises(ValueError, match="signal must be finite"):
        run(paper_rig(), [0.0, np.nan], fs=1e4)
    with pytest.raises(ValueError, match="hold must be one of 'linear', 'zoh'"):
        run(paper_rig(), [0.0, 1.0], fs=1e4, hold="cubic")
    with pytest.raises(ValueError, match="fs must be positive"):
        run(paper_rig(), [0.0, 1.0], fs=0)
    with pytest.raises(ValueError, match="signal must hold at least one sample, got none"):
        run(paper_rig(), [], fs=1e4)
