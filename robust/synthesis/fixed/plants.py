"""Plants line by line, in the form of the demands on a loop."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TypeAlias, cast

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust.analysis.loop import Loop, assemble_loop
from robust.lti.grids import BELOW_NYQUIST, controller_mode_lines, interpolate_frf, plant_features
from robust.lti.low_frequency import Reading, radius_below, read_below
from robust.lti.lti import response
from robust.lti.realisation import state_space
from robust.lti.stability import integrator_poles
from robust.models.sets.forms import FORMS, relative_radius
from robust.models.sets.measured import (
    PlantAlone,
    PlantLines,
    PlantSource,
    warn_of_unknown_hold,
)
from robust.models.sets.model import UncertaintyModel

#: |w| above which an inverse form is not treated as a disc: towards one the disc becomes a half
#: plane.
_LARGEST_DISC = 0.98
#: Factor above its features up to which a parametric plant is evaluated, for high-gain controllers;
#: and frequencies.
_FAR, _N_FAR = 1e5, 31
#: Points of the path between two lines, and maxima of |S| and |T| that become lines: at least this
#: share of the largest.
_PARTS, _NEAR_PEAK = 8, 0.7
#: The last lines of an FRF are those above the last one divided by this.
_LAST_LINES = 1.25
#: Least distance of two frequencies of a parametric plant [log], above rounding: those around a light
#: mode are far closer than its width.
_DISTINCT = 1e-12
#: Every such frequency below the first line of an FRF is a line of the demands.
_BELOW = 3


@value
class PlantOnLines:
    """One plant in front of the controller, hold and delay included."""

    omega: np.ndarray  # (W,) frequencies [rad/s]
    # G, centre: (W,) complex nominal response; centre of the disc of plants
    G: np.ndarray
    centre: np.ndarray
    radius: np.ndarray  # (W,) radius of that disc; zero without uncertainty
    # (W,) |w| where an inverse form comes near |w| = 1 or exceeds it, so that the set is not a
    # disc; zero elsewhere
    outside: np.ndarray
    inverse: np.ndarray  # (W,) |w| of an inverse form on S, zero for the other forms
    loop: Loop | None  # the parametric plant, if there is one: then stability follows from poles
    n_integrators: int  # number of integrators of a parametric plant
    # (W,) False at frequencies above the last line of an FRF, where it is assumed to be no larger
    # than there
    known: np.ndarray
    # lowest, highest: first and last measured line [rad/s]; below the first one an FRF is continued
    # by its integrators. For a parametric plant they exclude only the lines far above.
    lowest: float
    highest: float
    # readings, open_readings: possible continuations of an FRF below its first line, the likeliest
    # first: those that the design holds for, and others within the bound, for which it may not hold
    readings: tuple[Reading, ...] = ()
    open_readings: tuple[Reading, ...] = ()

    @property
    def on_lines(self) -> np.ndarray:
        """Return (W,) True between the first and the last line of an FRF."""
        return self.known & (self.omega >= self.lowest * (1 - 1e-12))

    @property
    def measured(self) -> tuple[np.ndarray, np.ndarray]:
        """Return lines and response of an FRF."""
        return self.omega[self.on_lines], self.G[self.on_lines]

    @property
    def rises_at_end(self) -> bool:
        """Return True if |G| rises over the last lines of an FRF by more than their bound
        allows.
        """
        (omega, G), radius = self.measured, self.radius[self.on_lines]
        last = np.union1d(
            np.flatnonzero(omega > omega[-1] / _LAST_LINES), np.arange(omega.size)[-4:]
        )
        x, y = np.log(omega[last]), np.log(np.abs(G[last]) + 1e-300)
        x = x - x.mean()
        error = radius[last] / np.abs(G[last])
        slope, spread = x @ y / (x @ x), np.sqrt(np.sum((x * error) ** 2)) / (x @ x)
        return bool(slope > spread + 1e-9)

    def held_for(self, readings: tuple[Reading, ...]) -> PlantOnLines:
        """Return the plant with these continuations to hold for, and all others left open."""
        left = tuple(one for one in self.readings + self.open_readings if one not in readings)
        return replace(self, readings=readings, open_readings=left)


@value
class KnownPlant:
    """The user's knowledge of an FRF: its unstable poles, its integrators and its sign; None if to
    be estimated.
    """

    n_unstable: int = 0
    n_integrators: int | None = None
    sign: int | None = None


#: Plants for a design.
DesignPlant: TypeAlias = "PlantLines | Bla | UncertaintyModel | AnySystem"


def plant_on_lines(
    plant: PlantSource,
    dt: float,
    delay: float,
    extra: tuple[float, ...],
    weights: tuple[object, ...],
    known: KnownPlant = KnownPlant(),  # noqa: B008
    K: Sequence[control.StateSpace] = (),
) -> PlantOnLines:
    """Return the plant, its disc and its lines; `extra` frequencies [rad/s] are added if it is
    known everywhere.

    K : controllers whose modes and loops are evaluated too; an FRF is interpolated there.
    """
    if isinstance(plant, PlantLines):
        return _measured_lines(plant, dt, delay, known, K)
    return _modelled_lines(plant, dt, delay, extra=extra, weights=weights, K=K)


def _with_discs(
    form: str,
    omega: np.ndarray,
    *,
    G: np.ndarray,
    w: np.ndarray,
    known: np.ndarray,
    n_integrators: int,
    band: tuple[float, float],
    loop: Loop | None = None,
) -> PlantOnLines:
    """Return a plant with the discs of a form of set, from responses and weights (W,) on its
    lines.
    """
    size = np.abs(G)
    inverse, w = FORMS[form].inverse, relative_radius(form, w, size)
    disc = w < _LARGEST_DISC
    outside = np.where(inverse & ~disc, w, 0.0)
    shrink = np.where(inverse & disc, 1 / np.maximum(1 - w**2, 1e-12), 1.0)
    return PlantOnLines(
        omega=omega,
        G=G,
        centre=G * shrink,
        radius=np.where(outside > 0, 0.0, size * w * shrink),
        outside=outside,
        inverse=np.where(inverse, w, 0.0),
        loop=loop,
        n_integrators=n_integrators,
        known=known,
        lowest=band[0],
        highest=band[1],
    )


def _measured_lines(
    plant: PlantLines,
    dt: float,
    delay: float,
    known: KnownPlant,
    K: Sequence[control.StateSpace],
) -> PlantOnLines:
    """Return an FRF, continued below its first line and above its last one."""
    if plant.G.shape[:2] != (1, 1):
        raise ValueError(
            "model must have one input and one output, got"
            f" {plant.G.shape[1]} and {plant.G.shape[0]}"
        )
    omega, G, form, w = plant.omega, plant.G[0, 0], plant.form, np.nan_to_num(np.abs(plant.w))
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(
            f"dt must put the Nyquist frequency above the highest line, {format_hertz(omega[-1])},"
            f" got {dt:g} s, whose Nyquist frequency is {0.5 / dt:g} Hz: give less than"
            f" {np.pi / omega[-1]:.3g} s, or design for a continuous model of these lines (robust"
            " model)"
        )
    G = G * plant.hold_and_delay_factor(omega, dt=dt, delay=delay)
    radius = relative_radius(form, w, np.abs(G)) * np.abs(G)
    n = omega.size
    band = (float(omega[0]), float(omega[-1]))
    readings = read_below(
        omega, G, radius, n_unstable=known.n_unstable, n_integrators=known.n_integrators
    )
    right = tuple(one for one in readings if one.sign == (known.sign or readings[0].sign))
    if not right:
        raise ValueError(
            "positive must be left out, because the gain of the plant is negative according to"
            " the phase of the FRF. Change the sign of u or y, or measure at lower frequency if"
            " this is wrong"
        )
    low = right[0]
    omega, G = np.concatenate([low.omega[::_BELOW], omega]), np.concatenate([low.G[::_BELOW], G])
    if FORMS[form].vanishes_with_plant:
        size = np.ones(omega.size)
    else:
        size = np.abs(G)
    w = np.concatenate([radius_below(omega[-n:], w / size[-n:]) * size[:-n], w])
    above = omega[-1] * np.geomspace(1.2, 100, 14)
    above = above[above * dt < 0.99 * np.pi]
    on_lines = np.arange(omega.size + above.size) < omega.size
    omega = np.concatenate([omega, above])
    G, w = (np.concatenate([part, np.full(above.size, part[-1])]) for part in (G, w))
    omega, G, w, on_lines = _add_mode_lines(K, omega, G=G, w=w, known=on_lines)
    seen = _with_discs(form, omega, G=G, w=w, known=on_lines, n_integrators=0, band=band)
    return replace(seen, readings=right, open_readings=() if known.sign else readings).held_for(
        right
    )


def _modelled_lines(
    plant: UncertaintyModel | PlantAlone,
    dt: float,
    delay: float,
    *,
    extra: tuple[float, ...],
    weights: tuple[object, ...],
    K: Sequence[control.StateSpace],
) -> PlantOnLines:
    """Return a parametric plant at the features of it, its weight, demands or controllers, and far
    above.
    """
    step = plant.dt
    if step and dt and abs(step / dt - 1) > 1e-9:
        raise ValueError(f"dt must be the sampling time of the plant, {step:g} s, got {dt:g} s")
    if dt:
        warn_of_unknown_hold(plant, dt)
    loop = assemble_loop(
        # a plant alone has all that a loop reads of a set
        cast("UncertaintyModel", plant),
        control.StateSpace([], [], [], [[0.0]], step or dt),
        w_P=None,
        delay=delay,
    )
    omega = _design_grid(loop, plant.omega, extra=extra, weights=weights, K=K)
    band = float(omega[0]), float(omega[-1])
    above = np.geomspace(1, _FAR, _N_FAR)[1:] * band[1]
    omega = np.concatenate([omega, above[above < loop.omega_max * BELOW_NYQUIST]])
    G = loop.plant_response(omega)
    # a line on an undamped mode has no response
    omega = omega[np.isfinite(G)]
    G = G[np.isfinite(G)]
    w, known = np.abs(response(loop.weight, omega)), np.ones(omega.size, dtype=bool)
    n = integrator_poles(loop.G, loop.dt)
    seen = _with_discs(
        plant.form, omega, G=G, w=w, known=known, n_integrators=n, band=band, loop=loop
    )
    if loop.aliases is None:
        return seen
    every = loop.aliases.sampled_radius(omega, G)
    return replace(
        seen, radius=np.where(np.isfinite(every), every, seen.radius)
    )  # without a bound the check decides


def _add_mode_lines(
    K: Sequence[control.StateSpace],
    omega: np.ndarray,
    *,
    G: np.ndarray,
    w: np.ndarray,
    known: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return lines, FRF, weight and its readings, with lines at modes of controllers and peaks of
    their loops.
    """
    modes = [controller_mode_lines(one, (omega[0], omega[-1])) for one in K]
    modes += [
        _loop_peak_lines(one, omega[known], G[known], at=np.union1d(omega[known], near))
        for one, near in zip(K, modes, strict=True)
    ]
    if not any(one.size for one in modes):
        return omega, G, w, known
    both, last = np.unique(np.concatenate([omega, *modes])), omega[known][-1]
    return both, interpolate_frf(both, omega, G), np.interp(both, omega, w), both <= last


