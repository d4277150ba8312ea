"""Arrays of NumPy (.npy): one array, or a table with named columns."""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from nlfrf._base.own_process import Contents, require_size


def contents(path: Path) -> Contents:
    """Read an array as "data" with columns "data.1", "data.2"; a structured array by the names of
    its fields.
    """
    with path.open("rb") as stream:
        version = npy.read_magic(stream)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, kind = read(stream)
        held = path.stat().st_size - stream.tell()
    if kind.hasobject:
        raise ValueError("it holds Python objects, and pickles are never read")
    wanted = kind.itemsize * int(np.prod(shape, dtype=object))
    require_size(wanted, path.stat().st_size)
    if wanted > held:
        raise ValueError(f"its header announces {wanted} bytes, and it has {held}")
    array = np.load(path, allow_pickle=False)
    if array.dtype.names is None:
        return {"data": array}, {}, {}, {}
    return {name: np.ascontiguousarray(array[name]) for name in array.dtype.names}, {}, {}, {}
