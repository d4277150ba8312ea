"""Load thousands of damaged files of each foreign format: only documented errors, no hang.

python -m benchmarks.fuzz_readers [--files 2000] [--only .tdms]

What is read in a process of its own is read here in forked ones with their libraries loaded before, which takes a
twentieth of the time; what happens to such a process ends in the same way.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import os
import pickle
import tempfile
import time
import warnings
from pathlib import Path

from nlfrf.files import channels
from nlfrf.readers import matlab
from nlfrf.shared.own_process import FACTOR, MEMORY, most, receive, send
from tests.support.measurement_files import WRITERS, fuzz

SECONDS = 20.0
ROOMS: dict = {}
CRASHED: list = []


def forked(room, path):
    """What `read_apart` does, by a fork."""
    import resource
    import select
    import signal

    if room not in ROOMS:
        spec = importlib.util.spec_from_file_location("room", room)
        ROOMS[room] = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(ROOMS[room])
    out, into = os.pipe()
    child = os.fork()
    if child == 0:
        try:
            os.close(out)
            limit = 4 * MEMORY + FACTOR * path.stat().st_size  # a fork begins with all that its parent holds
            resource.setrlimit(resource.RLIMIT_AS, (limit, limit))
            try:
                answer = ("found", io.BytesIO())
                send(ROOMS[room].contents(path), answer[1])
            except BaseException as error:
                answer = ("error", f"{type(error).__name__}: {error}")
            with os.fdopen(into, "wb") as stream:
                pickle.dump(answer, stream)
        finally:
            os._exit(0)
    os.close(into)
    content, end = b"", time.perf_counter() + SECONDS
    with os.fdopen(out, "rb", buffering=0) as stream:
        while True:
            ready, _, _ = select.select([stream], [], [], max(end - time.perf_counter(), 0))
            if not ready:
                os.kill(child, signal.SIGKILL)
                CRASHED.append("hung")
                break
            more = stream.read(1 << 16)
            if not more:
                break
            content += more
    _, status = os.waitpid(child, 0)
    if status:
        CRASHED.append(status)
        raise ValueError(f"its library crashed, exit code {status}")
    kind, told = pickle.loads(content)
    if kind == "error":
        raise ValueError(told)
    told.seek(0)
    return receive(told, most(path))


def main():
    """Print what happened."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--only", nargs="*", default=list(WRITERS))
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    channels.read_apart = matlab.read_apart = forked
    for suffix in asked.only:
        CRASHED.clear()
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            refused = fuzz(suffix, Path(folder), n=asked.files, seed=1)
        elapsed = time.perf_counter() - begin
        print(
            f"{suffix:<9} {asked.files} damaged files: {refused} refused, {asked.files - refused} read, none else; "
            f"{len(CRASHED)} crashed or hung in their own process; {elapsed:.1f} s",
            flush=True,
        )


if __name__ == "__main__":
    main()
