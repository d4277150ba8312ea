"""The fit of all levels at once: gains against brute force and closed forms, machines against their making."""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from robust.friction.presliding_fit import elements_of_curve, fit_friction, gaussian_gain, sinusoidal_gain

STIFFNESS, STRENGTH = np.array([4e4, 2e4, 4e3]), np.array([0.3, 0.5, 0.2])


def force_of(x, stiffness=STIFFNESS, strength=STRENGTH):
    """Force of Maxwell elements along a motion, step by step."""
    held, total = np.zeros(stiffness.size), np.empty(x.size)
    for i, step in enumerate(np.diff(x, prepend=0.0)):
        held = np.clip(held + stiffness * step, -strength, strength)
        total[i] = held.sum()
    return total


@pytest.mark.parametrize("amplitude", [1e-6, 1e-5, 4e-5, 3e-4])
def test_the_gain_of_a_sine_is_the_fundamental_of_the_force(amplitude):
    t = np.arange(60000) / 20000
    x = amplitude * np.cos(2 * np.pi * t)
    force = force_of(x)[40000:]
    gain = np.fft.rfft(force)[1] / np.fft.rfft(x[40000:])[1]
    assert np.isclose(gain, sinusoidal_gain(STIFFNESS, STRENGTH, amplitude), rtol=1e-3)


def test_the_gain_has_the_limits_of_a_spring_and_of_dry_friction():
    assert np.isclose(sinusoidal_gain(STIFFNESS, STRENGTH, 1e-9), STIFFNESS.sum())
    assert np.isclose(sinusoidal_gain(STIFFNESS, STRENGTH, 1.0), 4j * STRENGTH.sum() / np.pi, rtol=0.01)
    assert np.isclose(gaussian_gain(STIFFNESS, STRENGTH, 1e-9), STIFFNESS.sum())
    # E[A^2 4 W/(pi A)] / E[A^2]: W sqrt(2/pi) over the rms, the known gain of a relay; weights 1 would give twice that
    rms = 1.0
    assert np.isclose(
        gaussian_gain(STIFFNESS, STRENGTH, rms), 1j * STRENGTH.sum() * np.sqrt(2 / np.pi) / rms, rtol=0.01
    )


