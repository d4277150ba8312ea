"""Many runs of one task: in parallel, with progress, and resumable from the runs that were finished before.

A task is a function from a value to a dictionary of arrays. What it gives depends on its value alone, so the
result is the same whoever computes it, in whatever order.
"""

from __future__ import annotations

import hashlib
import numbers
import os
import tempfile
from collections.abc import Callable, Sequence
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import Any

import numpy as np

__all__ = ["Arrays", "Progress", "run_all"]


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
    """Run a task on every value; the results in the order of the values.

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
        Folder that keeps what is done. Results found there are not computed again.

    Returns
    -------
    list of dict

    Raises
    ------
    ValueError
        What the task refuses, or an executor that dies: what was done till then is in the folder.
    """
    folder = None if resume is None else opened(resume)
    names = [] if folder is None else [f"{fingerprint(value)}.npz" for value in values]
    results: dict[int, Arrays] = {}
    for i, name in enumerate(names):
        found = restored(Path(str(folder)) / name)
        if found is not None:
            results[i] = found
    if results and progress is not None:
        progress(len(results), len(values))
    todo = [i for i in range(len(values)) if i not in results]
    threads = ThreadPoolExecutor(max_workers=os.cpu_count()) if executor is None else None
    futures: dict[Future[Arrays], int] = {}
    try:
        for i in todo:
            futures[(threads or executor).submit(task, values[i])] = i  # type: ignore[union-attr]
        for future in as_completed(futures):
            i = futures[future]
            results[i] = future.result()
            if folder is not None:
                keep(results[i], folder / names[i])
            if progress is not None:
                progress(len(results), len(values))
    except ValueError:
        raise
    except Exception as error:
        where = "are lost: give resume= a folder to keep them" if folder is None else f"are kept in {folder}"
        raise ValueError(
            f"executor must finish all {len(values)} runs, got {type(error).__name__} ({error}) "
            f"after {len(results)}, which {where}"
        ) from error
    finally:
        for future in futures:
            future.cancel()
        if threads is not None:
            threads.shutdown(cancel_futures=True)
    return [results[i] for i in range(len(values))]


def opened(resume: Any) -> Path:
    """The folder, made where it does not exist."""
    folder = Path(resume)
    if folder.exists() and not folder.is_dir():
        raise ValueError(f"resume must be a folder, got the file {folder}")
    folder.mkdir(parents=True, exist_ok=True)
    return folder


def keep(result: Arrays, path: Path) -> None:
    """Write a result whole or not at all."""
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".", suffix=".part")
    try:
        with os.fdopen(handle, "wb") as file:
            np.savez(file, **result)  # type: ignore[arg-type]
        os.replace(name, path)
    except BaseException:
        os.unlink(name)
        raise


def restored(path: Path) -> Arrays | None:
    """A result kept before; None where there is none, or none that can be read."""
    try:
        with path.open("rb") as opened_file, np.load(opened_file, allow_pickle=False) as file:
            return {name: file[name] for name in file.files}
    except Exception:  # a damaged file makes zipfile and numpy raise anything
        return None


def fingerprint(value: Any) -> str:
    """A name for what a value holds: equal for equal content, different for different content."""
    digest = hashlib.sha256()
    absorb(digest, value)
    return digest.hexdigest()[:32]


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
    elif isinstance(value, (str, int, float, type(None))):
        digest.update(repr(value).encode())
    elif isinstance(value, numbers.Real):  # of numpy, or a fraction
        digest.update(repr(float(value)).encode())
    else:
        raise TypeError(f"no fingerprint of {type(value).__name__}")
    digest.update(b";")
