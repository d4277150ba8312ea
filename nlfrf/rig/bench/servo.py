"""A servo axis under its drive: motor and load with friction, a P-PI cascade, a quantised encoder,
a limited current.

    position set point -> [P] -> velocity set point -> [PI, filters] -> current set point -> delay,
    lag -> motor = load
          |-------------- encoder: quantised position, its differences ---------|

    m1 x1'' + c1 x1' + k (x1 - x2) + c (x1' - x2') + friction1(x1') = force_constant * current
    m2 x2'' + c2 x2' + k (x2 - x1) + c (x2' - x1') + k2 x2 + friction2(x2') = 0

All quantities are in one coordinate, that of the load. A rotor with inertia J behind a transmission
of r metres per radian has a motor inertia of J / r^2 kg, and its torque constant Kt becomes a force
constant of Kt / r N/A.
"""

from __future__ import annotations

import warnings
from collections.abc import Mapping
from concurrent.futures import Executor
from dataclasses import replace
from functools import cached_property
from os import PathLike

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    DataWarning,
    require_choice,
    require_integer,
    require_kind,
    require_nonnegative,
    require_positive,
    require_real,
)
from nlfrf._base.drive_entries import PORTS
from nlfrf._base.values import value
from nlfrf.records.record import Record, SignalLabels
from nlfrf.rig.bench.closed_loop import (
    MAX_HALVINGS,
    initial_axes,
    memory_at,
    signal_rows,
    steps_per_sample,
)
from nlfrf.rig.bench.drive import Drive
from nlfrf.rig.bench.machine import (
    pack_laws,
    stack_matrices,
)
from nlfrf.rig.bench.rig import Rig
from nlfrf.rig.bench.simulate import Arrays, Progress, run_all
from nlfrf.rig.bench.trajectory import Trajectory
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.rig.laws.laws import Friction, pack_law
from nlfrf.signals.axis_experiment import stepped_profile
from nlfrf.signals.multisine import Multisine, require_one_input

_MOTIONS = {"linear": ("m", "N"), "rotary": ("rad", "Nm")}
#: Share of samples with a current limit, or with a reversal in motion, up to which no warning is
#: given.
_SELDOM = 1e-3
#: Change from one period to the next, over the rms of the position, above which a record is
#: reported as unsettled.
_UNSETTLED = 1e-2


