"""The check: closed forms against brute force, published numbers, every kind of verdict, every
refusal.
"""

import json
import re

import control
import numpy as np
import pytest

from nlfrf._base.values import to_json
from robust import UncertaintyModel, check, fit_nominal, frd, performance_weight, uncertainty
from robust.lti.sampling import sampled
from tests.support.bla import make_bla
from tests.support.forms import DEVIATION, PERTURBED, worst_sensitivity
from tests.support.forms import UNSCALED as FORMS
from tests.support.printed import unwrapped
from tests.support.responses import response

LINES = np.array([0.1, 1.0, 10.0])
LAG = control.tf([1], [1, 1])


def simple(weight=0.3, form="multiplicative", nominal=LAG, perturbation="LTI", **more):
    radius = 0.999 * np.abs(
        response(
            control.ss(weight) if not np.isscalar(weight) else control.ss(0, 0, 0, weight), LINES
        )
    )
    return UncertaintyModel(nominal, weight, form, LINES, radius, perturbation=perturbation, **more)


def random_system(rng):
    """A stable lag of first order with a direct term."""
    return control.tf(rng.uniform(0.2, 2, 2) * [rng.uniform(0, 0.2), 1], [rng.uniform(0.1, 3), 1])


@pytest.mark.parametrize("form", [*FORMS, "coprime"])
def test_worst_case_is_exact_over_the_disc(form):
    """max |S_p| of any loop and line against 400 x 40 perturbations of the disc."""
    rng = np.random.default_rng(4)
    disc = (
        np.linspace(0.025, 1, 40)[:, None]
        * np.exp(1j * np.linspace(0, 2 * np.pi, 400, endpoint=False))
    ).ravel()
    for _ in range(6):
        G, K, w = (random_system(rng) for _ in range(3))
        s = 1j * np.geomspace(0.01, 100, 400)
        w *= rng.uniform(0.3, 0.9) * np.min(DEVIATION[form](-1 / K(s), G(s)) / np.abs(w(s)))
        curves = check(simple(w, form, G), K, w_P=control.tf([1.0], [1]), certify=False).curves
        few = np.arange(0, curves.omega.size, 40)
        worst, s = curves.rp[few], 1j * curves.omega[few]
        brute = np.abs(1 / (1 + K(s) * PERTURBED[form](G(s), w(s), disc[:, None]))).max(axis=0)
        assert np.all(brute <= worst * (1 + 1e-9))
        assert np.all(brute >= worst * (1 - 2e-2))
        assert worst_sensitivity(form, w(s), G=G(s), K=K(s)) == pytest.approx(worst, rel=1e-3)


@pytest.mark.parametrize("form", FORMS)
def test_margin_on_the_uncertainty_alone(form):
    """Times this factor the uncertainty misses the demand at one frequency, and there alone."""
    report = check(simple(0.1, form), 2.0, w_P=(w_P := control.tf([0.5, 0.75], [1, 1])))
    at = report.curves.omega
    s, x = 1j * at, report.margins.rp
    met = np.abs(w_P(s)) * worst_sensitivity(form, 0.1 * x + 0 * s, G=LAG(s), K=2.0 + 0 * s)
    assert met.max() == pytest.approx(1.0, rel=2e-3)


