"""Classical margins against closed forms and python-control; steps against closed forms and
scipy.
"""

import control
import numpy as np
import pytest
from scipy.signal import dlsim

import robust
from robust import DesignWarning, UncertaintyModel, check, sampled, step_response, worst_case
from tests.support.printed import unwrapped

OMEGA = np.geomspace(1e-3, 1e3, 3000)


@pytest.mark.parametrize("seed", range(12))
def test_margins_are_those_of_python_control(seed):
    rng = np.random.default_rng(seed)
    poles = -(10 ** rng.uniform(-1, 1.5, 3))
    L = control.tf([10 ** rng.uniform(1, 2)], np.poly(poles)) * control.tf([1, 1], [1, 0])
    seen = robust.margins.classical_margins(OMEGA, L(1j * OMEGA))
    gm, pm, _, wpc, wgc, _ = control.stability_margins(L, returnall=True)
    near = np.argmin(np.abs(pm))
    assert np.degrees(seen.phase_margin) == pytest.approx(abs(pm[near]), abs=0.01)
    assert seen.omega_phase == pytest.approx(wgc[near], rel=1e-4)
    assert seen.crossover == pytest.approx(max(wgc), rel=1e-4)
    above, below = gm[gm > 1], gm[(gm < 1) & (gm > 0)]
    assert seen.gain_margin == (pytest.approx(min(above), rel=1e-3) if above.size else np.inf)
    assert seen.gain_reduction == (pytest.approx(max(below), rel=1e-3) if below.size else 0.0)
    assert len(wpc) == above.size + below.size


def test_the_bandwidth_is_that_of_the_sensitivity():
    seen = robust.margins.classical_margins(OMEGA, 2 / (1j * OMEGA))  # |S| = w / sqrt(w^2 + 4)
    assert seen.bandwidth == pytest.approx(2.0, rel=1e-5)
    assert (seen.gain_margin, seen.gain_reduction) == (np.inf, 0.0)
    assert np.isnan(robust.margins.classical_margins(OMEGA, 0.1 / (1j * OMEGA + 1)).bandwidth)
    assert "|L| never crosses one" in unwrapped(
        robust.margins.classical_margins(OMEGA, 0.1 / (1j * OMEGA + 1))
    )


def test_every_crossover_is_named():
    """1/s times a resonance of gain 1/(2 zeta):

    |L| = 1 at one, and twice around the resonance at ten.
    """
    L = 1 / (1j * OMEGA) * 100 / (100 - OMEGA**2 + 0.2j * OMEGA)
    seen = robust.margins.classical_margins(OMEGA, L)
    size = lambda omega: abs(100 / (1j * omega * (100 - omega**2 + 0.2j * omega)))  # noqa: E731
    assert len(seen.crossovers) == 3
    assert [size(omega) for omega in seen.crossovers] == pytest.approx([1, 1, 1], rel=1e-3)
    assert str(seen).startswith("crossovers 0.1608 Hz, 1.507 Hz, 1.664 Hz, phase margin")
    assert seen.crossover == max(seen.crossovers)


def test_a_sampled_loop_has_its_gain_margin_at_nyquist():
    """k/(z - 1) is stable to k = 2, with the pole at z = -1."""
    T = 0.1
    omega = np.append(np.geomspace(1e-3, 0.99 * np.pi / T, 2000), np.pi / T * (1 - 1e-9))
    seen = robust.margins.classical_margins(omega, 0.5 / (np.exp(1j * omega * T) - 1))
    assert seen.gain_margin == pytest.approx(4.0, rel=1e-6)
    assert seen.omega_gain == pytest.approx(np.pi / T)


def test_the_report_says_them():
    plant, w = control.tf([1], [1, 3, 3, 1]), control.tf([0.05], [1])
    model = UncertaintyModel(
        plant, w, "multiplicative", np.array([0.1, 10.0]), np.array([0.05, 0.05])
    )
    report = check(model, 4.0)
    assert report.classical.gain_margin == pytest.approx(2.0, rel=1e-3)
    said = unwrapped(report)
    for fact in report.classical.facts:
        assert f"{fact.name}: {fact.amount}" in said or not fact.amount
    assert "gain margin: 6.021 dB at 0.2757 Hz" in said
    assert np.isnan(check(model, 9.0).classical.phase_margin)