@value
class ServoAxis:
    """A servo axis: a motor, a load behind a belt, a screw or a gear, an encoder, and a drive.

    All parameters are in the coordinate of the load: inertias, forces and positions of the motor
    are converted by the transmission.

    Parameters
    ----------
    motor_inertia : float
        Inertia of the motor [kg] or [kg m^2].
    drive : Drive
        Gains, limits, sampling, torque constant and encoder of the drive. Its velocity must be the
        difference of positions, not that of an observer.
    motor_friction, load_friction : law, optional
        Friction law of the motor and of the load, to ground.
    motor_damping, load_damping : float
        Viscous friction of the motor and of the load, to ground [Ns/m] or [Nm s/rad].
    load_inertia : float
        Inertia of the load [kg] or [kg m^2]. If it is zero, the axis is one rigid mass,
        `motor_inertia`.
    stiffness, damping : float
        Stiffness and damping of belt, screw or gear between motor and load [N/m], [Ns/m] or
        [Nm/rad], [Nm s/rad].
    spring : float
        Stiffness from the load to ground [N/m] or [Nm/rad]; zero for a free axis.
    resolution : float
        Quantisation step of the encoder [m] or [rad]; zero for none.
    motion : str
        "linear" (m, N) or "rotary" (rad, Nm).

    Raises
    ------
    ValueError
        A number is out of range; a load has no stiffness; or parameters of a load are given without
        `load_inertia`.

    References
    ----------
    G. Ellis, *Control System Design Guide*, 4th ed., Butterworth-Heinemann, 2012, chapter 16: two
    masses and a spring.

    Examples
    --------
    >>> from nlfrf import servo_axis
    >>> axis = servo_axis("belt")
    >>> round(axis.resonance, 1), axis.units
    (83.2, ('m', 'N'))
    """

    motor_inertia: float
    drive: Drive
    motor_friction: Friction | None = None
    motor_damping: float = 0.0
    load_inertia: float = 0.0
    load_friction: Friction | None = None
    load_damping: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    spring: float = 0.0
    resolution: float = 0.0
    motion: str = "linear"

    def __post_init__(self) -> None:
        require_positive("motor_inertia", self.motor_inertia)
        require_kind("drive", self.drive, Drive)
        for name in (
            "motor_damping",
            "load_inertia",
            "load_damping",
            "stiffness",
            "damping",
            "spring",
            "resolution",
        ):
            require_nonnegative(name, getattr(self, name))
        require_choice("motion", self.motion, tuple(_MOTIONS))
        # refuses units of another motion, and a missing torque constant
        self.drive.output_factor(self.units[1])
        if self.encoder == "both" or self.drive.velocity_from == "observer":
            raise ValueError(
                "drive must read one encoder and use its differences, got two encoders or an"
                " observer"
            )
        for law in (self.motor_friction, self.load_friction):
            if law is not None:
                pack_law(law)
        if self.load_inertia and not self.stiffness:
            raise ValueError("stiffness must be positive with a load_inertia, got 0")
        if not self.load_inertia:
            for name in ("load_friction", "load_damping", "stiffness", "damping"):
                if getattr(self, name):
                    raise ValueError(f"load_inertia must be positive if {name} is given, got 0")
            if self.encoder == "load":
                raise ValueError('encoder must be "motor" without a load_inertia, got "load"')

    @property
    def units(self) -> tuple[str, str]:
        """Units of position and force."""
        return _MOTIONS[self.motion]

    @property
    def encoder(self) -> str:
        """Mass that the encoder reads, "motor" or "load"."""
        return self.drive.encoder

    @property
    def force_constant(self) -> float:
        """Force per output of the velocity controller [N/A] or [Nm/A]; 1 if that output is a force
        or torque.
        """
        return self.drive.output_factor(self.units[1])

    @property
    def inertia(self) -> float:
        """Total moving inertia [kg] or [kg m^2]."""
        return self.motor_inertia + self.load_inertia

    @property
    def resonance(self) -> float:
        """Highest resonance of motor and load without friction [Hz]; zero for one free mass."""
        if self.two or self.spring:
            return float(np.abs(self.rig.poles(0.0)).max() / 2 / np.pi)
        return 0.0

    @property
    def two(self) -> bool:
        """True if motor and load are two masses."""
        return self.load_inertia > 0

    @cached_property
    def rig(self) -> Rig:
        """The machine without its drive, as a `Rig` from the motor force to the encoder position."""
        k, c = self.stiffness, self.damping
        if not self.two:
            mass, laws = [[self.motor_inertia]], [self.motor_friction]
            return Rig(
                mass,
                [[self.spring]],
                laws,
                [[self.motor_damping]],
                inputs=("force",),
                outputs=("position",),
            )
        return Rig(
            mass=np.diag([self.motor_inertia, self.load_inertia]),
            stiffness=[[k, -k], [-k, k + self.spring]],
            friction=[self.motor_friction, self.load_friction],
            damping=[[self.motor_damping + c, -c], [-c, self.load_damping + c]],
            actuators=[[1.0], [0.0]],
            sensors=[[1.0, 0.0] if self.encoder == "motor" else [0.0, 1.0]],
            inputs=("force",),
            outputs=("position",),
        )


def run_axis(
    axis: ServoAxis,
    set_points: Mapping[str, ArrayLike | None],
    *,
    closed: bool,
    noise: ArrayLike | None,
    initial: ArrayLike,
    oversampling: int,
) -> Trajectory:
    """Run an axis under its drive from a given state; with open loops `force` alone drives it.

    See `run`.
    """
    trace, lost = _run_to_its_end(
        axis, set_points, closed=closed, noise=noise, initial=initial, oversampling=oversampling
    )
    warn_of_forgotten_loops(lost)
    return trace


