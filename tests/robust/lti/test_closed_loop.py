"""The closed loop by its ports, its stability with a delay, its winding number: closed forms,
counted roots.
"""

import control
import numpy as np
import pytest

import robust
from robust.analysis import loop_gains
from robust.lti.connections import closed_loop
from robust.lti.grids import refine_peaks
from robust.lti.stability import assess_stability
from tests.support.forms import DEVIATION, PERTURBED, worst_sensitivity
from tests.support.printed import unwrapped
from tests.support.sets import set_around, unstable_poles

OMEGA = np.geomspace(1e-2, 1e2, 50)
G = control.ss(control.tf([3, 1], [1, 0.4, 2]))
K = control.ss(control.tf([0.5, 2], [0.1, 1]))


def test_ports_of_the_loop():
    """u, y, e from p_in, p_out, r in terms of S = 1/(1 + G K)."""
    g, k = G(1j * OMEGA), K(1j * OMEGA)
    S = 1 / (1 + g * k)
    wanted = {
        ("u", "p_in"): -k * g * S,
        ("u", "p_out"): -k * S,
        ("u", "r"): k * S,
        ("y", "p_in"): g * S,
        ("y", "p_out"): S,
        ("y", "r"): g * k * S,
        ("e", "p_in"): -g * S,
        ("e", "p_out"): -S,
        ("e", "r"): S,
    }
    for (out, into), curve in wanted.items():
        loop = control.StateSpace(*closed_loop(G, K, (out,), (into,)))
        assert loop(1j * OMEGA) == pytest.approx(curve, rel=1e-9)


def random_system(rng, n, n_out, n_in, slowest=2):
    A = rng.standard_normal((n, n)) - slowest * np.eye(n)
    return control.StateSpace(
        A,
        rng.standard_normal((n, n_in)),
        rng.standard_normal((n_out, n)),
        rng.standard_normal((n_out, n_in)),
        0,
    )


def test_ports_of_a_loop_of_three_outputs_and_two_inputs():
    """Every pair of ports by the matrices of the textbook, K (1 + G K)^-1 and so on."""
    rng = np.random.default_rng(0)
    plant, K = random_system(rng, 3, 3, 2), random_system(rng, 2, 2, 3)
    for s in 1j * OMEGA[::10]:
        g, k = plant(s), K(s)
        S = np.linalg.inv(np.eye(3) + g @ k)
        wanted = np.block([
            [-k @ S @ g, -k @ S, k @ S],
            [S @ g, S, g @ k @ S],
            [-S @ g, -S, S],
        ])  # fmt: skip
        found = control.StateSpace(*closed_loop(plant, K, ("u", "y", "e"), ("p_in", "p_out", "r")))(
            s
        )
        np.testing.assert_allclose(found, wanted, rtol=1e-9, atol=1e-12)
        turned = control.StateSpace(*closed_loop(plant, K, ("e", "u"), ("r", "p_in")))(s)
        np.testing.assert_allclose(turned[:3, :3], S, rtol=1e-9, atol=1e-12)
        np.testing.assert_allclose(turned[3:, 3:], -k @ S @ g, rtol=1e-9, atol=1e-12)


def test_a_plant_with_its_weights_is_the_loop_with_them():
    """gamma of a design is the largest gain of [w_P S; w_u K S; w_T T], weights of several channels
    and a plant that is not square.
    """
    rng = np.random.default_rng(1)
    G = random_system(rng, 3, 3, 2)
    w_P, w_u, w_T = (random_system(rng, *size, slowest=4) for size in ((1, 2, 3), (1, 2, 2), (0, 3, 3)))  # fmt: skip
    design = robust.mixsyn(G, w_P, w_u=w_u, w_T=w_T)
    s = 1j * np.r_[0.0, np.geomspace(1e-4, 1e4, 4000)]
    g, k, P, U, T = (np.moveaxis(part(s), 2, 0) for part in (G, design.K, w_P, w_u, w_T))
    S = np.linalg.inv(np.eye(3) + g @ k)
    sizes = np.linalg.norm(np.hstack([P @ S, U @ k @ S, T @ g @ k @ S]), 2, axis=(1, 2))
    assert design.gamma == pytest.approx(sizes.max(), rel=1e-3)


