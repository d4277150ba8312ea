"""The numerical problem behind `fit_weight`: least mean log excess of |W| over a target that it must cover."""

from __future__ import annotations

import time

import numpy as np

from nlfrf.values import value
from robust.lti import paired
from robust.rational import in_order, numerator, roots_from, starting_poles, vector_fit

# Parameters theta of a weight of order n: zeros first, then poles, each as (log omega, log zeta) of its n // 2
# second-order sections and log omega of a first-order one where n is odd; log_k is the gain at infinity.


@value
class Problem:
    """Points x (N,) on the imaginary axis, the log target there, at zero and at infinity (-inf: no demand there)."""

    x: np.ndarray
    target: np.ndarray
    low: float
    high: float
    floor: np.ndarray

    def excess(self, theta: np.ndarray, log_k: float, order: int) -> tuple[np.ndarray, np.ndarray]:
        """log |W| - target at the points (then zero and infinity, where demanded), and its Jacobian (., 2n+1)."""
        top, d_top, top0 = log_sections(self.x, theta[:order], order)
        bottom, d_bottom, bottom0 = log_sections(self.x, theta[order:], order)
        e = [log_k + top - bottom - self.target]
        J = [np.column_stack([d_top, -d_bottom, np.ones(self.x.size)])]
        if np.isfinite(self.low):
            at_zero = np.concatenate([slope_at_zero(order), -slope_at_zero(order), [1.0]])
            e.append(np.array([log_k + top0 - bottom0 - self.low]))
            J.append(at_zero[None, :])
        if np.isfinite(self.high):
            e.append(np.array([log_k - self.high]))
            J.append(np.concatenate([np.zeros(2 * order), [1.0]])[None, :])
        return np.concatenate(e), np.vstack(J)

    def clipped(self, theta: np.ndarray, order: int) -> np.ndarray:
        """Sections kept near the band, zeros too broad to hide between two points."""
        theta = theta.copy()
        span = (np.log(self.x[0]) - 7.0, np.log(self.x[-1]) + 7.0)
        for start in (0, order):
            for k in range(start, start + order - order % 2, 2):
                theta[k] = np.clip(theta[k], *span)
                least = np.interp(theta[k], np.log(self.x), self.floor) if start == 0 else np.log(1e-7)
                theta[k + 1] = np.clip(theta[k + 1], least, 5.0)
            if order % 2:
                theta[start + order - 1] = np.clip(theta[start + order - 1], *span)
        return theta


