"""A set that holds zero: its band has no lower edge, which is hatched and said, and moves no
axis.
"""

import control
import matplotlib
import numpy as np
import pytest

import robust

matplotlib.use("Agg")

from matplotlib import pyplot as plt

from robust import UncertaintyModel

OMEGA = np.geomspace(0.1, 100, 60)
G = control.ss(control.tf([1], [1, 1]))


def model(gain):
    """A multiplicative set whose weight ends at three times a gain: above one, or below."""
    w = control.ss(control.tf([3 * gain, 3 * gain * 0.1], [1, 3]))
    return UncertaintyModel(G, w, "multiplicative", OMEGA, np.abs(w(1j * OMEGA)))


def bands(ax):
    return [
        path.vertices
        for band in ax.collections
        for path in band.get_paths()
        if len(path.vertices) > 4
    ]


@pytest.mark.parametrize(("gain", "over"), [(1.0, True), (0.3, False)])
def test_the_band_of_a_set(gain, over):
    top, foot = robust.plot.plot_set(model(gain))
    said = [text.get_text() for text in foot.get_legend().get_texts()]
    assert ("over 100 %: the set holds 0" in said) == over
    assert any(band.get_hatch() for band in top.collections) == over
    drawn = top.get_lines()[0]
    f, size = (np.asarray(one, float) for one in drawn.get_data())
    for vertices in bands(top):
        assert np.all(vertices[:, 1] >= np.interp(vertices[:, 0], f, size) - 20 - 1e-6)
    low, high = top.get_ylim()
    assert size.min() - 20 < low < size.min()
    assert size.max() < high < size.max() + 20
    plt.close("all")
