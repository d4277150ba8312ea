"""Verification over the rationals: the stored energy of a claim falls with every friction of its class.

Between nodes the energy z'P(t)z is a cubic. The inequality [P' + A'P + PA + Q, PB + N; ., R] < 0 is then a convex
combination of its four Bernstein coefficients. Coordinates are changed exactly, which changes no sign.
"""

from __future__ import annotations

import math
import time
from dataclasses import replace
from itertools import pairwise

from flint import fmpq, fmpq_mat

from nlfrf._base.values import value
from robust.friction.exact.claim import FrictionClaim, Settling
from robust.friction.exact.loops import (
    ExactBlock,
    ExactLoop,
    block_diagonal,
    check_actuator,
    check_reach,
    dead_zone_block,
    equilibrium,
    exact_loop,
    with_actuator_filters,
)
from robust.proofs.exact.matrices import identity, positive_definite
from robust.proofs.exact.polynomials import to_rational, to_rational_matrix
from robust.proofs.exact.verification import Verification

# ---- The dissipation inequality of a class of friction over the rationals: supply z'Qz + 2 z'N d + d'R d, and storage.
#
# It is derived on the page on the theory of these proofs (T1, T2, T3). Nothing here is taken from the code that found
# the weights.


@value(copy=False)
class _ExactSupply:
    """A flow z' = A z + B d with jumps, its supply, and the rest of the stored energy, as matrices of rationals."""

    A: fmpq_mat
    B: fmpq_mat
    Q: fmpq_mat
    N: fmpq_mat
    R: fmpq_mat
    stored: fmpq_mat
    jumps: list[fmpq_mat]
    block: ExactBlock | None = None  # nonlinearity at the first jump


def _check_weights(claim: FrictionClaim) -> str:
    """Return an empty string if the weights are admissible for the class of friction, else the fault."""
    for port in claim.ports:
        if min([port.free, *port.weights]) < 0 or min([1.0, *port.rates]) <= 0:
            return "a weight is negative, or a rate is not positive"
        if not (port.K0 > 0 and port.stiction >= 1):
            return "K0 is not positive, or the stiction is below one"
        late = any(to_rational(a) * to_rational(port.bristle_time) >= 1 for a in port.rates)
        if claim.kind == "Maxwell slip" and (late or not port.rates.size):
            return "a filter is faster than the bristles"
    if claim.kind == "Maxwell slip":
        return check_actuator(claim)
    M, rho = [[to_rational(x) for x in row] for row in claim.block], to_rational(claim.stiction)
    if M[2][2] > 0 or min(claim.bounds) < 0:
        return "the block is not concave in the slope, or a bound is negative"
    ends = [(M[0][0], M[0][1], M[1][1]), (M[0][0], M[0][1] + M[0][2], M[1][1] + 2 * M[1][2] + M[2][2])]
    for (p, cross, r), bound in zip(ends, claim.bounds, strict=True):
        m = to_rational(bound)
        left = fmpq_mat([[p - m * (rho * rho - 1), cross - m], [cross - m, r + m]])
        if not positive_definite(left):
            return "the block is negative somewhere in the sector"
    return check_actuator(claim)


def _exact_supply(claim: FrictionClaim, loop: ExactLoop) -> _ExactSupply:
    if claim.settling is not None:
        return _settling_supply(claim, loop, claim.settling)
    form = _maxwell_slip_supply(claim, loop) if claim.kind == "Maxwell slip" else _bristle_supply(claim, loop)
    return form if claim.actuator is None else _with_dead_zone(form, dead_zone_block(claim, loop, form.A.nrows()), loop)


