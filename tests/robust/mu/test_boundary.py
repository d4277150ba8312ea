"""Loops that lie on the boundary of robustness as they are written down: no bound of mu claims
them, whichever way the loop was rounded when it was put together."""

import control
import numpy as np
import pytest

import robust
from robust.analysis import check_structure
from robust.models import Block, interconnection


def turned(rng, A, B, C):
    """Other coordinates, in which doubles no longer hold the loop exactly."""
    T = rng.standard_normal(A.shape)
    back = np.linalg.inv(T)
    return T @ A @ back, T @ B, C @ back


def slow_pole(seed):
    """s + a - r1 d1 - r2 d2 - ..., with a = r1 + r2 + ..., beside faster modes: all parameters at
    one put s = 0.
    """
    rng = np.random.default_rng(seed)
    n, m = int(rng.integers(2, 5)), int(rng.integers(1, 4))
    r = np.round(rng.uniform(0.1, 1, m), 2)
    A, B, C = np.diag([-r.sum(), *-rng.uniform(1, 50, n - 1)]), np.zeros((n, m)), np.zeros((1, n))
    B[0], C[0, 0] = 1, 1
    names = [f"d{k}" for k in range(m)]
    plant = control.ss(*turned(rng, A, B, C), np.zeros((1, m)), inputs=names, outputs=["y"])
    kinds = ["real"] * (m - 1) + [["real", "full"][seed % 2]]
    return [plant], {
        d: Block("y", d, float(size), kind=kind)
        for d, size, kind in zip(names, r, kinds, strict=True)
    }


def light_mode(seed):
    """s^2 + (c - c d) s + w^2: d = 1 takes all of the damping."""
    rng = np.random.default_rng(seed)
    w, c = 10 ** rng.uniform(-2, 3), float(np.round(rng.uniform(0.1, 1), 2))
    A, B, C = turned(
        rng, np.array([[0, 1], [-w * w, -c]]), np.array([[0.0], [1.0]]), np.array([[0.0, 1.0]])
    )
    plant = control.ss(A, B, C, [[0.0]], inputs=["d"], outputs=["y"])
    return [plant], {"d": Block("y", "d", c, kind="real")}


@pytest.mark.parametrize("make", [slow_pole, light_mode])
@pytest.mark.parametrize(
    "seeds",
    [
        range(1),
        *(
            pytest.param(seeds, marks=pytest.mark.attack)
            for seeds in (range(1, 10), range(10, 20), range(100, 110))
        ),
    ],
    ids=lambda seeds: f"{seeds[0]}",
)
def test_on_the_boundary_nothing_is_robust(make, seeds):
    for seed in seeds:
        systems, blocks = make(seed)
        report = check_structure(interconnection(systems, blocks))
        assert report.verdict != "robust", (seed, report.margins.rs)
        assert report.margins.rs == pytest.approx(1, abs=1e-6) or report.margins.rs < 1


@pytest.mark.attack(every=6)
@pytest.mark.parametrize("seed", range(6))
def test_a_little_inside_it_still_is(seed):
    systems, blocks = slow_pole(seed)
    smaller = {
        name: Block(block.reads, block.drives, 0.9999 * float(block.size.D[0, 0]), kind=block.kind)
        for name, block in blocks.items()
    }
    assert check_structure(interconnection(systems, smaller)).verdict == "robust"


def test_the_slack_is_on_mu_and_not_on_a_norm_near_one():
    """mu(0) = 1 - 1e-7 with a real parameter: below one, and not by the slack that a proof in
    doubles has.
    """
    for below, holds in ((1e-7, False), (1e-4, True)):
        N = control.ss([[-1.0]], [[1.0]], [[1 - below]], [[0.0]])
        assert robust.mu.certify(N, [(1, 1, "real")]).holds == holds
