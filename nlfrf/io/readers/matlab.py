"""MATLAB files of any version, each read by the library that knows it, in a process of its own."""

from __future__ import annotations

from pathlib import Path

from nlfrf._base.own_process import Contents, read_in_own_process
from nlfrf.io.readers import hdf5, matlab_objects, matlab_v5

INSTALL_HINT = "is a MATLAB object, which mat-io reads: pip install 'nlfrf[mat]'"


def contents(path: Path) -> Contents:
    """Read MATLAB v4 to v7 by SciPy, v7.3 as HDF5; time series, timetables and datasets by mat-io if installed."""
    with path.open("rb") as stream:
        head = stream.read(128)
    newer = b"MATLAB 7.3" in head[:32] or head[:4] == b"\x89HDF" or head[124:128] in (b"\0\2IM", b"\2\0MI")
    found = read_in_own_process(str((hdf5 if newer else matlab_v5).__file__), path)
    objects = {"#subsystem#", "#objects"} & set(found[3])
    found[3].clear()
    if objects:
        try:
            more = read_in_own_process(matlab_objects.__file__, path)
        except ModuleNotFoundError:
            found[3]["what MATLAB's whos calls timeseries, timetable or Dataset"] = INSTALL_HINT
        else:
            found = found[0] | more[0], found[1] | more[1], found[2] | more[2], found[3] | more[3]
    return found
