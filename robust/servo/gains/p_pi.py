"""A drive as one controller: from the measured positions to the set point of current or force.

    u = -K y,   K = F(z) kp (1 + Ts/tn z^-1/(1 - z^-1)) (V(z) + kv H(z))

F are the filters, V gives the velocity, and H is the hold of the position loop. Ts is the period of
the velocity loop.
"""

from __future__ import annotations

import warnings

import control
import numpy as np

from nlfrf._base.arguments import require_kind
from nlfrf.rig import Drive
from robust._base.warnings import DesignWarning
from robust.lti.connections import block_diagonal, in_parallel, in_series
from robust.lti.lti import with_names
from robust.lti.sampling import sampled
from robust.synthesis.blocks import second_order_section


def cascade(
    settings: Drive, *, output_unit: str = "", actuator: bool = False
) -> control.StateSpace:
    """Return the P-PI cascade of a drive as one controller.

    Use this for every check, proof or plot that takes a controller K, such as `check` and
    `prove_friction`.

    Parameters
    ----------
    settings : Drive
        Gains, filters, sampling and units.
    output_unit : str
        Unit of u: "A", or "N" ("Nm" for a rotary axis). The default is the output unit of
        `kp_unit`. It must be the unit of the plant input.
    actuator : bool
        False if the plant was identified from the current set point: u is then the current set
        point, and the plant contains delay and lag of the current loop. True if the plant was
        identified from the actual current: u is then the actual current at the sampling instants,
        and K contains delay and lag.

    Returns
    -------
    control.StateSpace
        Discrete controller from the position in `position_unit` to u, with u = -K y. With two
        encoders it has two inputs, "motor" in `position_unit` and "load" in `load_unit`.

    Raises
    ------
    ValueError
        Settings that are not a Drive, or a unit of u that needs a torque constant when none is
        given.

    Warns
    -----
    DesignWarning
        If the position loop runs slower than the velocity loop. Such a drive is periodically
        time-varying. K is a time-invariant approximation: the mean over all instants within a
        period of the position loop at which that loop may sample. A verdict on K holds for this
        approximation.

    References
    ----------
    SP 10.5 (cascade control).

    Examples
    --------
    >>> settings = Drive(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8)
    >>> K = cascade(settings, output_unit="N")
    >>> K.input_labels, K.output_labels, K.dt
    (['position'], ['force'], 0.00025)
    >>> round(float(abs(K(np.exp(2j * np.pi * 400 / 4000)))) / 1e6, 2)           # MN/m at 400 Hz
    18.69
    """
    require_kind("settings", settings, Drive)
    unit = output_unit or settings.output_unit
    scale = settings.gain * settings.output_factor(unit)
    warn_of_slow_position_loop(settings)
    dt = settings.dt
    K = in_series(_measured_velocity(settings), *_behind_velocity_loop(settings, scale), dt=dt)
    if actuator:
        current = control.StateSpace([], [], [], [[1.0]], 0)
        if rate := settings.lag and 1 / settings.lag:
            current = control.StateSpace([[-rate]], [[rate]], [[1.0]], [[0.0]], 0)
        K = in_series(K, sampled(current, dt, settings.delay), dt=dt)
    inputs = ("motor", "load") if settings.encoder == "both" else ("position",)
    return with_names(K, inputs, ("current" if unit == "A" else "force",))


def with_set_point(settings: Drive, *, output_unit: str = "") -> control.StateSpace:
    """Return the drive from (position set point, measured positions) to u, each in its own unit."""
    scale = settings.gain * settings.output_factor(output_unit or settings.output_unit)
    if settings.encoder == "both":
        factor = settings.load_scale.factor
    else:
        factor = settings.position_scale.factor
    n, held = settings.position_every, hold_mean(settings)
    # differences over a period of the position loop
    ahead = settings.velocity_feedforward * settings.fs / n
    difference = realise_fir(np.concatenate([[ahead], np.zeros(n - 1), [-ahead]]), settings.dt)
    velocity_set_point = in_parallel(
        times(settings.kv, held), in_series(difference, held, dt=settings.dt)
    )
    error = _added(times(factor, velocity_set_point), times(-1.0, _measured_velocity(settings)))
    return in_series(error, *_behind_velocity_loop(settings, scale), dt=settings.dt)


