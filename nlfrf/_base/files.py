"""Files are written whole or not at all; arrays as NPZ, HDF5 or MATLAB v5.

Pickles are never written or read.
"""

from __future__ import annotations

import json
import os
import re
import shlex
import tempfile
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar
from dataclasses import dataclass, field
from enum import Enum
from functools import partial
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import one_line, short_form
from nlfrf._base.extras import import_extra
from nlfrf._base.values import ArrayField

# ---- Output files: a command never writes onto a file that it reads, nor over a file of another
# kind.
#
# Every file of both packages goes through `write_atomically`, which checks this. A command opens
# `guarded_outputs`; then its inputs are safe under each of their names, and an existing file is
# replaced only by a result of its own kind. The kind is read from the file itself (`_file_kind`),
# because nothing else survives copying a folder or repeating a script.
#
# Outside a command the caller wrote the path, and the file is replaced as NumPy and pandas do. A
# file whose name a function made (`Role.DERIVED`) is treated as in a command, because the caller
# did not choose that name.

PICTURE_SIGNATURE = "nlfrf and robust: a picture of a result"  # signature in pictures
RECORD_SCHEMAS = ("nlfrf-record", "nlfrf-multirecord")
#: Kinds of these records if no command simulated them.
MEASURED_RECORDS = ("a measured record", "a measured record of several channels")
MULTIRECORD_KINDS = (RECORD_SCHEMAS[1], MEASURED_RECORDS[1])
SIMULATED_MARK = "simulated"  # entry of a simulated record; any other record may be a measurement
DESIGN_MARK = "the samples of a design"
_TABLE_HEADERS = (
    (r"f \[Hz\],Re G,Im G,bound,bound_realization,std_noise,.*", "the table of a BLA"),
    (r"f \[Hz\](,Re [^,]+,Im [^,]+,bound [^,]+)+", "the table of a matrix"),
    (r"b0,b1,b2,a0,a1,a2", "second-order sections"),
    (r"t \[s\](,u\d+( experiment \d+)?)+", DESIGN_MARK),
    (r"t \[s\],learned input", "a learned input"),
    (r"t \[s\],.*", ""),  # a record: it looks like any measurement
)
_TEXT_SIGNATURE = rb"(?m)^(?:% |<!-- )?\(?written by '((?:robust|nlfrf) [a-z]+)'\)?(?: -->)?$"
_PAGE_SIGNATURE = rb'<meta name="generator" content="(robust: [^"]+)">'
_HEAD_BYTES = 1 << 12  # bytes at either end of a file that contain its signature


class _FileKind(NamedTuple):
    """Name of a kind of file, and the command that takes a file {} of it."""

    name: str
    command: str


_MULTISINE_FILE = _FileKind(
    "a multisine",
    "nlfrf simulate {0} -o record.npz, or play it and: nlfrf identify RECORD --design {0} -o"
    " bla.npz",
)
_RECORD_FILE = _FileKind("a record", "nlfrf identify {} -o bla.npz")
_BLA_FILE = _FileKind("a BLA", "robust model {} -o model.json")
_MODEL_FILE = _FileKind(
    "a model",
    "robust design {0} --bandwidth HERTZ --sample-time SECONDS -o controller.json; "
    "robust check {0} controller.json -o report.txt",
)
_CERTIFICATE_FILE = _FileKind("a certificate", "robust verify {}")
FILE_KINDS = {
    "nlfrf-multisine": _MULTISINE_FILE,
    "nlfrf-axis-experiment": _FileKind(
        "an experiment on a drive",
        "robust servo play AXIS SETPOINTS.csv -o trace.csv, or play it and: "
        "nlfrf identify TRACE --design {} -o bla.npz",
    ),
    **dict.fromkeys((*RECORD_SCHEMAS, *MEASURED_RECORDS), _RECORD_FILE),
    "nlfrf-bla": _BLA_FILE,
    "nlfrf-frm": _BLA_FILE,
    "robust-model": _MODEL_FILE,
    "robust-matrix-model": _MODEL_FILE,
    "robust-controller": _FileKind("a controller", "robust check MODEL {}"),
    "robust-learning": _FileKind(
        "a learning filter", "robust learn step {} u.csv e.csv -o next.csv"
    ),
    "robust-certificate": _CERTIFICATE_FILE,
    "robust-friction-certificate": _CERTIFICATE_FILE,
    "robust-mu-certificate": _CERTIFICATE_FILE,
    "robust-schedule-certificate": _CERTIFICATE_FILE,
}


