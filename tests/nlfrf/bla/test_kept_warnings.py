"""What was warned of a record stays with it: in the record, in its BLA, in their files; once each,
and never less.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from nlfrf import (
    DataWarning,
    Record,
    bla_from_frf,
    identify,
    identify_noise,
    join_records,
    multisine,
)

CLIPPED, LOW_CREST = "u seems clipped", "u must have random phases"
MS = multisine(fs=256, n_samples=256, f_min=1, f_max=100, rms=1, n_realizations=2, rng=1)


def samples(level=np.inf, m=0):
    """Three periods of an input that a converter clipped at a level, and the output of a weak
    cube.
    """
    u = np.tile(np.clip(MS.u[m], -level, level), 3)
    return u, 2 * u + 0.05 * u**3


def cut(level=np.inf, m=0):
    return nlfrf.record_from_samples(*samples(level, m), fs=256, n_samples=256, lines=MS.lines)


def shown(make, *args):
    """What a function made, and the texts that it showed."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = make(*args)
    assert all(one.category is DataWarning and one.filename == __file__ for one in caught)
    return made, [str(one.message) for one in caught]


def matrix_record():
    ms = multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    u = ms.u[:, :, None]  # one period: noise counts as distortion, which is warned of
    y = np.stack([2 * u[0] + 0.1 * u[0] ** 3 + u[1], u[1] + 0.1 * u[1] ** 3])
    return Record(u=u, y=y, fs=256, lines=ms.lines)


def test_a_record_and_its_bla_keep_what_was_shown_each_once():
    record, of_record = shown(cut, 1.0)
    assert record.warnings == tuple(of_record)
    assert sum(CLIPPED in text for text in record.warnings) == 1
    bla, of_bla = shown(identify, record)
    assert bla.warnings == (*of_record, *of_bla)
    assert sum(LOW_CREST in text for text in bla.warnings) == 1
    for derived in (bla.every(2), bla.times(np.full(bla.f.size, 2.0)), replace(bla, hold="zoh")):
        assert derived.warnings == bla.warnings


def test_a_sound_record_keeps_none():
    record, of_record = shown(cut)
    bla, of_bla = shown(identify, record)
    assert of_record == of_bla == []
    assert record.warnings == bla.warnings == ()
    assert "warning" not in str(bla)


@pytest.mark.parametrize("action", ["ignore", "once", "default"])
def test_a_filter_that_hides_a_warning_does_not_lose_it(action):
    wanted = identify_quietly(cut_quietly(1.0)).warnings
    assert len(wanted) >= 2
    for _ in range(2):  # the second time python shows nothing any more
        with warnings.catch_warnings(record=True):
            warnings.simplefilter(action)
            assert identify(cut(1.0)).warnings == wanted


def cut_quietly(*args):
    return shown(cut, *args)[0]


def identify_quietly(record):
    return shown(identify, record)[0]


def test_warnings_as_errors_still_raise_and_leave_nothing_behind():
    record = cut_quietly(1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DataWarning)
        with pytest.raises(DataWarning, match=CLIPPED):
            cut(1.0)
        with pytest.raises(DataWarning, match=LOW_CREST):
            identify(record)
        assert identify(cut()).warnings == ()


def test_of_several_records_each_bla_keeps_its_own():
    clipped, sound = cut_quietly(1.0), cut()
    of_clipped, of_sound = shown(identify, [clipped, sound])[0]
    assert of_clipped.warnings
    assert of_sound.warnings == ()
    joined = shown(join_records, [sound, replace(clipped, u=cut(m=1).u, y=cut(m=1).y)])[0]
    assert joined.warnings == clipped.warnings


def test_other_ways_to_a_bla_keep_them_too():
    rng = np.random.default_rng(0)
    u = rng.standard_normal(40_000) * np.where(np.arange(40_000) < 10_000, 5.0, 0.1)
    bla, said = shown(lambda: identify_noise(u, u, fs=1.0, n_samples=400, f_min=0.01, f_max=0.4))
    assert "stationary" in said[0]
    assert bla.warnings == tuple(said)
    f = np.geomspace(1, 100, 20)
    std = np.full((2, 2, 20), 0.01)
    std[0, 0], std[1, 1] = 1.0, 1.0
    bla, said = shown(lambda: bla_from_frf(f, np.ones((2, 2, 20), complex), std=std))
    assert said
    assert bla.warnings == tuple(said)


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
def test_the_file_of_a_record_keeps_them(suffix, tmp_path):
    record = replace(
        cut_quietly(1.0), warnings=("said of “u”;\tand\nmore", *cut_quietly(1.0).warnings)
    )
    nlfrf.save(record, tmp_path / f"r{suffix}")
    read, said = shown(nlfrf.load_record, tmp_path / f"r{suffix}")
    assert read.warnings == (
        "said of “u”; and more",
        *record.warnings[1:],
    )  # printable, on one line
    assert said == []  # who measured was warned, and who reads has them in the value
    nlfrf.save(cut(), tmp_path / f"sound{suffix}")
    assert nlfrf.load_record(tmp_path / f"sound{suffix}").warnings == ()


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".h5"])
def test_the_file_of_a_matrix_and_of_its_record_keep_them(suffix, tmp_path):
    record = replace(matrix_record(), warnings=("said before",))
    nlfrf.save(record, tmp_path / f"r{suffix}")
    read = nlfrf.load_record(tmp_path / f"r{suffix}")
    assert read.warnings == ("said before",)
    bla, said = shown(identify, read)
    assert "one period does not separate noise" in said[0]
    assert bla.warnings == ("said before", *said)
    assert bla.entry(0, 1).warnings == bla.warnings
    if suffix != ".mat":
        nlfrf.save(bla, tmp_path / f"bla{suffix}")
        assert nlfrf.load(tmp_path / f"bla{suffix}").warnings == bla.warnings
        assert f"{len(bla.warnings)} warnings" in str(nlfrf.load(tmp_path / f"bla{suffix}"))


def test_the_file_of_a_bla_keeps_them_and_an_older_file_has_none(tmp_path):
    bla = identify_quietly(cut_quietly(1.0))
    nlfrf.save(bla, tmp_path / "bla.npz")
    assert nlfrf.load(tmp_path / "bla.npz").warnings == bla.warnings
    with np.load(tmp_path / "bla.npz") as stored:
        older = {name: stored[name] for name in stored.files if name != "warnings"}
    np.savez(tmp_path / "older.npz", **older)
    assert nlfrf.load(tmp_path / "older.npz").warnings == ()
    np.savez(tmp_path / "bad.npz", **older, warnings=np.array("no list"))
    with pytest.raises(ValueError, match="path must hold names as a list in JSON for warnings"):
        nlfrf.load(tmp_path / "bad.npz")


def test_what_a_file_is_warned_of_when_it_is_read_stays_with_the_record(tmp_path):
    u, y = samples()
    np.savez(tmp_path / "run.npz", u=u, y=y, z=u + y, fs=256.0)
    records, said = shown(
        lambda: nlfrf.load_record(tmp_path / "run.npz", y=["y", "z"], fs=250, n_samples=256)
    )
    assert "fs was given as 250 Hz" in said[0]
    assert [record.warnings for record in records] == [tuple(dict.fromkeys(said))] * 2
