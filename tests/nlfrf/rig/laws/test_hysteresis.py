"""Hysteresis against what is known of it in closed form, and its two memories against each
other.
"""

import numpy as np
import pytest
from scipy.integrate import quad

import nlfrf
from nlfrf._base.arguments import DataWarning
from tests.support.virgin_curves import chord_elements, virgin

CURVES = [
    nlfrf.hysteresis.Linear(3.0),
    nlfrf.hysteresis.Tanh(3.0, 2.0),
    nlfrf.hysteresis.Exponential(3.0, 2.0),
    nlfrf.hysteresis.Parabola(3.0, 2.0),
    nlfrf.hysteresis.ElasticPlastic(3.0, 2.0),
]
CURVES += [
    nlfrf.hysteresis.Table([0.2, 0.7, 1.5], [0.5, 1.2, 1.6]),
    nlfrf.hysteresis.MaxwellSlip([1.0, 2.0], [0.4, 1.5]),
]


def walk(n, *, rng, span=1.0):
    """A random path with inner loops of all sizes."""
    return span * np.cumsum(np.random.default_rng(rng).standard_normal(n))


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_virgin_curve_is_followed_from_rest(curve):
    z = np.linspace(0, 2, 50)
    assert np.allclose(nlfrf.hysteresis.hysteresis_force(curve, z), virgin(curve, z), rtol=1e-13)
    assert np.allclose(nlfrf.hysteresis.hysteresis_force(curve, -z), -virgin(curve, z), rtol=1e-13)


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_force_is_point_symmetric_to_the_last_bit(curve):
    z = walk(400, rng=1, span=0.2)
    assert np.array_equal(
        nlfrf.hysteresis.hysteresis_force(curve, -z), -nlfrf.hysteresis.hysteresis_force(curve, z)
    )


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_branches_are_the_virgin_curve_at_twice_the_size(curve):
    z = np.linspace(1.0, -1.0, 41)
    force = nlfrf.hysteresis.hysteresis_force(curve, z)
    assert np.allclose(force, virgin(curve, 1.0) - 2 * virgin(curve, (1.0 - z) / 2), atol=1e-13)


@pytest.mark.parametrize("curve", CURVES[1:5], ids=lambda c: type(c).__name__)
def test_symmetric_loop_loses_the_masing_energy(curve):
    amplitude = 0.9
    quarter = np.linspace(0, amplitude, 20001)
    cycle = np.concatenate(
        [quarter, quarter[-2::-1], -quarter[1:], -quarter[-2::-1], quarter[1:], quarter[-2::-1]]
    )
    cycle = np.concatenate([cycle, -quarter[1:], -quarter[-2::-1]])
    force = nlfrf.hysteresis.hysteresis_force(curve, cycle)
    last = slice(4 * 20000, None)
    lost = np.trapezoid(force[last], cycle[last])
    area = quad(lambda z: float(virgin(curve, z)), 0, amplitude, points=[2 / 3])[0]
    assert lost == pytest.approx(
        8 * area - 4 * amplitude * float(virgin(curve, amplitude)), rel=1e-6
    )


@pytest.mark.parametrize("curve", CURVES, ids=lambda c: type(c).__name__)
def test_closed_inner_loops_are_wiped_out(curve):
    with_loops = nlfrf.hysteresis.hysteresis_force(
        curve, [0.8, 0.1, 0.5, 0.2, 0.4, 0.2, 0.6, -0.3, 0.9, -0.7, 1.1]
    )
    without = nlfrf.hysteresis.hysteresis_force(curve, [0.8, -0.3, 0.9, -0.7, 1.1])
    assert np.allclose(with_loops[[0, -4, -3, -2, -1]], without, atol=1e-14)