def _settling_supply(claim: FrictionClaim, loop: ExactLoop, own: Settling) -> _ExactSupply:
    """Return the supply for friction without stiction plus a rest force (T7): states (y, e_j), inputs g - gh_1 and r.

    The decay is in the flow, A + decay I, and in the losses of the filters. stored : a form in (y, e_j, d), with d = g
    - gh_1. For several ports all d come before all r, and each r is relative to the largest rest of all ports.
    """
    ports, zero, decay = claim.ports, to_rational(0.0), to_rational(own.decay)
    filters = [[to_rational(x) for x in port.rates] for port in ports]
    rests = _largest_rests(claim)
    most = max(rests)
    rest, n, P = equilibrium(loop), loop.F.nrows(), len(ports)
    A, jumps = _with_force_filters(loop, [aj for a in filters for aj in a[1:]])
    size, first = len(A), n
    for i in range(size):
        A[i][i] += decay
    B, Q, N = fmpq_mat(size, 2 * P).tolist(), fmpq_mat(size, size).tolist(), fmpq_mat(size, 2 * P).tolist()
    stored, R = fmpq_mat(size + P, size + P).tolist(), fmpq_mat(2 * P, 2 * P).tolist()
    for p, (port, a) in enumerate(zip(ports, filters, strict=True)):
        mu, K0, d = [to_rational(x) for x in port.weights], to_rational(port.K0), size + p
        share = rests[p] / most if most else to_rational(1.0)
        v = loop.v.tolist()[p] + [zero] * (size - n)
        total = sum(mu, start=zero)
        lost = [m * (aj - decay) / K0 for m, aj in zip(mu, a, strict=True)]
        for i in range(n):
            B[i][p], B[i][P + p] = loop.B[i, p] - a[0] * rest[i, p], share * loop.B[i, p]
        for i in range(size):
            N[i][p] += total / 2 * v[i]
        stored[d][d] = total / (2 * K0)
        for j in range(1, len(a)):
            e, held = first + j - 1, mu[j] / (2 * K0)
            B[e][p] = a[j] - a[0]
            for i in range(size):
                Q[e][i] -= mu[j] / 2 * v[i]
                Q[i][e] -= mu[j] / 2 * v[i]
            Q[e][e] -= lost[j]
            N[e][p] += lost[j]
            stored[e][e] += held
            stored[e][d] -= held
            stored[d][e] -= held
        R[p][p], R[P + p][P + p] = -sum(lost, start=zero), -to_rational(float(own.rest_weights[p]))
        first += len(a) - 1
    return _ExactSupply(
        A=fmpq_mat(A), B=fmpq_mat(B), Q=fmpq_mat(Q), N=fmpq_mat(N), R=fmpq_mat(R), stored=fmpq_mat(stored), jumps=jumps
    )


def _largest_rests(claim: FrictionClaim) -> list[fmpq]:
    """Return the largest difference of each friction from that of the same elements with constant sliders [N]."""
    return [
        (1 - 1 / to_rational(port.stiction)) * Fs / 2
        for port, Fs in zip(claim.ports, _largest_forces(claim), strict=True)
    ]


def _largest_forces(claim: FrictionClaim) -> list[fmpq]:
    assert claim.settling is not None
    return [to_rational(claim.settling.Fs), *(to_rational(float(force)) for force in claim.settling.other_Fs)]


def _with_dead_zone(form: _ExactSupply, block: ExactBlock, loop: ExactLoop) -> _ExactSupply:
    """Add the dead zone at the first jump, or to the flow of a continuous loop, where it is one more input."""
    if loop.spans:
        return replace(form, block=block)

    def append_column(M: fmpq_mat, column: list[list[fmpq]]) -> fmpq_mat:
        return fmpq_mat([[*row, *more] for row, more in zip(M.tolist(), column, strict=True)])

    m = form.R.nrows()
    R = append_column(form.R, [[to_rational(0.0)]] * m).tolist()
    R.append([*[to_rational(0.0)] * m, -block.weight])
    B, N = append_column(form.B, (-block.input_column).tolist()), append_column(form.N, block.output_row.tolist())
    return replace(form, B=B, N=N, R=fmpq_mat(R))


def _with_force_filters(loop: ExactLoop, rates: list[fmpq]) -> tuple[list[list[fmpq]], list[fmpq_mat]]:
    """Append the filters of the friction force to the flow and to the jumps."""
    extra = len(rates)
    fall = fmpq_mat(extra, extra, [-a if i == j else 0 for i, a in enumerate(rates) for j in range(extra)])
    return block_diagonal(loop.F, fall).tolist(), [block_diagonal(jump, identity(extra)) for jump in loop.jumps]


