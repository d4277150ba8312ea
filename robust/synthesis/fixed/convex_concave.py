"""The convex-concave iteration from a stabilising controller to a local optimum.

K = F X/Y,  P = Y + G F X.  |P|^2 >= 2 Re(P P_c*) - |P_c|^2 with the previous iterate P_c turns every demand into
a convex one that holds at P_c, and P keeps the winding number of P_c: a stable loop stays stable.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf._base.values import value
from robust._base.states import Stability
from robust.lti.stability import unstable_poles
from robust.synthesis.fixed.cone_program import Demand, Rows, Step, solve_step
from robust.synthesis.fixed.plants import PlantOnLines
from robust.synthesis.fixed.starts import loops_stable
from robust.synthesis.fixed.structures import Basis

_WORKING_LINES = 80
_TOLERANCE = 1e-6
_STEP_GAIN = 1e-4
_HALVINGS = 8  # of the path to the point where the demands are met
_MAX_GAIN_RATIO = 1e6  # gain at low frequency over the first one, above which no demand limits it


@value
class DesignTask:
    """The data of a design: the lines, the demands, and the columns of Y and F X on the lines."""

    basis: Basis
    family: list[PlantOnLines]
    at: PlantOnLines
    aim: str
    rows: list[Demand]
    gamma: Demand | None
    stable: bool
    positive: bool
    n_unstable: int
    Y: np.ndarray
    X: np.ndarray

    @property
    def objective(self) -> Demand | None:
        """Return the demand that is minimised, if the aim is gamma."""
        if self.aim == "gamma":
            return self.gamma
        return None

    def split(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return (W,) Y and F X; by sums, because the threads of a matrix product cost more than
        they save here.
        """
        return (self.Y * theta).sum(axis=1), (self.X * theta).sum(axis=1)

    def loop(self, theta: np.ndarray) -> np.ndarray:
        """Return (W,) P = Y + G F X, about the centre of the discs."""
        Y, X = self.split(theta)
        return Y + self.at.centre * X

    def hard(self, theta: np.ndarray) -> float:
        """Return the worst demand, at most one if all are met."""
        Y, X = self.split(theta)
        return max((float(row.measure(Y, X).max()) for row in self.rows), default=0.0)

    def goal(self, theta: np.ndarray) -> float:
        """Return the quantity to minimise once the demands are met: gamma, or minus the gain at low
        frequency.
        """
        if self.objective is not None:
            return float(self.objective.measure(*self.split(theta)).max())
        Y0, X0 = self.basis.zero_frequency()
        size = abs(float(Y0 @ theta)) + 1e-9 * float(np.abs(Y0 * theta).sum())
        return (
            -abs(float(X0 @ theta)) / size if size else np.inf
        )  # a step that ends without a denominator

    def merit(self, theta: np.ndarray) -> tuple[float, float]:
        """Return the merit: demands first, then the goal."""
        return max(self.hard(theta), 1 + _TOLERANCE), self.goal(theta)

    def decide_stability(self, old: np.ndarray, new: np.ndarray) -> tuple[Stability, str]:
        """Return STABLE if loop and controller keep their numbers of unstable poles from old to
        new, or the reason.
        """
        P_old, P = self.loop(old), self.loop(new)
        if not np.all((P * P_old.conj()).real[self.at.known] > 0):
            return Stability.UNSTABLE, "the number of unstable poles of the loop may change"
        if not np.all(linear_rows(self, old) @ new >= 0):
            return Stability.UNSTABLE, "the number of unstable poles of the controller may change"
        zeros, poles = self.basis.zeros_and_poles(new)
        if (
            zeros.size > poles.size
        ):  # a pole of the start beyond the fastest one has gone to infinity
            return Stability.UNSTABLE, "the controller is not proper"
        K = self.basis.controller(new)
        if self.stable and unstable_poles(K, self.basis.dt):
            return Stability.UNSTABLE, "the controller is unstable"
        return loops_stable(K, self.family, self.n_unstable)


