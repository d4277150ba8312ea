"""LabVIEW measurement files (.lvm): a text table with a header that gives units and the clock."""

from __future__ import annotations

from pathlib import Path

from nlfrf._base.own_process import Contents
from nlfrf.io.readers.layout import decode_text
from nlfrf.io.readers.tables import read_table

__all__ = ["contents"]


END_OF_HEADER = "***End_of_Header***"


def contents(path: Path) -> Contents:
    """Read columns by name, with the units and the clocks of the header, which are labelled rows above a table."""
    content = path.read_bytes()
    text = decode_text(content).replace("\r\n", "\n")
    n_headers = text.count(END_OF_HEADER)
    if n_headers > 2:
        raise ValueError(f"it holds {n_headers - 1} measurements, one behind the other; save each in a file of its own")
    arrays, units, clocks, notes = read_table(text.replace(END_OF_HEADER, "").encode() if n_headers else content)
    return arrays, units | {"Delta_X": "s"} if "Delta_X" in arrays else units, clocks, notes
