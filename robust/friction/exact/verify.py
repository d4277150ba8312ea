"""Verification that the storage function of a claim decreases with every friction of its class.

The time between two jumps of the loop is cut into intervals. On each interval the storage function
is z'P(t)z, with the state z and a cubic P(t). The matrix of the inequality [P' + A'P + PA + Q, PB +
N; ., R] < 0 is then a convex combination of its four Bernstein coefficients, so it is enough that
they are negative definite. Changes of coordinates are computed exactly, so they keep definiteness.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

from flint import fmpq, fmpq_mat

from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.loops import (
    check_actuator,
    check_reach,
    dead_zone_block,
    exact_loop,
    with_actuator_filters,
)
from robust.friction.exact.supply import ExactBlock, ExactLoop, ExactSupply, block_diagonal
from robust.proofs.exact.matrices import identity, positive_definite
from robust.proofs.exact.polynomials import to_rational, to_rational_matrix
from robust.proofs.exact.verification import Verification


def _exact_supply(claim: FrictionClaim, loop: ExactLoop) -> ExactSupply:
    first, *others = claim.ports
    if claim.settling is not None:
        return claim.settling.supply(claim.ports, loop)
    form = first.supply(others, loop)
    if claim.actuator is None:
        return form
    return _with_dead_zone(form, dead_zone_block(claim, loop, form.A.nrows()), loop)


def _with_dead_zone(form: ExactSupply, block: ExactBlock, loop: ExactLoop) -> ExactSupply:
    """Add the dead zone at the first jump, or to the flow of a continuous loop, where it is one
    more input.
    """
    if loop.spans:
        return replace(form, block=block)

    def append_column(M: fmpq_mat, column: list[list[fmpq]]) -> fmpq_mat:
        return fmpq_mat([[*row, *more] for row, more in zip(M.tolist(), column, strict=True)])

    m = form.R.nrows()
    R = append_column(form.R, [[to_rational(0.0)]] * m).tolist()
    R.append([*[to_rational(0.0)] * m, -block.weight])
    B = append_column(form.B, (-block.input_column).tolist())
    N = append_column(form.N, block.output_row.tolist())
    return replace(form, B=B, N=N, R=fmpq_mat(R))


_PARTS = (
    "weights of the class",
    "the energy falls between samples",
    "the energy falls at samples",
    "the energy is positive",
)
_SETTLING_CLAIM = "the position settles within the bound"
_ACTUATOR_CLAIM = "the actuator stays within reach"


def verify_friction(claim: FrictionClaim, *, time_cap: float = math.inf) -> Verification:
    """Prove a claim on a machine with friction again, from its numbers as rationals.

    A claim that is not verified is a result and not an error: `failed` has each part with its
    reason.
    """
    deadline, own = time.monotonic() + time_cap, claim.settling
    wrong = next(filter(None, (port.fault for port in claim.ports)), "") or check_actuator(claim)
    wrong = wrong or ("" if own is None else own.fault(claim.ports))
    if wrong:
        failed = {_PARTS[0]: wrong}
    else:
        failed = {}
    try:
        loop = exact_loop(claim)
        if claim.actuator is not None:
            loop = with_actuator_filters(claim, loop)
        form = _in_coordinates(_exact_supply(claim, loop), claim)
        energy = [[to_rational_matrix(P) for P in interval] for interval in claim.P]
        failed |= _check_decrease(claim, loop, form=form, energy=energy, deadline=deadline)
        if own is None:
            looked_at = [energy[0][0], energy[-1][-1]]
        else:
            looked_at = [P for interval in energy for P in interval]
        whole = [_full_storage(form.stored, P) for P in looked_at]
        if not all(map(positive_definite, whole)):
            failed[_PARTS[3]] = "it is not positive definite"
        elif claim.actuator is not None:
            beyond = check_reach(claim, loop, energy=energy, stored=whole[-1])
            failed |= {_ACTUATOR_CLAIM: beyond} if beyond else {}
        elif own is not None and not own.holds(
            claim.ports, loop, V=to_rational_matrix(claim.V), energies=whole
        ):
            failed[_SETTLING_CLAIM] = "the energy allows more"
    except (ValueError, ZeroDivisionError) as error:
        failed |= {"the claim": str(error)}
    more = [_SETTLING_CLAIM] * (own is not None) + [_ACTUATOR_CLAIM] * (claim.actuator is not None)
    if "the claim" not in failed:
        proved = tuple(part for part in (*_PARTS, *more) if part not in failed)
    else:
        proved = ()
    return Verification(proved=proved, failed=tuple(failed.items()))


def _in_coordinates(form: ExactSupply, claim: FrictionClaim) -> ExactSupply:
    """Return the inequality in the coordinates of the energy, without rounding."""
    V = to_rational_matrix(claim.V)
    n, size = V.nrows(), form.stored.nrows()
    if form.A.nrows() != n:
        raise ValueError(f"V must have {form.A.nrows()} rows for this loop, got {n}")
    back, turned = V.inv(), V.transpose()
    W = block_diagonal(V, identity(size - n))
    block = form.block
    if block is not None:
        block = replace(
            block, input_column=back * block.input_column, output_row=turned * block.output_row
        )
    return ExactSupply(
        block=block,
        A=back * form.A * V,
        B=back * form.B,
        Q=turned * form.Q * V,
        N=turned * form.N,
        R=form.R,
        stored=W.transpose() * form.stored * W,
        jumps=[back * jump * V for jump in form.jumps],
    )


def _check_decrease(
    claim: FrictionClaim,
    loop: ExactLoop,
    *,
    form: ExactSupply,
    energy: list[list[fmpq_mat]],
    deadline: float,
) -> dict[str, str]:
    """Return each part of the decrease of the storage that is not proved, and why."""
    if not loop.spans:
        P = energy[0][0]
        held = len(energy) == 1 and positive_definite(-_flow_inequality(form, P, P - P))
        if held:
            return {}
        return {_PARTS[1]: "it does not"}
    counts = [int(count) for count in claim.counts]
    if (
        len(counts) != len(loop.spans)
        or min(counts) < 1
        or sum(counts) != len(energy)
        or claim.P.shape[1] != 4
    ):
        return {_PARTS[1]: "its intervals do not fill the period"}
    starts = [sum(counts[:i]) for i in range(len(counts) + 1)]
    for span, first, last in zip(loop.spans, starts, starts[1:], strict=False):
        rate = 3 * (last - first) / span
        if any(b[3] != after[0] for b, after in pairwise(energy[first:last])):
            return {_PARTS[1]: "it jumps between two intervals of one span"}
        for b in energy[first:last]:
            s0, s1, s2 = ((b[k + 1] - b[k]) * rate for k in range(3))
            third = fmpq(1, 3)
            slopes = (s0, (s0 + s1 * 2) * third, (s1 * 2 + s2) * third, s2)
            if not all(
                positive_definite(-_flow_inequality(form, P, slope))
                for P, slope in zip(b, slopes, strict=True)
            ):
                return {_PARTS[1]: "it does not"}
            if time.monotonic() > deadline:
                return {_PARTS[1]: "undecided: the time limit was reached"}
    for i, jump in enumerate(form.jumps):
        before, after = energy[starts[i] - 1][3], energy[starts[i]][0]
        if not positive_definite(_jump_inequality(form, i, before=before, after=after, jump=jump)):
            return {_PARTS[2]: "it may grow"}
    return {}


def _jump_inequality(
    form: ExactSupply, i: int, *, before: fmpq_mat, after: fmpq_mat, jump: fmpq_mat
) -> fmpq_mat:
    """Return the decrease of the storage at a jump as a matrix, with one more unknown for a block
    at the first jump.
    """
    plain = before - jump.transpose() * after * jump
    if i or form.block is None:
        return plain
    b, c, weight = form.block.input_column, form.block.output_row, form.block.weight
    side = (jump.transpose() * after * b - c).tolist()
    corner = weight - (b.transpose() * after * b).tolist()[0][0]
    rows = [[*row, *more] for row, more in zip(plain.tolist(), side, strict=True)]
    return fmpq_mat([*rows, [row[0] for row in side] + [corner]])


def _flow_inequality(form: ExactSupply, P: fmpq_mat, slope: fmpq_mat) -> fmpq_mat:
    """Return [P' + A'P + PA + Q, PB + N; ., R] as one matrix."""
    across = P * form.A
    top = slope + across + across.transpose() + form.Q
    side = P * form.B + form.N
    rows = [left + right for left, right in zip(top.tolist(), side.tolist(), strict=True)]
    below = [
        left + right for left, right in zip(side.transpose().tolist(), form.R.tolist(), strict=True)
    ]
    return fmpq_mat(rows + below)


def _full_storage(stored: fmpq_mat, P: fmpq_mat) -> fmpq_mat:
    """Return the whole storage: a form in the states and in the forces at rest."""
    rows = stored.tolist()
    for i, row in enumerate(P.tolist()):
        for j, x in enumerate(row):
            rows[i][j] += x
    return fmpq_mat(rows)
