"""Identification against exact cases, closed forms and formulas written independently."""

import re
import warnings

import numpy as np
import pytest
from scipy import signal

from nlfrf import DataWarning, Record, identify, identify_noise, multisine, second_opinion
from nlfrf.signals import LineGrid
from tests.support.printed import unwrapped

FS = N = 1024


def record_of(
    system,
    kind="special-odd",
    *,
    n_periods=1,
    noise=0.0,
    f_max=300,
    rms=1.0,
    n_realizations=1,
    seed=0,
):
    """A record of a static system, with white noise on the output."""
    rng = np.random.default_rng(seed)
    ms = multisine(
        kind,
        fs=FS,
        n_samples=N,
        f_min=1,
        f_max=f_max,
        rms=rms,
        n_realizations=n_realizations,
        rng=rng,
    )
    u = np.repeat(ms.u[:, None, :], n_periods, axis=1)
    return Record(u=u, y=system(u) + noise * rng.standard_normal(u.shape), fs=FS, lines=ms.lines)


def filtered(u, b, a):
    """Steady-state answer of a discrete filter to a period."""
    n = u.shape[-1]
    H = signal.freqz(b, a, np.arange(n // 2 + 1) * 2 * np.pi / n)[1]
    return np.fft.irfft(np.fft.rfft(u, axis=-1) * H, n, axis=-1), H


def level(amplitudes):
    return np.sqrt(np.mean(np.abs(amplitudes) ** 2))


# Which lines distortion falls on


def test_linear_plant_leaves_detection_lines_at_rounding():
    record = record_of(lambda u: filtered(u, [0.2, 0.1], [1, -0.7])[0])
    bla = identify(record)
    H = filtered(record.u, [0.2, 0.1], [1, -0.7])[1][record.lines.excited]
    np.testing.assert_allclose(bla.G, H, rtol=1e-12)
    assert level(bla.levels.odd) < 1e-14
    assert level(bla.levels.even) < 1e-14
    assert bla.bound().max() < 1e-12


@pytest.mark.parametrize(("power", "lit", "dark"), [(2, "even", "odd"), (3, "odd", "even")])
def test_even_and_odd_powers_fall_on_their_lines_only(power, lit, dark):
    levels = identify(record_of(lambda u: u + 0.1 * u**power)).levels
    assert level(getattr(levels, dark)) < 1e-13
    assert level(getattr(levels, lit)) > 1e-3


def test_an_even_system_has_no_bla_and_all_its_output_is_even_distortion():
    """Of y = u^2 the excited lines hold nothing, not even rounding: no level may be lost in 0
    / 0.
    """
    blas = [identify(record_of(lambda u: u**2, n_periods=2, seed=seed)) for seed in range(20)]
    for bla in blas:
        np.testing.assert_array_equal(bla.G, 0.0)
        assert bla.var_total.max() < 1e-60
        assert bla.bound().max() < 1e-30
        assert str(bla).endswith(
            "G is zero on every line: no part of the output is linear in the input"
        )
    U = record_of(lambda u: u).u[0, 0]
    U = 2 / N * np.abs(np.fft.rfft(U))[blas[0].lines.excited[0]]  # the same for all
    told = np.mean([bla.var_even * U**2 for bla in blas], axis=0)
    on_lines = np.mean([np.abs(bla.levels.even[0]) ** 2 for bla in blas], axis=0)
    assert abs(np.mean(told) / np.mean(on_lines) - 1) < 0.02
    assert "they differ by less than 6 dB on every line" in unwrapped(
        second_opinion(record_of(lambda u: u**2))
    )


def test_energy_on_detection_lines_of_the_input_is_no_distortion():
    rng = np.random.default_rng(0)
    ms = multisine(fs=FS, n_samples=N, f_min=1, f_max=300, rng=rng)
    u = (ms.u + 0.05 * ms.u**3 + 0.05 * ms.u**2)[:, None, :]  # a real actuator
    y, _ = filtered(u, [0.2, 0.1], [1, -0.7])
    levels = identify(Record(u=u, y=y, fs=FS, lines=ms.lines)).levels
    raw = np.fft.rfft(y[0, 0])[ms.lines.odd] * 2 / N
    assert level(levels.odd) < 0.02 * level(raw)  # what is left is interpolation of G between lines


# Exact numbers


def test_cubic_on_six_lines_is_the_exact_table():
    n_realizations = 20_000
    # 128 samples: the highest combination, line 57, does not alias
    ms = multisine(
        fs=128,
        n_samples=128,
        f_min=1,
        f_max=19,
        rms=np.sqrt(3),
        n_realizations=n_realizations,
        rng=1,
    )
    u = ms.u[:, None, :]
    bla = identify(Record(u=u, y=u**3, fs=128, lines=ms.lines))
    variance = np.array([12.9375, 10.1875, 14.125, 12.375, 8.4375, 8.4375])
    sigma = np.sqrt(variance / n_realizations)
    assert np.all(np.abs(bla.G - 8.25) < 4 * sigma)
    np.testing.assert_allclose(bla.var_distortion, variance, rtol=5 * 1.5 / np.sqrt(n_realizations))
    detected = np.mean(np.abs(bla.levels.odd) ** 2, axis=0)
    np.testing.assert_allclose(
        detected, [15.75, 17.4375, 12.9375, 11.25], rtol=5 * 1.5 / np.sqrt(n_realizations)
    )


@pytest.mark.parametrize(
    ("f", "G", "residual"),
    [(np.tanh, 0.6057055096, 0.0274153260), (lambda u: u**3, 3.0, 6.0)],
    ids=["tanh", "cubic"],
)
def test_bussgang_gain_and_residual_of_static_nonlinearities(f, G, residual):
    # many lines are as good as Gaussian: G = E[f'(u)], and the rest of the power of y is distortion
    rng = np.random.default_rng(2)
    ms = multisine("odd", fs=1, n_samples=16384, f_min=1e-4, f_max=0.49, n_realizations=64, rng=rng)
    u = ms.u[:, None, :]
    bla = identify(Record(u=u, y=f(u), fs=1, lines=ms.lines))
    assert abs(np.mean(bla.G) - G) < 2e-3 * G
    rest = np.mean((f(u) - np.mean(bla.G.real) * u) ** 2)
    assert abs(rest - residual) < 0.02 * residual


# Noise


def test_noise_variance_is_recovered_within_statistics():
    sigma = 0.01
    n_periods = 8
    bla = identify(record_of(lambda u: 2 * u, n_periods=n_periods, noise=sigma))
    U = np.abs(bla.levels.excited[0]) / np.abs(bla.G)
    expected = 4 * sigma**2 / N / n_periods / U**2
    # a sum of F chi-squares with 2 (P - 1) degrees of freedom each
    spread = 1 / np.sqrt(bla.f.size * (n_periods - 1))
    assert abs(np.mean(bla.var_noise / expected) - 1) < 4 * spread
    # a linear plant: everything is noise, so the total agrees with it
    assert 0.7 < np.median(bla.var_total) / np.median(bla.var_noise) < 1.4


def test_two_periods_that_are_the_same_hold_no_noise():
    bla = identify(record_of(lambda u: u + 0.1 * u**3, n_periods=2))
    np.testing.assert_array_equal(bla.var_noise, 0.0)
    np.testing.assert_array_equal(bla.var_distortion, bla.var_total)


def test_noise_of_the_input_counts_where_the_output_repeats_exactly():
    clean = record_of(lambda u: 2 * u, n_periods=4, n_realizations=50)
    sigma = 0.05
    u = clean.u + sigma * np.random.default_rng(4).standard_normal(clean.u.shape)
    bla = identify(Record(u=u, y=clean.y, fs=FS, lines=clean.lines), transient="none")
    amplitude = np.abs(np.fft.rfft(clean.u[0, 0])[clean.lines.excited]) * 2 / N
    # |G|^2 of the variance at the input, P = 4, M = 50
    expected = 4 * (4 * sigma**2 / N) / 4 / 50 / amplitude**2
    n = 50 * 3 * amplitude.size  # complex degrees of freedom
    assert abs(np.mean(bla.var_noise / expected) - 1) < 4 / np.sqrt(n)


def test_one_period_has_no_noise_split_and_says_so():
    bla = identify(record_of(lambda u: u + 0.1 * u**3))
    assert np.all(np.isnan(bla.var_noise))
    assert np.all(np.isnan(bla.levels.noise_odd))
    np.testing.assert_array_equal(bla.var_total, bla.var_distortion)
    assert np.all(np.isfinite(bla.bound()))


def seven_noisy_realisations():
    """A cubic, noise on both sides, two periods each."""
    rng = np.random.default_rng(5)
    M, P = 7, 2
    ms = multisine(fs=FS, n_samples=N, f_min=1, f_max=300, n_realizations=M, rng=rng)
    u = np.repeat(ms.u[:, None, :], P, axis=1) + 0.01 * rng.standard_normal((M, P, N))
    y = u**3 + 0.01 * rng.standard_normal((M, P, N))
    return ms, u, y, identify(Record(u=u, y=y, fs=FS, lines=ms.lines), transient="none")


def test_robust_method_equals_formulas_written_independently():
    ms, u, y, bla = seven_noisy_realisations()
    M, P = u.shape[:2]
    k = ms.lines.excited
    each, noise = [], np.zeros(k.size)
    for m in range(M):
        U, Y = (np.array([np.fft.rfft(x[m, p])[k] for p in range(P)]) for x in (u, y))
        Um, Ym = U.sum(0) / P, Y.sum(0) / P
        G = Ym / Um
        each.append(G)
        vU = sum(abs(U[p] - Um) ** 2 for p in range(P)) / (P - 1) / P
        vY = sum(abs(Y[p] - Ym) ** 2 for p in range(P)) / (P - 1) / P
        cYU = sum((Y[p] - Ym) * (U[p] - Um).conj() for p in range(P)) / (P - 1) / P
        noise += abs(G) ** 2 * (
            vY / abs(Ym) ** 2 + vU / abs(Um) ** 2 - 2 * (cYU / (Ym * Um.conj())).real
        )
    G = sum(each) / M
    total = sum(abs(g - G) ** 2 for g in each) / (M * (M - 1))
    np.testing.assert_allclose(bla.G, G, rtol=1e-12)
    np.testing.assert_allclose(bla.var_noise, noise / M**2, rtol=1e-10)
    np.testing.assert_allclose(bla.var_total, total, rtol=1e-12)
    np.testing.assert_allclose(
        bla.var_distortion, M * np.maximum(total - noise / M**2, 0), rtol=1e-10
    )


def test_robust_method_equals_the_package_best_linear_approximation():
    package = pytest.importorskip(
        "best_linear_approximation", reason="needs best-linear-approximation (Python 3.12)"
    )
    ms, u, y, bla = seven_noisy_realisations()
    columns = [np.moveaxis(x, 2, 0)[:, None] for x in (u, y)]  # samples, channels, M, P
    theirs = package.robust.noisy_input(
        *columns, fs=FS, excited_bins=ms.lines.excited, show_warnings=False
    ).G
    np.testing.assert_allclose(bla.G, theirs.value.squeeze(), rtol=1e-12)
    np.testing.assert_allclose(bla.var_noise, theirs.noise.var.squeeze(), rtol=1e-12)
    np.testing.assert_allclose(bla.var_total, theirs.total.var.squeeze(), rtol=1e-12)


def test_a_reference_removes_the_bias_of_a_noisy_input():
    rng = np.random.default_rng(6)
    M, P = 6, 4
    ms = multisine(fs=FS, n_samples=N, f_min=1, f_max=300, n_realizations=M, rng=rng)
    r = np.repeat(ms.u[:, None, :], P, axis=1)
    u = r + 3.0 * rng.standard_normal(r.shape)
    y = 2 * r
    with_r = identify(Record(u=u, y=y, r=r, fs=FS, lines=ms.lines))
    assert with_r.G.shape == with_r.bound().shape
    inside = np.mean(np.abs(with_r.G - 2) < with_r.bound())
    assert inside > 0.9


def test_the_systematic_part_of_a_cubic_is_told_within_its_order_of_magnitude():
    """For y = u^3 on a special-odd grid exactly 6.0 to 9.0 dB over the detection level, 7.7 on
    average; told as 8.
    """
    ms = multisine(fs=FS, n_samples=N, f_min=1, f_max=300, n_realizations=60, rng=7)
    blas = [
        identify(Record(u=u[None, None], y=u[None, None] ** 3, fs=FS, lines=ms.lines)) for u in ms.u
    ]
    told = np.sqrt(np.mean([bla.systematic() ** 2 for bla in blas], axis=0))
    # the linear part of u^3 is nothing
    true = 3 * np.sum(ms.amplitude**2) / 2 - 0.75 * ms.amplitude**2
    wrong = 20 * np.log10(true / told)
    assert abs(np.mean(wrong) - (7.7 - 8)) < 0.5
    assert -2.0 - 0.8 < wrong.min() < wrong.max() < 1.0 + 0.8
    np.testing.assert_allclose(blas[0].systematic(20) / blas[0].systematic(0), 10)


# Invariances


def test_scaling_the_input_scales_the_frf_and_a_shift_changes_no_variance():
    record = record_of(lambda u: u + 0.2 * u**3, n_periods=2, noise=0.01)
    bla = identify(record)
    scaled = identify(Record(u=4 * record.u, y=record.y, fs=FS, lines=record.lines))
    np.testing.assert_allclose(scaled.G, bla.G / 4, rtol=1e-12)
    np.testing.assert_allclose(scaled.bound(), bla.bound() / 4, rtol=1e-9)
    shifted = identify(
        Record(
            u=np.roll(record.u, 100, axis=2),
            y=np.roll(record.y, 100, axis=2),
            fs=FS,
            lines=record.lines,
        )
    )
    np.testing.assert_allclose(shifted.bound(), bla.bound(), rtol=1e-6)
    np.testing.assert_allclose(shifted.var_noise, bla.var_noise, rtol=1e-6)


# Transients


def resonant(zeta, f_n, n_periods, kind="special-odd", noise=0.0):
    """A lightly damped mode from rest, sampled exactly, and its frequency response."""
    rng = np.random.default_rng(3)
    ms = multisine(kind, fs=FS, n_samples=N, f_min=2, f_max=200, rng=rng)
    w = 2 * np.pi * f_n
    discrete = signal.cont2discrete(([w**2], [1, 2 * zeta * w, w**2]), 1 / FS)
    b, a = np.squeeze(discrete[0]), discrete[1]
    u = np.tile(ms.u[0], n_periods)
    y = signal.lfilter(b, a, u) + noise * rng.standard_normal(u.size)
    shape = (1, n_periods, N)
    return Record(u=u.reshape(shape), y=y.reshape(shape), fs=FS, lines=ms.lines), signal.freqz(
        b, a, ms.lines.excited * 2 * np.pi / N
    )[1]


def frf_error(bla, G):
    return np.max(np.abs(bla.G - G) / np.abs(G))


def test_local_rational_fit_takes_the_transient_off():
    record, G = resonant(0.002, 50.3, 2)
    assert frf_error(identify(record, transient="none"), G) > 0.05
    bla = identify(record)
    assert bla.experiment.transient == "local"
    assert frf_error(bla, G) < 1e-6
    # at detection lines too: there leakage would read as distortion
    assert level(bla.levels.odd) < 1e-5 * level(bla.levels.excited)
    assert level(identify(record, transient="none").levels.odd) > 1e-3 * level(bla.levels.excited)


def test_a_transient_that_dies_within_a_period_is_discarded():
    record, G = resonant(0.08, 50.3, 4, noise=1e-4)
    bla = identify(record)
    assert bla.experiment.transient == "discard"
    assert bla.experiment.n_periods == 3
    assert frf_error(bla, G) < 5e-3
    assert frf_error(identify(record, transient="none"), G) > 2e-2


@pytest.mark.parametrize("n_periods", [2, 5])
def test_local_fits_read_white_noise_as_it_is(n_periods):
    """A denominator that is fitted to noise halves what is left: it is only let in where it does
    far better.
    """
    sigma, n = 0.05, 40
    bla = identify(
        record_of(lambda u: 2 * u, n_periods=n_periods, noise=sigma, n_realizations=n),
        transient="local",
    )
    amplitude = np.abs(bla.levels.excited[0]) / 2
    # the transient that is taken off adds its own
    at_least = 4 * sigma**2 / N / n_periods / n / amplitude**2
    added = np.mean(bla.var_noise / at_least)
    assert 0.97 < added < 1.7
    true = bla.var_total  # scatter of the same FRF over the realisations, with no distortion in it
    assert abs(np.mean(bla.var_noise) / np.mean(true) - 1) < 0.06


@pytest.mark.parametrize("n", [4, 5, 7, 8])
def test_local_fits_on_the_shortest_periods(n):
    phase = np.random.default_rng(n).uniform(0, 2 * np.pi, (7, 1, 1))
    u = np.cos(2 * np.pi * np.arange(n) / n + np.tile(phase, (1, 2, 1)))
    bla = identify(Record(u=u, y=2 * u, fs=1, lines=LineGrid(excited=[1])), transient="local")
    np.testing.assert_allclose(bla.G, 2.0)


@pytest.mark.parametrize("noise", [0.0, 0.01])
def test_a_drift_is_seen_though_its_periods_agree_and_is_taken_off(noise):
    """A ramp leaks onto the lines of every period alike: only the means of the periods tell
    of it.
    """
    record = record_of(lambda u: 2 * u, n_periods=3, noise=noise)
    ramp = 10 * np.arange(record.u.size).reshape(record.u.shape) / N
    drifting = Record(u=record.u, y=record.y + ramp, fs=FS, lines=record.lines)
    assert np.abs(identify(drifting, transient="none").G - 2).max() > 5
    bla = identify(drifting)
    assert bla.experiment.transient == "local"
    assert np.abs(bla.G - 2).max() < 1e-6 + 2 * noise
    shifted = Record(u=record.u, y=record.y + 1e6, fs=FS, lines=record.lines)
    assert identify(shifted).experiment.transient == "none"


def test_steady_records_are_left_alone():
    for seed in range(20):
        assert (
            identify(
                record_of(lambda u: u, n_periods=2, noise=0.01, seed=seed)
            ).experiment.transient
            == "none"
        )


# Grids without usable detection lines


@pytest.mark.parametrize("kind", ["odd-odd", "odd", "full"])
def test_any_grid_yields_a_labelled_bound(kind):
    record = record_of(lambda u: u + 0.05 * u**3, kind)
    with pytest.warns(DataWarning, match="roughness"):
        bla = identify(record)
    assert bla.experiment.grid == kind
    assert bla.level_source == "roughness"
    assert np.all(np.isfinite(bla.bound()))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert identify(record, level_from="roughness").level_source == "roughness"


@pytest.mark.parametrize("kind", ["odd-odd", "full"])
def test_roughness_knows_noise_that_does_not_follow_a_resonance(kind):
    # a linear plant: all the roughness is white output noise, whose share of G differs widely
    # across the peak
    inside, widths = [], []
    for seed in range(40):
        record, G = resonant(0.02, 50.3, 1, kind)
        rng = np.random.default_rng(seed)
        spectrum = np.zeros(N // 2 + 1, dtype=complex)
        spectrum[record.lines.excited] = np.fft.rfft(record.u[0, 0])[record.lines.excited] * G
        y = np.fft.irfft(spectrum, N)
        sigma = 0.1 * np.std(y)
        noisy = y + sigma * rng.standard_normal((1, 2, N))
        u = np.repeat(record.u, 2, axis=1)
        bla = identify(
            Record(u=u, y=noisy, fs=FS, lines=record.lines),
            level_from="roughness",
            transient="none",
        )
        near = np.abs(bla.f - 50.3) < 6
        inside.append(np.mean((np.abs(bla.G - G) < bla.bound())[near]))
        true = 1.731 * sigma * np.sqrt(4 / N / 2) / (np.abs(bla.levels.excited[0]) / np.abs(bla.G))
        widths.append(np.median((bla.bound() / true)[near]))
    assert 0.92 < np.mean(inside) <= 1
    assert 0.9 < np.median(widths) < 1.6


def test_roughness_reads_no_less_at_the_ends_of_the_band():
    """There the windows are one-sided: a denominator fitted to them follows the scatter it is to
    measure.
    """
    errors, told, inside = [], [], []
    for seed in range(150):
        bla = identify(
            record_of(lambda u: u + 0.1 * u**3, "full", f_max=100, seed=seed),
            level_from="roughness",
        )
        ends = [0, 1, 2, -3, -2, -1]
        true = 1 + 0.1 * (3 - 0.75 * 2 / 100)  # rms 1 on 100 lines
        errors.append(np.abs(bla.G - true)[ends] ** 2)
        told.append(bla.var_total[ends])
        inside.append(errors[-1] < bla.bound()[ends] ** 2)
    assert 0.8 < np.mean(told) / np.mean(errors) < 1.2
    assert np.mean(inside) > 0.9


def test_roughness_follows_a_resonance_a_few_lines_wide():
    # one mode and no distortion: all the roughness there is comes from the bend of the FRF
    record, G = resonant(0.01, 50.3, 1, "full")
    n = record.n_samples
    y = np.fft.irfft(
        np.fft.rfft(record.u[0, 0]) * np.interp(np.arange(n // 2 + 1), record.lines.excited, G), n
    )
    bla = identify(
        Record(u=record.u, y=y.reshape(1, 1, n), fs=FS, lines=record.lines), level_from="roughness"
    )
    assert np.max(bla.bound() / np.abs(bla.G)) < 0.05


def test_detection_lines_may_lie_beyond_the_excited_band():
    record = record_of(lambda u: u + 0.1 * u**3, f_max=100)
    grid = record.lines
    more = LineGrid(excited=grid.excited, odd=np.append(grid.odd, [101, 103, 109]), even=grid.even)
    bla = identify(Record(u=record.u, y=record.y, fs=FS, lines=more))
    Y = 2 / N * np.fft.rfft(record.y[0, 0])
    np.testing.assert_allclose(bla.levels.odd[0, -3:], Y[[101, 103, 109]])
    middle = bla.f < 60
    np.testing.assert_allclose(bla.var_total[middle], identify(record).var_total[middle], rtol=1e-9)


# Refusals


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (
            dict(transient="maybe"),
            r"transient must be one of 'auto', 'none', 'discard', 'local', got 'maybe'",
        ),
        (
            dict(level_from="even"),
            r"level_from must be one of 'auto', 'detection', 'roughness', got 'even'",
        ),
        (dict(n_detection=2), r"n_detection must be a whole number of at least 3, got 2"),
        (
            dict(n_detection=1000),
            r"lines must hold at least n_detection = 1000 odd detection lines .* got 74",
        ),
        (
            dict(transient="local"),
            r"transient=\"local\" must have at least 2 periods to work on, got 1",
        ),
        (
            dict(transient="discard"),
            r"transient=\"discard\" must have at least 2 periods to work on, got 1",
        ),
    ],
)
def test_refusals(arguments, message):
    if "n_detection" in arguments:
        arguments = arguments | {"level_from": "detection"}
    with pytest.raises(ValueError, match=message):
        identify(record_of(lambda u: u**3), **arguments)


def test_no_detection_lines_to_read_from():
    with pytest.raises(
        ValueError, match=r"at least n_detection = 6 odd detection lines .* got 0 on this odd grid"
    ):
        identify(record_of(lambda u: u**3, "odd"), level_from="detection")


def test_a_grid_too_narrow_for_any_level():
    with (
        pytest.raises(ValueError, match="at least 5 excited lines for the roughness, got 4"),
        pytest.warns(DataWarning),
    ):
        identify(record_of(lambda u: u**3, f_max=12))


def test_lines_without_input_are_refused():
    record = record_of(lambda u: u)
    grid = multisine(fs=FS, n_samples=N, f_min=1, f_max=400, rng=0).lines
    with pytest.raises(
        ValueError, match="lines must be excited by the input, got line 305 with no input on it"
    ):
        identify(Record(u=record.u, y=record.y, fs=FS, lines=grid))


def test_lines_without_reference_are_refused():
    record = record_of(lambda u: u + 0.1 * u**3, n_realizations=3)
    R = np.fft.rfft(record.u)
    R[..., 11] = 0.0
    without = Record(u=record.u, y=record.y, r=np.fft.irfft(R, N), fs=FS, lines=record.lines)
    with pytest.raises(
        ValueError,
        match="lines must be excited by the reference, got line 11 with no reference on it",
    ):
        identify(without)


def test_bound_refusals():
    bla = identify(record_of(lambda u: u**3))
    for confidence in (0, 1, 1.5, -0.1):
        with pytest.raises(ValueError, match="confidence must lie strictly between 0 and 1"):
            bla.bound(confidence)
    with pytest.raises(ValueError, match="of must be one of 'bla', 'realization'"):
        bla.bound(of="both")


def test_realisations_of_another_level_are_refused():
    record = record_of(lambda u: u**3, n_realizations=4)
    u = record.u.copy()
    u[2] *= 2
    with pytest.raises(
        ValueError,
        match=r"same amplitude spectrum in every realisation, got realisation 2 up to 6.0 dB",
    ):
        identify(Record(u=u, y=record.y, fs=FS, lines=record.lines))


# Under the noise


def test_what_is_printed_tells_noise_from_distortion():
    one = str(identify(record_of(lambda u: u + 0.1 * u**3, noise=0.01)))
    assert "distortion and noise of one realisation" in one
    assert "even distortion and noise" in unwrapped(one)
    linear = identify(record_of(lambda u: u, n_periods=8, noise=0.01, n_realizations=7))
    said = dict(re.findall(r"(noise|even distortion) (-\d+) dB", str(linear)))
    assert int(said.get("even distortion", -100)) < int(said["noise"]) - 3


def test_levels_under_the_noise_are_called_upper_limits():
    quiet = identify(record_of(lambda u: u + 1e-6 * u**3, n_periods=8, noise=0.01))
    assert quiet.upper_limit.mean() > 0.9
    assert "upper limit" in unwrapped(quiet)
    loud = identify(record_of(lambda u: u + 0.1 * u**3, n_periods=8, noise=0.01))
    assert not loud.upper_limit.any()


# A second opinion


def test_second_opinion_agrees_on_a_cubic_and_says_so():
    opinion = second_opinion(record_of(lambda u: u + 0.1 * u**3))
    assert not opinion.disagree.any()
    assert "they differ by less than 6 dB on every line" in unwrapped(opinion)


def test_second_opinion_finds_a_disturbance_on_detection_lines():
    record = record_of(lambda u: u + 0.02 * u**3)
    t = np.arange(N) / FS
    hum = sum(
        0.1 * np.cos(2 * np.pi * k * t + k)
        for k in record.lines.odd[(record.lines.odd > 90) & (record.lines.odd < 130)]
    )
    opinion = second_opinion(Record(u=record.u, y=record.y + hum, fs=FS, lines=record.lines))
    f = opinion.f[opinion.disagree]
    assert f.size
    assert np.all((f > 60) & (f < 160))
    assert "a disturbance" in unwrapped(opinion)


def test_second_opinion_without_detection_lines():
    opinion = second_opinion(record_of(lambda u: u + 0.1 * u**3, "odd"))
    assert np.isnan(opinion.difference).all()
    assert "too few odd detection lines" in unwrapped(opinion)


# Noise excitation


def test_noise_and_multisine_of_one_spectrum_give_the_same_bla():
    rng = np.random.default_rng(8)
    u = rng.standard_normal(60_000)
    bla = identify_noise(u, np.tanh(u), fs=1.0, n_samples=600, f_min=0.01, f_max=0.45)
    assert abs(np.mean(bla.G) - 0.6057055096) < 4 * np.sqrt(np.mean(bla.var_total) / bla.f.size)
    assert 0.90 < np.mean(np.abs(bla.G - 0.6057055096) < bla.bound()) < 0.99
    assert np.isnan(bla.var_noise).all()
    assert bla.experiment.grid == "noise"


def test_uniform_noise_gives_another_bla():
    rng = np.random.default_rng(9)
    u = rng.uniform(-np.sqrt(3), np.sqrt(3), 60_000)
    bla = identify_noise(u, u**3, fs=1.0, n_samples=600, f_min=0.01, f_max=0.45)
    # E[u f(u)] = E[u^4] = 9/5, against 3 for a Gaussian of the same power
    assert abs(np.mean(bla.G) - 1.8) < 0.05


def test_noise_records_are_refused_by_name():
    u = np.random.default_rng(0).standard_normal(1000)
    good = dict(fs=1.0, n_samples=100, f_min=0.05, f_max=0.4)
    with pytest.raises(
        ValueError, match="u must hold at least 1200 samples, twice n_samples, got 1000"
    ):
        identify_noise(u, u, **good | {"n_samples": 600})
    with pytest.raises(ValueError, match="y must be as long as u, 1000 samples, got 999"):
        identify_noise(u, u[1:], **good)
    with pytest.raises(ValueError, match="f_max must lie below the Nyquist frequency"):
        identify_noise(u, u, **good | {"f_max": 0.6})


# Few lines


@pytest.mark.parametrize("n_lines", [5, 6, 7, 8, 9, 10, 11])
@pytest.mark.parametrize("step", [1, 2, 4])
def test_any_number_of_lines_that_a_roughness_needs(n_lines, step):
    """Exactly eight once ended in an IndexError: their windows are all the same, and none is
    centred.
    """
    excited = 1 + step * np.arange(n_lines)
    ms = multisine("custom", fs=FS, n_samples=N, f_min=1, f_max=300, lines=excited, rng=0)
    u = ms.u[None]
    bla = identify(Record(u=u, y=u + 0.1 * u**3, fs=FS, lines=ms.lines), level_from="roughness")
    assert np.all(np.isfinite(bla.bound()))
    assert np.all(
        np.isfinite(second_opinion(Record(u=u, y=u + 0.1 * u**3, fs=FS, lines=ms.lines)).roughness)
    )
