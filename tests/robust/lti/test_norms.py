"""The H-infinity norm, the frequencies where a gain crosses a level: closed forms, a dense grid."""

import control
import numpy as np
import pytest

from robust.lti.lti import response
from robust.lti.norms import crossings, hinf_norm, stabilising_riccati, to_continuous, to_discrete
from tests.robust.proofs.search.test_bounded_real import random_system, second_order


@pytest.mark.parametrize("zeta", [0.5, 1e-2, 1e-6])
def test_norm_of_a_resonance_in_closed_form(zeta):
    system, norm = second_order(zeta)
    found, where = hinf_norm(system)
    assert found == pytest.approx(norm, rel=1e-9)
    assert where == pytest.approx(np.abs(system.poles()[0]) * np.sqrt(1 - 2 * zeta**2), rel=1e-6)


def test_norm_agrees_with_a_dense_grid():
    rng = np.random.default_rng(3)
    for n in (2, 4, 8):
        system = random_system(rng, n)
        omega = np.unique(
            np.concatenate(
                [
                    np.geomspace(1e-4, 1e4, 4000),
                    *[np.abs(p.imag) * np.linspace(0.99, 1.01, 400) for p in system.poles()],
                ]
            )
        )
        norm, where = hinf_norm(system)
        on_grid = np.abs(response(system, omega[omega > 0])).max()
        assert on_grid <= norm * (1 + 1e-9)
        assert (
            np.abs(response(system, np.array([where])))[0] == pytest.approx(norm, rel=1e-9)
            if np.isfinite(where)
            else 1
        )


def test_crossings_are_where_the_gain_crosses():
    system, _ = second_order(0.1)
    omega, _ = crossings((system.A, system.B, system.C, system.D), 2.0)
    assert np.abs(response(system, omega)) == pytest.approx(2.0, rel=1e-9)
    assert omega.size == 2


def test_the_bilinear_map_keeps_norms_and_comes_back():
    rng = np.random.default_rng(5)
    G = random_system(rng, 6)
    there = to_discrete(G.A, G.B, G.C, G.D)
    for m, again in zip((G.A, G.B, G.C, G.D), to_continuous(*there), strict=True):
        assert again == pytest.approx(m, rel=1e-7, abs=1e-9 * np.abs(m).max(initial=1e-9))
    assert hinf_norm(control.StateSpace(*there, 1.0))[0] == pytest.approx(hinf_norm(G)[0], rel=1e-7)


@pytest.mark.parametrize("quick", [False, True])
@pytest.mark.parametrize("level", [1.1, 1.5, 2.0, 2.9, 3.1, 5.0, 20.0])
def test_a_riccati_equation_without_a_solution_has_none(level, quick):
    """One state, -0.6 x + [0.6 3.3 2.3] w and 0.48 u: b x^2 - 2 a x + q = 0 where its discriminant
    is positive.
    """
    a = -0.6079
    B = np.array([[0.2215, 3.4277, 2.2965, 0.4792]])
    Q = 0.1634
    D = np.array([0.5296, 0.0537, -0.4341])
    S = -0.4042 * np.append(D, 0.0)[None]
    R = np.zeros((4, 4))
    R[:3, :3], R[3, 3] = np.outer(D, D) - level**2 * np.eye(3), 1.0
    inverse = np.linalg.inv(R)
    b, half, q = (
        x.item() for x in (B @ inverse @ B.T, a - B @ inverse @ S.T, Q - S @ inverse @ S.T)
    )
    found = stabilising_riccati(np.array([[a]]), B, Q=np.array([[Q]]), R=R, S=S, quick=quick)
    if half**2 + b * q < 0:
        assert found is None
    else:  # that of the two with a stable closed loop
        assert found.item() == pytest.approx(-q / (half - np.sqrt(half**2 + b * q)), rel=1e-9)


def test_levels_below_the_norm_have_no_solution_and_those_above_have():
    """The same lag with all of its state as output."""
    kinds = []
    for level in (1.1, 2.0, 5.0, 20.0):
        R = np.diag([-(level**2)] * 3 + [1.0])
        B = np.array([[0.2215, 3.4277, 2.2965, 0.4792]])
        found = stabilising_riccati(
            np.array([[-0.6079]]), B, Q=np.array([[0.1634]]), R=R, S=np.zeros((1, 4)), quick=False
        )
        kinds.append(found is not None)
    assert kinds == [False, False, True, True]
