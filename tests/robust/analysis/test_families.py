"""A seeded part of `benchmarks.soundness`: families of loops on which checks go wrong, each with
its truth.
"""

import warnings

import control
import numpy as np
import pytest

import robust
from benchmarks.soundness import WRONG, judged
from robust import UncertaintyModel, check, worst_case
from robust.analysis import check_structure
from robust.models.sets.interconnection import Block, interconnection
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


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_every_check_decides_close_to_the_boundary(dt):
    """K = -1 puts the pole of 1/(s + 1) on the axis, its neighbour does not: every check decides
    both, and rightly.
    """
    G = (
        control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
        if not dt
        else control.ss([[0.5]], [[1]], [[1]], [[0]], dt)
    )
    limit = -1.0 if not dt else -0.5
    model = UncertaintyModel(
        G, 1e-17, "multiplicative", np.array([1.0]), np.array([1e-18]), perturbation="LTI"
    )
    for gain, stable in ((limit, False), (np.nextafter(limit, 0), True)):
        K = control.ss([], [], [], [[gain]], dt)
        report = check(model, K, certify=False)
        assert report.nominally_stable == stable
        assert "on the stability boundary or beyond it" in report.reason or stable
        beside = robust.margins.disk_margin(
            G * control.ss([], [], [], [[gain * (1 - 1e-13 * stable)]], dt)
        )  # the sum rounds
        assert (beside.alpha > 0) == stable
        if stable:
            assert worst_case(model, K).gain.max() > 1e7
        else:
            with pytest.raises(ValueError, match="on the stability boundary or beyond it"):
                worst_case(model, K)
    plant = control.ss(
        G.A, np.hstack([G.B] * 2), G.C, np.zeros((1, 2)), dt, inputs=["u", "d"], outputs=["y"]
    )
    for gain, stable in ((limit, False), (limit * (1 - 1e-13), True)):
        K = control.ss([], [], [], [[-gain]], dt, inputs=["y"], outputs=["u"])
        report = check_structure(interconnection([plant, K], {"d": Block("y", "d", 1e-18)}))
        assert report.nominally_stable == stable
        assert report.verdict != "not certified" or stable
    for A, stable in (([[0.0, 1.0], [-1.0, 0.0]], False), ([[0.0, 1.0], [-1.0, -5e-324]], True)):
        system = control.ss(A, [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
        alone = UncertaintyModel(
            system, 1e-17, "multiplicative", np.array([1.0]), np.array([1e-18]), perturbation="LTI"
        )
        assert check(alone, 0.0, certify=False).nominally_stable == stable
