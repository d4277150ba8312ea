"""Files made to do harm: read cleanly or refused in one line, whatever they announce, name or are
called.
"""

import subprocess
import sys
import tracemalloc
import zipfile
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from nlfrf._base import own_process
from nlfrf.io.measurement_files import read_channels
from tests.support.hostile_files import (
    FAMILIES,
    bomb,
    elsewhere,
    harm_of,
    mdf_attached,
    member,
    npz_of,
)

ROOT = Path(__file__).parents[3]


#: Files of a family where not 4: a process for each takes a while.
MANY = {"npz lies": 60, "named": 40, "elsewhere": 16}
FEW = {"npz lies": 60, "attached": 2}


@pytest.mark.own_process
@pytest.mark.parametrize(
    ("family", "n"),
    [
        *((family, FEW.get(family, 3)) for family in FAMILIES),
        *(
            pytest.param(family, MANY.get(family, 4), marks=pytest.mark.attack)
            for family in FAMILIES
        ),
    ],
)
def test_nothing_of_a_family_does_harm(family, n, tmp_path, monkeypatch):
    if "expands" in family:
        monkeypatch.setattr(own_process, "UNPACKED", 64 << 20)
    rng = np.random.default_rng(0)
    for _ in range(n):
        path = FAMILIES[family](tmp_path, rng)
        assert harm_of(path) == "", path.name
        path.unlink()


def test_three_megabytes_that_unpack_to_three_gigabytes_are_refused_unread(tmp_path):
    path = bomb(tmp_path / "bomb.npz", 3.0, whole=False)
    assert path.stat().st_size < 4e6
    tracemalloc.start()
    with pytest.raises(
        ValueError,
        match=r"'bomb\.npz': it unpacks to 3 GB, but a file of 0\.00\d+ GB may unpack to 1\.1\d GB",
    ):
        read_channels(path)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e7


def test_a_bomb_is_a_whole_archive(tmp_path):
    """So that it is refused for its size and for nothing else."""
    path = bomb(tmp_path / "small.npz", 0.02)
    assert zipfile.ZipFile(path).testzip() is None
    assert not read_channels(path).arrays["u"].any()


def test_numbers_of_another_file_are_never_a_channel(tmp_path):
    ways = set()
    for seed in range(40):
        path = elsewhere(tmp_path, np.random.default_rng(seed))
        with pytest.raises(
            ValueError, match=r"other files are never read; copy the numbers into this one"
        ) as refusal:
            read_channels(path)
        assert "\n" not in str(refusal.value)
        ways.add(
            (
                path.suffix,
                str(refusal.value).partition("': its '")[2].partition("' ")[2].partition(":")[0],
            )
        )
    said = ("has external storage", "is a virtual dataset", "is a link to another file")
    assert ways == {(suffix, one) for suffix in (".h5", ".mat") for one in said}


def test_an_attachment_outside_of_a_file_is_not_opened(tmp_path):
    path = mdf_attached(tmp_path)
    code = (
        "import sys; from pathlib import Path; from nlfrf.io.readers import mdf; opened ="
        " []\nsys.addaudithook(lambda event, about: opened.append(str(about[0])) if event =="
        f" 'open' else None)\nfound = mdf.contents(Path({str(path)!r}))\nprint(found[0]['u'].size,"
        " [name for name in opened if 'secret.' in name])"
    )
    said = subprocess.run(
        [sys.executable, "-c", code], check=True, capture_output=True, text=True, cwd=ROOT
    ).stdout
    assert said == "750 []\n"


def test_what_is_no_array_in_an_archive_is_noted_and_the_rest_is_read(tmp_path):
    path = npz_of(
        tmp_path / "run.npz", [("u.npy", member(np.arange(9.0))), ("README.txt", b"hello")]
    )
    found = read_channels(path)
    assert found.notes == {"README.txt": "is no array of NumPy"}
    np.testing.assert_array_equal(found.arrays["u"], np.arange(9.0))


def test_an_index_file_beside_a_recording_says_nothing_of_it(tmp_path):
    from tests.support.measurement_files import U, write_tdms

    write_tdms(tmp_path / "run.tdms")
    content = (tmp_path / "run.tdms").read_bytes()
    (tmp_path / "run.tdms_index").write_bytes(b"TDSh" + content[4:60])
    np.testing.assert_array_equal(read_channels(tmp_path / "run.tdms").arrays["run.u"], U)


def test_a_name_over_two_lines_is_found_by_what_is_printed_of_it_and_as_it_stands(tmp_path):
    u = np.tile(nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1).u[0], 3)
    np.savez(tmp_path / "run.npz", **{"Force\n\x1b[2Jdrive": u, "y": 2 * u, "fs": 100.0})
    for name in ("Force \\u001b[2Jdrive", "Force\n\x1b[2Jdrive"):
        record = nlfrf.load_record(tmp_path / "run.npz", u=name)
        np.testing.assert_array_equal(record.u.ravel(), u)
        assert record.u_name == "Force \\u001b[2Jdrive"


def test_names_that_are_alike_when_they_are_printed_are_told_apart(tmp_path):
    np.savez(tmp_path / "run.npz", **{"a\nb": np.zeros(9), "a b": np.ones(9)})
    assert {
        name: array[0] for name, array in read_channels(tmp_path / "run.npz").arrays.items()
    } == {
        "a b": 0,
        "a b.2": 1,
    }
