"""Multisines for several inputs: orthogonal to rounding, the rms that was asked for, and what they
refuse.
"""

import numpy as np
import pytest

import nlfrf

BAND = {"fs": 1024, "n_samples": 1024, "f_min": 2, "f_max": 200}


def sets(ms):
    return ms.spectrum.reshape(ms.n_inputs, ms.n_realizations, ms.n_inputs, -1)


@pytest.mark.parametrize("n_inputs", [2, 3, 4, 6])
def test_sets_are_orthogonal_on_every_line(n_inputs):
    rms = np.arange(1.0, n_inputs + 1)
    shape = np.linspace(1, 3, 50)
    ms = nlfrf.multisine(
        **BAND, n_inputs=n_inputs, n_realizations=3, rms=rms, rng=1, amplitude=lambda f: 1 + f
    )
    U = sets(ms)
    gram = np.einsum("irek,jrek->rijk", U, U.conj())
    expected = n_inputs * np.einsum("ik,ij->ijk", ms.amplitude**2, np.eye(n_inputs))
    assert np.abs(gram - expected).max() < 1e-13 * expected.max()
    np.testing.assert_allclose(
        np.sqrt(np.mean(ms.u**2, axis=2)), np.tile(rms[:, None], ms.n_experiments), rtol=1e-13
    )
    assert shape.size
    assert ms.crest_factor.shape == (n_inputs, 3 * n_inputs)


def test_every_experiment_has_independent_phases_in_every_channel():
    ms = nlfrf.multisine(
        fs=4096, n_samples=4096, f_min=1, f_max=1900, n_inputs=3, n_realizations=2, rng=2
    )
    phase = np.exp(1j * ms.phase.reshape(-1, ms.f.size))
    alike = np.abs(phase @ phase.conj().T) / ms.f.size - np.eye(len(phase))
    assert alike.max() < 5 / ms.f.size**0.5  # a mean of F unit vectors


def test_mixing_is_orthogonal_in_logical_axes():
    mixing = np.array([[1.0, 1.0], [0.5, -0.5]])
    ms = nlfrf.multisine(**BAND, n_inputs=2, mixing=mixing, rms=(1.0, 2.0), rng=3)
    logical = np.einsum("ij,jmk->imk", np.linalg.inv(mixing), ms.spectrum)
    gram = np.einsum("iek,jek->ijk", logical, logical.conj())
    assert np.abs(gram[0, 1]).max() < 1e-13 * np.abs(gram[0, 0]).max()
    np.testing.assert_allclose(ms.rms, np.sqrt(np.mean(ms.u**2, axis=(1, 2))), rtol=1e-12)


def test_the_best_of_many_draws_has_a_lower_worst_crest():
    one, best = (nlfrf.multisine(**BAND, n_inputs=2, n_draws=n, rng=4) for n in (1, 40))
    assert best.crest_factor.max() < one.crest_factor.max()
    np.testing.assert_allclose(best.amplitude, one.amplitude)


def test_zippered_lines_are_shared_out_at_random_and_keep_the_rms():
    ms = nlfrf.multisine("random-odd", **BAND, n_inputs=3, design="zippered", rms=2.0, rng=5)
    owners = ms.amplitude > 0
    assert np.all(owners.sum(axis=0) == 1)
    rounds = owners[:, : ms.f.size // 3 * 3].reshape(3, -1, 3)
    assert np.all(rounds.sum(axis=2) == 1)  # every input once in every three lines
    assert (ms.n_experiments, ms.n_realizations) == (1, 1)
    np.testing.assert_allclose(np.sqrt(np.mean(ms.u**2, axis=2)), 2.0, rtol=1e-12)


@pytest.mark.parametrize(
    ("more", "message"),
    [
        ({"design": "zippered"}, "kind must be random-odd for a zippered design"),
        ({"rms": (1.0, 2.0, 3.0)}, r"rms must be one number, or one per input \(2\)"),
        ({"rms": (1.0, -1.0)}, r"rms\[1\] must be positive"),
        ({"amplitude": np.ones((3, 50))}, r"amplitude must have one row per input \(2\), got 3"),
        ({"mixing": np.ones((2, 2))}, "mixing must have full rank"),
        (
            {"mixing": np.eye(2), "design": "zippered"},
            "mixing must be left out for a zippered design",
        ),
        ({"mixing": np.eye(3)}, r"mixing must have shape \(2, 2\)"),
        ({"design": "serial"}, "design must be one of 'orthogonal', 'zippered'"),
        ({"n_inputs": 0}, "n_inputs must be a whole number of at least 1"),
        (
            {"n_inputs": 1, "mixing": np.eye(1)},
            "n_inputs must be at least 2 for a zippered design, for mixing or for n_draws",
        ),
        (
            {"n_inputs": 1, "n_draws": 9},
            "n_inputs must be at least 2 for a zippered design, for mixing or for n_draws",
        ),
    ],
)
def test_refusals(more, message):
    with pytest.raises(ValueError, match=message):
        nlfrf.multisine(**{**BAND, "n_inputs": 2, "rng": 1, **more})
