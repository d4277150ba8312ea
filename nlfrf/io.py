"""Records and results to and from files. Nothing else in this package touches files.

A file is written whole or not at all. Pickles are never read.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.bla import Bla
from nlfrf.channels import read_channels
from nlfrf.checks import integer, positive
from nlfrf.distortion import DistortionLevels
from nlfrf.lines import LineGrid
from nlfrf.multisine import Multisine
from nlfrf.record import Record, record_from_samples
from nlfrf.values import field_names

RECORD_SCHEMA, BLA_SCHEMA, MULTISINE_SCHEMA = "nlfrf-record", "nlfrf-bla", "nlfrf-multisine"
VERSION = 1
PARTS: dict[str, Any] = {"lines": LineGrid, "levels": DistortionLevels}  # values inside a Bla


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
        ``.mat`` (MATLAB v5 or v7.3, dSPACE ControlDesk recordings included), ``.csv`` with a header line, ``.npz``,
        ``.h5``.
    u, y, r : str
        Names of the input, output and reference: variables, columns or channels, ``struct.field`` inside
        structs. A list of names for `y` gives a list of records that share the input.
    fs : float, optional
        Sampling frequency [Hz]; from a variable ``fs`` or a time channel of the file when not given.
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
        common: dict[str, Any] = {"u": u, "r": r, "fs": fs, "n_samples": n_samples, "lines": lines}
        first, *others = [load_record(path, y=one, n_discard=n_discard, resample=resample, **common) for one in y]
        # the very same input, so that what is known of it need not be found again
        return [first, *(replace(other, u=first.u, r=first.r, lines=first.lines) for other in others)]
    channels = read_channels(path)
    names = {"u": u, "y": y} | ({} if r is None else {"r": r})
    signals = {parameter: channels.signal(parameter, name) for parameter, name in names.items()}
    fs = positive("fs", channels.sampling_frequency() if fs is None else fs)
    if channels.text("schema") == RECORD_SCHEMA:
        return stored_record(channels.arrays, signals, fs=fs, lines=lines, n_discard=n_discard)
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


def save_csv(target: Path, record: Record) -> None:
    """Write the samples of a single realisation as columns t [s], u, y and r."""
    if record.n_realizations != 1:
        raise ValueError(f"record must hold one realisation for a .csv file, got {record.n_realizations}; use .npz")
    columns = {"u": record.u, "y": record.y} | ({} if record.r is None else {"r": record.r})
    samples = {name: signal.reshape(-1) for name, signal in columns.items()}
    t = np.arange(samples["u"].size) / record.fs
    table = np.column_stack([t, *samples.values()])
    np.savetxt(target, table, delimiter=",", header="t [s]," + ",".join(samples), comments="", fmt="%.17g")


def save_bla(bla: Bla, path: str | os.PathLike[str]) -> None:
    """Write a `Bla` to an ``.npz`` or ``.h5`` file, exactly.

    Parameters
    ----------
    bla : Bla
        What was identified.
    path : path
        File to write, ``.npz`` or ``.h5``. Written whole or not at all.

    Raises
    ------
    ValueError
        Another suffix.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> u = ms.u[None]
    >>> record = nlfrf.Record(u=u, y=2 * u + 0.1 * u**3, fs=128, lines=ms.lines)
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> bla = nlfrf.identify(record)
    >>> save_bla(bla, f"{folder.name}/bla.npz")
    >>> bool(np.array_equal(nlfrf.load_bla(f"{folder.name}/bla.npz").G, bla.G))
    True
    >>> folder.cleanup()
    """
    save_value(bla, BLA_SCHEMA, path)


def export_csv(bla: Bla, path: str | os.PathLike[str], *, confidence: float = 0.95) -> None:
    """Write a `Bla` as a table, one excited line a row, for spreadsheets and other programs.

    Columns: f [Hz], Re G, Im G, bound (of the BLA), bound_realization, std_noise, std_total, std_distortion, std_even,
    dof, grid_factor; standard deviations in the unit of G.

    Parameters
    ----------
    bla : Bla
        What was identified.
    path : path
        File to write. Written whole or not at all.
    confidence : float
        Probability of the two bounds.

    Raises
    ------
    ValueError
        A confidence that is no probability.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> u = ms.u[None]
    >>> record = nlfrf.Record(u=u, y=2 * u + 0.1 * u**3, fs=128, lines=ms.lines)
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> export_csv(nlfrf.identify(record), f"{folder.name}/bla.csv")
    >>> Path(folder.name, "bla.csv").read_text()[:36]
    'f [Hz],Re G,Im G,bound,bound_realiza'
    >>> folder.cleanup()
    """
    columns = {
        "f [Hz]": bla.f,
        "Re G": bla.G.real,
        "Im G": bla.G.imag,
        "bound": bla.bound(confidence),
        "bound_realization": bla.bound(confidence, of="realization"),
        "std_noise": np.sqrt(bla.var_noise),
        "std_total": np.sqrt(bla.var_total),
        "std_distortion": np.sqrt(bla.var_distortion),
        "std_even": np.sqrt(bla.var_even),
        "dof": bla.dof,
        "grid_factor": bla.grid_factor,
    }
    table, header = np.column_stack(list(columns.values())), ",".join(columns)
    write_whole(path, lambda target: np.savetxt(target, table, delimiter=",", header=header, comments="", fmt="%.17g"))


def load_bla(path: str | os.PathLike[str]) -> Bla:
    """Read what `save_bla` wrote.

    Parameters
    ----------
    path : path
        A file that `save_bla` wrote.

    Returns
    -------
    Bla

    Raises
    ------
    ValueError
        A file that is not a whole BLA of a version this package reads.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_bla("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, .h5, .hdf5, got 'README.md'
    """
    bla: Bla = load_value(Bla, BLA_SCHEMA, path)
    return bla


def save_multisine(ms: Multisine, path: str | os.PathLike[str]) -> None:
    """Write a design with its samples.

    ``.npz`` and ``.h5`` hold the design exactly, and the samples u (M, N) beside it. ``.csv``, ``.mat`` and ``.wav``
    hold what a signal generator plays, one column, row or channel a realisation, with the design in an ``.npz`` of the
    same name beside them; a WAV file is scaled to a peak of 1, and that peak stored with the design.

    Parameters
    ----------
    ms : Multisine
        The design.
    path : path
        File to write; its suffix says the format. Written whole or not at all.

    Raises
    ------
    ValueError
        Another suffix.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> from nlfrf.multisine import multisine
    >>> ms = multisine(fs=100, n_samples=100, f_min=1, f_max=20, rng=1)
    >>> save_multisine(ms, f"{folder.name}/ms.csv")              # and the design beside it
    >>> bool(np.array_equal(load_multisine(f"{folder.name}/ms.npz").phase, ms.phase))
    True
    >>> folder.cleanup()
    """
    path = Path(path)
    suffix, u = path.suffix.lower(), ms.u
    if suffix == ".csv":
        t = np.arange(ms.n_samples) / ms.fs
        table = np.column_stack([t, *u])
        header = ",".join(["t [s]", *(f"u{m}" for m in range(ms.n_realizations))])
        write_whole(path, lambda to: np.savetxt(to, table, delimiter=",", header=header, comments="", fmt="%.17g"))
    elif suffix == ".mat":
        save_mat(path, {"u": u, "fs": np.array(ms.fs), "f": ms.f, "amplitude": ms.amplitude, "phase": ms.phase})
    elif suffix == ".wav":
        from scipy.io import wavfile

        samples = (u.T / np.abs(u).max()).astype(np.float32)
        write_whole(path, lambda target: wavfile.write(target, round(ms.fs), samples))
    else:
        save_value(ms, MULTISINE_SCHEMA, path, u=u)
        return
    save_value(ms, MULTISINE_SCHEMA, path.with_suffix(".npz"), u=u, peak=np.array(np.abs(u).max()))


def load_multisine(path: str | os.PathLike[str]) -> Multisine:
    """Read the design that `save_multisine` wrote.

    Parameters
    ----------
    path : path
        The ``.npz`` or ``.h5`` file of the design.

    Returns
    -------
    Multisine

    Raises
    ------
    ValueError
        A file that is not a whole design of a version this package reads.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_multisine("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, .h5, .hdf5, got 'README.md'
    """
    ms: Multisine = load_value(Multisine, MULTISINE_SCHEMA, path)
    return ms


def load(path: str | os.PathLike[str]) -> Multisine | Record | Bla:
    """Read whatever this package wrote: a multisine, a record or a BLA; errors as of `load_bla`."""
    readers = {RECORD_SCHEMA: load_record, BLA_SCHEMA: load_bla, MULTISINE_SCHEMA: load_multisine}
    schema = read_channels(path).text("schema")
    if schema not in readers:
        raise ValueError(f"path must be a multisine, record or BLA that this package wrote, got {str(path)!r}")
    reader: Any = readers[schema]
    content: Multisine | Record | Bla = reader(path)
    return content


def save_value(thing: Any, schema: str, path: str | os.PathLike[str], **more: np.ndarray) -> None:
    """Write every field of a value, those of the values inside it by dotted names."""
    content: dict[str, np.ndarray] = {"schema": np.array(schema), "version": np.array(VERSION)} | more
    for name in field_names(thing):
        part = getattr(thing, name)
        if name in PARTS:
            content |= {f"{name}.{inner}": getattr(part, inner) for inner in field_names(part)}
        else:
            content[name] = np.asarray(part)
    write_arrays(Path(path), content)


def write_arrays(path: Path, content: Mapping[str, np.ndarray]) -> None:
    """Write named arrays in the format that the suffix says."""
    suffix = path.suffix.lower()
    if suffix == ".npz":
        write_whole(path, lambda target: save_arrays(target, content))
    elif suffix in (".h5", ".hdf5"):
        write_whole(path, lambda target: save_hdf5(target, content))
    else:
        raise ValueError(f"path must end in .npz or .h5, got {path.name!r}")


def load_value(kind: Any, schema: str, path: str | os.PathLike[str]) -> Any:
    """The value of one kind that `save_value` wrote."""
    channels = read_channels(path)
    found = channels.text("schema")
    if found != schema:
        raise ValueError(f"path must be a file of the schema {schema}, got {found or 'none'} in {str(path)!r}")
    content = channels.arrays
    version = int(content.get("version", np.array(0)))
    if version != VERSION:
        raise ValueError(f"path must hold schema version {VERSION} of {schema}, got {version} in {str(path)!r}")
    try:
        return kind(
            **{
                name: PARTS[name](**{inner: content[f"{name}.{inner}"] for inner in field_names(PARTS[name])})
                if name in PARTS
                else plain(content[name])
                for name in field_names(kind)
            }
        )
    except KeyError as missing:
        raise ValueError(f"path must hold a whole {schema}, got {str(path)!r} without {missing}") from None


def plain(array: np.ndarray) -> Any:
    """A number or a text from an array without axes, any other array as it is."""
    return array.item() if array.ndim == 0 else array


def write_whole(path: str | os.PathLike[str], write: Callable[[Path], None]) -> None:
    """Write a file whole or not at all: `write` fills a file beside it, which then takes its place.

    Parameters
    ----------
    path : path
        Where the file is to be.
    write : callable
        Is given the path to write to.
    """
    path = Path(path)
    if not path.parent.is_dir():
        raise FileNotFoundError(f"path must lie in an existing folder, got {str(path)!r}")
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=f".{path.stem}-", suffix=path.suffix)
    os.close(handle)
    beside = Path(name)
    try:
        write(beside)
        beside.chmod(0o666 & ~current_umask())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def in_one_line(error: Exception) -> str:
    """What went wrong, for a command line: the system's own errors name their file first."""
    if isinstance(error, OSError) and error.strerror and error.filename:
        return f"{error.filename} could not be opened: {error.strerror.lower()}"
    return str(error)


def current_umask() -> int:
    """The process's umask; mkstemp makes files that only their owner may read."""
    mask = os.umask(0)
    os.umask(mask)
    return mask