@pytest.mark.parametrize("rms", [4e-6, 1.5e-5, 6e-5])
def test_the_gain_of_narrow_gaussian_noise_is_that_of_a_long_simulation(rms):
    """E[F X*] / E[X X*] of a narrow band, 400 correlation times: 2 % of scatter at most."""
    rng, n = np.random.default_rng(0), 400_000
    spectrum = np.zeros(n // 2 + 1, dtype=complex)
    lines = np.arange(3900, 4101)
    spectrum[lines] = rng.standard_normal(lines.size) + 1j * rng.standard_normal(lines.size)
    x = np.fft.irfft(spectrum)
    x *= rms / np.std(x)
    X, F = np.fft.rfft(x)[lines], np.fft.rfft(force_of(x))[lines]
    measured = (F @ X.conj()) / (X @ X.conj())
    expected = gaussian_gain(STIFFNESS, STRENGTH, rms)
    assert abs(measured - expected) < 0.02 * abs(expected)


@pytest.mark.parametrize("p", [0.0, 0.4, 1.0, 2.0])
def test_the_elements_follow_the_virgin_curve(p):
    stiffness, strength = elements_of_curve(6e4, 1.5, p)
    assert np.isclose(strength.sum(), 1.5)
    assert np.isclose(stiffness.sum(), 6e4, rtol=0.01)
    z = np.linspace(0, 1.5 / 6e4 * 2, 50)
    share = {0.0: np.minimum(z / (1.5 / 6e4), 1), 1.0: 1 - np.exp(-z * 6e4 / 1.5)}.get(p)
    if share is None:
        inside = np.maximum(1 - (1 - p) * z * 6e4 / 1.5, 0.0)
        share = 1 - inside ** (1 / (1 - p))
    drawn = np.minimum(np.outer(z, stiffness), strength).sum(axis=1)
    assert np.abs(drawn - 1.5 * share).max() < 0.02 * 1.5


def levels(mass, spring, damping, curve, rms, *, stiction=1.0, seed=0, sign=1.0):
    """BLAs of a machine of 100 elements, with noise of 0.5 % on the position, and what was played."""
    rng = np.random.default_rng(seed)
    stiffness, strength = elements_of_curve(*curve, 100)
    vs = 0.01 if stiction > 1 else np.inf
    law = nlfrf.friction.VaryingSliders(stiffness=stiffness, strength=strength, stiction=stiction, vs=vs)
    rig = nlfrf.Rig(mass, spring, law, damping)
    blas, played = [], []
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        for i, level in enumerate(rms):
            grid = {"fs": 1024, "n_samples": 2048, "f_min": 2, "f_max": 200, "rng": 10 * seed + i}
            ms = nlfrf.multisine("special-odd", rms=level * curve[1], **grid)
            record = nlfrf.simulate(rig, ms, n_periods=4, n_discard=4)
            noise = 0.005 * np.std(record.y) * rng.standard_normal(record.y.shape)
            blas.append(nlfrf.identify(replace(record, y=sign * record.y + noise)))
            played.append(ms)
    return blas, played


MACHINES = [
    (1.0, 80e3, 5.0, (64e3, 1.0, 1.0)),
    (1.0, 80e3, 5.0, (64e3, 1.0, 0.3)),
    (12.0, 0.0, 20.0, (2e6, 20.0, 0.5)),
]


@pytest.mark.parametrize("machine", MACHINES, ids=["sprung, exponential", "sprung, sharp", "free"])
def test_a_machine_of_the_family_is_read(machine):
    mass, spring, damping, (K0, Fs, p) = machine
    found = fit_friction(*levels(*machine, (0.05, 0.3, 1.0, 4.0)), free=not spring)
    truth = {"mass": mass, "stiffness": spring, "K0": K0, "Fs": Fs, "damping": damping}
    for name, true in truth.items():
        off, std = abs(getattr(found, name) - true), getattr(found, f"{name}_std")
        assert off <= 4.5 * std + 0.003 * true, name  # 0.3 %: 40 elements for 100
        assert off <= (0.1 if name == "damping" else 0.02) * true, name
        assert std < 0.05 * true or not true, name
    assert abs(found.exponent - p) < 0.05
    assert np.median(found.misfit) < 1.5
    assert found.misfit.max() < 4  # where an element of 100 is about to slip, those of 30 are not
    assert found.left_open == ()


def test_a_highest_level_that_sticks_leaves_the_strength_open():
    found = fit_friction(*levels(*MACHINES[2], (0.02, 0.05, 0.1)), free=True)
    assert found.left_open == ("Fs",)
    assert np.isinf(found.Fs_std)
    assert np.isclose(found.K0, 2e6, rtol=0.02)
    assert np.isclose(found.mass, 12.0, rtol=0.01)


def test_levels_that_all_slide_leave_the_presliding_stiffness_open():
    assert "K0" in fit_friction(*levels(*MACHINES[0], (2.0, 3.0, 5.0))).left_open


def test_friction_outside_the_family_shows_in_the_misfit():
    misfit = fit_friction(*levels(*MACHINES[0], (0.05, 0.3, 1.0, 4.0), stiction=1.4)).misfit
    assert np.median(misfit) > 3
    assert misfit.max() > 5


def test_what_makes_no_fit_is_refused():
    blas, played = levels(*MACHINES[0], (0.05, 1.0, 4.0))
    with pytest.raises(ValueError, match="blas must hold at least three levels, from sticking to sliding, got 2"):
        fit_friction(blas[:2], played[:2])
    with pytest.raises(ValueError, match="multisines must be one for each of the 3 blas, got 2"):
        fit_friction(blas, played[:2])
    other = nlfrf.multisine("special-odd", fs=1024, n_samples=2048, f_min=4, f_max=150, rng=1)
    with pytest.raises(ValueError, match="multisines must excite the lines of the blas, got other frequencies"):
        fit_friction(blas, [*played[:2], other])
    turned, played = levels(*MACHINES[0], (0.05, 1.0, 4.0), sign=-1.0)
    with pytest.raises(ValueError, match="the output falls when the input rises"):
        fit_friction(turned, played)
    harder, played = levels(1.0, 90e3, 5.0, (10.0, 1.0, 1.0), (0.05, 1.0, 4.0))
    softer, _ = levels(1.0, 80e3, 5.0, (10.0, 1.0, 1.0), (0.05, 1.0, 4.0))
    with pytest.raises(ValueError, match="blas must span from sticking to sliding, got 8"):
        fit_friction([softer[0], harder[1], harder[2]], played)
