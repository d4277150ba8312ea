"""The nominal model: a rational function through a measured FRF, every line weighted by its own
variance.
"""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla, bla_from_frf
from nlfrf._base.arguments import (
    as_list,
    data_warning,
    format_hertz,
    keep_warnings,
    require_integer,
    require_nonnegative,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.units import units_differ
from nlfrf._base.values import value
from robust._base.channels import is_matrix, is_single, require_matrix
from robust._base.types import AnySystem
from robust._base.warnings import DesignWarning
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import SAMPLING_TOLERANCE, response, timebase, with_names
from robust.lti.realisation import from_roots, state_space
from robust.lti.sampling import delay_samples, delayed, discretize, hold_correction
from robust.models.fit.class_error import loop_tolerance, most_likely_size
from robust.models.fit.fit_uncertainty import (
    FitUncertainty,
    estimate_uncertainty,
    expected_ratio,
    format_roots,
    probability_of_cost,
)
from robust.models.fit.rational import (
    Roots,
    map_to_model_plane,
    s_plane_points,
)
from robust.models.fit.search import (
    MAX_ROUNDS,
    SETTLED,
    START_SIZES,
    UNLIKELY_COST,
    FitSearch,
    FrfData,
)
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
from robust.models.fit.weights import MAX_CHOSEN_ORDER

#: A BLA, several BLAs, or an FRF of another origin.
Measurement: TypeAlias = "Bla | Sequence[Bla] | control.FrequencyResponseData"


# ---- The nominal model of a measured matrix: the problem, its checks, the fit.

_MAX_POLES = 40
_PADE_ORDER, _PADE_ORDER_PER_INPUT = 4, 2  # order for one delay, and for each of several inputs
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


def matrices_given(bla: object) -> list[Bla]:
    """Return the given matrices, for one level or several, with the same channels; an empty list
    for other input.
    """
    many = as_list(bla)
    require_same_units(many)
    matrices = [one for one in many if is_matrix(one)]
    if not matrices:
        return []
    for one in many:
        require_matrix("bla", one)
        for name in ("inputs", "outputs"):
            if getattr(one, name) != getattr(matrices[0], name):
                raise ValueError(
                    f"bla must be matrices of the same {name}, got"
                    f" {', '.join(getattr(matrices[0], name))} and {', '.join(getattr(one, name))}"
                )
    return matrices


def require_same_units(given: object) -> None:
    """Refuse a list of BLAs whose units differ; unknown units match any."""
    if isinstance(given, list | tuple):
        blas = [one for one in given if isinstance(one, Bla)]
    else:
        blas = []
    for one, other in itertools.combinations(blas, 2):
        for name in ("input_units", "output_units"):
            for pair in zip(getattr(one, name), getattr(other, name), strict=False):
                if units_differ(*pair):
                    if one.is_single and other.is_single:
                        first, second = one.unit, other.unit
                    else:
                        first, second = pair
                    raise ValueError(
                        f"bla must be records in the same units, got {first} and {second}"
                    )


def require_same_channels(frm: Bla, known: object, of: str) -> None:
    """Refuse a record with other channel names, or in another order; unnamed channels match any."""
    for name, letter in (("inputs", "u"), ("outputs", "y")):
        first, second = tuple(getattr(known, name)), tuple(getattr(frm, name))
        unnamed = (), tuple(f"{letter}{i + 1}" for i in range(len(second)))
        if first != second and first not in unnamed and second not in unnamed:
            raise ValueError(
                f"bla must be a matrix of the same {name} as {of}, {', '.join(first)}, got"
                f" {', '.join(second)}"
            )


def _fit_matrix(
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
    estimated = isinstance(delay, str)
    if isinstance(delay, str):
        tau = np.zeros(frm.n_inputs)
    else:
        tau = _checked_delays(delay, frm.n_inputs, dt)
    if estimated and delay != "estimate":
        raise ValueError(
            'delay must be a number [s], one for each input, or "estimate", got'
            f" {short_form(delay)}"
        )
    _require_fittable(n_poles, omega, dt)
    if n_zeros not in (None, n_poles):
        raise ValueError(
            f"n_zeros must be None or n_poles = {n_poles} for several channels, got {n_zeros}"
        )
    measured = np.concatenate([one.G for one in frms], axis=2)
    dof = np.minimum(np.concatenate([one.dof for one in frms]), 1e12)
    var = np.concatenate([one.entries(one.cov.bound) for one in frms], axis=2)
    crossover = _checked_crossover(omega_c, omega, measured, var=var, dof=dof, dt=dt)
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
    whitened = sought.metric.whiten(sought.error(model, tau))
    expected = frm.n_outputs * frm.n_inputs * np.sum(expected_ratio(dof, frm.n_outputs))
    share, cost = 1 - n_parameters / (2 * measured.size), float(whitened @ whitened)
    # by the distribution for one entry, which is the widest
    p_value = probability_of_cost(
        cost / expected * np.sum(expected_ratio(dof)),
        dof,
        n_parameters / (frm.n_outputs * frm.n_inputs),
    )
    unlikelihood = cost * measured.size / expected
    if p_value < UNLIKELY_COST:
        sought, model, tau, unlikelihood = _fit_with_class_error(
            sought, model, tau, free=estimated and not dt
        )
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


# ---- ``DesignWarning`` for a fit or a weight that is usable but suspicious.

#: Cost over that of scatter alone, above which a fit to one record is suspicious. A fit with a
#: class error has a larger cost: 16 for two poles of the rig, where the least cost is below 10.
_COST_LIMIT = 20.0
OUTSIDE_FACTOR = 1.5  # smallest factor outside the band at which a pole is reported
# least scatter over |G| in the check; otherwise an exact record would make any model suspicious
_HARMLESS_SHARE = 1e-3
_INTEGRATOR_RATIO = 1e-6  # a pole below this fraction of the first line is an integrator
_EXCESSIVE_RATIO = (
    10.0  # mean of |weight| over the radius [dB], above which the weight is suspicious
)


def _warn_of_fit(fit: NominalFit, lines: FrfData, *, one_record: bool) -> None:
    """Warn of a fit far from the data of one record, or with poles outside the measured band."""
    omega, var = lines.omega, np.maximum(lines.var, (_HARMLESS_SHARE * np.abs(lines.G)) ** 2)
    ratio = float(np.sum(np.abs(fit.residual) ** 2 / var)) / fit.expected_cost
    if one_record and ratio > _COST_LIMIT:
        data_warning(
            f"a nominal model of {fit.G.nstates} poles does not fit the measurement: its cost"
            f" is {ratio:.3g} times the cost that the variance of the FRF explains, and the"
            f" misfit is added to the radius; {fit.describe_class_error()}",
            DesignWarning,
        )
    far = _poles_outside(fit.G, omega)
    if far.size:
        where = ", ".join(f"{w / 2 / np.pi:.4g}" for w in far)
        data_warning(
            f"the nominal model has a pole where nothing was measured, at {where} Hz; the band"
            f" is {omega.min() / 2 / np.pi:.4g} to {omega.max() / 2 / np.pi:.4g} Hz. Measure at"
            " this frequency if the bound stays below |G| there, which friction may prevent; or"
            " use fewer poles if the FRF allows it",
            DesignWarning,
        )


def _poles_outside(G: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return the sizes [rad/s] of poles outside the band of the lines, one for each pair; without
    integrators.
    """
    p = G.poles()
    with np.errstate(divide="ignore"):
        if G.dt:
            p = np.log(p.astype(complex)) / G.dt
    size = np.sort(np.abs(p[p.imag >= 0]))
    low, high = omega.min(), omega.max()
    return size[
        ((size < low / OUTSIDE_FACTOR) & (size > _INTEGRATOR_RATIO * low))
        | (size > high * OUTSIDE_FACTOR)
    ]


def checked_weight(
    weight: control.StateSpace, omega: np.ndarray, radius: np.ndarray, *, order: int | None
) -> control.StateSpace:
    """Return the weight; warn if its mean over the lines [rad/s] lies far above its radius.

    order : requested order; None if it was chosen here.
    """
    excess = float(np.mean(20 * np.log10(np.abs(response(weight, omega)) / radius)))
    if excess > _EXCESSIVE_RATIO:
        data_warning(
            f"the weight of order {weight.nstates} is {excess:.1f} dB above the radius on"
            " average over the measured lines: the set is much larger than the measurement"
            " requires. "
            + (
                "Leave out the order, so that it is chosen"
                if order is not None and order < MAX_CHOSEN_ORDER
                else (
                    "The radius scatters from line to line, and no weight can follow it:"
                    " average more realisations"
                )
            ),
            DesignWarning,
        )
    return weight


@value
class NominalFit:
    """A parametric model of a measured FRF, with the quality of its fit.

    Fields
    ------
    G : control.StateSpace
        The model without its delay, continuous (dt = 0) or discrete.
    delay, delays : float, (n_u,) ndarray
        Delay [s] in series with G.
    omega : (F,) ndarray
        Frequencies of the fitted lines [rad/s]; the lines of several records are concatenated.
    response : (F,) complex ndarray, or (n_y, n_u, F)
        Response of the model at these lines, delay included.
    residual : (F,) complex ndarray, or (n_y, n_u, F)
        Measured FRF minus `response`.
    std : (F,) ndarray, or (n_y, n_u, F)
        Standard deviation of the measured FRF on each line; nan without variances.
    cost : float
        Sum of |residual|^2 / std^2.
    expected_cost : float
        Expected cost of a model without error, from the variance of the FRF alone; nan without
        variances. A cost well above the expected cost shows undermodelling, which `uncertainty`
        adds to the radius.
    n_parameters : int
        Number of free real parameters.
    class_std : (F,) ndarray, or (n_y, n_u, F)
        Estimated standard deviation of the model error on each line. The fit weights each line by
        1/(std^2 + class_std^2). Zero if the variance of the FRF explains the residual.
    unlikelihood : float
        Negative log likelihood of the fit including the model error, up to a constant that depends
        on the variance of the FRF only.
    omega_c : float
        Crossover [rad/s] of the loop for which the model was fitted; nan if none was given.
    uncertainty : FitUncertainty
        Standard deviations of poles, zeros, gain and delay; None if the model does not come from
        `fit_nominal`.
    p_value : float
        Probability of a cost at least as large for a model without error; nan without variances.
    hold : str
        Hold of the record. "zoh" or "band-limited": the fit takes the hold into account, so that a
        continuous model is the plant without a hold, and a discrete model is the plant with a
        zero-order hold of dt. "unknown": the fit takes no hold into account.
    unit, inputs, outputs : str, tuple of str, tuple of str
        Unit of the response, if the record has one, and for several channels the names of inputs
        and outputs.
    warnings : tuple of str
        Warnings about the records and the fit.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 9 and 11 (cost and its expectation).

    Examples
    --------
    >>> omega = np.linspace(1, 20, 30)
    >>> fit = fit_nominal(control.FrequencyResponseData(1 / (1j * omega + 3), omega), n_poles=1)
    >>> fit.G.poles().real.round(9).tolist(), bool(np.abs(fit.residual).max() < 1e-9)
    ([-3.0], True)
    """

    G: control.StateSpace
    delay: float
    omega: np.ndarray
    response: np.ndarray
    residual: np.ndarray
    std: np.ndarray
    cost: float
    expected_cost: float
    n_parameters: int
    class_std: np.ndarray
    unlikelihood: float
    omega_c: float = float("nan")
    uncertainty: FitUncertainty | None = None
    p_value: float = float("nan")
    hold: str = "unknown"
    unit: str = ""
    delays: np.ndarray | None = None
    inputs: tuple[str, ...] = ()
    outputs: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        ratio = self.cost / self.expected_cost
        if self.G.dt:
            kind = f"sampled at {1 / self.G.dt:g} Hz"
        else:
            kind = "continuous"
        delays = np.unique(self.delay if self.delays is None else self.delays)
        delays_in_ms = ", ".join(f"{1e3 * tau:.3g}" for tau in delays)
        return (
            f"nominal model: {self.G.nstates} poles, {kind}, delay {delays_in_ms} ms; "
            f"cost {self.cost:.4g}, {ratio:.3g} times that of scatter alone"
            + ("" if np.isnan(self.p_value) else f" (p = {self.p_value:.2g})")
            + (f"\n  {self.describe_class_error()}" if np.any(self.class_std) else "")
            + format_roots(self.uncertainty, bool(self.G.dt), self.unit)
        )

    @property
    def criterion(self) -> float:
        """Bayesian information criterion: negative log likelihood + n_parameters ln(2 n_lines)/2,
        with n_lines lines.
        """
        return float(self.unlikelihood + self.n_parameters / 2 * np.log(2 * self.response.size))

    def describe_class_error(self) -> str:
        """Describe the model error relative to |G|: its maximum, and its maximum below the
        crossover.
        """
        channels = tuple(range(self.response.ndim - 1))
        beyond = np.sum(
            np.maximum(np.abs(self.residual) ** 2 - np.nan_to_num(self.std) ** 2, 0.0),
            axis=channels,
        )
        size = np.sum(np.abs(self.response + self.residual) ** 2, axis=channels)
        share = np.sqrt(beyond / np.maximum(size, np.finfo(float).tiny))
        low, worst = ~(self.omega > self.omega_c), int(np.argmax(share))
        if np.isnan(self.omega_c):
            band = ""
        else:
            band = f" below {format_hertz(self.omega_c)}"
        return (
            f"error of the class: {np.sqrt(np.mean(share[low] ** 2)):.2g} of |G|{band} (rms over"
            f" lines), at most {share[worst]:.2g} of |G| at {format_hertz(self.omega[worst])}"
        )


def frd(bla: Bla) -> control.FrequencyResponseData:
    """Return the best linear approximation (BLA) as an FRF object of python-control.

    Use this to plot the BLA with python-control, or to multiply and compare it with models.

    Parameters
    ----------
    bla : nlfrf.Bla
        A measured BLA, or a matrix of them.

    Returns
    -------
    control.FrequencyResponseData
        Inputs and outputs as measured, at the excited lines [rad/s].

    Raises
    ------
    ValueError
        Any other type than Bla.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> measured = frd(nlfrf.identify(record))
    >>> bool(np.allclose(measured.omega, 2 * np.pi * ms.f))
    True
    """
    if not isinstance(bla, Bla):
        raise ValueError(f"bla must be an nlfrf.Bla, got {short_form(bla)}")
    if bla.is_single:
        names = {}
    else:
        names = {"inputs": list(bla.inputs), "outputs": list(bla.outputs)}
    return control.FrequencyResponseData(bla.G, bla.omega, name="bla", **names)


@keep_warnings
def fit_nominal(
    bla: Measurement,
    *,
    n_poles: int,
    n_zeros: int | None = None,
    delay: float | str | np.ndarray = 0.0,
    dt: float = 0,
    stable: bool = True,
    std: np.ndarray | None = None,
    rank: int = 1,
    omega_c: float | None = None,
) -> NominalFit:
    """Fit a transfer function, the nominal model, to a measured FRF.

    Use this first, with `scan_orders` to choose the number of poles; `uncertainty` then adds the
    radius around the model.

    The fit minimises sum |G_k - B/A exp(-j omega_k delay)|^2 / var_k, if the variance var_k of the
    FRF explains the residual. Otherwise no model of this order fits within the variance, and the
    size epsilon of the model error is estimated together with the model. The cost is then sum |G_k
    - B/A exp(-j omega_k delay)|^2 / (var_k + epsilon^2 m_k^2) + ln(var_k + epsilon^2 m_k^2), with m
    = |G|/|T_c|^2 and |G| smoothed over an octave.

    Several starting values are refined by the Levenberg-Marquardt method. They come from vector
    fitting with different initial poles and delays. If the variance does not explain the residual,
    one more start is the fit with two poles and two zeros fewer, to which a pair is added at the
    largest residual.

    Parameters
    ----------
    bla : nlfrf.Bla, list of them or control.FrequencyResponseData
        The measurement. A list contains one plant at several levels or on several days, and gets
        one model. For several channels the entries of the model share their poles, and the residues
        have rank one (`rank`): the model has n_poles states. The fit is then weighted by the
        covariance.
    n_poles : int
        Number of poles. `scan_orders` helps to choose.
    n_zeros : int, optional
        Number of zeros; by default as many as the data show, n_poles - 1 at most. For several
        channels leave it out, or give n_poles for a direct term.
    delay : float or "estimate"
        Delay [s] in series; in discrete time a whole number of samples. For several channels also
        (n_u,), one for each input.
    dt : float
        0 for a continuous model, otherwise the sampling time [s] of a discrete one.
    stable : bool
        Keep every pole strictly stable. Set to False for an unstable plant, measured in closed
        loop.
    std : (F,) ndarray, or (n_y, n_u, F), optional
        Standard deviation sqrt(E|.|^2) of each line of a FrequencyResponseData, as in
        `nlfrf.bla_from_frf`; a Bla contains its own. Without `std` the lines are weighted by 1/|G|,
        and the fit has no expected cost. Required for several channels.
    rank : int
        Rank of the residues for several channels; 2 for a symmetric machine, which has pairs of
        equal modes.
    omega_c : float, optional
        Intended crossover [rad/s] of the loop. With fewer poles than the machine has, the model is
        then most accurate around this crossover: m contains the complementary sensitivity T_c of a
        loop with this crossover. By default |T_c| is one.

    Returns
    -------
    NominalFit

    Raises
    ------
    ValueError
        Orders that do not fit each other or the number of lines; a line where G is zero, without
        `std`; a delay that is not a whole number of samples; lines beyond the Nyquist frequency of
        `dt`; a crossover outside the lines, or at a frequency where |G| is below its bound.

    References
    ----------
    Pintelon & Schoukens, 2nd ed., 9; Gustavsen & Semlyen 1999 (starting values); Goodwin, Gevers &
    Ninness 1992 (error of a model class); de Callafon & Van den Hof 1995 (models for a loop).

    Examples
    --------
    >>> omega = np.linspace(1, 100, 60)
    >>> measured = control.FrequencyResponseData(50**2 / ((1j * omega)**2 + 2j * omega + 50**2), omega)
    >>> fit = fit_nominal(measured, n_poles=2, n_zeros=0)
    >>> np.abs(fit.G.poles()).round(9).tolist()
    [50.0, 50.0]
    """
    dt = require_nonnegative("dt", dt)
    if isinstance(bla, control.FrequencyResponseData) and (bla.ninputs, bla.noutputs) != (1, 1):
        bla, std = _bla_with_deviation(bla, std), None
    if frms := matrices_given(bla):
        return _fit_matrix(
            [bla_behind_hold(b, dt) for b in frms],
            n_poles,
            n_zeros=n_zeros,
            delay=delay,
            dt=dt,
            stable=stable,
            rank=rank,
            omega_c=omega_c,
        )
    search = start_search(bla, std, dt=dt, stable=stable, delay=delay, omega_c=omega_c)
    return likeliest_fit(search, bla, n_poles, n_zeros)


@keep_warnings
def likeliest_fit(
    search: FitSearch,
    bla: Measurement,
    n_poles: int,
    n_zeros: int | None,
    *,
    fewer: Sequence[Roots] | None = None,
) -> NominalFit:
    """Return the fit with the given poles; with an open number of zeros, the one with the lowest
    criterion.

    Zeros above the band that the data do not show are dropped: `fewer` are the fits without them,
    if there are any. A direct term is fitted only on request: through it the whole set above the
    Nyquist frequency folds down.
    """
    orders = checked_orders(search, n_poles, n_zeros)
    weighted, roots = search.best_with_class_error(orders)
    tried = [(weighted, roots)]
    if weighted is search and fewer is not None:
        tried += [(search, one) for one in fewer]
    elif n_zeros is None or fewer is not None:
        if search.dt:
            highest = np.inf
        else:
            highest = OUTSIDE_FACTOR * search.lines.omega.max()
        tried += [(weighted, one) for one in weighted.without_zeros_above(roots, highest)]
    fit = min((_nominal_of_roots(*one, bla) for one in tried), key=lambda fit: fit.criterion)
    one_record = is_single(bla) or (isinstance(bla, Sequence) and len(bla) == 1)
    _warn_of_fit(fit, search.lines, one_record=one_record)
    return fit


def start_search(
    bla: Measurement,
    std: np.ndarray | None,
    *,
    dt: float,
    stable: bool,
    delay: float | str | np.ndarray,
    omega_c: float | None,
) -> FitSearch:
    """Return the search for fits with one input and one output, of any order."""
    lines = _measured_lines(bla, std, dt, omega_c)
    if isinstance(delay, str) and delay != "estimate":
        raise ValueError(f'delay must be a number [s] or "estimate", got {short_form(delay)}')
    if isinstance(delay, str):
        known = None
    else:
        known = require_nonnegative("delay", delay)
    if known is not None and dt:
        known = delay_samples("delay", known, dt) * dt
    return FitSearch(lines=lines, dt=dt, stable=stable, delay=known)


def _nominal_of_roots(search: FitSearch, roots: Roots, bla: Measurement) -> NominalFit:
    """Return the `NominalFit` for the roots that a search found."""
    lines, dt, n_parameters = search.lines, search.dt, search.n_parameters(roots)
    zeros, poles, gain, tau, cost = roots
    model = search.response(roots)
    residual = lines.G - model
    left = max(lines.omega.size - n_parameters / 2, 0.5)
    expected = float(np.sum(expected_ratio(lines.dof)) * (left / lines.omega.size))
    scatter = float(np.sum(np.abs(residual) ** 2 / lines.var))
    return NominalFit(
        G=from_roots(*map_to_model_plane(zeros, poles, gain, dt, poles.size - zeros.size), dt),
        delay=float(tau),
        omega=lines.omega,
        response=model,
        residual=residual,
        std=np.where(np.isnan(lines.dof), np.nan, np.sqrt(lines.var)),
        cost=scatter,
        expected_cost=expected,
        n_parameters=n_parameters,
        class_std=lines.epsilon * lines.tolerance,
        unlikelihood=search.unlikelihood(roots),
        omega_c=lines.omega_c,
        uncertainty=estimate_uncertainty(
            s_plane_points(lines.omega, dt),
            lines.omega,
            model=model,
            std=np.sqrt(lines.total_var),
            zeros=zeros,
            poles=poles,
            gain=gain,
            c=np.fmax(cost, expected) / left,
            dt=dt,
            free_delay=search.delay is None and not dt,
        ),
        p_value=probability_of_cost(scatter, lines.dof, n_parameters),
        hold=lines.hold,
        unit=getattr(as_list(bla)[0], "unit", ""),
    )


def _bla_with_deviation(frf: control.FrequencyResponseData, std: np.ndarray | None) -> Bla:
    """Return the `Bla` of an FRF with the standard deviation of its entries."""
    if std is None:
        raise ValueError(
            f"std must be given with an FRF of {frf.ninputs} inputs and {frf.noutputs} outputs. Or"
            " give nlfrf.bla_from_frf(...) of it, which also takes a coherence"
        )
    G = np.asarray(frf.frdata, dtype=complex)
    several = G.shape[:2] != (1, 1)
    return bla_from_frf(
        np.asarray(frf.omega, dtype=float) / (2 * np.pi),
        G if several else G[0, 0],
        std=std,
        inputs=tuple(frf.input_labels) if several else (),
        outputs=tuple(frf.output_labels) if several else (),
    )


def checked_orders(search: FitSearch, n_poles: int, n_zeros: int | None) -> tuple[int, int]:
    """Return numbers of poles and zeros that fit each other and the lines."""
    n_poles = require_integer("n_poles", n_poles, least=0)
    n_zeros = require_integer(
        "n_zeros", max(n_poles - 1, 0) if n_zeros is None else n_zeros, least=0
    )
    _require_fittable(n_poles, search.lines.omega, search.dt)
    if n_zeros > n_poles:
        raise ValueError(
            f"n_zeros must be at most n_poles = {n_poles}, got {n_zeros}: the model must be proper"
        )
    n_parameters, most = n_poles + n_zeros + 1 + (search.delay is None), 2 * search.lines.omega.size
    if n_parameters > most:
        raise ValueError(
            f"n_poles and n_zeros must leave at most {most} parameters, twice the number of lines,"
            f" got {n_parameters}"
        )
    return n_poles, n_zeros


def _require_fittable(n_poles: int, omega: np.ndarray, dt: float) -> None:
    """Refuse more poles than are fitted, or lines above the Nyquist frequency of the model."""
    if n_poles > _MAX_POLES:
        raise ValueError(f"n_poles must be at most {_MAX_POLES}, got {n_poles}")
    if dt and omega.max() * dt >= np.pi:
        raise ValueError(
            f"dt must put the Nyquist frequency above the last line, {omega.max() / 2 / np.pi:g}"
            f" Hz, got dt = {dt:g} s with Nyquist {0.5 / dt:g} Hz"
        )


def _given_lines(
    frf: control.FrequencyResponseData, std: np.ndarray | None, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return omega, G, variance and degrees of freedom of an FRF of another origin; without a std
    relative errors.
    """
    if (frf.ninputs, frf.noutputs) != (1, 1):
        raise ValueError(
            f"bla must have one input and one output, got {frf.ninputs} and {frf.noutputs}"
        )
    if frf.dt and abs(frf.dt - dt) > SAMPLING_TOLERANCE * frf.dt:
        raise ValueError(f"dt must be that of bla, a sampled FRF at {frf.dt:g} s, got {dt:g} s")
    omega, G = np.asarray(frf.omega, dtype=float), np.asarray(frf.frdata[0, 0], dtype=complex)
    if std is None:
        if np.any(G) and not np.all(G):
            at = omega[np.argmin(np.abs(G))]
            raise ValueError(
                "std must be given for an FRF that is zero on a line, because the default"
                f" weight 1/|G| is infinite: at {at:g} rad/s"
            )
        return omega, G, np.abs(G) ** 2 + np.finfo(float).tiny, np.full(G.size, np.nan)
    var = require_real_array("std", std, ndim=1) ** 2
    if var.shape != G.shape or np.any(var <= 0):
        raise ValueError(
            f"std must hold one positive number per line ({G.size}), got {short_form(std)}"
        )
    return omega, G, var, np.full(G.size, np.inf)


def _measured_lines(
    bla: Measurement, std: np.ndarray | None, dt: float, omega_c: float | None
) -> FrfData:
    """Return lines, variances and degrees of freedom of an FRF, with the hold of a model of dt.

    The tolerance of each line is that of a loop with the crossover omega_c [rad/s].
    """
    hold = "unknown"
    if isinstance(bla, control.FrequencyResponseData):
        omega, G, var, dof = _given_lines(bla, std, dt)
    else:
        many = as_list(bla)
        if not many or not all(map(is_single, many)):
            raise ValueError(
                "bla must be an nlfrf.Bla, a list of them or a control.FrequencyResponseData, got"
                f" {short_form(bla)}"
            )
        if std is not None:
            raise ValueError(
                "std must only be given with a FrequencyResponseData, got it with a Bla"
            )
        omega = np.concatenate([b.omega for b in many])
        many = [bla_behind_hold(b, dt) for b in many]
        G = np.concatenate([b.G for b in many])
        var = np.concatenate([b.var_bound for b in many])
        dof = np.concatenate([b.dof for b in many])
        hold = many[0].hold if len({b.hold for b in many}) == 1 else "unknown"
    if not (np.isfinite(G).all() and np.any(G)):
        raise ValueError("bla must hold a finite FRF that is not zero everywhere")
    if np.any(omega <= 0):
        raise ValueError(f"bla must hold positive frequencies only, got {omega.min():g} rad/s")
    # below a millionth of |G| a variance is rounding, and its line would dominate the fit
    floor = (1e-6 * np.abs(G)) ** 2 + (1e-9 * np.abs(G).max()) ** 2
    dof, crossover = (
        np.where(np.isinf(dof), 1e12, dof),
        _checked_crossover(omega_c, omega, G, var=var, dof=dof, dt=dt),
    )
    tolerance = loop_tolerance(omega, G, crossover)
    if (
        np.isnan(dof).any() and omega_c is not None
    ):  # without a scatter the loop alone weighs the lines
        var = tolerance**2
    return FrfData(
        omega=omega,
        G=G,
        var=np.maximum(var, floor),
        dof=dof,
        tolerance=tolerance,
        omega_c=crossover,
        hold=hold,
    )


def _checked_crossover(
    omega_c: float | None,
    omega: np.ndarray,
    G: np.ndarray,
    *,
    var: np.ndarray,
    dof: np.ndarray,
    dt: float,
) -> float:
    """Return the crossover [rad/s] of a loop, nan for none; refuse one that no model of G (..., F)
    can serve.

    var, dof : (..., F), (F,) variance of G, and its degrees of freedom.
    """
    if omega_c is None:
        return float("nan")
    omega_c = require_positive("omega_c", omega_c)
    low, high, asked = omega.min(), omega.max(), f"{format_hertz(omega_c)} ({omega_c:.4g} rad/s)"
    if dt and omega_c * dt >= np.pi:
        raise ValueError(
            f"omega_c must lie below the Nyquist frequency {format_hertz(np.pi / dt)}, got {asked}"
        )
    if not low <= omega_c <= high:
        raise ValueError(
            f"omega_c must lie in the measured band, {format_hertz(low)} to {format_hertz(high)},"
            f" got {asked}"
        )
    k = int(np.argmin(np.abs(omega - omega_c)))
    size = np.abs(G[..., k])
    bound = np.sqrt(
        dof[k] * np.expm1(-np.log(0.05) / dof[k]) * var[..., k]
    )  # 95 % quantile of F(2, 2 dof)
    if np.all(size <= bound):
        raise ValueError(
            f"omega_c must lie where |G| is above its bound, got {asked}, where |G| ="
            f" {size.max():.3g} and its bound {bound.max():.3g}"
        )
    return omega_c


def with_delays(nominal: NominalFit | AnySystem | float) -> tuple[AnySystem | float, float]:
    """Return a nominal with the delays of its inputs included, and the longest of them [s]; a
    system unchanged.
    """
    if not isinstance(nominal, NominalFit):
        return nominal, 0.0
    G, delays = nominal.G, nominal.delays
    if G.ninputs == G.noutputs == 1:
        return delayed(G, nominal.delay, order=_PADE_ORDER), nominal.delay
    if delays is None or not np.any(delays):
        return G, 0.0
    through = control.StateSpace([], [], [], [[1.0]], G.dt)
    each = [delayed(through, float(tau), order=_PADE_ORDER_PER_INPUT) for tau in delays]
    return in_series(block_diagonal(each, G.dt), G), float(np.max(delays))


def single_nominal(
    nominal: NominalFit | AnySystem | float,
) -> tuple[control.StateSpace | control.FrequencyResponseData, float]:
    """Return a nominal with one channel, with its delay inside, and that delay [s]."""
    plant, delay = with_delays(nominal)
    return (
        plant if isinstance(plant, control.FrequencyResponseData) else state_space("nominal", plant)
    ), delay


def sampling_time_of(nominal: control.StateSpace | control.FrequencyResponseData) -> float:
    """Return the sampling time [s] of a nominal, 0 for an FRF."""
    if isinstance(nominal, control.FrequencyResponseData):
        return 0.0
    return timebase(nominal)


def bla_behind_hold(bla: Bla, dt: float) -> Bla:
    """Return a BLA as a model of sampling time dt describes it: without a hold (dt = 0), or behind
    a hold of dt.

    The correction is for the `hold` of the record; an unknown hold is left uncorrected.
    """
    factor = hold_correction(bla.omega, bla.hold, fs=bla.fs, dt=dt)
    if np.all(factor == 1):
        return bla
    return bla.times(factor, output_unit=bla.output_units)
