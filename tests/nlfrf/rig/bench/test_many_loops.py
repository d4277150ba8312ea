"""Many loops: the same whoever computes them, kept as they are done, resumed after a kill, and not
for other code.
"""

import os
import pickle
import subprocess
import sys
from concurrent.futures import Executor, Future, ProcessPoolExecutor
from multiprocessing import get_context
from types import SimpleNamespace

import numpy as np
import pytest

import robust
from nlfrf import paper_rig
from nlfrf.rig import run_loops

FS, N = 1000, 300


def arguments(n=1000):
    """n controllers and kicks; 833 runs make a part."""
    rng = np.random.default_rng(3)
    gains = rng.uniform([5.0, 10.0], [60.0, 300.0], (n, 2))
    return {
        "rig": paper_rig(),
        "controllers": [robust.shaping.pid(kp, ki, dt=1 / FS) for kp, ki in gains],
        "r": np.full(N, 1e-3),
        "initial": np.column_stack([np.zeros(n), rng.uniform(-0.02, 0.02, n)]),
    }


@pytest.fixture(scope="module")
def here():
    return run_loops(**arguments())


def same(these, those):
    return len(these) == len(those) and all(
        np.array_equal(a.x, b.x) and np.array_equal(a.u, b.u)
        for a, b in zip(these, those, strict=True)
    )


def test_processes_give_the_same_as_threads(here):
    with ProcessPoolExecutor(1, mp_context=get_context("spawn")) as executor:
        assert same(run_loops(**arguments(), executor=executor), here)


def test_a_cluster_of_dask_gives_the_same(here):
    distributed = pytest.importorskip("distributed")
    with (
        distributed.LocalCluster(
            n_workers=1, threads_per_worker=2, processes=False, dashboard_address=None
        ) as cluster,
        distributed.Client(cluster) as client,
    ):
        assert same(run_loops(**arguments(), executor=client.get_executor()), here)


def test_what_is_wanted_of_a_run_is_all_that_is_kept(here):
    last = run_loops(**arguments(), of=lambda response: float(response.x[-1]))
    assert last == [response.x[-1] for response in here]


def last(response):
    """Where the position ends [m]."""
    return float(response.x[-1])


class Small(Exception):
    """Of the user's own."""


def refusing(response):
    if response.x[-1] > 0:
        raise Small("nothing")
    return 0.0


def process(_):
    """The process that looks at a run."""
    return os.getpid()


@pytest.mark.attack
def test_what_is_wanted_is_found_in_the_worker(here):
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert run_loops(**arguments(), executor=executor, of=last) == [
            last(response) for response in here
        ]
        assert os.getpid() not in run_loops(**arguments(5), executor=executor, of=process)
        with pytest.raises(Small, match="nothing"):
            run_loops(**arguments(5), executor=executor, of=refusing)


@pytest.mark.attack
def test_a_lambda_and_what_a_folder_keeps_are_looked_at_here(here, tmp_path):
    wanted = [last(response) for response in here]
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert (
            run_loops(**arguments(), executor=executor, of=lambda response: float(response.x[-1]))
            == wanted
        )
        assert run_loops(**arguments(), executor=executor, of=last, resume=tmp_path) == wanted
    kept = []  # whatever is wanted of them, the runs are there
    assert same(
        run_loops(**arguments(), resume=tmp_path, progress=lambda *done: kept.append(done)), here
    )
    assert kept == [(2, 2)]


class Worker(Executor):
    """A worker in this process: it keeps the size of what is sent, and shows when it works."""

    def __init__(self):
        self.sizes, self.working = [], False

    def submit(self, task, /, *given):
        found = Future()
        self.sizes.append(len(pickle.dumps((task, given))))
        self.working = True
        found.set_result(task(*pickle.loads(pickle.dumps(given))))
        self.working = False
        return found


def test_a_function_goes_to_the_worker_where_it_can_be_found_there(monkeypatch):
    worker = Worker()

    def swing(response):
        return worker.working

    def looked_at_there(of):
        return set(run_loops(**arguments(2), executor=worker, of=of))

    assert looked_at_there(lambda response: worker.working) == {False}
    # what a notebook defines
    monkeypatch.setattr(swing, "__module__", "__main__", raising=False)
    monkeypatch.setattr(swing, "__qualname__", "swing")
    notebook = SimpleNamespace(swing=swing)
    monkeypatch.setitem(sys.modules, "__main__", notebook)
    assert looked_at_there(swing) == {False}
    notebook.__file__ = "study.py"
    assert looked_at_there(swing) == {True}


def test_what_all_runs_share_travels_once():
    once, fifty = Worker(), Worker()
    given = arguments(50) | {"r": np.ones(1000)}
    shared = run_loops(**given, executor=once)
    each = run_loops(**given | {"r": np.ones((50, 1000))}, executor=fifty)
    assert sum(once.sizes) < sum(fifty.sizes) - 49 * 8000
    assert same(shared, each)


KILLED = """
import os, signal, sys
from tests.nlfrf.rig.bench.test_many_loops import arguments
from nlfrf.rig import run_loops

run_loops(**arguments(), resume=sys.argv[1], progress=lambda done, total: os.kill(os.getpid(), signal.SIGKILL))
"""


def test_a_killed_run_is_resumed_without_loss(here, tmp_path):
    killed = subprocess.run([sys.executable, "-c", KILLED, str(tmp_path)], check=False, timeout=300)
    assert killed.returncode == -9
    assert len(list(tmp_path.glob("*.npz"))) >= 1
    done = []
    resumed = run_loops(
        **arguments(), resume=tmp_path, progress=lambda *counts: done.append(counts)
    )
    assert done[0] == (1, 2)
    assert done[-1] == (2, 2)
    assert same(resumed, here)


#: A process in which a file of the package ends in a comment, and which must not compute.
CHANGED = """
import sys
from pathlib import Path
from types import SimpleNamespace

read = Path.read_bytes
Path.read_bytes = lambda path: read(path) + b"# later" * path.match(sys.argv[2])

import numpy as np
from nlfrf import paper_rig
from nlfrf.rig import run_loops

class Nobody:
    def submit(self, task, value):
        raise OSError("nobody computes")

K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1e-3)
run_loops(paper_rig(), np.ones(20), [K], resume=sys.argv[1], executor=Nobody())
"""


@pytest.mark.parametrize(
    ("changed", "found"),
    [
        ("rig/bench/closed_loop.py", False),
        ("rig/kernels/coupled.py", False),
        ("rig/laws/laws.py", False),
        ("signals/multisine.py", True),
    ],
)
def test_results_of_another_integrator_are_not_taken(changed, found, tmp_path):
    """The integrator is every file that integrates."""
    K = SimpleNamespace(A=[[1.0]], B=[[1.0]], C=[[300.0]], D=[[300.0]], dt=1 / FS)
    kept = []
    for _ in range(2):
        run_loops(
            paper_rig(),
            np.ones(20),
            [K],
            resume=tmp_path,
            progress=lambda *counts: kept.append((len(list(tmp_path.glob("*.npz"))), *counts)),
        )
    assert kept == [(1, 1, 1)] * 2
    done = subprocess.run(
        [sys.executable, "-c", CHANGED, str(tmp_path), f"nlfrf/{changed}"],
        check=False,
        capture_output=True,
        text=True,
    )
    assert (done.returncode == 0) == found, done.stderr
    assert ("nobody computes" in done.stderr) != found
