"""The check under attack: random loops whose worst case is known by brute force.

A tenth of what was run (benchmarks/bench_robust.py runs 2000 loops): poles near the axis,
resonances of the weight between grid points, unstable and discrete loops, sampled controllers with
fractional delays.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check
from robust.lti.sampling import sampled
from tests.support.precise_loops import unstable_poles, wrongly_stable
from tests.support.random_loops import (
    random_case,
    roots,
    tf_response,
    zpk,
)
from tests.support.responses import response


def model_of(case, perturbation="LTI"):
    lines = np.array([0.5, 1.0])
    radius = 0.5 * np.abs(tf_response(case["w"], lines))
    return UncertaintyModel(
        case["G"], case["w"], case["form"], lines, radius, perturbation=perturbation
    )


def test_poles_that_are_exact():
    """1/(s - 1) with 1 and 1e-12 more of a gain, a pole on the border, and eigenvalues of random
    loops.
    """
    one = control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]])
    gains = (1 - 1e-12, 1.0, 1 + 1e-12)
    assert [unstable_poles(one, control.ss([], [], [], [[gain]])) for gain in gains] == [1, 1, 0]
    assert (
        unstable_poles(
            control.ss([], [], [], [[0.5]], 1), control.ss([[0.5]], [[1.0]], [[1.0]], [[0.25]], 1)
        )
        == 0
    )
    rng = np.random.default_rng(0)
    for _ in range(20):
        case = random_case(rng)
        assert (unstable_poles(case["in_loop"], case["K"]) > 0) == case["unstable"]


@pytest.mark.attack(every=10)
@pytest.mark.parametrize("block", range(10))
def test_never_robust_where_brute_force_finds_a_violation_and_robust_at_099(block):
    rng = np.random.default_rng(1000 + block)
    asked = said = 0
    for _ in range(21):
        case = random_case(rng)
        report = check(model_of(case), case["K"], delay=case["delay"])
        if case["unstable"]:
            assert not wrongly_stable(case, report)
            if report.nominally_stable:
                continue
            assert report.verdict == "not robust"
            assert np.isnan([report.margins.rs, report.margins.rp, report.margins.disk]).all()
            continue
        if case["target"] > 1:
            assert report.verdict != "robust"
        if case["stable"] and case["target"] == 0.99:
            # an inverse form under a sampled controller is judged exactly and proved by a condition
            # that is sufficient
            if case["kind"] != "sampled" or "inverse" not in case["form"]:
                asked += 1
                said += report.verdict == "robust"
            # never above the truth of the dense grid, below it only by what that grid misses
            assert report.margins.rs <= 1 / 0.99 * (1 + 1e-6)
            assert report.margins.rs == pytest.approx(1 / 0.99, rel=2e-3)
    assert said == asked


@pytest.mark.parametrize(
    ("n", "fewest"), [(40, 3), pytest.param(110, 10, marks=pytest.mark.attack)]
)
def test_performance_is_never_promised_where_brute_force_finds_a_violation(n, fewest):
    rng = np.random.default_rng(5)
    angles = np.exp(1j * np.linspace(0, 2 * np.pi, 181))
    promised = asked = 0
    for _ in range(n):
        case = random_case(rng, ("continuous", "discrete"))  # with every alias: in test_aliases
        if not case["stable"] or case["target"] > 0.99:
            continue
        S, a, b, omega = (case[k] for k in ("S", "a", "b", "omega"))
        w_P = zpk(roots(rng, 1), roots(rng, 1), 1.0)
        worst = np.abs(S) * np.max(
            np.abs((1 + a * angles[:, None]) / (1 + b * angles[:, None])), axis=0
        )
        peak = np.max(worst * np.abs(tf_response(w_P, omega)))
        target = float(rng.choice([0.97, 1.01]))
        w_P = control.StateSpace(w_P.A, w_P.B, w_P.C * target / peak, w_P.D * target / peak, 0)
        report = check(model_of(case), case["K"], delay=case["delay"], w_P=w_P)
        assert (
            np.max(report.curves.rp) >= target * 0.99
        )  # but for what lies outside the curve's grid
        if target > 1:
            assert not report.proofs.robust_performance
        elif np.max(report.curves.rp) < 0.99:
            asked += 1
            promised += report.proofs.robust_performance
    assert asked >= fewest
    assert promised == asked


def test_the_two_ways_to_sample_a_plant_agree():
    rng = np.random.default_rng(2)
    from tests.support.random_loops import hold_and_delay

    for _ in range(20):
        G = zpk(roots(rng, 1), roots(rng, 3), 2.0)
        T = 0.02
        delay = float(rng.choice([0.0, 0.3 * T, T, 1.7 * T, 3 * T]))
        omega = np.linspace(1, 150, 30)
        ours = response(sampled(G, T, delay), omega)
        assert ours == pytest.approx(
            tf_response(hold_and_delay(G, T, delay), omega), rel=1e-7, abs=1e-12
        )


@pytest.mark.parametrize("time", [1e-7, 1.0, 1e6])
@pytest.mark.parametrize("gain", [1e-9, 1.0, 1e9])
def test_units_do_not_matter(time, gain):
    """The same loop in other units of time and output has the same verdict and margin."""
    rng = np.random.default_rng(12)
    for _ in range(4):
        G = zpk(roots(rng, 1), roots(rng, 3), 2.0)
        K = zpk(roots(rng, 1), roots(rng, 1), 0.5)
        w = zpk(roots(rng, 1), roots(rng, 1), 0.05)
        scaled = [
            control.StateSpace(s.A / time, s.B / time, s.C * k, s.D * k, 0)
            for s, k in ((G, gain), (K, 1 / gain), (w, 1.0))
        ]
        reports = []
        for (g, k, weight), unit in (((G, K, w), 1.0), (scaled, time)):
            lines = np.array([0.5, 1.0]) / unit
            radius = 0.5 * np.abs(tf_response(weight, lines))
            reports.append(
                check(
                    UncertaintyModel(
                        g, weight, "multiplicative", lines, radius, perturbation="LTI"
                    ),
                    k,
                )
            )
        assert reports[0].verdict == reports[1].verdict
        if reports[0].nominally_stable:
            assert reports[1].margins.rs == pytest.approx(reports[0].margins.rs, rel=1e-6)
            assert reports[1].margins.disk == pytest.approx(reports[0].margins.disk, rel=1e-6)


def test_what_folds_down_counts_in_the_verdict():
    """A perturbation above the Nyquist frequency adds to rs, and the report says what it adds and
    what is assumed.
    """
    G = control.tf([1], [1, 1])
    rising = control.tf([1.0, 0.1], [1e-3, 1])
    model = UncertaintyModel(
        G, rising, "multiplicative", np.array([0.01]), np.array([0.1]), perturbation="LTI"
    )
    sampled_K, continuous = check(model, control.ss([], [], [], [[0.3]], 0.01)), check(model, 0.3)
    assert sampled_K.verdict == "robust"
    assert "all aliases from above included" in sampled_K.proved
    assert sampled_K.folding
    assert not continuous.folding
    assert 1 / sampled_K.margins.rs > 1 / continuous.margins.rs


@pytest.mark.parametrize("n", [2, pytest.param(8, marks=pytest.mark.attack)])
def test_what_folds_down_never_makes_less_of_it(n):
    """Sampled loops with light modes: rs with every alias is at least that of the frequency
    itself.
    """
    rng = np.random.default_rng(0)
    seen = 0
    while seen < n:
        case = random_case(rng, ("sampled",))
        if not case["stable"] or case["target"] > 1:
            continue
        report = check(model_of(case), case["K"], delay=case["delay"])
        seen += 1
        if "adds less than 0.5 %" in report.folding:
            continue
        alone = float(report.folding.split()[0])
        assert 1 / report.margins.rs >= alone * (1 - 6e-3)  # three digits are printed
