"""Controllers of fixed structure straight from the FRF: published optima, demands recomputed,
honest failure.
"""

import clarabel
import control
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st

import nlfrf
from robust import (
    DesignWarning,
    UncertaintyModel,
    check,
    design_frf,
    fit_nominal,
    performance_weight,
    sampled,
    uncertainty,
)
from tests.support.bla import make_bla
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))  # SP Example 2.17
W_P = performance_weight(10, M_S=1.5, A=1e-4)
OMEGA = np.geomspace(1e-2, 1e3, 400)


def gamma_of(G, K, omega=OMEGA):
    """The norm of [w_P S; K S] by brute force."""
    S = 1 / (1 + response(control.ss(G), omega) * response(K, omega))
    return np.hypot(np.abs(response(W_P, omega) * S), np.abs(response(K, omega) * S)).max()


def frf(G, omega):
    return control.FrequencyResponseData(response(control.ss(G), omega), omega)


def stable(G, K):
    p = control.feedback(control.ss(G) * K, 1).poles()
    return np.all(np.abs(p) < 1) if K.dt else np.all(p.real < 0)


@pytest.mark.parametrize(("order", "gamma"), [(1, 2.002), (2, 1.404), (3, 1.366)])
def test_sp_example_2_17(order, gamma):
    """SP 2nd ed., Example 2.17: the H-infinity optimum is 1.366 (there 1.37) with 4 states; order 3
    reaches it.
    """
    design = design_frf(BOOK, order, w_P=W_P, w_u=1.0)
    assert design.gamma == pytest.approx(gamma, abs=1e-3)
    assert design.gamma == pytest.approx(
        gamma_of(BOOK, design.K, np.geomspace(1e-4, 1e3, 4000)), rel=1e-3
    )
    assert design.K.nstates == order
    assert stable(BOOK, design.K)
    assert design.met
    assert list(design.history) == sorted(design.history, reverse=True)


def test_an_frf_alone_gives_nearly_the_same():
    design = design_frf(frf(BOOK, OMEGA), 2, w_P=W_P, w_u=1.0)
    assert design.gamma == pytest.approx(1.404, abs=2e-3)
    assert stable(BOOK, design.K)


def test_pi_of_a_lag_has_the_largest_integral_gain_the_sensitivity_allows():
    """G = 1/(s + 1)^3 with I control and M_S = 2: by brute force over the one parameter."""
    G = control.tf([1], [1, 3, 3, 1])
    design = design_frf(G, "I", M_S=2.0)
    w = np.geomspace(1e-2, 10, 4000)
    g = 1 / (1j * w + 1) ** 3 / (1j * w)
    ki = np.linspace(0.1, 1, 2001)
    peak = np.abs(1 / (1 + ki[:, None] * g)).max(axis=1)
    assert float(np.abs(response(design.K, np.array([1e-6])) * 1e-6)[0]) == pytest.approx(
        ki[peak <= 2].max(), rel=2e-3
    )
    more = design_frf(G, "PI", M_S=2.0)
    most = design_frf(G, "PID", M_S=2.0)
    gains = [float(np.abs(response(d.K, np.array([1e-6])) * 1e-6)[0]) for d in (design, more, most)]
    # Åström & Hägglund, Advanced PID Control, 6.5: PID control brings far more on a lag-dominated
    # plant
    assert gains[0] < gains[1] < 0.6 * gains[2]


def discs(form):
    omega = np.geomspace(0.02, 200, 60)
    # the inverse form is above one at low frequency, where its set is no disc
    w = (
        control.tf([0.3, 0.02], [0.05, 1])
        if form == "multiplicative"
        else control.tf([0.1, 1.5], [1, 0.5])
    )
    radius = 0.5 * np.abs(response(control.ss(w), omega))
    return UncertaintyModel(control.ss(BOOK), w, form, omega, radius, perturbation="LTI")


