"""Bounds of mu, of the worst gain and of how far the uncertainty may grow hold at every frequency,
and are attained.
"""

import control
import numpy as np
import pytest

import robust
from benchmarks.bounds_mu import compare
from robust.models import Block, interconnection


def mode(k):
    """s^2 + (1 + k d) s + 1, from the parameter d and a force to its velocity and the position."""
    return control.ss([[0, 1], [-1, -1]], [[0, 0], [-k, 1]], [[0, 1], [1, 0]], np.zeros((2, 2)))


@pytest.mark.parametrize(("k", "damping"), [(0.9, 0.1), (0.5, 0.5)])
def test_a_parameter_that_counts_at_one_frequency_between_all_lines(k, damping):
    N, real = mode(k), [(1, 1, "real")]
    mu, gain = robust.mu.bounds(N[0, 0], real), robust.mu.worst_gain(N, real)
    assert mu.lower.max() == pytest.approx(k, rel=1e-6)
    assert k <= mu.upper.max() < 1.01 * k
    true = 1 / (damping * np.sqrt(1 - damping**2 / 4))
    assert gain.lower.max() == pytest.approx(true, rel=1e-4)
    assert true <= gain.upper.max() < 1.06 * true
    for found in (mu, gain):
        assert all(one.holds for one in found.certificates)
        assert "at every frequency" in str(found)
        k = found.lower.argmax()
        M = N(1j * found.omega[k])
        loop = 1 - M[0, 0] * found.delta[0, 0, k]
        if found is mu:
            assert abs(loop) < 1e-6
        else:
            assert abs(M[1, 1] + M[1, 0] * found.delta[0, 0, k] * M[0, 1] / loop) == pytest.approx(
                found.lower[k], rel=1e-6
            )


def test_the_worst_gain_of_a_set_with_an_unstable_plant_is_infinite_and_mu_a_number():
    N, real = mode(1.2), [(1, 1, "real")]
    gain = robust.mu.worst_gain(N, real)
    assert np.isinf(gain.lower.max())
    assert np.isinf(gain.upper.max())
    k = gain.lower.argmax()
    assert abs(gain.delta[0, 0, k]) <= 1
    assert abs(1 - N(1j * gain.omega[k])[0, 0] * gain.delta[0, 0, k]) < 1e-6
    assert 1.2 <= robust.mu.bounds(N[0, 0], real).upper.max() < 1.22
    unstable = control.ss([[1.0]], [[1.0, 1.0]], [[1.0], [1.0]], np.zeros((2, 2)))
    assert np.isinf(robust.mu.worst_gain(unstable, [(1, 1)]).lower.max())
    found = robust.mu.bounds(
        unstable[0, 0], [(1, 1, "real")]
    )  # s - 1 - d: a pole at zero where d = -1
    assert found.lower.max() == pytest.approx(1, rel=1e-6)
    assert 1 <= found.upper.max() < 1.05


def test_what_was_only_looked_at_says_on_how_many_lines():
    N, real = mode(0.9), [(1, 1, "real")]
    assert "on 3 lines" in str(robust.mu.bounds(N[0, 0], real, [0.5, 1.5, 2.0]))
    assert "on 2 lines" in str(
        robust.mu.worst_gain(control.frd(N(1j * np.array([0.5, 2.0])), [0.5, 2.0]), real)
    )
    on_axis = robust.mu.bounds(control.ss([[0.0]], [[1.0]], [[1.0]], [[0.0]]), [(1, 1)])
    assert not on_axis.certificates
    assert "not proved between lines: the system is unstable" in on_axis.reason
    assert "on 120 lines" in str(on_axis)


def test_a_matrix_has_one_value_at_every_frequency():
    found = robust.mu.bounds(control.ss([], [], [], [[2, 2], [-1, -1]]), [(1, 1), (1, 1)])
    assert str(found) == "mu between 3 and 3"


@pytest.mark.parametrize(
    ("seed", "complex_block"),  # one parameter beside a complex block, and two parameters
    [
        pytest.param(
            seed, complex_block, marks=pytest.mark.attack if seed + 1 - complex_block else ()
        )
        for complex_block in (True, False)
        for seed in range(12)
    ],
)
def test_no_search_exceeds_the_bounds(seed, complex_block):
    found = compare(seed, complex_block=complex_block)
    assert found["mu"] > 1 - 1e-6
    assert found["gain"] > 1 - 1e-6
    assert found["proved"]
    assert found["mu, own"] < 1.1
    assert found["gain, own"] < 1.1


def test_a_complex_block_is_followed_to_its_peak():
    """2/(s^2 + 0.2 s + 1) peaks at sqrt(0.98) rad/s."""
    N = control.ss(control.tf([2], [1, 0.2, 1]))
    found = robust.mu.bounds(N, [(1, 1)])
    norm = 2 / (0.2 * np.sqrt(1 - 0.01))
    assert found.lower.max() == pytest.approx(norm, rel=1e-5)
    assert found.omega[found.lower.argmax()] == pytest.approx(np.sqrt(1 - 0.02), rel=1e-3)


def system(k):
    """The mode with the parameter by name."""
    N = mode(k)
    N = control.ss(N.A, N.B, N.C, N.D, inputs=["b", "f"], outputs=["v", "x"])
    return interconnection([N], {"damping": Block("v", "b", kind="real")}, inputs="f", outputs="x")


def test_robgain_in_closed_form_and_worst_gain_read_the_other_way():
    """Where the damping has fallen to 0.5 the gain is 1/(0.5 sqrt(1 - 1/16))."""
    level = 2 / np.sqrt(1 - 1 / 16)
    found = robust.robgain(system(0.8), level)
    assert found.broken == pytest.approx(0.5 / 0.8, rel=1e-4)
    assert found.broken / 1.05 < found.proved < found.broken
    assert found.worst == pytest.approx({"damping": -0.5 / 0.8}, rel=1e-4)
    assert found.omega == pytest.approx(np.sqrt(1 - 1 / 8), rel=1e-3)
    assert all(one.holds for one in found.certificates)
    N = system(0.8 * found.broken).N
    assert robust.mu.worst_gain(N, [(1, 1, "real")]).lower.max() == pytest.approx(level, rel=1e-3)


def test_robgain_is_zero_where_the_nominal_reaches_the_level_and_ends_where_the_loop_does():
    assert robust.robgain(system(0.8), 1.0).broken == 0
    found = robust.robgain(system(0.8), 1e9)
    assert found.broken == pytest.approx(1 / 0.8, rel=1e-4)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: robust.robgain(mode(1.0), 1.0), "system must be an UncertainSystem"),
        (lambda: robust.robgain(system(1.0), 0), "level must be positive"),
    ],
)
def test_robgain_refuses(call, message):
    with pytest.raises(ValueError, match=message):
        call()