@pytest.mark.parametrize("form", FORMS)
def test_curves_of_the_report(form):
    G, K, w = control.tf([2], [1, 1]), control.tf([3], [1, 2]), control.tf([0.1, 0.05], [0.2, 1])
    w_P = performance_weight(0.5, M_S=3.0, A=0.1)
    report = check(simple(w, form, G), K, w_P=w_P)
    s = 1j * report.curves.omega
    g, k, size = 2 / (s + 1), 3 / (s + 2), (0.1 * s + 0.05) / (0.2 * s + 1)
    S = 1 / (1 + g * k)
    rs = (
        {
            "multiplicative": g * k,
            "additive": k,
            "inverse-multiplicative": 1,
            "inverse-additive": g,
        }[form]
        * size
        * S
    )
    assert pytest.approx(S, rel=1e-9) == report.curves.S
    assert pytest.approx(1 - S, rel=1e-9) == report.curves.T
    assert report.curves.rs == pytest.approx(np.abs(rs), rel=1e-9)
    assert report.curves.np_ == pytest.approx(
        np.abs(response(w_P, report.curves.omega) * S), rel=1e-9
    )
    if form == "multiplicative":  # SP eq. 7.61: |w_P S|/(1 - |w T|)
        assert report.curves.rp == pytest.approx(
            report.curves.np_ / (1 - report.curves.rs), rel=1e-9
        )
    assert report.margins.rs == pytest.approx(1 / report.curves.rs.max(), rel=1e-4)
    assert report.margins.rs <= 1 / report.curves.rs.max() * (1 + 1e-12)
    assert report.verdict == "robust"


def test_disk_margin_of_the_published_example():
    """L = 25/(s^3 + 10 s^2 + 10 s + 10): 0.458, 4.05 dB, 25.8 deg at 1.94 rad/s."""
    report = check(simple(1e-3, nominal=control.tf([25], [1, 10, 10, 10])), 1.0)
    assert report.margins.disk == pytest.approx(0.458, abs=1e-3)
    assert 20 * np.log10(report.margins.disk_gain) == pytest.approx(4.05, abs=0.01)
    assert np.degrees(report.margins.disk_phase) == pytest.approx(25.8, abs=0.05)
    assert report.margins.omega_disk == pytest.approx(1.94, abs=0.02)


def test_sp_distillation_column_in_one_loop():
    """SP 8.11.3 has T = 0.7/(s + 0.7) in each channel:

    NP 0.5 and RS 0.526 are those of one of them.
    """
    w_I, w_P = control.tf([1, 0.2], [0.5, 1]), control.tf([0.5, 0.05], [1, 1e-7])
    report = check(
        simple(w_I, nominal=control.tf([1], [75, 1])), 0.7 * control.tf([75, 1], [1, 0]), w_P=w_P
    )
    assert report.curves.np_.max() == pytest.approx(0.5, abs=1e-3)
    assert report.curves.rs.max() == pytest.approx(0.526, abs=1e-3)


def test_verdict_follows_the_class():
    for perturbation, verdict in (
        ("LTI", "robust"),
        ("operator", "robust"),
        ("statistical", "statistically robust"),
    ):
        report = check(simple(perturbation=perturbation), 2.0)
        assert report.verdict == verdict
        assert report.proofs.robustly_stable
        assert report.given.perturbation == perturbation
    assert "no theorem applies" in report.not_proved


def test_an_unstable_loop_has_no_margins():
    report = check(simple(nominal=control.tf([1], [1, -1])), 0.5, w_P=performance_weight(1.0))
    assert report.verdict == "not robust"
    assert not report.nominally_stable
    assert not report.proofs.robustly_stable
    assert not report.proofs.robust_performance
    for number in (
        report.margins.rs,
        report.margins.rp,
        report.margins.disk,
        report.margins.omega_rs,
    ):
        assert np.isnan(number)
    assert np.isnan(report.curves.rs).all()
    assert np.isnan(report.curves.rp).all()
    assert "pole" in report.reason
    assert "disk margin" not in unwrapped(report)


def test_a_set_too_large_is_not_robust_and_says_where():
    report = check(simple(control.tf([2, 0.2], [1, 1])), 2.0)
    assert report.verdict == "not robust"
    assert report.margins.rs < 1
    assert f"{report.margins.omega_rs / 2 / np.pi:.3g}"[:3] in report.reason
    assert "shrink" in unwrapped(report)


def test_without_a_proof_nothing_is_certified():
    report = check(simple(), 2.0, certify=False)
    assert report.verdict == "not certified"
    assert "certify=False" in report.reason
    assert not report.proofs.robustly_stable
    assert report.margins.rs > 1
    assert report.proofs.certificates == ()