@pytest.mark.parametrize("zeta", [0.05, 0.3, 0.9])
def test_overshoot_and_settling_of_a_second_order_loop(zeta):
    step = step_response(control.tf([1], [1, 2 * zeta, 0]), 1.0)
    assert step.final == pytest.approx(1)
    assert step.overshoot == pytest.approx(np.exp(-np.pi * zeta / np.sqrt(1 - zeta**2)), abs=2e-4)
    t = np.linspace(0, 150, 200_000)
    wd = np.sqrt(1 - zeta**2)
    y = 1 - np.exp(-zeta * t) * (np.cos(wd * t) + zeta / wd * np.sin(wd * t))
    assert step.settling_time == pytest.approx(
        t[np.flatnonzero(np.abs(y - 1) > 0.02)[-1]], rel=0.01
    )
    assert step.rise_time == pytest.approx(t[np.argmax(y > 0.9)] - t[np.argmax(y > 0.1)], rel=0.03)


def test_a_sampled_step_is_that_of_scipy():
    T, plant, K = (
        0.05,
        control.tf([2], [1, 0.5, 4]),
        robust.shaping.pid(0.3, 0.8, 0.1, filter_time=0.1, dt=0.05),
    )
    step = step_response(plant, K, delay=0.03)
    G = sampled(control.ss(plant), T, 0.03)
    closed = control.ss(control.feedback(G * K, 1))
    _, y, _ = dlsim((closed.A, closed.B, closed.C, closed.D, T), np.ones(step.t.size))
    np.testing.assert_allclose(step.y, y[:, 0], atol=1e-9)
    assert step.u[-1] * 0.5 == pytest.approx(step.y[-1], rel=0.05)


def test_a_fast_rise_and_a_slow_tail_are_both_seen():
    step = step_response(
        control.tf([1], [1, 1e-3]), control.tf([1e4, 10], [1, 0])
    )  # T = 1e4/(s + 1e4), and a hidden mode
    assert step.rise_time == pytest.approx(np.log(9) / 1e4, rel=0.02)
    assert step.settling_time == pytest.approx(np.log(50) / 1e4, rel=0.02)


def test_a_loop_that_is_not_stable_has_no_step():
    with pytest.raises(ValueError, match="K must stabilise the plant"):
        step_response(control.tf([1], [1, -1]), 0.5)
    with pytest.raises(ValueError, match="delay must"):
        step_response(control.tf([1], [1, 1]), 0.5, delay=-1)


@pytest.mark.parametrize("dt", [0, 0.05])
def test_a_step_of_a_set_is_that_of_its_nominal_and_of_its_worst_plant(dt):
    model = UncertaintyModel(
        control.tf([1], [1, 1, 1]), control.tf([0.2], [1]), "multiplicative", [1.0, 2.0], [0.2, 0.2]
    )
    K, delay = control.tf([0.9], [1], dt), 0.1
    step, worst = step_response(model, K, delay=delay), worst_case(model, K, delay=delay)
    for found, plant in ((step, model.nominal), (step.worst, worst.plant)):
        np.testing.assert_array_equal(found.y, step_response(plant, K, delay=delay).y)
    assert step.worst.overshoot > step.overshoot
    assert str(step).splitlines() == [
        f"nominal plant: {step_response(model.nominal, K, delay=delay)}",
        f"worst plant: {step.worst}",
    ]


def test_a_worst_plant_that_was_sampled_has_its_delay_once():
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    omega = np.geomspace(0.1, 30, 20)
    gains, radius = (control.ss([], [], [], [[0.5]]),) * 2, np.full((4, 20), 0.5)
    model = UncertaintyModel(
        nominal=G, form="input", left=gains, right=gains, omega=omega, radius=radius
    )
    K, delay = control.ss([], [], [], 0.5 * np.eye(2), 0.1), 0.25
    step = step_response(model, K, delay=delay, duration=1.0)
    worst = worst_case(model, K, delay=delay)
    assert worst.plant.dt == 0.1
    assert np.all(step.worst.y[:, :3] == 0)  # until 0.25 s
    assert step.worst.y[0, 3] > 0


