"""Many loops: the same whoever computes them, kept as they are done, resumed after a kill, and not
for other code.
"""

import pickle
import subprocess
import sys
from concurrent.futures import ProcessPoolExecutor
from multiprocessing import get_context
from types import SimpleNamespace

import numpy as np
import pytest

import robust
from nlfrf import paper_rig
from nlfrf.rig import run_loops
from nlfrf.rig.bench import closed_loop as loop_results
from nlfrf.rig.bench import simulate as runs
from nlfrf.rig.bench.closed_loop import Controller, simulate_runs, stack_runs

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
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
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


@pytest.mark.attack
def test_what_is_wanted_is_found_in_the_worker_and_no_response_comes_back(here, monkeypatch):
    monkeypatch.setattr(loop_results, "_to_trajectories", None)  # here, not there
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as executor:
        assert run_loops(**arguments(), executor=executor, of=last) == [
            last(response) for response in here
        ]
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
    assert not loop_results.can_pickle(lambda response: response.x)
    assert loop_results.can_pickle(last)
    kept = []  # whatever is wanted of them, the runs are there
    assert same(
        run_loops(**arguments(), resume=tmp_path, progress=lambda *done: kept.append(done)), here
    )
    assert kept == [(2, 2)]


def test_what_a_notebook_defines_is_looked_at_here(monkeypatch):
    def swing(response):
        return response.x

    monkeypatch.setattr(swing, "__module__", "__main__", raising=False)
    monkeypatch.setattr(swing, "__qualname__", "swing")
    notebook = SimpleNamespace(swing=swing)
    monkeypatch.setitem(sys.modules, "__main__", notebook)
    assert not loop_results.can_pickle(swing)
    notebook.__file__ = "study.py"
    assert loop_results.can_pickle(swing)


def test_what_all_runs_share_travels_once():
    shared = stack_runs(*stacked(np.ones((1, 1000))), steps=4)
    each = stack_runs(*stacked(np.ones((50, 1000))), steps=4)
    sent, more = pickle.dumps(shared), pickle.dumps(each)
    assert len(sent) < len(more) - 49 * 8000
    back = simulate_runs(pickle.loads(sent))
    assert all(np.array_equal(back[name], part) for name, part in simulate_runs(each).items())


def stacked(r):
    """Fifty runs as `run_loops` stacks them."""
    zero = np.zeros((1, r.shape[1]))
    given = {"r": r, "disturbance": zero, "noise": zero, "initial": np.zeros((1, 2))}
    return paper_rig(), [Controller(K) for K in arguments(50)["controllers"]], given


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


def test_results_of_another_integrator_are_not_taken(tmp_path, monkeypatch, here):
    kept = []
    run_loops(**arguments(5), resume=tmp_path)
    run_loops(**arguments(5), resume=tmp_path, progress=lambda *counts: kept.append(counts))
    assert kept == [(1, 1)]
    monkeypatch.setattr(runs, "hash_integrator", lambda: b"a later version")
    run_loops(**arguments(5), resume=tmp_path)
    assert len(list(tmp_path.glob("*.npz"))) == 2


def test_the_integrator_is_every_file_that_integrates(tmp_path, monkeypatch):
    first = runs.hash_integrator()
    for part in ("bench", "kernels", "laws"):
        folder = tmp_path / part
        folder.mkdir()
        for path in (runs.Path(runs.__file__).parents[1] / part).glob("*.py"):
            (folder / path.name).write_bytes(path.read_bytes())
    monkeypatch.setattr(runs, "__file__", str(tmp_path / "bench" / "simulate.py"))
    assert runs.hash_integrator.__wrapped__() == first
    (tmp_path / "kernels" / "coupled.py").write_text("# changed\n")
    assert runs.hash_integrator.__wrapped__() != first
