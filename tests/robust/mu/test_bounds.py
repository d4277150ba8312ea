"""Both bounds in one call: the same of a system, its frequency response and its array; what is
refused.
"""

import control
import numpy as np
import pytest

import robust
from tests.robust.mu.test_mu import SP_8_5, along
from tests.support.distillation import BLOCKS, WITH_PERFORMANCE, controller, plant

OMEGA = np.geomspace(0.01, 10, 5)


@pytest.mark.parametrize(
    ("call", "blocks"), [(robust.mu.bounds, WITH_PERFORMANCE), (robust.mu.worst_gain, BLOCKS)]
)
def test_a_system_its_response_and_its_array_have_the_same_bounds(call, blocks):
    N = plant().lft(controller())
    response = along(N, OMEGA)
    of_array = call(response, blocks)
    for found in (
        call(N, blocks, OMEGA),
        call(control.FrequencyResponseData(response, OMEGA), blocks),
        call(control.FrequencyResponseData(response, OMEGA), blocks, OMEGA),
        call(response, blocks, OMEGA),
    ):
        assert np.array_equal(found.omega, OMEGA)
        assert found.upper == pytest.approx(of_array.upper, rel=1e-9)
        assert found.lower == pytest.approx(of_array.lower, rel=1e-6)
    some = call(control.FrequencyResponseData(response, OMEGA), blocks, OMEGA[[3]])
    assert some.upper == pytest.approx(of_array.upper[[3]], rel=1e-9)
    assert of_array.omega is None


def test_the_bounds_are_those_of_the_two_functions_and_meet_on_the_distillation_column():
    N = plant().lft(controller())
    found = robust.mu.bounds(N, WITH_PERFORMANCE, OMEGA)
    response = along(N, OMEGA)
    assert found.upper == pytest.approx(
        robust.mu.upper(response, WITH_PERFORMANCE).value, rel=1e-12
    )
    assert found.lower == pytest.approx(
        robust.mu.lower(response, WITH_PERFORMANCE).value, rel=1e-12
    )
    assert found.lower == pytest.approx(found.upper, rel=1e-3)
    for k in range(OMEGA.size):
        closed = np.eye(4) - response[:, :, k] @ found.delta[:, :, k]
        assert np.linalg.svd(closed, compute_uv=False)[-1] < 1e-6


def test_frequencies_are_chosen_where_none_are_given():
    """|N| of a light mode is 1/(2 zeta sqrt(1 - zeta^2)), in a band of a hundredth of it."""
    zeta = 5e-3
    N = control.ss(control.tf([1.0], [1.0, 2 * zeta, 1.0]))
    found = robust.mu.bounds(N, [(1, 1)])
    assert found.upper.max() == pytest.approx(0.5 / zeta, rel=0.01)
    assert "largest at 1 rad/s" in str(found)


@pytest.mark.attack
def test_the_peak_of_the_distillation_column_is_found():
    N = plant().lft(controller())
    found = robust.mu.bounds(N, WITH_PERFORMANCE)
    assert found.upper.max() == pytest.approx(5.78, rel=0.01)  # SP 8.11.3
    assert "largest at 1." in str(found)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: robust.mu.bounds(SP_8_5, [(1, 1)]),
            "blocks must add up to the 2 outputs and 2 inputs of N",
        ),
        (
            lambda: robust.mu.bounds(SP_8_5, [(2, 2)], [1.0, 2.0]),
            "omega must have one frequency for each matrix of N, got 2",
        ),
        (
            lambda: robust.mu.bounds(SP_8_5, [(2, 2)], [np.inf]),
            "omega must be a list of finite frequencies",
        ),
        (
            lambda: robust.mu.worst_gain(SP_8_5, [(2, 2)]),
            "blocks must use fewer than the 2 outputs and 2 inputs",
        ),
        (
            lambda: robust.mu.bounds(control.FrequencyResponseData(SP_8_5, [1.0]), [(2, 2)], [2.0]),
            "omega must hold frequencies of N, which has 1 from 1 to 1 rad/s",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
