"""Even and odd distortion levels at the output, from the lines that were not excited, and the law their phases tell.

The powers of the detection lines leave open whether the input drives the distortion or the output, and whether it
arises before the dynamics or behind them. Their phases tell: what stands there is, but for one factor, the third power
of what drives it, if the law is a cubic, and one realisation shows it.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.numbers import BLOCK, EPS, SMALL, TINY, fast_length, mean_power, power, squared
from nlfrf._base.values import value
from nlfrf.bla.frf import residual_variance
from nlfrf.bla.neighbours import Places
from nlfrf.bla.spectra import Spectra
from nlfrf.signals.lines import in_common, local_mean

__all__ = ["UNTOLD", "Answer", "Law", "detected_power", "nonlinear_answer", "told_law"]


SHARP = 8.0  # change of |G| within a window [dB] past which no farther line is used
FEWEST = 4
SCORED = 3  # steps of scoring: a fourth changes nothing unless noise is nearly all that is read
UNEVEN = 1.5  # largest over least |G|^2, of means over the lines around, from which the place of distortion matters
JAGGED = 2.0  # and line by line, as one realisation scatters
AROUND = 9  # lines over which the powers of detection lines, and |G|^2, are averaged
FAINT = 1e-12  # of the largest power, under which it is rounding
CHANCE = 1e-3  # with which phases may agree by it
HEARD = 0.7  # share of the power on detection lines that is no noise, at least
FLATTER = 0.6  # share in common with any power of its drive under which a law is flatter than those
SAMPLES = 6  # to a cycle of the last line, so that fifth powers fold back beyond it
PLACED = (
    "the input, before the dynamics",
    "the output, fed back as by a spring",
    "the input, beside the dynamics",
    "the output, behind the dynamics as by a sensor",
)
CUBIC = 0.35  # what a cube leaves over what a fifth power leaves, where it is told to be the law
FIFTH = 0.8  # share in common with a fifth power from which it may be that, where it is no cubic


@value(copy=False)
class Answer:
    """The output of an experiment with its linear part taken off.

    Fields
    ------
    G : (K,) complex ndarray
        The FRF, locally fitted and interpolated to all lines, excited and not.
    gain : (K,) ndarray
        |G|^2.
    uneven : bool
        Whether it changes over the band, so that it matters what drives the distortion, and where.
    Yc : (M, K) complex ndarray
        Y - G U: a real actuator, or a loop, puts some input on detection lines too.
    noise : (K,) ndarray
        Variance of Yc by noise, averaged over realisations; nan for one period.
    """

    G: np.ndarray
    gain: np.ndarray
    uneven: bool
    Yc: np.ndarray
    noise: np.ndarray


@value(copy=False)
class Law:
    """What the phases of the odd detection lines tell of the law behind them.

    Fields
    ------
    order : int
        3: a cubic. 5: it may be a fifth power. 1: flatter than any, it saturates, jumps or remembers. 0: not told.
    coherence : float
        Squared, of those lines with the cube of what drives them.
    reading : int
        Which drive, and where: the input (0, 2) or the output (1, 3), into the dynamics (0, 1) or behind them.
    """

    order: int = 0
    coherence: float = 0.0
    reading: int = 0

    @property
    def share(self) -> float:
        """Of a cubic the share that counts as told, from half on.

        What is none of these, a hysteresis or a cubic between two dynamics, has something in common with one of them.
        """
        return max(0.0, 2 * self.coherence - 1) if self.order == 3 else 0.0

    def said(self, uneven: bool, one_period: bool) -> str:
        """The law in words, its place where |G| changes over the band, and what one period leaves open; or nothing."""
        if self.order == 3:
            what = PLACED[self.reading] if uneven else "its drive"
            return (
                f"{100 * self.coherence:.0f} % of the power on odd detection lines has the phases of the cube of {what}"
            )
        otherwise = ", or much of them is noise" if one_period else ""
        flatter = f"what makes them saturates or jumps, or has a memory{otherwise}"
        return {
            5: "odd detection lines have the phases of a fifth power as much as of a cube",
            1: f"odd detection lines have the phases of no power: {flatter}",
        }.get(self.order, "")


UNTOLD = Law()


def is_uneven(gain: np.ndarray) -> bool:
    """Whether |G|^2 (F,) changes over the band, by more than scatter."""
    if gain.max() > JAGGED * gain.min():
        return True
    around = local_mean(gain, AROUND)
    return bool(around.max() > UNEVEN * around.min())


def told_law(excited: Spectra, answer: Answer) -> Law:
    """The law that makes the odd detection lines: of which power of the input, or of the output, they have the phases.

    Their powers are made even from line to line, so that phases alone count, over all lines and realisations, less what
    chance and noise make of it.

    Parameters
    ----------
    excited : Spectra
        On the excited lines.
    answer : Answer
    """
    where = excited.where
    U = excited.U[: max(1, BLOCK // (SAMPLES * int(where.lines[-1])))]  # of long periods few realisations tell enough
    Y = answer.Yc[: len(U)].take(where.odd, axis=1)
    n = Y.size
    if where.odd.size < FEWEST or not Y.any():
        return UNTOLD
    candidates = np.empty((2, 2, 2, *Y.shape), dtype=complex)  # by G or behind it; input, output; cube, fifth power
    G = answer.G
    candidates[1] = powers_on(where.lines[where.odd], [U, G.take(where.excited) * U], excited.lines)
    np.multiply(G.take(where.odd), candidates[1], out=candidates[0])
    level = level_around(mean_power(Y))
    noise = local_mean(np.nan_to_num(answer.noise.take(where.odd)), AROUND)
    heard = np.maximum(1 - noise / level, 0.0)  # lines count by what is no noise on them
    share = float(heard.mean())
    if share < HEARD:
        return UNTOLD
    y = Y / np.sqrt(level)
    levels = level_around(np.add.reduce(squared(candidates), axis=-2))
    x = candidates * np.sqrt(heard / levels)[..., None, :]
    common = squared(np.add.reduce(np.vecdot(x, y), axis=-1))
    common /= np.add.reduce(power(x), axis=-1) * power(y).sum() + TINY
    if common.max() < in_common(CHANCE, n):
        return UNTOLD
    common = np.clip((common * n - 1) / (n - 1) / share, 0.0, 1.0)
    cubes, fifths = common[..., 0].ravel(), common[..., 1].ravel()
    reading = int(cubes.argmax())
    cube, fifth = float(cubes[reading]), float(fifths.max())
    if max(cube, fifth) < FLATTER:
        order = 1
    elif 1 - cube < CUBIC * (1 - fifth):
        order = 3
    else:
        order = 5 if fifth > FIFTH else 0
    return Law(order=order, coherence=cube, reading=reading)


def level_around(power: np.ndarray) -> np.ndarray:
    """Mean power (..., K) over the lines around each, but not under what rounding leaves of running sums."""
    return np.maximum(local_mean(power, AROUND), FAINT * power.max(axis=-1, keepdims=True)) + TINY


def powers_on(lines: np.ndarray, drives: list[np.ndarray], excited: np.ndarray) -> np.ndarray:
    """(drives, 2, M, K) the third and fifth powers of multisines of these amplitudes (M, F), on some lines."""
    last = int(max(excited[-1], lines[-1]))
    n = 2 * fast_length(SAMPLES // 2 * last + 1)  # terms beyond alias onto lines past the last one
    spectrum = np.zeros((len(drives), *drives[0].shape[:-1], n // 2 + 1), dtype=complex)
    for one, drive in zip(spectrum, drives, strict=True):
        one[:, excited] = drive / np.sqrt(power(drive).sum() + TINY)
    x = np.fft.irfft(spectrum, n, norm="forward")
    square = x * x
    both = np.stack([x * square, x * square * square], axis=1)
    return np.fft.rfft(both).take(lines, axis=-1)


def nonlinear_answer(spectra: Spectra, smooth: np.ndarray) -> Answer:
    """What is left of the output when the linear answer, of an FRF on the excited lines, is taken off."""
    G = interpolate_frf(smooth, spectra.where)
    noise, gain = residual_variance(G, spectra), squared(G)
    return Answer(
        G=G,
        gain=gain,
        uneven=is_uneven(gain.take(spectra.where.excited)),
        Yc=spectra.Y - G * spectra.U,
        noise=np.add.reduce(noise) / len(noise),
    )


def interpolate_frf(G: np.ndarray, where: Places) -> np.ndarray:
    """G between its lines, linear in log magnitude and in phase; held at the ends."""
    magnitude = np.abs(G)
    # an output without any linear part has G = 0; a floor at rounding can still be squared and divided by
    floor = max(EPS * magnitude.max(), SMALL)
    logarithm, rise = np.empty(G.size, dtype=complex), np.zeros(G.size, dtype=complex)
    np.log(np.maximum(magnitude, floor), out=logarithm.real)
    np.arctan2(G.imag, G.real, out=logarithm.imag)
    np.subtract(logarithm[1:], logarithm[:-1], out=rise[:-1])
    turns = rise.imag / (2 * np.pi)
    rise.imag -= 2 * np.pi * np.rint(turns, out=turns)  # phase goes the shorter way round
    return np.exp(logarithm.take(where.below) + where.share * rise.take(where.below))


def detected_power(
    power: np.ndarray,
    noise: np.ndarray,
    gain: np.ndarray,
    gain_excited: np.ndarray,
    windows: np.ndarray,
    read: np.ndarray,
    follows: np.ndarray,
    profile: np.ndarray | float = 1.0,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Distortion read on a window of detection lines for each excited line.

    Distortion that arises before a resonance follows |G|^2 across it, distortion that arises behind it does not, nor
    does noise: so the expected power on line j of a window is taken as q_j = d c_j |G_j|^2 + n_j or as
    q_j = d c_j + n_j, with its profile c_j, the noise n_j known from the periods and d from maximum likelihood (scoring
    on exponentially distributed powers). What is measured over what is expected is then averaged over the window, so
    that lines of very different power weigh the same.

    Parameters
    ----------
    power, noise, gain : (K,) ndarray
        Measured power, variance by noise and |G|^2 on all lines.
    gain_excited : (F,) ndarray
        |G|^2 on the excited lines.
    windows : (n, w, F) int ndarray
        Detection lines of each excited line, nearest first, by their place among all lines; -1: none.
    read : (k,) int ndarray
        Which of the w windows each of k readings is of.
    follows : (k,) bool ndarray
        Whether the distortion is taken to follow |G|^2.
    profile : (n, k, F) ndarray
        How it is taken to be spread over the lines of a window beside that, of mean one.

    Returns
    -------
    distortion : (k, F) ndarray
        Power of the distortion on the scale of the excited line.
    ratio : (k, F) ndarray
        Mean of the measured over the expected power: near one.
    n_used : (k, F) ndarray
        Lines used: fewer than n where |G| changes much within the window.
    likelihood : (k, F) ndarray
        Log-likelihood of the powers on a window under what is expected, but for a constant.
    """
    gathered = np.empty((5, *windows.shape))
    P, N, A, excess, used = gathered
    for x, out in ((power, P), (noise, N), (gain, A)):
        x.take(windows, out=out, mode="wrap")  # -1 is told from the others by `used`
    A /= gain_excited
    np.subtract(P, N, out=excess)
    np.maximum(N, SMALL, out=N)  # its square can still be divided by
    np.greater_equal(windows, 0, out=used)
    if gain.max() >= 10 ** (SHARP / 10) * gain.min():
        used *= narrowed(A)
    P, floor, A, excess, used = gathered.take(read, axis=2)
    np.copyto(A, 1.0, where=~follows[:, None])
    A *= profile
    excess /= A
    floor /= A
    n_used = np.add.reduce(used)
    weighted, weight = sums = np.empty((2, *used.shape))  # (2, n, k, F)
    weight[...] = used  # as without noise
    for _ in range(SCORED):  # q_j / |G_j|^2 = d + floor_j: the weights are those of (P_j - N_j) / |G_j|^2
        np.multiply(weight, excess, out=weighted)
        over, under = np.add.reduce(sums, axis=1)
        d = np.maximum(over / under, 0.0)
        expected = d + floor
        np.multiply(expected, expected, out=weight)
        np.divide(used, weight, out=weight)
    expected *= A
    ratio = P / expected
    likelihood = np.add.reduce(used * (np.log(expected) + ratio))
    ratio *= used
    return d, np.add.reduce(ratio) / n_used, n_used, -likelihood


def narrowed(gain: np.ndarray) -> np.ndarray:
    """(n, ..., F) which lines of a window to use: up to where |G|^2 has changed by SHARP, never under FEWEST.

    Gains are relative to the excited line.
    """
    highest, lowest = np.maximum(np.maximum.accumulate(gain), 1.0), np.minimum(np.minimum.accumulate(gain), 1.0)
    used = highest < 10 ** (SHARP / 10) * lowest
    used[:FEWEST] = True
    return np.asarray(used)
