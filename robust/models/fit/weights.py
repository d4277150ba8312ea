"""Weights over a radius: stable, minimum phase, biproper, and as little above it as the order
allows.

The fit works on log |W| over log frequency: W = k prod of second-order sections in (log omega, log
zeta), stable and minimum phase for all parameters. The result is checked on the lines, on a ten
times finer grid, at zero and at infinity, and raised until it covers the radius everywhere.
"""

from __future__ import annotations

from itertools import islice

import control
import numpy as np

from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust.lti.lti import response
from robust.lti.realisation import from_roots
from robust.models.fit.rational import map_to_model_plane
from robust.models.fit.refinement import (
    MagnitudeProblem,
    log_sections,
    magnitude_problem,
    polish_by_barrier,
    slope_at_zero,
    zeros_and_poles,
)
from robust.models.fit.weight_search import (
    EXACT_TOLERANCE,
    Growth,
    add_states,
    constant_weight,
    fit_squared_magnitude,
    imaginary_axis_frequencies,
    least_squares,
    placed_weight,
    starting_parameters,
)

_COARSE_POINTS, _FINE_POINTS = 240, 700  # points to place sections, and for the final polish
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
        return imaginary_axis_frequencies(self.omega, self.dt)

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
        # two frequencies that differ by rounding have one logarithm, and no point between them
        n = np.clip(np.ceil(gaps / _LARGEST_STEP), 1, _MOST_BETWEEN + 1).astype(int) - 1
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
            imaginary_axis_frequencies(omega, self.dt),
        )
        return magnitude_problem(x, envelope, ends=True, share=share)


def _best_weight(demand: _Demand, order: int) -> _WeightFit:
    """Fit a weight of given order: exact if possible, else with the least mean excess."""
    if order and (exact := _exact_weight(demand, order)):
        return exact
    problem = demand.problem()
    coarse = problem.coarsen(_COARSE_POINTS)
    growth = constant_weight(coarse)
    while growth.order < order:
        growth = add_states(coarse, growth, min(2, order - growth.order))
    # for an odd order the weight grown by pairs may be far from the best: a rational fit of |W|^2
    # is another start
    lines = magnitude_problem(demand.x, demand.envelope, ends=True, share=demand.share).coarsen(
        _COARSE_POINTS
    )
    begun = []
    for start in starting_parameters(lines.thin(150), order) if order else []:
        on_lines = placed_weight(lines, start, order).fit[1]
        begun.append(placed_weight(coarse, on_lines, order))
    return _finished_weight(demand, problem, min([growth, *begun], key=lambda one: one.fit[0]))


def _choose_weight(demand: _Demand) -> _WeightFit:
    """Fit the weight of the order with the least sum of mean excess and price of its states."""
    fits = list(
        islice((fit for order in _exact_orders(demand) if (fit := _exact_weight(demand, order))), 1)
    )
    problem = demand.problem()
    coarse = problem.coarsen(_COARSE_POINTS)
    path = [constant_weight(coarse)]

    def price(growth: Growth) -> float:
        return _DB * growth.fit[0] + _STATE_PRICE_DB * growth.order

    best, most = path[0], fits[0].W.nstates if fits else MAX_CHOSEN_ORDER
    while path[-1].order + 2 <= min(
        most, price(best) / _STATE_PRICE_DB, best.order + 2 * _PATIENCE
    ):
        path.append(add_states(coarse, path[-1], 2))
        best = min(best, path[-1], key=price)
    if best.order:
        best = min(best, add_states(coarse, path[best.order // 2 - 1], 1), key=price)
    fits.append(_finished_weight(demand, problem, best))
    return min(fits, key=lambda fit: fit.mean_excess_db + _STATE_PRICE_DB * fit.W.nstates)


def _exact_orders(demand: _Demand) -> list[int]:
    """Return the orders at which the radius may be a weight: a first fit comes near it, as one of
    high order does.
    """
    problem = magnitude_problem(demand.x, np.log(demand.radius), ends=False, free=True).thin(150)

    def is_near(order: int) -> bool:
        theta = fit_squared_magnitude(problem, order)
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
    error, theta, _ = least_squares(
        magnitude_problem(demand.x, np.log(demand.radius), ends=False, free=True), order
    )[0]
    if error > EXACT_TOLERANCE:
        return None
    fit = _verify_and_lift(demand, theta, order, exact=True)
    if fit.max_excess_db < _EXACT_DB:
        return fit
    return None


def _finished_weight(demand: _Demand, problem: MagnitudeProblem, growth: Growth) -> _WeightFit:
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