def test_performance_has_its_own_field():
    hard = check(simple(), 2.0, w_P=performance_weight(50.0))
    assert hard.verdict == "robust"
    assert not hard.proofs.robust_performance
    assert hard.margins.rp == 0.0
    easy = check(simple(), 2.0, w_P=performance_weight(0.1, A=0.9))
    assert easy.proofs.robust_performance
    assert easy.margins.rp > 1


def test_margin_rp_is_where_rp_reaches_one():
    w, w_P = control.tf([0.3, 0.1], [0.5, 1]), performance_weight(0.3, A=0.6)
    x = check(simple(w), 2.0, w_P=w_P).margins.rp
    assert np.max(check(simple(w * x), 2.0, w_P=w_P).curves.rp) == pytest.approx(1.0, rel=1e-6)


def test_operator_performance_needs_one_scaling_for_all_frequencies():
    """The same loop and weights: promised for linear perturbations, not for nonlinear ones."""
    w, w_P = control.tf([0.5, 0.1], [0.3, 1]), performance_weight(0.5, M_S=2.0, A=0.5)
    scale = 0.97 / np.max(check(simple(w), 2.0, w_P=w_P).curves.rp)
    for factor, nonlinear in ((0.3, True), (1.0, False)):
        demand = w_P * (scale * factor)
        assert check(simple(w), 2.0, w_P=demand).proofs.robust_performance
        report = check(simple(w, perturbation="operator"), 2.0, w_P=demand)
        assert report.verdict == "robust"
        assert report.proofs.robust_performance == nonlinear


def test_sampled_controller_sees_hold_and_delay():
    """Phase lost by hold and delay: (1/2 + d/T) omega T, against the continuous loop."""
    T, K = 0.05, control.ss([], [], [], [[3.0]], 0.05)
    report = check(simple(), K, delay=T)
    L = report.curves.G * report.curves.K
    at = np.argmin(np.abs(report.curves.omega - 3.0))
    omega = report.curves.omega[at]
    lost = np.angle(3 / (1j * omega + 1)) - np.angle(L[at])
    assert lost == pytest.approx(1.5 * omega * T, rel=0.01)
    assert report.curves.omega.max() <= np.pi / T
    assert check(simple(), control.ss([], [], [], [[60.0]], T), delay=T).verdict == "not robust"
    assert check(simple(), 60.0).verdict == "robust"


def test_every_report_has_the_sampling_time_of_its_loop():
    """For one channel and for several, for a set and for an FRF."""
    T, omega, lag = 0.05, np.geomspace(0.1, 10, 20), control.ss([[0.5]], [[1.0]], [[0.5]], 0, 0.05)
    one, small = simple(), control.ss([], [], [], 0.1)
    two = control.append(one.nominal, one.nominal)
    sides = {"left": (small, small), "right": (small, small)}
    matrix = UncertaintyModel(two, form="input", omega=omega, **sides)
    models = {one: 1, control.frd(one.nominal, omega): 1, matrix: 2, control.frd(two, omega): 2}
    for model, n in models.items():
        for K, dt in ((control.append(*[lag] * n), T), (control.ss([], [], [], np.eye(n), 0), 0)):
            assert check(model, K, certify=False).given.dt == dt


def test_advice_names_the_part_that_limits():
    f = np.arange(1, 60, 2) * 0.05

    def G(s):
        return 1 / (s + 1)

    size = np.abs(G(2j * np.pi * f))
    for part, word in (
        ("noise", "average more periods"),
        ("distortion", "more periods will not help"),
        ("even", "asymmetry"),
    ):
        bla = make_bla(G, f, f0=0.05, **{f"sigma_{part}": 0.1 * size})
        if part == "even":
            bla = make_bla(G, f, f0=0.05, sigma_even=0.1 * size, sigma_noise=0.01 * size)
        model = uncertainty(bla, fit_nominal(bla, n_poles=1, n_zeros=0), order=1)
        assert word in check(model, control.tf([8], [1, 0])).advice


