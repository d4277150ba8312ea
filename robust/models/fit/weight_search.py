"""The numerical problem behind a weight: least mean log excess of |W| over a target that it must
cover, section by section; and its least squares fit.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from nlfrf._base.values import value
from robust.lti.realisation import from_roots, order_roots
from robust.models.fit.rational import fit_numerator, map_to_model_plane, starting_poles, vector_fit
from robust.models.fit.refinement import (
    MagnitudeProblem,
    asymmetric_cost,
    fit_asymmetric,
    magnitude_problem,
    polish_by_barrier,
    section_logarithms,
    sections_that_pay,
    slope_at_zero,
    zeros_and_poles,
)

EXACT_TOLERANCE = 1e-4  # log error below which a weight is the target itself
_BELOW = 8.0  # cost of negative over positive excess while sections are placed; best of 2, 4, 8, 16
Fit = tuple[float, np.ndarray, float]  # error, theta, log_k


def least_squares(problem: MagnitudeProblem, order: int) -> list[Fit]:
    """Return fits of the target from every start with their largest error, best first."""
    few, fits = problem.thin(150), []
    for start in starting_parameters(few, order):
        theta, log_k = fit_asymmetric(few, start, order=order, below=1.0, n_iterations=40)
        error = float(np.abs(few.excess(theta, log_k, order)[0]).max())
        if error < 1e-2:  # perhaps exact: decide on all points
            theta, log_k = fit_asymmetric(problem, theta, order=order, below=1.0, n_iterations=15)
            error = float(np.abs(problem.excess(theta, log_k, order)[0]).max())
        fits.append((error, theta, log_k))
        if error < EXACT_TOLERANCE:
            break
    return sorted(fits, key=lambda fit: fit[0])


@value
class Growth:
    """A weight that grows by sections: the least squares solution (theta, log_k), and a fit.

    The next section is placed on the least squares solution, whose negative excess costs `_BELOW`^2
    times as much.
    """

    order: int
    placed: tuple[np.ndarray, float]
    fit: Fit


def constant_weight(problem: MagnitudeProblem) -> Growth:
    placed = fit_asymmetric(problem, np.zeros(0), order=0, below=_BELOW, n_iterations=8)
    level = max(float(problem.target.max()), problem.low, problem.high)
    fit = problem.mean_excess(np.zeros(0), level, 0), np.zeros(0), level
    return Growth(order=0, placed=placed, fit=fit)


def add_states(problem: MagnitudeProblem, growth: Growth, more: int) -> Growth:
    """Return the weight, of even order so far, with one or two more states at the most profitable
    place.
    """
    order, cost, tries = growth.order + more, asymmetric_cost(problem, _BELOW), []
    for section, split in sections_that_pay(
        problem, growth.placed, order=growth.order, more=more, below=_BELOW
    ):
        start = problem.clip_sections(_add_section(growth.placed[0], section, split), order)
        tries.append(fit_asymmetric(problem, start, order=order, below=_BELOW, n_iterations=6))
    start, _ = min(tries, key=lambda fit: cost(problem.excess(fit[0], fit[1], order)[0])[0])
    grown = placed_weight(problem, start, order)
    # a section whose zeros cancel its poles changes nothing: growing never makes it worse
    least, before, gain = growth.fit
    same = (
        least,
        _add_section(before, np.array([problem.log_x.mean(), 0.0])[:more], np.zeros(more)),
        gain,
    )
    return replace(grown, fit=min(grown.fit, same, key=lambda fit: fit[0]))


def placed_weight(problem: MagnitudeProblem, start: np.ndarray, order: int) -> Growth:
    """Return the weight with sections refined by least squares, then by least excess."""
    theta, log_k = placed = fit_asymmetric(
        problem, start, order=order, below=_BELOW, n_iterations=8
    )
    theta, log_k = polish_by_barrier(
        problem, theta, log_k=log_k, order=order, barriers=(0.1, 0.02, 0.005), n_iterations=12
    )
    return Growth(
        order=order, placed=placed, fit=(problem.mean_excess(theta, log_k, order), theta, log_k)
    )


def _add_section(theta: np.ndarray, section: np.ndarray, split: np.ndarray) -> np.ndarray:
    """Return parameters (of even order) with one more section, its zeros and poles split about the
    given section.
    """
    zeros, poles = theta.reshape(2, -1)
    return np.concatenate([zeros, section + split, poles, section - split])


def starting_parameters(problem: MagnitudeProblem, order: int) -> list[np.ndarray]:
    """Return starting parameters: a rational fit of |W|^2, sections spread over the band."""
    fitted = fit_squared_magnitude(problem, order)
    if fitted is None:
        return [_spread_sections(problem, order)]
    return [fitted, _spread_sections(problem, order)]


def _spread_sections(problem: MagnitudeProblem, order: int) -> np.ndarray:
    """Return well damped sections evenly over log frequency, zeros next to poles."""
    half = order // 2
    centres = np.linspace(np.log(problem.x[0]), np.log(problem.x[-1]), half + order % 2 + 2)[1:-1]
    pairs = np.column_stack([centres[:half], np.zeros(half)]).ravel()
    zeros = np.concatenate([pairs, centres[half:] if order % 2 else []])
    return np.concatenate([zeros + 0.1, zeros - 0.1])


def fit_squared_magnitude(problem: MagnitudeProblem, order: int) -> np.ndarray | None:
    """Fit |W|^2, rational in y = -x^2, by vector fitting; take the stable square roots of poles and
    zeros.
    """
    scale = np.exp(np.mean(np.log(problem.x)))
    x, power = problem.x / scale, np.exp(2 * (problem.target - problem.target.mean()))
    y = -(x * x) + 0j
    guess = starting_poles(order, x[0], x[-1], spacing="log")
    damped = np.where(guess.imag == 0, guess, -0.2 * np.abs(guess.imag) + 1j * guess.imag)
    with np.errstate(all="ignore"):
        q = vector_fit(
            y,
            power + 0j,
            weight=1 / power,
            poles=order_roots(damped**2),
            n_iterations=8,
            stable=False,
        )
        if np.any(np.abs(y[:, None] - q).min(axis=0) < 1e-12 * np.abs(q)):
            return None
        try:
            z, _ = fit_numerator(y, power + 0j, weight=1 / power, poles=q, n_zeros=order)
        except np.linalg.LinAlgError:
            return None
    if z.size != order or q.size != order or not (np.isfinite(z).all() and np.isfinite(q).all()):
        return None
    theta = np.concatenate([_parameters_of_square(z), _parameters_of_square(q)])
    shift = slope_at_zero(order) > 0
    theta[np.concatenate([shift, shift])] += np.log(scale)
    return problem.clip_sections(theta, order)


def _parameters_of_square(q: np.ndarray) -> np.ndarray:
    """Return parameters of the stable square roots of q; undamped ones, on the negative axis, get
    damping.
    """
    p = -np.sqrt(q.astype(complex))
    p = np.where(np.abs(p.real) < 1e-9 * np.abs(p), -np.abs(p), p)
    return section_logarithms(order_roots(np.where(np.abs(p.imag) < 1e-9 * np.abs(p), p.real, p)))


def imaginary_axis_frequencies(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return frequencies on the imaginary axis: omega itself, or 2/dt tan(omega dt/2)."""
    if dt:
        return 2 / dt * np.tan(np.minimum(omega * dt / 2, np.pi / 2 * (1 - 1e-6)))
    return omega


def minimum_phase(
    omega: np.ndarray, d: np.ndarray, *, dt: float, order: int
) -> tuple[control.StateSpace, control.StateSpace]:
    """Return a stable minimum-phase function with |D| near d, in the mean of the logarithm, and its
    inverse.
    """
    if order == 0:
        gain = float(np.exp(np.mean(np.log(d))))
        return control.StateSpace([], [], [], [[gain]], dt), control.StateSpace(
            [], [], [], [[1 / gain]], dt
        )
    _, theta, log_k = least_squares(
        magnitude_problem(imaginary_axis_frequencies(omega, dt), np.log(d), ends=False), order
    )[0]
    zeros, poles = zeros_and_poles(theta, order)
    gain = float(np.exp(log_k))
    return (
        from_roots(*map_to_model_plane(zeros, poles, gain, dt, 0), dt),
        from_roots(*map_to_model_plane(poles, zeros, 1 / gain, dt, 0), dt),
    )
