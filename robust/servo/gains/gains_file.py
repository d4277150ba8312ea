"""Gains of a drive in a TOML file, every number with its unit."""

from __future__ import annotations

import os
import tomllib
import warnings
from collections.abc import Mapping

import numpy as np

from nlfrf._base.arguments import require_positive, short_form
from nlfrf._base.drive_entries import USUAL_KV, is_unusual_gain, read_drive_entries
from nlfrf._base.types import Json
from nlfrf._base.units import parse_quantity
from nlfrf.rig import Drive
from robust._base.warnings import DesignWarning
from robust.synthesis.blocks import Biquad, Filter, LowPass, Notch

#: Filters of a drive: their frequency is typed under their name, the other numbers under these, with these defaults.
_FILTERS: dict[str, dict[str, float]] = {
    "notch": {"bandwidth": np.nan, "depth": 0.0},
    "low_pass": {"zeta": LowPass.zeta},
    "biquad": {"zeta": np.nan, "numerator_frequency": np.nan, "numerator_zeta": np.nan},
}
_FILTER_NUMBERS = {"bandwidth": "frequency", "depth": "share", "zeta": "share"} | {
    "numerator_frequency": "frequency",
    "numerator_zeta": "share",
}


def load_gains(path: str | os.PathLike[str]) -> Drive:
    """Read the settings of a drive from a TOML file, in which every number has its unit.

    Parameters
    ----------
    path : path
        With `fs`, `kv`, `kp`, and what else `Drive` has; `delay` in ms in place of periods; filters in tables
        [[filters]] of one of `notch`, `low_pass`, `biquad`, the frequency [Hz], and the other numbers: `bandwidth` and
        `depth` of a notch; `zeta`; `zeta`, `numerator_frequency` and `numerator_zeta` of a biquad. A
        file without `lag` or `delay` stands for none, and for one period: the settings name both as assumed.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        A file that is not TOML, an entry that is not known or missing, a number without a unit or with a wrong one.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import tempfile
    >>> text = '''
    ... fs = "4 kHz"
    ... kv = "100 1/s"
    ... kp = "143 A/(m/s)"
    ... tn = "10 ms"
    ... torque_constant = "52.8 N/A"
    ... lag = "0.3 ms"
    ... delay = "0.25 ms"
    ... [[filters]]
    ... notch = "83 Hz"
    ... bandwidth = "20 Hz"
    ... depth = 0.1
    ... '''
    >>> with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
    ...     _ = file.write(text), file.flush()
    ...     print(load_gains(file.name))
    position loop kv = 100 1/s = 6 (m/min)/mm, every 0.25 ms
    velocity loop kp = 143 A/(m/s), tn = 10 ms, velocity from differences, every 0.25 ms
    filters: notch at 83 Hz
    force constant 52.8 N/A; current loop: lag 0.3 ms, delay 0.25 ms
    """
    with open(path, "rb") as file:
        try:
            content = tomllib.load(file)
        except (tomllib.TOMLDecodeError, UnicodeDecodeError) as error:
            raise ValueError(f"path must be a TOML file with the gains of a drive, got {path}: {error}") from None
    slots = content.pop("filters", [])
    found = read_drive_entries(str(path), content)
    _warn_of_unusual_gain(found["kv"], content["kv"])
    if not isinstance(slots, list):
        raise ValueError(f"filters must be tables [[filters]], got {short_form(slots)}")
    return Drive(**found, filters=tuple(map(_read_slot, slots)))


def _warn_of_unusual_gain(kv: float, written: Json) -> None:
    """Warn of a position gain kv [1/s] that hardly any drive has: its unit may be another one."""
    low, high = USUAL_KV
    if is_unusual_gain(kv):
        warnings.warn(
            f"kv = {short_form(written)} is {kv:.4g} 1/s, and drives usually have {low:g} to {high:g} 1/s "
            f"({60e-3 * low:g} to {60e-3 * high:g} (m/min)/mm). Every result is of that gain; look up its unit",
            DesignWarning,
            stacklevel=3,
        )


def _read_slot(given: Json) -> Filter:
    """One filter of the file."""
    kinds = [kind for kind in _FILTERS if isinstance(given, Mapping) and kind in given]
    if len(kinds) != 1:
        raise ValueError(f"filters must each have one of {', '.join(_FILTERS)}, got {short_form(given)}")
    kind = kinds[0]
    if others := sorted(set(given) - {kind} - set(_FILTER_NUMBERS)):
        raise ValueError(f"filters must have no entry {others[0]}; of {', '.join(_FILTER_NUMBERS)} what {kind} takes")
    typed = {name: parse_quantity(name, _FILTER_NUMBERS[name], given[name]) for name in given if name != kind}
    numbers = _FILTERS[kind] | typed
    if set(numbers) != set(_FILTERS[kind]) or np.isnan(list(numbers.values())).any():
        raise ValueError(f"filters must have the numbers that {kind} takes, got {', '.join(typed) or 'none'}")
    f = require_positive(kind, parse_quantity(kind, "frequency", given[kind]))
    omega = 2 * np.pi * f
    if kind == "notch":
        return Notch(omega=omega, width=numbers["bandwidth"] / f, depth=numbers["depth"])
    if kind == "low_pass":
        return LowPass(omega=omega, zeta=numbers["zeta"])
    upper = 2 * np.pi * numbers.pop("numerator_frequency")
    return Biquad(omega=omega, numerator_omega=upper, **numbers)
