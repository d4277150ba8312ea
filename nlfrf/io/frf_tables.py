"""FRFs in files: tables of Bode plotters and analysers, universal files (UFF), complex arrays."""

from __future__ import annotations

import itertools
import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import MissingArgumentError, data_warning, join_names, require_positive
from nlfrf.bla.bla import Bla
from nlfrf.bla.from_frf import bla_from_frf
from nlfrf.io.channels import Channels
from nlfrf.io.measurement_files import read_channels
from nlfrf.io.readers.names import (
    ROLES,
    TURN,
    ColumnName,
    Unit,
    convert,
    find_symbol,
    parse_name,
    parse_unit,
    suits,
)

#: The parts of G in order of preference, and the keys of `columns`, which abbreviate quantities.
_WHOLE = ("complex", "real", "magnitude")
_PARTS = (("complex",), ("real", "imaginary"), ("magnitude", "phase"))
_KEYS = {
    "f": "frequency",
    "G": "complex",
    "re": "real",
    "im": "imaginary",
    "mag": "magnitude",
    "phase": "phase",
    "std": "std",
    "coherence": "coherence",
}
_MIN_NEGATIVE = 0.1  # share of negative values above which a magnitude without a unit is in dB
_SAME_FRF = 0.01  # largest relative difference of an FRF that a file contains in two forms
_MAX_OUTLIERS = 0.02  # share of lines that may differ by more; one line always may
#: Arguments that a variance needs, and the reason.
_NEEDS = {
    "n_averages": (
        "a coherence gives a variance only with the number of independent averages, which the file"
        " lacks"
    ),
    "relative_std": (
        "the file has no coherence, and a swept sine shows no distortion, so the error of G is"
        " unknown. Give its relative standard deviation sqrt(E|G - E G|^2)/|G| from the scatter"
        " of repeated sweeps (0.1 dB is 0.012, 1 degree is 0.017); or export the coherence; or"
        " measure with a multisine of nlfrf design, which shows the distortion"
    ),
}


class _FrfTable(NamedTuple):
    """An FRF in a file: increasing frequencies [Hz], the names of the columns of G, the unit of G.

    `left_out` are unused columns of the same length; `refusal` is the reason if the columns are not
    understood.
    """

    columns: tuple[str, ...]
    f: np.ndarray = np.zeros(0)
    G: np.ndarray = np.zeros(0)
    std: np.ndarray | None = None
    coherence: np.ndarray | None = None
    unit: str = ""
    left_out: tuple[str, ...] = ()
    refusal: str = ""


