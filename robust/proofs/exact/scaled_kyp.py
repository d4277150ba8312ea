"""Proof that the structured singular value is below a level at every frequency, by one matrix P and
one scaling for all frequencies.

With X_L > 0 and X_R > 0 that commute with the perturbation (Delta X_L = X_R Delta), G skew on the
repeated real blocks, and P > 0, the inequality

    [A'P + PA, PB; B'P, 0] + [C D]' X_L [C D] - [0; I] G [C D] - [C D]' G' [0 I] - level^2 [0 0; 0
    X_R] < 0

(in discrete time its counterpart) proves that the system is stable, and that no perturbation of the
structure with a gain of up to 1/level makes its loop unstable. The inequality is assembled over the
rationals from the stored numbers, so the proof does not depend on how these numbers were found.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated, TypeAlias

import numpy as np
from flint import fmpq

from nlfrf._base.values import value
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim_files import SQUARE
from robust.proofs.exact.matrices import positive_definite, stack
from robust.proofs.exact.polynomials import (
    Decision,
    proved,
    to_rational,
    to_rational_matrix,
    undecided,
)

_KINDS = ("full", "repeated", "real")


Block: TypeAlias = tuple[int, int, str]


def require_blocks(system: Matrices, blocks: Sequence[Block], level: float) -> list[int]:
    """Return the sizes of the scalings of blocks that fit a system; refuse blocks that do not."""
    outputs, inputs = sum(block[0] for block in blocks), sum(block[1] for block in blocks)
    if system.D.shape != (outputs, inputs):
        raise ValueError(f"blocks must add up to D, got {blocks} for shape {system.D.shape}")
    for rows, cols, kind in blocks:
        if kind not in _KINDS or rows < 1 or cols < 1 or (kind != "full" and rows != cols):
            raise ValueError(
                f"blocks must be (rows, cols, kind) of a known kind, got {(rows, cols, kind)}"
            )
    if not (np.isfinite(level) and level > 0):
        raise ValueError(f"level must be positive, got {level}")
    return [1 if kind == "full" else rows for rows, _, kind in blocks]


@value
class ScaledClaim:
    """A claim on a system, with the matrices that prove it."""

    # stable; its structured singular value stays below the level at every frequency
    system: Matrices
    # kinds as in `robust.mu`: "full" (any matrix), "repeated" (a number times the identity), "real"
    # (a real one)
    blocks: tuple[Block, ...]
    level: float  # the level
    P: Annotated[
        np.ndarray, SQUARE
    ]  # (n, n) P in the coordinates z = T x; in the states x of the system it is T' P T
    T: Annotated[np.ndarray, SQUARE]  # (n, n) coordinates
    # X of each block: (1, 1) for a full block, (rows, rows) and symmetric for the others
    scalings: tuple[np.ndarray, ...]
    skews: tuple[
        np.ndarray, ...
    ]  # G of each block: (rows, rows) with G' = -G for a real block, else zero

    def __post_init__(self) -> None:
        n, sizes = self.system.order, require_blocks(self.system, self.blocks, self.level)
        wanted = {"P": [n], "T": [n], "scalings": sizes, "skews": sizes}
        for name, sides in wanted.items():
            if name in "PT":
                given = (getattr(self, name),)
            else:
                given = getattr(self, name)
            if [M.shape for M in given] != [(side, side) for side in sides]:
                raise ValueError(
                    f"{name} must fit system and blocks, got {[M.shape for M in given]}"
                )
            if not all(M.dtype == np.float64 and np.isfinite(M).all() for M in given):
                raise ValueError(f"{name} must hold finite numbers")

    @property
    def storage(self) -> np.ndarray:
        """P in the states of the system, symmetric, rounded to doubles."""
        P = self.T.T @ self.P @ self.T
        return np.asarray((P + P.T) / 2)

    def decide(self) -> dict[str, Decision]:
        """Decide stability and level.

        >>> one = np.ones((1, 1))
        >>> lag = Matrices(A=-one, B=one, C=one, D=0 * one)                   # 1/(s + 1): mu of one block is one
        >>> known = dict(system=lag, blocks=((1, 1, "full"),), P=one, T=one, scalings=(one,), skews=(0 * one,))
        >>> def at(level): return ScaledClaim(level=level, **known)
        >>> [at(x).decide()["structured singular value"].holds for x in (1.0, np.nextafter(1, 2))]
        [False, True]
        """
        refused = {
            name: undecided(f"{part} does not pass")
            for name, part in ((STABLE, "P"), (LEVEL, "the inequality"))
        }
        A, B, C, D, P, T = (
            to_rational_matrix(M)
            for M in (*(getattr(self.system, name) for name in "ABCD"), self.P, self.T)
        )
        if not all(
            _is_structured(*each)
            for each in zip(self.blocks, self.scalings, self.skews, strict=True)
        ):
            return refused | {
                LEVEL: undecided("the scaling does not commute with the perturbation")
            }
        P = T.transpose() * P * T
        P = (P + P.transpose()) / fmpq(2)
        if self.system.dt:
            top, side, corner = (
                A.transpose() * P * A - P,
                A.transpose() * P * B,
                B.transpose() * P * B,
            )
        else:
            top, side, corner = A.transpose() * P + P * A, P * B, B.transpose() * B * fmpq(0)
        if self.system.order and not (positive_definite(P) and positive_definite(-top)):
            return refused
        X_L, X_R, G = map(
            to_rational_matrix, place_scalings(self.blocks, self.scalings, self.skews)
        )
        top += C.transpose() * X_L * C
        side += C.transpose() * (X_L * D - G.transpose())
        across = G * D
        corner += (
            D.transpose() * X_L * D
            - across
            - across.transpose()
            - X_R * to_rational(self.level) ** 2
        )
        M = stack([[top, side], [side.transpose(), corner]])
        return {STABLE: proved(), LEVEL: proved() if positive_definite(-M) else refused[LEVEL]}


STABLE, LEVEL = "stability", "structured singular value"


def _is_structured(block: tuple[int, int, str], X: np.ndarray, G: np.ndarray) -> bool:
    """Return whether X is symmetric and positive definite, and G skew on a real block, zero on any
    other.
    """
    if (
        not np.array_equal(X, X.T)
        or not np.array_equal(G, -G.T)
        or (block[2] != "real" and G.any())
    ):
        return False
    return positive_definite(to_rational_matrix(X))


def place_scalings(
    blocks: Sequence[Block], scalings: Sequence[np.ndarray], skews: Sequence[np.ndarray]
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return X_L on the outputs of the system, X_R on its inputs, G from outputs to inputs."""
    outputs, inputs = sum(block[0] for block in blocks), sum(block[1] for block in blocks)
    shapes = (outputs, outputs), (inputs, inputs), (inputs, outputs)
    left, right, skew = (np.zeros(shape, np.result_type(*scalings)) for shape in shapes)
    r = c = 0
    for (rows, cols, kind), X, G in zip(blocks, scalings, skews, strict=True):
        at, into = slice(r, r + rows), slice(c, c + cols)
        left[at, at], right[into, into] = (
            (X[0, 0] * np.eye(rows), X[0, 0] * np.eye(cols)) if kind == "full" else (X, X)
        )
        if kind == "real":
            skew[into, at] = G
        r, c = r + rows, c + cols
    return left, right, skew
