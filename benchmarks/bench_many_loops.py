"""Ten thousand controllers on the nonlinear rig: seconds of CPU, what more processes give, a run
killed and resumed.

python -m benchmarks.bench_many_loops [number of controllers]
"""

import os
import subprocess
import sys
import tempfile
import time
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context

import numpy as np

from benchmarks.machine import main as machine
from benchmarks.timing import of_children
from nlfrf import paper_rig
from nlfrf.rig import run_loops
from robust.shaping import pid

FS, SECONDS = 1000, 2


def arguments(n):
    """n PI controllers, from timid to too bold, each after a kick of its own."""
    rng = np.random.default_rng(1)
    gains = rng.uniform([5.0, 10.0], [80.0, 600.0], (n, 2))
    return {
        "rig": paper_rig(),
        "controllers": [pid(kp, ki, dt=1 / FS) for kp, ki in gains],
        "r": np.full(SECONDS * FS, 1e-3),
        "initial": np.column_stack([np.zeros(n), rng.uniform(-0.05, 0.05, n)]),
        "of": swing,
    }


def swing(response):
    """How far the position goes in the last tenth [m]."""
    tail = response.x[-response.x.size // 10 :]
    return float(tail.max() - tail.min())


def killed(n, folder):
    """Run in a process of its own that is killed half way."""
    code = (
        "import os, signal, sys; from benchmarks.bench_many_loops import arguments; from nlfrf.rig"
        " import run_loops\nstop = lambda done, total: os.kill(os.getpid(), signal.SIGKILL) if"
        f" done >= total // 2 else None\nrun_loops(**arguments({n}), resume={folder!r},"
        " progress=stop)"
    )
    return subprocess.run([sys.executable, "-c", code], check=False).returncode


def main():
    """Everything."""
    machine()
    n = int(sys.argv[1]) if len(sys.argv) > 1 else 10_000
    given = arguments(n)
    run_loops(**arguments(2))  # compiled, or loaded
    cpu, wall = time.process_time(), time.perf_counter()
    here = run_loops(**given)
    cpu, wall = time.process_time() - cpu, time.perf_counter() - wall
    print(
        f"{n} controllers, {SECONDS} s at {FS} Hz: {cpu:.1f} s of CPU, {1e3 * cpu / n:.2f} ms a"
        f" run; {wall:.1f} s"
    )
    one = None
    for workers in (1, 2, 4):
        before = of_children()
        with ProcessPoolExecutor(workers, mp_context=get_context("spawn")) as executor:
            run_loops(
                **arguments(2 * 125 * workers), executor=executor
            )  # processes up, code loaded
            begin, asking = time.perf_counter(), time.process_time()
            there = run_loops(**given, executor=executor)
            seconds, asking = time.perf_counter() - begin, time.process_time() - asking
        one = one or seconds
        same = "identical" if there == here else "DIFFERENT"
        print(
            f"  {workers} processes: {seconds:6.1f} s, {one / seconds:.2f} times one"
            f" ({os.cpu_count()} cores); {of_children() - before:.1f} s of CPU, their start"
            f" included, and {1e3 * asking / n:.3f} ms a run of the process that asks; {same}"
        )
    with tempfile.TemporaryDirectory() as folder:
        code = killed(n, folder)
        counts = []
        again = run_loops(**given, resume=folder, progress=lambda *done: counts.append(done))
        same = "identical" if again == here else "DIFFERENT"
        print(
            f"  killed (exit {code}) with {counts[0][0]} of {counts[0][1]} parts done: resumed,"
            f" {same}"
        )


if __name__ == "__main__":
    main()