def load_frf(
    path: str | os.PathLike[str],
    *,
    relative_std: float | None = None,
    n_averages: float | None = None,
    channel: str = "",
    columns: str = "",
    hold: str = "unknown",
    fs: float | None = None,
) -> Bla:
    """Read an FRF of a Bode plotter or an analyser, as a `Bla` with its variance.

    The variance comes from `relative_std`, or from columns with the coherence or the standard
    deviation together with `n_averages`. For time signals use `load_record`.

    Parameters
    ----------
    path : path
        A table with frequencies [Hz] or [rad/s] and either magnitude (ratio or dB) and phase, or
        real and imaginary part; a universal file with FRFs; or an .npz or .h5 file with a complex
        array and its frequencies. Columns are recognised by their names.
    relative_std : float, optional
        Standard deviation of the complex number G over |G|; see `std` of `bla_from_frf`.
    n_averages : float, optional
        Number of independent averages behind the coherence or the standard deviation in the file.
    channel : str
        If the file has several FRFs, the one to read: the common part of the names of its columns,
        for example "CH2".
    columns : str
        Meaning of the columns, if their names do not show it; for example "f=col1 [Hz], re=col2
        [Ohm], im=-col3 [Ohm]". The keys are f, re, im, mag, phase, G (complex), std and coherence.
        "-" or "1/" in front of a name changes its sign or inverts it. The unit stands in brackets
        after the name.
    hold, fs
        As in `bla_from_frf`.

    Returns
    -------
    Bla
        The result of `bla_from_frf`. Rows at 0 Hz and rows without numbers are left out.

    Raises
    ------
    ValueError
        The file has no FRF, or several and `channel` is missing; the variance is unknown; names or
        units of columns are unknown; or columns contradict each other.

    Warns
    -----
    DataWarning
        A column has no unit, so one is assumed; or columns are left out.

    References
    ----------
    Bendat & Piersol, *Random Data*, 4th ed., 9.2 (variance by coherence).

    Examples
    --------
    >>> import tempfile
    >>> folder = tempfile.TemporaryDirectory()
    >>> path = Path(folder.name, "bode.csv")
    >>> _ = path.write_text("Frequency (Hz),Gain (dB),Phase (deg)\\n10,0,-45\\n20,-20,-90\\n")
    >>> bla = load_frf(path, relative_std=0.02)
    >>> bla.f, bla.G.round(3)
    (array([10., 20.]), array([0.707-0.707j, 0.   -0.1j  ]))
    >>> folder.cleanup()
    """
    file = read_channels(path)
    tables, name = find_frfs(file, columns), Path(path).name
    tables = {label: one for label, one in tables.items() if not one.refusal} or tables
    if not tables:
        raise ValueError(
            "path must hold an FRF, by name: frequencies that rise or fall throughout, with"
            f" magnitude and phase or real and imaginary part, got {name!r} with"
            f" {', '.join(file.arrays)}; name the columns as in 'f [Hz],gain [dB],phase [deg]', or"
            " give columns, as in 'f=col1 [Hz], mag=col2 [dB], phase=col3 [deg]'; nlfrf inspect"
            " shows the contents of a file"
        )
    wanted = re.sub(r"\W", "", channel).lower()
    chosen = [one for one in tables if re.sub(r"\W", "", one).lower() == wanted or not channel]
    if len(chosen) != 1:
        listed = ", ".join(map(repr, tables))
        raise ValueError(
            f"channel must name one of the FRFs of {name!r}, {listed}; got {channel or 'none'!r}"
        )
    table = tables[chosen[0]]
    if table.refusal:
        raise ValueError(table.refusal)
    if relative_std is None:
        std = table.std
    else:
        std = require_positive("relative_std", relative_std) * np.abs(table.G)
    missing = "relative_std" if table.coherence is None else "n_averages"
    if std is None and (table.coherence is None or n_averages is None):
        raise MissingArgumentError(missing, _NEEDS[missing])
    if table.left_out and len(tables) == 1:
        data_warning(
            f"left out, because not part of the FRF in {name!r}:"
            f" {', '.join(map(repr, table.left_out))}"
        )
    top, slash, bottom = table.unit.rpartition("/")
    return bla_from_frf(
        table.f,
        table.G,
        std=std,
        coherence=table.coherence if std is None else None,
        n_averages=n_averages,
        fs=fs,
        hold=hold,
        input_units=[bottom if slash else ""],
        output_units=[top or bottom],
    )


class _Column(NamedTuple):
    """A column of a file: its name, its numbers, and its parsed name."""

    name: str
    x: np.ndarray
    parsed: ColumnName


