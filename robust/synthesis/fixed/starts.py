"""A stabilising start controller in the requested structure: found by trial, or given."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from itertools import product

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from robust._base.states import Stability
from robust._base.types import Controller
from robust.analysis.loop import Loop, decide_nominal_stability
from robust.lti.connections import closed_loop
from robust.lti.lti import require_sampling_time, response, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import (
    count_half_turns,
    describe_unresolved,
    integrator_poles,
    unstable_poles,
    windings,
)
from robust.synthesis.fixed.cone_program import Demand
from robust.synthesis.fixed.plants import PlantOnLines
from robust.synthesis.fixed.population import evolve, genes_of_roots, parameters
from robust.synthesis.fixed.structures import Basis

_CROSSOVERS = 20
_LEADS = (1.0, 3.0, 10.0, 30.0)
_RESETS = (0.03, 0.1, 0.3, 3.0)
_GAINS = (1.0, 0.3, 0.1)
_INTEGRATOR_LEAKS = (1e-4, 1e-2)
_MAX_LINES = 100
_PER_CROSSOVER = 3  # simple controllers for each crossover at the start of the search
_BEYOND = 1.0  # logarithm of the largest factor between the search and the simple controllers
_DISTINCT = 0.5  # logarithm of the least factor between some coefficient of two starts
_PULLED_IN = 1e-6  # of the lowest line: far above rounding, far below any damping that a line shows


def _simple_controllers(
    basis: Basis, at: PlantOnLines
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (N, n) sizes of zeros and poles and (N,) crossovers of PI-like, lead and mixed shapes
    over the band.
    """
    shape = basis.structure
    sizes = np.abs(basis.plane(at.omega[at.known & (at.omega <= at.highest)]))
    n_pi = min(shape.n_zeros, shape.n_integrators)
    most = 0.5 * basis.fastest
    leaks = (0.0, *_INTEGRATOR_LEAKS) if shape.free and shape.n_zeros > n_pi else (0.0,)
    leads = _LEADS if shape.n_zeros > n_pi else _LEADS[:1]
    resets = _RESETS if n_pi or len(leaks) > 1 else _RESETS[:1]
    zeros, poles, centres = [], [], []
    for c in np.geomspace(sizes.min(), sizes.max(), _CROSSOVERS + 2)[1:-1]:
        for leak, lead, reset in product(leaks, leads, resets):
            slow = n_pi + (leak > 0)
            spare = shape.n_zeros - slow
            if (lead > 1 and spare == 0) or (reset != resets[0] and slow == 0):
                continue
            z = [reset * c] * slow + [c / np.sqrt(lead)] * (spare > 0) + [c] * (spare - 1)
            p = [leak * c] * (leak > 0) + [c * np.sqrt(lead)] * (spare > 0) + [c] * (spare - 1)
            zeros.append(z)
            poles.append((p + [10 * c] * shape.n_poles)[: shape.n_poles if shape.free else 0])
            centres.append(c)
    at_zeros, at_poles = (np.array(roots).reshape(len(centres), -1) for roots in (zeros, poles))
    return at_zeros, np.clip(at_poles, min(1.1 * basis.slowest, most), most), np.array(centres)


