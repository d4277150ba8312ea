"""Bounds on intervals are bounds: against the curve itself, densely sampled, and as proofs without any grid before."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, performance_weight
from robust.analysis.loop import assemble
from robust.analysis.proofs import parts
from robust.proofs.search.stability import product, prove_loop
from tests.support.random_loops import FORMS, random_case, roots, tf_response, zpk

LINES = np.array([0.5, 1.0])


def loop_of(case, w, w_P=None):
    model = UncertaintyModel(case["G"], w, case["form"], LINES, 0.1 * np.abs(tf_response(w, LINES)), perturbation="LTI")
    return assemble(model, case["K"], w_P, case["delay"])


def scaled(system, factor):
    return control.StateSpace(system.A, system.B, system.C * factor, system.D * factor, system.dt)


def intervals_of(rng, loop, n=60):
    """Middles and half-widths all over the axis: anywhere, and close to the roots of the loop and of its weights."""
    size = np.concatenate([np.abs(s.poles()) for s in (loop.short, loop.K, loop.weight) if s.nstates] + [[1.0]])
    if loop.dt:
        m = loop.top * rng.uniform(0.05, 0.9, n) ** 3
    else:
        m = rng.choice(size + 1e-3, n) * 10 ** (rng.normal(size=n) * rng.choice([1e-5, 0.1, 1.0], n))
    return m, m * 10 ** rng.uniform(-6, -0.05, n) * np.minimum(1, loop.top / m - 1 if loop.dt else 1)


@pytest.mark.parametrize("form", FORMS)
def test_the_bound_on_an_interval_is_above_the_curve_everywhere_on_it(form):
    rng = np.random.default_rng(FORMS.index(form))
    inside = np.linspace(-1, 1, 41)
    loops = tight = 0
    while loops < 8:
        case = random_case(rng)
        if case["form"] != form or not case["stable"]:
            continue
        loops += 1
        w_P = zpk(roots(rng, 1), roots(rng, 2, lightest=-4), 0.3)
        for performance in (False, True):
            loop = loop_of(case, scaled(case["w"], 0.5), w_P)
            whole = parts(loop, performance=performance)
            m, h = intervals_of(rng, loop)
            bound = whole.bound(
                [part.at(m) for part in whole.parts],
                [part.spread(m, h) for part in whole.parts],
                whole.relative.spread(m, h),
            )
            omega = (m[:, None] + h[:, None] * inside).ravel()
            curve = whole.exact([part.at(omega) for part in whole.parts]).reshape(m.size, -1)
            largest = np.nan_to_num(curve).max(axis=1)
            assert np.all(bound >= largest * (1 - 1e-7))
            tight += np.sum(bound < 1.1 * largest)
            if not loop.dt:
                end = 3e3 * max(
                    np.abs(r).max(initial=1.0) for part in whole.parts for z, p, _ in part.roots for r in (z, p)
                )
                beyond = end * np.geomspace(1, 1e6, 400)
                last = whole.bound(
                    [part.at(np.array([end])) for part in whole.parts],
                    [part.tail(end) for part in whole.parts],
                    whole.relative.tail(end),
                )[0]
                assert last >= np.max(whole.exact([part.at(beyond) for part in whole.parts])) * (1 - 1e-7)
    assert tight > 150  # and it is of use


def test_spread_of_a_product_with_delay():
    """Values of a response with delay stay in the disc and between the magnitudes, zeros on the axis included."""
    rng = np.random.default_rng(0)
    G = zpk(np.array([0, 3j, -3j]), np.array([-0.1 + 2j, -0.1 - 2j, 0, -1]), 1.0)
    for part in (product(G, delay=0.7), product(control.tf2ss([1.0], [1, 2]), over=(G,), delay=-0.7)):
        m = 10 ** rng.uniform(-2, 2, 400)
        h = m * 10 ** rng.uniform(-5, -0.01, 400)
        radius, up, low = part.spread(m, h)
        values = (
            part.at((m[:, None] + h[:, None] * np.linspace(-1, 1, 31)).ravel()).reshape(400, -1) / part.at(m)[:, None]
        )
        assert np.all(np.abs(values - 1).max(axis=1) <= radius * (1 + 1e-9) + 1e-12)
        assert np.all(np.abs(values).max(axis=1) <= up * (1 + 1e-9))
        assert np.all(np.abs(values).min(axis=1) >= low * (1 - 1e-9) - 1e-12)


def test_the_proof_stands_without_a_grid():
    """Peaks of 1.0002, 1.003 and 0.9995 by brute force; nothing but the intervals looks for them."""
    rng = np.random.default_rng(8)
    tried = 0
    while tried < 10:
        case = random_case(rng, ("continuous", "discrete"))  # a sampled set is proved with every alias
        if not case["stable"]:
            continue
        tried += 1
        for target in (1.0002, 1.003, 0.9995):
            loop = loop_of(case, scaled(case["w"], target / case["target"]))
            outcome = prove_loop(parts(loop, performance=False), LINES, loop.top, time_cap=5)
            assert outcome.holds == (target < 1)
            if outcome.holds:  # without gaps from zero to the top
                assert outcome.intervals[0, 0] == 0
                assert outcome.intervals[-1, 1] == loop.top
                assert outcome.intervals[1:, 0] == pytest.approx(outcome.intervals[:-1, 1], rel=1e-12)


def test_no_time_no_proof():
    model = UncertaintyModel(control.tf([1], [1, 1]), 0.3, "multiplicative", LINES, np.full(2, 0.3))
    loop = assemble(model, 1.0, performance_weight(0.1), 0.0)
    outcome = prove_loop(parts(loop, performance=True), LINES, loop.top, time_cap=0.0)
    assert not outcome.holds
    assert "undecided" in outcome.reason
