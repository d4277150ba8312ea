"""Proofs that a norm bound holds at every frequency: the bounded-real lemma, or a determinant, over
the rationals.

For one full block the structured singular value is the norm, so P is searched as in
`robust.proofs.search.scaled_kyp`. If no P is found, or the level does not hold,
`robust.proofs.exact.bands` decides.
"""

from __future__ import annotations

import time

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_choice, require_positive
from robust._base.states import Outcome
from robust._base.types import LinearSystem
from robust.lti.norms import hinf_norm
from robust.lti.realisation import multivariable, rightmost_pole
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.closed_loops import ClosedLoopClaim, decide_closed_loop
from robust.proofs.search.certificate import Certificate, failed_certificate
from robust.proofs.search.programs import SOLVERS
from robust.proofs.search.scaled_kyp import certify_scaled
from robust.proofs.search.stability import TIME_CAP, certificate_of_loop, norm_of_closed_loop

_SUBJECT = "norm"


def certify_norm(
    system: LinearSystem, level: float = 1.0, *, solver: str | None = None
) -> Certificate:
    """Prove that a system is stable and that its H-infinity norm is below a level.

    The proof is the bounded-real lemma: a matrix P > 0 with [A'P + PA + C'C, PB + C'D; B'P + D'C,
    D'D - level^2 I] < 0, or its discrete counterpart, which is checked over the rationals. P comes
    from a Riccati equation, or else from cvxpy. If no P passes the check, the sign of a determinant
    over all frequencies decides.

    Use this for a bound on a norm that also holds between the frequencies of a grid.

    Parameters
    ----------
    system : control.StateSpace or TransferFunction
        Continuous or discrete, with any number of inputs and outputs.
    level : float
        Bound of the norm to prove.
    solver : str, optional
        "CLARABEL" or "SCS", the solver of cvxpy that proposes P.

    Returns
    -------
    Certificate
        A certificate that does not hold states the reason: the bound is violated, with the norm and
        its frequency; the system is not stable; or the proof is undecided. A failure of a solver
        raises no error.

    Raises
    ------
    ValueError
        A level that is not positive, or another solver.

    References
    ----------
    Boyd, El Ghaoui, Feron & Balakrishnan 1994, 2.7.3.

    Examples
    --------
    >>> lag = control.tf([2], [1, 1])
    >>> certify_norm(lag, 2.002).holds
    True
    >>> certify_norm(lag, 1.998).outcome, certify_norm(lag, 1.998).reason
    ('violated', 'the norm is 2, at 0 Hz')
    """
    level = require_positive("level", level)
    if solver is not None:
        require_choice("solver", solver, SOLVERS)
    system = multivariable("system", system)
    if hinf_norm(system)[0] < level:
        block = (system.noutputs, system.ninputs, "full")
        if found := certify_scaled(system, [block], level, solver=solver, subject=_SUBJECT):
            return found
    return _certify_exactly(system, level)


def _certify_exactly(system: control.StateSpace, level: float) -> Certificate:
    """Return `certify_norm` over the rationals: that of a loop without a controller."""
    matrices = to_matrices(system)
    nothing = to_matrices(control.StateSpace([], [], [], np.zeros((0, 0)), system.dt))
    loop = ClosedLoopClaim(plant=matrices, controller=nothing, level=level)
    found = decide_closed_loop(loop, deadline=time.thread_time() + TIME_CAP)
    if found.holds:
        return certificate_of_loop(loop, _SUBJECT)
    if not found.violated:
        return failed_certificate(_SUBJECT, level, found.reason)
    norm = norm_of_closed_loop(matrices, nothing)
    reason, where = f"the norm is {norm.lower:.10g}, at {format_hertz(norm.omega)}", norm.omega
    if np.isinf(norm.lower):
        reason, where = f"the system is not stable: a pole at {rightmost_pole(system):.4g}", np.nan
    return failed_certificate(_SUBJECT, level, reason, outcome=Outcome.VIOLATED, violated_at=where)
