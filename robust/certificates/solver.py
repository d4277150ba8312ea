"""Convex programs, solved under a time cap by solvers that may fail in any way."""

from __future__ import annotations

import warnings
from typing import Any

__all__ = ["SOLVERS", "TIME_CAP", "attempt"]


def attempt(problem: Any, solver: str, time_cap: float, *, eps: float = 1e-7) -> str:
    """Solve a cvxpy problem. Empty where the solver came back, else what failed; what it found is for others to judge.

    problem : cvxpy.Problem; solver : its name there; time_cap : seconds; eps : tolerance of SCS.
    """
    caps = {"CLARABEL": {"time_limit": time_cap}, "SCS": {"time_limit_secs": time_cap, "eps": eps}}
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "may be inaccurate": it may well be
            problem.solve(solver=solver, **caps.get(solver, {}))
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # CLARABEL can panic with an exception that is no Exception
        return f"the solver {solver} failed: {type(error).__name__}" + (f": {error}" if str(error) else "")
    return ""


SOLVERS = ("CLARABEL", "SCS")
TIME_CAP = 5.0
