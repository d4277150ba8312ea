"""Sections as text: facts in rows behind their names, tables in columns."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from textwrap import wrap

from nlfrf._base.values import SCREEN_WIDTH
from robust.pages.section import Fact, Section

_NARROWEST = 13  # columns of the names, so that short lists align


def format_facts(facts: Iterable[Fact]) -> str:
    """Return facts in rows, the name of each in front of its value and meaning; a fact without a
    value is left out.

    >>> print(format_facts([Fact("gain margin", 7.4, "dB", "the gain may rise this far"), Fact("level", "")]))
    gain margin: 7.4 dB: the gain may rise this far
    """
    shown = {fact: fact.amount for fact in facts if fact.amount}
    width = max([_NARROWEST, *(len(fact.name) + 2 for fact in shown)])
    rows = []
    for fact, amount in shown.items():
        if fact.meaning:
            text = f"{amount}: {fact.meaning}"
        else:
            text = amount
        lines = [
            row
            for line in text.splitlines()
            for row in wrap(line, SCREEN_WIDTH - width, break_on_hyphens=False)
        ]
        names = [f"{fact.name}:", *[""] * len(lines)]
        rows += [f"{name:{width}}{line}" for name, line in zip(names, lines, strict=False)]
    return "\n".join(rows)


def format_table(table: Sequence[Sequence[str]]) -> str:
    """Return rows in columns, with two spaces between them.

    >>> print(format_table([("level", "force"), ("1", "0.3 N")]))
    level  force
    1      0.3 N
    """
    widths = [max(map(len, column)) for column in zip(*table, strict=True)]
    rows = ["  ".join(map(str.ljust, row, widths)) for row in table]
    return "\n".join(row.rstrip() for row in rows)


def format_sections(sections: Iterable[Section]) -> str:
    """Return sections below one another, each under its title."""
    pages = []
    for section in sections:
        lead = wrap(section.lead, SCREEN_WIDTH)
        facts = format_facts(section.facts)
        table = format_table(section.table)
        pages.append("\n".join(filter(None, [section.title, *lead, facts, table])))
    return "\n\n".join(pages)
