"""Loops in cascade and feedforward against the loops themselves: poles, plants of the set, errors
by brute force.
"""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, sampled
from robust.synthesis import feedforward_filter
from tests.support.responses import response

LINES = np.array([1.0, 10.0])
INTEGRATOR = control.tf([1], [1, 0])


def both_loops(G, K_x, K_v):
    """Velocity plant, position over velocity, joined signal by signal by python-control."""
    named = [
        control.ss(G.A, G.B, G.C, G.D, inputs="u", outputs="v"),
        control.ss(control.tf([1], [1, 0]), inputs="v", outputs="x"),
        control.ss(K_x, inputs="ex", outputs="vr"),
        control.ss(K_v, inputs="ev", outputs="u"),
        control.summing_junction(["r", "-x"], "ex"),
        control.summing_junction(["vr", "-v"], "ev"),
    ]
    return control.interconnect(named, inplist="r", outlist=["x", "v"])


def test_a_cascade_is_checked_as_one_loop():
    """Robust by the check: every plant of the set is stable in both loops; beyond the margin one is
    not.
    """
    G = control.ss(control.tf([50], [1, 3]) * control.tf([400], [1, 8, 400]))
    K_x, K_v = control.tf([4], [1]), control.tf([0.04, 0.1], [1, 0])
    K = control.ss(K_v) * (1 + control.ss(K_x) * control.ss(INTEGRATOR))
    alone = control.feedback(control.ss(K_v) * G, 1).poles()
    as_one = control.feedback(G * K, 1).poles()
    assert np.sort_complex(both_loops(G, K_x, K_v).poles()) == pytest.approx(
        np.sort_complex(as_one), rel=1e-6
    )
    assert alone.real.max() < 0
    model = UncertaintyModel(
        G,
        control.tf([0.1, 0.3], [0.5, 3]),
        "multiplicative",
        LINES,
        1e-3 * LINES,
        perturbation="LTI",
    )
    report = check(model, K)
    assert report.verdict == "robust"
    # wider than each loop by itself would say: its margin is another one
    assert check(model, K_v).margins.rs > 1.01 * report.margins.rs
    for plant in model.sample(20, rng=0):
        assert both_loops(plant, K_x, K_v).poles().real.max() < 0
    factor = 1.02 * report.margins.rs
    wide = UncertaintyModel(
        G,
        factor * control.tf([0.1, 0.3], [0.5, 3]),
        "multiplicative",
        LINES,
        1e-3 * LINES,
        perturbation="LTI",
    )
    assert check(wide, K).verdict == "not robust"
    omega = np.geomspace(1e-2, 1e3, 20_000)
    g, k, w = (response(s, omega) for s in (G, K, control.ss(wide.weight)))
    T = g * k / (1 + g * k)
    worst = int(np.argmax(np.abs(w * T)))
    delta = -1 / (w * T)[worst]
    G_p = g[worst] * (1 + w[worst] * delta)
    s, k_v = 1j * omega[worst], response(control.ss(K_v), omega[[worst]])[0]
    assert abs(delta) < 1
    assert 1 + G_p * k_v * (1 + 4 / s) == pytest.approx(0, abs=1e-9)
    assert robust.margins.disk_margin(G * K).alpha == pytest.approx(report.margins.disk, rel=1e-3)


def test_a_velocity_from_differences_of_a_position():
    """Under a clock: u = K_v (K_x (r - x) - (x[k] - x[k-1])/dt), step by step and as one
    controller.
    """
    dt, G = 0.01, control.ss(control.tf([1], [1, 2, 0]))
    difference = control.tf([1, -1], [dt, 0], dt)
    K = 8.0 * (5.0 + control.ss(difference))
    plant = sampled(G, dt)
    x, before, state, path = 0.0, 0.0, np.zeros((2, 1)), [0.0]
    for _ in range(300):
        u = 8.0 * (5.0 * (1.0 - x) - (x - before) / dt)
        before, state = x, plant.A @ state + plant.B * u
        x = float((plant.C @ state)[0, 0])
        path.append(x)
    loop = control.feedback(plant, K)  # r enters behind the outer controller only
    found = control.forced_response(loop, np.arange(301) * dt, 8.0 * 5.0 * np.ones(301)).outputs
    assert found == pytest.approx(np.array(path), abs=1e-9)
    assert path[-1] == pytest.approx(1.0, abs=1e-2)


@pytest.mark.parametrize(
    "form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive", "coprime"]
)
def test_feedforward_errors_are_those_of_the_set(form):
    """T_ref S_p (1 - G_p/G) over the disc of every frequency, and exact following of the nominal
    plant.
    """
    G = control.tf([2], [1, 1])
    w = control.tf([0.02, 0.05], [0.2, 1])
    K = control.tf([1, 1], [1, 0])
    T_ref = control.tf([1], [0.3, 1])
    model = UncertaintyModel(G, w, form, LINES, 1e-3 * np.ones(2), perturbation="LTI")
    found = feedforward_filter(model, K, T_ref)
    assert found.gamma_min <= found.gamma
    assert found.error.max() < 0.02
    at = slice(None, None, 60)
    g, k, size, wanted, f = (
        response(control.ss(s), found.omega[at]) for s in (G, K, w, T_ref, found.F)
    )
    Delta = np.exp(2j * np.pi * np.arange(720) / 720)[:, None]
    t = size / np.sqrt(1 - np.abs(size) ** 2)
    plants = {
        "multiplicative": g * (1 + size * Delta),
        "additive": g + size * Delta,
        "inverse-multiplicative": g / (1 + size * Delta),
        "inverse-additive": g / (1 + size * g * Delta),
        "coprime": (g + t * Delta) / (1 - g.conj() * t * Delta),
    }[form]
    y = plants / (1 + plants * k) * (f + k * wanted)
    assert found.error_worst[at] == pytest.approx(np.abs(wanted - y).max(axis=0), rel=1e-3)
    without = np.abs(wanted / (1 + plants * k)).max(axis=0)
    assert found.error_without[at] == pytest.approx(without, rel=1e-3, abs=1e-9)
    exact = np.abs(wanted * (1 - plants / g) / (1 + plants * k)).max(axis=0)
    assert found.error_worst[at] == pytest.approx(exact, abs=0.03)


def test_feedforward_under_a_clock_and_where_it_is_refused():
    G, w = control.tf([2], [1, 1]), control.tf([0.1], [1])
    model = UncertaintyModel(G, w, "multiplicative", LINES, np.full(2, 0.1), perturbation="LTI")
    K = control.ss([], [], [], [[1.0]], 0.02)
    found = feedforward_filter(model, K, control.tf([1], [0.3, 1]), delay=0.02)
    assert found.F.dt == 0.02
    slow = found.omega < 2
    assert found.error_worst[slow].max() < 0.3 * found.error_without[slow].max()
    unstable = UncertaintyModel(
        control.tf([1], [1, -1]), w, "multiplicative", LINES, np.full(2, 0.1)
    )
    with pytest.raises(
        ValueError, match="model must have a stable nominal for a feedforward, got a pole at 1"
    ):
        feedforward_filter(unstable, 3.0, control.tf([1], [1, 1]))
