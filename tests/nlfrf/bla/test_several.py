"""From a record of several channels to its `Bla`: linear systems exactly, covariances by
statistics, every warning.
"""

import warnings

import numpy as np
import pytest

import nlfrf
from tests.support.printed import unwrapped

BAND = {"fs": 512, "n_samples": 512, "f_min": 1, "f_max": 200}
G0 = np.array([[1.0, 0.3, -0.2], [-0.5, 2.0, 0.4]])


def covariance(frm):
    """(n_y n_u, n_y n_u, F) covariance of vec G, columns stacked: conj(gamma) kron the one behind
    the bound.
    """
    n = frm.n_inputs * frm.n_outputs
    return np.einsum("abk,cdk->acbdk", frm.cov.gamma.conj(), frm.cov.bound).reshape(n, n, -1)


def linear(ms, n_periods=2, noise=0.0, rng=0, G=G0):
    rng = np.random.default_rng(rng)
    u = np.repeat(ms.u[:, :, None], n_periods, axis=2)
    y = np.einsum("ji,imps->jmps", G[:, : ms.n_inputs], u)
    return nlfrf.Record(u=u, y=y + noise * rng.standard_normal(y.shape), fs=ms.fs, lines=ms.lines)


@pytest.mark.parametrize("n_inputs", [1, 2, 3])
@pytest.mark.parametrize("R", [1, 2])
def test_a_linear_system_without_noise_is_exact(n_inputs, R):
    ms = nlfrf.multisine(**BAND, n_inputs=n_inputs, n_realizations=R, rng=1)
    if n_inputs == 1:
        u = np.repeat(ms.u[None, :, None], 2, axis=2)
        record = nlfrf.Record(u=u, y=G0[:, :1, None, None] * u, fs=512, lines=ms.lines)
    else:
        record = linear(ms)
    frm = nlfrf.identify(record)
    assert np.abs(frm.G - G0[:, :n_inputs, None]).max() < 1e-12
    assert (frm.experiment.n_realizations, frm.experiment.n_experiments) == (R, R * n_inputs)


def test_turned_and_permuted_experiments_and_mixed_inputs_say_the_same():
    mixing = np.array([[1.0, 1.0], [1.0, -1.0]])
    ms = nlfrf.multisine(**BAND, n_inputs=2, mixing=mixing, rng=2)
    record = linear(ms)
    assert np.abs(nlfrf.identify(record).G - G0[:, :2, None]).max() < 1e-12
    turned = nlfrf.Record(u=-record.u[:, ::-1], y=-record.y[:, ::-1], fs=512, lines=ms.lines)
    np.testing.assert_allclose(nlfrf.identify(turned).G, nlfrf.identify(record).G, atol=1e-12)


def test_one_experiment_has_one_answer_with_or_without_an_axis_of_channels():
    ms = nlfrf.multisine("random-odd", **BAND, n_realizations=3, rng=3)
    rng = np.random.default_rng(1)
    u = np.repeat(ms.u[:, None], 3, axis=1)
    y = u + 0.1 * u**3 + 0.01 * rng.standard_normal(u.shape)
    bla = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines))
    for a, b in ((u[None], y[None]), (u, y[None]), (u[None], y)):
        same = nlfrf.identify(nlfrf.Record(u=a, y=b, fs=512, lines=ms.lines))
        np.testing.assert_array_equal(same.G, bla.G)
        np.testing.assert_array_equal(same.bound(), bla.bound())


def test_the_covariance_is_that_of_many_records():
    """conj(gamma) kron C of white noise with known covariance, against the scatter of 150 records,
    entry by entry.
    """
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=2, rms=(1.0, 3.0), rng=4)
    root = np.array([[0.1, 0.0], [0.08, 0.05]])
    rng = np.random.default_rng(2)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    errors, said = [], []
    for _ in range(150):
        y = np.einsum("ji,imps->jmps", G0[:, :2], u) + np.einsum(
            "ij,jmps->imps", root, rng.standard_normal(u.shape)
        )
        frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines), transient="none")
        errors.append((frm.G - G0[:, :2, None]).transpose(1, 0, 2).reshape(4, -1))
        said.append(covariance(frm).mean(axis=2))
    errors = np.array(errors)
    scatter = np.einsum("nak,nbk->ab", errors, errors.conj()) / errors.shape[0] / errors.shape[2]
    said = np.mean(said, axis=0)
    size = np.sqrt(np.outer(np.diag(scatter).real, np.diag(scatter).real))
    assert np.abs(said - scatter).max() < 0.05 * size.max()
    assert np.all(np.abs(said - scatter) / size < 0.08)
    assert np.all(np.abs(np.log(np.diag(said).real / np.diag(scatter).real)) < 0.05)


