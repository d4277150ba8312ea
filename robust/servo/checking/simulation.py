"""An axis as it was read, run under its drive with the laws of friction that its records leave: it rests, or it hunts.

What is simulated is not proved: another history, or friction of another law, may do otherwise.
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
from robust.friction.reading.identification import FrictionFit
from robust.friction.units import format_length

Law: TypeAlias = (
    "nlfrf.friction.Coulomb | nlfrf.friction.VaryingSliders | nlfrf.friction.Dahl | nlfrf.friction.LuGre "
    "| nlfrf.friction.Leuven"
)
#: Laws of friction that are tried; Leuven with an exponential virgin curve.
_LAWS = ("rigid", "Maxwell slip or GMS", "Dahl", "LuGre", "Leuven")
#: Those that take no shorter steps where friction is stiff.
_STIFF = ("rigid", "Maxwell slip or GMS")
#: Runs, the laws in turn. With the same numbers rigid friction, Maxwell slip and LuGre hunted by the same amplitude to
#: 8 %, Leuven by up to 19 % less and in fewer runs, on ten axes that hunt (benchmarks/bench_stranger.py).
RUNS = 12
#: Velocity over which stiction falls [m/s] or [rad/s] where records do not show it: what Armstrong-Hélouvry reports.
_STRIBECK_VELOCITY = (5e-4, 5e-2)
#: Deflections at which elements of Maxwell slip begin to slip, over their mean.
_DEFLECTIONS = np.array([0.25, 0.5, 1.0, 2.0])
#: A mass that would swing on its friction above this share of the sampling frequency swings there: for the drive
#: stiffer friction is the same, and where the encoder leaves the stiffness open it is at most that.
_STIFFEST = 0.25
#: Moves of the set point, each for a time, then a hold: in reset times of the velocity loop. The last share counts.
_MOVES, _MOVE, _HOLD, _LAST = 3, 15.0, 250.0, 0.25
#: Swing in the end above which the axis hunts, over the way on which the position loop asks for Coulomb friction. One
#: of that size takes about 1/0.02 reset times to wind up.
_SWINGS = 0.02
#: Runs that hunt from which the axis hunts, a third of them: fewer are at an end of several intervals at once. Of 23
#: axes that hunt and 32 that rest (benchmarks/bench_stranger.py), 2 runs named 23 and 10 as hunting, 4 runs 23 and 5,
#: 6 runs 18 and 1.
FEWEST = 4
#: Changes of a drive that are tried against hunting, the mildest first: gain, and factor on it.
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

#: Distance [m] or [rad] below which a simulation is at its set point.
SHOWN = 1e-9
_KEPT = "the linear loop passes with it"


@value(in_sentences=True)
class SimulatedRest:
    """What an axis does in the end, in simulations of it.

    Fields
    ------
    laws : tuple of str
        Of the friction, none of which the records refute. Bristles too stiff for the encoder are run as rigid friction.
    amplitudes : (runs,) ndarray
        Half the swing in the end [m] or [rad]; zero where the axis rests, nan where the integration came to no end.
    periods : (runs,) ndarray
        Of the swing [s]; nan where it rests.
    unit : str
        Of the position.
    offsets : (runs,) ndarray or None
        Largest distance from the set point in the end [m] or [rad].
    advice : str
        The mildest change of the drive that was found to help; empty of an axis that rests, and where none was found.

    References
    ----------
    B. Armstrong-Hélouvry, P. Dupont, C. Canudas de Wit, Automatica 30, 1994 (hunting, Stribeck velocities).
    """

    laws: tuple[str, ...]
    amplitudes: np.ndarray
    periods: np.ndarray
    unit: str = "m"
    offsets: np.ndarray | None = None
    advice: str = ""

    @property
    def hunts(self) -> bool:
        """Whether the axis moves for ever in several runs."""
        return self.count >= FEWEST

    @property
    def count(self) -> int:
        """How many runs hunt."""
        return int(np.count_nonzero(self.amplitudes > 0))

    @property
    def ended(self) -> int:
        """How many runs came to their end."""
        return int(np.count_nonzero(np.isfinite(self.amplitudes)))

    @property
    def amplitude(self) -> float:
        """The median amplitude of the runs that hunt [m] or [rad]; zero where none does."""
        return float(np.median(self.amplitudes[self.amplitudes > 0])) if self.count else 0.0

    def __str__(self) -> str:
        ended, laws = self.ended, ", ".join(self.laws)
        of = f"{ended} runs from random moves, with friction as read ({laws}); nothing is proved by that"
        if ended < self.amplitudes.size:
            of += f"; {self.amplitudes.size - ended} more came to no end"
        does = f"rests in {ended - self.count if self.count else 'all'}"
        if self.hunts:
            does = f"hunts {self.describe_swing()}, in {self.count}"
        return f"{does} of {of}{self.describe_end()}"

    @property
    def offset(self) -> float:
        """Return the largest distance from the set point in the end [m] or [rad]; nan where none is known."""
        known = np.zeros(0) if self.offsets is None else self.offsets[np.isfinite(self.offsets)]
        return float(known.max()) if known.size else np.nan

    def describe_end(self) -> str:
        """Say how far from the set point the runs end."""
        if not np.isfinite(self.offset):
            return ""
        far = format_length(max(self.offset, SHOWN), self.unit)
        return f"; in the end {'less than' if self.offset < SHOWN else 'at most'} {far} off the set point"

    def describe_swing(self) -> str:
        """Say by how much it hunts, and how often."""
        return f"by +-{format_length(self.amplitude, self.unit)}, once in {float(np.nanmedian(self.periods)):.2g} s"


def laws_not_refuted(force: FrictionForce) -> tuple[str, ...]:
    """Return the laws of friction that the records leave.

    Rigid friction has no stiffness that an encoder could resolve, and neither it nor Maxwell slip creeps; Dahl's has no
    stiction.
    """
    refuted = {
        "rigid": force.creeps or bool(np.isfinite(force.K0[1])),
        "Maxwell slip or GMS": force.creeps,
        "Dahl": bool(force.Fs[0] > force.sliding.interval("coulomb")[1]),
    }
    return tuple(law for law in _LAWS if not refuted.get(law))


def reason_against_simulation(force: FrictionForce | None, settings: Drive, masses: int = 1) -> str:
    """Why an axis is not simulated; empty where it is."""
    if masses > 1 and (force is None or force.load is None):
        return "motor and load were not read apart"
    if force is None or not np.isfinite(force.Fs).all():
        return "the break-away force is not known"
    if settings.velocity_from == "observer" or settings.encoder != "motor":
        return "only a drive with the encoder on the motor and a velocity from differences is simulated"
    if not settings.kv:
        return "without a position loop the axis has no set point to rest at"
    return ""


def simulate_rest(
    force: FrictionForce,
    settings: Drive,
    *,
    order: Sequence[int] = range(RUNS),
    most: float = np.inf,
) -> SimulatedRest:
    """Run an axis from random moves into a hold, with numbers drawn from their intervals.

    Parameters
    ----------
    force : FrictionForce
        Machine and friction as read, in N and m or in Nm and rad.
    settings : Drive
        The drive, in the same units.
    order : sequence of int
        The runs, below `RUNS`. Their draws are the same for every drive: two drives differ by their gains alone.
    most : float
        Amplitude [m] or [rad] above which no more is run.

    Returns
    -------
    SimulatedRest
    """
    from scipy.stats import qmc

    laws = laws_not_refuted(force)
    run = tuple(law for law in laws if law in _STIFF) if "rigid" in laws else laws
    draws = qmc.Sobol(4 + _MOVES, seed=1).random_base2(int(np.ceil(np.log2(RUNS))))
    found: list[tuple[float, float, float]] = []
    for k in order:
        found.append(_run_to_the_end(run[k % len(run)], force, settings, draws[k]))
        if found[-1][0] > most:
            break
    amplitudes, periods, offsets = np.array(found).T
    return SimulatedRest(laws=laws, amplitudes=amplitudes, periods=periods, unit=settings.base_unit, offsets=offsets)


def _run_to_the_end(law: str, force: FrictionForce, settings: Drive, draws: np.ndarray) -> tuple[float, float, float]:
    """Return amplitude [m], period [s] and offset [m] of one run, by (4 + MOVES,) draws between zero and one."""
    axis, oversampling = _draw_axis(law, force, settings, draws[:4])
    way = _coulomb_of(force) / (_gain_in_force(settings) * settings.kv)
    reset = settings.tn if np.isfinite(settings.tn) else 1 / settings.kv
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
    """Return the friction with the load as the levels show it, where they show motor, load and the spring between."""
    if fit is None or not fit.load_mass or not force.sliding.mass > fit.load_mass:
        return force
    if not np.isfinite([fit.stds[name] for name in ("mass", "load_mass", "coupling")]).all():
        return force
    share = float(np.clip(fit.load_Fs / fit.Fs, 0.0, 1.0)) if fit.Fs > 0 else np.nan
    return replace(force, load=coupled_load(fit, share))


def _draw_axis(law: str, force: FrictionForce, settings: Drive, draws: np.ndarray) -> tuple[nlfrf.rig.ServoAxis, int]:
    """Return the axis with friction of a law by (4,) draws, and the steps a period it takes."""
    friction, steps = _draw_friction(law, force, settings, draws)
    motion = "linear" if settings.base_unit == "m" else "rotary"
    damping = max(0.0, force.sliding.damping)
    axis = nlfrf.rig.ServoAxis(
        motor_inertia=force.sliding.mass, drive=settings, motor_friction=friction, motor_damping=damping, motion=motion
    )
    if (load := force.load) is None:
        return axis, steps

    def part(share: float) -> Law | None:
        sliding = replace(force.sliding, coulomb=share * force.sliding.coulomb)
        own = replace(force, sliding=sliding, Fs=share * force.Fs, K0=share * force.K0)
        return _draw_friction(law, own, settings, draws)[0] if share else None

    at_load = float(draws[1]) if np.isnan(load.share) else load.share
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
    """Coulomb friction [N], at most the break-away force."""
    return float(min(abs(force.sliding.coulomb), force.Fs[1]))


def _draw_friction(law: str, force: FrictionForce, settings: Drive, draws: np.ndarray) -> tuple[Law, int]:
    """Return friction of a law with numbers from their intervals by (4,) draws, and the steps a period it takes."""
    Fc = _coulomb_of(force)
    Fs = max(force.Fs[0], Fc) ** (1 - draws[0]) * force.Fs[1] ** draws[0]
    stiffest = force.sliding.mass * (2 * np.pi * _STIFFEST * settings.fs) ** 2
    low, high = np.fmin(force.K0, stiffest)  # nan: any stiffness
    K0 = low * (high / low) ** draws[1]
    slowest, fastest = np.where(np.isnan(force.stribeck), _STRIBECK_VELOCITY, force.stribeck)
    vs = min(slowest, fastest) ** (1 - draws[2]) * fastest ** draws[2]
    # what slips at the lowest levels looks like damping, too: bristles that damp by more than half of critical are none
    damping = draws[3] * np.fmin(force.bristle_time, np.sqrt(force.sliding.mass / K0)) * K0
    if law == "rigid":
        return nlfrf.friction.Coulomb(Fc=Fc, Fs=Fs, vs=vs), 1
    if law == "Maxwell slip or GMS":
        k = np.full(_DEFLECTIONS.size, K0 / _DEFLECTIONS.size)
        strength = Fs * _DEFLECTIONS / _DEFLECTIONS.sum()
        return nlfrf.friction.VaryingSliders(stiffness=k, strength=strength, stiction=Fs / Fc, vs=vs), 1
    # bristles relax with K0 |v| / Fc while they slip; the fastest move has this v
    speed = 3 * Fc / _gain_in_force(settings)
    steps = int(np.ceil(K0 * speed / Fc / settings.fs))
    if law == "Dahl":
        return nlfrf.friction.Dahl(sigma0=K0, Fc=Fs), steps
    if law == "LuGre":
        return nlfrf.friction.LuGre(sigma0=K0, sigma1=damping, sigma2=0.0, Fc=Fc, Fs=Fs, vs=vs), steps
    curve = nlfrf.hysteresis.Exponential(K0=K0, Fy=1.02 * Fs)  # reaches Fs
    return nlfrf.friction.Leuven(Fs=Fs, Fc=Fc, vs=vs, sigma1=damping, sigma2=0.0, curve=curve), steps


def _gain_in_force(settings: Drive) -> float:
    """Return the gain of the velocity loop with a force in the place of its current [N s/m] or [Nm s/rad]."""
    return settings.gain * settings.output_factor(settings.force_unit)


def with_advice(
    found: SimulatedRest, force: FrictionForce, settings: Drive, keeps: Callable[[Drive], bool]
) -> SimulatedRest:
    """Return the result with the mildest change of the drive that brings rest, or else halves the amplitude.

    keeps : whether the verdict of the linear loop is as good with a drive.
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
        change = f"{name} {_format_gain(name, old, settings)} -> {_format_gain(name, factor * old, settings)}"
        if not after.count:
            rests = f"{change}: rests in all runs{_describe_offset(force, other)}, {_KEPT}"
            return replace(found, advice=f"{halved}; or {rests}" if halved else rests)
        halved, most = f"{change}: hunts by +-{format_length(after.amplitude, found.unit)}, {_KEPT}", 0.0
    return replace(found, advice=halved)


def _describe_offset(force: FrictionForce, settings: Drive) -> str:
    """Say how far from its set point an axis may rest without an integral part."""
    if np.isfinite(settings.tn):
        return ""
    way = float(force.Fs[1]) / (_gain_in_force(settings) * settings.kv)
    return f" within {format_length(way, settings.base_unit)} of the set point"


def _format_gain(name: str, number: float, settings: Drive) -> str:
    """Return a gain with its unit."""
    if name == "tn":
        return f"{1e3 * number:.4g} ms" if np.isfinite(number) else "none (no integral action)"
    return f"{number:.4g} {settings.kp_unit if name == 'kp' else '1/s'}"
