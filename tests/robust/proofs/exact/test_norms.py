"""Norm bounds and matrix inequalities over the rationals: on either side of the limit, one unit
apart.
"""

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_mat
from scipy.optimize import minimize_scalar

from robust import certify_norm
from robust.proofs.exact.matrices import positive_definite


def largest_gain(system):
    """The largest singular value over a fine grid, climbed to the last digits."""
    poles = system.poles()
    if system.dt:
        poles = np.log(poles.astype(complex)) / system.dt
    near = (
        np.abs(poles.imag)[:, None] + np.abs(poles.real)[:, None] * np.linspace(-3, 3, 61)
    ).ravel()
    top = np.pi / system.dt if system.dt else 1e3 * np.abs(poles).max()
    omega = np.unique(np.concatenate([np.geomspace(1e-4, 1, 2000) * top, near, [0.0, top]]))
    omega = omega[(omega >= 0) & (omega <= top)]

    def gains(w):
        s = np.exp(1j * w * system.dt) if system.dt else 1j * w
        return np.linalg.norm(np.moveaxis(system(s, squeeze=False), -1, 0), 2, axis=(1, 2))

    def gain(w):
        return float(gains(np.array([w]))[0])

    sizes = gains(omega)
    best = [sizes[0], sizes[-1], np.linalg.norm(system.D, 2)]
    for k in np.argsort(sizes)[-5:]:
        low, high = omega[max(k - 1, 0)], omega[min(k + 1, omega.size - 1)]
        climbed = minimize_scalar(
            lambda w: -gain(w), bounds=(low, high), method="bounded", options={"xatol": 1e-9 * high}
        )
        best.append(-climbed.fun)
    return max(best)


@pytest.mark.parametrize("dt", [0, 0.1])
@pytest.mark.parametrize("seed", range(4))
def test_norms_of_several_channels(seed, dt):
    """Within 1e-8 of the norm that a search over frequency finds in floating point."""
    rng = np.random.default_rng(seed)
    A = rng.normal(size=(6, 6))
    poles = np.linalg.eigvals(A)
    A = 0.97 * A / np.abs(poles).max() if dt else A - (poles.real.max() + 0.05) * np.eye(6)
    system = control.StateSpace(
        A, rng.normal(size=(6, 2)), rng.normal(size=(3, 6)), rng.normal(size=(3, 2)), dt
    )
    norm = largest_gain(system)
    assert certify_norm(system, norm * (1 + 1e-8)).holds
    assert certify_norm(system, norm * (1 - 1e-8)).violated


def test_gains_and_unstable_systems():
    gain = control.ss([], [], [], [[3.0, 4.0]])
    assert certify_norm(gain, 5.0).violated
    assert certify_norm(gain, np.nextafter(5, 6)).holds
    for A, dt in ((0.0, 0), (1.0, 0.1), (-1.0, 0.1)):
        found = certify_norm(control.ss([[A]], [[1.0]], [[1e-9]], [[0.0]], dt), 1.0)
        assert found.violated
        assert "not stable" in found.reason


def test_matrices_beside_the_limit():
    rng = np.random.default_rng(1)
    root = fmpq_mat(8, 5, [fmpq(int(x)) for x in rng.integers(-9, 9, 40)])
    singular = root * root.transpose()  # of rank five
    small = fmpq_mat(8, 8, [fmpq(int(i == j), 10**60) for i in range(8) for j in range(8)])
    assert not positive_definite(singular)
    assert positive_definite(singular + small)
    assert not positive_definite(singular - small)
    with pytest.raises(ValueError, match="must be symmetric"):
        positive_definite(fmpq_mat([[1, 2], [1, 9]]))