def _run_to_its_end(
    axis: ServoAxis,
    set_points: Mapping[str, ArrayLike | None],
    *,
    closed: bool,
    noise: ArrayLike | None,
    initial: ArrayLike,
    oversampling: int,
) -> tuple[Trajectory, float]:
    """Return the trajectory of an axis, and the number of forgotten hysteresis loops."""
    given = {name: set_points.get(name) for name in PORTS}
    sizes = [np.size(signal) for signal in given.values() if signal is not None]
    if not sizes or 0 in sizes:
        raise ValueError(
            "position, velocity or force must be given, with at least one sample, got none"
        )
    given["noise"] = noise
    signals = {
        name: signal_rows(name, signal, sizes[0], n_rows=1)[0] for name, signal in given.items()
    }
    begin = initial_axes(initial, axis.rig.n_axes)
    steps = steps_per_sample(axis.rig, axis.drive.fs, oversampling)
    for halving in range(
        MAX_HALVINGS + 1
    ):  # a run that does not reach the end is repeated with shorter steps
        trace, lost = _attempt(axis, signals, closed=closed, begin=begin, steps=steps * 2**halving)
        if not trace.diverged:
            break
    return trace, lost


def _attempt(
    axis: ServoAxis, signals: dict[str, np.ndarray], *, closed: bool, begin: np.ndarray, steps: int
) -> tuple[Trajectory, float]:
    """Call the compiled code once; return the trace up to its end, and the number of forgotten
    hysteresis loops.
    """
    from nlfrf.rig.kernels.servo import GAINS, SIGNALS, step_servo

    rig, drive, n = axis.rig, axis.drive, signals["force"].size
    laws, grids = pack_laws(rig.friction)
    memory = memory_at(rig, laws, begin)
    Ts = 1 / drive.fs
    gains = {
        "kv": drive.kv,
        "feedforward": drive.velocity_feedforward,
        "kp": drive.gain,
        "integral": drive.gain * Ts / drive.tn,
        "smoothing": Ts / (Ts + drive.velocity_lag),
        "current_limit": drive.limit,
        "lag": drive.lag,
        "delay": min(drive.delay_periods, n),  # at most the whole run
        "resolution": axis.resolution,
    }
    rows, written = np.zeros((n, 4, rig.n_axes)), np.zeros((n, len(SIGNALS)))
    length = int(
        step_servo(
            stack_matrices(rig.mass, rig.stiffness, damping=rig.damping, cubic=None),
            laws,
            grids,
            memory.state,
            memory.stack,
            int(axis.encoder == "load"),
            float(axis.force_constant),
            np.array([float(gains[name]) for name in GAINS]),
            drive.sections,
            int(drive.position_every),
            bool(closed),
            signals["position"],
            signals["velocity"],
            signals["force"] / axis.force_constant,
            signals["noise"],
            float(drive.fs),
            int(steps),
            rows,
            written,
        )
    )
    rows, columns = rows[:length], dict(zip(SIGNALS, written[:length].T, strict=True))
    unlimited = columns.pop("unlimited")
    m, N = axis.units
    columns |= {
        "position_set": signals["position"][:length].copy(),
        "limited": unlimited != columns["current_set"],
        "force_set": axis.force_constant * columns["current_set"],
        "force": axis.force_constant * columns["current"],
        "x": rows[:, 0].T,
        "v": rows[:, 1].T,
        "friction": rows[:, 3].T,
    }
    units = dict.fromkeys(("position", "position_set", "x"), m) | dict.fromkeys(
        ("force", "force_set", "friction"), N
    )
    units |= dict.fromkeys(("velocity", "velocity_set", "v"), f"{m}/s") | {
        "current": axis.drive.output_unit,
        "current_set": axis.drive.output_unit,
        "limited": "",
    }
    trace = Trajectory(t=np.arange(length) * Ts, signals=columns, units=units, diverged=length < n)
    return trace, float(memory.state[:, packing.LOST].sum())


# ---- Experiments: a multisine at one port of the drive, at rest or in motion.


@value
class _ServoExperiment:
    """One realisation of a multisine on an axis: the argument of a worker."""

    axis: ServoAxis
    ms: Multisine
    port: str
    closed: bool
    base_velocity: float
    strokes: int
    n_periods: int
    n_discard: int
    oversampling: int


