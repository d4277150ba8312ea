"""Margins where one grid would miss them: modes far below all others, ripples of a long delay."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check
from robust.analysis.curves import loop_curves
from robust.lti.grids import refine_peaks


def curve(G, K, w, delay, omega, form):
    """|b| from polynomials."""
    s = 1j * omega
    g, k, w = (np.polyval(num, s) / np.polyval(den, s) for num, den in (G, K, w))
    g = g * np.exp(-s * delay)
    return np.abs(w * k / (1 + g * k) * (g if form == "multiplicative" else 1.0))


def margin(G, K, w, form, delay=0.0):
    ones = np.array([1.0, 2.0]), np.array([1e-4, 1e-4])
    model = UncertaintyModel(control.tf(*G), control.tf(*w), form, *ones, perturbation="LTI")
    return check(model, control.tf(*K), delay=delay, certify=False).margins.rs


@pytest.mark.parametrize("slow", [1e-6, 1e-10, 1e-14])
def test_a_weight_with_a_mode_far_below_the_loop(slow):
    """|w| peaks at 20 times its height there: 1.5 is the margin, not the 30 of the rest."""
    G, K = ([1.0], [1.0, 1.0]), ([2.0, 1.0], [1.0, 0.5])
    w = ([0.05, 0.1 * slow, 0.05 * slow**2], [1.0, 0.1 * slow, slow**2])
    omega = slow * np.linspace(0.5, 1.5, 20_001)
    assert margin(G, K, w, "multiplicative") == pytest.approx(
        1 / curve(G, K, w, 0, omega, "multiplicative").max(), 1e-4
    )


@pytest.mark.parametrize("delay", [1.0, 10.0, 100.0])
def test_ripples_of_a_delay(delay):
    """Many maxima of almost the same height, close together: the largest counts."""
    rng = np.random.default_rng(0)
    omega = np.concatenate(
        [np.linspace(1e-6, 400 / delay, 200_001), np.geomspace(1e-6, 1e4, 100_001)]
    )
    for _ in range(4):
        G, K = ([rng.uniform(0.3, 0.9)], [rng.uniform(0.01, 1), 1.0]), ([0.95], [1.0])
        w = ([0.3 * rng.uniform(0.1, 1), 0.2], [1.0, 1.0])
        assert (
            margin(G, K, w, "additive", delay)
            <= 1.001 / curve(G, K, w, delay, omega, "additive").max()
        )


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
