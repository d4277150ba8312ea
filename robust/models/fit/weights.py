"""Weights over a radius: stable, minimum phase, biproper, and as little above it as the order
allows.

The fit works on log |W| over log frequency: W = k prod of second-order sections in (log omega, log
zeta), stable and minimum phase for all parameters. The result is checked on the lines, on a ten
times finer grid, at zero and at infinity, and raised until it covers the radius everywhere.
"""

from __future__ import annotations

from dataclasses import replace
from itertools import islice

import control
import numpy as np

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust.lti.lti import response
from robust.lti.realisation import from_roots, order_roots
from robust.lti.sampling import discretize
from robust.models.fit.rational import fit_numerator, map_to_model_plane, starting_poles, vector_fit
from robust.models.fit.refinement import (
    MagnitudeProblem,
    asymmetric_cost,
    fit_asymmetric,
    log_sections,
    magnitude_problem,
    polish_by_barrier,
    section_logarithms,
    sections_that_pay,
    slope_at_zero,
    zeros_and_poles,
)

# ---- Weights by formula: for S and K S, and for a neglected delay and gain error.


def performance_weight(
    omega_B: float, *, M_S: float = 2.0, A: float = 1e-3, order: int = 1
) -> control.StateSpace:
    """Return the performance weight w_P for the demand |S| <= 1/|w_P|.

    Use this for a bound on |S|, and `control_weight` for a bound on |K S|.

    w_P = ((s/M_S^(1/n) + omega_B)/(s + omega_B A^(1/n)))^n.

    Parameters
    ----------
    omega_B : float
        Requested bandwidth [rad/s], where the asymptote of 1/|w_P| crosses one.
    M_S : float
        Largest |S| allowed anywhere, above one (2 is usual).
    A : float
        |S| allowed at zero frequency, below M_S.
    order : int
        The n of the formula: 1/|w_P| rises by n decades per decade below omega_B.

    Returns
    -------
    control.StateSpace

    Raises
    ------
    ValueError
        Numbers that are not positive.
        An A that is not below M_S, an M_S that is not above one.

    References
    ----------
    SP eq. 2.105 and 2.106 (2.8.2).

    Examples
    --------
    >>> w_P = performance_weight(10, M_S=1.5, A=1e-4)
    >>> round(float(abs(w_P(1e6j))), 4), round(float(abs(w_P(0))))
    (0.6667, 10000)
    """
    omega_B = require_positive("omega_B", omega_B)
    M_S = require_positive("M_S", M_S)
    A = require_positive("A", A)
    order = require_integer("order", order, least=1)
    if M_S <= 1:
        raise ValueError(
            f"M_S must be above 1: |S| of a real loop exceeds one somewhere, got {M_S:g}"
        )
    if A >= M_S:
        raise ValueError(f"A must be below M_S = {M_S:g}, got {A:g}")
    high, low = M_S ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_B * high), np.full(order, -omega_B * low), 1 / M_S, 0.0)


def control_weight(
    omega_bc: float, *, M_u: float = 1.0, A: float = 1e-2, order: int = 1
) -> control.StateSpace:
    """Return the control weight w_u for the demand |K S| <= 1/|w_u|.

    Use this to bound the actuator effort and to make the controller roll off. 1/|w_u| is M_u at low
    frequency and A far above omega_bc.

    w_u = ((s + omega_bc/M_u^(1/n))/(A^(1/n) s + omega_bc))^n.

    Parameters
    ----------
    omega_bc : float
        Frequency [rad/s] from which the controller has to roll off.
    M_u : float
        Largest |K S| at low frequency [unit of u per unit of y].
    A : float
        Largest |K S| at high frequency, below M_u.
    order : int
        The n of the formula: 1/|w_u| falls by n decades per decade around omega_bc.

    Returns
    -------
    control.StateSpace
        Weight of this order, biproper.

    Raises
    ------
    ValueError
        Numbers that are not positive, an A that is not below M_u.

    References
    ----------
    Zhou & Doyle, *Essentials of Robust Control*, 6.4.

    Examples
    --------
    >>> w_u = control_weight(100.0, M_u=5.0, A=0.1)
    >>> round(float(abs(w_u(0))), 6), round(float(abs(w_u(1e9j))), 6)
    (0.2, 10.0)
    """
    omega_bc = require_positive("omega_bc", omega_bc)
    M_u = require_positive("M_u", M_u)
    A = require_positive("A", A)
    order = require_integer("order", order, least=1)
    if M_u <= A:
        raise ValueError(f"A must be below M_u = {M_u:g}, got {A:g}")
    low, high = M_u ** (1 / order), A ** (1 / order)
    return from_roots(np.full(order, -omega_bc / low), np.full(order, -omega_bc / high), 1 / A, 0.0)


