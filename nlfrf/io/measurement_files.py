"""The kinds of measurement files: which reader reads which suffix, and a file as its channels."""

from __future__ import annotations

import gzip
import os
import tempfile
import zlib
from collections.abc import Callable, Iterable
from dataclasses import replace
from pathlib import Path
from types import ModuleType
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import one_line
from nlfrf._base.files import describe_wrong_file, stated_kind, to_path
from nlfrf._base.own_process import Contents, read_in_own_process, require_size
from nlfrf.io import npz
from nlfrf.io.channels import (
    OTHER_WAY,
    Channels,
    OnePath,
    abscissas_in_seconds,
    clean_names,
    split_columns,
)
from nlfrf.io.readers import (
    columns,
    hdf5,
    matlab,
    mdf,
    npy,
    tables,
    tdms,
    touchstone,
    twincat,
    uff,
    wav,
)


class _Reader(NamedTuple):
    """Reader of a kind of file, a function or a module for its own process, and the extra that it
    needs.
    """

    contents: Callable[[Path], Contents] | ModuleType
    extra: str = ""


_TEXT_READER = _Reader(tables.contents, extra="csv")
_HDF5_READER = _Reader(hdf5, extra="hdf5")
_MDF_READER = _Reader(mdf, extra="mdf")
TWINCAT = _Reader(twincat, extra="twincat")
_READERS = {
    ".mat": _Reader(matlab.contents, extra="hdf5"),  # version 7.3 is HDF5
    ".npz": _Reader(npz.contents),
    **dict.fromkeys(
        (".csv", ".txt", ".tsv", ".dat", ".asc", ".lvm", ".mpt", ".dta", ".z", ".frd"), _TEXT_READER
    ),
    ".npy": _Reader(npy.contents),
    ".h5": _HDF5_READER,
    ".hdf5": _HDF5_READER,
    ".tdms": _Reader(tdms, extra="tdms"),
    **dict.fromkeys((".mf4", ".mdf"), _MDF_READER),
    **dict.fromkeys((".uff", ".unv"), _Reader(uff, extra="uff")),
    **dict.fromkeys((".s1p", ".s2p", ".s3p", ".s4p"), _Reader(touchstone, extra="touchstone")),
    **dict.fromkeys((".parquet", ".feather"), _Reader(columns, extra="parquet")),
    ".wav": _Reader(wav),
}
_SUFFIXES = ", ".join(_READERS).replace(".csv,", ".csv, .csv.gz,")


def to_paths(path: OnePath | Iterable[OnePath]) -> list[OnePath]:
    """Return the files of an experiment, one or several."""
    if isinstance(path, str | os.PathLike) or not isinstance(path, Iterable):
        paths = [path]
    else:
        paths = list(path)
    if not paths:
        raise ValueError("path must be a file or a list of files, got none")
    return paths


def read_channels(path: str | os.PathLike[str]) -> Channels:
    """Read every channel of a file, chosen by its suffix.

    Raises
    ------
    ValueError
        An unknown suffix, a damaged file, a file of another kind than its suffix, a package that is
        not installed.
    FileNotFoundError
        No such file.
    """
    path = to_path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path must be an existing file, got {str(path)!r}")
    suffix = path.suffix.lower()
    if suffix == ".gz" and _READERS.get(Path(path.stem).suffix.lower()) is _TEXT_READER:
        return _read_compressed(path)
    arrays, units, clocks, notes = _read_contents(path, suffix, _reader_of_suffix(path, suffix))
    arrays, units, clocks, notes = clean_names(arrays, units, clocks=clocks, notes=notes)
    for name, array in arrays.items():
        if array.dtype.kind in "Mm" and array.size > 1:  # datetimes of numpy and pandas are a clock
            arrays[name] = (array - array.reshape(-1)[0]) / np.timedelta64(1, "s")
            units[name] = "s"
            clocks.setdefault("", name)
    numeric = {name: array for name, array in arrays.items() if array.dtype.kind in "fiubcUS"}
    if not numeric:
        listing = "; ".join(f"{name!r} {why}" for name, why in notes.items())
        raise ValueError(
            f"path must be a file that holds arrays of numbers, got {path.name!r} with none"
            + (f": {listing}" if listing else "")
            + f"; {OTHER_WAY}"
        )
    numeric, clocks = abscissas_in_seconds(numeric, units, clocks)
    if "schema" not in numeric:
        numeric, clocks = split_columns(numeric, clocks)
    for (
        array
    ) in numeric.values():  # no other reference exists, so they go into a record without a copy
        for one in (array.base, array):
            if isinstance(one, np.ndarray):
                one.flags.writeable = False
    return Channels(path=str(path), arrays=numeric, units=units, clocks=clocks, notes=notes)


