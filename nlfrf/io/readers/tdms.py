"""TDMS files of LabVIEW and similar programs, by npTDMS."""

from __future__ import annotations

import logging
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np

if TYPE_CHECKING:
    from nlfrf._base.own_process import Contents

_EPOCH = np.datetime64("1904-01-01", "us")  # start of a waveform without a stated one


def contents(path: Path) -> Contents:
    """Read channels as ``group.channel``, with their units and the step of their waveforms.

    This module is loaded by its path in its own process, so it imports nothing from this package.
    The file is passed open, because with a path npTDMS would trust an index file next to it.
    """
    from nptdms import TdmsFile

    found: Contents = ({}, {}, {}, {})
    arrays, units, clocks, notes = found
    began: dict[str, np.datetime64] = {}
    logging.getLogger("nptdms").setLevel(
        logging.ERROR
    )  # unreadable parts are refused here, not printed
    with path.open("rb") as stream:
        file = TdmsFile.read(stream)
    for group in file.groups():
        for channel in group.channels():
            name, array = f"{group.name}.{channel.name}", np.asarray(channel[:])
            if array.dtype.kind == "M":
                array = (array - array[:1]) / np.timedelta64(1, "s")
                units[name] = "s"
            if array.dtype.kind not in "fiub":
                notes[name] = "holds no numbers"
                continue
            arrays[name] = array
            stated = channel.properties.get("unit_string") or channel.properties.get(
                "NI_UnitDescription"
            )
            units[name] = str(stated or units.get(name, ""))
            step = channel.properties.get("wf_increment", 0.0)
            if (
                isinstance(step, float)
                and step > 0
                and channel.properties.get("wf_xname", "Time") in ("Time", "")
            ):
                clocks[name] = 1 / step
                arrays[f"{name}.start"] = np.array(
                    float(channel.properties.get("wf_start_offset") or 0.0)
                )
                units[f"{name}.start"] = str(channel.properties.get("wf_xunit_string") or "s")
                began[f"{name}.moment"] = np.datetime64(
                    channel.properties.get("wf_start_time", _EPOCH), "us"
                )
    last = max(began.values(), default=_EPOCH)
    arrays |= {
        key: np.array((moment - last) / np.timedelta64(1, "s")) for key, moment in began.items()
    }
    return found
