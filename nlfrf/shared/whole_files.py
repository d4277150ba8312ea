"""Files are written whole or not at all; arrays as NPZ, HDF5 or MATLAB v5. Pickles are never written or read."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.shared.outputs import Role, admit, require_writable, target_of
from nlfrf.shared.wording import shown

__all__ = ["DECIMALS", "VERSION", "path_of", "save_mat", "write_arrays", "write_table", "write_text", "write_whole"]


DECIMALS = (".", ",")  # marks of decimals that a table may have
ROWS = 1 << 14  # of a table that are put into text at a time
VERSION = 2  # of the schemas of records and results: 2 has hold, names and units


def path_of(path: Any) -> Path:
    """The path as a `Path`, or a refusal of what is none."""
    if not isinstance(path, str | os.PathLike):
        raise ValueError(f"path must be a text or a pathlib.Path, got {shown(path)}")
    return Path(path)


def write_whole(path: str | os.PathLike[str], write: Callable[[Path], None], *, role: Role = Role.NAMED) -> None:
    """Write a file whole or not at all: `write` fills a file beside it, which then takes its place.

    Parameters
    ----------
    path : path
        Where the file is to be.
    write : callable
        Is given the path to write to.
    role : Role
        Where the name comes from: it decides which existing file may be replaced, see `nlfrf.shared.outputs`.

    Raises
    ------
    ValueError
        A file that has to stay.
    FileNotFoundError
        A folder that does not exist.
    """
    path = path_of(path)
    target = target_of(path)
    if not target.parent.is_dir():
        raise FileNotFoundError(f"path must lie in an existing folder, got {str(path)!r}")
    require_writable(path, role=role)
    handle, name = tempfile.mkstemp(dir=target.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    beside = Path(name)
    try:
        write(beside)
        admit(path, beside, role)
        beside.chmod(0o666 & ~current_umask())
        beside.replace(target)
    finally:
        beside.unlink(missing_ok=True)


def current_umask() -> int:
    """The process's umask; mkstemp makes files that only their owner may read."""
    mask = os.umask(0)
    os.umask(mask)
    return mask


def write_arrays(path: Path, content: Mapping[str, np.ndarray], *, role: Role = Role.NAMED) -> None:
    """Write named arrays in the format that the suffix says."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_whole(path, lambda target: save_arrays(target, content), role=role)
    elif suffix in (".h5", ".hdf5"):
        write_whole(path, lambda target: save_hdf5(target, content), role=role)
    else:
        raise ValueError(f"path must end in .npz or .h5, got {path.name!r}")


def save_mat(path: Path, content: Mapping[str, np.ndarray]) -> None:
    """Write arrays as a MATLAB v5 file."""
    from scipy.io import savemat

    write_whole(path, lambda target: savemat(target, dict(content), appendmat=False, do_compression=True))


def save_arrays(target: Path, content: Mapping[str, Any]) -> None:
    """Write arrays as NPZ."""
    with target.open("wb") as stream:
        np.savez(stream, **content)


def save_hdf5(target: Path, content: Mapping[str, np.ndarray]) -> None:
    """Write arrays as HDF5, texts as attributes."""
    import h5py

    with h5py.File(target, "w") as file:
        for name, array in content.items():
            if array.dtype.kind == "U":
                file.attrs[name] = str(array)
            else:
                file.create_dataset(name, data=array)


def write_table(path: Path, table: np.ndarray, names: Sequence[str], *, decimal: str = ".") -> None:
    """Write columns of numbers under their names, each number with the fewest digits that give it back exactly.

    Parameters
    ----------
    path : Path
        The ``.csv`` file.
    table : (n, columns) ndarray
        The numbers.
    names : sequence of str
        What stands above the columns.
    decimal : str
        "." with commas between columns, or "," with semicolons, as spreadsheets in most of Europe want it.
    """
    between = "," if decimal == "." else ";"

    def quoted(name: str) -> str:
        return '"' + name.replace('"', '""') + '"' if set(name) & {between, '"'} else name

    def write(beside: Path) -> None:
        with beside.open("w", encoding="utf-8", newline="\n") as stream:
            stream.write(between.join(map(quoted, names)) + "\n")
            for first in range(0, len(table), ROWS):
                rows = (between.join(map(repr, row)) for row in table[first : first + ROWS].tolist())
                text = "\n".join(rows) + "\n"
                stream.write(text if decimal == "." else text.replace(".", ","))

    write_whole(path, write)


def write_text(path: str | os.PathLike[str], text: str, *, role: Role = Role.NAMED) -> None:
    """Write text as UTF-8, whole or not at all."""

    def write(beside: Path) -> None:
        beside.write_text(text, encoding="utf-8")

    write_whole(path, write, role=role)
