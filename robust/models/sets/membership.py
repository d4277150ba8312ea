"""Membership of a plant in a set at every frequency: its smallest Delta, without the inverse of a
plant.

In every form G_p - G = +-E with E = X Delta Y, X = L W_l and Y = W_r R, where L and R are one, the
nominal or the plant. So a Delta of gain gamma exists if and only if

    [gamma^2 X X*  E; E*  Y* Y] >= 0,

The inequality is decided with exact polynomials (`robust.proofs.exact.bands`), also at zeros and
poles on the axis, at zero and at infinity. For coprime factors X = w [1 G] and Y = [1; G_p].
"""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence

import control
import numpy as np
from flint import fmpq
from scipy.linalg import eig

from nlfrf._base.values import value
from robust.lti.connections import in_series
from robust.lti.lti import response_by_channel, timebase, zeros
from robust.lti.stability import unstable_poles
from robust.models.sets.forms import MatrixForm
from robust.proofs.exact.bands import (
    Pair,
    TransferMatrix,
    cut_at_crossings,
    join_blocks,
    multiply,
    points_of_band,
    subtract,
    to_float,
    to_numbers,
)
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.exact.interval_kyp import ExactMatrix
from robust.proofs.exact.matrices import identity
from robust.proofs.exact.polynomials import Decision, proved, refuted, to_rational, undecided
from robust.proofs.search.bands import TIME_CAP, GainBound, climb

#: Rounding of stored numbers, relative to the terms whose sum is a response: where a plant almost
#: vanishes, at a zero on the axis or at infinity, its Delta is the quotient of two roundings.
#: Systems in random coordinates have up to some 1e-14.
_ROUNDING = 1e-12
_POLE_ROUNDING = 1e-13  # the same for a pole: some 500 roundings of doubles


@value(copy=False)
class _Terms:
    """The terms of E = X Delta Y at a point:

    E, X X~ and Y~ Y, and the rounding that may add to X X~.
    """

    E: Pair
    left: ExactMatrix
    right: ExactMatrix
    more: ExactMatrix

    def below(self, level: float) -> ExactMatrix:
        """Return the matrix that is positive iff a Delta of gain below the level exists."""
        left = self.left.times(to_rational(level) ** 2) + self.more
        return join_blocks([[left, self.E[0]], [self.E[1], self.right]])

    def least_level(self) -> float:
        """Return the gain of the smallest Delta."""
        found = self.left.inverse * (self.E[0] * self.right.inverse * self.E[1] - self.more)
        return float(np.sqrt(max(0.0, np.linalg.eigvals(to_numbers(found)).real.max())))


@value(copy=False)
class Deviation:
    """The deviation of a plant from a nominal, as exact systems, with E, X and Y by their values,
    over given bands.
    """

    parts: tuple[TransferMatrix, ...]
    terms: Callable[[Sequence[Pair]], _Terms]
    dt: float
    bands: tuple[tuple[float, float], ...]

    def is_within(self, level: float, time_cap: float = TIME_CAP) -> Decision:
        """Decide if the smallest Delta has at most this gain at every frequency."""
        deadline = time.thread_time() + time_cap
        for low, high in self.bands:
            pieces = cut_at_crossings(
                self.parts,
                lambda pairs: self.terms(pairs).below(level),
                low=low,
                high=high,
                deadline=deadline,
            )
            if isinstance(pieces, str):
                return undecided(pieces)
            if outside := [piece.x for piece in pieces if not piece.M.is_positive]:
                return refuted("outside there", to_float(outside[0]))
        return proved()

    def bound(self, omega: float, tolerance: float, time_cap: float = TIME_CAP) -> GainBound:
        """Bound the gain of the smallest Delta over all frequencies, beginning at omega [rad/s]."""
        return climb(
            self.parts,
            lambda level: lambda pairs: self.terms(pairs).below(level),
            lambda pairs: self.terms(pairs).least_level(),
            starts=points_of_band((omega, omega), self.dt)[:1],
            bands=self.bands,
            dt=self.dt,
            tolerance=tolerance,
            deadline=time.thread_time() + time_cap,
        )


def block_deviation(
    row: MatrixForm,
    G: control.StateSpace,
    G_p: control.StateSpace,
    *,
    W_l: control.StateSpace,
    W_r: control.StateSpace,
    omega: np.ndarray,
) -> Deviation:
    """Return the deviation of a plant from a nominal in a form; omega : frequencies [rad/s] of its
    weights.
    """
    left, right = row.factors
    known = {"G": G, "G_p": G_p}
    gains = [
        np.linalg.norm(response_by_channel(W, omega), axis=axis) for W, axis in ((W_l, 1), (W_r, 0))
    ]
    if (
        left and right
    ):  # both vanish with the plant, and only the product of the added terms matters there
        units, share = (1 / gains[0].max(axis=1), 1 / gains[1].max(axis=1)), np.sqrt(_ROUNDING)
    else:  # the other one is a weight, and E has its units
        units, share = (gains[1].min(axis=1), gains[0].min(axis=1)), _ROUNDING
    more = {}
    if left:
        more["X"] = _with_rounded_inputs(known[left], units[0] / share)
    if right:
        more["Y"] = _with_rounded_outputs(known[right], units[1] / share)

    def terms(pairs: Sequence[Pair]) -> _Terms:
        at = dict(zip(("G", "G_p", "W_l", "W_r"), pairs, strict=False))
        rest = dict(zip(more, pairs[4:], strict=True))
        if left:
            X = multiply(at[left], at["W_l"])
        else:
            X = at["W_l"]
        if right:
            Y = multiply(at["W_r"], at[right])
        else:
            Y = at["W_r"]
        square, other = X[0] * X[1], Y[1] * Y[0]
        return _Terms(
            E=subtract(at["G_p"], at["G"]),
            left=square,
            right=other + rest["Y"][1] * rest["Y"][0] if right else other,
            more=rest["X"][0] * rest["X"][1] if left else square.times(fmpq(0)),
        )

    systems = [TransferMatrix.of(to_matrices(each)) for each in (G, G_p, W_l, W_r)]
    rounded = [TransferMatrix.of(each, own_poles=False) for each in more.values()]
    return Deviation(
        parts=(*systems, *rounded), terms=terms, dt=timebase(G), bands=_known_bands((G, G_p))
    )