class Role(Enum):
    """Origin of the name of a file."""

    NAMED = "the caller wrote its name"
    DERIVED = "its name is made up from that of another file"
    KEPT = "its name is a digest of its computation, in a folder for resuming"


@dataclass
class _Outputs:
    """Inputs of the running command, and the files written so far."""

    inputs: tuple[Path, ...]
    overwrite: bool
    written: list[Path] = field(default_factory=list)


_RUNNING_COMMAND: ContextVar[_Outputs | None] = ContextVar("running", default=None)


@contextmanager
def guarded_outputs(inputs: Sequence[Path], *, overwrite: bool = False) -> Iterator[_Outputs]:
    """Protect the inputs of a running command, and files of other kinds, from its outputs."""
    running = _Outputs(tuple(inputs), overwrite)
    token = _RUNNING_COMMAND.set(running)
    try:
        yield running
    finally:
        _RUNNING_COMMAND.reset(token)


def is_command() -> bool:
    """Return whether a command is running, and not a script of the user."""
    return _RUNNING_COMMAND.get() is not None


def require_writable(*paths: Path, role: Role = Role.NAMED) -> None:
    """Refuse, before the work, paths that `_admit_file` would refuse for any content.

    Parameters
    ----------
    *paths : Path
        Files to write.
    role : Role
        Origin of their names.
    """
    running = _RUNNING_COMMAND.get()
    for path in paths:
        target = _resolve_target(path)
        for taken in () if running is None else running.inputs:
            if _is_same_file(target, taken):
                if str(path) == str(taken):
                    which = ""
                else:
                    which = f", which is {taken}"
                raise ValueError(
                    f"a file to write must not be one that the command reads, got {path}{which}:"
                    " its content would be lost; use another name"
                )
        for taken in () if running is None else running.written:
            if _is_same_file(target, taken):
                raise ValueError(
                    f"files to write must have different names, got {path} twice; use another name"
                )
        if target.exists() and not target.is_file():
            raise ValueError(
                f"a file to write must be a file, got {path}, which is a folder or a device"
            )
        if _is_guarded(running, role) and target.exists() and not _is_replaceable(target, path):
            _raise_for_foreign(path, running)


def _admit_file(path: Path, new: Path, role: Role) -> None:
    """Refuse a new file for a path, or note that it is written.

    Parameters
    ----------
    path : Path
        Path of the file.
    new : Path
        The complete new file.
    role : Role
        Origin of the name of `path`.
    """
    require_writable(path, role=role)
    running, target = _RUNNING_COMMAND.get(), _resolve_target(path)
    if _is_guarded(running, role) and target.exists():
        suffix = path.suffix.lower()
        if _file_kind(target, suffix) != _file_kind(new, suffix):
            _raise_for_foreign(path, running)
    if running is not None and role is not Role.KEPT:
        running.written.append(path)


def _is_guarded(running: _Outputs | None, role: Role) -> bool:
    """Return whether a file of another kind must be kept."""
    return role is not Role.KEPT and (
        role is Role.DERIVED if running is None else not running.overwrite
    )


def _raise_for_foreign(path: Path, running: _Outputs | None) -> None:
    """Refuse to replace the file at a path."""
    cure = "use another name, or move it away" + (
        "" if running is None else ", or replace it by --overwrite"
    )
    raise ValueError(
        f"a file to write must be new or an earlier result of the same kind, got {path}, which"
        f" contains {_describe_content(path)}; {cure}"
    )


def _describe_content(path: Path) -> str:
    """Describe the content of a file; for a table use its design, if the .npz with its name has
    one.
    """
    design = path.with_suffix(".npz")
    if path != design and stated_kind(design, ".npz") == "nlfrf-axis-experiment":
        return f"set points or a trace of the experiment in {design.name}"
    kind = stated_kind(path, path.suffix.lower())
    if kind in FILE_KINDS:
        return FILE_KINDS[kind].name
    return kind or "something else"


