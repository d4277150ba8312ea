"""Sets of plants around a nominal, from records of any number of channels or from a radius of the user.

radius = misfit of the nominal + sqrt(F_p (variance of G + variance of one realisation + even level)) on each line, then
a stable minimum-phase weight over it (SP 7.4, 8.2.3). The misfit excludes the scatter, which is counted by itself.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import TypedDict

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    data_warning,
    format_count,
    format_hertz,
    keep_warnings,
    require_choice,
    require_integer,
    require_probability,
    require_real,
    require_real_array,
    short_form,
)
from robust._base.channels import is_single
from robust._base.types import AnySystem, Weight
from robust._base.warnings import DesignWarning
from robust.lti.connections import block_diagonal, in_series
from robust.lti.lti import response, timebase
from robust.lti.realisation import frequency_response, multivariable, state_space
from robust.lti.sampling import delayed
from robust.models.fit.class_error import mean_size, smooth_size, target_loop
from robust.models.fit.nominal import (
    NominalFit,
    bla_behind_hold,
    bla_of_fit,
    checked_weight,
    matrices_given,
    require_same_channels,
    require_same_units,
)
from robust.models.fit.weights import larger_of_neighbours
from robust.models.sets.family import (
    CLOSE_LIFT,
    DIAGONAL,
    FAMILY_ORDER,
    LIFT,
    MAX_LIFT,
    MAX_ROUNDS,
    TOLERANCE,
    find_family,
    is_full,
    is_plant,
    make_family_set,
)
from robust.models.sets.forms import ADDITIVE, AUTO, DEFAULT_FORM, ELEMENTS, FORMS, RECORD_FORMS, Form
from robust.models.sets.joint import attach_records
from robust.models.sets.membership import require_equal_roots
from robust.models.sets.model import UncertaintyModel, count_channels, format_channels, own_weights_call
from robust.models.sets.orders import scan_orders
from robust.models.sets.radius import (
    MIN_RADIUS_RATIO,
    Extrapolation,
    RadiusSpec,
    Scaling,
    block_radius,
    checked_slope,
    disc_parts,
    element_parts,
    fit_covering_weight,
    fit_extrapolated,
    larger_neighbour,
    nominal_response,
    radius_in_form,
    resolve_scaling,
    sum_of_parts,
)
from robust.models.sets.records import Origin

_PADE_ORDER, _PADE_ORDER_PER_INPUT = 4, 2  # of the delay in the nominal: each input of several has its own


@keep_warnings
def uncertainty(
    bla: Bla | AnySystem | Sequence[Bla | AnySystem | np.ndarray],
    nominal: NominalFit | AnySystem | float | None = None,
    *,
    form: str = DEFAULT_FORM,
    weights: str = DIAGONAL,
    omega_B: float | None = None,
    order: int | None = None,
    confidence: float = 0.95,
    simultaneous: bool = False,
    even: bool = True,
    systematic: float | None = None,
    below: str | float = "flat",
    above: str | float = 20.0,
    perturbation: str = "statistical",
    W1: Weight | None = None,
    W2: Weight | None = None,
) -> UncertaintyModel:
    """Turn a measured BLA with its levels into a set of plants around a nominal model.

    On each line the disc about the nominal holds the FRF of a new realisation with the stated confidence: radius =
    misfit of the nominal + sqrt(F_p (variance of G + variance of one realisation + even level)). The raw residual
    of a line contains scatter already, so the misfit is what is left of it after the variance is taken off. For a
    fitted nominal this errs on the wide side: the fit averages the variance of G that is counted here.

    Parameters
    ----------
    bla : nlfrf.Bla or list of them
        What was measured, of one or several channels; several levels, offsets or days make a plant family, with the
        largest radius of all. An FRF from elsewhere is a Bla by `nlfrf.bla_from_frf`, or by the `std` that
        `fit_nominal` was given with it. Or a list of plants (FRFs, systems) that the set has to hold. Or, of one
        channel, a radius of your own: arrays (omega, radius), in rad/s and the unit of the form.
    nominal : NominalFit, control system or control.FrequencyResponseData, optional
        The model in the middle, continuous or discrete. An FRF gives a model that is known on its lines only. Of a list
        of plants of several channels it may be left out: a fit of their mean response. Of records of several channels
        too: the fit that `scan_orders` takes.
    form : str
        "multiplicative", "additive", "inverse-multiplicative", "inverse-additive" or "coprime". Of several
        channels "elements" (when not given), "additive" or "input", chosen before looking; or "auto": the first two, at
        a price of 10 %. Of a list of plants of several channels also "output", "inverse-additive", "inverse-input" and
        "inverse-output"; when not given, the first form of `choose_form`.
    weights : str
        "diagonal": one weight a channel. "full", of a list of plants of several channels: W_l and W_r are matrices, and
        the set is smaller where deviations share a direction.
    omega_B : float, optional
        Bandwidth [rad/s] of the loop for which the form is chosen, of a list of plants of several channels; the middle
        of their band when not given.
    order : int, optional
        Order of the weight, or of each of them; when not given, it grows up to 12 as long as a state saves 0.1 dB of
        the mean excess, and is 4 of a family of plants of several channels.
    confidence : float
        Probability per line (or for all lines together when `simultaneous`).
    simultaneous : bool
        False: about one line in twenty of another record lies outside its disc at 95 %; `joint` tells of whole ones.
        True widens the radius by a factor of 1.8 to 2.1 and is seldom worth it (see the guide on bounds).
    even : bool
        Add the even distortion level: in closed loop the machine sees signals that are not odd.
    systematic : float, optional
        Decibels above the odd level added to the radius for the systematic part (8 in the paper); None leaves it out.
        Of one channel, or of "elements".
    below, above : "flat" or float
        What is assumed outside the measured band: the radius stays flat, or rises away from the band with that
        many dB per decade, over two decades, flat beyond.
    perturbation : str
        The class; "LTI" and "operator" are claims of the user about the plant.
    W1, W2 : control.StateSpace, TransferFunction or float, optional
        Scaling W2 G W1 of the plant for the coprime form, as for `ncfsyn`; when not given, unit gain in mid band.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        A form or class that does not exist, an inverse form where the radius reaches |G|, an order too low, plants
        that no set of the form holds.

    Notes
    -----
    A set of a list of plants of several channels has the least tr W_l W_l* + tr W_r* W_r at each frequency, before the
    fit. So scale inputs and outputs first (SP 1.4). Every plant lies inside: systems at all frequencies, zero and
    infinity included, which is proved by exact polynomials (`UncertaintyModel.contains`); FRFs on their lines. Where
    full weights of the order do not hold them, the weights are diagonal, with a warning.

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

    A set by weights of your own is an `UncertaintyModel`. A plant of two inputs and outputs, its inputs wrong by up to
    20 %, all at once and with any coupling (for a perturbation of each input by itself: `interconnection`):

    >>> from robust import UncertaintyModel, check
    >>> G = control.ss(-np.eye(2), np.eye(2), [[1.0, 0.3], [0.2, 1.0]], np.zeros((2, 2)))
    >>> model = UncertaintyModel(
    ...     G, form="input", left=(0.2, 0.2), right=(1, 1), omega=np.logspace(-2, 2), perturbation="LTI")
    >>> K = control.ss(np.zeros((2, 2)), np.eye(2), 2 * np.eye(2), 2 * np.eye(2))    # 2 (1 + 1/s) in both loops
    >>> report = check(model, K)
    >>> report.verdict, round(report.margins.rs, 2)                                  # 5 would be 100 %
    ('robust', 4.99)
    """
    bla = bla_of_fit(bla, nominal)
    require_same_units(bla)
    rules = Extrapolation(below=checked_slope("below", below), above=checked_slope("above", above))
    order = None if order is None else require_integer("order", order, least=0)
    if find_family(bla):
        if simultaneous or systematic is not None or W1 is not None or W2 is not None:
            raise ValueError("simultaneous, systematic, W1 and W2 must be left out where plants are given: of a Bla")
        return make_family_set(
            bla,
            nominal,
            form=form,
            weights=weights,
            order=FAMILY_ORDER if order is None else order,
            rules=rules,
            perturbation=perturbation,
            omega_B=omega_B,
        )
    if is_full(weights) or omega_B is not None:
        raise ValueError("weights and omega_B must be left out but for a family of plants of several channels")
    recorded: list[Bla] = matrices_given(bla)
    several = bool(recorded)
    if nominal is None and not several:
        raise ValueError("nominal must be given but for plants or records of several channels: see fit_nominal")
    if nominal is None:
        nominal = scan_orders(recorded).fit
    given = nominal.G if isinstance(nominal, NominalFit) else nominal
    if not several and count_channels(given) != (1, 1):
        raise ValueError(
            f"bla must be a measured Bla for a nominal of {format_channels(given)}, got {short_form(bla)}; a set by "
            f"weights of your own is {own_weights_call(given, form)}"
        )
    if several and form == DEFAULT_FORM:
        form = ELEMENTS
    if several and form == AUTO:  # the price of looking at both: what may go wrong is shared between them
        in_form = partial(
            uncertainty,
            bla,
            nominal,
            order=order,
            confidence=(1 + require_probability("confidence", confidence)) / 2,
            simultaneous=simultaneous,
            even=even,
            systematic=systematic,
            below=below,
            above=above,
            perturbation=perturbation,
        )
        return replace(in_form(form=ELEMENTS), alternative_form=in_form(form=ADDITIVE))
    require_choice("form", form, (*RECORD_FORMS, AUTO) if several else tuple(FORMS))
    spec = RadiusSpec(
        p=require_probability("confidence", confidence),
        simultaneous=bool(simultaneous),
        even=even,
        systematic=None if systematic is None else require_real("systematic", systematic),
    )
    omega_c = nominal.omega_c if isinstance(nominal, NominalFit) else float("nan")
    nominal, delay = _nominal_of_several_channels(nominal, recorded[0]) if several else _nominal_of_one_channel(nominal)
    dt = _sampling_time_of(nominal)
    make = partial(UncertaintyModel, nominal=nominal, form=form, perturbation=perturbation)
    if not several:
        if own := _set_of_user(bla, nominal, form=FORMS[form], rules=rules, dt=dt, order=order, spec=spec):
            return make(**own | {"origin": replace(own["origin"], delay=delay)})
        recorded = list(bla) if isinstance(bla, Sequence) else [bla]
    is_frf = isinstance(nominal, control.FrequencyResponseData)
    many = recorded if is_frf else [bla_behind_hold(one, dt) for one in recorded]
    made = (_block_set if several else _disc_set)(many, nominal, form, rules, order, spec, (W1, W2), omega_c)
    made["origin"] = replace(
        made["origin"],
        source="; ".join(map(_describe_record, many)),
        delay=delay,
        omega_c=omega_c,
        hold=many[0].hold if len({one.hold for one in many}) == 1 else "unknown",
        fs=min(one.fs for one in many),
        unit=many[0].unit,
    )
    model = make(
        **made,
        confidence=spec.p,
        simultaneous=spec.simultaneous,
        inputs=many[0].inputs,
        outputs=many[0].outputs,
    )
    _warn_of_radius(model)
    return attach_records(model, many, recorded)


#: Exponent of |T_c| times the radius in the importance of a line; a large one lets the largest value alone decide.
#: Of 36 loops of the friction rig 29 are robust with 4 and with 8, 26 with 1.
_NEAR_LARGEST = 4.0
#: What makes a radius of each of its parts smaller.
_CURES = {
    "noise": "more periods average noise",
    "odd": "another level, or more realisations, change odd distortion",
    "even": "an offset or an asymmetry makes even distortion",
    "misfit": "the nominal misses the machine there: name the crossover (omega_c, --bandwidth), or compare orders",
    "level": "the plant changes with the level: narrow the levels",
    "systematic": "a second level measures the systematic part",
}


def _warn_of_radius(model: UncertaintyModel) -> None:
    """Warn of a radius of one or more below the crossover that the nominal was fitted for."""
    relative, crossover = model.relative_radius(), model.origin.omega_c
    over = (model.omega <= crossover) & (relative >= 1)
    if not over.any():
        return
    k = int(np.argmax(np.where(over, relative, -1.0)))
    shares = model.radius_shares(k)
    data_warning(
        f"the radius of the set reaches {relative[k]:.3g} of |G| below the crossover of {format_hertz(crossover)}, at "
        f"{format_hertz(model.omega[k])}: no loop "
        f"with that bandwidth is robust. It is {shares[0][1]} for {100 * shares[0][0]:.0f} %: {_CURES[shares[0][1]]}",
        DesignWarning,
    )


class _SetFields(TypedDict, total=False):
    """Radius, weights and origin of a set, by the names of its fields."""

    omega: np.ndarray
    radius: np.ndarray
    budget: Mapping[str, np.ndarray]
    weight: control.StateSpace
    left: tuple[control.StateSpace, ...]
    right: tuple[control.StateSpace, ...]
    scaling: tuple[Weight | None, ...]
    origin: Origin


def _disc_set(
    many: list[Bla],
    nominal: control.StateSpace | control.FrequencyResponseData,
    form: str,
    rules: Extrapolation,
    order: int | None,
    spec: RadiusSpec,
    scaling: Scaling,
    omega_c: float,
) -> _SetFields:
    """Return radius, its parts and weight of a set of one channel, in the unit of its form."""
    row, dt = FORMS[form], _sampling_time_of(nominal)
    omega, parts, _ = disc_parts(many, [nominal] * len(many), spec)
    if dt:
        inside = omega * dt < np.pi * (1 - 1e-9)
        omega, parts = omega[inside], {name: part[inside] for name, part in parts.items()}
    absolute = sum_of_parts(parts)
    W1, W2, rules = resolve_scaling(row, nominal, omega=omega, shaped_by=scaling, rules=rules)
    factor, *covered = radius_in_form(
        row, omega, absolute=absolute, nominal=nominal, shaped_by=(W1, W2), rules=rules, dt=dt
    )
    importance = np.ones(covered[0].size)
    if not np.isnan(omega_c):  # as rs of the loop: where it is largest, an excess costs its margin
        size = np.abs(nominal_response(nominal, omega))
        in_loop = target_loop(omega, omega_c, smooth_size(omega, size)) / (size * factor)
        reached = np.interp(covered[0], omega, in_loop) * larger_of_neighbours(covered[1])
        importance = (reached / reached.max()) ** _NEAR_LARGEST
    importance = importance * (covered[0] <= omega[-1])  # above the band an excess costs nothing
    weight = fit_extrapolated(covered, rules, order=order, dt=dt, importance=importance)
    return {
        "weight": checked_weight(weight, omega, absolute * factor, order=order),
        "omega": omega,
        "radius": absolute * factor,
        "budget": {name: part * factor for name, part in parts.items() if np.isfinite(part).any()},
        "scaling": _given_scaling(W1, W2),
        "origin": Origin(extrapolation=str(rules)),
    }


def _block_set(
    frms: list[Bla],
    nominal: control.StateSpace,
    form: str,
    rules: Extrapolation,
    order: int | None,
    spec: RadiusSpec,
    scaling: Scaling,
    omega_c: float,
) -> _SetFields:
    """Return radii and weights of a set of several channels; the assumption outside the band applies to W_l only."""
    models, n = [nominal_response(nominal, frm.omega) for frm in frms], 0
    if form == ELEMENTS:
        omega, parts, radius = element_parts(frms, models, spec)
        budget = {name: part for name, part in parts.items() if np.isfinite(part).any()}
    else:
        if spec.systematic is not None:
            raise ValueError(f"systematic must be left out but for elements, got {spec.systematic:g} with {form}")
        omega, radius = block_radius(frms, models, spec=spec, form=form)
        n, budget = nominal.noutputs if form == ADDITIVE else nominal.ninputs, {}
    G = nominal_response(nominal, omega).reshape(nominal.noutputs, nominal.ninputs, -1)
    importance = target_loop(omega, omega_c, mean_size(omega, G))
    each = [rules] * (n or len(radius)) + [Extrapolation()] * (len(radius) - n if n else 0)
    weights = tuple(
        fit_covering_weight(
            omega,
            row,
            order=order,
            rules=rule,
            dt=_sampling_time_of(nominal),
            importance=importance,
        )
        for row, rule in zip(radius, each, strict=True)
    )
    return {
        "omega": omega,
        "radius": radius,
        "budget": budget,
        "left": weights[:n],
        "right": weights[n:],
        "scaling": _given_scaling(*scaling),
        "origin": Origin(extrapolation=str(rules)),
    }


def _given_scaling(*scaling: Weight | None) -> tuple[Weight | None, ...]:
    """Return W1 and W2 as a set takes them: none where neither is given."""
    return scaling if any(W is not None for W in scaling) else ()


def _sampling_time_of(nominal: control.StateSpace | control.FrequencyResponseData) -> float:
    """Return the sampling time [s] of a nominal, 0 of an FRF."""
    return 0.0 if isinstance(nominal, control.FrequencyResponseData) else timebase(nominal)


def _nominal_of_one_channel(
    nominal: control.StateSpace | control.FrequencyResponseData,
) -> tuple[control.StateSpace | control.FrequencyResponseData, float]:
    """Return the nominal of one channel with its delay inside, and that delay [s]."""
    delay = 0.0
    if isinstance(nominal, NominalFit):
        nominal, delay = delayed(nominal.G, nominal.delay, order=_PADE_ORDER), nominal.delay
    return nominal if isinstance(nominal, control.FrequencyResponseData) else state_space("nominal", nominal), delay


def _nominal_of_several_channels(
    nominal: control.StateSpace | control.FrequencyResponseData, frm: Bla
) -> tuple[control.StateSpace, float]:
    """Return the nominal of several channels with the delay of each input inside, and the longest of them [s]."""
    delay = 0.0
    if isinstance(nominal, NominalFit):
        require_same_channels(frm, nominal, "its nominal")
        G, delays = nominal.G, nominal.delays
        nominal = G
        if delays is not None and np.any(delays):
            delay = float(np.max(delays))
            through = control.StateSpace([], [], [], [[1.0]], G.dt)
            each = [delayed(through, float(tau), order=_PADE_ORDER_PER_INPUT) for tau in delays]
            nominal = in_series(block_diagonal(each, G.dt), G)
    nominal = multivariable("nominal", nominal)
    if (nominal.noutputs, nominal.ninputs) != (frm.n_outputs, frm.n_inputs):
        raise ValueError(
            f"nominal must have {frm.n_outputs} outputs and {frm.n_inputs} inputs, as the record, "
            f"got {nominal.noutputs} and {nominal.ninputs}"
        )
    return nominal, delay


def _describe_record(bla: Bla) -> str:
    """Describe a record."""
    lines = f"{bla.f.size} lines {bla.f[0]:g} to {bla.f[-1]:g} Hz"
    made = bla.experiment
    if made.grid == "given":
        what = "an FRF" if bla.is_single else "a matrix of FRFs"
        return f"{what} that was given, {lines}, variance from its {bla.level_source}"
    design, drawn = "", f"{made.n_realizations} realisations"
    if not bla.is_single:
        design, drawn = f"{made.design} ", f"{made.n_realizations} sets of {bla.n_inputs} experiments"
    return f"{design}{made.grid} multisine, {lines}, {drawn} x {made.n_periods} periods, level from {bla.level_source}"


def _radius_of_user(
    given: object, nominal: control.StateSpace | control.FrequencyResponseData, form: Form
) -> tuple[np.ndarray, np.ndarray, str] | None:
    """Return frequencies [rad/s], radius in the unit of the form, and its source in words; None where Blas were given.

    Two arrays are frequencies and radius as they are; FRFs or systems are plants that the set has to hold.
    """
    many = list(given) if isinstance(given, (list, tuple)) else [given]
    if many and all(map(is_single, many)):
        return None
    if not any(is_plant(part) or isinstance(part, np.ndarray) for part in many):
        raise ValueError(f"bla must be an nlfrf.Bla, a list of them, or a radius of your own, got {short_form(given)}")
    if form.depends_on_units:
        raise ValueError(f"form must not depend on units where the radius is your own, got {form.name}")
    if isinstance(given, tuple) and len(many) == 2 and not any(is_plant(part) for part in many):
        omega, radius = require_real_array("omega", many[0], ndim=1), require_real_array("radius", many[1], ndim=1)
        if omega.shape != radius.shape or not np.all(radius > 0) or not np.all(np.diff(omega, prepend=0.0) > 0):
            raise ValueError("radius must be positive, one for each omega, and these positive and increasing")
        return omega, radius, "a radius that was given"
    if not all(is_plant(part) for part in many):
        raise ValueError("bla must be all plants (FRFs or systems), or (omega, radius), where the radius is your own")
    lines = _frequencies_of_plants(many, nominal)
    each, differs = [], False
    for plant in many:
        omega, G = frequency_response("bla", plant, lines, (nominal, *many))
        centre = nominal_response(nominal, omega)
        differs |= bool(np.any(np.abs(G - centre) > 1e-12 * np.abs(centre)))
        with np.errstate(divide="ignore", invalid="ignore"):
            away = np.abs(form.deviation(G, centre))
        if not np.isfinite(away).all():
            raise ValueError(
                f"bla must leave the radius finite, got a plant or nominal that vanishes: {form.name} form"
            )
        each.append(larger_neighbour(lines, omega, away))
    radius = np.nanmax(each, axis=0)
    if not differs:
        raise ValueError("bla must hold a plant beside the nominal, got none that differs")
    return (
        lines,
        np.maximum(radius, MIN_RADIUS_RATIO * radius.max()),
        f"{format_count(len(many), 'plant')} that were given",
    )


def _frequencies_of_plants(
    many: Sequence[object], nominal: control.StateSpace | control.FrequencyResponseData
) -> np.ndarray:
    """Return all frequencies [rad/s] of the FRFs among the plants, or of the nominal where it is one."""
    known = [plant for plant in [*many, nominal] if isinstance(plant, control.FrequencyResponseData)]
    if not known:
        raise ValueError(
            "bla must hold an FRF, which says at which frequencies plants and nominal are compared: "
            "uncertainty([control.frd(plant, omega)], nominal). A weight that is known already makes a set by "
            "UncertaintyModel(nominal, weight, form, omega, radius)"
        )
    return np.unique(np.concatenate([np.asarray(plant.omega, dtype=float) for plant in known]))


def _set_of_user(
    given: object,
    nominal: control.StateSpace | control.FrequencyResponseData,
    *,
    form: Form,
    rules: Extrapolation,
    dt: float,
    order: int | None,
    spec: RadiusSpec,
) -> _SetFields:
    """Return the fields of a set with a radius of the user and its weight, without a confidence; none for Blas."""
    found = _radius_of_user(given, nominal, form)
    if found is None:
        return {}
    if spec.simultaneous or spec.systematic is not None:
        raise ValueError("simultaneous and systematic must be left out where the radius is your own: they are of a Bla")
    omega, radius, source = found
    covered = rules.extrapolate(omega, radius, dt)
    kinds = (control.StateSpace, control.TransferFunction)
    many = given if isinstance(given, list | tuple) and not isinstance(nominal, control.FrequencyResponseData) else ()
    systems = [state_space("bla", plant) for plant in many if isinstance(plant, kinds)]
    if systems:  # what they do between the lines of the FRFs
        require_equal_roots(form.name, [nominal, *systems], inverse=form.inverse)
        source += ", systems inside at all frequencies, FRFs on their lines"
    for round_ in range(MAX_ROUNDS):
        weight = fit_extrapolated(covered, rules, order=order, dt=dt, importance=1.0 * (covered[0] <= omega[-1]))
        model = UncertaintyModel(nominal=nominal, weight=weight, form=form.name, omega=omega, radius=radius)
        bounds = [model.deviations(plant)[0].bound(omega[0], TOLERANCE) for plant in systems]
        lift = max([1.0, *(one.upper * LIFT for one in bounds)])
        if lift < CLOSE_LIFT or round_ == MAX_ROUNDS - 1:
            break
        for plant, one in zip(systems, bounds, strict=True):
            covered = _cover_plant(covered, plant, nominal, form, one.omega)
    if not lift < MAX_LIFT:
        raise ValueError(
            f"bla must hold plants that a stable proper weight can cover, got one {lift:.3g} times as far from the "
            f"nominal as the weight reaches, {form.name} form: give it as an FRF, or another form or order"
        )
    weight = control.StateSpace(weight.A, weight.B, weight.C * lift, weight.D * lift, weight.dt)
    return {
        "omega": omega,
        "radius": radius,
        "weight": checked_weight(weight, omega, radius, order=order),
        "origin": Origin(source=source, extrapolation=str(rules)),
    }


def _cover_plant(
    covered: tuple[np.ndarray, np.ndarray],
    plant: control.StateSpace,
    nominal: control.StateSpace,
    form: Form,
    more: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Return frequencies and radii for a weight to cover, with one more, where the deviation of a system counts."""
    lines, radius = covered
    omega = np.union1d(lines, [more] * (more > 0))
    away = np.abs(form.deviation(response(plant, omega), response(nominal, omega)))
    return omega, np.maximum(np.exp(np.interp(np.log(omega), np.log(lines), np.log(radius))), np.nan_to_num(away))
