"""Values, systems and demands as text, for the report page."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from robust._base.types import Weight
from robust.lti.lti import response, timebase, to_s_plane
from robust.lti.realisation import state_space

#: Relative imaginary part that rounding gives to a double root: the root of 1e-16, with a margin.
_DOUBLE_ROOT = 1e-7


def rows_of_value(thing: object) -> str:
    """Return the text of a value without indents."""
    return "\n".join(row.strip() for row in str(thing).splitlines())


def describe_system(system: control.StateSpace) -> str:
    """Return a system in one line."""
    if timebase(system):
        kind = f"sampled at {1 / timebase(system):g} Hz"
    else:
        kind = "continuous"
    return f"{system.nstates} states, {kind}"


def describe_roots(roots: np.ndarray, dt: float) -> str:
    """Return poles or zeros as frequency and damping; a root at s = 0 is an integrator."""
    if not roots.size:
        return "none"
    # rounding makes a pair of a double root z < 0, which is no oscillation: both are listed
    real = (roots.real < 0) & (np.abs(roots.imag) < _DOUBLE_ROOT * np.abs(roots))
    s = to_s_plane(np.where(real & (dt > 0), roots.real, roots), dt)
    text = []
    for root in sorted(s[s.imag >= -1e-9 * np.abs(s)], key=abs):
        size = abs(root)
        if not np.isfinite(size):
            text.append("z = 0")
        elif size < 1e-6:
            text.append("0 Hz (integrator)")
        elif abs(root.imag) < 1e-9 * size:
            text.append(
                f"{size / 2 / np.pi:.4g} Hz" + (" (unstable side)" if root.real > 0 else "")
            )
        else:
            text.append(
                f"{size / 2 / np.pi:.4g} Hz, damping {round(-root.real / size, 6) + 0.0:.3g}"
            )
    return "; ".join(text)


def describe_demand(w_P: Weight) -> str:
    """Return the limits of |S| by a performance weight as text."""
    w_P = state_space("w_P", w_P)
    omega = np.geomspace(1e-3, 1e6, 4000)
    if timebase(w_P):
        omega = omega[omega * timebase(w_P) < np.pi]
    size = np.abs(response(w_P, omega))
    above = np.flatnonzero(size >= 1)
    if above.size:
        at = f", |S| below one up to {format_hertz(omega[above[-1]])}"
    else:
        at = ""
    return f"|S| at most {1 / size[0]:.3g} at low and {1 / size[-1]:.3g} at high frequency{at}"
