"""The norm of a plant closed through a controller, from both as they are stored: found in many digits, proved in balls.

A loop whose states lie decades apart, or nearly cancel, has another norm in doubles than it has: putting the closed
loop together rounds, evaluating it rounds, and so do the eigenvalues of its Hamiltonian matrix. Here all of it has as
many digits as it takes. The proof is one matrix P that solves the bounded-real Riccati equation with a little more
asked for (that of doubles refined by Newton's iteration; else from the sign of the Hamiltonian matrix, Roberts 1980):
P > 0 and the inequality of the bounded-real lemma, in balls rounded outward, say that the loop is stable with its norm
below the level. How P was found does not matter.
"""

from __future__ import annotations

import time
import warnings
from collections.abc import Callable
from itertools import pairwise
from math import atan, inf, nan
from typing import TypeAlias

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx

from nlfrf._base.values import value
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.matrices import ldl_pivots, stack
from robust.proofs.exact.polynomials import Decision, proved, refuted, undecided
from robust.proofs.exact.verification import Verification, summarise_claims

BITS = (320, 1024)
MAX_STATES = 40  # of loops whose sign is computed: a quarter of a minute, which grows with the third power
MAX_NORM_STATES = 60  # of loops whose norm is computed in many digits: half a minute
MAX_SIGN_STEPS = 40  # of Newton's iteration for the sign; fifteen where the level is not touched
MAX_REFINEMENTS = 60
LEVEL_FACTORS = (1.0, 1.001, 1.03, 1.5)  # times the level, squared
MAX_RISES = 20
ZERO_POLE = 1e-30  # of the largest pole: a triple root keeps a third of the digits, and one this small is zero
TOLERANCE = 1e-9
Balls: TypeAlias = tuple[arb_mat, arb_mat, arb_mat, arb_mat]


@value
class ClosedLoopClaim:
    """What is claimed of u = K y around a plant from (w, u) to (z, y): stable, the norm from w to z below the level."""

    plant: Matrices
    controller: Matrices
    level: float

    @property
    def sampled(self) -> bool:
        """Whether the loop is a discrete one."""
        return bool(self.plant.dt or self.controller.dt)