def makeweight(
    dc: float,
    crossover: float | tuple[float, float],
    high: float,
    *,
    order: int = 1,
    dt: float = 0.0,
) -> control.StateSpace:
    """Return a weight with given gains at zero, at one frequency and at infinity, as in MATLAB.

    W = ((h s + a d)/(s + a))^n with d = dc^(1/n), h = high^(1/n), and a from the gain m at omega.

    Parameters
    ----------
    dc, high : float
        |W| at zero frequency, and at infinity (sampled: at the Nyquist frequency).
    crossover : float or (float, float)
        Frequency [rad/s] at which |W| is one; or omega [rad/s] and |W| at omega, between dc and
        high.
    order : int
        Order of the weight; a higher order is steeper between dc and high.
    dt : float
        Sampling time [s]; 0 for a continuous weight.

    Returns
    -------
    control.StateSpace
        Stable, minimum phase and biproper.

    Raises
    ------
    ValueError
        Numbers that are not positive, a gain that is not between dc and high, a frequency beyond
        Nyquist.

    References
    ----------
    SP 2.8.2. A sampled weight comes from the bilinear map that is exact at omega.

    Examples
    --------
    >>> W = makeweight(100, (2.0, 1.5), 0.1, order=3)
    >>> [round(float(abs(W(s))), 6) for s in (0, 2j, 1e9j)]
    [100.0, 1.5, 0.1]
    >>> W = makeweight(0.01, 30.0, 2.0, dt=0.05)
    >>> [round(float(abs(W(np.exp(0.05j * w)))), 6) for w in (0.0, 30.0, np.pi / 0.05)]
    [0.01, 1.0, 2.0]
    """
    if isinstance(crossover, tuple | list) and len(crossover) == 2:
        omega, gain = crossover
    else:
        omega, gain = crossover, 1.0
    omega, gain = require_positive("crossover", omega), require_positive("crossover[1]", gain)
    dc = require_positive("dc", dc)
    high = require_positive("high", high)
    dt = require_nonnegative("dt", dt)
    order = require_integer("order", order, least=1)
    if not min(dc, high) < gain < max(dc, high):
        raise ValueError(
            f"the gain at crossover must be between dc = {dc:g} and high = {high:g}, got {gain:g}"
        )
    if omega * dt >= np.pi:
        raise ValueError(
            f"crossover must lie below the Nyquist frequency {np.pi / dt:g} rad/s, got {omega:g}"
            " rad/s"
        )
    d, m, h = (size ** (1 / order) for size in (dc, gain, high))
    a = omega * np.sqrt((m**2 - h**2) / (d**2 - m**2))
    W = from_roots(np.full(order, -a * d / h), np.full(order, -a), high, 0.0)
    if dt:
        return discretize(W, dt, prewarp=omega)
    return W


