"""Demands on a loop, line by line, in the form of a convex program.

With K = X/Y, every demand below reads, at one frequency,  a |Y| + b |X| <= |y Y + x X|.  A disc of plants with centre
c and radius r about the loop turns 1 + L into (Y + c X + r X Delta)/Y, so that at worst

    stability of the set     r |X| <= |Y + c X|                    |S|, worst case    |Y|/M + r |X| <= |Y + c X|
    performance              |w_P Y| + r |X| <= |Y + c X|          |K S|              |X|/M + r |X| <= |Y + c X|
    |T| <= M, M > 1          M/(M^2-1) |Y| + r |X| <= |M^2/(M^2-1) Y + c X|

exactly. Inverse forms are discs too while |w| < 1: centre G/(1 - |w|^2), radius |G w|/(1 - |w|^2).
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise
from typing import TypeAlias

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_real
from robust._base.types import LinearSystem, Weight
from robust.lti.lti import response
from robust.lti.realisation import state_space
from robust.synthesis.fixed.cone_program import Demand
from robust.synthesis.fixed.plants import PlantOnLines

#: Limit of a peak: a number, or the magnitude of a system over frequency.
Bound: TypeAlias = "float | LinearSystem"


#: Distance of the set from instability, so that a check can prove stability between the lines too.
_BACK_OFF = 0.99


def _limit_on_lines(name: str, bound: Bound, omega: np.ndarray) -> np.ndarray:
    """Return (W,) a limit given as a number, or as the magnitude of a system."""
    if isinstance(bound, (control.StateSpace, control.TransferFunction)):
        out = np.abs(response(state_space(name, bound), omega))
    else:
        out = np.full(omega.size, require_real(name, bound))
    if np.any(out <= 0):
        raise ValueError(f"{name} must be positive, got {out.min():g}")
    return out


def objective_row(
    at: PlantOnLines, w_P: Weight | None, w_T: Weight | None, w_u: Weight | None
) -> Demand | None:
    """Return [worst-case performance; w_T T; w_u K S] stacked; its largest value over the lines is
    gamma.
    """
    if w_P is None and w_T is None and w_u is None:
        return None
    sizes = {}
    for name, w in (("w_P", w_P), ("w_T", w_T), ("w_u", w_u)):
        sizes[name] = (
            np.zeros(at.omega.size)
            if w is None
            else np.abs(response(state_space(name, w), at.omega))
        )
        if not np.isfinite(sizes[name]).all():
            raise ValueError(f"{name} must be finite on the lines, got a pole on one")
    a, b = _worst_case_terms(at, sizes["w_P"])
    if w_P is None:
        a, b = 0 * a, 0 * b  # stability of the set is a demand of its own
    c = np.hypot(sizes["w_u"], sizes["w_T"] * np.abs(at.G))
    return _demand_row("gamma", at, a=a, b=b, c=c)


def weight_rows(
    at: PlantOnLines, *, w_P: Weight | None, w_T: Weight | None, w_u: Weight | None
) -> list[Demand]:
    rows = []
    for name, w, text in (
        ("w_P", w_P, "|w_P S| <= 1 for the whole set"),
        ("w_T", w_T, "|w_T T| <= 1"),
        ("w_u", w_u, "|w_u K S| <= 1"),
    ):
        found = objective_row(at, *(w if name == n else None for n in ("w_P", "w_T", "w_u")))
        if found is not None:  # one modulus alone: sqrt(0 + c^2) = c
            rows.append(replace(found, name=text, b=found.b + found.c, c=0 * found.c))
    return rows


def _worst_case_terms(at: PlantOnLines, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Return a and b of p |Y (1 + w Delta)| <= |1 + L over the set|: exact for discs, otherwise
    sufficient.
    """
    return p * (1 + at.outside) + at.outside, at.radius


def _demand_row(
    name: str,
    at: PlantOnLines,
    *,
    a: float | np.ndarray,
    b: float | np.ndarray,
    c: float | np.ndarray = 0.0,
    y: float | np.ndarray = 1.0,
    x: float | np.ndarray | None = None,
    index: np.ndarray | None = None,
) -> Demand:
    """Return a row on all lines (or some), with the centre of the disc on its right side by
    default.
    """
    W = at.omega.size
    if index is None:
        index = np.flatnonzero(at.known)
    wide = {key: np.broadcast_to(v, W)[index] for key, v in dict(a=a, b=b, c=c).items()}
    right = dict(
        y=np.broadcast_to(y, W)[index] + 0j,
        x=(at.centre if x is None else np.broadcast_to(x, W))[index] + 0j,
    )
    return Demand(name=name, index=index, **wide, **right)


