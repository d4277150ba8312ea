"""Trajectories of theta on which a loop grows: the product of its transition matrices over one
period, in balls.

theta is linear between vertices, or held from one to the next. For linear motion x' = A(theta(t)) x
is solved by a power series in time. The remainder is bounded by that of the scalar equation whose
coefficients are the norms of those of A. A period with matrix Phi grows if |trace Phi^k| > n for
some k, because then its spectral radius is above one.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import numpy as np
from flint import arb, arb_mat, ctx

from nlfrf._base.values import value
from robust.proofs.exact.polynomial_matrices import PolynomialMatrix, shifted
from robust.proofs.exact.sampled_motion import augmented_plant, norm_bound
from robust.proofs.exact.scheduled_kyp import ScheduleClaim
from robust.proofs.exact.scheduled_loop import ScheduledLoop, constant

_BITS = 320
_SQUARINGS = 40
_TINY = arb(2) ** -120


@value
class Trajectory:
    """A period of theta.

    Fields
    ------
    theta : (N,) ndarray
        Vertices in [-1, 1].
    step : float
        Time between vertices [s].
    held : bool
        True if theta jumps to each vertex and is held; otherwise it is linear in between.
    delta : float
        The perturbation is this number times the identity, -1 to 1.
    """

    theta: np.ndarray
    step: float
    held: bool = False
    delta: float = 0.0

    @property
    def rate(self) -> float:
        """Largest |theta'| [1/s]; inf if theta jumps."""
        moves = np.abs(np.diff(self.theta, append=self.theta[:1]))
        if self.held and moves.any():
            return np.inf
        return float(moves.max() / self.step)


def grows(claim: ScheduleClaim, trajectory: Trajectory) -> bool:
    """Return whether the loop of a claim certainly grows on a trajectory; its P and scalings are
    not used.
    """
    if not (np.abs(trajectory.theta).max() <= 1 and abs(trajectory.delta) <= 1):
        return False
    with ctx.workprec(_BITS):
        loop = held_loop(claim)
        if not claim.controller.dt:
            flows = _continuous_steps(claim, loop, trajectory)
        else:
            flows = _sampled_steps(claim, loop, trajectory)
        period = constant(np.eye(loop.A.shape[0])).parts[0]
        for flow in flows:
            period = flow * period
        for _ in range(_SQUARINGS):
            if abs(period.trace()) > period.nrows():
                return True
            period = period * period
    return False


def held_loop(claim: ScheduleClaim) -> ScheduledLoop:
    """Return the loop of a claim with theta constant within a sample."""
    loop = replace(claim, rate=0.0, jumps=True).loop()
    assert loop is not None  # a motion may be too fast for a bound, a hold is not
    return loop


def _close_loop(
    loop: ScheduledLoop, theta: float, delta: float, *, weighted: bool
) -> tuple[arb_mat, arb_mat]:
    """Return A at theta with the perturbation delta, and w over x (rows of all channels)."""
    A, B, C, D = (getattr(loop, name).at(arb(theta)) for name in "ABCD")
    n, m = B.nrows(), B.ncols()
    w = arb_mat(m, n)
    if weighted and delta:
        q = loop.blocks[0][0]
        first_C = arb_mat(C.tolist()[:q])
        first_D = arb_mat([row[:q] for row in D.tolist()[:q]])
        eye = constant(np.eye(q)).parts[0]
        found = (eye - first_D * arb(delta)).solve(first_C * arb(delta))
        w = arb_mat(m, n, found.entries() + [0] * ((m - q) * n))
    return A + B * w, w


def _continuous_steps(
    claim: ScheduleClaim, loop: ScheduledLoop, trajectory: Trajectory
) -> list[arb_mat]:
    """Return the transition matrices of a continuous loop; a perturbation with direct feedthrough
    is left out.
    """
    A = loop.A
    if trajectory.delta:
        if claim.weight is None:
            return []
        q = loop.blocks[0][0]
        if any(x != 0 for part in loop.D.parts for row in part.tolist()[:q] for x in row[:q]):
            return []
        pick = constant(np.eye(loop.B.shape[1], q))
        A = A + loop.B * pick * constant(np.eye(q, loop.C.shape[0])) * loop.C.scaled(
            trajectory.delta
        )
    ends = np.append(trajectory.theta, trajectory.theta[0])
    if trajectory.held:
        return [_transition(A, a, a, trajectory.step) for a in trajectory.theta]
    return [_transition(A, a, b, trajectory.step) for a, b in pairwise(ends)]


def _sampled_steps(
    claim: ScheduleClaim, loop: ScheduledLoop, trajectory: Trajectory
) -> list[arb_mat]:
    """Return the closed loop from sample to sample; the plant moves exactly in between."""
    n = claim.plant.order
    plant = PolynomialMatrix.of(augmented_plant(claim.plant.A, claim.plant.B)[0])
    ends = np.append(trajectory.theta, trajectory.theta[0])
    made = []
    for a, b in pairwise(ends):
        A, w = _close_loop(loop, a, trajectory.delta, weighted=claim.weight is not None)
        if not claim.plant.dt:
            flow = _transition(plant, a, a if trajectory.held else b, claim.controller.dt)
            xi, order = loop.xi.at(arb(a)).tolist(), A.nrows()
            reached = (
                arb_mat([row[:order] for row in xi]) + arb_mat([row[order:] for row in xi]) * w
            )
            A = arb_mat((flow * reached).tolist()[:n] + A.tolist()[n:])
        made.append(A)
    return made


def _transition(A: PolynomialMatrix, start: float, end: float, step: float) -> arb_mat:
    """Return the transition matrix of x' = A(theta) x over a step [s], with theta linear from start
    to end.
    """
    n, T = A.shape[0], arb(step)
    parts = [p * T for p in shifted(A.parts, start, arb(end) - arb(start))]
    sizes = [norm_bound(p) for p in parts]
    whole = sum((size / (j + 1) for j, size in enumerate(sizes)), arb(0)).exp()
    terms, bounds = [constant(np.eye(n)).parts[0]], [arb(1)]
    made, below = terms[0], arb(1)
    while not (whole - below) < _TINY * whole:
        k = len(terms) - 1
        both = list(zip(parts, sizes, terms[::-1], bounds[::-1], strict=False))
        terms.append(sum((p * x for p, _, x, _ in both), parts[0] * arb(0)) * (arb(1) / (k + 1)))
        bounds.append(sum((s * y for _, s, _, y in both), arb(0)) / (k + 1))
        made, below = made + terms[-1], below + bounds[-1]
    rest = (whole - below).upper()
    return arb_mat(n, n, [x + arb(0, rest) for x in made.entries()])
