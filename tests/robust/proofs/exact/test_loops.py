"""Claims on loops: verified where true, to the twelfth digit; never where the true peak lies above
one.
"""

import control
import numpy as np
import pytest
from flint import ctx

from tests.support.exact_claims import verify_loop
from tests.support.precise_loops import PreciseLoop, just_above
from tests.support.printed import unwrapped
from tests.support.random_loops import curves, random_case, roots, tf_response, zpk


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("seed", range(4))
def test_random_loops_are_verified_exactly_where_true(seed):
    rng = np.random.default_rng(seed)
    for _ in range(16):
        case = random_case(rng)
        if not (case["stable"] or case["unstable"]):
            continue
        found = verify_loop(case["G"], case["K"], case["w"], case["form"], delay=case["delay"])
        assert found.verified == (case["stable"] and case["target"] < 1), (
            found.failed,
            case["kind"],
            case["target"],
        )


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("excess", [1.5e-9, 3e-8, 1e-6])
def test_a_peak_just_above_one_is_never_verified(excess):
    rng = np.random.default_rng(7)
    count = 0
    while count < 8:
        case = random_case(rng)
        if not case["stable"]:
            continue
        w, peak, _ = just_above(case, excess)
        assert 1 + 1e-9 < float(peak) < 1 + 2e-6
        assert not verify_loop(case["G"], case["K"], w, case["form"], delay=case["delay"]).verified
        count += 1


def loops_with_performance(n):
    """Random loops with a performance weight, some of it sampled, and in continuous loops a
    delay.
    """
    rng = np.random.default_rng(11)
    while n:
        case = random_case(rng)
        if not case["stable"] or case["target"] >= 1:
            continue
        G, K, w, form, omega, delay = (
            case[name] for name in ("G", "K", "w", "form", "omega", "delay")
        )
        dt = float(G.dt or K.dt or 0)
        sampled_weight = dt and rng.random() < 0.4
        z, p = roots(rng, 1), roots(rng, 1)
        w_P = zpk(np.exp(z * dt), np.exp(p * dt), 1.0, dt) if sampled_weight else zpk(z, p, 1.0)
        S, a, b = case["S"], case["a"], case["b"]
        if case["kind"] == "continuous" and rng.random() < 0.7:
            delay = 10 ** rng.uniform(-4, -2)
            there = tf_response(G, omega) * np.exp(-1j * omega * delay)
            S, a, b = curves(form, there, tf_response(K, omega), tf_response(w, omega))
            scale = case["target"] / np.abs(b).max()
            w, a, b = w * scale, a * scale, b * scale
        worst = np.abs(S) * (np.abs(1 - a * b.conj()) + np.abs(a - b)) / (1 - np.abs(b) ** 2)
        worst = worst * np.abs(tf_response(w_P, omega))
        k = int(np.argmax(worst))
        yield (
            {"G": G, "K": K, "w": w, "form": form, "delay": delay, "w_P": w_P * (1 / worst[k])},
            float(omega[k]),
        )
        n -= 1


@pytest.mark.parametrize(("n", "kinds"), [(6, 3), pytest.param(24, 9, marks=pytest.mark.attack)])
def test_performance_is_decided_beside_the_limit(n, kinds):
    """At 1 - 1e-6 verified, at 1 + 1e-6 not; the peak from 100 digits by plain evaluation."""
    seen = set()
    for loop, start in loops_with_performance(n):
        peak, _ = PreciseLoop(**loop).peak(start, 1e-2, which=1)
        seen.add((loop["form"], bool(loop["delay"]), bool(loop["K"].dt)))
        for value, true in ((1 - 1e-6, True), (1 + 1e-6, False)):
            w_P = loop["w_P"] * float(value / peak)
            found = verify_loop(
                **loop | {"w_P": w_P}, claims=("robust stability", "robust performance")
            )
            assert found.verified == true, (loop["form"], loop["delay"], value, found.failed)
            assert found.proved[:3] == ("nominal stability", "stable weights", "robust stability")
    assert len(seen) >= kinds


