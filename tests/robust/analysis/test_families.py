"""A seeded part of `benchmarks.soundness`: families of loops on which checks go wrong, each with
its truth.
"""

import warnings

import numpy as np
import pytest

from benchmarks.soundness import WRONG, judged
from tests.support.random_families import FAMILIES


@pytest.mark.parametrize("name", FAMILIES)
@pytest.mark.parametrize("n", [4, pytest.param(9, marks=pytest.mark.attack)])
def test_no_wrong_verdict_no_refusal_nothing_open(name, n):
    rng, seen = np.random.default_rng([7, list(FAMILIES).index(name)]), set()
    for _ in range(n):
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # of the random designs
            case = FAMILIES[name](rng)
        found, report, _ = judged(case)
        assert not set(found) & set(WRONG), (
            found,
            report.reason,
            case["form"],
            case["kind"],
            case["target"],
        )
        seen.update(found)
    assert seen & {"violations", "at 0.99"}
