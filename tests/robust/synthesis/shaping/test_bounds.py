"""Bounds on |L|: exact over the phase, by brute force."""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, performance_weight
from tests.support.forms import UNSCALED, worst_sensitivity
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))


@pytest.mark.parametrize("form", UNSCALED)
def test_loop_bounds_are_exact_over_the_phase(form):
    """By brute force over the phase of L: just inside the bound every phase meets the demand, just
    beyond one fails.
    """
    omega = np.array([0.1, 1.0, 10.0])
    G = control.tf([2], [1, 1])
    for size in (0.3, 1.8):
        w = size / (1 if "multiplicative" in form else 2.0)
        model = UncertaintyModel(
            G, control.ss([], [], [], [[w]]), form, omega, np.full(3, w), perturbation="LTI"
        )
        g = model.at(omega)
        w_P = performance_weight(2.0, M_S=2.0, A=0.01)
        p = np.abs(response(w_P, omega))
        low, high = robust.shaping.loop_bounds(model, w_P)
        phases = np.exp(1j * np.linspace(0, 2 * np.pi, 361))

        def holds(k, level, g=g, p=p, w=w, phases=phases):
            K = level * phases / g[k]
            return np.max(p[k] * worst_sensitivity(form, w, G=g[k], K=K, n=720)) <= 1

        for k in range(3):
            if 0 < low[k] < np.inf:
                assert holds(k, low[k] * 1.001)
                assert not holds(k, low[k] * 0.99)
            if 0 < high[k] < np.inf:
                assert holds(k, high[k] * 0.999)
                assert not holds(k, high[k] * 1.01)
            if high[k] == 0:
                assert low[k] == np.inf
                assert not any(holds(k, level) for level in np.geomspace(1e-4, 1e4, 41))
