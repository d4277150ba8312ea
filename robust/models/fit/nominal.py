"""The nominal model: a rational function through a measured FRF, every line weighted by its own
variance.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    as_list,
    keep_warnings,
    require_integer,
    require_nonnegative,
    short_form,
)
from robust.lti.realisation import from_roots
from robust.lti.sampling import delay_samples
from robust.models.fit.doubts import OUTSIDE_FACTOR, warn_of_fit
from robust.models.fit.fit_uncertainty import (
    estimate_uncertainty,
    expected_ratio,
    probability_of_cost,
)
from robust.models.fit.matrix_fit import fit_matrix
from robust.models.fit.measurement import (
    Measurement,
    bla_behind_hold,
    bla_with_deviation,
    matrices_given,
    measured_lines,
    require_fittable,
)
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.rational import Roots, map_to_model_plane, s_plane_points
from robust.models.fit.search import FitSearch

# relative difference of an FRF from response plus residual of its own fit
_SAME_FRF = 1e-9


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
    dt, std_given = require_nonnegative("dt", dt), std is not None
    if isinstance(bla, control.FrequencyResponseData) and (bla.ninputs, bla.noutputs) != (1, 1):
        bla, std = bla_with_deviation(bla, std), None
    if frms := matrices_given(bla):
        fit = fit_matrix(
            [bla_behind_hold(b, dt) for b in frms],
            n_poles,
            n_zeros=n_zeros,
            delay=delay,
            dt=dt,
            stable=stable,
            rank=rank,
            omega_c=omega_c,
        )
    else:
        search = start_search(bla, std, dt=dt, stable=stable, delay=delay, omega_c=omega_c)
        fit = likeliest_fit(search, bla, n_poles, n_zeros)
    return replace(fit, std_given=std_given)


def bla_of_fitted(frf: control.FrequencyResponseData, fit: NominalFit) -> Bla | None:
    """Return the `Bla` of an FRF with the standard deviation that its fit was given.

    None if the fit has no given one, or is of another FRF.
    """
    fitted = fit.response + fit.residual
    G = np.asarray(frf.frdata, dtype=complex)
    if fitted.ndim == 1:
        G = G[0, 0]
    same = (
        fit.std_given
        and np.array_equal(frf.omega, fit.omega)
        and G.shape == fitted.shape
        and np.allclose(G, fitted, rtol=_SAME_FRF, atol=_SAME_FRF * np.abs(G).max())
    )
    if same:
        return bla_with_deviation(frf, fit.std)
    return None


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
    warn_of_fit(fit, search.lines)
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
    lines = measured_lines(bla, std, dt, omega_c)
    known = None
    if not isinstance(delay, str):
        known = require_nonnegative("delay", delay)
        known = delay_samples("delay", known, dt) * dt if dt else known
    elif delay != "estimate":
        raise ValueError(f'delay must be a number [s] or "estimate", got {short_form(delay)}')
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


def checked_orders(search: FitSearch, n_poles: int, n_zeros: int | None) -> tuple[int, int]:
    """Return numbers of poles and zeros that fit each other and the lines."""
    n_poles = require_integer("n_poles", n_poles, least=0)
    n_zeros = require_integer(
        "n_zeros", max(n_poles - 1, 0) if n_zeros is None else n_zeros, least=0
    )
    require_fittable(n_poles, search.lines.omega, search.dt)
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
