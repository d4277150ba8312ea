"""Machine and class of friction read around a nominal model that was fitted at the highest level, damped and undamped.

The damping of such a fit contains that of the friction at this level. A proof must not lean on it: the same model with
its poles and zeros turned onto the imaginary axis is a machine of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.wording import hertz
from robust.friction_proof.port_levels import Levels, levels_of
from robust.sliding.machine import SlidingMachine, sliding_machine
from robust.systems.lti import poles, response, zeros
from robust.systems.realisation import from_roots, state_space

__all__ = ["modal_damping", "read_around", "undamped"]

#: Of the friction's stiffness at the lowest level: what the next may show less of it.
AGREE = 0.2
#: Of the largest root: nearer to the real axis than this a pair of roots does not swing.
SWINGS = 1e-9


def read_around(blas: Sequence[Bla], nominal: Any) -> tuple[tuple[SlidingMachine, ...], Levels, str]:
    """(machines, levels, words): the nominal as a machine without and with its damping, and what is left of the levels.

    `nominal` is a model from force to position with at least two poles more than zeros, or a `sliding_machine` with a
    friction port of its own, which is taken as it is.
    """
    G = getattr(nominal, "G", nominal)
    machines: tuple[SlidingMachine, ...]
    if isinstance(G, SlidingMachine):
        machines, words = (G,), f"the machine that was given ({G.words})"
    else:
        G = state_space("nominal", G)
        machines = undamped(G), sliding_machine(G)
        words = f"a nominal of order {G.nstates} at the highest level, {modal_damping(G)}"
    levels = levels_of(blas, machines[-1])
    k = np.sort(levels.stiffness)
    if not k[-1] > max(0.0, k[0] + 3 * levels.stiffness_std):
        raise ValueError(
            f"blas must be stiffer at the lowest level than the nominal, got {k[-1] / 1e3:.4g} kN/m of friction there. "
            "Fit the nominal at the highest level"
        )
    if k[-1] - k[-2] > AGREE * k[-1]:
        raise ValueError(
            f"blas must reach so low that the friction gets no stiffer: it is {k[-2] / 1e3:.4g} and {k[-1] / 1e3:.4g} "
            f"kN/m at the two lowest levels, more than {100 * AGREE:g} % apart. Measure at a lower level"
        )
    return machines, levels, words


def undamped(G: control.StateSpace) -> SlidingMachine:
    """The same machine without damping: every root that swings keeps its size and goes to the axis, and so its gain.

    >>> machine = undamped(control.ss(control.tf([1], [1, 4, 80e3])))
    >>> bool(abs(np.linalg.eigvals(machine.A).real).max() < 1e-9), round(machine.resonance, 3)
    (True, 282.843)
    """
    p, z = turned(poles(G)), turned(zeros(G))
    omega = 1e3 * np.abs(p).max()  # far above every root both behave as gain/s^excess
    far = 1j * omega
    gain = response(G, np.array([omega]))[0] * np.prod(far - poles(G)) / np.prod(far - zeros(G))
    machine = sliding_machine(from_roots(z, p, float(np.real(gain)), 0.0))
    return SlidingMachine(
        **{name: getattr(machine, name) for name in ("A", "B_force", "B_port", "C_measured", "C_port")},
        words=f"{machine.words} without damping",
    )


def turned(roots: np.ndarray) -> np.ndarray:
    """Roots that swing on the imaginary axis; real ones as they are."""
    swings = np.abs(roots.imag) > SWINGS * np.abs(roots).max(initial=0.0)
    return np.where(swings, 1j * np.sign(roots.imag) * np.abs(roots), roots)


def modal_damping(G: control.StateSpace) -> str:
    """The damping of its modes in words: it contains that of the friction at the level of the fit."""
    found = poles(G)
    found = found[found.imag > SWINGS * np.abs(found).max()]
    if not found.size:
        return "no mode that swings"
    modes = sorted(found, key=abs)
    said = ", ".join(f"{100 * -p.real / abs(p):.2g} % at {hertz(abs(p))}" for p in modes)
    return f"modal damping {said}, which contains the friction's"
