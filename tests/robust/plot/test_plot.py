"""Pictures: each draws on the axes it was given, and shows what the value holds."""

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from robust import check, ncfsyn, performance_weight, uncertainty
from robust import plot as pictures
from robust._base.states import FrictionVerdict
from robust.analysis import sample_loops
from robust.friction.reading.friction_fit import FrictionFit
from robust.models import scan_orders
from tests.support.bla import make_bla
from tests.support.pictures import labels, notes
from tests.support.responses import response

F = np.arange(1, 120, 2) * 0.25


def plant(s):
    return 900 / (s * s + 6 * s + 900)


SIZE = np.abs(plant(2j * np.pi * F))
BLA = make_bla(
    plant,
    F,
    f0=0.25,
    sigma_noise=5e-3 * SIZE,
    sigma_distortion=0.05 * SIZE,
    sigma_even=0.01 * SIZE,
    rng=0,
)
SCAN = scan_orders(BLA, n_poles=range(2, 5), relative_degree=2)
MODEL = uncertainty(BLA, SCAN.fit, order=3)
K = ncfsyn(MODEL, control.tf([4.0], [1, 0])).K
W_P = performance_weight(1.0, A=0.1)
REPORT = check(MODEL, K, w_P=W_P)


def curve(ax, label):
    (line,) = [line for line in ax.get_lines() if line.get_label() == label]
    return line.get_xdata(), line.get_ydata()


def test_weight_lies_over_the_radius(ax):
    assert pictures.plot_weight(MODEL, ax=ax) is ax
    f, weight = curve(ax, "|weight|")
    on_lines, radius = curve(ax, "radius on the lines")
    assert np.all(np.interp(on_lines, f, weight) >= radius - 1e-6)
    assert f.min() < F[0] < F[-1] < f.max()
    assert "part: odd distortion" in labels(ax)
    assert MODEL.origin.extrapolation in " ".join(ax.get_title().split())


def test_budget_adds_up_to_a_hundred(ax):
    pictures.plot_budget(MODEL, ax=ax)
    top = max(path.vertices[:, 1].max() for patch in ax.collections for path in patch.get_paths())
    assert top == pytest.approx(100)
    shares = {label.partition(":")[0]: label.partition(":")[2] for label in labels(ax)}
    for name, words in (("noise", "noise"), ("odd", "odd distortion"), ("even", "even distortion")):
        share = 100 * np.mean(MODEL.budget[name] / MODEL.radius)
        assert (
            "measure" in shares[f"{words}, {share:.0f} %"]
        )  # a measurement stands beside each part
    assert "more poles" in next(
        text for part, text in shares.items() if part.startswith("misfit of the model")
    )


def test_loop_and_check(ax):
    pictures.plot_loop(REPORT, ax=ax)
    f, L = curve(ax, "|L| = |G K|")
    wanted = response(MODEL.nominal, 2 * np.pi * f) * response(K, 2 * np.pi * f)
    assert pytest.approx(20 * np.log10(np.abs(wanted)), abs=1e-6) == L
    figure, other = plt.subplots()
    pictures.plot_check(REPORT, ax=other)
    assert REPORT.verdict in other.get_title()
    assert curve(other, "robust stability")[1].max() == pytest.approx(REPORT.curves.rs.max())
    plt.close(figure)


def test_curves_leave_the_picture_below_without_a_plateau(ax):
    pictures.plot_check(REPORT, ax=ax)
    for label, curve_ in (
        ("robust stability", REPORT.curves.rs),
        ("robust performance", REPORT.curves.rp),
    ):
        assert np.array_equal(curve(ax, label)[1], curve_)
    low, high = ax.get_ylim()
    assert low >= 1e-3
    assert high >= 2


def test_an_unstable_loop_is_drawn_without_curves(ax):
    report = check(MODEL, 1e4 * K)
    assert not report.nominally_stable
    pictures.plot_check(report, ax=ax)
    assert "not robust" in ax.get_title()
    assert any("unstable" in text.get_text() for text in ax.texts)


