"""Certificates: they hold just above a known norm, fail just below it, and never believe a
solver.
"""

import warnings
from dataclasses import replace

import control
import cvxpy
import numpy as np
import pytest

from robust import certify_norm
from robust.lti import discretize
from robust.proofs.search.intervals import magnitude_of
from tests.support.responses import response


def second_order(zeta, wn=3.0):
    """Resonance and its norm in closed form: 1/(2 zeta sqrt(1 - zeta^2)) at DC gain one."""
    system = control.tf([wn**2], [1, 2 * zeta * wn, wn**2])
    return control.ss(system), 1 / (2 * zeta * np.sqrt(1 - zeta**2))


def random_system(rng, n, dt=0.0):
    """Poles over six decades with dampings down to 0.001, zeros beside them; its gain on a grid
    that resolves them, by their product.
    """
    w = 10 ** (rng.uniform(-3, 3, n // 2) if not dt else rng.uniform(-1, 2, n // 2))
    zeta, shift = 10 ** rng.uniform(-3, 0, n // 2), rng.choice([0.6, 1.3], n // 2)
    system = control.ss([], [], [], [[1.0]])
    for wn, damping, by in zip(w, zeta, shift, strict=True):
        # (s^2 + 2 damping by wn s + by^2 wn^2)/(s^2 + 2 damping wn s + wn^2)
        A = wn * np.array([[0.0, 1.0], [-1.0, -2 * damping]])
        C = wn * np.array([[by**2 - 1, 2 * damping * (by - 1)]])
        system = control.StateSpace(A, [[0.0], [1.0]], C, [[1.0]]) * system
    near = np.linspace(-4, 4, 4001)
    omega = np.concatenate([w[:, None] * (1 + zeta[:, None] * near), [w * 0, w * 1e6]], axis=None)
    s = 1j * np.abs(omega)[:, None]
    gain = np.abs(
        np.prod(
            (s**2 + 2 * zeta * shift * w * s + (shift * w) ** 2) / (s**2 + 2 * zeta * w * s + w**2),
            axis=1,
        )
    )
    return (discretize(system, dt) if dt else system), gain.max()


@pytest.mark.parametrize("zeta", [0.5, 0.05, 0.001])
@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
def test_holds_at_1001_and_fails_at_0999_times_a_known_norm(zeta, solver):
    system, norm = second_order(zeta)
    above = certify_norm(system, 1.001 * norm, solver=solver)
    assert above.holds
    assert above.method == "scaled KYP"
    assert above.verify().verified
    below = certify_norm(system, 0.999 * norm, solver=solver)
    assert below.violated
    assert below.reason.startswith(f"the norm is {norm:.6g}"[:-1])
    assert below.intervals == pytest.approx(3 * np.sqrt(max(1 - 2 * zeta**2, 0)), abs=1e-3)


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_poles_over_six_decades(dt):
    rng = np.random.default_rng(7)
    for n in (2, 6, 12, 20):
        system, norm = random_system(rng, n, dt)
        assert certify_norm(system, norm / 0.99).holds
        assert not certify_norm(system, norm * 0.9999).holds


def test_an_unstable_system_has_no_certificate():
    certificate = certify_norm(control.tf([1], [1, -1]), 100.0)
    assert certificate.violated
    assert certificate.reason == "the system is not stable: a pole at 1+0j"


def test_a_solver_that_lies_about_its_status_is_not_believed(monkeypatch):
    system, norm = second_order(0.05)

    def lie(self, *args, **kwargs):
        for variable in self.variables():
            variable.value = np.eye(variable.shape[0]) if variable.shape else np.array(1.0)
        self._status = "optimal"
        return 1.0

    monkeypatch.setattr(cvxpy.Problem, "solve", lie)
    assert not certify_norm(system, 0.9 * norm, solver="CLARABEL").holds
    assert not certify_norm(control.tf([1], [1, -1]), 100.0, solver="CLARABEL").holds


class Panic(BaseException):
    """What a solver in another language may raise: not an Exception."""


@pytest.mark.parametrize(
    "failure", [Panic("index out of bounds"), cvxpy.SolverError("no"), ValueError("what")]
)
def test_where_a_solver_fails_exact_arithmetic_decides(monkeypatch, failure):
    def fail(self, *args, **kwargs):
        raise failure

    monkeypatch.setattr(cvxpy.Problem, "solve", fail)
    system, norm = second_order(0.05)
    certificate = certify_norm(system, 1.01 * norm, solver="CLARABEL")
    assert certificate.holds
    assert certificate.method == "exact arithmetic"
    below = certify_norm(system, 0.99 * norm, solver="CLARABEL")
    assert below.violated


def test_stopping_the_program_is_not_swallowed(monkeypatch):
    def stop(self, *args, **kwargs):
        raise KeyboardInterrupt

    monkeypatch.setattr(cvxpy.Problem, "solve", stop)
    with pytest.raises(KeyboardInterrupt):
        certify_norm(second_order(0.05)[0], 100.0, solver="CLARABEL")


def test_the_judge_knows_a_wrong_matrix():
    # scalar lag b c/(s + 1) with norm 1/2: P between the roots of P^2/4 - 2 P + 1 is a certificate
    # at level one
    proof, one = certify_norm(control.ss(-1.0, 0.5, 1.0, 0.0), 1.0), np.eye(1)
    known = {"level": 1.0, "T": one, "scalings": (one,), "skews": (0 * one,)}

    def passes(P):
        return proof.again(replace(proof.claim, P=P * one, **known)).verified

    low, high = 4 - np.sqrt(12), 4 + np.sqrt(12)
    for P in (low * 1.001, high * 0.999, 4.0):
        assert passes(P)
    for P in (low * 0.999, high * 1.001, -1.0, 0.0):
        assert not passes(P)


def test_no_solver_warning_leaks_out():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        system, norm = second_order(0.001)
        certify_norm(system, norm * 1.0000001, solver="SCS")


def test_magnitude_bounds_hold_on_random_intervals():
    rng = np.random.default_rng(0)
    system = control.ss(
        control.tf(
            np.poly([-1, -50, -3 + 20j, -3 - 20j]).real,
            np.poly([-5, -0.1, -1 + 30j, -1 - 30j]).real,
        )
    )
    bound = magnitude_of(system)
    low = 10 ** rng.uniform(-3, 3, 300)
    high = low * (1 + 10 ** rng.uniform(-5, 1, 300))
    truth = (
        np.abs(response(system, np.geomspace(low, high, 300).ravel())).reshape(300, -1).max(axis=0)
    )
    found = bound.upper_each(low, high)
    assert np.all(found >= truth * (1 - 1e-12))
    assert np.all((found <= truth * 1.02)[high < 1.01 * low])


@pytest.mark.parametrize("level", [0.0, -1.0, np.nan])
def test_refuses_a_level_that_is_none(level):
    with pytest.raises(ValueError, match="level must be"):
        certify_norm(control.tf([1], [1, 1]), level)


def many_states(n, dt=0.0):
    """n lags side by side, from all ones: the norm is at 0 rad/s, the sum of n gains."""
    rates = np.arange(1.0, n + 1)
    A = np.diag(1 - rates / (2 * n)) if dt else np.diag(-rates)
    system = control.StateSpace(A, np.ones((n, 1)) / n, np.ones((1, n)), [[0.0]], dt)
    return system, float(np.sum((2 if dt else 1 / n) / rates))


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("n", [33, 40, 45])
@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_exact_arithmetic_decides_of_many_states(n, dt):
    system, norm = many_states(n, dt)
    above = certify_norm(system, norm * (1 + 1e-8))
    assert above.holds
    assert above.verify().verified
    below = certify_norm(system, norm * (1 - 1e-8))
    assert below.violated
    assert below.reason == f"the norm is {norm:.10g}, at 0 Hz"
    np.testing.assert_array_equal(below.intervals, [[0.0, 0.0]])
    A = system.A.copy()
    A[0, 0] = 1.2
    unstable = certify_norm(control.StateSpace(A, system.B, system.C, system.D, dt), 1e6)
    assert unstable.violated
    assert "not stable: a pole at 1.2" in unstable.reason


@pytest.mark.parametrize("slack", [1e-5, 1e-7, 1e-10, 1e-13])
def test_a_level_near_the_norm_is_decided(slack):
    assert certify_norm(control.tf([1], [1, 1]), 1 + slack).holds
    assert certify_norm(control.tf([1], [1, 1]), 1 - slack).violated
    assert certify_norm(control.tf([1], [1, 1]), 1.0).violated


def test_gains_and_a_peak_at_infinity():
    assert certify_norm(control.ss([], [], [], [[0.3, 0.4]]), 0.500001).holds
    found = certify_norm(control.ss([], [], [], [[0.3, 0.4]]), 0.4999)
    assert found.violated
    assert "the norm is 0.5, at " in found.reason
    found = certify_norm(control.tf([2, 1], [1, 1]), 1.9)
    assert found.reason == "the norm is 2, at infinite frequency"
    assert certify_norm(control.ss([], [], [], [[0.0]]), 1e-300).holds


def test_what_is_no_solver_is_refused():
    with pytest.raises(ValueError, match="solver must be one of 'CLARABEL', 'SCS', got 'nonsense'"):
        certify_norm(control.tf([1], [1, 1]), 2.0, solver="nonsense")
