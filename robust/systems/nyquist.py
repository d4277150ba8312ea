"""How often 1 + L winds about zero, counted on the lines of an FRF."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.grids import beside_modes, interpolated
from robust.systems.lti import in_s, poles, response

__all__ = ["continued", "half_turns", "integrators", "outside", "slope_at_start", "unstable_poles", "winding"]


#: Phase that a plant may turn from line to line where |L| is above the second number.
LARGEST_JUMP, SMALL_LOOP = 2 * np.pi / 3, 0.01
#: How far the phase of the first line may be from that of the integrators seen there [rad].
FARTHEST_PHASE = 1.2


def unstable_poles(K: control.StateSpace, dt: float) -> int:
    """Poles of the controller strictly outside the stability region; those on the boundary are integrators."""
    return int(outside(K, dt).size)


def outside(K: control.StateSpace, dt: float) -> np.ndarray:
    """The poles themselves."""
    p = poles(K)
    return p[np.abs(p) > 1 + 1e-9] if dt else p[p.real > 1e-9 * (1 + np.abs(p))]


def winding(omega: np.ndarray, G: np.ndarray, K: control.StateSpace, dt: float) -> tuple[int, bool]:
    """Unstable open-loop poles less unstable closed-loop poles, from 1 + G K, and whether the lines resolve it."""
    n = slope_at_start(omega, G)
    L = G * response(K, omega)
    jump = np.abs(np.angle(G[1:] / G[:-1])) > LARGEST_JUMP
    large = np.abs(L) > SMALL_LOOP
    seen = not np.any(jump & (large[1:] | large[:-1])) and clear_of_minus_one(L)
    seen &= settled_at_start(omega, G, n)
    # a loop that is still above one at its last line may cross -1 beyond it, but where that is Nyquist
    seen &= abs(L[-1]) < 1 or omega[-1] * dt > 0.9 * np.pi
    seen &= bool(np.all(np.abs(in_s(outside(K, dt), dt)) < omega[-1]))
    beyond = beside_modes(K, (omega[-1], np.pi / dt if dt else np.inf))  # where the plant is no larger than at the end
    seen &= bool(np.all(np.abs(G[-1] * response(K, beyond)) < max(1.0, abs(L[-1]))))
    omega, G = continued(omega, G, n)
    more = np.union1d(omega, beside_modes(K, (omega[0], omega[-1])))
    omega, G = more, interpolated(more, omega, G)
    F = 1 + G * response(K, omega)
    turns, clear = half_turns(F, n + integrators(K, dt))
    return round(float(turns)), bool(clear and seen and resolved(F, np.log(omega)))


def clear_of_minus_one(L: np.ndarray) -> bool:
    """Whether L passes -1 on a side that two lines leave no doubt about, wherever it crosses the negative real axis.

    A mode between two lines takes L along an arc: where the phase falls by d it may reach |L|/cos(d/2) on the way,
    where it rises (an anti-resonance) it may come down to |L| cos(d/2).
    """
    turn = np.angle(L[1:] / L[:-1])
    before = np.angle(-L[:-1])
    across = before * (before + turn) < 0
    arc = np.cos(np.abs(turn) / 2)
    ends = np.abs(np.array([L[:-1], L[1:]]))
    outer = ends.max(axis=0) / np.where(turn < 0, np.maximum(arc, 1e-9), 1.0)
    inner = ends.min(axis=0) * np.where(turn < 0, 1.0, arc)
    return bool(np.all(~across | (outer < 1) | (inner > 1)))


def slope_at_start(omega: np.ndarray, G: np.ndarray) -> int:
    """Integrators that an FRF shows over its first lines: its slope there in decades per decade, rounded.

    Where the first lines lie far apart and the slope grows from one to the next, it is less at zero: rounded down.
    """
    near = np.flatnonzero(omega <= 1.6 * omega[0])
    if near.size < 3 and omega.size >= 3:
        steep, steeper = first_slopes(omega, G)
        if steeper > steep:
            return max(0, int(np.floor(steep + 0.1)))
    near = near if near.size >= 3 else np.arange(min(3, omega.size))
    if near.size < 2:
        return 0
    return max(0, round(-float(np.polyfit(np.log(omega[near]), np.log(np.abs(G[near]) + 1e-300), 1)[0])))


def first_slopes(omega: np.ndarray, G: np.ndarray) -> tuple[float, float]:
    """How steeply |G| falls from the first line to the second and on to the third, in decades per decade."""
    slopes = -np.diff(np.log(np.abs(G[:3]) + 1e-300)) / np.diff(np.log(omega[:3]))
    return float(slopes[0]), float(slopes[1])


def settled_at_start(omega: np.ndarray, G: np.ndarray, n: int) -> bool:
    """Whether the first lines let n integrators be told: by a phase near theirs, and by a slope that stays."""
    if abs(off_phase(G[0], n)) > FARTHEST_PHASE:
        return False
    if n == 0 or omega.size < 3 or omega[2] <= 1.6 * omega[0]:
        return True
    steep, steeper = first_slopes(omega, G)
    return abs(steeper - steep) < 0.5


def off_phase(first: complex, n: int) -> float:
    """Phase [rad] of the first line from the nearest that n integrators, of either sign, can have."""
    away = float(np.angle(first * 1j**n))
    return away if abs(away) <= np.pi / 2 else float(np.angle(-first * 1j**n))


def continued(
    omega: np.ndarray, G: np.ndarray, n: int, decades: float = 5.0, points: int = 160
) -> tuple[np.ndarray, np.ndarray]:
    """An FRF carried on below its first line as n integrators with the gain it has there, for the winding number.

    The controller is known there, and may have its corners there; the phase of the plant goes to the nearest that n
    integrators can have, in proportion to frequency.
    """
    low = omega[0] * np.geomspace(10**-decades, 1, points + 1)[:-1]
    added = G[0] * (omega[0] / low) ** n * np.exp(1j * off_phase(G[0], n) * (low / omega[0] - 1))
    return np.concatenate([low, omega]), np.concatenate([added, G])


def half_turns(F: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """(...,) half turns of (..., W) curves F = 1 + L about zero from zero to infinite frequency, and whether whole.

    The phase of F turns by pi for each unstable pole that is stabilised, and by pi/2 more for each of the n
    integrators of L, taken as stable. It is followed from line to line; from the first line it is continued to the
    axis on which the integrators let F begin, from the last one to the real axis.
    """
    steps = np.angle(F[..., 1:] / F[..., :-1])
    start = F[..., 0] * np.exp(1j * n * np.pi / 2)
    opening = np.angle(np.where(start.real > 0, start, -start))
    closing = -np.angle(np.where(F[..., -1].real > 0, F[..., -1], -F[..., -1]))
    turns = (steps.sum(axis=-1) + opening + closing) / np.pi - n / 2
    largest = np.abs(steps).max(axis=-1, initial=0.0)
    whole = np.abs(turns - np.round(turns)) < 0.01
    return turns, (largest < 2.5) & (np.maximum(np.abs(opening), np.abs(closing)) < 1.0) & whole


def integrators(system: control.StateSpace, dt: float) -> int:
    """Poles at zero frequency."""
    p = poles(system)
    return int(np.sum(np.abs(p - 1) < 1e-6)) if dt else int(np.sum(np.abs(p) < 1e-9 * (1 + np.abs(p).max(initial=0))))


def resolved(F: np.ndarray, x: np.ndarray) -> bool:
    """Whether the polygon through the lines stays further from zero than the curve may bulge between them.

    The bulge h^2/8 |F''| is estimated from second differences over x, the logarithm of frequency, and doubled.
    """
    if F.size < 4:
        return False
    h, chord = np.diff(x), np.diff(F)
    slope = chord / h
    bend = 2 * np.abs(np.diff(slope)) / (h[1:] + h[:-1])
    bend = np.maximum(np.concatenate([bend[:1], bend]), np.concatenate([bend, bend[-1:]]))
    along = np.clip(-(F[:-1] * chord.conj()).real / np.maximum(np.abs(chord) ** 2, 1e-300), 0, 1)
    distance = np.abs(F[:-1] + along * chord)
    return bool(np.all(distance > 2 * h**2 / 8 * bend))
