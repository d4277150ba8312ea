"""Singular H-infinity problems: interpolation in closed form, published problems, bounds that no
controller beats.
"""

import json
from pathlib import Path

import control
import numpy as np
import pytest

from robust import UncertaintyModel, hinfsyn, mixsyn, performance_weight
from tests.support.compleib import BEST, generalised, problem
from tests.support.responses import response, response_by_channel

S = control.tf("s")


def sensitivity_only(G, w_P):
    """From (r, u) to (w_P e, e) with e = r - G u: D12 = 0 for a strictly proper plant."""
    G, w = control.ss(G), control.ss(w_P)
    n, m = G.nstates, w.nstates
    A = np.block([[G.A, np.zeros((n, m))], [-w.B @ G.C, w.A]])
    B = np.block([[np.zeros((n, 1)), G.B], [w.B, -w.B @ G.D]])
    C = np.block([[-w.D @ G.C, w.C], [-G.C, np.zeros((1, m))]])
    return control.StateSpace(A, B, C, np.block([[w.D, -w.D @ G.D], [np.eye(1), -G.D]]), 0)


def on_a_grid(P, K):
    """Largest gain of the closed loop on a grid, and whether it is stable, by numpy alone."""
    closed = P.lft(K)
    omega = np.concatenate([[0.0], np.geomspace(1e-6, 1e8, 6000)])
    return np.linalg.norm(response_by_channel(closed, omega), 2, (0, 1)).max()


@pytest.mark.parametrize(
    ("G", "least"),
    [
        ((1 - S) / ((S + 1) * (S + 2)), lambda w: abs(w(1.0))),  # S(1) = 1
        ((2 - S) / (S + 1) ** 3, lambda w: abs(w(2.0))),
        (
            (3 - S) / ((S - 1) * (S + 4)),
            lambda w: abs(w(3.0)) * (3 + 1) / (3 - 1),
        ),  # and S = 0 at the unstable pole
        ((1 - S) / (S * (S + 2)), lambda w: abs(w(1.0))),  # an integrator: S(0) = 0 costs nothing
        (1 / S**2, lambda w: 0.5),  # S(infinity) = 1: |w_P| = 1/2 there; 58.8 before
        (1 / (S**2 + 1), lambda w: 0.5),
        (1 / ((S + 1) * (S + 2)), lambda w: 0.5),
    ],
)
def test_weighted_sensitivity_in_closed_form(G, least):
    """min ||w_P S|| by Nevanlinna-Pick interpolation (Zames & Francis 1983): reached within 3 %,
    bounded from below.
    """
    w_P = performance_weight(1)
    P = sensitivity_only(G, w_P)
    expected = least(w_P)
    found = hinfsyn(P, 1, 1)
    assert expected * (1 - 1e-6) <= found.gamma <= 1.03 * expected
    assert 0.97 * expected <= found.gamma_min <= expected * (1 + 1e-6)
    assert found.level == found.gamma_min
    assert np.all(P.lft(found.K).poles().real < 0)
    assert on_a_grid(P, found.K) <= found.gamma * (1 + 1e-6)


@pytest.mark.parametrize("name", BEST)
def test_published_problems_with_singular_parts(name):
    """COMPleib (Leibfritz 2004): within 3 % of the best norm known, and no bound above a norm that
    was reached.
    """
    P, n_y, n_u = problem(name)
    found = hinfsyn(P, n_y, n_u)
    assert found.gamma <= 1.03 * BEST[name]
    assert found.gamma_min <= min(found.gamma, 1.001 * BEST[name])
    assert on_a_grid(P, found.K) <= found.gamma * (1 + 1e-6)


def test_what_cannot_be_stabilised_is_named(measured):
    folder = Path(measured) / "compleib"
    if not folder.is_dir():
        pytest.skip("no published problems beside the measured records")
    with pytest.raises(ValueError, match="u does not reach the mode at s = 0"):
        hinfsyn(*generalised(np.load(folder / "problems.npz"), "REA4"))
    assert json.loads((folder / "problems.json").read_text())["REA4"]["best_found"] is None


def multiplicative(G, w):
    omega = np.geomspace(1e-2, 1e2, 40)
    return UncertaintyModel(
        G,
        w,
        "multiplicative",
        omega,
        0.99 * np.abs(response(control.ss(w), omega)),
        perturbation="LTI",
    )


@pytest.mark.parametrize(
    ("G", "w_P"),
    [
        (1 / (S * (S + 1)), performance_weight(1)),
        (
            100 / (S**2 + 0.4 * S + 100) / (S * (S + 1)),
            performance_weight(0.5),
        ),  # a motor and a mode
        ((1 - 0.05 * S) / (S * (S + 1) ** 2), performance_weight(0.3)),
    ],
)
def test_the_first_call_of_mixsyn_is_near_its_infimum(G, w_P):
    """A multiplicative model of a strictly proper plant without w_u is always singular."""
    design = mixsyn(multiplicative(G, control.tf([0.3, 0.1], [0.05, 1])), w_P)
    assert design.gamma_min <= design.gamma <= 1.03 * design.gamma_min
    assert design.reason == ""


def test_a_gap_that_stays_is_said():
    P, n_y, n_u = problem("NN9")
    found = hinfsyn(P, n_y, n_u)
    assert found.gamma > 1.03 * found.gamma_min
    assert f"gamma {found.gamma:.4g} was reached" in found.reason


def test_random_singular_plants_keep_their_bounds():
    """D12 = D21 = 0, integrators among the poles: no controller that is found by other means beats
    the bound.
    """
    rng = np.random.default_rng(3)
    for k in range(4):
        n = int(rng.integers(2, 6))
        A = rng.standard_normal((n, n))
        if k % 2:
            A[0] = 0.0
        B, C = rng.standard_normal((n, 3)), rng.standard_normal((3, n))
        P = control.StateSpace(A, B, C, np.zeros((3, 3)), 0)
        found = hinfsyn(P, 1, 1)
        assert found.found
        assert found.gamma_min <= found.gamma
        size = 1e-3
        D = np.zeros((4, 4))
        D[2, 3], D[3, 2] = size, size
        regular = control.StateSpace(
            A,
            np.hstack([B[:, :2], np.zeros((n, 1)), B[:, 2:]]),
            np.vstack([C[:2], np.zeros((1, n)), C[2:]]),
            D,
            0,
        )
        other = P.lft(hinfsyn(regular, 1, 1).K) if not k % 2 else None
        if other is not None and np.all(other.poles().real < 0):
            omega = np.geomspace(1e-4, 1e6, 2000)
            gains = np.linalg.norm(response_by_channel(other, omega), 2, (0, 1))
            assert gains.max() >= found.gamma_min * (1 - 1e-6)