def _parse_columns(text: str, file: Channels) -> list[_Column]:
    """Parse the option for the columns of a file, as in "f=col1 [Hz], re=col2 [Ohm], im=-col3
    [Ohm]".
    """
    columns = []
    for item in re.split(rf",\s*(?=(?:{'|'.join(_KEYS)})\s*=)", text.strip()):
        key, _, rest = (one.strip() for one in item.partition("="))
        name, signs, unit = file.full_name(rest), "", ""
        if name not in file.arrays and (
            found := re.fullmatch(r"([-−]?(?:\s*1\s*/)?)\s*(.+?)", rest)
        ):
            signs, name = found[1], file.full_name(found[2])
        if name not in file.arrays and (found := re.fullmatch(r"(.+?)\s*\[([^\[\]]*)\]", name)):
            name, unit = file.full_name(found[1]), found[2]
        parsed = parse_name(name, unit or file.stated_unit(name))
        if (
            key not in _KEYS
            or name not in file.arrays
            or (unit and not suits(_KEYS[key], parse_unit(unit)))
        ):
            raise ValueError(
                f"columns must be {', '.join(_KEYS)}, each with a column and its unit, as in"
                f" 'f=col1 [Hz], re=col2 [Ohm], im=-col3 [Ohm]', got {item!r}; the columns of"
                f" {Path(file.path).name!r} are " + ", ".join(file.arrays)
            )
        named = parsed._replace(
            quantity=_KEYS[key],
            sign=parsed.sign * (-1 if signs[:1] in ("-", "−") else 1),
            inverse=parsed.inverse != ("/" in signs),
            unit=parse_unit(unit) if unit else parsed.unit,
            of_what="",
            label="",
            unknown=(),
        )
        columns.append(_Column(name, np.ravel(file.arrays[name]), named))
    return columns


def find_frfs(file: Channels, columns: str = "") -> dict[str, _FrfTable]:
    """Find the FRFs in the channels of a file, each once, by the common part of the names of their
    columns.
    """
    numeric = {
        name: np.ravel(array)
        for name, array in file.arrays.items()
        if array.dtype.kind in "fiuc" and np.squeeze(array).ndim == 1 and np.isfinite(array).any()
    }
    if (
        not columns
        and file.path.lower().endswith(".frd")
        and [*numeric] == ["col1", "col2", "col3"]
    ):
        columns = "f=col1 [Hz], mag=col2 [dB], phase=col3 [deg]"  # as in files of loudspeakers
        data_warning(f"{Path(file.path).name!r} names no columns: they are taken for {columns!r}")
    if columns:
        found = _parse_columns(columns, file)
    else:
        found = [
            _Column(
                name, x, parse_name(name, file.stated_unit(name), is_complex=x.dtype.kind == "c")
            )
            for name, x in numeric.items()
        ]
    tables: dict[str, _FrfTable] = {}
    for label in dict.fromkeys(one.parsed.label for one in found if one.parsed.quantity in _WHOLE):
        if (table := _read_frf(found, label, Path(file.path).name)) is None:
            continue
        others = [one.G for one in tables.values() if one.G.shape == table.G.shape]
        # an admittance and its impedance are one FRF
        same = (
            np.all(np.abs(G - table.G) <= _SAME_FRF * np.abs(G))
            for one in others
            for G in (one, 1 / one)
        )
        if table.refusal or not any(same):
            tables[label] = table
    return tables


def _read_frf(found: list[_Column], label: str, file: str) -> _FrfTable | None:
    """Read an FRF by the names of its columns; None if a part or its frequencies are missing."""
    whole = [one for one in found if one.parsed.quantity in _WHOLE]
    of, size = next(
        (one.parsed.of_what.split(), one.x.size) for one in whole if one.parsed.label == label
    )
    is_alone = all(one.parsed.label == label or one.parsed.unknown for one in whole)

    def related(quantity: str) -> list[_Column]:
        some = [one for one in found if one.parsed.quantity == quantity and one.x.size == size]
        own = [one for one in some if one.parsed.label == label]
        bare = [one for one in some if not one.parsed.label]
        fitting = [
            one
            for one in some
            if is_alone
            and {*of, *one.parsed.of_what.split()} in ({*of}, {*one.parsed.of_what.split()})
        ]
        other = {
            "frequency": bare or some,
            "std": bare,
            "coherence": fitting or bare,
            "phase": fitting,
            "imaginary": fitting,
        }
        return own or other.get(quantity, [])

    axes = sorted((one for one in related("frequency") if _is_monotone(one.x)), key=_is_unclear)
    forms = [form for parts in _PARTS for form in itertools.product(*map(related, parts))]
    forms.sort(key=lambda form: any(map(_is_unclear, form)))
    if not axes or not forms:
        return None
    lone = [(one,) for part in _PARTS[2] for one in related(part)]
    try:
        table, used = _assemble(
            axes, forms, [*forms[1:], *lone], related("std"), related("coherence"), file
        )
    except ValueError as error:
        example = ", ".join(map(_example_of, (axes[0], *forms[0])))
        why = f"columns must describe those of {file!r}: {error}; as in {example!r}"
        return _FrfTable(tuple(one.name for one in forms[0]), refusal=why)
    others = [
        one
        for one in found
        if one.name not in used and (one.parsed.unknown or not one.parsed.quantity)
    ]
    left_out = tuple(one.name for one in others if not re.fullmatch(r"col\d+", one.name))
    if table.f.size:
        return table._replace(left_out=left_out)
    return None