def _reader_of_suffix(path: Path, suffix: str) -> _Reader:
    """Return the reader for a suffix; refuse results of this project that are no measurement, and
    unknown suffixes.
    """
    if suffix in (".json", ".txt") and (
        kind := stated_kind(path, suffix)
    ):  # a result of `robust`, or a text
        raise ValueError(
            describe_wrong_file(path, kind, "nlfrf-multisine", "nlfrf-record", "nlfrf-bla")
        )
    if suffix not in _READERS:
        cure = "; save the sheet as .csv" if suffix in (".xls", ".xlsx", ".ods") else ""
        if suffix == ".sdf":
            cure = "; export the SDF of the analyser as a table, .mat or .uff"
        raise ValueError(f"path must end in {_SUFFIXES}, got {path.name!r}{cure}; {OTHER_WAY}")
    return _READERS[suffix]


def _read_contents(path: Path, suffix: str, reader: _Reader) -> Contents:
    """Return the contents found by the reader of a file; turn any failure into one clear error."""
    try:
        reader = _reader_by_start(path, reader)
        if isinstance(reader.contents, ModuleType):
            return read_in_own_process(str(reader.contents.__file__), path)
        return reader.contents(path)
    except MemoryError:
        raise ValueError(
            f"path must be a readable {suffix} file, got {path.name!r}: too large to read"
        ) from None
    except ModuleNotFoundError as missing:
        raise ValueError(
            f"path must be a file that can be read here: {path.name!r} needs {missing.name}, which"
            f" is not installed: pip install 'nlfrf[{reader.extra}]'; {OTHER_WAY}"
        ) from None
    except Exception as error:  # readers of damaged files raise nearly anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(
            f"path must be a readable {suffix} file, got {path.name!r}: {reason[:160]}; {OTHER_WAY}"
        ) from None


def _reader_by_start(path: Path, reader: _Reader) -> _Reader:
    """Return the reader of a file: for texts the first bytes may name another one than the
    suffix.
    """
    if reader is _TEXT_READER:
        with path.open("rb") as stream:
            start = stream.read(1024)
        if start.startswith(b"MDF "):  # older versions have the suffix .dat
            return _MDF_READER
        if twincat.is_export(start):
            return TWINCAT
    return reader


def extra_of_file(path: Path) -> str:
    """Return the extra of this package that a file needs; empty if it needs none, or is of an
    unknown kind.
    """
    reader = _READERS.get(path.suffix.lower())
    try:
        if (
            reader is None
            or not path.is_file()
            or (path.suffix.lower() == ".mat" and not matlab.is_version_73(path))
        ):
            return ""
        return _reader_by_start(path, reader).extra
    except OSError:  # an unreadable file
        return ""


def _read_compressed(path: Path) -> Channels:
    """Read a text table compressed by gzip, `run.csv.gz`, through a temporary file."""
    size, n = path.stat().st_size, 0
    with tempfile.TemporaryDirectory() as folder:
        unpacked = Path(folder) / path.stem
        try:
            with gzip.open(path, "rb") as packed, unpacked.open("wb") as written:
                while block := packed.read(1 << 20):
                    n += len(block)
                    require_size(n, size)
                    written.write(block)
        except (OSError, EOFError, ValueError, zlib.error) as error:
            raise ValueError(
                f"path must be a readable .gz file, got {path.name!r}: {one_line(str(error))};"
                f" {OTHER_WAY}"
            ) from None
        return replace(read_channels(unpacked), path=str(path))
