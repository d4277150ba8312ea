"""Bounds on the magnitude of a single-loop system on frequency intervals, and exact responses."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.lti import axis_offset, make_response, poles, timebase, zeros
from robust.lti.stability import poles_with_rounding
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.polynomials import exact_roots

SLACK = 3e-6  # of a level, for the rounding in the assembly of a system


@value
class Magnitude:
    """|W(j omega)| = gain prod |j omega - zeros| / prod |j omega - poles|, for bounds on
    intervals.
    """

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def upper_each(self, low: np.ndarray, high: np.ndarray) -> np.ndarray:
        """Return (I,) an upper bound on each finite interval; it becomes tight as the interval
        shrinks.
        """
        z, p = self.zeros / 1j, self.poles / 1j
        middle, half = (low + high) / 2, (high - low) / 2
        with np.errstate(divide="ignore", invalid="ignore"):
            crude = _log_max_distance(z, low, high) - _log_min_distance(p, low, high)
            at = np.log(np.abs(middle[:, None] - z)).sum(axis=1) - np.log(
                np.abs(middle[:, None] - p)
            ).sum(axis=1)
            z_low, z_high = _slope_range(z, low, high)
            p_low, p_high = _slope_range(p, low, high)
            fine = at + half * np.maximum(np.abs(z_high - p_low), np.abs(z_low - p_high))
            return self.gain * np.exp(np.fmin(crude, fine)) * (1 + 1e-9)


def _log_max_distance(roots: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (I,) log product of the largest distances of the roots from each interval."""
    ends = np.maximum(np.abs(low[:, None] - roots), np.abs(high[:, None] - roots))
    return np.asarray(np.log(ends).sum(axis=1))


def _log_min_distance(roots: np.ndarray, low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Return (I,) log product of the smallest distances of the roots from each interval."""
    with np.errstate(divide="ignore"):
        nearest = np.clip(roots.real, low[:, None], high[:, None]) - roots
        return np.asarray(np.log(np.abs(nearest)).sum(axis=1))


def _slope_range(
    roots: np.ndarray, low: np.ndarray, high: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (I,), (I,) range over each interval of the derivative of the log distances, summed
    root by root.
    """
    a = np.abs(roots.imag)
    first, last = low[:, None] - roots.real, high[:, None] - roots.real
    with np.errstate(divide="ignore", invalid="ignore"):
        # t/(t^2 + a^2) has its extremes +-1/(2a) at t = +-a; nan only for a root on the interval
        at_first, at_last, peak = first / (first**2 + a**2), last / (last**2 + a**2), 1 / (2 * a)
        most = np.where((first <= a) & (a <= last), peak, np.maximum(at_first, at_last))
        least = np.where((first <= -a) & (-a <= last), -peak, np.minimum(at_first, at_last))
    return np.nan_to_num(least, nan=-np.inf).sum(axis=1), np.nan_to_num(
        most, nan=np.inf, posinf=np.inf
    ).sum(axis=1)


def magnitude_of(system: control.StateSpace) -> Magnitude:
    """Return the magnitude of a single-loop system over omega; for a discrete one over x =
    tan(omega dt/2).
    """
    z, p = zeros(system), poles(system)
    dt = timebase(system)
    if dt:
        z, p = (z - 1) / (z + 1), (p - 1) / (p + 1)
        z, p = z[np.abs(z) < 1e12], p[np.abs(p) < 1e12]
    # the gain from one point without a root nearby
    point = 1.2345 * (np.exp(np.mean(np.log(np.abs(p[p != 0])))) if np.any(p != 0) else 1.0)
    if dt:
        at = np.exp(2j * np.arctan(point))
    else:
        at = 1j * point
    if system.nstates:
        value_there = abs(complex(system(at)))
    else:
        value_there = abs(system.D[0, 0])
    gain = value_there * float(np.prod(np.abs(1j * point - p)) / np.prod(np.abs(1j * point - z)))
    return Magnitude(zeros=z, poles=p, gain=gain)


# ---- Responses in doubles: from the matrices if rounding hardly moves a mode, else from exact
# roots.

_MAX_POLE_SHIFT = 0.1  # of its distance to the axis: largest shift of a pole by rounding
_AXIS_DISTANCE = 1e-8  # of its modulus: least distance of a pole to the axis that is assumed
_MAX_EXACT_STATES = 40  # largest number of states for exact roots


def poles_are_uncertain(poles: np.ndarray, moved: np.ndarray, discrete: bool) -> bool:
    """Return whether rounding may have moved a pole by about as much as it is damped."""
    if discrete:
        damping = np.abs(np.abs(poles) - 1)
        size = np.abs(poles - 1)
    else:
        damping = np.abs(poles.real)
        size = np.abs(poles)
    return bool(np.any(moved > _MAX_POLE_SHIFT * np.maximum(damping, _AXIS_DISTANCE * size)))


def trusted_responder(system: control.StateSpace) -> Callable[[np.ndarray], np.ndarray]:
    """Return `robust.lti.lti.make_response`; from exact roots if modes over decades share poor
    coordinates.
    """
    dt = timebase(system)
    if not 1 < system.nstates <= _MAX_EXACT_STATES or not poles_are_uncertain(
        *poles_with_rounding(system), bool(dt)
    ):
        return make_response(system)
    roots = exact_roots(to_matrices(system))
    return lambda omega: roots.at(axis_offset(omega, dt))
