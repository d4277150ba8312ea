"""How things are said to people: a frequency in Hz, anything at all at the end of a message."""

from __future__ import annotations

import re
from collections.abc import Sequence
from textwrap import wrap
from typing import Any

import numpy as np

__all__ = [
    "counted",
    "hertz",
    "in_unit",
    "in_words",
    "inverse_unit",
    "listed",
    "one_line",
    "paragraph",
    "printable",
    "ratio_unit",
    "shown",
]

NUMBERS = ("no", "one", "two", "three", "four", "five", "six", "seven", "eight", "nine", "ten", "eleven", "twelve")
#: What commands a terminal or turns the direction of the text behind it: control characters but the line break and the
#: tab, marks of direction and of no width, tags, halves of a pair (bytes of a file name that are no text).
COMMANDS = re.compile(
    "[\x00-\x08\x0b-\x1f\x7f-\x9f\u061c\u200b-\u200f\u2028-\u202e\u2060-\u206f\ufeff\ud800-\udfff\U000e0000-\U000e007f]"
)
BREAKS = re.compile("[\t\n\x0b\f\r\x85\u2028\u2029]+")


def printable(text: str) -> str:
    r"""Return a text with every character that commands a terminal written out, as JSON writes it.

    >>> printable("force\x1b[2J [N]\n")
    'force\\u001b[2J [N]\n'
    """

    def written_out(found: re.Match[str]) -> str:
        raw = found[0].encode("utf-16-be", "surrogatepass").hex()
        return "".join(f"\\u{raw[i : i + 4]}" for i in range(0, len(raw), 4))

    return COMMANDS.sub(written_out, text)


def one_line(text: str) -> str:
    r"""Return a text that comes from a file or names a thing, printable and without line breaks.

    >>> one_line("Force\r\n[N]"), one_line("u\x9b2J")
    ('Force [N]', 'u\\u009b2J')
    """
    return printable(BREAKS.sub(" ", text))


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
