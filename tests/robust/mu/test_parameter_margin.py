"""Branch and bound over real parameters: closed forms, brute force, boxes that fill the box,
stability inside.
"""

import itertools

import control
import numpy as np
import pytest

import robust


def loop(rng, n, sizes, damping=0.1):
    A = rng.standard_normal((n, n))
    A = A - (np.linalg.eigvals(A).real.max() + damping) * np.eye(n)
    m = sum(sizes)
    return control.ss(A, rng.standard_normal((n, m)), rng.standard_normal((m, n)), np.zeros((m, m)))


def farthest(N, sizes, x):
    """Largest real part of the poles with these parameters, (K, r) of them."""
    d = np.repeat(x, sizes, axis=1)
    return np.linalg.eigvals(N.A + N.B @ (d[:, :, None] * N.C)).real.max(axis=1)


def judge(found, N, sizes, gap=0.05):
    """What any result has to fulfil: boxes fill the box, all of it is stable, and the worst is on
    the boundary.
    """
    assert found.met
    assert found.broken <= found.proved * (1 + gap)
    assert all(certificate.holds for certificate in found.certificates)
    assert len(found.certificates) == len(found.boxes)
    low, high = found.boxes[..., 0], found.boxes[..., 1]
    assert np.prod(high - low, axis=1).sum() == pytest.approx(2.0 ** len(sizes))
    for a, b in itertools.combinations(range(len(low)), 2):
        assert np.any((low[a] >= high[b]) | (low[b] >= high[a]))
    rng = np.random.default_rng(1)
    corners = np.array(list(itertools.product((-1.0, 1.0), repeat=len(sizes))))
    inside = np.concatenate([corners, rng.uniform(-1, 1, (3000, len(sizes)))])
    assert farthest(N, sizes, found.proved * inside).max() < 0
    assert np.abs(found.worst).max() == pytest.approx(1)
    assert abs(farthest(N, sizes, found.broken * found.worst[None])[0]) < 1e-6 * np.linalg.norm(N.A)


def test_two_parameters_against_brute_force():
    sizes = (2, 2)
    N = loop(np.random.default_rng(0), 4, sizes, 0.4)
    found = robust.mu.parameter_margin(N, [(2, 2, "real")] * 2)
    judge(found, N, sizes)
    t = np.linspace(-1, 1, 201)
    edge = np.concatenate([np.column_stack([t, 0 * t + side]) for side in (-1, 1)])
    edge = np.concatenate([edge, edge[:, ::-1]])
    brute = next(k for k in np.geomspace(0.1, 1, 1000) if farthest(N, sizes, k * edge).max() > 0)
    assert found.broken == pytest.approx(brute, rel=0.01)


@pytest.mark.attack
def test_a_gap_of_27_per_cent_is_closed_by_cutting_the_box():
    """Three parameters in two places each: mu with real blocks alone proves 0.0423, and 0.0539
    breaks the loop.
    """
    sizes = (2, 2, 2)
    N = loop(np.random.default_rng(2), 6, sizes)
    found = robust.mu.parameter_margin(N, [(2, 2, "real")] * 3)
    judge(found, N, sizes)
    assert len(found.boxes) > 1
    assert found.proved > 0.05


def test_a_parameter_that_breaks_between_the_lines_of_any_grid():
    """s^2 + 0.02 s + 1 + d: unstable for d < -1 at zero frequency; for d > -1 never."""
    N = control.ss([[0.0, 1.0], [-1.0, -0.02]], [[0.0], [-1.0]], [[1.0, 0.0]], [[0.0]])
    found = robust.mu.parameter_margin(N, [(1, 1, "real")], gap=0.01)
    judge(found, N, (1,), 0.01)
    assert found.broken == pytest.approx(1.0, rel=1e-6)
    assert found.worst.tolist() == pytest.approx([-1.0])
    assert found.omega == pytest.approx(0.0, abs=1e-6)


def test_beside_a_complex_block_and_sampled():
    """s + 5 - 2.5 d1 + 2 d2 with d2 complex:

    5 of 4.5; the same sampled, as the bilinear map keeps it.
    """
    N = control.ss([[-5.0]], [[2.5, -2.0]], [[1.0], [1.0]], np.zeros((2, 2)))
    found = robust.mu.parameter_margin(N, [(1, 1, "real"), (1, 1)])
    assert found.met
    assert found.broken == pytest.approx(5 / 4.5, rel=1e-3)
    assert found.proved <= 5 / 4.5
    discrete = control.sample_system(N, 0.1, method="bilinear")
    again = robust.mu.parameter_margin(discrete, [(1, 1, "real"), (1, 1)])
    assert again.broken == pytest.approx(5 / 4.5, rel=1e-3)


def test_the_most_parts_are_said():
    N = loop(np.random.default_rng(2), 4, (1, 1))
    found = robust.mu.parameter_margin(N, [(1, 1, "real")] * 2, max_boxes=1, gap=1e-3)
    assert not found.met
    assert found.reason
    assert found.proved < found.broken


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda N: robust.mu.parameter_margin(N, [(1, 1)]), "blocks must contain a real one"),
        (lambda N: robust.mu.parameter_margin(N, [(2, 2, "real")]), "blocks must add up"),
        (
            lambda N: robust.mu.parameter_margin(
                control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]]), [(1, 1, "real")]
            ),
            "must be stable",
        ),
        (lambda N: robust.mu.parameter_margin(N, [(1, 1, "real")], gap=0), "gap must be positive"),
        (
            lambda N: robust.mu.parameter_margin(N, [(1, 1, "real")], max_boxes=0),
            "max_boxes must be",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call(control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]]))