def linear_rows(task: DesignTask, theta: np.ndarray) -> np.ndarray:
    """Return (Q, n), rows @ theta >= 0: the controller stays proper, stable; on request real roots,
    positive gains.
    """
    basis, n_y = task.basis, task.basis.n_y
    shape = basis.structure
    if not shape.free:
        scale = np.concatenate([np.sign(theta[:1]), np.zeros(basis.n_x)])[None, :]
        if task.positive:
            return np.vstack([scale, np.sign(theta[0]) * basis.gain_rows()])
        return scale
    if task.stable:
        # Y must not vanish on the circle through -slowest and -fastest: its roots stay inside
        span = basis.fastest - basis.slowest
        r = np.concatenate([[0.0], np.geomspace(1e-3 * task.at.omega.min(), span, 40)])
        s = -basis.slowest - r**2 / span + 1j * r * np.sqrt(np.maximum(1 - (r / span) ** 2, 0.0))
        Y = basis.unscaled(s, n_y - 1)
    else:
        Y = np.ones((1, n_y), complex)  # at infinite frequency: proper
    old = Y @ theta[:n_y]
    # a pole exactly on the circle: its side is checked afterwards, by the poles
    Y = Y[old != 0]
    old = old[old != 0]
    rows = [np.hstack([(Y / old[:, None]).real, np.zeros((Y.shape[0], basis.n_x))])]
    if shape.real:
        for part, before in ((slice(0, n_y), 0), (slice(n_y, None), n_y)):
            own = theta[part]
            T = np.array([basis.polynomial(e) for e in np.eye(own.size)]).T
            c = T @ own
            signed = np.sign(c[-1]) * T
            c = np.sign(c[-1]) * c
            wanted = [signed]
            if (
                c.size == 3
                # real roots: c2 + c0 <= |(c1, c2 - c0)|, at least its projection on the previous one
            ):
                direction = np.array([c[1], c[0] - c[2]]) / np.hypot(c[1], c[0] - c[2])
                wanted.append(
                    (
                        direction[0] * signed[1]
                        + direction[1] * (signed[0] - signed[2])
                        - signed[0]
                        - signed[2]
                    )[None]
                )
            block = np.vstack(wanted)
            wide = np.zeros((block.shape[0], theta.size))
            wide[:, before : before + own.size] = block
            rows.append(wide)
    return np.vstack(rows)


def _working_lines(task: DesignTask, theta: np.ndarray) -> np.ndarray:
    """Return (W,) bool: the first lines of the program, spread over the band, with the peaks of
    every demand.
    """
    W = task.at.omega.size
    if W <= 1.5 * _WORKING_LINES:
        return np.ones(W, dtype=bool)
    log = np.log(task.at.omega)
    mask = np.zeros(W, dtype=bool)
    for target in np.linspace(log.min(), np.log(task.at.highest), _WORKING_LINES):
        mask[int(np.argmin(np.abs(log - target)))] = True
    return mask | _demand_peaks(task, theta, 8)


def _demand_peaks(task: DesignTask, theta: np.ndarray, most: int) -> np.ndarray:
    """Return (W,) bool: the largest local maxima of each demand, and every line of a demand on few
    lines.
    """
    mask = np.zeros(task.at.omega.size, dtype=bool)
    Y, X = task.split(theta)
    for row in task.rows + ([task.objective] if task.objective is not None else []):
        v = row.measure(Y, X)
        if v.size < 8:
            mask[row.index] = True
            continue
        wide = np.concatenate([[-np.inf], v, [-np.inf]])
        top = np.flatnonzero((v >= wide[:-2]) & (v >= wide[2:]))
        mask[row.index[top[np.argsort(-v[top])][:most]]] = True
    return mask


