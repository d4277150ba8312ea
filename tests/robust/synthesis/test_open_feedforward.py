"""Feedforward with and without a loop around it: the worst error by brute force over the rim of
every form.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel
from robust.synthesis import feedforward_filter
from tests.support.forms import FORMS, PERTURBED
from tests.support.responses import response

LINES = np.array([0.1, 1.0, 10.0])
LAG, WANTED = control.ss(control.tf([2], [1, 1])), control.tf([1], [0.5, 1])


@pytest.mark.parametrize("form", FORMS)
@pytest.mark.parametrize("K", [0.0, 1.5])
def test_the_worst_error_is_that_of_the_set(form, K):
    model = UncertaintyModel(
        LAG, control.tf([0.1, 0.2], [0.5, 1]), form, LINES, np.full(3, 0.05), perturbation="LTI"
    )
    found = feedforward_filter(model, K, WANTED)
    G, F, w, T_ref = (
        response(control.ss(part), found.omega) for part in (LAG, found.F, model.weight, WANTED)
    )
    turns = np.exp(1j * np.linspace(0, 2 * np.pi, 721))[:, None]
    G_p = PERTURBED[form](G, w, turns)
    for f, worst in ((F, found.error_worst), (0 * F, found.error_without)):
        made = np.max(np.abs((T_ref - G_p * f) / (1 + G_p * K)), axis=0)
        assert worst == pytest.approx(made, rel=1e-3, abs=1e-9)
        assert np.all(made <= worst * (1 + 1e-9) + 1e-12)
    assert found.error == pytest.approx(np.abs((T_ref - G * F) / (1 + G * K)), abs=1e-9)


def test_a_loop_that_hardly_acts_is_one_that_does_not():
    model = UncertaintyModel(
        LAG, control.tf([0.2], [1]), "multiplicative", LINES, np.full(3, 0.2), perturbation="LTI"
    )
    none, hardly = (feedforward_filter(model, K, WANTED, delay=0.05) for K in (0.0, 1e-9))
    assert np.isfinite(none.error_worst).all()
    common, i, j = np.intersect1d(none.omega, hardly.omega, return_indices=True)
    assert common.size > 100
    assert hardly.error_worst[j] == pytest.approx(none.error_worst[i], rel=1e-6)
