"""The members of a family of plants on the lines where they are compared, and their nominal."""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from typing import TypeGuard

import control
import numpy as np

from nlfrf import DataWarning
from nlfrf._base.arguments import data_warning, short_form
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust._base.warnings import DesignWarning
from robust.lti.lti import poles as poles_of
from robust.lti.lti import response_by_channel, timebase, to_s_plane
from robust.lti.realisation import frequency_response, multivariable
from robust.models.fit.nominal import fit_nominal
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.forms import BLOCK_FORMS, ELEMENTS
from robust.models.sets.membership import require_equal_roots
from robust.models.sets.model import count_channels, format_channels

# lines over the band of all poles, and the factor by which they extend it
_N_LINES = 50
_FAR_RATIOS = np.array(
    [10.0, 100.0, 1e3, 1e4]
)  # factors outside the band of all poles at which members are checked
_BAND_RATIO = 30.0
_HALF_WIDTHS = np.array([-2.0, -1.0, 0.0, 1.0, 2.0])  # lines at a resonance
_MAX_LINES = 160
_MAX_CONDITION = 1e9  # condition number above which the inverse of a plant is rounding
_MAX_RISE = 100.0  # far deviation over the largest on the lines, above which it has no limit
#: Numbers of poles tried for a nominal; the first with a misfit below this share of the spread is
#: taken.
_NOMINAL_ORDERS, _MISFIT_SHARE = (1, 2, 3, 4, 5, 6, 8, 10, 12, 16), 0.1
_MIN_SPREAD = 1e-3  # least spread, over the largest entry on a line


@value
class Family:
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
        E = between_lines(row.deviation(self.G_p, self.G), self.omega)
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
    form: str, family: Family, omega: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the frequencies at which rounding does not dominate the deviations, with members and
    nominal there.

    Far outside the band a plant may be almost singular, and its inverse is rounding.
    """
    shape = (len(family.systems), omega.size, *family.G.shape[1:])
    members = np.array([on_lines(system, omega) for system in family.systems]).reshape(shape)
    nominal = on_lines(family.nominal, omega)
    if form != ELEMENTS and BLOCK_FORMS[form].needs_square_plant:
        with np.errstate(all="ignore"):
            decided = np.all(
                np.linalg.cond(np.concatenate([nominal[None], members])) < _MAX_CONDITION, axis=0
            )
        omega, members, nominal = omega[decided], members[:, decided], nominal[decided]
    return omega, members, nominal


def make_family(plants: list[AnySystem], nominal: NominalFit | AnySystem | None) -> Family:
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
    return Family(
        omega=omega, G_p=G_p, G=on_lines(given, omega), nominal=given, systems=tuple(systems)
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


def on_lines(system: control.StateSpace, omega: np.ndarray) -> np.ndarray:
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


def between_lines(E: np.ndarray, omega: np.ndarray) -> np.ndarray:
    """Return deviations (M, W, n, m), with that of the nearest line where a member is unknown."""
    known = ~np.isnan(E).any(axis=(2, 3))
    nearest = [
        np.flatnonzero(row)[np.abs(omega[row] - omega[:, None]).argmin(axis=1)] for row in known
    ]
    return np.array([member[at] for member, at in zip(E, nearest, strict=True)])
