"""Indices of the lines of a grid, and windows of neighbouring lines around each excited line.

They are computed once for each grid, and used by every estimate of the distortion.
"""

from __future__ import annotations

from functools import lru_cache

import numpy as np

from nlfrf._base.values import value
from nlfrf.signals.lines import LineGrid

N_CACHED_GRIDS = 16  # number of cached grids: those of one experiment, and of the next
_N_ODD_BELOW_BAND = 2  # detection lines below the band
WINDOW_LINES = 9  # excited lines over which an FRF is fitted locally
SMOOTHING_LINES = (
    9  # neighbouring lines over which powers and gains are averaged before they are compared
)


@value(copy=False)
class LineIndex:
    """The excited and detection lines of a grid in one row, and the windows of neighbours around
    each excited line.
    """

    lines: np.ndarray  # (K,) all lines, increasing
    # excited, odd, even: (F,) or (O,) or (E,) indices of each kind of line in `lines`
    excited: np.ndarray
    odd: np.ndarray
    even: np.ndarray
    detection: np.ndarray  # (D,) the odd detection lines, and odd lines just below the band
    # excited_windows, odd_windows: (F, n) for each excited line the nearest excited and odd lines,
    # nearest first, as indices into `excited` and `detection`
    excited_windows: np.ndarray
    odd_windows: np.ndarray
    # (n, k, F) for each excited line the nearest odd lines, and the nearest even ones if there are
    # any, as indices into `lines`; -1 if there are fewer. Windows are on the first axis, so that
    # sums over them run through memory in order.
    detection_windows: np.ndarray
    even_windows: np.ndarray  # (n, 1, F) the windows of even lines alone
    # excited_below, interpolation_weight: (K,) the excited line below each line, as an index into
    # `excited`, and the distance to it as a fraction of the step to the next one, from 0 to 1; 0
    # outside the band
    excited_below: np.ndarray
    interpolation_weight: np.ndarray


@lru_cache(maxsize=N_CACHED_GRIDS)
def index_lines(grid: LineGrid, n_detection: int = 6) -> LineIndex:
    """Return the lines of a grid in one row, with windows of `n_detection` detection lines."""
    detection = np.concatenate([_odd_lines_below_band(grid), grid.odd])
    lines = np.sort(np.concatenate([grid.excited, detection, grid.even]))
    excited, odd, even = (
        np.searchsorted(lines, np.asarray(kind)) for kind in (grid.excited, grid.odd, grid.even)
    )
    near_odd, near_even = (
        nearest_lines(grid.excited, kind, n_detection) for kind in (detection, grid.even)
    )
    windows = [np.searchsorted(lines, detection)[near_odd]] + bool(even.size) * [even[near_even]]
    near_detection = np.full((len(windows), excited.size, max(one.shape[1] for one in windows)), -1)
    for row, one in zip(near_detection, windows, strict=True):
        row[:, : one.shape[1]] = one
    below = np.maximum(np.searchsorted(grid.excited, lines, side="right") - 1, 0)
    step = np.append(np.diff(grid.excited), np.inf)[below]
    return LineIndex(
        lines=lines,
        excited=excited,
        odd=odd,
        even=even,
        detection=detection,
        excited_windows=nearest_lines(grid.excited, grid.excited, WINDOW_LINES),
        odd_windows=near_odd,
        detection_windows=_move_window_axis_first(near_detection),
        even_windows=_move_window_axis_first(even[near_even][None]),
        excited_below=below,
        interpolation_weight=np.maximum(lines - grid.excited[below], 0) / step,
    )


def _odd_lines_below_band(grid: LineGrid) -> np.ndarray:
    """Return the odd lines just below the band, within an octave: without them the first windows
    are one-sided.

    In a one-sided window a level that falls with frequency, as for a hysteresis, comes out too low.
    A grid with chosen detection lines, or without any, keeps its own.
    """
    first, last = int(grid.excited[0]), int(grid.excited[-1])
    n_odd = grid.odd.size + np.count_nonzero(grid.excited % 2)
    if not grid.odd.size or n_odd < (last + 1) // 2 - first // 2:
        return np.empty(0, dtype=np.int64)
    below = np.arange(first - 2 * _N_ODD_BELOW_BAND, first, 2)
    return below[(2 * below > first) & (below % 2 == 1)]


def _move_window_axis_first(windows: np.ndarray) -> np.ndarray:
    """Return windows (k, F, n) as (n, k, F), so that sums over a window run through memory in
    order.
    """
    return np.ascontiguousarray(np.moveaxis(windows, -1, 0))


def nearest_lines(targets: np.ndarray, lines: np.ndarray, n: int) -> np.ndarray:
    """Return (F, n) indices into `lines` of the n lines nearest to each target, nearest first."""
    n, reach = min(n, lines.size), min(2 * n, lines.size)
    first = np.clip(np.searchsorted(lines, targets) - n, 0, lines.size - reach)
    near = first[:, None] + np.arange(reach)
    order = np.argsort(np.abs(lines[near] - targets[:, None]), axis=1, kind="stable")[:, :n]
    return np.asarray(first[:, None] + order)
