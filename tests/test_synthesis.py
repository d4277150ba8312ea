"""Mixed sensitivity, gaps, elements and bounds for shaping by hand: published numbers, closed forms, brute force."""

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from robust import (
    UncertaintyModel,
    check,
    discretize,
    lag,
    lead,
    loop_bounds,
    mixsyn,
    ncf_margin,
    ncfsyn,
    notch,
    nu_gap,
    performance_weight,
    pid,
    roll_off,
    sampled,
)
from robust.shaping_plot import plot_loop_bounds
from robust.systems.closed_loop import worst_sensitivity
from robust.systems.lti import response
from robust.uncertain.forms import worst_terms

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
W_P = performance_weight(10, M_S=1.5, A=1e-4)


def stable(G, K):
    p = control.feedback(G * K, 1).poles()
    return np.all(np.abs(p) < 1) if K.dt else np.all(p.real < 0)


def stack(G, K, weights, omega):
    """Norm over omega of the weighted S, K S and T, by brute force."""
    g, k = response(G, omega), response(K, omega)
    S = 1 / (1 + g * k)
    parts = {"w_P": S, "w_u": k * S, "w_T": g * k * S}
    rows = [np.abs(response(control.ss(w) if w != 1 else control.ss([], [], [], [[1.0]]), omega) * parts[name])
            for name, w in weights.items()]  # fmt: skip
    return np.sqrt(np.sum(np.square(rows), axis=0)).max()


def test_mixsyn_sp_example_2_17():
    """SP 2nd ed., Example 2.17: gamma 1.37 (1.366)."""
    design = mixsyn(BOOK, W_P, w_u=1)
    assert design.gamma_min == pytest.approx(1.366, abs=5e-4)
    omega = np.geomspace(1e-4, 1e3, 4000)
    assert design.gamma == pytest.approx(stack(control.ss(BOOK), design.K, {"w_P": W_P, "w_u": 1}, omega), rel=1e-3)
    assert stable(control.ss(BOOK), design.K)


@pytest.mark.parametrize("delay", [0.0, 0.015])
def test_mixsyn_for_a_sampled_controller(delay):
    design = mixsyn(BOOK, W_P, w_u=1, dt=0.01, delay=delay)
    G = sampled(control.ss(BOOK), 0.01, delay)
    assert design.K.dt == 0.01
    assert stable(G, design.K)
    omega = np.geomspace(1e-4, np.pi / 0.01 * 0.999, 4000)
    assert design.gamma == pytest.approx(stack(G, design.K, {"w_P": discretize(W_P, 0.01), "w_u": 1}, omega), rel=1e-3)
    assert design.gamma > mixsyn(BOOK, W_P, w_u=1).gamma_min


@pytest.mark.parametrize(
    ("G", "w_P", "options"),
    [
        (control.tf([1], [1, 1e-6]), control.tf([0.5, 1], [1, 1e-6]), {"w_u": 0.1}),  # hangs elsewhere
        (sampled(control.ss(BOOK), 0.05), W_P, {"w_u": 1}),  # so does any discrete plant
        (control.tf([1], [1, 0, 0]), performance_weight(1), {"w_u": 0.1}),
        (control.tf([1, 2], [1, -1]), 0.5, {"w_u": 0.2, "w_T": 0.3}),
    ],
)
def test_mixsyn_ends_on_hard_plants(G, w_P, options):
    design = mixsyn(G, w_P, **options)
    assert design.met, design.reason
    assert stable(control.ss(G), design.K)
    assert np.isfinite(design.gamma)


@pytest.mark.parametrize("form", ["multiplicative", "additive", "inverse-multiplicative"])
def test_gamma_below_one_is_a_robust_loop(form):
    """The weight of the model takes its place in the stack, so the check finds the whole set stable."""
    omega = np.geomspace(0.1, 100, 30)
    w = {
        "multiplicative": control.tf([0.3, 0.1], [0.05, 1]),
        "additive": control.tf([0.02, 0.05], [0.05, 1]),
        "inverse-multiplicative": control.tf([0.05, 0.3], [1, 1]),
    }[form]
    model = UncertaintyModel(
        control.tf([1], [0.5, 1]), w, form, omega, 0.3 * np.abs(response(control.ss(w), omega)), perturbation="LTI"
    )
    design = mixsyn(model, performance_weight(1.0, M_S=2.5, A=1e-2), w_u=0.01)
    assert design.gamma < 1
    report = check(model, design.K, w_P=performance_weight(1.0, M_S=2.5, A=1e-2))
    assert report.verdict == "robust"
    assert np.max(report.np_) <= design.gamma * 1.001


