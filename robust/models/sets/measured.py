"""A plant that is known on measured lines only, in the form that a controller needs."""

from __future__ import annotations

from dataclasses import field, replace
from functools import singledispatch
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import data_warning
from nlfrf._base.values import value
from robust._base.warnings import DesignWarning
from robust.lti.lti import response, timebase
from robust.lti.realisation import state_space
from robust.lti.sampling import hold_correction, hold_response
from robust.models.fit.measurement import frd
from robust.models.sets.forms import DEFAULT_FORM
from robust.models.sets.model import UncertaintyModel
from robust.models.sets.radius import RadiusSpec, record_radius_parts, sum_of_parts
from robust.models.sets.records import Origin, RecordHold

#: Any object with an FRF on its lines.
FrfSource: TypeAlias = UncertaintyModel | Bla | control.FrequencyResponseData
# largest rate of the record over that of the controller at which the holds may be the same
_RATE_RATIO = 1.5


@value
class PlantLines:
    """A plant that is known on its lines only, with one channel or several, and the set around
    it.
    """

    omega: np.ndarray  # (W,) lines [rad/s]
    G: np.ndarray  # (n_y, n_u, W) complex plant
    w: np.ndarray  # (W,) complex weight; nan without a set
    W: np.ndarray  # (W,) complex scaling of the plant, if the form depends on its units
    form: str = DEFAULT_FORM
    perturbation: str = "LTI"  # class of the set
    hold: RecordHold | None = None  # None for an FRF from another program
    unit: str = ""
    dt: float = 0.0  # sampling time of a sampled FRF [s]; 0 for any other

    def hold_and_delay_factor(self, omega: np.ndarray, *, dt: float, delay: float) -> np.ndarray:
        """Return (W,) the factor that the FRF lacks: the delay, and a zero-order hold if only the
        controller is sampled.

        Aliasing from above Nyquist is unknown and left out.
        """
        factor = np.exp(-1j * omega * delay)
        hold = self.hold
        if hold is not None and hold.kind != "unknown":
            return np.asarray(factor * hold_correction(omega, hold.kind, fs=hold.fs, dt=dt))
        if dt and not self.dt:
            _warn_of_hold(hold, dt)
            return np.asarray(factor * hold_response(omega, dt))
        return factor


@value
class SeenLines(PlantLines):
    """A plant on its lines that includes hold and delay."""

    def hold_and_delay_factor(self, omega: np.ndarray, *, dt: float, delay: float) -> np.ndarray:
        del dt, delay
        return np.ones(omega.size)


@singledispatch
def lines_of(plant: object) -> PlantLines | None:
    """Return a plant that is known on its lines only by these; None for any other object."""
    del plant
    return None


@lines_of.register(PlantLines)
def _same_lines(plant: PlantLines) -> PlantLines:
    return plant


@lines_of.register(Bla)
def lines_of_bla(plant: Bla) -> PlantLines:
    n = plant.omega.size
    seen = PlantLines(
        omega=plant.omega,
        G=plant.G.reshape(plant.n_outputs, plant.n_inputs, n),
        w=np.full(n, np.nan + 0j),
        W=np.ones(n),
        hold=RecordHold(kind=plant.hold, fs=plant.fs),
        unit=plant.unit,
    )
    if not plant.is_single:
        return seen
    disc = sum_of_parts(record_radius_parts(plant, frd(plant), RadiusSpec()))
    return replace(seen, w=disc / np.abs(plant.G) + 0j, perturbation="statistical")


@lines_of.register(control.FrequencyResponseData)
def lines_of_frf(plant: control.FrequencyResponseData) -> PlantLines:
    omega = np.asarray(plant.omega, dtype=float)
    return PlantLines(
        omega=omega,
        G=np.asarray(plant.frdata),
        w=np.full(omega.size, np.nan + 0j),
        W=np.ones(omega.size),
        dt=float(plant.dt or 0),
    )


@lines_of.register(UncertaintyModel)
def _lines_of_set(plant: UncertaintyModel) -> PlantLines | None:
    if not plant.measured_only:
        return None
    return PlantLines(
        omega=plant.omega,
        G=plant.centre.response(plant.omega),
        w=response(plant.weight, plant.omega),
        W=response(plant.shaping, plant.omega),
        form=plant.form,
        perturbation=plant.perturbation,
        hold=plant.origin.hold,
        unit=plant.unit,
        dt=float(plant.nominal.dt or 0),
    )


@value
class PlantAlone:
    """A plant with one channel and without uncertainty, in the place of a set."""

    nominal: control.StateSpace
    weight: control.StateSpace  # zero
    shaping: control.StateSpace  # one
    form: str = DEFAULT_FORM
    perturbation: str = "LTI"
    omega: np.ndarray = field(default_factory=lambda: np.zeros(0))
    origin: Origin = Origin()

    @property
    def dt(self) -> float:
        """Sampling time [s] of the plant; 0 for continuous time."""
        return timebase(self.nominal)


#: A plant as a design sees it.
PlantSource: TypeAlias = PlantLines | UncertaintyModel | PlantAlone


def source_of(name: str, plant: object) -> PlantSource:
    """Return a plant with one channel by its lines if it is known there only, else as a set."""
    return lines_of(plant) or _set_of(name, plant)


def _set_of(name: str, plant: object) -> UncertaintyModel | PlantAlone:
    """Return a set unchanged, and a system with one channel as the set of this plant alone."""
    if isinstance(plant, UncertaintyModel | PlantAlone):
        return plant
    G = state_space(name, plant)
    zero, one = (control.StateSpace([], [], [], [[x]], timebase(G)) for x in (0.0, 1.0))
    return PlantAlone(nominal=G, weight=zero, shaping=one)


def warn_of_unknown_hold(model: UncertaintyModel | PlantAlone, dt: float) -> None:
    """Warn if the record may contain the hold of the controller, which is then counted twice.

    A sampled nominal has its hold inside.
    """
    if not model.dt:
        _warn_of_hold(model.origin.hold, dt)


def _warn_of_hold(hold: RecordHold | None, dt: float) -> None:
    if hold is not None and hold.kind == "unknown" and dt * hold.fs < _RATE_RATIO:
        data_warning(
            f"hold of the record (sampled at {hold.fs:g} Hz) is unknown: the check adds the hold of"
            f" the controller at {1 / dt:g} Hz, but if u was the command of a converter, the"
            " record already contains a hold, which is then counted twice. Load the record with"
            ' hold="zoh" (u is the command) or hold="band-limited" (u was measured after the'
            " hold)",
            DesignWarning,
        )
