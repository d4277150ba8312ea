"""Systems joined: in series, in parallel, in a loop of their own."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import constant

__all__ = ["feedback", "in_parallel", "in_series", "inverse", "one_plus"]


def in_series(*systems: control.StateSpace, dt: float | None = None) -> control.StateSpace:
    """First system first: the output of each drives the next; all states are kept."""
    total = systems[0]
    for system in systems[1:]:
        nt, ns = total.nstates, system.nstates
        A = np.block([[total.A, np.zeros((nt, ns))], [system.B @ total.C, system.A]])
        B = np.vstack([total.B, system.B @ total.D])
        C = np.hstack([system.D @ total.C, system.C])
        step = total.dt if constant(system) or total.dt is not None else system.dt
        total = control.StateSpace(A, B, C, system.D @ total.D, system.dt if constant(total) else step)
    return total if dt is None else control.StateSpace(total.A, total.B, total.C, total.D, dt)


def in_parallel(F: control.StateSpace, G: control.StateSpace) -> control.StateSpace:
    """F + G."""
    n, m = F.nstates, G.nstates
    A = np.block([[F.A, np.zeros((n, m))], [np.zeros((m, n)), G.A]])
    return control.StateSpace(A, np.vstack([F.B, G.B]), np.hstack([F.C, G.C]), F.D + G.D, F.dt)


def one_plus(X: control.StateSpace) -> control.StateSpace:
    """1 + X."""
    return control.StateSpace(X.A, X.B, X.C, X.D + 1, X.dt)


def inverse(X: control.StateSpace) -> control.StateSpace:
    """1 / X for a biproper X."""
    d = X.D[0, 0]
    if abs(d) < 1e-9:
        raise ValueError("form must leave the perturbed plant proper, got 1 + weight Delta = 0 at infinite frequency")
    return control.StateSpace(X.A - X.B @ X.C / d, X.B / d, -X.C / d, [[1 / d]], X.dt)


def feedback(G: control.StateSpace, X: control.StateSpace) -> control.StateSpace:
    """G / (1 + X G): y = G (u - X y), where the two direct terms close a loop of their own."""
    k = 1 / (1 + G.D[0, 0] * X.D[0, 0])
    A = np.block(
        [
            [G.A - k * X.D[0, 0] * G.B @ G.C, -G.B @ X.C * k],
            [k * X.B @ G.C, X.A - k * G.D[0, 0] * X.B @ X.C],
        ]
    )
    B = np.vstack([k * G.B, k * G.D[0, 0] * X.B])
    return control.StateSpace(A, B, np.hstack([k * G.C, -k * G.D[0, 0] * X.C]), k * G.D, G.dt)
