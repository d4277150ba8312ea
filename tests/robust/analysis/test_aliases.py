"""Sets of continuous plants under a sampled controller: counter-examples, exact limits, simulated
operators.
"""

import re
from dataclasses import replace

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, ncfsyn, sampled, uncertainty_of_plants
from tests.support.printed import unwrapped
from tests.support.random_families import above_nyquist, sampled_operators
from tests.support.random_loops import closed_loop_poles, hold_and_delay, tf_response
from tests.support.responses import response
from tests.support.sampled_sets import (
    alias_terms,
    largest_factor,
    period_map,
    smallest_distance,
    worst_member,
    worst_period_map,
)

LINES, RADIUS = np.array([1.0, 2.0]), np.array([1e-12, 1e-12])


def the_set(G, w, form="multiplicative", perturbation="LTI"):
    return UncertaintyModel(G, w, form, LINES, RADIUS, perturbation=perturbation)


def gain(k, dt=0.0):
    return control.ss([], [], [], [[k]], dt)


def light_mode():
    """A lag with a mode at 9.5 Hz, K = 1 at 10 Hz, w = 0.7."""
    G = control.ss(control.tf([1], [1, 1])) + control.ss(control.tf([0.05 * 3600], [1, 1.2, 3600]))
    return G, gain(0.7), gain(1.0, 0.1)


def test_an_operator_between_the_samples_is_not_proved_against():
    """Delta(t) = 1 in the first half of each sample, -1 in the second: of gain one, and the loop
    diverges.
    """
    G, w, K = light_mode()
    half = np.repeat([1.0, -1.0], 4)
    assert np.abs(
        np.linalg.eigvals(period_map(G, w, "multiplicative", K, 0.1, half))
    ).max() == pytest.approx(1.0019, abs=1e-4)
    report = check(the_set(G, w, perturbation="operator"), K)
    assert report.verdict == "not certified"
    assert report.margins.rs < 1
    assert not any(c.holds for c in report.proofs.certificates)
    smaller = the_set(G, gain(0.7 * report.margins.rs * 0.99), perturbation="operator")
    proved = check(smaller, K)
    assert proved.verdict == "robust"
    assert proved.proofs.certificates[0].verify().verified


def test_a_plant_of_the_set_with_a_mode_above_nyquist_is_not_proved_stable():
    """One FRF with a light mode at 125 Hz, sampled at 200 Hz: the plant itself lies in the set and
    is unstable.
    """
    w0, w1 = 2 * np.pi * 30, 2 * np.pi * 125
    G = control.tf([w0**2], [1, 0.2 * w0, w0**2])
    true = G + control.tf([0.1 * w1**2], [1, 0.004 * w1, w1**2])
    omega = 2 * np.pi * np.arange(1, 200, 0.5)
    frf = control.FrequencyResponseData(
        np.polyval(true.num[0][0], 1j * omega) / np.polyval(true.den[0][0], 1j * omega), omega
    )
    model = uncertainty_of_plants([frf], G, perturbation="LTI", order=6)
    K = ncfsyn(sampled(G, 1 / 200), 0.8).K
    assert model.contains(true)
    assert np.abs(control.feedback(sampled(true, 1 / 200) * K, 1).poles()).max() > 1.01
    report = check(model, K)
    assert report.verdict == "not certified"
    assert report.margins.rs < 1
    assert re.search(r"from 12(4\.9|5) Hz", report.reason)
    assert "Sample faster" in report.reason


