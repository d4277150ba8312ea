"""A channel that has another gain, or comes later, in one experiment of a set: told by name, number
and size.
"""

import re
import warnings

import numpy as np
import pytest

import nlfrf

FS = 256
GAIN = (
    r"(\w+|all of y1, y2) is about ([\d.]+) % (higher|lower) in experiment (\d) of (\d) than in"
    r" the others"
)
DELAY = (
    r"(\w+|all of y1, y2) is about ([\d.]+) samples (later|earlier) in experiment (\d) of (\d)"
    r" than in the others"
)


def stage(f, modes=(12.0, 31.0), damping=0.05):
    """(2, 2, F) response of two modes that both inputs drive and both outputs see."""
    shapes = np.array([[1.0, 0.7], [-0.4, 1.0]])
    s = 2j * np.pi * f
    return sum(
        np.einsum(
            "j,i,k->jik", shapes[m], [1.0, 0.5 - m], w * w / (s * s + 2 * damping * w * s + w * w)
        )
        for m, w in enumerate(2 * np.pi * np.array(modes))
    )


def played(seed, *, n_sets=1, n=512, noise=1e-3, cubic=0.0, damping=0.05):
    """Signals of a special-odd or random-odd design through the stage, its lines, and the true
    matrix there.
    """
    rng = np.random.default_rng(seed)
    kind = ("special-odd", "random-odd")[seed % 2]
    ms = nlfrf.multisine(
        kind, fs=FS, n_samples=n, f_min=1, f_max=80, n_inputs=2, n_realizations=n_sets, rng=rng
    )
    G = stage(np.arange(n // 2 + 1) * FS / n, damping=damping)
    y = np.fft.irfft(np.einsum("jik,imk->jmk", G, np.fft.rfft(ms.u)), n)
    y /= y.std(axis=(1, 2), keepdims=True)
    u, y = (np.repeat(x[:, :, None], 2, axis=2) for x in (ms.u, y + cubic * y**3))
    return u, y + noise * rng.standard_normal(y.shape), ms.lines


def said(u, y, lines):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=FS, lines=lines))
    return frm, [str(w.message) for w in caught]


@pytest.mark.parametrize("n_sets", [1, 2])
@pytest.mark.parametrize("side", ["u", "y"])
@pytest.mark.parametrize("by", [0.03, 0.1, -0.1])
def test_a_gain_of_one_experiment_is_told(by, side, n_sets):
    """Of a 95 % bound 24 to 60 % held without a word."""
    for seed in range(6):
        u, y, lines = played(seed, n_sets=n_sets)
        sound, nothing = said(u, y, lines)
        assert not nothing
        channel, experiment = seed // 2 % 2, seed % (2 * n_sets)
        {"u": u, "y": y}[side][channel, experiment] *= 1 + by
        frm, told = said(u, y, lines)
        found = [re.match(GAIN, text) for text in told]
        assert len(found) == 1, told
        name, size, way, number, _ = found[0].groups()
        if n_sets == 1:  # between sets the scatter shows it, and the bound is wide enough
            assert np.mean(np.abs(frm.G - sound.G) < frm.bound()) < 0.75
        assert (
            f"{side}{channel + 1} " in told[0].split(", according to")[0]
        )  # where y2 is of u1 alone the two are one
        assert abs(float(size) / abs(100 * by) - 1) < 0.55
        if name[0] != side:
            continue
        if n_sets > 1:  # of two experiments the one is too high as the other is too low
            assert (way, int(number)) == ("higher" if by > 0 else "lower", experiment + 1)
        else:
            assert (way == "higher") == ((by > 0) == (int(number) == experiment + 1))


@pytest.mark.parametrize("n_sets", [1, 2])
def test_a_delay_of_one_experiment_is_told(n_sets):
    for seed in range(6):
        u, y, lines = played(seed, n_sets=n_sets)
        n, channel, experiment = y.shape[-1], seed // 2 % 2, seed % (2 * n_sets)
        turn = np.exp(-2j * np.pi * np.arange(n // 2 + 1) * 0.2 / n)
        y[channel, experiment] = np.fft.irfft(np.fft.rfft(y[channel, experiment]) * turn, n)
        _, told = said(u, y, lines)
        found = re.match(DELAY, " ".join(told))
        assert found, told
        assert found[1] == f"y{channel + 1}"
        assert abs(float(found[2]) - 0.2) < 0.1
        assert (found[3] == "later") == (int(found[4]) == experiment + 1)


def test_sound_records_are_not_warned_of():
    """Resonances as narrow as the lines are apart, much noise, and distortion of each machine: one
    of 80 had jumps.
    """
    warned = 0
    for seed in range(80):
        n = (192, 256, 384, 512)[seed // 2 % 4]
        noise, cubic = (1e-4, 1e-2, 0.1)[seed % 3], (0.0, 0.01, 0.05)[seed // 3 % 3]
        u, y, lines = played(
            seed,
            n_sets=1 + seed // 8 % 2,
            n=n,
            noise=noise,
            cubic=cubic,
            damping=(0.05, 0.01)[seed % 2],
        )
        warned += any("in the others" in text or "jumps" in text for text in said(u, y, lines)[1])
    assert warned <= 1


def test_what_all_experiments_have_in_common_is_not_seen():
    """A gain that is wrong in all of them looks like the machine."""
    u, y, lines = played(0)
    y[0] *= 1.1
    assert not said(u, y, lines)[1]


def test_inputs_played_one_after_the_other_differ_from_nothing():
    """Each channel in the one experiment in which it was played; nothing is divided by the silence
    of the others.
    """
    ms = nlfrf.multisine(
        "random-odd", fs=FS, n_samples=512, f_min=1, f_max=80, n_realizations=2, rng=1
    )
    u = np.repeat((np.eye(2)[:, :, None] * ms.u)[:, :, None], 2, axis=2)
    y = np.einsum("ji,i...->j...", np.array([[1.0, 0.0], [0.5, 2.0]]), u + 0.01 * u**3)
    y += 1e-3 * np.random.default_rng(0).standard_normal(y.shape)
    frm, told = said(u, y, ms.lines)
    assert not told
    assert frm.typical >= 1
