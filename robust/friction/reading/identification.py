"""Machine and friction identified from records at several levels, from sticking to sliding."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import nlfrf
from nlfrf._base.arguments import require_list, require_one_channel
from nlfrf._base.numbers import smallest_step
from nlfrf._base.values import value
from robust.friction.reading.balance import (
    COARSE,
    FINE,
    KNOWN_IN_MOTION,
    LOAD,
    MEDIUM,
    SHRINKAGE,
    STEPS_PER_CYCLE,
    Candidate,
    Motion,
    as_real,
    element_spectra,
    force_of_motion,
    motion_of_record,
    pack,
    reaction_of_load,
    residual_of,
)
from robust.friction.reading.flexibility import sign_of_mode, stuck_stiffness
from robust.friction.reading.friction_fit import FrictionFit, LevelBalance
from robust.friction.reading.intervals import FORCE_ERROR, derived_numbers, deviations, mode_error
from robust.friction.reading.levels import FEWEST_LINES, require_levels
from robust.friction.reading.load import linear_load, start_with_load
from robust.friction.reading.numbers import HALF_WIDTH, NumbersRead, unit_of, units_of
from robust.friction.reading.questions import MOST_UNEXPLAINED, leave_open, questions_of
from robust.friction.reading.search import (
    REFUTED,
    escape,
    largest_share,
    refine,
    reweight,
    search,
    settle,
    share_left,
    start_candidates,
    with_branches,
)

#: (share of the time steps, shrinkage by noise) of fits that should give the same numbers. Their
#: differences enter every interval: 0.01 % of Fs and 0.04 % of the Coulomb friction on the linear
#: motor preset (medians of 25 runs).
_ALTERNATIVES = ((1 / 2, 8.0), (3 / 4, 1.0))
#: `FORCE_ERROR` for two masses, whose load is simulated. Six runs of the belt were off by up to 0.2
#: % of Fs and of the friction at the load and by 0.1 % of K0 and the delay; two of 72 numbers,
#: dampings of one run, were outside their intervals.
_LOAD_ERROR = 2e-3
#: Highest line, relative to the antiresonance of the load, at which two masses move like one.
_RIGID = 1 / 3
#: Number of lines that suffices for a spring and a damper.
_FEWEST_RIGID = 4
#: Share of the force of a level that one step of the encoder may make on a line: around the
#: antiresonance of a load the motion is small. This error repeats with the motion, so the scatter
#: over the periods does not show it. With all lines the true machine left 2 to 29 % of the force at
#: the levels of two axes; without them one fit left 0.0 to 0.6 %.
_MOST_OF_LINE = 0.02


def identify_friction(
    records: Sequence[nlfrf.Record],
    *,
    free: bool = False,
    masses: int = 1,
    sliding: NumbersRead | None = None,
) -> FrictionFit:
    """Identify an axis with friction from records at several levels, from sticking to sliding.

    The axis is one mass, or a motor and a load. One fit over all levels gives mass, viscous
    damping, spring, delay and friction with 95 % intervals. The records may be from open or closed
    loop. The friction model is Maxwell slip with any number of elements, stiction and a Stribeck
    curve.

    Use this for an axis that you can excite at three levels or more. The lowest level must be so
    low that the friction sticks. `machine_with_friction` makes a class of friction from the fit,
    for `prove_friction`.

    With two masses the force acts on the motor, and the encoder measures the position of the motor.
    A spring and a damper couple the load to the motor, and each mass has friction. Measure beyond
    the resonance: below it motor and load are hard to distinguish.

    Parameters
    ----------
    records : sequence of Record
        Periodic records in steady state with force [N] as input and position [m] as output: one
        record for each of at least three levels. Several periods are needed to estimate the noise.
    free : bool
        True for an axis without a spring from motor to ground.
    masses : int
        1, or 2 for a motor and a load.
    sliding : SlidingFit, optional
        Motor and load from `identify_sliding`, as start of the search. Lines on which much of the
        force is due to the encoder, as around the antiresonance, are then left out.

    Returns
    -------
    FrictionFit
        Its field `questions` lists what the levels do not determine.

    Raises
    ------
    ValueError
        Masses other than one or two; fewer than three records; several channels; too few lines;
        units with a prefix; a reversed sign.

    References
    ----------
    J. G. MacKinnon, H. White, *Some heteroskedasticity-consistent covariance matrix estimators*, J.
    Econometrics 29, 1985 (jackknife); J. D. Angrist, J.-S. Pischke, *Mostly Harmless Econometrics*,
    2009, section 8.1 (use of the larger of two standard errors); F. Al-Bender, V. Lampaert, J.
    Swevers, IEEE Trans. Automatic Control 50, 2005 (elements).

    Examples
    --------
    >>> identify_friction([])
    Traceback (most recent call last):
        ...
    ValueError: records must be a list of at least one Record, got []
    """
    if masses not in (1, 2):
        raise ValueError(f"masses must be 1, or 2 for a motor and a load, got {masses}")
    two = masses == 2
    readings = _Readings(records=_list_levels(records), two=two, sliding=sliding if two else None)
    coarse = readings.coarse()
    span = (
        min(float(np.std(one.x)) for one in coarse) / 2,
        0.9 * max(one.half_swing for one in coarse),
    )
    candidate = _search_machine(coarse, readings, span, spring=not free)
    fine = readings.fine()
    # for two masses only a fit that explains the levels is worth finer steps
    refuted = largest_share(coarse, candidate) > (MOST_UNEXPLAINED if two else REFUTED)
    if not (two or refuted):  # for two masses each start takes seconds
        candidate = escape(readings.motions(MEDIUM), candidate, span)
    if not refuted:
        candidate = settle(fine, candidate, span)[1]
    fine = with_branches(fine, candidate)
    stds = reweight(fine, candidate)
    if refuted:  # none of its numbers holds
        numbers = derived_numbers(pack(candidate), candidate)
        spread = dict.fromkeys(numbers, np.inf)
    else:
        numbers, spread = _numbers_with_spread(
            fine, readings.alternatives(), stds=stds, candidate=candidate, span=span
        )
    balances = [_balance_of(level, std, candidate) for level, std in zip(fine, stds, strict=True)]
    units = units_of(readings.records[0])
    stuck, mode = 0.0, None
    if free and not refuted:
        stuck = stuck_stiffness(fine, stds, candidate)
    # any term improves a worse fit
    if not two and max(one.unexplained for one in balances) < MOST_UNEXPLAINED:
        unit = unit_of("F s^4/L", units)
        mode = sign_of_mode(fine, stds, candidate=candidate, stds=spread, unit=unit)
    questions = tuple(
        questions_of(
            fine,
            candidate,
            balances=balances,
            units=units,
            stuck=stuck,
            mode=mode,
            split=HALF_WIDTH * spread.get("load_Fs", 0.0),
            damping=(numbers["damping"], 3 * spread["damping"]),
        )
    )
    return FrictionFit(
        **numbers,
        vs=candidate.vs,
        stds=leave_open(spread, questions, stuck),
        element_stiffness=candidate.stiffness,
        element_strength=candidate.stiffness * candidate.breakaway,
        seen_from=span[0],
        seen_to=max(level.half_swing for level in fine),
        levels=tuple(balances),
        questions=questions,
        units=units,
        load_sliders=candidate.load_sliders,
    )


@value(copy=False)
class _Readings:
    """The records as motions, with time steps of several lengths.

    For two masses the errors of the time steps are in `_LOAD_ERROR`.
    """

    records: list[nlfrf.Record]
    two: bool
    sliding: NumbersRead | None  # for two masses: motor and load as read in motion

    def motions(self, steps: float, shrinkage: float = SHRINKAGE) -> list[Motion]:
        """Return the motions; with a motor and load as read, without the lines of the encoder."""
        finer = FINE if self.two else steps  # an oscillation of the load may have few samples
        found = [
            motion_of_record(record, finer, shrinkage, STEPS_PER_CYCLE * steps)
            for record in self.records
        ]
        if self.sliding is None:
            return found
        return [
            without_noisy_lines(one, record, self.sliding)
            for one, record in zip(found, self.records, strict=True)
        ]

    def coarse(self) -> list[Motion]:
        """Return the motions for the search."""
        return self.motions(1 if self.two else COARSE)

    def fine(self) -> list[Motion]:
        """Return the motions for the numbers."""
        return self.motions(self._finest)

    def alternatives(self) -> list[list[Motion]]:
        """Return the motions of fits that should give the same numbers."""
        return [self.motions(share * self._finest, shrinkage) for share, shrinkage in _ALTERNATIVES]

    @property
    def _finest(self) -> float:
        if self.two:
            return COARSE
        return FINE


def _search_machine(
    coarse: list[Motion], readings: _Readings, span: tuple[float, float], *, spring: bool
) -> Candidate:
    """Return the machine that balances the forces best, from several starts; refuse a reversed
    sign.
    """
    machine = None
    if readings.sliding is not None:
        machine = linear_load(readings.sliding)
    if readings.two:
        starts = start_with_load(coarse, spring=spring, machine=machine)
    else:
        starts = start_candidates(coarse, span, spring=spring)
    if not starts[0].numbers["mass"] > 0:
        raise ValueError(
            f"records must be from force to position, got a mass of {starts[0].numbers['mass']:.3g}"
            " kg: the output falls when the input rises. Reverse the sign of the sensor"
        )
    if machine is None:
        return search(coarse, starts, span, ())
    # the other starts are guesses of the machine
    return search(coarse, starts[:1], span, KNOWN_IN_MOTION)


def _list_levels(records: Sequence[nlfrf.Record]) -> list[nlfrf.Record]:
    """Return the records of at least three levels of one axis, the highest force first; refuse
    anything else.
    """
    levels = require_list("records", records, nlfrf.Record)
    for one in levels:
        require_one_channel("records", one)
    units = [(record.y_unit, record.u_unit) for record in levels]
    require_levels("records", units, [record.lines.excited.size for record in levels])
    return sorted(levels, key=lambda record: -motion_of_record(record, 1).force)


def _balance_of(level: Motion, std: np.ndarray, candidate: Candidate) -> LevelBalance:
    """Return a level as a spring and a damper, measured and fitted; for two masses on lines where
    they move as one.
    """
    chosen = level.excited
    left = residual_of(level, candidate)
    spectra = element_spectra(
        level, candidate.breakaway, stiction=candidate.stiction, vs=candidate.vs
    )
    fitted = np.tensordot(candidate.stiffness, spectra, axes=1) + reaction_of_load(level, candidate)
    rigid = chosen
    # Well below the mode of the coupling both masses move as one: there the force less that of the
    # inertia is friction, as for one mass.
    if candidate.terms.load:
        load, coupling = (float(np.exp(candidate.numbers[name])) for name in LOAD[:2])
        fitted = fitted + load * level.omega**2 * level.Y
        below = chosen & (level.omega < _RIGID * np.sqrt(coupling / load))
        rigid = below if below.sum() >= _FEWEST_RIGID else chosen
    columns = np.stack([level.Y, 1j * level.omega * level.Y], axis=-1)[:, rigid]
    table = as_real([columns / std[:, rigid, np.newaxis]])
    k, c = (
        np.linalg.lstsq(table, as_real([force[:, rigid] / std[:, rigid]]), rcond=None)[0]
        for force in (fitted + left, fitted)
    )
    unexplained, noise = share_left(level, candidate)
    return LevelBalance(
        force=level.force,
        motion=float(np.sqrt((np.abs(level.Y) ** 2).sum(axis=1).mean() / 2)),
        stiffness=float(k[0]),
        damping=float(k[1]),
        stiffness_fit=float(c[0]),
        damping_fit=float(c[1]),
        unexplained=unexplained,
        noise=noise,
    )


def without_noisy_lines(level: Motion, record: nlfrf.Record, sliding: NumbersRead) -> Motion:
    """Return a level without the lines on which the step of the encoder makes much of the force; a
    few are kept.
    """
    step = smallest_step(record.y) / np.sqrt(
        3 * record.u.shape[-1]
    )  # standard deviation of a peak amplitude
    noise = np.abs(force_of_motion(sliding, level.omega, 0.0)) * step
    least = np.sort(noise)[min(FEWEST_LINES, noise.size) - 1]
    kept = noise <= max(least, _MOST_OF_LINE * float(np.sqrt((np.abs(level.U) ** 2).mean())))
    names = ("omega", "U", "Y", "noise", "excited", "lines")
    return replace(level, **{name: getattr(level, name)[..., kept] for name in names})


def _numbers_with_spread(
    fine: list[Motion],
    alternatives: list[list[Motion]],
    *,
    stds: list[np.ndarray],
    candidate: Candidate,
    span: tuple[float, float],
) -> tuple[dict[str, float], dict[str, float]]:
    """Return the numbers and their standard deviations.

    A variance is the sum of that of `deviations`, of the mean square difference of the alternatives
    (fits of the levels with other time steps and another suppression of noise), and of a floor for
    model errors.
    """
    terms, numbers = candidate.terms, derived_numbers(pack(candidate), candidate)
    spread = deviations(fine, stds, candidate)
    others = []
    for alternative in alternatives:
        levels = [
            replace(one, centred=level.centred)
            for one, level in zip(alternative, fine, strict=True)
        ]
        other = refine(levels, stds, candidate=candidate, span=span)
        others.append(derived_numbers(pack(other), other))
    error = _LOAD_ERROR if terms.load else FORCE_ERROR
    top, speed = float(fine[0].omega[-1]), max(float(np.std(level.v)) for level in fine)
    floors = {
        "mass": numbers["mass"] * float(np.hypot(error, mode_error(fine[0], numbers))),
        "damping": error * numbers["coulomb"] / speed,
        "stiffness": error * (abs(numbers["stiffness"]) + numbers["K0"]) if terms.spring else 0.0,
        "delay": error / top,
    }
    for name, std in spread.items():
        between = np.mean([(other[name] - numbers[name]) ** 2 for other in others])
        spread[name] = float(
            np.sqrt(std**2 + between + floors.get(name, error * numbers[name]) ** 2)
        )
    return numbers, spread
