"""Hum of the mains in one set of experiments with several inputs: named with its output, and
held.
"""

import warnings

import numpy as np
import pytest

from benchmarks import hum
from nlfrf import DataWarning, identify


@pytest.mark.parametrize("n_inputs", [2, 3])
def test_it_is_named_and_held(n_inputs):
    told = 0
    for number in range(6):
        ms, record = hum.set_of(number, n_inputs, size=0.2)
        before = identify(hum.set_of(number, n_inputs)[1])
        with warnings.catch_warnings(record=True) as said:
            warnings.simplefilter("always", DataWarning)
            after = identify(record)
        k = int(np.argmin(np.abs(ms.f - 50)))
        if not any("G of y2 differs from its neighbours at 50" in str(one.message) for one in said):
            continue
        told += 1
        off = np.abs(after.G - before.G)[1, :, k]
        assert np.all(off < 1.3 * after.bound()[1, :, k])
        assert off.max() > 2 * before.bound()[1, :, k].max()
        np.testing.assert_allclose(after.bound()[0, :, k], before.bound()[0, :, k], rtol=0.05)
    assert told >= 4


def test_sound_sets_stand_out_nowhere():
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*differs")
        for number in range(40):
            kind = ("special-odd", "random-odd")[number % 2]
            how = dict(kind=kind, cubic=0.1 * (number % 3), noise=0.01 * (number % 4))
            identify(hum.set_of(number, 2 + number % 2, **how)[1])


def test_rounding_of_a_linear_machine_stands_out_nowhere():
    """Without noise and distortion the level is rounding, and one line of it was called a hum."""
    with warnings.catch_warnings():
        warnings.filterwarnings("error", message=".*differs")
        for number in range(20):
            identify(hum.set_of(number, 2 + number % 2, cubic=0.0, noise=0.0)[1])
