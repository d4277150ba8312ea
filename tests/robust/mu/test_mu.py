"""The structured singular value against published numbers, closed forms, brute force and its own
other side.
"""

import control
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.optimize import linprog, minimize

import robust
from robust.mu.scalings import bound_from_scalings
from tests.support.distillation import BLOCKS, WITH_PERFORMANCE, controller, plant
from tests.support.responses import response_by_channel

SP_8_5 = np.array([[2, 2], [-1, -1]])[:, :, None]


def random_matrix(rng, shape, W):
    return rng.standard_normal((*shape, W)) + 1j * rng.standard_normal((*shape, W))


def along(N, omega):
    return response_by_channel(N, omega)


def size(blocks):
    return sum(b[0] for b in blocks), sum(b[1] for b in blocks)


@pytest.mark.parametrize(
    ("blocks", "mu"),
    [
        ([(2, 2)], np.sqrt(10)),
        ([(1, 1), (1, 1)], 3.0),
        ([(2, 2, "repeated")], 1.0),
        ([(1, 1, "real"), (1, 1, "real")], 3.0),
        ([(2, 2, "real")], 1.0),
    ],
)
def test_sp_example_8_5(blocks, mu):
    """SP Example 8.5: M = [[2, 2], [-1, -1]] has mu 3.162 (full), 3 (diagonal), 1 (scalar)."""
    upper, lower_ = robust.mu.upper(SP_8_5, blocks), robust.mu.lower(SP_8_5, blocks)
    assert upper.value[0] == pytest.approx(mu, rel=1e-6)
    assert lower_.value[0] == pytest.approx(mu, rel=1e-6)


def test_the_distillation_column():
    """SP 8.11.3: NP 0.5, RS 0.53 (0.526 in more digits), RP 5.78 (5.782 at 1.46 rad/s)."""
    N = plant().lft(controller())
    omega = np.unique(np.append(np.geomspace(1e-3, 1e2, 200), 1.46))
    response = along(N, omega)
    rp = robust.mu.upper(response, WITH_PERFORMANCE).value
    rs = robust.mu.upper(response[:2, :2], BLOCKS).value
    np_ = np.linalg.svd(np.moveaxis(response[2:, 2:], 2, 0), compute_uv=False)[:, 0]
    assert np_.max() == pytest.approx(0.5, abs=1e-4)
    assert rs.max() == pytest.approx(0.526, abs=2e-3)
    assert rp.max() == pytest.approx(5.782, abs=5e-4)
    assert omega[rp.argmax()] == pytest.approx(1.46, rel=0.05)
    below = robust.mu.lower(response[:, :, ::20], WITH_PERFORMANCE).value
    assert np.all(below >= 0.999 * rp[::20])


@pytest.mark.parametrize(
    ("held", "refused"), [(6.2, 5.4), pytest.param(5.79, 5.77, marks=pytest.mark.attack)]
)
def test_between_the_frequencies_of_the_distillation_column(held, refused):
    """The peak is 5.78 (SP 8.11.3)."""
    N = plant().lft(controller())
    certificate = robust.mu.certify(N, WITH_PERFORMANCE, held)
    assert certificate.holds
    ends = certificate.intervals
    assert ends[0, 0] == 0
    assert ends[-1, 1] == np.inf
    assert np.array_equal(ends[1:, 0], ends[:-1, 1])
    found = robust.mu.certify(N, WITH_PERFORMANCE, refused)
    assert not found.holds
    assert "at 0.2" in found.reason  # 1.46 rad/s are 0.232 Hz


@pytest.mark.parametrize(
    "blocks", [[(1, 1)] * 3, [(2, 1), (1, 2), (2, 2)], [(2, 2, "repeated"), (1, 1)]]
)
def test_bounds_meet_on_three_complex_blocks(blocks):
    """2 s + f <= 3 (s repeated, f full blocks): mu equals its upper bound (Packard & Doyle
    1993).
    """
    N = random_matrix(np.random.default_rng(1), size(blocks), 40)
    upper, below = robust.mu.upper(N, blocks), robust.mu.lower(N, blocks)
    assert np.all(below.value <= upper.value * (1 + 1e-9))
    assert np.all(below.value >= 0.99 * upper.value)
    for k in range(40):
        delta = below.delta[:, :, k]
        assert abs(np.linalg.det(np.eye(N.shape[0]) - N[:, :, k] @ delta)) < 1e-6
        assert np.linalg.norm(delta, 2) == pytest.approx(1 / below.value[k], rel=1e-9)


