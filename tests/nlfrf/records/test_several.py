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
    record = nlfrf.record_from_samples(
        u, y, fs=256, n_discard=1, inputs=["fx", "fy"], outputs=["x", "y", "z"]
    )
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
    record = nlfrf.record_from_samples(u, y, fs=256, n_samples=256, r=r)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    np.testing.assert_array_equal(record.r[:, :, 0], ms.u)


def test_refusals():
    ms, u, y = streams()
    four = np.zeros((2, 2, 1, 256)) + ms.u[:, :, None]
    make = {"u": four, "y": four, "fs": 256, "lines": ms.lines}
    with pytest.raises(ValueError, match=r"u must vary in every channel, got the constant 0 in fy"):
        nlfrf.Record(
            **{**make, "u": four * np.array([1, 0])[:, None, None, None]}, inputs=("fx", "fy")
        )
    with pytest.raises(ValueError, match="y must have the experiments, periods and samples of u"):
        nlfrf.Record(**{**make, "y": four[..., :-1]})
    with pytest.raises(ValueError, match="r must have the shape of u"):
        nlfrf.Record(**make, r=four[:1])
    with pytest.raises(ValueError, match="u must have 3 axes"):
        nlfrf.Record(**{**make, "u": four[0, 0]})
    with pytest.raises(ValueError, match="inputs must be 2 different names"):
        nlfrf.Record(**make, inputs=("x", "x"))
    with pytest.raises(ValueError, match="inputs must be 2 different names, got 'xy'"):
        nlfrf.Record(**make, inputs="xy")
    with pytest.raises(ValueError, match="lines must lie below the Nyquist line 128"):
        nlfrf.Record(**{**make, "lines": nlfrf.signals.LineGrid(excited=[1, 3, 200])})
    with pytest.raises(ValueError, match="y must have the experiments and samples of u"):
        nlfrf.record_from_samples(u, [one[:, :-5] for one in y], fs=256)
    with pytest.raises(ValueError, match="u must have the same channels in every experiment"):
        nlfrf.record_from_samples([u[0], u[1][:1]], y, fs=256)


def test_channels_in_columns_are_refused_with_the_cure():
    _, u, y = streams()
    with pytest.raises(
        ValueError, match=r"u must be \(channels, samples\), got shape \(\d+, 2\): transpose it"
    ):
        nlfrf.record_from_samples([one.T for one in u], y, fs=256)


def test_one_input_goes_with_several_outputs():
    _, u, y = streams()
    y = [one[:2] for one in y]
    record = nlfrf.record_from_samples(
        [one[0] for one in u], y, fs=256, n_samples=256, outputs=("x", "phi")
    )
    assert record.u.shape == (1, 2, 4, 256)
    assert (record.inputs, record.outputs, record.output_units) == (("u",), ("x", "phi"), ("", ""))
    assert record.y.shape == (2, 2, 4, 256)


def disturbed(kind, fault, seed=0):
    """Six periods of each experiment, with a fault in the last of them; what G is."""
    ms = nlfrf.multisine(
        "random-odd", fs=512, n_samples=1024, f_min=2, f_max=100, n_inputs=2, rng=1, design=kind
    )
    rng, k, n = np.random.default_rng(seed), ms.lines.excited, 6 * 1024
    period, clock = (1024.37, 1.0) if fault == "period" else (1024.0, 1 + 2e-5 * (fault == "clock"))
    u, y = [], []
    for m in range(ms.n_experiments):
        turns = [
            np.exp(2j * np.pi * np.outer(k, np.arange(n) * pace) / period) for pace in (1.0, clock)
        ]
        played, seen = (np.real(ms.spectrum[:, m] @ turn) for turn in turns)
        answer = np.stack([seen[0] + 0.5 * seen[1], seen[1] - 0.3 * seen[0]])
        if m == ms.n_experiments - 1:
            if fault == "output":
                answer[1] = np.append(np.delete(answer[1], 3500), answer[1, -1])
            if fault == "input":
                played[1] = np.append(np.delete(played[1], 3500), played[1, -1])
            if fault == "all":
                lost = [3500, 3501]
                played, answer = (
                    np.append(np.delete(x, lost, axis=1), x[:, -2:], axis=1)
                    for x in (played, answer)
                )
        u.append(played + 1e-3 * rng.standard_normal(played.shape))
        y.append(answer + 1e-3 * rng.standard_normal(answer.shape))
    return u, y, np.array([[1.0, 0.5], [-0.3, 1.0]])[:, :, None]


@pytest.mark.filterwarnings("ignore:each line excites one input")
@pytest.mark.parametrize("kind", ["orthogonal", "zippered"])
@pytest.mark.parametrize(
    ("fault", "told"),
    [
        ("none", ""),
        ("output", "y2.*must stay in step with u .* samples of y were lost"),
        ("input", "u2|n_samples must be the period of the input"),
        ("all", "n_samples must be the period of the input, got 1024: samples were lost"),
        (
            "period",
            "n_samples must be the period of the input, got 1024: the input repeats every 1024.3",
        ),
        (
            "clock",
            "y1.* must stay in step with u .* the clock of y differs from that of u by -20 ppm",
        ),
    ],
)
def test_a_fault_of_one_channel_is_told_and_cured(kind, fault, told):
    u, y, G = disturbed(kind, fault)
    if told:
        with pytest.raises(ValueError, match=told):
            nlfrf.record_from_samples(u, y, fs=512, n_samples=1024)
    if fault == "input" and kind == "zippered":
        return  # one input against the other: nobody knows which of them is right
    record = nlfrf.record_from_samples(u, y, fs=512, n_samples=1024, resample=True)
    assert record.n_periods >= 4
    frm = nlfrf.identify(record)
    assert np.abs(frm.G - G).max() < 2e-3
    assert np.mean(np.abs(frm.G - G) <= frm.bound()) > 0.85


def test_the_channel_is_called_by_its_name():
    u, y, _ = disturbed("orthogonal", "output")
    names = {"inputs": ["fx", "fy"], "outputs": ["x", "way"]}
    with pytest.raises(ValueError, match=r"y2 \(way\), realisation 1 must stay in step with u"):
        nlfrf.record_from_samples(u, y, fs=512, n_samples=1024, **names)
