"""Three levels from a pre-test, at which the friction sticks, bends (stiffness falls) and slides.

At each level the lowest lines obey U = (k - m w^2 + j c w) Y. While friction sticks, k is its
presliding stiffness, the same at every level. k falls as elements slip. When the axis slides, k is
the stiffness of springs to ground.
"""

from __future__ import annotations

from collections.abc import Sequence
from enum import Enum
from typing import NamedTuple

import numpy as np

from nlfrf import Record
from nlfrf._base.arguments import require_kind, require_list
from nlfrf._base.numbers import clipped_share, smallest_step, squared_modulus
from nlfrf._base.values import value
from nlfrf.io import in_design_units
from nlfrf.signals import AxisExperiment
from robust.pages.text import format_table
from robust.servo.experiment.loop import record_spectra

_LOW_LINES = 6  # number of lowest lines that give the stiffness: three pairs of a special-odd grid
_STEPS = 2.0  # least rms of a position, in steps of the encoder, for a level to be read
# largest relative scatter of the stiffness over levels that stick; quantisation gives up to 6 %
_PLATEAU = 0.1
# least stiffness over the plateau of a level that sticks; below, elements slip at the peaks
_STICKS = 0.97
# least ratio of highest to lowest position of a plateau: two equal levels are no plateau
_PLATEAU_SPAN = 2.0
_SLIDES = 0.005  # largest remaining share of the fall of the stiffness at a level that slides
# largest change of the stiffness between the two highest levels, over the plateau, if the axis
# slides
_SETTLED = 0.02
# least share of k Y in the force on the lowest lines; below, the mass determines k
_MIN_STIFFNESS_SHARE = 0.5
_RISES = 1.2  # stiffness over the median of the lower levels above which it rises with the level
# least ratio of slow to fast changes between periods for a drift: a vibration has slow ones too
_DRIFTS = 3.0
_CLIPPED = 2e-3  # largest share of samples at a limit of force for a level to be read


class FrictionRegime(Enum):
    """State of the friction at a level: sticking, bending (stiffness falls), sliding, or unknown.

    References
    ----------
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems 28
    (6), 2008.

    Examples
    --------
    >>> FrictionRegime.STICKS.value
    'sticks'
    """

    STICKS = "sticks"
    BENDS = "bends"
    SLIDES = "slides"
    TOO_SMALL = "too small: encoder steps"
    LIMITED = "at the limit of the force"
    OPEN = "left open"


@value
class AxisLevels:
    """The levels of a pre-test, and the three levels to use for experiments on friction.

    Fields
    ------
    rms : (3,) ndarray
        Rms of the force set point to design for, at the three levels at which the friction sticks,
        bends (its stiffness falls) and slides. They are entries of `set_point_rms`. Empty if
        `reason` is not empty.
    records : tuple of Record
        Records of the three levels, in the units of the design. Each is the `source` of
        `design_experiment` for its level.
    reason : str
        Reason why three levels were not found, and what to do; empty if they were found.
    force_rms, position_rms : (L,) ndarray
        Rms of force set point and position on the excited lines at each level, in the units of the
        design. A current is converted to a force, unless its unit cannot be converted.
    set_point_rms : (L,) ndarray
        Rms to design for at each level, in the unit of force of the design. A multisine with this
        rms and with the spectrum of the design moves the axis as far as the pre-test did at this
        level. The value is below `force_rms` if the loop changed the spectrum of the force.
    stiffness : (L,) ndarray
        Equivalent stiffness at each level from the lowest lines [N/m], [Nm/rad] or in the units of
        the record.
    states : tuple of FrictionRegime
        State of the friction at each level.
    units : tuple of str
        Units of force and position.

    Examples
    --------
    >>> levels = AxisLevels(
    ...     rms=np.zeros(0), records=(), reason="no level sticks", force_rms=np.ones(1), position_rms=np.ones(1),
    ...     set_point_rms=np.ones(1), stiffness=np.ones(1), states=(FrictionRegime.BENDS,), units=("N", "m"),
    ... )
    >>> print(levels)
    level  design for N rms  measured N rms  position m rms  stiffness N/m
        1                 1               1               1              1  bends
    no level sticks

    References
    ----------
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems 28
    (6), 2008.
    """

    rms: np.ndarray
    records: tuple[Record, ...]
    reason: str
    force_rms: np.ndarray
    position_rms: np.ndarray
    set_point_rms: np.ndarray
    stiffness: np.ndarray
    states: tuple[FrictionRegime, ...]
    units: tuple[str, str]

    def __str__(self) -> str:
        force, position = self.units
        units = f"{force} rms", f"{force} rms", f"{position} rms", f"{force}/{position}"
        names = ("design for", "measured", "position", "stiffness")
        rows = [("level", *map(" ".join, zip(names, units, strict=True)), "")]
        columns = zip(
            self.set_point_rms,
            self.force_rms,
            self.position_rms,
            self.stiffness,
            self.states,
            strict=True,
        )
        for k, (*numbers, state) in enumerate(columns):
            rows.append((str(k + 1), *(f"{number:.4g}" for number in numbers), state.value))
        taken = ", ".join(
            f"{rms:.3g} {force} ({state})" for rms, state in zip(self.rms, _TAKEN, strict=False)
        )
        if self.reason:
            return f"{format_table(rows)}\n{self.reason}"
        asked = (
            "design for: rms of a force with the designed spectrum that moves the axis as far as"
            " the measured force"
        )
        return f"{format_table(rows)}\n{asked}\ntake, as rms of the force set point: {taken}"


