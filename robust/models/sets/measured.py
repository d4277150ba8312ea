"""A plant that is known on measured lines only, in the form that a controller needs."""

from __future__ import annotations

from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import data_warning, short_form
from robust._base.warnings import DesignWarning
from robust.lti.lti import response, timebase
from robust.lti.sampling import hold_correction, hold_response
from robust.models.fit.measurement import frd
from robust.models.sets.forms import DEFAULT_FORM
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import RadiusSpec, record_radius_parts, sum_of_parts
from robust.models.sets.records import Origin

#: Any object with an FRF on its lines.
FrfSource: TypeAlias = UncertaintyModel | Bla | control.FrequencyResponseData
# largest rate of the record over that of the controller at which the holds may be the same
_RATE_RATIO = 1.5


def origin_of(model: FrfSource) -> Bla | Origin | control.FrequencyResponseData:
    """Return the object with hold, sampling frequency and unit: a Bla itself, the origin of a set,
    an FRF (without).
    """
    if isinstance(model, UncertaintyModel):
        return model.origin
    return model


def frf_sampling_time(model: FrfSource) -> float:
    """Return the sampling time [s] of a sampled FRF; 0 otherwise."""
    source = model.nominal if isinstance(model, UncertaintyModel) else model
    return float(getattr(source, "dt", 0) or 0)


def hold_and_delay_factor(
    model: FrfSource, omega: np.ndarray, *, dt: float, delay: float
) -> np.ndarray:
    """Return (W,) the factor that an FRF lacks: the delay, and a zero-order hold if only the
    controller is sampled.

    Aliasing from above Nyquist is unknown and left out.
    """
    factor, origin = np.exp(-1j * omega * delay), origin_of(model)
    if getattr(origin, "hold", "unknown") != "unknown":
        return np.asarray(factor * hold_correction(omega, origin.hold, fs=origin.fs, dt=dt))
    if dt and not frf_sampling_time(model):
        warn_of_unknown_hold(model, dt)
        return np.asarray(factor * hold_response(omega, dt))
    return factor


def warn_of_unknown_hold(model: FrfSource, dt: float) -> None:
    """Warn if the record may contain the hold of the controller, which is then counted twice."""
    sampled = (
        isinstance(model, UncertaintyModel) and not model.measured_only and timebase(model.nominal)
    )
    if sampled or getattr(origin_of(model), "hold", "known") != "unknown":
        return
    fs = origin_of(model).fs
    if dt * fs < _RATE_RATIO:
        data_warning(
            f"hold of the record (sampled at {fs:g} Hz) is unknown: the check adds the hold of"
            f" the controller at {1 / dt:g} Hz, but if u was the command of a converter, the"
            " record already contains a hold, which is then counted twice. Load the record with"
            ' hold="zoh" (u is the command) or hold="band-limited" (u was measured after the'
            " hold)",
            DesignWarning,
        )


def parts_on_lines(
    model: FrfSource,
) -> tuple[np.ndarray, np.ndarray, str, np.ndarray, str, np.ndarray]:
    """Return frequencies, plant, form, weight (nan: none), class and scaling of an FRF, a Bla or a
    set.
    """
    if isinstance(model, Bla):
        disc = sum_of_parts(record_radius_parts(model, frd(model), RadiusSpec()))
        return (
            model.omega,
            model.G,
            DEFAULT_FORM,
            disc / np.abs(model.G) + 0j,
            "statistical",
            np.ones(disc.size),
        )
    if isinstance(model, control.FrequencyResponseData):
        if (model.ninputs, model.noutputs) != (1, 1):
            raise ValueError(f"model must have one input and one output, got {short_form(model)}")
        omega = np.asarray(model.omega, dtype=float)
        return (
            omega,
            np.asarray(model.frdata[0, 0]),
            DEFAULT_FORM,
            np.full(omega.size, np.nan + 0j),
            "LTI",
            np.ones(omega.size),
        )
    weight, scaling = response(model.weight, model.omega), response(model.shaping, model.omega)
    return model.omega, model.at(model.omega), model.form, weight, model.perturbation, scaling
