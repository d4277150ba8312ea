"""Feedforward for an axis without a spring: mass, friction and jerk as gains of a drive, and the
remaining force.

    m a + c v + (Fc + (Fs - Fc) exp(-(v/vs)^2)) sign v = F,   T dF/dt + F = F*

The set point gives v, a and the jerk j. The lead T is the sum of lag, delay and half a period of
hold. To first order in T,

    F* = (m + c T) a + c v + m T j + (Fc + (Fs - Fc) exp(-(v/vs)^2)) sign v.

`robust.synthesis.feedforward_filter` is for plants that are stable by themselves; a free mass is
not stable.
"""

from __future__ import annotations

from functools import singledispatch
from itertools import product
from typing import TypeAlias

import control
import numpy as np

from nlfrf._base.arguments import require_kind, require_nonnegative, require_real, short_form
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust._base.types import LinearSystem
from robust.friction.plant import FrictionPlant
from robust.friction.reading.assumed_class import MachineWithFriction
from robust.friction.reading.from_blas import SIGMAS
from robust.lti.lti import response, timebase
from robust.lti.realisation import state_space
from robust.models.sets.model import UncertaintyModel
from robust.servo.gains.controller import solve_relative

#: Largest error of 1/(m s^2 + c s), relative to a plant that is accepted as such.
_MISFIT = 1e-6
#: Velocities, relative to vs, at which the error of the friction is searched.
_VELOCITIES = np.geomspace(1e-3, 1e2, 301)


#: A known number, or its lower and upper end.
Interval: TypeAlias = "float | tuple[float, float] | np.ndarray"


@value
class _FeedforwardGains:
    """Feedforward gains for mass, friction and jerk. Each parameter is an interval (2,), whose
    middle the gains use.

    `mass` [kg], `viscous` [Ns/m], `coulomb` [N], `stiction` [N] (friction at standstill) and
    `stribeck_velocity` [m/s]; for a rotary axis in rad and Nm. Without a Stribeck effect `stiction`
    is `coulomb`, and `stribeck_velocity` is nan. `lead` is the time T [s] by which the force
    follows its set point. With `settings` the gains have the units of the drive, otherwise they
    give a force.

    >>> found = feedforward(mass=(11.5, 12.5), viscous=20.0, coulomb=(14.0, 16.0))
    >>> float(found.force(0.1, 2.0)), float(found.error(0.1, 2.0))
    (41.0, 2.0)
    """

    mass: np.ndarray
    viscous: np.ndarray
    coulomb: np.ndarray
    stiction: np.ndarray
    stribeck_velocity: np.ndarray
    lead: float
    settings: Drive | None

    def force(
        self, v: float | np.ndarray, a: float | np.ndarray, j: float | np.ndarray = 0.0
    ) -> np.ndarray:
        """Return the force [N] or [Nm] to add for a velocity, acceleration and jerk of the set
        point.
        """
        m, c = self.mass.mean(), self.viscous.mean()
        middle = _friction_force(
            np.abs(v), self.coulomb.mean(), self.stiction.mean(), self.stribeck_velocity.mean()
        )
        return np.asarray((m + c * self.lead) * a + c * v + m * self.lead * j + middle * np.sign(v))

    def error(self, v: float | np.ndarray, a: float | np.ndarray) -> np.ndarray:
        """Return the largest error of the force [N] or [Nm] for every machine within the intervals.

        It holds while the axis moves in the direction of its set point, without terms of second
        order in the lead.
        """
        moving = np.where(np.asarray(v) != 0, self.friction_error, 0.0)
        return np.asarray(
            np.ptp(self.mass) / 2 * np.abs(a) + np.ptp(self.viscous) / 2 * np.abs(v) + moving
        )

    @property
    def friction_error(self) -> float:
        """Largest error of the dry friction over all velocities, q Fs [N] or [Nm]."""
        widest = np.nan_to_num(self.stribeck_velocity.max(), nan=1.0)
        v = _VELOCITIES * widest
        middle = _friction_force(
            v, self.coulomb.mean(), self.stiction.mean(), self.stribeck_velocity.mean()
        )
        corners = product(self.coulomb, self.stiction, self.stribeck_velocity)
        return float(
            max(np.max(np.abs(_friction_force(v, *corner) - middle)) for corner in corners)
        )

    @property
    def relative_error(self) -> float:
        """q: largest error of the dry friction, divided by the largest stiction; 0 without
        friction.

        While the axis slides in the direction of its set point the friction that is not compensated
        belongs to the class `Bounded(q * Fs)`.
        """
        if self.stiction[1]:
            return self.friction_error / self.stiction[1]
        return 0.0

    @property
    def drive_gains(self) -> tuple[tuple[str, float, str], ...]:
        """(signal that is multiplied, gain, unit) of each part, in the units of the drive; without
        a drive each part is a force.
        """
        base, force, scale = "m", "N", 1.0
        if self.settings is not None:
            base, force = self.settings.base_unit, self.settings.output_unit
            scale = self.settings.output_factor(force) / self.settings.output_factor(
                self.settings.force_unit
            )
        m, c = float(self.mass.mean()), float(self.viscous.mean())
        gains = [
            ("acceleration", m + c * self.lead, f"{force}/({base}/s^2)"),
            ("velocity", c, f"{force}/({base}/s)"),
        ]
        gains.append(("jerk", m * self.lead, f"{force}/({base}/s^3)"))
        gains.append(("sign of the velocity (Coulomb)", float(self.coulomb.mean()), force))
        rows = [(name, scale * gain, unit) for name, gain, unit in gains]
        if np.isfinite(self.stribeck_velocity).all():
            rows.append(
                (
                    "Stribeck, at standstill more",
                    scale * float((self.stiction - self.coulomb).mean()),
                    force,
                )
            )
            rows.append(("Stribeck velocity", float(self.stribeck_velocity.mean()), f"{base}/s"))
        return tuple(rows)

    def __str__(self) -> str:
        force = "N" if self.settings is None else self.settings.force_unit
        rows = [f"{name}: {gain:.6g} {unit}" for name, gain, unit in self.drive_gains]
        return "\n".join(
            [
                *rows,
                (
                    f"uncompensated dry friction in motion: {self.friction_error:.3g} {force},"
                    f" {100 * self.relative_error:.3g} % of stiction (all of it at standstill and"
                    " at a reversal)"
                ),
            ]
        )