def _assemble(
    axes: list[_Column],
    forms: list[tuple[_Column, ...]],
    others: list[tuple[_Column, ...]],
    deviations: list[_Column],
    coherences: list[_Column],
    file: str,
) -> tuple[_FrfTable, set[str]]:
    """Return an FRF, and the names of its columns or of compared ones; refuse unknown or
    contradicting columns.
    """
    _require_known_words(axes[0], forms[0], file)
    in_matlab = axes[0].name.rpartition(".")[2] == "wout"
    axis, *first = [_with_unit(one, file, in_matlab=in_matlab) for one in (axes[0], *forms[0])]
    f, G, (divisor, unit) = (
        convert(axis.parsed, axis.x),
        _complex_numbers(first),
        _unit_of_parts(first),
    )
    same_axes = [one for one in axes[1:] if not _is_unclear(one)]
    if differing := [
        one for one in same_axes if not np.allclose(convert(one.parsed, one.x), f, rtol=_SAME_FRF)
    ]:
        raise ValueError(
            f"the frequencies {axis.name!r} and {differing[0].name!r} contradict each other"
        )
    names = {one.name for one in first}
    clear = [
        form
        for form in others
        if not any(map(_is_unclear, form)) and not names >= {one.name for one in form}
    ]
    for form in clear:
        _require_same(G, first, form)
    for form in others:
        is_open = any(map(_is_unclear, form)) and not any(one.parsed.unknown for one in form)
        if is_open and [one.parsed.quantity for one in form] == [
            one.parsed.quantity for one in first
        ]:
            a, b = next(
                pair for pair in zip(first, form, strict=True) if pair[0].name != pair[1].name
            )
            raise ValueError(f"{a.name!r} and {b.name!r} may both be the {a.parsed.quantity}")
    own = next(one.parsed.unit for one in first if one.parsed.quantity != "phase")
    known = [
        (one, x) for one in deviations if (x := _deviation_of(one, np.abs(G), own)) is not None
    ]
    # the other part of G has the same deviation
    n_parts = 2 if len(known) == 1 and known[0][0].parsed.part else 1
    coherences = [one for one in coherences[:1] if not one.parsed.unknown]
    used = np.flatnonzero(np.isfinite(G) & (f > 0) & (G != 0))[
        :: 1 if np.nanargmax(f) > np.nanargmin(f) else -1
    ]
    table = _FrfTable(
        columns=tuple(one.name for one in first),
        f=f[used],
        G=G[used] / divisor,
        std=np.sqrt(n_parts * sum(x**2 for _, x in known))[used] / divisor if known else None,
        coherence=convert(coherences[0].parsed, coherences[0].x)[used] if coherences else None,
        unit=unit,
    )
    return table, {
        one.name
        for some in (first, *clear, [axis, *same_axes], [one for one, _ in known], coherences)
        for one in some
    }


def _is_monotone(x: np.ndarray) -> bool:
    """Return whether numbers rise or fall throughout."""
    steps = np.diff(x[np.isfinite(x)])
    return bool(abs(np.sign(steps).sum()) == max(steps.size, 1))


def _is_unclear(column: _Column) -> bool:
    """Return whether words of a column are unknown, or a unit without which its numbers have no
    meaning.
    """
    one = column.parsed
    return bool(one.unknown) or (
        one.unit is None and one.quantity in ("frequency", "magnitude", "phase")
    )


