"""A file of each kind, drawn by a seed: no answer is wrong without a word, and ordinary files are
read without one.

`python -m benchmarks.doors` draws thousands, and writes any of them by its seed.
"""

import warnings
from dataclasses import replace

import numpy as np
import pytest

import nlfrf
from benchmarks import doors
from benchmarks.doors import Outcome, compare, draw_kind, result_of
from benchmarks.drawn_files import KINDS, draw

#: Kinds that are drawn often differ more among themselves.
FILES = [
    pytest.param(name, seed, marks=pytest.mark.attack if (name, seed) == ("FRF table", 1) else ())
    for name, (weight, _) in KINDS.items()
    for seed in range(2 if weight >= 5 else 1)
]


@pytest.mark.parametrize(("name", "seed"), FILES, ids=lambda one: str(one).replace(" ", "_"))
def test_no_answer_is_wrong_without_a_word(name, seed, tmp_path):
    case = draw_kind(name, seed)
    found = result_of(case, tmp_path, with_commands=seed == 1)
    assert found.outcome not in (Outcome.SILENT, Outcome.CRASH), found
    if case.sound:
        assert found.outcome is Outcome.RIGHT, found


@pytest.mark.parametrize(
    "name",
    [
        *(
            f"sound table, {like}"
            for like in ("resonant", "noisy", "friction", "quantised", "from rest")
        ),
        *(
            "sound position in degrees or counts",
            "position that wraps",
            "channels that start at different times",
        ),
        *(
            "outliers",
            "silence before or behind",
            "hits of a hammer",
            "layout: thousands and decimal commas",
        ),
    ],
)
def test_the_samples_behind_a_file_have_the_frf_that_it_is_held_against(name):
    case = draw_kind(name, 7)
    run = case.run
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        bla = nlfrf.identify(
            nlfrf.record_from_samples(run.u, case.gain * run.y, fs=run.fs, n_samples=run.N)
        )
    case.unit = None
    assert not compare(case, bla)
    assert "%" in compare(replace(case, gain=2 * case.gain), bla)
    slow = replace(run, f=run.f / 1000, fs=run.fs / 1000)
    assert case.any_lines or "Hz" in compare(replace(case, run=slow), bla)


def test_an_answer_that_is_wrong_is_seen(tmp_path):
    case = draw_kind("sound table, plain", 0)
    assert result_of(case, tmp_path).outcome is Outcome.RIGHT
    assert result_of(replace(case, gain=2.0), tmp_path).outcome is Outcome.SILENT
    assert result_of(replace(case, unit="A/K"), tmp_path).outcome is Outcome.SILENT
    assert (
        result_of(replace(case, u="nobody", words="^$"), tmp_path).outcome is Outcome.REFUSED
    )  # its cure is right


def test_a_seed_is_a_file():
    one, again = draw(11), draw(11)
    assert one.kind == again.kind
    assert one.file == again.file
    assert np.array_equal(one.run.y, again.run.y)
    assert len({draw(seed).kind for seed in range(100)}) > 30


def test_the_command_prints_counts_and_writes_one_file(tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("sys.argv", ["doors", "--files", "3", "--kind", "sound table, plain"])
    assert doors.main() == 0
    assert "sound files: 3 of 3 right without a warning (100.0 %)" in capsys.readouterr().out
    monkeypatch.setattr(
        "sys.argv", ["doors", "--kind", "layout: LeCroy", "--write", "4", str(tmp_path)]
    )
    assert doors.main() == 0
    assert (tmp_path / "lecroy.csv").read_text().startswith("LECROYHDO")
    assert "nlfrf.load_record('lecroy.csv'" in capsys.readouterr().out
