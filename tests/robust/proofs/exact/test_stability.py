"""Stability in exact arithmetic: on the boundary itself, beside it by one unit in the last place,
behind delays.
"""

from dataclasses import replace

import control
import numpy as np
import pytest
from flint import fmpq, fmpq_mat

from tests.support.exact_claims import decided, matrices


def with_poles(den, num=0.0, dt=0):
    """num/den in companion form, every coefficient of den (its first is one) as it stands."""
    n = len(den) - 1
    A = np.diag(np.ones(n - 1), 1)
    A[-1] = -np.asarray(den, float)[:0:-1]
    C = np.zeros((1, n))
    C[0, : np.size(num)] = np.atleast_1d(num)[::-1]
    return control.StateSpace(A, np.eye(n)[:, -1:], C, 0, dt)


def rational(matrix):
    return fmpq_mat([[fmpq(*float(x).as_integer_ratio()) for x in row] for row in matrix])


@pytest.mark.parametrize("seed", range(12))
def test_random_polynomials(seed):
    rng = np.random.default_rng(seed)
    upper = rng.normal(size=4) * 0.5 - 0.6 + 1j * rng.normal(size=4)
    p = np.poly(np.concatenate([upper, upper.conj(), -rng.uniform(0.01, 100, 3)])).real
    assert decided(with_poles(p)) is bool(np.all(upper.real < 0))


@pytest.mark.parametrize(
    "p", [[1, 1, 1, 1], [1, 1, 0], [1, 0, 1], [1, 0, 2, 0, 1], [1, 4, 5, 4, 4]]
)
def test_roots_on_the_axis_are_not_stable_in_exact_arithmetic(p):
    assert decided(with_poles(p)) is False


def test_a_root_at_infinity_is_not_stable():
    """1 + G K without its highest power: a gain of -1 at infinite frequency."""
    lag = control.ss(control.tf([-1, 0], [1, 1]))
    assert decided(lag, 0.999) is True
    assert decided(lag, 1.0) is not True


def test_one_unit_in_the_last_place_of_the_circle():
    """z - a, and z^2 + a with its pair at the distance sqrt(a)."""
    below, above = np.nextafter(1, 0), np.nextafter(1, 2)
    for a, stable in ((below, True), (1.0, False), (above, False)):
        for p in ([1, -a], [1, 0, a]):
            assert decided(with_poles(p, dt=0.1), control.ss([], [], [], [[1.0]], 0.1)) is stable


def test_thirty_states_that_floating_point_loses():
    """Thirty poles within 1e-3 of each other, one of them 2^-40 unstable, over powers of two."""
    for last, stable in ((-(2.0**-40), True), (2.0**-40, False)):
        poles = np.append(-1 - np.arange(29) / 2.0**15, last)
        turn = np.eye(30) + np.diag(np.full(29, 1.0), 1)  # its inverse has whole numbers too
        A = rational(turn) * rational(np.diag(poles)) * rational(turn).inv()
        exact = [[float(x.p) / float(x.q) for x in row] for row in A.tolist()]
        assert rational(np.array(exact)) == A  # no double rounds it
        loop = control.StateSpace(np.array(exact), np.zeros((30, 1)), np.zeros((1, 30)), 0, 0)
        assert decided(loop) is stable


@pytest.mark.parametrize(
    ("delay", "stable"), [(np.pi / 2, True), (np.nextafter(np.pi / 2, 2), False), (8.0, False)]
)
def test_an_integrator_behind_a_delay(delay, stable):
    """s + exp(-s tau) is stable for tau < pi/2, which no double is."""
    assert decided(with_poles([1, 0], 1.0), delay=delay) is stable


def test_a_delay_that_stabilises():
    """s^2 + 1 behind -0.5 exp(-s tau): poles at +-j sqrt(0.5) at tau = 0 move in first, and out
    again later.
    """
    assert decided(with_poles([1, 0, 1], -0.5)) is False
    shifted = with_poles([1, -0.01, 1], -0.5)  # at tau = 0 clearly unstable by 0.005
    found = [decided(shifted, delay=tau) for tau in (0.01, 1.0, 6.0)]
    assert found == [False, True, False]


def test_a_delay_with_a_known_limit():
    """5 exp(-s tau)/(s + 1): |L| = 1 at sqrt(24), where the phase left is pi - atan(sqrt(24))."""
    limit = (np.pi - np.arctan(np.sqrt(24))) / np.sqrt(24)
    lag = with_poles([1, 1], 5.0)
    assert decided(lag, delay=limit * (1 - 1e-14)) is True
    assert decided(lag, delay=limit * (1 + 1e-14)) is False


@pytest.mark.parametrize(("num", "den"), [([1, 1], [1, 2]), ([2, 3], [1, 1]), ([-1], [1, 1])])
def test_what_a_delay_leaves_open_is_not_stable(num, den):
    """A gain of one or more at infinite frequency, and a pole at zero whatever the delay."""
    assert decided(control.ss(control.tf(num, den)), delay=0.1) is not True


def test_hidden_modes_stay():
    hidden = control.StateSpace(np.diag([-1.0, 3.0]), [[1.0], [0.0]], [[1.0, 1.0]], [[0.0]])
    assert decided(hidden) is False
    hidden.A[1, 1] = -3.0
    assert decided(hidden) is True


def test_a_gain_behind_the_hold_and_samples_of_delay():
    """A gain of two under a delay of one and a half samples is seen two samples late: z^2 + 2 K."""
    gain = control.ss([], [], [], [[2.0]])
    for K, stable in ((np.nextafter(0.5, 0), True), (0.5, False)):
        held = control.ss([], [], [], [[K]], 0.125)
        assert decided(gain, held, delay=0.1875) is stable


def test_what_is_no_system_is_refused():
    fits = matrices(with_poles([1, 1], 1.0))
    with pytest.raises(ValueError, match="B must be finite numbers of shape"):
        replace(fits, B=np.zeros((2, 2)))
    with pytest.raises(ValueError, match="D must be finite"):
        replace(fits, D=np.array([[np.nan]]))