def test_the_exact_limit_is_reached_by_a_plant_of_the_set():
    """A perturbation in phase at all aliases is unstable just above the limit; nothing is at 0.99
    of it.
    """
    rng, seen = np.random.default_rng(3), 0
    while seen < 2:
        case = above_nyquist(rng, form=str(rng.choice(["multiplicative", "additive"])))
        if not case["stable"]:
            continue
        G, K, w, form, delay = (case[k] for k in ("G", "K", "w", "form", "delay"))
        T = float(K.dt)
        report = check(the_set(G, w, form), K, delay=delay)
        at = report.margins.omega_rs
        k, g = tf_response(K, np.array([at])), tf_response(case["in_loop"], np.array([at]))
        KS = complex((k / (1 + k * g))[0])
        Delta = worst_member(tf_response, G, w, form, T, delay, at, KS, n=12, narrow=1e-5)
        assert np.abs(tf_response(Delta, np.array([at, 3 * at]))) == pytest.approx(1, rel=1e-6)

        def radius(factor, G=G, w=w, K=K, Delta=Delta, form=form, T=T, delay=delay):
            wD = control.StateSpace(w.A, w.B, w.C * factor, w.D * factor, 0) * Delta
            plant = G * (gain(1.0) + wD) if form == "multiplicative" else G + wD
            return np.abs(closed_loop_poles(hold_and_delay(plant, T, delay), K)).max()

        share = np.abs(alias_terms(tf_response, G, w, form, T, delay, np.array([at]), 12)[0])
        assert share.shape == (1, 25)
        if (
            radius(report.margins.rs * 1.1) > 1 + 1e-9
        ):  # the modes of so narrow an all-pass are hardly damped
            seen += 1
        assert radius(report.margins.rs * 0.99) < 1 + 1e-9


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("form", ["multiplicative", "additive"])
def test_operators_of_a_proved_set_never_destabilise(form):
    """Gains of +-1 that change within a sample: the largest spectral radius over all of them, where
    they are proved.
    """
    rng, proved, broken = np.random.default_rng(11), 0, 0
    while proved < 4:
        case = sampled_operators(rng, form=form, delayed=False)
        if not case["stable"]:
            continue
        G, K, w = case["G"], case["K"], case["w"]
        report = check(the_set(G, w, form, "operator"), K)
        T, factor = float(K.dt), report.margins.rs

        def at(size, G=G, w=w, K=K, T=T):
            return worst_period_map(
                G, control.StateSpace(w.A, w.B, w.C * size, w.D * size, 0), form, K, T, 6
            )

        proved += 1
        assert at(0.99 * factor) < 1
        broken += at(2.0 * factor) > 1
    assert broken >= 1  # the condition is sufficient, and not far from what simple operators can do


def test_what_reaches_the_sampler_unfiltered_is_not_certified():
    G, K = control.tf([1], [1, 1]), gain(0.5, 0.1)
    for form, w, kind in (
        ("additive", gain(0.01), "LTI"),
        ("additive", gain(0.01), "operator"),
        ("inverse-multiplicative", gain(0.01), "operator"),
    ):
        report = check(the_set(G, w, form, kind), K)
        assert report.verdict == "not certified"
        assert "reaches the sampler unfiltered" in report.reason
        assert report.margins.rs == 0
        assert "max rs: infinite at" in unwrapped(report)
        rolled = the_set(G, control.tf([0.02], [0.1, 1]), form, kind)
        assert check(rolled, K).verdict == "robust"
    flat = the_set(control.tf([1, 3], [1, 1]), gain(0.01))
    assert "unfiltered" in check(flat, K).reason


def test_an_inverse_weight_of_one_above_nyquist():
    # 20 at high frequencies, 0.6 at Nyquist
    lag = control.tf([1], [1, 1])
    w = control.tf([0.2, 0.02], [0.01, 1])
    report = check(the_set(lag, w, "inverse-multiplicative"), gain(0.5, 1.0))
    assert report.verdict == "not certified"
    assert "From one on, the set contains plants of any gain there" in report.reason
    assert report.margins.rs < 0.06


def test_a_set_of_sampled_plants_speaks_of_the_samples():
    G, _, K = light_mode()
    for kind in ("LTI", "operator", "statistical"):
        report = check(
            UncertaintyModel(
                sampled(G, 0.1), gain(0.3, 0.1), "multiplicative", LINES, RADIUS, perturbation=kind
            ),
            K,
        )
        assert report.verdict in ("robust", "statistically robust")
        assert "for the samples only" in report.proved
        assert "between the samples" in report.reason
        assert report.folding == ""


def test_a_loop_of_several_uncertainties_that_is_sampled_speaks_of_the_samples():
    from robust.analysis import check_structure
    from robust.models import Block, interconnection

    plant = control.ss(
        [[0.5]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], 0.1, inputs=["u", "d"], outputs=["y"]
    )
    K = control.ss([], [], [], [[-0.2]], 0.1, inputs=["y"], outputs=["u"])
    report = check_structure(
        interconnection([plant, K], {"gain": Block("y", "d", 0.1, perturbation="operator")})
    )
    assert report.verdict == "robust"
    assert "between the samples" in report.reason
    assert "for the samples only" in report.proved