_TAKEN = ("sticks", "bends", "slides")


def find_levels(records: Sequence[Record], experiment: AxisExperiment) -> AxisLevels:
    """Find the levels of a pre-test at which the friction sticks, bends and slides.

    Use this after a pre-test from `design_ramp` was played, to choose the levels of the experiments
    for `robust.friction.identify_friction`. Friction bends if its stiffness falls with the level.

    Parameters
    ----------
    records : sequence of Record
        Records of the pre-test, from `load_trace`.
    experiment : AxisExperiment
        Design of the pre-test, from `design_ramp`.

    Returns
    -------
    AxisLevels
        No levels are found, and `reason` states why, if the lowest level does not stick; if the
        highest level does not slide; if the stiffness rises with the level (backlash, a hardening
        spring); or if too many levels are below one step of the encoder or at a limit of the force.

    Raises
    ------
    ValueError
        Records without a reference or with several channels, or a design that is not a pre-test.

    References
    ----------
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems 28
    (6), 2008.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> from nlfrf.io import load_trace
    >>> from robust.servo import design_ramp, play_experiment
    >>> axis = nlfrf.servo_axis("ball screw")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=2000, f_min=2, f_max=60, rng=1)
    >>> ramp = design_ramp(axis, ms, rms=2500, n_levels=14)
    >>> folder = tempfile.TemporaryDirectory()
    >>> nlfrf.save(ramp, f"{folder.name}/ramp.csv")
    >>> trace = play_experiment(axis, f"{folder.name}/ramp.csv", f"{folder.name}/trace.csv")
    >>> levels = find_levels(load_trace(f"{folder.name}/trace.csv", ramp), ramp)
    >>> levels.reason, bool(levels.rms[0] < levels.rms[1] < levels.rms[2])
    ('', True)
    >>> folder.cleanup()
    """
    require_kind("experiment", experiment, AxisExperiment)
    if not experiment.is_ramp:
        raise ValueError(
            "experiment must be a ramp of levels, got one with the parts"
            f" {', '.join(experiment.labels)}"
        )
    records = [in_design_units(one, experiment) for one in require_list("records", records, Record)]
    read = [_read_level(one) for one in records]
    stiffness = np.array([one.stiffness for one in read])
    position = np.array([one.position for one in read])
    units = (records[0].u_unit or experiment.force_unit, experiment.position_unit)
    states, reason = _judge_levels(read, units, experiment.gains)
    if reason:
        chosen = []
    else:
        chosen = _choose_levels(states, stiffness)
    shape = experiment.force_amplitude / np.sqrt(np.sum(experiment.force_amplitude**2) / 2)
    set_point = np.array([_level_of_spectrum(record, shape) for record in records])
    return AxisLevels(
        rms=set_point[chosen],
        records=tuple(records[k] for k in chosen),
        reason=reason,
        force_rms=np.array([one.force for one in read]),
        position_rms=position,
        set_point_rms=set_point,
        stiffness=stiffness,
        states=tuple(states),
        units=(
            records[0].u_unit or experiment.force_unit,
            records[0].y_unit or experiment.position_unit,
        ),
    )