def _convex_step(
    task: DesignTask, theta: np.ndarray, *, mask: np.ndarray, level: bool
) -> tuple[Step, np.ndarray]:
    """Return the step about theta, and the map from eta back to theta.

    level: the demands themselves are minimised, because one of them is not met yet.
    """
    place = np.cumsum(mask) - 1
    Yb, Xb = task.Y[mask], task.X[mask]
    Yc, Xc = task.split(theta)
    P = Yc + task.at.centre * Xc
    unit = np.abs(task.at.centre)
    unit = np.maximum(unit, 1e-9 * np.median(unit))
    T = np.zeros((theta.size, theta.size))
    for part, size, first in (
        (Yb, 1 / P[mask], 0),
        (Xb, task.at.centre[mask] / P[mask], task.basis.n_y),
    ):
        own = slice(first, first + (task.basis.n_x if first else task.basis.n_y))
        T[own, own] = _orthonormal(part[:, own] * size[:, None])

    def arrays(rows: list[Demand]) -> Rows:
        parts = []
        for row in rows:
            on = mask[row.index]
            i = row.index[on]
            ref = row.y[on] * Yc[i] + row.x[on] * Xc[i]
            ratio = np.abs(P[i]) / np.abs(ref)
            right = (
                (row.y[on, None] * task.Y[i] + row.x[on, None] * task.X[i]) / ref[:, None]
            ).real @ T
            parts.append(
                (
                    place[i],
                    row.a[on] * ratio,
                    row.b[on] * ratio / unit[i],
                    row.c[on] * ratio / unit[i],
                    right,
                )
            )
        if not parts:
            parts.append((np.zeros(0, int), *np.zeros((3, 0)), np.zeros((0, theta.size))))
        line, a, b, c, right = (np.concatenate(p) for p in zip(*parts, strict=True))
        return Rows(line=line, a=a, b=b, c=c, R=right)

    aims = task.rows
    if not level:
        if task.objective is None:
            aims = []
        else:
            aims = [task.objective]
    linear = linear_rows(task, theta) @ T
    Y0, X0 = task.basis.zero_frequency()
    x0 = float(X0 @ theta)
    step = Step(
        eta=np.linalg.solve(T, theta),
        Y=Yb / np.abs(P[mask, None]) @ T,
        X=Xb * (unit / np.abs(P))[mask, None] @ T,
        hard=arrays([] if level else task.rows),
        aim=arrays(aims),
        linear=linear / np.maximum(np.linalg.norm(linear, axis=1, keepdims=True), 1e-300),
        gain=X0 @ T / (x0 if x0 else 1.0),
        scale=Y0 @ T / float(Y0 @ theta),
    )
    return step, T


def _orthonormal(columns: np.ndarray) -> np.ndarray:
    """Return (n, n) T with orthonormal columns @ T, real and imaginary parts taken together."""
    scale = 1 / np.linalg.norm(columns, axis=0)
    R = np.linalg.qr(np.vstack([columns.real, columns.imag]) * scale, mode="r")
    size = np.abs(np.diag(R))
    return scale[:, None] * (np.linalg.inv(R) if size.min() > 1e-13 else np.eye(size.size))


def iterate(
    task: DesignTask,
    starts: list[np.ndarray],
    *,
    n_iterations: int,
    progress: Callable[[int, float], object] | None,
) -> tuple[np.ndarray, tuple[float, ...], str]:
    """Return the best result over the starts: parameters, history and the reason of the end."""
    found = [
        _improve_start(task, theta, n_iterations=n_iterations, progress=progress)
        for theta in starts
    ]
    return min(found, key=lambda result: task.merit(result[0]))


