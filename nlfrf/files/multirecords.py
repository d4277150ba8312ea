"""Records of several inputs or outputs from files."""

from __future__ import annotations

import os
import zlib
from collections.abc import Sequence
from contextlib import suppress
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.files.channels import Channels, paths_of, read_channels
from nlfrf.files.designs import load_design
from nlfrf.files.lost_rows import keep_whole_periods
from nlfrf.files.stored_records import MULTIRECORD_SCHEMA, Asked, stored_multirecord
from nlfrf.records.record import SAME_CLOCK
from nlfrf.records.reference import Design
from nlfrf.records.several import MultiRecord, multirecord_from_samples
from nlfrf.shared.whole_files import path_of
from nlfrf.shared.wording import shown

__all__ = ["holds_multirecord", "load_multirecord"]


HEAD = 1 << 16  # bytes in which the schema of a file of this package stands: as NumPy has texts, or as HDF5 has them
FIRST = 128 + 8  # bytes of a MATLAB file before its first variable


def load_multirecord(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    u: Sequence[str] | None = None,
    y: Sequence[str] | None = None,
    r: Sequence[str] = (),
    fs: float | None = None,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    n_discard: int = 0,
    resample: bool = False,
    design: Design | str | os.PathLike[str] | None = None,
    hold: str | None = None,
) -> MultiRecord:
    """Read a record of several inputs or outputs: from measurement files, one file an experiment, or as it was saved.

    Parameters
    ----------
    path : path, or a list of them
        Any file that `load_record` reads; or what `save_record` wrote of a `MultiRecord`, of several such files the
        experiments of all.
    u, y, r : sequence of str
        Names of the inputs, the outputs and, in closed loop, the references. Of what `save_record` wrote they may be
        left out; there y chooses outputs.
    fs : float, optional
        Sampling frequency [Hz]; from the file when not given.
    n_samples : int, optional
        Samples in one period; found from the first input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from the inputs when not given.
    n_discard : int
        Periods to leave out at the start.
    resample : bool
        Cut the periods where the inputs show that they stand; see `multirecord_from_samples`.
    design : OrthogonalMultisine or path, optional
        What was played, or the file that `save_multisine` wrote; see `multirecord_from_samples`.
    hold : str, optional
        How all inputs run between their samples: "zoh" where they are commands of converters, "band-limited" where
        they were measured behind the hold. From the file or the design, or unknown, when not given.

    Returns
    -------
    MultiRecord
        With the channels called as they were asked for.

    Raises
    ------
    ValueError
        A file or a name as in `load_record`, files of different sampling frequencies, signals that do not make a
        record.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, n_inputs=2, rng=1)
    >>> folder = tempfile.TemporaryDirectory()
    >>> paths = [f"{folder.name}/run{m}.npz" for m in range(2)]
    >>> for m, path in enumerate(paths):
    ...     fx, fy = np.tile(ms.u[:, m], 3)
    ...     np.savez(path, fx=fx, fy=fy, x=fx + fy, fs=100.0)
    >>> load_multirecord(paths, u=["fx", "fy"], y=["x"], n_samples=100).u.shape
    (2, 2, 3, 100)
    >>> folder.cleanup()
    """
    if design is not None and isinstance(design, str | os.PathLike):
        design = load_design(design)
    files = [read_channels(one) for one in paths_of(path)]
    if all(file.text("schema") == MULTIRECORD_SCHEMA for file in files):
        if r:
            raise ValueError(f"r must be left out for a record that has its own references or none, got {shown(r)}")
        return stored_multirecord(files, u, y, fs, Asked(n_samples, lines, n_discard, resample, design, hold))
    if isinstance(u, str) or isinstance(y, str) or isinstance(r, str) or not (u and y):
        raise ValueError(
            f"u, y and r must be lists of names, at least one input and one output, got {u!r}, {y!r}, {r!r}"
        )
    signals: dict[str, Any] = {
        parameter: [together(parameter, names, file) for file in files]
        for parameter, names in (("u", u), ("y", y), ("r", r))
        if names
    }
    clocks = [file.sampling_frequency(fs, (*u, *y, *r)) for file in files]
    if max(clocks) > min(clocks) * (1 + SAME_CLOCK):
        raise ValueError(f"path must be files of one sampling frequency, got {min(clocks):g} to {max(clocks):g} Hz")
    asked = keep_whole_periods(
        [file.seconds(u[0]) for file in files],
        list(signals.values()),
        signals.get("r", signals["u"])[0][0],
        clocks[0],
        Asked(n_samples, lines, n_discard, resample, design, hold),
        [file.path for file in files],
    )
    return multirecord_from_samples(
        **signals,
        fs=clocks[0],
        n_samples=asked.n_samples,
        lines=lines,
        n_discard=asked.n_discard,
        resample=resample,
        inputs=tuple(u),
        outputs=tuple(y),
        design=design,
        hold=hold,
    )


def holds_multirecord(path: str | os.PathLike[str]) -> bool:
    """Whether a file is a record of several inputs that `save_record` wrote: its schema stands in front."""
    path = path_of(path)
    if path.suffix.lower() not in (".npz", ".mat", ".h5", ".hdf5") or not path.is_file():
        return False
    with path.open("rb") as stream:
        head = stream.read(HEAD)
    if head.startswith(b"MATLAB 5.0"):
        with suppress(zlib.error):  # of variables that are not compressed
            head = zlib.decompressobj().decompress(head[FIRST:], HEAD)
    return any(MULTIRECORD_SCHEMA.encode(code) in head for code in ("utf-8", "utf-32-le"))


def together(parameter: str, names: Sequence[str], file: Channels) -> np.ndarray:
    """(n_channels, n) channels of one file."""
    if file.text("schema"):
        raise ValueError(f"path must be measurement files, got {file.path!r}, written as {file.text('schema')}")
    streams = [file.signal(parameter, name) for name in names]
    for name, stream in zip(names, streams, strict=True):
        if stream.size != streams[0].size:
            raise ValueError(
                f"{parameter} must be channels of one length, got {streams[0].size} samples in {names[0]!r} and "
                f"{stream.size} in {name!r}"
            )
    return np.stack(streams)
