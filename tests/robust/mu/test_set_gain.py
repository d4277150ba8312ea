"""The worst gain over a set at all frequencies: above what any plant of the set has, and near
it.
"""

import control
import numpy as np
import pytest

import robust
from benchmarks.bounds import draw_set, try_family, try_set
from robust.mu.set_gain import bound_set_gain
from tests.support.responses import response_by_channel


def loop_with_S(model, K):
    """The loop with S as its performance."""
    return model.loop(K, w_P=control.ss([], [], [], [[1.0]], model.nominal.dt))


@pytest.mark.parametrize("seed", range(3))
def test_no_frequency_of_a_dense_grid_has_a_larger_bound(seed):
    """Modes of damping 1e-4 to 0.1, where a grid of some hundred frequencies sees next to
    nothing.
    """
    model, K = draw_set(np.random.default_rng([1, seed]))
    system = loop_with_S(model, K)
    found = bound_set_gain(system.N, system.structure)
    poles = system.N.poles()
    near = (np.abs(poles)[:, None] + np.abs(poles.real)[:, None] * np.linspace(-6, 6, 61)).ravel()
    omega = np.concatenate([near[near > 0], np.geomspace(1e-3, 1e4, 60)])
    dense = robust.mu.worst_gain(response_by_channel(system.N, omega), system.structure).upper.max()
    assert found.is_proved
    assert dense <= found.upper * (1 + 1e-7)
    assert found.upper <= 1.0011 * found.lower
    assert found.lower <= dense * 1.01 or np.isinf(dense)


def test_a_plant_of_the_set_that_may_be_unstable_has_no_bound():
    model, _ = draw_set(np.random.default_rng([1, 0]))
    wide = robust.UncertaintyModel(
        model.nominal,
        form="input",
        left=(2.0, 2.0),
        right=(1, 1),
        omega=model.omega,
        perturbation="LTI",
    )
    system = loop_with_S(wide, control.ss([], [], [], 5 * np.eye(2)))
    assert np.isinf(bound_set_gain(system.N, system.structure).upper)


def test_without_a_proof_the_number_of_frequencies_is_said():
    model, K = draw_set(np.random.default_rng([1, 0]))
    system = loop_with_S(model, K)
    assert (
        bound_set_gain(system.N, system.structure, time_cap=0.0).reason
        == "undecided: the time limit was reached"
    )
    proved = bound_set_gain(system.N, system.structure)
    assert proved.is_proved
    assert proved.upper == robust.check(model, K).margins.S_worst
    worst = robust.worst_case(model, K)
    assert worst.gain.max() == proved.upper
    assert f"largest gain over the set at most {proved.upper:.4g}; the plant" in str(worst)
    assert worst.achieved <= proved.upper


@pytest.mark.filterwarnings("ignore:weights were made diagonal")
@pytest.mark.parametrize(
    ("draw", "seeds"),
    [(try_set, range(3)), pytest.param(try_family, range(3), marks=pytest.mark.attack)],
)
def test_the_harness_finds_nothing_above_a_bound(draw, seeds):
    """A part of `python -m benchmarks.bounds`."""
    for seed in seeds:
        found = draw(np.random.default_rng([0, seed]))
        assert found is None or found[0] / found[1] <= 1 + 1e-6
