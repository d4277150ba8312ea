"""Machines of a nominal model, damped and undamped.

The damping of such a fit contains that of the friction at this level. A proof must not lean on it: the same model with
its poles and zeros turned onto the imaginary axis is a machine of its own.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf.shared.wording import hertz
from robust.sliding.machine import SlidingMachine, sliding_machine
from robust.systems.lti import poles, response, zeros
from robust.systems.realisation import from_roots, state_space
from robust.systems.sampling import without_pade

__all__ = ["error_of_nominal", "machines_of_nominal", "modal_damping", "undamped"]

#: Of the largest root: nearer to the real axis than this a pair of roots does not swing.
SWINGS = 1e-9


def machines_of_nominal(nominal: Any) -> tuple[tuple[SlidingMachine, ...], str]:
    """(machines, description): the nominal as a machine without and with its damping, each with its delay.

    `nominal` is a fit or a model from force to position with at least two poles more than zeros, or a `sliding_machine`
    with a friction port of its own, which is taken as it is.
    """
    G = getattr(nominal, "G", nominal)
    if isinstance(G, SlidingMachine):
        return (G,), f"the machine that was given ({G.words})"
    G, approximated = without_pade(state_space("nominal", G))
    delay = approximated + float(getattr(nominal, "delay", 0.0))
    description = f"a nominal of order {G.nstates}, {modal_damping(G)}"
    return tuple(replace(machine, delay=delay) for machine in (undamped(G), sliding_machine(G))), description


def error_of_nominal(nominal: Any, omega: np.ndarray) -> np.ndarray:
    """(W,) standard deviation of a fitted nominal at frequencies, relative to its response; zero of one that was given.

    The lines scatter, and a fit of p real parameters to n lines takes p/(2 n) of their variance on, on average.
    """
    if np.isnan(getattr(nominal, "std", np.nan)).any():
        return np.zeros(omega.size)
    order = np.argsort(nominal.omega)
    relative = (nominal.std / np.abs(nominal.response))[order]
    taken = nominal.n_parameters / (2 * nominal.omega.size) * max(1.0, nominal.cost / nominal.expected_cost)
    return np.asarray(np.sqrt(taken) * np.interp(omega, nominal.omega[order], relative))


def undamped(G: control.StateSpace) -> SlidingMachine:
    """The same machine without damping: every s^2 + d s + k of its poles and zeros loses its d; its mass is kept.

    >>> machine = undamped(control.ss(control.tf([1], [1, 4, 80e3])))
    >>> bool(abs(np.linalg.eigvals(machine.A).real).max() < 1e-9), round(machine.resonance, 3)
    (True, 282.843)
    """
    G, delay = without_pade(G)
    p, z = turned(poles(G)), turned(zeros(G))
    omega = 1e3 * np.abs(p).max()  # far above every root both behave as gain/s^excess
    far = 1j * omega
    gain = response(G, np.array([omega]))[0] * np.prod(far - poles(G)) / np.prod(far - zeros(G))
    machine = sliding_machine(from_roots(z, p, float(np.real(gain)), 0.0))
    return SlidingMachine(
        **{name: getattr(machine, name) for name in ("A", "B_force", "B_port", "C_measured", "C_port")},
        words=f"{machine.words} without damping",
        delay=delay,
    )


def turned(roots: np.ndarray) -> np.ndarray:
    """Roots of the modes without damping: pairs that swing on the imaginary axis, and real ones by two, small to large.

    Two real roots are a mode with so much damping that it does not swing, as a free mass whose friction slides. An odd
    one is left as it is: that of an amplifier.
    """
    swings = np.abs(roots.imag) > SWINGS * np.abs(roots).max(initial=0.0)
    real = np.sort(roots[~swings].real)[::-1]
    real = real[np.argsort(np.abs(real), kind="stable")]
    pairs = [sign * np.sqrt(complex(-p * q)) for p, q in zip(real[:-1:2], real[1::2], strict=True) for sign in (1, -1)]
    left = real[-1:] if real.size % 2 else real[:0]
    return np.concatenate([1j * np.sign(roots[swings].imag) * np.abs(roots[swings]), pairs, left])


def modal_damping(G: control.StateSpace) -> str:
    """The damping of its modes in words: it contains that of the friction at the level of the fit."""
    found = poles(G)
    found = found[found.imag > SWINGS * np.abs(found).max()]
    if not found.size:
        return "no mode that swings"
    modes = sorted(found, key=abs)
    said = ", ".join(f"{100 * -p.real / abs(p):.2g} % at {hertz(abs(p))}" for p in modes)
    return f"modal damping {said}, which contains the friction's"
