"""Load thousands of damaged files of each foreign format, and files made to do harm: only
documented errors, no hang.

python -m benchmarks.fuzz_readers [--files 2000] [--only .tdms]

What is read in a process of its own is read here in forked ones with their libraries loaded before,
which takes a twentieth of the time; what happens to such a process ends in the same way.
"""

from __future__ import annotations

import argparse
import importlib.util
import io
import os
import pickle
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

from nlfrf._base.own_process import FACTOR, MEMORY_LIMIT, receive, send
from nlfrf.io import measurement_files
from nlfrf.io.readers import matlab
from tests.support.hostile_files import FAMILIES, harm_of
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
            # a fork begins with all that its parent holds
            limit = 4 * MEMORY_LIMIT + FACTOR * path.stat().st_size
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
    return receive(told, path.stat().st_size)


def main():
    """Print what happened."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2000)
    parser.add_argument("--only", nargs="*", default=[*WRITERS, *FAMILIES])
    asked = parser.parse_args()
    warnings.simplefilter("ignore")
    harm = 0
    for family in [name for name in asked.only if name in FAMILIES]:
        # a gigabyte each, or a process each
        n = min(asked.files, 5) if "expands" in family else asked.files // 10
        begin, rng, done = time.perf_counter(), np.random.default_rng(2), 0
        with tempfile.TemporaryDirectory() as folder:
            for _ in range(n):
                path = FAMILIES[family](Path(folder), rng)
                wrong = harm_of(path)
                path.unlink()
                done += bool(wrong)
                if wrong:
                    print(f"{family}, {path.name}: {wrong}")
        harm += done
        print(
            f"{family:<14} {n} hostile files: {done} did harm; {time.perf_counter() - begin:.1f} s",
            flush=True,
        )
    measurement_files.read_in_own_process = matlab.read_in_own_process = forked
    for suffix in [name for name in asked.only if name in WRITERS]:
        CRASHED.clear()
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            refused = fuzz(suffix, Path(folder), n=asked.files, seed=1)
        elapsed = time.perf_counter() - begin
        print(
            f"{suffix:<9} {asked.files} damaged files: {refused} refused, {asked.files - refused}"
            f" read, none else; {len(CRASHED)} crashed or hung in their own process;"
            f" {elapsed:.1f} s",
            flush=True,
        )
    sys.exit(harm > 0)


if __name__ == "__main__":
    main()