def _maxwell_slip_supply(claim: FrictionClaim, loop: ExactLoop) -> _ExactSupply:
    """Return the supply of Maxwell-slip friction (T1, T2): states (y, e_j), inputs d = f - fh_1 of each port."""
    zero, ports, n = to_rational(0.0), claim.ports, loop.F.nrows()
    # at a stiction of one the energy is not positive
    ratios = [to_rational(port.stiction if port.stiction > 1 else 1.001) for port in ports]
    filters = [[to_rational(a) for a in port.rates] for port in ports]
    rest = equilibrium(loop)
    moved = (loop.x * rest).tolist()
    scales = _port_scales(claim, ratios, moved)
    A, jumps = _with_force_filters(loop, [a for own in filters for a in own[1:]])
    size, P, first = len(A), len(ports), n
    B, Q, N = fmpq_mat(size, P).tolist(), fmpq_mat(size, size).tolist(), fmpq_mat(size, P).tolist()
    R, stored = fmpq_mat(P, P).tolist(), fmpq_mat(size + 2 * P, size + 2 * P).tolist()
    shares = []  # s of each port
    for p, (port, a, rho, scale) in enumerate(zip(ports, filters, ratios, scales, strict=True)):
        mu, free, K0 = (
            [scale * to_rational(x) for x in port.weights],
            scale * to_rational(port.free),
            to_rational(port.K0),
        )
        x, v = (rows.tolist()[p] + [zero] * (size - n) for rows in (loop.x, loop.v))
        total = sum(mu, start=zero)
        s = free + (1 - 1 / rho) * total
        lost = [m * aj / (rho * K0) for m, aj in zip(mu, a, strict=True)]
        h, F = size + 2 * p, size + 2 * p + 1
        for i in range(n):
            B[i][p] = loop.B[i, p] - a[0] * rest[i, p]
        for i in range(size):
            N[i][p] += (free + total) / 2 * v[i] - s * a[0] / 2 * x[i]
            stored[i][h] = stored[h][i] = -s / 2 * x[i]
        stored[h][h] = total / (2 * rho * K0)
        stored[F][F] = (free + total) / (2 * K0)
        stored[h][F] = stored[F][h] = -total / (2 * rho * K0)
        for j in range(1, len(a)):
            e, held = first + j - 1, mu[j] / (2 * K0 * rho)
            B[e][p] = a[j] - a[0]
            for i in range(size):
                Q[e][i] -= mu[j] / (2 * rho) * v[i]
                Q[i][e] -= mu[j] / (2 * rho) * v[i]
            Q[e][e] -= lost[j]
            N[e][p] += lost[j]
            stored[e][e] += held
            for other, sign in ((h, 1), (F, -1)):
                stored[e][other] += sign * held
                stored[other][e] += sign * held
        R[p][p] = -sum(lost, start=zero)
        first += len(a) - 1
        shares.append(s)
    for p in range(P):
        for q in range(P):
            if shares[p] * moved[p][q] != shares[q] * moved[q][p]:
                raise ValueError("no stored energy fits the rests of the ports")
            stored[size + 2 * p][size + 2 * q] -= shares[p] * moved[p][q] / 2
    return _ExactSupply(
        A=fmpq_mat(A), B=fmpq_mat(B), Q=fmpq_mat(Q), N=fmpq_mat(N), R=fmpq_mat(R), stored=fmpq_mat(stored), jumps=jumps
    )


def _port_scales(claim: FrictionClaim, ratios: list[fmpq], moved: list[list[fmpq]]) -> list[fmpq]:
    """Return factors near one on the weights of each port that make s_p X_pq symmetric in spite of rounding.

    moved : X, the displacement at port p at rest under f_q = 1. A claim may have any nonnegative weights.
    """
    scales = [to_rational(1.0)]
    shares = [
        to_rational(port.free) + (1 - 1 / rho) * sum(map(to_rational, port.weights), start=to_rational(0.0))
        for port, rho in zip(claim.ports, ratios, strict=True)
    ]
    for p in range(1, len(shares)):
        own, other = shares[p] * moved[p][0], shares[0] * moved[0][p]
        scales.append(other / own if own != 0 and other / own > 0 else to_rational(1.0))
    return scales


