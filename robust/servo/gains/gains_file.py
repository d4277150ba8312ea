"""Gains of a drive in a TOML file, every number with its unit."""

from __future__ import annotations

import os
import warnings

from nlfrf._base.arguments import short_form
from nlfrf._base.drive_entries import USUAL_KV, is_unusual_gain, read_drive_entries
from nlfrf._base.parsing import parse_toml
from nlfrf._base.types import Json
from nlfrf.rig import Drive
from robust._base.warnings import DesignWarning
from robust.synthesis.pid_file import read_filters


def load_gains(path: str | os.PathLike[str]) -> Drive:
    """Read the settings of a drive from a TOML file, in which each number has a unit.

    Parameters
    ----------
    path : path
        File with `fs`, `kv`, `kp` and the other fields of `Drive`; instead of `delay_periods` it
        contains `delay` in ms. Each filter is a table [[filters]]. The key `notch`, `low_pass` or
        `biquad` gives the type of the filter and its frequency [Hz]. The other keys are `bandwidth`
        and `depth` for a notch; `zeta` for a low-pass; `zeta`, `numerator_frequency` and
        `numerator_zeta` for a biquad. By default no lag and a delay of one period are assumed, and
        printed as assumed.

    Returns
    -------
    Drive

    Raises
    ------
    ValueError
        A file that is not TOML, an unknown or missing entry, or a number without a unit or with a
        wrong one.
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
    content = parse_toml(path, "path", " with the gains of a drive")
    slots = content.pop("filters", [])
    found = read_drive_entries(str(path), content)
    _warn_of_unusual_gain(found["kv"], content["kv"])
    return Drive(**found, filters=read_filters(slots))


def _warn_of_unusual_gain(kv: float, written: Json) -> None:
    """Warn of a position gain kv [1/s] that hardly any drive has, because its unit may be wrong."""
    low, high = USUAL_KV
    if is_unusual_gain(kv):
        warnings.warn(
            f"kv = {short_form(written)} is {kv:.4g} 1/s, but drives usually have {low:g} to"
            f" {high:g} 1/s ({60e-3 * low:g} to {60e-3 * high:g} (m/min)/mm). Every result holds"
            " for this gain: check its unit",
            DesignWarning,
            stacklevel=3,
        )
