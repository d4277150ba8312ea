"""The numerical problem behind `fit_weight`: least mean log excess of |W| over a target that it must cover."""

from __future__ import annotations

import numpy as np

from robust.modelling.descent import asymmetric, polished
from robust.modelling.excess import Problem, slope_at_zero
from robust.modelling.rational import numerator, starting_poles, vector_fit
from robust.systems.realisation import in_order, paired

__all__ = ["EXACT", "least_excess", "least_squares"]


EXACT = 1e-4  # log error under which a weight is taken to be the target itself
FINE = 0.01  # mean log excess, 0.09 dB, under which no other start is tried
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
