"""One signal of a repeated trial from a file: any way of writing it, its column by name, its clock,
its unit.
"""

import numpy as np
import pytest

from nlfrf.io.trials import read_trial

DT = 1e-3
E = 3.25 * np.sin(7e-3 * np.arange(400))
T = [f"{DT * k:.6g}" for k in range(E.size)]
NUMBERS = [f"{e:.9f}" for e in E]
ROWS = [*map(",".join, zip(T, NUMBERS, strict=True))]


def german(text):
    """Write decimal commas."""
    return text.replace(".", ",")


def read(folder, lines, signal="e", **options):
    path = folder / "e.csv"
    path.write_text("\n".join(lines) + "\n\n", encoding="utf-8")
    return read_trial(path, signal, **{"dt": DT, **options})


@pytest.mark.parametrize(
    "lines",
    [
        NUMBERS,
        ROWS,
        ["e", *NUMBERS],
        ["\ufefft [s],e", *ROWS],
        ["t\te", *map("\t".join, zip(T, NUMBERS, strict=True))],
        [
            "t [ms];Fehler [mm]",
            *(german(f"{1e3 * float(t):g};{e}") for t, e in zip(T, NUMBERS, strict=True)),
        ],
        ["Fehler", *map(german, NUMBERS)],
        ["k,e", *(f"{k},{e}" for k, e in enumerate(NUMBERS))],
        ["t,e", *(f"{k},{e}" for k, e in enumerate(NUMBERS))],
    ],
)
def test_every_way_of_writing_it_gives_the_same_numbers(tmp_path, lines):
    assert read(tmp_path, lines).samples == pytest.approx(E, abs=1e-9)


@pytest.mark.parametrize("names", ["t,e,u", "e,t,y", "u,Fehler [mm],t", "time,position,error"])
def test_the_column_is_taken_by_its_name(tmp_path, names):
    columns = names.split(",")
    at = next(i for i, name in enumerate(columns) if name[0] in "eF")
    time = next(i for i, name in enumerate(columns) if name[0] == "t")
    table = np.cos(np.arange(3 * E.size)).reshape(-1, 3)
    table[:, at], table[:, time] = E, DT * np.arange(E.size)
    found = read(tmp_path, [names, *(",".join(map(repr, row)) for row in table.tolist())])
    assert np.array_equal(found.samples, E)
    assert str(found) == f"column {columns[at]!r} of e.csv"


def test_a_column_without_a_telling_name_is_asked_for_or_named(tmp_path):
    lines = ["ch1,ch2", *(f"{e},{-float(e)}" for e in NUMBERS)]
    with pytest.raises(
        ValueError, match=r"got 'ch1', 'ch2' in 'e.csv'; name the column with --err"
    ):
        read(tmp_path, lines)
    found = read(tmp_path, lines, column="ch1")
    assert found.samples == pytest.approx(E, abs=1e-9)
    assert str(found) == "column 'ch1' of e.csv, which has no times"


def test_the_file_of_the_other_signal_is_refused(tmp_path):
    with pytest.raises(ValueError, match="u must be a file in which one column is named like"):
        read(tmp_path, ["e", *NUMBERS], "u")
    with pytest.raises(ValueError, match="e must be a file in which one column is named like"):
        read(tmp_path, ["t [s],learned input", *ROWS])


@pytest.mark.parametrize(
    ("t", "message"),
    [
        (2 * DT * np.arange(400), "the time column has a step of 0.002 s"),
        (2e-3 * np.arange(40), "the time column has a step of 0.002 s"),
        (DT * np.delete(np.arange(401), 200), "time jumps by two samples at 0.2 s: one sample"),
        (DT * np.r_[:200, 200.7:400], "the steps of the time column vary from"),
        (DT * np.r_[:20, 20.6:40], "the last of 40 rows is 0.6 samples late"),
        (DT * np.r_[:200, :200], "the time column runs backwards"),
    ],
)
def test_times_that_are_not_those_of_the_controller_are_refused(tmp_path, t, message):
    lines = ["t [s],e", *(f"{one:.9g},{e}" for one, e in zip(t, NUMBERS, strict=False))]
    with pytest.raises(
        ValueError, match=f"e must be sampled every 0.001 s .* {message}"
    ) as refusal:
        read(tmp_path, lines)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize("dt", [DT, 2.5e-4])
def test_times_with_jitter_or_few_digits_are_accepted(tmp_path, dt):
    jitter = dt * (np.arange(400) + np.random.default_rng(1).uniform(-0.2, 0.2, 400))
    for t in (jitter, 7.5 + dt * np.arange(400), np.round(dt * np.arange(400), 3)):
        lines = ["t [s],e", *(f"{one:.9g},{e}" for one, e in zip(t, NUMBERS, strict=True))]
        assert read(tmp_path, lines, dt=dt).samples == pytest.approx(E, abs=1e-9)


def test_a_unit_is_converted_to_that_of_the_model(tmp_path):
    lines = ["t [s],e [mm]", *ROWS]
    found = read(tmp_path, lines, unit="m")
    assert found.samples == pytest.approx(1e-3 * E, abs=1e-12)
    assert str(found) == "column 'e [mm]' of e.csv, converted from mm to m"
    assert read(tmp_path, lines).samples == pytest.approx(E, abs=1e-9)
    with pytest.raises(ValueError, match=r"e must be in N like the model, got 'e \[mm\]'"):
        read(tmp_path, lines, unit="N")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "0,000\n0,023",
            "or have decimal points instead of commas, got '0,000', which may be one number or two columns",
        ),
        (
            "t [s],e\n0,1.5\n0.001,1.5\n0.002,",
            "e must have a number in every row, got none in sample 3",
        ),
        ("", "no rows of numbers were found"),
        ("t,e", "no rows of numbers were found"),
    ],
)
def test_what_may_be_two_things_is_refused(tmp_path, text, message):
    with pytest.raises(ValueError, match=message):
        read(tmp_path, [text])
