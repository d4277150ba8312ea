"""Multisines and results to and from files."""

from __future__ import annotations

import os
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.excitation.lines import LineGrid
from nlfrf.excitation.multisine import Multisine
from nlfrf.files.channels import read_channels
from nlfrf.files.records import RECORD_SCHEMA, load_record
from nlfrf.identification.bla import Bla, DistortionLevels
from nlfrf.records.record import Record
from nlfrf.shared.arguments import integer
from nlfrf.shared.values import field_names
from nlfrf.shared.whole_files import VERSION, save_mat, write_arrays, write_whole

__all__ = ["export_csv", "load", "load_bla", "load_multisine", "save_bla", "save_multisine"]


BLA_SCHEMA, MULTISINE_SCHEMA = "nlfrf-bla", "nlfrf-multisine"
PARTS: dict[str, Any] = {"lines": LineGrid, "levels": DistortionLevels}  # values inside a Bla


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
        Another suffix; a sampling frequency that is not a whole number for a WAV file, which can hold no other.

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> from nlfrf.excitation.multisine import multisine
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

        rate = integer("fs of a .wav file", ms.fs, least=1)
        samples = (u.T / np.abs(u).max()).astype(np.float32)
        write_whole(path, lambda target: wavfile.write(target, rate, samples))
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
                if name in content or name in PARTS or not hasattr(kind, name)  # a newer field has a default
            }
        )
    except KeyError as missing:
        raise ValueError(f"path must hold a whole {schema}, got {str(path)!r} without {missing}") from None


def plain(array: np.ndarray) -> Any:
    """A number or a text from an array without axes, any other array as it is."""
    return array.item() if array.ndim == 0 else array
