"""A file read in a process of its own, with a time and a memory limit.

Libraries in C can hang, run out of memory or crash on a damaged file, and nothing in Python can stop them. So such a
file is read by a child, which hands the arrays over as NPZ; whatever happens to it there ends as one clear error here.
"""

from __future__ import annotations

import io
import json
import os
import subprocess
import sys
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Found", "read_apart"]


SECONDS, PER_BYTE = 20.0, 1e-7  # time allowed: a start, and a slow disk
MEMORY, FACTOR = 4 << 30, 20  # bytes allowed: a base, and so many times the size of the file
#: What a file holds, by name: arrays, units, clocks (a frequency [Hz] or the name of a time channel; "" is for all
#: channels), and why something in it is no signal.
Found = tuple[dict[str, np.ndarray], dict[str, str], dict[str, Any], dict[str, str]]


def read_apart(room: str, path: Path) -> Found:
    """What the function ``contents`` of a room, given by its file, finds in a file.

    The room is loaded by its path alone, so it may import nothing of this package.

    Raises
    ------
    ValueError
        A file that cannot be read, or not within the limits; what the library said, or that it crashed.
    """
    limit = SECONDS + PER_BYTE * path.stat().st_size
    command = [sys.executable, "-I", __file__, room, str(path)]
    try:
        done = subprocess.run(command, capture_output=True, timeout=limit, check=False)
    except subprocess.TimeoutExpired:
        raise ValueError(f"its library did not come to an end within {limit:g} s") from None
    if done.returncode != 0:
        said = done.stderr.decode(errors="replace").strip().splitlines()
        if said and said[-1].startswith("ModuleNotFoundError"):
            raise ModuleNotFoundError(said[-1], name=said[-1].split("'")[1])
        raise ValueError(said[-1] if said else f"its library crashed, exit code {done.returncode}")
    with np.load(io.BytesIO(done.stdout), allow_pickle=False) as archive:
        names, *rest = json.loads(str(archive["about"]))
        units, clocks, notes = rest
        return {name: archive[f"a{i}"] for i, name in enumerate(names)}, units, clocks, notes


def child(room: str, path: Path) -> None:
    """Read a file, and write what it holds to standard output."""
    try:
        import resource

        limit = MEMORY + FACTOR * path.stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
    except (ImportError, ValueError, OSError):
        pass  # no such limit on this system
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what a library prints is no part of the answer
        answer.write(packed(room, path))


def packed(room: str, path: Path) -> memoryview:
    """What a room finds in a file, as the bytes of an NPZ file."""
    spec = spec_from_file_location("room", room)
    assert spec is not None
    assert spec.loader is not None
    module = module_from_spec(spec)
    spec.loader.exec_module(module)
    arrays, units, clocks, notes = module.contents(path)
    stream = io.BytesIO()
    about: Any = json.dumps([list(arrays), units, clocks, notes])
    np.savez(stream, about=about, **{f"a{i}": array for i, array in enumerate(arrays.values())})
    return stream.getbuffer()


if __name__ == "__main__":
    child(sys.argv[1], Path(sys.argv[2]))
