"""Many runs of one task: in parallel, with progress, and resumable from the runs that were finished before.

A task is a function from a value to a dictionary of arrays. What it gives depends on its value alone, so the
result is the same whoever computes it, in whatever order.
"""

from __future__ import annotations

import numbers
import os
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import FIRST_COMPLETED, Executor, Future, ThreadPoolExecutor, wait
from dataclasses import fields, is_dataclass
from functools import cache
from itertools import islice
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.shared.outputs import Role
from nlfrf.shared.whole_files import write_arrays
from nlfrf.shared.wording import shown

__all__ = ["Arrays", "Progress", "run_all", "run_each"]

WORKERS = 128  # of an executor that does not say how many it has

Arrays = dict[str, np.ndarray]
Progress = Callable[[int, int], Any]


def run_all(
    task: Callable[[Any], Arrays],
    values: Sequence[Any],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: Any = None,
) -> list[Arrays]:
    """Run a task on every value; the results in the order of the values. Arguments and refusals as in `run_each`."""
    results = dict(run_each(task, values, executor=executor, progress=progress, resume=resume))
    return [results[i] for i in range(len(values))]


def run_each(
    task: Callable[[Any], Arrays],
    values: Sequence[Any],
    *,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: Any = None,
) -> Iterator[tuple[int, Arrays]]:
    """Run a task on every value; place and result of each as it is done, of which few are held at a time.

    Parameters
    ----------
    task : callable
        From one value to a dictionary of arrays; a function of a module where the executor uses processes.
    values : sequence
        What it is run on.
    executor : concurrent.futures.Executor, optional
        Where it is run; one thread per core when not given.
    progress : callable, optional
        Called with the number done and the total, after each.
    resume : path, optional
        Folder that keeps what is done. Results found there are not computed again, unless what computes them changed.

    Returns
    -------
    iterator of (int, dict)

    Raises
    ------
    ValueError
        What the task refuses, or an executor that dies: what was done till then is in the folder.
    """
    folder = None if resume is None else opened(resume)
    todo, total, n_done = list(range(len(values))), len(values), 0
    if folder is not None:
        names = [f"{fingerprint(task, value)}.npz" for value in values]
        for i in todo.copy():
            found = restored(folder / names[i])
            if found is not None:
                todo.remove(i)
                n_done += 1
                yield i, found
    if n_done and progress is not None:
        progress(n_done, total)
    threads = ThreadPoolExecutor(max_workers=os.cpu_count()) if executor is None else None
    # what is handed over at a time: nobody waits, and no more results than these are held
    ahead = 2 * int(getattr(threads or executor, "_max_workers", WORKERS))
    running: dict[Future[Arrays], int] = {}
    rest = iter(todo)
    try:
        while True:
            for i in islice(rest, ahead - len(running)):
                running[(threads or executor).submit(task, values[i])] = i  # type: ignore[union-attr]
            if not running:
                break
            for future in wait(running, return_when=FIRST_COMPLETED).done:
                i = running.pop(future)
                result = future.result()
                if folder is not None:
                    write_arrays(folder / names[i], result, role=Role.KEPT)
                n_done += 1
                if progress is not None:
                    progress(n_done, total)
                yield i, result
    except ValueError:
        raise
    except Exception as error:
        where = "are lost: give resume= a folder to keep them" if folder is None else f"are kept in {folder}"
        raise ValueError(
            f"executor must finish all {total} runs, got {type(error).__name__} ({error}) after {n_done}, which {where}"
        ) from error
    finally:
        for future in running:
            future.cancel()
        if threads is not None:
            threads.shutdown(cancel_futures=True)


def opened(resume: Any) -> Path:
    """The folder, made where it does not exist."""
    if not isinstance(resume, str | os.PathLike):
        raise ValueError(f"resume must be a folder, got {shown(resume)}")
    folder = Path(resume)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"resume must be a folder, got the file {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def restored(path: Path) -> Arrays | None:
    """A result kept before; None where there is none, or none that can be read."""
    try:
        with path.open("rb") as opened_file, np.load(opened_file, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except Exception:  # a damaged file makes zipfile and numpy raise anything
        return None


def fingerprint(task: Callable[[Any], Arrays], value: Any) -> str:
    """A name for what a task gives on a value: another one for other content, another task, or another integrator."""
    from hashlib import sha256

    digest = sha256(integrator() + task.__qualname__.encode())
    absorb(digest, value)
    return digest.hexdigest()[:32]


@cache
def integrator() -> bytes:
    """A digest of the code that integrates: results that an older version kept are not taken for those of this one."""
    from hashlib import sha256

    digest = sha256()
    package = Path(__file__).parents[1]
    for path in sorted(path for wing in ("bench", "coupled", "friction") for path in (package / wing).glob("*.py")):
        digest.update(path.name.encode() + path.read_bytes())
    return digest.digest()


def absorb(digest: Any, value: Any) -> None:
    """Add a value to a digest: type and content, fields one by one."""
    digest.update(f"<{type(value).__qualname__}>".encode())
    if is_dataclass(value):
        for field in fields(value):
            digest.update(f"{field.name}=".encode())
            absorb(digest, getattr(value, field.name))
    elif isinstance(value, np.ndarray):
        digest.update(f"{value.dtype.str}{value.shape}".encode())
        digest.update(np.ascontiguousarray(value).tobytes())
    elif isinstance(value, (tuple, list)):
        for one in value:
            absorb(digest, one)
    elif isinstance(value, (str, int, float, type(None))):
        digest.update(repr(value).encode())
    elif isinstance(value, numbers.Real):  # of numpy, or a fraction
        digest.update(repr(float(value)).encode())
    elif callable(value):
        raise ValueError("resume must be left out with functions of your own: nothing tells whether they changed")
    else:
        raise TypeError(f"no fingerprint of {type(value).__name__}")
    digest.update(b";")
