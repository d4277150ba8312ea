"""A drive as one function block of structured text (IEC 61131-3), for a PLC that runs the cascade
itself.

All arithmetic is in LREAL. The block computes what `cascade` computes, and adds three things that a
linear controller does not have: a slower position loop without approximation, a limit with
anti-windup, and a start without a jump.
"""

from __future__ import annotations

import re

import numpy as np

from nlfrf._base.arguments import require_kind, short_form
from nlfrf.rig import Drive
from robust.io.target_code import literal
from robust.servo.gains.p_pi import velocity_section

#: Keywords of IEC 61131-3, which a block cannot have as its name.
_RESERVED = {
    "AND",
    "ARRAY",
    "BOOL",
    "DO",
    "ELSE",
    "END_IF",
    "FUNCTION_BLOCK",
    "IF",
    "INT",
    "LREAL",
    "MOD",
    "NOT",
    "OR",
}
_RESERVED |= {"REAL", "THEN", "TO", "VAR", "XOR"}


def structured_text(
    settings: Drive, *, name: str = "PositionController", output_unit: str = ""
) -> str:
    """Return a function block in IEC structured text that runs the cascade of a drive.

    Use this if a PLC closes the position and velocity loop, and the drive only controls the
    current. The PLC must call the block once in every period of the velocity loop.

    The inputs of the block are the position set point, the measured position (of motor and load
    with two encoders), a force or current that is added after the filters, and `reset`. While the
    output is at its limit, an error that would increase the output further is not integrated
    (conditional integration). In the first call, and while `reset` is true, the block uses the
    present position as the previous one, and sets its integral and its filters to zero.

    Parameters
    ----------
    settings : Drive
        Gains, filters, sampling and units. `lag` and `delay_periods` belong to the current loop,
        not to the block.
    name : str
        Name of the block.
    output_unit : str
        Unit of the output, as for `cascade`.

    Returns
    -------
    str

    Raises
    ------
    ValueError
        A name that is not an identifier, or a unit that needs a torque constant when none is given.

    References
    ----------
    IEC 61131-3:2013, *Programmable controllers - Part 3: Programming languages*, 7.3 (structured
    text). K. J. Åström, B. Wittenmark, *Computer-Controlled Systems*, 3rd ed., 1997, 3.5
    (anti-windup).

    Examples
    --------
    >>> settings = Drive(fs=4000, kv=100, kp=143, kp_unit="A/(m/s)", tn=0.01, limit=28.8)
    >>> text = structured_text(settings, name="FB_Axis")
    >>> print(text.splitlines()[0])
    FUNCTION_BLOCK FB_Axis
    >>> [row.strip() for row in text.splitlines() if row.strip().startswith("integral :=")]
    ['integral := 0.0;', 'integral := integral + integral_gain * velocity_error;']
    """
    require_kind("settings", settings, Drive)
    if (
        not isinstance(name, str)
        or not re.fullmatch(r"[A-Za-z][A-Za-z0-9_]*", name)
        or name.upper() in _RESERVED
    ):
        raise ValueError(f"name must be an identifier of IEC 61131-3, got {short_form(name)}")
    unit = output_unit or settings.output_unit
    factor = settings.output_factor(unit)
    rows = [
        f"FUNCTION_BLOCK {name}",
        (
            f"(* Position P, velocity PI. Call once every {1e3 / settings.fs:.12g} ms, in a task of"
            " fixed period. *)"
        ),
        *(f"(* {row} *)" for row in str(settings).splitlines()),
        *_declarations(settings, unit, factor),
        "",
        *_statements(settings),
        "END_FUNCTION_BLOCK",
    ]
    return "\n".join(rows) + "\n"


