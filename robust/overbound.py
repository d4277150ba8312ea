"""The numerical problem behind `fit_weight`: least mean log excess of |W| over a target that it must cover."""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np

from nlfrf.values import value
from robust.lti import paired
from robust.rational import in_order, numerator, roots_from, starting_poles, vector_fit

EXACT = 1e-4  # log error under which a weight is taken to be the target itself
FINE = 0.01  # mean log excess, 0.09 dB, under which no other start is tried

# Parameters theta of a weight of order n: zeros first, then poles, each as (log omega, log zeta) of its n // 2
# second-order sections and log omega of a first-order one where n is odd; log_k is the gain at infinity.


@value
class Problem:
    """Points x (N,) on the imaginary axis, the log target there, at zero and at infinity (-inf: no demand there).

    floor (N,) is the log of the smallest zero damping allowed near each point (poles: a third), share (N,) what a
    point counts for in the mean.
    """

    x: np.ndarray
    target: np.ndarray
    low: float
    high: float
    floor: np.ndarray
    share: np.ndarray
    log_x: np.ndarray

    def excess(self, theta: np.ndarray, log_k: float, order: int) -> tuple[np.ndarray, np.ndarray]:
        """log |W| - target at the points (then zero and infinity, where demanded), and its Jacobian (., 2n+1)."""
        top, d_top, top0 = log_sections(self.x, theta[:order], order)
        bottom, d_bottom, bottom0 = log_sections(self.x, theta[order:], order)
        N = self.x.size
        J = np.zeros((N + 2 * bool(np.isfinite(self.low)), 2 * order + 1))
        J[:N, :order], J[:N, order:-1], J[:, -1] = d_top.T, -d_bottom.T, 1.0
        e = log_k + top - bottom - self.target
        if np.isfinite(self.low):
            J[N, :order], J[N, order:-1] = slope_at_zero(order), -slope_at_zero(order)
            e = np.concatenate([e, [log_k + top0 - bottom0 - self.low, log_k - self.high]])
        return e, J

    def mean_excess(self, theta: np.ndarray, log_k: float, order: int) -> float:
        """Mean of log |W| - target over the points."""
        return float(self.share @ self.excess(theta, log_k, order)[0][: self.x.size])

    def clipped(self, theta: np.ndarray, order: int) -> np.ndarray:
        """Sections kept near the band, zeros too broad to hide between two points."""
        theta = theta.copy()
        # far outside the band a corner is free to go anywhere, and would
        reach = 2.0 if np.isfinite(self.low) else 7.0
        low, high = self.log_x[0] - reach, self.log_x[-1] + reach
        m = order - order % 2
        for start, zeros in ((0, True), (order, False)):
            w, zeta = slice(start, start + m, 2), slice(start + 1, start + m, 2)
            theta[w] = np.minimum(np.maximum(theta[w], low), high)
            least = np.interp(theta[w], self.log_x, self.floor) - (0.0 if zeros else 1.2)
            theta[zeta] = np.minimum(np.maximum(theta[zeta], least), 5.0)
            if order % 2:
                theta[start + order - 1] = min(max(theta[start + order - 1], low), high)
        return theta

    def coarse(self, most: int) -> Problem:
        """The same demand on fewer points: both ends of each group, with the highest target of the group."""
        if self.x.size <= 1.2 * most:
            return self
        # groups evenly over the index, over log frequency (lines of a multisine crowd at the top of the band), and over
        # the ups and downs of the target, its line-to-line scatter smoothed away
        width = max(1, self.x.size // 150)
        smooth = np.convolve(np.pad(self.target, width, mode="edge"), np.ones(width) / width, mode="same")[width:-width]
        steps = [np.ones(self.x.size - 1), np.diff(self.log_x), np.sqrt(np.abs(np.diff(smooth)) + 1e-12)]
        travelled = np.concatenate([[0.0], np.cumsum(sum(step / step.sum() for step in steps))])
        edges = np.searchsorted(travelled, np.linspace(0, travelled[-1], most // 2 + 1)[1:-1])
        edges = np.unique(np.concatenate([[0], edges, [self.x.size]]))
        pick = np.unique(np.concatenate([edges[:-1], edges[1:] - 1]))
        group = np.searchsorted(edges, pick, side="right") - 1
        share = np.add.reduceat(self.share, edges[:-1])[group] / np.bincount(group)[group]
        return Problem(
            x=self.x[pick],
            target=np.maximum.reduceat(self.target, edges[:-1])[group],
            low=self.low,
            high=self.high,
            floor=np.maximum(self.floor[pick], floor_of(self.log_x[pick])),
            share=share,
            log_x=self.log_x[pick],
        )

    def thinned(self, most: int) -> Problem:
        """Every so-manieth point, as it is."""
        step = max(1, self.x.size // most)
        return Problem(
            x=self.x[::step],
            target=self.target[::step],
            low=self.low,
            high=self.high,
            floor=self.floor[::step],
            share=np.full(self.x[::step].size, 1 / self.x[::step].size),
            log_x=self.log_x[::step],
        )


def problem_on(x: np.ndarray, target: np.ndarray, *, ends: bool, free: bool = False) -> Problem:
    """The demand on all points; with `ends` also at zero and infinity; `free` lets zeros hide between points."""
    log_x = np.log(x)
    return Problem(
        x=x,
        target=target,
        low=target[0] if ends else -np.inf,
        high=target[-1] if ends else -np.inf,
        floor=np.full(x.size, -16.0) if free else floor_of(log_x),
        share=np.full(x.size, 1 / x.size),
        log_x=log_x,
    )


def floor_of(log_x: np.ndarray) -> np.ndarray:
    """Log of a damping broad enough to leave no notch, and no unseen peak, between two points."""
    return np.log(np.clip(np.gradient(log_x), 1e-6, 0.5))


Fit = tuple[float, np.ndarray, float]  # how bad, theta, log_k


def least_squares(problem: Problem, order: int) -> list[Fit]:
    """Fits of the target itself from every start, the best first, with their largest error."""
    few, fits = problem.thinned(150), []
    for start in starts(few, order):
        theta, log_k = asymmetric(few, start, order, 1.0, 40)
        error = float(np.abs(few.excess(theta, log_k, order)[0]).max())
        if error < 1e-2:  # perhaps exact: all the points tell
            theta, log_k = asymmetric(problem, theta, order, 1.0, 15)
            error = float(np.abs(problem.excess(theta, log_k, order)[0]).max())
        fits.append((error, theta, log_k))
        if error < EXACT:
            break
    return sorted(fits, key=lambda fit: fit[0])


def least_excess(problem: Problem, order: int, fits: list[Fit], deadline: float) -> list[np.ndarray]:
    """The best parameters found: from every fit on fewer points, and grown; the best two polished on all points."""
    coarse = problem.coarse(240)
    # starts that came to the same fit are one start
    begun = [f[1] for k, f in enumerate(fits) if k == 0 or f[0] > fits[k - 1][0] * 1.001]
    found = [rough(coarse, begun[0], order, deadline)]
    if found[0][0] > FINE:
        found += [rough(coarse, theta, order, deadline) for theta in begun[1:]] + [grown(coarse, order, deadline)]
        found.sort(key=lambda fit: fit[0])
    return [
        polished(problem, theta, log_k, order, (0.1, 0.02, 0.005, 0.001), 15, deadline)[0]
        for bad, theta, log_k in found[:2]
        if bad <= 1.1 * found[0][0]
    ]


def rough(problem: Problem, theta: np.ndarray, order: int, deadline: float) -> Fit:
    """Mean excess and parameters after a quick fit."""
    theta, log_k = asymmetric(problem, problem.clipped(theta, order), order, 4.0, 10)
    theta, log_k = polished(problem, theta, log_k, order, (0.1, 0.02, 0.005), 16, deadline)
    return problem.mean_excess(theta, log_k, order), theta, log_k


def grown(problem: Problem, order: int, deadline: float) -> Fit:
    """Section by section: each new one where the excess is largest, or in the middle of a half of the band."""
    middle = (problem.log_x[0] + problem.log_x[-1]) / 2
    best = (problem.mean_excess(np.zeros(0), float(problem.target.max()), 0), np.zeros(0), float(problem.target.max()))
    for done in range(0, order, 2):
        _, theta, log_k = best
        e = problem.excess(theta, log_k, done)[0][: problem.x.size]
        width = max(1, problem.x.size // 30)
        smooth = np.convolve(e, np.ones(width) / width, mode="same")
        now = min(done + 2, order)
        tries = []
        for place in (problem.log_x[np.argmax(smooth)], *(problem.log_x[[0, -1]] + middle) / 2):
            new, gain = asymmetric(problem, with_section(theta, done, now, place, -0.2), now, 4.0, 8)
            lift = -float(problem.excess(new, gain, now)[0].min())
            tries.append((problem.mean_excess(new, gain + lift, now), new, gain))
        _, new, gain = min(tries, key=lambda fit: fit[0])
        new, gain = polished(problem, new, gain, now, (0.1, 0.02, 0.005), 10, deadline)
        # a section whose zeros cancel its poles changes nothing: growing never makes it worse
        same = (best[0], with_section(theta, done, now, middle, 0.0), log_k)
        best = min((problem.mean_excess(new, gain, now), new, gain), same, key=lambda fit: fit[0])
    return best


def with_section(theta: np.ndarray, order: int, now: int, place: float, spread: float) -> np.ndarray:
    """Parameters with one more section, of second order or of first; zeros and poles apart by the spread."""
    zeros, poles = theta[:order], theta[order:]
    if now - order == 1:
        return np.concatenate([zeros, [place + spread], poles, [place - spread]])
    return np.concatenate([zeros, [place, -0.7 + spread], poles, [place, -0.7 - spread]])


def log_sections(x: np.ndarray, theta: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray, float]:
    """Sum of log |section(j x)|, its Jacobian (n, N), and the sum at zero."""
    m = n - n % 2
    total, slopes = np.zeros(x.size), np.empty((n, x.size))
    x2 = x * x
    if m:
        log_w, log_zeta = theta[:m:2, None], theta[1:m:2, None]
        w2, damping = np.exp(2 * log_w), 4 * np.exp(2 * (log_w + log_zeta)) * x2
        gap = w2 - x2
        square = gap * gap + damping
        total = 0.5 * np.log(square).sum(axis=0)
        slopes[1:m:2] = damping / square
        slopes[:m:2] = 2 * w2 * gap / square + slopes[1:m:2]
    if n % 2:
        w2 = np.exp(2 * theta[-1])
        total = total + 0.5 * np.log(w2 + x2)
        slopes[-1] = w2 / (w2 + x2)
    return total, slopes, float(slope_at_zero(n) @ theta)


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
    x, power = problem.x / scale, np.exp(2 * (problem.target - problem.target.mean()))
    y = -(x * x) + 0j
    guess = starting_poles(order, x[0], x[-1], spacing="log")
    damped = np.where(guess.imag == 0, guess, -0.2 * np.abs(guess.imag) + 1j * guess.imag)
    with np.errstate(all="ignore"):
        q = vector_fit(y, power + 0j, 1 / power, in_order(damped**2), n_iterations=8, stable=False)
        if np.any(np.abs(y[:, None] - q).min(axis=0) < 1e-12 * np.abs(q)):
            return None
        try:
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
    p = np.where(np.abs(p.real) < 1e-9 * np.abs(p), -np.abs(p), p)
    pairs, rest = paired(in_order(np.where(np.abs(p.imag) < 1e-9 * np.abs(p), p.real, p)))
    theta: list[float] = []
    for a, b in pairs:
        w = np.sqrt(max(abs(a * b), 1e-30))
        theta += [np.log(w), np.log(max(-(a + b).real / (2 * w), 1e-7))]
    return np.array(theta + [np.log(max(abs(r), 1e-15)) for r in rest])


# excess -> value, first and second derivative
Objective = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]


def descended(
    problem: Problem, theta: np.ndarray, log_k: float, order: int, objective: Objective, n_iterations: int, small: float
) -> tuple[np.ndarray, float]:
    """Newton's method with the exact Hessian, its negative curvatures turned around, damped until it descends."""
    e, J = problem.excess(theta, log_k, order)
    value, first, second = objective(e)
    damping = 1e-3
    for _ in range(n_iterations):
        H = J.T @ (second[:, None] * J)
        H[:-1, :-1] += curvature(problem, theta, order, first)
        sizes, axes = np.linalg.eigh(H)
        slope = axes.T @ (J.T @ first)
        before = value
        for _ in range(10):
            step = -axes @ (slope / (np.abs(sizes) + damping * np.abs(sizes).max()))
            step *= min(1.0, 1.5 / np.abs(step[:-1]).max(initial=1e-300))
            trial = problem.clipped(theta + step[:-1], order)
            e_new, J_new = problem.excess(trial, log_k + step[-1], order)
            value_new, first_new, second_new = objective(e_new)
            if value_new < value:
                theta, log_k, e, J = trial, log_k + step[-1], e_new, J_new
                value, first, second = value_new, first_new, second_new
                damping = max(damping / 10, 1e-12)
                break
            damping = min(max(damping * 10, 1e-8), 1e6)
        if not value < before - small:
            break
    return theta, log_k


def curvature(problem: Problem, theta: np.ndarray, order: int, first: np.ndarray) -> np.ndarray:
    """Hessian (2n, 2n) of sum first * excess by the parameters: a block for each section."""
    out = np.zeros((2 * order, 2 * order))
    c = first[: problem.x.size]
    x2 = problem.x**2
    m = order - order % 2
    for start, sign in ((0, 1.0), (order, -1.0)):
        part = theta[start : start + order]
        if m:
            w2 = np.exp(2 * part[:m:2, None])
            damped = 4 * w2 * np.exp(2 * part[1:m:2, None]) * x2
            gap = w2 - x2
            square = gap * gap + damped
            by_w, by_zeta = (4 * w2 * gap + 2 * damped) / square, 2 * damped / square
            ww = ((8 * w2 * (gap + w2) + 4 * damped) / square - by_w**2) @ c
            wz = (4 * damped / square - by_w * by_zeta) @ c
            zz = (4 * damped / square - by_zeta**2) @ c
            k = start + np.arange(0, m, 2)
            out[k, k], out[k + 1, k + 1] = 0.5 * sign * ww, 0.5 * sign * zz
            out[k, k + 1] = out[k + 1, k] = 0.5 * sign * wz
        if order % 2:
            w2 = np.exp(2 * part[-1])
            ratio = w2 / (w2 + x2)
            out[start + order - 1, start + order - 1] = sign * float(2 * ratio * (1 - ratio) @ c)
    return out


def asymmetric(
    problem: Problem, theta: np.ndarray, order: int, below: float, n_iterations: int
) -> tuple[np.ndarray, float]:
    """Least squares on the log excess, where lying below the target costs below^2 times as much."""

    def objective(e: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        w = np.where(e < 0, 2 * below**2, 2.0) / e.size
        return float(0.5 * w @ e**2), w * e, w

    log_k = -float(problem.share @ problem.excess(theta, 0.0, order)[0][: problem.x.size])
    return descended(problem, theta, log_k, order, objective, n_iterations, 1e-14)


def polished(
    problem: Problem,
    theta: np.ndarray,
    log_k: float,
    order: int,
    barriers: tuple[float, ...],
    n_iterations: int,
    deadline: float,
) -> tuple[np.ndarray, float]:
    """Least mean excess with none negative: a logarithmic barrier, lowered step by step, then down to the target."""
    n = problem.x.size
    e = problem.excess(theta, log_k, order)[0]
    log_k += 0.02 - e.min()
    share = np.zeros(e.size)
    share[:n] = problem.share
    weight = np.maximum(share, 1 / n)  # the ends count like a point
    for mu in barriers:
        if time.monotonic() > deadline:
            break

        def objective(e: np.ndarray, mu: float = mu) -> tuple[float, np.ndarray, np.ndarray]:
            if not e.min() > 0:
                return np.inf, e, e
            return float(share @ e - mu * (weight @ np.log(e))), share - mu * weight / e, mu * weight / (e * e)

        theta, log_k = descended(problem, theta, log_k, order, objective, n_iterations, 1e-3 * mu)
    return theta, log_k - float(problem.excess(theta, log_k, order)[0].min())


def zeros_and_poles(theta: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots behind the parameters."""
    return (
        in_order(roots_from(theta[:order], order, log=True)),
        in_order(roots_from(theta[order:], order, log=True)),
    )