class _Level(NamedTuple):
    """One level: rms of force and position, stiffness, and shares of stiffness and damping in the
    force on low lines.

    steps : rms of the position in steps of the encoder. limited : whether the force is at a limit.
    drift, vibration : rms of the slow and of the fast differences between periods.
    """

    force: float
    position: float
    stiffness: float
    stiffness_share: float
    damping_share: float
    steps: float
    limited: bool
    drift: float = 0.0
    vibration: float = 0.0

    @property
    def readable(self) -> bool:
        """True if the encoder resolves the motion, and the force is not at its limit."""
        return not self.limited and self.steps > _STEPS


def _read_level(record: Record) -> _Level:
    """Return rms and stiffness of a level, the latter by least squares of U = (k - m w^2 + j c w) Y
    on low lines.
    """
    U, Y = (one[0].mean(axis=0) * 2 / record.n_samples for one in record_spectra(record)[:2])
    omega = 2 * np.pi * record.lines.excited * record.f0
    low = slice(0, _LOW_LINES)
    columns = np.column_stack([Y, -(omega**2) * Y, 1j * omega * Y])[low]
    scale = np.linalg.norm(columns, axis=0)
    A = np.concatenate([columns.real, columns.imag]) / scale
    found = np.linalg.lstsq(A, np.concatenate([U[low].real, U[low].imag]), rcond=None)[0] / scale
    force, position = (float(np.sqrt(np.sum(squared_modulus(one)) / 2)) for one in (U, Y))
    limited = clipped_share(np.ascontiguousarray(record.u[0]).ravel()) > _CLIPPED
    share, _, damped = found * scale / np.linalg.norm(U[low])
    return _Level(
        force,
        position,
        float(found[0]),
        float(share),
        float(damped),
        position / (smallest_step(record.y) or np.inf),
        limited,
        *_changes_of_periods(record),
    )


def _changes_of_periods(record: Record) -> tuple[float, float]:
    """Return the rms of the slow and of the fast differences between the position of a record and
    its mean period.

    Slow means up to the lines that give the stiffness, such as creep or settling; fast is above,
    such as vibration.
    """
    y = np.asarray(record.y)[0]
    power = 2 * squared_modulus(np.fft.rfft((y - y.mean(axis=0)).ravel()) / y.size)
    first = y.shape[0] * int(record.lines.excited[:_LOW_LINES][-1])
    return float(np.sqrt(power[:first].sum())), float(np.sqrt(power[first:].sum()))


def _judge_levels(
    read: list[_Level], units: tuple[str, str], gains: np.ndarray
) -> tuple[list[FrictionRegime], str]:
    """Return the state of each level, and the reason why no three of them can be taken.

    gains : (S,) relative set point of each level; the lowest levels have no record if nothing
    moved.
    """
    states = []
    for level in read:
        if level.readable:
            states.append(FrictionRegime.OPEN)
        elif level.limited:
            states.append(FrictionRegime.LIMITED)
        else:
            states.append(FrictionRegime.TOO_SMALL)
    good = [k for k, one in enumerate(read) if one.readable]
    force, unit = units[0], f"{units[0]}/{units[1]}"
    if len(good) > 3:
        held = _held_levels(read, gains)
        below = _what_lies_below(read, units, gains, held)
    else:
        held = 0
        below = ""
    if reason := _reason_against_reading(read, units, below, held):
        return states, reason
    k, position = (
        np.array([getattr(read[i], name) for i in good]) for name in ("stiffness", "position")
    )
    first, last = _plateau_of(k, position)
    if first == last:
        for i in good:
            states[i] = FrictionRegime.BENDS
        return (
            states,
            (
                "no level sticks: no two levels a factor of two apart have the same stiffness; it"
                f" changes from {k[0]:.3g} to {k[1]:.3g} {unit} between the lowest two. {below}"
            ),
        )
    return _judge_breaking_away(
        states, read, good[first:], k=k[first:], n_plateau=last - first, unit=(force, unit)
    )


