"""Design of an experiment on a running drive: a multisine that gives a wanted spectrum of force,
within limits.
"""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import numpy as np

from nlfrf import Multisine
from nlfrf._base.arguments import (
    data_warning,
    require_choice,
    require_integer,
    require_kind,
    require_positive,
    require_real,
)
from nlfrf._base.drive_entries import PORTS
from nlfrf._base.units import POSITIONS
from nlfrf.rig import ServoAxis
from nlfrf.signals import AxisExperiment, AxisLimits
from robust.servo.experiment.loop import (
    DriveSource,
    RecordSource,
    Source,
    as_source,
    closed_loop_poles,
    crossover_frequency,
)

#: Largest error of a double pole at one by rounding: the square root of the rounding of its
#: numbers.
_ROUNDING_OF_POLES = 1e-6
#: Factor by which the crossover lies outside the band if a warning is due: a model may still reach
#: a closer one.
_FAR = 2.0


def design_experiment(
    source: Source,
    ms: Multisine,
    *,
    rms: float | None = None,
    port: str = "position",
    limits: AxisLimits | None = None,
    base_velocity: float = 0.0,
    strokes: int = 0,
    n_periods: int = 2,
    n_discard: int = 2,
) -> AxisExperiment:
    """Design a multisine to add to a set point of a running drive, for a given force spectrum.

    Use this to identify an axis whose loop stays closed. The input of the identification is the
    force set point, which is an output of the controller. The spectrum to play is therefore the
    wanted force spectrum divided by the transfer function from the port (the set point to which the
    multisine is added) to the force. This transfer function is either computed from the gains and a
    rough plant, or measured with a first multisine of low level at the same port. The computed
    transfer function contains no friction: if the axis sticks, design again from the first record.

    Parameters
    ----------
    source : ServoAxis, Record, or pair of ServoAxis and Bla
        One of three: a drive with its gains and a rough machine, whose friction is used for
        `peak_force` only; a drive of this kind with a `Bla` from force set point to position, which
        replaces the FRF of the rough machine; or a record at the same port with its reference r, as
        `load_trace` returns it.
    ms : Multisine
        Band, phases and spectrum of the force set point; the level of `ms` is not used. Its
        sampling frequency must be that of the drive or of the record. Each of its M realisations
        becomes one file to play.
    rms : float, optional
        Root mean square of the force set point, in its unit. The default is the largest value that
        the limits allow.
    port : str
        Set point to which the multisine is added: "position", "velocity" or "force".
    limits : AxisLimits, optional
        Largest force, velocity and travel, including the base motion.
    base_velocity : float
        Velocity of a base motion that keeps the friction sliding [m/s] or [rad/s]; zero for an axis
        at rest.
    strokes : int
        Number of strokes forth and back, each of n_discard + n_periods periods; zero for one long
        stroke.
    n_periods, n_discard : int
        Number of periods to evaluate in each stroke, and of periods to discard before them.

    Returns
    -------
    AxisExperiment

    Raises
    ------
    ValueError
        A level or a base motion beyond a limit; a multisine that would reverse the base motion;
        neither a level nor limits; a source that does not fit; a multisine with another sampling
        frequency.

    Warns
    -----
    DataWarning
        For a drive with a rough machine: an unstable loop, a crossover far outside the band, or a
        reset time `tn` longer than the period.

    References
    ----------
    Pintelon & Schoukens, *System Identification: A Frequency Domain Approach*, 2nd ed., 2.6.4 (FRF
    of a closed loop).

    Examples
    --------
    >>> import nlfrf
    >>> axis = nlfrf.servo_axis("belt")
    >>> limits = AxisLimits(velocity=0.3, travel=0.5)
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=200, rng=1)
    >>> design_experiment(axis, ms, base_velocity=0.1, strokes=1, limits=limits, rms=500)
    Traceback (most recent call last):
        ...
    ValueError: rms must be at most 50.7 N within the limits, got 500 N: velocity would peak at 0.986, above ...
    """
    base_velocity = require_real("base_velocity", base_velocity)
    strokes = require_integer("strokes", strokes, least=0)
    if strokes and not base_velocity:
        raise ValueError(
            f"base_velocity must not be zero with strokes, got zero with {strokes} strokes"
        )
    if strokes:
        directions = np.tile([1.0, -1.0], strokes)
    else:
        directions = np.ones(1)
    drive = as_source(source)
    wanted = _wanted_force(drive, ms)
    if isinstance(source, ServoAxis):
        _warn_of_loop(source, wanted)
    segments = _Segments(base_velocity * directions, np.ones(directions.size), n_periods, n_discard)
    return _experiment_within(drive, wanted, segments=segments, port=port, rms=rms, limits=limits)