def _bristle_supply(claim: FrictionClaim, loop: ExactLoop) -> _ExactSupply:
    """Return the supply of bristles (T3): states (y, e_j), inputs gamma = F'/K0 and q = z'."""
    a, nu, mu = [to_rational(x) for x in claim.rates], [to_rational(x) for x in claim.weights], to_rational(claim.free)
    K0, sigma = to_rational(claim.K0), to_rational(claim.microdamping)
    M = [[to_rational(x) for x in row] for row in claim.block]
    rest, n = [row[0] for row in equilibrium(loop).tolist()], loop.F.nrows()
    size = n + len(a)
    A, jumps = _with_force_filters(loop, a)
    B = [[-K0 * r, sigma * b[0]] for b, r in zip(loop.B.tolist(), rest, strict=True)]
    B += [[-K0, to_rational(0.0)] for _ in a]
    x, v = (row.tolist()[0] + [to_rational(0.0)] * (size - n) for row in (loop.x, loop.v))
    Q = [[M[0][0] * v[i] * v[j] for j in range(size)] for i in range(size)]
    N = [[M[0][2] * v[i] - mu * K0 / 2 * x[i], M[0][1] * v[i]] for i in range(size)]
    kept = size + (mu > 0)
    stored = fmpq_mat(kept, kept).tolist()
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
    return _ExactSupply(
        A=fmpq_mat(A), B=fmpq_mat(B), Q=fmpq_mat(Q), N=fmpq_mat(N), R=fmpq_mat(R), stored=fmpq_mat(stored), jumps=jumps
    )


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

    A claim that is not verified is a result and not an error: `failed` has each part with its reason.
    """
    deadline, own = time.monotonic() + time_cap, claim.settling
    wrong = _check_weights(claim) or _check_decay(claim)
    failed = {_PARTS[0]: wrong} if wrong else {}
    try:
        loop = exact_loop(claim)
        loop = loop if claim.actuator is None else with_actuator_filters(claim, loop)
        form = _in_coordinates(_exact_supply(claim, loop), claim)
        energy = [[to_rational_matrix(P) for P in interval] for interval in claim.P]
        failed |= _check_decrease(claim, loop, form=form, energy=energy, deadline=deadline)
        looked_at = [energy[0][0], energy[-1][-1]] if own is None else [P for interval in energy for P in interval]
        whole = [_full_storage(form.stored, P) for P in looked_at]
        if not all(map(positive_definite, whole)):
            failed[_PARTS[3]] = "it is not positive definite"
        elif claim.actuator is not None:
            beyond = check_reach(claim, loop, energy=energy, stored=whole[-1])
            failed |= {_ACTUATOR_CLAIM: beyond} if beyond else {}
        elif own is not None and not _settles_within(claim, loop, whole):
            failed[_SETTLING_CLAIM] = "the energy allows more"
    except (ValueError, ZeroDivisionError) as error:
        failed |= {"the claim": str(error)}
    more = [_SETTLING_CLAIM] * (own is not None) + [_ACTUATOR_CLAIM] * (claim.actuator is not None)
    proved = tuple(part for part in (*_PARTS, *more) if part not in failed) if "the claim" not in failed else ()
    return Verification(proved=proved, failed=tuple(failed.items()))


def _check_decay(claim: FrictionClaim) -> str:
    """Return an empty string if decay and class satisfy T7, or if no bound is claimed; else the fault."""
    own = claim.settling
    if own is None:
        return ""
    if claim.kind != "Maxwell slip" or any(port.bristle_time or port.free for port in claim.ports):
        return "only for Maxwell slip without a damper, and with a weight of f v of zero"
    if not (own.decay > 0 and min(_largest_forces(claim)) > 0):
        return "decay or Fs is not positive"
    shares = [to_rational(float(share)) for share in own.rest_weights]
    if min(shares) < 0 or sum(shares, start=to_rational(0.0)) > 1:
        return "a weight of the rests is negative, or their sum is above one"
    slow = any(
        weight > 0 and rate < own.decay
        for port in claim.ports
        for rate, weight in zip(port.rates, port.weights, strict=True)
    )
    return "a filter is slower than the decay" if slow else ""


def _settles_within(claim: FrictionClaim, loop: ExactLoop, energies: list[fmpq_mat]) -> bool:
    """Return whether the displacement at every port is within the bound for every V up to its final value.

    |x| <= |x_y| + sum |x_e| |gh_1|: the sliders without stiction hold at most (1 + 1/rho)/2 of Fs.
    """
    own = claim.settling
    assert own is not None
    decay, most, size = to_rational(own.decay), max(_largest_rests(claim)), claim.V.shape[0]
    held = [
        (1 + 1 / to_rational(port.stiction)) / 2 * Fs
        for port, Fs in zip(claim.ports, _largest_forces(claim), strict=True)
    ]
    at_rest = (loop.x * equilibrium(loop)).tolist()
    turned, zero = to_rational_matrix(claim.V).transpose(), to_rational(0.0)
    for x, moved in zip(loop.x.tolist(), at_rest, strict=True):
        left = to_rational(own.error) - sum((abs(a) * f for a, f in zip(moved, held, strict=True)), start=zero)
        if left <= 0:
            return False
        read = (turned * fmpq_mat([[a] for a in [*x, *[zero] * (size - len(x))]])).tolist()
        row = fmpq_mat(read + [[zero]] * len(held))
        reached = [(row.transpose() * energy.solve(row)).tolist()[0][0] for energy in energies]
        if not max(reached) * most * most <= 2 * decay * left * left:
            return False
    return True


def _in_coordinates(form: _ExactSupply, claim: FrictionClaim) -> _ExactSupply:
    """Return the inequality in the coordinates of the energy, without rounding."""
    V = to_rational_matrix(claim.V)
    n, size = V.nrows(), form.stored.nrows()
    if form.A.nrows() != n:
        raise ValueError(f"V must have {form.A.nrows()} rows for this loop, got {n}")
    back, turned = V.inv(), V.transpose()
    W = block_diagonal(V, identity(size - n))
    block = form.block
    if block is not None:
        block = replace(block, input_column=back * block.input_column, output_row=turned * block.output_row)
    return _ExactSupply(
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
    claim: FrictionClaim, loop: ExactLoop, *, form: _ExactSupply, energy: list[list[fmpq_mat]], deadline: float
) -> dict[str, str]:
    """Return each part of the decrease of the storage that is not proved, and why."""
    if not loop.spans:
        P = energy[0][0]
        held = len(energy) == 1 and positive_definite(-_flow_inequality(form, P, P - P))
        return {} if held else {_PARTS[1]: "it does not"}
    counts = [int(count) for count in claim.counts]
    if len(counts) != len(loop.spans) or min(counts) < 1 or sum(counts) != len(energy) or claim.P.shape[1] != 4:
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
                positive_definite(-_flow_inequality(form, P, slope)) for P, slope in zip(b, slopes, strict=True)
            ):
                return {_PARTS[1]: "it does not"}
            if time.monotonic() > deadline:
                return {_PARTS[1]: "undecided: the time limit was reached"}
    for i, jump in enumerate(form.jumps):
        before, after = energy[starts[i] - 1][3], energy[starts[i]][0]
        if not positive_definite(_jump_inequality(form, i, before=before, after=after, jump=jump)):
            return {_PARTS[2]: "it may grow"}
    return {}


def _jump_inequality(form: _ExactSupply, i: int, *, before: fmpq_mat, after: fmpq_mat, jump: fmpq_mat) -> fmpq_mat:
    """Return the decrease of the storage at a jump as a matrix, with one more unknown for a block at the first jump."""
    plain = before - jump.transpose() * after * jump
    if i or form.block is None:
        return plain
    b, c, weight = form.block.input_column, form.block.output_row, form.block.weight
    side = (jump.transpose() * after * b - c).tolist()
    corner = weight - (b.transpose() * after * b).tolist()[0][0]
    rows = [[*row, *more] for row, more in zip(plain.tolist(), side, strict=True)]
    return fmpq_mat([*rows, [row[0] for row in side] + [corner]])


def _flow_inequality(form: _ExactSupply, P: fmpq_mat, slope: fmpq_mat) -> fmpq_mat:
    """Return [P' + A'P + PA + Q, PB + N; ., R] as one matrix."""
    across = P * form.A
    top = slope + across + across.transpose() + form.Q
    side = P * form.B + form.N
    rows = [left + right for left, right in zip(top.tolist(), side.tolist(), strict=True)]
    below = [left + right for left, right in zip(side.transpose().tolist(), form.R.tolist(), strict=True)]
    return fmpq_mat(rows + below)


def _full_storage(stored: fmpq_mat, P: fmpq_mat) -> fmpq_mat:
    """Return the whole storage: a form in the states and in the forces at rest."""
    rows = stored.tolist()
    for i, row in enumerate(P.tolist()):
        for j, x in enumerate(row):
            rows[i][j] += x
    return fmpq_mat(rows)
