"""What a class of models misses, as an error next to the scatter of the lines: how large it is, and where it may lie.

No machine is in a class of four poles. What the class misses is no noise, and belongs to no line of small scatter:

    G_k = G(theta)_k + n_k + e_k,    E|n_k|^2 = b_k^2 the variance of the line,    E|e_k|^2 = epsilon^2 m_k^2

The fit minimises the negative logarithm of the likelihood over theta and the one number epsilon,

    sum_k |G_k - G(theta)_k|^2 / (b_k^2 + epsilon^2 m_k^2) + ln(b_k^2 + epsilon^2 m_k^2)

(stochastic embedding: Goodwin, Gevers & Ninness, IEEE Trans. Automatic Control 37, 1992). m_k is what a loop tolerates:
K S = T/G, so an error costs it |T| |G_k - G(theta)_k|/|G|, and |G| counts smoothed, as |T| is small at an antiresonance
too. The square of |T_c| was measured to serve better than |T_c| on four machines of many modes: loops need low
frequencies more than the average of their band says (control-relevant identification: Schrama 1992; de Callafon & Van
den Hof 1995; Oomen & Bosgra 2012).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

_OCTAVE = 2.0
_MAX_WINDOWS = 200  # of medians; between them m is interpolated
_N_SIZES = 80  # of epsilon on the first grid of a search, over all sizes that could matter
_N_BALANCE = 8  # rounds that balance rows and columns; each divides what is left by ten or more
_LEAST_ENTRY = 1e-30  # of the largest entry: what a zero counts as


def smooth_size(omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (..., F) |G| smoothed over an octave: the running median, in which a mode counts as its surroundings.

    omega : (F,) [rad/s], in any order; G : (..., F).
    """
    order = np.argsort(omega, kind="stable")
    x, size = omega[order], np.abs(G)[..., order]
    first, last = np.searchsorted(x, x / np.sqrt(_OCTAVE), "left"), np.searchsorted(x, x * np.sqrt(_OCTAVE), "right")
    picked = np.unique(np.linspace(0, x.size - 1, min(x.size, _MAX_WINDOWS)).astype(int))
    medians = np.stack([np.median(size[..., first[k] : last[k]], axis=-1) for k in picked], axis=-1)
    log = np.log(np.maximum(medians, np.finfo(float).tiny)).reshape(-1, picked.size)
    out = np.empty(size.shape)
    out[..., order] = np.exp([np.interp(np.log(x), np.log(x[picked]), row) for row in log]).reshape(size.shape)
    return out


def mean_size(omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (F,) the geometric mean over the entries of |G| smoothed, G (n_y, n_u, F): its fall, in any units."""
    return np.asarray(np.exp(np.mean(np.log(smooth_size(omega, G)), axis=(0, 1))))


def target_loop(omega: np.ndarray, omega_c: float, smooth: np.ndarray, shape: np.ndarray | float = 1.0) -> np.ndarray:
    """Return (..., W) |T_c| of a loop with that crossover [rad/s]; one where it is nan.

    |T_c| = 1/sqrt(1 + 1/|L|^2) with |L| = (2 omega_c/omega)^n. Beyond the crossover the loop gain falls by one slope
    with the controller and by up to one more with the plant: n = 2 for a mass, and n = 1 where |G| is flat.

    smooth : (..., W) |G| smoothed; its mean slope beyond the crossover is the fall of the plant.
    shape : |G| over |G| smoothed, where the loop gain of a smooth controller rises and falls with it.

    >>> target_loop(np.array([0.0, 2.0, 20.0]), 1.0, np.array([1.0, 1.0, 0.01])).round(3).tolist()
    [1.0, 0.707, 0.01]
    >>> target_loop(np.array([0.0, 2.0, 20.0]), 1.0, np.ones(3)).round(3).tolist()
    [1.0, 0.707, 0.1]
    """
    if np.isnan(omega_c):
        return np.ones(np.shape(smooth))
    x = omega / (2 * omega_c)
    beyond = x >= 0.5
    u, level, share = np.log(x[beyond]), np.log(smooth[..., beyond]), 1 / x[beyond]  # each octave counts the same
    u = u - np.average(u, weights=share) if u.size else u
    spread = max(float(share @ u**2), np.finfo(float).tiny)
    n = 1 + np.clip(-(level * share) @ u / spread, 0.0, 1.0)[..., None]
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(1 + (np.where(x < 1, x**2, x**n) / shape) ** 2))


def loop_tolerance(omega: np.ndarray, G: np.ndarray, omega_c: float) -> np.ndarray:
    """Return (..., F) m = |G| smoothed over an octave, over |T_c|^2: the error of G that costs any loop the same.

    omega : (F,) [rad/s], in any order; G : (..., F).
    """
    smooth = smooth_size(omega, G)
    return smooth / target_loop(omega, omega_c, smooth) ** 2


def most_likely_size(square: np.ndarray, var: np.ndarray, tolerance: np.ndarray) -> tuple[float, float]:
    """Return epsilon at which residuals of these squares are most likely, and the negative log likelihood there.

    square, var, tolerance : (N,) |G - model|^2, b^2 and m. The likelihood may have several maxima: a grid finds the
    largest, then its neighbourhood is searched.
    """
    power = tolerance**2

    def unlikely(log_size: float) -> float:
        total = var + np.exp(2 * log_size) * power
        return float(np.sum(square / total + np.log(total)))

    least, most = (
        np.log(1e-3 * np.min(np.sqrt(var) / tolerance)),
        np.log(10 * np.max(np.sqrt(square + var) / tolerance)),
    )
    sizes = np.linspace(least, most, _N_SIZES)
    k = int(np.argmin([unlikely(size) for size in sizes]))
    around = sizes[max(k - 1, 0)], sizes[min(k + 1, _N_SIZES - 1)]
    found = minimize_scalar(unlikely, bounds=around, method="bounded", options={"xatol": 1e-6})
    return float(np.exp(found.x)), float(found.fun)


def balance(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (..., n) and columns (..., m) whose product has the mean squares of each row and column of a matrix.

    size : (..., n, m), not negative. The product does not depend on the units of inputs and outputs.
    """
    log = np.log(np.maximum(size, _LEAST_ENTRY * np.max(size, axis=(-2, -1), keepdims=True)))
    by_row = np.mean(log, axis=-1, keepdims=True)
    by_column = np.mean(log - by_row, axis=-2, keepdims=True)
    square = np.exp(2 * (log - by_row - by_column))  # in units of its own
    columns = np.ones((*size.shape[:-2], 1, size.shape[-1]))
    for _ in range(_N_BALANCE):
        rows = np.mean(square / columns, axis=-1, keepdims=True)
        columns = np.mean(square / rows, axis=-2, keepdims=True)
    return (np.exp(by_row) * np.sqrt(rows))[..., 0], (np.exp(by_column) * np.sqrt(columns))[..., 0, :]
