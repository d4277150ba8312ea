"""What the advice says: what the weight is made of where it limits, and where that comes from
outside the band.
"""

import control
import numpy as np
import pytest

from robust import DesignWarning, UncertaintyModel, check, fit_nominal, uncertainty
from robust.models import Origin
from tests.support.bla import make_bla

F = np.geomspace(1, 100, 60)


def spring_and_mode(s):
    """A slow lag that rules the low frequencies, and a flexible mode."""
    return 35 / (1 + s / (2 * np.pi * 2)) + 20 / (1 + 0.05 * s / 300 + (s / 300) ** 2)


def test_a_misfit_that_goes_on_below_the_band_is_named_and_cured_by_orders():
    """All of the radius at the first line is misfit: measuring below the band would not mend
    that.
    """
    size = np.abs(spring_and_mode(2j * np.pi * F))
    bla = make_bla(spring_and_mode, F, sigma_noise=2e-3 * size)
    with pytest.warns(DesignWarning, match="2 poles does not fit the measurement: its cost is"):
        fit_nominal(bla, n_poles=2, n_zeros=0)
    mode = control.ss(
        control.tf([1.5], [1 / 300**2, 0.05 / 300, 1])
    )  # the mode alone: misfit 34.8 of 34.8
    model = uncertainty(bla, mode, order=6)
    assert model.radius[0] == pytest.approx(34.8, rel=0.1)
    assert model.budget["misfit"][0] > 0.99 * model.radius[0]
    report = check(
        model, control.tf([1e-2 * 2 * np.pi * 0.01], [1, 2 * np.pi * 0.004]), certify=False
    )
    assert report.margins.omega_rs < 2 * np.pi * 1, "limited below the band"
    assert "below the measured band" in report.advice
    assert "from the first line, 1 Hz, where the radius consists of misfit 100 %" in report.advice
    assert "robust orders" in report.advice
    assert report.advice.endswith("Or measure at that frequency.")


def model_of(w, **parts):
    omega = 2 * np.pi * np.array([1.0, 3.0, 10.0])
    budget = {name: share * np.full(3, 0.1) for name, share in parts.items()}
    told = Origin(extrapolation="as told")
    lag = control.tf([1], [1, 0.1])
    return UncertaintyModel(
        lag, w, "multiplicative", omega, np.full(3, 0.1), origin=told, budget=budget
    )


def loop_at(f0):
    """A controller on that lag whose T has its peak at f0 [Hz]."""
    w0 = 2 * np.pi * f0
    return control.tf([w0**2], [1, 0.4 * w0])


@pytest.mark.parametrize(
    ("w", "f0", "parts", "said", "cure"),
    [
        (
            0.1,
            40.0,
            {"noise": 0.7, "misfit": 0.3},
            "above the measured band",
            "average more periods",
        ),
        (
            0.1,
            3.0,
            {"misfit": 0.7, "odd": 0.3},
            "where the radius consists of misfit 70 %, odd 30 %",
            "robust orders",
        ),
        (
            0.1,
            3.0,
            {"level": 1.0},
            "where the radius consists of level 100 %",
            "narrow the range of levels",
        ),
        (
            0.3,
            3.0,
            {"noise": 1.0},
            "The weight is 9.5 dB above the radius there.",
            "fit a weight of a higher order",
        ),
        (0.1, 3.0, {}, "where the parts of the radius are unknown", ""),
    ],
)
def test_the_largest_part_decides(w, f0, parts, said, cure):
    advice = check(
        model_of(control.ss([], [], [], [[w]]), **parts), loop_at(f0), certify=False
    ).advice
    assert said in advice
    assert cure in advice
    assert ("Or measure at that frequency." in advice) == (f0 > 10)


def test_a_lower_bandwidth_is_no_advice_where_T_is_one():
    flat = control.ss([], [], [], [[0.1]])
    through_one = control.tf([20 * np.pi, 2 * np.pi], [1, 0])  # L = 20 pi/s
    at_one = check(model_of(flat, odd=1.0), through_one, certify=False).advice
    assert (
        "|T| is near one, so a lower bandwidth does not reduce it. Identify at the level of the"
        " loop" in at_one
    )
    at_peak = check(model_of(flat, odd=1.0), loop_at(3.0), certify=False).advice
    assert "Odd distortion: lower the bandwidth" in at_peak


def test_a_rise_that_is_only_assumed_asks_for_a_measurement():
    w = control.tf(
        [0.1 / (2 * np.pi * 20), 0.1], [1e-5, 1]
    )  # 0.1 in the band, three times that at 60 Hz
    advice = check(model_of(w, odd=1.0), loop_at(60.0), certify=False).advice
    assert "above the measured band" in advice
    assert "The extrapolation makes the radius 2.8" in advice
    assert advice.endswith("The assumption outside the measured band: measure there.")
    assert "more periods" not in advice


def test_a_weight_that_fails_where_the_measured_lines_pass_is_named():
    """A radius with a bump that a constant weight covers everywhere: the lines pass, the weight
    does not.
    """
    omega = np.geomspace(0.1, 10, 40)
    radius = 0.3 + 2.7 * np.exp(-((np.log(omega / 8) / 0.2) ** 2))  # large where |T| is small
    plant, K = control.tf([1], [1, 1]), 2.0
    with pytest.warns(DesignWarning, match="much larger than the measurement requires"):
        model = UncertaintyModel.from_radius(
            plant, omega, radius, order=0, above="flat", perturbation="LTI"
        )
    report = check(model, K)
    assert report.verdict == "not robust"
    T = np.abs(2 / (1j * omega + 3))
    assert "On the measured lines the radius passes" in report.advice
    assert f"rs is at most {np.max(radius * T):.3g}" in report.advice
    assert "--order 2" in report.advice
    better = UncertaintyModel.from_radius(
        plant, omega, radius, order=4, above="flat", perturbation="LTI"
    )
    assert check(better, K).verdict == "robust"
    assert "the radius passes" not in check(better, K).advice
