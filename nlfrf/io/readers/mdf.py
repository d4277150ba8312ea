"""MDF measurement files of cars and test benches (.mf4, .mdf, older ones .dat), by asammdf."""

from __future__ import annotations

from collections import Counter
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents


def contents(path: Path) -> Contents:
    """Read channels by name (``group.name`` if several groups have it), each with the times of its
    group.

    This module is loaded by its path in its own process, so it imports nothing from this package.
    An MDF file can name other files as attachments, which asammdf opens for some channels: none is
    opened here.
    """
    from asammdf import MDF
    from asammdf.blocks.mdf_v4 import MDF4

    MDF4._extract_attachment = lambda *_, **__: (
        b"",
        Path(),
        b"",
    )  # an empty attachment for every channel

    found: Contents = ({}, {}, {}, {})
    arrays, units, clocks, notes = found
    # frames of a bus stay raw: asammdf would search the attachments for the database to decode them
    with MDF(str(path), process_bus_logging=False) as file:
        masters = dict(file.masters_db)  # by group, the channel with its times
        listed = [
            (g, i, str(channel.name))
            for g, group in enumerate(file.groups)
            for i, channel in enumerate(group.channels)
            if masters.get(g) != i
        ]
        often = Counter(name for _, _, name in listed)
        for g, i, name in listed:
            signal = file.get(group=g, index=i)
            samples = np.asarray(signal.samples)
            if often[name] == 1:
                unique = name
            else:
                unique = f"group{g}.{name}"
            if samples.dtype.kind not in "fiub" or samples.ndim != 1:
                notes[unique] = "holds no numbers"
                continue
            # a channel can have the name of the time axis
            if len(file.groups) == 1 and "time" not in often:
                times = "time"
            else:
                times = f"group{g}.time"
            arrays.setdefault(times, np.asarray(signal.timestamps, dtype=float))
            units.setdefault(times, "s")
            arrays[unique], clocks[unique] = samples, times
            units[unique] = str(signal.unit or "")
    return found
