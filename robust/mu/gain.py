"""What a set of perturbations can make of a gain, and the bound of mu by a solver of its own, to check against."""

from __future__ import annotations

from typing import Any

import numpy as np

from robust.mu.blocks import structure
from robust.mu.upper import bounded, response_matrices

__all__ = ["worst_gain"]


N_HALVINGS = 40


def worst_gain(N: np.ndarray, blocks: Any) -> np.ndarray:
    """An upper bound on the gain from the inputs to the outputs that no block closes, over all perturbations.

    Parameters
    ----------
    N : (n_out, n_in, W) ndarray
        Response; the first outputs and inputs belong to the perturbations, the others are the performance.
    blocks : list
        The perturbations, of size at most one, as for `mu_upper`.

    Returns
    -------
    (W,) ndarray
        Bound on the largest singular value over the set at each frequency;
        inf where the perturbations may make the loop singular.

    Raises
    ------
    ValueError
        Blocks that leave nothing for the performance.

    References
    ----------
    SP 8.10.3 (skewed mu); Packard & Doyle 1993.

    Examples
    --------
    S of L = 1 with 50 % uncertain gain: at worst 1/(1 + 0.5).

    >>> N = np.array([[-0.5 * 0.5, 0.5], [-0.5 * 0.5, 0.5]])[:, :, None]
    >>> round(float(worst_gain(N, [(1, 1)])[0]), 6)
    0.666667
    """
    M = response_matrices("N", N)
    rows, cols = structure("blocks", blocks).shape
    W, n_out, n_in = M.shape
    if rows >= n_out or cols >= n_in:
        raise ValueError(
            f"blocks must leave some of the {n_out} outputs and {n_in} inputs of N to the performance, "
            f"got {rows} rows and {cols} columns"
        )
    whole = [*blocks, (n_out - rows, n_in - cols)]
    stability = bounded(M[:, :rows, :cols], blocks).value
    open_ = np.flatnonzero(stability < 1)
    gain = np.full(W, np.inf)
    if not open_.size:
        return gain

    def fits(g: np.ndarray) -> np.ndarray:
        scaled = M[open_].copy()
        scaled[:, rows:] /= g[:, None, None]
        return np.asarray(bounded(scaled, whole).value < 1)

    size = np.linalg.norm(M[open_][:, rows:, cols:], axis=(1, 2)) + 1e-300
    low, high = size * 1e-3, size * 1.0001
    for _ in range(60):
        wide = ~fits(high)
        if not wide.any():
            break
        low, high = np.where(wide, high, low), np.where(wide, high * 4, high)
    for _ in range(N_HALVINGS):
        middle = np.sqrt(low * high)
        good = fits(middle)
        low, high = np.where(good, low, middle), np.where(good, middle, high)
        if np.all(high <= low * (1 + 1e-7)):
            break
    gain[open_] = np.where(fits(high), high, np.inf)
    return gain
