"""FRFs from elsewhere: what their bounds hold, by standard deviation and by coherence, and what is
refused.
"""

import numpy as np
import pytest
from scipy import signal

import nlfrf
from tests.support.printed import unwrapped

F = np.geomspace(1, 100, 30)
G = 1 / (1 + 0.1j * F)
CONFIDENCE, RECORDS = 0.95, 2000


def complex_normal(rng, *shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


def in_sigmas(held, p=CONFIDENCE):
    """How far a share is from p, in standard deviations of so many independent trials."""
    return (np.mean(held) - p) * np.sqrt(held.size / (p * (1 - p)))


def averaged_frf(rng, n, rms_noise, n_lines=RECORDS):
    """G = S_yu / S_uu and the coherence of n independent averages, on lines where G is 2."""
    U, N = complex_normal(rng, n, n_lines), rms_noise * complex_normal(rng, n, n_lines)
    Y = 2 * U + N
    S_uu, S_yy, S_yu = (np.mean(x, axis=0) for x in (np.abs(U) ** 2, np.abs(Y) ** 2, Y * U.conj()))
    return S_yu / S_uu, np.abs(S_yu) ** 2 / (S_uu * S_yy)


@pytest.mark.parametrize("of", ["bla", "realization"])
def test_a_known_standard_deviation_holds_what_it_says(of):
    rng, std = np.random.default_rng(1), 0.1 * np.abs(G)
    held = []
    for _ in range(300):
        bla = nlfrf.bla_from_frf(F, G + std * complex_normal(rng, F.size), std=std)
        target = G if of == "bla" else G + std * complex_normal(rng, F.size)
        held.append(np.abs(bla.G - target) < bla.bound(of=of))
    assert abs(in_sigmas(np.array(held))) < 4


@pytest.mark.parametrize("n", [3, 8])
def test_an_estimated_standard_deviation_has_its_degrees_of_freedom(n):
    rng = np.random.default_rng(2)
    each = 1.0 + complex_normal(rng, n, RECORDS)
    std = np.std(each, axis=0, ddof=1) / np.sqrt(n)
    bla = nlfrf.bla_from_frf(np.arange(1.0, RECORDS + 1), each.mean(axis=0), std=std, n_averages=n)
    assert abs(in_sigmas(np.abs(bla.G - 1) < bla.bound())) < 4
    taken_for_known = nlfrf.bla_from_frf(bla.f, bla.G, std=std)
    assert in_sigmas(np.abs(bla.G - 1) < taken_for_known.bound()) < -4


@pytest.mark.parametrize("n", [2, 4, 20])
@pytest.mark.parametrize("rms_noise", [0.1, 2.0])
def test_a_coherence_holds_what_it_says(n, rms_noise):
    """Exactly, from two averages on: F(2, 2 n - 2)."""
    rng = np.random.default_rng([n, int(10 * rms_noise)])
    measured, coherence = averaged_frf(rng, n, rms_noise)
    bla = nlfrf.bla_from_frf(
        np.arange(1.0, RECORDS + 1), measured, coherence=coherence, n_averages=n
    )
    assert abs(in_sigmas(np.abs(bla.G - 2) < bla.bound())) < 4


def test_the_bound_of_welch_and_its_coherence_holds_the_truth():
    inside = []
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = rng.standard_normal(40_000)
        y = signal.lfilter([0.5, 0.3], [1, -0.2], u) + 0.3 * rng.standard_normal(u.size)
        f, S_uu = signal.welch(u, 1.0, nperseg=400, detrend=False)
        S_yu = signal.csd(u, y, 1.0, nperseg=400, detrend=False)[1]
        coherence = signal.coherence(u, y, 1.0, nperseg=400, detrend=False)[1]
        some = slice(20, 180)
        bla = nlfrf.bla_from_frf(
            f[some], (S_yu / S_uu)[some], coherence=coherence[some], n_averages=0.947 * 199
        )
        true = signal.freqz([0.5, 0.3], [1, -0.2], 2 * np.pi * bla.f)[1]
        inside.append(np.mean(np.abs(bla.G - true) < bla.bound()))
    assert np.mean(inside) == pytest.approx(0.95, abs=0.015)


def test_several_channels_hold_every_entry_and_the_whole_matrix():
    rng = np.random.default_rng(4)
    of_output, of_input = np.array([0.1, 3.0]), np.array([1.0, 0.2, 2.0])
    std = np.broadcast_to((of_output[:, None] * of_input)[:, :, None], (2, 3, RECORDS))
    error = std * complex_normal(rng, 2, 3, RECORDS)
    frm = nlfrf.bla_from_frf(np.arange(1.0, RECORDS + 1), 1.0 + error, std=std)
    assert np.sqrt(frm.var_total) == pytest.approx(std, rel=1e-9)
    assert abs(in_sigmas(np.abs(error) < frm.bound())) < 4
    left, right = (np.moveaxis(x, 2, 0) for x in frm.block())
    inside = np.linalg.solve(left, np.moveaxis(error, 2, 0)) @ np.linalg.inv(right)
    assert abs(in_sigmas(np.linalg.svd(inside, compute_uv=False)[:, 0] < 1)) < 4
    assert (frm.inputs, frm.outputs) == (("u1", "u2", "u3"), ("y1", "y2"))


def test_deviations_that_are_no_product_are_raised_and_said():
    std = np.array([[1.0, 0.1], [0.2, 2.0]])[:, :, None] * np.ones(5)
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"std of output \d by input \d was increased up to .* times",
    ):
        frm = nlfrf.bla_from_frf(np.arange(1.0, 6), np.ones((2, 2, 5), complex), std=std)
    assert np.all(np.sqrt(frm.var_total) >= std * (1 - 1e-9))
    assert np.min(np.sqrt(frm.var_total) / std, axis=(0, 1)) == pytest.approx(np.ones(5))