@pytest.mark.parametrize("form", ["multiplicative", "inverse-multiplicative"])
def test_worst_case_performance_is_what_check_finds(form):
    model = discs(form)
    design = design_frf(model, "PID", w_P=performance_weight(1.0, M_S=2.5, A=1e-2))
    report = check(model, design.K, w_P=performance_weight(1.0, M_S=2.5, A=1e-2))
    assert report.verdict == "robust"
    assert design.gamma < 1
    assert report.proofs.robust_performance
    # gamma is |w_P S| + |w T|: at most one exactly where the worst case is
    assert (np.max(report.curves.rp) < 1) == (design.gamma < 1)
    if form == "multiplicative":
        mu = report.curves.np_ + report.curves.rs
        assert design.gamma == pytest.approx(mu.max(), rel=1e-2)


def test_every_limit_holds_where_it_was_asked_for():
    design = design_frf(
        BOOK,
        "order-3",
        integrators=1,
        w_P=W_P,
        M_S=1.6,
        M_T=1.2,
        M_u=control.tf([0.02, 20], [0.01, 1]),
        omega_c=(8, 60),
        n_iterations=10,
    )
    assert design.met, design.reason
    w = np.geomspace(1e-3, 1e4, 5000)
    L = response(control.ss(BOOK), w) * response(design.K, w)
    S = 1 / (1 + L)
    limit = np.abs(response(control.ss(control.tf([0.02, 20], [0.01, 1])), w))
    assert np.abs(S).max() <= 1.6 * 1.002
    assert np.abs(1 - S).max() <= 1.2 * 1.002
    assert np.max(np.abs(response(design.K, w) * S) / limit) <= 1.002
    assert 8 * 0.999 <= w[np.flatnonzero(np.abs(L) > 1)[-1]] <= 60 * 1.001
    assert np.abs(response(design.K, np.array([1e-9])))[0] > 1e6  # it integrates


def test_low_frequency_gain():
    design = design_frf(BOOK, "PI", w_u=1.0, M_S=1.8, gain=(0.5, 30.0))
    assert design.met, design.reason
    assert np.abs(BOOK(0.5j) * design.K(0.5j)) >= 30 * 0.999


def test_sampled_with_delay():
    """The design is on what the sampled controller sees: hold and delay inside."""
    design = design_frf(
        BOOK, "PID", w_P=performance_weight(2, M_S=2.0, A=1e-2), M_S=2.0, dt=0.02, delay=0.03
    )
    plant = sampled(control.ss(BOOK), 0.02, 0.03)
    assert design.K.dt == 0.02
    assert stable(plant, design.K)
    w = np.geomspace(1e-2, np.pi / 0.02 * 0.999, 3000)
    assert np.abs(1 / (1 + response(plant, w) * response(design.K, w))).max() <= 2.0 * 1.005
    undelayed = design_frf(
        BOOK, "PID", w_P=performance_weight(2, M_S=2.0, A=1e-2), M_S=2.0, dt=0.02
    )
    assert undelayed.gamma < design.gamma


def test_family():
    """One controller for plants of gain 1 and 3: stable and inside the limit with each, at a
    price.
    """
    plants = [k * BOOK / 2 for k in (1, 3)]
    one = design_frf(plants, "PID", w_P=performance_weight(3, A=1e-2), M_S=1.7)
    alone = design_frf(plants[0], "PID", w_P=performance_weight(3, A=1e-2), M_S=1.7)
    w = np.geomspace(1e-2, 1e3, 3000)
    for G in plants:
        assert stable(G, one.K)
        assert (
            np.abs(1 / (1 + response(control.ss(G), w) * response(one.K, w))).max() <= 1.7 * 1.005
        )
    assert one.gamma >= alone.gamma


@pytest.mark.parametrize(
    "stiffness",
    [
        76402.55559780999,
        *(pytest.param(one, marks=pytest.mark.attack) for one in (7.0e4, 7.6e4, 8.3e4)),
    ],
)
def test_undamped_modes_are_stabilised_whichever_side_rounding_puts_them(stiffness):
    dt = 1e-3
    springs = [control.ss(control.tf([1], [1, 0, k])) for k in (stiffness, 2.2 * stiffness)]
    K = design_frf(springs, "PID", M_S=2.0, dt=dt, n_starts=1).K
    for spring in springs:
        loop = control.feedback(sampled(spring, dt) * K)
        assert np.abs(loop.poles()).max() < 1


