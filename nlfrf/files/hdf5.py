"""HDF5 files, read in a process of their own.

The HDF5 library can hang, run out of memory or crash on a damaged file, and nothing in Python can stop it. So the file
is read by a child with a time and a memory limit, which hands the arrays over as NPZ; what happens to it there ends as
one clear error here.
"""

from __future__ import annotations

import io
import subprocess
import sys
from pathlib import Path

import numpy as np

__all__ = ["read_hdf5"]


SECONDS, PER_BYTE = 10.0, 1e-7  # time allowed: a start, and a slow disk
MEMORY, FACTOR = 4 << 30, 20  # bytes allowed: a base, and so many times the size of the file


def read_hdf5(path: Path) -> dict[str, np.ndarray]:
    """Every numeric dataset of an HDF5 file, groups joined by dots, and the texts among its attributes.

    Raises
    ------
    ValueError
        A file that the HDF5 library cannot read, or not within its limits.
    """
    limit = SECONDS + PER_BYTE * path.stat().st_size
    command = [sys.executable, "-I", __file__, str(path)]  # this file alone: the child needs no more of the package
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"the HDF5 library did not come to an end within {limit:.0f} s") from None
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        raise ValueError(said[-1] if said else f"the HDF5 library crashed, exit code {done.returncode}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def child() -> None:
    """Read the file named by the first argument, and write its arrays to standard output."""
    path = Path(sys.argv[1])
    try:
        import resource

        limit = MEMORY + FACTOR * path.stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (ImportError, ValueError, OSError):
        pass  # no such limit on this system
    arrays = datasets(path)
    stream = io.BytesIO()
    np.savez(stream, **arrays)  # type: ignore[arg-type]
    sys.stdout.buffer.write(stream.getbuffer())


def datasets(path: Path) -> dict[str, np.ndarray]:
    """The arrays and texts of an HDF5 file."""
    import h5py

    arrays: dict[str, np.ndarray] = {}

    def add(name: str, node: object) -> None:
        if isinstance(node, h5py.Dataset) and node.dtype.kind in "fiubc" and not name.startswith("#"):
            arrays[name.replace("/", ".")] = np.asarray(node[()])

    with h5py.File(path, "r") as file:
        file.visititems(add)
        for name, content in file.attrs.items():
            if isinstance(content, str):
                arrays[name] = np.array(content)
    return arrays


if __name__ == "__main__":
    child()
