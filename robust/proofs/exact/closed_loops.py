"""The norm of the closed loop of a plant and a controller, computed over the rationals.

If the poles of a loop are decades apart, or nearly cancel zeros, its norm in double precision is
wrong because of rounding in the assembly of the loop and in the eigenvalues of the Hamiltonian
matrix. Here the loop is assembled from rational numbers, and its poles and its norm are decided in
exact arithmetic (`robust.proofs.exact.bands`).
"""

from __future__ import annotations

import time
from math import inf

import numpy as np
from flint import fmpq_mat

from nlfrf._base.values import value
from robust.proofs.exact.bands import TransferMatrix, decide_norm
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.matrices import identity, stack
from robust.proofs.exact.polynomials import Decision, polynomial_roots, refuted, to_rational_matrix
from robust.proofs.exact.verification import Verification, summarise_claims


@value
class ClosedLoopClaim:
    """The claim that u = K y around a plant from (w, u) to (z, y) is stable with a norm from w to z
    below the level.

    A level of zero is that of a loop with zero transfer.
    """

    plant: Matrices
    controller: Matrices
    level: float

    @property
    def sampled(self) -> bool:
        """True for a discrete loop."""
        return bool(self.plant.dt or self.controller.dt)


def verify_closed_loop(claim: ClosedLoopClaim, *, time_cap: float = 60.0) -> Verification:
    """Prove stability and norm of a closed loop again, from plant and controller as given."""
    found = decide_closed_loop(claim, deadline=time.thread_time() + time_cap)
    return summarise_claims({"stability and norm": found})


def decide_closed_loop(claim: ClosedLoopClaim, *, deadline: float = inf) -> Decision:
    """Decide whether the loop is stable and its norm below the level.

    >>> import numpy as np
    >>> def of(*given): return Matrices(**{name: np.atleast_2d(M) for name, M in zip("ABCD", given)})
    >>> plant = of(-1.0, [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)))      # w and u drive a lag, z = y
    >>> K = Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=np.array([[-1.0]]))
    >>> [decide_closed_loop(ClosedLoopClaim(plant=plant, controller=K, level=x)).outcome for x in (0.5, 0.500001)]
    ['violated', 'holds']
    """
    try:
        loop = transfer_of_loop(claim.plant, claim.controller)
    except ZeroDivisionError:
        return refuted("the loop has no solution")
    if loop.is_zero:
        return loop.stability
    return decide_norm(loop, claim.level, deadline=deadline)


def transfer_of_loop(plant: Matrices, controller: Matrices) -> TransferMatrix:
    """Return F_l(P, K) as an exact system; ZeroDivisionError if it is not well posed."""
    return TransferMatrix.of_rationals(
        *_closed_loop(plant, controller), discrete=bool(plant.dt or controller.dt)
    )


def poles_of_closed_loop(plant: Matrices, controller: Matrices) -> np.ndarray | None:
    """Return the poles of u = K y around a plant, found exactly and then rounded; None if there is
    no solution.

    >>> one = np.ones((1, 1))
    >>> lag = Matrices(A=-one, B=one, C=-one, D=0 * one)
    >>> K = Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=2 * one)
    >>> poles_of_closed_loop(lag, K)
    array([-3.+0.j])
    """
    try:
        A, _, _, _ = _closed_loop(plant, controller)
    except ZeroDivisionError:
        return None
    return polynomial_roots(A.charpoly())


def _closed_loop(
    plant: Matrices, controller: Matrices
) -> tuple[fmpq_mat, fmpq_mat, fmpq_mat, fmpq_mat]:
    """Return F_l(P, K) over the rationals with all states; a ZeroDivisionError is raised if there
    is no solution.
    """
    n_u, n_y = controller.D.shape
    w, z = plant.D.shape[1] - n_u, plant.D.shape[0] - n_y
    n, m = plant.order, controller.order
    exact = to_rational_matrix
    A, B1, B2, C1, C2 = (
        exact(M) for M in (plant.A, plant.B[:, :w], plant.B[:, w:], plant.C[:z], plant.C[z:])
    )
    D11, D12, D21, D22 = (
        exact(D) for D in (plant.D[:z, :w], plant.D[:z, w:], plant.D[z:, :w], plant.D[z:, w:])
    )
    A_K, B_K, C_K, D_K = (exact(getattr(controller, name)) for name in "ABCD")
    loop_inverse = (identity(n_u) - D_K * D22).inv()
    # u = gain (x, x_K) + direct w
    gain = loop_inverse * stack([[D_K * C2, C_K]])
    direct = loop_inverse * D_K * D21
    through = stack([[B2], [B_K * D22]])
    return (
        stack([[A, fmpq_mat(n, m)], [B_K * C2, A_K]]) + through * gain,
        stack([[B1], [B_K * D21]]) + through * direct,
        stack([[C1, fmpq_mat(z, m)]]) + D12 * gain,
        D11 + D12 * direct,
    )
