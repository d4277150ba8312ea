"""H-infinity synthesis against published numbers, closed forms, and what no controller can beat."""

import control
import numpy as np
import pytest

from robust import hinfsyn

BOOK = control.ss(control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1]))))


def mixed_sensitivity(G, w_P, w_u=1.0, dt=0):
    """From (r, u) to (w_P e, w_u u, e) with e = r - G u."""
    zero, one = np.zeros((1, 1)), np.ones((1, 1))
    n = G.nstates
    e = control.StateSpace(
        G.A, np.hstack([np.zeros((n, 1)), G.B]), -G.C, np.hstack([one, -G.D]), dt
    )
    three = control.StateSpace(
        e.A,
        e.B,
        np.vstack([e.C, 0 * e.C, e.C]),
        np.vstack([e.D, np.hstack([zero, one * w_u]), e.D]),
        dt,
    )
    both = control.StateSpace([], [], [], np.eye(2), dt)
    return control.append(control.StateSpace(w_P.A, w_P.B, w_P.C, w_P.D, dt), both) * three


def random_plant(rng, n, n_w, n_u, n_z, n_y, dt=0):
    A = rng.standard_normal((n, n))
    A = A / np.abs(np.linalg.eigvals(A)).max() * 1.3 if dt else A
    B, C = rng.standard_normal((n, n_w + n_u)), rng.standard_normal((n_z + n_y, n))
    return control.StateSpace(A, B, C, 0.5 * rng.standard_normal((n_z + n_y, n_w + n_u)), dt)


def is_stable(system):
    poles = system.poles()
    return np.all(np.abs(poles) < 1) if system.dt else np.all(poles.real < 0)


def norm_on_a_grid(system):
    omega = np.concatenate([[0.0], np.geomspace(1e-4, 1e4, 2000)])
    points = np.exp(2j * np.arctan(omega)) if system.dt else 1j * omega
    values = np.moveaxis(system(points), 2, 0)
    return np.linalg.svd(values, compute_uv=False)[:, 0].max()


def test_sp_example_2_17():
    """SP Example 2.17: w_P with M = 1.5, omega_B = 10, A = 1e-4, w_u = 1 gives 1.37 (1.366 in more
    digits).
    """
    P = mixed_sensitivity(BOOK, control.ss(control.tf([1 / 1.5, 10], [1, 1e-3])))
    found = hinfsyn(P, 1, 1)
    assert found.gamma_min == pytest.approx(1.366, abs=5e-4)
    assert found.gamma_min < found.level < found.gamma_min * 1.0002
    assert found.gamma <= 1.01 * found.gamma_min
    assert found.reason == ""


@pytest.mark.parametrize("slow", [1e-5, 1e-6, 1e-9])
def test_slow_pole_with_a_biproper_weight(slow):
    """Where synthesis hangs elsewhere: the optimum hardly moves with a pole at -1e-6 rad/s."""
    found = hinfsyn(mixed_sensitivity(BOOK, control.ss(control.tf([1 / 1.5, 10], [1, slow]))), 1, 1)
    assert found.gamma_min == pytest.approx(1.366, abs=1e-3)
    assert found.gamma <= 1.011 * found.gamma_min


def test_scalar_problem_in_closed_form():
    """x' = a x + w1 + u, z = (x, u), y = x + w2: 2 a X - X^2 (1 - 1/g^2) + 1 = 0, Y = X < g."""
    a = 0.7
    P = control.StateSpace(
        [[a]], [[1, 0, 1]], [[1], [0], [1]], [[0, 0, 0], [0, 0, 1], [0, 1, 0]], 0
    )
    found = hinfsyn(P, 1, 1, tolerance=1e-9)
    # at the optimum X = g: 2 a g - g^2 + 2 = 0
    assert found.gamma_min == pytest.approx(a + np.sqrt(a**2 + 2), rel=1e-8)


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("dt", [0, 0.1])
def test_several_inputs_and_outputs_with_every_direct_term(dt):
    rng = np.random.default_rng(1)
    for _ in range(6):
        n_u, n_y = rng.integers(1, 4, 2)
        P = random_plant(rng, int(rng.integers(1, 11)), n_y + 1, n_u, n_u + 2, n_y, dt)
        found = hinfsyn(P, n_y, n_u)
        assert found.found
        assert found.gamma_min < found.level  # a regular problem
        closed = P.lft(found.K)
        assert is_stable(closed)
        assert norm_on_a_grid(closed) <= found.gamma * (1 + 1e-6)
        assert found.gamma_min * (1 - 1e-6) <= found.gamma <= 1.011 * found.gamma_min
        # no controller beats the lower end of the bracket: some that stabilise the loop too
        for _ in range(10):
            K = control.StateSpace(
                found.K.A,
                found.K.B,
                found.K.C,
                found.K.D + 0.03 * rng.standard_normal(found.K.D.shape),
                dt,
            )
            other = P.lft(K)
            if is_stable(other):
                assert norm_on_a_grid(other) > found.gamma_min * 0.999


def test_the_bilinear_map_keeps_the_optimum():
    P = random_plant(np.random.default_rng(5), 5, 3, 2, 4, 2)
    image = control.sample_system(P, 2, "bilinear")  # s = (z - 1)/(z + 1)
    discrete = control.StateSpace(image.A, image.B, image.C, image.D, 0.5)
    assert hinfsyn(discrete, 2, 2).gamma_min == pytest.approx(hinfsyn(P, 2, 2).gamma_min, rel=2e-4)