def verify_closed_loop(claim: ClosedLoopClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove stability and norm of a closed loop again, from plant and controller as they were given."""
    found = decide_closed_loop(claim, deadline=time.thread_time() + time_cap)
    return summarise_claims({"stability and norm": found})


def decide_closed_loop(claim: ClosedLoopClaim, *, deadline: float = inf, thorough: bool = True) -> Decision:
    """Decide whether the loop is stable with its norm below the level.

    Not thorough, only what doubles propose is looked at, which takes a tenth of the time.

    >>> import numpy as np
    >>> def of(*given): return Matrices(**{name: np.atleast_2d(M) for name, M in zip("ABCD", given)})
    >>> plant = of(-1.0, [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)))      # w and u drive a lag, z = y
    >>> K = Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[-1.0]]))
    >>> [decide_closed_loop(ClosedLoopClaim(plant=plant, controller=K, level=x)).outcome for x in (0.5, 0.500001)]
    ['undecided', 'holds']
    """
    found = undecided("not looked at")
    for bits in BITS if thorough else BITS[:1]:
        if time.thread_time() > deadline:
            return undecided("undecided, as time was up")
        with ctx.workprec(bits):
            try:
                found = decide_norm_at_precision(
                    closed_loop(claim.plant, claim.controller), claim, bits=bits, deadline=deadline, thorough=thorough
                )
            except ZeroDivisionError:
                found = undecided("a matrix to be inverted cannot be told from a singular one", needs_digits=True)
        if not found.needs_digits:
            break
    return found


def norm_of_closed_loop(plant: Matrices, controller: Matrices) -> tuple[float, float]:
    """Norm and the frequency [rad/s] of its peak in many digits; inf where not stable, nan of too many states.

    Raised from one pair of crossings to the next (Bruinsma & Steinbuch 1990), as in doubles; a number, and no proof.
    """
    dt = plant.dt or controller.dt
    sampled = dt > 0
    if plant.order + controller.order > MAX_NORM_STATES:
        return nan, nan
    with ctx.workprec(BITS[0]):
        try:
            loop = closed_loop(plant, controller)
            poles = eigenvalues(loop[0])
            if any(p.real.mid() >= 0 for p in poles) if not sampled else any(abs(p).mid() >= 1 for p in poles):
                return inf, nan
            norm, peak = peak_gain(continuous_image(loop) if sampled else loop)
        except (ZeroDivisionError, ValueError):
            return nan, nan
    return norm, 2 / dt * atan(peak) if sampled else peak


def poles_of_closed_loop(plant: Matrices, controller: Matrices) -> np.ndarray | None:
    """Poles of u = K y around a plant, to many digits and then rounded; None where there is no solution.

    >>> one = np.ones((1, 1))
    >>> lag = Matrices(A=-one, B=one, C=-one, D=0 * one)
    >>> K = Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=2 * one)
    >>> poles_of_closed_loop(lag, K)
    array([-3.+0.j])
    """
    with ctx.workprec(BITS[0]):
        try:
            found = np.array([complex(p) for p in eigenvalues(closed_loop(plant, controller)[0])], dtype=complex)
        except (ZeroDivisionError, ValueError):
            return None
    nothing = ZERO_POLE * np.abs(found).max(initial=0.0)  # what is left of a zero is no slow mode
    real, imag = (np.where(np.abs(part) <= nothing, 0.0, part) for part in (found.real, found.imag))
    return np.asarray(real + 1j * imag)


def closed_loop(plant: Matrices, controller: Matrices) -> Balls:
    """F_l(P, K) in balls, all states kept; a ZeroDivisionError where the loop has no solution."""
    n_u, n_y = controller.D.shape
    w, z = plant.D.shape[1] - n_u, plant.D.shape[0] - n_y
    A, B1, B2 = to_balls(plant.A), to_balls(plant.B[:, :w]), to_balls(plant.B[:, w:])
    C1, C2 = to_balls(plant.C[:z]), to_balls(plant.C[z:])
    D11, D12, D21, D22 = (to_balls(D) for D in (plant.D[:z, :w], plant.D[:z, w:], plant.D[z:, :w], plant.D[z:, w:]))
    A_K, B_K, C_K, D_K = (to_balls(getattr(controller, name)) for name in "ABCD")
    loop_inverse = (identity_balls(n_u) - D_K * D22).inv()
    gain, direct = loop_inverse * stack([[D_K * C2, C_K]]), loop_inverse * D_K * D21  # u = gain (x, x_K) + direct w
    n, m = plant.order, controller.order
    through = stack([[B2], [B_K * D22]])
    return (
        stack([[A, arb_mat(n, m)], [B_K * C2, A_K]]) + through * gain,
        stack([[B1], [B_K * D21]]) + through * direct,
        stack([[C1, arb_mat(z, m)]]) + D12 * gain,
        D11 + D12 * direct,
    )


def decide_norm_at_precision(
    loop: Balls, claim: ClosedLoopClaim, *, bits: int, deadline: float, thorough: bool
) -> Decision:
    """Decide at the precision of the moment."""
    level = arb(claim.level)
    square = level * level
    if is_zero_transfer(loop):  # its norm is zero: what is left to prove is that it is stable
        n, m = loop[0].nrows(), loop[3].ncols()
        loop, square = (loop[0], arb_mat(n, m), identity_balls(n), arb_mat(n, m)), arb(1)
    A, B, C, D = loop
    n = A.nrows()
    direct = identity_balls(D.ncols()) * square - D.transpose() * D
    pivots = ldl_pivots(direct.tolist())
    if not all(p > 0 for p in pivots):
        text = "not below the level at infinite frequency"
        return refuted(text) if any(p <= 0 for p in pivots) else undecided(text, needs_digits=True)
    if not n:
        return proved()
    scaled = balance_states(loop)
    image = continuous_image(scaled) if claim.sampled else scaled
    more = arb(2) ** -(bits // 3)
    P = refine_storage(image, square, more)
    if P is None and thorough and n <= MAX_STATES:
        P = storage_by_matrix_sign(image, square, more, bits, deadline)
    if P is None:
        return undecided("no energy was found: the level is reached, or the loop is not stable", needs_digits=True)
    A, B, C, D = scaled
    if claim.sampled:
        top, side = A.transpose() * P * A - P, A.transpose() * P * B
        corner = direct - B.transpose() * P * B
    else:
        top, side, corner = A.transpose() * P + P * A, P * B, direct
    top, side = top + C.transpose() * C, side + C.transpose() * D
    M = symmetric_part(stack([[-top, -side], [-side.transpose(), corner]]))
    if all(p > 0 for p in ldl_pivots(P.tolist())) and all(p > 0 for p in ldl_pivots(M.tolist())):
        return proved()
    return undecided("the energy that was found does not pass", needs_digits=True)


def is_zero_transfer(loop: Balls) -> bool:
    """Return whether nothing passes from input to output, by zeros that are exact."""
    A, B, C, D = loop
    return all(x == 0 for M in (D, *(C * A**k * B for k in range(A.nrows()))) for row in M.tolist() for x in row)


def refine_storage(loop: Balls, square: arb, more: arb) -> arb_mat | None:
    """P of a continuous loop at a level, squared: that of doubles, refined by Newton's iteration; None where it stalls.

    What is left of the Riccati equation is put together in many digits, the Lyapunov equation of a step solved in
    doubles: each step is right to some digits, as long as doubles tell the modes apart at all.
    """
    from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov

    A, B, C, D = loop
    Q = C.transpose() * C + identity_balls(A.nrows()) * (more * (frobenius_norm(C) ** 2))
    S = C.transpose() * D
    inverse = (identity_balls(D.ncols()) * square - D.transpose() * D).inv()
    enough = frobenius_norm(Q) * more * arb(2) ** -20
    a, b, q, s, r = (to_doubles(M) for M in (A, B, Q, S, inverse.inv()))
    for farther in LEVEL_FACTORS:  # nearer to the level doubles may find no solution to begin with
        first = symmetric_or_none(lambda r=farther * r: solve_continuous_are(a, b, q, -r, s=s))  # type: ignore[misc]
        if first is None:
            continue
        P = arb_mat(first.tolist())
        before: arb | float = inf
        for _ in range(MAX_REFINEMENTS):
            gain = inverse * (B.transpose() * P + S.transpose())
            left = symmetric_part(A.transpose() * P + P * A + Q + (P * B + S) * gain).mid()
            norm = frobenius_norm(left)
            if norm <= enough:
                return P
            F, rest = to_doubles(A + B * gain), to_doubles(left * (1 / norm))
            moved = symmetric_or_none(lambda F=F, rest=rest: solve_continuous_lyapunov(F.T, -rest))  # type: ignore[misc]
            if moved is None:
                break
            following = (P + arb_mat(moved.tolist()) * norm).mid()
            step = frobenius_norm(following - P)
            if not step < (2 * before if before < inf else inf):
                break
            P, before = following, step
    return None


def storage_by_matrix_sign(loop: Balls, square: arb, more: arb, bits: int, deadline: float) -> arb_mat | None:
    """P of a continuous loop at a level, squared, by the sign of the Hamiltonian matrix; None where there is none."""
    H = hamiltonian(loop, square, more)
    n = loop[0].nrows()
    near = arb(2) ** -(bits // 2)
    S = H
    for _ in range(MAX_SIGN_STEPS):
        if time.thread_time() > deadline:
            return None
        inverse = S.inv().mid()
        # by the determinant (Byers 1987): norms say little where the blocks are of different sizes
        c = (abs(S.det().mid()) ** (arb(-1) / (2 * n))).mid()
        following = ((S * c + inverse * (1 / c)) * arb(0.5)).mid()
        moved = frobenius_norm(following - S)
        S = following
        if moved <= near * frobenius_norm(S):
            break
    else:
        return None
    rows = S.tolist()
    left = arb_mat([[rows[i][n + j] + (i == n + j) for j in range(n)] for i in range(2 * n)])
    right = arb_mat([[-rows[i][j] - (i == j) for j in range(n)] for i in range(2 * n)])
    P = (left.transpose() * left).solve(left.transpose() * right).mid()
    return symmetric_part(P).mid()


def hamiltonian(loop: Balls, square: arb, more: arb) -> arb_mat:
    """Return the Hamiltonian matrix of a level, squared, with `more` of every state asked for, relative to what is."""
    A, B, C, D = loop
    inverse = (identity_balls(D.ncols()) * square - D.transpose() * D).inv()
    across = B * inverse * D.transpose()
    F = A + across * C
    Q = C.transpose() * C + C.transpose() * D * inverse * D.transpose() * C
    Q = Q + identity_balls(A.nrows()) * (more * (frobenius_norm(C) ** 2))
    return stack([[F, B * inverse * B.transpose()], [-Q, -F.transpose()]]).mid()


def peak_gain(loop: Balls) -> tuple[float, float]:
    """Norm and peak of a stable continuous loop, from evaluation at its poles on."""
    poles = [complex(p) for p in eigenvalues(loop[0])]
    found = [(gain_at(loop, omega), omega) for omega in {0.0, inf, *map(abs, poles), *(abs(p.imag) for p in poles)}]
    norm, peak = max(found)
    for _ in range(MAX_RISES):
        level = arb(norm) * (1 + arb(TOLERANCE))
        if not norm or not loop[0].nrows():
            break
        crossings = sorted(
            float(x.imag.mid())
            for x in eigenvalues(hamiltonian(loop, level * level, arb(0)))
            if x.imag.mid() > 0 and abs(x.real.mid()) < arb(2) ** -(BITS[0] // 4) * abs(x).mid()
        )
        between = [np.sqrt(a * b) for a, b in pairwise(crossings)]
        tried = [(gain_at(loop, omega), omega) for omega in between]
        if not tried or max(tried)[0] <= norm:
            break
        norm, peak = max(tried)
    return norm, peak


def gain_at(loop: Balls, omega: float) -> float:
    """Largest singular value at j omega."""
    A, B, C, D = loop
    if omega < inf and A.nrows():
        s = acb(0, omega)
        pencil = acb_mat(identity_balls(A.nrows())) * s - acb_mat(A)
        values = acb_mat(D) + acb_mat(C) * pencil.solve(acb_mat(B))
    else:
        values = acb_mat(D)
    return float(np.linalg.svd(np.array([[complex(x) for x in row] for row in values.tolist()]), compute_uv=False)[0])


def continuous_image(loop: Balls) -> Balls:
    """Return the image of a discrete loop on the imaginary axis, z = (1 + s)/(1 - s).

    P stays that of the loop itself.
    """
    A, B, C, D = loop
    one, root = identity_balls(A.nrows()), arb(2).sqrt()
    back = (A + one).inv()
    return back * (A - one), back * B * root, C * back * root, D - C * back * B


def balance_states(loop: Balls) -> Balls:
    """The loop with its states in units, powers of two, in which none acts on the others far more than they on it."""
    from scipy.linalg import matrix_balance

    A, B, C, D = loop
    n, (a, b, c) = A.nrows(), (np.abs(to_doubles(M)) for M in (A, B, C))
    bordered = np.block([[a, b.max(axis=1, initial=0.0)[:, None]], [c.max(axis=0, initial=0.0), np.zeros(1)]])
    sizes = matrix_balance(bordered, permute=False, separate=True)[1][0]
    units = [arb(float(size / sizes[n])) for size in sizes[:n]]
    forth, back = diagonal_balls([1 / u for u in units]), diagonal_balls(units)
    return forth * A * back, forth * B, C * back, D


def eigenvalues(matrix: arb_mat) -> list[acb]:
    """All eigenvalues, as near as the digits at hand bring them; nothing rests on them."""
    return list(acb_mat(matrix).eig(algorithm="approx")) if matrix.nrows() else []


def to_balls(matrix: np.ndarray) -> arb_mat:
    """Return a matrix of doubles as balls, exactly."""
    return arb_mat(len(matrix), matrix.shape[1], [arb(float(x)) for x in np.ravel(matrix)])


def to_doubles(matrix: arb_mat) -> np.ndarray:
    """Return the nearest doubles."""
    return np.array([[float(x.mid()) for x in row] for row in matrix.tolist()]).reshape(matrix.nrows(), -1)


def symmetric_or_none(solve: Callable[[], np.ndarray]) -> np.ndarray | None:
    """Return the symmetric part of what doubles find, or None where they find nothing to be trusted."""
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error", RuntimeWarning)
            found = solve()
    except (np.linalg.LinAlgError, ValueError, RuntimeWarning):
        return None
    return (found + found.T) / 2 if np.isfinite(found).all() else None


def symmetric_part(matrix: arb_mat) -> arb_mat:
    """Return the symmetric part of a matrix that is symmetric but for its errors."""
    return (matrix + matrix.transpose()) * arb(0.5)


def frobenius_norm(matrix: arb_mat) -> arb:
    """Frobenius norm, as far as its midpoint."""
    return sum((x.mid() * x.mid() for x in matrix.entries()), arb(0)).sqrt().mid()


def identity_balls(n: int) -> arb_mat:
    """Return the identity in balls."""
    return diagonal_balls([arb(1)] * n)


def diagonal_balls(numbers: list[arb]) -> arb_mat:
    """Return a diagonal matrix."""
    n = len(numbers)
    return arb_mat(n, n, [numbers[i] if i == j else 0 for i in range(n) for j in range(n)])
