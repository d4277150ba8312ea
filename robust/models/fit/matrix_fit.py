"""The nominal model of a measured matrix: shared poles behind the delays of the inputs."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    require_integer,
    require_nonnegative,
    require_real_array,
    short_form,
)
from nlfrf._base.values import value
from robust.lti.lti import with_names
from robust.lti.sampling import delay_samples, discretize
from robust.models.fit.class_error import most_likely_size
from robust.models.fit.fit_uncertainty import expected_ratio, probability_of_cost
from robust.models.fit.measurement import checked_crossover, require_fittable
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.search import MAX_ROUNDS, SETTLED, START_SIZES, UNLIKELY_COST
from robust.models.fit.shared_poles import (
    ErrorMetric,
    FitOptions,
    SharedPoles,
    error_metric,
    fit_by_vector_fitting,
    fit_shared_poles,
    refine_shared_poles,
    response_derivatives,
)

_MAX_DELAY_TRIALS, _N_ROUNDS = 41, 12
# in turns at the highest line: a smaller change of a delay ends the refinement
_DELAY_TOLERANCE = 1e-7


@value(copy=False)
class _MatrixFitProblem:
    """Data, metric and options for the fit of a matrix."""

    # points, omega: (F,) frequencies of the fit and of the record [rad/s]
    points: np.ndarray
    omega: np.ndarray
    G: np.ndarray  # (F, n_y, n_u) complex the matrix
    metric: ErrorMetric  # weight of its error
    options: FitOptions  # n_poles, rank, direct and stable

    def without_delays(self, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray, ErrorMetric]:
        """Return points, matrix and metric with the delays (n_u,) of the inputs removed."""
        turn = np.exp(1j * self.omega[:, None] * tau)
        return self.points, self.G * turn[:, None], self.metric.behind_delays(turn)

    def fit_behind_delays(
        self, tau: np.ndarray, start: SharedPoles | None = None
    ) -> tuple[SharedPoles, float]:
        """Return the best model with given delays, from a start or without, and its cost."""
        points, G, metric = self.without_delays(tau)
        model = start or fit_shared_poles(points, G, metric=metric, **self.options)
        return refine_shared_poles(
            points,
            G,
            metric=metric,
            model=model,
            direct=self.options["direct"],
            stable=self.options["stable"],
        )

    def error(self, model: SharedPoles, tau: np.ndarray) -> np.ndarray:
        """Return G minus a model behind delays, (F, n_y, n_u)."""
        return (
            self.G - model.response(self.points) * np.exp(-1j * self.omega[:, None] * tau)[:, None]
        )

    def with_class_error(
        self, model: SharedPoles, tau: np.ndarray
    ) -> tuple[_MatrixFitProblem, float]:
        """Return the problem at the likeliest size of the error of the class, and the negative log
        likelihood there.
        """
        square = np.abs(self.metric.left @ self.error(model, tau) @ self.metric.right) ** 2
        epsilon, unlikely = most_likely_size(square, np.ones(square.shape), self.metric.tolerance)
        return replace(self, metric=replace(self.metric, epsilon=epsilon)), unlikely

    def settle(
        self, model: SharedPoles, tau: np.ndarray
    ) -> tuple[_MatrixFitProblem, SharedPoles, float]:
        """Alternate between the model and the size of the class error, from a start; return both
        with their value.
        """
        last = np.inf
        for _ in range(MAX_ROUNDS):
            weighted, unlikely = self.with_class_error(model, tau)
            if not unlikely < last - SETTLED:
                break
            last, model = unlikely, weighted.fit_behind_delays(tau, model)[0]
        return weighted, model, unlikely


def fit_matrix(
    frms: list[Bla],
    n_poles: int,
    *,
    n_zeros: int | None,
    delay: float | str | np.ndarray,
    dt: float,
    stable: bool,
    rank: int,
    omega_c: float | None,
) -> NominalFit:
    """Return the fit of a matrix measured at one level or several: one model for all."""
    frm, omega = frms[0], np.concatenate([one.omega for one in frms])
    n_poles = require_integer("n_poles", n_poles, least=0)
    rank = require_integer("rank", rank, least=1)
    estimated, tau = True, np.zeros(frm.n_inputs)
    if not isinstance(delay, str):
        estimated, tau = False, _checked_delays(delay, frm.n_inputs, dt)
    elif delay != "estimate":
        raise ValueError(
            'delay must be a number [s], one for each input, or "estimate", got'
            f" {short_form(delay)}"
        )
    require_fittable(n_poles, omega, dt)
    if n_zeros not in (None, n_poles):
        raise ValueError(
            f"n_zeros must be None or n_poles = {n_poles} for several channels, got {n_zeros}"
        )
    measured = np.concatenate([one.G for one in frms], axis=2)
    dof = np.minimum(np.concatenate([one.dof for one in frms]), 1e12)
    var = np.concatenate([one.entries(one.cov.bound) for one in frms], axis=2)
    crossover = checked_crossover(omega_c, omega, measured, var=var, dof=dof, dt=dt)
    sought = _MatrixFitProblem(
        # j omega, or its bilinear image: continuous and discrete models are fitted in the s plane
        points=2 / dt * np.tan(omega * dt / 2) if dt else omega,
        omega=omega,
        G=np.moveaxis(measured, 2, 0),
        metric=error_metric(frms, crossover),
        options={
            "n_poles": n_poles,
            "rank": rank,
            "direct": n_zeros is not None or dt > 0,
            "stable": stable,
        },
    )
    if estimated:
        model, tau = _estimate_input_delays(sought, dt)
    else:
        model, tau = sought.fit_behind_delays(tau)[0], tau
    n_parameters = model.n_parameters + (frm.n_inputs if estimated and not dt else 0)
    if 2 * measured.size < n_parameters:
        raise ValueError(
            f"n_poles must leave at most {2 * measured.size} parameters, got {n_parameters}"
        )
    n_entries = frm.n_outputs * frm.n_inputs
    expected = n_entries * np.sum(expected_ratio(dof, frm.n_outputs))
    share = 1 - n_parameters / (2 * measured.size)

    def judge(model: SharedPoles, tau: np.ndarray) -> tuple[float, float]:
        """Return the cost over the one expected of the truth, and the probability of a larger
        one by the distribution for one entry, which is the widest.
        """
        whitened = sought.metric.whiten(sought.error(model, tau))
        ratio = float(whitened @ whitened) / expected
        return ratio, probability_of_cost(
            ratio * np.sum(expected_ratio(dof)), dof, n_parameters / n_entries
        )

    ratio, p_value = judge(model, tau)
    unlikelihood = ratio * measured.size
    if p_value < UNLIKELY_COST:
        wider, likeliest, delays, negative_log = _fit_with_class_error(
            sought, model, tau, free=estimated and not dt
        )
        # the descent may have ended in a minimum that is not the lowest: a second one starts here
        again = sought.fit_behind_delays(delays, likeliest)[0]
        ratio, probability = judge(again, delays)
        p_value = max(p_value, probability)
        if p_value < UNLIKELY_COST:
            sought, model, tau, unlikelihood = wider, likeliest, delays, negative_log
        else:
            model, tau, unlikelihood = again, delays, ratio * measured.size
    residual = np.moveaxis(sought.error(model, tau), 0, 2)
    whitened = replace(sought.metric, epsilon=0.0).whiten(sought.error(model, tau))
    G = with_names(model.state_space(), frm.inputs, frm.outputs)
    return NominalFit(
        G=discretize(G, dt) if dt else G,
        delay=float(tau.min()),
        delays=tau,
        omega=omega,
        response=measured - residual,
        residual=residual,
        std=np.sqrt(var),
        cost=float(whitened @ whitened),
        expected_cost=float(expected * share),
        n_parameters=n_parameters,
        class_std=np.moveaxis(sought.metric.epsilon * sought.metric.entry_tolerance, 0, 2),
        unlikelihood=unlikelihood,
        omega_c=crossover,
        p_value=p_value,
        hold=frm.hold if len({one.hold for one in frms}) == 1 else "unknown",
        inputs=frm.inputs,
        outputs=frm.outputs,
    )


def _fit_with_class_error(
    sought: _MatrixFitProblem, model: SharedPoles, tau: np.ndarray, *, free: bool
) -> tuple[_MatrixFitProblem, SharedPoles, np.ndarray, float]:
    """Return the likeliest fit of a class with an error: from the fit to scatter alone, and from
    scratch.

    free : True if the delays are estimated; they are then estimated again with the error of the
    class.
    """
    begun = [(model, tau)]
    for epsilon in START_SIZES:
        weighted = replace(sought, metric=replace(sought.metric, epsilon=epsilon))
        delays = begun[-1][1]
        once = free and len(begun) == 1
        begun.append(
            _estimate_input_delays(weighted, 0.0)
            if once
            else (weighted.fit_behind_delays(delays)[0], delays)
        )
    settled = [(*sought.settle(*start), start[1]) for start in begun]
    weighted, model, unlikelihood, tau = min(settled, key=lambda found: found[2])
    return weighted, model, tau, unlikelihood


def _checked_delays(delay: float | np.ndarray, n_inputs: int, dt: float) -> np.ndarray:
    """Return (n_u,) delays [s] from one number for all inputs or one for each; whole samples in
    discrete time.
    """
    if np.ndim(delay) == 0:
        tau = np.full(n_inputs, require_nonnegative("delay", delay))
    else:
        tau = require_real_array("delay", delay, ndim=1)
        if tau.size != n_inputs or np.any(tau < 0):
            raise ValueError(
                f"delay must be one number or {n_inputs}, one for each input, none negative, got"
                f" {tau}"
            )
    if dt:
        return np.array([delay_samples("delay", float(one), dt) * dt for one in tau])
    return tau


def _estimate_input_delays(sought: _MatrixFitProblem, dt: float) -> tuple[SharedPoles, np.ndarray]:
    """Return the model and the delays (n_u,) [s] of its inputs, none negative, that explain the
    phases best.

    The column of each input is scanned first. Then all delays are refined with the model: a
    Gauss-Newton step of both moves the delays, and the model is fitted again. In discrete time the
    samples on both sides are tried in turn.
    """
    omega, n_u = sought.omega, sought.G.shape[2]
    tau = np.array([_scan_input_delay(sought, i) for i in range(n_u)])
    model, cost = sought.fit_behind_delays(tau)
    for _ in range(_N_ROUNDS):
        step = _delay_step(sought, model, tau)
        for _ in range(6):
            moved = np.maximum(tau + step, 0.0)
            there, lower = sought.fit_behind_delays(moved, model)
            if lower < cost:
                break
            step = step / 4
        if not lower < cost:
            break
        done = np.abs(moved - tau).max() * omega.max() < 2 * np.pi * _DELAY_TOLERANCE
        model, cost, tau = there, lower, moved
        if done:
            break
    if not dt:
        return model, tau
    samples = np.round(tau / dt)
    model, cost = sought.fit_behind_delays(samples * dt, model)
    for i in range(n_u):
        for move in (-1, 1):
            other = samples.copy()
            other[i] = max(other[i] + move, 0)
            there, lower = sought.fit_behind_delays(other * dt, model)
            if lower < cost:
                model, cost, samples = there, lower, other
    return model, samples * dt


def _scan_input_delay(sought: _MatrixFitProblem, i: int) -> float:
    """Scan the delay [s] of one input by rough fits of its column, up to twice its mean group
    delay.

    Steps are at least an eighth of a turn at the highest frequency, and there are at most
    MAX_DELAY_TRIALS of them.
    """
    G, omega = sought.G[:, :, i : i + 1], sought.omega
    rises = np.flatnonzero(np.diff(omega) > 0)  # several levels are concatenated
    falls = -np.angle(np.sum(G[rises + 1] * G[rises].conj(), axis=(1, 2))) / np.diff(omega)[rises]
    size = np.sum(np.abs(G[rises + 1] * G[rises]), axis=(1, 2))
    longest = max(2 * float(np.sum(falls * size) / np.sum(size)), 2 * np.pi / omega.max())
    left = np.eye(G.shape[1]) / sought.metric.entry_std()[:, :, i, None]
    column = ErrorMetric(left, np.ones((omega.size, 1, 1)), np.zeros(G.shape), np.zeros(G.shape))
    one = replace(sought, G=G, metric=column)
    n = min(int(np.ceil(longest * omega.max() / (2 * np.pi) * 8)) + 1, _MAX_DELAY_TRIALS)

    def cost(tau: float) -> float:
        points, G, metric = one.without_delays(np.array([tau]))
        residual = metric.whiten(
            G - fit_by_vector_fitting(points, G, metric=metric, **sought.options).response(points)
        )
        return float(residual @ residual)

    return float(min(np.linspace(0.0, longest, n), key=cost))


def _delay_step(sought: _MatrixFitProblem, model: SharedPoles, tau: np.ndarray) -> np.ndarray:
    """Return (n_u,) the change of the delays in a joint Gauss-Newton step."""
    points, G, metric = sought.without_delays(tau)
    # derivative of each column by its own delay, up to the sign
    turned = 1j * sought.omega[:, None, None] * G
    by_delay = np.array([np.where(np.arange(tau.size) == i, turned, 0.0) for i in range(tau.size)])
    by_model = response_derivatives(
        points, model, direct=sought.options["direct"], stable=sought.options["stable"]
    )

    J = metric.whiten(np.concatenate([-by_delay, by_model])).T
    scale = np.maximum(np.linalg.norm(J, axis=0), np.finfo(float).tiny)
    step = (
        np.linalg.lstsq(J / scale, metric.whiten(G - model.response(points)), rcond=1e-12)[0]
        / scale
    )
    return np.asarray(step[: tau.size])
