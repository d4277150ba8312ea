"""The check under attack: random loops whose worst case is known by brute force.

A tenth of what was run (benchmarks/bench_robust.py runs 2000 loops): poles near the axis,
resonances of the weight between grid points, unstable and discrete loops, sampled controllers with
fractional delays.
"""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, performance_weight
from robust.lti.sampling import sampled
from tests.support.precise_loops import unstable_poles, wrongly_stable
from tests.support.random_loops import (
    closed_loop_poles,
    curves,
    dense_grid,
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


@pytest.mark.attack(every=6)
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


def test_a_peak_narrower_than_any_grid():
    """|w T| peaks over a relative width of 1e-7 between the lines; only a proof can know."""
    w = control.tf([1, 2e-6, 1.0], [1, 2e-7, 1.0])  # magnitude ten at omega = 1, one elsewhere
    lag = control.tf([1], [1, 1])
    # T = 0.25/(s + 1.25): |T(j)| = 0.156, so w T reaches 1.56 at 1 rad/s and 0.2 elsewhere
    model = UncertaintyModel(
        lag, w, "multiplicative", np.array([0.1, 10.0]), np.array([0.5, 0.5]), perturbation="LTI"
    )
    report = check(model, 0.25)
    assert report.verdict == "not robust"
    assert check(model, 0.1).verdict == "robust"  # T(j)/0.156 = 0.43


def test_hidden_unstable_modes_are_found():
    """The unstable pole of the plant is cancelled by the controller: the response looks fine, the
    loop is not.
    """
    G, K = control.tf([1], [1, -1]), control.tf([5, -5], [1, 3])
    report = check(
        UncertaintyModel(
            G, 0.1, "multiplicative", np.array([1.0]), np.array([0.05]), perturbation="LTI"
        ),
        K,
    )
    assert not report.nominally_stable
    assert report.verdict == "not robust"
    inside = control.tf(
        [1, -1], [1, 0, -1]
    )  # (s - 1)/((s - 1)(s + 1)), cancelled inside one transfer function
    report = check(
        UncertaintyModel(inside, 0.1, "multiplicative", np.array([1.0]), np.array([0.05])), 0.1
    )
    assert not report.nominally_stable


def test_a_hidden_integrator_is_not_called_stable():
    G, K = control.tf([1, 0], [1, 2, 1]), control.tf([1], [1, 0])
    report = check(
        UncertaintyModel(
            G, 0.1, "multiplicative", np.array([1.0]), np.array([0.05]), perturbation="LTI"
        ),
        K,
    )
    assert not report.nominally_stable
    assert report.verdict in ("not robust", "not certified")


def test_a_continuous_loop_with_delay_is_checked_with_the_delay_itself():
    """K/(s + 1) with delay: unstable from a delay on that is known in closed form; Padé is only a
    tool.
    """
    G, K = control.tf([1], [1, 1]), 5.0
    omega_c = np.sqrt(24.0)
    limit = (np.pi - np.arctan(omega_c)) / omega_c
    model = UncertaintyModel(
        G, 0.05, "multiplicative", np.array([1.0]), np.array([0.05]), perturbation="LTI"
    )
    assert check(model, K, delay=1.02 * limit).verdict == "not robust"
    rng = np.random.default_rng(3)
    for form in ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive"):
        tau, frequencies = rng.uniform(0.2, 0.7) * limit, np.geomspace(1e-3, 1e4, 100_000)
        s = 1j * frequencies
        size = np.abs((s + 3) / (s + 30))
        _, _, b = curves(form, np.exp(-s * tau) / (s + 1), K, size)
        for target, verdict in ((0.999, "robust"), (1.01, "not robust")):
            w = control.tf([1, 3], [1, 30]) * (target / np.abs(b).max())
            set_ = UncertaintyModel(
                G, w, form, np.array([1.0]), np.array([1e-6]), perturbation="LTI"
            )
            assert check(set_, K, delay=tau).verdict == verdict
    fine = check(model, K, delay=0.5 * limit)
    assert fine.verdict == "robust"
    omega = np.geomspace(1e-3, 1e3, 200_000)
    L = K / (1j * omega + 1) * np.exp(-0.5j * omega * limit)
    assert fine.margins.rs == pytest.approx(1 / np.max(0.05 * np.abs(L / (1 + L))), rel=1e-3)
    assert fine.margins.disk == pytest.approx(1 / np.max(np.abs(1 / (1 + L) - 0.5)), rel=1e-3)


@pytest.mark.parametrize("gain", [0.5, 1.5, 3.0, 30.0])
@pytest.mark.parametrize("delay", [0.3, 1.124, 4.0])
def test_stability_with_a_long_delay_is_that_of_the_delay_itself(gain, delay):
    """A light mode far above 1/delay, where a rational approximation of the delay has another phase
    altogether.
    """
    wn, zeta = 34.0, 0.006
    G = control.tf([0.15], [1, 1]) + control.tf(
        [gain * 2 * zeta * wn, 0], [1, 2 * zeta * wn, wn**2]
    )
    omega = np.unique(
        np.concatenate([np.geomspace(1e-4, 1e6, 100_000), np.linspace(25, 45, 100_000)])
    )
    L = G(1j * omega) * np.exp(-1j * omega * delay)
    unstable = round(-float(np.angle((1 + L[1:]) / (1 + L[:-1])).sum()) / np.pi)
    model = UncertaintyModel(
        G, 1e-4, "multiplicative", np.array([1.0]), np.array([1e-5]), perturbation="LTI"
    )
    report = check(model, 1.0, delay=delay)
    assert report.verdict == ("not robust" if unstable else "robust")
    assert report.reason.startswith(
        f"unstable: the nominal loop with its delay has {unstable} "
    ) == (unstable > 0)


@pytest.mark.parametrize("form", ["multiplicative", "inverse-multiplicative"])
def test_a_resonance_on_the_axis_of_the_plant(form):
    """Undamped plant modes: the loop has to damp them, the check has to live with infinite
    open-loop gain.
    """
    G = control.tf([1.0], [1, 0, 4.0])
    K = control.tf([3.0, 1.0], [0.05, 1])
    omega = dense_grid(0.0, closed_loop_poles(control.ss(G), control.ss(K)))
    _, _, b = curves(
        form,
        tf_response(control.ss(G), omega),
        tf_response(control.ss(K), omega),
        np.ones(omega.size),
    )
    for target in (0.99, 1.01):
        w = target / np.abs(b).max()
        model = UncertaintyModel(
            G, w, form, np.array([1.0]), np.array([0.5 * w]), perturbation="LTI"
        )
        assert check(model, K).verdict == ("robust" if target < 1 else "not robust")


def test_performance_weight_on_a_sampled_loop():
    G = control.tf([10], [1, 10])
    model = UncertaintyModel(
        G, 0.2, "multiplicative", np.array([1.0]), np.array([0.2]), perturbation="LTI"
    )
    K = control.tf([0.5, -0.45], [1, -1], 0.01)
    report = check(model, K, w_P=performance_weight(0.5, M_S=2.0, A=1e-2), delay=0.01)
    assert report.verdict == "robust"
    assert report.proofs.robust_performance
    assert report.curves.omega.max() < np.pi / 0.01


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


def test_a_loop_of_many_states_is_proved_from_its_responses():
    """A long delay makes hundreds of states, too many for a matrix inequality."""
    model = UncertaintyModel(
        control.tf([1], [1, 1]),
        0.1,
        "multiplicative",
        np.array([1.0]),
        np.array([0.1]),
        perturbation="LTI",
    )
    report = check(
        model,
        control.ss([], [], [], [[0.5]], 1e-3),
        delay=0.3,
        w_P=performance_weight(0.01, A=0.99),
    )
    assert report.nominally_stable
    assert report.verdict == "robust"
    assert report.margins.rs == pytest.approx(30.0, rel=1e-6)  # 0.1 |T| is largest at DC, T = 1/3
    assert report.margins.disk > 0.5


def test_performance_with_a_delay_in_a_continuous_loop():
    G, K, tau = control.tf([1], [1, 1]), 3.0, 0.05
    model = UncertaintyModel(
        G, 0.1, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI"
    )
    omega = np.geomspace(1e-4, 1e4, 100_000)
    L = K / (1j * omega + 1) * np.exp(-1j * omega * tau)
    w_P = performance_weight(0.5, M_S=2.5, A=0.4)
    rp = np.abs(response(w_P, omega)) / (np.abs(1 + L) - 0.1 * np.abs(L))
    for target, met in ((0.99, True), (1.01, False)):
        report = check(model, K, delay=tau, w_P=w_P * (target / rp.max()))
        assert report.verdict == "robust"
        assert report.proofs.robust_performance == met


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