def test_a_set_that_the_loop_does_not_survive_is_said():
    model = UncertaintyModel(
        control.tf([1], [1, 1, 1]), control.tf([2.0], [1]), "multiplicative", [1.0, 2.0], [0.2, 0.2]
    )
    with pytest.warns(DesignWarning, match="a plant of the set makes the loop unstable"):
        step = step_response(model, 3.0)
    assert step.worst is None


@pytest.mark.parametrize("dt", [0, 0.02])
def test_a_step_of_one_of_several_references_is_that_of_the_closed_loop(dt):
    rng = np.random.default_rng(3)
    A = rng.standard_normal((4, 4))
    A -= (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(4)
    G = control.ss(A, rng.standard_normal((4, 2)), rng.standard_normal((3, 4)), np.zeros((3, 2)))
    K = control.ss(
        [[-1.0]], 0.1 * np.ones((1, 3)), [[0.2], [-0.1]], 0.05 * rng.standard_normal((2, 3)), dt
    )
    seen = sampled(G, dt) if dt else G
    loop = control.feedback(seen * K, np.eye(3))
    for j in range(3):
        step = step_response(G, K, duration=3.0, reference=j)
        assert (step.y.shape[0], step.u.shape[0], step.reference) == (3, 2, j)
        even = np.linspace(0, 3, 1501) if not dt else step.t
        wanted = control.forced_response(
            loop, even, np.outer(np.eye(3)[j], np.ones(even.size))
        ).outputs
        for found, one in zip(step.y, wanted, strict=True):
            np.testing.assert_allclose(
                np.interp(even, step.t, found), one, atol=1e-9 if dt else 1e-3
            )
        assert step.final == pytest.approx(loop.dcgain()[j, j])
    with pytest.raises(
        ValueError, match="reference must be below the 3 outputs of the plant, got 3"
    ):
        step_response(G, K, reference=3)


def test_the_delay_margin_is_the_least_of_all_crossovers():
    """1/s alone has pi/2; with a light mode far above, whose phase margin is larger, the mode
    limits the delay.
    """
    omega = np.unique(np.concatenate([np.geomspace(0.1, 100, 2000), np.linspace(15, 25, 20001)]))
    s = 1j * omega
    assert robust.margins.classical_margins(omega, 1 / s).delay_margin == pytest.approx(
        np.pi / 2, rel=1e-5
    )
    found = robust.margins.classical_margins(omega, 1 / s + 5 * s / (s**2 + 0.1 * s + 400))
    fine = np.linspace(0.5, 25, 2000001)
    L = 1 / (1j * fine) + 5j * fine / (400 - fine**2 + 0.1j * fine)
    crossing = np.flatnonzero(np.diff(np.abs(L) > 1))
    wanted = min((np.angle(L[k]) + np.pi) % (2 * np.pi) / fine[k] for k in crossing)
    assert found.delay_margin == pytest.approx(wanted, rel=1e-3)
    assert wanted < 0.2


@pytest.mark.parametrize("gain", [0.5, 1e-4])
def test_a_gain_margin_may_stand_at_nyquist(gain):
    """g/(z - 1) is stable up to g = 2, where its pole leaves at z = -1: no phase crosses 180
    degrees below Nyquist.
    """
    T = 0.1
    integrator = control.ss(control.tf([1.0], [1, -1], T))
    model = robust.UncertaintyModel(
        integrator, 1e-3, "multiplicative", np.array([1.0]), np.array([1e-3]), perturbation="LTI"
    )
    found = robust.check(model, control.ss([], [], [], [[gain]], T)).classical
    assert found.gain_margin == pytest.approx(2 / gain, rel=1e-6)
    assert found.omega_gain == pytest.approx(np.pi / T)


def margins_of(L):
    """The classical margins of a loop by `check` and by the system itself."""
    L = control.ss(L)
    model = UncertaintyModel(
        L, 1e-9, "multiplicative", np.array([1.0]), np.array([1e-9]), perturbation="LTI"
    )
    one = control.ss([], [], [], [[1.0]], L.dt)
    return check(model, one, certify=False).classical, robust.margins.classical_margins(L)


@pytest.mark.parametrize(
    ("L", "gain", "reduction"),
    [
        (control.tf([2], [1, -1]), np.inf, 0.5),  # stable for gains above one half
        (control.tf([0.5, -0.5], [1, 2, 1]), 2.0, 0.0),  # (s + 1)^2 + k (s - 1)/2
        (control.tf([-0.5, 1], [1, 2]), 2.0, 0.0),  # s + 2 + k (2 - s)/2
        (control.tf([-2], [1, 1, 1]) * 0.25, 2.0, 0.0),
        (control.tf([5e-4], [1, 0.999], 0.1), 2.0, 0.0),  # z + 0.999 + 5e-4 k, at Nyquist
        (control.tf([1], [1, 0, 0]) * control.tf([1, 1], [0.1, 1]), np.inf, 0.0),
    ],
)
def test_a_gain_margin_may_stand_where_the_frequencies_end(L, gain, reduction):
    """The phase ends there at 180 degrees, and crosses nothing: 2/(s - 1) needs at least half its
    gain, and was said to need none.
    """
    for seen in margins_of(L):
        assert seen.gain_margin == pytest.approx(gain, rel=1e-3)
        assert seen.gain_reduction == pytest.approx(reduction, rel=1e-3, abs=1e-9)


def beside_a_light_mode(seed):
    """A loop with an integrator and two light modes with zeros near them; None if it is
    unstable.
    """
    rng = np.random.default_rng(seed)
    L = control.tf([10 ** rng.uniform(-2, 0)], [10 ** rng.uniform(-1, 1), 1, 0])
    for _ in range(2):
        at, zeta = 10 ** rng.uniform(-0.5, 1.5), 10 ** rng.uniform(-6, -2, 2)
        zero = at * rng.uniform(0.9, 1.1)
        zeros = [1 / zero**2, 2 * zeta[0] / zero, 1]
        L = L * control.tf(zeros, [1 / at**2, 2 * zeta[1] / at, 1])
    return L if unstable_poles(L, 1.0) == 0 else None


def unstable_poles(L, gain):
    return int(np.sum(control.feedback(control.ss(gain * L), 1).poles().real > 0))


def test_a_gain_margin_beside_a_light_mode():
    """A pole crosses the axis at the gain margin: said to be 27 dB where it is 21 dB, between two
    points of the grid near the mode.
    """
    seen = 0
    for seed in range(60):
        L = beside_a_light_mode(seed)
        if L is None:
            continue
        for found in margins_of(L):
            factors = [found.gain_margin, found.gain_reduction]
            for factor in (k for k in factors if 1e-6 < k < 1e6):
                seen += 1
                assert unstable_poles(L, 0.999 * factor) != unstable_poles(L, 1.001 * factor)
    assert seen > 20


@pytest.mark.parametrize(
    ("lag", "modes", "gain"),
    [
        (5.155571, [(1.248228937, 3.365674526e-3, 0.155438557)], 1.623153499),
        (
            0.18077585,
            [
                (15.95867077, 1.219177741e-4, 0.01976296808),
                (71.84921804, 1.626528691e-4, 0.01817807533),
            ],
            6.213178248,
        ),
    ],
)
def test_the_settling_time_of_a_mode_that_rings_long(lag, modes, gain):
    """Steps grew until they were longer than its period: 444 s were said where it is 512 s."""
    G = control.tf([1], [1 / lag, 1])
    for at, zeta, part in modes:
        G = G + control.tf([part * at**2], [1, 2 * zeta * at, at**2])
    K = control.tf([gain, gain], [1, 0])
    closed = control.ss(control.feedback(control.ss(G) * control.ss(K), 1))
    p, V = np.linalg.eig(closed.A)
    part = (closed.C @ V)[0] * np.linalg.solve(V, np.linalg.solve(closed.A, closed.B))[:, 0]
    t = np.linspace(0, 600, 600_001)
    away = np.abs(sum((c * np.exp(s * t)).real for c, s in zip(part, p, strict=True)))
    settled = t[np.flatnonzero(away > 0.02)[-1]]
    assert step_response(G, K).settling_time == pytest.approx(settled, rel=0.01)
