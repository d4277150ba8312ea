"""The H-infinity norm, the frequencies where a gain crosses a level: closed forms, a dense grid."""

import numpy as np
import pytest

from robust import certify_norm, check
from robust.lti.norms import stabilising_riccati
from tests.robust.proofs.search.test_bounded_real import second_order
from tests.support.sets import set_around, unstable_poles


@pytest.mark.parametrize("zeta", [0.5, 1e-2, 1e-6])
def test_norm_of_a_resonance_in_closed_form(zeta):
    system, norm = second_order(zeta)
    assert certify_norm(system, norm * (1 + 1e-9)).holds
    below = certify_norm(system, norm * (1 - 1e-9))
    assert below.violated
    peak = np.abs(system.poles()[0]) * np.sqrt(1 - 2 * zeta**2)
    assert below.intervals == pytest.approx(peak, rel=1e-4)


@pytest.mark.parametrize("zeta", [0.1, 1e-4])
@pytest.mark.parametrize("turns", [0, 1])
def test_a_delay_moves_poles_across_the_axis_where_the_gain_is_one(zeta, turns):
    """|9/(9 - w^2 + 6 j zeta w)| is two at two frequencies in closed form. A longer delay brings a
    pair of poles in at the upper one, and takes a pair out at the lower one.
    """
    system, _ = second_order(zeta)
    middle, size = 9 - 18 * zeta**2, np.sqrt((9 - 18 * zeta**2) ** 2 - 81 + 81 / 4)
    for sign, moved in ((1, 2), (-1, -2)):
        omega = np.sqrt(middle + sign * size)
        assert abs(system(1j * omega)) == pytest.approx(2.0, rel=1e-9)
        turned = (np.angle(system(1j * omega)) + np.pi) % (2 * np.pi) + 2 * np.pi * turns
        before, after = (
            unstable_poles(
                check(set_around(system, 1e-9), 0.5, delay=turned / omega * share, certify=False)
            )
            for share in (1 - 1e-7, 1 + 1e-7)
        )
        assert after - before == moved


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
