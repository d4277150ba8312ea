"""Fits and measured responses as python-control takes them."""

import control
import matplotlib.pyplot
import numpy as np
import pytest
from scipy.io import loadmat

import nlfrf
import robust


@pytest.fixture(scope="module")
def bla():
    ms = nlfrf.multisine(fs=1000, n_samples=1000, f_min=1, f_max=200, rng=1)
    u = np.repeat(ms.u[:, None], 2, axis=1)
    return nlfrf.identify(nlfrf.Record(u=u, y=2 * u + 0.1 * u**3, fs=1000, lines=ms.lines))


def test_bode_plot_takes_a_measured_response(bla):
    matplotlib.use("Agg")
    matplotlib.pyplot.close("all")  # it draws on whatever figure is open
    measured = robust.frd(bla)
    assert measured.name == "bla"
    plot = control.bode_plot(measured)
    assert plot.axes.size == 2
    np.testing.assert_allclose(np.abs(measured.frdata.ravel()), np.abs(bla.G))
    matplotlib.pyplot.close("all")


@pytest.mark.filterwarnings("ignore")  # a zero that the data do not carry is warned of
@pytest.mark.parametrize("gain", [1e-9, 1e-3, 1e5])
@pytest.mark.parametrize("n_zeros", [None, 0, 1])
def test_the_transfer_function_of_a_fit_is_the_fit(gain, n_zeros, tmp_path):
    """A free zero of an all-pole response goes far out; by SLICOT the transfer function was 0 then,
    without a word.

    python-control itself subtracts characteristic polynomials, in which a gain far below one is
    lost.
    """
    roots = [(3.0, 0.05), (700.0, 0.01)]
    den = np.polymul(*([1, 2 * d * w, w**2] for w, d in roots))
    omega = np.geomspace(0.3, 2000, 200)
    response = gain / np.polyval(den, 1j * omega)
    fit = robust.fit_nominal(control.frd(response, omega), n_poles=4, n_zeros=n_zeros)
    robust.io.export_matlab(fit.G, tmp_path / "G.mat")
    exported = loadmat(tmp_path / "G.mat", simplify_cells=True)["content"]["K"]
    found = [control.tf(fit.G)] if gain > 1 else []
    if "num" in exported:  # none where numbers cannot hold them
        found.append(control.tf(exported["num"], exported["den"]))
    for transfer in found:
        np.testing.assert_allclose(transfer(1j * omega), fit.G(1j * omega), rtol=1e-6)
    assert max(np.abs(fit.G.B).max(), np.abs(fit.G.C).max()) < 1e4 * min(
        np.abs(fit.G.B).max(), np.abs(fit.G.C).max()
    )
