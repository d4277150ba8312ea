"""Records in the format of this package, for one input and output or for several, written and
read.
"""

from __future__ import annotations

import json
import os
from collections.abc import Mapping, Sequence
from dataclasses import replace

import numpy as np

from nlfrf._base.arguments import require_integer, short_form
from nlfrf._base.files import (
    SIMULATED_MARK,
    VERSION,
    is_command,
    save_mat,
    to_path,
    write_arrays,
    write_table,
)
from nlfrf._base.values import ArrayField, field_names
from nlfrf.io.channels import Channels
from nlfrf.io.stored_values import AXES_ORDER, names_from_json, require_known_version
from nlfrf.records.periods import Cutting
from nlfrf.records.record import Record, join_records
from nlfrf.records.reference import fill_reference, reconstruct_references
from nlfrf.signals.lines import LineGrid

RECORD_SCHEMA = "nlfrf-record"
MULTIRECORD_SCHEMA = "nlfrf-multirecord"
_LABELS = ("u_name", "y_name", "u_unit", "y_unit")
_CHANNELS = ("inputs", "outputs")
_UNITS = ("input_units", "output_units")
_SEVERAL_AXES = f"channel {AXES_ORDER}"


def save_record(record: Record, path: str | os.PathLike[str], *, decimal: str = ".") -> None:
    """Write a record: ``.npz``, ``.mat`` and ``.h5`` contain all of it, ``.csv`` the samples of one
    experiment.
    """
    path = to_path(path)
    suffix = path.suffix.lower()
    if suffix == ".csv":
        write_table(path, *_record_to_columns(record), decimal=decimal)
    elif suffix == ".mat":
        save_mat(path, _record_to_arrays(record))
    elif suffix in (".npz", ".h5", ".hdf5"):
        write_arrays(path, _record_to_arrays(record))
    else:
        raise ValueError(f"path must end in .npz, .mat, .h5 or .csv, got {path.name!r}")


def _record_to_arrays(record: Record) -> dict[str, np.ndarray]:
    """Return a record as the named arrays of a file: signals, lines and labels, with schema,
    version and axes.
    """
    several = not record.is_single
    content = {
        "schema": np.array(MULTIRECORD_SCHEMA if several else RECORD_SCHEMA),
        "version": np.array(VERSION),
        "axes": np.array(_SEVERAL_AXES if several else AXES_ORDER),
        "shape": np.array(record.u.shape),  # MATLAB drops axes of length one
        "u": record.u,
        "y": record.y,
        "fs": np.array(record.fs),
        "hold": np.array(record.hold),
        **{name: getattr(record.lines, name) for name in field_names(LineGrid)},
    }
    if several:
        content |= {
            name: np.array(json.dumps(getattr(record, name))) for name in (*_CHANNELS, *_UNITS)
        }
    else:
        content |= {name: np.array(getattr(record, name)) for name in _LABELS}
    if record.warnings:
        content["warnings"] = np.array(json.dumps(record.warnings))
    # `nlfrf simulate`: no other command writes records, and a measured one must never have this
    # mark
    if is_command():
        content[SIMULATED_MARK] = np.array(True)
    if record.r is None:
        return content
    return {**content, "r": record.r}


def _record_to_columns(record: Record) -> tuple[np.ndarray, list[str]]:
    """Return the samples of a single experiment as columns, time [s] in front, and their names."""
    if record.n_experiments != 1:
        raise ValueError(
            f"record must hold one experiment for a .csv file, got {record.n_experiments}; use .npz"
        )
    signals = {"u": record.u, "y": record.y} | ({} if record.r is None else {"r": record.r})
    samples = {
        name: signal.reshape(-1, record.n_periods * record.n_samples)
        for name, signal in signals.items()
    }
    names = list(samples)
    if not record.is_single:
        names = [
            *record.inputs,
            *record.outputs,
            *(f"r {name}" for name in record.inputs if "r" in samples),
        ]
    t = np.arange(record.n_periods * record.n_samples) / record.fs
    return np.column_stack([t, *(row for signal in samples.values() for row in signal)]), [
        "t [s]",
        *names,
    ]


def stored_records(
    files: list[Channels],
    names: Mapping[str, str],
    outputs: list[str],
    fs: float | None,
    options: Cutting,
) -> list[Record]:
    """Return a record for each output, from files that `save_record` wrote."""
    records: list[Record] = []
    for output in outputs:
        runs = [
            _stored_record(file, {**names, "y": output}, fs=fs, options=options) for file in files
        ]
        if len(runs) == 1:
            record = runs[0]
        else:
            record = join_records(runs)
        if records:  # the same input object, so that its analysis is not repeated
            record = replace(record, u=records[0].u, r=records[0].r, lines=records[0].lines)
        records.append(record)
    return records


