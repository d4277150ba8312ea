"""Experiments that were played again are periods: recognised whatever the trigger, and what is no
repeat is not.
"""

import numpy as np
import pytest

import nlfrf

FS = N = 512
MIX = np.array([[1.0, 0.3], [-0.2, 0.6]])


def record(
    order,
    *,
    design="orthogonal",
    delays=None,
    n_periods=2,
    noise=1e-3,
    seed=0,
    rms=1.0,
    reference=False,
):
    """A cubic in each of two channels; experiments by their numbers, each behind a delay
    [samples].
    """
    rng = np.random.default_rng(seed)
    sets = 1 + max(order) // (2 if design == "orthogonal" else 1)
    ms = nlfrf.multisine(
        "random-odd",
        fs=FS,
        n_samples=N,
        f_min=1,
        # of more the cube of the samples is not that of the signal behind part of a sample
        f_max=80,
        n_inputs=2,
        n_realizations=sets,
        design=design,
        rms=rms,
        rng=rng,
    )
    lines = np.arange(N // 2 + 1)
    delays = np.zeros(len(order)) if delays is None else np.asarray(delays)
    turn = np.exp(-2j * np.pi * np.multiply.outer(delays, lines) / N)
    u = np.fft.irfft(np.fft.rfft(ms.u[:, order]) * turn, N)
    u = np.repeat(u[:, :, None], n_periods, axis=2)
    y = np.einsum("ji,impn->jmpn", MIX, u + 0.1 * u**3)
    y += noise * rng.standard_normal(y.shape)
    r = u if reference else None
    u = u + 1e-3 * rng.standard_normal(u.shape) if reference else u
    return nlfrf.Record(u=u, y=y, r=r, fs=FS, lines=ms.lines)


def covered(frm, sigma2=1.0):
    """Share of the entries within their 95 % bounds: of a cubic the BLA is known."""
    truth = MIX * (1 + 0.3 * sigma2 * (1 - 0.5 / frm.f.size))
    return np.mean(np.abs(frm.G - truth[:, :, None]) < frm.bound())


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("copies", [2, 7])
@pytest.mark.parametrize("reference", [False, True])
def test_a_set_played_again_is_covered_as_one(copies, reference):
    """It was 75 % for two and 21 % for seven."""
    frms = [
        nlfrf.identify(record([0, 1] * copies, seed=seed, reference=reference), transient="none")
        for seed in range(12)
    ]
    made = [frm.experiment for frm in frms]
    assert {(one.n_realizations, one.n_experiments, one.n_periods) for one in made} == {
        (1, 2, 2 * copies)
    }
    assert 0.92 < np.mean([covered(frm) for frm in frms]) < 0.99


@pytest.mark.parametrize(
    ("order", "delays", "told"),
    [
        ([0, 1, 0, 1], None, r"\(1, 3; 2, 4\)"),
        ([0, 0, 0, 1, 1, 1], None, r"\(1, 2, 3; 4, 5, 6\)"),  # these were refused
        ([0, 1, 0, 1], [0, 0, 100.7, 12.3], r"\(1, 3; 2, 4\)"),
        ([0, 1, 2, 3, 1, 0, 3, 2], [0, 0, 0, 0, 5, 6, 7, 8], r"\(1, 6; 2, 5; 3, 8; 4, 7\)"),
    ],
)
def test_repeats_are_told_whatever_order_and_trigger(order, delays, told):
    with pytest.warns(nlfrf.DataWarning, match=rf"u holds experiments with the same phases {told}"):
        frm = nlfrf.identify(record(order, delays=delays), transient="none")
    assert frm.experiment.n_realizations == (max(order) + 1) // 2
    once = nlfrf.identify(record(sorted(set(order)), noise=0), transient="none")
    assert np.abs(frm.G - once.G).max() < 5e-3
    assert np.median(frm.var_noise[0, 0]) == pytest.approx(
        4e-6 / N * frm.f.size / 2 / (2 * len(order)), rel=0.4
    )


def test_one_period_and_its_repeat_tell_the_noise():
    once = nlfrf.identify(record([0, 1], n_periods=4, noise=0.02), transient="none")
    with pytest.warns(nlfrf.DataWarning, match="u holds experiments with the same phases"):
        again = nlfrf.identify(record([0, 1] * 4, n_periods=1, noise=0.02), transient="none")
    assert np.mean(again.var_noise) == pytest.approx(np.mean(once.var_noise), rel=0.15)
    with pytest.warns(nlfrf.DataWarning, match="u holds experiments with the same phases"):
        mixed = nlfrf.identify(record([0, 1] * 2, n_periods=2, noise=0.02), transient="none")
    assert np.mean(mixed.var_noise) == pytest.approx(np.mean(once.var_noise), rel=0.15)


def test_a_zippered_experiment_played_again_is_one():
    with pytest.warns(nlfrf.DataWarning) as told:
        frm = nlfrf.identify(
            record([0, 0, 0], design="zippered", delays=[0, 9.5, 40]), transient="none"
        )
    assert any("with the same phases (1, 2, 3)" in str(one.message) for one in told)
    assert (frm.experiment.n_realizations, frm.experiment.n_periods) == (1, 6)


@pytest.mark.parametrize("rms", [1.0, (10.0, 0.1)])
def test_the_experiments_of_a_set_are_no_repeats(rms):
    """Orthogonal sets of the same phases differ by constants, the louder input not at all."""
    assert (
        nlfrf.identify(record([0, 1, 2, 3], rms=rms), transient="none").experiment.n_experiments
        == 4
    )
    rng = np.random.default_rng(3)
    ms = nlfrf.multisine(
        "random-odd", fs=FS, n_samples=N, f_min=1, f_max=200, n_realizations=2, rng=rng
    )
    first, second = np.reshape(rms * np.ones(2), (2, 1)) * ms.u
    u = np.array([[first, first], [second, -second]])[:, :, None]
    u = np.repeat(u, 2, axis=2)
    y = np.einsum("ji,impn->jmpn", MIX, u) + 1e-4 * rng.standard_normal(u.shape)
    with pytest.warns(nlfrf.DataWarning, match=r"experiments have the same phases \(psi\)"):
        frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=FS, lines=ms.lines), transient="none")
    assert frm.experiment.n_experiments == 2


