"""What the commands `nlfrf` and `robust` share: one line for a warning, for bad input, and for the version."""

from __future__ import annotations

import functools
import inspect
import re
import sys
import warnings
from collections.abc import Callable, Iterable, Iterator, Mapping
from contextlib import contextmanager, nullcontext
from importlib.metadata import version
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, TextIO, TypeVar, get_type_hints

import typer

from nlfrf._base.arguments import one_line, printable
from nlfrf._base.extras import MissingPackageError
from nlfrf._base.files import guarded_outputs, require_writable
from nlfrf._base.progress import rich_bar
from nlfrf._base.values import to_json

if TYPE_CHECKING:
    from rich.console import Console

OUTPUT_PARAMETERS = ("out", "picture")  # parameters that name a file to write; every other path is one that is read
_OVERWRITE_HELP = "Replace a file that no such command made; an input is never replaced."


Command = TypeVar("Command", bound=Callable[..., object])


class Commands(typer.Typer):
    """The commands of a program. Each keeps its inputs from its outputs, and names every file that it wrote."""

    def command(self, name: str | None = None, **options: Any) -> Callable[[Command], Command]:
        """Register a command; one with an output has `--overwrite`, too."""

        def add(function: Command) -> Command:
            # the whole first sentence, which would be cut to 45 letters and an ellipsis otherwise
            sentence = (inspect.getdoc(function) or "").partition("\n\n")[0].replace("\n", " ")
            super(Commands, self).command(name, **{"short_help": sentence, **options})(_guard_outputs(function))
            return function

        return add


def _guard_outputs(function: Callable[..., object]) -> Callable[..., object]:
    """Return the command with its outputs refused where they would overwrite inputs, and named when it ends."""
    signature = inspect.signature(function)
    if not set(OUTPUT_PARAMETERS) & set(signature.parameters):
        return function

    @functools.wraps(function)
    def run_with_outputs(*, overwrite: bool, **given: object) -> None:
        read = [path for name, value in given.items() if name not in OUTPUT_PARAMETERS for path in _find_paths(value)]
        with guarded_outputs(read, overwrite=overwrite) as running:
            require_writable(
                *(path for name in OUTPUT_PARAMETERS for path in _find_paths(given.get(name)) if not path.is_dir())
            )
            try:
                function(**given)
            finally:  # of a command that fails half way, too
                for path in running.written:
                    typer.echo(f"wrote {path}", err=bool(given.get("json")))

    # where --force is the largest friction force, it has the one name only
    names = ("--overwrite",) if "force" in signature.parameters else ("--overwrite", "--force")
    hints = get_type_hints(function, include_extras=True)
    hints["overwrite"] = Annotated[bool, typer.Option(*names, help=_OVERWRITE_HELP)]
    overwrite = inspect.Parameter("overwrite", inspect.Parameter.KEYWORD_ONLY, default=False)
    parameters = [*signature.parameters.values(), overwrite]
    run_with_outputs.__signature__ = signature.replace(  # type: ignore[attr-defined]
        parameters=[one.replace(annotation=hints[one.name]) for one in parameters]
    )
    run_with_outputs.__annotations__ = hints
    return run_with_outputs


def _find_paths(value: object) -> list[Path]:
    """Return the paths among what a parameter was given."""
    return [one for one in (value if isinstance(value, (list, tuple)) else [value]) if isinstance(one, Path)]