def test_the_report_fits_a_screen():
    f = np.arange(1, 60, 2) * 0.05
    bla = make_bla(lambda s: 1 / (s + 1), f, f0=0.05, sigma_distortion=0.02, hold="band-limited")
    model = uncertainty(bla, fit_nominal(bla, n_poles=1, n_zeros=0), order=2)
    text = str(
        check(
            model,
            control.ss([], [], [], [[1.0]], 0.1),
            w_P=performance_weight(0.1, A=0.9),
            delay=0.02,
        )
    )
    assert len(text.splitlines()) <= 40
    assert max(map(len, text.splitlines())) <= 100
    for word in ("STATISTICALLY ROBUST", "proved:", "not proved:", "95 %", "disk margin"):
        assert word in text


def test_what_to_do_next_stands_where_there_is_something_to_mend():
    f = np.arange(1, 60, 2) * 0.05
    bla = make_bla(lambda s: 1 / (s + 1), f, f0=0.05, sigma_distortion=0.02, hold="band-limited")
    model = uncertainty(bla, fit_nominal(bla, n_poles=1, n_zeros=0), order=2)
    for gain, w_P, good in (
        (1.0, None, True),
        (1.0, performance_weight(5.0, A=1e-3), False),
        (300.0, None, False),
    ):
        report = check(model, control.ss([], [], [], [[gain]], 0.1), w_P=w_P)
        assert report.advice
        assert (report.next_step == "", "next:" in str(report)) == (good, not good), report


