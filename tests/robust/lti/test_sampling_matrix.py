"""`sampled` and `discretize` of several inputs and outputs: entry by entry what they are of one."""

import control
import numpy as np
import pytest

from robust import sampled, step_response
from robust.lti import discretize

DT = 0.1
PLANT = control.StateSpace(
    [[-1.0, 0.5, 0], [0, -2, 1], [0.2, 0, -3]],
    [[1.0, 0], [0.3, 1], [0, 2]],
    [[1.0, 0, 1], [0, 1, 0]],
    [[0, 0.5], [0, 0]],
)
Z = np.exp(1j * np.linspace(0.1, 3, 20))


@pytest.mark.parametrize("delay", [0.0, 0.03, 0.1, 0.25])
def test_sampled_entry_by_entry(delay):
    whole = sampled(PLANT, DT, delay)
    for j, i in np.ndindex(2, 2):
        one = control.StateSpace(PLANT.A, PLANT.B[:, [i]], PLANT.C[[j]], PLANT.D[[j]][:, [i]])
        np.testing.assert_allclose(
            whole(Z)[j, i], sampled(one, DT, delay)(Z), rtol=1e-9, atol=1e-12
        )


def test_discretize_is_tustin():
    K = discretize(PLANT, DT)
    np.testing.assert_allclose(K(Z), PLANT(2 / DT * (Z - 1) / (Z + 1)), rtol=1e-9)
    assert K.dt == DT


def test_all_inputs_are_behind_the_same_delay():
    """A step through the loop, sample by sample: the plant reads u of three samples ago."""
    G, K = sampled(PLANT, DT), np.array([[0.5, 0.1], [-0.2, 0.4]])
    for j in range(2):
        found = step_response(G, K, delay=3 * DT, reference=j)
        x, u = np.zeros(3), [np.zeros(2)] * 3
        for k in range(found.t.size):
            y = G.C @ x + G.D @ u[k]
            assert found.y[:, k] == pytest.approx(y, abs=1e-9)
            u.append(K @ (np.eye(2)[j] - y))
            assert found.u[:, k] == pytest.approx(u[-1], abs=1e-9)
            x = G.A @ x + G.B @ u[k]
        assert found.t.size > 20


def test_a_continuous_delay_of_all_inputs_is_near_the_delay_itself():
    """Until twice the delay the loop has not read its own answer: a step of K behind the delay."""
    K, delay = np.array([[0.5, 0.1], [-0.2, 0.4]]), 0.2
    plant = control.StateSpace(PLANT.A, PLANT.B, PLANT.C, np.zeros((2, 2)))
    for j in range(2):
        found = step_response(plant, K, delay=delay, reference=j)
        seen = (found.t > 1.2 * delay) & (found.t < 2 * delay)
        assert seen.sum() > 10
        late = np.concatenate([[0.0], found.t[seen] - delay])
        wanted = control.forced_response(
            control.ss(PLANT.A, PLANT.B @ K, PLANT.C, 0),
            np.linspace(0, delay, 2001),
            np.outer(np.eye(2)[j], np.ones(2001)),
        )
        for row, curve in zip(found.y, wanted.outputs, strict=True):
            assert row[seen] == pytest.approx(np.interp(late[1:], wanted.time, curve), abs=1e-3)