def _example_of(column: _Column) -> str:
    """Return a column in the syntax of the option."""
    key = next(key for key, quantity in _KEYS.items() if quantity == column.parsed.quantity)
    if _is_unclear(column):
        unit = {"f": " [Hz]", "mag": " [dB]", "phase": " [deg]"}.get(key, " [1]")
    else:
        unit = ""
    return f"{key}={column.name}{unit}"


def _require_known_words(axis: _Column, form: Sequence[_Column], file: str) -> None:
    """Refuse unknown words; words that all parts share name the measured quantity, and are warned
    of.
    """
    shared = set.intersection(
        *({*one.parsed.unknown} & {*one.parsed.of_what.split()} for one in form)
    )
    for one in (axis, *form):
        if one is axis:
            named = []
        else:
            named = [word for word in shared if word.isalpha() or word.isdigit()]
        if unknown := [
            word
            for word in one.parsed.unknown
            if word not in named or ROLES.get(word.lower()) == "no_name"
        ]:
            raise ValueError(f"{unknown[0]!r} in {one.name!r} is not known")
    if shared and form[0].parsed.quantity != "complex":
        names = join_names([repr(one.name) for one in form])
        data_warning(
            f"{' '.join(form[0].parsed.unknown)!r} in {names} of {file!r} is taken as the measured"
            " quantity"
        )


def _with_unit(column: _Column, file: str, *, in_matlab: bool = False) -> _Column:
    """Return a column with its unit; without a stated one the likely one, with a warning, or a
    refusal.

    In MATLAB `[mag, phase, wout] = bode(sys)` gives ratios and degrees.
    """
    x, quantity = column.x, column.parsed.quantity
    if in_matlab or np.nanmax(np.abs(x)) > TURN:
        degrees = "degrees", "radians"
    else:
        degrees = "radians", "degrees"
    likely = {
        "frequency": ("Hz", "rad/s"),
        "magnitude": ("ratio" if in_matlab else "dB", "a ratio"),
        "phase": degrees,
    }
    if column.parsed.unit or quantity not in likely:
        return column
    taken, other = likely[quantity]
    if taken == "dB" and not np.mean(x[np.isfinite(x)] < 0) > _MIN_NEGATIVE:
        raise ValueError(f"{column.name!r} names no unit and may be in dB, or a ratio, [1]")
    if not in_matlab:
        data_warning(
            f"{column.name!r} of {file!r} names no unit and is taken for {taken}, not {other}:"
            " write the unit behind the name, as in 'phase [rad]', 'gain [dB]'"
        )
    return column._replace(parsed=column.parsed._replace(unit=parse_unit(taken)))


def _complex_numbers(form: Sequence[_Column], G: np.ndarray | None = None) -> np.ndarray:
    """Return G in SI units from its parts; a magnitude or phase alone is completed by the other
    part of `G`.
    """
    x = {one.parsed.quantity: convert(one.parsed, one.x) for one in form}
    if "real" in x:
        if form[0].parsed.inverse != form[1].parsed.inverse:
            raise ValueError(
                f"only one of {form[0].name!r} and {form[1].name!r} belongs to an inverse, 1/G"
            )
        z = x["real"] + 1j * x["imaginary"]
        if form[0].parsed.inverse:
            return 1 / z
        return z
    if G is None:
        size, angle = np.ones(1), np.zeros(1)
    else:
        size, angle = np.abs(G), np.angle(G)
    if "complex" in x:
        return x["complex"]
    return x.get("magnitude", size) * np.exp(1j * x.get("phase", angle))


