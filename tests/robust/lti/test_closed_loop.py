"""The closed loop by its ports, its stability with a delay, its winding number: closed forms,
counted roots.
"""

import control
import numpy as np
import pytest

from robust.lti.connections import (
    closed_loop,
    largest_allowed_factor,
    weighted_plant,
    worst_perturbation,
    worst_sensitivity,
)
from robust.lti.grids import find_peak, loop_grid, refine_peaks, structure_grid
from robust.lti.stability import assess_stability as instability
from robust.lti.stability import (
    connected_components,
    delay_pole_count,
    poles_with_rounding,
    winding_number,
)
from tests.support.printed import unwrapped

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


def random_system(rng, n, n_out, n_in):
    A = rng.standard_normal((n, n)) - 2 * np.eye(n)
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
    """Closed by any K it is [w_P S; w_u K S; w_T T], and what d, z of the plant see."""
    rng = np.random.default_rng(1)
    # (d, u) of 1 + 2 to (z, y) of 1 + 3
    P = random_system(rng, 3, 4, 3)
    K = random_system(rng, 2, 3, 2)
    K = control.StateSpace(K.A, K.B[:, [0, 1, 1]], K.C[:2], 0.1 * np.ones((2, 3)), 0)
    weights = [
        ("e", random_system(rng, 1, 2, 3)),
        ("u", random_system(rng, 1, 2, 2)),
        ("y", random_system(rng, 0, 3, 3)),
    ]
    whole = weighted_plant(P, 3, n_u=2, weights=weights).lft(K)
    bare = weighted_plant(P, 3, n_u=2, weights=[], reference=False).lft(K)
    for s in (0.3j, 2j):
        p, k = P(s), K(s)
        g_zd, g_zu, g_yd, g_yu = p[:1, :1], p[:1, 1:], p[1:, :1], p[1:, 1:]
        S = np.linalg.inv(np.eye(3) + g_yu @ k)
        from_d, from_r = (-S @ g_yd, -k @ S @ g_yd), (S, k @ S)
        columns = []
        for e, u, direct, output in (
            (*from_d, g_zd, g_yd),
            (*from_r, np.zeros((1, 3)), np.zeros((3, 3))),
        ):
            y = output + g_yu @ u
            columns.append(
                np.vstack(
                    [
                        direct + g_zu @ u,
                        weights[0][1](s) @ e,
                        weights[1][1](s) @ u,
                        weights[2][1](s) @ y,
                    ]
                )
            )
        np.testing.assert_allclose(whole(s), np.hstack(columns), rtol=1e-9, atol=1e-11)
        np.testing.assert_allclose(bare(s, squeeze=False), columns[0][:1], rtol=1e-9, atol=1e-11)


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


def test_worst_sensitivity_over_the_disc_by_brute_force():
    rng = np.random.default_rng(2)
    S, a, b = (rng.standard_normal(200) + 1j * rng.standard_normal(200) for _ in range(3))
    b = b / np.abs(b) * rng.uniform(0, 0.95, 200)
    Delta = np.exp(2j * np.pi * np.arange(2000) / 2000)[:, None]
    found = np.abs(S * (1 + a * Delta) / (1 + b * Delta)).max(axis=0)
    worst = worst_sensitivity(S, a, b)
    assert np.all(found <= worst * (1 + 1e-12))
    assert found == pytest.approx(worst, rel=2e-3)
    there = worst_perturbation(a, b)
    assert np.abs(there) == pytest.approx(1.0)
    assert np.abs(S * (1 + a * there) / (1 + b * there)) == pytest.approx(worst, rel=1e-9)


def test_factor_allowed_takes_the_worst_case_to_one():
    rng = np.random.default_rng(3)
    size = rng.uniform(0.05, 0.9, 100)
    a, b = (rng.standard_normal(100) + 1j * rng.standard_normal(100) for _ in range(2))
    k = largest_allowed_factor(size, a, b)
    assert worst_sensitivity(size + 0j, k * a, k * b) == pytest.approx(1.0, rel=1e-9)


@pytest.mark.parametrize(("product", "poles"), [(1.5, 0), (1.6, 2), (7.8, 2), (7.9, 4), (14.2, 6)])
def test_a_delay_in_a_loop_of_an_integrator(product, poles):
    """s + k exp(-s tau) has a pair more in the right half plane at each k tau = pi/2 + 2 pi n."""
    lag = control.ss(control.tf([2.0], [1, 1e-9]))
    assert delay_pole_count(lag, product / 2.0) == poles


def test_poles_on_the_boundary_are_not_decided():
    undamped = control.StateSpace([[0, 1], [-1, 0]], [[0], [1]], [[1, 0]], [[0]], 0)
    found, moved = poles_with_rounding(undamped)
    assert np.all(np.abs(found.real) <= moved)
    assert instability(undamped).state != "stable"
    assert instability(control.StateSpace([[-1.0]], [[1.0]], [[1.0]], [[0.0]], 0)).stable
    found = instability(control.StateSpace([[1.0]], [[0.0]], [[0.0]], [[0.0]], 0))
    assert (found.state, found.pole) == ("unstable", 1)
    assert "pole at 1" in unwrapped(found)


@pytest.mark.parametrize("gain", [0.5, 0.9, 1.1, 3.0])
def test_winding_number_counts_what_polynomials_say(gain):
    """8 k/(s + 1)^3 is stable up to k = 1; P/(s - 1) needs gain above one: one turn less."""
    omega = np.geomspace(1e-2, 1e2, 800)
    three = control.ss(control.tf([8.0], [1, 3, 3, 1]))
    turns, clear = winding_number(
        omega, three(1j * omega), K=control.ss([], [], [], [[gain]]), dt=0.0
    )
    unstable = np.sum(np.roots([1, 3, 3, 1 + 8 * gain]).real > 0)
    assert turns == -unstable
    assert clear
    one = control.ss(control.tf([1.0], [1, -1]))
    turns, clear = winding_number(
        omega, one(1j * omega), K=control.ss([], [], [], [[3 * gain]]), dt=0.0
    )
    assert clear
    assert turns == 1 - (3 * gain < 1)


def test_a_mode_that_no_log_grid_sees_is_on_the_grid():
    sharp = control.ss([[-1e-7, 3.0], [-3.0, -1e-7]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]])
    omega = loop_grid(np.array([1.0, 10.0]), np.zeros(0, complex), systems=[sharp], dt=0.0)
    assert np.abs(omega / 3 - 1).min() < 1e-7
    assert np.abs(structure_grid(sharp) / 3 - 1).min() < 1e-7


def test_the_highest_of_a_curve_is_found_between_the_points():
    peak, where = find_peak(
        lambda w: 1 / np.hypot(1 - w**2, 0.1 * w),
        np.geomspace(0.01, 100, 60),
        band=(0.01, 100),
        top=np.inf,
    )
    assert peak == pytest.approx(1 / (0.1 * np.sqrt(1 - 0.05**2)), rel=1e-6)
    assert where == pytest.approx(np.sqrt(1 - 0.1**2 / 2), rel=1e-3)


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


def test_states_that_act_on_each_other_are_one_part():
    """A ring of three, a pair behind it, and one alone, against the definition by powers of the
    graph.
    """
    A = np.zeros((6, 6))
    A[[1, 2, 0], [0, 1, 2]] = 1.0  # a ring
    A[3, 2] = A[3, 4] = A[4, 3] = 1.0  # a pair that the ring drives
    assert [part.tolist() for part in connected_components(A)] == [[0, 1, 2], [3, 4], [5]]
    assert connected_components(np.zeros((0, 0))) == []
