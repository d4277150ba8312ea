"""The dissipation inequality of a class of friction over the rationals: supply z'Qz + 2 z'N d + d'R d, and storage.

Derived on the page on the theory of these proofs (T1, T2, T3); nothing here is taken from the code that found weights.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from nlfrf.shared.values import value
from robust.friction_verification.actuator import ExactBlock, actuator_fits, exact_block
from robust.friction_verification.claim import FrictionClaim
from robust.friction_verification.loop import ExactLoop, rest_of
from robust.verification.exact import rational
from robust.verification.matrices import positive_definite

__all__ = ["ExactSupply", "exact_supply", "weights_fit"]


@value(copy=False)
class ExactSupply:
    """A flow z' = A z + B d with jumps, a supply, and the rest of the stored energy, as matrices of rationals.

    Fields
    ------
    A, B, Q, N, R, stored : fmpq_mat
    jumps : list of fmpq_mat
    block : ExactBlock or None
        What acts at the first jump.
    """

    A: Any
    B: Any
    Q: Any
    N: Any
    R: Any
    stored: Any
    jumps: list[Any]
    block: ExactBlock | None = None


def weights_fit(claim: FrictionClaim) -> str:
    """Empty if the weights are such as the class allows; else what is wrong with them."""
    from flint import fmpq_mat

    if min([claim.free, *claim.weights]) < 0 or min([1.0, *claim.rates]) <= 0:
        return "a weight is negative, or a rate not positive"
    if not (claim.K0 > 0 and claim.stiction >= 1):
        return "K0 is not positive, or stiction below one"
    if claim.kind == "Maxwell slip":
        tau = rational(claim.bristle_time)
        late = any(rational(a) * tau >= 1 for a in claim.rates)
        return "a filter is faster than the bristles" if late or not claim.rates.size else actuator_fits(claim)
    M, rho = [[rational(x) for x in row] for row in claim.block], rational(claim.stiction)
    if M[2][2] > 0 or min(claim.bounds) < 0:
        return "the block is not concave in the slope, or a bound is negative"
    ends = [(M[0][0], M[0][1], M[1][1]), (M[0][0], M[0][1] + M[0][2], M[1][1] + 2 * M[1][2] + M[2][2])]
    for (p, cross, r), bound in zip(ends, claim.bounds, strict=True):
        m = rational(bound)
        left = fmpq_mat([[p - m * (rho * rho - 1), cross - m], [cross - m, r + m]])
        if not positive_definite(left):
            return "the block is negative somewhere in the sector"
    return actuator_fits(claim)


def exact_supply(claim: FrictionClaim, loop: ExactLoop) -> ExactSupply:
    """The inequality of the class for this loop."""
    form = maxwell_slip(claim, loop) if claim.kind == "Maxwell slip" else bristle(claim, loop)
    return form if claim.actuator is None else with_actuator(form, exact_block(claim, loop, form.A.nrows()), loop)


def with_actuator(form: ExactSupply, block: ExactBlock, loop: ExactLoop) -> ExactSupply:
    """A block at the first jump, or of the flow where nothing is sampled: what is missed is one input more."""
    from flint import fmpq_mat

    if loop.spans:
        return replace(form, block=block)

    def beside(M: Any, column: list[list[Any]]) -> Any:
        return fmpq_mat([[*row, *more] for row, more in zip(M.tolist(), column, strict=True)])

    m = form.R.nrows()
    R = beside(form.R, [[rational(0.0)]] * m).tolist()
    R.append([*[rational(0.0)] * m, -block.weight])
    B, N = beside(form.B, (-block.enters).tolist()), beside(form.N, block.seen.tolist())
    return replace(form, B=B, N=N, R=fmpq_mat(R))


def zeros(rows: int, columns: int) -> list[list[Any]]:
    """A matrix to be filled."""
    zero = rational(0.0)
    return [[zero] * columns for _ in range(rows)]


def widened(loop: ExactLoop, rates: list[Any]) -> tuple[list[list[Any]], list[Any]]:
    """Rows of the flow with filters below, and the jumps."""
    from flint import fmpq_mat

    n, extra = loop.F.nrows(), len(rates)
    A = zeros(n + extra, n + extra)
    for i, row in enumerate(loop.F.tolist()):
        A[i][:n] = row
    for j, a in enumerate(rates):
        A[n + j][n + j] = -a
    jumps = []
    for jump in loop.jumps:
        J = zeros(n + extra, n + extra)
        for i, row in enumerate(jump.tolist()):
            J[i][:n] = row
        for j in range(extra):
            J[n + j][n + j] = rational(1.0)
        jumps.append(fmpq_mat(J))
    return A, jumps


def maxwell_slip(claim: FrictionClaim, loop: ExactLoop) -> ExactSupply:
    """States (y, e_j), input d = f - fh_1; T1 and T2."""
    from flint import fmpq_mat

    a, mu, free = [rational(x) for x in claim.rates], [rational(x) for x in claim.weights], rational(claim.free)
    # at one itself the energy is not positive; certificates of version 0.1 say one and were made with 1.001
    K0, rho = rational(claim.K0), rational(claim.stiction if claim.stiction > 1 else 1.001)
    rest, n = [row[0] for row in rest_of(loop).tolist()], loop.F.nrows()
    size = n + len(a) - 1
    A, jumps = widened(loop, a[1:])
    B = [[b[0] - a[0] * r] for b, r in zip(loop.B.tolist(), rest, strict=True)] + [[aj - a[0]] for aj in a[1:]]
    x, v = (row.tolist()[0] + [rational(0.0)] * (size - n) for row in (loop.x, loop.v))
    total = sum(mu)
    s = free + (1 - 1 / rho) * total
    lost = [m * aj / (rho * K0) for m, aj in zip(mu, a, strict=True)]
    Q, N = zeros(size, size), [[(free + total) / 2 * v[i] - s * a[0] / 2 * x[i]] for i in range(size)]
    stored, h, F = zeros(size + 2, size + 2), size, size + 1
    for i in range(size):
        stored[i][h] = stored[h][i] = -s / 2 * x[i]
    x_e = sum(c * r for c, r in zip(x, rest, strict=False))
    stored[h][h] = -s * x_e / 2 + total / (2 * rho * K0)
    stored[F][F] = (free + total) / (2 * K0)
    stored[h][F] = stored[F][h] = -total / (2 * rho * K0)
    for j in range(1, len(a)):
        e, held = n + j - 1, mu[j] / (2 * K0 * rho)
        for i in range(size):
            Q[e][i] -= mu[j] / (2 * rho) * v[i]
            Q[i][e] -= mu[j] / (2 * rho) * v[i]
        Q[e][e] -= lost[j]
        N[e][0] += lost[j]
        stored[e][e] += held
        for other, sign in ((h, 1), (F, -1)):
            stored[e][other] += sign * held
            stored[other][e] += sign * held
    R = [[-sum(lost)]]
    return ExactSupply(
        A=fmpq_mat(A), B=fmpq_mat(B), Q=fmpq_mat(Q), N=fmpq_mat(N), R=fmpq_mat(R), stored=fmpq_mat(stored), jumps=jumps
    )


def bristle(claim: FrictionClaim, loop: ExactLoop) -> ExactSupply:
    """States (y, e_j), inputs gamma = F'/K0 and q = z'; T3."""
    from flint import fmpq_mat

    a, nu, mu = [rational(x) for x in claim.rates], [rational(x) for x in claim.weights], rational(claim.free)
    K0, sigma = rational(claim.K0), rational(claim.microdamping)
    M = [[rational(x) for x in row] for row in claim.block]
    rest, n = [row[0] for row in rest_of(loop).tolist()], loop.F.nrows()
    size = n + len(a)
    A, jumps = widened(loop, a)
    B = [[-K0 * r, sigma * b[0]] for b, r in zip(loop.B.tolist(), rest, strict=True)]
    B += [[-K0, rational(0.0)] for _ in a]
    x, v = (row.tolist()[0] + [rational(0.0)] * (size - n) for row in (loop.x, loop.v))
    Q = [[M[0][0] * v[i] * v[j] for j in range(size)] for i in range(size)]
    N = [[M[0][2] * v[i] - mu * K0 / 2 * x[i], M[0][1] * v[i]] for i in range(size)]
    kept = size + (mu > 0)
    stored = zeros(kept, kept)
    for j, (rate, weight) in enumerate(zip(a, nu, strict=True)):
        Q[n + j][n + j] -= weight * rate / K0
        N[n + j][1] -= weight / 2
        stored[n + j][n + j] = weight / (2 * K0)
    if mu > 0:
        for i in range(size):
            stored[i][size] = stored[size][i] = -mu / 2 * x[i]
        x_e = sum(c * r for c, r in zip(x, rest, strict=False))
        stored[size][size] = mu / (2 * K0) - mu / 2 * x_e
    R = [[M[2][2], M[1][2]], [M[1][2], M[1][1]]]
    return ExactSupply(
        A=fmpq_mat(A), B=fmpq_mat(B), Q=fmpq_mat(Q), N=fmpq_mat(N), R=fmpq_mat(R), stored=fmpq_mat(stored), jumps=jumps
    )
