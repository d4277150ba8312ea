"""Records of several channels: shapes, names, what they refuse, streams cut into periods."""

import numpy as np
import pytest

import nlfrf


def streams(n_periods=4, n_inputs=2):
    ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=n_inputs, rng=1)
    u = [np.tile(ms.u[:, m], n_periods) for m in range(n_inputs)]
    return ms, u, [np.stack([one[0] + one[-1], one[0] * 2, one[-1]]) for one in u]


def test_streams_are_cut_into_a_record():
    ms, u, y = streams()
    record = nlfrf.multirecord_from_samples(u, y, fs=256, n_discard=1, inputs=["fx", "fy"], outputs=["x", "y", "z"])
    assert record.u.shape == (2, 2, 3, 256)
    assert record.y.shape == (3, 2, 3, 256)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    np.testing.assert_array_equal(record.u[:, :, 0], ms.u)
    np.testing.assert_array_equal(record.y[1], 2 * record.u[0])
    assert (record.inputs, record.outputs) == (("fx", "fy"), ("x", "y", "z"))


def test_references_say_where_the_periods_stand():
    ms, r, y = streams()
    rng = np.random.default_rng(0)
    u = [one + 0.1 * rng.standard_normal(one.shape) for one in r]
    record = nlfrf.multirecord_from_samples(u, y, fs=256, n_samples=256, r=r)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    np.testing.assert_array_equal(record.r[:, :, 0], ms.u)


def test_refusals():
    ms, u, y = streams()
    four = np.zeros((2, 2, 1, 256)) + ms.u[:, :, None]
    make = {"u": four, "y": four, "fs": 256, "lines": ms.lines}
    with pytest.raises(ValueError, match=r"u must vary in every channel, got the constant 0 in fy"):
        nlfrf.MultiRecord(**{**make, "u": four * np.array([1, 0])[:, None, None, None]}, inputs=("fx", "fy"))
    with pytest.raises(ValueError, match="y must have the experiments, periods and samples of u"):
        nlfrf.MultiRecord(**{**make, "y": four[..., :-1]})
    with pytest.raises(ValueError, match="r must have the shape of u"):
        nlfrf.MultiRecord(**make, r=four[:1])
    with pytest.raises(ValueError, match="u must have 4 axes"):
        nlfrf.MultiRecord(**{**make, "u": four[0]})
    with pytest.raises(ValueError, match="inputs must be 2 different names"):
        nlfrf.MultiRecord(**make, inputs=("x", "x"))
    with pytest.raises(ValueError, match="inputs must be 2 different names, got 'xy'"):
        nlfrf.MultiRecord(**make, inputs="xy")
    with pytest.raises(ValueError, match="lines must lie below the Nyquist line 128"):
        nlfrf.MultiRecord(**{**make, "lines": nlfrf.LineGrid(excited=[1, 3, 200])})
    with pytest.raises(ValueError, match="y must have the experiments and samples of u"):
        nlfrf.multirecord_from_samples(u, [one[:, :-5] for one in y], fs=256)
    with pytest.raises(ValueError, match="u must have the same channels in every experiment"):
        nlfrf.multirecord_from_samples([u[0], u[1][:1]], y, fs=256)
