"""The controller that was shaped: gain and elements as the page names them, to one state space."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import control
import numpy as np

from robust.loopshaping.compensators import lag, lead, notch, roll_off
from robust.systems.connections import in_series
from robust.systems.realisation import state_space

__all__ = ["shaped_controller"]


def shaped_controller(state: Mapping[str, Any], K: Any, dt: float) -> control.StateSpace:
    """The controller K to begin with, times the gain and the elements of a state of the page.

    >>> state = {"gain": 2.0, "elements": [{"kind": "lead", "f": 1.0, "phase": 30.0}]}
    >>> round(float(abs(shaped_controller(state, 1.0, 0.0)(2j * np.pi))), 9)      # a lead has gain one there
    2.0
    """
    K = state_space("K", K)
    gain = control.StateSpace([], [], [], [[float(state.get("gain", 1.0))]], dt)
    elements = [element_of(element, dt) for element in state.get("elements", ())]
    return in_series(control.StateSpace(K.A, K.B, K.C, K.D, dt), gain, *elements)


def element_of(element: Mapping[str, Any], dt: float) -> control.StateSpace:
    """One element, by the function of `compensators` that the page writes out for it."""
    omega, kind = 2 * np.pi * element["f"], element["kind"]
    if kind == "integrator":
        return lag(omega, np.inf, dt=dt)
    if kind == "lead":
        return lead(omega, np.radians(element["phase"]), dt=dt)
    if kind == "notch":
        return notch(omega, depth=element["depth"], width=element["width"], dt=dt)
    return roll_off(omega, order=element["order"], zeta=element["zeta"], dt=dt)
