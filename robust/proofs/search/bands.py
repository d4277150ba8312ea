"""The largest gain of a system in a band of frequencies, bounded from both sides in exact
arithmetic.

A level is tried. If the gain exceeds the level, exact arithmetic gives the frequency intervals in
which it does, and the gain inside an interval is the next level (Bruinsma & Steinbuch 1990). If the
gain exceeds it nowhere, the level is proved. Neither a frequency grid nor a Hamiltonian matrix in
floating point is used, so narrow modes and poles that are decades apart are not missed.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.lti import timebase
from robust.proofs.exact.bands import (
    Inequality,
    Pair,
    TransferMatrix,
    cut_at_crossings,
    frequency_of_point,
    gain_below,
    points_of_band,
    to_float,
    to_numbers,
)
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.polynomials import Coefficient, polynomial_roots, to_rational

_TOLERANCE = 1e-3  # relative, between both bounds
TIME_CAP = 10.0  # processor time [s] after which a bound is left undecided
_MAX_LEVELS = 60
# range of levels: a gain below it counts as zero, above it as unbounded
_SMALLEST = 1e-150
_LARGEST = 1e100


@value
class GainBound:
    """Bounds of the largest gain in a band, and the frequency [rad/s] at which the lower bound is
    attained.

    `upper` is proved at every frequency of the band. If nothing is proved, it is inf, and `reason`
    is not empty.
    """

    upper: float
    lower: float
    omega: float
    reason: str = ""

    @property
    def is_proved(self) -> bool:
        return not self.reason


def bound_gain(
    system: control.StateSpace,
    *,
    band: tuple[float, float] = (0.0, np.inf),
    tolerance: float = _TOLERANCE,
    time_cap: float = TIME_CAP,
) -> GainBound:
    """Bound the largest singular value of a system over a band [rad/s], including its ends at zero
    and infinity.

    The system need not be stable. With a pole on the axis inside the band there is no bound.

    >>> mode = control.ss(control.tf([1], [1, 2e-4, 1]))                    # a peak of 5000 at 1 rad/s
    >>> whole, above = bound_gain(mode), bound_gain(mode, band=(2.0, np.inf))
    >>> bool(5000 < whole.upper < 5006), round(whole.omega, 4), bool(1 / 3 <= above.upper < 0.334), above.omega
    (True, 1.0, True, 2.0)
    """
    H = TransferMatrix.of(to_matrices(system))
    return bound_transfer(H, timebase(system), band=band, tolerance=tolerance, time_cap=time_cap)


def bound_transfer(
    H: TransferMatrix,
    dt: float,
    *,
    band: tuple[float, float] = (0.0, np.inf),
    tolerance: float = _TOLERANCE,
    time_cap: float = TIME_CAP,
) -> GainBound:
    """Return `bound_gain` of an exact system; a discrete system is given by its bilinear image and
    its dt.
    """
    low, high = points_of_band(band, dt)
    s = polynomial_roots(H.characteristic)
    return climb(
        [H],
        gain_below,
        lambda pairs: float(np.linalg.norm(to_numbers(pairs[0][0]), 2)),
        starts=np.clip([*np.abs(s), *np.abs(s.imag), 1.0, low, high], low, high),
        bands=[(low, high)],
        dt=dt,
        tolerance=tolerance,
        deadline=time.thread_time() + time_cap,
    )


def climb(
    parts: Sequence[TransferMatrix],
    inequality: Callable[[float], Inequality],
    size: Callable[[Sequence[Pair]], float],
    *,
    starts: Sequence[float] | np.ndarray,
    bands: Sequence[tuple[float, float]] = ((0.0, np.inf),),
    dt: float = 0.0,
    tolerance: float = _TOLERANCE,
    deadline: float = np.inf,
) -> GainBound:
    """Bound the least level whose inequality holds on bands of the axis.

    size : function that gives the least level at one point, from the parts there; starts : first
    points x.
    """
    above, level = [None if np.isinf(x) else to_rational(x) for x in starts], 0.0
    for _ in range(_MAX_LEVELS):
        sizes = [_size_at(parts, size, x) for x in above]
        omega = frequency_of_point(to_float(above[int(np.argmax(sizes))]), dt)
        lower = max(level, *sizes)
        if lower > _LARGEST:
            break
        level, above = max(lower * (1 + tolerance), _SMALLEST), []
        for low, high in bands:
            pieces = cut_at_crossings(
                parts, inequality(level), low=low, high=high, deadline=deadline
            )
            if isinstance(pieces, str):
                return GainBound(upper=np.inf, lower=lower, omega=omega, reason=pieces)
            above += [piece.x for piece in pieces if not piece.M.is_positive]
        if not above:
            return GainBound(upper=level, lower=lower, omega=omega)
    reason = f"no bound was found: it grows without end near {omega:.6g} rad/s"
    return GainBound(upper=np.inf, lower=lower, omega=omega, reason=reason)


def _size_at(
    parts: Sequence[TransferMatrix], size: Callable[[Sequence[Pair]], float], x: Coefficient | None
) -> float:
    """Return the least level at a point of the axis; zero if it is unknown, at a pole."""
    try:
        return float(
            np.nan_to_num(size([part.on_axis(x) for part in parts]), nan=0.0, posinf=2 * _LARGEST)
        )
    except (ZeroDivisionError, OverflowError, np.linalg.LinAlgError):
        return 0.0