def _declarations(settings: Drive, unit: str, factor: float) -> list[str]:
    """Return the variables of the block, with their units and numbers."""
    base, two = settings.base_unit, settings.encoder == "both"
    gain, fs = settings.gain * factor, settings.fs
    position_factor = settings.load_scale.factor if two else settings.position_scale.factor
    set_point_unit = settings.load_scale.unit if two else settings.position_scale.unit
    sections = {"velocity": velocity_section(settings)}
    sections |= {f"filter{k + 1}": one for k, one in enumerate(settings.sections)}
    constants: list[tuple[str, float, str]] = [
        ("position_gain", settings.kv, "1/s"),
        ("set_point_factor", position_factor, f"{base}/{set_point_unit}"),
        ("feedforward_gain", settings.velocity_feedforward * fs / settings.position_every, "1/s"),
        (
            "velocity_factor",
            settings.position_scale.factor,
            f"{base}/{settings.position_scale.unit}",
        ),
        ("velocity_gain", gain, f"{unit}/({base}/s)"),
        ("integral_gain", gain * settings.dt / settings.tn, f"{unit}/({base}/s)"),
    ]
    if np.isfinite(settings.limit):
        constants.append(("output_limit", settings.limit * factor, unit))
    for key, section in sections.items():
        for letter, number in zip(("b0", "b1", "b2", "", "a1", "a2"), section, strict=True):
            if letter:
                constants.append((f"{key}_{letter}", float(number), ""))
    inputs = [("position_set", "LREAL", f"set point [{set_point_unit}]")]
    inputs += [
        (
            "position",
            "LREAL",
            f"measured{' at the motor' if two else ''} [{settings.position_scale.unit}]",
        )
    ]
    inputs += (
        [("load_position", "LREAL", f"measured at the load [{settings.load_scale.unit}]")]
        if two
        else []
    )
    inputs += [
        ("added", "LREAL", f"feedforward, added behind the filters [{unit}]"),
        ("reset", "BOOL", "start anew"),
    ]
    states = [
        "position_set_before",
        "position_origin",
        "velocity_set",
        "velocity_error",
        "integral",
        "unlimited",
    ]
    states += [f"{key}_{state}" for key in sections for state in ("s1", "s2", "in", "out")]
    rows = [
        "VAR_INPUT",
        *(f"    {key} : {kind}; (* {text} *)" for key, kind, text in inputs),
        "END_VAR",
    ]
    rows += ["VAR_OUTPUT", f"    output : LREAL; (* set point of the current loop [{unit}] *)"]
    rows += [
        "    limited : BOOL; (* whether the output is at its limit *)",
        "END_VAR",
        "VAR CONSTANT",
    ]
    for key, number, of in constants:
        rows.append(f"    {key} : LREAL := {literal(number)};{f' (* {of} *)' if of else ''}")
    rows += ["END_VAR", "VAR", "    started : BOOL := FALSE;", "    countdown : INT := 0;"]
    return [*rows, *(f"    {state} : LREAL := 0.0;" for state in states), "END_VAR"]


def _statements(settings: Drive) -> list[str]:
    """Return the statements of one call."""
    keys = ["velocity", *(f"filter{k + 1}" for k in range(len(settings.filters)))]
    limit = np.isfinite(settings.limit)
    measured = "load_position" if settings.encoder == "both" else "position"
    rows = [
        "IF reset OR NOT started THEN",
        "    started := TRUE;",
        "    countdown := 0;",
        "    position_origin := position;",
        "    position_set_before := position_set;",
        "    velocity_set := 0.0;",
        "    integral := 0.0;",
        *(f"    {key}_{state} := 0.0;" for key in keys for state in ("s1", "s2")),
        "END_IF;",
        "(* velocity, from the distance since the start *)",
        "velocity_in := position - position_origin;",
        *_section_statements("velocity"),
        "(* position loop *)",
        "IF countdown <= 0 THEN",
        f"    velocity_set := set_point_factor * (position_gain * (position_set - {measured})",
        "        + feedforward_gain * (position_set - position_set_before));",
        "    position_set_before := position_set;",
        f"    countdown := {settings.position_every};",
        "END_IF;",
        "countdown := countdown - 1;",
        "(* velocity loop *)",
        "velocity_error := velocity_set - velocity_factor * velocity_out;",
        "unlimited := velocity_gain * velocity_error + integral;",
    ]
    for key in keys[1:]:
        rows += [f"{key}_in := unlimited;", *_section_statements(key), f"unlimited := {key}_out;"]
    rows += ["unlimited := unlimited + added;", "output := unlimited;", "limited := FALSE;"]
    if limit:
        rows += [
            "IF unlimited > output_limit THEN",
            "    output := output_limit;",
            "    limited := TRUE;",
            "ELSIF unlimited < -output_limit THEN",
            "    output := -output_limit;",
            "    limited := TRUE;",
            "END_IF;",
        ]
    return [
        *rows,
        "(* anti-windup: no further into the limit *)",
        "IF (unlimited - output) * velocity_error <= 0.0 THEN",
        "    integral := integral + integral_gain * velocity_error;",
        "END_IF;",
    ]


def _section_statements(key: str) -> list[str]:
    """Return the statements of one second-order section, transposed direct form II."""
    return [
        f"{key}_out := {key}_b0 * {key}_in + {key}_s1;",
        f"{key}_s1 := {key}_b1 * {key}_in - {key}_a1 * {key}_out + {key}_s2;",
        f"{key}_s2 := {key}_b2 * {key}_in - {key}_a2 * {key}_out;",
    ]
