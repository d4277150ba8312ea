"""Loops decided where floating point cannot tell: between two neighbouring doubles, against 450
digits.
"""

import control
import numpy as np
import pytest

from robust import certify_norm
from tests.support.exact_claims import decided
from tests.support.hard_loops import boundary_gain, hard_loop, margin, with_gain
from tests.support.random_loops import hold_and_delay


def stable(G, K):
    return decided(G, K) is True


def test_the_boundary_lies_between_two_neighbouring_gains():
    rng, count = np.random.default_rng(5), 0
    while count < 2:
        G, K = hard_loop(rng, most=17)
        edges = boundary_gain(G, K, stable)
        if edges is None:
            continue
        assert np.nextafter(min(edges), np.inf) == max(edges)
        for gain in edges:
            assert (float(margin(G, with_gain(K, gain))) < 0) == stable(G, with_gain(K, gain))
        count += 1


@pytest.mark.parametrize("delay", [0.0, 0.013, 0.05])
def test_held_plants(delay):
    """The limit of the gain as one long matrix exponential sees it, to eleven digits on either
    side.
    """
    G = control.ss(control.tf([20], [1, 3, 20]))
    there = hold_and_delay(G, 0.01, delay)
    low, high = 0.01, 100.0
    while high - low > 1e-13 * high:
        k = (low + high) / 2
        loop = there.A - there.B @ there.C * k
        low, high = (k, high) if np.abs(np.linalg.eigvals(loop)).max() < 1 else (low, k)
    for factor, true in ((1 - 1e-9, True), (1 + 1e-9, False)):
        K = control.ss([], [], [], [[low * factor]], 0.01)
        assert decided(G, K, delay=delay) is true


def test_delays_of_continuous_loops():
    """1/s behind pi/2: no double is the limit, its two neighbours lie on either side."""
    G, K = control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]]), control.ss([], [], [], [[1.0]])
    verdicts = [decided(G, K, delay=d) for d in (np.pi / 2, np.nextafter(np.pi / 2, 2))]
    assert verdicts == [True, False]


def of_poles(A, dt=0):
    """A system of all channels with these dynamics, and a gain far below any level."""
    n = len(A)
    return control.StateSpace(A, 1e-30 * np.eye(n), np.eye(n), np.zeros((n, n)), dt)


def test_matrices():
    """On the circle, beside it by one unit in the last place, and a chain that rounding breaks."""
    assert certify_norm(control.ss([], [], [], [[1e-30]]), 1.0).holds
    on_circle = certify_norm(of_poles(np.eye(3), 0.1), 1.0)
    assert on_circle.violated
    assert "not stable" in on_circle.reason
    edge = np.nextafter(1, 0)
    assert certify_norm(of_poles(np.diag([edge, -edge]), 0.1), 1.0).holds
    jordan = -1e-8 * np.eye(12) + np.diag(np.full(11, 1e3), 1)
    loop = control.StateSpace(jordan, np.zeros((12, 1)), np.zeros((1, 12)), 0, 0)
    assert decided(loop) is True
    assert (
        np.linalg.eigvals(jordan + 1e-13 * np.ones((12, 12))).real.max() > 1
    )  # what rounding can make of it