def delay_weight(delay: float, *, gain: float = 0.0) -> control.StateSpace:
    """Return a third-order multiplicative weight that covers an uncertain delay and gain.

    Use this for a delay that the nominal model does not contain.

    The weight covers |k exp(-s theta) - 1| for 0 <= theta <= delay and 1 - gain <= k <= 1 + gain.
    The rational weights of SP 7.4.5 do not cover the exact radius at all frequencies, so they are
    raised until they do.

    Parameters
    ----------
    delay : float
        Longest delay [s] that the nominal model does not contain.
    gain : float
        Relative gain error, below 1.

    Returns
    -------
    control.StateSpace
        A weight within a few tenths of a dB of the exact radius. Without gain error it is zero at
        zero frequency.

    Raises
    ------
    ValueError
        A delay that is not positive, a gain error out of [0, 1).

    References
    ----------
    SP 7.4.5 (the exact radius and its approximations).

    Examples
    --------
    >>> w_I = delay_weight(0.01)
    >>> all(abs(w_I(1j * w)) >= abs(np.exp(-0.01j * w) - 1) for w in (1.0, 100.0, 314.0, 1000.0))
    True
    """
    delay, gain = require_positive("delay", delay), require_nonnegative("gain", gain)
    if gain >= 1:
        raise ValueError(
            f"gain must be below 1: with 100 % error the plant may vanish, got {gain:g}"
        )
    top = 1 + gain / 2
    pairs = [2.363 / delay * (-zeta + 1j * np.sqrt(1 - zeta**2)) for zeta in (0.838, 0.685)]
    zeros, poles = (
        np.array([real, p, p.conjugate()])
        for real, p in zip((-gain / (top * delay), -2 / delay), pairs, strict=True)
    )
    W = from_roots(zeros, poles, 2 * top, 0.0)
    omega = (
        np.concatenate(
            [np.geomspace(1e-4, 1, 200), np.linspace(1, 20, 4000), np.geomspace(20, 1e4, 200)]
        )
        / delay
    )
    lift = float(np.max(_delay_radius(omega * delay, gain) / np.abs(response(W, omega)))) * (
        1 + 1e-6
    )
    return control.StateSpace(W.A, W.B, W.C * max(lift, 1.0), W.D * max(lift, 1.0), 0)


def _delay_radius(x: np.ndarray, gain: float) -> np.ndarray:
    """Return (W,) max |k exp(-j x t) - 1| over 0 <= t <= 1, |k - 1| <= gain, x = omega delay."""
    return np.where(
        x < np.pi, np.sqrt(gain**2 + 2 * (1 + gain) * (1 - np.cos(np.minimum(x, np.pi)))), 2 + gain
    )


# ---- The numerical problem of `fit_weight`: least mean log excess of |W| over a target that it
# must cover.

_EXACT_TOLERANCE = 1e-4  # log error below which a weight is the target itself
_BELOW = 8.0  # cost of negative over positive excess while sections are placed; best of 2, 4, 8, 16
_COARSE_POINTS, _FINE_POINTS = 240, 700  # points to place sections, and for the final polish
Fit = tuple[float, np.ndarray, float]  # error, theta, log_k


def _least_squares(problem: MagnitudeProblem, order: int) -> list[Fit]:
    """Return fits of the target from every start with their largest error, best first."""
    few, fits = problem.thin(150), []
    for start in _starting_parameters(few, order):
        theta, log_k = fit_asymmetric(few, start, order=order, below=1.0, n_iterations=40)
        error = float(np.abs(few.excess(theta, log_k, order)[0]).max())
        if error < 1e-2:  # perhaps exact: decide on all points
            theta, log_k = fit_asymmetric(problem, theta, order=order, below=1.0, n_iterations=15)
            error = float(np.abs(problem.excess(theta, log_k, order)[0]).max())
        fits.append((error, theta, log_k))
        if error < _EXACT_TOLERANCE:
            break
    return sorted(fits, key=lambda fit: fit[0])


@value
class _Growth:
    """A weight that grows by sections: the least squares solution (theta, log_k), and a fit.

    The next section is placed on the least squares solution, whose negative excess costs `_BELOW`^2
    times as much.
    """

    order: int
    placed: tuple[np.ndarray, float]
    fit: Fit


def _constant_weight(problem: MagnitudeProblem) -> _Growth:
    placed = fit_asymmetric(problem, np.zeros(0), order=0, below=_BELOW, n_iterations=8)
    level = max(float(problem.target.max()), problem.low, problem.high)
    fit = problem.mean_excess(np.zeros(0), level, 0), np.zeros(0), level
    return _Growth(order=0, placed=placed, fit=fit)