def _loop_peak_lines(
    K: control.StateSpace, omega: np.ndarray, G: np.ndarray, *, at: np.ndarray
) -> np.ndarray:
    """Return frequencies between two of `at` at which |S| or |T| has a maximum near its largest,
    the FRF interpolated.
    """
    at = np.append(
        at[:-1, None] * (at[1:] / at[:-1])[:, None] ** (np.arange(_PARTS) / _PARTS), at[-1]
    )
    at = at[at <= omega[-1]]
    L = interpolate_frf(at, omega, G) * response(K, at)
    found = []
    for size in (np.abs(1 / (1 + L)), np.abs(L / (1 + L))):
        top = (
            (size[1:-1] > size[:-2])
            & (size[1:-1] > size[2:])
            & (size[1:-1] > _NEAR_PEAK * size.max())
        )
        found.append(at[1:-1][top])
    return np.setdiff1d(np.concatenate(found), omega)


def along_arcs(at: PlantOnLines) -> PlantOnLines:
    """Return an FRF along both paths that a mode or an anti-resonance may take between two lines.

    G is a straight line if an anti-resonance dominates, and 1/G if a mode does; G then follows an
    arc through zero (`passes_clear_of_minus_one`). A gain that is analytic between the two paths is
    largest on one of them.
    """
    lines = np.flatnonzero(at.on_lines)
    first, second, part = lines[:-1, None], lines[1:, None], np.arange(1, _PARTS) / _PARTS

    def paths(x: np.ndarray) -> np.ndarray:
        with np.errstate(all="ignore"):
            arc = 1 / ((1 - part) / x[first] + part / x[second])
        return np.concatenate([((1 - part) * x[first] + part * x[second]).ravel(), arc.ravel()])

    def larger(x: np.ndarray) -> np.ndarray:
        return np.tile(np.repeat(np.maximum(x[lines[:-1]], x[lines[1:]]), _PARTS - 1), 2)

    omega = np.tile((at.omega[first] * (at.omega[second] / at.omega[first]) ** part).ravel(), 2)
    return replace(
        at,
        omega=omega,
        G=paths(at.G),
        centre=paths(at.centre),
        radius=larger(at.radius),
        outside=larger(at.outside),
        inverse=larger(at.inverse),
        known=np.ones(omega.size, dtype=bool),
    )