def _resolve_target(path: Path) -> Path:
    """Return the file behind a path: a write follows a symbolic link, as in other programs."""
    return Path(os.path.realpath(path))


def _is_same_file(one: Path, other: Path) -> bool:
    """Return whether two paths name one file: by links of both kinds, or if they differ in case
    only.
    """
    try:
        if one.samefile(other):
            return True
    except OSError:  # one of them does not exist
        pass
    return str(_resolve_target(one)).casefold() == str(_resolve_target(other)).casefold()


def _is_replaceable(target: Path, path: Path) -> bool:
    """Return whether an existing file has a signature of these packages."""
    kind = _file_kind(target, path.suffix.lower())
    # any generator may write a column u0; a file of this package has its design next to it
    return kind is not None and (
        kind != DESIGN_MARK or "multisine" in (_file_kind(path.with_suffix(".npz"), ".npz") or "")
    )


#: Arguments of `load_record` -> options, for both commands and the hints of refusals.
LOAD_OPTIONS = {
    "u": "input",
    "y": "output",
    "r": "reference",
    "fs": "fs",
    "n_samples": "period",
    "n_discard": "discard",
    "resample": "resample",
    "design": "design",
    "hold": "hold",
}


def command_signature(command: str) -> str:
    """Return the last line of a text file, by which `_file_kind` recognises the command that wrote
    it.

    >>> command_signature("robust check")
    "(written by 'robust check')"
    """
    return f"(written by '{command}')"


def _file_kind(path: Path, suffix: str) -> str | None:
    """Return the kind stated in a file; None without a signature of these packages, or if it cannot
    be read.

    A record counts only if a command simulated it, because the same function writes measurements.
    """
    kind = stated_kind(path, suffix)
    if kind in MEASURED_RECORDS:
        return None
    return kind


def stated_kind(path: Path, suffix: str) -> str | None:
    """Return the kind stated in a file, also for a measured record; None without one, or if it
    cannot be read.
    """
    try:
        return KIND_READERS[suffix](path)
    except Exception:  # a damaged file may raise anything, and so does an unknown suffix
        return None


def require_file_of(path: str | os.PathLike[str], *schemas: str) -> None:
    """Refuse a file that states another kind, with the command that takes it."""
    kind = stated_kind(to_path(path), to_path(path).suffix.lower())
    if kind is not None and kind not in schemas:
        raise ValueError(describe_wrong_file(path, kind, *schemas))


def describe_wrong_file(path: str | os.PathLike[str], kind: str | None, *schemas: str) -> str:
    """Return the refusal of a file of a kind (None if it states none): wanted kind, its kind, the
    command for it.

    >>> describe_wrong_file("G.npz", "nlfrf-bla", "robust-model", "robust-matrix-model")
    'path must hold a model, got G.npz, which is a BLA; go on with: robust model G.npz -o model.json'
    """
    *most, last = dict.fromkeys(FILE_KINDS[schema].name for schema in schemas)
    if most:
        wanted = f"{', '.join(most)} or {last}"
    else:
        wanted = last
    if kind in FILE_KINDS:
        name, command = FILE_KINDS[kind]
    elif kind is None:
        name, command = "of a kind that no command here writes", "nlfrf inspect {}"
    elif re.fullmatch("(?:robust|nlfrf) [a-z]+", kind):
        name, command = f"a text of '{kind}', for people to read", f"{kind} --help"
    else:
        name, command = f"of the kind {kind!r}", "nlfrf inspect {}"
    quoted = shlex.quote(str(path))
    return (
        f"path must hold {wanted}, got {path}, which is {name}; go on with:"
        f" {command.format(quoted)}"
    )


def _kind_of_npz(path: Path) -> str | None:
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as file:
        return _kind_of_schema(str(file["schema"]), SIMULATED_MARK in file.files)


def _kind_of_hdf5(path: Path) -> str | None:
    h5py = import_extra("h5py", "hdf5", "an HDF5 file")

    with h5py.File(path, "r") as file:
        return _kind_of_schema(str(file.attrs["schema"]), SIMULATED_MARK in file)