def _improve_start(
    task: DesignTask,
    theta: np.ndarray,
    *,
    n_iterations: int,
    progress: Callable[[int, float], object] | None,
) -> tuple[np.ndarray, tuple[float, ...], str]:
    """Improve one start by convex steps until nothing improves: parameters, history and the reason
    of the end.
    """
    mask = _working_lines(task, theta)
    history: list[float] = []
    slow, why, first = 0, "converged", task.merit(theta)[1]
    for k in range(n_iterations):
        level = task.hard(theta) > 1 + _TOLERANCE
        step, T = _convex_step(task, theta, mask=mask, level=level)
        eta, trouble = solve_step(step)
        if eta is None:
            why = f"{trouble}; the previous controller is kept"
            break
        new = T @ eta
        before = task.merit(theta)
        best, open_question = _line_search(task, theta, new)
        after = task.merit(best)
        missed = _demand_peaks(task, new, 6) & ~mask
        if missed.any() and not is_lower(after, before, 1e-2):
            mask = mask | missed  # the lines that limited the step were not in the program
            if not is_lower(after, before, 0.0):
                continue
        if is_lower(after, before, _STEP_GAIN):
            slow = 0
        else:
            slow = slow + 1
        if is_lower(after, before, 0.0):
            theta = best / np.linalg.norm(best)
        history.append(after[0] if after[0] > 1 + _TOLERANCE else abs(after[1]))
        if progress is not None:
            progress(k + 1, history[-1])
        if first < 0 and after[1] < _MAX_GAIN_RATIO * first:
            why = (
                "stopped: the gain at low frequency grows without bound; limit K S, or the"
                " crossover from above"
            )
            break
        if slow >= 2:
            if open_question:
                why = f"ended early: for a better one {open_question}"
            break
    else:
        why = "stopped at the largest number of iterations" if n_iterations else "not iterated"
    return theta, tuple(history), why


def is_lower(after: tuple[float, float], before: tuple[float, float], by: float) -> bool:
    """Return True if a merit is lower by more than a fraction."""
    if after[0] != before[0]:
        return after[0] < before[0] - by * abs(before[0])
    return after[1] < before[1] - by * abs(before[1])


def _line_search(task: DesignTask, old: np.ndarray, new: np.ndarray) -> tuple[np.ndarray, str]:
    """Return the best point of equal stability, on the way to the new iterate and beyond.

    Also return why the stability of a better one is not decided, if that is the first obstacle; ""
    otherwise.
    """
    P_old, P = task.loop(old), task.loop(new)
    new = new / max(
        float(np.median(np.abs(P / P_old))), 1e-300
    )  # the same scale, so that the path is short
    best, merit, obstacle = old, task.merit(old), (Stability.STABLE, "")
    for ladder in ((1.0, 2.0, 4.0, 8.0), (0.7, 0.5, 0.3, 0.1, 0.03)):
        for reach in ladder:
            trial = old + reach * (new - old)
            found = task.merit(trial)
            if found < merit:
                decided = task.decide_stability(old, trial)
            else:
                decided = Stability.STABLE, ""
            if found < merit and decided[0] is Stability.STABLE:
                best, merit = trial, found
            elif reach > 1:
                break
            if not (obstacle[1]):
                obstacle = decided
            if reach < 1 and best is not old:
                break
        if best is not old:
            break
    if task.hard(old) > 1 + _TOLERANCE >= task.hard(best):
        best = _nearest_met(task, old, best)
    state, why = obstacle
    return best, why if state is Stability.UNDECIDED else ""


def _nearest_met(task: DesignTask, old: np.ndarray, met: np.ndarray) -> np.ndarray:
    """Return the first point on the path where the demands are met: a step for them alone gives the
    goal away.
    """
    low, high, best = 0.0, 1.0, met
    for _ in range(_HALVINGS):
        middle = (low + high) / 2
        trial = old + middle * (met - old)
        if task.hard(trial) <= 1 + _TOLERANCE:
            high = middle
            if (
                task.merit(trial) < task.merit(best)
                and task.decide_stability(old, trial)[0] is Stability.STABLE
            ):
                best = trial
        else:
            low = middle
    return best