def test_delta_has_the_structure():
    blocks = [(2, 2, "real"), (2, 2, "repeated"), (1, 2)]
    N = random_matrix(np.random.default_rng(2), size(blocks), 10)
    bound = robust.mu.lower(N, blocks, n_starts=3)
    assert np.all(bound.value <= robust.mu.upper(N, blocks).value)
    for k in np.flatnonzero(bound.value > 0):
        d = bound.delta[:, :, k]
        assert np.array_equal(d[:2, :2], d[0, 0].real * np.eye(2))
        assert np.array_equal(d[2:4, 2:4], d[2, 2] * np.eye(2))
        assert np.count_nonzero(d) <= 2 + 2 + 2
    assert np.count_nonzero(bound.value) >= 8


def test_the_scaling_shows_the_bound():
    blocks = [(1, 1), (2, 2, "repeated"), (1, 2)]
    N = random_matrix(np.random.default_rng(3), size(blocks), 5)
    bound = robust.mu.upper(N, blocks)
    D_L, D_R, _ = bound.scaling
    for k in range(5):
        scaled = D_L[:, :, k] @ N[:, :, k] @ np.linalg.inv(D_R[:, :, k])
        assert np.linalg.norm(scaled, 2) == pytest.approx(bound.value[k], rel=1e-12)
    # a full block commutes only with a multiple of the identity
    assert np.allclose(D_R[3:, 3:, 0], D_R[3, 3, 0] * np.eye(2))


def test_rank_one_in_closed_form():
    """N = a b^H: mu = sum |a_i| |b_i| over the blocks."""
    rng = np.random.default_rng(4)
    a, b = random_matrix(rng, (5, 1), 1)[:, :, 0], random_matrix(rng, (5, 1), 1)[:, :, 0]
    blocks = [(1, 1), (2, 2), (2, 2)]
    parts = [np.s_[:1], np.s_[1:3], np.s_[3:]]
    mu = sum(np.linalg.norm(a[p]) * np.linalg.norm(b[p]) for p in parts)
    assert robust.mu.upper((a @ b.conj().T)[:, :, None], blocks).value[0] == pytest.approx(
        mu, rel=1e-6
    )


def test_two_real_numbers_by_brute_force():
    """The smallest real (d1, d2) in the largest norm with det(I - N D) = 0, on a line search over
    the square's rays.
    """
    rng = np.random.default_rng(5)
    for _ in range(5):
        N = rng.standard_normal((2, 2))
        # det = 1 - N11 d1 - N22 d2 + det N d1 d2, with one of |d1|, |d2| = r on the square's edge
        t = np.linspace(-1, 1, 4001)
        rays = np.concatenate([[t, np.ones_like(t)], [np.ones_like(t), t]], axis=1)
        c2, c1 = np.linalg.det(N) * rays[0] * rays[1], -(N[0, 0] * rays[0] + N[1, 1] * rays[1])
        roots = np.concatenate([np.roots([p, q, 1.0]) for p, q in zip(c2, c1, strict=True)])
        smallest = np.abs(roots[np.abs(roots.imag) < 1e-12].real).min()
        bound = robust.mu.upper(N[:, :, None], [(1, 1, "real"), (1, 1, "real")]).value[0]
        assert bound >= (1 / smallest) * (1 - 1e-6)
        assert robust.mu.lower(N[:, :, None], [(1, 1, "real")] * 2).value[0] == pytest.approx(
            1 / smallest, rel=1e-3
        )
        assert bound <= 1.15 / smallest