def _kind_of_mat(path: Path) -> str | None:
    from scipy.io import loadmat

    content = loadmat(path, variable_names=["schema", "kind", "content", SIMULATED_MARK])
    if "content" in content:  # from `robust export`
        return str(content["content"]["kind"].item().item())
    if "kind" in content:
        return str(content["kind"].item())
    return _kind_of_schema(content["schema"].item(), SIMULATED_MARK in content)


def _kind_of_schema(schema: str, simulated: bool) -> str | None:
    if schema in RECORD_SCHEMAS and not simulated:
        return MEASURED_RECORDS[RECORD_SCHEMAS.index(schema)]
    if schema.startswith(("nlfrf-", "robust-")):
        return schema
    return None


def _kind_of_table(path: Path) -> str | None:
    with path.open("rb") as stream:
        first = stream.readline(1 << 20).decode().rstrip("\n").replace('"', "")
    if "," not in first:
        first = first.replace(";", ",")
    return (
        next((kind for pattern, kind in _TABLE_HEADERS if re.fullmatch(pattern, first)), None)
        or None
    )


def _kind_of_signed(path: Path, signature: bytes) -> str | None:
    found = re.search(signature, _first_and_last_bytes(path))
    return found and found[1].decode()


def _kind_of_sound(path: Path) -> str | None:
    if b"ISFT" in _first_and_last_bytes(path) and b"nlfrf" in _first_and_last_bytes(path):
        return DESIGN_MARK
    return None


def _first_and_last_bytes(path: Path) -> bytes:
    with path.open("rb") as stream:
        head = stream.read(_HEAD_BYTES)
        stream.seek(max(len(head), path.stat().st_size - _HEAD_BYTES))
        return head + stream.read()


KIND_READERS: dict[str, Callable[[Path], str | None]] = {
    ".npz": _kind_of_npz,
    ".mat": _kind_of_mat,
    ".json": lambda path: _kind_of_schema(
        json.loads(path.read_text(encoding="utf-8"))["schema"], simulated=False
    ),
    ".csv": _kind_of_table,
    ".wav": _kind_of_sound,
    **dict.fromkeys((".h5", ".hdf5"), _kind_of_hdf5),
    **dict.fromkeys((".html", ".htm"), partial(_kind_of_signed, signature=_PAGE_SIGNATURE)),
    **dict.fromkeys(
        (".png", ".pdf", ".svg", ".eps", ".ps"),
        partial(_kind_of_signed, signature=b"(%b)" % PICTURE_SIGNATURE.encode()),
    ),
    **dict.fromkeys(
        (".txt", ".m", ".md", ".h", ".st", ".py"),
        partial(_kind_of_signed, signature=_TEXT_SIGNATURE),
    ),
}
DECIMALS = (".", ",")  # decimal marks of a table
_CHUNK_ROWS = 1 << 14  # rows of a table that are formatted at a time
VERSION = 1  # version of the schemas of records and results


def to_path(path: object, name: str = "path") -> Path:
    """Return the path as a `Path`; refuse other types by the name of the parameter."""
    if not isinstance(path, str | os.PathLike):
        raise ValueError(f"{name} must be a text or a pathlib.Path, got {short_form(path)}")
    return Path(path)


