"""Cone programs in the form of the solver, without a modelling layer, which would take longer."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from scipy import sparse


def solve_conic(
    P: np.ndarray,
    q: np.ndarray,
    *,
    A: np.ndarray,
    b: np.ndarray,
    positive: int,
    zero: int = 0,
    cones: Sequence[int] = (),
) -> tuple[np.ndarray, np.ndarray, str]:
    """Return x and multipliers of min x'P x/2 + q'x, and "" or the reason of a failure.

    The first `zero` rows of b - A x are zero and the next `positive` are not negative; the others
    are second-order cones of these sizes, whose first entry is at least the norm of the others.
    """
    import clarabel

    settings = clarabel.DefaultSettings()
    settings.verbose = False
    kinds = [
        clarabel.ZeroConeT(zero),
        clarabel.NonnegativeConeT(positive),
        *map(clarabel.SecondOrderConeT, cones),
    ]
    try:
        solver = clarabel.DefaultSolver(
            sparse.csc_matrix(np.triu(P)), q, sparse.csc_matrix(A), b, kinds, settings
        )
        solution = solver.solve()
    except BaseException as error:  # the solver panics with an exception of its own
        if isinstance(error, KeyboardInterrupt | SystemExit):
            raise
        return np.zeros(0), np.zeros(0), f"the solver CLARABEL failed: {type(error).__name__}"
    x, z, status = np.array(solution.x), np.array(solution.z), str(solution.status)
    failed = "Infeasible" in status or not (np.isfinite(x).all() and np.isfinite(z).all())
    return x, z, f"the solver gave no step ({status})" if failed else ""
