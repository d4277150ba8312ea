"""How things are said to people: a frequency in Hz, anything at all at the end of a message."""

from __future__ import annotations

from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

__all__ = ["counted", "hertz", "in_unit", "in_words", "inverse_unit", "listed", "paragraph", "ratio_unit", "shown"]

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")


def shown(thing: Any) -> str:
    """A short form of anything, for the end of a message."""
    if isinstance(thing, np.ndarray):
        return f"an array of shape {thing.shape}"
    text = " ".join(repr(thing).split())
    return text if len(text) <= 60 else text[:57] + "..."


def hertz(omega: float) -> str:
    """A frequency for people."""
    return "infinite frequency" if np.isinf(omega) else f"{omega / 2 / np.pi:.4g} Hz"


def counted(n: int, what: str) -> str:
    """A count with its noun."""
    return f"{n} {what}" + "s" * (n != 1)


def in_words(n: int, what: str) -> str:
    """A count with its noun, small numbers in words.

    >>> in_words(1, "sample"), in_words(2, "sample"), in_words(40, "sample")
    ('one sample', 'two samples', '40 samples')
    """
    return f"{NUMBERS[n]} {what}" + "s" * (n != 1) if 0 <= n < len(NUMBERS) else counted(n, what)


def listed(names: Sequence[str]) -> str:
    """Names with commas and an "and" between them.

    >>> listed(["1"]), listed(["1", "3"]), listed(["1", "3", "4"])
    ('1', '1 and 3', '1, 3 and 4')
    """
    return " and ".join([*([", ".join(names[:-1])] if len(names) > 1 else []), names[-1]])


def paragraph(label: str, text: str) -> list[str]:
    """A labelled paragraph that fits a screen 100 wide."""
    rows = wrap(text, 86) or [""]
    return [f"{label + ':':<13}{rows[0]}", *(" " * 13 + row for row in rows[1:])] if text else []


def inverse_unit(unit: str) -> str:
    """The unit of one over a quantity.

    >>> inverse_unit("m/N"), inverse_unit("1/N"), inverse_unit("rad"), inverse_unit("m/s/V")
    ('N/m', 'N', '1/rad', '1/(m/s/V)')
    """
    top, *bottom = unit.split("/")
    if len(bottom) > 1:
        return f"1/({unit})"
    return bottom[0] if bottom and top == "1" else f"{bottom[0] if bottom else 1}/{top}"


def ratio_unit(top: str, bottom: str) -> str:
    """The unit of one quantity over another; empty where neither is known.

    >>> ratio_unit("m", "N"), ratio_unit("m", ""), ratio_unit("", "")
    ('m/N', 'm/1', '')
    """
    return f"{top or '1'}/{bottom or '1'}" if top or bottom else ""


def in_unit(what: str, unit: str, otherwise: str) -> str:
    """A quantity with its unit in brackets, for an axis: the one known, or what it would be.

    >>> in_unit("u", "N", "unit of u"), in_unit("u", "", "unit of u")
    ('u [N]', 'u [unit of u]')
    """
    return f"{what} [{unit or otherwise}]"