def test_unstable_plant():
    G = control.tf([1], [1, -1])
    for plant, more in ((G, {}), (frf(G, np.geomspace(0.05, 50, 150)), {"n_unstable": 1})):
        design = design_frf(
            plant, "PI", w_u=1.0, w_P=performance_weight(0.5, M_S=3, A=1e-2), **more
        )
        assert stable(G, design.K)


def test_fixed_notch_is_in_the_controller():
    notch = control.tf([1, 0.2, 100], [1, 4, 100])
    design = design_frf(BOOK, "PI", w_P=performance_weight(3, A=1e-2), fixed=notch)
    assert np.abs(design.K(10j) / design.K(9j)) < 0.3
    assert design.K.nstates == 3


def test_lead_lag_is_real_stable_and_minimum_phase():
    design = design_frf(BOOK, "lead-lag", w_P=performance_weight(3, A=1e-2))
    for roots in (design.K.poles(), design.K.zeros()):
        assert np.abs(roots.imag).max() <= 1e-6 * np.abs(roots).max()
        assert np.all(roots.real < 0)
    assert design.gamma < 1


def test_a_given_start_is_improved():
    K0 = control.tf([0.05, 0.01], [1, 0])
    design = design_frf(BOOK, "PI", w_P=W_P, w_u=1.0, start=K0)
    unmoved = design_frf(BOOK, "PI", w_P=W_P, w_u=1.0, start=K0, n_iterations=0)
    w = np.array([0.01, 1.0, 100.0])
    assert response(unmoved.K, w) == pytest.approx(response(control.ss(K0), w), rel=1e-6)
    assert design.gamma < 0.9 * unmoved.gamma
    assert unmoved.reason == "not iterated"


def test_progress():
    seen = []
    design = design_frf(BOOK, 2, w_P=W_P, w_u=1.0, progress=lambda k, v: seen.append((k, v)))
    counts, values = zip(*seen, strict=True)
    begins = [k for k, count in enumerate(counts) if count == counts[0]]  # of each start
    rounds = [values[a:b] for a, b in zip(begins, [*begins[1:], len(values)], strict=True)]
    assert len(rounds) > 1  # one that evolved, one that is simple
    assert design.history in rounds


def test_the_last_good_controller_is_kept_when_the_solver_fails(monkeypatch):
    """CLARABEL can raise an exception that is no Exception."""

    class PanicError(BaseException):
        pass

    calls, solver = [], clarabel.DefaultSolver

    def failing(*problem):
        calls.append(1)
        if len(calls) > 2:
            raise PanicError
        return solver(*problem)

    monkeypatch.setattr(clarabel, "DefaultSolver", failing)
    design = design_frf(BOOK, 2, w_P=W_P, w_u=1.0)
    assert (
        design.reason == "the solver CLARABEL failed: PanicError; the previous controller is kept"
    )
    assert stable(BOOK, design.K)
    assert design.gamma == pytest.approx(design.history[-1], rel=1e-3)


def test_what_cannot_be_met_is_named_with_its_frequency():
    """Bode's integral: |S| <= 1.02 with a crossover of 10 rad/s is out of reach on this plant."""
    design = design_frf(BOOK, "PID", M_S=1.02, omega_c=10)
    assert not design.met
    assert design.reason.startswith("not found: ")
    assert "|S| <= 1.02 is missed by a factor" in design.reason
    assert " Hz" in design.reason
    assert stable(BOOK, design.K)


def found_or_none(*args, **kwargs):
    """A design, or None where none was found to begin with."""
    try:
        return design_frf(*args, **kwargs)
    except ValueError as error:
        if "start must be given" not in str(error):
            raise
    return None


