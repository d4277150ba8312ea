"""MATLAB files of any version, each read by its library in a separate process."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np

from nlfrf._base.files import to_path
from nlfrf._base.own_process import Contents, read_in_own_process
from nlfrf.io.readers import hdf5, matlab_v5

_OBJECTS = "an object that MATLAB's whos lists as timeseries, timetable, table or Dataset"
_CURE = (
    "is a MATLAB object and not read: save it as a matrix, x = [ts.Time ts.Data]; save run.mat x"
)


def contents(path: Path) -> Contents:
    """Read MATLAB v4 to v7 by SciPy, v7.3 as HDF5; objects (time series, tables) are named in the
    notes, not read.
    """
    found = read_in_own_process(str((hdf5 if is_version_73(path) else matlab_v5).__file__), path)
    arrays, units, clocks, notes = found
    has_objects = any(name == "#subsystem#" for name in notes)
    named = {name: _CURE for name in notes if not name.startswith("#")}
    return arrays, units, clocks, named or ({_OBJECTS: _CURE} if has_objects else {})


def read_mat(path: str | os.PathLike[str]) -> dict[str, np.ndarray]:
    """Read the variables of a MATLAB file, without axes of length one.

    Use this for models and settings. For measured signals use `load_record`.

    Parameters
    ----------
    path : path
        A ``.mat`` file of version 4 to 7.

    Returns
    -------
    dict of str to ndarray
        Numbers and texts by name; a field of a struct has the name ``struct.field``.

    Raises
    ------
    ValueError
        The file cannot be read, or has version 7.3, which this function does not read.
    FileNotFoundError
        No such file.

    References
    ----------
    The MathWorks, *MAT-File Format*: levels 4 and 5.

    Examples
    --------
    >>> import tempfile
    >>> from scipy.io import savemat
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     savemat(f"{folder}/K.mat", {"K": {"D": [[2.0]], "Ts": 1e-3}})
    ...     {name: float(array) for name, array in read_mat(f"{folder}/K.mat").items()}
    {'K.D': 2.0, 'K.Ts': 0.001}
    """
    path = to_path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path must be an existing file, got {str(path)!r}")
    if is_version_73(path):
        raise ValueError(
            f"path must be a .mat file up to version 7, got {path.name!r} of 7.3: save it with"
            " '-v7'"
        )
    try:
        return contents(path)[0]
    except Exception as error:  # readers of damaged files raise nearly anything
        raise ValueError(
            f"path must be a readable .mat file, got {path.name!r}: {str(error)[:160]}"
        ) from None


def is_version_73(path: Path) -> bool:
    """Return whether a file is HDF5, in which MATLAB stores its matrices transposed."""
    with path.open("rb") as stream:
        head = stream.read(128)
    return (
        b"MATLAB 7.3" in head[:32]
        or head[:4] == b"\x89HDF"
        or head[124:128] in (b"\0\2IM", b"\2\0MI")
    )
