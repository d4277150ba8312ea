"""Multisine experiments on a machine, simulated to steady state, in parallel and resumable.

A task is a function from a value to a dictionary of arrays. Its result depends on this value alone.
So it does not depend on worker or order, and results in a folder can be reused.
"""

from __future__ import annotations

import numbers
import os
import warnings
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import fields, is_dataclass, replace
from functools import cache
from itertools import islice
from pathlib import Path
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from nlfrf._base.arguments import (
    DataWarning,
    require_choice,
    require_integer,
    require_kind,
)
from nlfrf._base.files import Role, to_path, write_arrays
from nlfrf._base.values import value
from nlfrf.records.record import Record
from nlfrf.rig.bench.rig import (
    Rig,
    initial_memory,
    integrate_rig,
    require_stable_step,
    unstable_step_error,
    warn_of_coarse_step,
)
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.signals.multisine import Multisine

if TYPE_CHECKING:
    from hashlib import _Hash as Hash

_DEFAULT_WORKERS = 128  # workers of an executor that does not state their number

Arrays = dict[str, np.ndarray]
Progress = Callable[[int, int], object]
Input = TypeVar("Input")


def run_all(
    task: Callable[[Input], Arrays],
    values: Sequence[Input],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> list[Arrays]:
    """Run a task on every value; return the results in the order of the values.

    Arguments as in `run_each`.
    """
    results = dict(run_each(task, values, executor=executor, progress=progress, resume=resume))
    return [results[i] for i in range(len(values))]


def run_each(
    task: Callable[[Input], Arrays],
    values: Sequence[Input],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Iterator[tuple[int, Arrays]]:
    """Run a task on every value; yield index and result of each when it is done, so that few are
    kept in memory.

    Parameters
    ----------
    task : callable
        Function from one value to a dictionary of arrays; defined in a module if the executor uses
        processes.
    values : sequence
        Arguments of the task.
    executor : concurrent.futures.Executor, optional
        Executor of the tasks; by default one thread per core.
    progress : callable, optional
        Called with the number done and the total, after each task.
    resume : path, optional
        Folder that keeps finished results. They are not computed again unless the code or the value
        changed.

    Returns
    -------
    iterator of (int, dict)

    Raises
    ------
    ValueError
        The task refuses its value, or the executor dies; earlier results are in the folder.
    """
    if resume is None:
        folder = None
    else:
        folder = _open_folder(resume)
    if folder is None:
        files = []
    else:
        files = [folder / f"{_fingerprint(task, value)}.npz" for value in values]
    todo, total = list(range(len(values))), len(values)
    for i, file in enumerate(files):
        if (found := _load_result(file)) is not None:
            todo.remove(i)
            yield i, found
    n_done = total - len(todo)
    if n_done and progress is not None:
        progress(n_done, total)
    pool = ThreadPoolExecutor(max_workers=os.cpu_count()) if executor is None else executor
    # tasks submitted at a time: no worker waits, and no more results than these are in memory
    ahead = 2 * int(getattr(pool, "_max_workers", _DEFAULT_WORKERS))
    running: dict[Future[Arrays], int] = {}
    rest = iter(todo)
    try:
        while True:
            for i in islice(rest, ahead - len(running)):
                running[pool.submit(task, values[i])] = i
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                i = running.pop(future)
                result = future.result()
                if files:
                    write_arrays(files[i], result, role=Role.KEPT)
                n_done += 1
                if progress is not None:
                    progress(n_done, total)
                yield i, result
    except ValueError:
        raise
    except Exception as error:
        if files:
            where = f"are kept in {files[0].parent}"
        else:
            where = "are lost: give resume= a folder to keep them"
        raise ValueError(
            f"executor must finish all {total} runs, got {type(error).__name__} ({error}) after"
            f" {n_done}, which {where}"
        ) from error
    finally:
        for future in running:
            future.cancel()
        if executor is None:
            pool.shutdown(cancel_futures=True)


def _open_folder(resume: str | os.PathLike[str]) -> Path:
    """Return the folder as a path, created if it does not exist."""
    folder = to_path(resume, "resume")
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"resume must be a folder, got the file {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def _load_result(path: Path) -> Arrays | None:
    """Return a result kept before; None if there is none, or it cannot be read."""
    try:
        with path.open("rb") as opened_file, np.load(opened_file, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except Exception:  # a damaged file makes zipfile and numpy raise anything
        return None


def _fingerprint(task: Callable[[Input], Arrays], value: Input) -> str:
    """Return a hash of task, value and integrator, the file name of the result."""
    from hashlib import sha256

    digest = sha256(_hash_integrator() + task.__qualname__.encode())
    _hash_value(digest, value)
    return digest.hexdigest()[:32]


@cache
def _hash_integrator() -> bytes:
    """Return a hash of the integrating code, so that results of an older version are not reused."""
    from hashlib import sha256

    digest = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(
        path for part in ("bench", "kernels", "laws") for path in (package / part).glob("*.py")
    ):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.digest()


def _hash_value(digest: Hash, value: object) -> None:
    """Add a value to a digest: type and content, fields one by one."""
    digest.update(f"<{type(value).__qualname__}>".encode())
    match value:
        case _ if is_dataclass(value):
            for field in fields(value):
                digest.update(f"{field.name}=".encode())
                _hash_value(digest, getattr(value, field.name))
        case np.ndarray():
            digest.update(f"{value.dtype.str}{value.shape}".encode())
            digest.update(np.ascontiguousarray(value).tobytes())
        case tuple() | list():
            for one in value:
                _hash_value(digest, one)
        case dict():
            for item in value.items():
                _hash_value(digest, item)
        case str() | int() | float() | None:
            digest.update(repr(value).encode())
        case numbers.Real():  # of numpy, or a fraction
            digest.update(repr(float(value)).encode())
        case _ if callable(value):
            raise ValueError(
                "resume must be left out with your own functions: a change in them cannot be"
                " detected"
            )
        case _:
            raise TypeError(
                f"resume cannot detect changes in a {type(value).__name__}: leave it out"
            )
    digest.update(b";")


#: Change from one period to the next, relative to the rms of the position, above which a record is
#: called unsettled.
_MAX_PERIOD_CHANGE = 1e-4


@value
class _Experiment:
    """One realisation of a multisine on a rig with its integration options: the argument of a
    worker.
    """

    rig: Rig
    ms: Multisine
    n_periods: int
    n_discard: int
    oversampling: int
    hold: str


def simulate(
    rig: Rig,
    ms: Multisine,
    *,
    n_periods: int = 1,
    n_discard: int = 2,
    oversampling: int = 1,
    hold: str = "band-limited",
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | os.PathLike[str] | None = None,
) -> Record:
    """Simulate a multisine experiment on a machine: force in, position out.

    Every realisation (draw of the random phases) starts at rest and runs to steady state. Use this
    to try an experiment before it is made. For a servo axis with a drive use
    `nlfrf.rig.simulate_servo`.

    Parameters
    ----------
    rig : Rig
        The machine.
    ms : Multisine
        The forces [N], M realisations or experiments of N samples.
    n_periods : int
        Number of periods P that are kept.
    n_discard : int
        Number of periods before them, in which the transient decays.
    oversampling : int
        Integration steps per sample.
    hold : str
        Force between samples. "band-limited": the multisine itself. "zoh": each sample is held.
    executor : concurrent.futures.Executor, optional
        Executor that runs the realisations; by default one thread per core. The result does not
        depend on the executor.
    progress : callable, optional
        Function called with the number of finished realisations and their total.
    resume : path, optional
        Folder for finished realisations. After an interruption, a call with the same arguments
        computes only the missing ones.

    Returns
    -------
    Record
        Record with u and y (M, P, N), for several channels (channels, M, P, N). Its lines are those
        of the multisine, its names those of the rig.

    Raises
    ------
    ValueError
        Multisine and rig have different numbers of inputs; the integration step is too long to be
        stable (the message states a sufficient oversampling); the executor failed; or a number is
        out of range.

    Warns
    -----
    DataWarning
        The last two periods differ by more than 1e-4 of the rms; the step is too coarse for an
        accurate resonance; or the motion had more turning points than the friction law stores.

    Examples
    --------
    With odd friction and odd excited lines, the response has odd lines only; even lines contain
    rounding errors.

    >>> from nlfrf.signals.multisine import multisine
    >>> from nlfrf.rig.bench.rig import paper_rig
    >>> ms = multisine(fs=2048, n_samples=8192, f_min=2, f_max=140, rms=0.25, rng=1)
    >>> record = simulate(paper_rig(), ms, n_discard=4)
    >>> spectrum = np.abs(np.fft.rfft(record.y[0, 0]))
    >>> bool(spectrum[ms.lines.even].max() < 1e-9 * spectrum[ms.lines.odd].max())
    True
    """
    require_kind("rig", rig, Rig)
    require_kind("ms", ms, Multisine)
    experiment = _Experiment(
        rig=rig,
        ms=ms,
        n_periods=require_integer("n_periods", n_periods, least=1),
        n_discard=require_integer("n_discard", n_discard, least=0),
        oversampling=require_integer("oversampling", oversampling, least=1),
        hold=require_choice("hold", hold, ("band-limited", "zoh")),
    )
    if rig.n_inputs != ms.n_inputs:
        raise ValueError(f"ms must have the inputs of the rig, {rig.n_inputs}, got {ms.n_inputs}")
    n_runs = ms.phase.shape[-2]
    realizations = [
        replace(experiment, ms=replace(ms, phase=ms.phase[..., m : m + 1, :]))
        for m in range(n_runs)
    ]
    require_stable_step(rig.stable_step, ms.fs, oversampling)
    warn_of_coarse_step(rig.poles(1.0), ms.fs, oversampling)
    outcomes = run_all(
        _run_experiment, realizations, executor=executor, progress=progress, resume=resume
    )
    change = np.array([float(outcome["change"]) for outcome in outcomes])
    if np.any(change > _MAX_PERIOD_CHANGE):
        warnings.warn(
            f"steady state was not reached: the last two periods differ by {change.max():.1e} of"
            f" the rms. Raise n_discard above {n_discard}",
            DataWarning,
            stacklevel=2,
        )
    warn_of_forgotten_loops(float(sum(outcome["lost"] for outcome in outcomes)))
    return _make_record(
        rig, ms, y=np.stack([outcome["y"] for outcome in outcomes], axis=-3), hold=hold
    )


def _run_experiment(experiment: _Experiment) -> Arrays:
    """Integrate one realisation from rest, in a worker.

    Returns y (P, N) or (n_y, P, N); the change from the last period but one to the last (rms over
    rms; nan for one period only); and the number of turning points that did not fit into the
    memory.
    """
    outcome = _try_experiment(experiment)
    if outcome is None:
        fs, steps = experiment.ms.fs, experiment.oversampling
        raise unstable_step_error(
            fs,
            steps,
            lambda finer: _try_experiment(replace(experiment, oversampling=finer)) is not None,
        )
    return outcome


def _try_experiment(experiment: _Experiment) -> Arrays | None:
    """Return the result of `_run_experiment`; None if the step was too long to be stable."""
    rig, ms, steps = experiment.rig, experiment.ms, experiment.oversampling
    memory = initial_memory(rig)
    drive = _force_over_period(ms, steps, experiment.hold)
    periods: list[np.ndarray] = []
    for _ in range(experiment.n_discard + experiment.n_periods):
        out = integrate_rig(rig, memory, drive=drive, h=1 / (ms.fs * steps), substeps=steps)
        if out is None:
            return None
        periods = [
            *periods[-max(experiment.n_periods - 1, 1) :],
            _sensor_positions(experiment, out[:, 0]),
        ]
    change = np.nan
    if len(periods) > 1:
        size = np.linalg.norm(periods[-1])  # zero for a mass that never moved
        change = float(np.linalg.norm(periods[-2] - periods[-1]) / max(size, np.finfo(float).tiny))
    y = np.stack(periods[-experiment.n_periods :], axis=-2)
    return {
        "y": y,
        "change": np.array(change),
        "lost": np.array(memory.state[..., packing.LOST].sum()),
    }


def _sensor_positions(experiment: _Experiment, x: np.ndarray) -> np.ndarray:
    """Return the (N,) position of a single axis, or (n_y, N), from the positions of the axes."""
    if not experiment.rig.several:
        return x.copy()
    y: np.ndarray = experiment.rig.sensors @ x.T
    return y


def _make_record(rig: Rig, ms: Multisine, *, y: np.ndarray, hold: str) -> Record:
    """Return the record of input and measured positions, with the names and units of the rig."""
    u = np.broadcast_to(ms.u[..., np.newaxis, :], (*ms.u.shape[:-1], *y.shape[-2:]))
    return Record(
        u=u,
        y=y,
        fs=ms.fs,
        lines=ms.lines,
        hold=hold,
        inputs=rig.inputs,
        outputs=rig.outputs,
        input_units=("N",) * len(rig.inputs),
        output_units=("m",) * len(rig.outputs),
    )


def _force_over_period(ms: Multisine, oversampling: int, hold: str) -> np.ndarray:
    """Return the (n, 3) or (n, 3, n_u) force at start, middle and end of every integration step of
    one period.
    """
    if hold == "zoh":
        u = np.repeat(ms.u[..., 0, :].T, oversampling, axis=0)
        return np.stack([u, u, u], axis=1)
    u = ms.sampled(2 * ms.n_samples * oversampling)[..., 0, :].T
    return np.stack([u[0::2], u[1::2], np.roll(u[0::2], -1, axis=0)], axis=1)
