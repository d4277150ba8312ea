"""Harmonic grids: the excited DFT lines, and the detection lines, which are not excited, so that
they show distortion.

Line k is the frequency k fs / n_samples. If only odd lines are excited, the odd part of a
nonlinearity acts on odd lines, and its even part on even lines. So output on odd lines without
excitation is odd distortion, and output on even lines is even distortion (Pintelon & Schoukens,
4.3).
"""

from __future__ import annotations

from functools import cached_property, lru_cache
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import format_count
from nlfrf._base.values import ArrayField, value

if TYPE_CHECKING:
    from numpy.typing import ArrayLike

KINDS = ("full", "odd", "odd-odd", "special-odd", "random-odd", "custom")
_MAX_LINE = 1 << 28  # a period of half a gigasample; a larger line number is a mistake
#: Excited residues and their modulus, for the periodic grids.
_RESIDUES: dict[str, tuple[tuple[int, ...], int]] = {
    "full": ((0,), 1),
    "odd": ((1,), 2),
    "odd-odd": ((1,), 4),
    "special-odd": ((1, 3), 8),
}


@value
class LineGrid:
    """Excited lines of a multisine, and detection lines between them, which are not excited.

    Line k is the frequency k fs / n_samples. `multisine` makes the grid of a design. Make one
    yourself for a record whose excitation comes from elsewhere.

    Parameters
    ----------
    excited : (F,) int ndarray
        Numbers of the excited lines: increasing, at least 1.
    odd, even : (O,), (E,) int ndarray, optional
        Numbers of the odd and of the even detection lines. By default all lines between the first
        and the last excited one that are not excited.

    Raises
    ------
    ValueError
        The lines are not whole, positive, increasing numbers, or a detection line is also excited.

    Examples
    --------
    >>> LineGrid(excited=[1, 3, 9, 11]).odd
    array([5, 7])
    """

    excited: ArrayField
    odd: ArrayField = None
    even: ArrayField = None

    def __post_init__(self) -> None:
        excited = _line_numbers("excited", self.excited)
        if excited.size == 0:
            raise ValueError("excited must hold at least one line, got none")
        if self.odd is None or self.even is None:
            rest = detection_lines(excited)
        else:
            rest = excited
        if self.odd is None:
            odd = rest[rest % 2 == 1]
        else:
            odd = _line_numbers("odd", self.odd)
        if self.even is None:
            even = rest[rest % 2 == 0]
        else:
            even = _line_numbers("even", self.even)
        for name, detection, remainder in (("odd", odd, 1), ("even", even, 0)):
            if np.any(detection % 2 != remainder):
                wrong = detection[detection % 2 != remainder]
                raise ValueError(f"{name} must hold {name} lines only, got line {wrong[0]}")
            both = np.intersect1d(detection, excited, assume_unique=True)
            if both.size:
                raise ValueError(f"{name} must not hold excited lines, got line {both[0]}")
        for name, array in (("excited", excited), ("odd", odd), ("even", even)):
            array.flags.writeable = False
            object.__setattr__(self, name, array)

    @cached_property
    def kind(self) -> str:
        """Kind of the grid: "special-odd", "random-odd", "odd-odd", "odd", "full" or "custom"."""
        return recognise_kind(self.excited)


def describe_band(f: np.ndarray) -> str:
    """Return number and range of frequencies (F,) [Hz] as text.

    >>> describe_band(np.array([1.0, 3.0]))
    '2 lines from 1 to 3 Hz'
    """
    return f"{format_count(f.size, 'line')} from {f[0]:.4g} to {f[-1]:.4g} Hz"


def detection_lines(excited: np.ndarray) -> np.ndarray:
    """Return every line between the first and the last excited one that is not excited."""
    if excited[-1] > _MAX_LINE:
        raise ValueError(f"excited must be lines of at most {_MAX_LINE}, got {excited[-1]}")
    return np.setdiff1d(np.arange(excited[0], excited[-1]), excited, assume_unique=True)