def test_lines_too_far_apart_are_never_called_stable():
    """A resonance between the lines: what cannot be counted is not counted."""
    sharp = control.tf([100], [1, 0.02, 100])
    coarse = frf(sharp, np.array([2.0, 6.0, 9.7, 10.4, 14.0, 20.0]))
    design = found_or_none(coarse, "PID", M_S=2.0)
    assert design is None or stable(sharp, design.K) or not design.met


@settings(max_examples=4, deadline=None)
@given(
    st.floats(0.2, 5),
    st.floats(0.05, 1.2),
    st.sampled_from([0.0, 0.05, 0.3]),
    st.sampled_from(["PI", "PID", 2]),
    st.booleans(),
)
@example(w0=1.0, zeta=0.05078125, delay=0.0, structure="PI", from_lines=True)
def test_what_is_called_met_is_met(w0, zeta, delay, structure, from_lines):
    """Random resonant plants with delay, from the model and from noisy lines: never an unstable
    loop called met.
    """
    G = control.tf([w0**2], [1, 2 * zeta * w0, w0**2])
    w = np.geomspace(w0 / 30, 30 * w0, 200)
    plant = G
    if from_lines:
        g = response(control.ss(G), w) * np.exp(-1j * w * delay / w0)
        rng = np.random.default_rng(0)
        g = g * (1 + 0.02 * (rng.normal(size=w.size) + 1j * rng.normal(size=w.size)))
        plant = control.FrequencyResponseData(g, w)
    design = found_or_none(
        plant,
        structure,
        M_S=1.8,
        w_P=performance_weight(0.1 * w0, A=0.05),
        delay=0.0 if from_lines else delay / w0,
        n_iterations=6,
    )
    if design is not None and design.met:
        true = control.ss(G) * control.tf(*control.pade(delay / w0, 8)) if delay else control.ss(G)
        assert stable(true, design.K)
        # of lines it is met on the lines: between them a resonance three lines wide stands up to
        # 1.17 times higher
        dense = np.geomspace(w0 / 30, 30 * w0, 2000)
        for at, most in ((w, 1.15), (dense, 1.25)) if from_lines else ((dense, 1.005),):
            L = response(control.ss(G), at) * np.exp(-1j * at * delay / w0) * response(design.K, at)
            assert np.abs(1 / (1 + L)).max() <= 1.8 * most


LINES = np.arange(1, 60, 2) * 0.5


def rig_like():
    def plant(s):
        w = 2 * np.pi * 15
        return 1e-3 * w * w / (s * s + 0.2 * w * s + w * w)

    size = np.abs(plant(2j * np.pi * LINES))
    return make_bla(
        plant,
        LINES,
        f0=0.5,
        sigma_noise=0.005 * size,
        sigma_distortion=0.05 * size,
        rng=3,
        fs=500,
        hold="band-limited",
    )


