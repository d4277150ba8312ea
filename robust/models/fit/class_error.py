"""The model error of a class of models: its size, and its weight on each line.

No machine has exactly four poles. The error e_k of a model with four poles is not noise, and does
not become smaller if the measured FRF has less scatter n_k:

    G_k = G(theta)_k + n_k + e_k,    E|n_k|^2 = b_k^2 the variance of the line,    E|e_k|^2 = epsilon^2 m_k^2

The fit minimises the negative logarithm of the likelihood over theta and the one number epsilon,

    sum_k |G_k - G(theta)_k|^2 / (b_k^2 + epsilon^2 m_k^2) + ln(b_k^2 + epsilon^2 m_k^2)

(stochastic embedding: Goodwin, Gevers & Ninness, IEEE Trans. Automatic Control 37, 1992). m_k is
the error that a loop tolerates: because of K S = T/G, a model error has the effect |T| |G_k -
G(theta)_k|/|G| on the loop. At an antiresonance of G, |T| is small as well, so |G| is smoothed. For
four machines with many modes the square of |T_c| gave better models than |T_c|, because low
frequencies matter more to a loop than |T_c| itself suggests (control-relevant identification:
Schrama 1992; de Callafon & Van den Hof 1995; Oomen & Bosgra 2012).
"""

from __future__ import annotations

import numpy as np
from scipy.optimize import minimize_scalar

_OCTAVE = 2.0
_MAX_WINDOWS = 200  # windows of the running median; m is interpolated between them
_N_SIZES = 80  # values of epsilon on the first grid of a search
_N_BALANCE = 8  # rounds that balance rows and columns; each divides the imbalance by ten or more
_LEAST_ENTRY = 1e-30  # stands for a zero, relative to the largest entry


def smooth_size(omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (..., F) |G| smoothed over an octave by a running median, which ignores a mode.

    omega : (F,) [rad/s], in any order; G : (..., F).
    """
    order = np.argsort(omega, kind="stable")
    x, size = omega[order], np.abs(G)[..., order]
    first = np.searchsorted(x, x / np.sqrt(_OCTAVE), "left")
    last = np.searchsorted(x, x * np.sqrt(_OCTAVE), "right")
    picked = np.unique(np.linspace(0, x.size - 1, min(x.size, _MAX_WINDOWS)).astype(int))
    medians = np.stack([np.median(size[..., first[k] : last[k]], axis=-1) for k in picked], axis=-1)
    log = np.log(np.maximum(medians, np.finfo(float).tiny)).reshape(-1, picked.size)
    out = np.empty(size.shape)
    out[..., order] = np.exp([np.interp(np.log(x), np.log(x[picked]), row) for row in log]).reshape(
        size.shape
    )
    return out


def mean_size(omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (F,) the geometric mean over the entries of smoothed |G|, G (n_y, n_u, F): its slope,
    in any units.
    """
    return np.asarray(np.exp(np.mean(np.log(smooth_size(omega, G)), axis=(0, 1))))


def target_loop(
    omega: np.ndarray, omega_c: float, smooth: np.ndarray, shape: np.ndarray | float = 1.0
) -> np.ndarray:
    """Return (..., W) |T_c| of a loop with the crossover omega_c [rad/s]; one if omega_c is nan.

    |T_c| = 1/sqrt(1 + 1/|L|^2) with |L| = (2 omega_c/omega)^n. Beyond the crossover the loop gain falls by one slope
    with the controller and by up to one more with the plant: n = 2 for a mass, and n = 1 where |G|
    is flat.

    smooth : (..., W) |G| smoothed; its mean slope beyond the crossover gives n.
    shape : |G| over |G| smoothed: with a smooth controller the loop gain is proportional to it.

    >>> target_loop(np.array([0.0, 2.0, 20.0]), 1.0, np.array([1.0, 1.0, 0.01])).round(3).tolist()
    [1.0, 0.707, 0.01]
    >>> target_loop(np.array([0.0, 2.0, 20.0]), 1.0, np.ones(3)).round(3).tolist()
    [1.0, 0.707, 0.1]
    """
    if np.isnan(omega_c):
        return np.ones(np.shape(smooth))
    x = omega / (2 * omega_c)
    beyond = x >= 0.5
    # each octave counts the same
    u = np.log(x[beyond])
    level = np.log(smooth[..., beyond])
    share = 1 / x[beyond]
    if u.size:
        u = u - np.average(u, weights=share)
    spread = max(float(share @ u**2), np.finfo(float).tiny)
    n = 1 + np.clip(-(level * share) @ u / spread, 0.0, 1.0)[..., None]
    with np.errstate(divide="ignore"):
        return np.asarray(1 / np.sqrt(1 + (np.where(x < 1, x**2, x**n) / shape) ** 2))


def loop_tolerance(omega: np.ndarray, G: np.ndarray, omega_c: float) -> np.ndarray:
    """Return (..., F) m = |G| smoothed over an octave, over |T_c|^2: the error of G with the same
    cost for a loop.

    omega : (F,) [rad/s], in any order; G : (..., F).
    """
    smooth = smooth_size(omega, G)
    return smooth / target_loop(omega, omega_c, smooth) ** 2


def most_likely_size(
    square: np.ndarray, var: np.ndarray, tolerance: np.ndarray
) -> tuple[float, float]:
    """Return the most likely epsilon for given squared residuals, and the negative log likelihood
    there.

    square, var, tolerance : (N,) |G - model|^2, b^2 and m. The likelihood may have several maxima:
    a grid finds the largest, then its neighbourhood is searched.
    """
    power = tolerance**2

    def unlikely(log_size: float) -> float:
        total = var + np.exp(2 * log_size) * power
        return float(np.sum(square / total + np.log(total)))

    least = np.log(1e-3 * np.min(np.sqrt(var) / tolerance))
    most = np.log(10 * np.max(np.sqrt(square + var) / tolerance))
    sizes = np.linspace(least, most, _N_SIZES)
    k = int(np.argmin([unlikely(size) for size in sizes]))
    around = sizes[max(k - 1, 0)], sizes[min(k + 1, _N_SIZES - 1)]
    found = minimize_scalar(unlikely, bounds=around, method="bounded", options={"xatol": 1e-6})
    return float(np.exp(found.x)), float(found.fun)


def balance(size: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return rows (..., n) and columns (..., m) whose product has the mean squares of the rows and
    columns of a matrix.

    size : (..., n, m), not negative. The product does not depend on the units of inputs and
    outputs.
    """
    log = np.log(np.maximum(size, _LEAST_ENTRY * np.max(size, axis=(-2, -1), keepdims=True)))
    by_row = np.mean(log, axis=-1, keepdims=True)
    by_column = np.mean(log - by_row, axis=-2, keepdims=True)
    square = np.exp(2 * (log - by_row - by_column))  # free of the units of rows and columns
    columns = np.ones((*size.shape[:-2], 1, size.shape[-1]))
    for _ in range(_N_BALANCE):
        rows = np.mean(square / columns, axis=-1, keepdims=True)
        columns = np.mean(square / rows, axis=-2, keepdims=True)
    return (np.exp(by_row) * np.sqrt(rows))[..., 0], (np.exp(by_column) * np.sqrt(columns))[
        ..., 0, :
    ]