def _add_states(problem: MagnitudeProblem, growth: _Growth, more: int) -> _Growth:
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
    grown = _placed_weight(problem, start, order)
    # a section whose zeros cancel its poles changes nothing: growing never makes it worse
    least, before, gain = growth.fit
    same = (
        least,
        _add_section(before, np.array([problem.log_x.mean(), 0.0])[:more], np.zeros(more)),
        gain,
    )
    return replace(grown, fit=min(grown.fit, same, key=lambda fit: fit[0]))


def _placed_weight(problem: MagnitudeProblem, start: np.ndarray, order: int) -> _Growth:
    """Return the weight with sections refined by least squares, then by least excess."""
    theta, log_k = placed = fit_asymmetric(
        problem, start, order=order, below=_BELOW, n_iterations=8
    )
    theta, log_k = polish_by_barrier(
        problem, theta, log_k=log_k, order=order, barriers=(0.1, 0.02, 0.005), n_iterations=12
    )
    return _Growth(
        order=order, placed=placed, fit=(problem.mean_excess(theta, log_k, order), theta, log_k)
    )


def _add_section(theta: np.ndarray, section: np.ndarray, split: np.ndarray) -> np.ndarray:
    """Return parameters (of even order) with one more section, its zeros and poles split about the
    given section.
    """
    zeros, poles = theta.reshape(2, -1)
    return np.concatenate([zeros, section + split, poles, section - split])


def _starting_parameters(problem: MagnitudeProblem, order: int) -> list[np.ndarray]:
    """Return starting parameters: a rational fit of |W|^2, sections spread over the band."""
    fitted = _fit_squared_magnitude(problem, order)
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


def _fit_squared_magnitude(problem: MagnitudeProblem, order: int) -> np.ndarray | None:
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


_MAX_ORDER = 16
#: For a weight without a given order: its states return in every controller and proof.
MAX_CHOSEN_ORDER = 12
_STATE_PRICE_DB = 0.1  # least saving of mean excess by one state
# pairs of states after the best that may save nothing: of two spikes, one alone lowers no level
_PATIENCE = 2
# log error of a first fit above which the radius is not a weight of its order
_ROUGH_TOLERANCE = 0.1
_MAX_EXACT_ORDER = 8
_LARGEST_STEP = 0.12  # of ln(omega) between two points of a fit, as for an assumed radius
_MOST_BETWEEN = 20  # points between two lines
#: Least importance over the largest. For |T|, which falls by 40 dB a decade, a weight of order 4
#: lay 78 dB over the radius without it.
_LEAST_IMPORTANCE = 0.1
_MAX_MEAN_EXCESS_DB = 30.0
_REFINEMENT = 10
_LIFT = 1e-7  # bound of what a parabola between the finest points could hide
_MAX_POINTS = 1500
_EXACT_DB = 0.005
_DB = 20 / np.log(10)


@value
class _WeightFit:
    """A weight that covers a radius, and its excess.

    Fields
    ------
    W : control.StateSpace
        Stable, minimum phase, biproper.
    min_ratio : float
        Smallest |W|/radius on the lines, on a ten times finer grid, at zero and infinity; at least
        one.
    max_excess_db, mean_excess_db : float
        Largest |W|/radius on the lines [dB], and its mean, weighted by importance.
    exact : bool
        True if the radius is itself a weight of this order and was recovered. The radius between
        the lines is then |W|. Otherwise it is taken as the larger radius of the two neighbouring
        lines.

    References
    ----------
    SP 7.4.3.

    Examples
    --------
    >>> fit = fit_weight(np.array([1.0, 2.0, 4.0]), np.array([0.1, 0.2, 0.3]), order=1)
    >>> fit.min_ratio >= 1, fit.W.nstates
    (True, 1)
    """

    W: control.StateSpace
    min_ratio: float
    max_excess_db: float
    mean_excess_db: float
    exact: bool


_N_COVER, _SLOWEST_RATIO = 400, 1 / 30  # points, and the first one over the slowest corner


class WeightOrderError(ValueError):
    """A weight of that order cannot cover the radius without a large excess."""


