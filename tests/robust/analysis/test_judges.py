"""Loops that no matrix inequality describes."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check
from tests.support.responses import response

T, OMEGA = 1e-2, np.geomspace(0.1, 100, 20)
LAG = control.ss(control.tf([2.0], [0.3, 1]))
RISING = control.ss(control.tf([0.3, 0.2], [0.1, 1]))


@pytest.mark.parametrize(
    ("dt", "delay", "reason"),
    [
        (0, 0.01, "the delay of a continuous loop"),
        (T, 0.0, "no inequality covers the aliases"),
    ],
)
def test_a_loop_that_is_no_state_space_is_proved_by_no_inequality(dt, delay, reason):
    model = UncertaintyModel(
        LAG, RISING, "multiplicative", OMEGA, np.abs(response(RISING, OMEGA)), perturbation="LTI"
    )
    K = control.ss([], [], [], [[0.5]], dt)
    report = check(model, K, delay=delay, proof="lmi")
    assert not report.proofs.robustly_stable
    assert any(one.reason.startswith(reason) for one in report.proofs.certificates)