def _judge_breaking_away(
    states: list[FrictionRegime],
    read: list[_Level],
    good: list[int],
    *,
    k: np.ndarray,
    n_plateau: int,
    unit: tuple[str, str],
) -> tuple[list[FrictionRegime], str]:
    """Return the states, set for the levels from the plateau of the stiffness on, and the reason if
    they do not do.

    Below the plateau the levels are dominated by quantisation.
    """
    force, unit_k = unit
    k0, k_end = float(np.median(k[:n_plateau])), float(k[-1])
    if k_end < k0:
        share = (k - k_end) / (k0 - k_end)
    else:
        share = np.ones(k.size)
    settled = abs(k[-1] - k[-2]) < _SETTLED * k0 and k_end < _STICKS * k0
    for i, one, left in zip(good, k, share, strict=True):
        if one >= _STICKS * k0:
            states[i] = FrictionRegime.STICKS
        elif settled and left <= _SLIDES:
            states[i] = FrictionRegime.SLIDES
        else:
            states[i] = FrictionRegime.BENDS
    top = f"at {read[good[-1]].force:.3g} {force} rms, the highest level that can be read"
    if k_end >= _STICKS * k0:
        return (
            states,
            (
                f"the axis does not break away: its stiffness stays at {k_end:.3g} {unit_k} {top}."
                " Raise level and limits"
            ),
        )
    if not settled:
        return (
            states,
            (
                f"the axis does not slide yet: its stiffness still changes from {k[-2]:.3g} to"
                f" {k_end:.3g} {unit_k} {top}. Raise level and limits"
            ),
        )
    if FrictionRegime.BENDS not in states:
        return states, "no level bends between sticking and sliding: take more levels"
    return states, ""


def _held_levels(read: list[_Level], gains: np.ndarray) -> int:
    """Return the number of levels below the lowest readable one at which friction holds the axis.

    Friction holds it if it moves less than in proportion to the motion at the highest level.
    """
    first, missing = next(k for k, one in enumerate(read) if one.readable), gains.size - len(read)
    steps = np.append(np.zeros(missing), [one.steps for one in read])
    below = np.arange(gains.size) < missing + first
    return int(
        np.count_nonzero(
            below & (2 * _STEPS * gains[-1] < read[-1].steps * gains) & (steps < _STEPS)
        )
    )


def _what_lies_below(
    read: list[_Level], units: tuple[str, str], gains: np.ndarray, held: int
) -> str:
    """Return advice on the levels below the lowest readable one, as text."""
    first = next(k for k, one in enumerate(read) if one.readable)
    lowest = f"{read[first].force:.3g} {units[0]} rms"
    finer = (
        "A lower level does not show more; a finer encoder does. The friction force can be read"
        " without it"
    )
    if held:
        return (
            f"At {held} of {gains.size} levels friction holds the axis within {_STEPS:g} steps of"
            f" the encoder; from {lowest} on it does not. {finer}"
        )
    unresolved = gains.size - len(read) + first > 0 or read[first].steps < _PLATEAU_SPAN * _STEPS
    if unresolved:
        return finer
    return f"Begin the ramp below {lowest}: raise --span"


