"""Columns of Parquet and Feather (Arrow) files, by pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents


def contents(path: Path) -> Contents:
    """Read columns of numbers by name; times as seconds since the first; missing numbers are nan.

    This module is loaded by its path in its own process, so it imports nothing from this package.
    """
    import pyarrow.types as kinds
    from pyarrow import feather, float64, int64, parquet

    # as a single file: a set of files needs different names of columns
    if path.suffix.lower() == ".parquet":
        table = parquet.ParquetFile(path).read()
    else:
        table = feather.read_table(path)
    found: Contents = ({}, {}, {}, {})
    arrays, units, clocks, notes = found
    for i, (column, about) in enumerate(zip(table.columns, table.schema, strict=True)):
        kind = column.type
        if about.name not in {*arrays, *notes}:
            name = about.name
        else:
            name = f"{about.name}.{i + 1}"
        if kinds.is_timestamp(kind) or kinds.is_duration(kind):
            ticks = column.cast(int64()).to_numpy()
            arrays[name] = (ticks - ticks[:1]) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[
                kind.unit
            ]
            units[name] = "s"
            clocks.setdefault("", name)  # a time by its type, whatever its name
            continue
        if not (
            kinds.is_integer(kind)
            or kinds.is_floating(kind)
            or kinds.is_boolean(kind)
            or kinds.is_decimal(kind)
        ):
            notes[name] = "holds no numbers"
            continue
        if column.null_count or kinds.is_boolean(kind) or kinds.is_decimal(kind):
            column = column.cast(float64())
        arrays[name] = column.to_numpy()
        metadata = about.metadata or {}
        units[name] = next(
            (metadata[key].decode() for key in (b"unit", b"units") if key in metadata), ""
        )
    return found