def fit_weight(
    omega: np.ndarray,
    radius: np.ndarray,
    *,
    order: int | None = None,
    dt: float = 0,
    importance: np.ndarray | None = None,
) -> _WeightFit:
    """Fit a weight that covers a radius, with as little excess as the order allows.

    Use this for a radius of your own; `uncertainty` already contains this fit.

    Parameters
    ----------
    omega : (W,) ndarray
        Frequencies [rad/s], increasing.
    radius : (W,) ndarray
        Lower bound of |W|, positive.
    order : int, optional
        Number of poles (and zeros) of the weight. By default it is raised, up to 12, as long as one
        more state lowers the mean excess |W|/radius by 0.1 dB.
    dt : float
        0 for a continuous weight, otherwise the sampling time [s] of a discrete one.
    importance : (W,) ndarray, optional
        Weight of the excess (in decibels) at each frequency, for example |T| of the intended loop;
        uniform by default. A value below a tenth of the largest counts as a tenth. |W| >= radius
        holds for any importance.

    Returns
    -------
    WeightFit
        The weight with the least mean excess over the lines, weighted by importance. On the lines
        |W| >= radius. Between two lines |W| is at least the larger of both radii. At zero and at
        infinity it is at least the first and the last radius.

    Raises
    ------
    ValueError
        Frequencies that do not increase, a radius that is not positive, or an order so low that the
        mean excess would be 30 dB or more (the message gives a sufficient order).

    References
    ----------
    SP 7.4.3 (what the weight is for); Boyd & Vandenberghe, *Convex Optimization*, 11.3 (the
    barrier).

    Examples
    --------
    >>> omega = np.geomspace(0.1, 1000, 400)
    >>> fit = fit_weight(omega, np.abs((1j * omega + 2) / (0.5j * omega + 10)), order=1)
    >>> fit.exact, round(float(fit.W.poles()[0].real), 3), round(float(fit.W.zeros()[0].real), 3)
    (True, -20.0, -2.0)
    >>> [fit_weight(omega, np.abs(1 / (1 + 0.1j * omega) ** n)).W.nstates for n in (0, 1, 2)]
    [0, 1, 2]
    """
    demand = _checked_demand(omega, radius, require_nonnegative("dt", dt), importance)
    if order is None:
        fit = _choose_weight(demand)
        order = fit.W.nstates
    else:
        order = require_integer("order", order, least=0)
        if order > _MAX_ORDER:
            raise ValueError(f"order must be at most {_MAX_ORDER}, got {order}")
        fit = _best_weight(demand, order)
    if fit.mean_excess_db < _MAX_MEAN_EXCESS_DB:
        return fit
    for enough in range(order + 1, _MAX_ORDER + 1):
        if _best_weight(demand, enough).mean_excess_db < _MAX_MEAN_EXCESS_DB:
            cure = f"Order {enough} is enough."
            break
    else:
        cure = f"No order up to {_MAX_ORDER} is enough: check unit and range of the radius."
    raise WeightOrderError(
        "order must be high enough to cover the radius with a mean excess under"
        f" {_MAX_MEAN_EXCESS_DB:g} dB, got order {order} with {fit.mean_excess_db:.1f} dB. {cure}"
    )


def larger_of_neighbours(radius: np.ndarray) -> np.ndarray:
    """Return (W,) the magnitude needed on each line so that the larger neighbour is covered between
    lines.
    """
    sides = np.pad(radius, 1, mode="edge")
    return np.maximum(radius, np.maximum(sides[:-2], sides[2:]))


