"""The sliding loop of a claim over the rationals: flows between samples, jumps at samples, and its
actuator.
"""

from __future__ import annotations

from flint import fmpq, fmpq_mat

from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.supply import (
    ExactBlock,
    ExactLoop,
    Row,
    Rows,
    block_diagonal,
    equilibrium,
)
from robust.proofs.exact.matrices import identity
from robust.proofs.exact.polynomials import to_rational, to_rational_matrix


def _continuous_flow(
    A: list[list[fmpq]], B: list[list[fmpq]], C: list[list[fmpq]], K: dict[str, list[list[fmpq]]]
) -> Rows:
    """Return the dynamics of a machine and a continuous controller, with the state (machine, K)."""
    n, D = len(A), K["D"][0][0]
    machine: Rows = [
        [A[i][j] - D * B[i][0] * C[0][j] for j in range(n)] + [B[i][0] * c for c in K["C"][0]]
        for i in range(n)
    ]
    return machine + [
        [-b[0] * C[0][j] for j in range(n)] + list(a) for a, b in zip(K["A"], K["B"], strict=True)
    ]


def exact_loop(claim: FrictionClaim) -> ExactLoop:
    """Return the loop of machine, hold, delay and controller; its state is (machine, held force,
    waiting forces, K).
    """
    A, B, C = (to_rational_matrix(getattr(claim.machine, name)).tolist() for name in "ABC")
    K = {name: to_rational_matrix(getattr(claim.controller, name)).tolist() for name in "ABCD"}
    n, s = claim.machine.order, claim.controller.order
    D, T = K["D"][0][0], to_rational(claim.controller.dt)
    if not T:
        size, F = n + s, _continuous_flow(A, B, C, K)
        spans: list[fmpq] = []
        jumps: list[Rows] = []
    else:
        whole, part = _split_delay(to_rational(claim.delay), T)
        waiting = whole + (part > 0)
        size, own = n + 1 + waiting + s, n + 1 + waiting
        F = [[*A[i], B[i][0], *[0] * (size - n - 1)] for i in range(n)]
        F += [[0] * size for _ in range(size - n)]
        command_row: Row = (
            [-D * c for c in C[0]] + [0] * (1 + waiting) + [c for row in K["C"] for c in row]
        )
        rows: Rows = [*identity(size).tolist()]
        forces: Rows = [
            command_row,
            *rows[n + 1 : own],
        ]  # the new force, then the waiting ones, the oldest last
        rows[n + 1 : own] = forces[:waiting]
        for i in range(s):
            rows[own + i] = (
                [-K["B"][i][0] * c for c in C[0]] + [0] * (1 + waiting) + list(K["A"][i])
            )
        spans, jumps = [T], [rows]
        if part > 0:
            late: Rows = [*identity(size).tolist()]
            late[n] = late[n + waiting]
            spans, jumps = [part, T - part], [rows, late]
        else:
            rows[n] = forces[waiting]
    ports, more = C[1:], [to_rational(0.0)] * (size - n)
    velocity = [
        [sum((c[i] * A[i][j] for i in range(n)), start=to_rational(0.0)) for j in range(n)]
        for c in ports
    ]
    return ExactLoop(
        F=fmpq_mat(F),
        B=fmpq_mat([[-b for b in B[i][1:]] for i in range(n)] + [[0] * len(ports)] * (size - n)),
        x=fmpq_mat([list(c) + more for c in ports]),
        v=fmpq_mat([row + more for row in velocity]),
        spans=spans,
        jumps=[fmpq_mat(jump) for jump in jumps],
    )


def _split_delay(delay: fmpq, T: fmpq) -> tuple[int, fmpq]:
    """Split a delay into whole samples and a remainder [s]."""
    near = fmpq(1, 10**9)
    whole = int((delay / T + near).floor())
    left = delay - whole * T
    return whole, left if left > near * T else fmpq(0)


# ---- An actuator that saturates, over the rationals: the loop with filters of its force, its
# supply, its region.


def check_actuator(claim: FrictionClaim) -> str:
    """Return an empty string if the weights of the actuator are admissible for any saturation, else
    the fault.
    """
    own = claim.actuator
    if own is None:
        return ""
    if min([own.sector, *own.weights]) < 0 or own.sector + sum(own.weights) <= 0:
        return "a weight of the actuator is negative, or all are zero"
    fastest = 1 if claim.controller.dt else None
    if min([1.0, *own.forgets]) <= 0 or (fastest and max([0.0, *own.forgets]) > fastest):
        return "a filter of the actuator is not a mean of the past"
    if not (0 < own.Fs < own.limit and 0 <= own.share <= 1):
        return "the limit is not above the friction, or the share is not between zero and one"
    return ""


def _commanded_force_row(claim: FrictionClaim, size: int) -> list[fmpq]:
    """Return the commanded force as a row (size,) on the states."""
    C = to_rational_matrix(claim.controller.C).tolist()
    D = to_rational_matrix(claim.controller.D).tolist()[0][0]
    measured = to_rational_matrix(claim.machine.C).tolist()[0]
    n, s = claim.machine.order, claim.controller.order
    row = [-D * c for c in measured] + [to_rational(0.0)] * (size - n)
    own = size - s - (0 if claim.actuator is None else len(claim.actuator.forgets))
    for i in range(s):
        row[own + i] = C[0][i]
    return row


