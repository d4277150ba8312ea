"""Response, poles, zeros, connections: against polynomials and against one another."""

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robust.lti.connections import (
    block_diagonal,
    feedback,
    in_parallel,
    in_series,
    inverse_system,
    lower_lft,
    one_plus,
    upper_lft,
)
from robust.lti.lti import balance_matrix, evaluate_transfer, poles, response, to_s_plane, zeros
from robust.lti.realisation import from_roots, multivariable, state_space

OMEGA = np.geomspace(1e-2, 1e2, 60)


def random_plant(rng, n, dt=0.0, direct=True):
    A = rng.standard_normal((n, n))
    A = (
        A / (1.1 * np.abs(np.linalg.eigvals(A)).max())
        if dt
        else A - (0.1 + np.linalg.eigvals(A).real.max()) * np.eye(n)
    )
    D = rng.standard_normal((1, 1)) if direct else np.zeros((1, 1))
    return control.StateSpace(A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), D, dt)


@pytest.mark.parametrize("dt", [0.0, 0.01])
@pytest.mark.parametrize("n", [3, 60])  # by solving at each frequency, and by a Schur form
def test_response_is_that_of_the_definition(n, dt):
    G = random_plant(np.random.default_rng(n), n, dt)
    for omega in (0.1, 3.0, 200.0):
        x = np.exp(1j * omega * dt) if dt else 1j * omega
        wanted = G.C @ np.linalg.solve(x * np.eye(n) - G.A, G.B) + G.D
        assert response(G, np.array([omega]))[0] == pytest.approx(wanted[0, 0], rel=1e-9)


def test_response_over_many_decades():
    """From roots, without ever forming a polynomial: prod (s - z)/prod (s - p), term by term."""
    z, p = -np.geomspace(1e-3, 1e3, 9), -np.geomspace(3e-4, 3e3, 10)
    s = 1j * np.geomspace(1e-5, 1e5, 50)
    wanted = np.prod(s[:, None] - z, axis=1) / np.prod(s[:, None] - p, axis=1)
    assert response(from_roots(z, p, 1.0, 0.0), s.imag) == pytest.approx(wanted, rel=1e-6)


def test_poles_and_zeros():
    z, p = np.array([-1 + 2j, -1 - 2j, 3.0]), np.array([-4.0, -0.1 + 5j, -0.1 - 5j, -7.0])
    G = from_roots(z, p, 2.5, 0.0)
    assert np.sort_complex(poles(G)) == pytest.approx(np.sort_complex(p), rel=1e-9)
    found = zeros(G)
    assert found.size == z.size
    assert np.abs(found[:, None] - z).min(axis=0) == pytest.approx(0, abs=1e-8)
    assert to_s_plane(np.exp(p * 0.01), 0.01) == pytest.approx(p, rel=1e-9)


@given(seed=st.integers(0, 2**20), dt=st.sampled_from([0.0, 0.1]))
def test_connections_are_what_their_formulas_say(seed, dt):
    rng = np.random.default_rng(seed)
    F, G = random_plant(rng, 2, dt), random_plant(rng, 3, dt)
    omega = OMEGA[OMEGA * dt < np.pi]
    f, g = response(F, omega), response(G, omega)
    for system, wanted in (
        (in_series(F, G), f * g),
        (in_parallel(F, G), f + g),
        (one_plus(G), 1 + g),
        (inverse_system(G), 1 / g),
        (feedback(G, F), g / (1 + f * g)),
    ):
        assert response(system, omega) == pytest.approx(
            wanted, rel=1e-6, abs=1e-9 * np.abs(wanted).max()
        )


