"""Loop shaping against published numbers and its own guarantees."""

import control
import numpy as np
import pytest
from scipy.linalg import solve_continuous_are, solve_continuous_lyapunov, sqrtm

import robust
from robust import ncfsyn, sampled
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))


def four_block(G, K, omega):
    """Largest singular value of [K; 1] (1 + G K)^-1 [1 G], which has rank one."""
    g, k = response(control.ss(G), omega), response(K, omega)
    return np.sqrt((1 + np.abs(g) ** 2) * (1 + np.abs(k) ** 2)) / np.abs(1 + g * k)


def test_sp_example_9_3():
    """SP 2nd ed., Example 9.3: gamma_min = 2.34 with W1 = (s + 2)/s."""
    W1 = control.tf([1, 2], [1, 0])
    design = ncfsyn(BOOK, W1)
    assert design.gamma_min == pytest.approx(2.339, abs=5e-4)
    assert design.gamma_min <= design.gamma <= 1.1 * design.gamma_min
    closed = control.feedback(control.ss(BOOK) * design.K, 1)
    assert np.all(closed.poles().real < 0)


def test_gamma_is_the_norm_of_the_four_block_loop():
    W1 = control.tf([1, 2], [1, 0])
    design = ncfsyn(BOOK, W1)
    omega = np.geomspace(1e-3, 1e4, 4000)
    g = response(control.ss(BOOK), omega) * response(control.ss(W1), omega)
    k = response(design.K, omega) / response(control.ss(W1), omega)
    norm = np.max(np.sqrt((1 + np.abs(g) ** 2) * (1 + np.abs(k) ** 2)) / np.abs(1 + g * k))
    assert norm == pytest.approx(design.gamma, rel=1e-4)


def test_a_mode_that_nearly_cancels_is_named():
    """(s - 1 - 1e-5)/((s - 1)(s + 1)): gamma came out infinite, and no reason with it."""
    design = ncfsyn(control.tf([1, -1 - 1e-5], np.polymul([1, -1], [1, 1])))
    assert np.isinf(design.gamma)
    assert not design.met
    assert design.reason.startswith("K does not stabilise the shaped plant: gamma_min is")
    assert "Its mode at s = 1 nearly cancels with a zero" in design.reason
    assert ncfsyn(control.tf([1, -2], np.polymul([1, -1], [1, 1]))).met


def test_the_smallest_norm_is_approached_and_not_passed():
    W1 = control.tf([1, 2], [1, 0])
    for factor in (1.01, 1.05, 1.5):
        design = ncfsyn(BOOK, W1, factor=factor)
        assert design.gamma_min < design.gamma <= factor * design.gamma_min * (1 + 1e-6)


def test_unstable_plant_is_stabilised():
    G = control.tf([1], [1, -1])
    design = ncfsyn(G, 4.0)
    assert np.all(control.feedback(control.ss(G) * design.K, 1).poles().real < 0)
    # closed form: for g/(s - 1) X and Z are scalar roots, gamma_min^2 = 1 + X Z
    g = 4.0
    X = (1 + np.sqrt(1 + g**2)) / 1.0
    assert design.gamma_min == pytest.approx(np.sqrt(1 + X * X / g**2), rel=1e-9)


def test_discrete_design_is_stable_and_tends_to_the_continuous_one():
    W1 = control.tf([1, 2], [1, 0])
    continuous = ncfsyn(BOOK, W1)
    for T in (0.01, 0.001):
        G = sampled(control.ss(BOOK), T)
        discrete = ncfsyn(G, control.sample_system(control.ss(W1), T, method="bilinear"))
        assert discrete.K.dt == T
        assert np.isfinite(discrete.gamma)
    assert discrete.gamma_min == pytest.approx(continuous.gamma_min, rel=0.02)


def test_direct_term():
    G = control.tf([0.5, 2], [1, 1])
    design = ncfsyn(G)
    omega = np.geomspace(1e-3, 1e4, 2000)
    assert four_block(G, design.K, omega).max() == pytest.approx(design.gamma, rel=1e-4)


def matrix_plant(rng, n, n_y, n_u, dt=0.0):
    A = rng.standard_normal((n, n)) - 0.5 * np.eye(n)
    D = 0.3 * rng.standard_normal((n_y, n_u))
    G = control.StateSpace(A, rng.standard_normal((n, n_u)), rng.standard_normal((n_y, n)), D, 0)
    return sampled(G, dt) if dt else G


def normalised_factors(G):
    """A, B, C, D of [N; M], of the bilinear image of a sampled plant (Zhou, Doyle & Glover 1996,
    theorem 13.37).
    """
    A, B, C, D = G.A, G.B, G.C, G.D
    if G.dt:
        back = np.linalg.inv(np.eye(len(A)) + A)
        A, B, C, D = back @ (A - np.eye(len(A))), back @ B, 2 * C @ back, D - C @ back @ B
    R = np.eye(D.shape[1]) + D.T @ D
    X = solve_continuous_are(A, B, C.T @ C, R, s=C.T @ D)
    F, half = -np.linalg.solve(R, D.T @ C + B.T @ X), np.linalg.inv(sqrtm(R).real)
    return A + B @ F, B @ half, np.vstack([C + D @ F, F]), np.vstack([D, np.eye(len(R))]) @ half


