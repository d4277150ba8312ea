"""Diagonal controllers closed loop by loop: what each loop sees, demands with all of them closed,
the whole checked.
"""

import control
import numpy as np
import pytest

import nlfrf
from robust import UncertaintyModel, check, design_frf, sampled
from robust.synthesis.fixed.sequential import MatrixOnLines
from tests.support.responses import response_by_channel

#: Two masses on springs, sensors and forces a little turned: 28 and 48 Hz.
MASS, SPRING = np.diag([1.0, 1.5]), np.diag([24.8e3, 136e3]) + 9e3 * np.array([[1, -1], [-1, 1]])
DAMPING = np.diag([12.0, 24.0])
STAGE = control.ss(
    np.block(
        [
            [np.zeros((2, 2)), np.eye(2)],
            [-np.linalg.solve(MASS, SPRING), -np.linalg.solve(MASS, DAMPING)],
        ]
    ),
    np.vstack([np.zeros((2, 2)), np.linalg.inv(MASS)]),
    np.hstack([3e4 * np.array([[1, 0.15], [-0.1, 1]]), np.zeros((2, 2))]),
    np.zeros((2, 2)),
)
OMEGA = 2 * np.pi * np.arange(4.0, 200.0, 8.0)


def number(x):
    return control.ss([], [], [], [[x]])


def set_of(G, form, left, right, perturbation="LTI"):
    radius = np.repeat([[w] for w in (*left, *right)], OMEGA.size, axis=1)
    return UncertaintyModel(
        nominal=G, form=form, left=tuple(map(number, left)), right=tuple(map(number, right)), omega=OMEGA,
        radius=radius, confidence=0.95, perturbation=perturbation,
    )  # fmt: skip


def test_what_a_loop_sees_with_others_closed():
    """G_k by closing the others with python-control, and the deviation to first order by finite
    differences.
    """
    rng = np.random.default_rng(0)
    A = rng.standard_normal((4, 4)) - 3 * np.eye(4)
    G = control.ss(A, rng.standard_normal((4, 3)), rng.standard_normal((3, 4)), np.zeros((3, 3)))
    K = [control.ss(control.tf([k, 1], [1, 3])) for k in (0.5, 0.2, 0.8)]
    omega = np.array([0.3, 2.0])
    g = np.moveaxis(response_by_channel(G, omega), 2, 0)
    none = np.zeros((2, 3, 1))
    radius = rng.uniform(0.5, 1, g.shape)
    lines = MatrixOnLines(omega=omega, G=g, left=none, right=none.swapaxes(1, 2), radius=radius)
    seen = lines.seen_from(1, K, 2.0)
    gains = control.append(K[0], number(0.0), K[2])
    closed = control.feedback(G, gains)[1, 1]
    np.testing.assert_allclose(seen.G[0, 0], closed(1j * omega), rtol=1e-9)
    slopes = np.zeros(g.shape, dtype=complex)
    for j, i in np.ndindex(3, 3):
        moved = g.copy()
        moved[:, j, i] += 1e-6
        other = MatrixOnLines(
            omega=omega, G=moved, left=none, right=none.swapaxes(1, 2), radius=radius
        )
        slopes[:, j, i] = (other.seen_from(1, K, 1.0).G - seen.G)[0, 0] / 1e-6
    np.testing.assert_allclose(seen.w, 2 * np.sum(np.abs(slopes) * radius, axis=(1, 2)), rtol=1e-4)
    left, right = rng.standard_normal((2, 3, 3)), rng.standard_normal((2, 3, 3))
    block = MatrixOnLines(omega=omega, G=g, left=left, right=right, radius=0 * radius)
    largest = [
        np.linalg.norm(right[w] @ slopes[w].T @ left[w], "nuc") for w in range(2)
    ]  # of rank one
    np.testing.assert_allclose(block.seen_from(1, K, 1.0).w, largest, rtol=1e-4)
    alone = lines.seen_from(1, [None, K[1], None], 1.0)
    np.testing.assert_allclose(alone.G[0, 0], g[:, 1, 1])
    np.testing.assert_allclose(alone.w, radius[:, 1, 1])


@pytest.mark.attack
@pytest.mark.parametrize("form", ["elements", "input"])
def test_two_axes_meet_their_demands_with_both_closed(form):
    """|S_k| of each loop with the other closed by hand; the whole is proved."""
    G = sampled(STAGE, 1 / 512)
    model = (
        set_of(G, form, (), (0.05,) * 4)
        if form == "elements"
        else set_of(G, form, (0.1, 0.1), (1.0, 1.0))
    )
    design = design_frf(model, "PI", M_S=[1.8, 2.0], n_iterations=10)
    assert design.met, design.reason
    assert design.K.dt == G.dt
    assert not np.any(design.K.D - np.diag(np.diag(design.K.D)))
    report = check(model, design.K)
    assert report.verdict == "robust"
    z = np.exp(1j * np.geomspace(1, 0.99 * np.pi * 512, 800) / 512)
    k = np.moveaxis(design.K(z), 2, 0)
    S = np.linalg.inv(
        np.eye(2) + k @ np.moveaxis(G(z), 2, 0)
    )  # S_kk: channel k opened, the other closed
    assert np.abs(S[:, 0, 0]).max() <= 1.8 * 1.005
    assert np.abs(S[:, 1, 1]).max() <= 2.0 * 1.005


