"""States of a decision as enums.

Code branches on these enums and never on a text, so that texts can be reworded without a change of
any verdict.
"""

from __future__ import annotations

from enum import StrEnum


class State(StrEnum):
    """Enum whose members equal their text, and are printed and written to files as that text."""

    def __repr__(self) -> str:
        return repr(self.value)


class Stability(State):
    """Stability of a system: every pole is strictly stable, or not, or undecided."""

    STABLE = "stable"
    UNSTABLE = "unstable"
    UNDECIDED = "undecided"


class Outcome(State):
    """Result for a statement: proved, disproved, or neither."""

    HOLDS = "holds"
    VIOLATED = "violated"
    UNDECIDED = "undecided"


class Demand(State):
    """Result for the performance demand on every plant of a set."""

    MET = "met"
    NOT_MET = "not met"
    NOT_PROVED = "not proved"


class Verdict(State):
    """Result of a check of a controller with a set of plants.

    >>> Verdict.ROBUST == "robust", f"{Verdict.NOT_ROBUST}".upper(), Verdict("not certified")
    (True, 'NOT ROBUST', 'not certified')
    """

    ROBUST = "robust"
    STATISTICALLY_ROBUST = "statistically robust"
    NOT_ROBUST = "not robust"
    NOT_CERTIFIED = "not certified"

    @property
    def is_robust(self) -> bool:
        """True if a property of the whole set is established, surely or at its confidence."""
        return self in (Verdict.ROBUST, Verdict.STATISTICALLY_ROBUST)


class FrictionVerdict(State):
    """Result of a proof for a loop with a class of friction."""

    PROVED = "proved"
    PROVED_LOCALLY = "proved up to a kick"
    SETTLES = "settles"
    REFUTED = "refuted"
    NOT_DECIDED = "not decided"

    @property
    def is_proved(self) -> bool:
        """True if the loop comes to rest, from every state or up to a kick."""
        return self in (FrictionVerdict.PROVED, FrictionVerdict.PROVED_LOCALLY)
