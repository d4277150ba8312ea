"""A sampled controller as a C header or as a function block in structured text: the same statements
in both.
"""

from __future__ import annotations

import re
from textwrap import wrap
from typing import NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import inverse_unit, one_line, require_kind
from nlfrf._base.files import command_signature, to_path, write_text
from robust._base.types import Controller
from robust.io.models import PathLike
from robust.io.rounded import Polynomial, RoundedController, Statement, round_controller
from robust.io.rounded_schedule import round_schedule
from robust.models.lpv import LpvModel

_WIDTH = 100
_TYPES = {
    ".h": {"float32": "float", "float64": "double"},
    ".st": {"float32": "REAL", "float64": "LREAL"},
}


def export_c(
    K: Controller | LpvModel,
    path: PathLike,
    *,
    dtype: str = "float32",
    limit: ArrayLike | None = None,
    unit: str = "",
) -> RoundedController:
    """Write a sampled controller with one input and one output as a C header.

    Use this for a controller on a microcontroller. The header contains a struct and the functions
    `init` and `step(e) -> u`; it allocates no memory. The coefficients are rounded to the
    arithmetic of the target, so check the returned controller, which contains this rounding. For a
    scheduled controller the function is `step(p, e) -> u`, with the operating point p in its unit,
    limited to its range.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or LpvModel
        Discrete controller with one input and one output. A scheduled controller (LpvModel) is
        written in the realisation that `prove_schedule` proves, with coefficients that are
        polynomials of the operating point.
    path : path
        The ``.h`` file. Its name is also the name of the struct, and the beginning of the names of
        both functions.
    dtype : str
        Arithmetic of the target: "float32" or "float64".
    limit : float or (2,) sequence, optional
        Largest |u|, or the smallest and the largest u with zero between them, in the unit of u. The
        code then has anti-windup by back-calculation, for an integrator or for a lag with most of
        the gain at zero frequency. Not available for a scheduled controller.
    unit : str
        Unit of the plant, y over u, as in `UncertaintyModel.origin`; it is written in the comment.

    Returns
    -------
    RoundedController
        The controller with the rounded coefficients, and bounds on the effect of rounding.

    Raises
    ------
    ValueError
        A controller that is continuous, has several channels, has two integrators and a limit, is
        scheduled and has a limit, or has second-order sections that do not reproduce its response
        to 0.1 %; coefficients beyond the range of `dtype`; a path that does not end in .h.

    Warns
    -----
    DesignWarning
        Rounding changes |K| or u by more than 1 %.

    References
    ----------
    ISO/IEC 9899:1999 (C99). Structure and bounds: see `RoundedController`.

    Examples
    --------
    >>> import os, tempfile
    >>> import control, robust
    >>> folder = tempfile.TemporaryDirectory()
    >>> rounded = export_c(robust.shaping.pid(2.0, 3.0, dt=1e-3), os.path.join(folder.name, "pi.h"), limit=10.0)
    >>> rounded.K.dt, bool(rounded.coefficient_error < 1e-7)
    (0.001, True)
    >>> folder.cleanup()
    """
    return _export(K, path, _C, dtype=dtype, limit=limit, unit=unit)


def export_structured_text(
    K: Controller | LpvModel,
    path: PathLike,
    *,
    dtype: str = "float64",
    limit: ArrayLike | None = None,
    unit: str = "",
) -> RoundedController:
    """Write a sampled controller with one input and one output as a function block for a PLC.

    Use this for a controller on a PLC; for a P-PI cascade use `robust.servo.structured_text`. The
    block is in structured text (IEC 61131-3), computes the same as the code of `export_c`, and has
    an input `reset`.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction or LpvModel
        Discrete or scheduled controller with one input and one output, as for `export_c`.
    path : path
        The ``.st`` file; the name of the block is FB_ followed by the name of the file.
    dtype : str
        "float32" for REAL, "float64" for LREAL.
    limit, unit
        As for `export_c`.

    Returns
    -------
    RoundedController
        As from `export_c`.

    Raises
    ------
    ValueError
        As from `export_c`.

    References
    ----------
    IEC 61131-3:2013, *Programmable controllers - Part 3: Programming languages*, 7.3 (structured
    text).

    Examples
    --------
    >>> import os, pathlib, tempfile
    >>> import control
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = os.path.join(folder.name, "lead.st")
    >>> _ = export_structured_text(control.tf([1, -0.5], [1, -0.9], 0.01), path)
    >>> [row for row in pathlib.Path(path).read_text().splitlines() if "y1 :=" in row]
    ['    y1 := e + s1;']
    >>> folder.cleanup()
    """
    return _export(K, path, _STRUCTURED_TEXT, dtype=dtype, limit=limit, unit=unit)