def test_pid_from_one_record():
    bla = rig_like()
    assert isinstance(bla, nlfrf.Bla)
    design = design_frf(bla, "PID", M_S=1.8, dt=2e-3)
    assert design.met, design.reason
    report = check(bla, design.K)
    assert report.nominally_stable
    assert report.margins.rs > 1
    assert np.abs(report.curves.S).max() < 1.8


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: design_frf(BOOK, "PIDD", M_S=2), "structure must be one of P, I, PI"),
        (lambda: design_frf(BOOK, 40, M_S=2), "structure must have an order"),
        (lambda: design_frf(BOOK, "PID"), "got no demand on the loop"),
        (lambda: design_frf(BOOK, "PID", M_S=2, aim="gamma"), 'aim must be "gain"'),
        (
            lambda: design_frf(BOOK, "PI", M_S=2, filter_time=0.1),
            "filter_time must only be given with PD or PID",
        ),
        (lambda: design_frf(BOOK, "PID", M_S=2, filter_time=0.0), "filter_time must be positive"),
        (lambda: design_frf(BOOK, "PI", M_S=2, integrators=1), "integrators must only be given"),
        (lambda: design_frf([], "PI", M_S=2), "empty list"),
        (lambda: design_frf(BOOK, "PI", M_S=-1.0), "M_S must be positive"),
        (
            lambda: design_frf(frf(BOOK, OMEGA), "PI", M_S=2, omega_c=1e5),
            "omega_c must lie within the lines",
        ),
        (
            lambda: design_frf(frf(BOOK, OMEGA), "PI", M_S=2, dt=1.0),
            "dt must put the Nyquist frequency above the highest line, .* Nyquist frequency is 0.5"
            " Hz: give less than 0.0.* s, or design for a continuous model of these lines",
        ),
        (
            lambda: design_frf(sampled(control.ss(BOOK), 0.1), "PI", M_S=2, dt=0.2),
            "dt must be one sampling time",
        ),
        (
            lambda: design_frf(BOOK, "PI", M_S=2, start=control.tf([-50], [1, 0])),
            "start must stabilise the plant",
        ),
        (
            lambda: design_frf(BOOK, "PI", M_S=2, start=control.tf([1], [1, 1, 1])),
            "start must have the structure",
        ),
        (lambda: design_frf(BOOK, "PI", M_S=2, gain=3.0), "gain must be"),
        (
            lambda: design_frf(BOOK, "PI", M_S=2, fixed=control.tf([1], [1, 1], 0.1)),
            "fixed must be continuous as the",
        ),
        (
            lambda: design_frf(control.tf([1], [1, 0, -1]), "I", M_S=2),
            "start must be given: no simple I controller",
        ),
        (
            lambda: design_frf(
                frf(control.tf([1], [1, 0.2, 100]), np.geomspace(0.1, 1e3, 80)), "PI", M_S=1.6
            ),
            (
                "lines at 9.434 and 10.6 rad/s the phase of the FRF turns by 161 deg, .*measure"
                " lines between them"
            ),
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.data
@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_pid_for_the_measured_motor_bench(measured):
    """From the record alone, sampled with a delay; then held against a model the design did not
    know.
    """
    file = measured / "motor_bench" / "MultisineTypeB.mat"
    cut = {"fs": 2500, "n_samples": 2500, "n_discard": 1, "hold": "band-limited"}
    bla = nlfrf.identify(nlfrf.load_record(file, u="iq_adx", y="theta_mx", **cut))
    design = design_frf(bla, "PID", M_S=1.8, M_T=1.6, dt=4e-4, delay=4e-4)
    assert design.met, design.reason
    on_lines = check(bla, design.K, delay=4e-4)
    assert on_lines.nominally_stable
    assert on_lines.margins.rs > 1
    assert np.abs(on_lines.curves.S).max() < 1.8
    with pytest.warns(DesignWarning, match=r"a pole where nothing was measured, at 3\.\d+ Hz"):
        nominal = fit_nominal(bla, n_poles=4, delay="estimate")
    report = check(uncertainty(bla, nominal, order=8), design.K, delay=4e-4)
    assert report.verdict == "statistically robust"
    for part in (
        "95 % bound may hold half the time",
        "detection lines of an odd-odd grid have less distortion",
        "a pole where nothing was",
    ):
        assert sum(part in text for text in report.warnings) == 1


@pytest.mark.parametrize("k", [0.1, 0.2, 0.45, 0.6])
def test_a_mode_between_two_lines_is_not_overlooked(k):
    """k/s on a mode of 16 % damping is stable up to k = 0.32; fifteen lines pass its peak by."""
    mode = control.tf([1], [1, 0.32, 1])
    lines = frf(mode, np.geomspace(0.01, 5, 15))
    K = control.tf([k], [1, 0])
    assert stable(mode, control.ss(K)) == (k < 0.32)
    assert check(lines, K).nominally_stable <= (k < 0.32)
    assert check(frf(mode, np.geomspace(0.01, 5, 150)), K).nominally_stable == (k < 0.32)


def test_the_loop_stays_closed_above_the_last_line():
    """A lead may rise where nothing was measured: it is held down there too."""
    G = control.tf([1], [1, 0])
    design = design_frf(frf(G, np.geomspace(0.05, 30, 100)), "lead", M_S=2.0)
    beyond = np.geomspace(30, 3000, 50)
    assert np.abs(response(design.K, beyond)).max() / 30 <= 0.5 * 1.001
