"""D-K iteration, the worst-case gain and the bound by semidefinite programming."""

import control
import cvxpy
import numpy as np
import pytest

from robust import certify_mu, dk_iteration, mu_upper, mu_upper_lmi, worst_gain
from robust.certificates.stability import instability
from robust.modelling.weights import minimum_phase
from robust.systems.bilinear import to_discrete
from robust.systems.lft import lower
from robust.systems.lti import response
from tests.robust.mu.test_mu import along, random_matrix, size
from tests.support.distillation import WITH_PERFORMANCE, controller, plant


def test_the_distillation_column():
    """SP 8.12.4: H-infinity synthesis alone reaches mu 1.18, the second round 1.02; the inverse-based K has 5.78."""
    design = dk_iteration(plant(), WITH_PERFORMANCE, 2, 2, n_rounds=2)
    first, second = (mu for _, mu, _ in design.history)
    assert first == pytest.approx(1.18, abs=0.02)
    assert second < 1.06
    assert design.mu == second
    N = lower(plant(), design.K)
    assert instability(N) == ""
    assert mu_upper(along(N, np.geomspace(1e-4, 1e3, 200)), WITH_PERFORMANCE).value.max() <= 1.005 * design.mu
    assert design.certificate.holds
    assert certify_mu(N, WITH_PERFORMANCE, 1.02 * design.mu).holds


def test_a_discrete_plant():
    P = plant()
    discrete = control.StateSpace(*to_discrete(P.A, P.B, P.C, P.D), 0.1)
    design = dk_iteration(discrete, WITH_PERFORMANCE, 2, 2, n_rounds=1, order=2)
    assert design.mu == pytest.approx(1.18, abs=0.03)
    assert design.K.dt == 0.1


def test_out_of_time_the_best_is_kept():
    design = dk_iteration(plant(), WITH_PERFORMANCE, 2, 2, time_cap=1e-9)
    assert "time cap" in design.reason
    assert len(design.history) <= 1


def test_scalings_are_minimum_phase_and_have_an_inverse():
    omega = np.geomspace(1e-2, 1e2, 80)
    D, inverse = minimum_phase(omega, np.abs((1j * omega + 2) / (1j * omega + 0.3)), 0.0, 1)
    assert np.all(D.poles().real < 0)
    assert np.all(inverse.poles().real < 0)
    assert np.abs(response(D, omega)) == pytest.approx(np.abs((1j * omega + 2) / (1j * omega + 0.3)), rel=1e-3)
    assert response(D, omega) * response(inverse, omega) == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize(
    "blocks", [[(1, 1), (2, 1), (1, 2)], [(2, 2, "repeated"), (1, 1)], [(1, 1, "real"), (1, 1, "real"), (1, 1)]]
)
def test_two_ways_to_the_same_bound(blocks):
    N = random_matrix(np.random.default_rng(7), size(blocks), 2)
    upper = mu_upper(N, blocks).value
    assert mu_upper_lmi(N, blocks).value == pytest.approx(upper, rel=2e-4)


def test_a_solver_that_lies_proves_nothing_wrong(monkeypatch):
    def lie(self, *args, **kwargs):
        for variable in self.variables():
            variable.value = np.ones(variable.shape)
        self._status = "optimal"

    monkeypatch.setattr(cvxpy.Problem, "solve", lie)
    N = random_matrix(np.random.default_rng(8), (2, 2), 1)
    blocks = [(1, 1), (1, 1)]
    assert mu_upper_lmi(N, blocks).value >= mu_upper(N, blocks).value * (1 - 1e-9)


def test_worst_gain_in_closed_form():
    """|w_P| |S| / (1 - |w_I T|) for a multiplicative perturbation; inf where |w_I T| >= 1."""
    omega = np.geomspace(0.1, 100, 30)
    L = 10 / (1j * omega * (1j * omega / 20 + 1))
    S, T, w = 1 / (1 + L), L / (1 + L), 0.05 * np.abs(1 + 1j * omega)
    N = np.array([[-w * T, -w * T / L], [L * S, S]])
    exact = np.where(np.abs(w * T) < 1, np.abs(S) / np.maximum(1 - np.abs(w * T), 1e-9), np.inf)
    assert worst_gain(N, [(1, 1)]) == pytest.approx(exact, rel=1e-5)


def test_worst_gain_of_the_distillation_column_is_seen_by_no_perturbation():
    N = lower(plant(), controller())
    response_ = along(N, np.array([0.1, 1.0]))
    gain = worst_gain(response_, [(1, 1), (1, 1)])
    rng = np.random.default_rng(9)
    for k in range(2):
        M, reached = response_[:, :, k], 0.0
        for _ in range(300):
            delta = np.diag(np.exp(2j * np.pi * rng.random(2)))
            closed = M[2:, 2:] + M[2:, :2] @ delta @ np.linalg.solve(np.eye(2) - M[:2, :2] @ delta, M[:2, 2:])
            reached = max(reached, np.linalg.norm(closed, 2))
        assert 0.9 * gain[k] < reached <= gain[k] * (1 + 1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: dk_iteration(plant(), [(1, 1)], 2, 2),
            "must add up to the 4 outputs and 4 inputs of P without",
        ),
        (lambda: dk_iteration(plant(), WITH_PERFORMANCE, 2, 2, order=-1), "order must be a whole number"),
        (lambda: dk_iteration(plant(), WITH_PERFORMANCE, 2, 2, time_cap=0), "time_cap must be positive"),
        (lambda: worst_gain(np.ones((2, 2, 1)), [(2, 2)]), "blocks must leave some of the 2 outputs"),
        (lambda: mu_upper_lmi(np.ones((2, 2, 1)), [(2, 2)], solver="MOSEK"), "solver must be one of"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
