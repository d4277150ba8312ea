"""Pictures of a matrix: one axes an entry with its numbers, one legend, nothing clipped."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")
from matplotlib import pyplot as plt

import nlfrf
from nlfrf import plot as pictures
from tests.support.pictures import labels

MS = nlfrf.multisine("random-odd", fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
U = np.repeat(MS.u[:, :, None], 2, axis=2)
NOISE = 0.02 * np.random.default_rng(0).standard_normal((3, *U.shape[1:]))
Y = np.stack([2 * U[0] + 0.1 * U[0] ** 3 + U[1], 0.5 * U[1], 0.1 * U[0]]) + NOISE
NAMES = {"inputs": ("Fx", "Fy"), "outputs": ("x", "y", "angle")}
FRM = nlfrf.identify(nlfrf.Record(u=U, y=Y, fs=256, lines=MS.lines, **NAMES))
MATRICES = {
    "frm": lambda ax: pictures.plot_frm(FRM, ax=ax),
    "bounds": lambda ax: pictures.plot_frm_bounds(FRM, ax=ax),
    "rga": lambda ax: pictures.plot_rga(FRM, ax=ax),
}


def curve(ax, label):
    (line,) = [line for line in ax.get_lines() if line.get_label() == label]
    return line.get_ydata()


def test_every_entry_stands_where_it_belongs():
    made = pictures.plot_frm(FRM)
    assert made.shape == (3, 2)
    for (j, i), ax in np.ndenumerate(made):
        np.testing.assert_allclose(curve(ax, "|G|"), 20 * np.log10(np.abs(FRM.G[j, i])))
        band, *hatched = ax.collections
        assert len(hatched) == np.any(
            FRM.bound()[j, i] >= np.abs(FRM.G[j, i])
        )  # where it has no lower edge
        top = band.get_paths()[0].vertices[:, 1].max()
        assert top == pytest.approx(20 * np.log10((np.abs(FRM.G) + FRM.bound())[j, i].max()))
    assert [ax.get_ylabel() for ax in made[:, 0]] == ["x  [dB]", "y  [dB]", "angle  [dB]"]
    assert [ax.get_title() for ax in made[0]] == ["by Fx", "by Fy"]
    plt.close(made[0, 0].figure)


def test_the_bound_of_the_matrix_reaches_further_than_that_of_an_entry():
    made = pictures.plot_frm_bounds(FRM, confidence=0.9)
    left, right = FRM.block(0.9)
    for (j, i), ax in np.ndenumerate(made):
        reach, radius = (
            10 ** (curve(ax, f"90 % bound of the {of}") / 20) for of in ("matrix", "entry")
        )
        np.testing.assert_allclose(radius, FRM.bound(0.9)[j, i])
        by_hand = [
            np.linalg.norm(left[j, :, k]) * np.linalg.norm(right[:, i, k])
            for k in range(FRM.f.size)
        ]
        np.testing.assert_allclose(reach, by_hand)
        assert np.all(reach > radius)
        np.testing.assert_allclose(
            10 ** (curve(ax, "std by noise") / 20), np.sqrt(FRM.var_noise[j, i])
        )
    plt.close(made[0, 0].figure)


@pytest.mark.attack(every=5)
@pytest.mark.parametrize("name", MATRICES)
@pytest.mark.parametrize("how", ["own", "beside", "placed"])
def test_a_matrix_takes_the_place_that_it_is_given(name, how):
    """A figure of its own, a cell among others, a place by its corners: axes inside it, one legend
    under all.
    """
    if how == "placed":
        figure = plt.figure(figsize=(7.6, 5.0))
        ax = figure.add_axes((0.1, 0.2, 0.86, 0.7))
    elif how == "beside":
        figure, (ax, _) = plt.subplots(1, 2, figsize=(14, 6), layout="constrained")
    else:
        ax = None
    made = MATRICES[name](ax)
    figure = made[0, 0].figure
    figure.canvas.draw()
    legends = [one.get_legend() for one in figure.axes if one.get_legend()]
    assert len(legends) == 1
    box = legends[0].get_window_extent()
    assert box.y1 < min(one.get_window_extent().y0 for one in made.flat)
    width, height = figure.canvas.get_width_height()
    for part in [box, *(one.get_tightbbox() for one in made.flat)]:
        assert part.x0 >= 0
        assert part.y0 >= 0
        assert part.x1 <= (width / 2 if how == "beside" else width) + 1
        assert part.y1 <= height
    boxes = [one.get_window_extent() for one in made.flat]
    assert all(not a.overlaps(b) for k, a in enumerate(boxes) for b in boxes[:k])
    plt.close(figure)


def test_singular_values_in_their_bands(ax):
    sigma = nlfrf.bla.singular_values(FRM)[0]
    pictures.plot_singular_values(FRM, ax=ax)
    for i in range(2):
        np.testing.assert_allclose(curve(ax, f"singular value {i + 1}"), 20 * np.log10(sigma[i]))
    assert labels(ax)[-1] == "95 % bound of the matrix"
    styles = {line.get_linestyle() for line in ax.get_lines()}
    assert len(styles) == 2  # told apart in grey


def test_many_lines_are_drawn_without_points():
    ms = nlfrf.multisine("odd", fs=2048, n_samples=2048, f_min=1, f_max=900, n_inputs=2, rng=1)
    u = np.repeat(ms.u[:, :, None], 2, axis=2)
    with pytest.warns(
        nlfrf.DataWarning, match="the odd grid of this record has no odd detection lines"
    ):
        frm = nlfrf.identify(nlfrf.Record(u=u, y=u, fs=2048, lines=ms.lines))
    made = pictures.plot_frm(frm)
    assert made[0, 0].get_lines()[0].get_marker() == "None"
    plt.close(made[0, 0].figure)
