"""A PID controller with the filters of a drive from a TOML file, as tunable blocks."""

from __future__ import annotations

import os
import warnings
from collections.abc import Mapping

import control
import numpy as np

from nlfrf._base.arguments import (
    require_choice,
    require_known,
    require_nonnegative,
    require_positive,
    short_form,
)
from nlfrf._base.parsing import parse_toml
from nlfrf._base.types import Json, JsonObject
from nlfrf._base.units import parse_quantity, split_quantity, unit_factor
from nlfrf._base.values import value
from robust._base.warnings import DesignWarning
from robust.synthesis.filters import Biquad, Filter, LowPass, Notch
from robust.synthesis.pid import Pid

#: Filters: their frequency stands under their name, the other numbers under these names, with these
#: defaults.
_FILTERS: dict[str, dict[str, float]] = {
    "notch": {"bandwidth": np.nan, "depth": 0.0},
    "low_pass": {"zeta": LowPass.zeta},
    "biquad": {"zeta": np.nan, "numerator_frequency": np.nan, "numerator_zeta": np.nan},
}
_FILTER_NUMBERS = {"bandwidth": "frequency", "depth": "share", "zeta": "share"} | {
    "numerator_frequency": "frequency",
    "numerator_zeta": "share",
}
#: Form of a PID -> its entries for the integral and the derivative.
_FORMS = {"parallel": ("Ki", "Kd"), "ideal": ("Ti", "Td"), "series": ("Ti", "Td")}
_TIMES = ("sample_time", "delay", "Ti", "Td", "Tf")
_LEAST_FILTER = 0.5  # samples: with a shorter filter a sampled derivative rings


@value
class _PidSettings:
    """A PID and its filters in series, as they run."""

    pid: Pid  # gains of the parallel form
    filters: tuple[Filter, ...]  # the filters, each with its own frequency
    dt: float  # sampling time [s]; 0 for a continuous controller
    delay: float | None  # computation delay [s]; None if the file has none
    unit: str  # unit of Kp, u over y; empty if the file has none

    @property
    def K(self) -> control.StateSpace:
        """Return the controller u = K (r - y); sampled by the trapezoidal rule, each filter exact
        at its frequency.
        """
        K = self.pid.system(self.dt)
        for slot in self.filters:
            K = K * slot.system(
                self.dt
            )  # the gains stand behind the filters: states of similar size
        return K


def load_pid(path: str | os.PathLike[str]) -> _PidSettings:
    """Read a PID with its filters from a TOML file.

    Use this to check a PID that you already have.

    Parameters
    ----------
    path : path
        File with `sample_time` ("0 s": continuous), `Kp`, and optional entries: `delay`; `form`,
        "parallel" (default: Kp + Ki/s + Kd s/(Tf s + 1)), "ideal" (Kp (1 + 1/(Ti s) + Td s/(Tf s +
        1))) or "series" (Kp (1 + 1/(Ti s)) (Td s + 1)/(Tf s + 1)); tables [[filters]] as in
        `servo.load_gains`.

    Raises
    ------
    ValueError
        A file that is not TOML, an entry that is unknown, missing or for another form, a number
        without a unit or with a wrong one, a filter above half the sampling frequency.
    FileNotFoundError
        No such file.

    Examples
    --------
    >>> import tempfile
    >>> text = 'sample_time = "1 ms"\\nKp = "2 N/m"\\nKi = "0.01 N/(mm s)"\\nKd = "30 N ms/m"\\nTf = "2 ms"'
    >>> with tempfile.NamedTemporaryFile("w", suffix=".toml") as file:
    ...     _ = file.write(text), file.flush()
    ...     settings = load_pid(file.name)
    >>> settings.pid.ki, settings.pid.kd, settings.unit
    (10.0, 0.03, 'N/m')
    """
    content = parse_toml(path, "path", " with a PID")
    form = _require_entries(str(path), content)
    times = {
        name: parse_quantity(name, "time", content[name]) for name in _TIMES if name in content
    }
    times |= {
        name: require_positive(name, times[name]) for name in ("Ti", "Td", "Tf") if name in times
    }
    dt, delay = require_nonnegative("sample_time", times["sample_time"]), times.get("delay")
    pid, unit = _read_pid(form, content, times)
    if dt and pid.kd and pid.filter_time < _LEAST_FILTER * dt:
        warnings.warn(
            f"Tf = {1e3 * pid.filter_time:g} ms is below half a sample of {1e3 * dt:g} ms: with"
            " the trapezoidal rule the derivative oscillates from sample to sample. Use a"
            " longer Tf, unless the PID is discretised by another rule",
            DesignWarning,
            stacklevel=2,
        )
    return _PidSettings(
        pid=pid,
        filters=read_filters(content.get("filters", []), dt),
        dt=dt,
        delay=None if delay is None else require_nonnegative("delay", delay),
        unit=unit,
    )