@value
class _Demand:
    """Lines omega (W,) [rad/s], the radius there, the sampling time [s], and the weights of the
    lines, of sum one.
    """

    omega: np.ndarray
    radius: np.ndarray
    dt: float
    share: np.ndarray

    @property
    def x(self) -> np.ndarray:
        """The lines on the imaginary axis."""
        return _imaginary_axis_frequencies(self.omega, self.dt)

    @property
    def envelope(self) -> np.ndarray:
        """The log magnitude needed on each line so that a continuous weight covers the larger
        neighbour.
        """
        return np.log(larger_of_neighbours(self.radius))

    def problem(self) -> MagnitudeProblem:
        """Return the fit to the lines and to points between them: between sparse lines a weight
        must not bulge.
        """
        log_w, log_r = np.log(self.omega), np.log(self.radius)
        gaps = np.diff(log_w)
        n = np.minimum(np.ceil(gaps / _LARGEST_STEP), _MOST_BETWEEN + 1).astype(int) - 1
        at = np.repeat(np.arange(n.size), n)  # the line before each point
        part = (np.arange(at.size) - np.repeat(np.cumsum(n) - n, n) + 1) / (n[at] + 1)
        order = np.argsort(np.r_[log_w, log_w[at] + part * gaps[at]], kind="stable")
        omega = np.exp(np.r_[log_w, log_w[at] + part * gaps[at]])[order]
        envelope = np.r_[self.envelope, np.maximum(log_r[at], log_r[at + 1])][order]
        of_line = np.r_[
            np.arange(log_w.size), at + (part > 0.5)
        ]  # the nearest line, whose importance a point takes
        share = (self.share / np.bincount(of_line))[of_line][order]
        x = np.where(
            order < log_w.size,
            self.x[np.minimum(order, log_w.size - 1)],
            _imaginary_axis_frequencies(omega, self.dt),
        )
        return magnitude_problem(x, envelope, ends=True, share=share)


def _best_weight(demand: _Demand, order: int) -> _WeightFit:
    """Fit a weight of given order: exact if possible, else with the least mean excess."""
    if order and (exact := _exact_weight(demand, order)):
        return exact
    problem = demand.problem()
    coarse = problem.coarsen(_COARSE_POINTS)
    growth = _constant_weight(coarse)
    while growth.order < order:
        growth = _add_states(coarse, growth, min(2, order - growth.order))
    # for an odd order the weight grown by pairs may be far from the best: a rational fit of |W|^2
    # is another start
    lines = magnitude_problem(demand.x, demand.envelope, ends=True, share=demand.share).coarsen(
        _COARSE_POINTS
    )
    begun = []
    for start in _starting_parameters(lines.thin(150), order) if order else []:
        on_lines = _placed_weight(lines, start, order).fit[1]
        begun.append(_placed_weight(coarse, on_lines, order))
    return _finished_weight(demand, problem, min([growth, *begun], key=lambda one: one.fit[0]))


