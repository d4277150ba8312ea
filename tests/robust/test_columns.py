"""The last column of a CSV file, as trials of a learning loop are stored: any separator, decimal
point or comma.
"""

import numpy as np
import pytest

from robust.reports.command import read_last_column

E = 3.25 * np.sin(7e-3 * np.arange(40))
T = [f"{0.001 * k:.6g}" for k in range(E.size)]
NUMBERS = [f"{e:.9f}" for e in E]


def german(text):
    """Write decimal commas."""
    return text.replace(".", ",")


@pytest.mark.parametrize(
    "lines",
    [
        NUMBERS,
        ["e", *NUMBERS],
        ["\ufefft [s],e", *map(",".join, zip(T, NUMBERS, strict=True))],
        ["t\te", *map("\t".join, zip(T, NUMBERS, strict=True))],
        ["t [ms];Fehler [mm]", *(german(";".join(row)) for row in zip(T, NUMBERS, strict=True))],
        ["Fehler", *map(german, NUMBERS)],
    ],
)
def test_every_way_of_writing_it_gives_the_same_numbers(tmp_path, lines):
    (tmp_path / "e.csv").write_text("\n".join(lines) + "\n\n", encoding="utf-8")
    assert read_last_column(tmp_path / "e.csv") == pytest.approx(E, abs=1e-9)


def test_whole_numbers_in_two_columns_are_two_columns(tmp_path):
    (tmp_path / "e.csv").write_text("k,e\n0,0\n1,1\n2,4\n")
    assert read_last_column(tmp_path / "e.csv").tolist() == [0, 1, 4]


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (
            "0,000\n0,023\n",
            "or have decimal points instead of commas, got '0,000', which may be one number or two columns",
        ),
        ("t,e\n0,1\n1,\n", "must have numbers in its last column"),
        ("t,e\n0,1.5\n1\n", "must have equally many columns in every row"),
        ("", "must have numbers in its last column, got no rows"),
        ("t,e\n", "must have numbers in its last column, got no rows"),
    ],
)
def test_what_may_be_two_things_is_refused(tmp_path, text, message):
    (tmp_path / "e.csv").write_text(text)
    with pytest.raises(ValueError, match=message):
        read_last_column(tmp_path / "e.csv")