def feedforward(
    plant: LinearSystem | UncertaintyModel | FrictionPlant | MachineWithFriction | None = None,
    *,
    mass: Interval | None = None,
    viscous: Interval | None = None,
    coulomb: Interval = 0.0,
    stiction: Interval | None = None,
    stribeck_velocity: Interval | None = None,
    settings: Drive | None = None,
) -> _FeedforwardGains:
    """Return the feedforward gains of a drive for an axis without a spring.

    Use this for a free axis, for which `robust.synthesis.feedforward_filter` has no stable plant to
    invert.

    Parameters
    ----------
    plant : control.StateSpace, TransferFunction, UncertaintyModel, FrictionPlant or MachineWithFriction, optional
        Plant 1/(m s^2 + c s) from force [N] or [Nm] to position [m] or [rad]. Of a
        `MachineWithFriction` the mass is used, with an interval of three standard deviations to
        either side. Without a plant, `mass` is needed.
    mass, viscous : float or (low, high), optional
        Mass [kg] or inertia [kg m^2], and viscous friction [Ns/m] or [Nm s/rad], as a number or an
        interval. They replace the values of the plant.
    coulomb, stiction : float or (low, high)
        Friction force while sliding, and at standstill [N] or [Nm].
    stribeck_velocity : float or (low, high), optional
        Velocity vs [m/s] or [rad/s] in exp(-(v/vs)^2), by which friction falls from `stiction` to
        `coulomb`. Required with `stiction`.
    settings : Drive, optional
        Drive. The jerk gain is computed from its lag and delay, and the gains are in its units
        (with its torque constant).

    Returns
    -------
    FeedforwardGains

    Raises
    ------
    ValueError
        A plant that is not 1/(m s^2 + c s); no mass; an interval whose lower end is above the upper
        end; a stiction below the Coulomb friction.

    References
    ----------
    B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30, 1994.

    Examples
    --------
    >>> from nlfrf.rig import Drive
    >>> drive = Drive(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=50.0, lag=0.3e-3)
    >>> print(feedforward(control.tf([1], [12, 20, 0]), coulomb=(14, 16), settings=drive))
    acceleration: 0.24027 A/(m/s^2)
    velocity: 0.4 A/(m/s)
    jerk: 0.000162 A/(m/s^3)
    sign of the velocity (Coulomb): 0.3 A
    uncompensated dry friction in motion: 1 N, 6.25 % of stiction (all of it at standstill and at a reversal)
    """
    if settings is not None:
        require_kind("settings", settings, Drive)
        settings.output_factor(settings.force_unit)
    read = (None, None) if plant is None else _rigid_body(plant)
    if mass is None:
        mass = read[0]
    if viscous is None:
        viscous = read[1]
    if mass is None:
        raise ValueError("mass must be given [kg] without a plant, got none")
    if stiction is not None and stribeck_velocity is None:
        raise ValueError("stribeck_velocity must be given with stiction, got none")
    if stiction is None and stribeck_velocity is not None:
        raise ValueError("stiction must be given with stribeck_velocity, got none")
    found = {
        "mass": _interval("mass", mass),
        "viscous": _interval("viscous", 0.0 if viscous is None else viscous),
        "coulomb": _interval("coulomb", coulomb),
        "stiction": _interval("stiction", coulomb if stiction is None else stiction),
        "stribeck_velocity": (
            np.full(2, np.nan)
            if stribeck_velocity is None
            else _interval("stribeck_velocity", stribeck_velocity)
        ),
    }
    for name in ("mass", "stribeck_velocity"):
        if found[name][0] <= 0:
            raise ValueError(f"{name} must be positive, got {found[name][0]:g}")
    if np.any(found["stiction"] < found["coulomb"]):
        raise ValueError(
            f"stiction must be at least coulomb, {found['coulomb'].tolist()}, got"
            f" {found['stiction'].tolist()}"
        )
    if settings is None:
        lead = 0.0
    else:
        lead = settings.lag + settings.delay + settings.dt / 2
    return _FeedforwardGains(**found, lead=lead, settings=settings)


