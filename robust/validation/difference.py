"""Shape and level of the difference of two records.

What is tested is the difference between the two records, d = G_2 - G_1, as both scatter about one BLA where nothing has
changed. Divided by its standard deviation it is white: z_k, of independent phases whatever their sizes are. Two things
may be wrong with it, and they are told apart.

shape   d goes along a change of gain, delay or frequency, x_k = dG_k/dtheta over the same deviation. By chance the
        score s = sum Re(conj(x_k) z_k) has the covariance C = 1/2 sum |z_k|^2 Re(conj(x_k) x_k^T), given the sizes
        |z_k|: then s^T C^-1 s is chi-square of three degrees of freedom. It needs no level: a wrong one drops out.
level   what is left of d is larger than both records say that they scatter.
"""

from __future__ import annotations

import numpy as np
from scipy.special import gammaincc, ndtr

__all__ = ["local_slope", "shape_and_level", "shared_lines"]


WINDOW = 9  # lines over which the slope of an FRF is taken
FEWEST = 8  # lines below which no shape is told
#: Lines: over their number, the variance of the log power of the residual of two records of one machine.
LEVEL_LINES = 2.0
SAME = 1e-9  # relative: one line


def shape_and_level(x: np.ndarray, units: np.ndarray, z: np.ndarray, n_lines: int | None = None) -> dict[str, float]:
    """Shape and level of whitened differences z (n,) along directions x (3, n), on n lines or fewer."""
    n_lines = z.size if n_lines is None else n_lines
    if n_lines < FEWEST:
        return {"p_value": float("nan")}
    score, fisher = (x.conj() @ z).real, (x.conj() @ x.T).real
    covariance = ((x.conj() * np.abs(z) ** 2) @ x.T).real / 2
    theta = np.linalg.lstsq(fisher, score, rcond=1e-12)[0]
    T = float(score @ np.linalg.lstsq(covariance, score, rcond=1e-12)[0])
    square = float(np.sum(np.abs(z - theta @ x) ** 2) / (z.size - len(x) / 2))
    gain, delay, frequency = (float(t) for t in theta * units)
    return {
        "p_value": float(gammaincc(len(x) / 2, T / 2)),
        "gain": gain,
        "delay": delay,
        "frequency": frequency,
        "level": float(np.sqrt(square)),
        "p_level": float(ndtr(-np.log(max(square, 1e-300)) / np.sqrt(LEVEL_LINES / n_lines))),
    }


def shared_lines(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """(n,) frequencies at which two records on lines (F,) of their own are compared.

    Lines of the one that has fewer in the band of both, so that no line of the other is read twice between its own:
    what scatters there would count as often, and the difference would not be white.
    """
    low, high = max(first[0], second[0]) * (1 - SAME), min(first[-1], second[-1]) * (1 + SAME)
    inside = [omega[(omega >= low) & (omega <= high)] for omega in (first, second)]
    fewer, other = (
        (inside[0], second) if 0 < inside[0].size < inside[1].size or not inside[1].size else (inside[1], first)
    )
    last = np.clip(np.searchsorted(other, fewer * (1 - SAME)), 0, other.size - 1)
    begin = np.where(np.abs(other[last] - fewer) <= SAME * fewer, last, last - 1)
    keep, read = np.zeros(fewer.size, dtype=bool), -1
    for k in range(fewer.size):
        keep[k] = begin[k] > read
        read = last[k] if keep[k] else read
    return np.asarray(fewer[keep])


def local_slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """(F,) slope of y over x by a parabola through the lines around each."""
    n = min(WINDOW, x.size)
    first = np.clip(np.arange(x.size) - n // 2, 0, x.size - n)
    window = first[:, None] + np.arange(n)
    r = x[window] - x[:, None]
    powers = np.stack([np.ones(r.shape), r, r**2], axis=-1)
    return np.asarray((np.linalg.pinv(powers) @ y[window][..., None])[:, 1, 0])