def end_row(family: list[PlantOnLines], at: PlantOnLines, most: float) -> list[Demand]:
    """Return a row for small |L| from the last line of every FRF on, where the plant is assumed to
    be no larger.
    """
    starts = np.cumsum([0, *(s.omega.size for s in family)])
    lasts = [
        np.arange(np.flatnonzero(s.known)[-1], s.omega.size) + first
        for s, first in zip(family, starts[:-1], strict=True)
        if s.loop is None
    ]
    ends = np.concatenate([np.zeros(0, dtype=int), *lasts])
    if not ends.size:
        return []
    name = f"|L| <= {most:g} from the last line on, above which the plant is unknown"
    return [
        _demand_row(
            name, at, a=0.0, b=(np.abs(at.centre) + at.radius) / most, y=1.0, x=0.0, index=ends
        )
    ]


def limit_rows(
    at: PlantOnLines,
    *,
    M_S: Bound | None,
    M_T: Bound | None,
    M_u: Bound | None,
    omega_c: float | tuple[float, float] | None,
    gain: tuple[float, float] | None,
    resonates: bool,
) -> list[Demand]:
    """Return the hard demands, with stability of the whole set as the first one.

    resonates : with a given resonance |L| of a controller may exceed one there, beyond its
    crossover.
    """
    rows = []
    if np.any(at.radius > 0) or np.any(at.outside > 0):
        # |w S| <= 1, because the disc of an inverse form grows without bound
        direct = at.inverse > 0
        b, x = np.where(direct, 0.0, at.radius / _BACK_OFF), np.where(direct, at.G, at.centre)
        rows.append(_demand_row("robust stability", at, a=at.inverse / _BACK_OFF, b=b, x=x))
    if M_S is not None:
        a, b = _worst_case_terms(at, 1 / _limit_on_lines("M_S", M_S, at.omega))
        rows.append(_demand_row(f"|S| <= {_describe_bound(M_S)}", at, a=a, b=b))
    if M_T is not None:
        rows.append(
            _peak_of_T(at, _limit_on_lines("M_T", M_T, at.omega), f"|T| <= {_describe_bound(M_T)}")
        )
    if M_u is not None:
        most = _limit_on_lines("M_u", M_u, at.omega)
        rows.append(
            _demand_row(
                f"|K S| <= {_describe_bound(M_u)}",
                at,
                a=at.outside,
                b=at.radius + (1 + at.outside) / most,
            )
        )
    if omega_c is not None:
        least, *above = np.ravel(omega_c).tolist()
        rows.append(_gain_row(at, "omega_c", least, 1.0))
        for highest in above:
            where = _nearest_lines(at, "omega_c", highest)
            name = f"|L| <= 1 at {format_hertz(highest)}"
            if not resonates:
                where = np.union1d(where, np.flatnonzero(at.known & (at.omega >= highest)))
                name = f"{name} and above"
            rows.append(_demand_row(name, at, a=0.0, b=np.abs(at.G), y=1.0, x=0.0, index=where))
    if gain is not None:
        rows.append(_gain_row(at, "gain", *gain))
    return rows


def _peak_of_T(at: PlantOnLines, M: np.ndarray, name: str) -> Demand:
    """Return |T| <= M over the set: exact for M > 1, where L must stay out of a circle; below by
    the triangle.
    """
    big = M > 1 + 1e-6
    square = np.where(big, M**2 - 1, 1.0)
    a = np.where(big, M / M**2, at.outside)
    b = np.where(big, at.radius * square / M**2, (np.abs(at.centre) + at.radius) / M + at.radius)
    x = np.where(big, at.centre * square / M**2, at.centre)
    if np.any(at.outside > 0):
        a = np.where(at.outside > 0, at.outside, a)
        b = np.where(at.outside > 0, np.abs(at.centre) / M, b)
        x = np.where(at.outside > 0, at.centre, x)
    return _demand_row(name, at, a=a, b=b, x=x)


def _gain_row(at: PlantOnLines, name: str, omega: float, least: float) -> Demand:
    """Return a least |L| of the nominal at a frequency."""
    least = require_real(name, least)
    if least <= 0:
        raise ValueError(f"{name} must contain a positive |L|, got {least:g}")
    where = _nearest_lines(at, name, omega)
    return _demand_row(
        f"|L| >= {least:g} at {format_hertz(float(omega))}",
        at,
        a=least,
        b=0.0,
        y=0.0,
        x=at.G,
        index=where,
    )


def _nearest_lines(at: PlantOnLines, name: str, omega: float) -> np.ndarray:
    """Return the lines nearest to a frequency, one for each plant; refuse a frequency outside the
    band.
    """
    omega = require_real(name, omega)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(at.omega) <= 0) + 1, [at.omega.size]])
    found = []
    for first, last in pairwise(starts):
        lines = at.omega[first:last][at.known[first:last]]
        lowest = max(at.lowest, lines[0])
        if not lowest * 0.999 <= omega <= lines[-1] * 1.001:
            raise ValueError(
                f"{name} must lie within the lines, {format_hertz(lowest)} to"
                f" {format_hertz(lines[-1])}, got {format_hertz(omega)}"
            )
        found.append(first + int(np.argmin(np.abs(np.log(lines / omega)))))
    return np.array(found)


def _describe_bound(bound: Bound) -> str:
    if isinstance(bound, (int, float)):
        return f"{bound:g}"
    return "its limit"
