"""A gain that is said to be sampled at another rate is another controller: refused; a gain without
a rate fits any.
"""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, worst_case
from robust.models import interconnection

T = 0.01
LAG = control.ss([[0.9]], [[1.0]], [[0.1]], [[0.0]], T)


def model():
    return UncertaintyModel(
        LAG, 0.2, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]), perturbation="LTI"
    )


def matrix_model():
    w = control.ss([], [], [], [[0.1]], T)
    of = {
        "form": "elements",
        "left": (),
        "right": (w,),
        "omega": np.array([1.0]),
        "radius": np.full((1, 1), 0.1),
    }
    return UncertaintyModel(nominal=LAG, confidence=0.95, **of)


def gain(dt):
    return control.StateSpace([], [], [], [[0.5]], dt)


@pytest.mark.parametrize("judge", [check, worst_case])
@pytest.mark.parametrize("dt", [0.02, 1e-3, 1.0])
def test_a_gain_of_another_clock_is_refused(judge, dt):
    with pytest.raises(
        ValueError, match=r"K must have the sampling time of the nominal model, 0.01 s, got"
    ):
        judge(model(), gain(dt))


def test_so_it_is_with_several_channels():
    for judge in (check, robust.margins.disk_margins):
        with pytest.raises(ValueError, match="K must have the sampling time"):
            judge(matrix_model(), gain(0.02))
    with pytest.raises(ValueError, match="systems must have one sampling time"):
        interconnection(
            [
                control.ss(LAG, inputs="u", outputs="y"),
                control.ss(gain(0.02), inputs="y", outputs="u"),
            ],
            {},
        )
    with pytest.raises(ValueError, match="sampling time"):
        robust.margins.ncf_margin(LAG, gain(0.02))


@pytest.mark.parametrize(
    "K", [0.5, gain(None), gain(True), gain(T), gain(T * (1 + 1e-12)), gain(0)]
)
def test_a_gain_without_a_clock_fits_any(K):
    assert check(model(), K).verdict == "robust"
    assert check(matrix_model(), K).nominally_stable
