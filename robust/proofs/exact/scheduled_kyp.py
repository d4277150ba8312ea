r"""The claim of a scheduled loop: V = x'P(theta)x decreases on every trajectory of theta and for
every perturbation.

    continuous   [A'P + PA +- nu P', PB; B'P, 0] + [C D]' X_L [C D] - diag(0, X_R) < 0
    discrete     [A B]' P+ [A B] - diag(P, 0)    + [C D]' X_L [C D] - diag(0, X_R) < 0

at every theta in [-1, 1], with P > 0 and X > 0, and X_R = gamma^2 X_L on the performance channel
with the gain gamma. nu is the largest |theta'| and T the sampling time (Wu, Yang, Packard & Becker
1996; with jumps Daafouz & Bernussou 2001). The first is affine in theta', the second in P+ =
P(theta + v), |v| <= s = nu T, which lies in the convex hull of the Bernstein coefficients of
P(theta + v) in v. A perturbation is causal with an L2 gain of at most one: from rest the supply of
each block is not negative at any time, nor is V.

The error of a sampled plant is in the margin: |[A B] xi + e|_P^2 <= (1 + a) |[A B] xi|_P^2 + (1 +
1/a) |e|_P^2.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from flint import arb, ctx
from scipy.linalg import block_diag

from nlfrf._base.values import value
from robust.proofs.exact.claim import LpvMatrices, Matrices
from robust.proofs.exact.polynomial_matrices import BITS, PolynomialMatrix, bernstein
from robust.proofs.exact.polynomials import Decision, proved, undecided
from robust.proofs.exact.sampled_motion import sup_bound
from robust.proofs.exact.scheduled_loop import GAINS, ScheduledLoop, assemble_schedule, constant
from robust.proofs.exact.verification import Verification, summarise_claims


@value
class ScheduleClaim:
    """A claim on a loop whose plant and controller depend on theta in [-1, 1], and the matrices
    that prove it.

    Fields
    ------
    plant, controller : LpvMatrices
        u = -K y. The plant is continuous, or discrete like the controller; it has no direct
        feedthrough.
    weight : Matrices or None
        W of the set.
    reads : tuple of str
        Form of the set, as in `LoopClaim`: ("G", "K"): G (1 + W Delta) at the input; ("K",): G + W
        Delta; (), ("G",): the inverse forms.
    delay : int
        Samples between u and the plant.
    rate : float
        Largest |theta'| [1/s]; 0 for jumps.
    jumps : bool
        True: theta jumps, at the samples of a sampled loop (held in between), otherwise at any
        time.
    gain, level : str, float
        "S" (from the reference to the error) or "GS" (from the input of the plant to its output),
        and the level of its L2 gain; "" and 1 for stability alone.
    P : (d + 1, n, n) ndarray
        V = z'P(theta)z with z = S^-1 x.
    S : (n, n) ndarray
        Coordinates of the loop as `assemble_schedule` makes it.
    scalings : (K,) ndarray
        X of each block.
    """

    SCHEMA: ClassVar[str] = "robust-schedule-certificate"
    UNITS: ClassVar[Mapping[str, str]] = {"dt": "s", "rate": "1/s", "delay": "samples"}
    LOOP: ClassVar[str] = (
        "u = -K(theta) y, theta in [-1, 1]; a continuous plant under a sampled K is held exactly"
    )

    plant: LpvMatrices
    controller: LpvMatrices
    weight: Matrices | None
    reads: tuple[str, ...]
    delay: int
    rate: float
    jumps: bool
    gain: str
    level: float
    P: np.ndarray
    S: np.ndarray
    scalings: np.ndarray

    def __post_init__(self) -> None:
        require_schedule(self.plant, self.controller, self.weight, self.reads)
        if self.gain not in ("", *GAINS) or not 0 < self.level < np.inf:
            raise ValueError(
                f"gain must be S or GS with a positive level, got {self.gain!r} with {self.level}"
            )
        if self.delay < 0 or not 0 <= self.rate < np.inf or bool(self.rate) is self.jumps:
            raise ValueError(
                f"rate must be positive, 0 for jumps, and delay in samples, got {self.rate},"
                f" {self.delay}"
            )

    @property
    def speed(self) -> float:
        """The rate, inf for jumps."""
        if self.jumps:
            return np.inf
        return self.rate

    def loop(self) -> ScheduledLoop | None:
        """Return the loop of the claim."""
        return assemble_schedule(
            self.plant,
            self.controller,
            weight=self.weight,
            reads=self.reads,
            delay=self.delay,
            rate=self.rate,
            gain=self.gain,
        )


def require_schedule(
    plant: LpvMatrices, controller: LpvMatrices, weight: Matrices | None, reads: tuple[str, ...]
) -> None:
    """Refuse parts that do not fit each other."""
    m, p = plant.B.shape[2], plant.C.shape[1]
    if plant.D.any():
        raise ValueError(
            "plant must have no direct feedthrough from input to output, got a D that is not zero"
        )
    if controller.D.shape[1:] != (m, p):
        raise ValueError(
            f"K must have {p} inputs and {m} outputs, got {controller.D.shape[2]} and"
            f" {controller.D.shape[1]}"
        )
    if plant.dt and plant.dt != controller.dt:
        raise ValueError(
            f"K must have the sampling time of the plant, {plant.dt:g} s, got {controller.dt:g} s"
        )
    if weight is not None:
        sides = (m if "K" in reads else p), (m if "G" in reads else p)
        if (
            weight.D.shape[1] != sides[0]
            or weight.D.shape[0] != sides[1]
            or weight.dt != controller.dt
        ):
            raise ValueError(
                f"weight must have {sides[0]} inputs, {sides[1]} outputs and the dt of K, got"
                f" {weight.D.shape[::-1]}"
            )


def verify_schedule(claim: ScheduleClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove a claim again from its numbers alone, in a few seconds (without a cap)."""
    return summarise_claims({describe(claim): decide_schedule(claim)})


