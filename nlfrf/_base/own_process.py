"""A file read in a process of its own, with a time and a memory limit; and how large what is read from a file may be.

Libraries in C can hang, run out of memory or crash on a damaged file, and nothing in Python can stop them. So such a
file is read by a child, which hands the arrays over through a pipe, a block at a time: neither of the two ever holds
an array twice. Whatever happens to the child ends as one clear error here.

Compressed files, and headers that lie, can ask for any amount of memory. `require_size` is the one limit of every
reader, in a process of its own or not: it is called with what the headers announce, before anything is unpacked.

    {"arrays": [[name, type, shape], ...], "units": ..., "clocks": ..., "notes": ...}  newline  the arrays, in C order
"""

from __future__ import annotations

import json
import os
import subprocess
import sys
import tempfile
import threading
from importlib.util import module_from_spec, spec_from_file_location
from pathlib import Path
from typing import IO

import numpy as np

SECONDS, _PER_BYTE = 20.0, 1e-7  # time allowed: a start, and a slow disk
#: Bytes that what is read from a file may take: a base, and so many times the size of the file. Noise of 16 bits
#: compresses 4 times as float64, a CSV of one digit a cell takes 4 times its size; constants have the base.
UNPACKED, FACTOR = 1 << 30, 20
MEMORY_LIMIT = (
    4 << 30
)  # bytes of address space that a process of its own may have instead of UNPACKED, with its libraries
BLOCK_BYTES = 1 << 20  # bytes handed over at a time
#: What a file holds, by name: arrays, units, clocks (a frequency [Hz] or the name of a time channel; "" is for all
#: channels), and why something in it is no signal.
Contents = tuple[dict[str, np.ndarray], dict[str, str], dict[str, float | str], dict[str, str]]


def read_in_own_process(reader_file: str, path: Path) -> Contents:
    """Return what the function ``contents`` of a module, given by its file, finds in a file.

    The module is loaded by its path alone, so it may import nothing of this package.

    Raises
    ------
    ValueError
        A file that cannot be read, or not within the limits; what the library said, or that it crashed.
    """
    limit = SECONDS + _PER_BYTE * path.stat().st_size
    command = [sys.executable, "-I", __file__, reader_file, str(path)]
    late = threading.Event()
    with tempfile.TemporaryFile() as errors, subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors) as reader:

        def stop() -> None:
            late.set()
            reader.kill()

        clock = threading.Timer(limit, stop)
        clock.start()
        received = False
        try:
            assert reader.stdout is not None
            found = receive(reader.stdout, path.stat().st_size)
            received = True
        finally:
            if not received:
                reader.kill()  # so that nobody waits for a child that waits for a reader
            code = reader.wait()
            clock.cancel()
        errors.seek(0)
        message_lines = errors.read().decode(errors="replace").strip().splitlines()
    if late.is_set():
        raise ValueError(f"its library did not come to an end within {limit:g} s")
    if code != 0 or found is None:
        if message_lines and message_lines[-1].startswith("ModuleNotFoundError"):
            raise ModuleNotFoundError(message_lines[-1], name=message_lines[-1].split("'")[1])
        raise ValueError(
            message_lines[-1].removeprefix("ValueError: ")
            if message_lines
            else f"its library crashed, exit code {code}"
        )
    return found


def require_size(wanted: int, file_size: int) -> None:
    """Refuse arrays of so many bytes from a file of that size where they are more than any file may unpack to.

    >>> require_size(10**9, 1000)
    >>> require_size(3 * 10**9, 2_900_000)
    Traceback (most recent call last):
        ...
    ValueError: it unpacks to 3 GB, and a file of 0.0029 GB may to 1.13 GB: 1 GiB and 20 times its size
    """
    limit = UNPACKED + FACTOR * file_size
    if wanted > limit:
        raise ValueError(
            f"it unpacks to {wanted / 1e9:.3g} GB, and a file of {file_size / 1e9:.2g} GB may to {limit / 1e9:.3g} GB: "
            f"{UNPACKED >> 30} GiB and {FACTOR} times its size"
        )


def receive(stream: IO[bytes], file_size: int) -> Contents | None:
    """Return what `send` wrote of a file of that size; None where it ends before it is whole."""
    head = stream.readline()
    if not head.endswith(b"\n"):
        return None
    about = json.loads(head)
    kinds = [(name, np.dtype(kind), tuple(shape)) for name, kind, shape in about["arrays"]]
    require_size(sum(kind.itemsize * int(np.prod(shape, dtype=object)) for _, kind, shape in kinds), file_size)
    arrays = {}
    for name, kind, shape in kinds:
        arrays[name] = np.empty(shape, kind)
        left: memoryview | bytes = arrays[name].reshape(-1).view(np.uint8).data if arrays[name].nbytes else b""
        while left:
            n = stream.readinto(left)  # type: ignore[attr-defined]
            if not n:
                return None
            left = left[n:]
    return arrays, about["units"], about["clocks"], about["notes"]


def send(found: Contents, stream: IO[bytes]) -> None:
    """Hand over what a module found, a block at a time.

    An array may be anything with a shape and a type that gives arrays when it is cut along its first axis, so that a
    module need not read it whole; its ``rows``, where it has any, are how many are best read together.
    """
    arrays, *rest = found
    kinds = [[name, np.dtype(array.dtype).str, list(array.shape)] for name, array in arrays.items()]
    about = {"arrays": kinds} | dict(zip(("units", "clocks", "notes"), rest, strict=True))
    stream.write(json.dumps(about).encode() + b"\n")
    for name in list(arrays):
        array = arrays.pop(name)  # what is handed over need not be kept
        if array.dtype.hasobject:
            raise ValueError(f"{name!r} holds objects")
        if not array.shape:
            stream.write(np.asarray(array[()]).tobytes())
            continue
        together = getattr(array, "rows", 1)
        row = max(1, array.dtype.itemsize * int(np.prod(array.shape[1:])))
        step = together * max(1, BLOCK_BYTES // (row * together))
        for first in range(0, array.shape[0], step):
            stream.write(np.ascontiguousarray(array[first : first + step]).view(np.uint8).data)


def run_child(reader_file: str, path: Path) -> None:
    """Read a file, and write what it holds to standard output."""
    try:
        import resource

        most = MEMORY_LIMIT + FACTOR * path.stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    except (ImportError, ValueError, OSError):
        pass  # no such limit on this system
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # what a library prints is no part of the answer
        spec = spec_from_file_location("room", reader_file)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        send(module.contents(path), answer)


if __name__ == "__main__":
    run_child(sys.argv[1], Path(sys.argv[2]))
    os._exit(0)  # it is all handed over: what the libraries clear up at their end takes as long as a small file
