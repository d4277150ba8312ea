"""Experiments on the rig: symmetry, steady state, and the same result whoever computes it."""

import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor, ThreadPoolExecutor
from multiprocessing import get_context

import numpy as np
import pytest

from nlfrf.checks import DataWarning
from nlfrf.friction import Leuven, LuGre
from nlfrf.hysteresis import Exponential
from nlfrf.multisine import multisine
from nlfrf.rig import Rig, paper_rig
from nlfrf.simulate import simulate


def odd(n_realizations=1, *, kind="special-odd", rms=0.25, n_samples=4096, rng=5):
    return multisine(
        kind, fs=4096, n_samples=n_samples, f_min=1, f_max=140, rms=rms, n_realizations=n_realizations, rng=rng
    )


def test_record_has_the_shape_and_the_lines_of_the_experiment():
    ms = odd(3)
    record = simulate(paper_rig(), ms, n_periods=2)
    assert record.u.shape == record.y.shape == (3, 2, 4096)
    assert np.array_equal(record.u[:, 1], ms.u)
    assert record.fs == ms.fs
    assert record.lines is ms.lines


LUGRE = LuGre(sigma0=64e3, sigma1=13, sigma2=0.4, Fc=0.7, Fs=1.0, vs=0.01)


@pytest.mark.parametrize(
    "friction", [Leuven(), Leuven(curve=Exponential(64e3, 1.0)), LUGRE], ids=["tanh", "exp", "LuGre"]
)
@pytest.mark.parametrize("rms", [0.025, 0.25, 2.5])
@pytest.mark.parametrize("kind", ["odd", "odd-odd", "special-odd", "random-odd"])
def test_odd_grids_are_answered_with_half_wave_antisymmetry_to_rounding(kind, rms, friction):
    ms = odd(kind=kind, rms=rms)
    y = simulate(Rig(1.0, 80e3, friction), ms, n_discard=9).y[0, 0]
    spectrum = np.abs(np.fft.rfft(y))
    assert np.abs(y[:2048] + y[2048:]).max() < 2e-12 * y.std()
    assert spectrum[0:1024:2].max() < 1e-13 * spectrum.max()
    if kind != "odd":  # there is distortion to be seen, it is odd
        assert np.sqrt(np.mean(spectrum[ms.lines.odd] ** 2)) > 1e-4 * spectrum.max()


def test_result_does_not_depend_on_who_computes_it():
    ms, rig = odd(4), paper_rig()
    y = simulate(rig, ms).y
    with ThreadPoolExecutor(1) as one:
        assert np.array_equal(simulate(rig, ms, executor=one).y, y)
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as processes:
        assert np.array_equal(simulate(rig, ms, executor=processes).y, y)


def test_progress_counts_up_to_the_total():
    seen = []
    simulate(paper_rig(), odd(3), progress=lambda done, total: seen.append((done, total)))
    assert seen == [(1, 3), (2, 3), (3, 3)]


def test_held_force_is_a_force_delayed_by_half_a_sample():
    ms = odd(rms=1e-4)
    smooth, held = (simulate(paper_rig(), ms, hold=hold, n_discard=4) for hold in ("band-limited", "zoh"))
    ratio = (np.fft.rfft(held.y[0, 0]) / np.fft.rfft(smooth.y[0, 0]))[ms.lines.excited]
    f = ms.f / ms.fs
    assert np.abs(ratio / (np.sinc(f) * np.exp(-1j * np.pi * f)) - 1).max() < 1e-5


def test_unsettled_record_is_announced():
    with pytest.warns(DataWarning, match=r"steady state was not reached: .* Raise n_discard above 0"):
        simulate(paper_rig(), odd(), n_discard=0, n_periods=2)


def test_refusals_name_the_parameter():
    with pytest.raises(ValueError, match="n_periods must be a whole number of at least 1, got 0"):
        simulate(paper_rig(), odd(), n_periods=0)
    with pytest.raises(ValueError, match="hold must be one of 'band-limited', 'zoh', got 'foh'"):
        simulate(paper_rig(), odd(), hold="foh")
    coarse = multisine(fs=100, n_samples=400, f_min=1, f_max=40, rng=1)
    with pytest.raises(ValueError, match=r"oversampling must be at least \d+ for a stable integration step"):
        simulate(paper_rig(), coarse)


def test_step_too_long_in_sliding_is_refused():
    rig = Rig(1.0, 80e3, Leuven(n=3.0))
    with pytest.raises(ValueError, match=r"oversampling must be about \d+ for a stable integration step in sliding"):
        simulate(rig, odd(2, rms=60.0))


def test_numba_is_loaded_by_the_first_simulation_only():
    code = "import sys, nlfrf.simulate, nlfrf.friction; print([m for m in ('numba', 'matplotlib') if m in sys.modules])"
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True).stdout.strip() == "[]"
