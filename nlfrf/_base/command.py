"""Common parts of the commands `nlfrf` and `robust`: one line for a warning, for bad input, and for
the version.
"""

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

from nlfrf._base.arguments import as_list, one_line, printable
from nlfrf._base.extras import MissingPackageError
from nlfrf._base.files import guarded_outputs, require_writable
from nlfrf._base.progress import rich_bar
from nlfrf._base.values import to_json

if TYPE_CHECKING:
    from rich.console import Console

_OUTPUT_PARAMETERS = (
    "out",
    "picture",
    "rounded",
)  # parameters with a file to write; every other path is read
_OVERWRITE_HELP = "Replace files that were not made by such a command; inputs are never replaced."


Command = TypeVar("Command", bound=Callable[..., object])


class Commands(typer.Typer):
    """The commands of a program.

    Each protects its inputs from its outputs, and prints every file that it wrote.
    """

    def command(self, name: str | None = None, **options: Any) -> Callable[[Command], Command]:
        """Register a command; one with an output has `--overwrite`, too."""

        def add(function: Command) -> Command:
            # the whole first sentence; typer would cut it to 45 letters
            sentence = (inspect.getdoc(function) or "").partition("\n\n")[0].replace("\n", " ")
            super(Commands, self).command(name, **{"short_help": sentence, **options})(
                _guard_outputs(function)
            )
            return function

        return add


def _guard_outputs(function: Callable[..., object]) -> Callable[..., object]:
    """Return the command with a check that outputs do not overwrite inputs, and a list of outputs
    at its end.
    """
    signature = inspect.signature(function)
    if not set(_OUTPUT_PARAMETERS) & set(signature.parameters):
        return function

    @functools.wraps(function)
    def run_with_outputs(*, overwrite: bool, **given: object) -> None:
        read = [
            path
            for name, value in given.items()
            if name not in _OUTPUT_PARAMETERS
            for path in _find_paths(value)
        ]
        with guarded_outputs(read, overwrite=overwrite) as running:
            require_writable(
                *(
                    path
                    for name in _OUTPUT_PARAMETERS
                    for path in _find_paths(given.get(name))
                    if not path.is_dir()
                )
            )
            try:
                function(**given)
            finally:  # also for a command that fails midway
                for path in running.written:
                    typer.echo(f"wrote {path}", err=bool(given.get("json")))

    # if --force is the largest friction force, the option has one name only
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
    return [one for one in as_list(value) if isinstance(one, Path)]


class _Printable:
    """A text stream without characters that control a terminal (`printable`)."""

    def __init__(self, stream: TextIO) -> None:
        self.stream = stream

    def write(self, text: str) -> int:
        """Write a text, made printable."""
        self.stream.write(printable(text))
        return len(text)

    def writelines(self, lines: Iterable[str]) -> None:
        """Write several texts, made printable."""
        self.write("".join(lines))

    def __getattr__(self, name: str) -> object:
        if name == "buffer":  # click would bypass this stream through it
            raise AttributeError(name)
        return getattr(self.stream, name)


@contextmanager
def _clean_streams() -> Iterator[None]:
    """Make everything that is printed inside printable: names in files, paths, messages of
    libraries.
    """
    before = sys.stdout, sys.stderr
    sys.stdout, sys.stderr = (_Printable(stream) for stream in before)
    try:
        yield
    finally:
        sys.stdout, sys.stderr = before


def _rich_console() -> Console:
    """Return a console of rich on standard error itself, because its control codes are intended."""
    from rich.console import Console

    return Console(file=getattr(sys.stderr, "stream", sys.stderr))


