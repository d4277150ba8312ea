"""Norm bounds and matrix inequalities over the rationals: on either side of the limit, one unit
apart.
"""

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_mat

from robust.lti.norms import hinf_norm
from robust.proofs.exact.bands import TransferMatrix, decide_norm
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.matrices import positive_definite
from robust.proofs.exact.polynomials import to_rational_matrix


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_norms_of_several_channels(seed, dt):
    """Within 1e-8 of the norm that bisection on the Hamiltonian finds in floating point."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(6, 6))
    poles = np.linalg.eigvals(A)
    A = 0.97 * A / np.abs(poles).max() if dt else A - (poles.real.max() + 0.05) * np.eye(6)
    system = control.StateSpace(
        A, rng.normal(size=(6, 2)), rng.normal(size=(3, 6)), rng.normal(size=(3, 2)), dt
    )
    norm = hinf_norm(system)[0]
    for factor, true in ((1 + 1e-8, True), (1 - 1e-8, False)):
        exact = TransferMatrix.of(to_matrices(system))
        assert exact.stability.holds
        assert decide_norm(exact, norm * factor).holds == true


def test_gains_and_unstable_systems():
    gain = TransferMatrix.of(to_matrices(control.ss([], [], [], [[3.0, 4.0]])))
    assert not decide_norm(gain, 5.0).holds
    assert decide_norm(gain, np.nextafter(5, 6)).holds
    for A, dt in ((0.0, 0), (1.0, 0.1), (-1.0, 0.1)):
        system = TransferMatrix.of(to_matrices(control.ss([[A]], [[1.0]], [[1e-9]], [[0.0]], dt)))
        assert not system.stability.holds
        assert not decide_norm(system, 1.0).holds


def test_matrices_beside_the_limit():
    rng = np.random.default_rng(1)
    root = to_rational_matrix(rng.integers(-9, 9, (8, 5)).astype(float))
    singular = root * root.transpose()  # of rank five
    small = fmpq_mat(8, 8, [fmpq(int(i == j), 10**60) for i in range(8) for j in range(8)])
    assert not positive_definite(singular)
    assert positive_definite(singular + small)
    assert not positive_definite(singular - small)
    with pytest.raises(ValueError, match="must be symmetric"):
        positive_definite(fmpq_mat([[1, 2], [1, 9]]))