def _stored_record(
    file: Channels, names: Mapping[str, str], *, fs: float | None, options: Cutting
) -> Record:
    """Return a record as `save_record` wrote it, already cut into periods, with its grid."""
    if "r" in file.arrays:  # a closed loop needs it
        names = {"r": "r", **names}
    known = {
        file.text("u_name"): "u",
        file.text("y_name"): "y",
        "u": "u",
        "y": "y",
    }  # or by their own names
    signals = {
        parameter: file.signal(parameter, known.get(name, name))
        for parameter, name in names.items()
    }
    require_known_version(file, RECORD_SCHEMA, AXES_ORDER)
    periods, (lines, hold, warned) = _stored_periods(file, signals, options)
    if options.design is not None:
        periods.setdefault("r", reconstruct_references(options.design, periods["u"]))
    return Record(
        **{name: signal[0] for name, signal in periods.items()},
        lines=lines,
        hold=hold,
        warnings=warned,
        fs=file.sampling_frequency(fs),
        u_name=file.text("u_name"),
        y_name=file.text("y_name"),
        u_unit=file.text("u_unit"),
        y_unit=file.text("y_unit"),
    )


def stored_multirecord(
    files: list[Channels],
    u: Sequence[str] | None,
    *,
    y: Sequence[str] | None,
    fs: float | None,
    options: Cutting,
) -> Record:
    """Return a record with several inputs that `save_record` wrote; several files give the
    experiments of all.
    """
    return join_records(
        [_stored_experiments(file, u, y=y, fs=fs, options=options) for file in files]
    )


def _stored_experiments(
    file: Channels,
    u: Sequence[str] | None,
    *,
    y: Sequence[str] | None,
    fs: float | None,
    options: Cutting,
) -> Record:
    """Return the record of several experiments in a file of this package, with the wanted
    outputs.
    """
    require_known_version(file, MULTIRECORD_SCHEMA, _SEVERAL_AXES)
    if missing := [name for name in ("u", "y", *_CHANNELS) if name not in file.arrays]:
        raise ValueError(f"path must hold a whole record, got one without {', '.join(missing)}")
    inputs, outputs = (names_from_json(name, file.arrays[name]) for name in _CHANNELS)
    if u is not None and tuple(u) != inputs:
        raise ValueError(
            f"u must be all inputs of the record, {', '.join(inputs)}, got {short_form(list(u))}"
        )
    for name in y or ():
        if name not in outputs:
            raise ValueError(
                f"y must be outputs of the record, {', '.join(outputs)}, got {short_form(name)}"
            )
    signals = {name: file.signal(name, name) for name in ("u", "y", "r") if name in file.arrays}
    found, (lines, hold, warned) = _stored_periods(file, signals, options)
    units = {
        name: names_from_json(name, file.arrays[name]) for name in _UNITS if name in file.arrays
    }
    if y is not None:
        chosen = [outputs.index(name) for name in y]
        found["y"], outputs = found["y"][chosen], tuple(y)
        if "output_units" in units:
            units["output_units"] = tuple(units["output_units"][j] for j in chosen)
    fill_reference(found, options.design)
    return Record(
        **found,
        lines=lines,
        hold=hold,
        warnings=warned,
        fs=file.sampling_frequency(fs),
        inputs=inputs,
        outputs=outputs,
        input_units=units.get("input_units", ()),
        output_units=units.get("output_units", ()),
    )


def _stored_periods(
    file: Channels, signals: Mapping[str, np.ndarray], options: Cutting
) -> tuple[dict[str, ArrayField], tuple[LineGrid, str, tuple[str, ...]]]:
    """Return signals (channels, M, P, N) as cut, and lines, hold and warnings; `options` take
    precedence.
    """
    arrays = file.arrays
    try:
        shape = tuple(int(n) for n in np.ravel(arrays["shape"]))[-3:]
        grid = LineGrid(**{name: np.ravel(arrays[name]) for name in field_names(LineGrid)})
        periods = {name: signal.reshape(-1, *shape) for name, signal in signals.items()}
    except KeyError as missing:
        raise ValueError(f"path must hold a whole record, got one without {missing}") from None
    if options.resample:
        raise ValueError(
            "resample must be left out for a record that is cut into periods already, got"
            f" {file.path!r}"
        )
    if options.n_samples not in (None, shape[2]):
        raise ValueError(
            f"n_samples must be that of the record, {shape[2]}, got {short_form(options.n_samples)}"
        )
    n_discard = require_integer("n_discard", options.n_discard, least=0)
    if n_discard >= shape[1]:
        raise ValueError(
            f"n_discard must be less than the {shape[1]} periods of the record, got {n_discard}"
        )
    design, hold = options.design, file.text("hold") or "unknown"
    if design is not None:
        grid, hold = design.lines, design.hold if hold == "unknown" else hold
    kept = {name: signal[:, :, n_discard:] for name, signal in periods.items()}
    if "warnings" in arrays:
        warned = names_from_json("warnings", arrays["warnings"])
    else:
        warned = ()
    lines = grid if options.lines is None else options.lines
    return kept, (lines, options.hold or hold, warned)
