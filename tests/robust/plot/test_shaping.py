"""The picture to shape a loop in: it shows the loop."""

import control
import matplotlib
import numpy as np
import pytest

import robust

matplotlib.use("Agg")
from matplotlib import pyplot as plt

from robust import UncertaintyModel, performance_weight
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))


def model_to_shape():
    omega = np.geomspace(0.5, 300, 120)
    w = control.tf([0.2, 0.15], [0.02, 1])
    return UncertaintyModel(
        BOOK, w, "multiplicative", omega, np.abs(response(control.ss(w), omega)), perturbation="LTI"
    )


def test_the_picture_shows_the_loop_between_its_bounds():
    model, w_P = model_to_shape(), performance_weight(3.0, A=1e-2)
    low, high = robust.shaping.loop_bounds(model, w_P)
    for K in (
        1e-3,
        robust.shaping.lead(10.0, np.radians(40)) * robust.shaping.lag(1.0, 100.0) * 0.5,
    ):
        _, ax = plt.subplots()
        assert robust.plot.plot_loop_bounds(model, w_P, K, ax=ax) is ax
        assert ax.get_title().startswith("nominally stable; max rs")
        lines = {line.get_label(): line.get_data() for line in ax.get_lines()}
        k = K if np.isscalar(K) else response(K, model.omega)
        L = np.abs(model.at(model.omega) * k)
        f, drawn = lines["|L|"]
        assert np.interp(model.omega / 2 / np.pi, f, drawn) == pytest.approx(
            20 * np.log10(L), abs=1e-6
        )
        outside = (low > L) | (high < L)
        assert np.array_equal(lines["beyond a bound"][0], model.omega[outside] / 2 / np.pi)
        bottom, top = ax.get_ylim()
        assert bottom < max(20 * np.log10(L.min()), -119.0)
        assert 20 * np.log10(L.max()) < top
        plt.close("all")
    assert robust.plot.plot_loop_bounds(model, w_P, 1e6).get_title() == "unstable"
    plt.close("all")
