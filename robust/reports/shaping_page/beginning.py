"""The default start controller of the page: a gain, and the elements that the plant needs."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product
from operator import itemgetter

import numpy as np

from nlfrf._base.types import JsonObject
from robust.analysis.loop import Loop, assemble_loop, decide_in_floating_point
from robust.lti.lti import response
from robust.models.sets.forms import relative_radius
from robust.models.sets.model import UncertaintyModel
from robust.reports.shaping_page.elements import shaped_controller

_PHASE_MARGIN = 50.0  # of the nominal loop [degrees]
# of the integrator at the crossover [degrees]: a corner at a tenth, or at 2.7 times it
_LEAST_LAG = 6.0
_MOST_LAG = 70.0
_LEAST_LEAD, _MOST_LEAD = 5.0, 65.0  # [degrees]; a lead of more phase has too much gain for noise
_NOT_ROBUST = 1e6  # factor on rs for a loop that is not robustly stable: larger than any demand
_MOST_ROLL_OFF = (
    45.0  # phase lag of a first-order roll-off with its corner at the crossover [degrees]
)
_BELOW_NYQUIST = 0.9  # of the Nyquist frequency, for a corner
#: Crossovers over the first one, tried in this order until a loop is robust and meets the demand.
#: If a crossover is given, higher ones come before lower ones, at which the demand fails.
_BELOW, _AROUND = 2.0 ** -np.arange(7), np.array([1, 2, 4, *2.0 ** -np.arange(1, 5)])


def starting_state(
    models: Sequence[UncertaintyModel],
    loops: Sequence[Loop],
    omega: np.ndarray,
    *,
    omega_c: float | None,
    delay: float,
) -> JsonObject:
    """Return gain and elements that make |L| = 1 at omega_c [rad/s], or near it if that loop is not
    robust.

    The default of omega_c is the end of the demand, |w_P| = 1; without a demand, half the frequency
    at which the radius of the set reaches |G|. The first loop that is robustly stable and meets the
    demand is returned, else the nearest.
    """
    asked = omega_c if omega_c is not None else _end_of_demand(loops[0], omega)
    first, top = asked or _end_of_set(models[0], loops[0], omega) / 2, loops[0].omega_max / 2
    found: list[tuple[float, JsonObject]] = []
    for crossover in np.minimum(first * (_AROUND if asked else _BELOW), top):
        if crossover < first and any(
            missed < _NOT_ROBUST for missed, _ in found
        ):  # lower ones miss the demand by more
            break
        for sign, most_roll_off in product((1.0, -1.0), (0.0, _MOST_ROLL_OFF)):
            state = _shape_for(loops[0], float(crossover), sign, most_roll_off=most_roll_off)
            K = shaped_controller(state, 1.0, loops[0].dt)
            tried = [assemble_loop(model, K, w_P=loops[0].w_P, delay=delay) for model in models]
            found.append((_missed(tried, omega), state))
            if found[-1][0] <= 1:
                return state
    return min(found, key=itemgetter(0))[1]


def _missed(loops: Sequence[Loop], omega: np.ndarray) -> float:
    """Return the largest rp of loops on the grid, at most 1 without a demand.

    If a loop is not robustly stable, the number is above any rp and grows with rs; if one is
    unstable, it is infinite.
    """
    if not all(decide_in_floating_point(loop).stable for loop in loops):
        return np.inf
    curves = [loop.curves(omega) for loop in loops]
    rs = float(max(np.max(one.rs) for one in curves))
    if rs >= 1:
        return _NOT_ROBUST * rs
    return max((float(np.max(one.rp)) for one in curves if one.w_P is not None), default=rs)


def _end_of_demand(loop: Loop, omega: np.ndarray) -> float | None:
    """Return the highest frequency of the grid at which |w_P| >= 1 [rad/s]."""
    if loop.w_P is None:
        wanted = omega[:0]
    else:
        wanted = omega[np.abs(response(loop.w_P, omega)) >= 1]
    if 0 < wanted.size < omega.size:
        return float(wanted[-1])
    return None


def _end_of_set(model: UncertaintyModel, loop: Loop, omega: np.ndarray) -> float:
    """Return the lowest frequency [rad/s] above which the radius exceeds |G|, within the lines and
    half of Nyquist.
    """
    omega = omega[omega <= min(model.omega[-1], loop.omega_max)]
    radius = relative_radius(
        model.form, np.abs(response(model.weight, omega)), np.abs(loop.plant_response(omega))
    )
    below = np.flatnonzero(radius < 1)
    return float(omega[min(below[-1] + 1, omega.size - 1)] if below.size else omega[0])


def _shape_for(loop: Loop, omega_c: float, sign: float, *, most_roll_off: float) -> JsonObject:
    """Return a gain with the given sign, integrator and lead, for |L| = 1 and the phase margin at
    omega_c.

    A roll-off uses the remaining phase, up to most_roll_off [degrees], against resonances above
    omega_c.
    """
    G = complex(loop.plant_response(np.array([omega_c]))[0])
    # a phase from -270 to 90 degrees: more lead than 90 degrees counts as lag
    surplus = (np.degrees(np.angle(sign * G)) + 270) % 360 - 90 - _PHASE_MARGIN
    elements, f_c, highest = [], omega_c / 2 / np.pi, _BELOW_NYQUIST * loop.omega_max / 2 / np.pi
    poles = loop.given_plant.poles()
    integrates = np.any(
        np.abs(poles - 1 if loop.given_plant.dt else poles) < 1e-6 * omega_c * (loop.dt or 1.0)
    )
    if not integrates:
        lag = float(np.clip(surplus, _LEAST_LAG, _MOST_LAG))
        surplus -= lag
        elements.append(
            {"kind": "integrator", "f": _tidy(min(f_c * np.tan(np.radians(lag)), highest))}
        )
    if -surplus > _LEAST_LEAD:
        elements.append(
            {"kind": "lead", "f": _tidy(f_c), "phase": _tidy(min(-surplus, _MOST_LEAD))}
        )
    elif min(surplus, most_roll_off) > _LEAST_LAG:
        corner = f_c / np.tan(np.radians(min(surplus, most_roll_off)))
        elements.append(
            {"kind": "roll-off", "f": _tidy(min(corner, highest)), "order": 1, "zeta": 0.7}
        )
    state: JsonObject = {"gain": 1.0, "elements": elements}
    if loop.dt:
        at = np.exp(1j * omega_c * loop.dt)
    else:
        at = 1j * omega_c
    gain = 1 / abs(G * shaped_controller(state, 1.0, loop.dt)(at))
    return state | {"gain": _tidy(sign * gain)}


def _tidy(number: float) -> float:
    """Round to the four digits that the page shows."""
    return float(f"{number:.4g}")