@pytest.mark.parametrize("ending", ["npz", "h5"])
def test_it_is_stored_drawn_and_told(ending, tmp_path, ax):
    bla = nlfrf.bla_from_frf(F, G, coherence=0.99, n_averages=20, inputs=["force"], outputs=["way"])
    nlfrf.save(bla, tmp_path / f"bla.{ending}")
    loaded = nlfrf.load(tmp_path / f"bla.{ending}")
    assert np.array_equal(loaded.bound(), bla.bound())
    assert (loaded.u_name, loaded.y_name, loaded.experiment.grid, loaded.level_source) == (
        "force",
        "way",
        "given",
        "coherence",
    )
    assert np.isnan(loaded.fs)
    assert "distortion estimated from coherence, 0.99 in the median" in unwrapped(bla)
    nlfrf.export_csv(bla, tmp_path / "bla.csv")
    nlfrf.plot.plot_bla(bla, ax=ax)
    frm = nlfrf.bla_from_frf(F, G[None, None], std=0.01)
    nlfrf.save(frm, tmp_path / f"frm.{ending}")
    assert np.array_equal(nlfrf.load(tmp_path / f"frm.{ending}").bound(), frm.bound())


def test_a_known_variance_has_the_law_of_a_chi_square():
    assert nlfrf.bla_from_frf(F, G, std=1.0).bound() == pytest.approx(
        np.full(F.size, np.sqrt(-np.log(0.05))), rel=3e-6
    )
    assert nlfrf.bla_from_frf(F, G, std=1.0).dof[0] == 1e6  # as good as known


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            {},
            (
                r"std or coherence must be given, got neither: without a variance the bound has no"
                r" probability"
            ),
        ),
        (dict(std=1.0, coherence=0.9), r"std or coherence must be given, got both"),
        (dict(coherence=0.9), r"n_averages must be given with coherence"),
        (dict(coherence=0.9, n_averages=1), r"n_averages must be at least 2, got 1"),
        (dict(coherence=1.1, n_averages=9), r"coherence must be above 0 and at most 1, got 1\.1"),
        (dict(std=0.0), r"std must be positive on every line, got 0"),
        (
            dict(std=np.ones(4)),
            r"std must be one number or have the shape of G, \(30,\), got \(4,\)",
        ),
        (dict(std=1.0, f=F[::-1]), r"f must be positive and increasing"),
        (dict(std=1.0, G=G[:4]), r"G must have the shape \(30,\) or \(n_y, n_u, 30\)"),
        (dict(std=1.0, G=np.where(F > 3, G, np.nan)), r"G must hold finite complex numbers"),
        (
            dict(std=1.0, G=20 * np.log10(abs(G))),
            r"G must be complex, got real numbers from -20.* to -0\.04.*np\.radians",
        ),
        (
            dict(std=1.0, G=np.abs(G)),
            r"G must be complex, .* which have no phase: .*magnitude \* np\.exp\(1j\*phase\)",
        ),
        (
            dict(std=1.0, G=np.full(F.size, 2)),
            r"G must be complex, .*G \+ 0j for a gain without phase",
        ),
        (
            dict(coherence=1.0, n_averages=9),
            r"coherence must be below 1 on some lines, .*single average.*give std",
        ),
        (dict(std=1.0, hold="zoh"), r"fs must be given if hold is .zoh."),
        (dict(std=object()), r"std must hold real numbers"),
        (dict(std=1.0, outputs=["y", "z"]), r"outputs must be one name, got "),
        (dict(std=1.0, inputs=["a", "b"]), r"inputs must be one name, got "),
    ],
)
def test_refusals(change, message):
    with pytest.raises(ValueError, match=message):
        nlfrf.bla_from_frf(**dict(f=F, G=G) | change)