def design_ramp(
    source: Source,
    ms: Multisine,
    *,
    rms: float | None = None,
    port: str = "position",
    limits: AxisLimits | None = None,
    n_levels: int = 20,
    span: float = 1e4,
    n_periods: int = 1,
    n_discard: int = 1,
) -> AxisExperiment:
    """Design a pre-test at rest: one multisine at rising levels, from sticking to sliding.

    Use this to find the levels at which friction sticks, bends (its stiffness falls) and slides;
    `find_levels` finds them in the trace of the pre-test. The levels rise in equal ratios from
    `rms` / `span` to `rms`, and each lasts a few periods. If a drive stops at a limit, the complete
    levels before the stop are evaluated.

    Parameters
    ----------
    source, port, limits
        As for `design_experiment`.
    ms : Multisine
        As for `design_experiment`, with one realisation. Band and spectrum should be those of the
        later experiments.
    rms : float, optional
        Rms that the force set point has at the highest level if the axis slides there, in the
        unit of the set point. The default is the largest value within the limits.
    n_levels : int
        Number of levels.
    span : float
        Ratio of the highest to the lowest level.
    n_periods, n_discard : int
        Number of periods to evaluate at each level, and of periods to discard before them.

    Returns
    -------
    AxisExperiment
        The pre-test, with one realisation.

    Raises
    ------
    ValueError
        The errors of `design_experiment`; fewer than four levels; several realisations.

    References
    ----------
    Beckhoff TE5960 (TwinCAT 3 motion tuning): a base amplitude, found by trial, that overcomes
    stiction.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=100, rng=1)
    >>> ramp = design_ramp(nlfrf.servo_axis("belt"), ms, rms=100, n_levels=10)
    >>> ramp.labels[-1], ramp.duration
    ('level 10', 20.25)
    """
    n_levels = require_integer("n_levels", n_levels, least=4)
    if not require_positive("span", span) > 1:
        raise ValueError(f"span must be above 1, got {span:g}")
    drive = as_source(source)
    wanted = _wanted_force(drive, ms)
    if wanted.n_realizations != 1:
        raise ValueError(f"ms must have one realisation, got {wanted.n_realizations}")
    segments = _Segments(
        np.zeros(n_levels), np.geomspace(1 / span, 1.0, n_levels), n_periods, n_discard
    )
    return _experiment_within(drive, wanted, segments=segments, port=port, rms=rms, limits=limits)


class _Segments(NamedTuple):
    """Base velocity and relative level of each segment (S,), periods to keep of each, and periods
    before them.
    """

    velocities: np.ndarray
    gains: np.ndarray
    n_periods: int
    n_discard: int


def _wanted_force(source: DriveSource | RecordSource, ms: Multisine) -> Multisine:
    """Return the wanted multisine of the force, with an rms of one."""
    require_kind("ms", ms, Multisine)
    if not ms.is_single:
        raise ValueError(f"ms must have one input, got {ms.n_inputs}")
    fs = source.fs
    if abs(ms.fs / fs - 1) > 1e-9:
        raise ValueError(f"ms must be sampled as the source is, at {fs:g} Hz, got {ms.fs:g} Hz")
    return replace(ms, amplitude=ms.amplitude / ms.rms, hold="zoh")


