"""The radius of a set about a nominal (a model or an FRF) on each line, and its parts.

The parts are noise, odd and even distortion, misfit, level and systematic part; P&S 4.3 for the
variances, F quantiles for the discs. Full blocks of a matrix use the covariance of all entries;
discs of single entries would ignore their correlation.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from operator import itemgetter
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import require_choice, require_nonnegative
from nlfrf._base.values import value
from robust._base.types import Weight
from robust.lti.lti import response
from robust.lti.realisation import state_space
from robust.models.fit.weights import WeightOrderError, fit_weight
from robust.models.sets.centre import centre_of
from robust.models.sets.forms import INPUT, Form
from robust.models.sets.records import PARTS

#: Lines over which misfits and covariances are averaged, relative to |G|: a low-order weight does
#: not follow scatter.
_WINDOW = 9
_DECADES_ABOVE = 2.0
# largest over smallest radius up to which a weight for several channels is constant
_FLAT_RATIO = 1.06
#: Least over largest radius of given plants: a plant equal to the nominal on a line would leave a
#: zero.
MIN_RADIUS_RATIO = 1e-6


@value
class RadiusSpec:
    """Contents of a radius, as in `uncertainty`: confidence p, all lines together or not, even and
    systematic.
    """

    p: float = 0.95
    simultaneous: bool = False
    even: bool = True
    systematic: float | None = None


@value
class Extrapolation:
    """The user's rule outside the measured band: dB per decade away from it, 0 for flat."""

    # below, above: slope on either side, over two decades; flat beyond
    below: float = 0.0
    above: float = 0.0

    def __str__(self) -> str:
        return (
            f"below the band {_describe_slope(self.below)}, above it {_describe_slope(self.above)}"
        )

    def extrapolate(
        self, omega: np.ndarray, radius: np.ndarray, dt: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Return frequencies and radius continued outside the band, for the weight to cover."""
        step = np.linspace(0, _DECADES_ABOVE, 41)[1:]
        low, high = omega[0] * 10 ** -step[::-1], omega[-1] * 10**step
        if dt:
            nyquist = np.pi / dt * (1 - 1e-9)
            if omega[-1] < nyquist:
                high = np.concatenate([high[high < nyquist], [nyquist]])
            else:
                high = high[:0]
        under, over = (omega[0] / low) ** (self.below / 20), (high / omega[-1]) ** (self.above / 20)
        return np.concatenate([low, omega, high]), np.concatenate(
            [radius[0] * under, radius, radius[-1] * over]
        )


def checked_slope(name: str, rule: str | float) -> float:
    """Return the slope in dB per decade away from the band, checked."""
    if isinstance(rule, str) and require_choice(name, rule, ("flat",)):
        return 0.0
    return require_nonnegative(name, rule)


def _describe_slope(rule: float) -> str:
    if rule == 0:
        return "flat"
    return f"rising {rule:g} dB/decade over {_DECADES_ABOVE:g} decades"


def fit_covering_weight(
    omega: np.ndarray,
    radius: np.ndarray,
    *,
    order: int | None,
    rules: Extrapolation,
    dt: float,
    importance: np.ndarray | None = None,
) -> control.StateSpace:
    """Return a weight over a radius: a number if the radius is flat and does not rise outside the
    band.

    importance : (F,) weight of an excess on the lines, uniform by default; below the band that of
    the first line, above it none.
    """
    if radius.max() < _FLAT_RATIO * radius.min() and rules.below == rules.above == 0:
        return control.StateSpace([], [], [], [[radius.max()]], dt)
    covered = rules.extrapolate(omega, radius, dt)
    share = np.interp(covered[0], omega, np.ones(omega.size) if importance is None else importance)
    return fit_extrapolated(
        covered, rules, order=order, dt=dt, importance=share * (covered[0] <= omega[-1])
    )


def fit_extrapolated(
    covered: Sequence[np.ndarray],
    rules: Extrapolation,
    *,
    order: int | None,
    dt: float,
    importance: np.ndarray,
) -> control.StateSpace:
    """Fit a weight over (omega, radius) continued outside the lines; a refusal also names the rule.

    importance : (W,) weight of an excess.
    """
    omega, radius = covered
    try:
        return fit_weight(omega, radius, order=order, dt=dt, importance=importance).W
    except WeightOrderError as error:
        if rules.below == rules.above == 0:
            raise
        raise WeightOrderError(
            f"{error} Outside the measured lines the radius was extrapolated ({rules}), which a"
            ' weight of low order cannot follow: above="flat" and below="flat" keep it constant'
            " there"
        ) from None


def nominal_response(
    nominal: control.StateSpace | control.FrequencyResponseData, omega: np.ndarray
) -> np.ndarray:
    """Return (W,) or (n_y, n_u, W) response of the nominal; an FRF is interpolated in log magnitude
    and phase.

    On its lines the interpolation is exact.
    """
    G = centre_of(nominal).between_lines(omega)
    if G.shape[:2] == (1, 1):
        return G[0, 0]
    return G


def disc_parts(
    many: Sequence[Bla],
    nominals: Sequence[control.StateSpace | control.FrequencyResponseData],
    spec: RadiusSpec,
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Return all frequencies of the records for one channel, the parts of the largest absolute
    radius, and that radius.

    Between the lines of a record a part is the larger one of its neighbours, so the parts add up to
    more there.

    nominals : the nominal for each record; the same model, or its response on the lines of that
    record.
    """
    omega = np.unique(np.concatenate([b.omega for b in many]))
    discs = [
        record_radius_parts(b, nominal, spec) for b, nominal in zip(many, nominals, strict=True)
    ]

    def spread(values: Callable[[dict[str, np.ndarray]], np.ndarray]) -> np.ndarray:
        return np.array(
            [
                larger_neighbour(omega, b.omega, values(disc))
                for b, disc in zip(many, discs, strict=True)
            ]
        )

    total = spread(sum_of_parts)
    worst = np.nanargmax(np.where(np.isnan(total), -np.inf, total), axis=0)[None, :]
    parts = {name: np.take_along_axis(spread(itemgetter(name)), worst, axis=0)[0] for name in PARTS}
    if len(many) > 1:
        # the misfit of the family as a whole is "misfit"; the additional misfit at one level is
        # "level"
        together = np.nanmin(spread(lambda disc: disc["misfit"]), axis=0)
        parts["level"] = np.maximum(parts["misfit"] - together, 0.0)
        parts["misfit"] = parts["misfit"] - parts["level"]
    return omega, parts, np.nanmax(total, axis=0)


def element_parts(
    frms: Sequence[Bla], models: Sequence[np.ndarray], spec: RadiusSpec
) -> tuple[np.ndarray, dict[str, np.ndarray], np.ndarray]:
    """Return `disc_parts` for every entry of a matrix, column by column, (n, W) each: all hold
    together with p.

    The parts are scaled to add up to the radius between the lines of a record too.

    models : (n_y, n_u, F) response of the nominal on the lines of each record.
    """
    n_y, n_u = models[0].shape[:2]
    each = replace(spec, p=spec.p ** (1 / (n_y * n_u)))
    found = []
    for i, j in np.ndindex(n_u, n_y):
        nominals = [control.frd(G[j, i], frm.omega) for G, frm in zip(models, frms, strict=True)]
        found.append(disc_parts([frm.entry(j, i) for frm in frms], nominals, each))
    radius = np.array([total for _, _, total in found])
    parts = {name: np.array([parts[name] for _, parts, _ in found]) for name in PARTS}
    share = radius / sum_of_parts(parts)
    return found[0][0], {name: part * share for name, part in parts.items()}, radius


def sum_of_parts(parts: dict[str, np.ndarray]) -> np.ndarray:
    return np.sum(list(parts.values()), axis=0)


def record_radius_parts(
    bla: Bla, nominal: control.StateSpace | control.FrequencyResponseData, spec: RadiusSpec
) -> dict[str, np.ndarray]:
    """Return the parts (F,) of the absolute radius for one record with one channel."""
    F = bla.f.size
    quantile = bla.f_quantile(spec.p, simultaneous=spec.simultaneous)
    # for a new realisation: the error of G itself, plus the scatter of one realisation, which M
    # does not reduce
    scatter = bla.bound(spec.p, of="realization", simultaneous=spec.simultaneous) ** 2 / quantile
    # an FRF from elsewhere has one standard deviation, which shows the scatter of repeated
    # measurements
    if bla.level_source in ("std", "coherence"):
        noise = scatter
    else:
        noise = np.nan_to_num(bla.var_noise)
    shares = {
        "noise": np.minimum(noise, scatter),
        "odd": np.maximum(scatter - noise, 0.0),
        "even": np.nan_to_num(bla.var_even) if spec.even else np.zeros(F),
    }
    variance = sum_of_parts(shares)
    radius = np.sqrt(quantile * variance)
    parts = {
        name: radius * np.divide(share, variance, out=np.zeros(F), where=variance > 0)
        for name, share in shares.items()
    }
    model = nominal_response(nominal, bla.omega)
    parts["misfit"] = _model_misfit(bla, model)
    parts["level"] = np.zeros(F)
    parts["systematic"] = (
        np.zeros(F) if spec.systematic is None else bla.systematic(spec.systematic)
    )
    floor = np.maximum(1e-9 * np.abs(model), np.finfo(float).tiny)
    # a disc has a positive radius even without any scatter
    parts["misfit"] = parts["misfit"] + np.maximum(floor - sum_of_parts(parts), 0.0)
    return parts


def _model_misfit(bla: Bla, model: np.ndarray) -> np.ndarray:
    """Return (F,) the misfit beyond scatter: windowed mean of |residual|^2 minus the variance, as
    an amplitude.

    It is relative to the model inside the window; otherwise a resonance would spread over its
    neighbours. A line far beyond all scatter counts by itself, because a window would hide a narrow
    error.
    """
    square = np.abs(bla.G - model) ** 2
    var = bla.var_bound
    size = np.maximum(np.abs(model) ** 2, np.finfo(float).tiny)
    around = size * _window_means((square - var) / size)
    alone = np.where(square > bla.f_quantile(0.95, simultaneous=True) * var, square - var, 0.0)
    return np.sqrt(np.maximum(np.maximum(around, alone), 0.0))


def _window_means(x: np.ndarray) -> np.ndarray:
    """Return (F, ...) means over the lines around each line, in windows inside the band."""
    F = len(x)
    sums = np.concatenate([np.zeros((1, *x.shape[1:])), np.cumsum(x, axis=0)])
    first = np.clip(np.arange(F) - _WINDOW // 2, 0, max(F - _WINDOW, 0))
    last = np.minimum(first + _WINDOW, F)
    return np.asarray((sums[last] - sums[first]) / (last - first).reshape(-1, *[1] * (x.ndim - 1)))


def larger_neighbour(omega: np.ndarray, lines: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Return the values at other frequencies: the larger neighbour inside the band of the lines,
    nan outside it.
    """
    right = np.clip(np.searchsorted(lines, omega), 0, lines.size - 1)
    left = np.where(lines[right] == omega, right, np.maximum(right - 1, 0))
    out = np.maximum(values[left], values[right])
    out[(omega < lines[0]) | (omega > lines[-1])] = np.nan
    return out


#: W1 and W2, the scaling of a plant.
Scaling: TypeAlias = "tuple[Weight | None, Weight | None]"


def radius_in_form(
    form: Form,
    omega: np.ndarray,
    *,
    absolute: np.ndarray,
    nominal: control.StateSpace | control.FrequencyResponseData,
    shaped_by: Scaling,
    rules: Extrapolation,
    dt: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the factor from an absolute radius to that of the form, and frequencies and radii for
    the weight to cover.

    For a form that depends on the units of the plant the relative radius is continued, with |G| at
    each frequency, because the radius of the form has a limit.
    """
    if not form.depends_on_units:
        factor = form.radius_factor(omega, absolute, np.abs(nominal_response(nominal, omega)))
        return factor, *rules.extrapolate(omega, absolute * factor, dt)

    def sizes(
        omega: np.ndarray,
    ) -> tuple[np.ndarray, np.ndarray]:  # |G|, and |W1 W2| of the given scalings
        # an FRF is continued by its value at each end
        inside = centre_of(nominal).known_at(omega)
        scaling = [response(state_space("W1 and W2", W), omega) for W in shaped_by if W is not None]
        return np.abs(nominal_response(nominal, inside)), np.abs(
            np.prod([np.ones(omega.size), *scaling], axis=0)
        )

    size, scale = sizes(omega)
    factor = scale * form.radius_factor(omega, absolute * scale, size * scale)
    wide, relative = rules.extrapolate(omega, absolute / np.maximum(size, 1e-300), dt)
    size, scale = sizes(wide)
    there = relative * size * scale
    try:
        return factor, wide, there * form.radius_factor(wide, there, size * scale)
    except ValueError as error:
        raise ValueError(f"below and above must give a radius outside the band: {error}") from None


def resolve_scaling(
    form: Form,
    nominal: control.StateSpace | control.FrequencyResponseData,
    *,
    omega: np.ndarray,
    shaped_by: Scaling,
    rules: Extrapolation,
) -> tuple[Weight | None, Weight | None, Extrapolation]:
    """Return W1, W2 and the rule outside the band that apply.

    The default scaling gives unit gain in mid band: the mean of |G| in decibels over log frequency
    is zero. Outside the lines of an FRF no plant is known to which a radius could be relative.
    """
    if not form.depends_on_units:
        return *shaped_by, rules
    if isinstance(nominal, control.FrequencyResponseData):
        rules = Extrapolation()
    if shaped_by != (None, None):
        return *shaped_by, rules
    size, log = np.log(np.abs(nominal_response(nominal, omega))), np.log(omega)
    if omega.size > 1:
        middle = np.trapezoid(size, log) / (log[-1] - log[0])
    else:
        middle = size[0]
    return 1.0, float(np.exp(-middle)), rules


# ---- Full blocks for several channels.


def block_radius(
    frms: Sequence[Bla], models: Sequence[np.ndarray], *, spec: RadiusSpec, form: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return all frequencies, and (n_left + n_right, W) the largest radii of diagonal W_l and W_r
    over the records.

    A block W_l D W_r lies in every block with larger diagonals. The split between left and right is
    arbitrary and varies with the level of excitation: for several records each has W_r of mean
    square one.
    """
    each = [
        block_radii_of_record(frm, G, missed=entry_misfits(frm, G), spec=spec, form=form)
        for frm, G in zip(frms, models, strict=True)
    ]
    if len(frms) == 1:
        return frms[0].omega, np.concatenate(each[0])
    omega, spread = np.unique(np.concatenate([frm.omega for frm in frms])), []
    for frm, (left, right) in zip(frms, each, strict=True):
        scale = np.sqrt(np.mean(right**2, axis=0))
        spread.append(
            [larger_neighbour(omega, frm.omega, row) for row in (*(left * scale), *(right / scale))]
        )
    return omega, np.nanmax(spread, axis=0)


def entry_misfits(frm: Bla, model: np.ndarray) -> np.ndarray:
    """Return (F,) or (n_y, n_u, F) the misfit of the nominal beyond scatter, entry by entry."""
    entries = model.reshape(frm.n_outputs, frm.n_inputs, -1)
    out, spec = np.empty(entries.shape), RadiusSpec(even=False)
    for j, i in np.ndindex(entries.shape[:2]):
        parts = record_radius_parts(frm.entry(j, i), control.frd(entries[j, i], frm.omega), spec)
        out[j, i] = parts["misfit"]
    return out.reshape(model.shape)


def block_radii_of_record(
    frm: Bla, model: np.ndarray, *, missed: np.ndarray, spec: RadiusSpec, form: str
) -> tuple[np.ndarray, np.ndarray]:
    """Return radii (n, F) of diagonal W_l and W_r whose full block covers the matrix of a new
    realisation.

    W_l W_l^H >= (1 + 1/t) x_p C + (1 + t) B with the misfit m and B = n_y diag_j sum_i m_ji^2 /
    gamma_ii; t minimises its trace. A Hermitian X lies below the diagonal lambda_max(corr X) X_jj.
    """
    gamma = np.moveaxis(frm.cov.gamma, 2, 0)
    x = _root_quantiles(frm, spec)
    C = frm.covariance_of("realization")
    if spec.even:
        C = C + frm.experiment.n_realizations * np.nan_to_num(frm.cov.even)
    own = np.einsum("iif->if", frm.cov.gamma).real
    C = x[:, None, None] * smooth_covariance(np.moveaxis(C, 2, 0), model, own)
    n_y = frm.n_outputs
    B = n_y * np.einsum("jif,if->fj", missed**2, 1 / own)
    trace_C, trace_B = np.einsum("fjj->f", C).real, B.sum(axis=1) + np.finfo(float).tiny
    t = np.sqrt(trace_C / trace_B) + np.finfo(float).tiny
    X = (1 + 1 / t)[:, None, None] * C + ((1 + t)[:, None] * B)[:, :, None] * np.eye(n_y)
    if form == INPUT:
        inverse = np.linalg.inv(np.moveaxis(model, 2, 0))
        X = inverse @ X @ np.swapaxes(inverse, 1, 2).conj()
    return diagonal_bound(X), diagonal_bound(gamma)


def _root_quantiles(frm: Bla, spec: RadiusSpec) -> np.ndarray:
    """Return (F,) quantile of Roy's root: block of a `Bla` over the root of its covariance."""
    left, _ = frm.block(spec.p, simultaneous=spec.simultaneous)
    size = np.einsum("jkf,jkf->f", left, left.conj()).real
    return size / np.einsum("jjf->f", frm.cov.bound).real


def smooth_covariance(C: np.ndarray, model: np.ndarray, own: np.ndarray) -> np.ndarray:
    """Return (F, n_y, n_y) averaged over neighbouring lines, relative to the size of the nominal's
    rows.
    """
    size = np.sqrt(np.einsum("jif,if->fj", np.abs(model) ** 2, 1 / own))
    return _window_means(C / size[:, :, None] / size[:, None]) * size[:, :, None] * size[:, None]


def diagonal_bound(X: np.ndarray) -> np.ndarray:
    """Return (n, F) roots of a diagonal above a Hermitian (F, n, n): lambda_max of its correlation
    times X_jj.
    """
    size = np.sqrt(np.einsum("fjj->fj", X).real)
    correlation = X / size[:, :, None] / size[:, None]
    return (size * np.sqrt(np.linalg.eigvalsh(correlation)[:, -1:])).T