def test_a_discrete_plant_with_poles_at_minus_one_at_one_and_at_zero():
    for p in (-1.0, 1.0, 0.0):
        G = control.StateSpace([[p, 1.0], [0.0, 0.0]], [[0.0], [1.0]], [[1.0, 0.0]], [[0.0]], 0.1)
        w_P = control.sample_system(
            control.ss(control.tf([0.5, 0.05], [1, 1e-4])), 0.1, method="bilinear"
        )
        found = hinfsyn(mixed_sensitivity(G, w_P, 0.1, 0.1), 1, 1)
        assert found.found
        assert is_stable(control.feedback(G * found.K, 1))


def test_singular_problems_are_made_regular_and_judged_without():
    """An integrator under output disturbance (P21 loses rank at 0), and no weight on u (D12 =
    0).
    """
    w_P = control.ss(control.tf([1 / 1.5, 10], [1, 1e-3]))
    integrator = control.ss(control.tf([1], [1, 0]))
    for P in (mixed_sensitivity(integrator, w_P), mixed_sensitivity(BOOK, w_P, 0.0)):
        found = hinfsyn(P, 1, 1)
        assert found.level == found.gamma_min  # a singular problem
        assert norm_on_a_grid(P.lft(found.K)) <= found.gamma * (1 + 1e-6)
        assert found.gamma < 5


def test_good_enough_is_enough_and_the_cap_is_kept():
    P = mixed_sensitivity(BOOK, control.ss(control.tf([1 / 1.5, 10], [1, 1e-3])))
    assert 2.0 <= hinfsyn(P, 1, 1, gamma_min=2.0).level < 2.001
    hurried = hinfsyn(P, 1, 1, n_steps=1)
    assert not hurried.found
    assert hurried.n_steps == 1
    assert "all levels that n_steps allows were tried" in hurried.reason
    assert not hurried.K.D.any()


def test_a_level_with_an_undamped_solution_is_not_met():
    """Below 8.19 the Hamiltonian has eigenvalues on the axis: one of each pair, told by rounding,
    is no solution.
    """
    A = [[-0.59, -0.47, 0.59], [-0.66, -0.61, -1.61], [0.73, 0.81, -0.48]]
    B = [[0.16, -1.29, -0.47], [1.38, 0.14, 2.31], [-0.79, 0.58, -0.2]]
    C = [[0.57, -0.01, -0.56], [-0.87, 3.07, -0.08], [-2.02, -0.65, 0.68]]
    found = hinfsyn(control.ss(A, B, C, [[0, 0, 0], [0, 0, 1], [0, 1, 0]], 0), 1, 1)
    assert found.reason == ""
    assert found.gamma_min <= found.level <= found.gamma <= 1.0101 * found.level


def hidden(mode, reached):
    B2, C2 = ([[0.0]], [[1.0]]) if reached == "y" else ([[1.0]], [[0.0]])
    return control.StateSpace(
        [[mode]], np.hstack([[[1.0]], B2]), np.vstack([[[1.0]], C2]), [[0, 1], [1, 0]], 0
    )


@pytest.mark.parametrize("is_hidden", [False, True])
def test_whether_a_mode_is_hidden_depends_on_no_units(is_hidden):
    """Relative to the norm of A, a mode that is reached counted as hidden in states of other
    units.
    """
    rng = np.random.default_rng(0)
    for _ in range(30):
        n = int(rng.integers(3, 9))
        A, B, C = (rng.standard_normal(shape) for shape in ((n, n), (n, 2), (2, n)))
        A[:2] += 2 * np.eye(2, n)
        if is_hidden:  # u does not reach the first two
            A[:2, 2:], B[:2, 1] = 0, 0
            A[:2, :2] = [[0.5, 2.0], [-2.0, 0.5]]
        states, speed = 10 ** rng.uniform(-5, 5, n), 10 ** rng.uniform(-5, 5)
        channels = 10 ** rng.uniform(-5, 5, 4)
        A = A * states[:, None] / states
        B = B * states[:, None] * channels[:2]
        C = C / states * channels[2:, None]
        P = control.StateSpace(speed * A, speed * B, C, [[0, 1], [1, 0]], 0)
        if is_hidden:
            with pytest.raises(ValueError, match="u does not reach the mode"):
                hinfsyn(P, 1, 1, n_steps=1)
        else:
            assert hinfsyn(P, 1, 1, n_steps=1).n_steps == 1


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: hinfsyn(hidden(2.0, "y"), 1, 1),
            "P must be stabilisable .* u does not reach the mode at s = 2",
        ),
        (
            lambda: hinfsyn(hidden(0.0, "u"), 1, 1),
            "P must be stabilisable .* y misses the mode at s = 0",
        ),
        (lambda: hinfsyn(BOOK, 1, 1), "P must have more than n_y = 1 outputs"),
        (lambda: hinfsyn(hidden(1, "y"), 0, 1), "n_y must be a whole number of at least 1"),
        (lambda: hinfsyn(hidden(1, "y"), 1, 1, factor=0.9), "factor must be at least 1"),
        (lambda: hinfsyn("P", 1, 1), "P must be a control.StateSpace"),
        (lambda: hinfsyn(hidden(1, "y"), 1, 1, n_steps=0), "n_steps must be"),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()