def _design_grid(
    loop: Loop,
    lines: np.ndarray,
    *,
    extra: tuple[float, ...],
    weights: tuple[object, ...],
    K: Sequence[control.StateSpace],
) -> np.ndarray:
    """Return frequencies [rad/s] for a parametric plant: at its features and those of weight,
    demands, controllers.
    """
    if not lines.size:
        lines = plant_features(loop.G, loop.dt, extra)
    grids = [np.array(extra)]
    for w in (
        None,
        *(w for w in weights if isinstance(w, (control.StateSpace, control.TransferFunction))),
    ):
        if w is not None:
            w = state_space("weight", w)
        grids.append(replace(loop, w_P=w).grid(lines) if w is None or w.nstates else np.zeros(0))
    grids += [replace(loop, K=one).grid(lines) for one in K]
    omega = np.unique(np.concatenate(grids))
    omega = omega[(omega > 0) & (omega < loop.omega_max * BELOW_NYQUIST)]
    distinct = np.concatenate([[True], np.diff(np.log(omega)) > _DISTINCT])
    return omega[distinct | np.isin(omega, extra)]


def stacked_plants(plants: list[PlantOnLines]) -> PlantOnLines:
    """Return the plants of a family as one, line after line, so that a demand applies to all of
    them.
    """
    return PlantOnLines(
        omega=np.concatenate([s.omega for s in plants]),
        G=np.concatenate([s.G for s in plants]),
        centre=np.concatenate([s.centre for s in plants]),
        radius=np.concatenate([s.radius for s in plants]),
        outside=np.concatenate([s.outside for s in plants]),
        inverse=np.concatenate([s.inverse for s in plants]),
        known=np.concatenate([s.known for s in plants]),
        loop=None,
        n_integrators=0,
        lowest=max(s.lowest for s in plants),
        highest=max(s.highest for s in plants),
    )
