"""A rational function through complex data, refined by Levenberg and Marquardt's method."""

from __future__ import annotations

from collections.abc import Callable
from itertools import zip_longest

import numpy as np

from nlfrf._base.values import value
from robust.lti.realisation import order_roots, pair_roots
from robust.models.fit.rational import Roots, stack_real_imaginary

_STABLE_RATIO = 1e-8  # smallest distance of a stable pole from the axis, over the lowest frequency
_MIN_DAMPING, _MAX_DAMPING = 1e-12, 1e3  # damping of a step over the largest singular value squared
_N_STEPS = 150
CONVERGED = 1e-8  # relative change of the cost in a step that ends the search


def refine(
    s: np.ndarray,
    data: np.ndarray,
    *,
    weight: np.ndarray,
    start: Roots,
    factor: Callable[[float], np.ndarray],
    omega: np.ndarray | None = None,
    stable: bool = True,
    tolerance: float = CONVERGED,
) -> Roots:
    """Refine by Levenberg-Marquardt on the weighted error, over second-order sections in scaled
    frequency.

    factor(delay) multiplies the rational function; the delay itself is refined if omega is given.
    The refinement ends when a step lowers the cost by no more than a relative tolerance.
    """
    zeros, poles, gain, delay, _ = start
    free_delay = omega is not None
    unit = float(np.exp(np.mean(np.log(np.abs(s)))))
    x = s / unit
    theta = np.concatenate(
        [
            [1.0],
            _section_coefficients(zeros / unit),
            _section_coefficients(poles / unit),
            [0.0] * free_delay,
        ]
    )
    n_zero, n_pole = zeros.size, poles.size
    pole_part = slice(1 + n_zero, 1 + n_zero + n_pole)
    base = gain * unit ** float(n_zero - n_pole)
    if omega is not None:
        slope = -1j * omega / omega.max()
        delay_unit = 1 / omega.max()
    else:
        slope = x
        delay_unit = 0.0

    def error(theta: np.ndarray) -> tuple[np.ndarray, float, Callable[[], np.ndarray]]:
        """Return the weighted error, its sum of squares, and a function for its derivatives by the
        parameters.
        """
        with np.errstate(all="ignore"):
            tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
            out = base * theta[0] * factor(tau)
            top = _evaluate_sections(x, theta[1 : 1 + n_zero], n_zero)
            bottom = _evaluate_sections(x, theta[1 + n_zero : 1 + n_zero + n_pole], n_pole)
            for one, other in zip_longest(top, bottom, fillvalue=1.0):
                out = out * one / other
            e = stack_real_imaginary((data - out) * weight)
            cost = float(e @ e)

        def derivatives() -> np.ndarray:
            J = np.empty((theta.size, x.size), dtype=complex)
            J[0] = 1 / theta[0] if theta[0] else 1.0
            _relative_slopes(x, top, out=J[1 : 1 + n_zero])
            _relative_slopes(x, bottom, out=J[pole_part])
            np.negative(J[pole_part], out=J[pole_part])
            if free_delay:
                J[-1] = slope
            J *= out * weight
            return np.concatenate([J.real, J.imag], axis=1)

        return e, cost if np.isfinite(cost) else np.inf, derivatives

    low = np.full(theta.size, -np.inf)
    if stable:
        least = _STABLE_RATIO * np.abs(x).min()
        low[pole_part] = np.where(np.arange(n_pole) % 2, least**2, least)
        if n_pole % 2:
            low[n_zero + n_pole] = least
        theta = np.maximum(theta, low)
    if free_delay:
        low[-1] = -delay / delay_unit
    e, cost, derivatives = error(theta)
    damping = 1e-3
    for _ in range(_N_STEPS):
        before, J = cost, derivatives()
        if not np.isfinite(J).all():
            break
        # squared slopes keep enough digits for the least damping, and cost a tenth of singular
        # values
        H, g = J @ J.T, J @ e
        solve = _damped_solver(H, g, free=(theta > low) | (g > 0))
        while damping < _MAX_DAMPING:
            step = solve(damping)
            below = theta + step < low
            if below.any():  # solve again for the others, with these held at their bounds
                held = np.where(below, low - theta, 0.0)
                step = np.where(
                    below, held, _damped_solver(H, g - H @ held, free=~below & (step != 0))(damping)
                )
            trial = np.maximum(theta + step, low)
            e_new, cost_new, derivatives_new = error(trial)
            if cost_new < cost:
                theta, e, cost, derivatives = trial, e_new, cost_new, derivatives_new
                damping = max(damping / 10, _MIN_DAMPING)
                break
            damping *= 6
        if not cost < before * (1 - tolerance):
            break
    zeros = order_roots(_roots_from(theta[1 : 1 + n_zero], n_zero) * unit)
    poles = order_roots(_roots_from(theta[1 + n_zero : 1 + n_zero + n_pole], n_pole) * unit)
    tau = delay + (theta[-1] * delay_unit if free_delay else 0.0)
    return zeros, poles, base * theta[0] * unit ** float(n_pole - n_zero), tau, cost