def _require_entries(path: str, content: JsonObject) -> str:
    """Return the form of a PID; refuse entries that are unknown, missing or for another form."""
    if "kv" in content:
        raise ValueError(
            "path must hold a PID, got the gains of a drive; go on with: robust servo check"
            f" TRACE {path}"
        )
    form = require_choice("form", content.get("form", "parallel"), tuple(_FORMS))
    integral, derivative = _FORMS[form]
    if others := [
        name for name in ("Ki", "Kd", "Ti", "Td") if name in content and name not in _FORMS[form]
    ]:
        raise ValueError(
            f"{path} must have no entry {others[0]} in the {form} form, which takes Kp, {integral},"
            f' {derivative} and Tf. form = "parallel" takes Ki and Kd; "ideal" and "series" take Ti'
            " and Td"
        )
    require_known(
        path, content, ["form", "sample_time", "delay", "Kp", integral, derivative, "Tf", "filters"]
    )
    needed = {"sample_time": 'such as "1 ms", or "0 s" for a continuous PID', "Kp": "the gain"}
    if missing := [name for name in needed if name not in content]:
        raise ValueError(f"{path} must have an entry {missing[0]}, {needed[missing[0]]}, got none")
    alone = [name for name in (derivative, "Tf") if name in content]
    if len(alone) == 1:
        raise ValueError(
            f"{path} must have {derivative} and Tf, the time constant of its filter, or none of"
            f" them, got {alone[0]} alone. A low_pass in [[filters]] filters the whole PID"
        )
    return form


def _read_pid(form: str, content: JsonObject, times: Mapping[str, float]) -> tuple[Pid, str]:
    """Return the parallel form of a PID in any form, and the unit of Kp."""
    (kp, unit), tf = _read_gain("Kp", content["Kp"]), times.get("Tf", 0.0)
    if form == "parallel":
        ki, kd = (
            _read_gain(name, content[name], unit, per)[0] if name in content else 0.0
            for name, per in (("Ki", "/s"), ("Kd", " s"))
        )
    else:
        ki, td = (kp / times["Ti"] if "Ti" in times else 0.0), times.get("Td", 0.0)
        kd = kp * td
        if form == "series" and td:  # compare both forms by powers of s
            kp, kd = kp + ki * (td - tf), (kp - ki * tf) * (td - tf)
    return Pid(kp=kp, ki=ki, kd=kd, filter_time=tf), unit


def _read_gain(
    name: str, written: Json, unit: str | None = None, per: str = ""
) -> tuple[float, str]:
    """Return a gain and its unit; if `unit`, that of Kp, is given, converted to it with a power of
    the time.
    """
    if isinstance(written, int | float) and not isinstance(written, bool) and not unit:
        return float(written), ""
    try:
        number, own = split_quantity(written)
    except ValueError:
        number, own = np.nan, ""
    wanted = f"{unit or '1'}{per}"
    if unit is None:
        factor = 1.0
    else:
        factor = unit_factor(own, wanted)
    if not np.isfinite(number * factor):
        if unit is None:
            such = 'of u over y, such as "800 N/m"'
        else:
            such = f"{wanted}, as Kp has {unit or 'no unit'}"
        raise ValueError(
            f"{name} must be a number with its unit, {such}, got {short_form(written)}"
        )
    return number * factor, own


def read_filters(slots: Json, dt: float = 0.0) -> tuple[Filter, ...]:
    """Return the filters of tables [[filters]]; each below half the sampling frequency if dt [s] is
    given.
    """
    if not isinstance(slots, list):
        raise ValueError(f"filters must be tables [[filters]], got {short_form(slots)}")
    return tuple(_read_slot(given, dt) for given in slots)


def _read_slot(given: Json, dt: float) -> Filter:
    kinds = [kind for kind in _FILTERS if isinstance(given, Mapping) and kind in given]
    if len(kinds) != 1:
        raise ValueError(
            f"filters must each have one of {', '.join(_FILTERS)}, got {short_form(given)}"
        )
    kind = kinds[0]
    require_known("filters", given, [kind, *_FILTERS[kind]])
    if missing := [
        name for name, usual in _FILTERS[kind].items() if np.isnan(usual) and name not in given
    ]:
        raise ValueError(f"filters must have an entry {missing[0]} with {kind}, got none")
    numbers = _FILTERS[kind] | {
        name: parse_quantity(name, _FILTER_NUMBERS[name], given[name])
        for name in given
        if name != kind
    }
    f = require_positive(kind, parse_quantity(kind, "frequency", given[kind]))
    if f * dt >= 0.5:
        raise ValueError(
            f"{kind} must lie below half the sampling frequency, {0.5 / dt:g} Hz, got {f:g} Hz"
        )
    omega = 2 * np.pi * f
    if kind == "notch":
        return Notch(omega=omega, width=numbers["bandwidth"] / f, depth=numbers["depth"])
    if kind == "low_pass":
        return LowPass(omega=omega, zeta=numbers["zeta"])
    upper = 2 * np.pi * numbers.pop("numerator_frequency")
    return Biquad(omega=omega, numerator_omega=upper, **numbers)
