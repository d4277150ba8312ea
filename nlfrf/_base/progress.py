"""A bar for whatever counts what it has done: on a terminal, or in a notebook."""

from __future__ import annotations

import html
import sys
import time
from collections.abc import Callable
from typing import Any

MIN_INTERVAL = 0.1  # seconds between two looks
BAR_WIDTH = 30


def progress_bar(label: str = "") -> Callable[[int, int], None]:
    """A bar to give as ``progress=`` to whatever takes that: in a notebook below the cell, else on standard error.

    Parameters
    ----------
    label : str
        What is being done.

    Returns
    -------
    callable
        Takes how many are done, and of how many. Nothing is shown where nobody looks: standard error that is a file.

    Raises
    ------
    ValueError
        A label that is not text.

    Examples
    --------
    >>> show = progress_bar("simulating")
    >>> for done in range(1, 4):
    ...     show(done, 3)
    """
    if not isinstance(label, str):
        raise ValueError(f"label must be a text, got {label!r}")
    handle: Any = None
    begun = last = time.monotonic()

    def show(done: int, total: int) -> None:
        nonlocal handle, last
        now = time.monotonic()
        if done < total and handle is not None and now - last < MIN_INTERVAL:
            return
        last = now
        left = f", {(now - begun) * (total - done) / done:.0f} s left" if 0 < done < total else f", {now - begun:.1f} s"
        status = f"{label} {done} of {total}{left}".strip()
        if in_notebook():
            from IPython.display import HTML, display

            shown = HTML(f"<progress value='{done}' max='{total}'></progress> {html.escape(status)}")
            if handle is None:
                handle = display(shown, display_id=True)
            else:
                handle.update(shown)
        elif sys.stderr.isatty():
            handle = True
            filled = round(BAR_WIDTH * done / max(total, 1))
            sys.stderr.write(f"\r{'#' * filled}{'.' * (BAR_WIDTH - filled)} {status}   " + "\n" * (done >= total))
            sys.stderr.flush()

    return show


def in_notebook() -> bool:
    """Return whether this runs in the kernel of a notebook, and not in a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")