def test_nu_gap_does_not_depend_on_the_scale_of_the_states():
    """Slow unstable poles of a sampled plant, its input gain in C: chordal distance on a grid."""
    poles = np.array([1.00413 + 0.0179j, 1.00413 - 0.0179j, 1.0027, 1.0016])
    plants = []
    for factor in (1.0, 0.9984):
        A = np.zeros((4, 4))
        A[0], A[1:, :-1] = -np.poly(poles * factor).real[1:], np.eye(3)
        C = 3e-9 * np.array([[0.0, 1.0, -0.45, 0.0]])
        plants.append(control.StateSpace(A, np.eye(4)[:, :1], C, [[0.0]], 0.01))
    omega = np.geomspace(1e-4, 0.999 * np.pi / 0.01, 20_000)
    first, second = (response(G, omega) for G in plants)
    chord = np.abs(first - second) / np.sqrt((1 + np.abs(first) ** 2) * (1 + np.abs(second) ** 2))
    gap = nu_gap(*plants)
    assert gap == pytest.approx(chord.max(), rel=1e-3)
    for size in (1e-6, 1e6):
        scaled = [control.StateSpace(G.A, G.B * size, G.C / size, G.D, G.dt) for G in plants]
        assert nu_gap(*scaled) == pytest.approx(gap, rel=1e-6)


def test_nu_gap_closed_forms():
    """Zhou & Doyle, Essentials of Robust Control, 17.2: 0.02, 0.8988, 0.8941; two gains: their chordal distance."""
    a, b, c = control.tf([100], [2, 1]), control.tf([100], [2, -1]), control.tf([100], [1, 2, 1])
    assert nu_gap(a, b) == pytest.approx(0.02, abs=5e-5)
    assert nu_gap(a, c) == pytest.approx(0.8988, abs=5e-5)
    assert nu_gap(b, c) == pytest.approx(0.8941, abs=5e-5)
    assert nu_gap(1.0, 2.0) == pytest.approx(1 / np.sqrt(10))
    assert nu_gap(c, c) < 1e-12
    assert nu_gap(control.tf([1], [1, -1]), control.tf([-1], [1, -1])) == 1.0  # no winding: as far as can be


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_gap_and_margin_hold_each_other(dt):
    """Vinnicombe: arcsin b(G2, K) >= arcsin b(G1, K) - arcsin gap, and a loop with b > gap stays stable."""
    rng = np.random.default_rng(0)
    for _ in range(8):
        G1 = control.ss(control.tf(rng.uniform(0.5, 3, 1), [1, rng.uniform(-0.5, 2), rng.uniform(0.2, 2)]))
        G2 = control.ss(control.tf(rng.uniform(0.5, 3, 1), [1, rng.uniform(-0.5, 2), rng.uniform(0.2, 2)]))
        if dt:
            G1, G2 = sampled(G1, dt), sampled(G2, dt)
        K = ncfsyn(G1).K
        gap, b1, b2 = nu_gap(G1, G2), ncf_margin(G1, K), ncf_margin(G2, K)
        assert gap == pytest.approx(nu_gap(G2, G1), abs=1e-6)
        assert np.arcsin(b2) >= np.arcsin(b1) - np.arcsin(gap) - 1e-6
        assert stable(G2, K) or gap >= b1
        assert ncfsyn(G1).gamma == pytest.approx(1 / b1, rel=1e-6)


def test_elements_do_what_they_say():
    w = 20.0
    for dt in (0.0, 0.01):
        at = np.array([w])
        for phase in np.radians([20, 60, 80]):
            k = response(lead(w, phase, dt=dt), at)[0]
            assert (abs(k), np.angle(k)) == pytest.approx((1.0, phase))
        assert abs(response(notch(w, depth=0.02, dt=dt), at)[0]) == pytest.approx(0.02)
        assert abs(response(roll_off(w, order=2, zeta=0.5, dt=dt), at)[0]) == pytest.approx(1.0)
        assert abs(response(roll_off(w, dt=dt), at)[0]) == pytest.approx(np.sqrt(0.5))
        assert np.degrees(np.angle(response(lag(w, np.inf, dt=dt), at)[0])) == pytest.approx(-45)
        K = pid(2.0, 3.0, 0.4, filter_time=0.05, dt=dt)
        s = 2 / dt * np.tan(0.5 * w * dt) * 1j if dt else 1j * w
        assert response(K, at)[0] == pytest.approx(2 + 3 / s + 0.4 * s / (0.05 * s + 1))
        # they multiply to a controller on one time base
        assert (K * lead(w, 0.5, dt=dt) * notch(w, dt=dt)).dt == dt


FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


@pytest.mark.parametrize("form", FORMS)
def test_loop_bounds_are_exact_over_the_phase(form):
    """By brute force over the phase of L: just inside the bound every phase meets the demand, just beyond one fails."""
    omega = np.array([0.1, 1.0, 10.0])
    G = control.tf([2], [1, 1])
    for size in (0.3, 1.8):
        w = size / (1 if "multiplicative" in form else 2.0)
        model = UncertaintyModel(G, control.ss([], [], [], [[w]]), form, omega, np.full(3, w), perturbation="LTI")
        g = model.at(omega)
        w_P = performance_weight(2.0, M_S=2.0, A=0.01)
        p = np.abs(response(w_P, omega))
        low, high = loop_bounds(model, w_P)
        phases = np.exp(1j * np.linspace(0, 2 * np.pi, 1441))

        def holds(k, level, g=g, p=p, w=w, phases=phases):
            K = level * phases / g[k]
            worst = worst_sensitivity(*worst_terms(form, np.full(K.size, w + 0j), np.full(K.size, g[k]), K))
            return np.max(p[k] * worst) <= 1

        for k in range(3):
            if 0 < low[k] < np.inf:
                assert holds(k, low[k] * 1.001)
                assert not holds(k, low[k] * 0.99)
            if 0 < high[k] < np.inf:
                assert holds(k, high[k] * 0.999)
                assert not holds(k, high[k] * 1.01)
            if high[k] == 0:
                assert low[k] == np.inf
                assert not any(holds(k, level) for level in np.geomspace(1e-4, 1e4, 41))


def model_to_shape():
    omega = np.geomspace(0.5, 300, 120)
    w = control.tf([0.2, 0.15], [0.02, 1])
    return UncertaintyModel(
        BOOK, w, "multiplicative", omega, np.abs(response(control.ss(w), omega)), perturbation="LTI"
    )


def test_the_picture_follows_the_controller():
    model, w_P = model_to_shape(), performance_weight(3.0, A=1e-2)
    figure, ax = plt.subplots()
    picture = plot_loop_bounds(model, w_P, 1e-3, ax=ax)
    assert picture.ax is ax
    assert picture.violations.any()
    assert "stable" in ax.get_title()
    first = picture.line.get_ydata().copy()
    better = lead(10.0, np.radians(40)) * lag(1.0, 100.0) * 0.5
    n_artists = len(ax.get_children())
    assert picture.update(better) is picture
    assert len(ax.get_children()) == n_artists  # drawn over, not on top of one another
    L = np.abs(model.at(model.omega) * response(better, model.omega))
    assert picture.line.get_ydata() == pytest.approx(20 * np.log10(L), abs=1e-6)
    assert picture.before.get_ydata() == pytest.approx(first)
    low, high = loop_bounds(model, w_P)
    assert np.array_equal(picture.violations, (low > L) | (high < L))
    assert picture.dots.get_xdata().size == picture.violations.sum()
    picture.update(1e6)
    assert ax.get_title() == "unstable"
    assert picture._repr_png_().startswith(b"\x89PNG")
    plt.close(figure)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mixsyn(BOOK, control.tf([1], [1, 0])), "w_P must be stable"),
        (lambda: mixsyn(BOOK, control.tf([1, 0, 0], [1, 1])), "w_P must be proper"),
        (lambda: mixsyn(BOOK, 1.0, w_u=control.tf([1], [1, 1], 0.1)), "w_u must be continuous or have the sampling"),
        (lambda: mixsyn(sampled(control.ss(BOOK), 0.1), 1.0, dt=0.2), "dt must be the sampling time of the plant"),
        (lambda: mixsyn(control.ss([[1.0, 0], [0, -1]], [[0], [1]], [[1, 1]], 0), 1.0, w_u=1), "can stabilise"),
        (lambda: nu_gap(sampled(control.ss(BOOK), 0.1), BOOK), "G2 must have the sampling time of G1"),
        (lambda: ncf_margin(sampled(control.ss(BOOK), 0.1), control.tf([1], [1, 1])), "K must have the sampling time"),
        (lambda: lead(1.0, 2.0), "phase must be below pi/2"),
        (lambda: lag(1.0, 0.5), "gain must be above 1"),
        (lambda: roll_off(1.0, order=3), "order must be 1 or 2"),
        (lambda: notch(-1.0), "omega must be positive"),
        (lambda: pid(1.0, 0.0, 1.0), "filter_time must be positive"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
