"""Records of several inputs or outputs from files."""

from __future__ import annotations

import os
from collections.abc import Sequence
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.files.channels import Channels, paths_of, read_channels
from nlfrf.records.record import SAME_CLOCK
from nlfrf.records.several import MultiRecord, multirecord_from_samples

__all__ = ["load_multirecord"]


def load_multirecord(
    path: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    *,
    u: Sequence[str],
    y: Sequence[str],
    r: Sequence[str] = (),
    fs: float | None = None,
    n_samples: int | None = None,
    lines: LineGrid | None = None,
    n_discard: int = 0,
    hold: str = "unknown",
) -> MultiRecord:
    """Read a record of several inputs or outputs from measurement files, one file an experiment.

    Parameters
    ----------
    path : path, or a list of them
        Any file that `load_record` reads.
    u, y, r : sequence of str
        Names of the inputs, the outputs and, in closed loop, the references.
    fs : float, optional
        Sampling frequency [Hz]; from the file when not given.
    n_samples : int, optional
        Samples in one period; found from the first input when not given.
    lines : LineGrid, optional
        Excited and detection lines; found from the inputs when not given.
    n_discard : int
        Periods to leave out at the start.
    hold : str
        How all inputs run between their samples: "zoh" where they are commands of converters, "band-limited" where
        they were measured behind the hold.

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
    if isinstance(u, str) or isinstance(y, str) or isinstance(r, str) or not (u and y):
        raise ValueError(
            f"u, y and r must be lists of names, at least one input and one output, got {u!r}, {y!r}, {r!r}"
        )
    files = [read_channels(one) for one in paths_of(path)]
    signals: dict[str, Any] = {
        parameter: [together(parameter, names, file) for file in files]
        for parameter, names in (("u", u), ("y", y), ("r", r))
        if names
    }
    clocks = [file.sampling_frequency(fs, (*u, *y, *r)) for file in files]
    if max(clocks) > min(clocks) * (1 + SAME_CLOCK):
        raise ValueError(f"path must be files of one sampling frequency, got {min(clocks):g} to {max(clocks):g} Hz")

    return multirecord_from_samples(
        **signals,
        fs=clocks[0],
        n_samples=n_samples,
        lines=lines,
        n_discard=n_discard,
        inputs=tuple(u),
        outputs=tuple(y),
        hold=hold,
    )


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