def _damped_solver(
    H: np.ndarray, g: np.ndarray, *, free: np.ndarray
) -> Callable[[float], np.ndarray]:
    """Return a function of the damping: the damped least squares step of the free parameters, from
    J'J and J'e.
    """
    size = np.sqrt(np.diag(H))
    scale = free / np.where(size > 0, size, 1.0)
    squares, axes = np.linalg.eigh(H * scale * scale[:, None])
    along = axes.T @ (g * scale)

    def step(damping: float) -> np.ndarray:
        return np.asarray(
            axes
            @ (along / (squares.clip(0.0) + damping * squares[-1] + np.finfo(float).tiny))
            * scale
        )

    return step


def _section_coefficients(roots: np.ndarray) -> np.ndarray:
    """Return section coefficients (c1, c0) of s^2 + c1 s + c0 for each pair, then c0 of a single s
    + c0.
    """
    pairs, rest = pair_roots(roots)
    return np.array(
        [c for a, b in pairs for c in (-(a + b).real, (a * b).real)] + [-r.real for r in rest]
    )


def _evaluate_sections(x: np.ndarray, theta: np.ndarray, n: int) -> list[np.ndarray]:
    sections = [x * x + theta[k] * x + theta[k + 1] for k in range(0, n - n % 2, 2)]
    if n % 2:
        sections.append(x + theta[-1])
    return sections


def _relative_slopes(x: np.ndarray, sections: list[np.ndarray], *, out: np.ndarray) -> None:
    """Write the logarithmic derivative of each section by its parameters into out (n, W)."""
    with np.errstate(all="ignore"):
        for k, section in enumerate(sections):
            rows = out[2 * k : 2 * k + 2]
            rows[-1] = 1 / section
            if len(rows) == 2:
                np.multiply(x, rows[-1], out=rows[0])


def _roots_from(theta: np.ndarray, n: int) -> np.ndarray:
    found: list[complex] = []
    for k in range(0, n - n % 2, 2):
        c1, c0 = theta[k], theta[k + 1]
        inner = complex(c1 * c1 / 4 - c0)
        if inner.real < 0:
            half = np.sqrt(inner)
            found += [-c1 / 2 + half, -c1 / 2 - half]
        else:
            # the larger root first, the other one from their product: no cancellation
            far = -c1 / 2 - np.copysign(np.sqrt(inner.real), c1)
            found += [complex(far), complex(c0 / far if far else 0.0)]
    if n % 2:
        found.append(complex(-theta[-1]))
    return np.array(found, dtype=complex)


# ---- Excess of |W| over a target, as a function of the roots of W.


