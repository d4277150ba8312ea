"""Simulation of the identified axis under its drive, with every friction law that the records do
not refute.

A simulation proves nothing: with another history or another friction law the axis may behave
differently.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeAlias

import numpy as np

import nlfrf
from nlfrf._base.values import value
from nlfrf.rig import Drive
from robust.friction.reading.force import FrictionForce, coupled_load
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.units import format_length

Law: TypeAlias = (
    "nlfrf.friction.Coulomb | nlfrf.friction.VaryingSliders | nlfrf.friction.Dahl |"
    " nlfrf.friction.LuGre | nlfrf.friction.Leuven"
)
#: Friction laws to try; Leuven has an exponential virgin curve.
_LAWS = ("rigid", "Maxwell slip or GMS", "Dahl", "LuGre", "Leuven")
#: Laws that need no shorter integration steps if the friction is stiff.
_STIFF = ("rigid", "Maxwell slip or GMS")
#: Number of runs; the laws take turns. On ten axes that hunt, rigid friction, Maxwell slip and
#: LuGre with the same numbers hunted by the same amplitude to 8 %, Leuven by up to 19 % less and in
#: fewer runs (benchmarks/bench_stranger.py).
_RUNS = 12
#: Stribeck velocity [m/s] or [rad/s] if the records do not show it: the range that
#: Armstrong-Hélouvry reports.
_STRIBECK_VELOCITY = (5e-4, 5e-2)
#: Deflections at which the elements of Maxwell slip begin to slip, over their mean.
_DEFLECTIONS = np.array([0.25, 0.5, 1.0, 2.0])
#: Upper limit for the resonance of the mass on its friction, over the sampling frequency. A drive
#: cannot tell stiffer friction from it, so it also bounds a stiffness that the encoder does not
#: resolve.
_STIFFEST = 0.25
#: Number of moves of the set point; time of each move, and of the hold after them, in reset times
#: of the velocity loop; share at the end of the hold that is evaluated.
_MOVES, _MOVE, _HOLD, _LAST = 3, 15.0, 250.0, 0.25
#: Peak-to-peak motion above which the axis hunts, over the position error whose force command is
#: Coulomb friction. At that size the integral takes about 1/0.02 reset times to wind up.
_SWINGS = 0.02
#: Number of hunting runs from which the axis counts as hunting, a third of all: fewer runs have
#: several numbers at an end of their intervals. Among 23 axes that hunt and 32 that rest
#: (benchmarks/bench_stranger.py), a limit of 2 runs calls 23 and 10 of them hunting, 4 runs 23 and
#: 5, 6 runs 18 and 1.
_FEWEST = 4
#: Changes of a drive to try against hunting, the mildest first: gain, and factor on it.
_CHANGES = (
    ("tn", 1.5),
    ("kv", 2 / 3),
    ("kp", 1.5),
    ("tn", 2.0),
    ("kv", 0.5),
    ("tn", 3.0),
    ("kv", 1 / 3),
    ("tn", np.inf),
)

#: Distance [m] or [rad] below which a simulated axis counts as at its set point.
SHOWN = 1e-9
_KEPT = "the linear loop passes with it"


@value(in_sentences=True)
class SimulatedRest:
    """Simulated runs of an axis under its drive, and whether it rests or hunts at their end.

    Fields
    ------
    laws : tuple of str
        Friction laws not refuted by the records. Bristles too stiff for the encoder are simulated
        as rigid friction.
    amplitudes : (runs,) ndarray
        Half the peak-to-peak motion at the end [m] or [rad]; zero at rest, nan if the integration
        failed.
    periods : (runs,) ndarray
        Period of the motion [s]; nan at rest.
    unit : str
        Unit of the position.
    offsets : (runs,) ndarray or None
        Largest distance from the set point at the end [m] or [rad].
    advice : str
        The mildest change of the drive that helps; empty if the axis rests, or if no change helps.

    References
    ----------
    B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30, 1994 (hunting, Stribeck
    velocities).
    """

    laws: tuple[str, ...]
    amplitudes: np.ndarray
    periods: np.ndarray
    unit: str = "m"
    offsets: np.ndarray | None = None
    advice: str = ""

    @property
    def hunts(self) -> bool:
        """True if the axis moves for ever in `_FEWEST` runs or more."""
        return self.count >= _FEWEST

    @property
    def count(self) -> int:
        """Number of runs that hunt."""
        return int(np.count_nonzero(self.amplitudes > 0))

    @property
    def ended(self) -> int:
        """Number of runs without a failed integration."""
        return int(np.count_nonzero(np.isfinite(self.amplitudes)))

    @property
    def amplitude(self) -> float:
        """Median amplitude of the runs that hunt [m] or [rad]; zero if none hunts."""
        if self.count:
            return float(np.median(self.amplitudes[self.amplitudes > 0]))
        return 0.0

    def __str__(self) -> str:
        ended, laws = self.ended, ", ".join(self.laws)
        of = (
            f"{ended} runs from random moves, with friction as read ({laws}); a simulation proves"
            " nothing"
        )
        if ended < self.amplitudes.size:
            of += f"; {self.amplitudes.size - ended} more failed"
        does = f"rests in {ended - self.count if self.count else 'all'}"
        if self.hunts:
            does = f"hunts {self.describe_swing()}, in {self.count}"
        return f"{does} of {of}{self.describe_end()}"

    @property
    def offset(self) -> float:
        """Largest distance from the set point at the end [m] or [rad]; nan if none is known."""
        if self.offsets is None:
            known = np.zeros(0)
        else:
            known = self.offsets[np.isfinite(self.offsets)]
        if known.size:
            return float(known.max())
        return np.nan

    def describe_end(self) -> str:
        """Return a clause with the largest distance from the set point at the end; empty if
        unknown.
        """
        if not np.isfinite(self.offset):
            return ""
        far = format_length(max(self.offset, SHOWN), self.unit)
        return (
            f"; eventually {'less than' if self.offset < SHOWN else 'at most'} {far} off the set"
            " point"
        )

    def describe_swing(self) -> str:
        """Return amplitude and period of the hunting as text."""
        return (
            f"by +-{format_length(self.amplitude, self.unit)}, once in"
            f" {float(np.nanmedian(self.periods)):.2g} s"
        )


def _laws_not_refuted(force: FrictionForce) -> tuple[str, ...]:
    """Return the friction laws not refuted by the records.

    A resolved stiffness refutes rigid friction, creep refutes rigid friction and Maxwell slip,
    stiction refutes Dahl.
    """
    refuted = {
        "rigid": force.creeps or bool(np.isfinite(force.K0[1])),
        "Maxwell slip or GMS": force.creeps,
        "Dahl": bool(force.Fs[0] > force.sliding.interval("coulomb")[1]),
    }
    return tuple(law for law in _LAWS if not refuted.get(law))


def reason_against_simulation(force: FrictionForce | None, settings: Drive, masses: int = 1) -> str:
    """Return the reason why an axis is not simulated; empty if it is."""
    if masses > 1 and (force is None or force.load is None):
        return "motor and load were not separated"
    if force is None or not np.isfinite(force.Fs).all():
        return "the break-away force is not known"
    if settings.velocity_from == "observer" or settings.encoder != "motor":
        return (
            "the simulation takes only a drive with the encoder on the motor and a velocity from"
            " differences"
        )
    if not settings.kv:
        return "without a position loop the axis has no set point to rest at"
    return ""


def simulate_rest(
    force: FrictionForce,
    settings: Drive,
    *,
    order: Sequence[int] = range(_RUNS),
    most: float = np.inf,
) -> SimulatedRest:
    """Simulate an axis in random moves and a final hold, with numbers drawn from their intervals.

    force : machine and friction as read, in the units of the drive (N and m, or Nm and rad). order
    : indices of the runs, below `_RUNS`. All drives get the same draws, so two drives differ by
    their gains alone. most : amplitude [m] or [rad] above which the simulation stops.
    """
    from scipy.stats import qmc

    laws = _laws_not_refuted(force)
    if "rigid" in laws:
        run = tuple(law for law in laws if law in _STIFF)
    else:
        run = laws
    draws = qmc.Sobol(4 + _MOVES, seed=1).random_base2(int(np.ceil(np.log2(_RUNS))))
    found: list[tuple[float, float, float]] = []
    for k in order:
        found.append(_run_to_the_end(run[k % len(run)], force, settings, draws[k]))
        if found[-1][0] > most:
            break
    amplitudes, periods, offsets = np.array(found).T
    return SimulatedRest(
        laws=laws, amplitudes=amplitudes, periods=periods, unit=settings.base_unit, offsets=offsets
    )


def _run_to_the_end(
    law: str, force: FrictionForce, settings: Drive, draws: np.ndarray
) -> tuple[float, float, float]:
    """Return amplitude [m], period [s] and offset [m] of one run, for (4 + MOVES,) draws between
    zero and one.
    """
    axis, oversampling = _draw_axis(law, force, settings, draws[:4])
    way = _coulomb_of(force) / (_gain_in_force(settings) * settings.kv)
    if np.isfinite(settings.tn):
        reset = settings.tn
    else:
        reset = 1 / settings.kv
    move, hold = (int(count * reset * settings.fs) + 1 for count in (_MOVE, _HOLD))
    ends = way * np.cumsum(10 ** (1.5 * draws[4:] - 1) * np.resize([1.0, -1.0], _MOVES))
    position = np.concatenate([np.repeat(ends, move), np.full(hold, ends[-1])])
    trace = nlfrf.rig.run(axis, position, oversampling=oversampling)
    if trace.diverged:
        return np.nan, np.nan, np.nan
    last = trace.x[0][-int(_LAST * hold) :]
    swing, offset = float(np.ptp(last)), float(np.abs(last - ends[-1]).max())
    if swing < _SWINGS * way:
        return 0.0, np.nan, offset
    away = last - (last.max() + last.min()) / 2
    turns = np.count_nonzero(np.diff(np.sign(away[np.abs(away) > swing / 4])))
    return swing / 2, 2 * last.size / settings.fs / turns if turns else np.nan, offset


def with_load(force: FrictionForce, fit: FrictionFit | None) -> FrictionForce:
    """Return the friction with its load, if the fit of the levels has motor, load and the spring
    between them.
    """
    if fit is None or not fit.load_mass or not force.sliding.mass > fit.load_mass:
        return force
    if not np.isfinite([fit.stds[name] for name in ("mass", "load_mass", "coupling")]).all():
        return force
    if fit.Fs > 0:
        share = float(np.clip(fit.load_Fs / fit.Fs, 0.0, 1.0))
    else:
        share = np.nan
    return replace(force, load=coupled_load(fit, share))


def _draw_axis(
    law: str, force: FrictionForce, settings: Drive, draws: np.ndarray
) -> tuple[nlfrf.rig.ServoAxis, int]:
    """Return the axis with a friction law for (4,) draws, and the number of integration steps in a
    period.
    """
    friction, steps = _draw_friction(law, force, settings, draws)
    motion = "linear" if settings.base_unit == "m" else "rotary"
    damping = max(0.0, force.sliding.damping)
    axis = nlfrf.rig.ServoAxis(
        motor_inertia=force.sliding.mass,
        drive=settings,
        motor_friction=friction,
        motor_damping=damping,
        motion=motion,
    )
    if (load := force.load) is None:
        return axis, steps

    def part(share: float) -> Law | None:
        sliding = replace(force.sliding, coulomb=share * force.sliding.coulomb)
        own = replace(force, sliding=sliding, Fs=share * force.Fs, K0=share * force.K0)
        if share:
            return _draw_friction(law, own, settings, draws)[0]
        return None

    if np.isnan(load.share):
        at_load = float(draws[1])
    else:
        at_load = load.share
    coupled = replace(
        axis,
        motor_inertia=force.sliding.mass - load.mass,
        motor_friction=part(1 - at_load),
        load_inertia=load.mass,
        load_friction=part(at_load),
        stiffness=load.stiffness,
        damping=load.damping,
    )
    return coupled, steps


def _coulomb_of(force: FrictionForce) -> float:
    """Return the Coulomb friction [N], at most the break-away force."""
    return float(min(abs(force.sliding.coulomb), force.Fs[1]))


def _draw_friction(
    law: str, force: FrictionForce, settings: Drive, draws: np.ndarray
) -> tuple[Law, int]:
    """Return a friction law with numbers from their intervals for (4,) draws, and the integration
    steps in a period.
    """
    Fc = _coulomb_of(force)
    Fs = max(force.Fs[0], Fc) ** (1 - draws[0]) * force.Fs[1] ** draws[0]
    stiffest = force.sliding.mass * (2 * np.pi * _STIFFEST * settings.fs) ** 2
    low, high = np.fmin(force.K0, stiffest)  # nan: any stiffness
    K0 = low * (high / low) ** draws[1]
    slowest, fastest = np.where(np.isnan(force.stribeck), _STRIBECK_VELOCITY, force.stribeck)
    vs = min(slowest, fastest) ** (1 - draws[2]) * fastest ** draws[2]
    # slip at the lowest levels looks like damping, so the damping of the bristles is at most half
    # of the critical one
    damping = draws[3] * np.fmin(force.bristle_time, np.sqrt(force.sliding.mass / K0)) * K0
    if law == "rigid":
        return nlfrf.friction.Coulomb(Fc=Fc, Fs=Fs, vs=vs), 1
    if law == "Maxwell slip or GMS":
        k = np.full(_DEFLECTIONS.size, K0 / _DEFLECTIONS.size)
        strength = Fs * _DEFLECTIONS / _DEFLECTIONS.sum()
        return (
            nlfrf.friction.VaryingSliders(stiffness=k, strength=strength, stiction=Fs / Fc, vs=vs),
            1,
        )
    # bristles relax at the rate K0 |v| / Fc while they slip; the fastest move has this v
    speed = 3 * Fc / _gain_in_force(settings)
    steps = int(np.ceil(K0 * speed / Fc / settings.fs))
    if law == "Dahl":
        return nlfrf.friction.Dahl(sigma0=K0, Fc=Fs), steps
    if law == "LuGre":
        return (
            nlfrf.friction.LuGre(sigma0=K0, sigma1=damping, sigma2=0.0, Fc=Fc, Fs=Fs, vs=vs),
            steps,
        )
    curve = nlfrf.hysteresis.Exponential(K0=K0, Fy=1.02 * Fs)  # reaches Fs
    return (
        nlfrf.friction.Leuven(Fs=Fs, Fc=Fc, vs=vs, sigma1=damping, sigma2=0.0, curve=curve),
        steps,
    )


def _gain_in_force(settings: Drive) -> float:
    """Return the gain of the velocity loop in terms of force [N s/m] or [Nm s/rad]."""
    return settings.gain * settings.output_factor(settings.force_unit)


def with_advice(
    found: SimulatedRest, force: FrictionForce, settings: Drive, keeps: Callable[[Drive], bool]
) -> SimulatedRest:
    """Return the result with the mildest change of the drive that brings rest, or else halves the
    amplitude.

    keeps : function that returns whether the linear loop passes with a drive.
    """
    halved, most = "", found.amplitude / 2
    order = np.argsort(-found.amplitudes, kind="stable").tolist()
    for name, factor in _CHANGES if found.hunts else ():
        old = getattr(settings, name)
        if not np.isfinite(old):
            continue
        other = replace(settings, **{name: factor * old})
        after = simulate_rest(force, other, order=order, most=most)
        if not np.all(after.amplitudes <= most) or not keeps(other):
            continue
        change = (
            f"{name} {_format_gain(name, old, settings)} ->"
            f" {_format_gain(name, factor * old, settings)}"
        )
        if not after.count:
            rests = f"{change}: rests in all runs{_describe_offset(force, other)}, {_KEPT}"
            return replace(found, advice=f"{halved}; or {rests}" if halved else rests)
        halved = f"{change}: hunts by +-{format_length(after.amplitude, found.unit)}, {_KEPT}"
        most = 0.0
    return replace(found, advice=halved)


def _describe_offset(force: FrictionForce, settings: Drive) -> str:
    """Return a clause with the largest distance of rest from the set point; empty with an integral
    part.
    """
    if np.isfinite(settings.tn):
        return ""
    way = float(force.Fs[1]) / (_gain_in_force(settings) * settings.kv)
    return f" within {format_length(way, settings.base_unit)} of the set point"


def _format_gain(name: str, number: float, settings: Drive) -> str:
    """Return a gain with its unit; a reset time is in ms."""
    if name == "tn":
        if np.isfinite(number):
            return f"{1e3 * number:.4g} ms"
        return "none (no integral action)"
    return f"{number:.4g} {settings.kp_unit if name == 'kp' else '1/s'}"
