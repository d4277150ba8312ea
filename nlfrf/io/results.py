"""Save all objects of these packages to files, and load them."""

from __future__ import annotations

import itertools
import os
from collections.abc import Callable
from importlib import import_module
from typing import Any

import numpy as np

from nlfrf._base.arguments import require_choice, require_kind
from nlfrf._base.files import DECIMALS, FILE_KINDS, describe_wrong_file, to_path, write_table
from nlfrf.bla.bla import Bla
from nlfrf.io.channels import Channels
from nlfrf.io.designs import DESIGNS, save_experiment, save_multisine
from nlfrf.io.measurement_files import read_channels
from nlfrf.io.stored_records import (
    MULTIRECORD_SCHEMA,
    RECORD_SCHEMA,
    save_record,
    stored_multirecord,
    stored_records,
)
from nlfrf.io.stored_values import save_value, value_from_file
from nlfrf.records.periods import Cutting
from nlfrf.records.record import Record
from nlfrf.signals.axis_experiment import AxisExperiment
from nlfrf.signals.multisine import Multisine

_BLA_SCHEMA, _FRM_SCHEMA = "nlfrf-bla", "nlfrf-frm"  # for one input and output, for several
_RESULTS: dict[str, Callable[..., Bla]] = {_BLA_SCHEMA: Bla, _FRM_SCHEMA: Bla}
StoredValue = Multisine | AxisExperiment | Record | Bla
#: Module that reads and writes the JSON files of `robust`. It is not imported, because `robust`
#: imports this package.
_JSON_FILES = "robust.io.stored"
_PID_FILES = "robust.synthesis.pid_file"


