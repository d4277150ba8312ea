"""Named channels from measurement files: MATLAB, dSPACE, CSV, NPZ, HDF5."""

from __future__ import annotations

import csv
import os
import re
import warnings
from collections.abc import Callable, Mapping
from dataclasses import field
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.files.hdf5 import read_hdf5
from nlfrf.shared.arguments import DataWarning, positive
from nlfrf.shared.values import value

__all__ = ["Channels", "read_channels"]


UNIT = re.compile(r"\s*[\[(]([^\])]*)[\])]\s*$")
SECONDS = {"": 1.0, "s": 1.0, "sec": 1.0, "ms": 1e-3, "us": 1e-6, "µs": 1e-6, "μs": 1e-6, "ns": 1e-9, "min": 60.0}
SLOW, UNLIKELY = 100.0, 2.0  # a clock in a time channel without a unit that may not be in seconds, or hardly is [Hz]
APART = 1e-3  # how far a sampling frequency that was given may be from that of the file
ROUGH = 2e-4  # how far a time axis of uneven steps may be from a clock of three digits that is believed instead


@value
class Channels:
    """What a file holds: arrays by name.

    Fields
    ------
    path : str
        Where they come from.
    arrays : dict of str to ndarray
        Numeric arrays and texts; members of structs as ``struct.member``.
    time : str
        Name of the time channel, empty where there is none.
    units : dict of str to str
        Units that the file says apart from the names.
    """

    path: str
    arrays: Mapping[str, np.ndarray]
    time: str = ""
    units: Mapping[str, str] = field(default_factory=dict)

    def full_name(self, name: str) -> str:
        """The name of a channel as the file has it: "input" finds "input (V)", where no other could be meant."""
        found = [known for known in self.arrays if UNIT.sub("", known) == name]
        return found[0] if name not in self.arrays and len(found) == 1 else name

    def signal(self, parameter: str, name: str) -> np.ndarray:
        """One stream of samples; a refusal lists the names there are."""
        array = self.arrays.get(self.full_name(name))
        if array is None or array.dtype.kind not in "fiub" or array.size < 2:
            listed = ", ".join(sorted(k for k, a in self.arrays.items() if a.dtype.kind in "fiub" and a.size > 1))
            raise ValueError(
                f"{parameter} must name a signal of {Path(self.path).name!r}, one of {listed or 'none'}; got {name!r}"
            )
        if array.ndim > 1 and self.text("schema"):
            return np.asarray(array, dtype=float)  # this package's own file: whoever asks knows the axes
        array = np.squeeze(array)
        if array.ndim != 1:
            raise ValueError(f"{parameter} must name one stream of samples, got {name!r} with shape {array.shape}")
        return np.asarray(array, dtype=float)

    def labels(self, u: str, y: str) -> dict[str, str]:
        """Names of input and output without their units, and the units that the file has in brackets or beside them."""
        labels = {}
        for signal, name in (("u", u), ("y", y)):
            full = self.full_name(name)
            unit = UNIT.search(full)
            labels[f"{signal}_name"] = "" if full == signal else UNIT.sub("", full)
            labels[f"{signal}_unit"] = unit[1].strip() if unit else self.units.get(full, "")
        return labels

    def text(self, name: str) -> str:
        """A text, empty where there is none of that name."""
        array = self.arrays.get(name)
        if array is None or array.dtype.kind not in "US" or array.size != 1:
            return ""
        item = array.reshape(-1)[0]
        return item.decode() if isinstance(item, bytes) else str(item)

    def sampling_frequency(self, given: float | None = None) -> float:
        """As given, else from a variable fs, else from the steps of the time channel [Hz].

        What was given is held against what the file says.
        """
        file = Path(self.path).name
        stored = self.arrays.get("fs")
        if stored is not None and stored.size == 1 and stored.dtype.kind in "fiu":
            found, where = float(stored.reshape(-1)[0]), "fs"
        elif self.time:
            found, where = self.frequency_of_time(given is not None), f"the time channel {self.time!r}"
        else:
            found, where = 0.0, ""
        if given is None:
            if not found > 0:
                raise ValueError(f"fs must be given: {file!r} holds neither fs nor a time channel")
            return found
        given = positive("fs", given)
        if found > 0 and abs(given / found - 1) > APART:
            warnings.warn(
                f"fs was given as {given:g} Hz, but by {where} of {file!r} it is {found:g} Hz; the one given is used",
                DataWarning,
                stacklevel=4,
            )
        return given

    def frequency_of_time(self, known: bool) -> float:
        """The sampling frequency [Hz] by the time channel, 0 where it has none or where it need not be understood."""
        unit = UNIT.search(self.time)
        second = SECONDS.get(unit[1].strip() if unit else "")
        if second is None and not known:
            raise ValueError(f"fs must be given: the unit of the time channel {self.time!r} is not known")
        fs = frequency_of((second or 0.0) * np.ravel(self.arrays[self.time]).astype(float))
        if unit is not None or not 0 < fs <= SLOW:
            return fs
        if known:  # without a unit, a slow clock in seconds may be a fast one in milliseconds
            return 0.0
        said = f"the time channel {self.time!r} names no unit and steps by {1 / fs:g}: {fs:g} Hz if these are seconds, "
        said += f"{1e3 * fs:g} Hz if they are milliseconds"
        if fs <= UNLIKELY:
            raise ValueError(f"fs must be given: {said}")
        warnings.warn(f"{said}; seconds are taken, give fs if they are not", DataWarning, stacklevel=5)
        return fs


