"""What is wanted of each loop of a stack, found where the loops are computed, so that little has to travel."""

from __future__ import annotations

import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np

from nlfrf.bench.loop_response import LoopResponse
from nlfrf.bench.loop_runs import LoopRuns, respond
from nlfrf.bench.runs import Arrays

__all__ = ["Wanted", "results", "told", "travels"]


@dataclass(frozen=True)
class Wanted:
    """A task: the loops computed, and of each what `of` gives. Only that comes back, and how many turns were lost."""

    of: Callable[[LoopResponse], Any]

    def __call__(self, runs: LoopRuns) -> Arrays:
        out = respond(runs)
        try:
            return {"found": objects(results(runs, out, self.of)), "lost": out["lost"]}
        except Exception as error:  # of the function, not of the executor: raised by whoever asked
            return {"refused": objects([error]), "lost": out["lost"]}


def objects(items: list[Any]) -> np.ndarray:
    """(n,) array of anything, looked at no further."""
    held = np.empty(len(items), dtype=object)
    for i, item in enumerate(items):
        held[i] = item
    return held


def results(runs: LoopRuns, out: Arrays, of: Callable[[LoopResponse], Any] | None) -> list[Any]:
    """What comes of computed runs: their responses, or of each what is wanted of it."""
    if "refused" in out:
        raise out["refused"][0]
    if "found" in out:
        return list(out["found"])
    responses = told(runs, out)
    return responses if of is None else [of(response) for response in responses]


def told(runs: LoopRuns, out: Arrays) -> list[LoopResponse]:
    """What the compiled code gave, as values; arrays end where a loop ran away."""
    found = []
    for r, rows, n in zip(runs.r, out["rows"], out["lengths"], strict=True):
        x, v, y, u, friction = rows[:n].T
        ran_away = bool(n < r.size)
        t = np.arange(n) / runs.fs
        found.append(LoopResponse(t=t, r=r[:n], u=u, x=x, v=v, y=y, friction=friction, diverged=ran_away))
    return found


def travels(of: Callable[[LoopResponse], Any]) -> bool:
    """Whether a process of any executor can be given a function; a lambda it cannot, nor what a notebook defines."""
    try:
        sent = pickle.dumps(of)
    except Exception:  # pickle raises anything
        return False
    return b"__main__" not in sent or hasattr(sys.modules["__main__"], "__file__")
