"""Results to and from files, and whatever else this package wrote."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable

import numpy as np

from nlfrf._base.arguments import require_choice, require_kind
from nlfrf._base.files import DECIMALS, describe_wrong_file, to_path, write_table
from nlfrf.bla.bla import Bla
from nlfrf.io.channels import Channels, read_channels
from nlfrf.io.designs import DESIGNS, save_experiment, save_multisine
from nlfrf.io.stored_records import (
    MULTIRECORD_SCHEMA,
    RECORD_SCHEMA,
    save_record,
    stored_multirecord,
    stored_records,
)
from nlfrf.io.stored_values import load_value, save_value, value_from_file
from nlfrf.records.record import Record
from nlfrf.records.samples import Cutting
from nlfrf.signals.axis_experiment import AxisExperiment
from nlfrf.signals.multisine import Multisine
from nlfrf.signals.orthogonal import OrthogonalMultisine

BLA_SCHEMA, FRM_SCHEMA = "nlfrf-bla", "nlfrf-frm"  # of one input and output, of several
RESULTS: dict[str, Callable[..., Bla]] = {BLA_SCHEMA: Bla, FRM_SCHEMA: Bla}
StoredValue = Multisine | OrthogonalMultisine | AxisExperiment | Record | Bla


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
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> bla = nlfrf.identify(record)
    >>> save_bla(bla, f"{folder.name}/bla.npz")
    >>> bool(np.array_equal(nlfrf.io.load_bla(f"{folder.name}/bla.npz").G, bla.G))
    True
    >>> folder.cleanup()
    """
    require_kind("bla", bla, Bla)
    save_value(bla, BLA_SCHEMA if bla.is_single else FRM_SCHEMA, path)


def export_csv(bla: Bla, path: str | os.PathLike[str], *, confidence: float = 0.95, decimal: str = ".") -> None:
    """Write a `Bla` as a table, one excited line a row, for spreadsheets and other programs.

    Columns: f [Hz], Re G, Im G, bound (of the BLA), bound_realization, std_noise, std_total, std_distortion, std_even,
    dof, grid_factor; standard deviations in the unit of G. Of several channels, for every entry: Re, Im and bound,
    behind each "output/input".

    Parameters
    ----------
    bla : Bla
        What was identified.
    path : path
        File to write. Written whole or not at all.
    confidence : float
        Probability of the two bounds.
    decimal : str
        Mark of decimals: "." or ",", which has semicolons between the columns.

    Raises
    ------
    ValueError
        A confidence that is no probability.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> from pathlib import Path
    >>> folder = tempfile.TemporaryDirectory()
    >>> export_csv(nlfrf.identify(record), f"{folder.name}/bla.csv")
    >>> Path(folder.name, "bla.csv").read_text()[:36]
    'f [Hz],Re G,Im G,bound,bound_realiza'
    >>> folder.cleanup()
    """
    require_kind("bla", bla, Bla)
    require_choice("decimal", decimal, DECIMALS)
    columns = bla_table(bla, confidence) if bla.is_single else frm_table(bla, confidence)
    write_table(to_path(path), np.column_stack(list(columns.values())), list(columns), decimal=decimal)


def frm_table(frm: Bla, confidence: float) -> dict[str, np.ndarray]:
    """Return the table of a matrix, entry by entry."""
    columns, bound = {"f [Hz]": frm.f}, frm.bound(confidence)
    for (j, y), (i, u) in itertools.product(enumerate(frm.outputs), enumerate(frm.inputs)):
        entry, name = frm.G[j, i], f"{y}/{u}".replace(",", ";")
        columns |= {f"Re {name}": entry.real, f"Im {name}": entry.imag, f"bound {name}": bound[j, i]}
    return columns


def bla_table(bla: Bla, confidence: float) -> dict[str, np.ndarray]:
    """Return the table of one input and output."""
    return {
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
    ValueError: path must end in .mat, .npz, .csv, ... got 'README.md'; arrays of any origin go to ...
    """
    bla: Bla = load_value(RESULTS, path)
    return bla


def save(thing: StoredValue, path: str | os.PathLike[str], *, decimal: str = ".") -> None:
    """Write whatever this package makes, so that `load` reads it: a multisine, an experiment, a record or a BLA.

    Parameters
    ----------
    thing : Multisine, OrthogonalMultisine, AxisExperiment, Record or Bla
        What to write.
    path : path
        File to write; its suffix says how. All of it is kept by ``.npz`` and ``.h5``. An experiment as ``.csv`` is the
        set points to play, one file a realisation, with its design as ``.npz``.
    decimal : str
        Decimal mark of a table, "." or ",".

    Raises
    ------
    ValueError
        A thing of another kind, or a suffix that does not fit.

    Examples
    --------
    >>> save(1.0, "x.npz")
    Traceback (most recent call last):
        ...
    ValueError: thing must be of type Multisine or OrthogonalMultisine or AxisExperiment or Record or Bla, got 1.0
    """
    require_kind("thing", thing, Multisine, OrthogonalMultisine, AxisExperiment, Record, Bla)
    if isinstance(thing, Bla):
        save_bla(thing, path)
    elif isinstance(thing, Record):
        save_record(thing, path, decimal=decimal)
    elif isinstance(thing, AxisExperiment):
        save_experiment(thing, path, decimal=decimal)
    else:
        save_multisine(thing, path, decimal=decimal)


def load(path: str | os.PathLike[str]) -> StoredValue:
    """Read whatever this package wrote: a multisine, an experiment, a record, a BLA, of one input or of several.

    Parameters
    ----------
    path : path
        A file of `save_multisine`, `save_record` or `save_bla`.

    Returns
    -------
    Multisine, OrthogonalMultisine, AxisExperiment, Record or Bla

    Raises
    ------
    ValueError
        A file of another kind, one that is not whole, or of a version that this package does not read.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, ... got 'README.md'; arrays of any origin go to ...
    """
    return value_in(read_channels(path))


def value_in(file: Channels) -> StoredValue:
    """Return the record, result or design that the channels of a file of this package hold."""
    schema = file.text("schema")
    if schema == RECORD_SCHEMA:
        return stored_records([file], {"u": "u"}, ["y"], None, Cutting())[0]
    if schema == MULTIRECORD_SCHEMA:
        return stored_multirecord([file], None, y=None, fs=None, options=Cutting())
    if schema not in RESULTS | DESIGNS:
        raise ValueError(describe_wrong_file(file.path, schema or None, *DESIGNS, RECORD_SCHEMA, *RESULTS))
    kinds: dict[str, Callable[..., StoredValue]] = {**RESULTS, **DESIGNS}
    return value_from_file(kinds, file)
