"""Pictures of sets and loops of several inputs and outputs: they show the numbers that the values
hold.
"""

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import robust
from robust import plot as pictures
from tests.support.pictures import labels
from tests.support.responses import response_by_channel

OMEGA = np.geomspace(1, 100, 30)
G = control.ss(
    [[-5.0, 30.0], [-30.0, -5.0]],
    [[1.0, 0.1], [0.2, 1.0]],
    [[30.0, 0.0], [1.0, 5.0]],
    np.zeros((2, 2)),
)


def weights(n):
    return tuple(control.ss(control.tf([0.02 + 0.01 * k, 1 + k], [1, 20 + k])) for k in range(n))


def model(form):
    n_left, n_right = {"elements": (0, 4), "additive": (2, 2), "input": (2, 2)}[form]
    parts = weights(n_left + n_right)
    return robust.UncertaintyModel(
        nominal=G, form=form, left=parts[:n_left], right=parts[n_left:], omega=OMEGA,
        radius=np.array([np.abs(response_by_channel(one, OMEGA)[0, 0]) for one in parts]),
        confidence=0.95, perturbation="LTI",
        inputs=("Fx", "Fy"), outputs=("x", "angle"),
    )  # fmt: skip


MODELS = {form: model(form) for form in ("elements", "additive", "input")}
K = control.ss([], [], [], 0.1 * np.eye(2))


def curve(ax, label):
    (line,) = [line for line in ax.get_lines() if line.get_label() == label]
    return np.asarray(line.get_xdata()), np.asarray(line.get_ydata())


@pytest.mark.parametrize("form", MODELS)
def test_the_reach_of_an_entry_is_reached_and_not_left(form):
    one, rng, at = MODELS[form], np.random.default_rng(0), np.array([3.0, 30.0])
    nominal, reach = response_by_channel(one.nominal, at), one.entry_radius(at)
    far = np.zeros(reach.shape)
    for n in range(400):
        Delta = rng.standard_normal((2, 2))
        if form == "elements":
            Delta = np.diag(np.sign(rng.standard_normal(4)))
        elif n % 4:
            Delta = np.outer(rng.standard_normal(2), np.eye(2)[n % 2])
        Delta = Delta / np.linalg.norm(Delta, 2)
        far = np.maximum(far, np.abs(response_by_channel(one.perturbed(Delta), at) - nominal))
    assert np.all(far <= reach * (1 + 1e-9))
    assert np.all(
        far > (0.99 if form != "input" else 0.85) * reach
    )  # of "input" complex ones reach the rest


@pytest.mark.parametrize("form", MODELS)
def test_the_set_entry_by_entry(form):
    one = MODELS[form]
    made = pictures.plot_set(one)
    for (j, i), ax in np.ndenumerate(made):
        f, drawn = curve(ax, "nominal")
        np.testing.assert_allclose(
            drawn, 20 * np.log10(np.abs(response_by_channel(G, 2 * np.pi * f)[j, i]))
        )
        band = next(c for c in ax.collections if c.get_label() == "the set")
        x, y = band.get_paths()[0].vertices.T
        at = np.isclose(x, f[300])
        top = (
            np.abs(response_by_channel(G, 2 * np.pi * f[[300]]))[j, i]
            + one.entry_radius(2 * np.pi * f[[300]])[j, i]
        )
        assert y[at].max() == pytest.approx(20 * np.log10(top[0]))
        assert {patch.get_gid() for patch in ax.patches} == {"not measured"}
    assert [ax.get_title() for ax in made[0]] == ["by Fx", "by Fy"]
    plt.close(made[0, 0].figure)


@pytest.mark.parametrize("form", MODELS)
def test_every_weight_lies_over_its_radius(form):
    one = MODELS[form]
    made = pictures.plot_weight(one)
    shown = []
    for ax in made.flat:
        f, weight = curve(ax, "|weight|")
        at, radius = curve(ax, "radius on the lines")
        assert np.all(np.interp(at, f, weight) >= radius - 1e-3)
        shown.append(radius)
    order = [0, 2, 1, 3] if form == "elements" else [0, 1, 2, 3]  # columns of G one after the other
    np.testing.assert_allclose(shown, 20 * np.log10(one.radius[order]))
    plt.close(made[0, 0].figure)


def test_a_plant_that_is_not_square_leaves_places_empty():
    w = control.ss([], [], [], [[0.1]])
    tall = robust.UncertaintyModel(
        nominal=G[:, 0], form="additive", left=(w, w), right=(w,), omega=OMEGA, radius=np.full((3, 30), 0.1),
        confidence=0.95,
    )  # fmt: skip
    made = pictures.plot_weight(tall)
    assert [[ax.get_visible() for ax in row] for row in made] == [[True, True], [True, False]]
    plt.close(made[0, 0].figure)
    assert pictures.plot_set(tall).shape == (2, 1)
    plt.close("all")


def test_singular_values_of_a_loop(ax):
    gains = robust.analysis.loop_gains(G, K, omega=OMEGA)
    k = int(np.searchsorted(gains.omega, 10.0))
    s = 1j * gains.omega[k]
    L = np.asarray(G(s)) @ (0.1 * np.eye(2))
    S = np.linalg.inv(np.eye(2) + L)
    for found, wanted in (
        (gains.L, L),
        (gains.S, S),
        (gains.T, np.eye(2) - S),
        (gains.K_S, 0.1 * S),
    ):
        np.testing.assert_allclose(found[:, k], np.linalg.svd(wanted, compute_uv=False))
    assert gains.stable
    assert set(OMEGA) <= set(gains.omega)
    pictures.plot_loop(gains, ax=ax)
    np.testing.assert_allclose(curve(ax, "S, largest")[1], 20 * np.log10(gains.S[0]))
    assert len(labels(ax)) == 7  # with the band that was not measured
    bad = robust.analysis.loop_gains(G, -10 * np.eye(2))
    assert not bad.stable
    ax.clear()
    pictures.plot_loop(bad, ax=ax)
    assert ax.get_title() == "Nominal loop, not stable"
    with pytest.raises(ValueError, match=r"K must have the sampling time of G, 0 s, got 0\.1 s"):
        robust.analysis.loop_gains(
            G, control.ss([[0.5, 0], [0, 0.5]], np.eye(2), np.eye(2), np.eye(2), 0.1)
        )
    sampled = robust.analysis.loop_gains(
        robust.sampled(G, 0.01), control.ss([], [], [], 0.1 * np.eye(2))
    )
    assert sampled.omega.max() < np.pi / 0.01


def test_the_check_of_a_matrix_is_drawn_as_any_other(ax):
    report = robust.check(
        MODELS["elements"], K, w_P=control.ss(control.tf([0.1], [1, 1])), certify=False
    )
    pictures.plot_check(report, ax=ax)
    _, mu = curve(ax, "robust stability, upper bound of mu")
    np.testing.assert_allclose(mu, report.curves.rs[report.curves.omega > 0])
    assert curve(ax, "reached by a perturbation that was found")[1][0] == pytest.approx(
        1 / report.margins.broken
    )
    assert "robust performance" in labels(ax)
    assert ax.get_title() == f"Verdict on stability: {report.verdict}"
    assert {patch.get_gid() for patch in ax.patches} == {"not measured"}
    ax.clear()
    unstable = robust.check(MODELS["elements"], -10 * np.eye(2))
    pictures.plot_check(unstable, ax=ax)
    assert unstable.reason in [text.get_text() for text in ax.texts]
