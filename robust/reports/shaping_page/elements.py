"""The shaped controller: gain and elements of the page as one state space."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.types import JsonObject
from robust._base.types import Controller
from robust.lti.connections import in_series
from robust.lti.realisation import state_space
from robust.synthesis.shaping import lag, lead, low_pass, notch


def shaped_controller(state: JsonObject, K: Controller, dt: float) -> control.StateSpace:
    """Return the controller K at the start, times the gain and the elements of a state of the page.

    >>> state = {"gain": 2.0, "elements": [{"kind": "lead", "f": 1.0, "phase": 30.0}]}
    >>> round(float(abs(shaped_controller(state, 1.0, 0.0)(2j * np.pi))), 9)      # a lead has gain one there
    2.0
    """
    K = state_space("K", K)
    gain = control.StateSpace([], [], [], [[float(state.get("gain", 1.0))]], dt)
    elements = [_shaping_element(element, dt) for element in state.get("elements", ())]
    return in_series(control.StateSpace(K.A, K.B, K.C, K.D, dt), gain, *elements)


def _shaping_element(element: JsonObject, dt: float) -> control.StateSpace:
    """Return one element, by the function of `robust.shaping` that the Python of the page uses."""
    omega, kind = 2 * np.pi * element["f"], element["kind"]
    if kind == "integrator":
        return lag(omega, np.inf, dt=dt)
    if kind == "lead":
        return lead(omega, np.radians(element["phase"]), dt=dt)
    if kind == "notch":
        return notch(omega, depth=element["depth"], width=element["width"], dt=dt)
    return low_pass(omega, order=element["order"], zeta=element["zeta"], dt=dt)