def _choose_weight(demand: _Demand) -> _WeightFit:
    """Fit the weight of the order with the least sum of mean excess and price of its states."""
    fits = list(
        islice((fit for order in _exact_orders(demand) if (fit := _exact_weight(demand, order))), 1)
    )
    problem = demand.problem()
    coarse = problem.coarsen(_COARSE_POINTS)
    path = [_constant_weight(coarse)]

    def price(growth: _Growth) -> float:
        return _DB * growth.fit[0] + _STATE_PRICE_DB * growth.order

    best, most = path[0], fits[0].W.nstates if fits else MAX_CHOSEN_ORDER
    while path[-1].order + 2 <= min(
        most, price(best) / _STATE_PRICE_DB, best.order + 2 * _PATIENCE
    ):
        path.append(_add_states(coarse, path[-1], 2))
        best = min(best, path[-1], key=price)
    if best.order:
        best = min(best, _add_states(coarse, path[best.order // 2 - 1], 1), key=price)
    fits.append(_finished_weight(demand, problem, best))
    return min(fits, key=lambda fit: fit.mean_excess_db + _STATE_PRICE_DB * fit.W.nstates)


def _exact_orders(demand: _Demand) -> list[int]:
    """Return the orders at which the radius may be a weight: a first fit comes near it, as one of
    high order does.
    """
    problem = magnitude_problem(demand.x, np.log(demand.radius), ends=False, free=True).thin(150)

    def is_near(order: int) -> bool:
        theta = _fit_squared_magnitude(problem, order)
        if theta is None:
            return True
        error = problem.excess(theta, -problem.mean_excess(theta, 0.0, order), order)[0]
        return bool(np.abs(error).max() < _ROUGH_TOLERANCE)

    if is_near(_MAX_EXACT_ORDER):
        return [order for order in range(1, _MAX_EXACT_ORDER + 1) if is_near(order)]
    return []


def _exact_weight(demand: _Demand, order: int) -> _WeightFit | None:
    """Return the radius as a weight of this order, or None if it is not one."""
    if demand.omega.size < 4 * (2 * order + 1):  # a weight may fit fewer lines by accident
        return None
    error, theta, _ = _least_squares(
        magnitude_problem(demand.x, np.log(demand.radius), ends=False, free=True), order
    )[0]
    if error > _EXACT_TOLERANCE:
        return None
    fit = _verify_and_lift(demand, theta, order, exact=True)
    if fit.max_excess_db < _EXACT_DB:
        return fit
    return None


def _finished_weight(demand: _Demand, problem: MagnitudeProblem, growth: _Growth) -> _WeightFit:
    """Return the weight polished on all lines and verified; never worse than a constant, nor than
    before.
    """
    order, (_, theta, log_k) = growth.order, growth.fit
    polished, _ = polish_by_barrier(
        problem.coarsen(_FINE_POINTS),
        theta,
        log_k=log_k,
        order=order,
        barriers=(0.1, 0.02, 0.005, 0.001),
        n_iterations=60,
    )
    fits = [
        _verify_and_lift(demand, each, order, exact=False)
        for each in (polished, theta, np.zeros(2 * order))
    ]
    return min(fits, key=lambda fit: fit.mean_excess_db)


def cover_sampled(weight: control.StateSpace, dt: float) -> control.StateSpace:
    """Fit a discrete weight for one channel that covers a continuous one closely, up to the Nyquist
    frequency.

    A demand on a sampled loop is about |w| at its frequencies. Tustin's method warps that axis and
    demands too little near Nyquist. For weights of first and second order the excess was at most
    0.3 dB.
    """
    corners = np.abs(np.concatenate([weight.poles(), weight.zeros()]))
    first = np.min(corners[corners > 0], initial=np.pi / dt) * _SLOWEST_RATIO
    omega = np.geomspace(first, np.pi / dt, _N_COVER)
    radius = np.abs(response(weight, omega))
    return fit_weight(omega, radius, order=weight.nstates, dt=dt).W


def _checked_demand(
    omega: np.ndarray, radius: np.ndarray, dt: float, importance: np.ndarray | None
) -> _Demand:
    omega = require_real_array("omega", omega, ndim=1)
    radius = require_real_array("radius", radius, ndim=1)
    dt = require_nonnegative("dt", dt)
    if omega.size < 2 or radius.shape != omega.shape:
        raise ValueError(
            f"radius must have one value per frequency, at least two, got {radius.size} for"
            f" {omega.size}"
        )
    if np.any(np.diff(omega) <= 0) or omega[0] <= 0:
        raise ValueError(f"omega must be positive and increasing, got {omega[:3]} at its start")
    if np.any(radius <= 0):
        k = int(np.argmin(radius))
        raise ValueError(f"radius must be positive, got {radius[k]:g} at {omega[k]:g} rad/s")
    if dt and omega[-1] * dt > np.pi * (1 + 1e-9):
        raise ValueError(
            f"omega must not exceed the Nyquist frequency pi / dt = {np.pi / dt:g} rad/s, got"
            f" {omega[-1]:g} rad/s"
        )
    if importance is None:
        share = np.ones(omega.size)
    else:
        share = require_real_array("importance", importance, ndim=1)
    if share.shape != omega.shape or share.min() < 0 or not share.any():
        raise ValueError(
            f"importance must be one number of at least 0 for each of {omega.size} frequencies, not"
            f" all of them 0, got {short_form(importance)}"
        )
    share = np.maximum(share, _LEAST_IMPORTANCE * share.max())
    return _Demand(omega=omega, radius=radius, dt=dt, share=share / share.sum())


def _imaginary_axis_frequencies(omega: np.ndarray, dt: float) -> np.ndarray:
    """Return frequencies on the imaginary axis: omega itself, or 2/dt tan(omega dt/2)."""
    if dt:
        return 2 / dt * np.tan(np.minimum(omega * dt / 2, np.pi / 2 * (1 - 1e-6)))
    return omega


def _verify_and_lift(demand: _Demand, theta: np.ndarray, order: int, *, exact: bool) -> _WeightFit:
    """Return the weight as a system, lifted until it covers the radius on a finer grid."""
    radius, dt = demand.radius, demand.dt
    shape = from_roots(*map_to_model_plane(*zeros_and_poles(theta, order), 1.0, dt, 0), dt)
    on_lines = np.abs(response(shape, demand.omega))
    needed = np.max(radius / on_lines)
    if not exact:
        low = float(np.exp(slope_at_zero(order) @ (theta[:order] - theta[order:])))
        between = _largest_shortfall(demand, theta, order)
        needed = max(
            needed, np.max(np.exp(demand.envelope) / on_lines), between, radius[0] / low, radius[-1]
        )
    gain = float(needed) * (1 + _LIFT)
    W = control.StateSpace(shape.A, shape.B, shape.C * gain, shape.D * gain, dt)
    excess = _DB * np.log(on_lines * gain / radius)
    return _WeightFit(
        W=W,
        min_ratio=gain / float(needed),
        max_excess_db=float(excess.max()),
        mean_excess_db=float(demand.share @ excess),
        exact=exact,
    )


def _magnitude_at(theta: np.ndarray, order: int, x: np.ndarray) -> np.ndarray:
    """Return |W| with gain one at infinity."""
    top, bottom = log_sections(x, theta.reshape(2, order), order)[0]
    return np.exp(top - bottom)


def _largest_shortfall(demand: _Demand, theta: np.ndarray, order: int) -> float:
    """Return the largest ratio of larger neighbour to |W| between the lines: on a finer grid, then
    in each dip.

    The grid is even over the imaginary axis: near the Nyquist frequency a small step in omega is a
    large one there.
    """
    x, radius = np.log(demand.x), demand.radius
    x[-1] += 10.0 * (
        demand.omega[-1] * demand.dt >= np.pi * (1 - 1e-6)
    )  # Nyquist is at infinity on that axis
    fine = (x[:-1, None] + np.linspace(0, 1, _REFINEMENT + 1) * np.diff(x)[:, None]).ravel()
    fine = np.unique(np.concatenate([fine, np.linspace(x[0], x[-1], _MAX_POINTS)]))
    target = np.maximum(radius[1:], radius[:-1])

    def ratio(points: np.ndarray) -> np.ndarray:
        piece = np.clip(np.searchsorted(x, points, side="right") - 1, 0, target.size - 1)
        return np.asarray(
            _magnitude_at(theta, order, np.exp(points).ravel()).reshape(points.shape)
            / target[piece]
        )

    values = ratio(fine)
    least = float(values.min())
    dips = np.flatnonzero((values[1:-1] <= values[:-2]) & (values[1:-1] <= values[2:])) + 1
    dips = dips[np.argsort(values[dips])][:40]
    low, high = fine[dips - 1], fine[dips + 1]
    for _ in range(2 if dips.size else 0):
        near = low[:, None] + np.linspace(0, 1, 41) * (high - low)[:, None]
        values = ratio(near)
        least = min(least, float(values.min()))
        k, each = values.argmin(axis=1), np.arange(dips.size)
        low, high = near[each, np.maximum(k - 1, 0)], near[each, np.minimum(k + 1, 40)]
    return 1 / least


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
    _, theta, log_k = _least_squares(
        magnitude_problem(_imaginary_axis_frequencies(omega, dt), np.log(d), ends=False), order
    )[0]
    zeros, poles = zeros_and_poles(theta, order)
    gain = float(np.exp(log_k))
    return (
        from_roots(*map_to_model_plane(zeros, poles, gain, dt, 0), dt),
        from_roots(*map_to_model_plane(poles, zeros, 1 / gain, dt, 0), dt),
    )