def export_csv(
    bla: Bla, path: str | os.PathLike[str], *, confidence: float = 0.95, decimal: str = "."
) -> None:
    """Write a `Bla` as a CSV table, one row per excited line.

    The columns are f [Hz], Re G, Im G, bound (of the BLA), bound_realization, std_noise, std_total,
    std_distortion, std_even, dof and grid_factor, which the fields and methods of `Bla` explain.
    Standard deviations are in the unit of G. For several channels each entry of G has columns Re,
    Im and bound, named by "output/input". Each warning is a row "# warning: ..." above the table.

    Parameters
    ----------
    bla : Bla
        Result of `identify`.
    path : path
        File to write. After an error no partial file is left.
    confidence : float
        Probability of the two bounds.
    decimal : str
        Decimal mark: "." with commas between the columns, or "," with semicolons.

    Raises
    ------
    ValueError
        The confidence is not between 0 and 1.
    FileNotFoundError
        The folder does not exist.

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
    if not bla.is_single:
        columns = _frm_table(bla, confidence)
    else:
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
    write_table(
        to_path(path),
        np.column_stack(list(columns.values())),
        list(columns),
        decimal=decimal,
        comments=[f"warning: {text}" for text in bla.warnings],
    )


def _frm_table(frm: Bla, confidence: float) -> dict[str, np.ndarray]:
    """Return the columns of a matrix, entry by entry."""
    columns, bound = {"f [Hz]": frm.f}, frm.bound(confidence)
    for (j, y), (i, u) in itertools.product(enumerate(frm.outputs), enumerate(frm.inputs)):
        entry, name = frm.G[j, i], f"{y}/{u}".replace(",", ";")
        columns |= {
            f"Re {name}": entry.real,
            f"Im {name}": entry.imag,
            f"bound {name}": bound[j, i],
        }
    return columns


def save(
    thing: object,
    path: str | os.PathLike[str],
    *,
    decimal: str = ".",
    delay: float | None = None,
    unit: str = "",
) -> None:
    """Write an object of these packages to a file that `load` reads.

    An existing file is replaced. After an error no partial file is left.

    Parameters
    ----------
    thing : Multisine, Record, Bla, UncertaintyModel, controller, RobustnessReport, ...
        Object to write. The kind of object decides which suffixes are possible:

        - a multisine: ``.npz`` and ``.h5`` contain the exact design and its samples u of shape
          (M, N), or (n_u, M, N) for several inputs. ``.csv``, ``.mat`` and ``.wav`` contain the
          signal for a generator, one column or channel per realisation or input. The design is then
          written to an ``.npz`` file with the same name. A WAV file is scaled to a peak of 1.
        - an experiment on a drive: ``.npz`` and ``.h5`` contain the design. ``.csv`` contains the
          set points to play, one file per realisation, and the design is written to an ``.npz``
          file.
        - a record: ``.npz``, ``.mat`` and ``.h5`` contain the whole record, ``.csv`` the samples of
          one experiment.
        - a BLA: ``.npz`` or ``.h5``.
        - an uncertainty model, or a controller for negative feedback (state space, transfer
          function, number or matrix): ``.json``, exact to the bit.
        - a result of `robust.check` or `robust.prove_friction`: ``.json``. The file is a
          certificate: it contains plant, controller, delay, weights and claim, and a checksum of
          them.
    path : path
        File to write.
    decimal : str
        Decimal mark in a ``.csv``: "." with commas between the columns, or "," with semicolons.
    delay : float, optional
        For a controller: computation delay [s] assumed in its design. The command `robust check`
        uses it; without it the command assumes zero, with a warning if the controller is sampled.
    unit : str
        For a controller: unit of its plant, y over u. Commands refuse the controller for a plant
        with another unit.

    Raises
    ------
    ValueError
        The object is of another kind; the suffix does not fit the object; a record with several
        experiments is to be written as ``.csv``; the sampling frequency is not a whole number for
        ``.wav``; or a report contains no proof.
    FileNotFoundError
        The folder does not exist.

    Warns
    -----
    DataWarning
        Second-order sections would differ from a sampled controller by more than 0.1 %, so only A,
        B, C and D are written.

    Examples
    --------
    >>> import nlfrf, tempfile
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> folder = tempfile.TemporaryDirectory()
    >>> save(ms, f"{folder.name}/ms.csv")  # to play, with the design in ms.npz
    >>> bool(np.array_equal(load(f"{folder.name}/ms.npz").phase, ms.phase))
    True
    >>> folder.cleanup()
    """
    require_choice("decimal", decimal, DECIMALS)
    if (delay is not None or unit) and isinstance(thing, StoredValue):
        raise ValueError(
            f"delay and unit must be left out for anything but a controller, got {delay!r} and"
            f" {unit!r}"
        )
    match thing:
        case Bla():
            save_value(thing, _BLA_SCHEMA if thing.is_single else _FRM_SCHEMA, path)
        case Record():
            save_record(thing, path, decimal=decimal)
        case AxisExperiment():
            save_experiment(thing, path, decimal=decimal)
        case Multisine():
            save_multisine(thing, path, decimal=decimal)
        case _:
            import_module(_JSON_FILES).save_json(thing, path, delay=delay, unit=unit)


def load(path: str | os.PathLike[str]) -> Any:
    """Read a file that `save` or a command of these packages wrote.

    Use `load_record` or `nlfrf.io.load_frf` for files of other programs.

    Parameters
    ----------
    path : path
        File that `save` wrote, or a ``.toml`` file with a PID and its notches, as for `robust
        check`. For a multisine saved as ``.csv``, ``.mat`` or ``.wav``, or for set points saved as
        ``.csv``, give the ``.npz`` file that `save` wrote with it.

    Returns
    -------
    Multisine, AxisExperiment, Record, Bla, UncertaintyModel or control.StateSpace
        The saved object; a controller as a state space. For a certificate it is the claim (what is
        to be proved). `robust.io.verify_certificate` proves this claim.

    Raises
    ------
    ValueError
        The file is of another kind, is incomplete, or has an unknown version.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> load("README.md")
    Traceback (most recent call last):
        ...
    ValueError: path must end in .mat, .npz, .csv, ... got 'README.md'; arrays of any origin go to ...
    """
    suffix = to_path(path).suffix.lower()
    if suffix == ".json":
        return import_module(_JSON_FILES).load_json(path)
    if suffix == ".toml":
        return import_module(_PID_FILES).load_pid(path).K
    return load_own(path)


def load_own(path: str | os.PathLike[str]) -> StoredValue:
    """Read an object that `nlfrf` wrote, for commands that take nothing else."""
    return value_in(read_channels(path))


def value_in(file: Channels) -> StoredValue:
    """Return the record, result or design in the channels of a file of this package."""
    schema = file.text("schema")
    if schema == RECORD_SCHEMA:
        return stored_records([file], {"u": "u"}, ["y"], None, Cutting())[0]
    if schema == MULTIRECORD_SCHEMA:
        return stored_multirecord([file], None, y=None, fs=None, options=Cutting())
    if schema not in _RESULTS | DESIGNS:
        design = to_path(file.path).with_suffix(".npz")
        if not schema and design.is_file():
            played = f"; the design of a played signal may be in {design.name}"
        else:
            played = ""
        raise ValueError(describe_wrong_file(file.path, schema or None, *FILE_KINDS) + played)
    kinds: dict[str, Callable[..., StoredValue]] = {**_RESULTS, **DESIGNS}
    return value_from_file(kinds, file)
