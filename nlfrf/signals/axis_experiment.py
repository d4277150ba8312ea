"""Experiment on a running drive: a multisine added to one of its set points, at rest or in motion.

An experiment is a sequence of segments of `n_discard + n_periods` periods. In a segment the
amplitude of the multisine and the base velocity (that of the axis without the multisine) are
constant. They change smoothly over the first quarter of a period of each segment. After the last
segment they return to zero over a quarter of a period.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import (
    require_choice,
    require_integer,
    require_nonnegative,
    require_real_array,
)
from nlfrf._base.drive_entries import PORTS, SAME_GAIN
from nlfrf._base.values import value
from nlfrf.signals.multisine import Multisine, require_one_input


@value
class AxisLimits:
    """Limits of an experiment on a drive; infinite means no limit.

    The limits apply to the multisine together with the motion to which it is added.

    Fields
    ------
    force : float
        Largest force, torque or current set point [N], [Nm] or [A], in the unit that the drive
        records.
    velocity : float
        Largest velocity [m/s] or [rad/s].
    travel : float
        Distance between the two ends of the motion [m] or [rad].

    Raises
    ------
    ValueError
        A limit is negative or no number.

    References
    ----------
    Beckhoff TE5960 (TwinCAT 3 motion tuning): a torque limit and a position window for every
    excitation.

    Examples
    --------
    >>> AxisLimits(velocity=0.2).force
    inf
    """

    force: float = np.inf
    velocity: float = np.inf
    travel: float = np.inf

    def __post_init__(self) -> None:
        for name in ("force", "velocity", "travel"):
            if getattr(self, name) != np.inf:
                require_nonnegative(name, getattr(self, name))


@value
class AssumedDrive:
    """Drive that the design of an experiment assumes.

    Fields
    ------
    kv : float
        Position gain [1/s].
    kp : float
        Velocity gain [A s/m] or [A s/rad].
    tn : float
        Reset time [s].
    velocity_feedforward : float
        Fraction of the set-point velocity that is fed forward.
    lag, delay : float
        Time constant and delay of the current loop [s].
    force_constant : float
        Force constant [N/A] or [Nm/A].

    References
    ----------
    `nlfrf.rig.Drive` has all settings of a drive; these are the ones that change the force of an
    experiment.

    Examples
    --------
    >>> import nlfrf, robust.servo
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> experiment = robust.servo.design_experiment(nlfrf.servo_axis("belt"), ms, rms=20)
    >>> drive = experiment.assumed_drive
    >>> drive.kv, drive.tn, drive.has_gains(kv=60.0, kp=drive.kp, tn=drive.tn)
    (30, 0.03, False)
    """

    kv: float
    kp: float
    tn: float
    velocity_feedforward: float
    lag: float
    delay: float
    force_constant: float

    def has_gains(self, kv: float, kp: float, tn: float) -> bool:
        """Return whether these are the gains: kv [1/s], kp [A s/m] or [A s/rad], tn [s]."""
        return bool(
            np.allclose((kv, kp, 1 / tn), (self.kv, self.kp, 1 / self.tn), rtol=SAME_GAIN, atol=0)
        )

    def describe(self, position_unit: str, force_unit: str) -> str:
        """Describe the drive in the units of the experiment."""
        without = "" if self.velocity_feedforward else " (none)"
        return (
            f"kv = {self.kv:g} 1/s, kp = {self.kp:g} A s/{position_unit}, tn = {self.tn:g} s,"
            f" velocity_feedforward = {self.velocity_feedforward:g}{without};"
            f" current loop: {self.force_constant:g} {force_unit}/A, lag {1e3 * self.lag:g}"
            f" ms, delay {1e3 * self.delay:g} ms"
        )


class _Motion(NamedTuple):
    """Peaks of force and velocity, and the travel."""

    force: float
    velocity: float
    travel: float


@value
class AxisExperiment:
    """Experiment on a running drive: a multisine added to one of its set points.

    The experiment is a sequence of segments. In each segment the amplitude of the multisine and the
    velocity of the axis are constant; the velocity may be zero.

    The usual order of calls is:

    1. `robust.servo.design_experiment` or `robust.servo.design_ramp` makes the experiment.
    2. `nlfrf.save` writes the set points that the drive plays.
    3. `nlfrf.io.load_trace` reads what the drive recorded. For a simulated drive,
       `robust.servo.play_experiment` writes that file.

    Fields
    ------
    ms : Multisine
        The multisine, before multiplication by `gains`; M realisations (draws of the random
        phases).
    port : str
        Set point to which the drive adds the multisine: "position", "velocity" or "force".
    force_response, position_response : (F,) ndarray
        Expected FRFs from the multisine at the port to the force set point and to the position, on
        each line.
    gains : (S,) ndarray
        Factor by which the multisine is multiplied in each segment.
    velocities : (S,) ndarray
        Velocity of the axis in each segment, without the multisine [m/s] or [rad/s].
    n_periods, n_discard : int
        Number of periods kept in each segment, and of periods discarded before them.
    position_unit, force_unit : str
        Units of the position and of the force set point.
    base_force : float
        Expected largest force set point of the base motion alone; at rest the mean force of the
        record, or zero.
    assumed_drive : AssumedDrive or None
        Drive that the design assumes; None if the design was made from a record.

    Raises
    ------
    ValueError
        Arrays have shapes that do not fit each other, or a number is out of range.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.6.4 and
    5.2.

    Examples
    --------
    >>> import nlfrf, robust.servo
    >>> axis = nlfrf.servo_axis("belt")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> experiment = robust.servo.design_experiment(axis, ms, rms=20)
    >>> round(experiment.rms, 6), experiment.labels
    (20.0, ('at rest',))
    """

    ms: Multisine
    port: str
    force_response: np.ndarray
    position_response: np.ndarray
    gains: np.ndarray
    velocities: np.ndarray
    n_periods: int
    n_discard: int
    position_unit: str
    force_unit: str
    base_force: float
    assumed_drive: AssumedDrive | None = None

    def __post_init__(self) -> None:
        require_one_input(self.ms)
        require_choice("port", self.port, PORTS)
        require_integer("n_periods", self.n_periods, least=1)
        require_integer("n_discard", self.n_discard, least=1)
        for name in ("force_response", "position_response"):
            if np.shape(getattr(self, name)) != self.ms.f.shape:
                raise ValueError(
                    f"{name} must have one value per line ({self.ms.f.size}), got"
                    f" {np.shape(getattr(self, name))}"
                )
        gains, velocities = (
            require_real_array(one, getattr(self, one), ndim=1) for one in ("gains", "velocities")
        )
        if gains.shape != velocities.shape or not gains.size:
            raise ValueError(
                f"velocities must be one per segment, {gains.size} of them, got {velocities.size}"
            )

    @property
    def drive(self) -> str:
        """Description of the drive that the experiment assumes."""
        if self.assumed_drive is None:
            return "the same as in the first record"
        return self.assumed_drive.describe(self.position_unit, self.force_unit)

    @property
    def n_segments(self) -> int:
        """Number of segments S."""
        return self.gains.size

    @property
    def block(self) -> int:
        """Number of samples in one segment."""
        return (self.n_discard + self.n_periods) * self.ms.n_samples

    @property
    def n_rows(self) -> int:
        """Number of samples in the whole experiment."""
        return self.n_segments * self.block + self.ms.n_samples // 4

    @property
    def duration(self) -> float:
        """Duration of the whole experiment [s]."""
        return self.n_rows / self.ms.fs

    @property
    def force_amplitude(self) -> np.ndarray:
        """(F,) expected amplitude of the force set point on each line, for a factor 1 in `gains`."""
        return np.asarray(self.ms.amplitude * np.abs(self.force_response))

    @property
    def rms(self) -> float:
        """Expected rms of the force set point, in the segment with the largest amplitude of the
        multisine.
        """
        return float(self.gains.max() * np.sqrt(np.sum(self.force_amplitude**2) / 2))

    @property
    def base_motion(self) -> _Motion:
        """Peaks and travel of the base motion alone."""
        return _Motion(
            self.base_force, float(np.abs(self.velocities).max()), float(np.ptp(self.base))
        )

    @property
    def multisine_motion(self) -> _Motion:
        """Peaks and travel of the multisine alone at its largest amplitude, for the worst of its
        realisations.
        """
        force, velocity, position = (
            self._multisine_behind(H)
            for H in (
                self.force_response,
                2j * np.pi * self.ms.f * self.position_response,
                self.position_response,
            )
        )
        return _Motion(
            float(np.abs(force).max()),
            float(np.abs(velocity).max()),
            float(np.ptp(position, axis=1).max()),
        )

    def _multisine_behind(self, H: np.ndarray) -> np.ndarray:
        """Return the multisine (M, N) behind an FRF (F,), at its largest amplitude."""
        ms = replace(
            self.ms,
            amplitude=self.gains.max() * self.ms.amplitude * np.abs(H),
            phase=self.ms.phase + np.angle(H),
        )
        return ms.u

    @property
    def peak_force(self) -> float:
        """Bound of the largest force set point: the sum of base motion and multisine, because
        their peaks may coincide.
        """
        return self.base_motion.force + self.multisine_motion.force

    @property
    def peak_velocity(self) -> float:
        """Bound of the largest velocity of the position response: sum of base motion and
        multisine.
        """
        return self.base_motion.velocity + self.multisine_motion.velocity

    @property
    def travel(self) -> float:
        """Bound of the distance between the two ends of the motion."""
        return self.base_motion.travel + self.multisine_motion.travel

    @property
    def base(self) -> np.ndarray:
        """(n,) position set point without the multisine."""
        velocity = stepped_profile(self.velocities, self.block, self.ms.n_samples // 4)
        return np.asarray(np.cumsum(velocity) / self.ms.fs)

    @property
    def excitation(self) -> np.ndarray:
        """(M, n) ndarray: signal added to the set point `port`."""
        gain = stepped_profile(self.gains, self.block, self.ms.n_samples // 4)
        repeats = -(-gain.size // self.ms.n_samples)
        return np.asarray(gain * np.tile(self.ms.u, repeats)[:, : gain.size])

    def set_points(self, realization: int) -> dict[str, np.ndarray]:
        """Return the set points (n,) to play, by name: the position, and the port with the
        multisine.
        """
        found = {"position": self.base}
        found[self.port] = found.get(self.port, 0.0) + self.excitation[realization]
        return found

    @property
    def units(self) -> dict[str, str]:
        """Unit of each set point, by its name."""
        return {
            "force": self.force_unit,
            "velocity": f"{self.position_unit}/s",
            "position": self.position_unit,
        }

    @property
    def is_ramp(self) -> bool:
        """True if the experiment raises the amplitude step by step at rest."""
        return self.n_segments > 1 and not np.any(self.velocities)

    @property
    def groups(self) -> dict[str, tuple[int, ...]]:
        """Indices of the segments in each record, by the label of the record. There is one record
        for each direction of motion, or for each amplitude at rest.
        """
        if self.is_ramp:
            return {f"level {s + 1}": (s,) for s in range(self.n_segments)}
        names = {-1: "backward", 0: "at rest", 1: "forward"}
        signs = np.sign(self.velocities).astype(int)
        return {
            names[one]: tuple(np.flatnonzero(signs == one).tolist())
            for one in dict.fromkeys(signs.tolist())
        }

    @property
    def labels(self) -> tuple[str, ...]:
        """Label of each record that `load_trace` returns."""
        return tuple(self.groups)

    def __str__(self) -> str:
        ms, force, position = self.ms, self.force_unit, self.position_unit
        v = np.abs(self.velocities).max()
        if v:
            motion = f"in motion at {v:g} {position}/s"
        else:
            motion = "at rest"
        levels = (
            f", {self.n_segments} levels from {self.rms * self.gains.min() / self.gains.max():.3g}"
            f" {force} on"
        )
        return (
            f"{ms.kind} multisine at the {self.port} set point, {motion}, {ms.f.size} lines from"
            f" {ms.f[0]:g} to {ms.f[-1]:g} Hz, {self.duration:.3g} s\nforce {self.rms:.3g} {force}"
            f" rms{levels if len(self.groups) > 2 else ''}; expected peaks {self.peak_force:.3g}"
            f" {force}, {self.peak_velocity:.3g} {position}/s, travel {self.travel:.3g}"
            f" {position}\nassumed of the drive: {self.drive}"
        )


def stepped_profile(levels: np.ndarray, block: int, rise: int) -> np.ndarray:
    """Return (n,) levels (S,), held for `block` samples each and reached over `rise` samples, with
    a return to zero.

    >>> stepped_profile(np.array([2.0, -2.0]), 4, 2).round(2)
    array([ 0.29,  1.71,  2.  ,  2.  ,  1.41, -1.41, -2.  , -2.  , -1.71, -0.29])
    """
    wanted = np.concatenate([np.repeat(np.asarray(levels, dtype=float), block), np.zeros(rise)])
    share = (1 - np.cos(np.pi * (np.arange(rise) + 0.5) / rise)) / 2
    before = 0.0
    for k, after in enumerate([*levels, 0.0]):
        wanted[k * block : k * block + rise] = before + (after - before) * share
        before = after
    return wanted
