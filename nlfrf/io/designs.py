"""Multisines: read from files, written to files, and written as signals to play."""

from __future__ import annotations

import os
import struct
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import TypeVar

import numpy as np

from nlfrf._base.arguments import require_integer
from nlfrf._base.drive_entries import PORTS
from nlfrf._base.files import (
    DESIGN_MARK,
    Role,
    require_writable,
    save_mat,
    to_path,
    write_atomically,
    write_table,
)
from nlfrf._base.values import value
from nlfrf.io.measurement_files import read_channels
from nlfrf.io.stored_values import load_value, save_value
from nlfrf.signals.axis_experiment import AxisExperiment
from nlfrf.signals.multisine import Multisine

_MULTISINE_SCHEMA = "nlfrf-multisine"
_EXACT_SUFFIXES = (".npz", ".h5", ".hdf5")
_PLAYABLE_SUFFIXES = (
    ".csv",
    ".mat",
    ".wav",
)  # these contain the played signal, and the design is a second file
_EXPERIMENT_SCHEMA = "nlfrf-axis-experiment"
DESIGNS: dict[str, Callable[..., Multisine | AxisExperiment]] = {
    _MULTISINE_SCHEMA: Multisine,
    _EXPERIMENT_SCHEMA: AxisExperiment,
}


def save_multisine(ms: Multisine, path: str | os.PathLike[str], *, decimal: str = ".") -> None:
    """Write a design with its samples, or the signal for a generator with the design as a second
    file.
    """
    path, companion = to_path(path), to_path(path).with_suffix(".npz")
    suffix, u = path.suffix.lower(), ms.u
    peak = float(np.abs(u).max())
    if suffix not in (*_EXACT_SUFFIXES, *_PLAYABLE_SUFFIXES):
        raise ValueError(
            f"path must end in {', '.join(_EXACT_SUFFIXES)} or, to be played,"
            f" {', '.join(_PLAYABLE_SUFFIXES)}, got {path.name!r}"
        )
    if suffix in _PLAYABLE_SUFFIXES:
        require_writable(companion, role=Role.DERIVED)  # before the first of two files is there
    if suffix == ".csv":
        t = np.arange(ms.n_samples) / ms.fs
        write_table(
            path,
            np.column_stack([t, *_played_samples(u)]),
            ["t [s]", *_played_names(ms)],
            decimal=decimal,
        )
    elif suffix == ".mat":
        save_mat(
            path,
            {
                "kind": np.array(DESIGN_MARK),
                "u": u,
                "fs": np.array(ms.fs),
                "f": ms.f,
                "amplitude": ms.amplitude,
                "phase": ms.phase,
            },
        )
    elif suffix == ".wav":
        from scipy.io import wavfile

        rate = require_integer("fs of a .wav file", ms.fs, least=1)
        samples = (_played_samples(u).T / peak).astype(np.float32)

        def write(target: Path) -> None:
            wavfile.write(target, rate, samples)
            _add_remark(target, f"full scale is {peak:.17g}")

        write_atomically(path, write)
    else:
        save_value(ms, _MULTISINE_SCHEMA, path, u=u)
        return
    save_value(ms, _MULTISINE_SCHEMA, companion, role=Role.DERIVED, u=u, peak=np.array(peak))


def save_experiment(
    experiment: AxisExperiment, path: str | os.PathLike[str], *, decimal: str = "."
) -> None:
    """Write an experiment: ``.npz`` or ``.h5``, or a ``.csv`` of set points to play and its design
    as ``.npz``.

    For several realisations play.csv becomes play-1.csv, play-2.csv, ...
    """
    path = to_path(path)
    suffix, companion = path.suffix.lower(), path.with_suffix(".npz")
    if suffix not in (*_EXACT_SUFFIXES, ".csv"):
        raise ValueError(
            f"path must end in .csv, to be played, or in {', '.join(_EXACT_SUFFIXES)}, got"
            f" {path.name!r}"
        )
    if suffix != ".csv":
        save_value(experiment, _EXPERIMENT_SCHEMA, path)
        return
    require_writable(companion, role=Role.DERIVED)  # before the first of several files is there
    t, M = np.arange(experiment.n_rows) / experiment.ms.fs, experiment.ms.n_realizations
    for m in range(M):
        if M == 1:
            target = path
        else:
            target = path.with_name(f"{path.stem}-{m + 1}{path.suffix}")
        columns = {
            f"{port} [{experiment.units[port]}]": one
            for port, one in experiment.set_points(m).items()
        }
        write_table(
            target, np.column_stack([t, *columns.values()]), ["t [s]", *columns], decimal=decimal
        )
    save_value(experiment, _EXPERIMENT_SCHEMA, companion, role=Role.DERIVED)


