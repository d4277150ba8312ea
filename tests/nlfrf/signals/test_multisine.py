"""Harmonic grids and multisine design."""

import warnings

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import gamma

from nlfrf import DataWarning, Record, identify, multisine, reduce_crest
from nlfrf.signals import LineGrid
from nlfrf.signals.crest import expected_peaks

PLAIN = ["full", "odd", "odd-odd", "special-odd", "random-odd"]
BAND = dict(fs=1024, n_samples=1024, f_min=1, f_max=200)


def test_grids_are_those_of_the_paper():
    def excited(kind, f_min=1):
        return multisine(kind, fs=64, n_samples=64, f_min=f_min, f_max=20, rng=0).lines

    assert excited("full").excited.tolist() == list(range(1, 21))
    assert excited("odd").excited.tolist() == list(range(1, 21, 2))
    assert excited("odd-odd").excited.tolist() == [1, 5, 9, 13, 17]
    special = excited("special-odd")
    assert special.excited.tolist() == [1, 3, 9, 11, 17, 19]
    assert special.odd.tolist() == [5, 7, 13, 15]
    assert special.even.tolist() == list(range(2, 19, 2))
    assert excited("special-odd", f_min=9).excited.tolist() == [9, 11, 17, 19]


def test_random_odd_leaves_one_of_four_odd_lines_out():
    ms = multisine("random-odd", **BAND, rng=3)
    odd = np.arange(1, 200, 2)
    missing = np.setdiff1d(odd, ms.lines.excited)
    assert missing.size == odd.size // 4
    assert np.all(np.bincount(((missing - 1) // 2) // 4) == 1)
    assert not np.array_equal(
        multisine("random-odd", **BAND, rng=4).lines.excited, ms.lines.excited
    )


@pytest.mark.parametrize("kind", PLAIN)
def test_a_grid_is_recognised_as_what_it_is(kind):
    for f_min in (1, 2, 5, 9, 13):
        lines = multisine(kind, **BAND | {"f_min": f_min}, rng=5).lines
        assert lines.kind == kind


def test_a_grid_of_another_sort_is_called_custom():
    assert LineGrid(excited=[1, 3, 9, 15, 17, 40]).kind == "custom"
    assert LineGrid(excited=[1, 2, 4, 8]).kind == "custom"


@settings(deadline=None, max_examples=40)
@given(
    kind=st.sampled_from(PLAIN),
    n_samples=st.integers(200, 600),
    rms=st.floats(1e-3, 1e3),
    n_realizations=st.integers(1, 3),
    seed=st.integers(0, 2**32 - 1),
)
def test_energy_stands_on_the_excited_lines_only(kind, n_samples, rms, n_realizations, seed):
    ms = multisine(
        kind,
        fs=1000,
        n_samples=n_samples,
        f_min=5,
        f_max=400,
        rms=rms,
        n_realizations=n_realizations,
        rng=seed,
    )
    assert ms.u.shape == (n_realizations, n_samples)
    np.testing.assert_allclose(np.sqrt(np.mean(ms.u**2, axis=1)), rms, rtol=1e-12)
    spectrum = np.abs(np.fft.rfft(ms.u, axis=1)) * 2 / n_samples
    np.testing.assert_allclose(
        spectrum[:, ms.lines.excited], np.tile(ms.amplitude, (n_realizations, 1)), rtol=1e-9
    )
    spectrum[:, ms.lines.excited] = 0
    assert spectrum.max() < 1e-12 * rms * np.sqrt(n_samples)


def test_amplitude_by_array_and_by_callable():
    pink = multisine(**BAND, amplitude=lambda f: f**-0.5, rms=2, rng=1)
    same = multisine(**BAND, amplitude=pink.f**-0.5 * 7, rms=2, rng=1)
    np.testing.assert_allclose(pink.u, same.u, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(
        pink.amplitude[0] / pink.amplitude[-1], np.sqrt(pink.f[-1] / pink.f[0])
    )


def test_seeded_realisations_are_reproducible_and_differ():
    one = multisine(**BAND, n_realizations=2, rng=7)
    two = multisine(**BAND, n_realizations=2, rng=7)
    np.testing.assert_array_equal(one.u, two.u)
    assert np.abs(one.u[0] - one.u[1]).max() > 0.1


def test_denser_sampling_is_the_same_signal():
    ms = multisine(**BAND, rng=7)
    np.testing.assert_allclose(ms.sampled(4096)[:, ::4], ms.u, atol=1e-12)


@pytest.mark.parametrize("kind", PLAIN)
def test_crest_factor_falls_at_the_same_amplitude_spectrum(kind):
    f_max = {"full": 100, "odd": 200, "odd-odd": 400, "special-odd": 400, "random-odd": 266}[kind]
    ms = multisine(kind, fs=2048, n_samples=2048, f_min=1, f_max=f_max, n_realizations=2, rng=1)
    assert 98 <= ms.f.size <= 102
    with pytest.warns(DataWarning, match="lower than that of random phases"):
        better = reduce_crest(ms, target=1.7, rng=1)
    assert better.crest_factor.max() <= 1.7
    assert ms.crest_factor.min() > 2.5
    np.testing.assert_array_equal(better.amplitude, ms.amplitude)
    spectrum = np.abs(np.fft.rfft(better.u, axis=1))[:, ms.lines.excited] * 2 / 2048
    np.testing.assert_allclose(spectrum, np.tile(ms.amplitude, (2, 1)), rtol=1e-9)
    peak_between_samples = np.abs(better.sampled(8 * 2048)).max() / better.rms
    assert peak_between_samples < 1.75


def test_optimised_realisations_are_not_all_the_same():
    ms = multisine("full", fs=1024, n_samples=1024, f_min=1, f_max=100, n_realizations=3, rng=1)
    with pytest.warns(DataWarning):
        turned = np.exp(1j * reduce_crest(ms, target=1.7, rng=1).phase)
    assert (
        np.abs(np.triu(turned @ turned.conj().T, 1)).max() < 50
    )  # Schroeder's phases once served for every one


@pytest.mark.parametrize("n_realizations", [1, 2, 7])
def test_by_default_the_best_of_a_few_random_draws_is_taken(n_realizations):
    """However many realisations: peaks that random phases have now and then, and no warning of
    them.
    """
    for seed in range(5):
        ms = multisine(
            fs=1024, n_samples=4096, f_min=0.25, f_max=100, n_realizations=n_realizations, rng=seed
        )
        better = reduce_crest(ms, rng=seed)
        assert np.all(better.crest_factor <= ms.crest_factor + 0.05)
        assert better.crest_factor.min() > 2.4
        assert (
            np.unique(better.phase[:, 0]).size == n_realizations
        )  # the same seed, and no draw twice
        assert better.crest_factor.max() < {1: 3.2, 2: 3.7, 7: 3.9}[n_realizations]
    one = reduce_crest(ms, n_draws=1)
    np.testing.assert_array_equal(one.phase, ms.phase)


@pytest.mark.parametrize(
    "band",
    [
        dict(kind="special-odd", f_min=1, f_max=400),
        dict(kind="full", f_min=1, f_max=400),
        dict(kind="odd", f_min=1, f_max=24),
        dict(kind="special-odd", f_min=1, f_max=19),
        dict(kind="special-odd", f_min=1500, f_max=1600),
        dict(kind="full", f_min=1, f_max=2000),
        dict(kind="special-odd", f_min=1, f_max=1000, n_log=30),
    ],
)
def test_the_peaks_of_random_phases_are_expected_about_once(band):
    """Exponentially distributed with mean one, near enough: so that peaks as low as 1e-5 are never
    theirs.
    """
    ms = multisine(fs=4096, n_samples=4096, n_realizations=400, rng=3, **band)
    peaks = expected_peaks(
        ms.crest_factor, ms.lines.excited, amplitude=ms.amplitude, n_samples=4096
    )
    assert 0.5 < peaks.mean() < 1.6
    assert peaks.max() < 11
    sevens = peaks[:399].reshape(-1, 7).sum(axis=1)
    assert gamma(1).sf(peaks).min() > 1e-5
    assert gamma(7).sf(sevens).min() > 1e-5
    worst, first = np.argmax(peaks), 7 * np.argmax(sevens)
    for u in (ms.u[worst : worst + 1], ms.u[first : first + 7]):
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            identify(Record(u=u[:, None], y=u[:, None], fs=4096, lines=ms.lines))
        assert not any("random phases" in str(one.message) for one in told)


def test_crest_factor_never_rises():
    ms = multisine("full", fs=64, n_samples=64, f_min=1, f_max=2, rng=0)
    assert reduce_crest(ms, n_iterations=3, target=0.1, rng=0).crest_factor[0] <= ms.crest_factor[0]
    with pytest.raises(ValueError, match="target must be positive"):
        reduce_crest(ms, target=0)


def test_logarithmic_lines_stand_on_the_grid():
    ms = multisine("odd", fs=4096, n_samples=8192, f_min=0.5, f_max=1000, n_log=40, rng=0)
    assert np.all(ms.lines.excited % 2 == 1)
    assert 30 <= ms.f.size <= 40
    steps = np.diff(np.log(ms.f[ms.f > 5]))
    assert steps.max() < 1.5 * steps.min() + 0.05


@pytest.mark.parametrize("n_samples", [63, 64, 1001])
def test_bands_close_to_nyquist_are_handled(n_samples):
    ms = multisine(
        "full", fs=n_samples, n_samples=n_samples, f_min=1, f_max=n_samples / 2 - 0.01, rng=0
    )
    assert ms.lines.excited[-1] == (n_samples - 1) // 2
    np.testing.assert_allclose(np.sqrt(np.mean(ms.u**2)), 1, rtol=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (dict(kind="even"), r"kind must be one of 'full', .*, got 'even'"),
        (dict(fs=0), r"fs must be positive, got 0"),
        (dict(rms=-1), r"rms must be positive, got -1"),
        (dict(n_samples=10.5), r"n_samples must be a whole number of at least 4, got 10.5"),
        (dict(f_max=600), r"f_max must lie below the Nyquist frequency 512 Hz, got 600 Hz"),
        (dict(f_max=0.5), r"f_max must be at least f_min = 1 Hz, got 0.5 Hz"),
        (
            dict(f_min=1.2, f_max=1.8),
            r"f_min and f_max must hold a multiple of the resolution 1 Hz",
        ),
        (
            dict(kind="special-odd", f_min=4.5, f_max=8),
            r"must hold at least one line of a special-odd grid",
        ),
        (dict(kind="custom"), r"lines must be given for a custom grid"),
        (dict(lines=[1, 3]), r"lines must only be given with kind=\"custom\""),
        (
            dict(kind="custom", lines=[1, 300]),
            r"lines must lie inside the band, lines 1 to 200, got lines 1 to 300",
        ),
        (dict(kind="custom", lines=[1, 1.5]), r"excited must be whole DFT line numbers"),
        (dict(kind="custom", lines=[3, 1]), r"excited must be increasing"),
        (
            dict(amplitude=[1, 2]),
            r"amplitude must have one value per excited line \(50\), got shape \(2,\)",
        ),
        (
            dict(amplitude=lambda f: f - f),
            r"amplitude must be finite and positive on every excited line",
        ),
        (dict(n_realizations=0), r"n_realizations must be a whole number of at least 1, got 0"),
        (dict(rms=float("nan")), r"rms must be finite, got nan"),
        (dict(fs="fast"), r"fs must be a real number, got 'fast'"),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        multisine(**BAND | change)


def test_line_grid_refusals():
    with pytest.raises(ValueError, match="at least one line"):
        LineGrid(excited=[])
    with pytest.raises(ValueError, match="odd must hold odd lines only, got line 4"):
        LineGrid(excited=[1, 3], odd=[4])
    with pytest.raises(ValueError, match="even must not hold excited lines, got line 2"):
        LineGrid(excited=[1, 2], even=[2])
    with pytest.raises(ValueError, match="line 0 is the mean"):
        LineGrid(excited=[0, 2])