def test_what_is_said_of_the_loops_is_what_was_done():
    """Loops that meet their demands with all others closed are not designed again, and not said to
    be.
    """
    steps = []
    apart = control.ss(np.diag([-60.0, -90.0]), np.diag([60.0, 90.0]), np.eye(2), np.zeros((2, 2)))
    design = design_frf(
        set_of(apart, "input", (0.02, 0.02), (1.0, 1.0)),
        "PI",
        M_S=2.0,
        n_iterations=2,
        progress=lambda number, _: steps.append(number),
    )
    assert design.met, design.reason
    alone = []
    for pole in (60.0, 90.0):
        channel = UncertaintyModel(
            control.tf([pole], [1, pole]), 0.02, "multiplicative", OMEGA, np.full(OMEGA.size, 0.02)
        )
        design_frf(
            channel,
            "PI",
            M_S=2.0,
            n_iterations=2,
            progress=lambda number, _: alone.append(number),
        )
    assert steps.count(1) == alone.count(1) > 0  # searches of each loop, once
    assert "designed again if it failed" in design.reason


@pytest.mark.attack
def test_what_cannot_be_is_said():
    """A set that no loop bears is not met, and why is said; the column of SP under 5 % in each
    entry by itself.
    """
    G = control.ss(
        -np.eye(2) / 75,
        np.eye(2),
        np.array([[87.8, -86.4], [108.2, -109.6]]) / 75,
        np.zeros((2, 2)),
    )
    model = set_of(G, "elements", (), (4.0, 5.0, 4.0, 5.0))
    design = design_frf(model, "PI", M_S=2.0, n_iterations=2)
    assert not design.met
    assert "the whole set is not stable" in design.reason
    assert check(model, design.K).verdict != "robust"


def test_from_measured_lines_alone():
    """An Bla: loops on its lines, the whole by the exact test of its full block there."""
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=2, f_max=250, n_inputs=2, rng=1)
    lags = control.ss(
        np.diag([-60.0, -90.0]), np.diag([60.0, 90.0]), [[1, 0.2], [-0.1, 1]], np.zeros((2, 2))
    )
    H = response_by_channel(lags, 2 * np.pi * np.arange(257.0))
    y = np.fft.irfft(np.einsum("jik,iek->jek", H, np.fft.rfft(ms.u)), n=512)
    u, y = (np.repeat(x[:, :, None], 2, axis=2) for x in (ms.u, y))
    y = y + 0.003 * np.random.default_rng(2).standard_normal(y.shape) + 0.01 * u**3
    frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=512, lines=ms.lines))
    design = design_frf(frm, "PI", M_S=1.8, omega_c=(30.0, 120.0), end_gain=0.9, n_iterations=10)
    assert design.met, design.reason
    closed = control.feedback(lags * design.K, np.eye(2))
    assert closed.poles().real.max() < 0
    g, k = (np.moveaxis(X(1j * frm.omega), 2, 0) for X in (lags, design.K))
    S = np.linalg.inv(np.eye(2) + k @ g)
    assert max(np.abs(S[:, j, j]).max() for j in (0, 1)) <= 1.8


@pytest.mark.parametrize(
    ("G", "options", "message"),
    [
        (
            STAGE,
            {"M_S": [2.0]},
            "M_S must have one entry for each of 2 loops if it is a list, got 1",
        ),
        (
            STAGE,
            {"M_S": 2.0, "dt": 0.01},
            "dt and delay must be in the nominal for several channels",
        ),
        (STAGE, {"M_S": 2.0, "delay": 0.01}, "dt and delay must be in the nominal"),
        (
            STAGE,
            {"M_S": 2.0, "n_unstable": 1},
            "n_unstable must be 0 for several channels, .*, got 1",
        ),
        (STAGE, {"M_S": 2.0, "prove": 1}, "prove must be left out of a design for a matrix"),
        (
            control.ss(np.diag([1.0, -1]), np.eye(2), np.eye(2), np.zeros((2, 2))),
            {"M_S": 2.0},
            "got a pole at 1",
        ),
    ],
)
def test_refusals(G, options, message):
    with pytest.raises(ValueError, match=message):
        design_frf(set_of(G, "input", (0.1, 0.1), (1.0, 1.0)), "PI", **options)


def test_a_list_of_matrices_is_refused_as_one():
    """An Bla in a list was said to be no plant, which an Bla alone is."""
    one = set_of(STAGE, "input", (0.1, 0.1), (1.0, 1.0))
    with pytest.raises(
        ValueError,
        match=r"plant must be one Bla or UncertaintyModel with several .* got a list of matrices",
    ):
        design_frf([one, one], "PI", M_S=2.0)


def test_a_plant_that_is_not_square_is_refused():
    G = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]])
    with pytest.raises(
        ValueError,
        match="plant must have as many inputs as outputs for a diagonal controller, got 2",
    ):
        design_frf(set_of(G, "elements", (), (0.1, 0.1)), "PI", M_S=2.0)