@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("shape", [(2, 2), (3, 2), (1, 3)])
def test_least_gamma_of_matrices_from_the_hankel_norm_of_their_factors(shape, dt):
    """gamma_min = (1 - |[N M]|_H^2)^-1/2 (Glover & McFarlane 1989): no Riccati solution of the
    design in it.
    """
    G = matrix_plant(np.random.default_rng(sum(shape)), 4, *shape, dt)
    A, B, C, D = normalised_factors(G)
    factors = control.ss(A, B, C, D)(2j)
    np.testing.assert_allclose(factors.conj().T @ factors, np.eye(shape[1]), atol=1e-9)
    P, Q = (solve_continuous_lyapunov(F, -X) for F, X in ((A, B @ B.T), (A.T, C.T @ C)))
    hankel = np.sqrt(np.linalg.eigvals(P @ Q).real.max())
    design = ncfsyn(G)
    assert design.gamma_min == pytest.approx(1 / np.sqrt(1 - hankel**2), rel=1e-7)
    assert design.gamma_min <= design.gamma <= 1.1 * design.gamma_min
    assert design.gamma == pytest.approx(1 / robust.margins.ncf_margin(G, design.K), rel=1e-6)


def test_beside_one_another_the_worst_channel_counts():
    """Of a diagonal plant gamma_min is the largest of the channels', and shaping functions may come
    in matrices.
    """
    single = [control.ss(control.tf([k], [1, a])) for k, a in ((1, 1), (4, -0.5), (2, 3))]
    W = [control.tf([1, 2], [1, 0]), control.tf([2], [1]), control.tf([1, 5], [1, 0])]
    wanted = max(ncfsyn(G, w).gamma_min for G, w in zip(single, W, strict=True))
    design = ncfsyn(control.append(*single), control.append(*map(control.ss, W)))
    assert design.gamma_min == pytest.approx(wanted, rel=1e-8)
    same = ncfsyn(control.append(*single), W[0], 0.5)
    written = ncfsyn(
        control.append(*single), control.append(*[control.ss(W[0])] * 3), 0.5 * np.eye(3)
    )
    assert same.gamma_min == pytest.approx(written.gamma_min, rel=1e-9)
    assert np.all(
        control.feedback(control.append(*single) * design.K, np.eye(3)).poles().real < 1e-9
    )


def test_exchanged_and_turned_channels():
    """gamma_min does not see a permutation or a rotation, and the controller turns along."""
    rng = np.random.default_rng(9)
    G = matrix_plant(rng, 4, 3, 2)
    Q_y, Q_u = np.linalg.qr(rng.standard_normal((3, 3)))[0], np.eye(2)[::-1]
    turned = control.StateSpace(G.A, G.B @ Q_u, Q_y @ G.C, Q_y @ G.D @ Q_u, 0)
    one, two = ncfsyn(G), ncfsyn(turned)
    assert two.gamma_min == pytest.approx(one.gamma_min, rel=1e-9)
    np.testing.assert_allclose(Q_u @ two.K(1j) @ Q_y, one.K(1j), rtol=1e-6, atol=1e-9)


def test_a_gain_matrix():
    """Without dynamics the best is reached: 1 for any gain, by K = G'."""
    G = np.array([[2.0, 1.0], [0.0, 3.0]])
    design = ncfsyn(G)
    assert design.gamma_min == 1.0
    assert design.gamma == pytest.approx(1.0)
    np.testing.assert_allclose(design.K.D, G.T)


@pytest.mark.parametrize("omega_c", [0.5, 20.0])
@pytest.mark.parametrize("T", [0.0, 0.01])
def test_crossover_weight_puts_the_crossover(omega_c, T):
    G = control.ss(control.tf([5], [1, 10]))
    G = sampled(G, T) if T else G
    W1 = robust.shaping.crossover_weight(G, omega_c)
    assert np.abs(response(G, np.array([omega_c])) * response(W1, np.array([omega_c])))[
        0
    ] == pytest.approx(1)
    assert np.abs(response(W1, np.array([1e-6])))[0] > 1e3


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: ncfsyn(BOOK, factor=1.0), "factor must be above 1"),
        (lambda: ncfsyn(BOOK, control.tf([1], [1, 1], 0.1)), "W1 must have the sampling time of G"),
        (lambda: ncfsyn(control.tf([1, 0, 0], [1, 1])), "G must be proper"),
        (lambda: ncfsyn(np.ones((2, 3)), np.eye(2)), "W1 must have 3 outputs, one a channel of G"),
        (
            lambda: ncfsyn(np.ones((2, 3)), W2=np.eye(3)),
            "W2 must have 2 inputs, one a channel of G",
        ),
        (
            lambda: ncfsyn(np.eye(2), control.tf([1], [1, 1], 0.1)),
            "W1 must have the sampling time of G",
        ),
        (
            lambda: ncfsyn(control.tf([1], [1, 0]), control.tf([1, 0], [1, 1])),
            "W2 G W1 must be stabilisable",
        ),
        (lambda: robust.shaping.crossover_weight(BOOK, -1.0), "omega_c must be positive"),
        (
            lambda: robust.shaping.crossover_weight(sampled(control.ss(BOOK), 0.1), 30.0),
            "half the Nyquist frequency",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
