"""Friction at several places of a machine, as on motor and load: the largest forces, the
multiplier weights, and a bound on the final distance from rest.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import require_positive
from robust.friction.bounds import steady_error_bound
from robust.friction.loop import FrictionLoop
from robust.friction.plant import ROUNDING, FrictionPlant
from robust.friction.proof.dissipation import ROUNDED_UP
from robust.friction.proof.multipliers import negative_multipliers, port_terms

#: Coupling of the forces at two ports, relative to a definite matrix: slack for the aliases of the
#: sampler.
_COUPLINGS = (0.9, 0.99)
_MIN_SHARE = 1e-9  # share of a row that must remain


def largest_forces(machine: FrictionPlant, Fs: float | Sequence[float] | None) -> np.ndarray:
    """Return the (P,) largest friction force of each port; nan if none was given."""
    if Fs is None:
        return np.full(machine.n_ports, np.nan)
    given = np.atleast_1d(np.asarray(Fs, dtype=object))
    if given.shape != (machine.n_ports,):
        raise ValueError(
            f"Fs must be a force for each friction port, {machine.n_ports}, got {given.size}"
        )
    return np.array([require_positive("Fs", force) for force in given])


def coupling_of_rests(loop: FrictionLoop) -> tuple[str, bool]:
    """Return the reason why no stored energy fits the rests of several ports; and whether it needs
    equal weights.

    X_pq is the displacement at port p at rest under a friction of 1 N at port q: s_p X_pq must be
    symmetric. With integral action on the motor, only the stretch of each part beyond the motor is
    left of X.
    """
    rest, offset = loop.rest()
    X, unsure = loop.displacements @ rest, np.abs(loop.displacements) @ offset
    coupled = np.abs(X) > 10 * unsure
    np.fill_diagonal(coupled, False)
    if not coupled.any():
        return "", False
    if np.all(np.abs(X - X.T) <= 10 * (unsure + unsure.T)):
        return "", True
    return (
        (
            "the rest of one port depends on the friction at another, and not the other way round,"
            " as with a position loop on the encoder of the load: no stored energy is known for"
            " this case"
        ),
        False,
    )


def weights_of_ports(
    response: np.ndarray,
    omega: np.ndarray,
    *,
    rates: np.ndarray,
    K0: np.ndarray,
    rho: np.ndarray,
    balanced: bool,
) -> np.ndarray | None:
    """Return (P, 1 + J) weights of the filters at each port; None if there are none.

    response : (W, P, P) velocity at each port over the friction at each.
    balanced : s = mu_0 + (1 - 1/rho) sum_j mu_j must be the same at all ports.
    """
    table = port_terms(response, omega, rates=rates, K0=K0, rho=rho)
    n_ports, n = rho.size, 1 + rates.size
    shares = np.hstack(
        [
            np.ones((n_ports, 1)),
            np.repeat(1 - 1 / np.maximum(rho, ROUNDED_UP)[:, None], n - 1, axis=1),
        ]
    )
    equal = None
    if balanced:
        equal = np.zeros((n_ports * n, n_ports - 1))
        for port in range(1, n_ports):
            equal[:n, port - 1], equal[port * n : (port + 1) * n, port - 1] = (
                shares[0],
                -shares[port],
            )
    theta = negative_multipliers(table, couplings=_COUPLINGS, least=_MIN_SHARE, balanced=equal)
    if theta is None:
        return None
    mu = theta.reshape(n_ports, n)
    if not (mu[:, 1:] > 0).any(axis=1).all():
        return None
    if balanced:  # equal to rounding, not only to the tolerance of the program
        held = (shares * mu).sum(axis=1)
        mu[:, 0] += held.max() - held
    return mu


def bound_of_ports(loop: FrictionLoop, forces: np.ndarray, bristle_time: float = 0.0) -> float:
    """Return the largest distance of any port from rest that remains with any friction up to these
    forces; inf if there is no bound.

    Bristles with damping make the friction s + tau s' with a bounded s. After integration by parts
    s' enters through F B as s enters through B, unless a sample sees B at once. The bound is convex
    in tau, so it is largest at one end.
    """
    if not np.isfinite(forces).all() or not loop.growth() < 0:
        return np.inf
    if bristle_time:
        size = np.abs(loop.columns).max()
        if any(
            np.abs(jump @ loop.columns - loop.columns).max() > ROUNDING * size
            for jump in loop.jumps
        ):
            return np.inf
        ends = [loop.columns, loop.columns + bristle_time * loop.F @ loop.columns]
    else:
        ends = [loop.columns]
    return max(
        sum(
            force * max(steady_error_bound(replace(loop, B=end[:, port], x=x, v=v)) for end in ends)
            for port, force in enumerate(forces)
        )
        for x, v in zip(loop.displacements, loop.velocities, strict=True)
    )
