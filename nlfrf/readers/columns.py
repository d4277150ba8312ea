"""Columns of Parquet and Feather (Arrow) files, by pyarrow."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["contents"]


def contents(path: Path) -> tuple[dict[str, np.ndarray], dict[str, str], dict[str, Any], dict[str, str]]:
    """Columns of numbers by name; moments as seconds since the first; missing numbers are nan.

    This room is loaded by its path in a process of its own, so it imports nothing of this package.
    """
    import pyarrow.types as kinds
    from pyarrow import feather, float64, int64, parquet

    table = parquet.read_table(path) if path.suffix.lower() == ".parquet" else feather.read_table(path)
    arrays: dict[str, np.ndarray] = {}
    units: dict[str, str] = {}
    notes: dict[str, str] = {}
    for name, column in zip(table.column_names, table.columns, strict=True):
        kind = column.type
        if kinds.is_timestamp(kind) or kinds.is_duration(kind):
            ticks = column.cast(int64()).to_numpy()
            arrays[name] = (ticks - ticks[:1]) * {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}[kind.unit]
            units[name] = "s"
            continue
        if not (kinds.is_integer(kind) or kinds.is_floating(kind) or kinds.is_boolean(kind) or kinds.is_decimal(kind)):
            notes[name] = "holds no numbers"
            continue
        if column.null_count or kinds.is_boolean(kind) or kinds.is_decimal(kind):
            column = column.cast(float64())
        arrays[name] = column.to_numpy()
        about = table.schema.field(name).metadata or {}
        unit = next((about[key].decode() for key in (b"unit", b"units") if key in about), "")
        if unit:
            units[name] = unit
    return arrays, units, {}, notes
