"""Convex programs, solved with a time limit and with protection against solver failures."""

from __future__ import annotations

import warnings
from typing import TYPE_CHECKING

if TYPE_CHECKING:
    import cvxpy

SOLVERS = ("CLARABEL", "SCS")
SCS_STEPS = 20_000  # some seconds for 32 states


def solve_program(
    problem: cvxpy.Problem,
    solver: str,
    time_cap: float | None = None,
    *,
    eps: float = 1e-7,
    steps: int = SCS_STEPS,
) -> str:
    """Solve a cvxpy problem. Return an empty text if the solver returns, else the failure; the
    result is not judged.

    problem : cvxpy.Problem; solver : its name in cvxpy; time_cap : seconds, None: a limit of steps
    instead of time; eps, steps : tolerance of SCS, and its number of steps without a time cap.
    """
    caps = {
        "CLARABEL": {} if time_cap is None else {"time_limit": time_cap},
        "SCS": {
            "eps": eps,
            **({"max_iters": steps} if time_cap is None else {"time_limit_secs": time_cap}),
        },
    }
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "may be inaccurate": the result is judged elsewhere
            problem.solve(solver=solver, **caps.get(solver, {}))
    except (KeyboardInterrupt, SystemExit):
        raise
    except (
        BaseException
    ) as error:  # CLARABEL can panic with an exception that does not derive from Exception
        return f"the solver {solver} failed: {type(error).__name__}" + (
            f": {error}" if str(error) else ""
        )
    return ""