def log_sections(x: np.ndarray, theta: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Sum of log |section(j x)|, its Jacobian, and the sum at zero."""
    total, slopes, at_zero = np.zeros(x.size), [], 0.0
    x2 = x * x
    for k in range(0, n - n % 2, 2):
        w2, damping = np.exp(2 * theta[k]), 4 * np.exp(2 * (theta[k] + theta[k + 1])) * x2
        gap = w2 - x2
        square = gap * gap + damping
        total += 0.5 * np.log(square)
        slopes += [(2 * w2 * gap + damping) / square, damping / square]
        at_zero += 2 * theta[k]
    if n % 2:
        w2 = np.exp(2 * theta[-1])
        total += 0.5 * np.log(w2 + x2)
        slopes.append(w2 / (w2 + x2))
        at_zero += theta[-1]
    return total, np.column_stack(slopes), float(at_zero)


def slope_at_zero(n: int) -> np.ndarray:
    """Derivative of the log gain of the sections at zero frequency by their parameters."""
    return np.array([2.0, 0.0] * (n // 2) + [1.0] * (n % 2))


def starts(problem: Problem, order: int) -> list[np.ndarray]:
    """Parameters to start from: a rational fit of |W|^2, sections spread over the band, sections on the peaks."""
    found = [spread(problem, order), on_peaks(problem, order)]
    fitted = magnitude_fit(problem, order)
    return found if fitted is None else [fitted, *found]


def spread(problem: Problem, order: int) -> np.ndarray:
    """Well damped sections evenly over log frequency, zeros next to poles."""
    half = order // 2
    centres = np.linspace(np.log(problem.x[0]), np.log(problem.x[-1]), half + order % 2 + 2)[1:-1]
    pairs = np.column_stack([centres[:half], np.zeros(half)]).ravel()
    zeros = np.concatenate([pairs, centres[half:] if order % 2 else []])
    return np.concatenate([zeros + 0.1, zeros - 0.1])


def on_peaks(problem: Problem, order: int) -> np.ndarray:
    """Lightly damped sections on the highest peaks of the target, the rest spread."""
    theta = spread(problem, order)
    log_x, t = np.log(problem.x), problem.target
    width = max(1, t.size // 40)
    taken = np.zeros(t.size, dtype=bool)
    for k in range(order // 2):
        free = np.where(taken, -np.inf, t)
        peak = int(np.argmax(free))
        if taken[peak]:
            break
        beside = t[max(0, peak - width) : peak + width + 1]
        sharp = np.clip(np.exp(-(t[peak] - beside.min())), 1e-3, 0.5)
        theta[2 * k], theta[2 * k + 1] = log_x[peak], np.log(0.7)
        theta[order + 2 * k], theta[order + 2 * k + 1] = log_x[peak], np.log(sharp)
        taken[max(0, peak - 2 * width) : peak + 2 * width + 1] = True
    return theta


def magnitude_fit(problem: Problem, order: int) -> np.ndarray | None:
    """|W|^2 is rational in y = -x^2: vector fitting there, then the stable square roots of poles and zeros."""
    scale = np.exp(np.mean(np.log(problem.x)))
    pick = slice(None, None, max(1, problem.x.size // 500))
    x, power = problem.x[pick] / scale, np.exp(2 * (problem.target[pick] - problem.target.mean()))
    y = -(x * x) + 0j
    guess = starting_poles(order, x[0], x[-1], spacing="log")
    damped = np.where(guess.imag == 0, guess, -0.2 * np.abs(guess.imag) + 1j * guess.imag)
    try:
        q = vector_fit(y, power + 0j, 1 / power, in_order(damped**2), n_iterations=8, stable=False)
        z, _ = numerator(y, power + 0j, 1 / power, q, order)
    except np.linalg.LinAlgError:
        return None
    if z.size != order or q.size != order or not (np.isfinite(z).all() and np.isfinite(q).all()):
        return None
    theta = np.concatenate([from_square(z), from_square(q)])
    shift = slope_at_zero(order) > 0
    theta[np.concatenate([shift, shift])] += np.log(scale)
    return problem.clipped(theta, order)


def from_square(q: np.ndarray) -> np.ndarray:
    """Parameters of the stable square roots of q; one on the negative axis would be undamped and gets damping."""
    p = -np.sqrt(q.astype(complex))
    axis = np.abs(p.real) < 1e-9 * np.abs(p)
    p = np.where(axis, -np.abs(p), p)
    pairs, rest = paired(in_order(np.where(np.abs(p.imag) < 1e-9 * np.abs(p), p.real, p)))
    theta: list[float] = []
    for a, b in pairs:
        w = np.sqrt(max(abs(a * b), 1e-30))
        theta += [np.log(w), np.log(max(-(a + b).real / (2 * w), 1e-7))]
    return np.array(theta + [np.log(max(abs(r), 1e-15)) for r in rest])


def asymmetric(
    problem: Problem, theta: np.ndarray, order: int, below: tuple[float, ...], n_iterations: int
) -> tuple[np.ndarray, float]:
    """Least squares on the log excess, where lying below the target costs below^2 times as much."""
    theta, log_k = theta.copy(), 0.0
    log_k = -float(np.mean(problem.excess(theta, 0.0, order)[0][: problem.x.size]))
    damping = 1e-2
    for factor in below:
        e, J = problem.excess(theta, log_k, order)
        w = np.where(e < 0, factor**2, 1.0)
        cost = float(w @ e**2)
        for _ in range(n_iterations):
            H, g = J.T @ (w[:, None] * J), J.T @ (w * e)
            size = np.diag(H).copy() + 1e-12 * np.trace(H)
            before = cost
            for _ in range(8):
                step = np.linalg.solve(H + np.diag(damping * size), -g)
                trial = problem.clipped(theta + np.clip(step[:-1], -2, 2), order)
                e2, J2 = problem.excess(trial, log_k + step[-1], order)
                w2 = np.where(e2 < 0, factor**2, 1.0)
                if (cost2 := float(w2 @ e2**2)) < cost:
                    theta, log_k, e, J, w, cost = trial, log_k + step[-1], e2, J2, w2, cost2
                    damping = max(damping / 6, 1e-12)
                    break
                damping = min(damping * 5, 1e8)
            if not cost < before * (1 - 1e-4) and cost > 1e-20:
                break
    return theta, log_k


def polished(
    problem: Problem, theta: np.ndarray, log_k: float, order: int, deadline: float
) -> tuple[np.ndarray, float]:
    """Least mean excess with none negative: a logarithmic barrier, lowered until the gap is a hundredth of a dB."""
    n = problem.x.size
    e, J = problem.excess(theta, log_k, order)
    log_k += 0.02 - e.min()
    e = e + 0.02 - e.min()
    damping = 1e-2
    mean_slope = np.zeros(e.size)
    mean_slope[:n] = 1 / n

    def objective(e: np.ndarray, mu: float) -> float:
        return float(mean_slope @ e - mu * np.mean(np.log(e))) if e.min() > 0 else np.inf

    for mu in (0.1, 0.02, 0.005, 0.001):
        cost = objective(e, mu)
        for _ in range(12):
            g = J.T @ (mean_slope - mu / (e.size * e))
            H = J.T @ ((mu / (e.size * e * e))[:, None] * J)
            size = np.diag(H).copy() + 1e-9 * np.trace(H)
            before = cost
            for _ in range(8):
                step = np.linalg.solve(H + np.diag(damping * size), -g)
                trial = problem.clipped(theta + np.clip(step[:-1], -1, 1), order)
                e2, J2 = problem.excess(trial, log_k + step[-1], order)
                if (cost2 := objective(e2, mu)) < cost:
                    theta, log_k, e, J, cost = trial, log_k + step[-1], e2, J2, cost2
                    damping = max(damping / 5, 1e-9)
                    break
                damping = min(damping * 4, 1e9)
            if cost > before - 1e-4 * mu - 1e-7 or time.monotonic() > deadline:
                break
    return theta, log_k - float(e.min())


def zeros_and_poles(theta: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots behind the parameters."""
    return (
        in_order(roots_from(theta[:order], order, log=True)),
        in_order(roots_from(theta[order:], order, log=True)),
    )
