"""A system as the page computes with it: a Hessenberg form, whose response costs n^2 operations a frequency."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy.linalg import hessenberg

from robust.systems.lti import scaled_states, timebase
from robust.systems.stability import certain_poles

__all__ = ["doubtful_poles", "encoded_response"]


def encoded_response(system: control.StateSpace) -> dict[str, Any]:
    """Numbers from which the page computes C (x I - H)^-1 B + D: x = j omega, or exp(j omega dt) - 1 where sampled.

    A sampled system is given by A - I: its slow poles crowd around one, and would lose their digits there.
    """
    dt = timebase(system)
    A, B, C = scaled_states(system.A - np.eye(system.nstates) * (dt > 0), system.B, system.C)
    H, Q = hessenberg(A, calc_q=True) if A.size else (A, A)
    return {
        "dt": dt,
        "H": H.ravel().tolist(),
        "b": (Q.T @ B).ravel().tolist(),
        "c": (C @ Q).ravel().tolist(),
        "d": float(system.D[0, 0]),
    }


def doubtful_poles(system: control.StateSpace) -> list[list[float]]:
    """[re, im] of the poles that are not stable beyond rounding; of a sampled system under s = 2/dt (z - 1)/(z + 1)."""
    dt = timebase(system)
    poles, moved = certain_poles(system)
    found = poles[(np.abs(poles) - 1 if dt else poles.real) >= -moved]
    if dt:
        found = 2 / dt * (found - 1) / (found + 1)
    return [[float(p.real), float(p.imag)] for p in found]
