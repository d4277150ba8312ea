"""The worst gain over a set against the same program in cvxpy, skewed mu and perturbations that
were drawn.
"""

import cvxpy
import numpy as np
import pytest

import robust
from tests.robust.mu.test_mu import random_matrix, size

FAMILIES = [
    [(2, 2)],
    [(1, 1)] * 3,
    [(2, 2, "repeated"), (1, 2)],
    [(1, 1, "real"), (1, 1)],
    [(2, 2, "real"), (1, 1, "real"), (2, 1)],
]


def stable_family(blocks, W, seed=0):
    """Random matrices with two channels of performance, the loop of the blocks at 0.3 to 0.9 of its
    largest gain.
    """
    rng = np.random.default_rng(seed)
    rows, cols = size(blocks)
    N = random_matrix(rng, (rows + 2, cols + 2), W)
    return N / robust.mu.upper(N[:rows, :cols], blocks).value * rng.uniform(0.3, 0.9, W)


def places(blocks):
    """Rows and columns of M that each block closes, and its kind."""
    row = col = 0
    for n_rows, n_cols, *kind in blocks:
        yield slice(row, row + n_rows), slice(col, col + n_cols), kind[0] if kind else "full"
        row, col = row + n_rows, col + n_cols


def hermitian(n):
    """A basis of the Hermitian matrices of size n."""
    for i, j in np.ndindex(n, n):
        X = np.zeros((n, n), complex)
        X[i, j] = 1 if i <= j else 1j
        yield (X + X.conj().T) / (2 if i == j else 1)


def commuting(blocks):
    """(X_L, X_R) that commute with every perturbation, and the skew ones of its real parameters."""
    (rows, cols), scalings, skews = size(blocks), [], []
    for row, col, kind in places(blocks):
        n, m = row.stop - row.start, col.stop - col.start
        for X in [np.eye(n)] if kind == "full" else hermitian(n):
            L, R = np.zeros((rows, rows), complex), np.zeros((cols, cols), complex)
            L[row, row], R[col, col] = X, np.eye(m) if kind == "full" else X
            scalings.append((L, R))
            if kind == "real":
                G = np.zeros((cols, rows), complex)
                G[col, row] = X
                skews.append(G)
    return scalings, skews


def gain_by_cvxpy(M, blocks):
    """min gamma, N^H diag(X_L, I) N + j (G N - N^H G^H) <= diag(X_R, gamma I), with complex
    variables of its own.
    """
    (rows, cols), n = size(blocks), M.shape[1]
    scalings, skews = commuting(blocks)
    x, g, gamma = (
        cvxpy.Variable(len(scalings)),
        cvxpy.Variable(max(len(skews), 1)),
        cvxpy.Variable(),
    )
    E, F = np.eye(n)[:, :cols], np.eye(n)[:, cols:]
    slack = gamma * (F @ F.T) - M[rows:].conj().T @ M[rows:]
    for k, (L, R) in enumerate(scalings):
        slack = slack + x[k] * (E @ R @ E.T - M[:rows].conj().T @ L @ M[:rows])
    for k, S in enumerate(skews):
        skew = 1j * E @ S @ M[:rows]
        slack = slack - g[k] * (skew + skew.conj().T)
    X_L = sum(x[k] * L for k, (L, _) in enumerate(scalings))
    positive = [
        cvxpy.bmat([[cvxpy.real(A), -cvxpy.imag(A)], [cvxpy.imag(A), cvxpy.real(A)]])
        for A in (slack, X_L)
    ]
    problem = cvxpy.Problem(cvxpy.Minimize(gamma), [(A + A.T) / 2 >> 0 for A in positive])
    problem.solve(solver="CLARABEL")
    return np.sqrt(gamma.value)


@pytest.mark.parametrize("blocks", FAMILIES, ids=str)
@pytest.mark.filterwarnings("ignore:Solution may be inaccurate")  # the last digits
def test_the_program_of_cvxpy_has_the_same_value(blocks):
    N = stable_family(blocks, 3)
    assert robust.mu.worst_gain(N, blocks).upper == pytest.approx(
        [gain_by_cvxpy(N[:, :, k], blocks) for k in range(3)], rel=1e-5
    )


@pytest.mark.parametrize("blocks", FAMILIES, ids=str)
def test_skewed_mu_is_one_where_the_outputs_are_divided_by_the_gain(blocks):
    """`robust.mu.upper` finds no smaller one; with real blocks it may find less than the program
    does.
    """
    N = stable_family(blocks, 15, seed=1)
    gain, rows = robust.mu.worst_gain(N, blocks).upper, size(blocks)[0]
    N[rows:] /= gain
    mu = robust.mu.upper(N, [*blocks, (2, 2)]).value
    assert np.all(mu >= 1 - 1e-5)
    assert "real" in str(blocks) or mu == pytest.approx(1.0, rel=1e-6)


@pytest.mark.parametrize("blocks", FAMILIES, ids=str)
def test_the_worst_case_lies_in_the_set_and_has_its_gain(blocks):
    N = stable_family(blocks, 12, seed=2)
    found, (rows, cols) = robust.mu.worst_gain(N, blocks), size(blocks)
    of_structure = np.zeros((cols, rows))
    for k in range(12):
        M, delta = N[:, :, k], found.delta[:, :, k]
        loop = np.linalg.solve(np.eye(rows) - M[:rows, :cols] @ delta, M[:rows, cols:])
        gain = np.linalg.norm(M[rows:, cols:] + M[rows:, :cols] @ delta @ loop, 2)
        assert gain == pytest.approx(found.lower[k], rel=1e-9)
        assert np.linalg.norm(delta, 2) <= 1 + 1e-12
        for row, col, kind in places(blocks):
            of_structure[col, row] = 1
            if kind != "full":
                assert np.array_equal(
                    delta[col, row], delta[col, row][0, 0] * np.eye(row.stop - row.start)
                )
            assert kind != "real" or not delta[col, row].imag.any()
        assert not delta[of_structure == 0].any()
    assert np.median(found.lower / found.upper) > 0.99


def test_no_perturbation_that_is_drawn_has_a_larger_gain_than_the_worst_case():
    """One real number beside a complex one: a scan of the real one, the complex one at any
    phase.
    """
    N = stable_family([(1, 1, "real"), (1, 1)], 6, seed=3)
    found = robust.mu.worst_gain(N, [(1, 1, "real"), (1, 1)])
    t, phase = (
        each.ravel()
        for each in np.meshgrid(np.linspace(-1, 1, 81), np.exp(2j * np.pi * np.arange(90) / 90))
    )
    delta = np.zeros((t.size, 2, 2), complex)
    delta[:, 0, 0], delta[:, 1, 1] = t, phase
    for k in range(6):
        M = N[:, :, k]
        loop = np.linalg.solve(
            np.eye(2) - M[:2, :2] @ delta, np.broadcast_to(M[:2, 2:], (t.size, 2, 2))
        )
        drawn = np.linalg.norm(M[2:, 2:] + M[2:, :2] @ delta @ loop, 2, axis=(1, 2)).max()
        assert 0.98 * found.lower[k] <= drawn <= found.lower[k] * (1 + 1e-5)


def test_where_the_set_makes_the_loop_singular_the_gain_has_no_bound():
    N = np.array([[2.0, 1.0], [1.0, 1.0]])
    found = robust.mu.worst_gain(N, [(1, 1)])
    assert (found.lower[0], found.upper[0]) == (np.inf, np.inf)
    assert found.delta[0, 0, 0] == pytest.approx(0.5)