def _known_bands(systems: Sequence[control.StateSpace]) -> tuple[tuple[float, float], ...]:
    """Return the bands of the axis without poles that rounding cannot distinguish from it.

    Within `_POLE_ROUNDING` times the sensitivity of such a pole to relative errors in A, a response
    is rounding.
    """
    cuts = []
    for G in systems:
        dt = timebase(G)
        if G.nstates:
            found, left, right = eig(G.A, left=True, right=True)
        else:
            found, left, right = np.zeros(0), *np.zeros((2, 0, 0))
        along = np.abs(np.einsum("ij,ij->j", left.conj(), right))
        with np.errstate(
            divide="ignore", invalid="ignore"
        ):  # a double integrator has no rounding: 0/0
            moved = (
                _POLE_ROUNDING
                * np.einsum("ij,ik,kj->j", np.abs(left), np.abs(G.A), np.abs(right))
                / along
            )
        moved = np.minimum(
            np.nan_to_num(moved, nan=0.0), np.sqrt(_POLE_ROUNDING) * np.linalg.norm(G.A)
        )
        for p, reach in zip(found, moved, strict=True):
            if abs(abs(p) - 1 if dt else p.real) <= reach and p.imag >= 0:
                if dt:
                    at, reach = float(np.angle(p)) / dt, reach / dt
                else:
                    at, reach = p.imag, reach
                cuts.append(points_of_band((max(at - reach, 0.0), at + reach), dt))
    cuts.sort()
    starts = [0.0, *np.maximum.accumulate([high for _, high in cuts]).tolist()]
    stops = [*(low for low, _ in cuts), np.inf]
    return tuple(band for band in zip(starts, stops, strict=True) if band[0] < band[1])


def _with_rounded_inputs(G: control.StateSpace, units: np.ndarray) -> Matrices:
    """Return the effect on a plant of a relative change of B by one, each input over its unit."""
    sizes = np.linalg.norm(G.B / units, axis=1)
    return to_matrices(control.StateSpace(G.A, np.diag(sizes), G.C, np.zeros(G.C.shape), G.dt))


def _with_rounded_outputs(G: control.StateSpace, units: np.ndarray) -> Matrices:
    """Return the effect on a plant of a relative change of C by one, each output over its unit."""
    sizes = np.linalg.norm(G.C / units[:, None], axis=0)
    return to_matrices(control.StateSpace(G.A, G.B, np.diag(sizes), np.zeros(G.B.shape), G.dt))


def coprime_deviation(
    G: control.StateSpace,
    G_p: control.StateSpace,
    *,
    weight: control.StateSpace,
    shaping: control.StateSpace,
) -> Deviation:
    """Return the deviation of the coprime factors of a shaped plant from those of the nominal."""
    shaped = [in_series(each, shaping) for each in (G, G_p)]
    one = ExactMatrix.real(identity(1))

    def terms(pairs: Sequence[Pair]) -> _Terms:
        P, P_p, w = pairs
        row = join_blocks([[one, P[0]]]), join_blocks([[one], [P[1]]])
        column = join_blocks([[one], [P_p[0]]]), join_blocks([[one, P_p[1]]])
        X = multiply(w, row)
        left = X[0] * X[1]
        return _Terms(
            E=subtract(P_p, P), left=left, right=column[1] * column[0], more=left.times(fmpq(0))
        )

    parts = tuple(TransferMatrix.of(to_matrices(each)) for each in (*shaped, weight))
    return Deviation(parts=parts, terms=terms, dt=timebase(G), bands=_known_bands(shaped))


def right_roots(system: control.StateSpace, *, inverse: bool) -> int:
    """Return the number of poles (inverse form: zeros) outside the stability region."""
    dt = timebase(system)
    if not inverse:
        return unstable_poles(system, dt)
    found = zeros(system)
    return int(np.sum(np.abs(found) > 1 + 1e-9 if dt else found.real > 1e-9 * (1 + np.abs(found))))


def require_equal_roots(form: str, systems: Sequence[control.StateSpace], *, inverse: bool) -> None:
    """Require plants with as many poles (or zeros) in the right half plane as the nominal."""
    own, *counts = (right_roots(system, inverse=inverse) for system in systems)
    if set(counts) - {own}:
        raise ValueError(
            f"form must be {'one that is not' if inverse else 'an'} inverse if the number of"
            f" {'zeros' if inverse else 'poles'} in the right half plane differs, got {form} with"
            f" {own} for the nominal and {min(counts)} to {max(counts)} for the plants"
        )
