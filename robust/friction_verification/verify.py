"""The stored energy of a claim falls with every friction of its class: proved over the rationals, nothing rounded.

Between nodes the energy z'P(t)z is a cubic, and the inequality [P' + A'P + PA + Q, PB + N; ., R] < 0 a convex
combination of its four Bernstein coefficients; coordinates are changed exactly, which changes no sign.
"""

from __future__ import annotations

import time
from dataclasses import replace
from itertools import pairwise
from typing import Any

from robust.friction_verification.actuator import reach_fits, with_filters
from robust.friction_verification.claim import FrictionClaim
from robust.friction_verification.loop import ExactLoop, exact_loop
from robust.friction_verification.supply import ExactSupply, exact_supply, weights_fit
from robust.verification.exact import rational_matrix
from robust.verification.loops import Verification
from robust.verification.matrices import positive_definite

__all__ = ["verify_friction"]

PARTS = (
    "weights of the class",
    "the energy falls between samples",
    "the energy falls at samples",
    "the energy is positive",
)
REACH = "the actuator stays within reach"
BITS = 512


def verify_friction(claim: FrictionClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove a claim on a machine with friction again, from its numbers as rationals.

    Not verified is a result, not an error: each part with its reason.
    """
    deadline = time.monotonic() + time_cap
    wrong = weights_fit(claim)
    failed = {PARTS[0]: wrong} if wrong else {}
    try:
        loop = exact_loop(claim)
        loop = loop if claim.actuator is None else with_filters(claim, loop)
        form = in_coordinates(exact_supply(claim, loop), claim)
        energy = [[rational_matrix(P) for P in interval] for interval in claim.P]
        failed |= falls(claim, loop, form, energy, deadline)
        if not all(positive_definite(with_energy(form.stored, P)) for P in (energy[0][0], energy[-1][-1])):
            failed[PARTS[3]] = "it is not"
        elif claim.actuator is not None:
            beyond = reach_fits(claim, loop, energy, with_energy(form.stored, energy[-1][-1]))
            failed |= {REACH: beyond} if beyond else {}
    except (ValueError, ZeroDivisionError) as error:
        failed |= {"the claim": str(error)}
    parts = PARTS if claim.actuator is None else (*PARTS, REACH)
    proved = tuple(part for part in parts if part not in failed) if "the claim" not in failed else ()
    return Verification(verified=not failed, proved=proved, failed=tuple(failed.items()), bits=BITS if proved else 0)


def in_coordinates(form: ExactSupply, claim: FrictionClaim) -> ExactSupply:
    """The inequality in the coordinates of the energy, exactly."""
    from flint import fmpq_mat

    V = rational_matrix(claim.V)
    n, size = V.nrows(), form.stored.nrows()
    if form.A.nrows() != n:
        raise ValueError(f"V must have {form.A.nrows()} rows for this loop, got {n}")
    back, turned = V.inv(), V.transpose()
    wide = [[*row, *[0] * (size - n)] for row in V.tolist()]
    wide += [[int(i == j) for j in range(size)] for i in range(n, size)]
    W = fmpq_mat(wide)
    block = form.block
    if block is not None:
        block = replace(block, enters=back * block.enters, seen=turned * block.seen)
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


def falls(
    claim: FrictionClaim, loop: ExactLoop, form: ExactSupply, energy: list[list[Any]], deadline: float
) -> dict[str, str]:
    """What of the fall of the energy is not proved, and why."""
    from flint import fmpq

    if not loop.spans:
        P = energy[0][0]
        held = len(energy) == 1 and positive_definite(-inequality(form, P, P - P))
        return {} if held else {PARTS[1]: "it does not"}
    counts = [int(count) for count in claim.counts]
    if len(counts) != len(loop.spans) or min(counts) < 1 or sum(counts) != len(energy) or claim.P.shape[1] != 4:
        return {PARTS[1]: "its intervals do not fill the period"}
    starts = [sum(counts[:i]) for i in range(len(counts) + 1)]
    for span, first, last in zip(loop.spans, starts, starts[1:], strict=False):
        rate = 3 * (last - first) / span
        if any(b[3] != after[0] for b, after in pairwise(energy[first:last])):
            return {PARTS[1]: "it jumps where nothing happens"}
        for b in energy[first:last]:
            s0, s1, s2 = ((b[k + 1] - b[k]) * rate for k in range(3))
            third = fmpq(1, 3)
            slopes = (s0, (s0 + s1 * 2) * third, (s1 * 2 + s2) * third, s2)
            if not all(positive_definite(-inequality(form, P, slope)) for P, slope in zip(b, slopes, strict=True)):
                return {PARTS[1]: "it does not"}
            if time.monotonic() > deadline:
                return {PARTS[1]: "undecided, as time was up"}
    for i, jump in enumerate(form.jumps):
        before, after = energy[starts[i] - 1][3], energy[starts[i]][0]
        if not positive_definite(lost(form, i, before, after, jump)):
            return {PARTS[2]: "it may grow"}
    return {}


def lost(form: ExactSupply, i: int, before: Any, after: Any, jump: Any) -> Any:
    """What of the energy is lost at a jump, with a block at the first one more unknown."""
    from flint import fmpq_mat

    plain = before - jump.transpose() * after * jump
    if i or form.block is None:
        return plain
    b, c, weight = form.block.enters, form.block.seen, form.block.weight
    side = (jump.transpose() * after * b - c).tolist()
    corner = weight - (b.transpose() * after * b).tolist()[0][0]
    rows = [[*row, *more] for row, more in zip(plain.tolist(), side, strict=True)]
    return fmpq_mat([*rows, [row[0] for row in side] + [corner]])


def inequality(form: ExactSupply, P: Any, slope: Any) -> Any:
    """[P' + A'P + PA + Q, PB + N; ., R] as one matrix."""
    from flint import fmpq_mat

    across = P * form.A
    top = slope + across + across.transpose() + form.Q
    side = P * form.B + form.N
    rows = [left + right for left, right in zip(top.tolist(), side.tolist(), strict=True)]
    below = [left + right for left, right in zip(side.transpose().tolist(), form.R.tolist(), strict=True)]
    return fmpq_mat(rows + below)


def with_energy(stored: Any, P: Any) -> Any:
    """The whole stored energy, a form in the states and in the forces that rest."""
    from flint import fmpq_mat

    rows = stored.tolist()
    for i, row in enumerate(P.tolist()):
        for j, x in enumerate(row):
            rows[i][j] += x
    return fmpq_mat(rows)