def _line_numbers(name: str, lines: ArrayLike) -> np.ndarray:
    """Return lines as an increasing int array; refuse anything else."""
    array = np.asarray(lines)
    if array.ndim != 1:
        raise ValueError(f"{name} must be one-dimensional, got shape {array.shape}")
    if array.dtype.kind not in "iuf" or not np.all(array == np.floor(array)):
        raise ValueError(f"{name} must be whole DFT line numbers, got {array[:4].tolist()}...")
    array = array.astype(np.int64)
    if array.size and array[0] < 1:
        raise ValueError(
            f"{name} must be lines of at least 1 (line 0 is the mean), got {array.min()}"
        )
    if np.any(np.diff(array) <= 0):
        raise ValueError(f"{name} must be increasing without repeats, got {array[:6].tolist()}...")
    return array


def grid_lines(kind: str, first: int, *, last: int, rng: np.random.Generator) -> LineGrid:
    """Return the grid of a kind on the lines first..last (both included if the kind excites them).

    ``random-odd`` leaves out one line, drawn by `rng`, of every four consecutive odd lines.
    """
    if kind == "random-odd":
        odd = np.arange(first + (first + 1) % 2, last + 1, 2)
        groups = odd.size // 4
        left_out = odd[4 * np.arange(groups) + rng.integers(0, 4, size=groups)]
        excited = np.setdiff1d(odd, left_out, assume_unique=True)
    else:
        residues, modulus = _RESIDUES[kind]
        band = np.arange(first, last + 1)
        excited = band[np.isin(band % modulus, residues)]
    return LineGrid(excited=excited)


def recognise_kind(excited: np.ndarray) -> str:
    """Return the kind of grid of excited lines; "custom" if it is none of the known ones."""
    if excited.size < 2:
        return "custom"
    steps = np.diff(excited)
    if np.all(steps == 1):
        return "full"
    if np.any(excited % 2 == 0):
        return "custom"
    if np.all(steps == 2):
        return "odd"
    if np.all(steps == 4):
        return "odd-odd"
    # 8k+1, 8k+3, or the same pattern from another odd line on: alternate steps of 2 and 6
    if excited.size >= 3 and set(steps[:2].tolist()) == {2, 6} and np.all(steps[2:] == steps[:-2]):
        return "special-odd"
    if _is_special_odd(excited):
        return "random-odd"
    return "custom"


def _is_special_odd(excited: np.ndarray) -> bool:
    """Return whether odd lines fall into groups of four consecutive ones, each with one line
    missing.
    """
    index = (excited - excited[0]) // 2
    if index[-1] < 8:
        return False
    for shift in range(4):  # place of the first excited line in its group
        counts = np.bincount((index + shift) // 4)
        inner, edges = counts[1:-1], counts[[0, -1]]
        if np.all(inner == 3) and np.all(edges <= 4) and np.all(edges >= 1):
            return True
    return False


def local_mean(x: np.ndarray, n: int) -> np.ndarray:
    """Return the mean over the n neighbours of each entry along the last axis, one-sided at the
    ends.
    """
    size, half = x.shape[-1], n // 2
    total = np.empty(
        (*x.shape[:-1], size + 2 * half + 1)
    )  # running sums, constant beyond either end
    total[..., : half + 1] = 0.0
    end = half + 1 + size
    np.add.accumulate(x, axis=-1, out=total[..., half + 1 : end])
    total[..., end:] = total[..., end - 1 : end]
    return np.asarray(
        (total[..., 2 * half + 1 :] - total[..., :size]) / _neighbour_counts(size, half)
    )


@lru_cache(maxsize=64)
def _neighbour_counts(size: int, half: int) -> np.ndarray:
    """Return (size,) the number of entries within `half` of each."""
    centre = np.arange(size)
    return np.minimum(centre + half + 1, size) - np.maximum(centre - half, 0)


# ---- Chance correlation of vectors with random phases.


def chance_correlation(chance: float, n: float) -> float:
    """Return the share of power that unit vectors of n random phases have in common with
    probability `chance`.

    The probability of a share above c is (1 - c)^(n - 1).

    >>> round(chance_correlation(0.01, 2), 2), round(chance_correlation(0.01, 100), 3)
    (0.99, 0.045)
    """
    return float(1 - chance ** (1 / (n - 1)))