def test_no_confidence_is_spoken_of_where_none_is_known():
    """A radius of one's own without a class: neither a confidence of nan nor one that nobody
    gave.
    """
    omega = np.geomspace(0.1, 10, 20)
    model = UncertaintyModel.from_radius(
        control.tf([1], [1, 1]), omega, np.full(20, 0.1), order=0, above="flat"
    )
    text = str(check(model, 0.5))
    assert "STATISTICALLY ROBUST" in text
    assert "at its confidence" not in text
    assert "the probability that the set contains the machine is unknown" in " ".join(text.split())
    assert "nan" not in text


def test_performance_counts_every_alias():
    """|w_P| |S|/(1 - |K S| sum |h F|) by brute force, met at 0.98 of it and not at 1.02."""
    G, w, K = light_mode()
    w = gain(0.3)
    omega = np.geomspace(1e-3, np.pi / 0.1 * (1 - 1e-9), 4000)
    g, k = tf_response(hold_and_delay(G, 0.1, 0.0), omega), np.ones(omega.size)
    S = 1 / (1 + g * k)
    hold, _, F = alias_terms(tf_response, G, w, "multiplicative", 0.1, 0.0, omega)
    worst = np.abs(S) / (1 - np.abs(k * S) * (np.abs(hold) * F).sum(1))
    for target in (0.98, 1.02):
        report = check(the_set(G, w), K, w_P=gain(target / worst.max()))
        assert report.proofs.robust_performance == (target < 1)
        assert report.curves.rp.max() == pytest.approx(target, rel=2e-3)


@pytest.mark.parametrize(
    ("form", "name"),
    [
        ("multiplicative", "robust performance"),
        ("inverse-multiplicative", "robust performance"),
        ("inverse-multiplicative", "robust performance with one scaling"),
    ],
)
def test_performance_of_operators_is_not_claimed_without_a_condition(form, name):
    """|w_P S| is 100 for the nominal, whose stability alone was examined for such a claim."""
    w = control.ss(control.tf([0.1], [0.3, 1]))
    report = check(the_set(control.tf([1], [1, 1]), w, form, "operator"), gain(0.5, 0.1))
    claim = report.proofs.certificates[0].claim
    demand = replace(claim.controller, D=np.array([[100.0]]), dt=0.0)
    with pytest.raises(ValueError, match=r"claims must be .*every alias included.* for operators"):
        replace(claim, performance=demand, claims=(f"{name}, every alias included",))


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("kind", ["LTI", "operator"])
@pytest.mark.parametrize(
    "form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive"]
)
def test_a_certificate_holds_for_its_numbers_only(form, kind):
    """Proved in exact arithmetic; with a weight beyond the limit the same claim is not."""
    G, _, K = light_mode()
    w = control.ss(control.tf([0.1], [0.3, 1]))
    report = check(the_set(G, w, form, kind), K, w_P=gain(0.2))
    proof = report.proofs.certificates[0]
    assert proof.judged == "proved, rigorous"
    assert proof.claim.claims == ("robust stability, every alias included",)
    assert proof.verify().verified
    with pytest.raises(ValueError, match="perturbation must be one of LTI, statistical, operator"):
        replace(proof.claim, perturbation="anything")
    larger = replace(proof.claim.weight, C=proof.claim.weight.C * report.margins.rs * 1.01)
    assert not replace(proof, claim=replace(proof.claim, weight=larger)).verify(time_cap=2).verified
    if len(report.proofs.certificates) > 1 and report.proofs.certificates[1].holds:
        assert report.proofs.certificates[1].verify().verified


