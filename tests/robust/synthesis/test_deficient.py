"""Channels without effect, outputs that u does not reach, deficient D12 and D21: the answer, and
never a bare error.
"""

import control
import numpy as np
import pytest

from benchmarks.bench_hinf_singular import FAMILIES, faults_of
from robust import hinfsyn, mixsyn
from tests.support.precise_lft import lft_gain

S = control.tf("s")
#: z = (x, u1 + u2), y = x + 0.1 n, and the same with one actuator.
EQUAL = [[1, 0, 1, 1]], [[1], [0], [1]], [[0, 0, 0, 0], [0, 0, 1, 1], [0, 0.1, 0, 0]]
ALONE = [[1, 0, 1]], [[1], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 0.1, 0]]


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("family", FAMILIES)
@pytest.mark.parametrize("seed", range(4))
def test_deficient_plants_have_the_answer_of_their_closed_form(family, seed):
    faults, _ = faults_of(family, [7, seed])
    assert not faults


@pytest.mark.parametrize("a", [1.0, 0.7, 1.3])
def test_two_equal_actuators_do_what_one_does(a):
    both, one = (
        hinfsyn(control.ss([[-a]], *matrices), 1, n) for matrices, n in ((EQUAL, 2), (ALONE, 1))
    )
    assert both.gamma == pytest.approx(one.gamma, rel=1e-6)
    assert both.gamma_min == pytest.approx(one.gamma_min, rel=1e-3)
    assert both.certified
    assert both.K.D.shape == (2, 1)
    np.testing.assert_allclose(both.K.C[0], both.K.C[1])  # they share the work


@pytest.mark.parametrize("a", [1.0, 1.3])
def test_where_nothing_helps_the_controller_is_zero(a):
    unreached = control.ss(
        [[-a, 0], [0, -2 * a]], [[1, 0], [0, 1]], [[1, 0], [1, 1]], np.zeros((2, 2))
    )
    dead = control.ss([[-a]], [[1, 1]], [[1], [0]], np.zeros((2, 2)))
    idle = control.ss([[-a]], [[1, 0]], [[1], [1]], np.zeros((2, 2)))
    for P in (unreached, dead, idle):
        found = hinfsyn(P, 1, 1)
        assert (found.K.nstates, found.K.D.item()) == (0, 0.0)
        assert found.gamma == pytest.approx(1 / a, rel=1e-6)
        assert found.gamma_min == pytest.approx(1 / a, rel=1e-6)
        assert found.certified
        assert found.reason == ""


def with_efforts(*units):
    """x' = x + w + sum u, each actuator in a unit and with an effort of its own."""
    n, efforts = len(units), np.diag(units)
    B, C = np.hstack([[[1.0, 0.0]], [units]]), np.vstack([[1.0], *[[0.0]] * n, [1.0]])
    D = np.block(
        [[np.zeros((1, 2 + n))], [np.zeros((n, 2)), efforts], [np.array([[0, 0.1] + [0] * n])]]
    )
    return hinfsyn(control.ss([[1.0]], B, C, D), 1, n)


def test_other_units_are_no_missing_effect():
    """Two actuators in units 1e6 apart share the work, and one alone needs more of it."""
    one, both, other = with_efforts(1.0), with_efforts(1.0, 1.0), with_efforts(1e3, 1e-3)
    assert other.gamma_min == pytest.approx(both.gamma_min, rel=1e-3)
    assert other.gamma_min < 0.9 * one.gamma_min
    assert other.certified


def test_an_unstable_mode_that_a_dead_actuator_leaves_is_named():
    P = control.ss([[1.0]], [[1, 0]], [[1], [1]], np.zeros((2, 2)))
    with pytest.raises(
        ValueError,
        match=(
            "P must be stabilisable through u and y, got a plant where u does not reach the mode at"
            " s = 1"
        ),
    ):
        hinfsyn(P, 1, 1)


def terrain_following(measured):
    """COMPleib TF1 to TF3, by what is measured (Gershon, Shaked & Yaesh): from (w, u) to (z, y)."""
    A = np.zeros((7, 7))
    A[[0, 1, 2, 4, 4], [0, 0, 1, 3, 4]] = -1, 1, 1, 1, -1
    A[5, [0, 1, 4, 5]] = -0.088, 0.0345, 1, -0.0032
    A[6, [2, 6]] = 0.05, -1e-5
    B, C = np.zeros((7, 3)), np.zeros((4 + len(measured), 7))
    B[6, 0], B[0, 1], B[3, 2] = -0.05, 1, 0.09
    C[0, 6], C[1, 5] = 1, 2.23
    C[np.arange(4, len(C)), measured] = 1
    D = np.zeros((len(C), 3))
    D[2, 1], D[3, 2], D[4, 0] = np.sqrt(3), np.sqrt(0.3), 0.04
    return control.StateSpace(A, B, C, D, 0), len(measured), 2


