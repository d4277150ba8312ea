"""States of a decision as enums. Code branches on these; words are made of them where something is printed.

A sentence is for people: it may be reworded at any time, and no verdict may change with it.
"""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """An enum whose members are also their text: equal to it, and shown, printed and written to files as it."""

    def __repr__(self) -> str:
        return repr(self.value)


class Stability(State):
    """Whether every pole of a system is strictly stable."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    UNDECIDED = "undecided"


class Outcome(State):
    """Whether a statement was proved, disproved, or neither."""

    HOLDS = "holds"
    VIOLATED = "violated"
    UNDECIDED = "undecided"


class Demand(State):
    """Whether every plant of a set meets the performance demand."""

    MET = "met"
    NOT_MET = "not met"
    NOT_PROVED = "not proved"


class Verdict(State):
    """What a check found of a controller and a set of plants.

    >>> Verdict.ROBUST == "robust", f"{Verdict.NOT_ROBUST}".upper(), Verdict("not certified")
    (True, 'NOT ROBUST', 'not certified')
    """

    ROBUST = "robust"
    STATISTICALLY_ROBUST = "statistically robust"
    NOT_ROBUST = "not robust"
    NOT_CERTIFIED = "not certified"

    @property
    def is_robust(self) -> bool:
        """Return whether something was established for the whole set, surely or at its confidence."""
        return self in (Verdict.ROBUST, Verdict.STATISTICALLY_ROBUST)


class FrictionVerdict(State):
    """What a proof found of a loop and a class of friction."""

    PROVED = "proved"
    PROVED_LOCALLY = "proved up to a kick"
    SETTLES = "settles"
    REFUTED = "refuted"
    NOT_DECIDED = "not decided"

    @property
    def is_proved(self) -> bool:
        """Return whether the loop comes to rest, from every state or up to a kick."""
        return self in (FrictionVerdict.PROVED, FrictionVerdict.PROVED_LOCALLY)