def literal(number: float, dtype: str = "float64") -> str:
    """Return a number in the syntax of C and structured text, exact to the bit.

    >>> literal(5.0), literal(1e-5), literal(1e20), literal(0.1, "float32")
    ('5.0', '1.0E-05', '1.0E+20', '0.1')
    """
    mantissa, _, exponent = str(np.dtype(dtype).type(number)).upper().partition("E")
    if "." not in mantissa:
        mantissa = f"{mantissa}.0"
    if exponent:
        return f"{mantissa}E{exponent}"
    return mantissa


class _Language(NamedTuple):
    """Syntax of numbers, names and statements in a language; {} stands for each."""

    suffix: str
    types: dict[str, str]
    numbers: dict[str, str]
    state: str
    declared: str  # declaration of a state
    cleared: str
    local: str  # left side of a statement whose target is not a state
    assign: str
    limits: tuple[str, str]
    theta: str  # statement of theta: t between -{0} and {0}
    input: str  # declaration of the operating point
    advice: str
    template: str


_C = _Language(
    suffix=".h",
    types={"float32": "float", "float64": "double"},
    numbers={"float32": "{}f", "float64": "{}"},
    state="k->{}",
    declared="    TYPE {};",
    cleared="    k->{} = 0;",
    local="const TYPE {}",
    assign=" = ",
    limits=("if (u < {0}) u = {0};", "if (u > {0}) u = {0};"),
    theta="    const TYPE theta = t < -{0} ? -{0} : t > {0} ? {0} : t;\n    (void)theta;",
    input="TYPE p, ",
    advice=(
        "Compile with -ffp-contract=off, and without -ffast-math, which would remove the"
        " compensation of sums."
    ),
    template="""/*
COMMENT
*/
#ifndef NAME_H
#define NAME_H

#ifdef __FAST_MATH__
#error "-ffast-math changes the order of operations, and removes the compensation of sums"
#endif

typedef struct {
DECLARED
} NAME_state;

static inline void NAME_init(NAME_state *k)
{
    (void)k;
CLEARED
}

static inline TYPE NAME_step(NAME_state *k, POINTTYPE e)
{
    (void)k;
BEFORE
    TYPE u = v;
AFTER
    return u;
}

#endif
""",
)
_STRUCTURED_TEXT = _Language(
    suffix=".st",
    types={"float32": "REAL", "float64": "LREAL"},
    numbers={"float32": "REAL#{}", "float64": "LREAL#{}"},
    state="{}",
    declared="    {} : TYPE := 0.0;",
    cleared="    {} := 0.0;",
    local="{}",
    assign=" := ",
    limits=("IF u < {0} THEN u := {0}; END_IF;", "IF u > {0} THEN u := {0}; END_IF;"),
    theta="    theta := LIMIT(-{0}, t, {0});",
    input="    p : TYPE; (* operating point *)\n",
    advice="Call it in a task of this period.",
    template="""FUNCTION_BLOCK FB_NAME
(*
COMMENT
*)
VAR_INPUT
POINT    e : TYPE; (* r - y *)
    reset : BOOL; (* set all states to zero *)
END_VAR
VAR_OUTPUT
    u : TYPE;
END_VAR
VAR
DECLARED
LOCALS
END_VAR

IF reset THEN
CLEARED
END_IF;
BEFORE
    u := v;
AFTER
END_FUNCTION_BLOCK
""",
)


