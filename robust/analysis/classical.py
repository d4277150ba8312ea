"""Crossover, phase and gain margin and bandwidth from the loop gain."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import (
    format_hertz,
    require_real_array,
)
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust.lti.connections import closed_loop
from robust.lti.grids import BELOW_NYQUIST, NO_PEAK, Peak, mode_lines, structure_grid
from robust.lti.lti import poles, response, timebase, to_s_plane, zeros
from robust.lti.realisation import state_space
from robust.pages.section import Fact

_BETWEEN = 8  # subdivisions between two frequencies of the grid of a system
#: Usual limit of |S| over a set; it leaves a phase margin of 29 deg and a gain margin of 2 (SP
#: 2.4.3).
USUAL_PEAK = 2.0
#: Phase margin [deg] below which a loop is close to instability (SP 2.4.3).
USUAL_PHASE_MARGIN = 30.0
# When the first or the last value of a loop gain counts as a negative number. The next value is at
# least _APART away [log]. |Im L / Re L| at the end must be below _NEARLY_REAL, and one of two: it is
# _SMALLER times that of the next value (just below Nyquist); or it is _PROPORTIONAL to the distance
# from zero or infinite frequency [relative error], and the slope of |L| is below _FLAT.
_NEARLY_REAL, _SMALLER, _PROPORTIONAL, _FLAT, _APART = 0.05, 0.1, 0.1, 0.05, 1e-4
# Rounds in which the intervals with a crossing are divided, and parts of each interval.
_N_DIVISIONS, _PARTS = 4, 16


@value
class ClassicalMargins:
    """Crossover, phase margin, gain margin and bandwidth of a loop; valid for a stable loop only.

    Fields
    ------
    crossovers : tuple of float
        Every frequency with |L| = 1 [rad/s], increasing.
    phase : Peak or None
        Smallest |180 deg + arg L| over all frequencies with |L| = 1 [rad], and its frequency
        [rad/s]; None without crossover.
    delay_margin : float
        Smallest additional delay that puts L on -1, over all frequencies with |L| = 1 [s]; inf
        without crossover.
    gain, reduction : Peak or None
        Smallest factor above one, and largest below one, on the loop gain that puts L on -1, and
        its frequency [rad/s]; None if there is none.
    bandwidth : float
        Lowest frequency at which |S| rises to 1/sqrt(2) [rad/s]; nan if |S| starts above it or
        never reaches it.

    References
    ----------
    SP 2.4.3 (margins), 2.4.5 (bandwidth).

    Examples
    --------
    L = 4/(s + 1)^3: phase crossover at sqrt(3) with |L| = 1/2.

    >>> omega = np.geomspace(1e-2, 1e2, 2000)
    >>> seen = classical_margins(omega, 4 / (1j * omega + 1) ** 3)
    >>> round(seen.gain_margin, 4), round(seen.omega_gain**2, 4)
    (2.0, 3.0)
    """

    crossovers: tuple[float, ...] = ()
    phase: Peak | None = None
    delay_margin: float = float("inf")
    gain: Peak | None = None
    reduction: Peak | None = None
    bandwidth: float = float("nan")

    @property
    def phase_margin(self) -> float:
        """Smallest |180 deg + arg L| over all frequencies with |L| = 1 [rad]; nan without
        crossover.
        """
        return (self.phase or NO_PEAK).value

    @property
    def omega_phase(self) -> float:
        """Frequency of the phase margin [rad/s]; nan without crossover."""
        return (self.phase or NO_PEAK).omega

    @property
    def gain_margin(self) -> float:
        """Smallest factor above one on the loop gain that puts L on -1; inf if there is none."""
        if self.gain is None:
            return float("inf")
        return self.gain.value

    @property
    def omega_gain(self) -> float:
        """Frequency of the gain margin [rad/s]; nan if no factor puts L on -1."""
        return (self.gain or NO_PEAK).omega

    @property
    def gain_reduction(self) -> float:
        """Largest factor below one on the loop gain that puts L on -1; 0 if there is none."""
        if self.reduction is None:
            return 0.0
        return self.reduction.value

    @property
    def omega_reduction(self) -> float:
        """Frequency of the gain reduction [rad/s]; nan if no factor puts L on -1."""
        return (self.reduction or NO_PEAK).omega

    @property
    def crossover(self) -> float:
        """Highest frequency with |L| = 1 [rad/s]; nan without crossover."""
        if self.crossovers:
            return self.crossovers[-1]
        return float("nan")

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Crossover, margins and bandwidth as lines of a report."""
        high, low = (
            20 * np.log10(gain or np.nan) for gain in (self.gain_margin, self.gain_reduction)
        )
        return (
            Fact(
                "crossovers" if len(self.crossovers) > 1 else "crossover",
                ", ".join(map(format_hertz, self.crossovers)) or "none: |L| never crosses one",
            ),
            Fact(
                "phase margin",
                Peak(np.degrees(self.phase_margin), self.omega_phase),
                "deg",
                f"customary are {USUAL_PHASE_MARGIN:g} deg or more",
            ),
            Fact("gain margin", Peak(high, self.omega_gain), "dB", "allowed rise of the gain"),
            Fact(
                "lower gain margin",
                Peak(low, self.omega_reduction),
                "dB",
                "allowed fall of the gain",
            ),
            Fact(
                "bandwidth of S",
                self.bandwidth / (2 * np.pi),
                "Hz",
                "disturbances below it are reduced",
            ),
        )

    def __str__(self) -> str:
        return ", ".join(str(fact) for fact in self.facts if fact.amount)


