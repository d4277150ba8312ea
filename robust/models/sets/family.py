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

import warnings
from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import TypeGuard

import control
import numpy as np

from nlfrf import DataWarning
from nlfrf._base.arguments import data_warning, require_choice, require_positive, short_form
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust._base.warnings import DesignWarning
from robust.lti.lti import poles as poles_of
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.realisation import frequency_response, multivariable
from robust.models.fit.nominal import fit_nominal
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.spectral import fit_matrix_weights
from robust.models.sets.block_weights import smallest_block_weights
from robust.models.sets.forms import AUTO, BLOCK_FORMS, ELEMENTS, MATRIX_FORMS
from robust.models.sets.membership import require_equal_roots
from robust.models.sets.model import UncertaintyModel, count_channels, format_channels
from robust.models.sets.radius import MIN_RADIUS_RATIO, Extrapolation, fit_covering_weight
from robust.pages.text import format_table

_WEIGHTS = DIAGONAL, _FULL = ("diagonal", "full")
# lines over the band of all poles, and the factor by which they extend it
_N_LINES = 50
_BAND_RATIO = 30.0
_HALF_WIDTHS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # lines at a resonance
_MAX_LINES = 160
_FAR_RATIOS = np.array(
    [10.0, 100.0, 1e3, 1e4]
)  # factors outside the band of all poles at which members are checked
_MAX_CONDITION = 1e9  # condition number above which the inverse of a plant is rounding
_MAX_RISE = 100.0  # far deviation over the largest on the lines, above which it has no limit
MAX_ROUNDS = 3  # rounds that add the frequencies at which a member lies outside between the lines
CLOSE_LIFT = 1.02  # a lift below this factor replaces further rounds
LIFT = 1 + 1e-6  # factor beyond the proved lift, for the rounding of lifted weights
_FAMILY_ORDER = 4  # default order of the weights
TOLERANCE = 1e-3  # between both bounds of the size of Delta
MAX_LIFT = 1.5  # above it no proper weight of the order covers the deviations
#: Numbers of poles tried for a nominal; the first with a misfit below this share of the spread is
#: taken.
_NOMINAL_ORDERS, _MISFIT_SHARE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16), 0.1
_MIN_SPREAD = 1e-3  # least spread, over the largest entry on a line


@value
class _Family:
    """Members and nominal of a family on common lines, and the members that are systems."""

    omega: np.ndarray  # (W,) lines [rad/s]
    # (M, W, n_y, n_u) complex members, FRFs before systems; nan for an FRF on a line that it does
    # not have
    G_p: np.ndarray
    G: np.ndarray  # (W, n_y, n_u) complex the nominal
    nominal: control.StateSpace
    systems: tuple[control.StateSpace, ...]  # members that are known at every frequency

    @property
    def is_parametric(self) -> bool:
        """Return True if every member is a system, known at every frequency."""
        return len(self.systems) == len(self.G_p)

    def deviations(self, form: str) -> np.ndarray:
        """Return (M, W, n, m) the W_l Delta W_r of each member; refuse a form that has none for one
        of them.
        """
        row, (n_y, n_u) = BLOCK_FORMS[form], self.G.shape[1:]
        if row.needs_square_plant and n_y != n_u:
            raise ValueError(
                f"form must be elements or additive for a plant that is not square, got {n_y} by"
                f" {n_u}"
            )
        require_equal_roots(form, (self.nominal, *self.systems), inverse=row.inverse)
        if row.needs_square_plant:
            known = np.where(np.isnan(self.G_p), self.G, self.G_p)
            singular = ~np.all(
                np.linalg.cond(np.concatenate([self.G[None], known])) < _MAX_CONDITION, axis=0
            )
            if singular.any():
                raise ValueError(
                    "form must be elements or additive for a plant that is nearly singular, got"
                    f" {form} and one at {self.omega[singular.argmax()]:.4g} rad/s"
                )
        E = _between_lines(row.deviation(self.G_p, self.G), self.omega)
        # A deviation that grows without limit outside the lines has no proper weight above it.
        ends, members, nominal = _decided_responses(form, self, self.ends)
        if ends.size:
            far = row.deviation(members, nominal)
        else:
            far = np.zeros(0)
        if (
            not np.isfinite(E).all()
            or np.max(np.abs(far), initial=0.0) > _MAX_RISE * np.abs(E).max()
        ):
            raise ValueError(
                f"form must leave every deviation finite at all frequencies, got {form} with an"
                " infinite one"
            )
        return E

    @property
    def ends(self) -> np.ndarray:
        """Return frequencies [rad/s] far outside the lines, below the Nyquist frequency."""
        dt = timebase(self.nominal)
        ends = np.concatenate([self.omega[0] / _FAR_RATIOS, self.omega[-1] * _FAR_RATIOS])
        if dt:
            return ends[ends < np.pi / dt]
        return ends