def _measured_velocity(settings: Drive) -> control.StateSpace:
    """Return the feedback of the velocity loop, from the positions to velocity + kv position, in
    its own units.
    """
    velocity = times(
        settings.position_scale.factor, realise_section(velocity_section(settings), settings.dt)
    )
    if settings.encoder == "both":
        factor = settings.load_scale.factor
    else:
        factor = settings.position_scale.factor
    join = _added if settings.encoder == "both" else in_parallel
    return join(velocity, times(settings.kv * factor, hold_mean(settings)))


def _behind_velocity_loop(settings: Drive, scale: float) -> list[control.StateSpace]:
    """Return the PI controller of the velocity, times a scale, and the filters behind it."""
    dt = settings.dt
    share = dt / settings.tn
    pi = control.StateSpace([[1.0]], [[1.0]], [[scale * share]], [[scale]], dt)
    gain = control.StateSpace([], [], [], [[scale]], dt)
    return [pi if share else gain, *(realise_section(one, dt) for one in settings.sections)]


def velocity_section(settings: Drive) -> np.ndarray:
    """Return (6,) section from a position to its velocity: differences behind a low-pass, or the
    observer.
    """
    fs = settings.fs
    if settings.velocity_from == "observer":
        omega = 2 * np.pi * settings.observer_frequency
        return second_order_section([0.0, omega, 0.0], [1.0, 2.0, 1.0], 1 / np.tan(omega / fs / 2))
    share = 1 / (1 + settings.velocity_lag * fs)
    return np.array([share * fs, -share * fs, 0.0, 1.0, share - 1.0, 0.0])


def hold_mean(settings: Drive) -> control.StateSpace:
    """Return the hold of a position loop that samples in every nth period, as its mean over the n
    phases.
    """
    n = settings.position_every
    return realise_fir(np.full(n, 1 / n), settings.dt)


def warn_of_slow_position_loop(settings: Drive) -> None:
    """Warn that K is an approximation where the position loop runs slower than the velocity
    loop.
    """
    if settings.position_every > 1:
        warnings.warn(
            f"the position loop runs once in {settings.position_every} periods of the velocity"
            " loop, so the drive is periodically time-varying. K is its mean over the"
            f" {settings.position_every} possible shifts between both loops, and every verdict"
            " on K holds for this approximation only. Set position_every to 1 for a proof",
            DesignWarning,
            stacklevel=3,
        )


def realise_section(section: np.ndarray, dt: float) -> control.StateSpace:
    """Return a second-order section as a state space; a section of first order has one state."""
    b0, b1, b2, _, a1, a2 = section
    A, B = np.array([[-a1, 1.0], [-a2, 0.0]]), np.array([[b1 - a1 * b0], [b2 - a2 * b0]])
    n = 2 if a2 or b2 else 1
    return control.StateSpace(A[:n, :n], B[:n], np.eye(1, n), [[b0]], dt)


def realise_fir(taps: np.ndarray, dt: float) -> control.StateSpace:
    """Return a sum of delayed samples as a state space."""
    n = taps.size - 1
    if n == 0:
        return control.StateSpace([], [], [], [[taps[0]]], dt)
    return control.StateSpace(np.eye(n, k=-1), np.eye(n, 1), taps[None, 1:], [[taps[0]]], dt)


def times(factor: float, system: control.StateSpace) -> control.StateSpace:
    """Return a system with its output multiplied by a number."""
    return control.StateSpace(system.A, system.B, factor * system.C, factor * system.D, system.dt)


def _added(F: control.StateSpace, G: control.StateSpace) -> control.StateSpace:
    """Return two systems, each with its own inputs, with their outputs added."""
    both = block_diagonal([F, G], F.dt)
    return control.StateSpace(
        both.A, both.B, both.C.sum(axis=0)[None], both.D.sum(axis=0)[None], F.dt
    )
