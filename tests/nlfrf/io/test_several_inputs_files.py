"""Designs and records of several inputs on disk: exact to the bit, whole, joined, laid under a
design.
"""

import warnings
import zipfile
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from tests.support.measurement_files import damaged

NAMES = {"inputs": ("Kraft, x [N]", "µ/2"), "outputs": ("x", 'a "b"', "z")}


def design(**more):
    given = {"n_inputs": 2, "rms": (1.0, 3.0), "rng": 1} | more
    return nlfrf.multisine("random-odd", fs=256, n_samples=256, f_min=1, f_max=100, **given)


def played(ms, *, n_periods=2, noise=0.01, seed=0, **more):
    u = np.repeat(ms.u[:, :, None], n_periods, axis=2)
    y = np.stack([u[0] + 0.1 * u[0] ** 3, u[1], u[0] - u[1]])
    y += noise * np.random.default_rng(seed).standard_normal(y.shape)
    return nlfrf.Record(u=u, y=y, fs=ms.fs, lines=ms.lines, hold="zoh", **NAMES, **more)


def same_record(one, two):
    for name in ("u", "y", "r"):
        np.testing.assert_array_equal(getattr(one, name), getattr(two, name))
    for name in ("excited", "odd", "even"):
        np.testing.assert_array_equal(getattr(one.lines, name), getattr(two.lines, name))
    for name in ("fs", "inputs", "outputs", "hold"):
        assert getattr(one, name) == getattr(two, name)


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat"])
@pytest.mark.parametrize("closed", [False, True])
@pytest.mark.parametrize("kind", ["orthogonal", "zippered"])
def test_a_record_comes_back_as_it_was(suffix, closed, kind, tmp_path):
    ms = design(design=kind)
    record = played(ms, r=np.repeat(ms.u[:, :, None], 2, axis=2) if closed else None)
    path = tmp_path / f"run{suffix}"
    nlfrf.save(record, path)
    same_record(nlfrf.load_record(path), record)
    same_record(nlfrf.load(path), record)
    one = nlfrf.load_record(path, y=["z"], n_discard=1, hold="band-limited")
    np.testing.assert_array_equal(one.y, record.y[2:, :, 1:])
    assert (one.outputs, one.hold) == (("z",), "band-limited")


def test_a_record_of_a_single_period_keeps_its_axes_in_matlab(tmp_path):
    record = played(design(design="zippered"), n_periods=1)
    nlfrf.save(record, tmp_path / "run.mat")
    same_record(nlfrf.load_record(tmp_path / "run.mat"), record)


def test_one_experiment_as_a_table(tmp_path):
    record = played(design(design="zippered"))
    nlfrf.save(record, tmp_path / "run.csv")
    asked = {"u": ["Kraft, x [N]", "µ/2"], "y": ["x", 'a "b"', "z"], "n_samples": 256}
    back = nlfrf.load_record(tmp_path / "run.csv", **asked)
    np.testing.assert_array_equal(back.u, record.u)
    np.testing.assert_array_equal(back.y, record.y)
    with pytest.raises(
        ValueError, match=r"record must hold one experiment for a \.csv file, got 2; use \.npz"
    ):
        nlfrf.save(played(design()), tmp_path / "two.csv")
    assert not (tmp_path / "two.csv").exists()


def test_sets_in_several_files_are_one_record(tmp_path):
    sets = [played(design(rng=seed), seed=seed, n_periods=2 + seed) for seed in (1, 2)]
    for k, one in enumerate(sets):
        nlfrf.save(replace(one, lines=sets[0].lines), tmp_path / f"set{k}.npz")
    paths = sorted(tmp_path.glob("set*.npz"))
    both = nlfrf.load_record(paths)
    assert both.u.shape == (2, 4, 3, 256)
    np.testing.assert_array_equal(both.y[:, 2:], sets[1].y[:, :, :3])
    nlfrf.save(replace(sets[1], lines=sets[0].lines, inputs=("a", "b")), paths[1])
    with pytest.raises(
        ValueError, match="records must be of one experiment, with the same inputs, got"
    ):
        nlfrf.load_record(paths)