def _decided_responses(
    form: str, family: _Family, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the frequencies at which rounding does not dominate the deviations, with members and
    nominal there.

    Far outside the band a plant may be almost singular, and its inverse is rounding.
    """
    shape = (len(family.systems), omega.size, *family.G.shape[1:])
    members = np.array([_on_lines(system, omega) for system in family.systems]).reshape(shape)
    nominal = _on_lines(family.nominal, omega)
    if form != ELEMENTS and BLOCK_FORMS[form].needs_square_plant:
        with np.errstate(all="ignore"):
            decided = np.all(
                np.linalg.cond(np.concatenate([nominal[None], members])) < _MAX_CONDITION, axis=0
            )
        omega, members, nominal = omega[decided], members[:, decided], nominal[decided]
    return omega, members, nominal


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
    family = _make_family(require_plants(plants), nominal)
    return _rank_forms(family, require_positive("omega_B", omega_B), full=is_full(weights))


def _rank_forms(family: _Family, omega_B: float, *, full: bool) -> _FormRanking:
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


def require_plants(plants: object) -> list[AnySystem]:
    """Return the plants, FRFs or systems, as a list: all with one channel, or all with several."""
    if isinstance(plants, list | tuple):
        many = list(plants)
    else:
        many = []
    other = next((one for one in many if not is_plant(one)), None)
    if not many or other is not None:
        raise ValueError(
            "plants must be a list of systems or FRFs, got"
            f" {short_form(plants if other is None else other)}"
        )
    if len({count_channels(one) == (1, 1) for one in many}) > 1:
        raise ValueError(
            "plants must all have one channel, or all several, got"
            f" {', '.join(sorted({format_channels(one) for one in many}))}"
        )
    return many


def is_plant(given: object) -> TypeGuard[AnySystem]:
    """Return whether a value is a system or an FRF of python-control."""
    return isinstance(
        given, control.FrequencyResponseData | control.StateSpace | control.TransferFunction
    )


def _make_family(plants: list[AnySystem], nominal: NominalFit | AnySystem | None) -> _Family:
    """Return the family on the lines of its FRFs, which must be the same, or else on lines about
    its poles.
    """
    shape = count_channels(plants[0])
    if shape == (1, 1):
        raise ValueError(
            "plants must be systems or FRFs with several inputs and outputs, got"
            f" {short_form(plants)}"
        )
    frfs = [plant for plant in plants if isinstance(plant, control.FrequencyResponseData)]
    systems = [
        multivariable("plants", plant)
        for plant in plants
        if not isinstance(plant, control.FrequencyResponseData)
    ]
    if nominal is None:
        given = None
    else:
        given = _nominal_system(nominal)
    if given is None:
        known = systems
    else:
        known = [given, *systems]
    if known:
        dt = timebase(known[0])
    else:
        dt = float(frfs[0].dt or 0)
    if frfs:
        omega = np.asarray(frfs[0].omega, dtype=float)
        if any(
            len(frf.omega) != omega.size or not np.allclose(frf.omega, omega, rtol=1e-9)
            for frf in frfs
        ):
            raise ValueError(
                "plants must be FRFs on the same lines, got different lines: interpolate them first"
            )
    else:
        omega = _lines_of_systems(known)
    G_p = _members_on_lines([*frfs, *systems], omega, tuple(known), shape)
    if given is None:
        given = _find_nominal(G_p, omega, dt)
    if count_channels(given) != shape:
        raise ValueError(
            f"nominal must have {shape[0]} outputs and {shape[1]} inputs as the plants, "
            f"got {given.noutputs} and {given.ninputs}"
        )
    return _Family(
        omega=omega, G_p=G_p, G=_on_lines(given, omega), nominal=given, systems=tuple(systems)
    )


def _nominal_system(nominal: NominalFit | AnySystem) -> control.StateSpace:
    if isinstance(nominal, NominalFit):
        nominal = nominal.G
    if isinstance(nominal, control.FrequencyResponseData):
        raise ValueError(
            "nominal must be a system or a NominalFit for plants with several channels, got an FRF"
        )
    return multivariable("nominal", nominal)


def _members_on_lines(
    many: Sequence[AnySystem],
    omega: np.ndarray,
    clocks: tuple[AnySystem, ...],
    shape: tuple[int, int],
) -> np.ndarray:
    """Return (M, W, n_y, n_u) responses of the members."""
    return np.array(
        [
            np.moveaxis(frequency_response("plants", plant, omega, clocks, shape)[1], 2, 0)
            for plant in many
        ]
    )


def _on_lines(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return (W, n_y, n_u) response."""
    return np.moveaxis(response_by_channel(system, omega), 2, 0)


def _lines_of_systems(systems: Sequence[control.StateSpace]) -> np.ndarray:
    """Return (W,) frequencies [rad/s] beyond all poles, dense at each resonance."""
    dt = max(map(timebase, systems))
    s = np.concatenate([to_s_plane(poles_of(system), timebase(system)) for system in systems])
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    if s.size:
        size = np.abs(s)
    else:
        size = np.ones(1)
    size = size[(size > np.median(size) * 1e-6) & (size < np.median(size) * 1e6)]
    if dt:
        top = np.pi / dt * (1 - 1e-9)
    else:
        top = np.inf
    sharp = s[(np.abs(s.real) < 0.3 * np.abs(s)) & (s.imag > 0)]
    at = (sharp.imag[:, None] + np.abs(sharp.real)[:, None] * _HALF_WIDTHS).ravel()
    if at.size > _MAX_LINES - _N_LINES:
        at = np.sort(at)[:: max(1, at.size // (_MAX_LINES - _N_LINES) + 1)]
    low, high = size.min() / _BAND_RATIO, min(size.max() * _BAND_RATIO, top)
    omega = np.concatenate([np.geomspace(low, high, _N_LINES), at])
    return np.unique(omega[(omega >= low) & (omega <= high)])


def _find_nominal(G_p: np.ndarray, omega: np.ndarray, dt: float) -> control.StateSpace:
    """Fit the mean response of the members by the lowest order whose misfit is small compared with
    their spread.
    """
    mean = G_p.mean(axis=0)
    spread = np.abs(G_p - mean).max(axis=0)
    spread = np.maximum(
        spread, _MIN_SPREAD * np.abs(mean).max(axis=(1, 2), keepdims=True)
    )  # also for an entry that is zero
    rows, columns = spread.max(axis=2, keepdims=True), spread.max(axis=1, keepdims=True)
    std = np.moveaxis(_MISFIT_SHARE * rows * columns / rows.max(axis=1, keepdims=True), 0, 2)
    best: control.StateSpace | None = None
    least = np.inf
    for n in _NOMINAL_ORDERS:
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", DataWarning)  # the order is only a trial
                fit = fit_nominal(
                    control.frd(np.moveaxis(mean, 0, 2), omega), n_poles=n, std=std, dt=dt
                )
        except ValueError:  # more parameters than lines
            break
        misfit = float(np.sqrt(np.mean(np.abs(fit.residual / std) ** 2)))
        if misfit < 0.8 * least:  # a further pole has to pay
            best, least = fit.G, misfit
        if misfit < 1:
            break
    if best is None:
        raise ValueError(
            f"nominal must be given for FRFs on {omega.size} lines, which are too few to fit one"
        )
    if least > 1 / _MISFIT_SHARE:
        data_warning(
            f"the fitted nominal is {_MISFIT_SHARE * least:.2g} times the spread of the plants"
            " away from their middle, so the set is larger than necessary: give a nominal",
            DesignWarning,
        )
    return best


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
    family, chosen = _make_family(plants, nominal), ""
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
    family: _Family,
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


def _add_lines(family: _Family, omega: np.ndarray) -> _Family:
    """Return a family on more lines; its FRFs are unknown (nan) there."""
    lines = np.unique(np.concatenate([family.omega, omega]))
    n = len(family.G_p) - len(family.systems)
    G_p = np.full((len(family.G_p), lines.size, *family.G.shape[1:]), np.nan, dtype=complex)
    G_p[:n, np.searchsorted(lines, family.omega)] = family.G_p[:n]
    for k, system in enumerate(family.systems):
        G_p[n + k] = _on_lines(system, lines)
    return replace(family, omega=lines, G_p=G_p, G=_on_lines(family.nominal, lines))


def _between_lines(E: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Return deviations (M, W, n, m), with that of the nearest line where a member is unknown."""
    known = ~np.isnan(E).any(axis=(2, 3))
    nearest = [
        np.flatnonzero(row)[np.abs(omega[row] - omega[:, None]).argmin(axis=1)] for row in known
    ]
    return np.array([member[at] for member, at in zip(E, nearest, strict=True)])


def _fit_set(
    family: _Family, form: str, *, full: bool, order: int, rules: Extrapolation, perturbation: str
) -> UncertaintyModel:
    """Return the set with weights above the smallest ones on the lines; W_l carries the rule
    outside them.
    """
    dt, omega = timebase(family.nominal), family.omega
    if form == ELEMENTS:
        away = np.abs(_between_lines(family.G_p - family.G, omega)).max(axis=0)
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


def _reach_of_members(model: UncertaintyModel, family: _Family) -> _Reach:
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
