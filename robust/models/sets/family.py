"""Sets from families of plants with several channels, which are systems, FRFs, or both.

At each frequency `block_weights` gives the smallest W_l and W_r that cover the deviation of every
member; stable minimum-phase weights are fitted above them. The forms are compared by one measure:
the largest sigma(W_r X W_l) over frequency. X is the transfer matrix seen by Delta in the loop: T,
S, G^-1 T or S G, for T = omega_B/(s + omega_B) in every channel. If the measure is below one, that
loop is robustly stable for the set (SP 8.6). The form with the smallest measure is the least
demanding one for a controller.

Members need not have stable deviations. If they have as many poles in the right half plane as the
nominal (in an inverse form: zeros), det(I + L) of each has the winding number of the nominal, as in
the proof for a stable Delta.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import control
import numpy as np

from nlfrf._base.arguments import data_warning, require_choice, require_positive
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust._base.warnings import DesignWarning
from robust.lti.lti import response_by_channel, timebase
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.spectral import fit_matrix_weights
from robust.models.sets.block_weights import smallest_block_weights
from robust.models.sets.family_members import (
    Family,
    between_lines,
    make_family,
    on_lines,
    require_plants,
)
from robust.models.sets.forms import AUTO, BLOCK_FORMS, ELEMENTS, MATRIX_FORMS
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import MIN_RADIUS_RATIO, Extrapolation, fit_covering_weight
from robust.pages.text import format_table

_WEIGHTS = DIAGONAL, _FULL = ("diagonal", "full")
MAX_ROUNDS = 3  # rounds that add the frequencies at which a member lies outside between the lines
CLOSE_LIFT = 1.02  # a lift below this factor replaces further rounds
LIFT = 1 + 1e-6  # factor beyond the proved lift, for the rounding of lifted weights
_FAMILY_ORDER = 4  # default order of the weights
TOLERANCE = 1e-3  # between both bounds of the size of Delta
MAX_LIFT = 1.5  # above it no proper weight of the order covers the deviations


@value
class _FormRanking:
    """Forms of uncertainty for a family, the best one first.

    Fields
    ------
    omega_B : float
        Bandwidth of the loop for the comparison [rad/s].
    forms : tuple of str
    measures : (n,) ndarray
        Largest sigma(W_r X W_l) over frequency for each form. X is the transfer matrix seen by
        Delta in the loop. Below one, the loop is robustly stable.
    omega : (n,) ndarray
        Frequency of the maximum for each form [rad/s].
    refused : tuple of str
        Reasons why no set of the other forms contains the plants.

    References
    ----------
    SP 8.6.1 (8.53 to 8.58).

    Examples
    --------
    >>> print(_FormRanking(omega_B=1.0, forms=("output", "additive"), measures=[0.3, 0.8], omega=[2.0, 1.0]))
    output    0.300 at 2 rad/s
    additive  0.800 at 1 rad/s
    """

    omega_B: float
    forms: tuple[str, ...]
    measures: np.ndarray
    omega: np.ndarray
    refused: tuple[str, ...] = ()

    @property
    def best(self) -> str:
        """Return the form with the smallest measure."""
        return self.forms[0]

    def __str__(self) -> str:
        rows = zip(self.forms, self.measures, self.omega, strict=True)
        return format_table(
            [(form, f"{size:.3f} at {omega:.4g} rad/s") for form, size, omega in rows]
        )


def choose_form(
    plants: Sequence[AnySystem],
    nominal: NominalFit | AnySystem | None = None,
    *,
    omega_B: float,
    weights: str = DIAGONAL,
) -> _FormRanking:
    """Rank the forms of uncertainty for a family of plants by how much they restrict a loop.

    For each form the robust-stability measure of a loop with the bandwidth `omega_B` is computed.
    The form with the smallest measure comes first.

    Use this before `uncertainty_of_plants` if you do not know where the uncertainty of a plant with
    several channels acts.

    Parameters
    ----------
    plants : list of control.StateSpace, TransferFunction or FrequencyResponseData
        Plants of the family, with several channels.
    nominal : NominalFit or control system, optional
        Nominal plant; by default fitted as in `uncertainty_of_plants`.
    omega_B : float
        Bandwidth of the loop [rad/s]: T = omega_B/(s + omega_B) in every channel.
    weights : str
        "diagonal" or "full", as in `uncertainty_of_plants`.

    Returns
    -------
    FormRanking

    Raises
    ------
    ValueError
        Plants that do not fit each other, or that no form can cover.

    References
    ----------
    SP 8.2.3 and 8.6.1 (8.53 to 8.57: robust stability of the six forms).

    Examples
    --------
    An ill-conditioned plant whose two outputs have gain errors of up to 20 %: the uncertainty at
    the output comes first.

    >>> G = control.ss([[-1.0]], [[1.0, -1.0]], [[1.0], [1.2]], np.eye(2) * 0.01)
    >>> plants = [control.ss(G.A, G.B, np.diag(k) @ G.C, np.diag(k) @ G.D) for k in ([0.8, 1.2], [1.2, 0.8])]
    >>> choose_form(plants, G, omega_B=1.0).best
    'output'
    """
    family = make_family(require_plants(plants), nominal)
    return _rank_forms(family, require_positive("omega_B", omega_B), full=is_full(weights))


def _rank_forms(family: Family, omega_B: float, *, full: bool) -> _FormRanking:
    s = 1j * family.omega / omega_B
    S, T = ((x[:, None, None] * np.eye(family.G.shape[1])) for x in (s / (1 + s), 1 / (1 + s)))
    found, refused = [], []
    for form, row in BLOCK_FORMS.items():
        try:
            L, R = smallest_block_weights(family.deviations(form), full=full)
        except ValueError as error:
            refused.append(f"{form}: {error}")
            continue
        left, right = np.linalg.cholesky(L), np.linalg.cholesky(R)
        X = row.weighed(family.G, S, T)
        size = np.linalg.norm(np.swapaxes(right, 1, 2).conj() @ X @ left, 2, (1, 2))
        traces = np.einsum("wii->w", L).real
        found.append(
            (
                float(f"{size.max():.3g}"),
                traces.max() / traces.min(),
                form,
                size.max(),
                size.argmax(),
            )
        )
    if not found:
        raise ValueError(
            f"plants must have a set in one of the forms, got none: {'; '.join(refused)}"
        )
    found.sort()  # forms of equal measure: the one with the flattest weight comes first
    _, _, forms, measures, at = zip(*found, strict=True)
    return _FormRanking(
        omega_B=omega_B,
        forms=forms,
        measures=np.array(measures),
        omega=family.omega[list(at)],
        refused=tuple(refused),
    )


def is_full(weights: str) -> bool:
    """Return True for matrix weights, from the argument `weights`."""
    return require_choice("weights", weights, _WEIGHTS) == _FULL


def make_family_set(
    plants: list[AnySystem],
    nominal: NominalFit | AnySystem | None,
    *,
    form: str | None,
    full: bool,
    order: int | None,
    rules: Extrapolation,
    perturbation: str,
    omega_B: float | None,
) -> UncertaintyModel:
    """Return the set of a family, in the requested form or in the one with the smallest measure."""
    family, chosen = make_family(plants, nominal), ""
    if not np.any(
        np.abs(family.G_p - family.G).max(axis=(0, 2, 3)) > 1e-9 * np.abs(family.G).max(axis=(1, 2))
    ):
        raise ValueError("plants must hold one other than the nominal, got none that differs")
    if form is None or form == AUTO:
        if omega_B is None:
            bandwidth = float(np.sqrt(family.omega[0] * family.omega[-1]))
        else:
            bandwidth = require_positive("omega_B", omega_B)
        ranking = _rank_forms(family, bandwidth, full=full)
        form = ranking.best
        chosen = (
            f"; chosen from {len(ranking.forms)} forms by the weight times |T| or |S| at"
            f" {bandwidth:.3g} rad/s"
        )
    require_choice("form", form, (*MATRIX_FORMS, AUTO))
    if form == ELEMENTS and full:
        raise ValueError(
            'weights must be "diagonal" for the form elements, which has one weight for each'
            ' entry, got "full"'
        )
    if family.is_parametric:
        rules = Extrapolation()
    hold = partial(
        _hold_family,
        family,
        form,
        order=_FAMILY_ORDER if order is None else order,
        rules=rules,
        perturbation=perturbation,
        chosen=chosen,
    )
    if not full:
        return hold(full=False)
    try:
        return hold(full=True)
    except ValueError as error:
        model = hold(full=False)
        data_warning(
            f"weights were made diagonal for these plants: with full weights, {error}",
            DesignWarning,
        )
        return model


def _hold_family(
    family: Family,
    form: str,
    *,
    full: bool,
    order: int,
    rules: Extrapolation,
    perturbation: str,
    chosen: str,
) -> UncertaintyModel:
    """Return a set of a form that covers every member, or raise."""
    for round_ in range(MAX_ROUNDS):
        model = _fit_set(
            family, form, full=full, order=order, rules=rules, perturbation=perturbation
        )
        reach = _reach_of_members(model, family)
        outside = reach.sizes > CLOSE_LIFT
        if not outside.any() or round_ == MAX_ROUNDS - 1:
            break
        family = _add_lines(family, reach.omega[outside])
    lift, at = float(reach.sizes.max()), float(reach.omega[reach.sizes.argmax()])
    if not lift < MAX_LIFT:
        raise ValueError(
            "form and order must allow stable proper weights that cover every deviation, got"
            f" {form} of order {order}: at {at:.3g} rad/s the deviation of a plant is {lift:.3g}"
            " times as large as the weights allow"
        )
    return _lift_set(
        model,
        max(lift, 1.0) * LIFT,
        source=f"{len(family.G_p)} plants that were given, {reach.where}{chosen}",
        extrapolation="plants known at every frequency" if family.is_parametric else str(rules),
    )


def _add_lines(family: Family, omega: np.ndarray) -> Family:
    """Return a family on more lines; its FRFs are unknown (nan) there."""
    lines = np.unique(np.concatenate([family.omega, omega]))
    n = len(family.G_p) - len(family.systems)
    G_p = np.full((len(family.G_p), lines.size, *family.G.shape[1:]), np.nan, dtype=complex)
    G_p[:n, np.searchsorted(lines, family.omega)] = family.G_p[:n]
    for k, system in enumerate(family.systems):
        G_p[n + k] = on_lines(system, lines)
    return replace(family, omega=lines, G_p=G_p, G=on_lines(family.nominal, lines))


def _fit_set(
    family: Family, form: str, *, full: bool, order: int, rules: Extrapolation, perturbation: str
) -> UncertaintyModel:
    """Return the set with weights above the smallest ones on the lines; W_l carries the rule
    outside them.
    """
    dt, omega = timebase(family.nominal), family.omega
    if form == ELEMENTS:
        away = np.abs(between_lines(family.G_p - family.G, omega)).max(axis=0)
        rows = away.transpose(2, 1, 0).reshape(-1, omega.size)
        rows = np.maximum(rows, MIN_RADIUS_RATIO * rows.max())
        right = tuple(
            fit_covering_weight(omega, row, order=order, rules=rules, dt=dt) for row in rows
        )
        return UncertaintyModel(
            nominal=family.nominal,
            form=form,
            omega=omega,
            radius=rows,
            right=right,
            perturbation=perturbation,
        )
    E = family.deviations(form)
    L, R = smallest_block_weights(E, full=full)
    size = np.einsum("wii->w", L).real
    L = L * np.maximum(1.0, MIN_RADIUS_RATIO**2 * size.max() / size)[:, None, None]
    scale = np.einsum("wii->w", R).real[:, None, None] / R.shape[1]  # W_l carries the size
    L, R = L * scale, R / scale
    rows = np.sqrt([*np.einsum("wii->iw", L).real, *np.einsum("wii->iw", R).real])
    n = L.shape[1]
    if full:
        lines, nearest, factor = _extend_lines(omega, rules, dt)
        W_l, W_r = fit_matrix_weights(
            lines,
            E[:, nearest] * factor[:, None, None],
            L=L[nearest] * factor[:, None, None] ** 2,
            R=R[nearest],
            order=order,
            dt=dt,
        )
        left, right = (W_l,), (W_r,)
        rows = np.minimum(rows, _gains_of_weights(W_l, W_r, omega))
    else:
        left = tuple(
            fit_covering_weight(omega, row, order=order, rules=rules, dt=dt) for row in rows[:n]
        )
        right = tuple(
            fit_covering_weight(omega, row, order=order, rules=Extrapolation(), dt=dt)
            for row in rows[n:]
        )
    return UncertaintyModel(
        nominal=family.nominal,
        form=form,
        omega=omega,
        radius=rows,
        left=left,
        right=right,
        perturbation=perturbation,
    )


def _extend_lines(
    omega: np.ndarray, rules: Extrapolation, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return lines continued outside the band, the nearest measured line to each, and the growth of
    a deviation there.

    The lines are unchanged if the rule is flat, because the fit is flat by itself.
    """
    if rules.below == rules.above == 0:
        return omega, np.arange(omega.size), np.ones(omega.size)
    wide, factor = rules.extrapolate(omega, np.ones(omega.size), dt)
    nearest = np.clip(np.arange(wide.size) - int(np.sum(wide < omega[0])), 0, omega.size - 1)
    return wide, nearest, factor


