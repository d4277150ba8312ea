"""LabVIEW measurement files (.lvm): a text table with a header that gives units and the clock."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from nlfrf._base.own_process import Contents
from nlfrf.io.readers.layout import decode_text
from nlfrf.io.readers.tables import read_table

__all__ = ["contents"]


END_OF_HEADER = "***End_of_Header***"


def contents(path: Path) -> Contents:
    """Read columns by name, with the units and the clock of the header; a plain table without such a header."""
    content = path.read_bytes()
    text = decode_text(content).replace("\r\n", "\n")
    if END_OF_HEADER not in text:
        return read_table(content)
    parts = text.split(END_OF_HEADER)
    if len(parts) > 3:
        raise ValueError(
            f"it holds {len(parts) - 2} measurements, one behind the other; save each in a file of its own"
        )
    entries = dict(row for part in parts[:-1] for line in part.split("\n") if (row := parse_header_line(line)))
    head, _, body = parts[-1].lstrip("\t,; ").lstrip("\n").partition("\n")
    separator = "," if entries.get("Separator", ["Tab"])[0] == "Comma" else "\t"
    names = [name for name in head.split(separator) if name not in ("Comment", "")]
    timed = entries.get("X_Columns", ["One"])[0] != "No"
    if not timed and names[0] != "X_Value":
        names = ["X_Value", *names]
    if entries.get("Decimal_Separator", ["."])[0] == "," and separator == "\t":
        body = body.replace(",", ".")
    arrays, _, _, notes = read_table("\n".join([separator.join(names), body]).encode())
    channels = [name for name in arrays if not name.startswith("X_Value")]
    units = dict(zip(channels, entries.get("Y_Unit_Label", []), strict=False))
    steps = [float(one.replace(",", ".")) for one in entries.get("Delta_X", [])]
    if not timed or np.isnan(arrays.get("X_Value", np.zeros(1))).all():
        arrays.pop("X_Value", None)
    clocks: dict[str, float | str] = {name: 1 / step for name, step in zip(channels, steps, strict=False) if step > 0}
    if len(set(steps)) < 2:  # else each channel has its own, whatever the times of the first
        clocks = {"": 1 / steps[0]} if steps and steps[0] > 0 and "X_Value" not in arrays else {}
    return arrays, units, clocks, notes


def parse_header_line(line: str) -> tuple[str, list[str]] | None:
    """Parse a line of a header: its key, and its entries for the channels."""
    key, *rest = line.replace(",", "\t").split("\t") if "\t" not in line else line.split("\t")
    return (key.strip(), [one.strip() for one in rest if one.strip()]) if key.strip() and rest else None