def simulate_servo(
    axis: ServoAxis,
    ms: Multisine,
    *,
    port: str = "force",
    closed: bool = True,
    base_velocity: float = 0.0,
    strokes: int = 0,
    n_periods: int = 2,
    n_discard: int = 2,
    oversampling: int = 1,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: str | PathLike[str] | None = None,
) -> Record:
    """Simulate a multisine experiment on a servo axis with its drive, from the force set point to
    the encoder position.

    Without `base_velocity` the axis moves about a fixed position set point. With it the multisine
    is added to a motion at constant velocity, so that friction slides; this motion is subtracted
    from the recorded position. With `strokes` the axis moves back and forth. The record then
    contains only the strokes in the direction of `base_velocity`; call the function twice for both
    directions.

    Parameters
    ----------
    axis : ServoAxis
        Machine and drive.
    ms : Multisine
        Multisine with M realisations (draws of the random phases) of N samples, at the sampling
        frequency of the drive.
    port : str
        Set point to which the multisine is added: "force" [N] or [Nm], "velocity" [m/s] or [rad/s],
        or "position" [m] or [rad].
    closed : bool
        False: torque mode, in which the multisine alone drives the motor.
    base_velocity : float
        Velocity of the position set point [m/s] or [rad/s]. Its sign is the recorded direction.
    strokes : int
        Number of strokes back and forth; zero for one motion in one direction.
    n_periods : int
        Number of periods kept in each stroke.
    n_discard : int
        Number of periods discarded at the start of each stroke, or of the experiment.
    oversampling : int
        Smallest number of integration steps per period of the drive.
    executor, progress, resume
        As in `simulate`.

    Returns
    -------
    Record
        (M, P, N) arrays, P being the number of kept periods of all strokes. u is the force set
        point, y the encoder position, and r the multisine. The identified plant contains the hold,
        the delay and the lag of the current loop.

    Raises
    ------
    ValueError
        The sampling frequency of the multisine is not that of the drive; motion or a set point is
        given for an open loop; or the axis is unstable.

    Warns
    -----
    DataWarning
        The current reached its limit; an axis in motion moved backwards; or, at rest, the last two
        periods differ by more than the encoder resolution explains.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.6.4: FRF
    of a closed loop.

    Examples
    --------
    >>> from nlfrf.signals.multisine import multisine
    >>> from nlfrf import servo_axis
    >>> axis = servo_axis("linear motor")
    >>> ms = multisine(fs=axis.drive.fs, n_samples=4000, f_min=5, f_max=500, rms=2.0, rng=1)
    >>> record = simulate_servo(axis, ms, n_periods=1)
    >>> record.y.shape, record.input_units, record.output_units, record.hold
    ((1, 1, 4000), ('N',), ('m',), 'zoh')
    """
    require_kind("axis", axis, ServoAxis)
    require_one_input(ms)
    experiment = _ServoExperiment(
        axis=axis,
        ms=ms,
        port=require_choice("port", port, PORTS),
        closed=bool(closed),
        base_velocity=require_real("base_velocity", base_velocity),
        strokes=require_integer("strokes", strokes, least=0),
        n_periods=require_integer("n_periods", n_periods, least=1),
        n_discard=require_integer("n_discard", n_discard, least=0),
        oversampling=require_integer("oversampling", oversampling, least=1),
    )
    _require_possible(experiment)
    runs = [
        replace(experiment, ms=replace(ms, phase=ms.phase[m : m + 1]))
        for m in range(ms.n_realizations)
    ]
    found = run_all(_run_experiment, runs, executor=executor, progress=progress, resume=resume)
    warn_of_forgotten_loops(float(sum(one["lost"] for one in found)))
    _warn_of(
        experiment,
        {name: max(float(one[name]) for one in found) for name in ("limited", "turned", "change")},
    )
    u, y, r = (np.stack([one[name] for one in found]) for name in ("u", "y", "r"))
    position, force = axis.units
    labels: SignalLabels = {
        "u_name": "force",
        "y_name": "position",
        "u_unit": force,
        "y_unit": position,
    }
    return Record(u=u, y=y, r=r, fs=ms.fs, lines=ms.lines, hold="zoh", **labels)


def _require_possible(one: _ServoExperiment) -> None:
    """Refuse an experiment that the drive cannot make."""
    if abs(one.ms.fs / one.axis.drive.fs - 1) > 1e-9:
        raise ValueError(
            f"ms must be sampled like the drive, at {one.axis.drive.fs:g} Hz, got {one.ms.fs:g} Hz"
        )
    if not one.closed and (one.port != "force" or one.base_velocity):
        raise ValueError(
            'port must be "force" and base_velocity 0 in an open loop, got a set point that no loop'
            " follows"
        )
    if one.strokes and not one.base_velocity:
        raise ValueError(
            f"base_velocity must not be zero if the axis moves back and forth, got {one.strokes}"
            " strokes"
        )
    if one.base_velocity and one.n_discard < 1:
        raise ValueError("n_discard must be at least 1 in motion, for the acceleration, got 0")


