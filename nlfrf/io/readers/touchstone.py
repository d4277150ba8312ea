"""Touchstone files (.s1p to .s4p): the S-parameters of an analyser, by scikit-rf."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents


def contents(path: Path) -> Contents:
    """Read S11, S21, ... as in the file, each with its frequencies [Hz].

    This module is loaded by its path in its own process, so it imports nothing from this package.
    """
    from skrf.io.touchstone import Touchstone

    text = io.StringIO(
        re.sub(r"(?m)^\s*#(.*)$", _sort_options, path.read_text(encoding="latin-1"), count=1)
    )
    text.name = str(path)  # the name gives the number of ports
    file = Touchstone(text)
    if (
        file.parameter.upper() != "S"
    ):  # scikit-rf converts others to S, and reads Y by the reference of Z
        raise ValueError(
            f"it holds {file.parameter.upper()}-parameters: export S-parameters, or a table of the"
            " ratio"
        )
    f, S = file.get_sparameter_arrays()
    ports = range(1, S.shape[1] + 1)
    arrays = {f"S{i}{j}": S[:, i - 1, j - 1] for i in ports for j in ports}
    frequencies = {f"{name}.frequency": f for name in arrays}
    return arrays | frequencies, dict.fromkeys(frequencies, "Hz"), {}, {}


def _sort_options(found: re.Match[str]) -> str:
    """Return the line of options in the order of scikit-rf; the format allows any order, and
    missing options.

    >>> _sort_options(re.match("#(.*)", "# R 75 RI MHz"))
    '# MHz S RI R 75'
    """
    options = re.sub("!.*", "", found[1])
    kinds = {"[kMG]?Hz": "GHz", "[SYZGH]": "S", "DB|MA|RI": "MA", r"R\s+\S+": "R 50"}
    return " ".join(
        [
            "#",
            *(
                (re.findall(rf"(?i)\b(?:{kind})(?!\S)", options) or [default])[0]
                for kind, default in kinds.items()
            ),
        ]
    )
