"""A controller to begin from: simple shapes tried over the band, or one that was given, in the structure asked for."""

from __future__ import annotations

from dataclasses import replace
from itertools import product

import control
import numpy as np

from robust._base.states import Stability
from robust._base.types import Controller
from robust.analysis.loop import Loop, decide_nominal_stability
from robust.lti.connections import closed_loop
from robust.lti.lti import response, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import count_half_turns, extend_below, integrator_poles, unstable_poles, winding_number
from robust.synthesis.fixed.demands import Demand
from robust.synthesis.fixed.plants import PlantOnLines
from robust.synthesis.fixed.structures import Basis

CROSSOVERS, LEADS, RESETS, GAINS = 20, (1.0, 3.0, 10.0, 30.0), (0.03, 0.1, 0.3, 3.0), (1.0, 0.3, 0.1)
INTEGRATOR_LEAKS = (1e-4, 1e-2)
MAX_LINES = 60
PULLED_IN = 1e-6  # of the lowest line: far above rounding, far below any damping that a line shows


def simple_controllers(basis: Basis, at: PlantOnLines) -> tuple[np.ndarray, np.ndarray]:
    """Return (N, n) parameters and (N,) crossovers of PI-like, lead and mixed shapes with |L| = 1 all over the band."""
    shape = basis.structure
    sizes = np.abs(basis.plane(at.omega[at.known & (at.omega <= at.highest)]))
    n_pi = min(shape.n_zeros, shape.n_integrators)
    most = 0.5 * basis.fastest
    leaks = (0.0, *INTEGRATOR_LEAKS) if shape.free and shape.n_zeros > n_pi else (0.0,)
    leads = LEADS if shape.n_zeros > n_pi else LEADS[:1]
    resets = RESETS if n_pi or len(leaks) > 1 else RESETS[:1]
    zeros, poles, centres = [], [], []
    for c in np.geomspace(sizes.min(), sizes.max(), CROSSOVERS + 2)[1:-1]:
        for leak, lead, reset in product(leaks, leads, resets):
            slow = n_pi + (leak > 0)
            spare = shape.n_zeros - slow
            if (lead > 1 and spare == 0) or (reset != resets[0] and slow == 0):
                continue
            z = [reset * c] * slow + [c / np.sqrt(lead)] * (spare > 0) + [c] * (spare - 1)
            p = [leak * c] * (leak > 0) + [c * np.sqrt(lead)] * (spare > 0) + [c] * (spare - 1)
            zeros.append(z)
            poles.append((p + [10 * c] * shape.n_poles)[: shape.n_poles])
            centres.append(c)
    at_zeros, at_poles = (np.array(roots).reshape(len(centres), -1) for roots in (zeros, poles))
    at_poles = np.clip(at_poles, min(1.1 * basis.slowest, most), most)
    y = basis.coefficients(-at_poles) if shape.free else np.ones((len(centres), 1))
    return np.hstack([y, basis.coefficients(-at_zeros)]), np.array(centres)