def test_memory_that_is_too_short_is_announced_and_costs_only_the_innermost_loops():
    curve = nlfrf.hysteresis.Tanh(1.0, 1.0)
    inward = np.linspace(2, 0, 400) * np.where(
        np.arange(400) % 2, -1, 1
    )  # 400 nested turning points
    path = np.concatenate([inward, -inward[250::-1]])
    with pytest.warns(
        DataWarning, match=r"the hysteresis memory of 256 turning points overflowed \d+ times"
    ):
        force = nlfrf.hysteresis.hysteresis_force(curve, path)
    elements = chord_elements(curve, np.geomspace(4e-3, 6, 2000))  # no memory to overflow
    assert np.abs(force - nlfrf.hysteresis.hysteresis_force(elements, path)).max() < 1e-3
    assert np.isfinite(force).all()


@pytest.mark.parametrize("curve", CURVES[1:], ids=lambda c: type(c).__name__)
def test_inner_loop_closes_where_it_opened(curve):
    force = nlfrf.hysteresis.hysteresis_force(curve, [1.0, -0.2, 0.3, -0.2])
    assert force[3] == pytest.approx(force[1], abs=1e-14)
    assert force[2] != pytest.approx(float(virgin(curve, 0.3)), abs=1e-3)  # it has a memory at all


def test_stack_and_elements_are_the_same_operator():
    elements = nlfrf.hysteresis.MaxwellSlip([1.0, 0.5, 2.0, 0.7], [0.3, 0.4, 0.2, 2.0])
    knots = np.sort(elements.strength / elements.stiffness)
    table = nlfrf.hysteresis.Table(knots, virgin(elements, knots))
    z = walk(5000, rng=2, span=0.3)
    difference = nlfrf.hysteresis.hysteresis_force(elements, z) - nlfrf.hysteresis.hysteresis_force(
        table, z
    )
    assert np.abs(difference).max() < 1e-12


def test_elements_of_one_size_lose_nothing_in_small_motions():
    quarter = np.linspace(0, 0.1, 1001)
    cycle = np.concatenate([quarter, quarter[-2::-1], -quarter[1:], -quarter[-2::-1], quarter[1:]])
    uniform = nlfrf.hysteresis.MaxwellSlip(
        np.full(8, 1 / 8), np.full(8, 1 / 8) * np.linspace(0.4, 3.0, 8)
    )
    assert (
        abs(np.trapezoid(nlfrf.hysteresis.hysteresis_force(uniform, cycle)[1000:], cycle[1000:]))
        < 1e-12
    )


@pytest.mark.parametrize(
    ("z", "F", "message"),
    [
        ([1.0, 2.0], [1.0, 2.5], "F must be concave"),
        ([1.0, 2.0], [1.0, 0.5], "F must be increasing"),
        ([2.0, 1.0], [1.0, 2.0], "z must be positive and increasing, got 1 after 2"),
        ([1.0, 2.0], [1.0], "F must have one force for each"),
        ([0.0], [0.0], "z must be positive and increasing, got 0 after 0"),
    ],
)
def test_curves_that_make_no_hysteresis_are_refused(z, F, message):
    with pytest.raises(ValueError, match=message):
        nlfrf.hysteresis.Table(z, F)


def test_refusals_name_the_parameter():
    with pytest.raises(ValueError, match="K0 must be positive, got 0"):
        nlfrf.hysteresis.Tanh(0, 1)
    with pytest.raises(ValueError, match="Fy must be positive, got -1"):
        nlfrf.hysteresis.Parabola(1, -1)
    with pytest.raises(ValueError, match="strength must be positive for every element, got 0"):
        nlfrf.hysteresis.MaxwellSlip([1.0, 1.0], [1.0, 0.0])
    with pytest.raises(ValueError, match="strength must hold real numbers, got dtype <U1"):
        nlfrf.hysteresis.MaxwellSlip([1.0], ["a"])
    with pytest.raises(ValueError, match="curve must be one of Linear"):
        nlfrf.hysteresis.hysteresis_force(3.0, [1.0])
