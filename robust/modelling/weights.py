"""Weights over a radius: stable, minimum phase, biproper, and as little above it as the order allows.

The fit works on log |W| over log frequency: W = k prod of second-order sections in (log omega, log zeta), stable
and minimum phase whatever the parameters. What it returns is verified on the lines, on a ten times finer grid, at
zero and at infinity, and lifted until nothing is violated.
"""

from __future__ import annotations

import time
from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import integer, nonnegative, real_array
from nlfrf.shared.values import value
from robust.modelling.excess import log_sections, problem_on, slope_at_zero, zeros_and_poles
from robust.modelling.overbound import EXACT, least_excess, least_squares
from robust.modelling.rational import to_plane
from robust.systems.lti import response
from robust.systems.realisation import from_roots

__all__ = ["WeightFit", "fit_weight", "minimum_phase"]


MAX_ORDER = 16
MAX_MEAN_EXCESS_DB = 30.0
FINER = 10
SAFETY = 1e-7  # what a parabola between the finest points could still hide
MOST_POINTS = 1500
EXACT_DB = 0.005
TIME_CAP = 3.0
DB = 20 / np.log(10)


@value
class WeightFit:
    """A weight over a radius.

    Fields
    ------
    W : control.StateSpace
        Stable, minimum phase, biproper.
    min_ratio : float
        Smallest |W| over what it has to cover, on the lines, on a ten times finer grid, at zero and infinity;
        at least one.
    max_excess_db, mean_excess_db : float
        Largest and mean |W| over the radius on the lines [dB].
    exact : bool
        The radius was itself a weight of this order and was recovered; what it does between the lines is then
        taken for the radius there. Otherwise the larger of the two neighbours holds between lines.

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


def fit_weight(omega: np.ndarray, radius: np.ndarray, *, order: int, dt: float = 0) -> WeightFit:
    """Fit a weight that covers a radius, with as little excess as the order allows.

    Parameters
    ----------
    omega : (W,) ndarray
        Frequencies [rad/s], increasing.
    radius : (W,) ndarray
        What |W| has to cover there, positive.
    order : int
        Number of poles (and zeros) of the weight.
    dt : float
        0 for a continuous weight, otherwise the sampling time [s] of a discrete one.

    Returns
    -------
    WeightFit
        The mean excess over the lines was minimised; |W| >= radius holds on the lines, |W| >= the larger
        neighbour between them, |W| >= the first and last radius at zero and infinity.

    Raises
    ------
    ValueError
        Frequencies that do not increase, a radius that is not positive, or an order so low that the mean
        excess would be 30 dB or more (it says which order would do).

    References
    ----------
    SP 7.4.3 (what the weight is for); Boyd & Vandenberghe, *Convex Optimization*, 11.3 (the barrier).

    Examples
    --------
    >>> omega = np.geomspace(0.1, 1000, 400)
    >>> fit = fit_weight(omega, np.abs((1j * omega + 2) / (0.5j * omega + 10)), order=1)
    >>> fit.exact, round(float(fit.W.poles()[0].real), 3), round(float(fit.W.zeros()[0].real), 3)
    (True, -20.0, -2.0)
    """
    omega, radius = checked_radius(omega, radius, dt)
    order = integer("order", order, least=0)
    if order > MAX_ORDER:
        raise ValueError(f"order must be at most {MAX_ORDER}, got {order}")
    fit = best_weight(omega, radius, order, float(dt))
    if fit.mean_excess_db < MAX_MEAN_EXCESS_DB:
        return fit
    for enough in range(order + 1, MAX_ORDER + 1):
        if best_weight(omega, radius, enough, float(dt)).mean_excess_db < MAX_MEAN_EXCESS_DB:
            cure = f"Order {enough} would do."
            break
    else:
        cure = f"No order up to {MAX_ORDER} would do: is the radius in the unit and range you expect?"
    raise ValueError(
        f"order must be high enough to cover the radius with a mean excess under {MAX_MEAN_EXCESS_DB:g} dB, "
        f"got order {order} with {fit.mean_excess_db:.1f} dB. {cure}"
    )


def checked_radius(omega: Any, radius: Any, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """The two arrays, or a refusal."""
    omega, radius = real_array("omega", omega, ndim=1), real_array("radius", radius, ndim=1)
    dt = nonnegative("dt", dt)
    if omega.size < 2 or radius.shape != omega.shape:
        raise ValueError(f"radius must have one value per frequency, at least two, got {radius.size} for {omega.size}")
    if np.any(np.diff(omega) <= 0) or omega[0] <= 0:
        raise ValueError(f"omega must be positive and increasing, got it starting {omega[:3]}")
    if np.any(radius <= 0):
        k = int(np.argmin(radius))
        raise ValueError(f"radius must be positive, got {radius[k]:g} at {omega[k]:g} rad/s")
    if dt and omega[-1] * dt > np.pi * (1 + 1e-9):
        raise ValueError(
            f"omega must not exceed the Nyquist frequency pi / dt = {np.pi / dt:g} rad/s, got {omega[-1]:g} rad/s"
        )
    return omega, radius


def best_weight(omega: np.ndarray, radius: np.ndarray, order: int, dt: float) -> WeightFit:
    """The fit itself: exact where possible, otherwise the least mean excess found, never worse than a constant."""
    deadline = time.monotonic() + TIME_CAP
    x = axis(omega, dt)
    log_r = np.log(radius)
    fits = [verified(omega, radius, np.zeros(2 * order), order, dt, exact=False)]
    begun = least_squares(problem_on(x, log_r, ends=False, free=True), order) if order else []
    if begun and begun[0][0] < EXACT and x.size >= 4 * (2 * order + 1):
        # through that many lines a weight goes by no accident
        fit = verified(omega, radius, begun[0][1], order, dt, exact=True)
        if fit.max_excess_db < EXACT_DB:
            return fit
    if order:
        problem = problem_on(x, envelope(log_r), ends=True).coarse(MOST_POINTS)
        for theta in least_excess(problem, order, begun, deadline):
            fits.append(verified(omega, radius, theta, order, dt, exact=False))
    return min(fits, key=lambda fit: fit.mean_excess_db)


def axis(omega: np.ndarray, dt: float) -> np.ndarray:
    """Frequencies on the imaginary axis: themselves, or 2/dt tan(omega dt/2)."""
    return 2 / dt * np.tan(np.minimum(omega * dt / 2, np.pi / 2 * (1 - 1e-6))) if dt else omega


def envelope(log_r: np.ndarray) -> np.ndarray:
    """What a continuous function must reach at each line to be above the larger neighbour on both sides."""
    upper = log_r.copy()
    upper[1:] = np.maximum(upper[1:], log_r[:-1])
    upper[:-1] = np.maximum(upper[:-1], log_r[1:])
    return upper


def verified(
    omega: np.ndarray, radius: np.ndarray, theta: np.ndarray, order: int, dt: float, *, exact: bool
) -> WeightFit:
    """The weight as a system, looked at on a finer grid and lifted until it covers what it has to."""
    shape = from_roots(*to_plane(*zeros_and_poles(theta, order), 1.0, dt, 0), dt)
    on_lines = np.abs(response(shape, omega))
    needed = np.max(radius / on_lines)
    if not exact:
        low = float(np.exp(slope_at_zero(order) @ (theta[:order] - theta[order:])))
        between = shortfall(theta, order, omega, radius, dt)
        needed = max(needed, np.max(np.exp(envelope(np.log(radius))) / on_lines), between, radius[0] / low, radius[-1])
    gain = float(needed) * (1 + SAFETY)
    W = control.StateSpace(shape.A, shape.B, shape.C * gain, shape.D * gain, dt)
    excess = DB * np.log(on_lines * gain / radius)
    return WeightFit(
        W=W,
        min_ratio=gain / float(needed),
        max_excess_db=float(excess.max()),
        mean_excess_db=float(excess.mean()),
        exact=exact,
    )


def magnitude_at(theta: np.ndarray, order: int, x: np.ndarray) -> np.ndarray:
    """|W| with gain one at infinity."""
    top, bottom = log_sections(x, theta.reshape(2, order), order)[0]
    return np.exp(top - bottom)


def shortfall(theta: np.ndarray, order: int, omega: np.ndarray, radius: np.ndarray, dt: float) -> float:
    """Largest of the larger neighbour over |W| between the lines: on a ten times finer grid, then down each dip.

    The grid is one over the imaginary axis: near the Nyquist frequency a little of omega is most of that.
    """
    x = np.log(axis(omega, dt))
    x[-1] += 10.0 * (omega[-1] * dt >= np.pi * (1 - 1e-6))  # there it lies at infinity
    fine = (x[:-1, None] + np.linspace(0, 1, FINER + 1) * np.diff(x)[:, None]).ravel()
    fine = np.unique(np.concatenate([fine, np.linspace(x[0], x[-1], MOST_POINTS)]))
    target = np.maximum(radius[1:], radius[:-1])

    def ratio(points: np.ndarray) -> np.ndarray:
        piece = np.clip(np.searchsorted(x, points, side="right") - 1, 0, target.size - 1)
        return np.asarray(magnitude_at(theta, order, np.exp(points).ravel()).reshape(points.shape) / target[piece])

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
    omega: np.ndarray, d: np.ndarray, dt: float, order: int
) -> tuple[control.StateSpace, control.StateSpace]:
    """A stable minimum-phase function with |D| near d, in the mean of the logarithm, and its inverse."""
    if order == 0:
        gain = float(np.exp(np.mean(np.log(d))))
        return control.StateSpace([], [], [], [[gain]], dt), control.StateSpace([], [], [], [[1 / gain]], dt)
    _, theta, log_k = least_squares(problem_on(axis(omega, dt), np.log(d), ends=False), order)[0]
    zeros, poles = zeros_and_poles(theta, order)
    gain = float(np.exp(log_k))
    return (
        from_roots(*to_plane(zeros, poles, gain, dt, 0), dt),
        from_roots(*to_plane(poles, zeros, 1 / gain, dt, 0), dt),
    )
