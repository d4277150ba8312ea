"""What a command may write: never onto a file that it reads, nor over a file that no command of its kind made.

Every file of both packages goes through `whole_files.write_whole`, which asks here. A command opens `outputs`; then its
inputs are safe under each of their names, and an existing file is replaced only by a result of its own kind. The kind
is read from the file itself (`kind_of`), because nothing else survives copying a folder or calling a script again.

Outside a command a path is one that the caller wrote down, and is replaced as NumPy and pandas do. A file whose name a
function made up (`Role.DERIVED`) is treated as in a command: nobody asked for that name.
"""

from __future__ import annotations

import json
import os
import re
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from pathlib import Path
from typing import Any

import numpy as np

__all__ = [
    "PICTURE",
    "PLAYED",
    "SIMULATED",
    "Role",
    "admit",
    "is_command",
    "kind_of",
    "outputs",
    "require_writable",
    "signature",
    "target_of",
]

PICTURE = "nlfrf and robust: a picture of a result"  # what pictures say of who made them
RECORDS = ("nlfrf-record", "nlfrf-multirecord")
SIMULATED = "simulated"  # entry of a record that a command computed: any other record may be someone's measurement
PLAYED = "the samples of a design"
TABLES = (
    (r"f \[Hz\],Re G,Im G,bound,bound_realization,std_noise,.*", "the table of a BLA"),
    (r"f \[Hz\](,Re [^,]+,Im [^,]+,bound [^,]+)+", "the table of a matrix"),
    (r"b0,b1,b2,a0,a1,a2", "second-order sections"),
    (r"t \[s\](,u\d+( experiment \d+)?)+", PLAYED),
    (r"t \[s\],.*", ""),  # a record: it looks like anybody's measurement
)
TEXTS = re.compile(r"^(?:% |<!-- )?\(?written by '((?:robust|nlfrf) [a-z]+)'\)?(?: -->)?$", re.M)
HEAD = 1 << 12  # bytes at either end of a file in which it says what it is


class Role(Enum):
    """Why a file has the name it has."""

    NAMED = "the caller wrote its name"
    DERIVED = "its name is made up from that of another file"
    KEPT = "its name is a digest of what computes it, in a folder for resuming"


@dataclass
class Outputs:
    """What the command that is running reads, and what it has written so far."""

    inputs: tuple[Path, ...]
    overwrite: bool
    written: list[Path] = field(default_factory=list)


RUNNING: ContextVar[Outputs | None] = ContextVar("running", default=None)


@contextmanager
def outputs(inputs: Sequence[Path], *, overwrite: bool = False) -> Iterator[Outputs]:
    """While a command runs: keep its inputs, and what it did not make, from what it writes."""
    running = Outputs(tuple(inputs), overwrite)
    token = RUNNING.set(running)
    try:
        yield running
    finally:
        RUNNING.reset(token)


def is_command() -> bool:
    """Whether a command is running, and not a script of the user's."""
    return RUNNING.get() is not None


def require_writable(*paths: Path, role: Role = Role.NAMED) -> None:
    """Refuse, before the work is done, what `admit` would refuse after it whatever is to be written.

    Parameters
    ----------
    *paths : Path
        Files that are to be written.
    role : Role
        Where their names come from.
    """
    running = RUNNING.get()
    for path in paths:
        target = target_of(path)
        for taken in () if running is None else running.inputs:
            if same_file(target, taken):
                raise ValueError(
                    f"a file to write must not be one that the command reads, got {name_of(path, taken)}: what it "
                    "holds would be lost; take another name"
                )
        for taken in () if running is None else running.written:
            if same_file(target, taken):
                raise ValueError(f"files to write must have different names, got {path} twice; take another name")
        if target.exists() and not target.is_file():
            raise ValueError(f"a file to write must be a file, got {path}, which is a folder or a device")
        if is_guarded(running, role) and target.exists() and not is_replaceable(target, path):
            raise_for_foreign(path, running)


def admit(path: Path, new: Path, role: Role) -> None:
    """Refuse a file that is about to take a place, or note that it is written.

    Parameters
    ----------
    path : Path
        The place.
    new : Path
        The whole file that is to be there.
    role : Role
        Where the name of the place comes from.
    """
    require_writable(path, role=role)
    running, target = RUNNING.get(), target_of(path)
    if is_guarded(running, role) and target.exists():
        suffix = path.suffix.lower()
        if kind_of(target, suffix) != kind_of(new, suffix):
            raise_for_foreign(path, running)
    if running is not None and role is not Role.KEPT:
        running.written.append(path)


def is_guarded(running: Outputs | None, role: Role) -> bool:
    """Whether a file that is no result of ours has to stay."""
    return role is not Role.KEPT and (role is Role.DERIVED if running is None else not running.overwrite)


