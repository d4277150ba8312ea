"""How far |W| lies above a target, as a function of the roots of W."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value
from robust.modelling.refinement import roots_from
from robust.systems.realisation import in_order

__all__ = ["Problem", "log_sections", "problem_on", "slope_at_zero", "zeros_and_poles"]


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
        """log |W| - target at the points (then zero and infinity, where demanded), and its Jacobian (2n+1, .)."""
        totals, slopes = log_sections(self.x, theta.reshape(2, order), order)
        N, ends = self.x.size, 2 * bool(np.isfinite(self.low))
        J = np.empty((2 * order + 1, N + ends))
        J[:order, :N], J[-1] = slopes[0], 1.0
        np.negative(slopes[1], out=J[order:-1, :N])
        e = np.empty(N + ends)
        np.subtract(totals[0], totals[1], out=e[:N])
        e[:N] += log_k - self.target
        if ends:
            at_zero = slope_at_zero(order)
            J[:order, N], J[order:-1, N], J[:-1, N + 1] = at_zero, -at_zero, 0.0
            e[N:] = log_k + at_zero @ (theta[:order] - theta[order:]) - self.low, log_k - self.high
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


def log_sections(x: np.ndarray, theta: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Sums (..., N) of log |section(j x)| for parameters (..., n), and their Jacobians (..., n, N)."""
    m = n - n % 2
    shape = theta.shape[:-1]
    total, slopes = np.zeros((*shape, x.size)), np.empty((*shape, n, x.size))
    x2 = x * x
    if m:
        log_w, log_zeta = theta[..., :m:2, None], theta[..., 1:m:2, None]
        w2, damping = np.exp(2 * log_w), 4 * np.exp(2 * (log_w + log_zeta)) * x2
        gap = w2 - x2
        square = gap * gap + damping
        total = 0.5 * np.add.reduce(np.log(square), axis=-2)
        by_zeta = np.divide(damping, square, out=slopes[..., 1:m:2, :])
        slopes[..., :m:2, :] = 2 * w2 * gap / square + by_zeta
    if n % 2:
        w2 = np.exp(2 * theta[..., -1:])
        square = w2 + x2
        total = total + 0.5 * np.log(square)
        slopes[..., -1, :] = w2 / square
    return total, slopes


def slope_at_zero(n: int) -> np.ndarray:
    """Derivative of the log gain of the sections at zero frequency by their parameters."""
    return np.array([2.0, 0.0] * (n // 2) + [1.0] * (n % 2))


def zeros_and_poles(theta: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    """Roots behind the parameters."""
    return (
        in_order(roots_from(theta[:order], order, log=True)),
        in_order(roots_from(theta[order:], order, log=True)),
    )
