"""A file read in its own process, with limits for time and memory; and the size limit for the
content of any file.

Libraries in C can hang, run out of memory or crash on a damaged file, and nothing in Python can
stop them. So a child process reads such a file, and sends the arrays through a pipe in blocks:
neither process ever holds an array twice. Any failure of the child ends as one clear error here.

Compressed files, and wrong headers, can demand any amount of memory. `require_size` limits it for
every reader. It is called with the sizes in the headers, before anything is unpacked. The child
sends a line of JSON, and then the arrays:

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

SECONDS, _PER_BYTE = 20.0, 1e-7  # [s] time limit: a base, and a slow disk
#: Limit of the bytes of unpacked arrays: a base, and a multiple of the size of the file. Noise with
#: 16 bits compresses 4 times as float64, a CSV with one digit per cell takes 4 times its size;
#: constants have the base.
UNPACKED, FACTOR = 1 << 30, 20
MEMORY_LIMIT = 4 << 30  # bytes of address space of a child, instead of UNPACKED, libraries included
_BLOCK_BYTES = 1 << 20  # bytes sent at a time
#: Content of a file, by name: arrays, units, clocks (a frequency [Hz] or the name of a time
#: channel; "" is for all channels), and reasons why an entry is no signal.
Contents = tuple[dict[str, np.ndarray], dict[str, str], dict[str, float | str], dict[str, str]]


def read_in_own_process(reader_file: str, path: Path) -> Contents:
    """Return the result of ``contents`` of a module, given by its file, for a file.

    The module is loaded by its path, so it must not import anything from this package.

    Raises
    ------
    ValueError
        The file cannot be read within the limits; the message is that of the library, or that it
        crashed.
    """
    limit = SECONDS + _PER_BYTE * path.stat().st_size
    command = [sys.executable, "-I", __file__, reader_file, str(path)]
    late = threading.Event()
    with (
        tempfile.TemporaryFile() as errors,
        subprocess.Popen(command, stdout=subprocess.PIPE, stderr=errors) as reader,
    ):

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
                reader.kill()  # a child that waits for its reader would block
            code = reader.wait()
            clock.cancel()
        errors.seek(0)
        message_lines = errors.read().decode(errors="replace").strip().splitlines()
    if late.is_set():
        raise ValueError(f"its library did not finish within {limit:g} s")
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
    """Refuse arrays with more bytes than a file of this size may unpack to.

    >>> require_size(10**9, 1000)
    >>> require_size(3 * 10**9, 2_900_000)
    Traceback (most recent call last):
        ...
    ValueError: it unpacks to 3 GB, but a file of 0.0029 GB may unpack to 1.13 GB: 1 GiB and 20 times its size
    """
    limit = UNPACKED + FACTOR * file_size
    if wanted > limit:
        raise ValueError(
            f"it unpacks to {wanted / 1e9:.3g} GB, but a file of {file_size / 1e9:.2g} GB may"
            f" unpack to {limit / 1e9:.3g} GB: {UNPACKED >> 30} GiB and {FACTOR} times its size"
        )


def receive(stream: IO[bytes], file_size: int) -> Contents | None:
    """Return the content that `send` wrote for a file of this size; None if it is incomplete."""
    head = stream.readline()
    if not head.endswith(b"\n"):
        return None
    about = json.loads(head)
    kinds = [(name, np.dtype(kind), tuple(shape)) for name, kind, shape in about["arrays"]]
    require_size(
        sum(kind.itemsize * int(np.prod(shape, dtype=object)) for _, kind, shape in kinds),
        file_size,
    )
    arrays = {}
    for name, kind, shape in kinds:
        arrays[name] = np.empty(shape, kind)
        left: memoryview | bytes = (
            arrays[name].reshape(-1).view(np.uint8).data if arrays[name].nbytes else b""
        )
        while left:
            n = stream.readinto(left)  # type: ignore[attr-defined]
            if not n:
                return None
            left = left[n:]
    return arrays, about["units"], about["clocks"], about["notes"]


def send(found: Contents, stream: IO[bytes]) -> None:
    """Send the content found by a module, in blocks.

    An array may be any object with a shape and a type that returns arrays for slices of its first
    axis, so that a module need not read it whole. Its ``rows``, if it has any, are the number of
    rows that are best read together.
    """
    arrays, *rest = found
    kinds = [[name, np.dtype(array.dtype).str, list(array.shape)] for name, array in arrays.items()]
    about = {"arrays": kinds} | dict(zip(("units", "clocks", "notes"), rest, strict=True))
    stream.write(json.dumps(about).encode() + b"\n")
    for name in list(arrays):
        array = arrays.pop(name)  # released as soon as it is sent
        if array.dtype.hasobject:
            raise ValueError(f"{name!r} holds objects")
        if not array.shape:
            stream.write(np.asarray(array[()]).tobytes())
            continue
        together = getattr(array, "rows", 1)
        row = max(1, array.dtype.itemsize * int(np.prod(array.shape[1:])))
        step = together * max(1, _BLOCK_BYTES // (row * together))
        for first in range(0, array.shape[0], step):
            stream.write(np.ascontiguousarray(array[first : first + step]).view(np.uint8).data)


def _run_child(reader_file: str, path: Path) -> None:
    """Read a file, and send its content to standard output."""
    try:
        import resource

        most = MEMORY_LIMIT + FACTOR * path.stat().st_size
        resource.setrlimit(resource.RLIMIT_AS, (most, most))
    except (ImportError, ValueError, OSError):
        pass  # this system has no such limit
    with os.fdopen(os.dup(1), "wb") as answer:
        os.dup2(2, 1)  # text printed by a library must not mix with the arrays
        spec = spec_from_file_location("room", reader_file)
        assert spec is not None
        assert spec.loader is not None
        module = module_from_spec(spec)
        spec.loader.exec_module(module)
        send(module.contents(path), answer)


if __name__ == "__main__":
    _run_child(sys.argv[1], Path(sys.argv[2]))
    os._exit(0)  # all is sent: the cleanup of the libraries takes as long as a small file
