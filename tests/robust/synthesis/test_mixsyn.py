"""Mixed sensitivity: published numbers, brute force."""

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, mixsyn, performance_weight, sampled
from robust.lti import discretize
from tests.support.responses import response

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
    assert design.gamma == pytest.approx(
        stack(control.ss(BOOK), design.K, {"w_P": W_P, "w_u": 1}, omega), rel=1e-3
    )
    assert stable(control.ss(BOOK), design.K)


def zero_in_the_way():
    """1/((0.2 s + 1)(s + 1)) [1 1; 1 + 2 s 2]: a zero at 0.5 (SP, and an example of python-control
    after it).
    """
    one = np.array([[-6.0, -5.0], [1.0, 0.0]])
    A, B = np.kron(np.eye(2), one), np.kron(np.eye(2), [[5.0], [0.0]])
    return control.StateSpace(A, B, [[0, 1, 0, 1], [2, 1, 0, 2]], np.zeros((2, 2)), 0)


@pytest.mark.parametrize(
    ("crossovers", "gamma"), [((0.25, 0.25), 2.80), ((0.25, 25), 2.92), ((25, 0.25), 6.73)]
)
def test_two_channels_with_a_zero_in_the_way(crossovers, gamma):
    """SP 1st ed., Example 3.8: which output is to bear the zero; 2.80, 2.92, 6.73 with M_S = 1.5, A
    = 1e-4, w_u = 1.
    """
    G, weights = zero_in_the_way(), [performance_weight(c, M_S=1.5, A=1e-4) for c in crossovers]
    w_P = control.append(*weights)
    design = mixsyn(G, w_P, w_u=1)
    assert design.gamma_min == pytest.approx(gamma, abs=1e-2)
    assert design.met
    assert design.gamma <= 1.011 * design.gamma_min
    omega = np.geomspace(1e-5, 1e4, 3000)
    g, k, w = (np.moveaxis(X(1j * omega), 2, 0) for X in (G, design.K, w_P))
    S = np.linalg.inv(np.eye(2) + g @ k)
    norm = np.linalg.norm(np.concatenate([w @ S, k @ S], axis=1), 2, axis=(1, 2)).max()
    assert design.gamma == pytest.approx(norm, rel=1e-3)


def test_channels_beside_one_another():
    """Of diagonal plants and weights the largest of the channels' least norms; one weight stands
    for all channels.
    """
    plants = [BOOK, control.tf([3], [1, 1])]
    single = [mixsyn(G, W_P, w_u=1).gamma_min for G in plants]
    both = mixsyn(control.append(*map(control.ss, plants)), W_P, w_u=np.eye(2))
    assert both.gamma_min == pytest.approx(max(single), rel=1e-3)
    tall = mixsyn(control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0, 0]]), 0.5, w_u=1)
    assert (tall.K.ninputs, tall.K.noutputs) == (1, 2)
    # two equal inputs share the work: |K S| of each is 1/sqrt(2) of that with the gain sqrt(2) on
    # one
    assert tall.gamma_min == pytest.approx(
        mixsyn(control.tf([np.sqrt(2)], [1, 1]), 0.5, w_u=1).gamma_min, rel=1e-3
    )


@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_two_channels_for_a_sampled_controller(delay):
    G = zero_in_the_way()
    design = mixsyn(G, performance_weight(0.25, M_S=1.5, A=1e-4), w_u=1, dt=0.05, delay=delay)
    assert design.met
    assert design.K.dt == 0.05
    closed = control.feedback(sampled(G, 0.05, delay) * design.K, np.eye(2))
    assert np.all(np.abs(closed.poles()) < 1)


@pytest.mark.parametrize("delay", [0.0, 0.015])
def test_mixsyn_for_a_sampled_controller(delay):
    design = mixsyn(BOOK, W_P, w_u=1, dt=0.01, delay=delay)
    G = sampled(control.ss(BOOK), 0.01, delay)
    assert design.K.dt == 0.01
    assert stable(G, design.K)
    omega = np.geomspace(1e-4, np.pi / 0.01 * 0.999, 4000)
    assert design.gamma == pytest.approx(
        stack(G, design.K, {"w_P": discretize(W_P, 0.01), "w_u": 1}, omega), rel=1e-3
    )
    assert design.gamma > mixsyn(BOOK, W_P, w_u=1).gamma_min


@pytest.mark.parametrize(
    ("G", "w_P", "options"),
    [
        (
            control.tf([1], [1, 1e-6]),
            control.tf([0.5, 1], [1, 1e-6]),
            {"w_u": 0.1},
        ),  # hangs elsewhere
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
    """The weight of the model takes its place in the stack, so the check finds the whole set
    stable.
    """
    omega = np.geomspace(0.1, 100, 30)
    w = {
        "multiplicative": control.tf([0.3, 0.1], [0.05, 1]),
        "additive": control.tf([0.02, 0.05], [0.05, 1]),
        "inverse-multiplicative": control.tf([0.05, 0.3], [1, 1]),
    }[form]
    model = UncertaintyModel(
        control.tf([1], [0.5, 1]),
        w,
        form,
        omega,
        0.3 * np.abs(response(control.ss(w), omega)),
        perturbation="LTI",
    )
    design = mixsyn(model, performance_weight(1.0, M_S=2.5, A=1e-2), w_u=0.01)
    assert design.gamma < 1
    report = check(model, design.K, w_P=performance_weight(1.0, M_S=2.5, A=1e-2))
    assert report.verdict == "robust"
    assert np.max(report.curves.np_) <= design.gamma * 1.001


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: mixsyn(BOOK, control.tf([1], [1, 0])), "w_P must be stable"),
        (lambda: mixsyn(BOOK, control.tf([1, 0, 0], [1, 1])), "w_P must be proper"),
        (
            lambda: mixsyn(BOOK, 1.0, w_u=control.tf([1], [1, 1], 0.1)),
            "w_u must be continuous or have the sampling",
        ),
        (
            lambda: mixsyn(sampled(control.ss(BOOK), 0.1), 1.0, dt=0.2),
            "dt must be the sampling time of the plant",
        ),
        (
            lambda: mixsyn(np.eye(2), np.eye(3)),
            "w_P must have 1 input, for all channels alike, or 2, got 3",
        ),
        (
            lambda: mixsyn(np.ones((2, 3)), 0.5, w_u=np.eye(2)),
            "w_u must have 1 input, for all channels alike, or 3",
        ),
        (
            lambda: mixsyn(control.ss([[1.0, 0], [0, -1]], [[0], [1]], [[1, 1]], 0), 1.0, w_u=1),
            "P must be stabilisable",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