def _warn_of_loop(axis: ServoAxis, wanted: Multisine) -> None:
    """Warn of a loop that is unstable, or does not fit the band and the period of the
    experiment.
    """
    drive = axis.drive
    gains = f"kv = {drive.kv:g} 1/s, kp = {drive.kp:g} {drive.kp_unit} and tn = {drive.tn:g} s"
    if np.abs(closed_loop_poles(axis)).max() > 1 + _ROUNDING_OF_POLES:
        data_warning(
            f"the loop of this axis with {gains} is unstable without friction, so the computed"
            " peaks and set points are wrong. Check the units of the gains, of torque_constant"
            " and of the inertia"
        )
        return
    crossover, (first, last) = crossover_frequency(axis), wanted.f[[0, -1]]
    if not first / _FAR <= crossover <= last * _FAR:
        if np.isnan(crossover):
            where = "nowhere"
        else:
            where = f"at {crossover:.3g} Hz"
        data_warning(
            f"the loop with {gains} crosses over {where}, far outside the lines of {first:g} to"
            f" {last:g} Hz: a trace cannot show its margins. Take a band around the crossover, or"
            " check the units of the gains"
        )
    period = wanted.n_samples / wanted.fs
    if period < drive.tn < np.inf:
        data_warning(
            f"tn = {drive.tn:g} s is longer than the period of {period:g} s: the lines do not show"
            " the integral part. Check the unit of tn: it is in seconds here, and drives often"
            " show it in ms"
        )


def _experiment_within(
    source: DriveSource | RecordSource,
    wanted: Multisine,
    *,
    segments: _Segments,
    port: str,
    rms: float | None,
    limits: AxisLimits | None,
) -> AxisExperiment:
    """Return the experiment at its level, or at the largest level within the limits; refuse a level
    beyond them.
    """
    if limits is not None:
        require_kind("limits", limits, AxisLimits)
    force_response, position_response = source.responses(
        require_choice("port", port, PORTS), wanted.f
    )
    position, force = source.units
    position = POSITIONS.get(position, (position,))[0]
    draft = AxisExperiment(
        ms=replace(wanted, amplitude=wanted.amplitude / np.abs(force_response)),
        port=port,
        force_response=force_response,
        position_response=position_response,
        gains=segments.gains,
        velocities=segments.velocities,
        n_periods=require_integer("n_periods", segments.n_periods, least=1),
        n_discard=require_integer("n_discard", segments.n_discard, least=1),
        position_unit=position or "m",
        force_unit=force or "N",
        base_force=0.0,
        assumed_drive=source.assumed_drive,
    )
    # the force of the base motion is simulated with the set points of the draft
    draft = replace(draft, base_force=source.base_force(draft))
    level = _level_within(draft, limits=AxisLimits() if limits is None else limits, rms=rms)
    return replace(draft, ms=replace(draft.ms, amplitude=level * draft.ms.amplitude))


def _level_within(draft: AxisExperiment, *, limits: AxisLimits, rms: float | None) -> float:
    """Return the rms of the force set point, as given or the largest within the limits; the draft
    has an rms of 1.
    """
    units = {
        "force": draft.force_unit,
        "velocity": f"{draft.position_unit}/s",
        "travel": draft.position_unit,
    }
    base = draft.base_motion
    # Peaks are bounded by sums, base motion plus level times multisine, whatever their phases are.
    taken, each = base._asdict(), draft.multisine_motion._asdict()
    left = {}
    for name, unit in units.items():
        limit = getattr(limits, name)
        if taken[name] > limit:
            raise ValueError(
                f"base_velocity or the length of the strokes must be smaller for a {name} of at"
                f" most {limit:g} {unit}, got {base.velocity:g} {units['velocity']}: the base"
                f" motion alone needs {taken[name]:.3g} {unit}"
            )
        left[name] = limit - taken[name]
    if (
        base.velocity
    ):  # a multisine as fast as its base motion reverses the axis, and friction sticks
        left["velocity"] = min(left["velocity"], base.velocity)
    tightest = min(left, key=lambda name: left[name] / each[name])
    largest = left[tightest] / each[tightest]
    if rms is None and not np.isfinite(largest):
        raise ValueError("rms must be given without limits, got none")
    if rms is None:
        level = largest
    else:
        level = require_positive("rms", rms)
    if level > largest * (1 + 1e-12):
        raise ValueError(
            f"rms must be at most {largest:.3g} {draft.force_unit} within the limits, got {level:g}"
            f" {draft.force_unit}: {tightest} would peak at {level * each[tightest]:.3g}, above"
            f" {left[tightest]:.3g} {units[tightest]}"
            + (" left by the base motion" if base.velocity else "")
        )
    if not level > 0:
        raise ValueError(
            f"limits must leave some {tightest} for the multisine, got none: the base motion"
            " takes it"
        )
    return level
