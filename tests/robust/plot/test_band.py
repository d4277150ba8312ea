"""Every picture over frequency marks what was measured, with half a decade beside it, in the units
of the record.
"""

from dataclasses import replace

import control
import matplotlib
import numpy as np
import pytest

import robust

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import nlfrf
from nlfrf import plot as measured_pictures
from robust import UncertaintyModel, check, fit_nominal, ncfsyn, uncertainty
from robust import plot as pictures
from robust.analysis import sample_loops
from tests.support.bla import make_bla
from tests.support.pictures import labels
from tests.support.printed import unwrapped

F = np.arange(1, 120, 2) * 0.25


def plant(s):
    return 900 / (s * s + 6 * s + 900)


BLA = replace(
    make_bla(
        plant,
        F,
        f0=0.25,
        sigma_distortion=0.05 * np.abs(plant(2j * np.pi * F)),
        rng=0,
        hold="band-limited",
    ),
    inputs=("force",),
    outputs=("position",),
    input_units=("N",),
    output_units=("m",),
)
FIT = fit_nominal(BLA, n_poles=2, n_zeros=0)
MODEL = uncertainty(BLA, FIT, order=3)
K = ncfsyn(MODEL, control.tf([4.0], [1, 0])).K
REPORT = check(MODEL, K)
HALF = np.sqrt(10)
OVER_FREQUENCY = {
    "loop": lambda ax: pictures.plot_loop(REPORT, ax=ax),
    "check": lambda ax: pictures.plot_check(REPORT, ax=ax),
    "family": lambda ax: pictures.plot_family(sample_loops(MODEL, K, 5, rng=0), ax=ax),
    "fit": lambda ax: pictures.plot_fit(FIT, ax=ax),
    "weight": lambda ax: pictures.plot_weight(MODEL, ax=ax),
    "budget": lambda ax: pictures.plot_budget(MODEL, ax=ax),
    "bode": lambda ax: pictures.plot_set(MODEL, BLA, ax=ax),
    "shaping": lambda ax: robust.plot.plot_loop_bounds(MODEL, control.tf([1.0], [1, 1]), K, ax=ax),
}


@pytest.mark.parametrize("name", OVER_FREQUENCY)
def test_the_band_is_marked_with_half_a_decade_beside_it(name):
    figure, ax = plt.subplots()
    OVER_FREQUENCY[name](ax)
    for drawn in figure.axes:
        grey = [patch for patch in drawn.patches if patch.get_gid() == "not measured"]
        spans = sorted(
            (
                patch.get_extents().transformed(drawn.transData.inverted()).x0,
                patch.get_extents().transformed(drawn.transData.inverted()).x1,
            )
            for patch in grey
        )
        start, end = drawn.get_xlim()
        assert len(spans) == 2
        assert spans[0] == pytest.approx((start, F[0]), rel=1e-6)
        assert spans[1] == pytest.approx((F[-1], end), rel=1e-6)
        happens = [w / 2 / np.pi for w in (REPORT.margins.omega_rs, REPORT.classical.crossover)]
        assert start >= min(F[0] / HALF, *happens) / 1.31
        assert end == pytest.approx(F[-1] * HALF, rel=0.01) or end > F[-1]
        assert start <= F[0] / HALF * 1.001
    plt.close(figure)


def test_more_is_shown_only_where_something_happens(ax):
    slow = UncertaintyModel(
        control.tf([1], [1, 1]),
        control.tf([0.2], [1]),
        "multiplicative",
        np.array([10.0, 100.0]),
        np.full(2, 0.1),
    )
    far = check(slow, control.tf([0.05], [1, 0]))  # crosses two decades below the band
    pictures.plot_loop(far, ax=ax)
    assert ax.get_xlim()[0] < far.classical.crossover / 2 / np.pi < 10 / 2 / np.pi / 100
    ax.clear()
    near = check(slow, 30.0)
    pictures.plot_loop(near, ax=ax)
    assert ax.get_xlim() == pytest.approx((10 / 2 / np.pi / HALF, 100 / 2 / np.pi * HALF), rel=1e-6)


@pytest.mark.parametrize("name", OVER_FREQUENCY)
def test_legends_are_off_the_data_and_every_entry_has_its_line(name):
    figure, ax = plt.subplots(layout="constrained")
    OVER_FREQUENCY[name](ax)
    figure.canvas.draw()
    lowest = figure.axes[-1]
    box = lowest.get_legend().get_window_extent()
    assert box.y1 < min(drawn.get_window_extent().y0 for drawn in figure.axes)
    for drawn in figure.axes:
        start, end = drawn.get_xlim()
        low, high = drawn.get_ylim()
        for line in drawn.get_lines():
            if line.get_label() in labels(lowest) and np.size(line.get_xdata()):
                x, y = np.asarray(line.get_xdata(), float), np.asarray(line.get_ydata(), float)
                assert np.any((x >= start) & (x <= end) & (y >= low) & (y <= high)), (
                    line.get_label()
                )
    plt.close(figure)


