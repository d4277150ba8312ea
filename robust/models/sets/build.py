"""The set of plants around a nominal, from one record or several, with any number of channels.

radius = misfit of the nominal + sqrt(F_p (variance of G + variance of one realisation + even
level)) on each line, then a stable minimum-phase weight over it (SP 7.4, 8.2.3). The misfit
excludes the scatter, which is counted separately.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import TypedDict

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    as_list,
    data_warning,
    format_hertz,
    keep_warnings,
    require_choice,
    require_integer,
    require_probability,
    require_real,
    short_form,
)
from nlfrf._base.values import value
from robust._base.types import AnySystem, Weight
from robust._base.warnings import DesignWarning
from robust.lti.realisation import multivariable
from robust.models.fit.class_error import mean_size, smooth_size, target_loop
from robust.models.fit.doubts import checked_weight
from robust.models.fit.measurement import (
    matrices_given,
    require_same_channels,
)
from robust.models.fit.nominal import bla_of_fitted
from robust.models.fit.nominal_fit import (
    GivenNominal,
    NominalFit,
    given_nominal,
    sampling_time_of,
    single_nominal,
)
from robust.models.fit.weights import larger_of_neighbours
from robust.models.sets.centre import centre_of
from robust.models.sets.family import DIAGONAL
from robust.models.sets.family_members import is_plant
from robust.models.sets.forms import ADDITIVE, AUTO, DEFAULT_FORM, ELEMENTS, FORMS, RECORD_FORMS
from robust.models.sets.joint import attach_records
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.orders import scan_orders
from robust.models.sets.plants import uncertainty_of_plants
from robust.models.sets.radius import (
    Extrapolation,
    RadiusSpec,
    Scaling,
    block_radius,
    checked_slope,
    disc_parts,
    element_parts,
    fit_covering_weight,
    fit_extrapolated,
    nominal_response,
    radius_in_form,
    resolve_scaling,
    sum_of_parts,
)
from robust.models.sets.records import Origin, RecordHold


@keep_warnings
def uncertainty(
    bla: Bla | Sequence[Bla] | control.FrequencyResponseData | Sequence[AnySystem],
    nominal: NominalFit | AnySystem | float | None = None,
    *,
    form: str | None = None,
    order: int | None = None,
    confidence: float | None = None,
    simultaneous: bool = False,
    even: bool | None = None,
    systematic: float | None = None,
    below: str | float = "flat",
    above: str | float = 20.0,
    perturbation: str = "statistical",
    W1: Weight | None = None,
    W2: Weight | None = None,
    weights: str = DIAGONAL,
    omega_B: float | None = None,
) -> UncertaintyModel:
    """Make an uncertainty set around a nominal model from a measured BLA and its bound.

    On each line (frequency) a disc around the nominal contains the FRF of a new realisation (random
    draw of the phases of the excitation) with the stated confidence. Its radius is the misfit of
    the nominal + sqrt(F_p (variance of G + variance of one realisation + variance of the even
    distortion)), with the F quantile F_p. The squared misfit is |measured FRF - nominal|^2 minus
    the variance.

    Use this after `nlfrf.identify` and `fit_nominal`, before any design. A list of plants that the
    set has to contain is passed to `uncertainty_of_plants`. For a radius of your own use
    `UncertaintyModel.from_radius`.

    Parameters
    ----------
    bla : nlfrf.Bla or list of them, control.FrequencyResponseData, or list of plants
        The measurement, with one or several channels. A list of measurements at several levels or
        offsets or on several days gives one set, with the largest radius of all.
        `nlfrf.bla_from_frf` and `robust.io.bla_from_frd` make a Bla from an FRF of another program.
        A FrequencyResponseData itself is taken with the fit that was made of it with `std`. The
        radius then covers the misfit and what this deviation contains: another FRF measured in the
        same way, without the errors that repeat in every average.
    nominal : NominalFit, control system or control.FrequencyResponseData
        Nominal model, continuous or discrete. With an FRF as nominal the set is known on its lines
        only. For several channels it may be left out: the default is the fit of `scan_orders`.
    form : str, optional
        "multiplicative" (default), "additive", "inverse-multiplicative", "inverse-additive" or
        "coprime". For several channels: "elements" (default), "additive" or "input"; or "auto",
        which makes the sets "elements" and "additive", of which `check` may use the better one,
        each at the confidence (1 + p)/2 for a `confidence` p. Choose the form before you see a
        verdict, because trying several forms is a multiple test.
    order : int, optional
        Order of each weight. By default it is raised, up to 12, as long as one more state lowers
        the mean of |weight|/radius by 0.1 dB.
    confidence : float
        Probability on each line, or on all lines together if `simultaneous` is True; 0.95 by
        default.
    simultaneous : bool
        True: the confidence holds for all lines together, and the radius is larger by a factor of
        1.8 to 2.1 (see the guide on bounds). False: it holds on each line; the field `joint` is the
        probability for a whole FRF.
    even : bool
        Add the variance of the even distortion (the default): signals in closed loop are not odd
        multisines.
    systematic : float, optional
        Systematic part of the radius (difference between the BLA and the FRF of the machine without
        its nonlinearity), in decibels above the odd distortion level: 8 for a static cubic, more
        for friction near a resonance. None for no such part. For one channel, or for the form
        "elements".
    below, above : "flat" or float
        Assumption about the radius below and above the measured band. "flat": it is constant. A
        number: it rises away from the band by this many dB per decade over two decades, and is
        constant beyond.
    perturbation : str
        Class of Delta, as in `UncertaintyModel`. With "LTI" or "operator" you claim that the plant
        is in the set.
    W1, W2 : control.StateSpace, TransferFunction or float, optional
        Shaping functions of the plant, W2 G W1, for the coprime form, as in `ncfsyn`. By default
        constants that give W2 G W1 a gain of one in the middle of the band.
    weights, omega_B
        Options of `uncertainty_of_plants`, for a list of plants with several channels only.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        A form or class that does not exist, an inverse form if the radius reaches |G|, or an order
        that is too low.

    References
    ----------
    SP 7.4 and 8.2.3; Pintelon & Schoukens, 2nd ed., 4.3.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> model = uncertainty(nlfrf.identify(record), control.tf([2.3], [1]), order=0, above="flat")
    >>> model.form, model.perturbation, bool(np.all(model.radius < 0.35))
    ('multiplicative', 'statistical', True)
    """
    if isinstance(bla, list | tuple) and bla and all(map(is_plant, bla)):
        _require_none_of_records(
            {
                "confidence": confidence,
                "simultaneous": simultaneous or None,
                "even": even,
                "systematic": systematic,
                "W1": W1,
                "W2": W2,
            }
        )
        return uncertainty_of_plants(
            bla,
            nominal,
            form=form,
            weights=weights,
            omega_B=omega_B,
            order=order,
            below=below,
            above=above,
            perturbation=perturbation,
        )
    if weights != DIAGONAL or omega_B is not None:
        raise ValueError("weights and omega_B must be left out with a measured Bla")
    if isinstance(bla, control.FrequencyResponseData) and isinstance(nominal, NominalFit):
        bla = bla_of_fitted(bla, nominal) or bla
    recorded = _require_records(bla)
    single = recorded[0].is_single
    form = _checked_form(form, single)
    known = _nominal_or_fit(nominal, recorded, single)
    given = given_nominal(known)
    request = _SetRequest(
        nominal=_plant_of_records(given, recorded[0]),
        delay=given.delay,
        omega_c=given.omega_c,
        form=form,
        make=_disc_set if single else _block_set,
        order=None if order is None else require_integer("order", order, least=0),
        rules=Extrapolation(
            below=checked_slope("below", below), above=checked_slope("above", above)
        ),
        spec=RadiusSpec(
            p=require_probability("confidence", 0.95 if confidence is None else confidence),
            simultaneous=bool(simultaneous),
            even=even is None or even,
            systematic=None if systematic is None else require_real("systematic", systematic),
        ),
        perturbation=perturbation,
        scaling=(W1, W2),
    )
    if form == AUTO:
        return _better_of_two_forms(request, recorded)
    return _set_in_form(request, recorded)


@value
class _SetRequest:
    """Nominal and assumptions of a set around records, the same in every form."""

    nominal: control.StateSpace | control.FrequencyResponseData  # delays inside
    delay: float  # the longest delay inside the nominal [s]
    omega_c: float  # crossover that the nominal was fitted for [rad/s]; nan if none was named
    form: str
    # `_disc_set` or `_block_set`: radius and weights for one channel or for several
    make: Callable[[_SetRequest, list[Bla]], tuple[_SetFields, Extrapolation]]
    order: int | None
    rules: Extrapolation
    spec: RadiusSpec
    perturbation: str
    scaling: Scaling

    @property
    def dt(self) -> float:
        """Return the sampling time [s] of the nominal."""
        return sampling_time_of(self.nominal)


def _checked_form(form: str | None, single: bool) -> str:
    """Return the form of a set around records; refuse one that is not for so many channels."""
    if form is None:
        form = DEFAULT_FORM if single else ELEMENTS
    require_choice("form", form, tuple(FORMS) if single else (*RECORD_FORMS, AUTO))
    return form


def _nominal_or_fit(
    nominal: NominalFit | AnySystem | float | None, recorded: list[Bla], single: bool
) -> NominalFit | AnySystem | float:
    """Return the given nominal, for several channels without one the fit of `scan_orders`."""
    if nominal is not None:
        return nominal
    if single:
        raise ValueError("nominal must be given for one channel: see fit_nominal, got none")
    return scan_orders(recorded).fit


def _better_of_two_forms(request: _SetRequest, recorded: list[Bla]) -> UncertaintyModel:
    """Return the set "elements" with the set "additive" as its alternative."""
    # two tests share the probability of an error
    spec = replace(request.spec, p=(1 + request.spec.p) / 2)
    elements, additive = (
        _set_in_form(replace(request, form=one, spec=spec), recorded)
        for one in (ELEMENTS, ADDITIVE)
    )
    return replace(elements, alternative_form=additive)


def _set_in_form(request: _SetRequest, recorded: list[Bla]) -> UncertaintyModel:
    """Return the set in the form of the request, with its records."""
    # a model without a hold and a record behind one differ by the hold, which is no misfit
    blas = [centre_of(request.nominal).behind_hold(bla) for bla in recorded]
    first = blas[0]
    made, rules = request.make(request, blas)
    model = UncertaintyModel(
        nominal=request.nominal,
        form=request.form,
        perturbation=request.perturbation,
        **made,
        confidence=request.spec.p,
        simultaneous=request.spec.simultaneous,
        inputs=first.inputs,
        outputs=first.outputs,
        origin=Origin(
            source="; ".join(map(_describe_record, blas)),
            extrapolation=str(rules),
            delay=request.delay,
            omega_c=request.omega_c,
            hold=RecordHold(
                kind=first.hold if len({bla.hold for bla in blas}) == 1 else "unknown",
                fs=min(bla.fs for bla in blas),
            ),
            unit=first.unit,
        ),
    )
    _warn_of_radius(model)
    return attach_records(model, blas, recorded)


#: Exponent of |T_c| times the radius in the importance of a line; a large one lets the largest
#: value alone decide. On 36 loops of the friction rig 1 to 4 give the same verdicts.
_NEAR_LARGEST = 4.0
#: Remedy for each part of a radius.
_CURES = {
    "noise": "average more periods or sweeps",
    "odd": "measure at another level, or use more realisations",
    "even": "look for an offset or an asymmetry",
    "misfit": (
        "the nominal does not fit there; name the crossover (omega_c, --bandwidth), or compare"
        " orders"
    ),
    "level": "narrow the range of levels",
    "systematic": "measure at a second level",
}


def _warn_of_radius(model: UncertaintyModel) -> None:
    """Warn if the relative radius reaches one below the crossover of the nominal fit."""
    relative, crossover = model.relative_radius(), model.origin.omega_c
    over = (model.omega <= crossover) & (relative >= 1)
    if not over.any():
        return
    k = int(np.argmax(np.where(over, relative, -1.0)))
    shares = model.radius_shares(k)
    data_warning(
        f"the radius of the set reaches {relative[k]:.3g} of |G| below the crossover of"
        f" {format_hertz(crossover)}, at {format_hertz(model.omega[k])}: no loop with that"
        f" bandwidth is robust. Its largest part is {shares[0][1]}, {100 * shares[0][0]:.0f} %:"
        f" {_CURES[shares[0][1]]}",
        DesignWarning,
    )


class _SetFields(TypedDict, total=False):
    """Radius and weights of a set, by the names of its fields."""

    omega: np.ndarray
    radius: np.ndarray
    budget: Mapping[str, np.ndarray]
    weight: control.StateSpace
    left: tuple[control.StateSpace, ...]
    right: tuple[control.StateSpace, ...]
    scaling: tuple[Weight | None, ...]


def _disc_set(request: _SetRequest, blas: list[Bla]) -> tuple[_SetFields, Extrapolation]:
    """Return radius, parts and weight of a set for one channel, in the unit of its form, and the
    rule outside the band.
    """
    row, nominal, dt = FORMS[request.form], request.nominal, request.dt
    omega, parts, _ = disc_parts(blas, [nominal] * len(blas), request.spec)
    if dt:
        inside = omega * dt < np.pi * (1 - 1e-9)
        omega, parts = omega[inside], {name: part[inside] for name, part in parts.items()}
    absolute = sum_of_parts(parts)
    W1, W2, rules = resolve_scaling(
        row, nominal, omega=omega, shaped_by=request.scaling, rules=request.rules
    )
    factor, *covered = radius_in_form(
        row, omega, absolute=absolute, nominal=nominal, shaped_by=(W1, W2), rules=rules, dt=dt
    )
    importance = np.ones(covered[0].size)
    if not np.isnan(request.omega_c):
        # proportional to rs of the loop: an excess costs margin where rs is largest
        size = np.abs(nominal_response(nominal, omega))
        in_loop = target_loop(omega, request.omega_c, smooth_size(omega, size)) / (size * factor)
        reached = np.interp(covered[0], omega, in_loop) * larger_of_neighbours(covered[1])
        importance = (reached / reached.max()) ** _NEAR_LARGEST
    importance = importance * (covered[0] <= omega[-1])  # an excess above the band costs nothing
    weight = fit_extrapolated(covered, rules, order=request.order, dt=dt, importance=importance)
    return {
        "weight": checked_weight(weight, omega, absolute * factor, order=request.order),
        "omega": omega,
        "radius": absolute * factor,
        "budget": {name: part * factor for name, part in parts.items() if np.isfinite(part).any()},
        "scaling": _given_scaling(W1, W2),
    }, rules


def _block_set(request: _SetRequest, blas: list[Bla]) -> tuple[_SetFields, Extrapolation]:
    """Return radii and weights of a set for several channels, and the rule outside the band, which
    applies to W_l only.
    """
    nominal, spec, rules = request.nominal, request.spec, request.rules
    models, n = [nominal_response(nominal, bla.omega) for bla in blas], 0
    if request.form == ELEMENTS:
        omega, parts, radius = element_parts(blas, models, spec)
        budget = {name: part for name, part in parts.items() if np.isfinite(part).any()}
    else:
        if spec.systematic is not None:
            raise ValueError(
                f'systematic must be left out unless form is "elements", got {spec.systematic:g}'
                f" with {request.form}"
            )
        omega, radius = block_radius(blas, models, spec=spec, form=request.form)
        n, budget = nominal.noutputs if request.form == ADDITIVE else nominal.ninputs, {}
    G = nominal_response(nominal, omega).reshape(nominal.noutputs, nominal.ninputs, -1)
    importance = target_loop(omega, request.omega_c, mean_size(omega, G))
    # W_r of a block is flat outside the band: both sides rising would count the rise twice
    each = [rules] * (n or len(radius)) + [Extrapolation()] * (len(radius) - n if n else 0)
    weights = tuple(
        fit_covering_weight(
            omega, row, order=request.order, rules=rule, dt=request.dt, importance=importance
        )
        for row, rule in zip(radius, each, strict=True)
    )
    return {
        "omega": omega,
        "radius": radius,
        "budget": budget,
        "left": weights[:n],
        "right": weights[n:],
        "scaling": _given_scaling(*request.scaling),
    }, rules


def _given_scaling(*scaling: Weight | None) -> tuple[Weight | None, ...]:
    """Return W1 and W2, or nothing if neither is given."""
    if any(W is not None for W in scaling):
        return scaling
    return ()


def _require_none_of_records(given: Mapping[str, object]) -> None:
    """Refuse options of a measurement given with plants, which have no statistics."""
    for name, option in given.items():
        if option is not None:
            raise ValueError(
                f"{name} must be left out with plants: it belongs to a measured Bla, got"
                f" {short_form(option)}"
            )


def _require_records(bla: object) -> list[Bla]:
    """Return one Bla or several as a list, with the same channels and units."""
    given = as_list(bla)
    blas = [one for one in given if isinstance(one, Bla)]
    if not blas or len(blas) < len(given):
        raise ValueError(
            f"bla must be an nlfrf.Bla or a list of them, got {short_form(bla)}; for an FRF use"
            " nlfrf.bla_from_frf first, or give its std to fit_nominal, for plants"
            " uncertainty_of_plants(plants, nominal), for a radius of your own"
            " UncertaintyModel.from_radius(nominal, omega, radius), for weights of your own"
            " UncertaintyModel(...)"
        )
    matrices_given(blas)  # in the same units, and of the same channels
    return blas


def _plant_of_records(
    nominal: GivenNominal, bla: Bla
) -> control.StateSpace | control.FrequencyResponseData:
    """Return the nominal as the channels of the record need it."""
    if bla.is_single:
        return single_nominal(nominal.plant)[0]
    require_same_channels(bla, nominal, "its nominal")
    system = multivariable("nominal", nominal.plant)
    if (system.noutputs, system.ninputs) != (bla.n_outputs, bla.n_inputs):
        raise ValueError(
            f"nominal must have {bla.n_outputs} outputs and {bla.n_inputs} inputs, as the record, "
            f"got {system.noutputs} and {system.ninputs}"
        )
    return system


def _describe_record(bla: Bla) -> str:
    lines = f"{bla.f.size} lines {bla.f[0]:g} to {bla.f[-1]:g} Hz"
    made = bla.experiment
    what, design, drawn = "an FRF", "", f"{made.n_realizations} realisations"
    if not bla.is_single:
        what, design = "a matrix of FRFs", f"{made.design} "
        drawn = f"{made.n_realizations} sets of {bla.n_inputs} experiments"
    if made.grid == "given":
        return f"{what} that was given, {lines}, variance from its {bla.level_source}"
    return (
        f"{design}{made.grid} multisine, {lines}, {drawn} x {made.n_periods} periods, level from"
        f" {bla.level_source}"
    )
