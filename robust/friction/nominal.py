"""Machines of a nominal model of an axis, damped and undamped.

The damping of a fitted model contains damping by friction at the level of the record, on which a
proof must not rely. So a second plant has the same poles and zeros, moved onto the imaginary axis.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf._base.arguments import format_hertz
from robust.friction.plant import FrictionPlant, friction_plant, require_one_port
from robust.lti.lti import poles, response, zeros
from robust.lti.realisation import from_roots, state_space
from robust.lti.sampling import without_pade

#: A pair of roots closer to the real axis than this, relative to the largest root, does not
#: oscillate.
_OSCILLATORY_TOLERANCE = 1e-9


def machines_of_nominal(nominal: object) -> tuple[tuple[FrictionPlant, ...], str]:
    """Return (machines, description): the nominal as a machine without and with its damping, each
    with its delay.

    `nominal` is a fit or a model from force to position with at least two poles more than zeros, or
    a `friction_plant` with one friction port, which is used as it is.
    """
    G = getattr(nominal, "G", nominal)
    if isinstance(G, FrictionPlant):
        require_one_port(G)
        return (G,), f"the given machine ({G.description})"
    G, approximated = without_pade(state_space("nominal", G))
    delay = approximated + float(getattr(nominal, "delay", 0.0))
    description = f"a nominal of order {G.nstates}, {_describe_modal_damping(G)}"
    return tuple(
        replace(machine, delay=delay) for machine in (_undamped(G), friction_plant(G))
    ), description


def error_of_nominal(
    nominal: Any, omega: np.ndarray
) -> np.ndarray:  # a fit comes from above this package
    """Return (W,) the standard deviation of a fitted nominal relative to its response; zero for a
    model that was given.

    The lines scatter, and a fit of p real parameters to n lines inherits p/(2 n) of their variance
    on average.
    """
    if np.isnan(getattr(nominal, "std", np.nan)).any():
        return np.zeros(omega.size)
    order = np.argsort(nominal.omega)
    relative = (nominal.std / np.abs(nominal.response))[order]
    taken = (
        nominal.n_parameters
        / (2 * nominal.omega.size)
        * max(1.0, nominal.cost / nominal.expected_cost)
    )
    return np.asarray(np.sqrt(taken) * np.interp(omega, nominal.omega[order], relative))


def _undamped(G: control.StateSpace) -> FrictionPlant:
    """Return the machine without damping: each s^2 + d s + k of its poles and zeros loses its d,
    the mass is kept.

    >>> machine = _undamped(control.ss(control.tf([1], [1, 4, 80e3])))
    >>> bool(abs(np.linalg.eigvals(machine.A).real).max() < 1e-9), round(machine.resonance, 3)
    (True, 282.843)
    """
    G, delay = without_pade(G)
    p, z = _undamped_roots(poles(G)), _undamped_roots(zeros(G))
    omega = 1e3 * np.abs(p).max()  # far above every root both behave as gain/s^excess
    far = 1j * omega
    gain = response(G, np.array([omega]))[0] * np.prod(far - poles(G)) / np.prod(far - zeros(G))
    machine = friction_plant(from_roots(z, p, float(np.real(gain)), 0.0))
    return FrictionPlant(
        **{
            name: getattr(machine, name)
            for name in ("A", "B_force", "B_port", "C_measured", "C_port")
        },
        description=f"{machine.description} without damping",
        delay=delay,
    )


def _undamped_roots(roots: np.ndarray) -> np.ndarray:
    """Return the roots without damping, small to large: oscillatory pairs on the imaginary axis,
    real roots in pairs.

    Two real roots are a mode with so much damping that it does not oscillate, such as a free mass
    whose friction slides. An odd real root stays as it is: it is that of an amplifier.
    """
    swings = np.abs(roots.imag) > _OSCILLATORY_TOLERANCE * np.abs(roots).max(initial=0.0)
    real = np.sort(roots[~swings].real)[::-1]
    real = real[np.argsort(np.abs(real), kind="stable")]
    pairs = [
        sign * np.sqrt(complex(-p * q))
        for p, q in zip(real[:-1:2], real[1::2], strict=True)
        for sign in (1, -1)
    ]
    if real.size % 2:
        left = real[-1:]
    else:
        left = real[:0]
    return np.concatenate([1j * np.sign(roots[swings].imag) * np.abs(roots[swings]), pairs, left])


def _describe_modal_damping(G: control.StateSpace) -> str:
    """Describe the damping of the modes, which contains the friction of the fit's level."""
    found = poles(G)
    found = found[found.imag > _OSCILLATORY_TOLERANCE * np.abs(found).max()]
    if not found.size:
        return "no mode that oscillates"
    modes = sorted(found, key=abs)
    text = ", ".join(f"{100 * -p.real / abs(p):.2g} % at {format_hertz(abs(p))}" for p in modes)
    return f"modal damping {text}, which includes that of the friction"