@pytest.mark.attack(every=3)
@pytest.mark.parametrize(
    ("kind", "R", "n_inputs"), [("random-odd", 1, 2), ("special-odd", 2, 2), ("random-odd", 1, 3)]
)
def test_entries_and_matrices_hold_what_they_say(kind, R, n_inputs):
    """White noise and static cross terms; windows overlap, so the tolerance is that of a smaller
    sample.
    """
    grid = nlfrf.multisine(kind, **BAND, rng=0).lines
    entries, matrices = [], []
    frms = []
    n = 30
    for e in range(n):
        ms = nlfrf.multisine(
            "custom", lines=grid, **BAND, n_inputs=n_inputs, n_realizations=R, rng=e
        )
        record = linear(ms, noise=0.02, rng=e)
        u = record.u
        cross = np.stack([0.1 * u[0] ** 3 + 0.1 * u[0] * u[1] ** 2, 0.1 * u[1] ** 2 * u[-1]])
        frms.append(
            nlfrf.identify(
                nlfrf.Record(u=u, y=record.y + cross, fs=512, lines=grid), transient="none"
            )
        )
    truth = np.mean([frm.G for frm in frms], axis=0)
    for frm in frms:
        d = (frm.G - truth) * n / (n - 1)
        entries.append(np.mean(np.abs(d) < frm.bound()))
        left, right = (np.moveaxis(side, 2, 0) for side in frm.block())
        Z = np.linalg.solve(left, np.moveaxis(d, 2, 0)) @ np.linalg.inv(right)
        matrices.append(np.mean(np.linalg.norm(Z, 2, (1, 2)) < 1))
    assert 0.93 < np.mean(entries) < 0.99
    assert 0.92 < np.mean(matrices) < 0.995


def test_a_loop_by_reference_has_a_full_gamma_and_no_bias():
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=2, n_realizations=2, rng=5)
    rng = np.random.default_rng(3)
    r = np.repeat(ms.u[:, :, None], 4, axis=2)
    K = np.array([[0.8, 0.6], [-0.4, 0.5]])
    n = 0.05 * rng.standard_normal(r.shape)
    # u = r - K (G u + n): static, so the loop closes sample by sample
    G = G0[:, :2]
    u = np.einsum(
        "ij,jmps->imps", np.linalg.inv(np.eye(2) + K @ G), r - np.einsum("ij,jmps->imps", K, n)
    )
    y = np.einsum("ij,jmps->imps", G, u) + n
    frm = nlfrf.identify(nlfrf.Record(u=u, y=y, r=r, fs=512, lines=ms.lines), transient="none")
    inside = np.abs(frm.G - G[:, :, None]) < frm.bound()
    assert inside.mean() > 0.92
    off = np.abs(frm.cov.gamma[0, 1]) / np.sqrt(frm.cov.gamma[0, 0].real * frm.cov.gamma[1, 1].real)
    assert np.median(off) > 0.1
    # noise that is fed back correlates u with n: without the reference G is off by many sigmas
    biased = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines), transient="none")
    assert (
        np.abs((frm.G - G[:, :, None]).mean(axis=2)).max()
        < np.abs((biased.G - G[:, :, None]).mean(axis=2)).max()
    )


def test_a_transient_is_taken_off():
    from scipy.signal import lfilter

    ms = nlfrf.multisine(**BAND, n_inputs=2, rng=6)
    u = np.repeat(ms.u[:, :, None], 3, axis=2)
    stream = u.reshape(2, 2, -1)
    b, a = [0.02], [1, -1.9, 0.95]
    y = lfilter(b, a, stream[0] + 0.5 * stream[1])[None].reshape(1, *u.shape[1:])
    record = nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines)
    z = np.exp(-2j * np.pi * ms.f / 512)
    G = b[0] / np.polyval(a[::-1], z) * np.array([1.0, 0.5])[:, None]
    raw, cured = (
        np.abs(nlfrf.identify(record, transient=how).G[0] - G).max() for how in ("none", "local")
    )
    assert cured < 1e-4 * np.abs(G).max()
    assert cured < 1e-2 * raw