def frequency_of(t: np.ndarray) -> float:
    """The sampling frequency of a time axis, which may be printed coarsely, jitter or have gaps; 0 where it has none.

    Clocks are set in round numbers: of all that the axis allows, the one with the fewest digits.

    >>> frequency_of(np.round(np.arange(20_000) / 16384, 6))
    16384.0
    """
    t = t[np.isfinite(t)]
    if t.size < 2:
        return 0.0
    steps = np.diff(t)
    usual = np.median(steps)
    gaps = steps > 1.5 * usual
    if steps.min() > 0.5 * usual and gaps.mean() < 0.1:  # else it is only printed coarsely
        steps = steps[~gaps]
    span = float(steps.sum())
    if not 0 < span < np.inf:
        return 0.0
    fs, tolerance = steps.size / span, max(float(np.ptp(steps)) / span, 1e-12)
    rough = ROUGH if np.std(steps) > 1e-6 / fs else 0.0
    for n in range(1, 18):
        rounded = float(f"{fs:.{n}g}")
        if abs(rounded / fs - 1) <= max(tolerance, rough if n <= 3 else 0.0):
            break
    return rounded


def read_channels(path: str | os.PathLike[str]) -> Channels:
    """Read every channel of a file, chosen by its suffix.

    Raises
    ------
    ValueError
        An unknown suffix, or a file that is damaged or is not what its suffix says.
    FileNotFoundError
        No such file.
    """
    path = Path(path)
    if not path.is_file():
        raise FileNotFoundError(f"path must be an existing file, got {str(path)!r}")
    reader = READERS.get(path.suffix.lower())
    if reader is None:
        raise ValueError(f"path must end in {', '.join(READERS)}, got {path.name!r}")
    try:
        arrays = reader(path)
    except MemoryError:
        raise ValueError(f"path must be a readable {path.suffix} file, got {path.name!r}: too large to read") from None
    except Exception as error:  # readers of damaged files raise nearly anything
        reason = " ".join(str(error).split()) or type(error).__name__
        raise ValueError(f"path must be a readable {path.suffix} file, got {path.name!r}: {reason[:160]}") from None
    numeric = {name: array for name, array in arrays.items() if array.dtype.kind in "fiubcUS"}
    if not numeric:
        raise ValueError(f"path must be a file that holds arrays of numbers, got {path.name!r} with none")
    names = [name for name in numeric if UNIT.sub("", name).lower() in ("t", "time", "x.data", "zeit")]
    return Channels(path=str(path), arrays=numeric, time=names[0] if names else "")


def read_mat(path: Path) -> dict[str, np.ndarray]:
    """MATLAB v5 by SciPy, v7.3 by h5py; objects that cannot be decoded are left out."""
    with path.open("rb") as stream:
        head = stream.read(128)
    if b"MATLAB 7.3" in head[:32] or head[:4] == b"\x89HDF":
        return read_hdf5(path)
    from scipy.io import loadmat

    raw = loadmat(path, squeeze_me=True, struct_as_record=False, appendmat=False)
    arrays: dict[str, np.ndarray] = {}
    for name, content in raw.items():
        if isinstance(name, str) and not name.startswith("__"):
            flatten(name, content, arrays)
    return arrays


def flatten(name: str, content: Any, arrays: dict[str, np.ndarray]) -> None:
    """Add a MATLAB variable: numbers and texts as they are, structs member by member, dSPACE channels by name."""
    members = getattr(content, "_fieldnames", None)
    if members is not None:
        if {"X", "Y"} <= set(members):
            flatten_dspace(content, arrays)
            return
        for member in members:
            flatten(f"{name}.{member}", getattr(content, member), arrays)
        return
    array = np.asarray(content)
    if array.dtype.kind in "fiubUS" and array.dtype.names is None:
        arrays[name] = array


def flatten_dspace(recording: Any, arrays: dict[str, np.ndarray]) -> None:
    """A dSPACE ControlDesk recording: X.Data is the time, Y a list of channels with Name and Data."""
    time = np.ravel(getattr(np.ravel(recording.X)[0], "Data", np.empty(0)))
    if time.size > 1:
        arrays["time"] = np.asarray(time, dtype=float)
    for channel in np.ravel(recording.Y):
        arrays[str(channel.Name)] = np.asarray(channel.Data, dtype=float)


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Every array of an NPZ file."""
    with path.open("rb") as stream, np.load(stream, allow_pickle=False) as archive:
        return {name: archive[name] for name in archive.files}


def read_csv(path: Path) -> dict[str, np.ndarray]:
    """Columns of a CSV file by their header; comma, semicolon or tab between them, decimal commas with the last two."""
    content = path.read_bytes()
    try:
        text = content.decode("utf-8-sig")
    except UnicodeDecodeError:  # as spreadsheets write it, for a µ in the header
        text = content.decode("latin-1")
    first, _, rest = text.removeprefix("#").partition("\n")  # NumPy and others mark their header so
    delimiter = max(",;\t", key=first.count)
    if delimiter != ",":
        rest = rest.replace(",", ".")
    names = [name.strip() for name in next(csv.reader([first], delimiter=delimiter))]
    if len(set(names)) != len(names) or not all(names) or any(is_number(name) for name in names):
        raise ValueError("the first line must be a header that names every column once")
    table = np.loadtxt(rest.splitlines(), delimiter=delimiter, ndmin=2)
    if table.shape[1] != len(names):
        raise ValueError(f"the header names {len(names)} columns, the data have {table.shape[1]}")
    return dict(zip(names, table.T.copy(), strict=True))


def is_number(text: str) -> bool:
    """Whether a text reads as a number."""
    try:
        float(text)
    except ValueError:
        return False
    return True


READERS: dict[str, Callable[[Path], dict[str, np.ndarray]]] = {
    ".mat": read_mat,
    ".npz": read_npz,
    ".csv": read_csv,
    ".h5": read_hdf5,
    ".hdf5": read_hdf5,
}