def test_a_controller_of_another_shape_is_refused():
    rng = np.random.default_rng(2)
    with pytest.raises(
        ValueError,
        match="K must have 3 inputs and 2 outputs, one for each output and input of the plant",
    ):
        closed_loop(random_system(rng, 2, 3, 2), random_system(rng, 1, 3, 2), ("u",), ("r",))


def test_a_loop_without_a_solution_is_refused():
    one, minus = (control.StateSpace([], [], [], [[d]]) for d in (1.0, -1.0))
    with pytest.raises(ValueError, match="K must leave the loop well posed"):
        closed_loop(one, minus, ("e",), ("r",))


def random_set(rng, form):
    """A set around a stable loop, with G, K and w, and frequencies that resolve all of them."""
    G = control.tf([rng.uniform(0.5, 2)], [1, 2 * rng.uniform(0.1, 0.7), 1])
    K = control.tf([rng.uniform(0.1, 0.5), 0.2], [1, rng.uniform(1, 3)])
    w = control.tf(rng.uniform(0.05, 0.3) * np.array([0.01, 1]), [rng.uniform(0.2, 2), 1])
    return set_around(G, w, form), G, K, w


@pytest.mark.parametrize("form", list(PERTURBED)[:4])
def test_worst_sensitivity_over_the_disc_by_brute_force(form):
    rng = np.random.default_rng(2)
    for _ in range(3):
        model, G, K, w = random_set(rng, form)
        report = robust.check(model, K, w_P=0.1, certify=False)
        s = 1j * report.curves.omega
        rim = np.array([worst_sensitivity(form, w(x), G=G(x), K=K(x), n=2000).item() for x in s])
        bounded = np.isfinite(rim)
        assert bounded.sum() > 100
        assert np.all(0.1 * rim[bounded] <= report.curves.rp[bounded] * (1 + 1e-9))
        assert 0.1 * rim == pytest.approx(report.curves.rp, rel=2e-3)
        worst = robust.worst_case(model, K)
        s = 1j * worst.omega_worst
        reached = np.abs(1 / (1 + K(s) * PERTURBED[form](G(s), w(s), worst.delta)))
        assert abs(worst.delta) == pytest.approx(1.0)
        rim = worst_sensitivity(form, w(s), G=G(s), K=K(s), n=20_000).item()
        assert rim * (1 - 1e-12) <= reached <= rim * (1 + 1e-6)
        assert reached == pytest.approx(report.margins.S_worst, rel=1e-3)


@pytest.mark.parametrize("form", list(PERTURBED)[:4])
def test_factor_allowed_takes_the_worst_case_to_one(form):
    rng = np.random.default_rng(3)
    for _ in range(3):
        model, G, K, w = random_set(rng, form)
        factor = robust.check(model, K, w_P=0.4, certify=False).margins.rp
        grown = robust.check(set_around(G, factor * w, form), K, w_P=0.4, certify=False)
        assert 0.4 * grown.margins.S_worst == pytest.approx(1.0, rel=1e-6)
        s = 1j * grown.curves.omega
        assert np.all(DEVIATION[form](-1 / K(s), G(s)) > factor * np.abs(w(s)))


@pytest.mark.parametrize(
    ("product", "poles"),
    [(1.5, 0), (1.6, 2), (7.8, 2), (7.9, 4), (14.2, 6)]
    + [(angle * share, poles)
       for angle, before in ((np.pi / 2, 0), (5 * np.pi / 2, 2))
       for share, poles in ((1 - 1e-6, before), (1 + 1e-6, before + 2))],
)  # fmt: skip
def test_a_delay_in_a_loop_of_an_integrator(product, poles):
    """s + k exp(-s tau) has a pair more in the right half plane at each k tau = pi/2 + 2 pi n."""
    lag = control.tf([2.0], [1, 1e-9])
    found = robust.check(set_around(lag, 1e-9), 1.0, delay=product / 2.0, certify=False)
    assert unstable_poles(found) == poles


def test_poles_on_the_boundary_are_not_decided():
    undamped = control.StateSpace([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], [[0]], 0)
    assert assess_stability(undamped).state == "undecided"
    assert assess_stability(control.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]], 0)).stable
    found = assess_stability(control.StateSpace([[1.0]], [[0.0]], [[0.0]], [[0.0]], 0))
    assert (found.state, found.pole) == ("unstable", 1)
    assert "pole at 1" in unwrapped(found)
    assert assess_stability(control.ss([], [], [], [[1.0]])).stable