@value
class MagnitudeProblem:
    """Points x (N,) on the imaginary axis, the log target there, at zero and at infinity (-inf: no
    target there).

    floor (N,) : log of the smallest zero damping allowed near each point (a third of it for poles).
    share (N,) : weight of each point in the mean.
    """

    x: np.ndarray
    target: np.ndarray
    low: float
    high: float
    floor: np.ndarray
    share: np.ndarray
    log_x: np.ndarray

    def excess(self, theta: np.ndarray, log_k: float, order: int) -> tuple[np.ndarray, np.ndarray]:
        """Return log |W| - target at the points and ends, and its Jacobian (2n+1, .)."""
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

    def shares(self) -> tuple[np.ndarray, np.ndarray]:
        """Return weights for each excess, zero at the ends; for negative excess at least an even
        share.
        """
        share = np.zeros(self.x.size + 2 * bool(np.isfinite(self.low)))
        share[: self.x.size] = self.share
        return share, np.maximum(share, 1 / self.x.size)

    def mean_excess(self, theta: np.ndarray, log_k: float, order: int) -> float:
        """Return the mean of log |W| - target over the points."""
        return float(self.share @ self.excess(theta, log_k, order)[0][: self.x.size])

    def clip_sections(self, theta: np.ndarray, order: int) -> np.ndarray:
        """Return sections kept near the band, with zeros too broad to hide between two points."""
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

    def coarsen(self, most: int) -> MagnitudeProblem:
        """Return the target on fewer points: the ends of each group, with its maximum."""
        if self.x.size <= 1.2 * most:
            return self
        # groups are even over the index, over log frequency (lines of a multisine crowd at the top
        # of the band), and over the variation of the smoothed target
        width = max(1, self.x.size // 150)
        smooth = np.convolve(
            np.pad(self.target, width, mode="edge"), np.ones(width) / width, mode="same"
        )[width:-width]
        steps = [
            np.ones(self.x.size - 1),
            np.diff(self.log_x),
            np.sqrt(np.abs(np.diff(smooth)) + 1e-12),
        ]
        travelled = np.concatenate([[0.0], np.cumsum(sum(step / step.sum() for step in steps))])
        edges = np.searchsorted(travelled, np.linspace(0, travelled[-1], most // 2 + 1)[1:-1])
        edges = np.unique(np.concatenate([[0], edges, [self.x.size]]))
        pick = np.unique(np.concatenate([edges[:-1], edges[1:] - 1]))
        group = np.searchsorted(edges, pick, side="right") - 1
        share = np.add.reduceat(self.share, edges[:-1])[group] / np.bincount(group)[group]
        return MagnitudeProblem(
            x=self.x[pick],
            target=np.maximum.reduceat(self.target, edges[:-1])[group],
            low=self.low,
            high=self.high,
            floor=np.maximum(self.floor[pick], _damping_floor(self.log_x[pick])),
            share=share,
            log_x=self.log_x[pick],
        )

    def thin(self, most: int) -> MagnitudeProblem:
        """Return every k-th point unchanged, at most `most` points."""
        step = max(1, self.x.size // most)
        return MagnitudeProblem(
            x=self.x[::step],
            target=self.target[::step],
            low=self.low,
            high=self.high,
            floor=self.floor[::step],
            share=np.full(self.x[::step].size, 1 / self.x[::step].size),
            log_x=self.log_x[::step],
        )


def magnitude_problem(
    x: np.ndarray,
    target: np.ndarray,
    *,
    ends: bool,
    free: bool = False,
    share: np.ndarray | None = None,
) -> MagnitudeProblem:
    """Return the problem on all points; `ends` adds zero and infinity; `free` lets zeros hide
    between points.
    """
    log_x = np.log(x)
    return MagnitudeProblem(
        x=x,
        target=target,
        low=target[0] if ends else -np.inf,
        high=target[-1] if ends else -np.inf,
        floor=np.full(x.size, -16.0) if free else _damping_floor(log_x),
        share=np.full(x.size, 1 / x.size) if share is None else share,
        log_x=log_x,
    )


def _damping_floor(log_x: np.ndarray) -> np.ndarray:
    """Return the log of the smallest damping that leaves no notch, and no unseen peak, between two
    points.
    """
    return np.log(np.clip(np.gradient(log_x), 1e-6, 0.5))


def log_sections(x: np.ndarray, theta: np.ndarray, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return sums (..., N) of log |section(j x)| for parameters (..., n), and their Jacobians (...,
    n, N).
    """
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
    """Return the derivative of the log gain of the sections at zero frequency by the parameters."""
    return np.array([2.0, 0.0] * (n // 2) + [1.0] * (n % 2))


def zeros_and_poles(theta: np.ndarray, order: int) -> tuple[np.ndarray, np.ndarray]:
    zeros, poles = (_roots_of_logarithms(part, order) for part in (theta[:order], theta[order:]))
    return zeros, poles


def section_logarithms(roots: np.ndarray) -> np.ndarray:
    """Return log frequency and log damping of each pair of stable roots (real ones paired too), log
    size of one.
    """
    pairs, rest = pair_roots(roots)
    theta: list[float] = []
    for a, b in pairs:
        w = np.sqrt(max(abs(a * b), 1e-30))
        theta += [np.log(w), np.log(max(-(a + b).real / (2 * w), 1e-7))]
    return np.array(theta + [np.log(max(abs(r), 1e-15)) for r in rest])


def _roots_of_logarithms(theta: np.ndarray, n: int) -> np.ndarray:
    """Return the n stable roots with these logarithms."""
    m, coefficients = n - n % 2, np.exp(theta)
    coefficients[:m:2], coefficients[1:m:2] = (
        2 * np.exp(theta[:m:2] + theta[1:m:2]),
        np.exp(2 * theta[:m:2]),
    )
    roots = _roots_from(coefficients, n)
    # an exponential underflows to zero, and a stable root must not be zero
    return order_roots(np.minimum(roots.real, -1e-12) + 1j * roots.imag)


# ---- Newton steps on the roots of a weight, to the least excess over a target.

# excess -> value, first and second derivative
Objective = Callable[[np.ndarray], tuple[float, np.ndarray, np.ndarray]]


def _descend_newton(
    problem: MagnitudeProblem,
    theta: np.ndarray,
    *,
    log_k: float,
    order: int,
    objective: Objective,
    n_iterations: int,
    small: float,
) -> tuple[np.ndarray, float]:
    """Minimise by Newton's method with the exact Hessian, negative curvatures reversed, damped
    until it descends.
    """
    e, J = problem.excess(theta, log_k, order)
    value, first, second = objective(e)
    damping = 1e-3
    for _ in range(n_iterations):
        H = (second * J) @ J.T
        H[:-1, :-1] += section_hessian(problem, theta, order=order, first=first, J=J)
        sizes, axes = np.linalg.eigh(H)
        slope = axes.T @ (J @ first)
        before = value
        for _ in range(10):
            step = -axes @ (slope / (np.abs(sizes) + damping * np.abs(sizes).max()))
            step *= min(1.0, 1.5 / np.abs(step[:-1]).max(initial=1e-300))
            trial = problem.clip_sections(theta + step[:-1], order)
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


def section_hessian(
    problem: MagnitudeProblem, theta: np.ndarray, *, order: int, first: np.ndarray, J: np.ndarray
) -> np.ndarray:
    """Return the Hessian (2n, 2n) of sum first * excess: a block for each section."""
    N, m = problem.x.size, order - order % 2
    c, slopes = first[:N], J[:-1, :N].reshape(2, order, N)
    sign = np.array([[1.0], [-1.0]])  # for zeros and poles of W
    weighted = slopes * c
    linear, square = np.add.reduce(weighted, axis=-1), sign * np.vecdot(weighted, slopes)
    out = np.diag(2 * (linear - square).ravel())
    if m:
        # for a pair: w^4 over the square of the section is its slope by zeta times w^2 / (2 zeta
        # x)^2
        w, zeta = slice(0, m, 2), slice(1, m, 2)
        by_zeta = slopes[:, zeta]
        mixed = 2 * (linear[:, zeta] - sign * np.vecdot(weighted[:, w], by_zeta))
        first_of = np.arange(2 * order).reshape(2, order)[:, w]
        out[first_of, first_of] += np.exp(2 * (theta[first_of] - theta[first_of + 1])) * (
            by_zeta @ (c / problem.x**2)
        )
        out[first_of, first_of + 1] = out[first_of + 1, first_of] = mixed
    return out


def asymmetric_cost(problem: MagnitudeProblem, below: float) -> Objective:
    """Return the sum of squares of the log excess, with negative excess weighted below^2 times as
    much.
    """
    share, least = problem.shares()

    def objective(e: np.ndarray) -> tuple[float, np.ndarray, np.ndarray]:
        w = np.where(e < 0, 2 * below**2 * least, 2 * share)
        return float(0.5 * w @ e**2), w * e, w

    return objective


def fit_asymmetric(
    problem: MagnitudeProblem, theta: np.ndarray, *, order: int, below: float, n_iterations: int
) -> tuple[np.ndarray, float]:
    """Return the least squares fit of the log excess, with negative excess weighted below^2 times
    as much.
    """
    return _descend_newton(
        problem,
        theta,
        log_k=-problem.mean_excess(theta, 0.0, order),
        order=order,
        objective=asymmetric_cost(problem, below),
        n_iterations=n_iterations,
        small=1e-14,
    )


# places of each kind, log damping; more of either did not help over 70 radii
_PLACES = 15
_DAMPINGS = (-2.0, 0.0)
_MAX_SPLIT = 0.7


def sections_that_pay(
    problem: MagnitudeProblem, fit: tuple[np.ndarray, float], *, order: int, more: int, below: float
) -> list[tuple[np.ndarray, np.ndarray]]:
    """Return the two places at which one more section of `more` states lowers the asymmetric cost
    most, with the split.

    A section whose zeros cancel its poles is split by a Newton step with all other parameters free:
    the Schur complement of its block of the Hessian, the others at their optimum. Places lie evenly
    over the points and over log frequency.
    """
    N, ends = problem.x.size, np.linspace(0, 1, _PLACES)
    places = np.concatenate(
        [np.quantile(problem.log_x, ends), np.quantile(problem.log_x[[0, -1]], ends)]
    )
    grid = np.array([(w, zeta)[:more] for w in places for zeta in _DAMPINGS])
    e, J = problem.excess(*fit, order)
    first, second = asymmetric_cost(problem, below)(e)[1:]
    slopes = np.zeros((*grid.shape, e.size))
    slopes[..., :N] = log_sections(problem.x, grid, more)[1]
    slopes[..., N:-1] = slope_at_zero(more)[:, None]
    weighted = slopes * second
    coupling = weighted @ J.T
    H = (J * second) @ J.T
    H[np.diag_indices_from(H)] *= 1.001
    # what the other parameters take over, if a section at this place is split
    through = coupling @ np.linalg.pinv(H, hermitian=True)
    block = weighted @ slopes.mT
    schur = (
        block
        - through @ coupling.mT
        + 1e-3 * np.trace(block, axis1=1, axis2=2)[:, None, None] * np.eye(more)
    )
    slope = slopes @ first - through @ (J @ first)
    split = -np.linalg.solve(schur, slope[..., None])[..., 0]
    gain = -np.vecdot(split, slope)
    # neighbouring places lower the cost by the same effect: the second one is elsewhere
    best = int(np.argmax(gain))
    other = int(np.argmax(np.where(np.abs(grid[:, 0] - grid[best, 0]) < 0.3, -np.inf, gain)))
    return [(grid[k], np.clip(split[k] / 2, -_MAX_SPLIT, _MAX_SPLIT)) for k in (best, other)]


def polish_by_barrier(
    problem: MagnitudeProblem,
    theta: np.ndarray,
    *,
    log_k: float,
    order: int,
    barriers: tuple[float, ...],
    n_iterations: int,
) -> tuple[np.ndarray, float]:
    """Minimise the mean of a nonnegative excess: a logarithmic barrier, lowered step by step, then
    to the target.
    """
    log_k += 0.02 - float(problem.excess(theta, log_k, order)[0].min())
    share, weight = problem.shares()
    for mu in barriers:

        def objective(e: np.ndarray, mu: float = mu) -> tuple[float, np.ndarray, np.ndarray]:
            if not e.min() > 0:
                return np.inf, e, e
            return (
                float(share @ e - mu * (weight @ np.log(e))),
                share - mu * weight / e,
                mu * weight / (e * e),
            )

        theta, log_k = _descend_newton(
            problem,
            theta,
            log_k=log_k,
            order=order,
            objective=objective,
            n_iterations=n_iterations,
            small=1e-3 * mu,
        )
    return theta, log_k - float(problem.excess(theta, log_k, order)[0].min())