def test_one_real_number_beside_a_full_block_by_a_scan():
    """For each real number in turn the full block is a largest singular value: both bounds meet
    that.
    """
    blocks = [(1, 1, "real"), (2, 2)]
    N = random_matrix(np.random.default_rng(3), (3, 3), 8)
    upper, below = robust.mu.upper(N, blocks).value, robust.mu.lower(N, blocks).value
    t = np.linspace(-3, 3, 60_001)
    for k in range(8):
        M = N[:, :, k]
        closed = M[1:, 1:] + (t / (1 - M[0, 0] * t))[:, None, None] * np.outer(M[1:, 0], M[0, 1:])
        mu = 1 / np.min(np.maximum(np.abs(t), 1 / np.linalg.svd(closed, compute_uv=False)[:, 0]))
        assert below[k] == pytest.approx(mu, rel=1e-3)
        assert upper[k] == pytest.approx(mu, rel=1e-2)
        assert upper[k] >= below[k] * (1 - 1e-9)


@pytest.mark.parametrize("n", [2, 3, 5])
def test_real_numbers_of_rank_one_by_a_linear_program(n):
    """det(I - a b^T D) = 1 - sum a_j b_j d_j: the smallest real d is a linear program."""
    rng = np.random.default_rng(n)
    a, b = random_matrix(rng, (n, 8), 1)[..., 0], random_matrix(rng, (n, 8), 1)[..., 0]
    N = a[:, None] * b[None]
    bound = robust.mu.lower(N, [(1, 1, "real")] * n)
    for k in range(8):
        c = a[:, k] * b[:, k]
        sizes = np.hstack([np.eye(n), -np.ones((n, 1))]), np.hstack([-np.eye(n), -np.ones((n, 1))])
        found = linprog(
            np.eye(n + 1)[-1], A_ub=np.vstack(sizes), b_ub=np.zeros(2 * n),
            A_eq=[[*c.real, 0], [*c.imag, 0]], b_eq=[1, 0], bounds=[(None, None)] * (n + 1),
        )  # fmt: skip
        assert bound.value[k] == pytest.approx(1 / found.fun, rel=1e-6)
        delta = bound.delta[:, :, k]
        assert np.array_equal(delta, np.diag(np.diag(delta).real))
        assert abs(np.linalg.det(np.eye(n) - N[:, :, k] @ delta)) < 1e-6


def smallest_real_numbers(N, rng, n_starts):
    """Least of the largest |x_j| with det(I - N diag(x)) = 0, by a search of another kind:

    SLSQP from many starts.
    """
    n = len(N)

    def closed(x):
        det = np.linalg.det(np.eye(n) - N * x[:n])
        return [det.real, det.imag]

    limits = {"type": "ineq", "fun": lambda x: np.concatenate([x[n] - x[:n], x[n] + x[:n]])}
    sizes = []
    for _ in range(n_starts):
        x = rng.uniform(-1, 1, n) * 10 ** rng.uniform(-1, 0.7)
        found = minimize(
            lambda x: x[n],
            [*x, np.abs(x).max()],
            constraints=[{"type": "eq", "fun": closed}, limits],
            method="SLSQP",
        )
        if found.success and np.hypot(*closed(found.x)) < 1e-6:
            sizes.append(np.abs(found.x[:n]).max())
    return min(sizes)


@pytest.mark.filterwarnings("ignore:Values in x were outside bounds")
def test_four_real_numbers_by_a_search_of_another_kind():
    """Random matrices, and the one of 200 where ascent alone stopped at 0.745 of what the search
    finds.
    """
    N = random_matrix(np.random.default_rng(3), (4, 4), 200)[..., [34, 0, 1, 2, 3, 4]]
    bound = robust.mu.lower(N, [(1, 1, "real")] * 4)
    rng = np.random.default_rng(0)
    searched = np.array([1 / smallest_real_numbers(each, rng, 12) for each in np.moveaxis(N, 2, 0)])
    assert (bound.value > 0.97 * searched).all()
    for k in range(6):
        delta = bound.delta[:, :, k]
        assert np.array_equal(delta, np.diag(np.diag(delta).real))
        assert np.abs(delta).max() == pytest.approx(1 / bound.value[k], rel=1e-9)
        assert abs(np.linalg.det(np.eye(4) - N[:, :, k] @ delta)) < 1e-6


