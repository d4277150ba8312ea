"""What the commands `nlfrf` and `robust` share: one line for a warning, for bad input, and for the version."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from importlib.metadata import version
from typing import Annotated, Any

import typer

__all__ = ["Version", "run"]


def run(name: str, app: Callable[[], Any], *shown: type[Warning]) -> None:
    """Run a command: bad input is one line on standard error and exit code 2, never a traceback.

    Warnings of the classes `shown` are one line there too.
    """
    with warnings.catch_warnings():
        for category in shown:
            warnings.simplefilter("always", category)
        warnings.showwarning = lambda message, *_, **__: typer.echo(f"{name}: warning: {message}", err=True)
        try:
            app()
        except (ValueError, OSError) as error:
            typer.echo(f"{name}: {in_one_line(error)}", err=True)
            raise SystemExit(2) from None
        except MemoryError as error:
            typer.echo(f"{name}: not enough memory for this: {error or 'none is left'}", err=True)
            raise SystemExit(2) from None


def in_one_line(error: Exception) -> str:
    """What went wrong, for a command line: the system's own errors name their file first."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename} could not be opened: {error.strerror.lower()}"
    return str(error)


def print_version(wanted: bool) -> None:
    """Print the version and stop, before a command is asked for."""
    if wanted:
        typer.echo(f"nlfrf + robust {version('nlfrf')}")
        raise typer.Exit


Version = Annotated[
    bool, typer.Option("--version", is_eager=True, callback=print_version, help="Print the version and stop.")
]
