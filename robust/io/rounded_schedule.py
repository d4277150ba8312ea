"""A schedule as statements in the arithmetic of its target: the state space that is proved, with
coefficients that are polynomials of theta, by Horner's rule in every step.

Second-order sections have other states. They are the same controller while theta is constant, but
not while theta moves. With F = A - I in the rows of slow states,

    s_j := s_j + (F_jk s_k + ... + B_j e)

keeps the digits of poles near 1, as sections in powers of z - 1 do. The sum of a state that only
integrates is compensated (Kahan 1965), as in `robust.io.rounded`. A state only integrates if what
other states and itself add to it is lost in the rounding of B_j e in the target's arithmetic: a residue
of 1e-15 in A, as from a change of states, does not count. It stays in the statement.
"""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import data_warning, require_choice
from robust._base.warnings import DesignWarning
from robust.io.rounded import (
    NOTABLE_ERROR,
    Polynomial,
    RoundedController,
    Statement,
    largest_error,
    require_representable,
)
from robust.models.lpv import LpvModel

_N_COMPARED = 33  # operating points at which the rounded controller is compared
_SLOW = 0.5  # of A_jj, from which a state is written as a change


def round_schedule(K: LpvModel, *, dtype: str, limit: ArrayLike | None = None) -> RoundedController:
    """Return a sampled schedule for one loop as statements with rounded coefficients.

    dtype : "float32" or "float64"; limit : None, because a schedule has no anti-windup here.
    """
    kind = np.dtype(require_choice("dtype", dtype, ("float32", "float64"))).type
    if limit is not None:
        raise ValueError(
            f"limit must be left out for a schedule, which has no anti-windup here, got {limit}"
        )
    if K.D.shape[1:] != (1, 1) or not K.dt:
        if not K.dt:
            what = "continuous"
        else:
            what = f"with {K.D.shape[2]} inputs and {K.D.shape[1]} outputs"
        raise ValueError(
            "K must be discrete with one input and one output to be written as code, got a schedule"
            f" that is {what}"
        )
    slow = K.A[0].diagonal() > _SLOW
    unit = np.zeros_like(K.A)
    unit[0] = np.diag(slow.astype(float))
    parts = {"A": K.A - unit, "B": K.B, "C": K.C, "D": K.D}
    for part in parts.values():
        require_representable(part, kind)
    parts = {name: part.astype(kind).astype(float) for name, part in parts.items()}
    found = replace(K, **(parts | {"A": parts["A"] + unit}))
    compensated = slow & _only_integrate(parts["A"], parts["B"], float(np.finfo(kind).eps) / 2)
    before = _statements(
        np.block([[parts["C"], parts["D"]], [parts["A"], parts["B"]]]), slow, compensated
    )
    low, high = K.points[[0, -1]]
    errors = [largest_error(K.at(p), found.at(p)) for p in np.linspace(low, high, _N_COMPARED)]
    error, omega = max(errors)
    if not error <= NOTABLE_ERROR:
        data_warning(
            f"K changes by up to {error:.2g} of |K| with coefficients in {dtype}"
            + ": use dtype='float64'" * (dtype == "float32"),
            DesignWarning,
        )
    middle, scale = (float(kind(one)) for one in ((low + high) / 2, 1 / K.half_range))
    off = abs(middle - (low + high) / 2) / K.half_range + 2 * float(np.finfo(kind).eps)
    facts = (
        (
            f"p: {K.describe_range()}, read in every step and clamped to this range. theta = (p -"
            f" middle)/half the range is within {off:.2g} of the exact one, for which the proof is"
        ),
        (
            f"state space of order {K.order} in the realisation that is proved, coefficients as"
            f" polynomials of theta of degree {len(K.A) - 1} at most. Sections would be other states,"
            " which is another controller while theta moves"
        ),
        (
            f"coefficients in {dtype} change |K| by at most {error:.2g} of itself with p held, at"
            f" {omega / 2 / np.pi:.4g} Hz, compared at {_N_COMPARED} operating points. Operations are"
            " rounded too, without a bound here"
        ),
    )
    return RoundedController(
        K=found,
        dtype=dtype,
        before=before,
        after=(),
        limit=np.array([-np.inf, np.inf]),
        coefficient_error=error,
        gain=np.nan,
        rounding=np.nan,
        facts=facts,
        theta=(middle, scale),
    )


def _only_integrate(F: np.ndarray, B: np.ndarray, unit: float) -> np.ndarray:
    """Return (n,) True for states to which no state adds more than the rounding unit of B e.

    |F_jk| x_k and x_j are compared at the largest of theta in [-1, 1]. x_k is the first move of a
    state after a sample of e, so the comparison does not change with the unit of a state.
    """
    added, moves = np.abs(F).sum(axis=0), np.abs(B).sum(axis=0)[:, 0]
    for _ in range(len(added)):
        moves = np.where(moves > 0, moves, added @ moves)
    return np.asarray(np.all(added * moves <= unit * moves[:, None], axis=1))


def _statements(
    M: np.ndarray, slow: np.ndarray, compensated: np.ndarray
) -> tuple[Statement | Polynomial, ...]:
    """Return the statements of [v; change or new value of each state] = M(theta) [states; e]."""
    n = len(slow)
    names = [*(f"s{j + 1}" for j in range(n)), "e"]
    polynomials: list[Statement | Polynomial] = []
    sums: list[list[tuple[Any, str]]] = []
    for row in np.moveaxis(M, 0, 2):
        sums.append([])
        for entry, name in zip(row, names, strict=True):
            if entry[1:].any():
                polynomials.append(Polynomial(f"c{len(polynomials) + 1}", tuple(entry)))
                sums[-1].append((polynomials[-1].target, name))
            elif entry[0]:
                sums[-1].append((float(entry[0]), name))
    rows = [Statement("v", tuple(sums[0] or [(0.0, "e")]))]
    last = []
    for j, terms in enumerate(sums[1:]):
        state, new = names[j], f"n{j + 1}"
        if compensated[j]:
            carry, change, added = f"{state}_carry", f"change{j + 1}", f"added{j + 1}"
            rows.append(Statement(change, (*terms, (1.0, carry))))
            rows.append(Statement(new, ((1.0, state), (1.0, change))))
            rows.append(Statement(added, ((1.0, new), (-1.0, state))))
            last.append(Statement(carry, ((1.0, change), (-1.0, added))))
        else:
            kept = ((1.0, state),) if slow[j] else ()
            rows.append(Statement(new, (*terms, *kept) or ((0.0, "e"),)))
        last.append(Statement(state, ((1.0, new),)))
    return (*polynomials, *rows, *last)