def _export(
    K: Controller | LpvModel,
    path: PathLike,
    language: _Language,
    *,
    dtype: str,
    limit: ArrayLike | None,
    unit: str,
) -> RoundedController:
    """Round a controller, write it in a language, and return it."""
    path = to_path(path)
    if path.suffix.lower() != language.suffix:
        raise ValueError(f"path must end in {language.suffix}, got {str(path)!r}")
    require_kind("unit", unit, str)
    rounder = round_schedule if isinstance(K, LpvModel) else round_controller
    rounded: RoundedController = rounder(K, dtype=dtype, limit=limit)  # type: ignore[arg-type]
    if unit:
        units = f" K is in {one_line(inverse_unit(unit))}, u over e."
    else:
        units = ""
    dt, kind = rounded.K.dt, language.types[dtype]
    lines = [
        (
            f"{one_line(path.name)}: controller u = K e with e = r - y, one step every {dt:.12g} s"
            f" ({1 / dt:.6g} Hz).{units} Give the time from the sample of y to u as the delay of"
            " 'robust check'."
        ),
        f"All arithmetic is in {kind} ({dtype}), in the written order. {language.advice}",
        *rounded.facts,
    ]
    # remove sequences that would end a comment, in either language
    safe = [re.sub(r"(?<=\*)(?=[/)])|(?<=\()(?=\*)", " ", line) for line in lines]
    rows = [row for line in safe for row in wrap(line, _WIDTH, subsequent_indent="  ")]
    name = re.sub(r"\W", "_", path.stem, flags=re.ASCII)
    parts = _render_statements(rounded, language) | {
        "COMMENT": "\n".join([*rows, command_signature("robust export")]),
        "NAME": name if name[:1].isalpha() else f"K_{name}",
        "TYPE": kind,
        "POINT": language.input.replace("TYPE", kind) if rounded.theta else "",
    }
    write_text(path, re.sub("|".join(parts), lambda found: parts[found[0]], language.template))
    return rounded


def _render_statements(rounded: RoundedController, language: _Language) -> dict[str, str]:
    """Return the declarations and statements of a controller, by their place in the template."""
    states, kind = rounded.states, language.types[rounded.dtype]
    targets = dict.fromkeys(row.target for row in (*rounded.before, *rounded.after))

    def number(value: float) -> str:
        return language.numbers[rounded.dtype].format(literal(value, rounded.dtype))

    def term(value: float | str, name: str) -> str:
        read = (language.state if name in states else "{}").format(name)
        if isinstance(value, str):
            return f"+ {value} * {read}"
        if abs(value) == 1:
            factor = ""
        else:
            factor = f"{number(abs(value))} * "
        return ("- " if value < 0 else "+ ") + factor + read

    def plain(value: float) -> str:
        if value < 0:
            return f"-{number(-value)}"
        return number(value)

    def signed(value: float) -> str:
        return ("- " if value < 0 else "+ ") + number(abs(value))

    def horner(row: Polynomial) -> str:
        *rest, last = row.coefficients
        text = plain(last)
        for k, value in enumerate(reversed(rest)):
            text = f"{f'({text})' if k else text} * theta {signed(value)}"
        return text

    def assign(row: Statement | Polynomial) -> str:
        left = (language.state if row.target in states else language.local).format(row.target)
        if isinstance(row, Polynomial):
            return f"    {left}{language.assign}{horner(row)};"
        terms = " ".join(term(*one) for one in row.terms).removeprefix("+ ")
        return f"    {left}{language.assign}{terms};"

    point = []
    if rounded.theta:
        middle, scale = rounded.theta
        left = language.local.format("t") + language.assign
        point.append(f"    {left}{number(scale)} * (p {signed(-middle)});")
        point.append(language.theta.format(number(1.0)))
        targets = dict.fromkeys(["t", "theta", *targets])

    clamps = [
        "    " + clamp.format(plain(bound))
        for clamp, bound in zip(language.limits, rounded.limit, strict=True)
        if np.isfinite(bound)
    ]
    rows = {
        "DECLARED": [language.declared.format(name) for name in states or ["unused"]],
        "LOCALS": [language.declared.format(name) for name in targets if name not in states],
        "CLEARED": [language.cleared.format(name) for name in states],
        "BEFORE": [*point, *(assign(row) for row in rounded.before)],
        "AFTER": [*clamps, *(assign(row) for row in rounded.after)],
    }
    return {place: "\n".join(lines).replace("TYPE", kind) for place, lines in rows.items()}