def test_half_a_repeat_is_left_as_it_is():
    """Three of four experiments would be left: no whole sets."""
    with pytest.warns(nlfrf.DataWarning, match="the experiments separate the inputs badly"):
        assert nlfrf.identify(record([0, 1, 0, 3]), transient="none").experiment.n_experiments == 4


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("design", ["orthogonal", "zippered"])
def test_sets_of_another_level_are_refused(design):
    """Their BLA is another one: at 6 dB more the cube weighs four times as much."""
    one = record(range(4), design=design)
    louder = np.ones((2, 4, 1, 1))
    louder[1, 2:] = 2.0
    other = nlfrf.Record(u=one.u * louder, y=one.y, fs=FS, lines=one.lines)
    with pytest.raises(
        ValueError, match=r"amplitude spectrum in every set of u2, got set of u2 [1234] up to"
    ):
        nlfrf.identify(other, transient="none")


def low_peaks(lines, rng):
    """A set of two inputs whose phases phi + psi + T were turned until all four signals have low
    peaks (CF 1.7).
    """
    T = np.array([[0, 0], [0, np.pi]])[:, :, None]
    phi = rng.uniform(0, 2 * np.pi, (2, 1, lines.size))
    psi = rng.uniform(0, 2 * np.pi, (1, 2, lines.size))
    for _ in range(200):
        X = np.zeros((2, 2, N // 2 + 1), complex)
        X[..., lines] = np.exp(1j * (phi + psi + T)) * N / np.sqrt(2 * lines.size)
        u = np.fft.irfft(X, N)
        wanted = np.exp(1j * np.angle(np.fft.rfft(np.clip(u, -1.35, 1.35))[..., lines]) - 1j * T)
        phi = np.angle((wanted * np.exp(-1j * psi)).sum(axis=1, keepdims=True))
        psi = np.angle((wanted * np.exp(-1j * phi)).sum(axis=0, keepdims=True))
    return u


def test_low_peaks_of_several_inputs_are_warned_of():
    """Their bound held 28 % without a word; random phases, mixed, zippered or the best of some
    draws, are not.
    """
    rng = np.random.default_rng(0)
    band = dict(fs=FS, n_samples=N, f_min=1, f_max=80, n_inputs=2)
    ms = nlfrf.multisine("random-odd", **band, rng=rng)
    u = np.repeat(low_peaks(ms.lines.excited, rng)[:, :, None], 2, axis=2)
    y = u + 1e-3 * rng.standard_normal(u.shape)
    with pytest.warns(
        nlfrf.DataWarning, match=r"u1 must have random phases .* got a crest factor of 1\.[67]"
    ):
        nlfrf.identify(nlfrf.Record(u=u, y=y, fs=FS, lines=ms.lines), transient="none")
    for more in (
        {},
        {"n_draws": 30},
        {"mixing": np.array([[1.0, 1.0], [1.0, -1.0]])},
        {"n_realizations": 3},
    ):
        ms = nlfrf.multisine("random-odd", **band, **more, rng=rng)
        u = np.repeat(ms.u[:, :, None], 2, axis=2)
        y = u + 1e-3 * rng.standard_normal(u.shape)
        assert (
            nlfrf.identify(
                nlfrf.Record(u=u, y=y, fs=FS, lines=ms.lines), transient="none"
            ).experiment.n_periods
            == 2
        )


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize("fault", ["swapped", "sign", "late"])
def test_outputs_of_other_experiments_are_told(fault):
    """Every entry of the matrix is then nonsense; its bound, of the detection lines, held 1 to 38 %
    without a word.
    """
    one = record(range(2), n_periods=4)
    y = one.y.copy()
    if fault == "swapped":
        y = y[:, ::-1]
    elif fault == "sign":
        y[:, 1] *= -1
    else:
        y[:, 1] = np.roll(y[:, 1], 2, axis=-1)
    told = (
        r"G of y[12] changes from line to line by \d+ % of its size|is about [12](\.\d)? samples"
        r" (earl|lat)"
    )
    with pytest.warns(nlfrf.DataWarning, match=told):
        nlfrf.identify(nlfrf.Record(u=one.u, y=y, fs=FS, lines=one.lines), transient="none")
