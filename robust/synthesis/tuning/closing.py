"""The closed loop of a plant and the blocks, its responses, and their derivatives by M (the matrix
of the blocks).

With the states of the blocks included in the plant the blocks are one static feedback u = M y
(Apkarian & Noll 2006):

    N = M (I - D22 M)^-1,   A + B2 N C2, B1 + B2 N D21, C1 + D12 N C2, D11 + D12 N D21

are the matrices A_cl, B_cl, C_cl, D_cl of the closed loop H. With X = (sI - A_cl)^-1 B_cl and Y =
C_cl (sI - A_cl)^-1, dH = L dM R at any frequency s, L = (Y B2 + D12)(I - M D22)^-1, R = (I - D22
M)^-1 (C2 X + D21). The differential of any gain of H that a limit bounds is Re tr(Q* dH) for some
Q. So its derivative with respect to parameter k is Re tr(R Q* L dM_k), with dM_k the derivative of
M with respect to this parameter.
"""

from __future__ import annotations

from functools import cached_property

import control
import numpy as np
from scipy.linalg import block_diag

from nlfrf._base.values import value
from robust.lti.lti import Matrices, evaluate_transfer
from robust.lti.norms import continuous_matrices
from robust.lti.wiring import is_well_posed

#: Condition of the eigenvectors up to which responses on a grid are computed from the modes.
_MAX_MODAL_CONDITION = 1e7


@value(copy=False)
class StatePlant:
    """All fixed parts, with the states of the blocks included: from (inputs, M y) to
    (outputs, y).
    """

    A: np.ndarray
    B1: np.ndarray
    B2: np.ndarray
    C1: np.ndarray
    C2: np.ndarray
    D11: np.ndarray
    D12: np.ndarray
    D21: np.ndarray
    D22: np.ndarray

    def close(self, M: np.ndarray) -> ClosedLoop | None:
        """Return the loop closed by the blocks; None if it has no solution."""
        around = np.eye(M.shape[1]) - self.D22 @ M
        if not is_well_posed(around):
            return None
        F = np.linalg.inv(around)
        N = M @ F
        gain = self.B2 @ N
        return ClosedLoop(
            plant=self,
            A=self.A + gain @ self.C2,
            B=self.B1 + gain @ self.D21,
            C=self.C1 + self.D12 @ N @ self.C2,
            D=self.D11 + self.D12 @ N @ self.D21,
            E=np.eye(M.shape[0]) + N @ self.D22,
            F=F,
        )


def state_plant(
    open_loop: control.StateSpace, n_states: int, n_in: int, n_out: int, dt: float
) -> StatePlant:
    """Return the open loop with the states of the blocks included; the ports of the blocks come
    last.
    """
    A, B, C, D = continuous_matrices(open_loop, dt)
    n_w, n_z = B.shape[1] - n_out, C.shape[0] - n_in
    zero, one = np.zeros((n_states, n_states)), np.eye(n_states)
    B2 = block_diag(B[:, n_w:], one)  # (states, states of the blocks) <- (u, derivatives)
    C2 = block_diag(C[n_z:], one)
    u_first, y_first = np.r_[n_out : n_out + n_states, :n_out], np.r_[n_in : n_in + n_states, :n_in]
    D22 = block_diag(D[n_z:, n_w:], zero)
    return StatePlant(
        A=block_diag(A, zero),
        B1=np.vstack([B[:, :n_w], np.zeros((n_states, n_w))]),
        B2=B2[:, u_first],
        C1=np.hstack([C[:n_z], np.zeros((n_z, n_states))]),
        C2=C2[y_first],
        D11=D[:n_z, :n_w],
        D12=np.hstack([np.zeros((n_z, n_states)), D[:n_z, n_w:]]),
        D21=np.vstack([np.zeros((n_states, n_w)), D[n_z:, :n_w]]),
        D22=D22[np.ix_(y_first, u_first)],
    )


@value(copy=False)
class ClosedLoop:
    """A loop closed by the blocks, continuous or the bilinear image of a sampled one."""

    plant: StatePlant
    A: np.ndarray
    B: np.ndarray
    C: np.ndarray
    D: np.ndarray
    E: np.ndarray
    F: np.ndarray

    @property
    def matrices(self) -> Matrices:
        """Return A, B, C, D from all inputs to all outputs."""
        return self.A, self.B, self.C, self.D

    @cached_property
    def modes(self) -> tuple[np.ndarray, np.ndarray]:
        """Return eigenvalues and eigenvectors of A."""
        if not len(self.A):
            return np.zeros(0, complex), np.zeros((0, 0), complex)
        poles, vectors = np.linalg.eig(self.A)
        return poles.astype(complex), vectors.astype(complex)

    @property
    def poles(self) -> np.ndarray:
        """Return eigenvalues of A."""
        return self.modes[0]

    @cached_property
    def modal(self) -> tuple[np.ndarray, np.ndarray] | None:
        """Return C V and V^-1 B; None if the eigenvectors nearly coincide."""
        vectors = self.modes[1]
        if len(vectors) and not np.linalg.cond(vectors) < _MAX_MODAL_CONDITION:
            return None
        return self.C @ vectors, np.linalg.solve(vectors, self.B.astype(complex)) if len(
            vectors
        ) else self.B

    def responses(self, omega: np.ndarray) -> np.ndarray:
        """Return (W, outputs, inputs) at s = j omega; omega may be infinite."""
        omega = np.atleast_1d(omega)
        if self.modal is None:
            return self.responses_by_elimination(omega)
        left, right = self.modal
        poles = self.poles
        with np.errstate(divide="ignore", invalid="ignore"):
            terms = np.where(np.isinf(omega)[:, None], 0.0, 1 / (1j * omega[:, None] - poles))
        return self.D + (left * terms[:, None, :]) @ right

    def responses_by_elimination(self, omega: np.ndarray) -> np.ndarray:
        """Return the same by elimination, point by point."""
        infinite = np.isinf(omega)
        points = np.where(infinite, 0.0, omega) * 1j
        points[infinite] = np.inf
        return evaluate_transfer(self.A, self.B, self.C, self.D, points)

    def sensitivity_factors(self, omega: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Return H, L and R at a frequency: dH = L dM R."""
        P = self.plant
        if np.isinf(omega) or not len(self.A):
            return self.D.astype(complex), P.D12 @ self.E, self.F @ P.D21
        pencil = 1j * omega * np.eye(len(self.A)) - self.A
        both = np.linalg.solve(pencil, np.hstack([self.B, P.B2]))
        X, across = both[:, : self.B.shape[1]], both[:, self.B.shape[1] :]
        return self.C @ X + self.D, (self.C @ across + P.D12) @ self.E, self.F @ (P.C2 @ X + P.D21)

    def pole_sensitivity_factors(self, k: int) -> tuple[np.ndarray, np.ndarray]:
        """Return (m, 1) and (1, m) r and l of a simple pole: d pole = l dM r."""
        vectors = self.modes[1]
        try:
            left = np.linalg.solve(vectors.T, np.eye(len(vectors))[:, k])
        except (
            np.linalg.LinAlgError
        ):  # a defective matrix: the direction of a least-squares inverse
            left = np.linalg.pinv(vectors)[k]
        return self.F @ (self.plant.C2 @ vectors[:, [k]]), left[None] @ self.plant.B2 @ self.E
