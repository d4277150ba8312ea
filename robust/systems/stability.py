"""Whether a loop is stable, counted exactly: its poles beyond rounding, and what a delay does to them."""

from __future__ import annotations

import control
import numpy as np
from scipy.linalg import eig

from nlfrf.shared.values import value
from robust.shared.states import Stability
from robust.systems.lti import evened, poles, response, timebase
from robust.systems.norms import EPS, crossings

__all__ = ["StabilityResult", "apparent_instability", "certain_poles", "moved_out", "stable", "strong_parts"]


@value
class StabilityResult:
    """Whether a system is stable, and the pole that decides; its text is for people.

    Fields
    ------
    state : Stability
    pole : complex
        The pole nearest to the stability boundary, or farthest beyond it; nan where none is named.
    of_loop : bool
        Whether it is a pole of the nominal loop, of which the text then speaks.
    without_delay : bool
        Whether it is a pole of the loop without its delay.
    at_boundary : bool
        Whether exact arithmetic found it on the boundary or beyond it, where rounding could not tell.
    n_unstable : float
        Unstable poles of a loop with its delay, where those were counted; nan elsewhere.
    """

    state: Stability
    pole: complex = complex(np.nan, np.nan)
    of_loop: bool = False
    without_delay: bool = False
    at_boundary: bool = False
    n_unstable: float = np.nan

    @property
    def stable(self) -> bool:
        """Whether every pole is strictly stable, beyond doubt."""
        return self.state is Stability.STABLE

    @property
    def unstable(self) -> bool:
        """Whether a pole is surely not stable."""
        return self.state is Stability.UNSTABLE

    def __bool__(self) -> bool:
        raise TypeError("a StabilityResult is neither true nor false: ask for .stable or .unstable")

    def __str__(self) -> str:
        if self.stable:
            return f"{self.state}"
        named = not np.isnan(self.pole)
        where = (f" at {self.pole:.4g}" if named else "") + (" without its delay" if self.without_delay else "")
        if self.unstable and not np.isnan(self.n_unstable):
            what = f"the nominal loop with its delay has {self.n_unstable:g} unstable poles"
        elif self.unstable:
            beyond = ", on the stability boundary or beyond it" if self.at_boundary else ""
            what = f"{'the nominal loop has ' if self.of_loop else ''}a pole{where}{beyond}"
        elif named:
            what = f"a pole{' of the nominal loop' if self.of_loop else ''}{where} cannot be told from the stability "
            what += "boundary"
        else:
            what = "with its delay the nominal loop cannot be told from one on the stability boundary"
        return f"{self.state}: {what}"


def moved_out(L: control.StateSpace, delay: float) -> float:
    """How many poles of 1 + L exp(-s delay) the delay [s] moves out of the left half plane, less those it moves in.

    inf where |L| > 1 at infinite frequency, nan where rounding decides.

    >>> moved_out(control.ss(control.tf([5], [1, 1])), 0.36), moved_out(control.ss(control.tf([5], [1, 1])), 0.37)
    (0.0, 2.0)
    """
    direct = abs(float(L.D[0, 0]))
    found = crossings((L.A, L.B, L.C, L.D), 1.0)
    if direct > 1 or found is None:
        return np.inf if direct > 1 + 1e-9 else np.nan
    clusters = apart(*found)
    if not clusters:
        return 0.0
    low, high = np.array(clusters).T
    between = np.concatenate([[low[0] / 2], np.sqrt(high[:-1] * low[1:]), [2 * high[-1]]])
    above = np.abs(response(L, between)) > 1
    total = 0.0
    for k, ends in enumerate(np.column_stack([np.maximum(low, high * 1e-9), high])):
        turned = (np.angle(response(L, ends)) + np.pi) % (2 * np.pi)
        passed = np.floor((ends * delay - turned) / (2 * np.pi)) + 1
        if passed[0] != passed[1]:
            return np.nan
        if low[k] > 0:
            total += 2 * passed[0] * (int(above[k]) - int(above[k + 1]))
        elif passed[0] > 0:
            return np.nan
    return float(total)


def apart(omega: np.ndarray, moved: np.ndarray) -> list[tuple[float, float]]:
    """Intervals in which the crossings lie, those that overlap put together."""
    out: list[tuple[float, float]] = []
    for k in np.argsort(omega - moved):
        low, high = max(0.0, float(omega[k] - moved[k])), float(omega[k] + moved[k])
        if out and low <= out[-1][1]:
            out[-1] = (out[-1][0], max(high, out[-1][1]))
        elif high > 0:
            out.append((low, high))
    return out


def certain_poles(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray]:
    """Poles, hidden modes included, and how far rounding may have moved each.

    States that no path leads back to (a weight outside the loop) are looked at apart: their poles are exact.
    """
    poles, moved = [np.zeros(0, complex)], [np.zeros(0)]
    for part in strong_parts(system.A):
        A = evened(system.A[np.ix_(part, part)])[0]
        found, left, right = eig(A, left=True, right=True)
        cosine = np.abs(np.einsum("ij,ij->j", left.conj(), right))
        poles.append(found)
        alone = A.shape[0] == 1
        moved.append(0.0 * cosine if alone else 100 * EPS * np.linalg.norm(A) / np.maximum(cosine, np.sqrt(EPS)))
    return np.concatenate(poles), np.concatenate(moved)


def strong_parts(A: np.ndarray) -> list[np.ndarray]:
    """The states of each part of a system all of whose states act on each other, on whatever ways."""
    reach = ((A != 0) | np.eye(len(A), dtype=bool)).astype(np.float32)
    for _ in range(len(A).bit_length()):  # ways of twice the length each time
        reach = (reach @ reach > 0).astype(np.float32)
    first = np.argmax(reach * reach.T, axis=1) if len(A) else np.zeros(0, int)
    return [np.flatnonzero(first == k) for k in np.unique(first)]


def apparent_instability(system: control.StateSpace) -> StabilityResult:
    """Whether every pole is stable beyond rounding, one is unstable, or rounding leaves it open."""
    poles, moved = certain_poles(system)
    excess = np.abs(poles) - 1 if timebase(system) else poles.real
    if not poles.size or np.all(excess < -moved):
        return StabilityResult(state=Stability.STABLE)
    worst = int(np.argmax(excess + moved))
    state = Stability.UNSTABLE if excess[worst] > moved[worst] else Stability.UNDECIDED
    return StabilityResult(state=state, pole=complex(poles[worst]))


def stable(system: control.StateSpace) -> bool:
    """Whether every pole lies strictly inside the stability region."""
    p = poles(system)
    return bool(np.all(np.abs(p) < 1)) if timebase(system) else bool(np.all(p.real < 0))
