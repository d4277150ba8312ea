"""A second record, of another day or level, held against a model."""

from __future__ import annotations

import control
import numpy as np
from scipy.stats import binom

from nlfrf import Bla
from nlfrf.shared.values import value
from robust.modelling.nominal import behind_hold
from robust.systems.lti import timebase
from robust.uncertain.model import UncertaintyModel

__all__ = ["Validation", "validate"]


@value
class Validation:
    """A second record held against a model.

    Fields
    ------
    n_outside : int
        Lines of the record outside their disc.
    n_expected : float
        How many are expected outside when the model is right.
    p_value : float
        Probability of at least that many when the model is right (binomial, lines independent).
    omega_outside : (n_outside,) ndarray
        Where they are [rad/s].
    n_lines : int
        Lines compared; those outside the band of the model are left out.
    omega, distance : (n_lines,) ndarray
        The lines compared [rad/s], and how far each lies from the nominal, in units of its disc.

    References
    ----------
    The binomial distribution of lines outside, taken as independent.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> from robust import uncertainty, validate
    >>> bla = nlfrf.identify(record)
    >>> seen = validate(uncertainty(bla, control.tf([2.3], [1]), order=0, above="flat"), bla)
    >>> seen.n_outside, seen.n_lines == ms.f.size
    (0, True)
    """

    n_outside: int
    n_expected: float
    p_value: float
    omega_outside: np.ndarray
    n_lines: int
    omega: np.ndarray
    distance: np.ndarray


def validate(model: UncertaintyModel, bla: Bla) -> Validation:
    """Hold a second record (another day, another level, closed loop) against a model.

    Parameters
    ----------
    model : UncertaintyModel
        The model.
    bla : nlfrf.Bla
        What was measured later; lines outside the band of the model are left out.

    Returns
    -------
    Validation

    Raises
    ------
    ValueError
        No line inside the band of the model, or a model that claims no probability.

    References
    ----------
    Lines outside are binomial, taken as independent.

    Examples
    --------
    >>> import nlfrf, robust
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> bla = nlfrf.identify(record)
    >>> model = robust.uncertainty(bla, control.tf([2.3], [1]), order=0, above="flat")
    >>> validate(model, bla).n_outside
    0
    """
    inside = (bla.omega >= model.omega[0] * (1 - 1e-9)) & (bla.omega <= model.omega[-1] * (1 + 1e-9))
    if not inside.any():
        raise ValueError("bla must have lines inside the band of the model, got none")
    if np.isnan(model.confidence):
        raise ValueError("model must state a confidence to be validated against, got none")
    p = model.confidence ** (1 / model.omega.size) if model.simultaneous else model.confidence
    n = int(inside.sum())
    if not model.measured_only:
        bla = behind_hold(bla, timebase(model.nominal))
    omega = bla.omega[inside]
    distance = model.distance(control.FrequencyResponseData(bla.G[inside], omega))
    outside = distance > 1
    n_outside = int(outside.sum())
    return Validation(
        n_outside=n_outside,
        n_expected=(1 - p) * n,
        p_value=float(binom.sf(n_outside - 1, n, 1 - p)),
        omega_outside=omega[outside],
        n_lines=n,
        omega=omega,
        distance=distance,
    )