def test_real_beats_complex_where_it_should():
    """A damped oscillator with an uncertain stiffness: as a real number it needs far more than its
    damping.
    """
    zeta, part = 0.01, 0.5
    omega = np.geomspace(0.3, 3, 400)
    N = (-part / (1 - omega**2 + 2j * zeta * omega))[None, None]
    as_real, as_complex = (
        robust.mu.upper(N, [(1, 1, *kind)]).value.max() for kind in (("real",), ())
    )
    assert as_complex == pytest.approx(np.abs(N).max(), rel=1e-9)
    assert as_complex > 20
    # 1 + part delta - omega^2 never vanishes together with the damping: the real bound is zero at
    # every omega > 0
    assert as_real < 1e-3 * as_complex


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 10**6), st.floats(1e-6, 1e6))
def test_properties(seed, scale):
    rng = np.random.default_rng(seed)
    blocks = [
        [(1, 1), (2, 2)],
        [(1, 1)] * 3,
        [(2, 2, "repeated"), (1, 1)],
        [(1, 1, "real"), (2, 2)],
    ][seed % 4]
    N = random_matrix(rng, (3, 3), 2)
    value = robust.mu.upper(N, blocks).value
    matrices = np.moveaxis(N, 2, 0)
    rho = np.abs(np.linalg.eigvals(matrices)).max(axis=1)
    sigma = np.linalg.norm(matrices, 2, axis=(1, 2))
    assert np.all(value <= sigma * (1 + 1e-12))
    if seed % 4 != 3:
        assert np.all(value >= rho * (1 - 1e-9))
    assert robust.mu.upper(scale * N, blocks).value == pytest.approx(
        scale * value, rel=1e-3 if seed % 4 == 3 else 1e-6
    )
    d = np.diag([3.0, 0.2, 0.2 if blocks[-1] == (2, 2) else 5.0])
    if blocks[0] != (2, 2, "repeated"):
        moved = np.moveaxis(d @ matrices @ np.linalg.inv(d), 0, 2)
        assert robust.mu.upper(moved, blocks).value == pytest.approx(
            value, rel=1e-3 if seed % 4 == 3 else 1e-6
        )


def test_zero_and_huge_matrices():
    assert robust.mu.upper(np.zeros((2, 2, 3)), [(1, 1), (1, 1)]).value.tolist() == [0, 0, 0]
    assert robust.mu.lower(np.zeros((2, 2, 3)), [(1, 1), (1, 1)]).value.tolist() == [0, 0, 0]
    N = np.diag([1e150, 1e-150])[:, :, None]
    assert robust.mu.upper(N, [(1, 1), (1, 1)]).value[0] == pytest.approx(1e150, rel=1e-9)
    N = np.array([[0.0, 1e9], [1e-9, 0.0]])[:, :, None]
    assert robust.mu.upper(N, [(1, 1), (1, 1)]).value[0] == pytest.approx(1.0, rel=1e-6)


def test_a_scaling_that_is_no_scaling_proves_nothing():
    N = np.ones((1, 2, 2), complex)
    assert (
        bound_from_scalings(
            N, np.zeros((1, 2, 2)), np.full((1, 2, 2), np.nan), np.zeros((1, 2, 2))
        )[0]
        == np.inf
    )


@pytest.mark.parametrize("dt", [0, 0.1])
def test_certificates_of_random_systems(dt):
    """Just above the peak of the bound they hold, just below it they do not; repeated and real
    blocks included.
    """
    rng = np.random.default_rng(6)
    for blocks in ([(1, 1), (2, 1)], [(2, 2, "repeated"), (1, 1)], [(1, 1, "real"), (2, 2)]):
        n_out, n_in = size(blocks)
        A = rng.standard_normal((4, 4))
        A = (
            A / np.abs(np.linalg.eigvals(A)).max() * 0.9
            if dt
            else A - (np.linalg.eigvals(A).real.max() + 0.1) * np.eye(4)
        )
        N = control.StateSpace(
            A,
            rng.standard_normal((4, n_in)),
            rng.standard_normal((n_out, 4)),
            np.zeros((n_out, n_in)),
            dt,
        )
        x = np.geomspace(1e-3, 1e3, 600)
        points = np.exp(2j * np.arctan(x)) if dt else 1j * x
        peak = robust.mu.upper(N(points, squeeze=False), blocks).value.max()
        above = robust.mu.certify(N, blocks, 1.02 * peak)
        assert above.holds, above.reason
        assert not robust.mu.certify(N, blocks, 0.98 * peak).holds


