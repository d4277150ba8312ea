"""What is said of a matrix does not depend on the units of its inputs and outputs."""

import numpy as np
import pytest

import nlfrf

FS = N = 512


def narrow(f):
    """One input with a flat spectrum, one whose spectrum is a peak."""
    return np.stack([np.ones_like(f), 1 / (1 + ((f - 100) / 8) ** 2) + 5e-3])


def signals(kind, design, R, reference, amplitude):
    """Inputs, outputs that a cube and a cross term bend, references, lines."""
    ms = nlfrf.multisine(
        kind, fs=FS, n_samples=N, f_min=1, f_max=200, n_inputs=2, n_realizations=R, design=design, rng=3,
        amplitude=amplitude,
    )  # fmt: skip
    rng = np.random.default_rng(0)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    z = np.exp(-2j * np.pi * np.arange(N // 2 + 1) / N)
    x = np.fft.irfft(np.fft.rfft(u) * 0.05 / (1 - 1.6 * z + 0.9 * z**2), N)
    y = np.stack([x[0] + 0.4 * u[1] + 0.1 * u[0] ** 3, 0.3 * x[1] - u[0] + 0.2 * u[1] ** 2 * u[0]])
    y += 0.01 * rng.standard_normal(y.shape)
    return (
        u + 0.003 * reference * rng.standard_normal(u.shape),
        y,
        u if reference else None,
        ms.lines,
    )


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize(
    ("kind", "design", "R", "reference", "amplitude"),
    [
        ("random-odd", "orthogonal", 1, False, narrow),
        ("special-odd", "orthogonal", 2, False, narrow),
        ("random-odd", "orthogonal", 2, True, None),
        ("full", "orthogonal", 2, False, None),
        ("random-odd", "zippered", 1, False, None),
        ("random-odd", "zippered", 3, False, None),
    ],
)
def test_units_scale_the_matrix_and_its_bounds_and_nothing_else(
    kind, design, R, reference, amplitude
):
    """The bound was up to 32 % less of narrow spectra, 1e8 times as large of zippered ones; the
    block 1e16 times.
    """
    u, y, r, lines = signals(kind, design, R, reference, amplitude)

    def found(a, b):
        a, b = (np.reshape(one, (2, 1, 1, 1)) for one in (a, b))
        r_scaled = None if r is None else a * r
        return nlfrf.identify(nlfrf.Record(u=a * u, y=b * y, r=r_scaled, fs=FS, lines=lines))

    own = found((1, 1), (1, 1))
    shape = np.einsum("abk,cbk->ack", own.block()[0], own.block()[0].conj())
    for a, b in (((1, 1e-6), (1, 1)), ((1, 1), (1e6, 1e-6)), ((1e-6, 1e3), (1e-6, 1e6))):
        frm, into, out = found(a, b), np.reshape(a, (1, 2, 1)), np.reshape(b, (2, 1, 1))
        np.testing.assert_allclose(frm.G * into / out, own.G, rtol=1e-9)
        for of in ("bla", "realization"):
            np.testing.assert_allclose(frm.bound(of=of) * into / out, own.bound(of=of), rtol=1e-9)
        distortion = frm.var_distortion * (into / out) ** 2
        np.testing.assert_allclose(
            distortion, own.var_distortion, rtol=1e-9, atol=1e-9 * own.var_distortion.max()
        )
        left = frm.block()[0] / out
        again = np.einsum("abk,cbk->ack", left, left.conj())
        np.testing.assert_allclose(again, shape, rtol=1e-9, atol=1e-9 * np.abs(shape).max())


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_what_repeats_is_known_whatever_the_units():
    """One delay is common to all inputs: that of the input of large numbers was taken alone."""
    ms = nlfrf.multisine(
        "random-odd",
        fs=FS,
        n_samples=N,
        f_min=1,
        f_max=80,
        n_inputs=2,
        n_realizations=2,
        rms=(1.0, 1e-7),
        rng=1,
    )
    rng = np.random.default_rng(0)
    u = np.repeat(ms.u[:, [0, 1, 0, 1], None], 2, axis=2)
    u[0] += 0.3 * rng.standard_normal(u[0].shape)
    y = u[:1] + 1e7 * u[1:] + 0.01 * rng.standard_normal(u[:1].shape)
    frms = []
    for unit in (1.0, 1e7):
        scaled = u * np.reshape([1.0, unit], (2, 1, 1, 1))
        frms.append(nlfrf.identify(nlfrf.Record(u=scaled, y=y, fs=FS, lines=ms.lines)))
    assert [frm.experiment.n_experiments for frm in frms] == [2, 2]
    np.testing.assert_allclose(frms[0].bound()[0, 1] * 1e-7, frms[1].bound()[0, 1], rtol=1e-9)
