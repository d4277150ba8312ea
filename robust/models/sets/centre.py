"""The nominal at the centre of a set: a system, or an FRF that is known on its lines only.

A set chooses one of the two where it is made. What differs between a set around a system and one
around an FRF is a method here.
"""

from __future__ import annotations

from typing import Protocol, TypeAlias

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.values import value
from robust._base.types import AnySystem
from robust.lti.grids import interpolate_frf
from robust.lti.lti import frf_on_lines, response, response_by_channel, timebase
from robust.lti.realisation import frequency_response
from robust.models.fit.measurement import bla_behind_hold
from robust.models.sets.delta import Delta, Systems
from robust.models.sets.forms import FORMS

Plant: TypeAlias = "control.StateSpace | control.FrequencyResponseData"


class Centre(Protocol):
    """The nominal of a set; responses are (n_y, n_u, W) for any number of channels."""

    @property
    def dt(self) -> float:
        """Sampling time [s] of a system; 0 for an FRF."""
        ...

    def response(self, omega: np.ndarray) -> np.ndarray:
        """Return the response at omega [rad/s]."""
        ...

    def known_at(self, omega: np.ndarray) -> np.ndarray:
        """Return omega, moved into the band in which the nominal is known."""
        ...

    def between_lines(self, omega: np.ndarray) -> np.ndarray:
        """Return the response (n_y, n_u, W) at any omega [rad/s] in that band."""
        ...

    def describe(self) -> str:
        """Describe the nominal."""
        ...

    def clock_for(self, weight: control.StateSpace) -> float:
        """Return the sampling time [s] that a weight of the set must have."""
        ...

    def clocks(self, weights: Systems) -> tuple[AnySystem, ...]:
        """Return the systems whose sampling time a plant of the set must have."""
        ...

    def behind_hold(self, bla: Bla) -> Bla:
        """Return a record as the nominal describes it: behind the hold of a system."""
        ...

    def band(self, omega: np.ndarray, wide: np.ndarray) -> np.ndarray:
        """Return the frequencies of a picture: the lines omega, or a wider band if the nominal is
        known there.
        """
        ...

    def is_provable(self, plant: object) -> bool:
        """Return whether a deviation of the plant is known between the lines, too."""
        ...

    def beyond(self, delta: Delta, omega: np.ndarray) -> np.ndarray:
        """Return the frequencies outside the lines omega at which a drawn plant is compared."""
        ...

    def perturbed(self, delta: Delta, D: control.StateSpace, omega: np.ndarray) -> Plant:
        """Return the plant of a perturbation D; an FRF on the lines omega around an FRF."""
        ...


@value(copy=False)
class _SystemCentre:
    """A nominal that is a system, known at all frequencies."""

    system: control.StateSpace

    @property
    def dt(self) -> float:
        return timebase(self.system)

    def response(self, omega: np.ndarray) -> np.ndarray:
        return response_by_channel(self.system, omega)

    def known_at(self, omega: np.ndarray) -> np.ndarray:
        return omega

    def between_lines(self, omega: np.ndarray) -> np.ndarray:
        return self.response(omega)

    def describe(self) -> str:
        return f"{self.system.nstates} states"

    def clock_for(self, weight: control.StateSpace) -> float:
        del weight
        return self.dt

    def clocks(self, weights: Systems) -> tuple[AnySystem, ...]:
        return self.system, weights[0]

    def behind_hold(self, bla: Bla) -> Bla:
        return bla_behind_hold(bla, self.dt)

    def band(self, omega: np.ndarray, wide: np.ndarray) -> np.ndarray:
        del omega
        return wide

    def is_provable(self, plant: object) -> bool:
        return not isinstance(plant, control.FrequencyResponseData)

    def beyond(self, delta: Delta, omega: np.ndarray) -> np.ndarray:
        return delta.beyond(omega, self.dt)

    def perturbed(self, delta: Delta, D: control.StateSpace, omega: np.ndarray) -> Plant:
        del omega
        return delta.perturbed(self.system, D)


@value(copy=False)
class _FrfCentre:
    """A nominal that is an FRF of one channel: nothing is known between its lines."""

    frf: control.FrequencyResponseData

    @property
    def dt(self) -> float:
        return 0.0

    def response(self, omega: np.ndarray) -> np.ndarray:
        return frf_on_lines(self.frf, omega)[None, None]

    def known_at(self, omega: np.ndarray) -> np.ndarray:
        return np.clip(omega, np.min(self.frf.omega), np.max(self.frf.omega))

    def between_lines(self, omega: np.ndarray) -> np.ndarray:
        known, G = frequency_response("nominal", self.frf, omega)
        if omega[0] < known[0] * (1 - 1e-6) or omega[-1] > known[-1] * (1 + 1e-6):
            raise ValueError("nominal must be an FRF over the whole band of bla, got a shorter one")
        return interpolate_frf(omega, known, G)[None, None]

    def describe(self) -> str:
        return "an FRF"

    def clock_for(self, weight: control.StateSpace) -> float:
        return timebase(weight)

    def clocks(self, weights: Systems) -> tuple[AnySystem, ...]:
        del weights
        return (self.frf,)

    def behind_hold(self, bla: Bla) -> Bla:
        return bla

    def band(self, omega: np.ndarray, wide: np.ndarray) -> np.ndarray:
        del wide
        return omega

    def is_provable(self, plant: object) -> bool:
        del plant
        return False

    def beyond(self, delta: Delta, omega: np.ndarray) -> np.ndarray:
        del delta
        return omega[:0]

    def perturbed(self, delta: Delta, D: control.StateSpace, omega: np.ndarray) -> Plant:
        w, Delta, W = (response(X, omega) for X in (*delta.weights, D, delta.shaping))
        G = FORMS[delta.form].perturbed(W * frf_on_lines(self.frf, omega), w, Delta) / W
        return control.FrequencyResponseData(G, omega, self.frf.dt)


def centre_of(nominal: Plant) -> Centre:
    """Return the centre of a set with this nominal."""
    if isinstance(nominal, control.FrequencyResponseData):
        return _FrfCentre(frf=nominal)
    return _SystemCentre(system=nominal)