def describe(claim: ScheduleClaim) -> str:
    """Return the name of a claim."""
    if not claim.gain:
        return "stability on every trajectory"
    return f"gain {claim.gain} below {claim.level:g} on every trajectory"


def decide_schedule(claim: ScheduleClaim) -> Decision:
    """Decide a claim at every theta in balls."""
    with ctx.workprec(BITS):
        loop = claim.loop()
        if loop is None:
            return undecided("theta moves too fast within a sample")
        n = loop.A.shape[0]
        shapes = claim.P.shape[1:], claim.S.shape, claim.scalings.shape
        if shapes != ((n, n), (n, n), (len(loop.blocks),)) or not np.all(claim.scalings > 0):
            return undecided("P and X do not fit the loop")
        if not np.array_equal(claim.P, claim.P.transpose(0, 2, 1)):
            return undecided("P is not symmetric")
        if not loop.dt and claim.jumps and claim.P[1:].any():
            return undecided("P must not go with theta where theta jumps")
        P = PolynomialMatrix.of(claim.P)
        if not P.is_positive_definite():
            return undecided("P is not positive definite at every operating point")
        for M in inequalities(loop, claim):
            if not (-M).is_positive_definite():
                return undecided("the inequality does not hold at every operating point")
    return proved()


def inequalities(loop: ScheduledLoop, claim: ScheduleClaim) -> list[PolynomialMatrix]:
    """Return the matrices that must be negative definite at every theta, one for each move."""
    S = PolynomialMatrix.of(claim.S[None])
    T = PolynomialMatrix([S.parts[0].inv()])
    A, B, C, D = T * loop.A * S, T * loop.B, loop.C * S, loop.D
    P = PolynomialMatrix.of(claim.P)
    n, m = B.shape
    left, right = scaled_blocks(loop.blocks, claim.scalings, claim.level if claim.gain else None)
    states, inputs = constant(np.eye(n, n + m)), constant(np.eye(m, n + m, n))
    AB, CD = A * states + B * inputs, C * states + D * inputs
    rest = CD.transpose() * constant(left) * CD - constant(
        np.diag(np.concatenate([np.zeros(n), right]))
    )
    if not loop.dt:
        half = states.transpose() * P * AB
        rest = rest + half + half.transpose()
        turn = states.transpose() * P.derivative().scaled(claim.rate) * states
        if not claim.P[1:].any():
            return [rest]
        return [rest + turn, rest - turn]
    rest = rest - states.transpose() * P * states
    made = []
    for later in moved_polynomials(P, claim.speed * loop.dt):
        M = AB.transpose() * later * AB + rest
        if loop.eps:
            enters = T * constant(np.eye(n, loop.plant_states))
            xi = loop.xi * constant(block_diag(claim.S, np.eye(m)))
            size = sup_bound(enters.transpose() * later * enters)
            a = arb(loop.eps) * (size * sup_bound(xi) ** 2).sqrt() + arb(2) ** -200
            M = (
                M
                + (AB.transpose() * later * AB).scaled(a)
                + (xi.transpose() * xi).scaled((1 + 1 / a) * arb(loop.eps) ** 2 * size)
            )
        made.append(M)
    return made


def scaled_blocks(
    blocks: list[tuple[int, int]], X: np.ndarray, level: float | None
) -> tuple[np.ndarray, np.ndarray]:
    """Return X_L (matrix) and the diagonal of X_R; the last block is the gain if a level is given.

    The level is squared in doubles and rounded down, so what is proved is the level or less.
    """
    left = np.repeat(X, [rows for rows, _ in blocks])
    factors = np.ones(len(blocks))
    if level is not None:
        factors[-1] = level**2 * (1 - 1e-15)
    return np.diag(left), np.repeat(X * factors * (1 - 1e-15), [cols for _, cols in blocks])


def moved_polynomials(P: PolynomialMatrix, s: float) -> list[PolynomialMatrix]:
    """Return polynomials whose convex hull holds P(theta + v) for |v| <= s; for s = inf, P anywhere
    in [-1, 1].
    """
    if np.isinf(s):
        return bernstein([PolynomialMatrix([part]) for part in P.parts], -1.0, 1.0)
    derivatives = [P]
    for j in range(1, len(P.parts)):
        derivatives.append(derivatives[-1].derivative().scaled(arb(1) / j))
    return bernstein(derivatives, -s, s)
