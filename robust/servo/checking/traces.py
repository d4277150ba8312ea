"""The traces of a check: each with its name, its conditions, its BLA and its warnings."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import nlfrf
from nlfrf._base.values import value
from robust.friction.reading.from_blas import highest_level
from robust.servo.checking.doubts import doubts_of_warnings
from robust.servo.checking.findings import BaseMotion, Conditions, Doubt, Trace, describe_trace
from robust.servo.checking.read import collect_warnings


@value(copy=False)
class Traces:
    """The traces of a check: each with its name, its conditions, its BLA and the warnings of
    identifying it.
    """

    records: Sequence[nlfrf.Record]
    names: Sequence[str]
    under: Sequence[Conditions]
    blas: Sequence[nlfrf.Bla]
    warned: Sequence[Sequence[str]]

    @property
    def moving(self) -> list[int]:
        """Indices of the traces in motion."""
        return [k for k, one in enumerate(self.under) if one.motion is BaseMotion.MOVING]

    @property
    def at_rest(self) -> list[nlfrf.Record]:
        """The other traces."""
        return [record for k, record in enumerate(self.records) if k not in self.moving]

    @property
    def chosen(self) -> int:
        """Index of the trace for the set: one in motion, if there is one, of the highest level."""
        candidates = self.moving or list(range(len(self.records)))
        return candidates[highest_level([self.blas[k] for k in candidates])]

    def doubts(self) -> list[Doubt]:
        """Return a doubt for each warning.

        Warnings of identifying a trace at rest count only if the set is made from it: friction has
        its own balance.
        """
        warned = [self.warned[k] for k in self.moving or [self.chosen]]
        return doubts_of_warnings(self.under, warned)

    def describe(self) -> tuple[Trace, ...]:
        """Return level and band of each trace."""
        return tuple(
            describe_trace(self.names[k], record, self.blas[k], k in self.moving)
            for k, record in enumerate(self.records)
        )


def identify_traces(
    records: Sequence[nlfrf.Record],
    names: Sequence[str],
    conditions: Sequence[Conditions],
    advance: Callable[[], None],
) -> Traces:
    """Return the traces with their BLAs; without names they are numbered."""
    names = list(names) or [f"trace {k + 1}" for k in range(len(records))]
    blas, warned = [], []
    for name, record in zip(names, records, strict=True):
        with collect_warnings(name) as texts:
            blas.append(nlfrf.identify(record))
        warned.append(texts)
        advance()
    return Traces(
        records=records,
        names=names,
        under=list(conditions) or [Conditions()] * len(records),
        blas=blas,
        warned=warned,
    )
