"""The frequency ranges on which a scaling that was found at one frequency proves a level, in exact
arithmetic.

With X > 0 that commutes with the perturbations and skew K on the real blocks, mu of N stays below
one if

    X_R - N~ X_L N + K N + N~ K~ > 0.

A scaling that was found at x_0 is complex. Along the axis its real part is constant, and its
imaginary part is multiplied by 2 x x_0/(x_0^2 + x^2), which is one at x_0 and smaller elsewhere. So
X stays positive, and everything is a real system in s: `robust.proofs.exact.bands` decides where
the inequality holds, without a grid.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from flint import fmpq, fmpq_mat, fmpq_poly

from nlfrf._base.values import value
from robust.mu.blocks import BlockStructure
from robust.mu.scalings import MuBound
from robust.proofs.exact.bands import Pair, Piece, TransferMatrix, cut_at_crossings
from robust.proofs.exact.interval_kyp import ExactMatrix
from robust.proofs.exact.polynomials import to_rational, to_rational_matrix


@value(copy=False)
class _TurningMatrix:
    """A matrix Z at x_0, as Re Z + t Im Z with t = j at x_0."""

    re: fmpq_mat
    im: fmpq_mat

    @classmethod
    def of(cls, Z: np.ndarray) -> _TurningMatrix:
        """Return a matrix of complex numbers."""
        return cls(re=to_rational_matrix(Z.real), im=to_rational_matrix(Z.imag))

    def at(self, t: ExactMatrix) -> ExactMatrix:
        """Return the matrix at t (1, 1)."""
        return ExactMatrix(re=self.re + self.im * t.re[0, 0], im=self.im * t.im[0, 0])


def cut_by_scaling(
    H: TransferMatrix,
    s: BlockStructure,
    found: MuBound,
    *,
    units: np.ndarray,
    x: float,
    band: tuple[float, float],
    deadline: float = np.inf,
) -> list[Piece] | str:
    """Return the pieces of a band between the points at which the scaling of one x begins or ends
    to prove a level.

    found : bound at one frequency. units : (n_in,) divisor of each input of H.
    """
    assert found.scaling is not None  # for an upper bound
    D_L, D_R, G = (each[:, :, 0] for each in found.scaling)
    c = _coefficients(s.left, D_L.conj().T @ D_L)
    X_L, X_R = np.tensordot(c, s.left, 1), np.tensordot(c, s.right, 1)
    K = -1j * np.tensordot(_coefficients(s.skew, D_R.conj().T @ G @ D_L), s.skew, 1)
    left, right, skew, skew_adjoint = (_TurningMatrix.of(Z) for Z in (X_L, X_R, K, K.conj().T))
    n = len(units)
    unit = fmpq_mat(
        n, n, [1 / to_rational(units[i]) if i == j else 0 for i in range(n) for j in range(n)]
    )

    def inequality(pairs: Sequence[Pair]) -> ExactMatrix:
        (N, adjoint), (t, _) = pairs
        N, adjoint = N * ExactMatrix.real(unit), ExactMatrix.real(unit) * adjoint
        return (
            right.at(t) - adjoint * left.at(t) * N + skew.at(t) * N + adjoint * skew_adjoint.at(t)
        )

    if not left.at(ExactMatrix(re=fmpq_mat([[0]]), im=fmpq_mat([[1]]))).is_positive:
        return "a scaling found is not positive"
    parts = [H, _factor_of_imaginary_parts(to_rational(x), n)]
    return cut_at_crossings(parts, inequality, low=band[0], high=band[1], deadline=deadline)


def _coefficients(basis: np.ndarray, Z: np.ndarray) -> np.ndarray:
    """Return (K,) the coefficients of a Hermitian matrix in a basis: both sides of a scaling then
    agree exactly.
    """
    return np.array([np.vdot(one, Z).real / np.vdot(one, one).real for one in basis])


def _factor_of_imaginary_parts(x: fmpq, n: int) -> TransferMatrix:
    """Return 2 x s/(x^2 - s^2) as a system, for products of up to n of them."""
    k, none = (n + 1) // 2, fmpq_poly([0])
    den = fmpq_poly([x * x, -1]) ** (k - 1)
    return TransferMatrix(
        num=(((none, 2 * x * den),),), den=(den * fmpq_poly([x * x, -1]), none), order=2 * k
    )