def test_an_improper_inverse_is_refused():
    with pytest.raises(ValueError, match="form must leave the perturbed plant proper"):
        inverse_system(control.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_linear_fractional_transformations(dt):
    """F_l(P, K) = P11 + P12 K (I - P22 K)^-1 P21, and the upper one, frequency by frequency."""
    rng = np.random.default_rng(7)
    parts = [random_plant(rng, 2, dt) for _ in range(4)]
    beside = block_diagonal(parts, dt)
    mix, back = 0.3 * rng.standard_normal((3, 4)), rng.standard_normal((4, 3))
    P = control.StateSpace(beside.A, beside.B @ back, mix @ beside.C, mix @ beside.D @ back, dt)
    K = random_plant(rng, 2, dt)
    for omega in (0.05, 1.0, 12.0):
        s = np.array([np.exp(1j * omega * dt) if dt else 1j * omega])
        p = evaluate_transfer(P.A, P.B, P.C, P.D, s)[0]
        k = evaluate_transfer(K.A, K.B, K.C, K.D, s)[0]
        low = p[:2, :2] + p[:2, 2:] @ k @ np.linalg.inv(np.eye(1) - p[2:, 2:] @ k) @ p[2:, :2]
        high = p[1:, 1:] + p[1:, :1] @ k @ np.linalg.inv(np.eye(1) - p[:1, :1] @ k) @ p[:1, 1:]
        for system, wanted in ((lower_lft(P, K), low), (upper_lft(P, K), high)):
            assert evaluate_transfer(system.A, system.B, system.C, system.D, s)[0] == pytest.approx(
                wanted, rel=1e-7, abs=1e-9
            )


def test_numbers_polynomials_and_roots_become_the_same_system():
    wanted = (2j * OMEGA + 1) / ((1j * OMEGA) ** 2 + 0.2j * OMEGA + 4)
    for system in (control.tf([2, 1], [1, 0.2, 4]), control.ss(control.tf([2, 1], [1, 0.2, 4]))):
        assert response(state_space("G", system), OMEGA) == pytest.approx(wanted, rel=1e-9)
    assert response(state_space("G", 3), OMEGA) == pytest.approx(3.0)


def test_states_of_sizes_beyond_any_integer_are_scaled_in_silence():
    """A plant of a set with a weight far away: scipy casts scales of 1e23 to integers, and
    warns.
    """
    A = np.array([[-1.0, 1e60, 0.0], [1e-60, -2.0, 1.0], [0.0, 1.0, -3.0]])
    scaled, weights = balance_matrix(A)
    np.testing.assert_allclose(scaled * weights[:, None] / weights, A, rtol=1e-12)
    assert np.abs(scaled).max() < 1e3


@pytest.mark.parametrize("direct", [True, False])
def test_zeros_of_several_channels_make_the_matrix_singular(direct):
    """Where the plant loses rank; as many as its determinant has."""
    rng = np.random.default_rng(4)
    A, B, C = rng.standard_normal((4, 4)), rng.standard_normal((4, 2)), rng.standard_normal((2, 4))
    D = rng.standard_normal((2, 2)) if direct else np.zeros((2, 2))
    found = zeros(control.StateSpace(A, B, C, D, 0))
    assert found.size == (4 if direct else 2)
    for z in found:
        sizes = np.linalg.svd(C @ np.linalg.solve(z * np.eye(4) - A, B) + D, compute_uv=False)
        assert sizes[1] < 1e-9 * sizes[0]


@pytest.mark.parametrize("dt", [0, 0.1])
def test_a_matrix_of_transfer_functions_is_one_minimal_system(dt):
    """The unstable mode that its entries share is one mode, and every entry is what it was."""
    pole = 1.2 if dt else 1.0
    numerators = [[[1.0], [2.0]], [[3.0, 1.0], [0.5]]]
    denominators = [[[1, -pole], [1, -pole]], [[1, 0.5 - pole, -0.5 * pole], [1, 0.3]]]
    G = control.tf(numerators, denominators, dt, inputs=["a", "b"], outputs=["c", "d"])
    system = multivariable("P", G)
    assert (system.input_labels, system.output_labels, system.dt) == (["a", "b"], ["c", "d"], dt)
    assert (
        np.sum(np.abs(poles(system) - pole) < 1e-6) == 2
    )  # of rank two: its residue is a full matrix
    points = np.exp(1j * OMEGA[OMEGA < 3]) if dt else 1j * OMEGA
    for s in points:
        np.testing.assert_allclose(system(s), G(s), rtol=1e-7)


def test_a_matrix_that_no_state_space_has_is_refused():
    with pytest.raises(ValueError, match="P must be proper, got degree 2 over degree 1"):
        multivariable("P", control.tf([[[1, 0, 0], [1]]], [[[1, 1], [1, 1]]]))
    hidden = control.tf([[[1, -1], [1]]], [[[1, 1, -2], [1, 3]]])  # (s - 1)/((s - 1)(s + 2))
    with pytest.raises(
        ValueError, match="P must have no hidden unstable mode, got one that cancels at 1"
    ):
        multivariable("P", hidden)
    shared = control.tf([[[1, -1], [1]]], [[[1, 1, -2], [1, -1]]])  # another entry shows it
    assert np.isclose(poles(multivariable("P", shared)), 1).any()