def test_inputs_of_other_spectra_are_told_apart_as_well(recwarn):
    """Of f and 1/f the ratio over all lines was taken for a condition, 18, though each line is
    orthogonal.
    """
    ms = nlfrf.multisine(
        "random-odd", **BAND, n_inputs=2, rng=7, amplitude=lambda f: np.stack([f / 50, 50 / f])
    )  # fmt: skip
    nlfrf.identify(linear(ms, noise=1e-3))
    assert not [one for one in recwarn if "badly" in str(one.message)]


def test_warnings_and_refusals():
    ms = nlfrf.multisine(**BAND, n_inputs=2, rng=7)
    record = linear(ms)
    with pytest.warns(
        nlfrf.DataWarning, match="one period does not separate noise from distortion"
    ):
        nlfrf.identify(linear(ms, n_periods=1))
    few = nlfrf.Record(u=record.u[:, :1], y=record.y[:, :1], fs=512, lines=ms.lines)
    with pytest.raises(ValueError, match="record must hold 2 experiments for its 2 inputs"):
        nlfrf.identify(few)
    same = nlfrf.Record(u=record.u[:, [0, 0]], y=record.y[:, [0, 0]], fs=512, lines=ms.lines)
    with pytest.raises(
        ValueError,
        match=r"u must hold experiments that separate the inputs, got a condition number of",
    ):
        nlfrf.identify(same)
    near, answer = record.u.copy(), record.y.copy()
    for signal in (near, answer):
        signal[:, 1] = signal[:, 0] + 0.05 * signal[:, 1]
    with pytest.warns(
        nlfrf.DataWarning,
        match="the experiments separate the inputs badly: the condition number is",
    ):
        nlfrf.identify(nlfrf.Record(u=near, y=answer, fs=512, lines=ms.lines))
    silent = nlfrf.signals.LineGrid(
        excited=np.append(ms.lines.excited, 253), odd=ms.lines.odd, even=ms.lines.even
    )
    with pytest.raises(
        ValueError,
        match="lines must be excited by every input, got line 253 with no input on it in u1",
    ):
        nlfrf.identify(nlfrf.Record(u=record.u, y=record.y, fs=512, lines=silent))
    full = nlfrf.multisine("full", **BAND, n_inputs=2, rng=8)
    with pytest.warns(
        nlfrf.DataWarning,
        match="the full grid of this record has no odd detection lines. So the distortion",
    ):
        assert nlfrf.identify(linear(full, noise=0.01)).level_source == "roughness"
    with pytest.raises(
        ValueError,
        match="lines must hold at least n_detection = 6 odd detection lines for level_from",
    ):
        nlfrf.identify(linear(full), level_from="detection")


def test_experiments_with_the_same_phases_are_counted_once():
    ms = nlfrf.multisine(**BAND, n_inputs=2, rng=9)
    phi = np.random.default_rng(1).uniform(0, 2 * np.pi, (2, 1, ms.f.size))
    signs = np.array([[0, 0], [0, np.pi]])[:, :, None]
    plain = nlfrf.Multisine(
        fs=512,
        n_samples=512,
        kind=ms.kind,
        lines=ms.lines,
        design="orthogonal",
        amplitude=ms.amplitude,
        phase=phi + signs,
    )
    with pytest.warns(nlfrf.DataWarning, match=r"experiments have the same phases \(psi\)"):
        copied = nlfrf.identify(linear(plain))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        own = nlfrf.identify(linear(ms))
    assert 1.5 < np.median(own.dof / copied.dof) < 2.5


def test_the_bounds_of_a_matrix_and_its_entries():
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=2, rng=10)
    frm = nlfrf.identify(linear(ms, noise=0.05))
    np.testing.assert_allclose(
        np.einsum("aak->ak", covariance(frm)).real.reshape(2, 2, -1).transpose(1, 0, 2),
        frm.entries(frm.cov.bound),
    )
    left, right = frm.block()
    box = np.sqrt(np.einsum("jak,jak->jk", left, left.conj()).real)[:, None] * np.sqrt(
        np.einsum("iak,iak->ik", right, right.conj()).real
    )
    assert np.all(box > frm.bound())  # the whole matrix asks for more than one entry
    assert np.all(frm.bound(of="realization") >= frm.bound())
    assert np.all(frm.bound(simultaneous=True) > frm.bound())
    entry = frm.entry(1, 0)
    np.testing.assert_allclose(entry.bound(), frm.bound()[1, 0])
    np.testing.assert_allclose(
        entry.bound(of="realization"), frm.bound(of="realization")[1, 0], rtol=0.02
    )
    assert "y2 by u1" in unwrapped(frm)
    with pytest.raises(ValueError, match="output and input must be below 2 and 2"):
        frm.entry(2, 0)


