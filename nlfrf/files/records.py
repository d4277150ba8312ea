"""Records to and from files."""

from __future__ import annotations

import os
from collections.abc import Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.files.channels import read_channels
from nlfrf.records.record import Record, record_from_samples
from nlfrf.shared.arguments import integer, positive
from nlfrf.shared.values import field_names
from nlfrf.shared.whole_files import VERSION, save_mat, write_arrays, write_whole
from nlfrf.shared.wording import shown

__all__ = ["RECORD_SCHEMA", "load_record", "save_record"]


RECORD_SCHEMA = "nlfrf-record"


def load_record(
    path: str | os.PathLike[str],
    *,
    u: str = "u",
    y: str | Sequence[str] = "y",
    r: str | None = None,
    fs: float | None = None,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    n_discard: int = 0,
    resample: bool = False,
) -> Any:
    """Read a record from a measurement file.

    Parameters
    ----------
    path : path
        ``.mat`` (MATLAB v5 or v7.3, dSPACE ControlDesk recordings included), ``.csv`` with a header line and comma,
        semicolon or tab (then with decimal commas too), ``.npz``, ``.h5``.
    u, y, r : str
        Names of the input, output and reference: variables, columns or channels, ``struct.field`` inside
        structs. A list of names for `y` gives a list of records that share the input.
    fs : float, optional
        Sampling frequency [Hz]; from a variable ``fs`` or a time channel of the file (in seconds, or in
        the unit its name has in brackets) when not given.
    n_samples : int, optional
        Samples in one period; found from the input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from the input when not given.
    n_discard : int
        Periods to leave out at the start.
    resample : bool
        Cut the periods where the input shows that they stand; see `record_from_samples`.

    Returns
    -------
    Record, or a list of them for a list of y

    Raises
    ------
    ValueError
        A file that cannot be read as what its name says, names that are not in it (the message lists those that
        are), signals that do not make a record.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import nlfrf
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> nlfrf.save_record(Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines), f"{folder.name}/run.mat")
    >>> record = load_record(f"{folder.name}/run.mat", u="u", y="y")
    >>> bool(np.array_equal(record.u, ms.u[None]))
    True
    >>> folder.cleanup()
    """
    if not isinstance(y, str):
        if not y:
            raise ValueError("y must name at least one output, got none")
        common: dict[str, Any] = {"u": u, "r": r, "fs": fs, "n_samples": n_samples, "lines": lines}
        first, *others = [load_record(path, y=one, n_discard=n_discard, resample=resample, **common) for one in y]
        # the very same input, so that what is known of it need not be found again
        return [first, *(replace(other, u=first.u, r=first.r, lines=first.lines) for other in others)]
    channels = read_channels(path)
    names = {"u": u, "y": y} | ({} if r is None else {"r": r})
    signals = {parameter: channels.signal(parameter, name) for parameter, name in names.items()}
    fs = positive("fs", channels.sampling_frequency() if fs is None else fs)
    if channels.text("schema") == RECORD_SCHEMA:
        record = stored_record(channels.arrays, signals, fs=fs, lines=lines, n_discard=n_discard)
        if n_samples not in (None, record.n_samples):
            raise ValueError(f"n_samples must be that of the record, {record.n_samples}, got {shown(n_samples)}")
        return record
    return record_from_samples(
        **signals, fs=fs, n_samples=n_samples, lines=lines, n_discard=n_discard, resample=resample
    )


def stored_record(
    arrays: Mapping[str, np.ndarray],
    signals: Mapping[str, np.ndarray],
    *,
    fs: float,
    lines: LineGrid | None,
    n_discard: int,
) -> Record:
    """A record as `save_record` wrote it, already cut into periods, with its grid."""
    try:
        shape = tuple(int(n) for n in np.ravel(arrays["shape"]))
        grid = LineGrid(**{name: np.ravel(arrays[name]) for name in field_names(LineGrid)})
        periods = {name: signal.reshape(shape) for name, signal in signals.items()}
    except KeyError as missing:
        raise ValueError(f"path must hold a whole record, got one without {missing}") from None
    n_discard = integer("n_discard", n_discard, least=0)
    if n_discard >= shape[1]:
        raise ValueError(f"n_discard must be less than the {shape[1]} periods of the record, got {n_discard}")
    return Record(
        **{name: signal[:, n_discard:] for name, signal in periods.items()},
        fs=fs,
        lines=grid if lines is None else lines,
    )


def save_record(record: Record, path: str | os.PathLike[str]) -> None:
    """Write a record: ``.npz``, ``.mat`` and ``.h5`` hold all of it, ``.csv`` the samples of one realisation.

    Parameters
    ----------
    record : Record
        What was measured or simulated.
    path : path
        File to write; its suffix says the format. Written whole or not at all.

    Raises
    ------
    ValueError
        A suffix that is none of these; several realisations for a CSV file.

    Examples
    --------
    >>> import nlfrf
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> ms = nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> save_record(Record(u=ms.u[None], y=2 * ms.u[None], fs=100, lines=ms.lines), f"{folder.name}/run.csv")
    >>> Path(folder.name, "run.csv").read_text().splitlines()[0]
    't [s],u,y'
    >>> folder.cleanup()
    """
    path = Path(path)
    content = {
        "schema": np.array(RECORD_SCHEMA),
        "version": np.array(VERSION),
        "shape": np.array(record.u.shape),  # MATLAB drops axes of length one
        "u": record.u,
        "y": record.y,
        "fs": np.array(record.fs),
        "excited": record.lines.excited,
        "odd": record.lines.odd,
        "even": record.lines.even,
    }
    if record.r is not None:
        content["r"] = record.r
    suffix = path.suffix.lower()
    if suffix == ".mat":
        save_mat(path, content)
    elif suffix == ".csv":
        write_whole(path, lambda target: save_csv(target, record))
    elif suffix in (".npz", ".h5", ".hdf5"):
        write_arrays(path, content)
    else:
        raise ValueError(f"path must end in .npz, .mat, .h5 or .csv, got {path.name!r}")


def save_csv(target: Path, record: Record) -> None:
    """Write the samples of a single realisation as columns t [s], u, y and r."""
    if record.n_realizations != 1:
        raise ValueError(f"record must hold one realisation for a .csv file, got {record.n_realizations}; use .npz")
    columns = {"u": record.u, "y": record.y} | ({} if record.r is None else {"r": record.r})
    samples = {name: signal.reshape(-1) for name, signal in columns.items()}
    t = np.arange(samples["u"].size) / record.fs
    table = np.column_stack([t, *samples.values()])
    np.savetxt(target, table, delimiter=",", header="t [s]," + ",".join(samples), comments="", fmt="%.17g")