@value
class SetPoints:
    """Set points for a drive or a simulated axis, over time.

    `nlfrf.save` writes them for an experiment to play.

    Fields
    ------
    fs : float
        Sampling frequency [Hz].
    played : dict of str to (n,) ndarray
        Set point by name: "force", "velocity", "position", as far as the file contains them.
    units : dict of str to str
        Unit of each set point; "" if the file states none.

    Examples
    --------
    >>> SetPoints(fs=4000.0, played={"force": np.zeros(8)}, units={"force": "N"}).units
    {'force': 'N'}
    """

    fs: float
    played: Mapping[str, np.ndarray]
    units: Mapping[str, str]


def load_set_points(path: str | os.PathLike[str]) -> SetPoints:
    """Read the set points of a drive from a table with time and columns called position, velocity
    or force.

    Parameters
    ----------
    path : path
        File of the table, in any format of `nlfrf.load_record`. `nlfrf.save` writes one for an
        experiment to play.

    Returns
    -------
    SetPoints

    Raises
    ------
    ValueError
        The file has none of these columns, or its time steps are not equal.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import tempfile
    >>> with tempfile.TemporaryDirectory() as folder, open(f"{folder}/play.csv", "w+") as file:
    ...     _ = file.write("t [s],position [m]\\n" + "".join(f"{k / 1000},{k}\\n" for k in range(4)))
    ...     _ = file.seek(0)
    ...     played = load_set_points(file.name)
    >>> played.fs, played.units
    (1000.0, {'position': 'm'})
    """
    file = read_channels(to_path(path))
    given = [port for port in PORTS if file.full_name(port) in file.arrays]
    if not given:
        raise ValueError(
            f"path must hold set points called {', '.join(PORTS)}, got none in"
            f" {Path(file.path).name!r}"
        )
    return SetPoints(
        fs=file.sampling_frequency(None, tuple(given)),
        played={port: file.signal(port, port) for port in given},
        units={port: file.unit(file.full_name(port)) for port in given},
    )


def _add_remark(path: Path, text: str) -> None:
    """Add a LIST chunk to a WAV file: the program that wrote it, and a comment (Microsoft RIFF,
    INFO list).
    """

    def chunk(name: bytes, content: bytes) -> bytes:
        return name + struct.pack("<I", len(content)) + content + b"\0" * (len(content) % 2)

    remark = chunk(
        b"LIST", b"INFO" + chunk(b"ISFT", b"nlfrf\0") + chunk(b"ICMT", text.encode() + b"\0")
    )
    with path.open("r+b") as stream:
        size = stream.seek(0, os.SEEK_END)
        stream.write(remark)
        stream.seek(4)
        stream.write(struct.pack("<I", size + len(remark) - 8))


def _played_samples(u: np.ndarray) -> np.ndarray:
    """Return (channels, N) periods in playing order: all inputs of an experiment side by side."""
    if u.ndim == 2:
        return u
    return np.swapaxes(u, 0, 1).reshape(-1, u.shape[2])


def _played_names(ms: Multisine) -> list[str]:
    """Return the names of these periods: u0, u1 for realisations; for several inputs input, then
    experiment.
    """
    if ms.is_single:
        return [f"u{m}" for m in range(ms.n_realizations)]
    return [
        f"u{i + 1} experiment {m + 1}" for m in range(ms.n_experiments) for i in range(ms.n_inputs)
    ]


Given = TypeVar("Given")


def given_or_read(
    given: Given | str | os.PathLike[str], read: Callable[[str | os.PathLike[str]], Given]
) -> Given:
    """Return a design that is given itself, or in a file."""
    if isinstance(given, str | os.PathLike):
        return read(given)
    return given


def load_design(path: str | os.PathLike[str]) -> Multisine:
    """Return the design that `save_multisine` wrote, for one input or for several."""
    design: Multisine | AxisExperiment = load_value(DESIGNS, path)
    if isinstance(design, AxisExperiment):
        raise ValueError(
            f"path must be a multisine, got an experiment on a drive in {str(path)!r}: use"
            " load_trace"
        )
    return design


def load_experiment(path: str | os.PathLike[str]) -> AxisExperiment:
    """Return the experiment that `save_experiment` wrote."""
    experiment: AxisExperiment = load_value({_EXPERIMENT_SCHEMA: AxisExperiment}, path)
    return experiment
