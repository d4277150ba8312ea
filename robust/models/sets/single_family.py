"""Sets for one channel that contain given plants: FRFs on their lines, systems at all frequencies.

The radius is the largest deviation of a plant on the lines, and a weight is fitted over it. Between
the lines exact polynomials decide whether a system is inside the set. A frequency at which it is
outside is added to the fit of the weight. If that does not suffice after a few rounds, the whole
weight is raised.
"""

from __future__ import annotations

from collections.abc import Sequence

import control
import numpy as np

from nlfrf._base.arguments import format_count, require_choice
from robust._base.types import AnySystem
from robust.lti.lti import response
from robust.lti.realisation import frequency_response, state_space
from robust.models.fit.doubts import checked_weight
from robust.models.fit.nominal_fit import NominalFit, sampling_time_of, single_nominal
from robust.models.sets.family import CLOSE_LIFT, LIFT, MAX_LIFT, MAX_ROUNDS, TOLERANCE
from robust.models.sets.forms import DEFAULT_FORM, FORMS, Form
from robust.models.sets.membership import require_equal_roots
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import (
    MIN_RADIUS_RATIO,
    Extrapolation,
    fit_extrapolated,
    larger_neighbour,
    nominal_response,
)
from robust.models.sets.records import Origin


def make_set_of_plants(
    plants: Sequence[AnySystem],
    nominal: NominalFit | AnySystem | float | None,
    *,
    form: str | None,
    order: int | None,
    rules: Extrapolation,
    perturbation: str,
) -> UncertaintyModel:
    """Return a set for one channel around a nominal that contains every plant."""
    if nominal is None:
        raise ValueError("nominal must be given for plants with one channel: see fit_nominal")
    form = require_choice("form", DEFAULT_FORM if form is None else form, tuple(FORMS))
    row = FORMS[form]
    if row.depends_on_units:
        raise ValueError(
            f"form must not depend on the units of u and y for a list of plants, got {form}"
        )
    centre, delay = single_nominal(nominal)
    dt, is_frf = sampling_time_of(centre), isinstance(centre, control.FrequencyResponseData)
    omega, radius = _radius_of_plants(plants, centre, row)
    source = f"{format_count(len(plants), 'plant')} that were given"
    kinds = (control.StateSpace, control.TransferFunction)
    if is_frf:
        systems = []
    else:
        systems = [state_space("plants", plant) for plant in plants if isinstance(plant, kinds)]
    if systems:
        require_equal_roots(form, [centre, *systems], inverse=row.inverse)
        source += ", systems inside at all frequencies, FRFs on their lines"
    covered = rules.extrapolate(omega, radius, dt)
    for round_ in range(MAX_ROUNDS):
        weight = fit_extrapolated(
            covered, rules, order=order, dt=dt, importance=1.0 * (covered[0] <= omega[-1])
        )
        model = UncertaintyModel(
            nominal=centre, weight=weight, form=form, omega=omega, radius=radius
        )
        bounds = [model.deviations(plant)[0].bound(omega[0], TOLERANCE) for plant in systems]
        lift = max([1.0, *(one.upper * LIFT for one in bounds)])
        if lift < CLOSE_LIFT or round_ == MAX_ROUNDS - 1:
            break
        for plant, one in zip(systems, bounds, strict=True):
            covered = _cover_plant(covered, plant, centre, row, one.omega)
    if not lift < MAX_LIFT:
        raise ValueError(
            f"plants must be ones that a stable proper weight can cover, got one {lift:.3g} times"
            f" as far from the nominal as the weight reaches, {form} form: give this plant as an"
            " FRF, or choose another form or order"
        )
    weight = control.StateSpace(weight.A, weight.B, weight.C * lift, weight.D * lift, weight.dt)
    return UncertaintyModel(
        nominal=centre,
        weight=checked_weight(weight, omega, radius, order=order),
        form=form,
        omega=omega,
        radius=radius,
        perturbation=perturbation,
        origin=Origin(source=source, extrapolation=str(rules), delay=delay),
    )


def _radius_of_plants(
    plants: Sequence[AnySystem],
    nominal: control.StateSpace | control.FrequencyResponseData,
    form: Form,
) -> tuple[np.ndarray, np.ndarray]:
    """Return lines [rad/s] and the largest deviation of a plant, in the unit of the form."""
    lines = _lines_of_frfs(plants, nominal)
    each, differs = [], False
    for plant in plants:
        omega, G = frequency_response("plants", plant, lines, (nominal, *plants))
        centre = nominal_response(nominal, omega)
        differs |= bool(np.any(np.abs(G - centre) > 1e-12 * np.abs(centre)))
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(form.deviation(G, centre))
        if not np.isfinite(away).all():
            raise ValueError(
                "plants must leave the radius finite, got a plant or nominal that vanishes:"
                f" {form.name} form"
            )
        each.append(larger_neighbour(lines, omega, away))
    if not differs:
        raise ValueError("plants must hold one other than the nominal, got none that differs")
    radius = np.nanmax(each, axis=0)
    return lines, np.maximum(radius, MIN_RADIUS_RATIO * radius.max())


def _lines_of_frfs(
    plants: Sequence[AnySystem], nominal: control.StateSpace | control.FrequencyResponseData
) -> np.ndarray:
    """Return all frequencies [rad/s] of the FRFs among the plants and the nominal."""
    known = [
        plant for plant in [*plants, nominal] if isinstance(plant, control.FrequencyResponseData)
    ]
    if not known:
        raise ValueError(
            "plants must contain an FRF, because plants and nominal are compared on its lines: "
            "uncertainty_of_plants([control.frd(plant, omega)], nominal). For a known weight use "
            "UncertaintyModel(nominal, weight, form, omega, radius)"
        )
    return np.unique(np.concatenate([np.asarray(plant.omega, dtype=float) for plant in known]))


def _cover_plant(
    covered: tuple[np.ndarray, np.ndarray],
    plant: control.StateSpace,
    nominal: control.StateSpace,
    form: Form,
    more: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and radii for a weight to cover, with one more at which the deviation of a
    system is added.
    """
    lines, radius = covered
    omega = np.union1d(lines, [more] * (more > 0))
    away = np.abs(form.deviation(response(plant, omega), response(nominal, omega)))
    return omega, np.maximum(
        np.exp(np.interp(np.log(omega), np.log(lines), np.log(radius))), np.nan_to_num(away)
    )
