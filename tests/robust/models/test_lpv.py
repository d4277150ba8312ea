"""Models that go with an operating point: polynomials through given systems, and what is
refused.
"""

import control
import numpy as np
import pytest

from robust.models import LpvModel


def spring(k, c=1.0):
    return control.ss([[0, 1], [-k, -c]], [[0], [1]], [[1, 0]], 0)


def test_polynomials_pass_through_the_points():
    points = [-0.3, 0.0, 0.1, 0.5]
    systems = [spring(1 + p + 3 * p**3, 2 - p**2) for p in points]
    model = LpvModel.from_points(systems, at=points)
    for p, system in zip(points, systems, strict=True):
        assert np.allclose(model.at(p).A, system.A, rtol=1e-13, atol=1e-13)
    assert np.allclose(
        model.at(0.37).A, spring(1 + 0.37 + 3 * 0.37**3, 2 - 0.37**2).A
    )  # cubic: everywhere
    assert not model.B[1:].any(), "what is the same at every point does not go with it, exactly"


def test_a_lower_degree_is_the_closest():
    points = np.linspace(0, 1, 5)
    stiffness = np.array([3.0, 4.1, 5.0, 5.9, 7.0])
    model = LpvModel.from_points([spring(k) for k in stiffness], at=points, degree=1)
    assert np.allclose(-model.at(0.3).A[1, 0], np.polyval(np.polyfit(points, stiffness, 1), 0.3))


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"at": [0.0]}, "at must be at least two operating points that increase, got one"),
        ({"at": [0.0, 0.0]}, "at must be at least two operating points that increase"),
        ({"at": [1.0, 0.0]}, "at must be at least two operating points that increase"),
        ({"at": [0.0, 1.0, 2.0]}, "at must have one operating point for each system, got 3 for 2"),
        ({"degree": 2}, "degree must be at most 1 for 2 operating points, got 2"),
        (
            {"over": "level"},
            r"over must be a position, a load .* got 'level': a BLA at a level is an average",
        ),
        ({"form": "coprime"}, "form must be one of"),
        ({"systems": [spring(1.0), control.ss(-1, 1, 1, 0)]}, "systems must have the same states"),
        ({"systems": [spring(1.0), "plant"]}, "systems must be a control.StateSpace"),
        (
            {"systems": [control.tf([1], [1, 1, k]) for k in (1.0, 2.0)]},
            "systems must be state-space systems .* got a transfer function",
        ),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    given = {"systems": [spring(1.0), spring(2.0)], "at": [0.0, 1.0]} | change
    with pytest.raises(ValueError, match=message):
        LpvModel.from_points(given.pop("systems"), **given)


def test_a_point_outside_the_range_is_refused():
    model = LpvModel.from_points([spring(1.0), spring(2.0)], at=[0, 1], over="position", unit="m")
    with pytest.raises(ValueError, match="point must lie in position from 0 to 1 m, got"):
        model.at(1.5)
