"""The picture to shape a loop in: it follows the controller."""

import control
import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from robust import UncertaintyModel, performance_weight
from robust.lti.lti import response
from robust.plot import plot_loop_bounds
from robust.shaping import lag, lead, loop_bounds

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))


def model_to_shape():
    omega = np.geomspace(0.5, 300, 120)
    w = control.tf([0.2, 0.15], [0.02, 1])
    return UncertaintyModel(
        BOOK, w, "multiplicative", omega, np.abs(response(control.ss(w), omega)), perturbation="LTI"
    )


def test_the_picture_follows_the_controller():
    model, w_P = model_to_shape(), performance_weight(3.0, A=1e-2)
    figure, ax = plt.subplots()
    picture = plot_loop_bounds(model, w_P, 1e-3, ax=ax)
    assert picture.ax is ax
    assert picture.violations.any()
    assert "stable" in ax.get_title()
    first = picture.line.get_ydata().copy()
    better = lead(10.0, np.radians(40)) * lag(1.0, 100.0) * 0.5
    n_artists = len(ax.get_children())
    assert picture.update(better) is picture
    assert len(ax.get_children()) == n_artists  # drawn over, not on top of one another
    L = np.abs(model.at(model.omega) * response(better, model.omega))
    f, drawn = picture.line.get_data()
    assert np.interp(model.omega / 2 / np.pi, f, drawn) == pytest.approx(20 * np.log10(L), abs=1e-6)
    assert picture.before.get_ydata() == pytest.approx(first)
    low, high = loop_bounds(model, w_P)
    assert np.array_equal(picture.violations, (low > L) | (high < L))
    assert picture.dots.get_xdata().size == picture.violations.sum()
    picture.update(1e6)
    assert ax.get_title() == "unstable"
    plt.close(figure)
