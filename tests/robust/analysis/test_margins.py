"""Margins of measured lines, and of responses that failed."""

import control
import numpy as np
import pytest

from robust import check
from robust.analysis.curves import loop_curves
from robust.lti.grids import refine_peaks


def test_a_number_with_a_clock_is_a_sampled_controller():
    """K = 2 at 50 Hz holds its output: on measured lines the loop has the hold's delay, as it has
    for any other K.
    """
    omega = np.linspace(1, 60, 200)
    plant = control.frd(1 / (1j * omega + 1), omega)
    held = check(plant, control.StateSpace([], [], [], [[2.0]], 0.02))
    x = omega * 0.01
    wanted = 2 / (1j * omega + 1) * np.sin(x) / x * np.exp(-1j * x)
    assert np.abs(held.curves.S - 1 / (1 + wanted)).max() < 1e-12
    assert np.abs(check(plant, 2.0).curves.S - 1 / (1 + 2 / (1j * omega + 1))).max() < 1e-12


def test_a_response_that_is_no_number_is_no_pole():
    """At a pole S = 0 and T = 1; where a response failed nothing is known, and nothing may look
    good there.
    """
    omega, one = np.array([1.0, 2.0, 3.0]), np.ones(3, complex)
    curves = loop_curves(
        "multiplicative",
        omega,
        G=np.array([1.0, np.inf, np.nan]) + 0j,
        K=one,
        w=0.1 * one,
        w_P=None,
    )
    assert curves.S[:2] == pytest.approx([0.5, 0.0])
    assert curves.rs[:2] == pytest.approx([0.05, 0.1])
    assert np.isnan(curves.S[2])
    assert np.isnan(curves.rs[2])

    def failing(at):
        return np.where(at > 1, np.nan, 0.1)[None]

    (peak,) = refine_peaks(failing, omega, values=failing(omega), band=(1.0, 3.0))
    assert peak.value == np.inf