def test_every_so_many_th_line_is_as_it_was():
    frm = nlfrf.identify(
        linear(nlfrf.multisine("random-odd", **BAND, n_inputs=2, rng=10), noise=0.05)
    )
    some = frm.every(3)
    np.testing.assert_array_equal(some.f, frm.f[::3])
    np.testing.assert_array_equal(some.bound(), frm.bound()[:, :, ::3])
    # the share of distortion is one of nine lines around
    ratio = some.bound(of="realization") / frm.bound(of="realization")[:, :, ::3]
    assert 0.9 < np.median(ratio) < 1.1
    np.testing.assert_array_equal(some.entry(1, 0).levels.excited, frm.levels[1].excited[:, ::3])
    np.testing.assert_array_equal(some.lines.excited * frm.fs / frm.experiment.n_samples, some.f)
    with pytest.raises(ValueError, match="step must be"):
        frm.every(0)


def test_a_zippered_record_gives_the_matrix_from_one_experiment():
    """Noise alone on a smooth plant: entries and matrices hold; what is interpolated is said."""
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=2, design="zippered", rng=11)
    inside = []
    with pytest.warns(nlfrf.DataWarning, match=r"each line excites one input \(zippered\)"):
        clean = nlfrf.identify(linear(ms), transient="none")
    assert (clean.experiment.design, clean.experiment.n_experiments) == ("zippered", 1)
    assert np.abs(clean.G - G0[:, :2, None]).max() < 1e-12
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        frms = [nlfrf.identify(linear(ms, noise=0.05, rng=e), transient="none") for e in range(40)]
        many = nlfrf.identify(
            linear(
                nlfrf.multisine(
                    "random-odd", **BAND, n_inputs=2, design="zippered", n_realizations=3, rng=12
                )
            )
        )
        loop = linear(ms)
        with pytest.raises(ValueError, match="r must be left out for a zippered record"):
            nlfrf.identify(nlfrf.Record(u=loop.u, y=loop.y, r=loop.u, fs=512, lines=ms.lines))
    inside = [np.abs(frm.G - G0[:, :2, None]) < frm.bound() for frm in frms]
    assert 0.93 < np.mean(inside) < 0.998
    assert many.experiment.n_realizations == 3
    assert 2 < np.median(many.dof / clean.dof) < 4


def test_an_experiment_that_was_disturbed_is_named():
    """Ten times the noise in one experiment: the error of the matrix has rank one, and its law does
    not know that.
    """
    ms = nlfrf.multisine(**BAND, n_inputs=3, rng=13)
    record = linear(ms)
    noise = 0.01 * np.random.default_rng(0).standard_normal(record.y.shape)
    alike = nlfrf.Record(u=record.u, y=record.y + noise, fs=512, lines=ms.lines)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        nlfrf.identify(alike, transient="none")
    noise[:, 1] *= 10
    loud = nlfrf.Record(u=record.u, y=record.y + noise, fs=512, lines=ms.lines)
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"experiment 2 of 3 scatters (9\.\d|1[01]\.\d) times as much from period",
    ):
        nlfrf.identify(loud, transient="none")


def test_every_warning_points_at_the_line_that_called():
    """Of whatever depth: one and several inputs, conditions, levels, streams."""
    ms = nlfrf.multisine("full", **BAND, n_inputs=2, rng=14)
    one = nlfrf.multisine("full", **BAND, rng=14)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    near = u.copy()
    near[:, 1] = near[:, 0] + 0.05 * near[:, 1]
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        nlfrf.identify(nlfrf.Record(u=near[:, :, :1], y=u[:, :, :1], fs=512, lines=ms.lines))
        nlfrf.identify(nlfrf.Record(u=one.u[:, None], y=one.u[:, None], fs=512, lines=one.lines))
        stuck = np.tile(one.u, 4).ravel()
        stuck[100:500] = 0.0
        nlfrf.record_from_samples(np.tile(one.u, 4).ravel(), stuck, fs=512, n_samples=512)
    assert len(said) >= 5
    assert {warning.filename for warning in said} == {__file__}