def test_the_cures_of_real_numbers_give_the_frf():
    cured = 10 ** (20 * np.log10(np.abs(G)) / 20) * np.exp(1j * np.radians(np.degrees(np.angle(G))))
    np.testing.assert_allclose(nlfrf.bla_from_frf(F, cured, std=1.0).G, G, rtol=1e-12)
    assert nlfrf.bla_from_frf(F, np.full(F.size, 2.0) + 0j, std=1.0).G[0] == 2  # a gain: no word


def test_a_complex_type_without_phases_is_warned_of():
    with pytest.warns(
        nlfrf.DataWarning, match="G is real on every line and varies, as if its phase were missing"
    ):
        nlfrf.bla_from_frf(F, 20 * np.log10(np.abs(G)) + 0j, std=1.0)


def test_a_coherence_that_was_rounded_to_one_leaves_a_variance():
    coherence = np.where(F > 30, 0.9, np.where(F > 10, 0.999, 1.0))
    with pytest.warns(
        nlfrf.DataWarning, match=r"coherence of 1 on some lines is rounded.*0\.999 is used"
    ):
        bla = nlfrf.bla_from_frf(F, G, coherence=coherence, n_averages=11)
    np.testing.assert_allclose(bla.var_total[0], 0.001 / 0.999 * np.abs(G[0]) ** 2 / 10)


def test_a_factor_asks_for_the_unit_that_it_makes():
    bla = nlfrf.bla_from_frf(F, G, std=0.01, input_units=["N"], output_units=["m/s2"])
    with pytest.raises(
        ValueError, match=r"output_unit must be given, .*unit of m/s2: output_unit=.m. if"
    ):
        bla.times(-1 / bla.omega**2)
    moved = bla.times(-1 / bla.omega**2, output_unit="m")
    assert moved.unit == "m/N"
    np.testing.assert_allclose(moved.bound(), bla.bound() / bla.omega**2)
    assert bla.times(np.exp(-0.01j * bla.omega)).unit == "m/s2/N"  # a delay
    assert bla.times(2 * np.ones(F.size), output_unit=bla.output_units).unit == "m/s2/N"
    assert nlfrf.bla_from_frf(F, G, std=0.01).times(1 / F).unit == ""


@pytest.mark.filterwarnings("ignore:u must be stationary noise")
def test_a_sweep_is_refused_at_the_ends_of_its_band():
    """At the edge it gave 1.2e4 +- 2 % where 0.05 was true."""
    t = np.arange(40_000)
    u = signal.chirp(t, 0.01, t.size, 0.2)
    y = signal.lfilter(*signal.butter(2, 0.1), u)
    with pytest.raises(
        ValueError,
        match=r"u must have power of its own on every line, got \d+ lines of 177 without.*Hz",
    ):
        nlfrf.identify_noise(u, y, fs=1.0, n_samples=400, f_min=0.01, f_max=0.45)
    bla = nlfrf.identify_noise(u, y, fs=1.0, n_samples=400, f_min=0.02, f_max=0.18)
    true = signal.freqz(*signal.butter(2, 0.1), 2 * np.pi * bla.f)[1]
    assert np.abs(bla.G - true).max() < 0.02


def test_noise_of_any_colour_is_never_refused():
    for seed in range(20):
        rng = np.random.default_rng(seed)
        u = signal.lfilter([1], [1, -rng.uniform(-0.95, 0.98)], rng.standard_normal(900))
        nlfrf.identify_noise(u, u, fs=1.0, n_samples=400, f_min=0.005, f_max=0.495)