def _gains_of_weights(
    W_l: control.StateSpace, W_r: control.StateSpace, omega: np.ndarray
) -> np.ndarray:
    """Return (n + m, W) norms of the rows of W_l and of the columns of W_r."""
    sides = (response_by_channel(W, omega) for W in (W_l, W_r))
    return np.concatenate(
        [np.linalg.norm(side, axis=axis) for side, axis in zip(sides, (1, 0), strict=True)]
    )


@value
class _Reach:
    """Size of Delta for each member (M,), its frequency [rad/s] (M,), and a description of the
    frequencies checked.
    """

    sizes: np.ndarray
    omega: np.ndarray
    where: str


def _reach_of_members(model: UncertaintyModel, family: Family) -> _Reach:
    """Return the largest Delta of each member: for an FRF on its lines, for a system proved at all
    frequencies.
    """
    n, known = len(family.G_p) - len(family.systems), ~np.isnan(family.G_p)
    far = model.normalized_distance(family.omega, np.where(known, family.G_p, family.G), family.G)
    sizes, omega = far.max(axis=1), family.omega[far.argmax(axis=1)]
    if n:
        where = {f"FRFs at their {int(known[0, :, 0, 0].sum())} lines"}
    else:
        where = set()
    for k, system in enumerate(family.systems, start=n):
        found = [
            deviation.bound(float(omega[k]), TOLERANCE) for deviation in model.deviations(system)
        ]
        largest = max(found, key=lambda one: (one.upper, one.lower))
        if largest.is_proved or largest.lower > sizes[k]:
            sizes[k], omega[k] = (
                largest.upper if largest.is_proved else largest.lower,
                largest.omega,
            )
        if largest.is_proved:
            at = "all"
        else:
            at = f"{family.omega.size}"
        where.add(f"systems at {at} frequencies{f' ({largest.reason})' * (not largest.is_proved)}")
    return _Reach(sizes=sizes, omega=omega, where=f"each inside, {' and '.join(sorted(where))}")


def _lift_set(
    model: UncertaintyModel, factor: float, *, source: str, extrapolation: str
) -> UncertaintyModel:
    """Return a set enlarged by a factor, with its source and extrapolation."""
    raised = tuple(
        control.StateSpace(w.A, w.B, w.C * factor, w.D * factor, w.dt, remove_useless_states=False)
        for w in model.left or model.right
    )
    if model.left:
        left, right = raised, model.right
    else:
        left, right = (), raised
    origin = replace(model.origin, source=source, extrapolation=extrapolation)
    return replace(model, left=left, right=right, origin=origin)