class _Printable:
    """A text stream that writes out whatever in a text would command the terminal behind it (`printable`)."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text so."""
        self.stream.write(printable(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several so."""
        self.write("".join(lines))

    def __getattr__(self, name: str) -> object:
        if name == "buffer":  # the way around it, which click takes where it finds one
            raise AttributeError(name)
        return getattr(self.stream, name)


@contextmanager
def _clean_streams() -> Iterator[None]:
    """Everything that is printed, whoever prints it, cleaned: names in files, paths, messages of libraries."""
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Printable(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _rich_console() -> Console:
    """Return a console of rich on standard error itself: what moves there is drawn by codes that are meant."""
    from rich.console import Console

    return Console(file=getattr(sys.stderr, "stream", sys.stderr))


def run_command(name: str, app: Callable[..., object], *shown: type[Warning], options: Mapping[str, str]) -> None:
    """Run a command: bad input is one line on standard error and exit code 2, never a traceback.

    Warnings of the classes `shown` are one line there too, each once. `options` says which parameters of the library
    have another name on the command line: in messages they have that one. What names in a file could do to a terminal
    is undone on the way, in everything that is printed.
    """
    with _clean_streams(), warnings.catch_warnings():
        for category in shown:
            warnings.simplefilter("always", category)
        printed: set[str] = set()

        others = warnings.showwarning

        def show(
            message: Warning | str,
            category: type[Warning],
            filename: str,
            lineno: int,
            file: TextIO | None = None,
            line: str | None = None,
        ) -> None:
            if not issubclass(category, shown):  # of a library below: nothing that a user of ours can mend
                others(message, category, filename, lineno, file, line)
                return
            text = _name_options(one_line(str(message)), options)
            if text not in printed:  # of several outputs, each warns of what they share
                typer.echo(f"{name}: warning: {text}", err=True)
            printed.add(text)

        warnings.showwarning = show
        try:
            app(prog_name=name)
        except SystemExit as stop:
            if stop.code == _INTERRUPTED:  # files are written whole or not at all
                typer.echo(f"{name}: interrupted. No file is half written", err=True)
            raise
        except (ValueError, OSError, MissingPackageError) as error:
            typer.echo(f"{name}: {_name_options(_describe_error(error), options)}", err=True)
            raise SystemExit(2) from None
        except MemoryError as error:
            typer.echo(f"{name}: not enough memory for this: {error or 'none is left'}", err=True)
            raise SystemExit(2) from None


def _name_options(text: str, options: Mapping[str, str]) -> str:
    """Return a message of the library in the words of the command line.

    >>> _name_options("n_samples must be 7; give n_samples=7 or resample=True", {"n_samples": "period", "resample": ""})
    '--period must be 7; give --period 7 or --resample'
    >>> _name_options("go to record_from_samples(u, y, fs=...)", {"fs": "fs"})  # a call stays one
    'go to record_from_samples(u, y, fs=...)'
    """
    for parameter, option in options.items():
        option = f"--{option or parameter}"
        text = re.sub(rf"\b{parameter} ?= ?True\b", option, text)
        text = re.sub(rf"\b{parameter} ?= ?(?!\.\.\.)(?=\S)", f"{option} ", text)
        verb = " must name" if len(parameter) == 1 else "(?: of [^ ]+)? must"  # u, y and r are signals everywhere else
        text = re.sub(rf"(?<![-\w.]){parameter}(?={verb}\b| above\b)|(?<=give ){parameter}\b", option, text)
    return text


def _describe_error(error: Exception) -> str:
    """Return what went wrong, for a command line: the system's own errors name their file first."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{one_line(str(error.filename))} could not be opened: {error.strerror.lower()}"
    return one_line(str(error))


def printer(json: bool) -> Callable[[object], None]:
    """Who says what was found: standard output, or standard error where that is kept for JSON."""
    return lambda printed: typer.echo(str(printed), err=json)


def finish_command(results: object, good: bool, json: bool, *, code: int = 1) -> None:
    """The end of a command with a verdict: the result as JSON where asked for, an exit code where it is not good."""
    if json:
        typer.echo(to_json(results, most=MAX_ROWS))
    if not good:
        raise typer.Exit(code)


def require_left_out(options: Mapping[str, object]) -> None:
    """Refuse the first option that was given for an experiment on a drive."""
    if name := next((name for name, given in options.items() if given), None):
        raise ValueError(f"--{name} must be left out for an experiment on a drive: its design says it")


def parse_number(name: str, text: str) -> float:
    """Return a number given as text, or a refusal."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(f"{name} must be a number or the word its help names, got {text!r}") from None


@contextmanager
def spinner(what: str) -> Iterator[None]:
    """A spinner on standard error while something takes its time."""
    with _rich_console().status(what):
        yield


@contextmanager
def progress_display(what: str, *, even: bool = True) -> Iterator[Callable[[int, int], None]]:
    """A bar on standard error that takes (done, total), moves while a step takes long, and is gone afterwards.

    Nothing is written where that is a file: rich would end it with an empty line.
    """
    bar = rich_bar(_rich_console(), what, even=even)

    def show(done: int, total: int) -> None:
        bar.update(bar.task_ids[0], completed=done, total=total, status=f"{done} of {total}")

    with bar if bar.console.is_terminal else nullcontext():
        yield show


def _print_version(wanted: bool) -> None:
    """Print the version and stop, before a command is asked for."""
    if wanted:
        typer.echo(f"nlfrf + robust {version('nlfrf')}")
        raise typer.Exit


_INTERRUPTED = 130  # exit code of a command that was interrupted, as a shell has it
MAX_ROWS = 64  # numbers of an array that a verdict in JSON holds; of a longer one its shape
Decimal = Annotated[
    str,
    typer.Option(
        "--decimal", help="Mark of decimals in a .csv that is written: '.', or ',' with semicolons between columns."
    ),
]
Json = Annotated[
    bool, typer.Option("--json", help="Print the result as JSON, all else on standard error; long arrays by shape.")
]
Version = Annotated[
    bool, typer.Option("--version", is_eager=True, callback=_print_version, help="Print the version and stop.")
]