def classical_margins(
    omega: np.ndarray | AnySystem, L: np.ndarray | None = None
) -> ClassicalMargins:
    """Return gain margin, phase margin and bandwidth of a loop, from L as a system or as values.

    Use this for a quick comparison with other tools. The report of `check` contains these margins,
    too (`RobustnessReport.classical`).

    Parameters
    ----------
    omega : (W,) ndarray, or control system
        Frequencies [rad/s], increasing and dense; or the loop gain L = G K as a system, for which
        the frequencies are chosen automatically.
    L : (W,) complex ndarray, optional
        Loop gain at these frequencies; values that are not finite are ignored.

    Returns
    -------
    ClassicalMargins
        The margins, computed by linear interpolation of log |L| and phase over log frequency. A
        gain margin may also stand at the first or the last frequency, if L tends to a negative
        number there.

    Raises
    ------
    ValueError
        Arrays of different sizes, frequencies that do not increase.

    References
    ----------
    SP 2.4.3 (margins), 2.4.5 (bandwidth).

    Examples
    --------
    >>> omega = np.geomspace(1e-2, 1e2, 2000)
    >>> seen = classical_margins(omega, 2 / (1j * omega * (1j * omega + 1)))
    >>> round(float(np.degrees(seen.phase_margin)), 1)                # 90 deg - atan(1.2496)
    38.7
    >>> print(classical_margins(control.tf([2], [1, 1, 0])))
    crossover 0.1989 Hz, phase margin 38.67 deg at 0.1989 Hz, gain margin infinite, bandwidth of S
      0.1333 Hz
    """
    if L is None:
        omega, L = _loop_gain_of(omega)
    else:
        omega, L = _check_loop_gain(omega, L)
    known = np.isfinite(L) & (L != 0)
    x, L = np.log(omega[known]), L[known]
    if x.size < 2:
        return ClassicalMargins()
    size, phase = np.log(np.abs(L)), np.unwrap(np.angle(L))
    found = ClassicalMargins()
    at = _zero_crossings(x, size)
    if at.size:
        off = np.interp(at, x, phase)
        margin = np.abs((off + 2 * np.pi) % (2 * np.pi) - np.pi)
        k = int(np.argmin(margin))
        found = replace(
            found,
            crossovers=tuple(np.exp(at).tolist()),
            phase=Peak(float(margin[k]), float(np.exp(at[k]))),
            delay_margin=float(((off + np.pi) % (2 * np.pi) / np.exp(at)).min()),
        )
    turns = np.arange(
        np.ceil((phase.min() / np.pi - 1) / 2), np.floor((phase.max() / np.pi - 1) / 2) + 1
    )
    real = [_zero_crossings(x, phase - (2 * n + 1) * np.pi) for n in turns]
    # at zero, infinite or the Nyquist frequency the phase ends, and crosses nothing
    for end, inwards, values in ((x[:1], x, L), (x[-1:], -x[::-1], L[::-1])):
        if _tends_to_negative_number(inwards, values):
            real.append(end)
    at = np.unique(np.concatenate([np.zeros(0), *real]))
    factor = np.exp(-np.interp(at, x, size))
    found = replace(
        found,
        gain=_nearest_to_one(factor, at, factor > 1),
        reduction=_nearest_to_one(factor, at, factor < 1),
    )
    S = np.log(np.abs(1 / (1 + L))) + np.log(2) / 2
    reached = _zero_crossings(x, S)
    if S[0] < 0 and reached.size:
        return replace(found, bandwidth=float(np.exp(reached[0])))
    return found


