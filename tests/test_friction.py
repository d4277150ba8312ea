"""Friction laws: their numbers, and what they refuse."""

import numpy as np
import pytest

from nlfrf.friction import Dahl, Leuven, LuGre, stribeck
from nlfrf.hysteresis import ElasticPlastic, MaxwellSlip, Tanh


def test_stribeck_curve_is_odd_and_falls_from_static_to_coulomb():
    v = np.array([1e-9, 0.01, 1.0])
    assert np.allclose(stribeck(Leuven(), v), [1.0, 0.7 + 0.3 * np.exp(-1), 0.7])
    assert np.array_equal(stribeck(Leuven(), -v), -stribeck(Leuven(), v))


@pytest.mark.parametrize(
    ("kwargs", "message"),
    [
        ({"Fs": 0.5}, "Fs must be at least Fc = 0.7 N, got 0.5 N"),
        ({"vs": 0.0}, "vs must be positive, got 0"),
        ({"n": 0.0}, "n must be positive, got 0"),
        ({"n": -1.0}, "n must be positive, got -1"),
        ({"sigma1": -1.0}, "sigma1 must be zero or positive, got -1"),
        ({"delta": np.nan}, "delta must be finite, got nan"),
        ({"curve": ElasticPlastic(64e3, 0.5)}, "curve must reach the static friction Fs = 1 N"),
        ({"curve": lambda z: z}, "curve must be one of Linear, Tanh"),
        ({"form": "other"}, "form must be one of 'modified', 'original'"),
        ({"form": "original", "curve": MaxwellSlip([64e3], [1.0])}, "curve must be a virgin curve where"),
    ],
)
def test_leuven_refuses(kwargs, message):
    with pytest.raises(ValueError, match=message):
        Leuven(**kwargs)


def test_lugre_and_dahl_refuse():
    with pytest.raises(ValueError, match="sigma0 must be positive"):
        LuGre(sigma0=0.0, sigma1=1.0, sigma2=1.0, Fc=1.0, Fs=1.0, vs=1.0)
    with pytest.raises(ValueError, match="Fc must be positive"):
        Dahl(sigma0=1.0, Fc=0.0)


def test_leuven_defaults_are_the_paper_s():
    law = Leuven()
    assert (law.Fs, law.Fc, law.vs, law.delta, law.sigma1, law.sigma2) == (1.0, 0.7, 0.01, 2.0, 13.0, 0.4)
    assert isinstance(law.curve, Tanh)
