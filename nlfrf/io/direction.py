"""Input, output and reference among the channels of a file: found from their common period, lines
and names.

A channel named like an input is the input. Without such a name the spectra decide. If the spectra
contradict the names, or decide nothing, no input is proposed.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import format_count, join_names
from nlfrf.io.readers.clock import UNIT_SUFFIX
from nlfrf.records.direction import (
    SignalLines,
    compare_detection_lines,
    compare_levels,
    describe_played,
    find_signal_lines,
)
from nlfrf.records.period import detect_repetition, is_repeated

_INPUT_NAMES = re.compile(
    r"u\d*|in(put)?\d*|.*(force|kraft|current|strom|command|cmd|drive|voltage|torque|excit|stell|moment|soll).*|i_?[aq].*",
    re.I,
)
_OUTPUT_NAMES = re.compile(
    r"y\d*|out(put)?\d*|x\d*|theta.*|"
    r".*(pos|weg|lage|drehz|geschw|angle|winkel|acc|beschl|vel|speed|disp|response|meas|enc(?![ey])|ist(?![a-z])).*|"
    # the actual value, in German; the conditions leave out "reference" and "distance"
    r"(.*[^a-z])?ist.*",
    re.I,
)
_SET_WORDS = r"set[ _]?points?|soll(?:wert)?|cmd|command(?:ed)?|ref(?:erence)?|target|demand(?:ed)?"
_SET_POINT = re.compile(
    rf"(?<![ _.])[ _.]*(?:{_SET_WORDS})$|(?<![a-z])(?:{_SET_WORDS})(?![a-z])[ _.]*", re.I
)
MAX_CANDIDATES = 12  # channels whose spectra are computed
WHOLE_TOLERANCE = 0.05  # [samples] largest distance of a period from a whole number


class Direction(NamedTuple):
    """Proposed roles of the channels of a record; empty names if there is no proposal, with the
    reason in `doubt`.

    The period [samples] is 0 if none is found, and all samples if the record is one period; `lines`
    describes it.
    """

    u: str = ""
    reference: str = ""
    period: float = 0.0
    lines: str = "no channel repeats"
    doubt: str = ""


#: Role of a channel by its name, in the order of preference for the input.
Rank = IntEnum("Rank", "INPUT SET_POINT UNKNOWN OUTPUT")


def find_direction(streams: Mapping[str, np.ndarray], rate: Callable[[str], float]) -> Direction:
    """Return input and reference among streams (n,) that were sampled together, and their common
    period.

    Parameters
    ----------
    streams : dict of str to (n,) ndarray
        Channels that vary.
    rate : callable
        Sampling frequency [Hz] of a channel by its name; nan if unknown.
    """
    likely = sorted(streams, key=_rank_by_name)[:MAX_CANDIDATES]
    x = {name: np.asarray(streams[name], dtype=float) for name in streams if name in likely}
    period, together = _find_common_period(x)
    n = round(period)
    if abs(period - n) <= WHOLE_TOLERANCE:
        period = float(n)
    found = {
        name: find_signal_lines(one[: one.size // n * n].reshape(1, -1, n))
        for name, one in together.items()
    }
    lines = {name: one for name, one in found.items() if one is not None}
    if not lines:
        inputs = [name for name in x if _rank_by_name(name) is Rank.INPUT]
        if len(inputs) == 1 < len(x):
            return Direction(u=inputs[0])
        return Direction()
    u, doubt = _choose_input(lines)
    if u:
        references = _find_references(u, lines)
    else:
        references = []
    reference = min(references, key=lambda name: lines[name].spread, default="")
    name = u or next(iter(lines))
    excited, fs = lines[name].grid.excited, rate(name)
    lasts = f" ({period / fs:.4g} s)"
    band = f" from {excited[0] * fs / n:.4g} to {excited[-1] * fs / n:.4g} Hz"
    if np.isnan(fs):
        lasts, band = "", ""
    else:
        lasts, band = lasts, band
    periods, n_lines = format_count(x[name].size // n, "period"), format_count(excited.size, "line")
    return Direction(
        u,
        reference,
        period,
        f"period {period:.6g} samples{lasts}, {periods}; {n_lines}{band}",
        doubt,
    )


def _find_common_period(streams: Mapping[str, np.ndarray]) -> tuple[float, dict[str, np.ndarray]]:
    """Return the period [samples] of channels that were sampled together, 0 if there is none, and
    those that have it.

    If a channel does not repeat and has odd lines only over its whole length, this length is one
    period, whatever rings behind it. Else it is the period at which most channels repeat.
    """
    periods: dict[int, float] = {}
    for x in streams.values():
        try:
            period = detect_repetition(x)
            periods.setdefault(round(period), period)
        except ValueError:
            if (lines := find_signal_lines(x.reshape(1, 1, -1))) and lines.is_one_period:
                return float(x.size), dict(streams)
    groups = [
        (period, {name: x for name, x in streams.items() if is_repeated(x, period)})
        for period in periods.values()
    ]
    return max(groups, key=lambda group: (len(group[1]), group[0]), default=(0.0, {}))


def _choose_input(lines: Mapping[str, SignalLines]) -> tuple[str, str]:
    """Return the input among periodic channels, by names, then by lines, and the reason if there is
    none.
    """
    ranks = {name: _rank_by_name(name) for name in lines}
    first = min(ranks.values())
    if (
        first is Rank.SET_POINT
        and list(ranks.values()).count(Rank.UNKNOWN) > 1
        and Rank.OUTPUT not in ranks.values()
    ):
        first = Rank.UNKNOWN  # a loop, with one of them as input
    names = [name for name in lines if ranks[name] is first]
    u = names[0]
    if len(names) > 1:
        beaten = {b for a in names for b in names if _shows_played(lines[a], lines[b])}
        if beaten:
            left = [name for name in names if name not in beaten]
        else:
            left = []
        if len(left) != 1 and first > Rank.SET_POINT:
            return "", f"neither names nor spectra show which of {join_names(names)} was played"
        if len(left) == 1:
            u = left[0]
        else:
            u = min(names, key=lambda name: lines[name].spread)
    quantity = _bare_name(u)
    u = next(
        (name for name in lines if name != u and _SET_POINT.sub("", _bare_name(name)) == quantity),
        u,
    )
    for name, one in lines.items() if Rank.SET_POINT not in ranks.values() else ():
        if compare_levels(one, lines[u]):
            level = f"its lines have equal amplitudes within {one.spread:.2g} dB"
        else:
            level = ""
        if ranks[name] > first and (found := describe_played(one, lines[u]) or level):
            return (
                "",
                (
                    f"by its name {u} is the input, but the multisine is found in {name},"
                    f" {found}. Either {name} was played, or the reference of a closed loop is"
                    " missing"
                ),
            )
    return u, ""


def _find_references(u: str, lines: Mapping[str, SignalLines]) -> list[str]:
    """Return the channels that a loop may have followed, besides its input u: by their names, else
    by their lines.

    The lines decide if another channel is named like an output: the played multisine is exact from
    period to period, and the input of a loop contains what the machine adds.
    """
    ranks = {name: _rank_by_name(name) for name in lines if name != u}
    if named := [name for name, rank in ranks.items() if rank is Rank.SET_POINT]:
        return named
    if Rank.OUTPUT not in ranks.values():
        return []
    return [
        name
        for name, rank in ranks.items()
        if rank is Rank.UNKNOWN and lines[name].is_clean and _shows_played(lines[name], lines[u])
    ]


def _shows_played(one: SignalLines, other: SignalLines) -> bool:
    """Return whether one signal was played and not another: by clean detection lines, one level, or
    exactness.
    """
    if compare_detection_lines(other, one):
        return False
    return bool(
        compare_detection_lines(one, other)
        or compare_levels(one, other)
        or one.is_exact > other.is_exact
    )


def _rank_by_name(name: str) -> Rank:
    """Return the role of a channel by its name.

    >>> [_rank_by_name(name).name for name in ("Kraft [N]", "speed_ref", "ch1", "measured current", "run.Lage (mm)")]
    ['INPUT', 'SET_POINT', 'UNKNOWN', 'UNKNOWN', 'OUTPUT']
    """
    short = _bare_name(name)
    if is_set_point(name) or short == "r":  # the reference, as files of this package name it
        return Rank.SET_POINT
    drives = _INPUT_NAMES.fullmatch(short) is not None
    responds = _OUTPUT_NAMES.fullmatch(short) is not None
    if drives == responds:
        return Rank.UNKNOWN
    if drives:
        return Rank.INPUT
    return Rank.OUTPUT


def choose_output(u: str, candidates: Mapping[str, np.ndarray]) -> str:
    """Return the first channel named like an output, else the first not named like an input or set
    point.
    """
    others = [
        name for name in candidates if name != u and candidates[name].size == candidates[u].size
    ]
    ranked = sorted(
        (name for name in others if not is_set_point(name)), key=_rank_by_name, reverse=True
    )
    if ranked:
        return ranked[0]
    return ""


def is_set_point(name: str) -> bool:
    """Return whether a channel is named a set point, which a sampled drive or controller holds over
    each period.

    >>> [is_set_point(name) for name in ("current set point [A]", "Strom_Soll", "reference", "current [A]")]
    [True, True, True, False]
    """
    return bool(_SET_POINT.search(_bare_name(name)))


def _bare_name(name: str) -> str:
    """Return a name without its unit and the structs around it."""
    return UNIT_SUFFIX.sub("", name).rsplit(".", 1)[-1].strip()