def test_what_is_asked_of_a_record_that_was_saved(tmp_path):
    path = tmp_path / "run.npz"
    nlfrf.save(played(design()), path)

    def refusal(load=nlfrf.load_record, **asked):
        with pytest.raises(ValueError) as error:  # noqa: PT011 - its message is what is looked at
            load(path, **asked)
        return str(error.value)

    assert "u must be all inputs of the record, Kraft, x [N], µ/2" in refusal(u=["µ/2"], y=["x"])
    assert "y must be outputs of the record, x, a \"b\", z, got 'w'" in refusal(y=["w"])
    assert "r must be left out" in refusal(r=["x"])
    assert "n_samples must be that of the record, 256, got 128" in refusal(n_samples=128)
    assert "n_discard must be less than the 2 periods" in refusal(n_discard=2)
    assert "path must be a record of one input" in refusal(load=nlfrf.load_record, u="µ/2")
    assert "which is a record; go on with: nlfrf identify" in refusal(
        load=lambda path: nlfrf.load_record(path, u="u", y="y", design=path)
    )
    whole = dict(np.load(path))
    for missing in ("u", "shape", "odd", "outputs"):
        np.savez(path, **{name: array for name, array in whole.items() if name != missing})
        assert missing in refusal()
    np.savez(path, **(whole | {"axes": np.array("realization period sample")}))
    assert "axes 'channel realization period sample'" in refusal()
    np.savez(path, **(whole | {"version": np.array(99)}))
    assert "schema version 1 of nlfrf-multirecord" in refusal()


@pytest.mark.parametrize("suffix", [".npz", ".h5"])
@pytest.mark.parametrize("mixing", [None, np.array([[1.0, 2.0], [0.5, -1.0]])])
def test_a_design_comes_back_as_it_was(suffix, mixing, tmp_path):
    ms = design(mixing=mixing, hold="zoh", n_realizations=2)
    path = tmp_path / f"ms{suffix}"
    nlfrf.save(ms, path)
    back = nlfrf.load(path)
    assert back.n_inputs == ms.n_inputs
    np.testing.assert_array_equal(back.u, ms.u)
    assert (back.design, back.hold, back.kind, back.fs) == (
        "orthogonal",
        "zoh",
        "random-odd",
        256.0,
    )


def test_what_a_generator_plays(tmp_path):
    ms = design()
    for suffix in (".csv", ".mat", ".wav"):
        nlfrf.save(ms, tmp_path / f"play{suffix}")
        np.testing.assert_array_equal(nlfrf.load(tmp_path / "play.npz").u, ms.u)
        (tmp_path / "play.npz").unlink()
    table = np.loadtxt(tmp_path / "play.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(
        table[:, 1:], np.stack([ms.u[0, 0], ms.u[1, 0], ms.u[0, 1], ms.u[1, 1]], axis=1)
    )
    header = (tmp_path / "play.csv").read_text().splitlines()[0]
    assert header == "t [s],u1 experiment 1,u2 experiment 1,u1 experiment 2,u2 experiment 2"


def streams(ms, seed, limit=np.inf):
    """Three periods of each experiment behind a trigger of its own, through actuators that
    saturate.
    """
    rng = np.random.default_rng(seed)
    u, y = [], []
    for m in range(ms.n_experiments):
        clipped = np.clip(np.tile(ms.u[:, m], 4), -limit, limit)
        start = rng.integers(ms.n_samples)
        cut = clipped[:, start : start + 3 * ms.n_samples]
        u.append(cut + 0.01 * rng.standard_normal(cut.shape))
        y.append(
            np.stack([cut[0] + 0.5 * cut[1], cut[1] - cut[0]])
            + 0.003 * rng.standard_normal(cut.shape)
        )
    return u, y


