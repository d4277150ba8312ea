"""Sets of plants around a nominal, from records of any number of channels.

radius = misfit of the nominal + sqrt(F_p (variance of G + variance of one realisation + even
level)) on each line, then a stable minimum-phase weight over it (SP 7.4, 8.2.3). The misfit
excludes the scatter, which is counted separately.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, TypedDict

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import (
    data_warning,
    format_hertz,
    keep_warnings,
    require_choice,
    require_integer,
    require_probability,
    require_real,
    short_form,
)
from robust._base.channels import is_single
from robust._base.types import AnySystem, Weight
from robust._base.warnings import DesignWarning
from robust.lti.realisation import multivariable
from robust.models.fit.class_error import mean_size, smooth_size, target_loop
from robust.models.fit.nominal import (
    NominalFit,
    bla_behind_hold,
    bla_of_fit,
    checked_weight,
    matrices_given,
    require_same_channels,
    require_same_units,
    sampling_time_of,
    single_nominal,
    with_delays,
)
from robust.models.fit.weights import larger_of_neighbours
from robust.models.sets.family import DIAGONAL, FAMILY_ORDER, find_plants, is_full, make_family_set
from robust.models.sets.forms import ADDITIVE, AUTO, DEFAULT_FORM, ELEMENTS, FORMS, RECORD_FORMS
from robust.models.sets.joint import attach_records
from robust.models.sets.model import (
    UncertaintyModel,
    count_channels,
    format_channels,
    own_weights_call,
)
from robust.models.sets.orders import scan_orders
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
from robust.models.sets.records import Origin
from robust.models.sets.single_family import make_set_of_plants


@keep_warnings
def uncertainty(
    bla: Bla | AnySystem | Sequence[Bla | AnySystem],
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

    On each line the disc around the nominal contains the FRF of a new realisation with the stated
    confidence: radius = misfit of the nominal + sqrt(F_p (variance of G + variance of one
    realisation + even level)). The raw residual of a line contains scatter, so the misfit is the
    residual less the variance. For a fitted nominal this errs on the wide side: the fit averages
    the variance of G that is counted here.

    Use this after `nlfrf.identify` and `fit_nominal`, before any design: controllers are designed
    and checked for the set that it returns.

    Parameters
    ----------
    bla : nlfrf.Bla or list of them
        What was measured, with one or several channels; several levels, offsets or days make one
        set, with the largest radius of all. An FRF from elsewhere is a Bla by `nlfrf.bla_from_frf`,
        or by the `std` that `fit_nominal` was given with it. Or a list of plants (FRFs, systems)
        that the set has to hold.
    nominal : NominalFit, control system or control.FrequencyResponseData, optional
        The model in the middle, continuous or discrete. An FRF gives a model that is known on its
        lines only. For several channels it may be left out: plants get a fit of their mean
        response, records the fit that `scan_orders` chooses.
    form : str
        "multiplicative", "additive", "inverse-multiplicative", "inverse-additive" or "coprime". For
        records with several channels: "elements" (when not given), "additive" or "input", chosen
        before you see a verdict; or "auto", the first two at a price of 10 %. For plants with
        several channels also "output", "inverse-additive", "inverse-input" and "inverse-output";
        when not given, the first form of `choose_form`.
    weights : str
        "diagonal": one weight a channel. "full", for plants with several channels: W_l and W_r are
        matrices, and the set is smaller if deviations share a direction.
    omega_B : float, optional
        Bandwidth [rad/s] of the loop for which the form is chosen, for plants with several
        channels; the middle of their band when not given.
    order : int, optional
        Order of each weight. When not given, it grows up to 12 as long as a state saves 0.1 dB of
        the mean excess, and is 4 for plants with several channels.
    confidence : float
        Probability per line (or for all lines together when `simultaneous`).
    simultaneous : bool
        False: about one line in twenty of another record lies outside its disc at 95 %; `joint` is
        the probability for a whole FRF. True widens the radius by a factor of 1.8 to 2.1 and is
        seldom worth it (see the guide on bounds).
    even : bool
        Add the even distortion level: in closed loop the machine receives signals that are not odd.
    systematic : float, optional
        Decibels above the odd level added to the radius for the systematic part (8 in the paper);
        None leaves it out. For one channel, or for "elements".
    below, above : "flat" or float
        Assumption outside the measured band: the radius stays flat, or rises away from the band
        with that many dB per decade, over two decades, flat beyond.
    perturbation : str
        The class; "LTI" and "operator" are claims of the user about the plant.
    W1, W2 : control.StateSpace, TransferFunction or float, optional
        Scaling W2 G W1 of the plant for the coprime form, as for `ncfsyn`; when not given, unit
        gain in mid band.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        A form or class that does not exist, an inverse form where the radius reaches |G|, an order
        too low, plants that no set of the form holds.

    Notes
    -----
    For plants with several channels the set has the least tr W_l W_l* + tr W_r* W_r at each
    frequency, before the fit. So scale inputs and outputs first (SP 1.4). Every plant lies inside:
    systems at all frequencies, zero and infinity included, which is proved by exact polynomials
    (`UncertaintyModel.contains`); FRFs on their lines. If full weights of the order do not cover
    the plants, the weights are diagonal, with a warning.

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

    A set by weights of your own is an `UncertaintyModel`, one by a radius of your own
    `UncertaintyModel.from_radius`. A plant with two inputs and outputs, its inputs wrong by up to
    20 %, all at once and with any coupling (for a perturbation of each input by itself:
    `interconnection`):

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
    plants = find_plants(bla)
    is_family = bool(plants) and count_channels(plants[0]) != (1, 1)
    if plants and (simultaneous or systematic is not None or W1 is not None or W2 is not None):
        raise ValueError(
            "simultaneous, systematic, W1 and W2 must be left out with plants: they belong to a Bla"
        )
    if is_family:
        return make_family_set(
            plants,
            nominal,
            form=form,
            weights=weights,
            order=FAMILY_ORDER if order is None else order,
            rules=rules,
            perturbation=perturbation,
            omega_B=omega_B,
        )
    if is_full(weights) or omega_B is not None:
        raise ValueError(
            "weights and omega_B must be left out, except for a family of plants with several"
            " channels"
        )
    if plants:
        if nominal is None:
            raise ValueError("nominal must be given for plants with one channel: see fit_nominal")
        return make_set_of_plants(
            plants, nominal, form=form, order=order, rules=rules, perturbation=perturbation
        )
    recorded: list[Bla] = matrices_given(bla)
    several = bool(recorded)
    if nominal is None and not several:
        raise ValueError(
            "nominal must be given, except for plants or records with several channels: see"
            " fit_nominal"
        )
    if nominal is None:
        nominal = scan_orders(recorded).fit
    given = nominal.G if isinstance(nominal, NominalFit) else nominal
    if not several and count_channels(given) != (1, 1):
        raise ValueError(
            f"bla must be a measured Bla for a nominal of {format_channels(given)}, got"
            f" {short_form(bla)}; for weights of your own use {own_weights_call(given, form)}"
        )
    if several and form == DEFAULT_FORM:
        form = ELEMENTS
    if several and form == AUTO:  # two tests share the probability of an error
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
    if not several:
        recorded = _single_records(bla)
    nominal, delay = _nominal_of_records(nominal, recorded[0])
    is_frf = isinstance(nominal, control.FrequencyResponseData)
    many = (
        recorded
        if is_frf
        else [bla_behind_hold(one, sampling_time_of(nominal)) for one in recorded]
    )
    made = (_block_set if several else _disc_set)(
        many, nominal, form, rules, order, spec, (W1, W2), omega_c
    )
    made["origin"] = replace(
        made["origin"],
        source="; ".join(map(_describe_record, many)),
        delay=delay,
        omega_c=omega_c,
        hold=many[0].hold if len({one.hold for one in many}) == 1 else "unknown",
        fs=min(one.fs for one in many),
        unit=many[0].unit,
    )
    model = UncertaintyModel(
        nominal=nominal,
        form=form,
        perturbation=perturbation,
        **made,
        confidence=spec.p,
        simultaneous=spec.simultaneous,
        inputs=many[0].inputs,
        outputs=many[0].outputs,
    )
    _warn_of_radius(model)
    return attach_records(model, many, recorded)


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
    """Warn if the relative radius reaches one below the crossover that the nominal was fitted
    for.
    """
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
    """Return radius, parts and weight of a set for one channel, in the unit of its form."""
    row, dt = FORMS[form], sampling_time_of(nominal)
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
    if not np.isnan(
        omega_c
    ):  # proportional to rs of the loop: an excess costs margin where rs is largest
        size = np.abs(nominal_response(nominal, omega))
        in_loop = target_loop(omega, omega_c, smooth_size(omega, size)) / (size * factor)
        reached = np.interp(covered[0], omega, in_loop) * larger_of_neighbours(covered[1])
        importance = (reached / reached.max()) ** _NEAR_LARGEST
    importance = importance * (covered[0] <= omega[-1])  # an excess above the band costs nothing
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
    """Return radii and weights of a set for several channels; the assumption outside the band
    applies to W_l only.
    """
    models, n = [nominal_response(nominal, frm.omega) for frm in frms], 0
    if form == ELEMENTS:
        omega, parts, radius = element_parts(frms, models, spec)
        budget = {name: part for name, part in parts.items() if np.isfinite(part).any()}
    else:
        if spec.systematic is not None:
            raise ValueError(
                f'systematic must be left out unless form is "elements", got {spec.systematic:g}'
                f" with {form}"
            )
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
            dt=sampling_time_of(nominal),
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
    """Return W1 and W2, or nothing if neither is given."""
    return scaling if any(W is not None for W in scaling) else ()


def _single_records(bla: object) -> list[Bla]:
    """Return the records with one channel that were given, one or a list."""
    many: list[Any] = list(bla) if isinstance(bla, list | tuple) else [bla]
    if not many or not all(map(is_single, many)):
        raise ValueError(
            "bla must be an nlfrf.Bla, a list of them, or plants (FRFs or systems), got"
            f" {short_form(bla)}; for a radius of your own use"
            " UncertaintyModel.from_radius(nominal, omega, radius)"
        )
    return many


def _nominal_of_records(
    nominal: NominalFit | AnySystem | float, bla: Bla
) -> tuple[AnySystem, float]:
    """Return the nominal with its delays inside, as the channels of the record need it, and the
    longest delay [s].
    """
    if isinstance(nominal, NominalFit) and not bla.is_single:
        require_same_channels(bla, nominal, "its nominal")
    if bla.is_single:
        return single_nominal(nominal)
    given, delay = with_delays(nominal)
    system = multivariable("nominal", given)
    if (system.noutputs, system.ninputs) != (bla.n_outputs, bla.n_inputs):
        raise ValueError(
            f"nominal must have {bla.n_outputs} outputs and {bla.n_inputs} inputs, as the record, "
            f"got {system.noutputs} and {system.ninputs}"
        )
    return system, delay


def _describe_record(bla: Bla) -> str:
    lines = f"{bla.f.size} lines {bla.f[0]:g} to {bla.f[-1]:g} Hz"
    made = bla.experiment
    if made.grid == "given":
        what = "an FRF" if bla.is_single else "a matrix of FRFs"
        return f"{what} that was given, {lines}, variance from its {bla.level_source}"
    design, drawn = "", f"{made.n_realizations} realisations"
    if not bla.is_single:
        design = f"{made.design} "
        drawn = f"{made.n_realizations} sets of {bla.n_inputs} experiments"
    return (
        f"{design}{made.grid} multisine, {lines}, {drawn} x {made.n_periods} periods, level from"
        f" {bla.level_source}"
    )