def _tends_to_negative_number(x: np.ndarray, L: np.ndarray) -> bool:
    """Return whether a loop gain (W,) is a negative number at its first value, as at Nyquist, or
    tends to one where x (W,) tends to minus infinity.
    """
    k = int(np.searchsorted(x, x[0] + _APART))
    if L[0].real >= 0 or k == x.size:
        return False
    # Im L / Re L at the end and at the next value
    end, next_ = (one.imag / one.real if one.real else np.inf for one in (L[0], L[k]))
    expected = end * np.exp(x[k] - x[0])
    is_proportional = abs(next_ - expected) <= _PROPORTIONAL * abs(expected)
    is_flat = abs(np.log(np.abs(L[k] / L[0]))) < _FLAT * (x[k] - x[0])
    falls = abs(end) < _SMALLER * abs(next_)
    return bool(abs(end) < _NEARLY_REAL and (falls or (is_proportional and is_flat)))


def frequencies_of_crossings(
    loop_gain: Callable[[np.ndarray], np.ndarray],
    omega: np.ndarray,
    L: np.ndarray,
    *,
    roots: np.ndarray,
) -> np.ndarray:
    """Return frequencies [rad/s] close to each side of every crossover of a loop gain, of every
    crossing of the negative real axis and of |S| = 1/sqrt(2), so that `classical_margins` may
    interpolate between them.

    Near a light mode a grid in the logarithm of frequency is too coarse: |L| falls with the
    distance from the mode.

    L : (W,) loop gain on the grid omega (W,).
    roots : poles and zeros of the loop in the s plane.
    """
    modes = np.setdiff1d(mode_lines(roots, (float(omega[0]), float(omega[-1]))), omega)
    at, L = np.concatenate([omega, modes]), np.concatenate([L, loop_gain(modes)])
    at, L = at[np.argsort(at)], L[np.argsort(at)]
    found, parts = np.zeros(0), np.linspace(0, 1, _PARTS + 1)
    for left in reversed(range(_N_DIVISIONS)):
        known = np.isfinite(L) & (L != 0)
        at, L = at[known], L[known]
        above, reached = np.abs(L) > 1, np.abs(1 + L) < np.sqrt(2)
        k = np.flatnonzero(
            (above[1:] != above[:-1])
            | (reached[1:] != reached[:-1])
            | (np.abs(np.diff(np.angle(L))) > np.pi)
        )
        found = np.union1d(at[k], at[k + 1])
        if left:
            at = np.unique(at[k, None] * (at[k + 1] / at[k])[:, None] ** parts)
            L = loop_gain(at)
    return found


def _nearest_to_one(factor: np.ndarray, x: np.ndarray, side: np.ndarray) -> Peak | None:
    """Return the factor (n,) nearest to one on one side of it, with its frequency exp x; None if
    there is none on this side.
    """
    if not side.any():
        return None
    k = np.flatnonzero(side)[np.argmin(np.abs(np.log(factor[side])))]
    return Peak(float(factor[k]), float(np.exp(x[k])))


def _loop_gain_of(L: object) -> tuple[np.ndarray, np.ndarray]:
    """Return the response of a system with one channel, on a grid dense around its poles and those
    of its loop.
    """
    if isinstance(L, control.FrequencyResponseData):
        return _check_loop_gain(np.asarray(L.omega), np.squeeze(np.asarray(L.frdata)))
    system = state_space("L", L)
    dt, one = timebase(system), control.StateSpace([], [], [], [[1.0]], None)
    closed = control.StateSpace(*closed_loop(system, one, ("e",), ("r",)), dt)
    grid = np.log(np.union1d(structure_grid(system)[1:], structure_grid(closed)[1:]))
    omega = np.exp(
        np.interp(np.arange(0, grid.size - 1 + 1e-9, 1 / _BETWEEN), np.arange(grid.size), grid)
    )
    if dt:
        omega = np.unique(np.minimum(omega, np.pi / dt * BELOW_NYQUIST))
    roots = to_s_plane(np.concatenate([poles(system), zeros(system), poles(closed)]), dt)
    crossings = frequencies_of_crossings(
        lambda at: response(system, at), omega, response(system, omega), roots=roots
    )
    omega = np.union1d(omega, crossings)
    return omega, response(system, omega)


def _check_loop_gain(omega: np.ndarray, L: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and loop gain as arrays of one size; refuse others."""
    omega, L = require_real_array("omega", omega, ndim=1), np.asarray(L)
    if L.shape != omega.shape or L.dtype.kind not in "iufc":
        raise ValueError(
            f"L must have one number for each frequency, shape ({omega.size},), got {L.dtype}"
            f" of shape {L.shape}"
        )
    if omega.size and not (omega[0] > 0 and np.all(np.diff(omega) > 0)):
        raise ValueError("omega must be positive and increase")
    return omega, L


def _zero_crossings(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return the zeros of a piecewise linear function."""
    k = np.flatnonzero((y[:-1] < 0) != (y[1:] < 0))
    return np.asarray(x[k] + (x[k + 1] - x[k]) * y[k] / (y[k] - y[k + 1]))