def _reason_against_reading(
    read: list[_Level], units: tuple[str, str], below: str, held: int
) -> str:
    """Return the reason why the levels cannot show a stiffness that falls with the level; empty if
    they may.

    below : advice on lower levels. held : number of lower levels at which friction holds the axis.
    """
    good = [one for one in read if one.readable]
    # two levels that stick show a plateau of the stiffness; one more bends, and one slides
    if len(good) < 4:
        limited = sum(one.limited for one in read)
        return (
            f"{len(good)} of {len(read)} levels can be read, 4 are needed:"
            f" {len(read) - len(good) - limited} move less than {_STEPS:g} steps of the encoder,"
            f" {limited} are at the limit of the force. Change --rms or --span"
        )
    k = np.array([one.stiffness for one in good])
    stiffest = int(np.argmax(k))
    # compared with two lower levels at least
    rises = stiffest > 1 and _RISES * np.median(k[:stiffest]) < k[stiffest]
    # low levels whose force is mostly damping: friction slips all the time, because the axis drifts
    # or vibrates. Not so if friction holds the axis at still lower levels.
    if (
        rises
        and not held
        and np.median([one.damping_share for one in good[:stiffest]]) > _MIN_STIFFNESS_SHARE
    ):
        damps = (
            f"below {good[stiffest].force:.3g} {units[0]} rms friction damps the axis and does not"
            " hold it"
        )
        drift, vibration = np.median(
            [(one.drift, one.vibration) for one in good[:stiffest]], axis=0
        )
        if drift > _DRIFTS * vibration:
            return (
                f"{damps}: its position drifts by {drift:.2g} {units[1]} rms from period to period,"
                " by creep or an integral part that still winds up. Let it settle before each"
                " level: raise --discard"
            )
        return (
            f"{damps}: the axis may vibrate by itself. Look for the vibration, and stop it by lower"
            " gains"
        )
    if not any(one.stiffness_share > _MIN_STIFFNESS_SHARE for one in good):
        least = f"{good[0].force:.3g} {units[0]} rms"
        return f"no readable level sticks: from {least} on the axis moves as a free mass. {below}"
    if rises:
        return (
            f"the stiffness rises with the level, from {np.median(k[:stiffest]):.3g} to"
            f" {k[stiffest]:.3g} {'/'.join(units)}: this is backlash or a hardening spring, because"
            " with friction the stiffness falls. Remove the backlash first"
        )
    return ""


def _plateau_of(k: np.ndarray, position: np.ndarray) -> tuple[int, int]:
    """Return (first, last + 1) of the longest run of levels with the same stiffness over a
    sufficient range.
    """
    best = (0, 0)
    for first in range(k.size):
        last = first + 1
        while last < k.size and abs(k[last] / np.median(k[first:last]) - 1) < _PLATEAU:
            last += 1
        wide = position[last - 1] >= _PLATEAU_SPAN * position[first]
        stiff = k[first] > k.max() / 2  # sliding levels form a plateau too
        if wide and stiff and last - first > best[1] - best[0]:
            best = (first, last)
    return best


def _choose_levels(states: list[FrictionRegime], stiffness: np.ndarray) -> list[int]:
    """Return three levels: the second highest that sticks, the one nearest to half the fall, the
    lowest that slides.
    """
    sticks, bends, slides = (
        [k for k, one in enumerate(states) if one is wanted]
        for wanted in (FrictionRegime.STICKS, FrictionRegime.BENDS, FrictionRegime.SLIDES)
    )
    half = (stiffness[sticks].mean() + stiffness[slides].mean()) / 2
    return [
        sticks[max(len(sticks) - 2, 0)],
        min(bends, key=lambda k: float(abs(stiffness[k] - half))),
        slides[0],
    ]


def _level_of_spectrum(record: Record, shape: np.ndarray) -> float:
    """Return the rms of a force with a given spectrum (F,) of rms one that moves the axis as far as
    in a record.
    """
    U, Y, _ = (np.atleast_2d(one[0].mean(axis=0)) for one in record_spectra(record))
    moved = np.sum(squared_modulus(Y)) * 2 / record.n_samples**2
    return float(np.sqrt(moved / (np.sum(squared_modulus(Y / U) * shape**2) / 2)))