@pytest.mark.parametrize("gain", [0.5, 0.9, 1.1, 3.0])
def test_winding_number_counts_what_polynomials_say(gain):
    """8 k/(s + 1)^3 is stable up to k = 1; P/(s - 1) needs gain above one: one turn less."""
    omega = np.geomspace(1e-2, 1e2, 800)
    unstable = np.sum(np.roots([1, 3, 3, 1 + 8 * gain]).real > 0)
    for num, den, K, n_poles, turns in (
        ([8.0], [1, 3, 3, 1], gain, 0, -unstable),
        ([1.0], [1, -1], 3 * gain, 1, 1 - (3 * gain < 1)),
    ):
        frf = control.FrequencyResponseData(control.tf(num, den)(1j * omega), omega)
        found = robust.check(frf, K, n_unstable=n_poles)
        assert found.nominally_stable == (turns == n_poles)
        if turns != n_poles:
            assert f"1 + L winds {turns} times about zero" in unwrapped(found)


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_a_mode_that_no_log_grid_sees_is_on_the_grid(dt):
    sharp = control.ss([[-1e-7, 3.0], [-3.0, -1e-7]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    sharp = robust.sampled(sharp, dt) if dt else sharp
    omega = robust.check(set_around(sharp), 1e-12, certify=False).curves.omega
    assert np.abs(omega / 3 - 1).min() < 1e-7
    assert np.abs(loop_gains(sharp, 1e-12).omega / 3 - 1).min() < 1e-7


def test_the_highest_of_a_curve_is_found_between_the_points():
    """rs is |w|/2 of a loop of ones; |w| a resonance."""
    w = control.tf([0.1], [1, 0.1, 1])
    found = robust.check(set_around(1.0, w), 1.0, certify=False).margins.peak_rs
    assert found.value == pytest.approx(0.05 / (0.1 * np.sqrt(1 - 0.05**2)), rel=1e-6)
    assert found.omega == pytest.approx(np.sqrt(1 - 0.1**2 / 2), rel=1e-3)
    assert robust.worst_case(set_around(1.0, w), 1.0).omega_worst == pytest.approx(
        found.omega, rel=1e-3
    )


def test_several_curves_are_climbed_together_as_each_alone():
    """Sharp and flat, high and low, a corner: no maximum is lost among those of another curve."""

    def curves(w):
        corner = np.where(w < 5, w / 5, 5 / w)
        return np.array(
            [1 / np.hypot(1 - w**2, 1e-4 * w), 1e-3 / np.hypot(1 - (w / 30) ** 2, 0.02 * w), corner]
        )

    points = np.geomspace(0.01, 100, 700)
    points = np.unique(np.concatenate([points, 1 + 1e-4 * np.linspace(-2, 2, 21)]))
    found = refine_peaks(curves, points, values=curves(points), band=(0.01, 100.0))
    sharp, flat, corner = found
    assert sharp == pytest.approx((1e4, 1.0), rel=1e-7)
    scan = np.linspace(1, 40, 1_000_001)
    assert flat == pytest.approx((curves(scan)[1].max(), scan[curves(scan)[1].argmax()]), rel=1e-4)
    assert corner == pytest.approx((1.0, 5.0), rel=1e-4)


@pytest.mark.parametrize(
    ("group", "above", "pole"),
    [([0, 1, 2], 2e-2, 1e-2), ([3, 4], 2e-2, 1e-2), ([5], 2e-15, 1e-15), ([], 0.0, None)],
)
def test_states_that_act_on_each_other_are_one_part(group, above, pole):
    """A ring of three, a pair behind it, and a slow state that both drive: the slow pole is exact,
    because nothing reads it. A group is moved until its pole is unstable.
    """
    A = np.zeros((6, 6))
    A[[1, 2, 0], [0, 1, 2]] = 1.0  # a ring, with the roots of one
    A[3, 2] = A[3, 4] = A[4, 3] = 1.0  # a pair that the ring drives
    A[5, :5] = 1e6
    A -= np.diag([1.01, 1.01, 1.01, 1.01, 1.01, 1e-15])
    A[group, group] += above
    found = assess_stability(control.StateSpace(A, np.zeros((6, 1)), np.zeros((1, 6)), [[0.0]], 0))
    if pole is None:
        assert found.stable
    else:
        assert found.unstable
        assert found.pole == pytest.approx(pole, rel=1e-9)
