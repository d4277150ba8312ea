"""Random structures, plants and limits: nothing met that a dense look finds violated, no loop
unstable.
"""

import numpy as np
import pytest

import robust
from tests.support.random_tunings import random_tuning, violation


@pytest.mark.attack(every=6)
@pytest.mark.parametrize("seed", range(300, 312))
def test_what_is_met_is_met_on_a_dense_grid(seed):
    arguments = random_tuning(np.random.default_rng([1, seed]), n_starts=1, time_cap=60.0)
    design = robust.tune(**arguments)  # warnings are errors, but for what other packages deprecate
    assert violation(design) == ""
    assert "robust" not in str(design).replace("robustly", "").split("check()")[0]
