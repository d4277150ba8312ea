"""One signal of a repeated trial from a file: the column by its name, on the clock of the trials."""

from __future__ import annotations

import re
from pathlib import Path

import numpy as np

from nlfrf._base.numbers import all_finite
from nlfrf._base.units import unit_factor
from nlfrf._base.values import value
from nlfrf.io.channels import Channels
from nlfrf.io.measurement_files import read_channels
from nlfrf.io.readers.clock import UNIT_SUFFIX, is_rising, is_time_name, sampling_frequency
from nlfrf.io.rows import find_rows_off
from nlfrf.io.uneven_clock import UnevenClock

#: Names of the two signals of a trial, in English and in German, without unit.
_NAMES = {
    "u": re.compile(r"u\d*|.*(input|learned|feed ?forward|added|vorsteuer|korrektur).*", re.I),
    "e": re.compile(r"e\d*|err|.*(error|fehler|abweichung|deviation).*", re.I),
}
_DECIMAL_COMMA = re.compile(r"[-+]?\d+,\d+")
_SECONDS = (1.0, 1e-3, 1e-6)  # units [s] that a time column without a stated unit may have
_MAX_RATE_ERROR = 1e-3  # largest relative difference from the sampling frequency of the trials
_MAX_SHIFT = 0.5  # [samples] by which the last row of a short trial may be off its place


@value
class _TrialSignal:
    """Samples of one signal of a trial, and where they stand."""

    samples: np.ndarray  # (n,) samples in the wanted unit
    column: str  # name of the column, with its unit
    path: str  # path of the file
    has_times: bool  # whether the times of the rows were checked
    converted: str = ""  # how the unit was converted, empty if it was not

    def __str__(self) -> str:
        times = "" if self.has_times else ", which has no times"
        return f"column {self.column!r} of {Path(self.path).name}{times}{self.converted}"


def read_trial(
    path: Path, signal: str, *, dt: float, unit: str = "", column: str = ""
) -> _TrialSignal:
    """Return one signal of a trial, "u" or "e": the named column, else the one with such a name.

    Times in the file must be those of an even clock with the sampling time `dt` [s]. A stated unit
    is converted to the wanted one.
    """
    file = _decimal_commas(path) or read_channels(path)
    if column:
        full = file.full_name(column)
    else:
        full = _choose_column(file, signal)
    samples = file.signal(signal, full)
    if not all_finite(samples):
        bad = int(np.flatnonzero(~np.isfinite(samples))[0])
        raise ValueError(
            f"{signal} must have a number in every row, got none in sample {bad + 1} of"
            f" {full!r} of {Path(path).name!r}"
        )
    seconds = _times_of(file, full, dt)
    if seconds is not None:
        _require_clock(f"{signal} must be sampled every {dt:g} s", file, t=seconds, dt=dt)
    factor, stated = 1.0, file.unit(full)
    if unit and stated:
        factor = unit_factor(stated, unit)
    if not np.isfinite(factor):
        raise ValueError(
            f"{signal} must be in {unit} like the model, got {full!r} of {path.name!r} in {stated}"
        )
    return _TrialSignal(
        samples=factor * samples,
        column=full,
        path=str(path),
        has_times=seconds is not None,
        converted=f", converted from {stated} to {unit}" if factor != 1 else "",
    )


def _decimal_commas(path: Path) -> Channels | None:
    """Return the one column of a table with decimal commas, which looks like two columns; else
    None.
    """
    if path.suffix.lower() not in (".csv", ".txt") or not path.is_file():
        return None
    text = path.read_text(encoding="utf-8-sig", errors="replace")
    name, *rows = [line.strip() for line in text.splitlines() if line.strip()] or [""]
    if not rows or not all(map(_DECIMAL_COMMA.fullmatch, rows)):
        return None
    if _DECIMAL_COMMA.fullmatch(name):
        raise ValueError(
            f"{path.name} must start with a line of names, or have decimal points instead of"
            f" commas, got {name!r}, which may be one number or two columns"
        )
    if "," in name:
        return None
    column = np.array([float(row.replace(",", ".")) for row in rows])
    return Channels(path=str(path), arrays={name: column})


def _times_of(file: Channels, full: str, dt: float) -> np.ndarray | None:
    """Return the time of each row of a column [s]; None without a time column.

    Times without a known unit are in seconds, milliseconds or microseconds, if one of them gives
    `dt`. Whole numbers that rise by one are row numbers, whose gaps count.
    """
    time = file.time_of(full)
    if not time or file.arrays[time].size != file.arrays[full].size:
        return None
    t = np.ravel(file.arrays[time]).astype(float)
    if not all_finite(t) or t.size < 2:
        return None
    second, usual = file.second_of(time), float(np.median(np.diff(t)))
    if second is not None and file.unit(time):
        return second * t
    factors = [one for one in _SECONDS if abs(one * usual / dt - 1) <= _MAX_RATE_ERROR]
    if second is None or (usual == 1 and not factors):
        factors = [dt / usual] if usual > 0 else [1.0]
    return (factors or [1.0])[0] * t


def _require_clock(wanted: str, file: Channels, *, t: np.ndarray, dt: float) -> None:
    """Refuse times [s] at another rate, with lost rows or with unequal steps."""
    found, name, steps = "", Path(file.path).name, np.diff(t)
    # the step of times with few digits, which repeat
    coarse = np.min(steps, where=steps > 0, initial=np.inf) if np.any(steps == 0) else 0.0
    fs, late = sampling_frequency(t), (t[-1] - t[0]) / dt - steps.size
    if not fs > 0:
        found = "the time column runs backwards"
    elif rows := find_rows_off(t, 1 / dt):
        found = rows.describe() if isinstance(rows, UnevenClock) else str(rows)
    elif abs(fs * dt - 1) > _MAX_RATE_ERROR and abs(late) > max(_MAX_SHIFT, coarse / dt):
        found = f"the time column has a step of {1 / fs:.6g} s"
    elif abs(late) > max(_MAX_SHIFT, coarse / dt, _MAX_RATE_ERROR * t.size):
        found = f"the last of {t.size} rows is {late:.3g} samples late"
    if found:
        raise ValueError(
            f"{wanted} like the controller, but in {name!r} {found}; record the trial again at this"
            " sampling time"
        )


def _choose_column(file: Channels, signal: str) -> str:
    """Return the column of a signal: the only one other than times and counters, else by its name."""
    names = [
        name
        for name in file.signals
        if not is_time_name(name) and np.squeeze(file.arrays[name]).ndim == 1
    ]
    own = [name for name in names if _NAMES[signal].fullmatch(_bare(name))]
    if not own:
        own = [name for name in names if not is_rising(np.ravel(file.arrays[name]).astype(float))]
        own = own or names
    [other] = _NAMES.keys() - {signal}
    if len(own) == 1 and not _names_other(own[0], signal, other):
        return own[0]
    what = {"u": "the added input", "e": "the error r - y"}[signal]
    listed = ", ".join(repr(name) for name in names) or "none"
    raise ValueError(
        f"{signal} must be a file in which one column is named like {what}, got {listed} in"
        f" {Path(file.path).name!r}; name the column with"
        f" {'--input' if signal == 'u' else '--error'}"
    )


def _names_other(name: str, signal: str, other: str) -> bool:
    """Return whether a column has the name of the other signal and not of the wanted one."""
    bare = _bare(name)
    return not _NAMES[signal].fullmatch(bare) and bool(_NAMES[other].fullmatch(bare))


def _bare(name: str) -> str:
    """Return a name without its unit and the structs around it."""
    return UNIT_SUFFIX.sub("", name).rsplit(".", 1)[-1].strip()
