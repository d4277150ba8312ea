"""A second record, of another day or level, against a model: is it the same machine, and does it lie in the set?"""

from __future__ import annotations

from dataclasses import replace
from typing import overload

import control
import numpy as np

from nlfrf import Bla, Frm
from nlfrf.shared.arguments import of_kind
from nlfrf.shared.values import value
from nlfrf.shared.wording import hertz, shown
from robust.modelling.nominal import behind_hold
from robust.systems.grids import interpolated
from robust.systems.lti import timebase
from robust.systems.sampling import hold_between
from robust.uncertain.evidence import LEVEL_DOF, Evidence, evidence_of
from robust.uncertain.matrix_model import MatrixUncertainty
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.radius import nominal_response
from robust.validation.difference import local_slope, shape_and_level, shared_lines
from robust.validation.matrices import MatrixValidation, validate_matrix

__all__ = ["Validation", "validate"]


STEP = 1e-5
LINE = 1e-6  # relative: a line of the FRF that a model is made around


@value
class Validation:
    """A second record held against a model.

    Fields
    ------
    n_outside : int
        Lines on which the record differs from the one behind the model by more than both scatter, at the confidence of
        the model.
    n_expected : float
        How many do where nothing has changed.
    p_value : float
        Probability that two records of one machine differ as much along a change of gain, delay and frequency
        together. Uniform where nothing has changed and distortion is white over the lines; 1 for the record behind the
        model itself, nan on fewer than eight lines.
    omega_outside : (n_outside,) ndarray
        Where they are [rad/s].
    n_lines : int
        Lines of the record; those outside the band of the model are left out. Where the two records have other lines
        they are compared on fewer, of which `n_expected` tells the number.
    omega, distance : (n_lines,) ndarray
        Those lines [rad/s], and how far each lies from the nominal, in units of the weight.
    gain, frequency : float
        The change that fits best, relative: a resonance that went up by 1 % has a frequency of 0.01.
    delay : float
        The same of the delay [s].
    level, p_level : float
        What is left of the difference over what both records say that they scatter, rms, and the probability of as much
        or more where nothing has changed.

    References
    ----------
    C. R. Rao, *Linear Statistical Inference and Its Applications*, 2nd ed., 6e (score tests); H. White, Econometrica
    48, 817 (1980) (their covariance where variances are not known).

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> from robust import uncertainty, validate
    >>> bla = nlfrf.identify(record)
    >>> seen = validate(uncertainty(bla, control.tf([2.3], [1]), order=0, above="flat"), bla)
    >>> seen.n_outside, seen.n_lines == ms.f.size, seen.p_value
    (0, True, 1.0)
    """

    n_outside: int
    n_expected: float
    p_value: float
    omega_outside: np.ndarray
    n_lines: int
    omega: np.ndarray
    distance: np.ndarray
    gain: float = float("nan")
    delay: float = float("nan")
    frequency: float = float("nan")
    level: float = float("nan")
    p_level: float = float("nan")

    @property
    def n_outside_set(self) -> int:
        """Lines of the record outside the set itself: beyond the weight."""
        return int(np.sum(self.distance > 1))

    def __str__(self) -> str:
        """What was found, in a few lines."""
        where = "" if not self.n_outside_set else f", worst at {hertz(float(self.omega[np.argmax(self.distance)]))}"
        return (
            f"validation: {self.n_outside_set} of {self.n_lines} lines outside the set{where}\n"
            f"  shape: p = {self.p_value:.2g}; best change: gain {100 * self.gain:+.2g} %, frequency "
            f"{100 * self.frequency:+.2g} %, delay {1e3 * self.delay:+.2g} ms\n"
            f"  level: the rest is {self.level:.2g} times what both records scatter, p = {self.p_level:.2g}; "
            f"{self.n_outside} lines beyond both discs, {self.n_expected:.3g} expected"
        )


@overload
def validate(model: UncertaintyModel, bla: Bla) -> Validation: ...


@overload
def validate(model: MatrixUncertainty | Frm, bla: Frm) -> MatrixValidation: ...


