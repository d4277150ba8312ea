"""An FRF of python-control becomes a `Bla` and comes back: numbers, frequencies, names, sampling
time.
"""

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust.io import bla_from_frd

OMEGA = 2 * np.pi * np.geomspace(1, 100, 24)


@pytest.mark.parametrize(("n_y", "n_u"), [(1, 1), (2, 1), (1, 2), (3, 2)])
@pytest.mark.parametrize("named", [True, False])
def test_an_frf_survives_the_way_there_and_back(n_y, n_u, named):
    rng = np.random.default_rng(10 * n_y + n_u)
    G = rng.standard_normal((n_y, n_u, OMEGA.size)) + 1j * rng.standard_normal(
        (n_y, n_u, OMEGA.size)
    )
    names = {
        "inputs": [f"force {i}" for i in range(n_u)],
        "outputs": [f"position {j}" for j in range(n_y)],
    }
    frf = control.frd(G, OMEGA, **(names if named else {}))
    bla = bla_from_frd(frf, std=0.1, input_units=["N"] * n_u, output_units=["m"] * n_y)
    again = robust.frd(bla)
    assert np.array_equal(again.frdata, G)
    assert np.allclose(again.omega, OMEGA, rtol=1e-14)
    assert (bla.n_outputs, bla.n_inputs, bla.is_single) == (n_y, n_u, n_y * n_u == 1)
    assert (bla.input_units, bla.output_units) == (("N",) * n_u, ("m",) * n_y)
    if named:
        assert [list(bla.inputs), list(bla.outputs)] == list(names.values())
    else:
        assert not any("[" in name for name in (*bla.inputs, *bla.outputs))


def test_the_bound_is_that_of_bla_from_frf():
    G = 1 / (1 + 0.1j * OMEGA)
    plain = nlfrf.bla_from_frf(OMEGA / (2 * np.pi), G, coherence=0.97, n_averages=30)
    bla = bla_from_frd(control.frd(G, OMEGA), coherence=0.97, n_averages=30)
    assert np.allclose(bla.bound(), plain.bound(), rtol=1e-14)


def test_a_sampled_frf_keeps_its_clock():
    bla = bla_from_frd(control.frd(np.exp(-1e-4j * OMEGA), OMEGA, 1e-3), std=0.1, hold="zoh")
    assert (bla.fs, bla.hold) == (pytest.approx(1000.0), "zoh")
    assert np.isnan(bla_from_frd(control.frd(np.exp(-1e-4j * OMEGA), OMEGA), std=0.1).fs)


@pytest.mark.parametrize("given", [np.ones(3), control.tf([1], [1, 1]), None, "plant.json"])
def test_what_is_no_frf_is_refused(given):
    with pytest.raises(ValueError, match="frf must be of type FrequencyResponseData, got"):
        bla_from_frd(given, std=0.1)


def test_without_a_deviation_nothing_is_made():
    with pytest.raises(ValueError, match="std"):
        bla_from_frd(control.frd(1 / (1 + 0.1j * OMEGA), OMEGA))
