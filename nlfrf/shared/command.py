"""What the commands `nlfrf` and `robust` share: one line for a warning, for bad input, and for the version."""

from __future__ import annotations

import re
import warnings
from collections.abc import Callable, Iterator, Mapping
from contextlib import contextmanager
from importlib.metadata import version
from typing import Annotated, Any

import typer

from nlfrf.shared.plain import as_json

__all__ = ["Json", "Version", "end", "number", "run", "speaker", "working"]


def run(name: str, app: Callable[..., Any], *shown: type[Warning], options: Mapping[str, str]) -> None:
    """Run a command: bad input is one line on standard error and exit code 2, never a traceback.

    Warnings of the classes `shown` are one line there too, each once. `options` says which parameters of the library
    have another name on the command line: in messages they have that one.
    """
    with warnings.catch_warnings():
        for category in shown:
            warnings.simplefilter("always", category)
        said: set[str] = set()

        others = warnings.showwarning

        def show(message: Warning | str, category: type[Warning], *where: Any, **more: Any) -> None:
            if not issubclass(category, shown):  # of a library below: nothing that a user of ours can mend
                others(message, category, *where, **more)
                return
            text = in_options(str(message), options)
            if text not in said:  # of several outputs, each warns of what they share
                typer.echo(f"{name}: warning: {text}", err=True)
            said.add(text)

        warnings.showwarning = show
        try:
            app(prog_name=name)
        except (ValueError, OSError) as error:
            typer.echo(f"{name}: {in_options(in_one_line(error), options)}", err=True)
            raise SystemExit(2) from None
        except MemoryError as error:
            typer.echo(f"{name}: not enough memory for this: {error or 'none is left'}", err=True)
            raise SystemExit(2) from None


def in_options(text: str, options: Mapping[str, str]) -> str:
    """A message of the library in the words of the command line.

    >>> in_options("n_samples must be 7; give n_samples=7 or resample=True", {"n_samples": "period", "resample": ""})
    '--period must be 7; give --period 7 or --resample'
    >>> in_options("go to record_from_samples(u, y, fs=...)", {"fs": "fs"})  # a call stays one
    'go to record_from_samples(u, y, fs=...)'
    """
    for parameter, option in options.items():
        option = f"--{option or parameter}"
        text = re.sub(rf"\b{parameter} ?= ?True\b", option, text)
        text = re.sub(rf"\b{parameter} ?= ?(?!\.\.\.)(?=\S)", f"{option} ", text)
        verb = " must name" if len(parameter) == 1 else "(?: of [^ ]+)? must"  # u, y and r are signals everywhere else
        text = re.sub(rf"(?<![-\w.]){parameter}(?={verb}\b| above\b)|(?<=give ){parameter}\b", option, text)
    return text


def in_one_line(error: Exception) -> str:
    """What went wrong, for a command line: the system's own errors name their file first."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename} could not be opened: {error.strerror.lower()}"
    return str(error)


def speaker(json: bool) -> Callable[[Any], None]:
    """Who says what was found: standard output, or standard error where that is kept for JSON."""
    return lambda said: typer.echo(str(said), err=json)


def end(results: Any, good: bool, json: bool) -> None:
    """The end of a command with a verdict: the result as JSON where asked for, exit code 1 where it is not good."""
    if json:
        typer.echo(as_json(results, most=MOST))
    if not good:
        raise typer.Exit(1)


def number(name: str, text: str) -> float:
    """A number given as text, or a refusal."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} must be a number or the word its help names, got {text!r}") from None


@contextmanager
def working(what: str) -> Iterator[None]:
    """A spinner on standard error while something takes its time."""
    from rich.console import Console

    with Console(stderr=True).status(what):
        yield


def print_version(wanted: bool) -> None:
    """Print the version and stop, before a command is asked for."""
    if wanted:
        typer.echo(f"nlfrf + robust {version('nlfrf')}")
        raise typer.Exit


MOST = 64  # numbers of an array that a verdict in JSON holds; of a longer one its shape
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, all else on standard error; long arrays by shape.")
]
Version = Annotated[
    bool, typer.Option("--version", is_eager=True, callback=print_version, help="Print the version and stop.")
]