class TestMeasuredLinesOnly:
    """A plant that is an FRF: the winding number, and never more than "on the measured lines
    only".
    """

    OMEGA = np.geomspace(0.01, 100, 400)

    def frf(self, system, omega=None):
        omega = self.OMEGA if omega is None else omega
        return control.FrequencyResponseData(response(control.ss(system), omega), omega)

    def test_never_certified(self):
        report = check(self.frf(LAG), 2.0)
        assert report.nominally_stable
        assert report.verdict == "not certified"
        assert "on the measured lines only" in report.reason
        assert np.isnan(report.margins.rs)
        model = UncertaintyModel(
            self.frf(LAG), 0.3, "multiplicative", LINES, np.full(3, 0.3), perturbation="LTI"
        )
        # the lines of the radius must be lines of the FRF
        omega = self.OMEGA[::7]
        model = UncertaintyModel(
            self.frf(LAG),
            0.3,
            "multiplicative",
            omega,
            np.full(omega.size, 0.3),
            perturbation="LTI",
        )
        report = check(model, 2.0)
        assert report.verdict == "not certified"
        assert "on the measured lines only" in report.reason
        assert report.margins.rs == pytest.approx(1 / (0.3 * 2 / 3), rel=1e-3)

    @pytest.mark.parametrize(
        ("system", "K", "n_unstable", "stable"),
        [
            (LAG, 5.0, 0, True),
            (control.tf([1], [1, 3, 3, 1]), 7.5, 0, True),
            (control.tf([1], [1, 3, 3, 1]), 8.5, 0, False),
            (control.tf([1], [1, -1]), 2.0, 1, True),
            (control.tf([1], [1, -1]), 0.5, 1, False),
            (control.tf([1], [1, 3, 3, 1]), control.tf([0.3], [1, 0]), 0, True),
            (control.tf([1], [1, 3, 3, 1]), control.tf([3.0], [1, 0]), 0, False),
            (control.tf([1], [1, 0.02, 1]), control.tf([1, 2, 1], [1, 20, 100]), 0, True),
            (control.tf([-1], [1, 1]), 1.5, 0, False),
        ],
    )
    def test_winding_number_agrees_with_the_poles(self, system, K, n_unstable, stable):
        loop = control.feedback(
            control.ss(system) * (control.ss(K) if not np.isscalar(K) else K), 1
        )
        assert np.all(loop.poles().real < 0) == stable
        report = check(self.frf(system), K, n_unstable=n_unstable)
        assert report.nominally_stable == stable
        assert report.verdict == ("not certified" if stable else "not robust")

    def test_lines_too_far_apart_decide_nothing(self):
        sparse = np.geomspace(0.01, 100, 4)
        report = check(self.frf(control.tf([1], [1, 3, 3, 1]), sparse), 8.5)
        assert not report.nominally_stable
        assert report.verdict == "not certified"

    @pytest.mark.parametrize(
        ("system", "K", "omega"),
        [
            # a linear grid whose first lines leap over a mode: the drop looks like integrators, of
            # which there is none
            (
                control.tf([0.002], np.polymul([1, 0.07, 0.04], [1, 0.4, 0.3])),
                0.05,
                np.linspace(0.066, 377, 200),
            ),
            # the unstable pole of the controller lies above the last line
            (LAG, control.tf([0.5], [1, -300]), np.geomspace(0.01, 100, 400)),
        ],
    )
    def test_lines_that_do_not_show_what_decides(self, system, K, omega):
        """What the lines cannot tell is called undecided, neither stable nor unstable."""
        report = check(self.frf(system, omega), K)
        assert not report.nominally_stable
        assert report.verdict == "not certified"
        assert "do not show the winding number of 1 + L: it turns by" in report.reason

    @pytest.mark.parametrize("K", [0.1, 0.2])
    def test_an_integrator_under_a_light_mode(self, K):
        """The slope of the first lines looks like none, the phase does not: stable up to K =
        0.25.
        """
        report = check(self.frf(control.tf([1], [1, 0.25, 1, 0]), np.linspace(0.33, 250, 1000)), K)
        assert report.nominally_stable

    def test_a_loop_above_one_on_its_last_line_is_undecided(self):
        """A sampled gain of 100 that becomes unstable between the last line and Nyquist."""
        G, T = sampled(control.ss(control.tf([8000], [1, 12, 8000])), 0.0123), 0.0123
        K = control.ss([], [], [], [[70.0]], T)
        omega = np.linspace(0.3, 64, 200)
        assert np.abs(control.feedback(G * K, 1).poles()).max() > 1
        report = check(control.FrequencyResponseData(response(G, omega), omega, T), K)
        assert report.verdict == "not certified"
        assert not report.nominally_stable

    def test_first_lines_around_a_corner_show_no_integrator(self):
        omega = np.arange(1, 300) * 0.3
        assert check(self.frf(control.tf([1], [1, 2, 1]), omega), 0.2).nominally_stable

    def test_a_line_at_zero_frequency_is_refused(self):
        with pytest.raises(
            ValueError, match="model must have an FRF on positive frequencies, got a line at 0"
        ):
            check(self.frf(LAG, np.linspace(0, 10, 50)), 1.0)

    def test_a_bla_brings_its_own_radius(self):
        f = np.arange(1, 200, 2) * 0.02
        bla = make_bla(lambda s: 1 / (s + 1), f, f0=0.02, sigma_distortion=0.01)
        report = check(bla, 2.0)
        assert report.given.perturbation == "statistical"
        radius = bla.bound(of="realization") / np.abs(bla.G)
        assert report.curves.rs == pytest.approx(radius * np.abs(report.curves.T), rel=1e-9)
        assert check(frd(bla), 2.0).margins.disk == pytest.approx(report.margins.disk)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: check("model.json", 1.0), "model must be an UncertaintyModel"),
        (lambda: check(simple(), "K"), "K must be a control.StateSpace"),
        (lambda: check(simple(), control.tf([1, 0, 0], [1, 1])), "K must be proper"),
        (lambda: check(simple(), np.eye(2)), "K must have one input and one output"),
        (lambda: check(simple(), 1.0, delay=-1.0), "delay must be zero or positive"),
        (
            lambda: check(simple(), control.ss([], [], [], [[0.5]], 1e-4), delay=1.0),
            "delay must leave at most 600 states in the loop, got 1 s",
        ),
        (
            lambda: check(control.FrequencyResponseData([1.0, np.nan, 1.0], [1.0, 2.0, 3.0]), 1.0),
            "model must have a finite FRF on every line, got .nan.* at 0.3183 Hz",
        ),
        (lambda: simple(control.tf([1], [1, -1])), r"weight must be stable, got a pole at 1"),
        (lambda: check(simple(), 1.0, solver="MOSEK"), "solver must be one of"),
        (lambda: check(simple(), 1.0, w_P=control.tf([1], [1, 0])), "w_P must be stable"),
        (lambda: check(simple(), 1.0, w_P=control.tf([1, 1, 1], [1, 2])), "w_P must be proper"),
        (
            lambda: check(simple(), control.tf([1.0], [1, 0.5], True)),
            "K must state its sampling time",
        ),
        (
            lambda: check(simple(nominal=control.tf([1, 2], [1, 1])), -1.0),
            "K must leave the loop well posed",
        ),
        (
            lambda: check(
                simple(0.1, nominal=control.tf([0.1], [1, -0.9], 0.1)),
                control.tf([1.0], [1, 0.5], 0.2),
            ),
            "K must have the sampling time of the nominal model, 0.1 s, got 0.2 s",
        ),
        (
            lambda: check(
                simple(0.1, nominal=control.tf([0.1], [1, -0.9], 0.1)), control.tf([1.0], [1, 0.5])
            ),
            "got a continuous controller",
        ),
        (
            lambda: check(simple(0.1, nominal=control.tf([0.1], [1, -0.9], 0.1)), 1.0, delay=0.05),
            "delay must be a whole number of samples",
        ),
        (
            lambda: check(
                simple(), control.tf([0.1], [1, -0.9], 0.1), w_P=control.tf([0.1], [1, -0.9], 0.2)
            ),
            "w_P must be continuous or have the sampling time of the loop",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_worst_performance_stands_with_its_own_frequency():
    """The largest |w_P S_p|, 1.119 at 2.717 Hz, stood with where the uncertainty may grow least, at
    3.561 Hz.
    """
    w, omega = control.tf([0.8, 0.48], [1, 10]), np.geomspace(0.01, 1000, 60)
    model = UncertaintyModel(
        LAG, w, "multiplicative", omega, 0.9 * np.abs(w(1j * omega)), perturbation="LTI"
    )
    w_P = control.tf([0.9, 0.72], [1, 0.1])
    report = check(model, 8, w_P=w_P)
    value, frequency = map(
        float, re.search(r"performance: (\S+) at (\S+) Hz: demand", unwrapped(str(report))).groups()
    )
    s = 2j * np.pi * frequency
    worst = worst_sensitivity("multiplicative", w(s), G=LAG(s), K=8.0)
    assert np.abs(w_P(s)) * worst == pytest.approx(value, rel=1e-3)
    assert value == pytest.approx(report.curves.rp.max(), rel=1e-3)
    assert (
        unwrapped(str(report)).count(
            f"demand not met for the whole set, missed by a factor {value:.3g}"
        )
        == 1
    )


def test_text_and_json_have_the_same_facts():
    """A fact that the text has, without an empty one, is in the JSON with its number and text."""
    report = check(simple(), control.tf([1], [1, 0]), w_P=control.tf([0.5], [1, 0.01]))
    told = json.loads(to_json(report))["facts"]
    text = " ".join(str(report).split())
    facts = [fact for fact in (*report.findings, *report.details) if fact.amount]
    assert [fact["name"] for fact in told] == [fact.name for fact in facts]
    assert {"max rs", "max |S|", "disk margin", "phase margin"} <= {fact["name"] for fact in told}
    for fact, plain in zip(facts, told, strict=True):
        assert plain["amount"] == fact.amount
        assert f"{fact.name}: {fact.amount}" in text
    largest = next(fact for fact in told if fact["name"] == "max |S|")
    assert largest["value"]["value"] == report.margins.S_worst
