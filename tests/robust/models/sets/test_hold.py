"""The hold counts once: in the record, or in the loop."""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust

FS, N = 1000, 2000
PLANT = control.ss(control.tf([4e4], [1, 20, 4e4]))  # 31.8 Hz


def record(hold, fs=FS):
    """What a sampled experiment sees: behind the hold of the converter, or of a force measured
    behind it.
    """
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=fs, n_samples=N, f_min=1, f_max=300, rng=rng)
    seen = robust.sampled(PLANT, 1 / fs) if hold != "band-limited" else PLANT
    omega = 2 * np.pi * np.arange(1, N // 2) * ms.f0
    G = np.concatenate([[0], seen(np.exp(1j * omega / fs) if seen.dt else 1j * omega).ravel(), [0]])
    y = np.fft.irfft(np.fft.rfft(ms.u) * G, N)
    u, y = np.tile(ms.u, (4, 1)), np.tile(y, (4, 1))
    y = y + 1e-5 * np.std(y) * rng.standard_normal(y.shape)
    return nlfrf.Record(
        u=u[None], y=y[None], fs=fs, lines=ms.lines, hold=hold, u_unit="N", y_unit="mm"
    )


def phase_error(model, omega):
    """Of the plant as a controller at FS sees it, against the exact one [deg]."""
    z = np.exp(1j * omega / FS)
    seen = model if model.dt else robust.sampled(model, 1 / FS)
    exact = robust.sampled(PLANT, 1 / FS)
    return np.abs(np.angle(seen(z) / exact(z), deg=True)).max()


OMEGA = 2 * np.pi * np.array([10.0, 60.0, 250.0])
#: A hold that is not taken out is no rational function: a fit puts a pole beyond the band for it,
#: and misses.
SUSPICIOUS = ("ignore::robust.DesignWarning",)


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning", *SUSPICIOUS)
def test_a_hold_that_nobody_mentions_is_counted_twice():
    bla = nlfrf.identify(record("unknown"))
    fit = robust.fit_nominal(bla, n_poles=3, n_zeros=2)
    z = np.exp(1j * OMEGA / FS)
    twice = np.angle(robust.sampled(fit.G, 1 / FS)(z) / robust.sampled(PLANT, 1 / FS)(z), deg=True)
    np.testing.assert_allclose(twice, [-1.8, -10.8, -45], rtol=0.1)  # half a sample more


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_at_the_rate_of_the_controller_a_discrete_fit_is_what_it_sees():
    bla = nlfrf.identify(record("zoh"))
    assert (bla.hold, bla.unit) == ("zoh", "mm/N")
    fit = robust.fit_nominal(bla, n_poles=2, n_zeros=1, dt=1 / FS)
    assert fit.hold == "zoh"
    assert phase_error(fit.G, OMEGA) < 0.05
    model = robust.uncertainty(bla, fit, order=2)
    hold, unit = model.origin.hold, model.origin.unit
    assert (hold.kind, hold.fs, unit) == ("zoh", FS, "mm/N")
    assert model.radius.max() < 1e-2


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning", *SUSPICIOUS)
@pytest.mark.parametrize(
    ("hold", "fs", "dt"), [("zoh", 4000, 0), ("zoh", 4000, 1 / FS), ("band-limited", FS, 0)]
)
def test_elsewhere_the_hold_is_taken_out_or_put_in(hold, fs, dt):
    bla = nlfrf.identify(record(hold, fs))
    fit = robust.fit_nominal(bla, n_poles=2 if dt == 0 else 3, n_zeros=0 if dt == 0 else 2, dt=dt)
    assert phase_error(fit.G, OMEGA) < (
        0.3 if dt == 0 else 3
    )  # what folds down above Nyquist is left out
    model = robust.uncertainty(bla, fit, order=1)
    assert np.median(model.radius) < 2e-2
    assert robust.validate(model, bla).n_outside <= 0.1 * bla.f.size


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_frf_checks_and_designs_see_the_hold_once():
    seen = robust.sampled(PLANT, 1 / FS)
    K = control.ss([[0.5]], [[0.05]], [[0.5]], [[0.0]], 1 / FS)
    for hold in ("zoh", "band-limited"):
        bla = nlfrf.identify(record(hold))
        for plant in (bla, robust.uncertainty(bla, robust.frd(bla))):
            report = robust.check(plant, K)
            z = np.exp(1j * report.curves.omega / FS)
            S = 1 / (1 + K(z) * seen(z))
            # above, a band-limited record does not know what folds down
            inside = report.curves.omega < 2 * np.pi * 100
            assert np.abs(report.curves.S / S - 1)[inside].max() < (2e-3 if hold == "zoh" else 0.1)
        assert robust.design_frf(bla, "PI", M_S=2.0, dt=1 / FS).K.dt == 1 / FS


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning", *SUSPICIOUS)
def test_an_unknown_hold_is_warned_of_where_it_matters(tmp_path):
    bla = nlfrf.identify(record("unknown"))
    K = control.ss([[0.5]], [[0.05]], [[0.5]], [[0.0]], 1 / FS)
    fit = robust.fit_nominal(bla, n_poles=3, n_zeros=2)
    model = robust.uncertainty(bla, fit, order=1)
    for plant in (bla, model):
        with pytest.warns(
            robust.DesignWarning,
            match=r'hold of the record .sampled at 1000 Hz. is unknown: .* hold="zoh"',
        ):
            robust.check(plant, K, certify=False)
    robust.check(
        model, control.ss([[0.5]], [[0.05]], [[0.5]], [[0.0]], 4 / FS), certify=False
    )  # far below its rate, it does not
    robust.save(model, tmp_path / "m.json")
    again = robust.load(tmp_path / "m.json")
    hold, unit = again.origin.hold, again.origin.unit
    assert (hold.kind, hold.fs, unit) == ("unknown", FS, "mm/N")


MIXED = np.array([[1.0, 0.2], [-0.1, 0.5]])


def matrix_of(hold, fs=FS):
    """The same of two inputs and outputs, all of them mixed."""
    ms = nlfrf.multisine(fs=fs, n_samples=N, f_min=1, f_max=300, n_inputs=2, hold=hold, rng=0)
    seen = robust.sampled(PLANT, 1 / fs) if hold != "band-limited" else PLANT
    omega = 2 * np.pi * np.arange(1, N // 2) * ms.f0
    G = np.concatenate([[0], seen(np.exp(1j * omega / fs) if seen.dt else 1j * omega).ravel(), [0]])
    u = np.repeat(ms.u[:, :, None], 4, axis=2)
    y = np.fft.irfft(np.einsum("ji,impk->jmpk", MIXED, np.fft.rfft(u) * G), N)
    y += 1e-5 * np.std(y) * np.random.default_rng(1).standard_normal(y.shape)
    return nlfrf.identify(
        nlfrf.Record(u=u, y=y, fs=fs, lines=ms.lines, hold=ms.hold), transient="none"
    )


def matrix_error(G):
    """Largest error of the matrix as a controller at FS sees it, over the matrix [1]."""
    z = np.exp(1j * OMEGA / FS)
    seen = G if G.dt else robust.sampled(G, 1 / FS)
    exact = MIXED[:, :, None] * robust.sampled(PLANT, 1 / FS)(z)
    off = np.asarray(seen(z, squeeze=False)) - exact
    return (np.linalg.norm(off, axis=(0, 1)) / np.linalg.norm(exact, axis=(0, 1))).max()


@pytest.mark.parametrize(
    ("hold", "fs", "dt"), [("zoh", FS, 1 / FS), ("zoh", 4000, 0), ("band-limited", FS, 0)]
)
def test_the_hold_of_several_inputs_counts_once(hold, fs, dt, tmp_path):
    frm = matrix_of(hold, fs)
    nlfrf.save(frm, tmp_path / "G.npz")
    assert nlfrf.load(tmp_path / "G.npz").hold == frm.entry(1, 0).hold == hold
    fit = robust.fit_nominal(frm, n_poles=2, rank=2, dt=dt)
    assert fit.hold == hold
    assert matrix_error(fit.G) < 1e-2
    model = robust.uncertainty(frm, fit, order=1)
    gain = np.abs(
        np.asarray(model.nominal(np.exp(1j * OMEGA * dt) if dt else 1j * OMEGA, squeeze=False))
    ).max()
    assert model.radius.max() < 2e-2 * gain
    assert robust.validate(model, frm).n_outside <= 0.1 * frm.f.size


def test_matrices_of_two_holds_are_one_plant():
    """Of the same machine, one record with the hold in it: `validate` compares the machines."""
    band, held = matrix_of("band-limited"), matrix_of("zoh", 4000)
    assert robust.validate(band, held).p_value > 1e-3
    assert robust.validate(band, replace(held, hold="band-limited")).p_value < 1e-6


def test_an_unknown_hold_of_several_inputs_is_warned_of():
    with pytest.warns(
        robust.DesignWarning,
        match=r'hold of the record .sampled at 1000 Hz. is unknown: .* hold="zoh"',
    ):
        robust.design_frf(matrix_of("unknown"), "I", M_S=2.0, dt=1 / FS, n_iterations=1)
    with pytest.raises(ValueError, match="hold must be one of"):
        nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, hold="foh")