def test_the_sums_over_all_aliases():
    """Against 30 000 aliases taken one by one; a plant that does not roll off has no bound."""
    G, T, K = control.tf([3], [1, 1]), 0.05, gain(2.0, 0.05)
    curves = check(the_set(G, gain(0.2)), K).curves
    near = [np.argmin(np.abs(curves.omega - one)) for one in (0.5, 5.0, 40.0)]
    omega = curves.omega[near]
    k = np.arange(1, 30_001)[:, None]
    alias = np.concatenate([2 * np.pi * k / T - omega, 2 * np.pi * k / T + omega])
    hold, size = 2 * np.sin(omega * T / 2) / (alias * T), 3 / np.sqrt(1 + alias**2)
    F = (0.2 * hold * size).sum(axis=0)
    own = np.sinc(omega * T / 2 / np.pi) * 0.2 * np.abs(response(control.ss(G), omega))
    rs = 2 * np.abs(curves.S[near]) * (own + F)
    assert curves.rs[near] == pytest.approx(rs, rel=3e-3)
    assert np.all(curves.rs[near] >= rs * (1 - 1e-9))
    flat = check(the_set(control.tf([1, 3], [1, 1]), gain(0.2)), K)
    assert flat.margins.rs == 0


def test_an_operator_set_is_called_unstable_only_where_a_linear_member_is():
    """Near Nyquist the hold keeps 2/pi of a frequency: the condition of operators fails, no linear
    plant breaks it.
    """
    # K peaks at Nyquist
    G = control.tf([1], [1, 1])
    K = control.ss([[-0.8]], [[1.0]], [[0.12]], [[0.0]], 1.0)
    unit = check(the_set(G, gain(1.0), perturbation="operator"), K)
    assert unit.margins.omega_rs == pytest.approx(np.pi, rel=1e-3)
    between = the_set(G, gain(1.7 * unit.margins.rs), perturbation="operator")
    assert check(between, K).verdict == "not certified"
    far = check(the_set(G, gain(8 * unit.margins.rs), perturbation="operator"), K)
    assert far.verdict == "not robust"


def test_an_inverse_weight_that_stays_near_one_far_above_nyquist_is_bounded_as_closely_as_it_counts():
    """|w| = 0.96 at every alias: bounds that are 5 % above it would leave nothing below one."""
    w = control.tf([0.96, 0.96], [1, 3])
    at = np.array([1.0, 2.0])
    model = UncertaintyModel(
        control.tf([1], [1, 1]), w, "inverse-multiplicative", at, 0.1 * at, perturbation="LTI"
    )
    assert check(model, control.ss([], [], [], [[0.02]], 0.1)).verdict == "robust"


@pytest.mark.parametrize("form", ["inverse-multiplicative", "inverse-additive"])
@pytest.mark.parametrize(("k", "delay"), [(14.0, 0.0), (6.0, 0.03), (6.0, 0.1)])
def test_an_inverse_set_is_proved_up_to_its_limit_and_never_above(form, k, delay):
    """The limit of 1/(s + 1) under a gain at 10 Hz by brute force; the aliases take a large part of
    it.
    """
    G, K, T = control.ss(control.tf([1], [1, 1])), gain(k, 0.1), 0.1
    omega = np.linspace(1e-3, np.pi / T, 4000)
    L = k * tf_response(hold_and_delay(G, T, delay), omega)
    S = 1 / (1 + L)
    limit = largest_factor(tf_response, G, gain(1.0), form, T, delay, omega, S, k * S)
    for share, proved in ((0.997, True), (1.003, False)):
        report = check(the_set(G, gain(share * limit), form), K, delay=delay)
        assert report.proofs.robustly_stable == proved


def test_performance_of_an_inverse_set_is_proved_up_to_its_limit_and_never_above():
    """The largest |w_P S_p| by brute force."""
    G, K, T = control.ss(control.tf([1], [1, 1])), gain(6.0, 0.1), 0.1
    omega = np.linspace(1e-3, np.pi / T, 1000)
    S = 1 / (1 + 6 * tf_response(hold_and_delay(G, T, 0.03), omega))
    for form, size in (("inverse-multiplicative", 0.3), ("inverse-additive", 2.0)):
        _, hG, F = alias_terms(tf_response, G, gain(size), form, T, 0.03, omega, 60)
        worst = np.max(np.abs(S) / smallest_distance(1.0, 6 * S, hG, F))
        for share, proved in ((0.99, True), (1.01, False)):
            report = check(the_set(G, gain(size), form), K, w_P=gain(share / worst), delay=0.03)
            assert report.proofs.robust_performance == proved