@pytest.mark.parametrize("by_file", [False, True])
def test_the_design_tells_what_a_distorting_actuator_hides(by_file, tmp_path):
    ms = design(rms=1.0, hold="zoh")
    u, y = streams(ms, seed=1, limit=1.3)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        alone = nlfrf.record_from_samples(u, y, fs=256)
    assert alone.lines.excited.size > ms.lines.excited.size
    if by_file:
        nlfrf.save(ms, tmp_path / "ms.npz")
        for m in range(2):
            np.savez(tmp_path / f"run{m}.npz", a=u[m][0], b=u[m][1], x=y[m][0], y=y[m][1], fs=256.0)
        paths = [tmp_path / f"run{m}.npz" for m in range(2)]
        record = nlfrf.load_record(paths, u=["a", "b"], y=["x", "y"], design=tmp_path / "ms.npz")
    else:
        record = nlfrf.record_from_samples(u, y, fs=256, design=ms)
    np.testing.assert_array_equal(record.lines.excited, ms.lines.excited)
    assert (record.n_samples, record.hold) == (256, "zoh")
    assert np.ptp(record.r - record.r[:, :, :1]) == 0  # one period that stands for all
    frm = nlfrf.identify(record)
    inside = np.abs(frm.G - np.array([[1.0, 0.5], [-1.0, 1.0]])[:, :, None]) <= frm.bound()
    assert inside.mean() > 0.85  # 4 x 37 entries of 95 %, which neighbouring lines share a level of


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_a_zippered_record_takes_its_design(tmp_path):
    """Its lines and its hold, and no references: with those it was refused, measured or saved."""
    ms = design(design="zippered", hold="zoh")
    record = played(ms, n_periods=3)
    nlfrf.save(record, tmp_path / "run.npz")
    stored = nlfrf.load_record(tmp_path / "run.npz", design=ms)
    streams = [one[:, 0].reshape(len(one), -1) for one in (record.u, record.y)]
    measured = nlfrf.record_from_samples(*streams, fs=256, design=ms)
    for found in (stored, measured):
        assert (found.r, found.hold) == (None, "zoh")
        np.testing.assert_allclose(nlfrf.identify(found).G, nlfrf.identify(record).G, rtol=1e-12)
    with pytest.raises(ValueError, match="design must be the one that was played"):
        nlfrf.record_from_samples(*streams, fs=256, design=design(design="zippered", rng=2))


def test_a_design_that_was_not_played_is_refused():
    ms = design(rms=1.0)
    u, y = streams(ms, seed=2)
    with pytest.raises(
        ValueError, match="design must be the one that was played, got a correlation of"
    ):
        nlfrf.record_from_samples(u, y, fs=256, design=design(rms=1.0, rng=9))
    with pytest.raises(ValueError, match="design must have the inputs of the record, 2, got 3"):
        nlfrf.record_from_samples(u, y, fs=256, design=design(rms=1.0, n_inputs=3))
    with pytest.raises(ValueError, match="design must be of type Multisine, got 3"):
        nlfrf.record_from_samples(u, y, fs=256, design=3)
    with pytest.raises(ValueError, match="design must have the inputs of the record, 1, got 2"):
        nlfrf.record_from_samples(u[0][0], y[0][0], fs=256, design=ms)


@pytest.mark.own_process
@pytest.mark.parametrize("what", ["record", "design"])
def test_damaged_files_are_refused_or_read(what, tmp_path):
    path, rng = tmp_path / "x.npz", np.random.default_rng(4)
    if what == "record":
        nlfrf.save(played(design()), path)
    else:
        nlfrf.save(design(), path)
    whole = path.read_bytes()
    refused = 0
    for _ in range(60):
        path.write_bytes(damaged(whole, rng))
        try:
            nlfrf.load(path)
        except ValueError as error:
            refused += "\n" not in str(error)
        else:
            refused += 1
    assert refused == 60  # in one line, or read: nothing else


def test_a_file_of_ours_is_read_once(tmp_path, monkeypatch):
    ms = design()
    nlfrf.save(played(ms), tmp_path / "record.npz")
    nlfrf.save(ms, tmp_path / "design.npz")
    nlfrf.save(nlfrf.identify(played(ms)), tmp_path / "frm.npz")
    unpack, reads = zipfile.ZipFile.__init__, []

    def counting(archive, file, *args, **options):
        reads.append(Path(file.name).stem)
        unpack(archive, file, *args, **options)

    monkeypatch.setattr(zipfile.ZipFile, "__init__", counting)
    for name in ("record", "design", "frm"):
        nlfrf.load(tmp_path / f"{name}.npz")
        nlfrf.inspect_file(tmp_path / f"{name}.npz")
    assert reads == [name for name in ("record", "design", "frm") for _ in range(2)]


def test_one_loader_takes_a_name_or_a_list_of_them(tmp_path):
    u, y = streams(design(rms=1.0), seed=2)
    paths = [tmp_path / f"run{m}.npz" for m in range(len(u))]
    for path, inputs, outputs in zip(paths, u, y, strict=True):
        np.savez(path, fx=inputs[0], fy=inputs[1], x=outputs[0], fs=256.0)
    record = nlfrf.load_record(paths, u=["fx", "fy"], y="x", n_samples=256)
    same = nlfrf.load_record(paths, u=["fx", "fy"], y=["x"], n_samples=256)
    np.testing.assert_array_equal(record.u, same.u)
    assert (record.inputs, record.outputs) == (("fx", "fy"), ("x",))
