"""The questions that levels leave open: each with the number that shows it, and what to measure."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import pairwise

import numpy as np

from robust.friction.reading.balance import Candidate, Motion
from robust.friction.reading.friction_fit import Gap, LevelBalance, OpenQuestion
from robust.friction.reading.numbers import REPORTED, unit_of
from robust.friction.reading.search import EXPLAINED_BY_TWO
from robust.friction.units import format_length

#: Share of the force or of Fs that may stay unexplained at a level beyond noise. The preset of one
#: mass leaves 0.5 %, those of two masses 4 to 15 % around break-away, where Fs was up to 16 % off.
MOST_UNEXPLAINED = 0.02
#: Share of Fs that may break away in the outer part of the largest swing, and share of K0 that may
#: slip at the lowest level.
_MOST_LATE, _MOST_EARLY = 0.1, 0.2
#: Start of the outer part of the swing. An element that sticks throughout the swing is a spring: a
#: free axis has none, and with a spring to ground it looks like a part of it. With a highest level
#: of 0.6 times the break-away force k was 23, 25 and 48 % of K0 too high on three random machines
#: (benchmarks/read_machine.py): one element was not seen, the others broke away up to 0.32, 0.41
#: and 0.24 of the swing. Of 26 sets with a highest level of 4 or 5.5 times, 25 stay below 0.2.
_OUTER_OF_FREE, _OUTER_WITH_SPRING = 0.75, 0.2
#: Share of Fs that may lie at either motor or load, by the half-width of its interval, before they
#: are inseparable.
_MOST_SPLIT = 0.1
#: Levels whose forces differ by less than this factor are one level.
_SAME_LEVEL = 1.3
#: Advice for levels that one mass (False) or two masses (True) do not explain.
_ANOTHER_MACHINE = {
    False: (
        "Measure to beyond the resonance and take masses=2, or give machine_with_friction the "
        "BLAs and a nominal with the mode"
    ),
    True: (
        "The search may have ended in a wrong minimum: add a level between those that bend. Or look"
        " for play, or measure in motion (identify_sliding)"
    ),
}
#: Advice for levels of which one mass explains the sticking one and no slipping one.
_ANOTHER_FRICTION = (
    "It explains the lowest level, so the friction is not Maxwell slip: it creeps before it slips"
    " (LuGre, Dahl), or slips at other forces"
)
#: Numbers that a question leaves open: all of them if the machine is not one mass.
_LEFT_OPEN = {
    Gap.OTHER_MACHINE: tuple(REPORTED),
    Gap.FLEXIBLE: tuple(REPORTED),
    Gap.HIGHEST_LEVEL_STICKS: ("Fs", "coulomb", "stiction"),
    Gap.LOWEST_LEVEL_SLIPS: ("K0",),
    Gap.STICTION: ("stiction",),
    Gap.SPLIT: ("load_K0", "load_Fs", "load_coulomb"),
}


def questions_of(
    levels: list[Motion],
    candidate: Candidate,
    *,
    balances: list[LevelBalance],
    units: tuple[str, str],
    stuck: float,
    mode: str | None,
    split: float,
    damping: tuple[float, float],
) -> Iterator[OpenQuestion]:
    """Yield the questions that the levels leave open.

    levels : the highest first.
    stuck : stiffness that never slips [N/m].
    mode : evidence that the machine is not rigid in the band; None if there is none.
    split : half-width of the interval of the break-away force of the load [N]; zero for one mass.
    damping : viscous friction and three of its standard deviations [Ns/m].
    """
    yield from _questions_of_machine(
        levels, candidate, balances=balances, units=units, mode=mode, damping=damping
    )
    yield from _questions_of_levels(levels, candidate, units=units, stuck=stuck)
    N, Fs = units[0], float(np.dot(*candidate.all_elements))
    if split > _MOST_SPLIT * Fs:
        yield OpenQuestion(
            kind=Gap.SPLIT,
            description=(
                f"friction of the motor and of the load look alike: {split:.2g} {N} of Fs ="
                f" {Fs:.4g} {N} may belong to either. Their sum holds. Measure beyond the resonance"
            ),
        )
    if not candidate.terms.stiction:
        yield OpenQuestion(
            kind=Gap.STICTION,
            description=(
                "no stiction above Coulomb friction is seen at speeds up to"
                f" {np.abs(levels[0].v).max():.2g} {unit_of('L/s', units)}; stiction that falls only at higher"
                " speeds counts as part of Fs"
            ),
        )


def _questions_of_machine(
    levels: list[Motion],
    candidate: Candidate,
    *,
    balances: list[LevelBalance],
    units: tuple[str, str],
    mode: str | None,
    damping: tuple[float, float],
) -> Iterator[OpenQuestion]:
    """Yield the questions about the machine: does the model explain the levels, with numbers that a
    machine can have, and is it rigid.
    """
    N, Fs, two = units[0], float(np.dot(*candidate.all_elements)), candidate.terms.load
    limits = [
        EXPLAINED_BY_TWO if two and one.force > Fs / 2 else MOST_UNEXPLAINED for one in balances
    ]
    worst, limit = max(
        zip(balances, limits, strict=True), key=lambda one: one[0].unexplained / one[1]
    )
    model = "motor and load" if two else "one mass"
    if worst.unexplained > limit:
        slips = not two and balances[-1].unexplained < limit
        yield OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"{model} with Maxwell slip leaves {100 * worst.unexplained:.2g} % of the force (or"
                f" of Fs) at {worst.force:.3g} {N} rms unexplained, more than {100 * limit:g} %"
                f" beyond noise. {_ANOTHER_FRICTION if slips else _ANOTHER_MACHINE[two]}"
            ),
        )
    c, half = damping
    if c + half < 0:
        yield OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"viscous friction of {c:.3g} +- {half:.1g} {unit_of('F s/L', units)} would drive"
                " the machine: the search ended in a wrong minimum, or another delay is mistaken"
                f" for it. {_ANOTHER_MACHINE[two]}"
            ),
        )
    delay, period = candidate.numbers["delay"], float(2 * np.pi / levels[0].omega.min())
    if abs(delay) > period:
        yield OpenQuestion(
            kind=Gap.OTHER_MACHINE,
            description=(
                f"{model} with Maxwell slip needs a delay of {delay:.3g} s, longer than the"
                f" {period:.3g} s of the lowest line: the search ended in a wrong minimum."
                f" {_ANOTHER_MACHINE[two]}"
            ),
        )
    if mode is not None:
        yield OpenQuestion(
            kind=Gap.FLEXIBLE,
            description=(
                f"the machine is no rigid mass with Maxwell slip in the band: {mode}. No single"
                " mass fits, so mass and friction are wrong by several per cent."
                f" {_ANOTHER_MACHINE[two]}"
            ),
        )


def _questions_of_levels(
    levels: list[Motion], candidate: Candidate, *, units: tuple[str, str], stuck: float
) -> Iterator[OpenQuestion]:
    """Yield the questions about the levels: do they reach from sticking to sliding, and differ."""
    N, (k, D) = units[0], candidate.all_elements
    Fs, K0 = float(k @ D), float(k.sum())
    outer = levels[0].half_swing
    begins = _OUTER_WITH_SPRING if candidate.terms.spring else _OUTER_OF_FREE
    late = float((k * D)[begins * outer < D].sum()) / Fs
    if late > _MOST_LATE or stuck:
        if stuck:
            seen = f"{stuck:.3g} {unit_of('F/L', units)} never slip"
        else:
            seen = f"{100 * late:.2g} % of Fs breaks away beyond {begins:.2g} of that"
        yield OpenQuestion(
            kind=Gap.HIGHEST_LEVEL_STICKS,
            description=(
                f"the highest level still sticks: it swings +-{format_length(outer, units[1])}, and"
                f" {seen}. Fs is not known, nor which part is spring and which friction. Measure at"
                " three times the force"
            ),
        )
    inner = float(np.std(levels[-1].x))
    early = float(k[inner > D].sum()) / K0
    if early > _MOST_EARLY:
        yield OpenQuestion(
            kind=Gap.LOWEST_LEVEL_SLIPS,
            description=(
                f"the lowest level does not stick: it moves {format_length(inner, units[1])} rms,"
                f" where {100 * early:.2g} % of K0 slips, and elements that slip earlier are not"
                " seen. Measure at a third of the force"
            ),
        )
    distinct = _count_distinct(levels)
    if distinct < min(3, len(levels)):
        listed = ", ".join(f"{level.force:.3g}" for level in levels)
        yield OpenQuestion(
            kind=Gap.EQUAL_LEVELS,
            description=(
                f"levels of {listed} {N} rms count as {distinct}, as neighbours differ by less than"
                f" {_SAME_LEVEL:g} times in force and motion. Measure at three that differ:"
                " sticking, bending, sliding"
            ),
        )


def _count_distinct(levels: list[Motion]) -> int:
    """Return the number of levels that differ: when friction slides, the motion grows and the force
    hardly does.
    """
    rises = [
        max(high.force / low.force, high.half_swing / low.half_swing)
        for high, low in pairwise(levels)
    ]
    return 1 + sum(rise > _SAME_LEVEL for rise in rises)


def leave_open(
    spread: dict[str, float], questions: Sequence[OpenQuestion], stuck: float
) -> dict[str, float]:
    """Return the standard deviations, infinite for numbers that the questions leave open.

    On a free axis a stiffness that never slips is friction, so K0 of the elements is too small. An
    assumed number, such as no spring, has no deviation and is not left open.
    """
    names = {name for question in questions for name in _LEFT_OPEN.get(question.kind, ())} | (
        {"K0"} if stuck else set()
    )
    return spread | {name: np.inf for name in names if spread.get(name)}
