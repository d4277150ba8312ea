"""How things are said to people: a frequency in Hz, anything at all at the end of a message."""

from __future__ import annotations

from textwrap import wrap
from typing import Any

import numpy as np

__all__ = ["counted", "hertz", "paragraph", "shown"]


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


def paragraph(label: str, text: str) -> list[str]:
    """A labelled paragraph that fits a screen 100 wide."""
    rows = wrap(text, 86) or [""]
    return [f"{label + ':':<13}{rows[0]}", *(" " * 13 + row for row in rows[1:])] if text else []