@pytest.mark.parametrize(
    ("measured", "known"),
    [([2, 1, 6, 5], 0.249), ([2, 1, 3], 5200.0), ([2, 3, 6], 0.249)],
    ids=["TF1", "TF2", "TF3"],
)
def test_terrain_following(measured, known):
    """Three integrators in a chain, and a lag of a day: inf and 5.5e6 came out of TF1 and TF2."""
    P, n_y, n_u = terrain_following(measured)
    found = hinfsyn(P, n_y, n_u)
    assert found.certified
    assert found.gamma <= 1.04 * known
    assert 0.96 * known <= found.gamma_min <= found.gamma
    assert max(lft_gain(P, found.K, w) for w in (1e-9, 1e-6, 1e-3, 0.1, 0.3)) <= found.gamma


def test_a_weight_with_zeros_in_the_right_half_plane_is_bounded_by_its_value_at_infinity():
    """L is strictly proper: S(inf) = 1. The bound is there before any controller."""
    W = (2 * S**2 - 2.2 * S + 1) / (3 * S**2 + 0.2 * S + 0.01)
    for G in ((S + 1) / (S**2 + 0.5 * S + 4), 1 / (S**2 + 0.2 * S + 1)):
        found = mixsyn(G, W)
        assert found.gamma_min == pytest.approx(2 / 3, rel=1e-9)
        assert 2 / 3 < found.gamma < 1.03 * 2 / 3
        assert found.reason == ""


def test_a_problem_without_a_bound_says_so():
    """Two lags from w and u to z, y = u's: no controller is best, as any level is reached."""
    # -1/(s + 1) from w, -1/((s + 2)(s + 10)) from u
    B = [[1.0, 0], [0, 1], [0, 0]]
    C = [[-1.0, 0, -1]] * 2
    P = control.ss([[-1.0, 0, 0], [0, -12, -20], [0, 1, 0]], B, C, np.zeros((2, 2)))
    found = hinfsyn(P, 1, 1)
    assert found.gamma < 1e-2
    assert found.gamma_min == 0
    assert found.reason.endswith("was reached, no lower bound was found")


def test_a_loop_that_is_zero_is_certified():
    design = mixsyn(control.ss(1 / (S + 1)), control.ss([], [], [], [[0.0]]))
    assert (design.gamma, design.certified, design.reason) == (0.0, True, "")
    assert design.certificate.verify().verified
    chain = control.ss(
        [[-1, 0], [0, -2]], [[1, 0], [0, 1]], [[0, 1], [1, 0]], np.zeros((2, 2))
    )  # w reaches y alone
    found = hinfsyn(chain, 1, 1)
    assert (found.gamma, found.certified) == (0.0, True)


@pytest.mark.attack
def test_the_answer_depends_on_steps_and_not_on_time(monkeypatch):
    P, n_y, n_u = terrain_following([2, 3, 6])
    first = hinfsyn(P, n_y, n_u)
    monkeypatch.setattr("time.monotonic", lambda: 1e12)
    monkeypatch.setattr("time.thread_time", lambda: 1e12)
    again = hinfsyn(P, n_y, n_u)
    assert (again.gamma, again.n_steps) == (first.gamma, first.n_steps)
    few = hinfsyn(P, n_y, n_u, n_steps=20)
    assert few.n_steps <= first.n_steps
    assert few.gamma >= first.gamma * (1 - 1e-9)


def test_controllers_of_compressed_plants_close_the_loop_that_was_given():
    """With a path from u to y, sampled: K is put back over every step of the way."""
    rng = np.random.default_rng(5)
    A, mix = 0.5 * rng.standard_normal((3, 3)), np.array([[1.0, 2.0, -1.0]])
    B1, b, c = rng.standard_normal((3, 2)), rng.standard_normal((3, 1)), rng.standard_normal((1, 3))
    D = np.block(
        [[np.zeros((1, 2)), np.zeros((1, 3))], [np.zeros((1, 2)), 0.3 * mix], [0.1, 0.2, 0.4 * mix]]
    )
    P = control.StateSpace(A, np.hstack([B1, b @ mix]), np.vstack([c, np.zeros((1, 3)), c]), D, 0.1)
    found = hinfsyn(P, 1, 3)
    closed = P.lft(found.K)
    assert np.abs(closed.poles()).max() < 1
    theta = np.linspace(0, np.pi, 400)
    gains = [np.linalg.norm(closed(np.exp(1j * t)), 2) for t in theta]
    assert max(gains) == pytest.approx(found.gamma, rel=1e-2)


def test_what_rounding_leaves_of_a_rotation_couples_nothing():
    """One state: an entry of 4e-16 in place of a zero was balanced by, and the solution of the
    Riccati equation came out as anything from 0.8 to 2.3 times the right one.
    """
    faults, _ = faults_of("deficient", [5, 18])
    assert not faults