def with_actuator_filters(claim: FrictionClaim, loop: ExactLoop) -> ExactLoop:
    """Append the filters u_j+ = u_j + phi (u_commanded - u_j) of the actuator to the loop, as its
    last states.
    """
    assert claim.actuator is not None
    forgets = [to_rational(phi) for phi in claim.actuator.forgets]
    n, size, extra = loop.F.nrows(), loop.F.nrows() + len(forgets), len(forgets)
    command_row, zero = _commanded_force_row(claim, size), to_rational(0.0)
    F = block_diagonal(loop.F, fmpq_mat(extra, extra)).tolist()
    jumps = [block_diagonal(jump, identity(extra)).tolist() for jump in loop.jumps]
    if jumps:
        moved = jumps[0]
    else:
        moved = F
    for j, phi in enumerate(forgets):
        moved[n + j] = [old + phi * a for old, a in zip(moved[n + j], command_row, strict=True)]
        moved[n + j][n + j] -= phi
    more = [[zero] * (size - n)]
    return ExactLoop(
        F=fmpq_mat(F),
        B=fmpq_mat(loop.B.tolist() + [[zero]] * (size - n)),
        x=fmpq_mat([loop.x.tolist()[0] + more[0]]),
        v=fmpq_mat([loop.v.tolist()[0] + more[0]]),
        spans=loop.spans,
        jumps=[fmpq_mat(jump) for jump in jumps],
    )


def dead_zone_block(claim: FrictionClaim, loop: ExactLoop, size: int) -> ExactBlock:
    """Return theta_0 w (share c'y - w) + sum theta_j w (c'y - w - u_j) for a loop with filters, in
    `size` states.
    """
    own = claim.actuator
    assert own is not None
    theta = [to_rational(x) for x in own.weights]
    sector = to_rational(own.sector)
    share = to_rational(own.share)
    n, m = claim.machine.order, loop.F.nrows()
    first = m - len(theta)
    total = sum(theta, start=to_rational(0.0))
    output_row = [(share * sector + total) / 2 * a for a in _commanded_force_row(claim, m)] + [
        to_rational(0.0)
    ] * (size - m)
    input_column = [to_rational(0.0)] * size
    for j, (weight, phi) in enumerate(zip(theta, own.forgets, strict=True)):
        output_row[first + j] -= weight / 2
        input_column[first + j] = to_rational(phi)
    if loop.spans:
        input_column[n + 1 if first > n + 1 + claim.controller.order else n] = to_rational(1.0)
    else:
        for i, row in enumerate(to_rational_matrix(claim.machine.B).tolist()):
            input_column[i] = row[0]
    return ExactBlock(
        input_column=fmpq_mat([[e] for e in input_column]),
        output_row=fmpq_mat([[c] for c in output_row]),
        weight=sector + total,
    )


def check_reach(
    claim: FrictionClaim, loop: ExactLoop, *, energy: list[list[fmpq_mat]], stored: fmpq_mat
) -> str:
    """Return an empty string if the claimed initial velocity keeps the command in the sector, else
    the fault.

    The test is (1 - share)^2 kick^2 (e'Pe) (c'E^-1 c) <= (limit - Fs |c'rest|)^2, in the
    coordinates of the energy. stored : the whole energy E just before a sample.
    """
    own = claim.actuator
    assert own is not None
    m, size = loop.F.nrows(), claim.V.shape[0]
    command_row = _commanded_force_row(claim, m)
    rest = [row[0] for row in equilibrium(loop).tolist()]
    held = sum((a * r for a, r in zip(command_row, rest, strict=True)), start=to_rational(0.0))
    left = to_rational(own.limit) - to_rational(own.Fs) * abs(held)
    if left <= 0:
        return "the friction alone uses up the limit"
    V = to_rational_matrix(claim.V)
    wide = [*command_row, *[to_rational(0.0)] * (size - m)]
    read = V.transpose() * fmpq_mat([[a] for a in wide])
    read = fmpq_mat(read.tolist() + [[to_rational(0.0)]] * (stored.nrows() - size))
    peak_command = (read.transpose() * stored.solve(read)).tolist()[0][0]
    B, v = to_rational_matrix(claim.machine.B).tolist(), loop.v.tolist()[0]
    through = sum((v[i] * B[i][1] for i in range(claim.machine.order)), start=to_rational(0.0))
    if through <= 0:
        if own.share == 1:
            return ""
        return "a force at the friction port does not change the velocity at once"
    hit = fmpq_mat(
        [
            [B[i][1] / through] if i < claim.machine.order else [to_rational(0.0)]
            for i in range(size)
        ]
    )
    start = V.solve(hit)
    put_in = max(
        (start.transpose() * P * start).tolist()[0][0] for interval in energy for P in interval
    )
    over = (1 - to_rational(own.share)) * to_rational(own.kick)
    if over * over * put_in * peak_command <= left * left:
        return ""
    return "a kick of that size may leave the sector"
