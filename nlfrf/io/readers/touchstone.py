"""Touchstone files (.s1p to .s4p): the S-parameters of an analyser, by scikit-rf."""

from __future__ import annotations

import io
import re
from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents


def contents(path: Path) -> Contents:
    """Read S11, S21, ... as they stand in the file, each with its frequencies [Hz].

    This module is loaded by its path in a process of its own, so it imports nothing of this package.
    """
    from skrf.io.touchstone import Touchstone

    text = io.StringIO(re.sub(r"(?m)^\s*#(.*)$", _sort_options, path.read_text(encoding="latin-1"), count=1))
    text.name = str(path)  # which says how many ports there are
    file = Touchstone(text)
    if file.parameter.upper() != "S":  # scikit-rf keeps the others as S, and has read Y by the reference of Z
        raise ValueError(f"it holds {file.parameter.upper()}-parameters: export S-parameters, or a table of the ratio")
    f, S = file.get_sparameter_arrays()
    ports = range(1, S.shape[1] + 1)
    arrays = {f"S{i}{j}": S[:, i - 1, j - 1] for i in ports for j in ports}
    frequencies = {f"{name}.frequency": f for name in arrays}
    return arrays | frequencies, dict.fromkeys(frequencies, "Hz"), {}, {}


def _sort_options(found: re.Match[str]) -> str:
    """Return the line of options in the order that scikit-rf takes; the format allows any, and to leave some out.

    >>> _sort_options(re.match("#(.*)", "# R 75 RI MHz"))
    '# MHz S RI R 75'
    """
    options = re.sub("!.*", "", found[1])
    kinds = {"[kMG]?Hz": "GHz", "[SYZGH]": "S", "DB|MA|RI": "MA", r"R\s+\S+": "R 50"}
    return " ".join(
        ["#", *((re.findall(rf"(?i)\b(?:{kind})(?!\S)", options) or [default])[0] for kind, default in kinds.items())]
    )
