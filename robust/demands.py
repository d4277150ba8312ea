"""What is asked of a loop, line by line, in the form a convex program takes.

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
from types import SimpleNamespace
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.checks import real
from nlfrf.values import value
from robust.assembly import Assembly, assemble, in_s
from robust.frf_check import as_seen, continued, integrators, on_lines, slope_at_start
from robust.lti import poles, response, state_space, timebase, zeros
from robust.report import hertz
from robust.uncertainty import UncertaintyModel

#: The set must stay this far inside stability, so that a check can prove it between the lines too.
BACK_OFF = 0.99
#: |w| from which an inverse form is no longer treated as a disc: towards one it becomes a half plane.
LARGEST_DISC = 0.98


@value
class Seen:
    """One plant as the controller sees it, hold and delay inside.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    G, centre : (W,) complex ndarray
        Nominal response; centre of the disc of plants.
    radius : (W,) ndarray
        Radius of that disc; zero without uncertainty.
    outside : (W,) ndarray
        |w| where an inverse form comes near |w| = 1 or passes it, so that the set is no disc; zero elsewhere.
    inverse : (W,) ndarray
        |w| of an inverse form on S, zero for the other forms.
    loop : Assembly or None
        The parametric plant, where there is one: then stability is a matter of poles.
    n_integrators : int
        Integrators of the plant; of an FRF by the slope of its first lines.
    known : (W,) ndarray of bool
        False on frequencies above the last line of an FRF, where it is taken to be no larger than there.
    lowest : float
        First measured line [rad/s]: an FRF is carried on below it as its integrators.
    """

    omega: np.ndarray
    G: np.ndarray
    centre: np.ndarray
    radius: np.ndarray
    outside: np.ndarray
    inverse: np.ndarray
    loop: Assembly | None
    n_integrators: int
    known: np.ndarray
    lowest: float


@value
class Row:
    """One demand: sqrt((a |Y| + b |X|)^2 + (c |X|)^2) <= |y Y + x X| on the lines of `index`.

    Fields
    ------
    name : str
        The demand in words.
    index : (R,) ndarray of int
        Lines it is made on.
    a, b, c : (R,) ndarray
    y, x : (R,) complex ndarray
    """

    name: str
    index: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    y: np.ndarray
    x: np.ndarray

    def on(self, mask: np.ndarray) -> Row:
        """The same demand on some of the lines, counted among those."""
        keep = mask[self.index]
        place = np.cumsum(mask) - 1
        parts = {name: getattr(self, name)[keep] for name in "abcyx"}
        return Row(name=self.name, index=place[self.index[keep]], **parts)

    def measure(self, Y: np.ndarray, X: np.ndarray) -> np.ndarray:
        """(..., R) left side over right side, from Y and X on all lines: at most one where the demand is met."""
        Y, X = Y[..., self.index], X[..., self.index]
        size = np.abs(X)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.hypot(self.a * np.abs(Y) + self.b * size, self.c * size) / np.abs(self.y * Y + self.x * X)
        return np.where(np.isnan(ratio), np.inf, ratio)


def see(plant: Any, dt: float, delay: float, extra: tuple[float, ...], weights: tuple[Any, ...]) -> Seen:
    """The plant, its disc and its lines; `extra` frequencies [rad/s] are added where it is known everywhere."""
    if isinstance(plant, (Bla, control.FrequencyResponseData)) or getattr(plant, "measured_only", False):
        omega, G, form, w, _ = on_lines(plant)
        w = np.nan_to_num(np.abs(w))
        if dt and omega[-1] * dt >= np.pi:
            raise ValueError(f"dt must put Nyquist above the lines, up to {hertz(omega[-1])}, got {dt:g} s")
        G = as_seen(plant, omega, G, dt, delay)
        loop, n_integrators, lowest = None, slope_at_start(omega, G), float(omega[0])
        n = omega.size
        omega, G = continued(omega, G, n_integrators, decades=3.0, points=60)
        w = np.concatenate([np.full(omega.size - n, w[0]) * (np.abs(G[:-n] / G[-n]) if form == "additive" else 1.0), w])
        above = omega[-1] * np.geomspace(1.2, 100, 14)
        above = above[above * dt < 0.99 * np.pi]
        known = np.arange(omega.size + above.size) < omega.size
        omega = np.concatenate([omega, above])
        G, w = (np.concatenate([part, np.full(above.size, part[-1])]) for part in (G, w))
    else:
        if not isinstance(plant, UncertaintyModel):
            G_ss = state_space("plant", plant)
            nothing = control.StateSpace([], [], [], [[0.0]], timebase(G_ss))
            plant = SimpleNamespace(nominal=G_ss, weight=nothing, form="multiplicative", omega=np.zeros(0))
        step = timebase(plant.nominal)
        if step and dt and abs(step / dt - 1) > 1e-9:
            raise ValueError(f"dt must be the sampling time of the plant, {step:g} s, got {dt:g} s")
        loop = assemble(plant, control.StateSpace([], [], [], [[0.0]], step or dt), None, delay)
        lines, form = plant.omega, plant.form
        omega = grid(loop, lines, extra, weights)
        G, w = loop.plant(omega), np.abs(response(loop.weight, omega))
        n_integrators, lowest = integrators(loop.G, loop.dt), float(omega[0])
        known = np.ones(omega.size, dtype=bool)
    size = np.abs(G)
    inverse = form.startswith("inverse")
    w = w * size if form == "inverse-additive" else w / np.maximum(size, 1e-300) if form == "additive" else w
    disc = w < LARGEST_DISC
    outside = np.where(inverse & ~disc, w, 0.0)
    shrink = np.where(inverse & disc, 1 / np.maximum(1 - w**2, 1e-12), 1.0)
    radius = np.where(outside > 0, 0.0, size * w * shrink)
    return Seen(
        omega=omega,
        G=G,
        centre=G * shrink,
        radius=radius,
        outside=outside,
        inverse=np.where(inverse, w, 0.0),
        loop=loop,
        n_integrators=n_integrators,
        known=known,
        lowest=lowest,
    )


def grid(loop: Assembly, lines: np.ndarray, extra: tuple[float, ...], weights: tuple[Any, ...]) -> np.ndarray:
    """Frequencies [rad/s] to look at a parametric plant: where it, its weight or a demand has features."""
    if not lines.size:
        lines = np.array(extra) if extra else np.array([0.1 / loop.dt if loop.dt else 1.0])
        if loop.G.nstates:
            s = in_s(np.concatenate([poles(loop.G), zeros(loop.G)]), loop.dt)
            size = np.abs(s[np.isfinite(s) & (np.abs(s) > 0)])
            lines = size[size < loop.top * 0.999] if np.any(size < loop.top * 0.999) else lines
        lines = np.unique(lines)
    grids = [np.array(extra)]
    for w in (None, *(w for w in weights if isinstance(w, (control.StateSpace, control.TransferFunction)))):
        w = None if w is None else state_space("weight", w)
        grids.append(replace(loop, w_P=w).grid(lines) if w is None or w.nstates else np.zeros(0))
    omega = np.unique(np.concatenate(grids))
    omega = omega[(omega > 0) & (omega < loop.top * (1 - 1e-9))]
    return omega[np.concatenate([[True], np.diff(np.log(omega)) > 1e-6])]


def joined(seen: list[Seen]) -> Seen:
    """All plants of a family, one after the other."""
    parts: dict[str, Any] = {
        name: np.concatenate([getattr(s, name) for s in seen])
        for name in ("omega", "G", "centre", "radius", "outside", "inverse", "known")
    }
    return Seen(**parts, loop=None, n_integrators=0, lowest=max(s.lowest for s in seen))


def limit(name: str, bound: Any, omega: np.ndarray) -> np.ndarray:
    """(W,) a limit given as a number, or as the magnitude of a system."""
    if isinstance(bound, (control.StateSpace, control.TransferFunction)):
        out = np.abs(response(state_space(name, bound), omega))
    else:
        out = np.full(omega.size, real(name, bound))
    if np.any(out <= 0):
        raise ValueError(f"{name} must be positive, got {out.min():g}")
    return out


def objective_row(at: Seen, w_P: Any, w_T: Any, w_u: Any) -> Row | None:
    """[worst-case performance; w_T T; w_u K S] stacked, whose largest value over the lines is gamma."""
    if w_P is None and w_T is None and w_u is None:
        return None
    sizes = {}
    for name, w in (("w_P", w_P), ("w_T", w_T), ("w_u", w_u)):
        sizes[name] = np.zeros(at.omega.size) if w is None else np.abs(response(state_space(name, w), at.omega))
        if not np.isfinite(sizes[name]).all():
            raise ValueError(f"{name} must be finite on the lines, got a pole on one")
    a, b = worst(at, sizes["w_P"])
    if w_P is None:
        a, b = 0 * a, 0 * b  # stability of the set is a demand of its own
    c = np.hypot(sizes["w_u"], sizes["w_T"] * np.abs(at.G))
    return row("gamma", at, a, b, c)


def weight_rows(at: Seen, *, w_P: Any, w_T: Any, w_u: Any) -> list[Row]:
    """The weights as demands of their own."""
    rows = []
    for name, w, said in (
        ("w_P", w_P, "|w_P S| <= 1 for the whole set"),
        ("w_T", w_T, "|w_T T| <= 1"),
        ("w_u", w_u, "|w_u K S| <= 1"),
    ):
        found = objective_row(at, *(w if name == n else None for n in ("w_P", "w_T", "w_u")))
        if found is not None:  # one modulus alone: sqrt(0 + c^2) = c
            rows.append(replace(found, name=said, b=found.b + found.c, c=0 * found.c))
    return rows


def worst(at: Seen, p: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """a and b of p |Y (1 + w Delta)| <= |1 + L over the set|: exact for discs, sufficient where the set is none."""
    return p * (1 + at.outside) + at.outside, at.radius


def row(
    name: str, at: Seen, a: Any, b: Any, c: Any = 0.0, *, y: Any = 1.0, x: Any = None, index: np.ndarray | None = None
) -> Row:
    """A row on all lines (or some), with the centre of the disc on its right side unless told otherwise."""
    W = at.omega.size
    index = np.flatnonzero(at.known) if index is None else index
    wide = {key: np.broadcast_to(v, W)[index] for key, v in dict(a=a, b=b, c=c).items()}
    right = dict(y=np.broadcast_to(y, W)[index] + 0j, x=(at.centre if x is None else np.broadcast_to(x, W))[index] + 0j)
    return Row(name=name, index=index, **wide, **right)


def end_row(seen: list[Seen], at: Seen, most: float) -> list[Row]:
    """|L| small from the last line of every FRF on, where the plant is taken to be no larger than there."""
    starts = np.cumsum([0, *(s.omega.size for s in seen)])
    lasts = [
        np.arange(np.flatnonzero(s.known)[-1], s.omega.size) + first
        for s, first in zip(seen, starts[:-1], strict=True)
        if s.loop is None
    ]
    ends = np.concatenate([np.zeros(0, dtype=int), *lasts])
    if not ends.size:
        return []
    name = f"|L| <= {most:g} from the last line on, above which the plant is not known"
    return [row(name, at, 0.0, (np.abs(at.centre) + at.radius) / most, y=1.0, x=0.0, index=ends)]


def limit_rows(at: Seen, *, M_S: Any, M_T: Any, M_u: Any, omega_c: Any, gain: Any) -> list[Row]:
    """The demands that must be met, whatever else is minimised; stability of the whole set is the first of them."""
    rows = []
    if np.any(at.radius > 0) or np.any(at.outside > 0):
        direct = at.inverse > 0  # |w S| <= 1, as the disc of an inverse form grows without bound
        b, x = np.where(direct, 0.0, at.radius / BACK_OFF), np.where(direct, at.G, at.centre)
        rows.append(row("robust stability", at, at.inverse / BACK_OFF, b, x=x))
    if M_S is not None:
        a, b = worst(at, 1 / limit("M_S", M_S, at.omega))
        rows.append(row(f"|S| <= {named(M_S)}", at, a, b))
    if M_T is not None:
        rows.append(peak_of_T(at, limit("M_T", M_T, at.omega), f"|T| <= {named(M_T)}"))
    if M_u is not None:
        most = limit("M_u", M_u, at.omega)
        rows.append(row(f"|K S| <= {named(M_u)}", at, at.outside, at.radius + (1 + at.outside) / most))
    if omega_c is not None:
        least, most = omega_c if isinstance(omega_c, (tuple, list)) else (omega_c, None)
        rows.append(gain_row(at, "omega_c", least, 1.0))
        if most is not None:
            where = nearest(at, "omega_c", most)
            rows.append(row(f"|L| <= 1 at {hertz(most)}", at, 0.0, np.abs(at.G), y=1.0, x=0.0, index=where))
    if gain is not None:
        rows.append(gain_row(at, "gain", *gain))
    return rows


def peak_of_T(at: Seen, M: np.ndarray, name: str) -> Row:
    """|T| <= M over the set: exact for M > 1, where L must stay out of a circle; by the triangle below that."""
    big = M > 1 + 1e-6
    square = np.where(big, M**2 - 1, 1.0)
    a = np.where(big, M / M**2, at.outside)
    b = np.where(big, at.radius * square / M**2, (np.abs(at.centre) + at.radius) / M + at.radius)
    x = np.where(big, at.centre * square / M**2, at.centre)
    if np.any(at.outside > 0):
        a = np.where(at.outside > 0, at.outside, a)
        b = np.where(at.outside > 0, np.abs(at.centre) / M, b)
        x = np.where(at.outside > 0, at.centre, x)
    return row(name, at, a, b, x=x)


def gain_row(at: Seen, name: str, omega: Any, least: Any) -> Row:
    """|L| of the nominal at least so large at a frequency."""
    least = real(name, least)
    if least <= 0:
        raise ValueError(f"{name} must ask for a positive |L|, got {least:g}")
    where = nearest(at, name, omega)
    return row(f"|L| >= {least:g} at {hertz(float(omega))}", at, least, 0.0, y=0.0, x=at.G, index=where)


def nearest(at: Seen, name: str, omega: Any) -> np.ndarray:
    """The lines nearest to a frequency, one for each plant, or a refusal outside the band."""
    omega = real(name, omega)
    starts = np.concatenate([[0], np.flatnonzero(np.diff(at.omega) <= 0) + 1, [at.omega.size]])
    found = []
    for first, last in pairwise(starts):
        lines = at.omega[first:last][at.known[first:last]]
        lowest = max(at.lowest, lines[0])
        if not lowest * 0.999 <= omega <= lines[-1] * 1.001:
            raise ValueError(
                f"{name} must lie within the lines, {hertz(lowest)} to {hertz(lines[-1])}, got {hertz(omega)}"
            )
        found.append(first + int(np.argmin(np.abs(np.log(lines / omega)))))
    return np.array(found)


def named(bound: Any) -> str:
    """A limit in words."""
    return f"{bound:g}" if isinstance(bound, (int, float)) else "its limit"
