"""Proof that the structured singular value is below a level at every frequency, not only on a grid.

First one scaling for all frequencies is searched (`robust.proofs.search.scaled_kyp`). If none is
found, one scaling is searched for each interval of the frequency axis (`robust.mu.intervals`).
Anyone can repeat either proof over the rationals. Repeated parameters may need thousands of
intervals. In this case each scaling, computed at one frequency, is used on the whole frequency
range on which exact arithmetic proves the level (`robust.mu.pieces`). This is faster, but the
certificate cannot be verified again.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import pairwise

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_choice, require_positive
from robust._base.states import Outcome
from robust._base.types import Blocks, LinearSystem
from robust.lti.lti import response_by_channel, timebase
from robust.lti.realisation import multivariable
from robust.mu.blocks import blocks_with_kinds, structure_for
from robust.mu.intervals import certify_intervals
from robust.mu.pieces import cut_by_scaling
from robust.mu.scalings import upper_bound
from robust.proofs.exact.bands import TransferMatrix, frequency_of_point, to_float
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.polynomials import polynomial_roots
from robust.proofs.exact.scaled_kyp import LEVEL
from robust.proofs.search.certificate import PIECES, Certificate, failed_certificate
from robust.proofs.search.intervals import SLACK
from robust.proofs.search.programs import SOLVERS
from robust.proofs.search.scaled_kyp import certify_scaled
from robust.proofs.search.stability import decide_stability

_MAX_INTERVALS = 2000  # with one scaling each


def certify(
    N_ss: LinearSystem, blocks: Blocks, level: float = 1.0, *, solver: str | None = None
) -> Certificate:
    """Prove that the structured singular value of a system stays below a level at every frequency.

    Use this for robust stability of a loop whose perturbation has several blocks; the level is then
    one.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system to which the perturbation is connected; continuous or discrete.
    blocks : list
        As for `upper`.
    level : float
        Level to prove. If mu < level at all frequencies, the loop is stable for every stable linear
        perturbation with this structure and a gain of at most 1/level. If one block is a
        performance block, the performance gain is then also below the level.
    solver : str, optional
        "CLARABEL" or "SCS", the solver of cvxpy that searches one scaling for all frequencies. By
        default a scaling that needs no solver is tried first, then CLARABEL, then SCS.

    Returns
    -------
    Certificate
        `intervals` (I, 2) are the proved frequency intervals [rad/s]. If the certificate does not
        hold, `reason` is one of: the system is not stable; the upper bound reaches the level at a
        frequency; the proof would need too many or too narrow intervals, of which one that is still
        open is named. A proof by "scaled KYP" (one scaling) or "generalised KYP" (one scaling for
        each interval) is exact over the rationals, and `Certificate.verify` repeats it. A proof by
        "scalings, each where it holds" is exact, too, but `verify` cannot repeat it.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss, a level that is not positive.

    References
    ----------
    Packard & Doyle 1993 (the theorem); Boyd, El Ghaoui, Feron & Balakrishnan 1994, 8.1 (one
    scaling); Iwasaki & Hara 2005 (intervals); Young, Newlin & Doyle 1991 (real blocks as a norm).

    Examples
    --------
    >>> import control
    >>> lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    >>> certify(control.append(lag, 2 * lag), [(1, 1), (1, 1)], 2.001).verify().verified
    True
    """
    N = multivariable("N_ss", N_ss)
    structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    level = require_positive("level", level)
    if solver is not None:
        require_choice("solver", solver, SOLVERS)
    nominal = decide_stability(N)
    if not nominal.stable:
        return failed_certificate(LEVEL, level, f"the system is not stable: {nominal}")
    # exact for N as given, but N was rounded when it was assembled: the slack on the level covers
    # that
    slack, given = level * (1 - SLACK), blocks_with_kinds(blocks)
    found = certify_scaled(N, given, slack, solver=solver)
    if found is None:
        found = certify_intervals(N, given, slack)
    if not found.holds and not found.violated:
        other = certify_by_intervals(N, blocks, level)
        if other.holds:
            found = other
    return replace(found, level=level)


def certify_by_intervals(
    N: control.StateSpace, blocks: Blocks, level: float, *, most: int = _MAX_INTERVALS
) -> Certificate:
    """Return `certify` for a stable system with at most `most` scalings, each on the pieces that it
    proves.
    """
    s, dt = structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss"), timebase(N)
    H, units = TransferMatrix.of(to_matrices(N)), np.full(N.ninputs, level * (1 - SLACK))
    first = _middle_of_poles(H)
    todo, done = [(first, np.inf, 8 * first), (0.0, first, first / 2)], []
    for _ in range(most):
        low, high, x = todo.pop()
        omega = frequency_of_point(x, dt)
        response = np.moveaxis(response_by_channel(N, np.array([omega])), 2, 0) / units
        found = upper_bound(response, blocks, target=1.0)
        if not found.value[0] < 1:
            there = f"at {format_hertz(omega)} it is {found.value[0]:.6g}"
            return failed_certificate(
                LEVEL, level, f"the bound does not stay below the level: {there}"
            )
        pieces = cut_by_scaling(H, s, found, units=units, x=x, band=(low, high))
        if isinstance(pieces, str):
            return failed_certificate(LEVEL, level, pieces)
        rest = [piece for piece in pieces if not piece.M.is_positive]
        if any(piece.low <= x <= piece.high for piece in rest):
            return failed_certificate(LEVEL, level, f"undecided at {format_hertz(omega)}")
        todo += [(piece.low, piece.high, to_float(piece.x)) for piece in rest]
        done += [piece.low for piece in pieces if piece.M.is_positive]
        if not todo:
            cuts = [frequency_of_point(x, dt) for x in (*sorted(done), np.inf)]
            return Certificate(
                subject=LEVEL,
                outcome=Outcome.HOLDS,
                level=level,
                method=PIECES,
                intervals=np.array(list(pairwise(cuts))),
                reason="",
            )
    return failed_certificate(LEVEL, level, f"undecided after {most} intervals")


def _middle_of_poles(H: TransferMatrix) -> float:
    """Return the geometric mean of the moduli of the poles on the axis; one if there are none."""
    sizes = np.abs(polynomial_roots(H.characteristic))
    if sizes.any():
        return float(np.exp(np.mean(np.log(sizes[sizes > 0]))))
    return 1.0
