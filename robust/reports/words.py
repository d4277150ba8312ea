"""Systems and demands in words, for the report page."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.wording import hertz
from robust.systems.lti import response, timebase
from robust.systems.realisation import state_space

__all__ = ["demand_text", "roots_text", "system_text"]


def system_text(system: control.StateSpace) -> str:
    """A system in one line."""
    kind = f"sampled at {1 / timebase(system):g} Hz" if timebase(system) else "continuous"
    return f"{system.nstates} states, {kind}"


def roots_text(roots: np.ndarray, dt: float) -> str:
    """Poles or zeros as frequency and damping, those at the origin of s counted apart."""
    if not roots.size:
        return "none"
    with np.errstate(divide="ignore"):
        s = np.log(roots.astype(complex)) / dt if dt else roots
    said = []
    for root in sorted(s[s.imag >= -1e-9 * np.abs(s)], key=abs):
        size = abs(root)
        if not np.isfinite(size):
            said.append("z = 0")
        elif size < 1e-6:
            said.append("0 Hz (integrator)")
        elif abs(root.imag) < 1e-9 * size:
            said.append(f"{size / 2 / np.pi:.4g} Hz" + (" (unstable side)" if root.real > 0 else ""))
        else:
            said.append(f"{size / 2 / np.pi:.4g} Hz, damping {round(-root.real / size, 6) + 0.0:.3g}")
    return "; ".join(said)


def demand_text(w_P: Any) -> str:
    """A performance weight as what it allows of |S|."""
    w_P = state_space("w_P", w_P)
    omega = np.geomspace(1e-3, 1e6, 4000)
    if timebase(w_P):
        omega = omega[omega * timebase(w_P) < np.pi]
    size = np.abs(response(w_P, omega))
    above = np.flatnonzero(size >= 1)
    at = f", |S| below one up to {hertz(omega[above[-1]])}" if above.size else ""
    return f"|S| at most {1 / size[0]:.3g} at low and {1 / size[-1]:.3g} at high frequency{at}"