def page_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of an HTML page; refuse another suffix."""
    return _path_ending_in(path, ".html", ".htm")


def json_path(path: str | os.PathLike[str]) -> Path:
    """Return the path of a JSON file, which `load` recognises by its suffix; refuse another
    suffix.
    """
    return _path_ending_in(path, ".json")


def _path_ending_in(path: str | os.PathLike[str], *suffixes: str) -> Path:
    """Return a path with one of these suffixes; refuse others with the first in the message."""
    path = to_path(path)
    if path.suffix.lower() not in suffixes:
        raise ValueError(f"path must end in {suffixes[0]}, got {path.name!r}")
    return path


def write_atomically(
    path: str | os.PathLike[str], write: Callable[[Path], None], *, role: Role = Role.NAMED
) -> None:
    """Write a file whole or not at all: `write` fills a temporary file, which then replaces it.

    Parameters
    ----------
    path : path
        Path of the file.
    write : callable
        Called with the path to write to.
    role : Role
        Origin of the name: it decides which existing file may be replaced, see `nlfrf._base.files`.

    Raises
    ------
    ValueError
        The existing file must be kept.
    FileNotFoundError
        The folder does not exist.
    """
    path = to_path(path)
    target = _resolve_target(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"path must lie in an existing folder, got {str(path)!r}")
    require_writable(path, role=role)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    temporary = Path(name)
    try:
        write(temporary)
        _admit_file(path, temporary, role)
        temporary.chmod(0o666 & ~_current_umask())
        temporary.replace(target)
    finally:
        temporary.unlink(missing_ok=True)


def _current_umask() -> int:
    """Return the umask of the process; mkstemp makes files that only their owner may read."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_arrays(path: Path, content: Mapping[str, np.ndarray], *, role: Role = Role.NAMED) -> None:
    """Write named arrays in the format of the suffix."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_atomically(path, lambda target: _save_arrays(target, content), role=role)
    elif suffix in (".h5", ".hdf5"):
        write_atomically(path, lambda target: _save_hdf5(target, content), role=role)
    else:
        raise ValueError(f"path must end in .npz or .h5, got {path.name!r}")


def save_mat(path: Path, content: Mapping[str, np.ndarray]) -> None:
    """Write arrays as a MATLAB v5 file."""
    from scipy.io import savemat

    write_atomically(
        path, lambda target: savemat(target, dict(content), appendmat=False, do_compression=True)
    )


def _save_arrays(target: Path, content: Mapping[str, ArrayField]) -> None:
    """Write arrays as NPZ."""
    with target.open("wb") as stream:
        np.savez(stream, **content)


def _save_hdf5(target: Path, content: Mapping[str, np.ndarray]) -> None:
    """Write arrays as HDF5, texts as attributes."""
    h5py = import_extra("h5py", "hdf5", "an HDF5 file")

    with h5py.File(target, "w") as file:
        for name, array in content.items():
            if array.dtype.kind == "U":
                file.attrs[name] = str(array)
            else:
                file.create_dataset(name, data=array)


def write_table(
    path: Path,
    table: np.ndarray,
    names: Sequence[str],
    *,
    decimal: str = ".",
    comments: Sequence[str] = (),
) -> None:
    """Write columns of numbers under their names, each number with the fewest digits that reproduce
    it exactly.

    Parameters
    ----------
    path : Path
        The ``.csv`` file.
    table : (n, columns) ndarray
        The numbers.
    names : sequence of str
        Names of the columns.
    decimal : str
        "." with commas between columns, or "," with semicolons, for spreadsheets in most of Europe.
    comments : sequence of str
        Rows above the names, behind a "#".
    """
    between = "," if decimal == "." else ";"

    def quoted(name: str) -> str:
        if set(name) & {between, '"'}:
            return '"' + name.replace('"', '""') + '"'
        return name

    def write(temporary: Path) -> None:
        with temporary.open("w", encoding="utf-8", newline="\n") as stream:
            stream.writelines(f"# {one_line(one)}\n" for one in comments)
            stream.write(between.join(map(quoted, names)) + "\n")
            for first in range(0, len(table), _CHUNK_ROWS):
                rows = (
                    between.join(map(repr, row))
                    for row in table[first : first + _CHUNK_ROWS].tolist()
                )
                text = "\n".join(rows) + "\n"
                stream.write(text if decimal == "." else text.replace(".", ","))

    write_atomically(path, write)


def write_text(path: str | os.PathLike[str], text: str, *, role: Role = Role.NAMED) -> None:
    """Write text as UTF-8, whole or not at all."""

    def write(temporary: Path) -> None:
        temporary.write_text(text, encoding="utf-8")

    write_atomically(path, write, role=role)


def write_json(content: Mapping[str, object], path: str | os.PathLike[str]) -> None:
    """Write a JSON file, whole or not at all."""
    write_text(json_path(path), json.dumps(content, indent=1, allow_nan=False) + "\n")