def run_command(
    name: str, app: Callable[..., object], *shown: type[Warning], options: Mapping[str, str]
) -> None:
    """Run a command: bad input is one line on standard error and exit code 2, never a traceback.

    Warnings of the classes `shown` are one line each, too, and appear once. `options` maps
    parameters of the library to options of the command line, which replace them in messages. All
    printed text is made printable, so that names in a file cannot control a terminal.
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
            if not issubclass(category, shown):  # of another library: the user cannot act on it
                others(message, category, filename, lineno, file, line)
                return
            text = _name_options(one_line(str(message)), options)
            if text not in printed:  # several outputs may give the same warning
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
    """Return a message of the library with options in place of parameters.

    >>> _name_options("n_samples must be 7; give n_samples=7 or resample=True", {"n_samples": "period", "resample": ""})
    '--period must be 7; give --period 7 or --resample'
    >>> _name_options("go to record_from_samples(u, y, fs=...)", {"fs": "fs"})  # a call is unchanged
    'go to record_from_samples(u, y, fs=...)'
    """
    for parameter, option in options.items():
        option = f"--{option or parameter}"
        text = re.sub(rf"\b{parameter} ?= ?True\b", option, text)
        text = re.sub(rf"\b{parameter} ?= ?(?!\.\.\.)(?=\S)", f"{option} ", text)
        # u, y and r are signals elsewhere
        verb = " must name" if len(parameter) == 1 else "(?: of [^ ]+)? must"
        text = re.sub(
            rf"(?<![-\w.]){parameter}(?={verb}\b| above\b)|(?<=give ){parameter}\b", option, text
        )
    return text


def _describe_error(error: Exception) -> str:
    """Describe an error for the command line; errors of the system have the name of the file
    first.
    """
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{one_line(str(error.filename))} could not be opened: {error.strerror.lower()}"
    return one_line(str(error))


def printer(json: bool) -> Callable[[object], None]:
    """Return the print function: standard output, or standard error if that is reserved for
    JSON.
    """
    return lambda printed: typer.echo(str(printed), err=json)


def finish_command(results: object, good: bool, json: bool, *, code: int = 1) -> None:
    """End a command with a verdict: print the result as JSON if wanted, exit with a code if it is
    not good.
    """
    if json:
        typer.echo(to_json(results, most=MAX_ROWS))
    if not good:
        raise typer.Exit(code)


def require_left_out(options: Mapping[str, object]) -> None:
    """Refuse the first option that was given for an experiment on a drive."""
    if name := next((name for name, given in options.items() if given), None):
        raise ValueError(
            f"--{name} must be left out for an experiment on a drive: its design contains it"
        )


def parse_number(name: str, text: str) -> float:
    """Return a number given as text; refuse other text."""
    try:
        return float(text)
    except ValueError:
        raise ValueError(
            f"{name} must be a number or the word its help names, got {text!r}"
        ) from None


@contextmanager
def spinner(what: str) -> Iterator[None]:
    """Show a spinner on standard error during a long task."""
    with _rich_console().status(what):
        yield


@contextmanager
def progress_display(what: str, *, even: bool = True) -> Iterator[Callable[[int, int], None]]:
    """Show a bar on standard error, moved by calls (done, total), also during a long step; it
    vanishes at the end.

    Nothing is written if standard error is a file, because rich would end it with an empty line.
    """
    bar = rich_bar(_rich_console(), what, even=even)

    def show(done: int, total: int) -> None:
        bar.update(bar.task_ids[0], completed=done, total=total, status=f"{done} of {total}")

    with bar if bar.console.is_terminal else nullcontext():
        yield show


def _print_version(wanted: bool) -> None:
    """Print the version and stop, before a command is required."""
    if wanted:
        typer.echo(f"nlfrf + robust {version('nlfrf')}")
        raise typer.Exit


_INTERRUPTED = 130  # exit code of an interrupted command, as in a shell
MAX_ROWS = 64  # most numbers of an array in a JSON verdict; a longer array is given by its shape
Decimal = Annotated[
    str,
    typer.Option(
        "--decimal",
        help="Decimal mark of the .csv to write: '.', or ',' with semicolons between columns.",
    ),
]
Json = Annotated[
    bool,
    typer.Option(
        "--json",
        help=(
            "Print the result as JSON, everything else on standard error; long arrays as their"
            " shape."
        ),
    ),
]
Resample = Annotated[
    bool,
    typer.Option(
        "--resample",
        help="Find the start of each period where the input repeats, and interpolate between"
        " samples.",
    ),
]
Version = Annotated[
    bool,
    typer.Option(
        "--version", is_eager=True, callback=_print_version, help="Print the version and stop."
    ),
]
