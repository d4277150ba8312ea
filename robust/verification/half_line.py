"""Polynomials proved positive on the half-line from zero to infinity, by the signs of their coefficients.

A polynomial all of whose coefficients are nonnegative has no positive root; on an interval the same is said of its
Bernstein coefficients (Descartes, Bernstein, Vincent). The half-line is cut until every piece passes. Pieces shrink
with the square root of the distance from zero, so that a polynomial that nearly touches zero takes few more.
"""

from __future__ import annotations

import time
from enum import Enum, auto
from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.shared.states import Outcome

__all__ = ["Decision", "bernstein", "positive_on_half_line", "proved", "refuted", "undecided"]


NARROWEST = 1e-13
MOST_PIECES = 4000


@value
class Decision:
    """Whether a statement was proved or disproved; where it is false (nan: no place is named), and why, for people.

    `needs_digits` says of an undecided one that more digits may decide it.
    """

    outcome: Outcome
    violated_at: float = np.nan
    reason: str = ""
    needs_digits: bool = False

    @property
    def holds(self) -> bool:
        """Whether it was proved."""
        return self.outcome is Outcome.HOLDS

    @property
    def violated(self) -> bool:
        """Whether it was disproved."""
        return self.outcome is Outcome.VIOLATED


def proved() -> Decision:
    """Decide that it holds."""
    return Decision(outcome=Outcome.HOLDS)


def refuted(reason: str, at: float = np.nan) -> Decision:
    """Decide that it is false."""
    return Decision(outcome=Outcome.VIOLATED, violated_at=at, reason=reason)


def undecided(reason: str, *, needs_digits: bool = False) -> Decision:
    """Leave it open."""
    return Decision(outcome=Outcome.UNDECIDED, reason=reason, needs_digits=needs_digits)


class Signs(Enum):
    """What the Bernstein coefficients of a piece say of it."""

    POSITIVE = auto()
    MIXED = auto()
    UNCLEAR = auto()


def bernstein(p: Any, low: Any, high: Any) -> list[Any]:
    """Coefficients with the signs of the Bernstein coefficients of p on [low, high] (each a positive multiple)."""
    kind = type(p)
    n = p.degree()
    local = p(kind([low, high - low]))
    coefficients = kind([local[k] for k in range(n, -1, -1)])(kind([1, 1]))
    return [coefficients[k] for k in range(n, -1, -1)]


def bernstein_signs(coefficients: list[Any]) -> Signs:
    """Whether all are positive, so that the piece is, ends included; some negative; or unclear for want of digits."""
    if all(c >= 0 for c in coefficients) and coefficients[0] > 0 and coefficients[-1] > 0:
        return Signs.POSITIVE
    return Signs.MIXED if any(c < 0 for c in coefficients) else Signs.UNCLEAR


def positive_on_half_line(p: Any, *, deadline: float = np.inf) -> Decision:
    """Prove p(y) > 0 for all y >= 0; p is an arb_poly or fmpq_poly of python-flint. Infinity is not looked at.

    >>> from flint import fmpq, fmpq_poly
    >>> positive_on_half_line(fmpq_poly([fmpq(1000001, 1000000), -2, 1])).holds    # (y - 1)^2 + 1e-6
    True
    >>> round(positive_on_half_line(fmpq_poly([fmpq(999999, 1000000), -2, 1])).violated_at, 3)
    1.0
    """
    from flint import arb

    coefficients = p.coeffs()
    if not coefficients or not coefficients[0] > 0:
        below = not coefficients or bool(coefficients[0] <= 0)
        said = "not positive at zero"
        return refuted(said, 0.0) if below else undecided(said, needs_digits=True)
    low, high = root_bounds([arb(c) for c in coefficients])
    todo: list[tuple[float, float]] = [(0.0, low), (low, high), (high, np.inf)]
    for _ in range(MOST_PIECES):
        if not todo:
            return proved()
        if time.thread_time() > deadline:
            return undecided("undecided, as time was up")
        a, b = todo.pop()
        found = bernstein_signs(bernstein(p, exactly(p, a), exactly(p, b)) if np.isfinite(b) else beyond(p, a))
        if found is Signs.POSITIVE:
            continue
        middle = between(a, b)
        if p(exactly(p, middle)) <= 0:
            return refuted("negative there", middle)
        if found is Signs.UNCLEAR or (np.isfinite(b) and b - a <= NARROWEST * b) or not 1e-290 < middle < 1e290:
            return undecided(f"undecided near {middle:.6g}", needs_digits=True)
        todo += [(a, middle), (middle, b)]
    return undecided(f"undecided after {MOST_PIECES} pieces")


def beyond(p: Any, low: float) -> list[Any]:
    """Coefficients of p(low + y): all nonnegative where p has no root beyond; the last is only its sign at infinity."""
    return list(p(type(p)([exactly(p, low), 1])).coeffs())


def exactly(p: Any, x: float) -> Any:
    """A double as an exact number of the kind that p has."""
    from flint import arb, fmpq, fmpq_poly

    return fmpq(*float(x).as_integer_ratio()) if isinstance(p, fmpq_poly) else arb(float(x))


def between(a: float, b: float) -> float:
    """Where to cut: geometrically, as roots lie decades apart."""
    if a == 0:
        return b / 64
    return a * 64 if np.isinf(b) else float(np.sqrt(a) * np.sqrt(b))


def root_bounds(coefficients: list[Any]) -> tuple[float, float]:
    """About where the smallest and the largest root lie: only where to cut first, nothing rests on it."""
    logs = [float(abs(c).log().mid()) if abs(c) > 0 else -np.inf for c in coefficients]
    n = max(k for k, log in enumerate(logs) if np.isfinite(log))
    small = [(logs[0] - log) / k for k, log in enumerate(logs) if k and np.isfinite(log)]
    large = [(logs[k] - logs[n]) / (n - k) for k in range(n) if np.isfinite(logs[k])]
    if not small or not large:
        return 0.5, 2.0
    low, high = min(small) - np.log(2), max(large) + np.log(2)
    low, high = np.clip([low, max(high, low + 1)], -600, 600)
    return float(np.exp(low)), float(np.exp(high))
