"""Which lines of a grid are neighbours: worked out once for each grid, as every level is read off windows of them."""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.shared.values import value

__all__ = ["KEPT", "detection_windows", "layout", "nearest"]


KEPT = 16  # grids and windows that are remembered: those of one experiment, and of the next


@value(copy=False)
class Layout:
    """The excited and detection lines of a grid in one row.

    Fields
    ------
    lines : (K,) int ndarray
        All of them, increasing.
    excited, odd, even : (F,), (O,), (E,) int ndarray
        Where each kind stands among them.
    """

    lines: np.ndarray
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray


@lru_cache(maxsize=KEPT)
def layout(grid: LineGrid) -> Layout:
    """All lines of a grid in one row."""
    lines = np.sort(np.concatenate([grid.excited, grid.odd, grid.even]))
    excited, odd, even = (np.searchsorted(lines, kind) for kind in (grid.excited, grid.odd, grid.even))
    return Layout(lines=lines, excited=excited, odd=odd, even=even)


@lru_cache(maxsize=KEPT)
def nearest(grid: LineGrid, kind: str, n: int) -> np.ndarray:
    """(F, n) for each excited line the n nearest "excited", "odd" or "even" lines, as indices into those."""
    window = nearest_lines(grid.excited, getattr(grid, kind), n)
    window.flags.writeable = False
    return window


@lru_cache(maxsize=KEPT)
def detection_windows(grid: LineGrid, kinds: tuple[str, ...], n: int) -> np.ndarray:
    """(k, F, n) the same for several kinds of detection lines, as places among all lines; -1 where there are fewer."""
    found = [getattr(layout(grid), kind)[nearest(grid, kind, n)] for kind in kinds]
    windows = np.full((len(kinds), grid.excited.size, max(one.shape[1] for one in found)), -1)
    for window, one in zip(windows, found, strict=True):
        window[:, : one.shape[1]] = one
    windows.flags.writeable = False
    return windows


def nearest_lines(at: np.ndarray, lines: np.ndarray, n: int) -> np.ndarray:
    """(F, n) indices into `lines` of the n lines nearest to each of `at`, nearest first; one-sided at the ends."""
    n, reach = min(n, lines.size), min(2 * n, lines.size)
    first = np.clip(np.searchsorted(lines, at) - n, 0, lines.size - reach)
    near = first[:, None] + np.arange(reach)
    order = np.argsort(np.abs(lines[near] - at[:, None]), axis=1, kind="stable")[:, :n]
    return np.asarray(first[:, None] + order)