def test_a_mixing_from_a_first_matrix_finds_the_weak_direction():
    """Skogestad & Postlethwaite's distillation column (3.7.2): gains 197 and 1.4; 1 % noise on
    every line.
    """
    G = np.array([[87.8, -86.4], [108.2, -109.6]])
    weak, sizes, into = np.linalg.svd(G)

    def error(mixing, rng):
        """Of the weak gain, relative."""
        ms = nlfrf.multisine("random-odd", **BAND, n_inputs=2, mixing=mixing, rng=rng)
        u = np.repeat(ms.u[:, :, None], 2, axis=2)
        y = np.einsum("ji,imps->jmps", G, u)
        of_line = np.sqrt(512 * 2 / 2 / ms.f.size) * y.std(
            axis=(1, 2, 3)
        )  # behind it, over two periods
        size = 0.01 * of_line[:, None, None, None]
        y = y + size * np.random.default_rng(rng).standard_normal(y.shape)
        frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines), transient="none")
        return np.abs(np.einsum("j,jik,i->k", weak[:, 1], frm.G, into[1]) - sizes[1]) / sizes[1]

    plain = np.concatenate([error(None, rng) for rng in range(4)])
    with pytest.warns(
        nlfrf.DataWarning, match=r"condition number is 142 .* to excite the weak direction"
    ):
        mixed = np.concatenate([error(into.T / sizes, rng) for rng in range(4)])
    assert 0.6 < np.sqrt(np.mean(plain**2)) < 1.0
    assert 0.005 < np.sqrt(np.mean(mixed**2)) < 0.01
    assert 70 < np.sqrt(np.mean(plain**2) / np.mean(mixed**2)) < 140


