"""Results to and from files, and whatever else this package wrote."""

from __future__ import annotations

import itertools
import os

import numpy as np

from nlfrf._base.arguments import of_kind, one_of
from nlfrf._base.files import DECIMALS, path_of, write_table
from nlfrf.bla.bla import Bla
from nlfrf.bla.mimo.frm import Frm
from nlfrf.io.channels import Channels, read_channels
from nlfrf.io.designs import DESIGNS
from nlfrf.io.stored_records import (
    MULTIRECORD_SCHEMA,
    RECORD_SCHEMA,
    Asked,
    stored_multirecord,
    stored_records,
)
from nlfrf.io.stored_values import load_value, save_value, value_of
from nlfrf.records.record import Record
from nlfrf.records.several import MultiRecord
from nlfrf.signals.multisine import Multisine
from nlfrf.signals.orthogonal import OrthogonalMultisine

__all__ = ["export_csv", "load", "load_bla", "load_frm", "loaded", "save_bla", "save_frm"]


BLA_SCHEMA, FRM_SCHEMA = "nlfrf-bla", "nlfrf-frm"
RESULTS = {BLA_SCHEMA: Bla, FRM_SCHEMA: Frm}
Kept = Multisine | OrthogonalMultisine | Record | MultiRecord | Bla | Frm


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
    >>> bool(np.array_equal(nlfrf.load_bla(f"{folder.name}/bla.npz").G, bla.G))
    True
    >>> folder.cleanup()
    """
    of_kind("bla", bla, Bla)
    save_value(bla, BLA_SCHEMA, path)


def save_frm(frm: Frm, path: str | os.PathLike[str]) -> None:
    """Write an `Frm` to an ``.npz`` or ``.h5`` file, exactly.

    Parameters
    ----------
    frm : Frm
        What was identified.
    path : path
        File to write, ``.npz`` or ``.h5``. Written whole or not at all.

    Raises
    ------
    ValueError
        Another suffix.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> ms = nlfrf.multisine(fs=256, n_samples=256, f_min=1, f_max=100, n_inputs=2, rng=1)
    >>> u = np.repeat(ms.u[:, :, None], 2, axis=2)
    >>> frm = nlfrf.identify(nlfrf.MultiRecord(u=u, y=u[::-1] + 0.1 * u**3, fs=256, lines=ms.lines))
    >>> folder = tempfile.TemporaryDirectory()
    >>> save_frm(frm, f"{folder.name}/G.npz")
    >>> bool(np.array_equal(nlfrf.load_frm(f"{folder.name}/G.npz").bound(), frm.bound()))
    True
    >>> folder.cleanup()
    """
    of_kind("frm", frm, Frm)
    save_value(frm, FRM_SCHEMA, path)


def export_csv(bla: Bla | Frm, path: str | os.PathLike[str], *, confidence: float = 0.95, decimal: str = ".") -> None:
    """Write a `Bla` or `Frm` as a table, one excited line a row, for spreadsheets and other programs.

    Columns: f [Hz], Re G, Im G, bound (of the BLA), bound_realization, std_noise, std_total, std_distortion, std_even,
    dof, grid_factor; standard deviations in the unit of G. Of an Frm, for every entry: Re, Im and bound, behind each
    "output/input".

    Parameters
    ----------
    bla : Bla or Frm
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
    of_kind("bla", bla, Bla, Frm)
    one_of("decimal", decimal, DECIMALS)
    columns = matrix_columns(bla, confidence) if isinstance(bla, Frm) else single_columns(bla, confidence)
    write_table(path_of(path), np.column_stack(list(columns.values())), list(columns), decimal=decimal)


def matrix_columns(frm: Frm, confidence: float) -> dict[str, np.ndarray]:
    """The table of a matrix, entry by entry."""
    columns, bound = {"f [Hz]": frm.f}, frm.bound(confidence)
    for (j, y), (i, u) in itertools.product(enumerate(frm.outputs), enumerate(frm.inputs)):
        entry, name = frm.G[j, i], f"{y}/{u}".replace(",", ";")
        columns |= {f"Re {name}": entry.real, f"Im {name}": entry.imag, f"bound {name}": bound[j, i]}
    return columns


def single_columns(bla: Bla, confidence: float) -> dict[str, np.ndarray]:
    """The table of one input and output."""
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
    bla: Bla = load_value({BLA_SCHEMA: Bla}, path)
    return bla


def load_frm(path: str | os.PathLike[str]) -> Frm:
    """Read what `save_frm` wrote.

    Parameters
    ----------
    path : path
        A file that `save_frm` wrote.

    Returns
    -------
    Frm

    Raises
    ------
    ValueError
        A file that is not a whole matrix of a version this package reads.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load_frm("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, ... got 'README.md'; arrays of any origin go to ...
    """
    frm: Frm = load_value({FRM_SCHEMA: Frm}, path)
    return frm


def load(path: str | os.PathLike[str]) -> Kept:
    """Read whatever this package wrote: a multisine, a record, a BLA or a matrix, of one input or of several.

    Parameters
    ----------
    path : path
        A file of `save_multisine`, `save_record`, `save_bla` or `save_frm`.

    Returns
    -------
    Multisine, OrthogonalMultisine, Record, MultiRecord, Bla or Frm

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
    return loaded(read_channels(path))


def loaded(file: Channels) -> Kept:
    """The same of a file that was read."""
    schema = file.text("schema")
    if schema == RECORD_SCHEMA:
        return stored_records([file], {"u": "u"}, ["y"], None, Asked())[0]
    if schema == MULTIRECORD_SCHEMA:
        return stored_multirecord([file], None, None, None, Asked())
    if schema not in RESULTS | DESIGNS:
        raise ValueError(f"path must be a multisine, record, BLA or FRM that this package wrote, got {file.path!r}")
    content: Kept = value_of(RESULTS | DESIGNS, file)
    return content
