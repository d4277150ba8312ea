"""A progress bar, on a terminal or in a notebook."""

from __future__ import annotations

import html
import sys
import time
from typing import TYPE_CHECKING

from nlfrf._base.arguments import require_kind

if TYPE_CHECKING:
    from IPython.display import DisplayHandle
    from rich.console import Console
    from rich.progress import Progress

_MIN_INTERVAL = 0.1  # [s] between two updates
_ERASE_LINE = "\r\x1b[2K"


def progress_bar(label: str = "") -> _ProgressBar:
    """Return a progress bar to give to functions that have an argument `progress`.

    The bar is shown below the cell in a notebook, and on standard error in a terminal.

    Parameters
    ----------
    label : str
        Name of the task.

    Returns
    -------
    callable
        Call it with the number of finished steps and their total. The bar is not shown if standard
        error is a file. `robust.tune` has a time limit instead of a number of steps; give it
        ``progress_bar(label).timed``.

    Raises
    ------
    ValueError
        `label` is not a text.

    Examples
    --------
    >>> show = progress_bar("simulating")
    >>> for done in range(1, 4):
    ...     show(done, 3)
    """
    require_kind("label", label, str)
    return _ProgressBar(label)


class _ProgressBar:
    """A bar that each call draws anew, without a thread, so that an interrupt leaves the terminal
    intact.
    """

    def __init__(self, label: str) -> None:
        self.label = label
        self.begun = time.monotonic()
        self.last = -float("inf")
        self.notebook_handle: DisplayHandle | None = None
        self.bar: Progress | None = None

    def __call__(self, done: int, total: int) -> None:
        """Show the number done and the total."""
        self.show(done, total, f"{done} of {total}")

    def timed(self, n_evaluated: int, best: float, left: float) -> None:
        """Show a search with a time limit: number of evaluations, best value so far, seconds left."""
        passed = time.monotonic() - self.begun
        self.show(passed, passed + left, f"{n_evaluated} evaluations, best {best:.4g}")

    def show(self, done: float, total: float, status: str) -> None:
        """Draw the bar on a terminal or in a notebook, at limited rate; always at its end."""
        now = time.monotonic()
        if done < total and now - self.last < _MIN_INTERVAL:
            return
        self.last = now
        if _in_notebook():
            self.show_in_notebook(done, total, status)
        elif sys.stderr.isatty():
            from rich.console import Console

            if self.bar is None:
                self.bar = rich_bar(Console(file=sys.stderr), self.label)
            self.bar.update(self.bar.task_ids[0], completed=done, total=total, status=status)
            with self.bar.console.capture() as drawn:
                self.bar.console.print(self.bar.get_renderable())
            sys.stderr.write(_ERASE_LINE + drawn.get().rstrip("\n") + "\n" * (done >= total))
            sys.stderr.flush()

    def show_in_notebook(self, done: float, total: float, status: str) -> None:
        """Draw the bar below a cell."""
        from IPython.display import HTML, display

        text = html.escape(f"{self.label} {status}".strip())
        shown = HTML(f"<progress value='{done}' max='{total}'></progress> {text}")
        if self.notebook_handle is None:
            self.notebook_handle = display(shown, display_id=True)
        else:
            self.notebook_handle.update(shown)


def rich_bar(console: Console, label: str, *, even: bool = True) -> Progress:
    """Return a bar of rich with one task, whose field `status` describes the work done; it vanishes
    at its end.

    For uneven steps the time left is not shown.
    """
    from rich.progress import (
        BarColumn,
        Progress,
        ProgressColumn,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )

    columns: list[ProgressColumn] = [
        TextColumn("{task.description}"),
        BarColumn(),
        TextColumn("{task.fields[status]}"),
        TimeElapsedColumn(),
        *([TextColumn("left"), TimeRemainingColumn()] if even else []),
    ]
    bar = Progress(*columns, console=console, transient=True, auto_refresh=console.is_terminal)
    bar.add_task(label, total=None, status="")
    return bar


def _in_notebook() -> bool:
    """Return whether the code runs in the kernel of a notebook, and not in a terminal."""
    shell = getattr(sys.modules.get("IPython"), "get_ipython", lambda: None)()
    return hasattr(shell, "kernel")
