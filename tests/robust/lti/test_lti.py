"""Response, zeros, connections, realisation, through the sets that hold a system: against polynomials
and formulas.
"""

import warnings

import control
import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import robust
from robust.lti.lti import zeros
from tests.support.forms import PERTURBED
from tests.support.sets import from_roots, realised, set_around

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
        found = set_around(G).at(np.array([omega] * 6))
        assert found == pytest.approx(wanted[0, 0], rel=1e-9)


def test_response_over_many_decades():
    """From roots, without ever forming a polynomial: prod (s - z)/prod (s - p), term by term."""
    z, p = -np.geomspace(1e-3, 1e3, 9), -np.geomspace(3e-4, 3e3, 10)
    s = 1j * np.geomspace(1e-5, 1e5, 50)
    wanted = np.prod(s[:, None] - z, axis=1) / np.prod(s[:, None] - p, axis=1)
    G = from_roots(z, p, 1.0)
    assert set_around(G).at(s.imag) == pytest.approx(wanted, rel=1e-6)


def test_poles_and_zeros():
    z, p = np.array([-1 + 2j, -1 - 2j, 3.0]), np.array([-4.0, -0.1 + 5j, -0.1 - 5j, -7.0])
    G = from_roots(z, p, 2.5)
    assert np.sort_complex(np.linalg.eigvals(G.A)) == pytest.approx(np.sort_complex(p), rel=1e-9)
    found = zeros(G)
    assert found.size == z.size
    assert np.abs(found[:, None] - z).min(axis=0) == pytest.approx(0, abs=1e-8)


def points(omega, dt):
    return np.exp(1j * omega * dt) if dt else 1j * omega


@given(
    seed=st.integers(0, 2**20),
    dt=st.sampled_from([0.0, 0.1]),
    form=st.sampled_from([form for form in PERTURBED if form != "coprime"]),
)
def test_connections_are_what_their_formulas_say(seed, dt, form):
    """Plants of a set: products, sums, inverses and loops of three systems."""
    rng = np.random.default_rng(seed)
    G, w, Delta = (random_plant(rng, n, dt) for n in (3, 2, 2))
    s = points(OMEGA[OMEGA * dt < np.pi], dt)
    plant = set_around(G, w, form).perturbed(Delta)
    wanted = PERTURBED[form](G(s), w(s), Delta(s))
    assert plant(s) == pytest.approx(wanted, rel=1e-6, abs=1e-9 * np.abs(wanted).max())


def test_an_improper_inverse_is_refused():
    lag = control.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    with pytest.raises(ValueError, match="form must leave the perturbed plant proper"):
        set_around(lag, form="inverse-multiplicative").perturbed(-1.0)


def random_matrix(rng, n, n_y, n_u, dt):
    parts = control.append(*(random_plant(rng, n, dt) for _ in range(2)))
    mix, back = 0.3 * rng.standard_normal((n_y, 2)), rng.standard_normal((2, n_u))
    return control.StateSpace(parts.A, parts.B @ back, mix @ parts.C, mix @ parts.D @ back, dt)


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_linear_fractional_transformations(dt):
    """The upper one makes a plant of a set, the lower one its loop; all parts have direct terms."""
    rng = np.random.default_rng(7)
    G, W_l, W_r, Delta, K, w_P = (random_matrix(rng, 2, 2, 2, dt) for _ in range(6))
    model = robust.UncertaintyModel(
        G, form="inverse-output", left=(W_l,), right=(W_r,), omega=np.array([0.05, 1.0, 12.0])
    )
    plant, N, one = model.perturbed(Delta), model.loop(K, w_P=w_P).N, np.eye(2)
    bare = model.loop(K).N
    for s in points(model.omega, dt):
        g, k, left, right = G(s), K(s), W_l(s), W_r(s)
        perturbed = np.linalg.inv(one + left @ Delta(s) @ right) @ g
        np.testing.assert_allclose(plant(s), perturbed, rtol=1e-7, atol=1e-9)
        S = np.linalg.inv(one + g @ k)
        loop = np.block([[-right @ S @ left, right @ g @ k @ S], [w_P(s) @ S @ left, w_P(s) @ S]])
        np.testing.assert_allclose(N(s), loop, rtol=1e-7, atol=1e-9)
        np.testing.assert_allclose(bare(s), loop[:2, :2], rtol=1e-7, atol=1e-9)


def test_numbers_polynomials_and_roots_become_the_same_system():
    wanted = (2j * OMEGA + 1) / ((1j * OMEGA) ** 2 + 0.2j * OMEGA + 4)
    for system in (control.tf([2, 1], [1, 0.2, 4]), control.ss(control.tf([2, 1], [1, 0.2, 4]))):
        assert set_around(system).at(OMEGA) == pytest.approx(wanted, rel=1e-9)
    assert set_around(3).at(OMEGA) == pytest.approx(3.0)


def test_states_of_sizes_beyond_any_integer_are_scaled_in_silence():
    """A plant of a set with a weight far away: scipy casts scales of 1e23 to integers, and
    warns.
    """
    T = np.diag([1e60, 1.0, 1.0])
    A = np.array([[-1.0, 1.0, 0.0], [1.0, -2.0, 1.0], [0.0, 1.0, -3.0]])
    b, c = np.ones((3, 1)), np.array([[0.0, 1.0, 1.0]])
    s = 1j * OMEGA
    wanted = [(c @ np.linalg.solve(x * np.eye(3) - A, b)).item() for x in s]
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        model = set_around(
            control.StateSpace(T @ A @ np.linalg.inv(T), T @ b, c @ np.linalg.inv(T), [[0.0]], 0)
        )
        assert model.at(OMEGA) == pytest.approx(np.array(wanted), rel=1e-12)


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
    system = realised(G)
    assert (system.input_labels, system.output_labels, system.dt) == (["a", "b"], ["c", "d"], dt)
    assert (
        np.sum(np.abs(system.poles() - pole) < 1e-6) == 2
    )  # of rank two: its residue is a full matrix
    points = np.exp(1j * OMEGA[OMEGA < 3]) if dt else 1j * OMEGA
    for s in points:
        np.testing.assert_allclose(system(s), G(s), rtol=1e-7)


def test_a_matrix_that_no_state_space_has_is_refused():
    with pytest.raises(ValueError, match="nominal must be proper, got degree 2 over degree 1"):
        realised(control.tf([[[1, 0, 0], [1]]], [[[1, 1], [1, 1]]]))
    hidden = control.tf([[[1, -1], [1]]], [[[1, 1, -2], [1, 3]]])  # (s - 1)/((s - 1)(s + 2))
    with pytest.raises(
        ValueError, match="nominal must have no hidden unstable mode, got one that cancels at 1"
    ):
        realised(hidden)
    shared = control.tf([[[1, -1], [1]]], [[[1, 1, -2], [1, -1]]])  # another entry shows it
    assert np.isclose(realised(shared).poles(), 1).any()
