"""Facts, pictures and sections of a page. Text, HTML and JSON show the same fact."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust.lti.grids import Peak


@value(kw_only=False, in_sentences=True)
class Fact:
    """One fact.

    Fields
    ------
    name : str
        Name of the quantity.
    value : str, float or Peak
        A text, a number, or a number with the frequency at which it is attained. Neither an empty
        text nor nan is shown.
    unit : str
        Unit of the number.
    meaning : str
        What the number means for the reader.

    Examples
    --------
    >>> print(Fact("phase margin", Peak(43.4, 200 * np.pi), "deg", "30 deg or more is customary"))
    phase margin 43.4 deg at 100 Hz
    """

    name: str
    value: str | float | Peak
    unit: str = ""
    meaning: str = ""

    @property
    def amount(self) -> str:
        """Return the value with its unit and frequency; empty if there is none."""
        number, place = self.value if isinstance(self.value, Peak) else (self.value, np.nan)
        if np.isnan(place):
            at = ""
        else:
            at = f" at {format_hertz(place)}"
        if isinstance(number, str):
            return number and f"{number} {self.unit}".rstrip() + at
        if np.isnan(number):
            return ""
        return ("infinite" if np.isinf(number) else f"{number:.4g} {self.unit}".rstrip()) + at

    def __str__(self) -> str:
        return f"{self.name} {self.amount}"


@value(kw_only=False)
class Picture:
    """A picture: its content as a data address, and its caption."""

    source: str
    caption: str


@value(kw_only=False)
class Section:
    """One section: its name in addresses and in JSON, a heading, a sentence on it, facts, a table,
    and pictures.

    The first row of the table is its head.
    """

    name: str
    title: str
    lead: str = ""
    facts: Sequence[Fact] = ()
    table: Sequence[Sequence[str]] = ()
    pictures: Sequence[Picture] = ()