@pytest.mark.attack
def test_a_zippered_matrix_holds_near_a_resonance_no_wider_than_the_distance_of_its_lines():
    """Noise of 40 and 20 dB on two coupled modes, 28.9 and 49.8 Hz, 1.2 and 1.5 Hz wide; own lines
    1.3 Hz apart.
    """
    fs, n, mix = 1024.0, 4096, np.array([[1.0, 0.15], [-0.1, 1.0]])
    modes = np.array([28.9, 49.8])
    ms = nlfrf.multisine(
        "random-odd",
        fs=fs,
        n_samples=n,
        f_min=2.25,
        f_max=100,
        n_inputs=2,
        design="zippered",
        rng=1,
    )
    s, w = 1j * ms.f, modes[:, None]
    G = np.einsum(
        "ja,ak,ia->jik", mix, 1 / (s**2 + 0.04 * w * s + w**2), np.array([[1.0, 0.3], [-0.2, 1.0]])
    )
    spectrum = np.zeros((2, 1, n // 2 + 1), dtype=complex)
    spectrum[..., ms.lines.excited] = np.einsum("jik,iek->jek", G, ms.spectrum) * n / 2
    y = np.repeat(np.fft.irfft(spectrum, n)[:, :, None], 2, axis=2)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    near = np.abs(ms.f[:, None] - modes).min(axis=1) < 3
    for level in (0.01, 0.1):
        noise = level * y.std(axis=(1, 2, 3), keepdims=True)
        entries, matrices = [], []
        for e in range(30):
            there = y + noise * np.random.default_rng(e).standard_normal(y.shape)
            with pytest.warns(nlfrf.DataWarning, match="each line excites one input"):
                frm = nlfrf.identify(
                    nlfrf.Record(u=u, y=there, fs=fs, lines=ms.lines), transient="none"
                )
            left, right = (np.moveaxis(side, 2, 0) for side in frm.block())
            d = frm.G - G
            Z = np.linalg.solve(left, np.moveaxis(d, 2, 0)) @ np.linalg.inv(right)
            entries.append((np.abs(d) < frm.bound())[..., near].mean())
            matrices.append((np.linalg.norm(Z, 2, (1, 2)) < 1)[near].mean())
        assert 0.92 < np.mean(entries) < 0.995
        assert 0.92 < np.mean(matrices) <= 1


def test_a_zippered_record_without_detection_lines_is_refused():
    ms = nlfrf.multisine("full", **BAND, n_inputs=2, design="zippered", rng=15)
    with (
        pytest.warns(nlfrf.DataWarning),
        pytest.raises(ValueError, match="lines must be random-odd for a zippered record"),
    ):
        nlfrf.identify(linear(ms, noise=0.01))


def test_an_input_lost_in_its_noise_asks_for_references():
    ms = nlfrf.multisine(**BAND, n_inputs=2, n_realizations=6, rng=16)
    clean = linear(ms, noise=0.001)
    rng = np.random.default_rng(0)
    noise = rng.standard_normal(clean.u.shape) * np.sqrt((ms.amplitude[0] ** 2).mean() * 256)
    bias = {}
    for name, more in (("without", {}), ("with", {"r": clean.u})):
        record = nlfrf.Record(u=clean.u + noise, y=clean.y, fs=512, lines=ms.lines, **more)
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always")
            bias[name] = np.abs(
                (nlfrf.identify(record, transient="none").G - G0[:, :2, None]).mean(axis=2)
            ).max()
        assert any("is lost in its noise on" in str(one.message) for one in said) == (
            name == "without"
        )
    assert bias["with"] < 0.3 * bias["without"]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        quiet = nlfrf.Record(u=clean.u + 0.3 * noise, y=clean.y, fs=512, lines=ms.lines)
        nlfrf.identify(quiet, transient="none")


@pytest.mark.parametrize("n_periods", [1, 2])
def test_a_matrix_is_printed_without_a_word_more(n_periods):
    ms = nlfrf.multisine("random-odd", fs=256, n_samples=256, f_min=2, f_max=100, n_inputs=2, rng=1)
    u = np.repeat(ms.u[:, :, None], n_periods, axis=2)
    record = nlfrf.Record(u=u, y=np.stack([u[0] + 0.1 * u[0] ** 3, u[1]]), fs=256, lines=ms.lines)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        frm = nlfrf.identify(record)
    said = unwrapped(str(frm))  # every warning is an error here
    assert ("distortion and noise -" in said) == (n_periods == 1)
    assert ("noise -inf dB, distortion" in said) == (n_periods == 2)


def test_a_list_may_hold_records_of_any_number_of_channels():
    several = linear(nlfrf.multisine(**BAND, n_inputs=2, rng=2))
    one = nlfrf.Record(u=several.u[0], y=2 * several.u[0], fs=512, lines=several.lines)
    found = nlfrf.identify([several, one])
    assert [bla.G.ndim for bla in found] == [3, 1]
    with pytest.raises(ValueError, match="record must be a Record or a list of them"):
        nlfrf.identify([several, "run.csv"])


@pytest.mark.parametrize("kind", ["special-odd", "full"])
@pytest.mark.parametrize(("n_realizations", "n_periods"), [(1, 2), (3, 2), (2, 3), (8, 2)])
@pytest.mark.filterwarnings("ignore:the full grid of this record", "ignore:.* in experiment . of")
def test_an_output_among_others_has_what_it_has_alone(kind, n_realizations, n_periods):
    """One engine: of each output the same matrix, variances, 95 % bound and levels, whatever else
    was recorded.
    """
    ms = nlfrf.multisine(kind, **BAND, n_realizations=n_realizations, rng=17)
    rng = np.random.default_rng(4)
    u = np.repeat(np.reshape(ms.u, (1, n_realizations, 1, -1)), n_periods, axis=2)
    z = np.exp(-2j * np.pi * np.arange(257) / 512)
    x = np.fft.irfft(np.fft.rfft(u) * 0.05 / (1 - 1.6 * z + 0.9 * z**2), 512)
    y = np.concatenate([x + 0.3 * x**3, 100 * (u + 0.1 * u**3)])
    y += 0.01 * y.std(axis=(1, 2, 3), keepdims=True) * rng.standard_normal(y.shape)
    both = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines), transient="none")
    for j in range(2):
        alone = nlfrf.identify(
            nlfrf.Record(u=u[0], y=y[j], fs=512, lines=ms.lines), transient="none"
        )
        for name in ("G", "var_noise", "var_total", "var_even"):
            np.testing.assert_allclose(
                getattr(both, name)[j, 0], getattr(alone, name), rtol=1e-9, err_msg=name
            )
        for of in ("bla", "realization"):
            np.testing.assert_allclose(
                both.bound(of=of)[j, 0], alone.bound(of=of), rtol=1e-9 if of == "bla" else 0.02
            )
        np.testing.assert_allclose(both.levels[j].odd, alone.levels.odd, rtol=1e-9, atol=1e-15)


def test_a_second_opinion_is_of_one_input_and_one_output():
    with pytest.raises(
        ValueError,
        match=(
            "record must have one input and one output, got 2 and 2: for several channels identify"
        ),
    ):
        nlfrf.second_opinion(linear(nlfrf.multisine(**BAND, n_inputs=2, rng=2), G=G0[:, :2]))