@pytest.mark.parametrize(
    "form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive", "coprime"]
)
def test_nyquist_discs_touch_minus_one_where_rs_says_so(form, ax):
    model = uncertainty(BLA, SCAN.fit, form=form, order=3)
    report = check(model, K)
    centre, radius = report.discs
    fine = np.isfinite(centre)
    # |1 + centre| <= radius where some L of the set passes through -1, and there rs is at least one
    assert np.array_equal(np.abs(1 + centre[fine]) <= radius[fine], report.curves.rs[fine] >= 1)
    for angle in np.linspace(0, 2 * np.pi, 13):
        Delta = np.exp(1j * angle)
        G, w = report.curves.G, response(model.weight, report.curves.omega)
        t = w / np.sqrt(1 - np.minimum(np.abs(w), 0.99) ** 2)
        g = G if report.curves.shaping is None else G * report.curves.shaping
        plants = {
            "multiplicative": G * (1 + w * Delta),
            "additive": G + w * Delta,
            "inverse-multiplicative": G / (1 + w * Delta),
            "inverse-additive": G / (1 + w * G * Delta),
            "coprime": G / g * (g + t * Delta) / (1 - g.conj() * t * Delta),
        }[form]
        rim = np.abs(plants * report.curves.K - centre) / radius
        assert rim[fine & (radius > 1e-9)] == pytest.approx(1.0, rel=1e-6)
    pictures.plot_nyquist(report, ax=ax)
    assert len(ax.patches) > 3
    assert ax.get_aspect() == 1.0


def test_family_orders_fit_nominal_bounds(ax):
    family = sample_loops(MODEL, K, 12, rng=0)
    pictures.plot_family(family, ax=ax)
    assert len(ax.get_lines()) == 14
    for draw, content in (
        (pictures.plot_orders, SCAN),
        (pictures.plot_fit, SCAN.fit),
    ):
        axes = draw(content)
        assert axes.get_xlabel()
        assert axes.get_ylabel()
        plt.close(axes.figure)


def test_what_rests_where_has_a_bar_a_case_from_the_set_point_on(ax):
    cases = [
        pictures.RestCase("as it is", FrictionVerdict.SETTLES, 2e-5),
        pictures.RestCase("without integral", FrictionVerdict.PROVED, 5e-5),
        pictures.RestCase("with integral", FrictionVerdict.PROVED, 0.0),
        pictures.RestCase("any friction", FrictionVerdict.NOT_DECIDED, np.inf),
    ]
    pictures.plot_rest(cases, ax=ax)
    ends = [bar.get_x() + bar.get_width() for bar in ax.patches]
    low, high = ax.get_xlim()
    assert ends == pytest.approx([20, 50, low, high])
    assert low <= 2
    assert labels(ax) == ["may move for ever", "proved: comes to rest"]
    texts = notes(ax)
    assert texts[::2] == [case.name for case in cases]
    assert texts[1::2] == ["20 um", "50 um", "at the set point", "no bound known"]
    assert ax.get_xlabel() == "largest final distance from the set point [µm]"
    with pytest.raises(ValueError, match="cases must be a list of at least one RestCase, got"):
        pictures.plot_rest([])


def test_the_virgin_curve_of_the_elements_is_drawn_over_the_loops(ax):
    """Two elements, 2 N/um up to 4 N and 1 N/um up to 6 N:

    3 N/um, then 1 N/um from 2 um, 10 N from 6 um on.
    """
    elements = {"element_stiffness": np.array([2e6, 1e6]), "element_strength": np.array([4.0, 6.0])}
    fit = friction_fit(K0=3e6, Fs=10.0, **elements)
    x = 1e-6 * np.array([-20.0, 0.0, 20.0, 0.0])
    pictures.plot_friction_force({"slides": np.stack([x, 3e6 * x])}, fit, ax=ax)
    curve = next(
        line for line in ax.get_lines() if line.get_label() == "virgin curve, 2 Maxwell elements"
    )
    at = np.array([-8.0, -1.0, 1.0, 2.0, 4.0, 6.0, 8.0])
    assert np.interp(at, *curve.get_data()) == pytest.approx([-10, -3, 3, 6, 8, 10, 10], abs=0.05)
    loop = ax.get_lines()[0]
    assert (loop.get_label(), loop.get_xdata().tolist()) == (
        "slides",
        pytest.approx([-20, 0, 20, 0, -20]),
    )
    assert ax.get_ylabel() == "friction force [N]"
    left_open = friction_fit(K0=3e6, Fs=10.0, **elements, stds={"K0": np.inf, "Fs": np.inf})
    shown = pictures.plot_friction_force({"slides": np.stack([x, 3e6 * x])}, left_open)
    assert labels(shown) == ["slides"]
    plt.close(shown.figure)
    with pytest.raises(
        ValueError, match="loops must hold position and force of a record by its name, got"
    ):
        pictures.plot_friction_force({}, fit)


def friction_fit(**given):
    """A fit whose other numbers no picture of the force needs."""
    names = [
        "mass",
        "damping",
        "stiffness",
        "coulomb",
        "stiction",
        "vs",
        "delay",
        "lag",
        "softening",
        "seen_from",
    ]
    return FrictionFit(
        **dict.fromkeys(names, 1.0),
        levels=(),
        questions=(),
        **{"stds": {"K0": 0.0, "Fs": 0.0}} | given,
    )