@pytest.mark.parametrize("n", [3, pytest.param(12, marks=pytest.mark.attack)])
def test_one_scaling_is_the_norm_of_the_loop(n):
    """Against the singular values of the loop with both weights on a dense grid, 1e-4 on either
    side.
    """
    rng = np.random.default_rng(3)
    count = 0
    while count < n:
        case = random_case(rng)
        if not case["stable"] or case["target"] >= 1 or case["kind"] == "sampled":
            continue
        G, K, w, omega, d = case["G"], case["K"], case["w"], case["omega"], 10 ** rng.uniform(-1, 1)
        dt = float(G.dt or 0)
        w_P = (
            zpk([np.exp(-2 * dt)], [np.exp(-0.1 * dt)], 0.1, dt) if dt else zpk([-2.0], [-0.1], 0.1)
        )
        g, k = tf_response(G, omega), tf_response(K, omega)
        S = 1 / (1 + g * k)
        u, y, e = {
            "u": (-g * k * S, -k * S, k * S),
            "y": (g * S, S, g * k * S),
            "e": (-g * S, -S, S),
        }.values()
        out, into = {
            "multiplicative": (u, 0),
            "additive": (u, 1),
            "inverse-multiplicative": (y, 1),
            "inverse-additive": (y, 0),
        }[case["form"]]
        W, P = tf_response(w, omega), tf_response(w_P, omega)
        M = np.array([[W * out[into], d * W * out[2]], [P / d * e[into], P * e[2]]]).transpose(
            2, 0, 1
        )
        norm = np.linalg.norm(M, 2, axis=(1, 2)).max()
        for factor, true in ((0.9999, True), (1.0001, False)):
            found = verify_loop(
                G, K, w * (factor / norm), case["form"], w_P=w_P * (factor / norm), scaling=d,
                claims=("robust stability", "robust performance with one scaling"),
            )  # fmt: skip
            assert found.verified == true, (case["form"], factor, found.failed)
        count += 1


def test_poles_on_the_axis_and_integrators():
    """1/(s^2 + 1) under 2 + s/(s^2 + 1): everything stays finite over the closed-loop
    polynomial.
    """
    G = control.ss(control.tf([1], [1, 0, 1]))
    K = control.ss(control.tf([1, 1], [0.01, 1]))
    w = control.ss([], [], [], [[0.2]])
    assert verify_loop(G, K, w, "multiplicative").verified
    double = control.ss(control.tf([1], [1, 0, 0]))
    assert verify_loop(double, K, w, "inverse-multiplicative").verified


def test_what_is_not_stable_is_said():
    lag, w = control.ss(control.tf([1], [1, 1])), control.ss([], [], [], [[0.1]])
    found = verify_loop(lag, -1.0, w, "additive")  # a pole at zero, exactly
    assert not found.verified
    assert found.failed[0] == ("nominal stability", "a pole is not stable")
    assert "nominal stability: NOT verified: a pole is not stable" in unwrapped(found)
    unstable_weight = control.ss(control.tf([1e-9], [1, -1e-12]))
    found = verify_loop(lag, 1.0, unstable_weight, "additive")
    assert found.proved == ("nominal stability",)
    assert found.failed[0][0] == "stable weights"


def test_a_limit_that_is_reached_at_infinity_is_none():
    """|w T| of a biproper loop tends to one from below: not below one at every frequency."""
    G, w = control.ss(control.tf([1, 0], [1, 1])), control.ss([], [], [], [[2.0]])
    assert not verify_loop(G, 1.0, w, "multiplicative").verified
    below = control.ss([], [], [], [[np.nextafter(2, 0)]])
    assert verify_loop(G, 1.0, below, "multiplicative").verified


@pytest.mark.parametrize(
    ("parts", "message"),
    [
        (
            {"delay": 0.05, "G": control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1)},
            "delay must be whole samples",
        ),
        (
            {"K": control.ss([[0.5]], [[1]], [[1]], [[0]], 0.2)},
            "controller must have the sampling time",
        ),
        (
            {"w": control.ss([[0.5]], [[1]], [[1]], [[0]], 0.2)},
            "weight must be continuous or sampled",
        ),
    ],
)
def test_parts_that_do_not_fit_are_not_verified(parts, message):
    G = control.ss([[0.5]], [[1]], [[1]], [[0]], 0.1)
    loop = {"G": G, "K": 0.1, "w": control.ss([], [], [], [[0.1]]), "form": "additive"} | parts
    found = verify_loop(**loop)
    assert not found.verified
    assert message in found.failed[0][1]


def test_precision_is_left_as_it_was():
    before = ctx.prec
    verify_loop(
        control.ss(control.tf([1], [1, 1])), 1.0, control.ss([], [], [], [[0.1]]), "additive"
    )
    assert ctx.prec == before
