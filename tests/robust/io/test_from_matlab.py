"""Controllers that MATLAB saved: matrices, coefficients, roots, alone or as fields of a struct."""

import control
import numpy as np
import pytest
from scipy.io import savemat

from robust.io.models import load_controller
from tests.support.responses import response

T = 1e-3
OMEGA = np.geomspace(1, 3000, 50)
PI = control.ss([[1.0]], [[1.0]], [[20.0]], [[800.0]], T)
MATRICES = {"A": PI.A, "B": PI.B, "C": PI.C, "D": PI.D}


def cell(held):
    """A MATLAB cell of one entry."""
    out = np.empty((1, 1), dtype=object)
    out[0, 0] = np.asarray(held)
    return out


def saved(path, content):
    savemat(path, content)
    return load_controller(path)


def random_roots(rng, n):
    real = rng.uniform(-0.9, 0.9, n % 2)
    pairs = rng.uniform(0.1, 0.9, n // 2) * np.exp(1j * rng.uniform(0, 3, n // 2))
    return np.concatenate([real, pairs, pairs.conj()])


@pytest.mark.parametrize("dt", [0.0, T])
@pytest.mark.parametrize("n", range(5))
def test_every_way_of_saving_is_the_same_controller(tmp_path, n, dt):
    rng = np.random.default_rng(n)
    zeros, poles, gain = random_roots(rng, max(n - 1, 0)), random_roots(rng, n), float(rng.normal())
    z = np.exp(1j * OMEGA * dt) if dt else 1j * OMEGA
    expected = gain * np.prod(z[:, None] - zeros, axis=1) / np.prod(z[:, None] - poles, axis=1)
    num, den = gain * np.atleast_1d(np.poly(zeros).real), np.atleast_1d(np.poly(poles).real)
    K = control.ss(control.tf(num, den, dt))
    padded = np.append(np.zeros(den.size - num.size), num)
    beside = {"Ts": dt, "TimeUnit": "seconds", "InputDelay": 0.0, "Name": ""}
    contents = [
        {"A": K.A, "B": K.B, "C": K.C, "D": K.D, "Ts": dt},
        {"K": {"A": K.A, "B": K.B, "C": K.C, "D": K.D, "E": np.zeros((0, 0)), **beside}},
        {"num": num, "den": den, "Ts": dt},
        {
            "S": {
                "Numerator": cell(padded),
                "Denominator": cell(den),
                "Variable": "z" if dt else "s",
                **beside,
            }
        },
        {"z": zeros[:, None], "p": poles[:, None], "k": gain, "Ts": dt},
        {
            "K": {"Z": cell(zeros[:, None]), "P": cell(poles[:, None]), "K": gain, **beside},
            "x": np.arange(3.0),
        },
    ]
    if dt:  # leading zeros count in powers of 1/z, trailing ones do not
        contents.append({"K": {"num": padded, "den": den, "Variable": "z^-1"}, "Ts": dt})
    for content in contents:
        found = saved(tmp_path / "K.mat", content)
        assert found.dt == dt
        np.testing.assert_allclose(response(found, OMEGA), expected, rtol=1e-9)


@pytest.mark.parametrize(
    ("n", "n_y", "n_u"), [(1, 2, 3), (3, 2, 1), (2, 1, 2), (4, 3, 3), (0, 2, 2)]
)
def test_several_channels_keep_their_shape(tmp_path, n, n_y, n_u):
    rng = np.random.default_rng(5)
    A, B, C, D = (rng.normal(size=shape) for shape in ((n, n), (n, n_u), (n_y, n), (n_y, n_u)))
    found = saved(tmp_path / "K.mat", {"A": A, "B": B, "C": C, "D": D, "Ts": T})
    for name, matrix in zip("ABCD", (A, B, C, D), strict=True):
        assert np.array_equal(getattr(found, name), matrix)


def test_of_several_structs_the_one_called_k_counts(tmp_path):
    other = {"A": 1.0, "B": 1.0, "C": 1.0, "D": 0.0, "Ts": 2 * T}
    assert saved(tmp_path / "a.mat", {"G": other, "K": {**MATRICES, "Ts": T}}).dt == T
    with pytest.raises(ValueError, match="got 2, called G, H"):
        saved(tmp_path / "a.mat", {"G": other, "H": other})


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (MATRICES, "Ts must be the sampling time"),
        ({**MATRICES, "Ts": -1.0}, "Ts must be the sampling time"),
        ({"K": {**MATRICES, "Ts": T, "InputDelay": 1.0}}, "inputdelay must be zero"),
        (
            {"K": {**MATRICES, "Ts": T, "TimeUnit": "minutes"}},
            "TimeUnit must be seconds in 'K.mat', got minutes",
        ),
        ({"K": {**MATRICES, "Ts": T, "E": 2.0}}, "E must be the identity"),
        ({**MATRICES, "Ts": T, "B": np.ones((2, 2))}, r"B must have the shape \(1, 4\)"),
        ({"num": [1.0, 2.0, 3.0], "den": [1.0, 2.0], "Ts": T}, "proper"),
        ({"z": [0.1, 0.2], "p": [0.5], "k": 1.0, "Ts": T}, "proper"),
        ({"z": [0.1], "p": [0.5 + 0.1j], "k": 1.0, "Ts": T}, "p must be real or conjugate"),
        ({"x": np.arange(5.0)}, r"got none in 'K.mat'; in MATLAB: \[A, B, C, D, Ts\] = ssdata"),
    ],
)
def test_what_is_no_controller_is_refused_in_one_line(tmp_path, content, message):
    with pytest.raises(ValueError, match=message) as refused:
        saved(tmp_path / "K.mat", content)
    assert "\n" not in str(refused.value)


def test_damaged_files_and_those_of_version_73_are_refused(tmp_path):
    for name, content in (
        ("a.mat", b"garbage" * 50),
        ("b.mat", b"MATLAB 7.3 MAT-file" + bytes(600)),
        ("c.mat", b""),
    ):
        (tmp_path / name).write_bytes(content)
        with pytest.raises(ValueError, match="path must"):
            load_controller(tmp_path / name)
    with pytest.raises(FileNotFoundError, match="existing file"):
        load_controller(tmp_path / "d.mat")