def _friction_force(
    v: np.ndarray, coulomb: float, stiction: float, stribeck_velocity: float
) -> np.ndarray:
    """Return the dry friction at a speed v >= 0, which falls from stiction to Coulomb friction
    (Stribeck).
    """
    if np.isnan(stribeck_velocity):
        return np.asarray(coulomb + 0.0 * v)
    return np.asarray(coulomb + (stiction - coulomb) * np.exp(-((v / stribeck_velocity) ** 2)))


def _interval(name: str, given: Interval) -> np.ndarray:
    """Return (2,) least and largest value of a number or a pair."""
    if np.size(given) == 2:
        low, high = (require_nonnegative(name, float(end)) for end in np.ravel(given))
        if low > high:
            raise ValueError(f"{name} must be (low, high), got {short_form((low, high))}")
        return np.array([low, high])
    return np.full(2, require_nonnegative(name, require_real(name, given)))


@singledispatch
def _rigid_body(plant: object) -> tuple[Interval, Interval | None]:
    """Return mass and viscous friction of a plant: the mass with its interval, and None for an
    unknown friction.
    """
    return _read_rigid_body(state_space("plant", plant))


@_rigid_body.register(MachineWithFriction)
def _body_of_machine(plant: MachineWithFriction) -> tuple[Interval, Interval | None]:
    spread = SIGMAS * plant.mass_std
    return (plant.mass - spread, plant.mass + spread), None


@_rigid_body.register(FrictionPlant)
def _body_of_friction_plant(plant: FrictionPlant) -> tuple[Interval, Interval | None]:
    force_to_position = control.StateSpace(
        plant.A, plant.B_force[:, None], plant.C_measured[None], 0, 0
    )
    return _read_rigid_body(state_space("plant", force_to_position))


@_rigid_body.register(UncertaintyModel)
def _body_of_set(plant: UncertaintyModel) -> tuple[Interval, Interval | None]:
    return _read_rigid_body(state_space("plant", plant.nominal))


def _read_rigid_body(plant: control.StateSpace) -> tuple[float, float]:
    """Return m and c of a plant 1/(m s^2 + c s), by its response."""
    if timebase(plant):
        raise ValueError(f"plant must be continuous, got one sampled at {timebase(plant):g} s")
    rate = float(np.max(np.abs(plant.poles()), initial=0.0)) or 1.0
    omega = rate * np.geomspace(1e-2, 1e2, 41)
    with np.errstate(all="ignore"):
        G = response(plant, omega)
        columns = np.stack([-(omega**2), 1j * omega]) * G  # m s^2 + c s = 1/G
    if not np.isfinite(columns).all():
        raise ValueError("plant must be 1/(m s^2 + c s), got a response that is not finite")
    m, c = solve_relative(columns, np.ones(omega.size))
    misfit = float(np.max(np.abs(m * columns[0] + c * columns[1] - 1)))
    if not (misfit <= _MISFIT and m > 0):
        raise ValueError(
            f"plant must be 1/(m s^2 + c s), got a relative error of {misfit:.2g} to the nearest"
            " such plant: give mass and viscous of all moving parts instead"
        )
    return float(m), max(float(c), 0.0)
