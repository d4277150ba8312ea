"""Even and odd distortion levels at the output, from the lines that were not excited."""

from __future__ import annotations

import numpy as np

from nlfrf.identification.frf import residual_variance
from nlfrf.identification.neighbours import Places
from nlfrf.identification.spectra import Spectra
from nlfrf.shared.leastsquares import EPS, SMALL
from nlfrf.shared.values import value

__all__ = ["Answer", "detected_power", "nonlinear_answer"]


SHARP = 8.0  # change of |G| within a window [dB] past which no farther line is used
FEWEST = 4
SCORED = 3  # steps of scoring: a fourth changes nothing unless noise is nearly all that is read


@value(copy=False)
class Answer:
    """The output of an experiment with its linear part taken off.

    Fields
    ------
    G : (K,) complex ndarray
        The FRF, locally fitted and interpolated to all lines, excited and not.
    Yc : (M, K) complex ndarray
        Y - G U: a real actuator, or a loop, puts some input on detection lines too.
    noise : (K,) ndarray
        Variance of Yc by noise, averaged over realisations; nan for one period.
    """

    G: np.ndarray
    Yc: np.ndarray
    noise: np.ndarray


def nonlinear_answer(spectra: Spectra, smooth: np.ndarray) -> Answer:
    """What is left of the output when the linear answer, of an FRF on the excited lines, is taken off."""
    G = interpolate_frf(smooth, spectra.where)
    noise = residual_variance(G, spectra)
    return Answer(G=G, Yc=spectra.Y - G * spectra.U, noise=np.add.reduce(noise) / len(noise))


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
    used[...] = narrowed(A) & (windows >= 0)
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