def _project_on_structure(basis: Basis, K0: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return the parameters of the structure closest to a given controller on the lines."""
    s = basis.plane(omega)
    k = response(K0, omega)
    Y = basis.Y(s) * basis.integrals(s)[:, None]
    X = basis.X(s) * response(basis.fixed, omega)[:, None]
    M = np.hstack([k[:, None] * Y, -X])
    weight = 1 / np.maximum(np.abs(k), 1e-12 * np.abs(k).max())
    for _ in range(8):  # Sanathanan & Koerner: the error of X/Y, not of X - K Y
        A = M * weight[:, None]
        A = np.vstack([A.real, A.imag])
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        theta = np.linalg.svd(A / scale, full_matrices=False)[2][-1] / scale
        weight = 1 / np.maximum(np.abs(k * (Y @ theta[: basis.n_y])), 1e-300)
    if np.real(basis.Y(np.zeros(1, complex)) @ theta[: basis.n_y])[0] > 0:
        return theta
    return -theta


def loops_stable(
    K: control.StateSpace, family: list[PlantOnLines], n_unstable: int
) -> tuple[Stability, str]:
    """Return if K stabilises every plant of the family, by poles or by winding number, with the
    reason if not.
    """
    for i, at in enumerate(family):
        if len(family) > 1:
            who = f" of plant {i + 1}"
        else:
            who = ""
        if at.loop is not None:
            found, why = _stable_by_poles(at.loop, K)
            if found is not Stability.STABLE:
                return found, f"the loop{who} {why}"
            continue
        dt = timebase(K)
        turns, clear = windings(*at.measured, K=K, dt=dt, readings=at.readings)
        if not clear:
            omega, G = at.measured
            L = G * response(K, omega)
            return Stability.UNDECIDED, describe_unresolved(omega, 1 + L, np.abs(L), who)
        if wrong := [found for found in turns if found != n_unstable + unstable_poles(K, dt)]:
            return (
                Stability.UNSTABLE,
                f"the loop{who} is unstable: 1 + L winds {wrong[0]} times about zero",
            )
    return Stability.STABLE, ""


def describe_open_reading(
    K: control.StateSpace, family: list[PlantOnLines], n_unstable: int
) -> str:
    """Describe a continuation of a plant below its first line with which the loop may be unstable;
    "" without any.

    The text also names the remedy: lines at lower frequency, or a statement of the user.
    """
    wanted = n_unstable + unstable_poles(K, timebase(K))
    for at in family:
        if at.loop is not None or not at.open_readings:
            continue
        turns, clear = windings(*at.measured, K=K, dt=timebase(K), readings=at.open_readings)
        open_ones = [
            one
            for one, found in zip(at.open_readings, turns, strict=True)
            if found != wanted or not clear
        ]
        if open_ones:
            return (
                f"stability not decided: below its first line at {format_hertz(at.lowest)} the FRF"
                f" may be that of a plant {at.readings[0]}, or {open_ones[0]}, and the loop is"
                " known to be stable with the first only. Measure at lower frequency (a longer"
                " period, --period, and a lower --f-min), or state plant_integrators=, or"
                " positive=True if y rises as u rises"
            )
    return ""


def _stable_by_poles(loop: Loop, K: control.StateSpace) -> tuple[Stability, str]:
    """Return the state of a parametric loop, stable if every pole is stable beyond rounding, and
    the reason if not.
    """
    closed = replace(loop, K=K)
    try:
        closed_loop(loop.G, K, ("e",), ("r",))
    except ValueError:
        return Stability.UNDECIDED, "is not well posed"
    nominal = decide_nominal_stability(closed)
    return nominal.state, f"is {nominal}"


def find_start(
    basis: Basis,
    family: list[PlantOnLines],
    *,
    at: PlantOnLines,
    rows: list[Demand],
    aim: Demand | None,
    n_unstable: int,
    allow_unstable: bool,
    positive: bool,
    wanted: int,
) -> list[np.ndarray]:
    """Return parameters of stabilising controllers: as many evolved ones as wanted, and a simple
    one; may be empty.
    """
    zeros, poles, centres = _simple_controllers(basis, at)
    thin = np.zeros(at.omega.size, dtype=bool)
    thin[np.unique(np.linspace(0, at.omega.size - 1, _MAX_LINES).astype(int))] = True
    for row in rows:
        if row.index.size < _MAX_LINES:
            thin[row.index] = True
    omega = at.omega[thin]
    s = basis.plane(omega)
    Y_columns = (basis.Y(s) * basis.integrals(s)[:, None]).T
    X_columns = (basis.X(s) * response(basis.fixed, omega)[:, None]).T
    thin_rows = [row.on(thin) for row in rows]
    if aim is None:
        thin_aim = None
    else:
        thin_aim = aim.on(thin)
    Y0, X0 = basis.zero_frequency()
    if positive:
        gain_rows = basis.gain_rows().T
    else:
        gain_rows = np.zeros((0, 0))

    def merit(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (N,) worst demand and (N,) goal on a few lines."""
        Y, X = theta[:, : basis.n_y] @ Y_columns, theta[:, basis.n_y :] @ X_columns
        hard = np.max(
            [np.ones(len(theta)), *(row.measure_between(Y, X, omega) for row in thin_rows)], axis=0
        )
        if positive:
            hard[np.any(theta @ gain_rows < 0, axis=1)] = np.inf
        if thin_aim is not None:
            return hard, thin_aim.measure_between(Y, X, omega)
        return hard, -np.abs(
            (theta @ X0) / (np.abs(theta @ Y0) + 1e-9 * np.abs(theta * Y0).sum(axis=1))
        )

    # the gain that puts |L| = 1 at the line next to the crossover, of either sign, and smaller
    # gains
    k = np.argmin(np.abs(np.log(np.abs(s) / centres[:, None])), axis=1)
    each = np.arange(centres.size)
    theta = parameters(
        basis, genes_of_roots(zeros, poles, np.ones(centres.size)), np.ones(centres.size)
    )
    Y, X = theta[:, : basis.n_y] @ Y_columns, theta[:, basis.n_y :] @ X_columns
    with np.errstate(divide="ignore"):
        unit = np.abs(Y[each, k] / (at.G[thin][k] * X[each, k]))
    gains = np.concatenate([sign * part * unit for sign in (1, -1) for part in _GAINS])
    fine = np.isfinite(gains) & (gains != 0)
    which, gains = np.tile(each, 2 * len(_GAINS))[fine], gains[fine]
    genes = genes_of_roots(zeros[which], poles[which], gains)
    signs = np.sign(gains)
    centres = centres[which]
    theta = parameters(basis, genes, signs)
    hard, best = merit(theta)
    order = np.lexsort((best, hard))
    order = order[np.isfinite(hard[order])]

    allowed = _winding_test(basis, family, n_unstable)
    niches: dict[float, list[int]] = {}
    for batch in np.array_split(order, max(1, order.size // 200)) if order.size else []:
        for k in batch[allowed(theta[batch])]:
            niches.setdefault(float(centres[k]), []).append(int(k))
    chosen = [k for own in niches.values() for k in own[:_PER_CROSSOVER]]
    if not chosen:
        return []
    box = genes.min(axis=0) - _BEYOND, genes.max(axis=0) + _BEYOND
    evolved, own_genes = evolve(
        basis, genes[chosen], signs[chosen], box=box, merit=merit, allowed=allowed
    )
    simple = sorted((k for own in niches.values() for k in own), key=lambda k: (hard[k], best[k]))
    is_right = partial(
        _stabilises, basis, family=family, n_unstable=n_unstable, allow_unstable=allow_unstable
    )
    found = _add_distinct([], evolved, own_genes, most=wanted, is_right=is_right)
    # a simple one comes after those that evolved, because convex steps may improve it more; all
    # simple ones if no evolved one is proved stable, because the winding number was estimated
    return [
        one
        for one, _ in _add_distinct(
            found, theta[simple], genes[simple], most=wanted + 1, is_right=is_right
        )
    ]


def _stabilises(
    basis: Basis,
    theta: np.ndarray,
    *,
    family: list[PlantOnLines],
    n_unstable: int,
    allow_unstable: bool,
) -> bool:
    """Return True for a controller that stabilises every plant, and is stable itself if
    required.
    """
    K = basis.controller(theta)
    may_be_given = allow_unstable or unstable_poles(K, basis.dt) == 0
    return may_be_given and loops_stable(K, family, n_unstable)[0] is Stability.STABLE


def _add_distinct(
    found: list[tuple[np.ndarray, np.ndarray]],
    thetas: np.ndarray,
    genes: np.ndarray,
    *,
    most: int,
    is_right: Callable[[np.ndarray], bool],
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return parameters with their genes: those found, and other valid ones distinct from them, up
    to a number.
    """
    found = list(found)
    for theta, own in zip(thetas, genes, strict=True):
        if len(found) >= most:
            break
        if not any(np.abs(own - other).max() < _DISTINCT for _, other in found) and is_right(theta):
            found.append((theta, own))
    return found


def _winding_test(
    basis: Basis, family: list[PlantOnLines], n_unstable: int
) -> Callable[[np.ndarray], np.ndarray]:
    """Return a test of (N, n) stable controllers for the right winding number of 1 + L, on the
    lines of every plant.
    """
    n_K = basis.structure.n_integrators + integrator_poles(basis.fixed, basis.dt)
    plants = []
    for at in family:
        if at.loop is None:
            lines, G = at.measured
            below = at.readings[0].omega
            omega, wanted = np.concatenate([below, lines]), n_unstable
            curves = [(one.n_integrators, one.G) for one in at.readings]
        else:
            omega = at.omega[at.known]
            below = omega[:0]
            G = response(_barely_damped(at.loop.G, _PULLED_IN * omega.min()), omega)
            wanted = unstable_poles(at.loop.G, at.loop.dt)
            curves = [(at.n_integrators, np.zeros(0, complex))]
        Y, X = basis.columns(omega)
        plants.append((below.size, Y.T, X.T, G, curves, at.loop is None, wanted))

    def is_right(theta: np.ndarray) -> np.ndarray:
        out = np.ones(len(theta), dtype=bool)
        for n_below, Y, X, G, curves, resolved, wanted in plants:
            with np.errstate(all="ignore"):
                K = (theta @ X) / (theta @ Y)
                on_lines = 1 + K[:, n_below:] * G
                for n, below in curves:
                    F = np.hstack([1 + K[:, :n_below] * below, on_lines])
                    turns, clear = count_half_turns(F, n_K + n)
                    out &= np.round(turns) == wanted
                    if resolved:  # otherwise it is an estimate: the poles decide
                        out &= clear
        return out

    return is_right


def _barely_damped(G: control.StateSpace, sigma: float) -> control.StateSpace:
    """Return the plant with every pole pulled in by sigma [rad/s]: on the boundary the winding
    would be rounding.
    """
    dt = timebase(G)
    if dt:
        A = G.A * np.exp(-sigma * dt)
    else:
        A = G.A - sigma * np.eye(G.nstates)
    return control.ss(A, G.B, G.C, G.D, G.dt)


def start_from_controller(basis: Basis, start: Controller, at: PlantOnLines) -> np.ndarray:
    """Return the parameters of a given controller; refuse one without the structure."""
    K0 = state_space("start", start)
    require_sampling_time("start", K0, reference="the design", wanted=basis.dt)
    omega = at.omega[at.omega <= at.highest * (1 + 1e-9)]
    theta = _project_on_structure(basis, K0, omega)
    K, k = basis.controller(theta), response(K0, omega)
    error = float(np.max(np.abs(response(K, omega) - k) / np.abs(k)))
    if not error < 0.1:
        raise ValueError(
            f"start must have the structure {basis.structure.name!r}, got a controller that"
            f" differs from the nearest one of this structure by {100 * error:.2g} %"
        )
    return theta
