"""Stiff plants: no lower bound lies above what a controller reaches, and a heavier weight on u
costs no less.
"""

import control
import numpy as np
import pytest

from benchmarks.bounds_mu import compare_lags
from robust import hinfsyn, mixsyn, performance_weight
from robust.proofs.exact.synthesis_levels import level_fails
from tests.robust.synthesis.test_hinfsyn import BOOK, mixed_sensitivity
from tests.support.exact_claims import matrices


@pytest.mark.parametrize(
    ("G", "omega_B", "w_u"),
    [
        (control.tf([1e-5], np.polymul([1, 1e-8], [1e-4, 1])), 1.0, 3e3),
        (control.tf([2], np.polymul([1e7, 1], [1e-3, 1])), 1e-4, 300.0),
        (control.tf([1], [1, 1]), 1.0, 0.5),
    ],
)
def test_the_bound_lies_between_that_of_single_frequencies_and_what_is_reached(G, omega_B, w_u):
    w_P, s = performance_weight(omega_B, M_S=2, A=1e-2), 1j * np.logspace(-12, 7, 4000)
    p = np.abs(w_P(s))
    point = (
        p * w_u / np.sqrt(w_u**2 + (p * np.abs(G(s))) ** 2)
    ).max()  # the least of any |S| with its |K S| there
    design = mixsyn(G, w_P, w_u)
    assert 0.98 * point <= design.gamma_min <= design.gamma
    assert design.gamma <= 1.03 * design.gamma_min
    assert design.gamma_min <= 100  # of K = 0


@pytest.mark.parametrize(
    "seed", [4, *(pytest.param(k, marks=pytest.mark.attack) for k in (2, *range(5, 40)))]
)
def test_no_controller_of_another_kind_reaches_less(seed):
    found = compare_lags(seed)
    assert found["gamma_min"] > 1 - 1e-6
    assert found["gamma"] < 1.03
    assert found["heavier w_u"] > 1


def test_many_digits_agree_with_doubles_on_a_plant_that_is_not_stiff():
    P = mixed_sensitivity(BOOK, control.ss(control.tf([1 / 1.5, 10], [1, 1e-3])))
    low = hinfsyn(P, 1, 1).gamma_min
    one = np.eye(1)
    assert [
        level_fails(matrices(P), one, one, share * low) for share in (0.5, 0.999, 1.001, 2)
    ] == [
        True,
        True,
        False,
        False,
    ]


def test_channels_without_an_effect_of_their_own_decide_nothing():
    P = control.ss(-np.eye(1), np.ones((1, 2)), [[1.0], [1.0]], np.zeros((2, 2)))
    assert level_fails(matrices(P), np.eye(1), np.eye(1), 0.1) is None