def validate(model: UncertaintyModel | MatrixUncertainty | Frm, bla: Bla | Frm) -> Validation | MatrixValidation:
    """Hold a second record (another day, another level, closed loop) against a model.

    The record is compared with the one that the model was made of, line by line (of other lines those of the one that
    has fewer, the other one interpolated); of several levels with the one that it resembles most. A model without a
    record is taken as exact. p-values are as good as the distortion is white over the lines: they are on the rig with
    friction, a static cubic bends all lines of one realisation together, which looks like a small change of gain (see
    the guide on bounds).

    Parameters
    ----------
    model : UncertaintyModel, MatrixUncertainty or nlfrf.Frm
        The model; of several inputs and outputs also the first record alone.
    bla : nlfrf.Bla or nlfrf.Frm
        What was measured later; lines outside the band of the model are left out.

    Returns
    -------
    Validation, or MatrixValidation of an Frm

    Raises
    ------
    ValueError
        No line inside the band of the model, lines between those of an FRF that the model is made around, a model that
        claims no probability, a record of other inputs and outputs.

    References
    ----------
    Score test on whitened residuals, with a covariance that takes the sizes of the lines as they are.

    Examples
    --------
    A plant that became 30 % stiffer to the eye of the same multisine.

    >>> import nlfrf, robust
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1, n_realizations=2)
    >>> y = 2 * ms.u + 0.1 * ms.u**3
    >>> first, second = (nlfrf.identify(nlfrf.Record(u=ms.u[i:i + 1, None], y=gain * y[i:i + 1, None], fs=128,
    ...     lines=ms.lines)) for i, gain in ((0, 1.0), (1, 1.3)))
    >>> seen = validate(robust.uncertainty(first, control.tf([2.3], [1]), order=0, above="flat"), second)
    >>> bool(abs(seen.gain - 0.3) < 0.1), seen.p_value < 1e-3
    (True, True)
    """
    if isinstance(model, MatrixUncertainty | Frm):
        if not isinstance(bla, Frm):
            raise ValueError(f"bla must be an nlfrf.Frm, as the model, got {shown(bla)}")
        return validate_matrix(model, bla)
    if not isinstance(bla, Bla):
        raise ValueError(f"bla must be an nlfrf.Bla, as the model, got {shown(bla)}")
    of_kind("model", model, UncertaintyModel)
    inside = (bla.omega >= model.omega[0] * (1 - 1e-9)) & (bla.omega <= model.omega[-1] * (1 + 1e-9))
    if not inside.any():
        raise ValueError("bla must have lines inside the band of the model, got none")
    if np.isnan(model.confidence):
        raise ValueError("model must state a confidence to be validated against, got none")
    bla = (
        bla.times(as_recorded(model, bla, inside)) if model.measured_only else behind_hold(bla, timebase(model.nominal))
    )
    second = on_lines(evidence_of(bla), bla.omega[inside])
    distance = model.distance(control.FrequencyResponseData(second.G, second.omega))
    tried = []
    for one in known(model, second):
        lines = shared_lines(one.omega, second.omega)
        tried.append(compared(model, on_lines(one, lines), on_lines(second, lines)))
    best = max(tried, key=lambda one: (np.nan_to_num(one.p_value), one.p_level))
    return replace(best, omega=second.omega, n_lines=second.omega.size, distance=distance)


def as_recorded(model: UncertaintyModel, bla: Bla, inside: np.ndarray) -> np.ndarray:
    """(F,) factor from a record to the hold of the FRF that a model is made around; one where a hold is not known."""
    at = np.asarray(model.nominal.omega)
    if np.abs(np.log(bla.omega[inside, None] / at[at > 0])).min(axis=1).max() > LINE:
        raise ValueError(
            "bla must have lines of the FRF that the model is made around, got others: between its lines it is not "
            "known. A model around a fit (fit_nominal) takes any"
        )
    if "unknown" in (model.hold, bla.hold):
        return np.ones(bla.omega.size)
    own, other = (hold_between(bla.omega, one.hold, one.fs, 0.0) for one in (bla, model))
    return np.asarray(own / other)


def known(model: UncertaintyModel, second: Evidence) -> tuple[Evidence, ...]:
    """The records behind a model that reach the lines of another one; the nominal itself, as exact, where none does."""
    reach = [one for one in model.evidence if one.omega[0] <= second.omega[-1] and one.omega[-1] >= second.omega[0]]
    if reach:
        return tuple(reach)
    nothing = np.zeros(second.omega.size)
    G = nominal_response(model.nominal, second.omega)
    return (Evidence(omega=second.omega, G=G, variance=nothing, scatter=nothing, confirmed=1.0),)


def on_lines(one: Evidence, omega: np.ndarray) -> Evidence:
    """A record on other lines, interpolated in log magnitude and phase; exact where the lines are its own."""
    if omega.size == one.omega.size and np.allclose(omega, one.omega, rtol=1e-9, atol=0):
        return one
    variance, scatter = (np.interp(omega, one.omega, part) for part in (one.variance, one.scatter))
    return replace(one, omega=omega, G=interpolated(omega, one.omega, one.G), variance=variance, scatter=scatter)


def compared(model: UncertaintyModel, first: Evidence, second: Evidence) -> Validation:
    """Two records on the same lines, one against the other."""
    omega, d = second.omega, second.G - first.G
    variance = np.maximum(first.variance + second.variance, np.finfo(float).tiny)
    p = model.confidence ** (1 / omega.size) if model.simultaneous else model.confidence
    outside = np.abs(d) ** 2 > LEVEL_DOF * np.expm1(-np.log1p(-p) / LEVEL_DOF) * variance  # of F(2, 2 dof)
    same = bool(np.all(np.abs(d) <= 1e-9 * np.abs(second.G)))
    found = (
        {"p_value": 1.0}
        if same
        else shape_and_level(*directions(model, first, second, variance), d / np.sqrt(variance))
    )
    return Validation(
        n_outside=int(outside.sum()),
        n_expected=(1 - p) * omega.size,
        omega_outside=omega[outside],
        n_lines=omega.size,
        omega=omega,
        distance=np.zeros(omega.size),
        **found,
    )


def directions(
    model: UncertaintyModel, first: Evidence, second: Evidence, variance: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """(3, F) where a change of gain, delay and frequency moves the lines, whitened; and the units of these changes.

    About the mean of both records, each for what it is worth: it is independent of their difference.
    """
    omega = second.omega
    G = (first.G * second.variance + second.G * first.variance) / variance
    if model.measured_only:
        slope = local_slope(np.log(omega), np.log(np.abs(G)) + 1j * np.unwrap(np.angle(G)))
    else:  # of the nominal, which does not scatter
        below, above = (nominal_response(model.nominal, omega * factor) for factor in (1 - STEP, 1 + STEP))
        slope = np.log(above / below) / (2 * STEP)
    along = np.array([np.ones(omega.size), -1j * omega / omega[-1], -slope])
    return along * G / np.sqrt(variance), np.array([1.0, 1 / omega[-1], 1.0])
