"""`sampled` and `discretize` of several inputs and outputs: entry by entry what they are of one."""

import control
import numpy as np
import pytest

from robust import sampled
from robust.lti import discretize
from robust.lti.sampling import delayed

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


def test_delayed_entry_by_entry():
    """All inputs behind the same delay: samples in discrete time, an all-pass near exp(-s delay)
    otherwise.
    """
    late = delayed(sampled(PLANT, DT), 2 * DT, order=0)
    np.testing.assert_allclose(late(Z), sampled(PLANT, DT)(Z) * Z**-2.0, rtol=1e-9, atol=1e-12)
    s = 1j * np.linspace(0.1, 5, 9)
    np.testing.assert_allclose(
        delayed(PLANT, 0.2, order=6)(s), PLANT(s) * np.exp(-0.2 * s), rtol=1e-6, atol=1e-9
    )
