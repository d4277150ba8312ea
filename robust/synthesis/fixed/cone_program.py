"""One convex step of the fixed-structure design: second-order cones, line by line.

The unknowns are the parameters of K = X/Y; and |Y| and |X|, if a demand contains the sum of both.
The parameters are in coordinates eta in which the columns of Y/|P_c| and |c| X/|P_c| are
orthonormal, with the centre c of the disc of plants and P_c = Y + c X of the previous iterate. A
modulus on the small side of a demand is a cone. One on the large side is replaced by a lower bound
from the previous iterate:

    |R| >= Re(R R_c*)/|R_c|     for hard demands
    |R|^2 >= 2 Re(R R_c*) - |R_c|^2     for the level that is minimised: a^2 <= level |R|^2 is a rotated cone

Both are exact at the previous iterate, so the previous iterate stays feasible, and no step makes
the result worse (Karimi & Kammer, Automatica 85 (2017), eq. 22 to 26).
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.values import value
from robust.synthesis.conic import solve_conic

_MAX_STEP_RATIO = 100.0


@value
class Demand:
    """One demand: sqrt((a |Y| + b |X|)^2 + (c |X|)^2) <= |y Y + x X| on the lines of `index`.

    Fields
    ------
    name : str
        Description of the demand.
    index : (R,) ndarray of int
        Lines of the demand.
    a, b, c : (R,) ndarray
    y, x : (R,) complex ndarray
    """

    name: str
    index: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    y: np.ndarray
    x: np.ndarray

    def on(self, mask: np.ndarray) -> Demand:
        """Return the demand on the lines of a mask, with indices among those."""
        keep = mask[self.index]
        place = np.cumsum(mask) - 1
        parts = {name: getattr(self, name)[keep] for name in "abcyx"}
        return Demand(name=self.name, index=place[self.index[keep]], **parts)

    def measure(self, Y: np.ndarray, X: np.ndarray) -> np.ndarray:
        """Return (..., R) left side over right side, from Y and X on all lines: at most one if the
        demand is met.
        """
        Y, X = Y[..., self.index], X[..., self.index]
        size = np.abs(X)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = np.hypot(self.a * np.abs(Y) + self.b * size, self.c * size) / np.abs(
                self.y * Y + self.x * X
            )
        return np.where(np.isnan(ratio), np.inf, ratio)

    def measure_between(self, Y: np.ndarray, X: np.ndarray, omega: np.ndarray) -> np.ndarray:
        """Return (...,) largest `measure`, with the right side on a straight line between two
        lines.

        A loop that passes near -1 between two lines is small on the chord; omega (W,) shows where a
        plant ends.
        """
        Y, X = Y[..., self.index], X[..., self.index]
        with np.errstate(all="ignore"):
            K = np.abs(X / Y)
            left, right = np.hypot(self.a + self.b * K, self.c * K), self.y + self.x * X / Y
            start, way = right[..., :-1], np.diff(right, axis=-1)
            share = np.clip(np.nan_to_num(-(start * way.conj()).real / np.abs(way) ** 2), 0.0, 1.0)
            ratio = (left[..., :-1] + share * np.diff(left, axis=-1)) / np.abs(start + share * way)
            ratio = np.where(np.diff(omega[self.index]) > 0, ratio, 0.0)
        ratio = np.concatenate([ratio, (left / np.abs(right))[..., -1:]], axis=-1)
        return np.asarray(np.where(np.isnan(ratio), np.inf, ratio).max(axis=-1))


@value(copy=False)
class Rows:
    """Demands of one kind, over their own previous |R_c|: line (H,), a, b, c (H,) and Re(R/R_c) (H,
    n).
    """

    line: np.ndarray
    a: np.ndarray
    b: np.ndarray
    c: np.ndarray
    R: np.ndarray


@value(copy=False)
class Step:
    """The numbers of one convex step, in eta."""

    eta: np.ndarray  # (n,) coordinates of the previous iterate
    # Y, X: (F, n) complex Y and |c| X over the previous |P_c|
    Y: np.ndarray
    X: np.ndarray
    # hard, aim: hard demands; demands whose level is minimised
    hard: Rows
    aim: Rows
    linear: np.ndarray  # (Q, n) linear @ eta >= 0
    # gain, scale: (n,) the functional maximised without an aim, and the one kept at one meanwhile
    gain: np.ndarray
    scale: np.ndarray


def solve_step(step: Step) -> tuple[np.ndarray | None, str]:
    """Return eta, or None with the reason of a failure; the caller judges the result.

    The unknowns are eta, |Y| and |X| on lines with a demand that adds the two, and the level. An
    expression is a matrix over these and one. A cone is a list of expressions: on each line the
    first is at least the norm of the others.
    """
    hard, aim, n = step.hard, step.aim, step.eta.size
    adds_hard, adds_aim = ((rows.a > 0) & (rows.b > 0) for rows in (hard, aim))
    lines = np.unique(np.concatenate([hard.line[adds_hard], aim.line[adds_aim]]))
    place = np.zeros(step.Y.shape[0], dtype=int)
    place[lines] = np.arange(lines.size)
    unknown = np.eye(n + 2 * lines.size + 2)
    sizes = unknown[n : n + lines.size], unknown[n + lines.size : -2]
    level, one = unknown[[-2]], unknown[[-1]]

    def of_eta(matrix: np.ndarray) -> np.ndarray:
        return np.asarray(matrix @ unknown[:n])

    def parts(matrix: np.ndarray) -> list[np.ndarray]:
        return [of_eta(matrix.real), of_eta(matrix.imag)]

    def added(rows: Rows, pick: np.ndarray) -> np.ndarray:
        at = place[rows.line[pick]]
        return np.asarray(rows.a[pick, None] * sizes[0][at] + rows.b[pick, None] * sizes[1][at])

    def alone(rows: Rows, pick: np.ndarray) -> list[np.ndarray]:
        a, line = rows.a[pick, None], rows.line[pick]
        return parts(np.where(a > 0, a * step.Y[line], rows.b[pick, None] * step.X[line]))

    # bounds the step if improvement has no limit
    cones = [
        [_MAX_STEP_RATIO * float(np.linalg.norm(step.eta)) * one, *(unknown[[k]] for k in range(n))]
    ]
    cones += [
        [size, *parts(part[lines])] for size, part in zip(sizes, (step.Y, step.X), strict=True)
    ]
    cones.append([of_eta(hard.R[~adds_hard]), *alone(hard, ~adds_hard)])
    positive = [of_eta(step.linear), of_eta(hard.R[adds_hard]) - added(hard, adds_hard)]
    zero = of_eta(step.scale[None]) - one
    goal = -of_eta(step.gain)
    if aim.line.size:
        goal, zero = level[0], zero[:0]
        for pick, small in ((adds_aim, [added(aim, adds_aim)]), (~adds_aim, alone(aim, ~adds_aim))):
            ones = np.zeros(np.count_nonzero(pick), dtype=int)
            square, wide = 2 * of_eta(aim.R[pick]) - one[ones], level[ones]
            if np.any(aim.c[pick] > 0):
                small = small + parts(aim.c[pick, None] * step.X[aim.line[pick]])
            cones.append([wide + square, *(2 * part for part in small), wide - square])
    cones = [cone for cone in cones if len(cone[0])]
    by_line = [np.stack(cone, axis=1).reshape(-1, len(one[0])) for cone in cones]
    rows = np.vstack([zero, *positive, *by_line])
    x, _, failed = solve_conic(
        np.zeros((len(unknown) - 1,) * 2),
        goal[:-1],
        A=-rows[:, :-1],
        b=rows[:, -1],
        zero=len(zero),
        positive=sum(len(part) for part in positive),
        cones=[len(cone) for cone in cones for _ in cone[0]],
    )
    if failed:
        return None, failed
    return x[:n], ""