def test_a_peak_between_grid_points_is_not_missed():
    """A resonance of damping 1e-7: no grid sees it."""
    zeta = 1e-7
    N = control.ss(control.tf([2e-6], [1, 2 * zeta, 1]))
    assert not robust.mu.certify(N, [(1, 1)], 9.0).holds
    assert robust.mu.certify(N, [(1, 1)], 11.0).holds


@pytest.mark.parametrize("A", [0.0, 1e-3])
def test_no_certificate_for_what_is_not_stable(A):
    refused = robust.mu.certify(control.ss([[A]], [[1.0]], [[1.0]], [[0.0]]), [(1, 1)], 1e9)
    assert not refused.holds
    assert "not stable" in refused.reason


@pytest.mark.parametrize("size", [1e-200, 1e200, 1e300])
@pytest.mark.parametrize(
    "blocks", [[(1, 1), (1, 1)], [(1, 1, "real"), (1, 1)], [(2, 2, "repeated")]]
)
def test_numbers_whose_squares_are_none_have_bounds(size, blocks):
    """At 1e200 the upper bound was nan and the lower zero, at 1e-200 no block was seen."""
    bounds, known = robust.mu.bounds(size * SP_8_5, blocks), robust.mu.bounds(SP_8_5, blocks)
    np.testing.assert_allclose(bounds.upper / size, known.upper, rtol=1e-6)
    np.testing.assert_allclose(bounds.lower / size, known.lower, rtol=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: robust.mu.upper(SP_8_5, [(1, 1)]),
            "blocks must add up to the 2 outputs and 2 inputs of N, got 1 rows",
        ),
        (
            lambda: robust.mu.upper(SP_8_5, [(2, 1, "real")]),
            "blocks.0. must be square to be real, got 2 rows and 1",
        ),
        (
            lambda: robust.mu.upper(SP_8_5, [(2, 2, "unreal")]),
            "must be of the kind 'full', 'repeated' or 'real'",
        ),
        (
            lambda: robust.mu.upper(SP_8_5, [(0, 2)]),
            "blocks.0. must be .rows, cols. with whole numbers",
        ),
        (lambda: robust.mu.upper(SP_8_5, "full"), "blocks must be a list"),
        (
            lambda: robust.mu.upper(SP_8_5[:, :, 0], [(2, 2)]),
            "N must be an array .outputs, inputs, frequencies.",
        ),
        (
            lambda: robust.mu.upper(control.ss(-1, 1, 1, 0), [(1, 1)]),
            "got a StateSpace; give its response, N.1j . omega., or use",
        ),
        (lambda: robust.mu.lower(SP_8_5 * np.nan, [(2, 2)]), "N must be finite, got 4 nan"),
        (
            lambda: robust.mu.upper(SP_8_5[:, :, :0], [(2, 2)]),
            "and at least one frequency, got the shape .2, 2, 0.",
        ),
        (
            lambda: robust.mu.certify(control.ss(-1, 1, 1, 0), [(1, 1)], -1.0),
            "level must be positive",
        ),
        (
            lambda: robust.mu.certify(control.ss(-1, 1, 1, 0), [(2, 1)], 1.0),
            "outputs and 1 inputs of N_ss, got 2 rows",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.attack
def test_no_certificate_under_a_perturbation_that_was_found():
    """Light damping and real blocks: the scalings have G in the thousands, and a test too coarse
    would pass them.
    """
    rng = np.random.default_rng(11)
    blocks, seen = [(2, 2, "real"), (1, 1)], 0
    for _ in range(5):
        w, zeta = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-4, -2)
        A = np.array([[-zeta * w, w, 0], [-w, -zeta * w, 0], [0, 0, -1.0]])
        N = control.ss(
            A, rng.standard_normal((3, 3)), rng.standard_normal((3, 3)), rng.standard_normal((3, 3))
        )
        omega = w * (1 + zeta * np.linspace(-3, 3, 61))
        response = along(N, omega)
        k = np.argsort(-robust.mu.upper(response, blocks).value)[:2]
        found = robust.mu.lower(response[:, :, k], blocks, n_starts=2).value.max()
        if found > 0:
            seen += 1
            assert not robust.mu.certify(N, blocks, 0.99 * found).holds
    assert seen >= 3
