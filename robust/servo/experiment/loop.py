"""The transfer function from a port of a running drive to force and position.

    u = transfer * multisine,  y = G * u;   transfer = C_port / (1 + G C),  C_force = 1

C is the drive from position to force. C_port is the drive from the port (a set point to which the
multisine is added) to the force set point, with the position held at zero. G is the plant from
force set point to position, with hold, delay and lag.
"""

from __future__ import annotations

from typing import Any, TypeAlias

import numpy as np

from nlfrf import Bla, Record
from nlfrf._base.arguments import as_list, require_kind
from nlfrf._base.numbers import rfft_at
from nlfrf._base.units import POSITIONS
from nlfrf._base.values import value
from nlfrf.rig import ServoAxis, run
from nlfrf.signals import AssumedDrive, AxisExperiment


@value(kw_only=False, copy=False)
class DriveSource:
    """A running drive known by its gains, with a rough machine or a measured plant."""

    axis: ServoAxis
    plant: Bla | None = None  # FRF from force set point to position, instead of the rough machine

    @property
    def fs(self) -> float:
        """Sampling frequency [Hz]."""
        return self.axis.drive.fs

    @property
    def units(self) -> tuple[str, str]:
        """Units of position and force."""
        return self.axis.units

    def responses(self, port: str, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return two (F,) complex responses to a unit at the port, on the lines f [Hz]: force set
        point and position.
        """
        if self.plant is None:
            G = _plant_frf(self.axis, f)
        else:
            G = _interpolate_frf(self.plant.f, np.asarray(self.plant.G), f=f, what="plant")
        force = _port_frf(self.axis, G, port=port, f=f)
        return force, G * force

    @property
    def assumed_drive(self) -> AssumedDrive:
        """Gains of the drive, for the experiment."""
        drive = self.axis.drive
        return AssumedDrive(
            kv=drive.kv,
            kp=drive.gain,
            tn=drive.tn,
            velocity_feedforward=drive.velocity_feedforward,
            lag=drive.lag,
            delay=drive.delay,
            force_constant=self.axis.force_constant,
        )

    def base_force(self, experiment: AxisExperiment) -> float:
        """Return the peak of the force in the base motion, by simulation."""
        if not np.any(experiment.velocities):
            return 0.0
        # both directions, and one reversal
        n = min(2 * experiment.block + experiment.ms.n_samples, experiment.n_rows)
        return float(np.abs(run(self.axis, experiment.base[:n]).force_set).max())


@value(kw_only=False, copy=False)
class RecordSource:
    """A running drive known by a record of its loop, with the reference at the port."""

    record: Record

    @property
    def fs(self) -> float:
        """Sampling frequency [Hz]."""
        return self.record.fs

    @property
    def units(self) -> tuple[str, str]:
        """Units of position and force, empty if unknown."""
        return self.record.y_unit, self.record.u_unit

    def responses(self, port: str, f: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """Return the responses of `DriveSource`, read from the record; its port is the one played.

        A known unit of position becomes m or rad.
        """
        record = self.record
        U, Y, R = record_spectra(record)
        f_record = record.lines.excited * record.f0
        Y = Y * POSITIONS.get(record.y_unit, ("", 1.0))[1]  # the reference is in m or rad
        force, position = (
            _interpolate_frf(f_record, np.mean(one / R, axis=0), f=f, what="the record")
            for one in (U.mean(axis=1), Y.mean(axis=1))
        )
        return force, position

    @property
    def assumed_drive(self) -> AssumedDrive | None:
        """None: a record does not contain the gains."""
        return None

    def base_force(self, experiment: AxisExperiment) -> float:
        """Return the mean force of the record, that of its base motion."""
        return float(np.abs(self.record.u.mean(axis=-1)).max())


#: A drive with a rough machine; a drive with a measured FRF that replaces that of its machine; or a
#: record.
Source: TypeAlias = ServoAxis | Record | tuple[ServoAxis, Bla]


def as_source(source: Source) -> DriveSource | RecordSource:
    """Return what is known of a drive, from each form in which it is given."""
    parts: list[Any] = as_list(source)
    origin, *plants = parts
    require_kind("source", origin, ServoAxis, Record)
    if isinstance(origin, ServoAxis):
        for plant in plants:
            require_kind("plant", plant, Bla)
        return DriveSource(origin, *plants)
    if plants:
        raise ValueError(
            "plant must be left out with a record, which contains the measured loop, got both"
        )
    return RecordSource(origin)


def record_spectra(record: Record) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return (M, P, F) spectra of force and position, and (M, F) of the reference, on the excited
    lines.
    """
    if record.r is None or not record.is_single:
        raise ValueError(
            "source must be a record of one input and output with its reference r, got one without"
        )
    U, Y, R = (rfft_at(one, record.lines.excited) for one in (record.u, record.y, record.r))
    return U, Y, R.mean(axis=1)


def _interpolate_frf(known: np.ndarray, H: np.ndarray, *, f: np.ndarray, what: str) -> np.ndarray:
    """Return H at the frequencies f, by linear interpolation of its logarithm."""
    if f[0] < known[0] * (1 - 1e-9) or f[-1] > known[-1] * (1 + 1e-9):
        raise ValueError(
            f"f_min and f_max must be within the lines of {what}, {known[0]:g} to {known[-1]:g} Hz,"
            f" got lines from {f[0]:g} to {f[-1]:g} Hz"
        )
    log_gain, phase = np.log(np.abs(H)), np.unwrap(np.angle(H))
    return np.asarray(np.exp(np.interp(f, known, log_gain) + 1j * np.interp(f, known, phase)))


def _plant_frf(axis: ServoAxis, f: np.ndarray) -> np.ndarray:
    """Return (F,) FRF from force set point to encoder, without friction: hold, delay and current
    lag included.
    """
    Phi, early, late, C = _sampled_plant(axis)
    z, whole = np.exp(2j * np.pi * f / axis.drive.fs), int(axis.drive.delay_periods)
    inputs = np.outer(z ** -(whole + 1.0), early) + np.outer(z ** -float(whole), late)
    return np.array(
        [
            C @ np.linalg.solve(one * np.eye(C.size) - Phi, b)
            for one, b in zip(z, inputs, strict=True)
        ]
    )


def _sampled_plant(axis: ServoAxis) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return Phi (n, n), inputs (n,) for the set points delayed by whole + 1 and by whole periods,
    and C (n,).

    The hold is exact: x' = A x + B u over each period, in which u changes once, `delay_periods`
    after the sample.
    """
    from scipy.linalg import expm

    drive, rig = axis.drive, axis.rig
    n, Ts, lag = rig.n_axes, 1 / axis.drive.fs, axis.drive.lag
    order = 2 * n + (lag > 0)
    A, B, C = np.zeros((order, order)), np.zeros(order), np.zeros(order)
    A[:n, n : 2 * n] = np.eye(n)
    A[n : 2 * n, : 2 * n] = -np.linalg.solve(rig.mass, np.hstack([rig.stiffness, rig.damping]))
    push = np.linalg.solve(rig.mass, np.asarray(rig.actuators))[:, 0]
    if lag > 0:
        A[n : 2 * n, -1], A[-1, -1], B[-1] = push, -1 / lag, 1 / lag
    else:
        B[n : 2 * n] = push
    C[:n] = np.asarray(rig.sensors)[0]

    def sampled(T: float) -> tuple[np.ndarray, np.ndarray]:
        whole = expm(T * np.block([[A, B[:, None]], [np.zeros((1, order + 1))]]))
        return whole[:order, :order], whole[:order, -1]

    part = drive.delay_periods % 1.0
    (Phi, _), (_, early), (late_Phi, late) = (
        sampled(Ts),
        sampled(part * Ts),
        sampled((1 - part) * Ts),
    )
    return Phi, late_Phi @ early, late, C


def closed_loop_poles(axis: ServoAxis) -> np.ndarray:
    """Return the poles of the axis under its drive, without friction, over one period of the
    position loop.

    One period is a linear map of the states of drive and machine. It is built by running the steps
    of the compiled drive on all unit vectors at once.
    """
    Phi, early, late, C = _sampled_plant(axis)
    drive, sections = axis.drive, axis.drive.sections
    Ts, whole = 1 / drive.fs, int(drive.delay_periods)
    # rows: machine, set points of the last whole + 1 periods, last reading, speed, integral,
    # position loop, filters
    sizes = np.cumsum([C.size, whole + 1, 1, 1, 1, 1])
    state = np.eye(sizes[-1] + 2 * len(sections))
    for k in range(drive.position_every):
        x, forces, last, speed, integral, by_position, memory = (
            one.copy() for one in np.split(state, sizes)
        )
        y = C @ x
        speed += Ts / (Ts + drive.velocity_lag) * ((y - last) / Ts - speed)
        if k == 0:
            by_position = -drive.kv * y[None]
        error = by_position - speed
        new = drive.gain * error + integral
        for s, (b0, b1, b2, _, a1, a2) in enumerate(sections):  # direct form II, transposed
            given, new = new, b0 * new + memory[[2 * s]]
            memory[2 * s] = (b1 * given - a1 * new + memory[2 * s + 1])[0]
            memory[2 * s + 1] = (b2 * given - a2 * new)[0]
        integral += drive.gain * Ts / drive.tn * error
        forces = np.vstack([axis.force_constant * new, forces])
        x = Phi @ x + np.outer(early, forces[whole + 1]) + np.outer(late, forces[whole])
        state = np.vstack([x, forces[:-1], y[None], speed, integral, by_position, memory])
    return np.linalg.eigvals(state)


def crossover_frequency(axis: ServoAxis) -> float:
    """Return the highest frequency [Hz] at which the loop, opened at the force, has a gain of one;
    nan if none.

    The grid is fine and covers six decades below half the sampling frequency.
    """
    f = np.geomspace(1e-6, 1.0, 3000)[:-1] * axis.drive.fs / 2
    L = 1 / _port_frf(axis, _plant_frf(axis, f), port="force", f=f) - 1
    above = np.flatnonzero(np.abs(L) >= 1)
    if above.size:
        return float(f[above[-1]])
    return np.nan


def _port_frf(axis: ServoAxis, G: np.ndarray, *, port: str, f: np.ndarray) -> np.ndarray:
    """Return (F,) response of the force set point to a unit at a port, by the equations of
    docs/guide/axis.md.

    A position loop that runs in every nth period is replaced by its mean over the n phases, without
    its aliases.
    """
    drive, Ts = axis.drive, 1 / axis.drive.fs
    z, every = np.exp(2j * np.pi * f * Ts), axis.drive.position_every
    smoothing = Ts / (Ts + drive.velocity_lag)
    speed = (1 - 1 / z) / Ts * smoothing / (1 - (1 - smoothing) / z)
    pi = axis.force_constant * drive.gain * (1 + Ts / drive.tn / (z - 1))
    for section in drive.sections:
        pi = pi * np.polyval(section[:3], z) / np.polyval(section[3:], z)
    hold = (1 - z**-every) / (every * (1 - 1 / z))
    by_position = drive.kv * hold
    ahead = drive.velocity_feedforward * hold * (1 - z**-every) / (every * Ts)
    entry = {"force": 1.0, "velocity": pi, "position": pi * (by_position + ahead)}[port]
    return np.asarray(entry / (1 + G * pi * (by_position + speed)))
