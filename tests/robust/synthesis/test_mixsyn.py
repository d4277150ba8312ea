"""Mixed sensitivity: published numbers, brute force."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, discretize, mixsyn, performance_weight, sampled
from robust.systems.lti import response

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
    design = mixsyn(BOOK, W_P, w_u=1, time_cap=60)
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


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mixsyn(BOOK, control.tf([1], [1, 0])), "w_P must be stable"),
        (lambda: mixsyn(BOOK, control.tf([1, 0, 0], [1, 1])), "w_P must be proper"),
        (lambda: mixsyn(BOOK, 1.0, w_u=control.tf([1], [1, 1], 0.1)), "w_u must be continuous or have the sampling"),
        (lambda: mixsyn(sampled(control.ss(BOOK), 0.1), 1.0, dt=0.2), "dt must be the sampling time of the plant"),
        (lambda: mixsyn(control.ss([[1.0, 0], [0, -1]], [[0], [1]], [[1, 1]], 0), 1.0, w_u=1), "can stabilise"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
