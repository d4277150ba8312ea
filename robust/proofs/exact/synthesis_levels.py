"""Lower bounds on gamma of H-infinity synthesis, in multiple precision.

If the poles are decades apart, rounding makes the existence conditions fail at values of gamma that
a controller can achieve. Here the plant is used as given. The two Riccati equations are solved by
the sign of their Hamiltonian matrices (Roberts 1980), with as many digits as needed. A level fails
if a Hamiltonian has eigenvalues on the axis, if a solution is not semidefinite, or if the spectral
radius of their product reaches the level squared; then every lower level fails too (Doyle, Glover,
Khargonekar & Francis 1989). The result is a number with many digits, and not a proof.
"""

from __future__ import annotations

from typing import TypeAlias

import numpy as np
from flint import acb, acb_mat, arb, arb_mat, ctx
from scipy.linalg import matrix_balance

from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.matrices import identity, ldl_pivots, stack

Balls: TypeAlias = tuple[arb_mat, arb_mat, arb_mat, arb_mat]

_BITS = 192
_MOST_STATES = 40  # of the plant: a second for a level
_MOST_STEPS = 60  # of Newton's iteration for the sign: a step halves the decades between the poles


def level_fails(
    plant: Matrices,
    into_u: np.ndarray,
    out_of_y: np.ndarray,
    level: float,
    *,
    circle: tuple[float, ...] = (),
) -> bool | None:
    """Return True if no controller brings the norm of a plant from (w, u) to (z, y) below a level.

    None if it is unknown: too many states, or no full rank at infinite frequency in u and in y.

    plant : the generalised plant. into_u, out_of_y : combinations of its last inputs and outputs
    that act and measure. circle : ends of the disc in the right half plane [rad/s] that replaces
    the half plane.

    >>> import numpy as np
    >>> P = Matrices(A=-np.eye(1), B=np.ones((1, 2)), C=np.array([[1.0], [0.0], [1.0]]),
    ...              D=np.array([[0.0, 0.0], [0.0, 1.0], [1.0, 0.0]]))
    >>> [level_fails(P, np.eye(1), np.eye(1), x) for x in (0.70, 0.71)]                       # 1/sqrt(2)
    [True, False]
    """
    if plant.order > _MOST_STATES:
        return None
    w, z = plant.D.shape[1] - len(into_u), plant.D.shape[0] - out_of_y.shape[1]
    with ctx.workprec(_BITS):
        A, B, C, D = (_to_balls(getattr(plant, name)) for name in "ABCD")
        inputs = stack(
            [
                [_identity_balls(w), arb_mat(w, into_u.shape[1])],
                [arb_mat(len(into_u), w), _to_balls(into_u)],
            ]
        )
        outputs = stack(
            [
                [_identity_balls(z), arb_mat(z, out_of_y.shape[1])],
                [arb_mat(len(out_of_y), z), _to_balls(out_of_y)],
            ]
        )
        try:
            parts = _balance_states((A, B * inputs, outputs * C, outputs * D * inputs))
            if plant.dt:
                parts = _half_plane_image(parts, 1.0, -1.0)
            return _existence_fails(
                _half_plane_image(parts, *circle) if circle else parts, z, w, arb(level)
            )
        except ZeroDivisionError:
            return None


def _half_plane_image(plant: Balls, a: float, b: float) -> Balls:
    """Return the image under p = (s - a)/(1 - s/b), as in `robust.lti.norms.to_half_plane`.

    For a discrete system 1 and -1 are the ends of the disc whose outside becomes the right half
    plane.
    """
    A, B, C, D = plant
    one, near, far = _identity_balls(A.nrows()), arb(a), arb(b)
    inverse = (one - A * (1 / far)).inv()
    return (
        inverse * (A - one * near),
        inverse * B * (1 - near / far),
        C * inverse,
        D + C * inverse * B * (1 / far),
    )


def _existence_fails(plant: Balls, z: int, w: int, level: arb) -> bool | None:
    """Return True if a level fails, at the current precision, for z outputs and w inputs besides y
    and u.
    """
    A, B, C, D = plant
    dual = A.transpose(), C.transpose(), B.transpose(), D.transpose()
    found: list[arb_mat] = []
    for parts, outputs, inputs in ((plant, z, w), (dual, w, z)):
        try:
            storage = _control_storage(parts, outputs, inputs, level)
        except ZeroDivisionError:  # no full rank: this side gives no information
            continue
        if storage is None:
            return True
        found.append(storage)
    if len(found) < 2:
        return None
    return any(x.real.mid() >= (level * level).mid() for x in _eigenvalues(found[0] * found[1]))