def _run_experiment(experiment: _ServoExperiment) -> Arrays:
    """Run one realisation, in a worker."""
    axis, ms, N = experiment.axis, experiment.ms, experiment.ms.n_samples
    block = experiment.n_discard + experiment.n_periods
    base = _base_position(experiment)
    played = np.tile(ms.u[0], base.size // N)
    signals = {name: np.zeros(base.size) for name in PORTS} | {"position": base}
    signals[experiment.port] = signals[experiment.port] + played
    if experiment.closed:
        given = signals
    else:
        given = {"force": signals["force"]}
    trace, lost = _run_to_its_end(
        axis,
        given,
        closed=experiment.closed,
        noise=None,
        initial=(0.0, 0.0),
        oversampling=experiment.oversampling,
    )
    if trace.diverged:
        raise ValueError(
            "axis must be stable under its drive, got one that ran away after"
            f" {trace.t.size / axis.drive.fs:.3g} s: lower kp or kv, or raise tn"
        )

    def kept(signal: np.ndarray) -> np.ndarray:
        """Return (P, N) the recorded periods of all strokes: every second stroke, beginning with
        the second.
        """
        if experiment.strokes:
            strokes = signal.reshape(-1, block, N)[1::2]
        else:
            strokes = signal.reshape(1, block, N)
        return np.asarray(strokes[:, experiment.n_discard :].reshape(-1, N))

    y = kept(trace.position - base)
    change = 0.0
    if experiment.n_periods > 1 and not experiment.base_velocity:
        period_difference = np.sqrt(np.mean((y[-1] - y[-2]) ** 2))
        change = max(period_difference - 2 * axis.resolution, 0.0) / max(
            np.std(y[-1]), np.finfo(float).tiny
        )
    back = kept(trace.v[-1]) * experiment.base_velocity < 0
    return {
        "u": kept(trace.force_set),
        "y": y,
        "r": kept(played),
        "limited": np.array(np.mean(kept(trace.limited))),
        "turned": np.array(np.mean(back)),
        "change": np.array(change),
        "lost": np.array(lost),  # a warning of a worker process would stay there
    }


def _base_position(experiment: _ServoExperiment) -> np.ndarray:
    """Return (n,) the position set point of the whole experiment [unit of the axis].

    Each stroke lasts as long as all periods together; the first one is backward. Without strokes
    there is one forward motion. The velocity is constant except for a quarter of a multisine period
    at each change.
    """
    block = (experiment.n_discard + experiment.n_periods) * experiment.ms.n_samples
    if experiment.strokes:
        directions = np.tile([-1.0, 1.0], experiment.strokes)
    else:
        directions = np.ones(1)
    velocity = stepped_profile(
        experiment.base_velocity * directions, block, experiment.ms.n_samples // 4
    )
    return np.asarray(np.cumsum(velocity[: directions.size * block]) / experiment.axis.drive.fs)


def _warn_of(experiment: _ServoExperiment, worst: dict[str, float]) -> None:
    """Warn of a limited current, a reversal in motion, and an unsettled record."""
    texts = []
    if worst["limited"] > _SELDOM:
        limit, unit = experiment.axis.drive.limit, experiment.axis.drive.output_unit
        texts.append(
            f"the current was at its limit of {limit:g} {unit} in {100 * worst['limited']:.2g}"
            " % of the samples, so the FRF includes the limit. Lower the rms of the multisine"
        )
    if worst["turned"] > _SELDOM:
        texts.append(
            f"the axis moved backwards in {100 * worst['turned']:.2g} % of the samples, so its"
            " friction does not slide all the time. Raise base_velocity above"
            f" {abs(experiment.base_velocity):g}, or lower the rms of the multisine"
        )
    if worst["change"] > _UNSETTLED:
        texts.append(
            f"steady state was not reached: the last two periods differ by {worst['change']:.1e} of"
            f" the rms. Raise n_discard above {experiment.n_discard}"
        )
    for text in texts:
        warnings.warn(text, DataWarning, stacklevel=3)
