"""A radius of the user's own: as arrays, or as the distance of a list of plants from the nominal."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import real_array
from nlfrf.shared.wording import counted, shown
from robust.modelling.design_warning import suspected
from robust.modelling.weights import fit_weight
from robust.systems.realisation import frequency_response
from robust.uncertain.forms import Form
from robust.uncertain.radius import extrapolated, nominal_response, slope, spread_over, worded

__all__ = ["own_radius", "with_weight"]

#: Smallest radius over the largest: a plant that is the nominal on a line leaves none, and a set needs one.
LEAST = 1e-6


def own_radius(given: Any, nominal: Any, form: Form) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Frequencies [rad/s], radius in the unit of the form, and its source in words; None where Blas were given.

    Two arrays are frequencies and radius as they are; FRFs or systems are plants that the set has to hold.
    """
    many = list(given) if isinstance(given, (list, tuple)) else [given]
    if many and all(isinstance(b, Bla) for b in many):
        return None
    if not any(is_plant(part) or isinstance(part, np.ndarray) for part in many):
        raise ValueError(f"bla must be an nlfrf.Bla, a list of them, or a radius of your own, got {shown(given)}")
    if form.scaled:
        raise ValueError(f"form must not depend on units where the radius is your own, got {form.name}")
    if isinstance(given, tuple) and len(many) == 2 and not any(is_plant(part) for part in many):
        omega, radius = real_array("omega", many[0], ndim=1), real_array("radius", many[1], ndim=1)
        if omega.shape != radius.shape or not np.all(radius > 0) or not np.all(np.diff(omega, prepend=0.0) > 0):
            raise ValueError("radius must be positive, one for each omega, and these positive and increasing")
        return omega, radius, "a radius that was given"
    if not all(is_plant(part) for part in many):
        raise ValueError("bla must be all plants (FRFs or systems), or (omega, radius), where the radius is your own")
    lines = plant_lines(many, nominal)
    each, differs = [], False
    for plant in many:
        omega, G = frequency_response("bla", plant, lines)
        centre = nominal_response(nominal, omega)
        differs |= bool(np.any(np.abs(G - centre) > 1e-12 * np.abs(centre)))
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(form.deviation(G, centre))
        if not np.isfinite(away).all():
            raise ValueError(
                f"bla must leave the radius finite, got a plant or nominal that vanishes: {form.name} form"
            )
        each.append(spread_over(lines, omega, away))
    radius = np.nanmax(each, axis=0)
    if not differs:
        raise ValueError("bla must hold a plant beside the nominal, got none that differs")
    return lines, np.maximum(radius, LEAST * radius.max()), f"{counted(len(many), 'plant')} that were given"


def is_plant(part: Any) -> bool:
    """Whether it is an FRF or a system."""
    return isinstance(part, (control.FrequencyResponseData, control.StateSpace, control.TransferFunction))


def plant_lines(many: list[Any], nominal: Any) -> np.ndarray:
    """All frequencies [rad/s] of the FRFs among the plants, or of the nominal where it is one."""
    known = [plant for plant in [*many, nominal] if isinstance(plant, control.FrequencyResponseData)]
    if not known:
        raise ValueError("bla must hold an FRF, to say at which frequencies: control.frd(plant, omega)")
    return np.unique(np.concatenate([np.asarray(plant.omega, dtype=float) for plant in known]))


def with_weight(
    given: tuple[np.ndarray, np.ndarray, str],
    rules: tuple[Any, Any],
    order: int,
    dt: float,
    simultaneous: bool,
    systematic: float | None,
) -> dict[str, Any]:
    """The fields of a set with such a radius, its weight fitted; no confidence is claimed."""
    if simultaneous or systematic is not None:
        raise ValueError("simultaneous and systematic must be left out where the radius is your own: they are of a Bla")
    omega, radius, source = given
    below, above = slope("below", rules[0]), slope("above", rules[1])
    weight = fit_weight(*extrapolated(omega, radius, below, above, dt), order=order, dt=dt).W
    words = f"below the band {worded(below)}, above it {worded(above)}"
    covered = suspected(weight, omega, radius)
    return {"omega": omega, "radius": radius, "weight": covered, "extrapolation": words, "source": source}