def raise_for_foreign(path: Path, running: Outputs | None) -> None:
    """Refuse to replace what is in a place."""
    cure = "take another name, or move it away" + ("" if running is None else ", or replace it by --overwrite")
    raise ValueError(
        f"a file to write must be new or an earlier result of the same kind, got {path}, which holds something else; "
        f"{cure}"
    )


def target_of(path: Path) -> Path:
    """The file behind a path: a symbolic link is written through, as by every other program."""
    return Path(os.path.realpath(path))


def same_file(one: Path, other: Path) -> bool:
    """Whether two paths name one file: by links of both kinds, and by case where names differ in nothing else."""
    try:
        if one.samefile(other):
            return True
    except OSError:  # one of them is not there
        pass
    return str(target_of(one)).casefold() == str(target_of(other)).casefold()


def name_of(path: Path, taken: Path) -> str:
    """A path, and the input it is another name of."""
    return str(path) if str(path) == str(taken) else f"{path}, which is {taken}"


def is_replaceable(target: Path, path: Path) -> bool:
    """Whether an existing file says that these packages made it."""
    kind = kind_of(target, path.suffix.lower())
    # anybody's generator may write a column u0: ours has its design beside it
    return kind is not None and (kind != PLAYED or "multisine" in (kind_of(path.with_suffix(".npz"), ".npz") or ""))


def signature(command: str) -> str:
    """The line at the end of a text file by which `kind_of` knows the command that wrote it.

    >>> signature("robust check")
    "(written by 'robust check')"
    """
    return f"(written by '{command}')"


def kind_of(path: Path, suffix: str) -> str | None:
    """What a file says it is, None where it does not say that these packages made it, or cannot be read.

    A record counts only where a command simulated it, because a measurement is written by the same function.
    """
    try:
        return READERS[suffix](path)
    except Exception:  # a damaged file makes its reader raise anything; so does a suffix that nobody here writes
        return None


def of_npz(path: Path) -> str | None:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        return of_schema(str(file["schema"]), SIMULATED in file.files)


def of_hdf5(path: Path) -> str | None:
    import h5py

    with h5py.File(path, "r") as file:
        return of_schema(str(file.attrs["schema"]), SIMULATED in file)


def of_mat(path: Path) -> str | None:
    from scipy.io import loadmat

    content = loadmat(path, variable_names=["schema", "kind", "content", SIMULATED])
    if "content" in content:  # of `robust export`
        return str(content["content"]["kind"].item().item())
    return (
        str(content["kind"].item()) if "kind" in content else of_schema(content["schema"].item(), SIMULATED in content)
    )


def of_schema(schema: str, simulated: bool) -> str | None:
    ours = schema.startswith(("nlfrf-", "robust-")) and (schema not in RECORDS or simulated)
    return schema if ours else None


def of_json(path: Path) -> str | None:
    return of_schema(json.loads(path.read_text(encoding="utf-8"))["schema"], simulated=False)


def of_table(path: Path) -> str | None:
    with path.open("rb") as stream:
        first = stream.readline(1 << 20).decode().rstrip("\n").replace('"', "")
    first = first if "," in first else first.replace(";", ",")
    return next((kind for pattern, kind in TABLES if re.fullmatch(pattern, first)), None) or None


def of_page(path: Path) -> str | None:
    found = re.search(rb'<meta name="generator" content="(robust: [^"]+)">', ends_of(path))
    return found and found[1].decode()


def of_picture(path: Path) -> str | None:
    return PICTURE if PICTURE.encode() in ends_of(path) else None


def of_text(path: Path) -> str | None:
    found = TEXTS.search(ends_of(path).decode(errors="replace"))
    return found and found[1]


def of_sound(path: Path) -> str | None:
    return PLAYED if b"ISFT" in ends_of(path) and b"nlfrf" in ends_of(path) else None


def ends_of(path: Path) -> bytes:
    """The first and the last bytes of a file."""
    with path.open("rb") as stream:
        head = stream.read(HEAD)
        stream.seek(max(len(head), path.stat().st_size - HEAD))
        return head + stream.read()


READERS: dict[str, Callable[[Path], Any]] = {
    ".npz": of_npz,
    ".mat": of_mat,
    ".json": of_json,
    ".csv": of_table,
    ".wav": of_sound,
    **dict.fromkeys((".h5", ".hdf5"), of_hdf5),
    **dict.fromkeys((".html", ".htm"), of_page),
    **dict.fromkeys((".png", ".pdf", ".svg", ".eps", ".ps"), of_picture),
    **dict.fromkeys((".txt", ".m", ".md"), of_text),
}