@pytest.mark.parametrize("name", OVER_FREQUENCY)
def test_the_legend_explains_the_grey_band_and_every_colour_of_a_curve(name):
    """Of curves over frequency; a line across all of the picture that says where 0 dB is has
    none.
    """
    figure, ax = plt.subplots(layout="constrained")
    OVER_FREQUENCY[name](ax)
    legend = figure.axes[-1].get_legend()
    assert [text.get_text() for text in legend.get_texts()].count("not measured") == 1
    explained = {matplotlib.colors.to_hex(line.get_color()) for line in legend.get_lines()}
    for drawn in figure.axes:
        curves = [line for line in drawn.get_lines() if np.size(line.get_xdata()) > 2]
        assert {matplotlib.colors.to_hex(line.get_color()) for line in curves} <= explained
    plt.close(figure)


@pytest.mark.parametrize("width", [4.0, 7.6, 12.0])
def test_no_title_sticks_out_of_its_figure(width):
    """The longest titles: a weight with what is assumed outside the band, and the samples of a
    record.
    """
    ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rms=1.23456e-5, rng=1)
    record = nlfrf.Record(
        u=ms.u[None], y=ms.u[None], fs=128, lines=ms.lines, u_name="current of the drive"
    )
    for draw, content in ((pictures.plot_weight, MODEL), (measured_pictures.plot_samples, record)):
        figure = plt.figure(figsize=(width, 5))
        ax = draw(content, ax=figure.add_axes((0.11, 0.2, 0.87, 0.7)))
        figure.canvas.draw()
        box = ax.title.get_window_extent()
        assert 0 <= box.x0 < box.x1 <= figure.bbox.width, (width, ax.get_title())
        assert box.y1 <= figure.bbox.height
        plt.close(figure)


def test_the_bode_picture_holds_measured_points_nominal_and_set():
    top, bottom = pictures.plot_set(MODEL, BLA)
    assert (top.get_xscale(), bottom.get_xscale()) == ("log", "log")
    points = next(
        line
        for line in top.get_lines()
        if line.get_marker() == "." and np.size(line.get_xdata()) == F.size
    )
    np.testing.assert_allclose(points.get_ydata(), 20 * np.log10(np.abs(BLA.G)))
    nominal = max(bottom.get_lines(), key=lambda line: np.size(line.get_xdata()))
    at = nominal.get_xdata()
    exact = np.degrees(np.unwrap(np.angle(MODEL.at(2 * np.pi * at))))
    np.testing.assert_allclose(nominal.get_ydata(), exact, atol=1e-6)
    assert {"the set", "nominal", "measured, 95 % bound", "not measured"} == set(labels(bottom))
    plt.close(top.figure)
    top, bottom = measured_pictures.plot_bode(BLA)
    assert {"95 % bound", "best linear approximation"} == set(labels(bottom))
    plt.close(top.figure)


def test_units_and_names_of_the_record_stand_on_every_axis_and_in_every_text():
    ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    named = {"u_name": "force", "y_name": "position", "u_unit": "N", "y_unit": "m"}
    record = nlfrf.Record(
        u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines, **named
    )
    bla = nlfrf.identify(record)
    drawn = [
        (measured_pictures.plot_bla, bla, "m/N"),
        (measured_pictures.plot_levels, bla, "dB, m]"),
        (measured_pictures.plot_input, record, "dB, N]"),
        (measured_pictures.plot_samples, record, "force [N]"),
        (measured_pictures.plot_opinion, nlfrf.second_opinion(record), "m/N"),
        (pictures.plot_fit, FIT, "m/N"),
        (lambda one: pictures.plot_set(one)[0], MODEL, "m/N"),
        (pictures.plot_weight, uncertainty(BLA, FIT, form="additive", order=4), "m/N"),
        (pictures.plot_weight, uncertainty(BLA, FIT, form="inverse-additive", order=4), "N/m"),
    ]
    for draw, content, unit in drawn:
        ax = draw(content)
        assert unit in ax.get_ylabel()
        assert "unit of" not in ax.get_ylabel()
        plt.close(ax.figure)
    ax = pictures.plot_weight(MODEL)
    assert ax.get_ylabel() == "radius, multiplicative [dB]"
    plt.close(ax.figure)
    assert f"largest |G| {np.abs(bla.G).max():.4g} m/N at" in unwrapped(bla)
    additive = uncertainty(BLA, FIT, form="additive", order=4)
    assert f"to {additive.radius.max():.3g} m/N (at" in unwrapped(additive)
    assert REPORT.given.unit == FIT.unit == "m/N"
