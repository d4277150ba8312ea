"""The largest gain in a band: both bounds against another method, on modes, poles on the axis and
clocks.
"""

import control
import numpy as np
import pytest

from robust.proofs.search.bands import bound_gain


def light_modes(rng, n_modes, n=2, dt=0.0):
    """Modes of damping 1e-5 to 1 over four decades, some unstable, in coordinates of no meaning."""
    w = 10 ** rng.uniform(-2, 2, n_modes)
    z = 10 ** rng.uniform(-5, 0, n_modes) * rng.choice([1, 1, -1], n_modes)
    A = np.kron(np.diag(w), np.ones((2, 2))) * np.tile([[0, 1], [-1, -2]], (n_modes, n_modes))
    A[1::2, 1::2] *= np.diag(z)
    T = rng.normal(size=A.shape)
    B, C = rng.normal(size=(len(A), n)), rng.normal(size=(n, len(A)))
    G = control.ss(T @ A @ np.linalg.inv(T), T @ B, C @ np.linalg.inv(T), rng.normal(size=(n, n)))
    return (control.sample_system(G, dt) if dt else G), w, z


@pytest.mark.parametrize("dt", [0.0, 0.02])
@pytest.mark.parametrize("seed", range(4))
def test_a_search_by_another_method_stays_below_the_bound_and_reaches_it(seed, dt):
    rng = np.random.default_rng(seed)
    G, w, z = light_modes(rng, 4, dt=dt)
    top = np.pi / dt if dt else np.inf
    for band in ((0.0, np.inf), (0.3 * w[0], 3 * w[0]), (float(w.max() * 1.1), np.inf)):
        high = min(band[1], top)
        if band[0] >= high:
            continue
        found = bound_gain(G, band=band)
        near = (w[:, None] * (1 + np.abs(z[:, None]) * np.linspace(-20, 20, 2001))).ravel()
        omega = np.concatenate(
            [near, np.geomspace(1e-3, 1e4, 3000), [band[0], high if np.isfinite(high) else 1e9]]
        )
        omega = omega[(omega >= band[0]) & (omega <= high)]
        sizes = np.linalg.norm(
            np.moveaxis(G(np.exp(1j * omega * dt) if dt else 1j * omega), 2, 0), 2, axis=(1, 2)
        )
        assert found.is_proved
        assert sizes.max() <= found.upper * (1 + 1e-9)
        assert found.upper <= 1.0011 * found.lower
        assert found.lower <= sizes.max() * 1.02
        assert band[0] * (1 - 1e-9) <= found.omega <= high


def test_a_pole_on_the_axis_leaves_no_bound_inside_the_band_and_one_beside_it():
    G = control.ss(control.tf([1], [1, 0, 4, 0]))  # 1/(s (s^2 + 4))
    whole = bound_gain(G)
    assert not whole.is_proved
    assert np.isinf(whole.upper)
    assert "grows without end near" in whole.reason
    between = bound_gain(G, band=(0.5, 1.5))
    assert between.upper == pytest.approx(1 / (0.5 * 3.75), rel=1.1e-3)
    assert bound_gain(G, band=(3.0, np.inf)).upper == pytest.approx(1 / 15, rel=1.1e-3)


def test_a_system_of_ten_decades_and_one_without_a_gain():
    stiff = control.ss(
        np.diag([-1e-9, -1e3]), np.eye(2), [[1e-9, 0.0], [1.0, 2e3]], np.zeros((2, 2))
    )
    assert bound_gain(stiff).upper == pytest.approx(
        np.linalg.norm([[1.0, 0.0], [1e9, 2.0]], 2), rel=1.1e-3
    )
    assert bound_gain(control.ss([[-1.0]], [[1.0]], [[0.0]], [[0.0]])).upper < 1e-100
    assert bound_gain(control.ss([], [], [], [[3.0, 4.0]])).upper == pytest.approx(5.0, rel=1.1e-3)


def test_time_that_is_up_says_so():
    found = bound_gain(light_modes(np.random.default_rng(0), 4)[0], time_cap=0.0)
    assert (found.upper, found.reason) == (np.inf, "undecided: the time limit was reached")