def _unit_of_parts(form: Sequence[_Column]) -> tuple[float, str]:
    """Return factor to SI and name of the unit of G: the unit of all parts, else one without
    prefixes.
    """
    parts = [one.parsed for one in form if one.parsed.quantity != "phase"]
    units = [one.unit or Unit(1.0, (("unknown", 1),)) for one in parts]
    if len({unit.powers for unit in units}) > 1:
        raise ValueError(
            f"{form[0].name!r} and {form[1].name!r} must be in one unit, or units of one kind"
        )
    unit = units[0]
    name = re.sub("^(?:dB.*|%|1)$", "", units[0].text if parts[0].scale == 1 else "")
    divisor = unit.factor if unit.powers and not unit.decades else 1.0
    if len({one.factor for one in units}) > 1:
        divisor = 1.0
        name = re.sub(
            r"[^\W\d_]+", lambda some: (find_symbol(some[0]) or ("", "", some[0]))[2], name
        )
    top, slash, bottom = name.rpartition("/")
    if slash:
        inverted = f"{bottom}/{top}"
    else:
        inverted = name and f"1/{name}"
    if parts[0].inverse:
        return 1 / divisor, inverted
    return divisor, name


def _require_same(G: np.ndarray, first: Sequence[_Column], form: Sequence[_Column]) -> None:
    """Refuse two forms of G that contradict each other by more than the digits of their columns."""
    other, tolerance = _complex_numbers(form, G), _SAME_FRF * np.abs(G)
    for columns, value in ((first, G), (form, other)):
        moved = [one._replace(x=one.x + _last_decimal(one.x)) for one in columns]
        tolerance = tolerance + np.abs(_complex_numbers(moved, G) - value)
    n_off = np.count_nonzero(np.abs(other - G) > tolerance)  # missing numbers do not count
    if n_off > max(1.0, _MAX_OUTLIERS * G.size):
        names = (join_names([repr(one.name) for one in columns]) for columns in (first, form))
        raise ValueError(f"{' contradict '.join(names)} in {n_off} of {G.size} lines")


def _last_decimal(x: np.ndarray) -> float:
    """Return the last decimal of written numbers; 0 if they have many digits."""
    kept = x[np.isfinite(x)]
    return next(
        (10.0**-k for k in range(12) if np.allclose(np.round(kept, k), kept, rtol=1e-12, atol=0)),
        0.0,
    )


def _deviation_of(column: _Column, size: np.ndarray, own: Unit | None) -> np.ndarray | None:
    """Return the standard deviation of G or of a part in SI units; None if its unit does not fit
    that of G.
    """
    unit = column.parsed.unit or (None if own and own.decades else own or Unit(1.0))
    if unit is None or column.parsed.unknown:
        return None
    is_share = not unit.powers and unit.factor < 1 and unit != own  # not if G is in percent, too
    is_relative = unit.decades > 0 or is_share or suits("phase", unit)
    if not is_relative and (
        unit.powers != (own or Unit(1.0)).powers or (not unit.powers and unit.factor == 0.01)
    ):
        return None
    if unit.decades:
        x = 10 ** (unit.decades * np.abs(column.x)) - 1
    else:
        x = unit.factor * np.abs(column.x)
    return np.asarray(x * size if is_relative else x)


def describe_frfs(tables: dict[str, _FrfTable]) -> tuple[str, tuple[str, ...]]:
    """Describe the FRFs of a file and what the first one lacks; return also the options that it
    needs.
    """
    if not tables:
        return "", ()
    (label, frf), *others = tables.items()
    if frf.refusal:
        return f"FRF:   in {' and '.join(map(repr, frf.columns))}\nneeds: {frf.refusal}", (
            "--columns",
            "COLUMNS",
        )
    about = (
        f"FRF:   {frf.f.size} lines from {frf.f[0]:g} to {frf.f[-1]:g} Hz in"
        f" {' and '.join(map(repr, frf.columns))}"
    )
    about += "".join(f", and of {other!r}" for other, _ in others)
    about += (
        f"; not part of it: {', '.join(map(repr, frf.left_out))}"
        if frf.left_out and not others
        else ""
    )
    channel = ("--channel", label) if others else ()
    if frf.std is not None:
        return about, channel
    if frf.coherence is None:
        missing, option = "relative_std", "relative-std"
    else:
        missing, option = "n_averages", "averages"
    return f"{about}\nneeds: {_NEEDS[missing]}", (f"--{option}", option.upper(), *channel)