def project_on_structure(basis: Basis, K0: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Parameters of a given controller, as near as the structure comes to it on the lines."""
    s = basis.plane(omega)
    k = response(K0, omega)
    Y, X = basis.Y(s) * basis.integrals(s)[:, None], basis.X(s) * response(basis.fixed, omega)[:, None]
    M = np.hstack([k[:, None] * Y, -X])
    weight = 1 / np.maximum(np.abs(k), 1e-12 * np.abs(k).max())
    for _ in range(8):  # Sanathanan & Koerner: the error of X/Y, not of X - K Y
        A = M * weight[:, None]
        A = np.vstack([A.real, A.imag])
        scale = np.maximum(np.linalg.norm(A, axis=0), 1e-300)
        theta = np.linalg.svd(A / scale)[2][-1] / scale
        weight = 1 / np.maximum(np.abs(k * (Y @ theta[: basis.n_y])), 1e-300)
    return theta if np.real(basis.Y(np.zeros(1, complex)) @ theta[: basis.n_y])[0] > 0 else -theta


def loops_stable(K: control.StateSpace, family: list[PlantOnLines], n_unstable: int) -> tuple[Stability, str]:
    """Whether K stabilises every plant of the family, by poles or by winding number, and if not, what was found."""
    for i, at in enumerate(family):
        who = f" of plant {i + 1}" if len(family) > 1 else ""
        if at.loop is not None:
            found, why = stable_by_poles(at.loop, K)
            if found is not Stability.STABLE:
                return found, f"the loop{who} {why}"
            continue
        dt = timebase(K)
        turns, clear = winding_number(at.omega[at.known], at.G[at.known], K=K, dt=dt)
        if not clear:
            return (
                Stability.UNDECIDED,
                f"the lines{who} are too far apart, or end too early, to count how often 1 + L winds about zero",
            )
        if turns != n_unstable + unstable_poles(K, dt):
            return Stability.UNSTABLE, f"the loop{who} is unstable: 1 + L winds {turns} times about zero"
    return Stability.STABLE, ""


def stable_by_poles(loop: Loop, K: control.StateSpace) -> tuple[Stability, str]:
    """Return whether every pole of a parametric loop is stable beyond rounding."""
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
    """Parameters of stabilising simple controllers, those that come nearest to the demands first; may be empty."""
    theta, centres = simple_controllers(basis, at)
    thin = np.zeros(at.omega.size, dtype=bool)
    thin[np.unique(np.linspace(0, at.omega.size - 1, MAX_LINES).astype(int))] = True
    for row in rows:
        if row.index.size < MAX_LINES:
            thin[row.index] = True
    s = basis.plane(at.omega[thin])
    Y = theta[:, : basis.n_y] @ (basis.Y(s) * basis.integrals(s)[:, None]).T
    X = theta[:, basis.n_y :] @ (basis.X(s) * response(basis.fixed, at.omega[thin])[:, None]).T
    # the gain that puts |L| = 1 at the line next to the crossover, of either sign, and less of it
    k = np.argmin(np.abs(np.log(np.abs(s) / centres[:, None])), axis=1)
    each = np.arange(centres.size)
    with np.errstate(divide="ignore"):
        unit = np.abs(Y[each, k] / (at.G[thin][k] * X[each, k]))
    gains = np.concatenate([sign * part * unit for sign in (1, -1) for part in GAINS])
    fine = np.isfinite(gains) & (gains != 0)
    which, gains = np.tile(each, 2 * len(GAINS))[fine], gains[fine]
    theta, centres = theta[which], centres[which]
    theta[:, basis.n_y :] *= gains[:, None]
    Y, X = Y[which], X[which] * gains[:, None]
    if positive:
        good = np.all(theta @ basis.gain_rows().T >= 0, axis=1)
        theta, centres, Y, X = theta[good], centres[good], Y[good], X[good]
    hard = np.max([np.ones(len(theta)), *(row.on(thin).measure(Y, X).max(axis=-1) for row in rows)], axis=0)
    if aim is not None:
        best = aim.on(thin).measure(Y, X).max(axis=-1)
    else:
        Y0, X0 = basis.zero_frequency()
        best = -np.abs((theta @ X0) / (np.abs(theta @ Y0) + 1e-9 * np.abs(theta * Y0).sum(axis=1)))
    found: list[np.ndarray] = []
    used: list[float] = []
    order = np.lexsort((best, hard))
    for batch in np.array_split(order, max(1, order.size // 200)) if order.size else []:
        for k in batch[winding_is_right(basis, theta[batch], family=family, n_unstable=n_unstable)]:
            if any(abs(np.log(centres[k] / c)) < 0.5 for c in used):
                continue
            K = basis.controller(theta[k])
            may_be_given = allow_unstable or unstable_poles(K, basis.dt) == 0
            if may_be_given and loops_stable(K, family, n_unstable)[0] is Stability.STABLE:
                found.append(theta[k])
                used.append(centres[k])
        if len(found) >= wanted:
            break
    return found


def winding_is_right(basis: Basis, theta: np.ndarray, *, family: list[PlantOnLines], n_unstable: int) -> np.ndarray:
    """Return (N,) bool: whether 1 + L winds as it has to for each of many stable controllers, on the lines."""
    out = np.ones(theta.shape[0], dtype=bool)
    n_K = basis.structure.n_integrators + integrator_poles(basis.fixed, basis.dt)
    for at in family:
        omega, G = at.omega[at.known], at.G[at.known]
        if at.loop is None:
            omega, G = extend_below(omega, G, n=at.n_integrators)
        else:
            G = response(barely_damped(at.loop.G, PULLED_IN * omega.min()), omega)
        Y, X = basis.columns(omega)
        with np.errstate(all="ignore"):
            F = 1 + G * (theta @ X.T) / (theta @ Y.T)
            turns, clear = count_half_turns(F, n_K + at.n_integrators)
        if at.loop is None:
            out &= clear & (np.round(turns) == n_unstable)
        else:  # a guess: the poles decide
            out &= np.round(turns) == unstable_poles(at.loop.G, at.loop.dt)
    return out


def barely_damped(G: control.StateSpace, sigma: float) -> control.StateSpace:
    """Return the plant with every pole pulled in by sigma [rad/s]: on the boundary rounding picks the side it turns."""
    dt = timebase(G)
    A = G.A * np.exp(-sigma * dt) if dt else G.A - sigma * np.eye(G.nstates)
    return control.ss(A, G.B, G.C, G.D, G.dt)


def start_from_controller(basis: Basis, start: Controller, at: PlantOnLines) -> np.ndarray:
    """Parameters of a controller the user gave, or a refusal when it does not have the structure."""
    K0 = state_space("start", start)
    if K0.nstates and timebase(K0) != basis.dt:
        raise ValueError(f"start must have the sampling time of the design, {basis.dt:g} s, got {timebase(K0):g} s")
    omega = at.omega[at.omega <= at.highest * (1 + 1e-9)]
    theta = project_on_structure(basis, K0, omega)
    K, k = basis.controller(theta), response(K0, omega)
    error = float(np.max(np.abs(response(K, omega) - k) / np.abs(k)))
    if not error < 0.1:
        raise ValueError(
            f"start must have the structure {basis.structure.name!r}, got one that the structure misses by "
            f"{100 * error:.2g} %"
        )
    return theta
