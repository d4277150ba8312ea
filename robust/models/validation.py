"""Comparison of a second record, from another day or level, with a model."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial
from typing import TypeAlias, TypeVar

import numpy as np
from scipy.special import gammaincc, ndtr

from nlfrf import Bla
from nlfrf._base.arguments import format_hertz, keep_warnings, require_kind
from nlfrf._base.numbers import roy_quantile
from nlfrf._base.units import units_differ
from nlfrf._base.values import value
from robust._base.channels import require_matrix, require_single
from robust.lti.sampling import hold_correction
from robust.models.fit.measurement import bla_behind_hold, require_same_channels, require_same_units
from robust.models.fit.shared_poles import hermitian_power
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import nominal_response, smooth_covariance
from robust.models.sets.records import LEVEL_DOF, RecordSummary, summarize_record

# The test is about the difference between the two records, d = G_2 - G_1: both scatter about one
# BLA if the machine has not changed. Divided by its standard deviation d is white: z_k, with
# independent phases whatever their sizes are. For several channels its covariance is the sum of
# those of both records, which includes noise and distortion of both; the bound of one record alone
# is for a new realisation without measurement noise. d can deviate in two ways, which are
# separated:
#
# shape   d follows a change of gain, delay or frequency, x_k = dG_k/dtheta over the same deviation.
# By chance the
#         score s = sum Re(conj(x_k) z_k) has the covariance C = 1/2 sum |z_k|^2 Re(conj(x_k)
#         x_k^T), given the sizes |z_k|: then s^T C^-1 s is chi-square with three degrees of
#         freedom. It needs no level: a wrong one drops out.
# level   the remainder of d is larger than the scatter of both records.

_WINDOW = 9  # lines over which the slope of an FRF is estimated
_MIN_SHARED_LINES = 8  # lines below which a shape is not tested
#: Variance of the log residual power of two records of one machine, times the number of lines.
_LEVEL_LINES = 2.0
_SAME_LINE = 1e-9  # relative difference of equal lines
_VARIANCE_FLOOR = 1e-8  # relative to the largest eigenvalue of a covariance
_CONFIDENCE = 0.95  # for a record against a record
_DIFFERENCE_STEP = 1e-5
# p below which the conclusion reports a change; a choice, nothing else depends on it
_CHANGED = 0.01
_LINE_TOLERANCE = 1e-6  # relative distance to a line of the FRF that a model is made around


@value
class _RecordChange:
    """Change from one record to another that explains their difference best, and what it leaves.

    Fields
    ------
    gain, frequency : float
        Relative change of the gain and of the frequencies. For example, `frequency` is 0.01 if the
        resonance has risen by 1 %.
    delay : float
        Change of the delay [s].
    level, p_level : float
        Rms of the difference that the change of gain, delay and frequency does not explain, divided
        by the scatter expected from both records; and its p-value, the probability of at least this
        ratio for an unchanged machine.
    """

    gain: float
    frequency: float
    delay: float
    level: float
    p_level: float


@value
class Validation:
    """Result of `validate`: comparison of a second record with a model or with a first record.

    Fields
    ------
    n_outside : int
        Number of lines on which both records differ by more than their scatter explains, at the
        confidence of the model (95 % without a model). For several channels the whole matrix of a
        line is compared.
    n_expected : float
        Expected value of `n_outside` if the machine has not changed.
    p_value : float
        p-value of the test for a change of gain, delay and frequency together (one change for all
        entries): probability that two records of an unchanged machine differ at least as much. It
        is uniformly distributed for an unchanged machine, if the distortion is white over the
        lines. 1 for the record of the model itself, nan for fewer than eight lines.
    omega_outside : (n_outside,) ndarray
        Frequencies of the lines that `n_outside` counts [rad/s].
    n_lines : int
        Number of lines of the record inside the band of the model. Two records with different lines
        are compared on fewer lines, to which `n_expected` refers.
    omega, distance : (n_lines,) ndarray
        Frequencies of the lines [rad/s], and the distance of the second FRF from the nominal on
        each, divided by the weight; nan without a model.
    change : RecordChange or None
        Estimated change of gain, frequency and delay, and the level of the difference that remains.
        None for the record of the model itself, and for fewer than eight lines.
    entries_outside : (n_y, n_u) int ndarray or None
        `n_outside` of each entry, for several channels; `n_expected` refers to each entry.
    p_values : (n_y, n_u) ndarray or None
        `p_value` of each entry alone, for several channels.
    inputs, outputs : tuple of str
        Names of the channels.
    warnings : tuple of str
        Warnings about the model and both records.

    References
    ----------
    C. R. Rao, *Linear Statistical Inference and Its Applications*, 2nd ed., 6e (score tests); H.
    White, Econometrica 48, 817 (1980) (their covariance for unknown variances); Khatri 1964 for
    whole matrices, as `Bla.block`.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> import control
    >>> from robust import uncertainty, validate
    >>> bla = nlfrf.identify(record)
    >>> seen = validate(uncertainty(bla, control.tf([2.3], [1]), order=0, above="flat"), bla)
    >>> seen.n_outside, seen.n_lines == ms.f.size, seen.p_value
    (0, True, 1.0)

    Two records with several channels:

    >>> import nlfrf, robust
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, n_inputs=2, n_realizations=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> y = u + 0.1 * u**3 + 0.2 * u[::-1]
    >>> first, second = (nlfrf.identify(nlfrf.Record(u=u[:, s], y=y[:, s], fs=128, lines=ms.lines))
    ...     for s in (slice(0, 2), slice(2, 4)))
    >>> seen = robust.validate(first, second)
    >>> seen.n_outside < 4, seen.p_value > 0.01
    (True, True)
    """

    n_outside: int
    n_expected: float
    p_value: float
    omega_outside: np.ndarray
    n_lines: int
    omega: np.ndarray
    distance: np.ndarray
    change: _RecordChange | None
    entries_outside: np.ndarray | None = None
    p_values: np.ndarray | None = None
    inputs: tuple[str, ...] = ("u",)
    outputs: tuple[str, ...] = ("y",)
    warnings: tuple[str, ...] = ()

    @property
    def n_outside_set(self) -> int:
        """Number of lines on which the second FRF is outside the set of the model."""
        return int(np.sum(self.distance > 1))

    def __str__(self) -> str:
        """Return the result in a few lines."""
        if self.n_outside_set:
            where = f", worst at {format_hertz(float(self.omega[np.argmax(self.distance)]))}"
        else:
            where = ""
        shares, entry, entries, what = "", "", "", "lines beyond both discs"
        rows = [f"validation: {self.n_outside_set} of {self.n_lines} lines outside the set{where}"]
        if self.p_values is not None and self.entries_outside is not None:
            rows = [
                f"validation of {len(self.outputs)} outputs by {len(self.inputs)} inputs on"
                f" {self.n_lines} lines"
            ]
            rows[0] += (
                ""
                if np.isnan(self.distance).all()
                else f": {self.n_outside_set} outside the set{where}"
            )
            shares, what = " of all entries", "matrices beyond both"
            place = np.unravel_index(
                np.argmin(np.nan_to_num(self.p_values, nan=1.0)), self.p_values.shape
            )
            j, i = map(int, place)
            entry = (
                f"the entry that changed most: {self.outputs[j]} by {self.inputs[i]}, p ="
                f" {self.p_values[j, i]:.2g}"
            )
            low, high = int(self.entries_outside.min()), int(self.entries_outside.max())
            entries = f"; entries {low} to {high}"
        outside = f"{self.n_outside} {what}, {self.n_expected:.3g} expected{entries}"
        change = self.change
        if change is None:
            if self.p_value == 1:
                why = "the record is that of the model"
            else:
                why = f"not tested on fewer than {_MIN_SHARED_LINES} lines"
            rows.append(f"shape and level: {why}; {outside}")
        else:
            rows.append(
                f"shape: p = {self.p_value:.2g}; best change{shares}: gain"
                f" {100 * change.gain:+.2g} %, frequency {100 * change.frequency:+.2g} %, delay"
                f" {1e3 * change.delay:+.2g} ms"
            )
            rows += [entry] * bool(entry)
            rows.append(
                f"level: the remainder is {change.level:.2g} times the scatter of both records, p ="
                f" {change.p_level:.2g}; {outside}"
            )
        return "\n  ".join(
            [
                *rows,
                f"conclusion: {self.conclusion}",
                *(f"warning: {text}" for text in self.warnings),
            ]
        )

    @property
    def conclusion(self) -> str:
        """Conclusion: whether the machine or its scatter changed, and whether the set contains all
        lines.
        """
        changed = []
        if self.p_value < _CHANGED:
            changed.append("the FRF has another shape")
        if self.change is not None and self.change.p_level < _CHANGED:
            changed.append("it scatters more than both records")
        if changed:
            words = ", and ".join(changed)
        else:
            words = "no significant change"
        if np.isnan(self.distance).all():
            return f"{words} (at {100 * _CHANGED:g} %)"
        holds = "contains every line" if not self.n_outside_set else "does not contain every line"
        return f"{words} (at {100 * _CHANGED:g} %); the set {holds} of this record"


@keep_warnings
def validate(model: UncertaintyModel | Bla, bla: Bla) -> Validation:
    """Compare a second record (another day, another level, closed loop) with a model.

    Use this to decide whether an old model is still valid for a machine, or whether the set is
    valid at another level.

    The second record is compared line by line with the record behind the model. If their lines
    differ, the lines of the record with fewer lines are used, and the other record is interpolated.
    If the model is from several levels, its record that is most similar to the second record is
    used. A model without a record is compared as if it were exact.

    The p-values are valid if the distortion is white over the lines, as with friction. A static
    cubic nonlinearity shifts all lines of one realisation together, which looks like a small change
    of gain (see the guide on bounds).

    Parameters
    ----------
    model : UncertaintyModel or nlfrf.Bla
        The model; or the first record, without a model.
    bla : nlfrf.Bla
        The second record. Its lines outside the band of the model are left out.

    Returns
    -------
    Validation

    Raises
    ------
    ValueError
        No line inside the band of the model, a nominal that is an FRF with other lines, a model
        without a confidence, or a record with other inputs and outputs.

    References
    ----------
    Score test on the difference of the two FRFs, divided by its standard deviation. The covariance
    of the score is conditional on the magnitudes of this quotient on the lines.

    Examples
    --------
    A plant whose stiffness has risen by 30 %, measured with the same multisine.

    >>> import control, nlfrf, robust
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1, n_realizations=2)
    >>> y = 2 * ms.u + 0.1 * ms.u**3
    >>> first, second = (nlfrf.identify(nlfrf.Record(u=ms.u[i:i + 1, None], y=gain * y[i:i + 1, None], fs=128,
    ...     lines=ms.lines)) for i, gain in ((0, 1.0), (1, 1.3)))
    >>> seen = validate(robust.uncertainty(first, control.tf([2.3], [1]), order=0, above="flat"), second)
    >>> bool(abs(seen.change.gain - 0.3) < 0.1), seen.p_value < 1e-3
    (True, True)
    """
    require_kind("model", model, UncertaintyModel, Bla)
    several = not model.is_single
    (require_matrix if several else require_single)("bla", bla)
    if (bla.n_outputs, bla.n_inputs) != (model.n_outputs, model.n_inputs):
        raise ValueError(
            f"bla must have {model.n_outputs} outputs and {model.n_inputs} inputs, as the model,"
            f" got {bla.n_outputs} and {bla.n_inputs}"
        )
    if several:
        require_same_channels(bla, model, "the model")
    inside = (bla.omega >= model.omega[0] * (1 - 1e-9)) & (
        bla.omega <= model.omega[-1] * (1 + 1e-9)
    )
    if not inside.any():
        raise ValueError("bla must have lines inside the band of the model, got none")
    slope: _Slope = _measured_slope
    confidence, simultaneous = _CONFIDENCE, False
    firsts: tuple[RecordSummary, ...]
    if isinstance(model, Bla):
        require_same_units([model, bla])
        if "unknown" not in (model.hold, bla.hold):
            model, bla = bla_behind_hold(model, 0.0), bla_behind_hold(bla, 0.0)
        second = summarize_record(bla).on_lines(bla.omega[inside])
        firsts, distance = (summarize_record(model),), np.full(second.omega.size, np.nan)
    else:
        if units_differ(model.unit, bla.unit):
            raise ValueError(f"bla must be in {model.unit}, as the model, got {bla.unit}")
        confidence, simultaneous = model.confidence, model.simultaneous
        if np.isnan(confidence):
            raise ValueError("model must state a confidence to be validated against, got none")
        if model.measured_only:
            bla = bla.times(_hold_factor(model, bla, inside), output_unit=bla.output_units)
        else:
            bla = model.centre.behind_hold(bla)
            slope = partial(_nominal_slope, model)
        second = summarize_record(bla).on_lines(bla.omega[inside])
        nominal = np.moveaxis(model.at(second.omega), -1, 0)
        distance = model.normalized_distance(second.omega, second.G, nominal)
        firsts = _records_near(model, second)
    tried = []
    for first in firsts:
        lines = _shared_lines(first.omega, second.omega)
        if simultaneous:
            p = confidence ** (1 / lines.size)
        else:
            p = confidence
        pair = first.on_lines(lines), second.on_lines(lines)
        tried.append(
            _compare_matrix_records(*pair, p) if several else _compare_records(slope, *pair, p)
        )
    best = max(tried, key=_likeness)
    best = replace(best, omega=second.omega, n_lines=second.omega.size, distance=distance)
    return replace(best, inputs=bla.inputs, outputs=bla.outputs)


def _likeness(found: Validation) -> tuple[float, float]:
    """Return how well a record fits: the p-value of its shape, then that of its level."""
    level = 0.0 if found.change is None else found.change.p_level
    return float(np.nan_to_num(found.p_value)), level


def _hold_factor(model: UncertaintyModel, bla: Bla, inside: np.ndarray) -> np.ndarray:
    """Return (F,) the factor from the hold of a record to that of the model's FRF; one if a hold is
    unknown.
    """
    at = np.asarray(model.nominal.omega)
    if np.abs(np.log(bla.omega[inside, None] / at[at > 0])).min(axis=1).max() > _LINE_TOLERANCE:
        raise ValueError(
            "bla must have lines of the FRF that is the nominal of the model, got others,"
            " between which this FRF is unknown. A model with a fitted nominal (fit_nominal)"
            " allows any lines"
        )
    hold = model.origin.hold
    if hold is None or "unknown" in (hold.kind, bla.hold):
        return np.ones(bla.omega.size)
    own = hold_correction(bla.omega, bla.hold, fs=bla.fs, dt=0.0)
    other = hold_correction(bla.omega, hold.kind, fs=hold.fs, dt=0.0)
    return np.asarray(own / other)


def _records_near(model: UncertaintyModel, second: RecordSummary) -> tuple[RecordSummary, ...]:
    """Return the records behind a model that share lines with another record; otherwise the
    nominal, as exact.
    """
    reach = [
        one
        for one in model.records
        if one.omega[0] <= second.omega[-1] and one.omega[-1] >= second.omega[0]
    ]
    G = np.moveaxis(nominal_response(model.nominal, second.omega), -1, 0)
    return tuple(reach) or (replace(second, G=G, variance=0 * second.variance),)


def _shared_lines(first: np.ndarray, second: np.ndarray) -> np.ndarray:
    """Return (n,) frequencies at which two records on lines (F,) of their own are compared.

    These are the lines of the one with fewer, in the band of both. So no line of the other is used
    twice: its scatter would count twice, and the difference would not be white.
    """
    low = max(first[0], second[0]) * (1 - _SAME_LINE)
    high = min(first[-1], second[-1]) * (1 + _SAME_LINE)
    inside = [omega[(omega >= low) & (omega <= high)] for omega in (first, second)]
    if 0 < inside[0].size < inside[1].size or not inside[1].size:
        fewer, other = inside[0], second
    else:
        fewer, other = inside[1], first
    last = np.clip(np.searchsorted(other, fewer * (1 - _SAME_LINE)), 0, other.size - 1)
    begin = np.where(np.abs(other[last] - fewer) <= _SAME_LINE * fewer, last, last - 1)
    keep, read = np.zeros(fewer.size, dtype=bool), -1
    for k in range(fewer.size):
        keep[k] = begin[k] > read
        if keep[k]:
            read = last[k]
    return np.asarray(fewer[keep])


def _fit_shape_and_level(
    x: np.ndarray, units: np.ndarray, *, z: np.ndarray, n_lines: int | None = None
) -> tuple[float, _RecordChange | None]:
    """Return p-value and change of whitened differences z (n,) along directions x (3, n), on n
    lines or fewer; nan and None on too few lines.
    """
    if n_lines is None:
        n_lines = z.size
    if n_lines < _MIN_SHARED_LINES:
        return float("nan"), None
    score, fisher = (x.conj() @ z).real, (x.conj() @ x.T).real
    covariance = ((x.conj() * np.abs(z) ** 2) @ x.T).real / 2
    theta = np.linalg.lstsq(fisher, score, rcond=1e-12)[0]
    T = float(score @ np.linalg.lstsq(covariance, score, rcond=1e-12)[0])
    square = float(np.sum(np.abs(z - theta @ x) ** 2) / (z.size - len(x) / 2))
    gain, delay, frequency = (float(t) for t in theta * units)
    change = _RecordChange(
        gain=gain,
        delay=delay,
        frequency=frequency,
        level=float(np.sqrt(square)),
        p_level=float(ndtr(-np.log(max(square, 1e-300)) / np.sqrt(_LEVEL_LINES / n_lines))),
    )
    return float(gammaincc(len(x) / 2, T / 2)), change


def _local_slope(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Return (F,) the slope of y over x by a parabola through the lines around each line."""
    n = min(_WINDOW, x.size)
    first = np.clip(np.arange(x.size) - n // 2, 0, x.size - n)
    window = first[:, None] + np.arange(n)
    r = x[window] - x[:, None]
    powers = np.stack([np.ones(r.shape), r, r**2], axis=-1)
    return np.asarray((np.linalg.pinv(powers) @ y[window][..., None])[:, 1, 0])


def _change_directions(
    omega: np.ndarray, G: np.ndarray, slope: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Return (3, F, ...) derivatives of responses (F, ...) by gain, delay and frequency, and units
    of these changes.

    slope : d log G / d log omega.
    """
    turn = (-1j * omega / omega[-1]).reshape(-1, *[1] * (G.ndim - 1)) * np.ones_like(G)
    return np.array([np.ones_like(G), turn, -slope]) * G, np.array([1.0, 1 / omega[-1], 1.0])


#: d log G / d log omega from lines and FRF (F,).
_Slope: TypeAlias = Callable[[np.ndarray, np.ndarray], np.ndarray]


def _nominal_slope(model: UncertaintyModel, omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (F,) d log G / d log omega of the nominal, which does not scatter as the FRF G does."""
    del G
    below, above = (
        nominal_response(model.nominal, omega * factor)
        for factor in (1 - _DIFFERENCE_STEP, 1 + _DIFFERENCE_STEP)
    )
    return np.asarray(np.log(above / below) / (2 * _DIFFERENCE_STEP))


def _measured_slope(omega: np.ndarray, G: np.ndarray) -> np.ndarray:
    """Return (F,) d log G / d log omega of an FRF on its lines."""
    return _local_slope(
        np.log(omega), np.log(np.maximum(np.abs(G), 1e-300)) + 1j * np.unwrap(np.angle(G))
    )


def _compare_records(
    slope: _Slope, first: RecordSummary, second: RecordSummary, p: float
) -> Validation:
    """Compare two records with one channel on the same lines.

    slope : d log G / d log omega, from lines and FRF.
    """
    omega, d = second.omega, second.G - first.G
    variance = np.maximum(first.variance + second.variance, np.finfo(float).tiny)
    outside = np.abs(d) ** 2 > _f_quantile(p, LEVEL_DOF) * variance
    p_value, change = 1.0, None
    if not np.all(np.abs(d) <= 1e-9 * np.abs(second.G)):
        # about the weighted mean of both records, which is independent of their difference
        G = (first.G * second.variance + second.G * first.variance) / variance
        x, units = _change_directions(omega, G, slope(omega, G))
        p_value, change = _fit_shape_and_level(
            x / np.sqrt(variance), units, z=d / np.sqrt(variance)
        )
    return _make_validation(omega, outside, p=p, p_value=p_value, change=change)


def _compare_matrix_records(first: RecordSummary, second: RecordSummary, p: float) -> Validation:
    """Compare two records with several channels on the same lines."""
    omega, d = second.omega, second.G - first.G
    n_y, n_u = d.shape[1:]
    gamma, later_gamma, dof, later_dof = first.gamma, second.gamma, first.dof, second.dof
    assert gamma is not None  # for several channels
    assert later_gamma is not None
    assert dof is not None
    assert later_dof is not None
    before = np.einsum("fjj,fii->fji", first.variance, gamma).real
    after = np.einsum("fjj,fii->fji", second.variance, later_gamma).real
    variance = np.maximum(before + after, np.finfo(float).tiny)
    L = _welch_satterthwaite_dof(
        before, after, dof_a=dof[:, None, None], dof_b=later_dof[:, None, None]
    )
    entries = np.abs(d) ** 2 > _f_quantile(p, L) * variance
    # for inputs along the same directions both times the sum is a product again; otherwise it lies
    # above
    turned = np.linalg.eigvals(np.linalg.solve(gamma, later_gamma)).real.max(axis=1)
    C = [first.variance, turned[:, None, None] * second.variance]
    before, after = (np.einsum("fjj->f", one).real for one in C)
    L = _welch_satterthwaite_dof(before, after, dof_a=dof, dof_b=later_dof)
    Z = _inverse_hermitian_root(C[0] + C[1]) @ d @ _inverse_hermitian_root(gamma)
    limit = np.array([roy_quantile(p, n_y, n_u, round(float(one), 1)) for one in L])
    p_value, change, p_values = 1.0, None, np.ones((n_y, n_u))
    if not np.all(np.abs(d) <= 1e-9 * np.abs(second.G)):
        p_value, change, p_values = _entry_changes(first, second, d=d, C=C[0] + C[1])
    outside = np.linalg.norm(Z, 2, (1, 2)) ** 2 > limit
    return replace(
        _make_validation(omega, outside, p=p, p_value=p_value, change=change),
        entries_outside=entries.sum(axis=0),
        p_values=p_values,
    )


def _make_validation(
    omega: np.ndarray,
    outside: np.ndarray,
    *,
    p: float,
    p_value: float,
    change: _RecordChange | None,
) -> Validation:
    """Make the result on the shared lines of two records."""
    return Validation(
        n_outside=int(outside.sum()),
        n_expected=(1 - p) * omega.size,
        omega_outside=omega[outside],
        n_lines=omega.size,
        omega=omega,
        distance=np.zeros(omega.size),
        p_value=p_value,
        change=change,
    )


Dof = TypeVar("Dof", float, np.ndarray)


def _f_quantile(p: float, dof: Dof) -> Dof:
    return dof * np.expm1(-np.log1p(-p) / dof)


def _welch_satterthwaite_dof(
    a: np.ndarray, b: np.ndarray, *, dof_a: np.ndarray, dof_b: np.ndarray
) -> np.ndarray:
    """Return degrees of freedom of the sum of two estimated variances (Welch and Satterthwaite)."""
    tiny = np.finfo(float).tiny ** 0.25
    scale = np.maximum(a + b, tiny)
    return np.asarray(1 / ((a / scale) ** 2 / dof_a + (b / scale) ** 2 / dof_b + tiny))


def _inverse_hermitian_root(X: np.ndarray) -> np.ndarray:
    """Return (F, n, n) X^-1/2 of Hermitian matrices."""
    return hermitian_power(X, -0.5, share=_VARIANCE_FLOOR, least=np.finfo(float).tiny)


def _entry_changes(
    first: RecordSummary, second: RecordSummary, *, d: np.ndarray, C: np.ndarray
) -> tuple[float, _RecordChange | None, np.ndarray]:
    """Return p-value and change that all entries share, and (n_y, n_u) p-values for a change of
    each entry.
    """
    omega, (F, n_y, n_u) = second.omega, d.shape
    G = (first.G + second.G) / 2
    slope = np.array([_measured_slope(omega, g) for g in G.reshape(F, -1).T]).T.reshape(G.shape)
    x, units = _change_directions(omega, G, slope)
    assert first.gamma is not None  # for several channels
    own = np.einsum("fii->fi", first.gamma).real
    level = smooth_covariance(C, np.moveaxis(G, 0, 2), own.T)
    left, right = _inverse_hermitian_root(level), _inverse_hermitian_root(first.gamma)
    p_value, change = _fit_shape_and_level(
        (left @ x @ right).reshape(3, -1), units, z=(left @ d @ right).ravel(), n_lines=F
    )
    size = np.sqrt(np.einsum("fjj->fj", level).real[:, :, None] * own[:, None])
    each = [
        _fit_shape_and_level((x / size)[:, :, j, i], units, z=(d / size)[:, j, i])[0]
        for j, i in np.ndindex(n_y, n_u)
    ]
    return p_value, change, np.array(each).reshape(n_y, n_u)