def _control_storage(plant: Balls, z: int, w: int, level: arb) -> arb_mat | None:
    """Return X of a level for known states and known w, or Y for the dual plant; None if there is
    none.

    A ZeroDivisionError is raised if u does not reach z at infinite frequency.
    """
    A, B, C, D = plant
    n_u = B.ncols() - w
    if not n_u:
        raise ZeroDivisionError
    C1, D1 = (arb_mat(M.tolist()[:z]) for M in (C, D))
    R = D1.transpose() * D1
    R = arb_mat(
        [
            [R[i, j] - (level * level if i == j < w else 0) for j in range(w + n_u)]
            for i in range(w + n_u)
        ]
    )
    # the Schur complement of u in R is negative at levels above the direct term that remains for
    # any u
    corner = arb_mat([[R[i, j] for j in range(w, w + n_u)] for i in range(w, w + n_u)])
    side = arb_mat([[R[i, j] for j in range(w, w + n_u)] for i in range(w)])
    top = arb_mat([[R[i, j] for j in range(w)] for i in range(w)])
    if not all(p > 0 for p in ldl_pivots(corner.tolist())):
        raise ZeroDivisionError
    if not all(p > 0 for p in ldl_pivots((side * corner.inv() * side.transpose() - top).tolist())):
        return None
    n, across = A.nrows(), R.inv() * D1.transpose() * C1
    if not n:
        return arb_mat(0, 0)
    F, Q = A - B * across, C1.transpose() * C1 - C1.transpose() * D1 * across
    H = stack([[F, B * R.inv() * B.transpose() * -1], [Q * -1, F.transpose() * -1]]).mid()
    S = _sign_of(H)
    if S is None:
        return None
    rows = S.tolist()
    left = arb_mat([[rows[i][n + j] + (i == n + j) for j in range(n)] for i in range(2 * n)])
    right = arb_mat([[-rows[i][j] - (i == j) for j in range(n)] for i in range(2 * n)])
    X = _symmetric_part((left.transpose() * left).solve(left.transpose() * right)).mid()
    # X is zero to the last digit if y determines w completely
    rounding = (_frobenius_norm(X) + _frobenius_norm(H) * arb(2) ** -(_BITS // 4)) * arb(2) ** -(
        _BITS // 4
    )
    if all(p > 0 for p in ldl_pivots((X + _identity_balls(n) * rounding).tolist())):
        return X
    return None


def _sign_of(H: arb_mat) -> arb_mat | None:
    """Return the sign of a Hamiltonian matrix; None if it has eigenvalues on the axis."""
    S, near = H, arb(2) ** -(_BITS // 2)
    for _ in range(_MOST_STEPS):
        try:
            inverse = S.inv().mid()
        except ZeroDivisionError:
            return None
        c = (abs(S.det().mid()) ** (arb(-1) / S.nrows())).mid()  # by the determinant (Byers 1987)
        following = ((S * c + inverse * (1 / c)) * arb(0.5)).mid()
        moved = _frobenius_norm(following - S)
        S = following
        if moved <= near * _frobenius_norm(S):
            return S
    return None


# ---- Systems in balls.


def _balance_states(loop: Balls) -> Balls:
    """Return the loop with its states in balanced units, which are powers of two."""
    A, B, C, D = loop
    n, (a, b, c) = A.nrows(), (np.abs(_to_doubles(M)) for M in (A, B, C))
    bordered = np.block(
        [[a, b.max(axis=1, initial=0.0)[:, None]], [c.max(axis=0, initial=0.0), np.zeros(1)]]
    )
    sizes = matrix_balance(bordered, permute=False, separate=True)[1][0]
    units = [arb(float(size / sizes[n])) for size in sizes[:n]]
    forth, back = _diagonal_balls([1 / u for u in units]), _diagonal_balls(units)
    return forth * A * back, forth * B, C * back, D


def _eigenvalues(matrix: arb_mat) -> list[acb]:
    """Return all eigenvalues approximately, to the current digits; no proof uses them."""
    if matrix.nrows():
        return list(acb_mat(matrix).eig(algorithm="approx"))
    return []


def _to_balls(matrix: np.ndarray) -> arb_mat:
    """Return a matrix of doubles as balls, exactly."""
    return arb_mat(len(matrix), matrix.shape[1], [arb(float(x)) for x in np.ravel(matrix)])


def _to_doubles(matrix: arb_mat) -> np.ndarray:
    return np.array([[float(x.mid()) for x in row] for row in matrix.tolist()]).reshape(
        matrix.nrows(), -1
    )


def _symmetric_part(matrix: arb_mat) -> arb_mat:
    return (matrix + matrix.transpose()) * arb(0.5)


def _frobenius_norm(matrix: arb_mat) -> arb:
    return sum((x.mid() * x.mid() for x in matrix.entries()), arb(0)).sqrt().mid()


def _identity_balls(n: int) -> arb_mat:
    return arb_mat(identity(n))


def _diagonal_balls(numbers: list[arb]) -> arb_mat:
    n = len(numbers)
    return arb_mat(n, n, [numbers[i] if i == j else 0 for i in range(n) for j in range(n)])
