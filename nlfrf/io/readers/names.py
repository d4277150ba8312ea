"""The grammar of names and units of columns, variables, channels and attributes, each parsed as a
whole.

    name = [sign or inverse] quantity [of what] [unit or scale in brackets, behind a mark or a
    blank] unit = [factor] symbol [power] { "*" or "/" symbol [power] }, or a scale of ratios as dB

Tables, records, arrays, structs and attributes share the tables below. A word in none of them is
kept as `unknown`: the caller decides whether it is the name of a thing, or asks the user.
"""

from __future__ import annotations

import re
import unicodedata
from collections import Counter, defaultdict
from functools import lru_cache
from math import log, pi
from typing import NamedTuple

import numpy as np

TURN = 2 * pi
_MAX_LENGTH = 200  # most characters of a name or a unit
_PREFIXES = {
    "": 1.0,
    "p": 1e-12,
    "n": 1e-9,
    "u": 1e-6,
    "μ": 1e-6,
    "m": 1e-3,
    "k": 1e3,
    "K": 1e3,
    "M": 1e6,
    "G": 1e9,
    "nano": 1e-9,
    "micro": 1e-6,
    "milli": 1e-3,
    "centi": 1e-2,
    "kilo": 1e3,
    "mega": 1e6,
    "giga": 1e9,
}
#: Decades of a ratio per unit of a scale: `log10` and `ln` are for the ratio itself, dB10 for a
#: power.
_SCALES = {
    **dict.fromkeys(("dB", "dB20", "decibel", "decibels"), 1 / 20),
    **dict.fromkeys(("Np", "neper", "nepers", "ln"), 1 / log(10)),
    **dict.fromkeys(("log10", "lg"), 1.0),
    **dict.fromkeys(("B", "bel"), 1 / 2),
    "dB10": 1 / 10,
    "dNp": 0.1 / log(10),
    "cNp": 0.01 / log(10),
}
#: Units by their spellings: factor to base units, and powers of these. A base unit is its own
#: symbol.
_UNITS = {
    "rad radian radians": (1.0, "rad"),
    "deg ° degree degrees Deg Grad": (
        TURN / 360,
        "rad",
    ),  # Grad is German for degree; grad may be the gon
    "gon gons gradian gradians": (TURN / 400, "rad"),
    "rev revs revolution revolutions turn turns cycle cycles cyc tr": (TURN, "rad"),
    "arcmin": (TURN / 21600, "rad"),
    "arcsec": (TURN / 1296000, "rad"),
    "Hz hertz cps": (TURN, "rad s-1"),
    "rpm CPM": (TURN / 60, "rad s-1"),
    "s sec secs second seconds sekunde sekunden": (1.0, "s"),
    "min mins minute minutes": (60.0, "s"),
    "h hr hrs hour hours": (3600.0, "s"),
    "d day days": (86400.0, "s"),
    "week weeks": (604800.0, "s"),
    "m meter meters metre metres": (1.0, "m"),
    "cm": (0.01, "m"),
    "in inch inches": (0.0254, "m"),
    "ft foot feet": (0.3048, "m"),
    "mil mils": (25.4e-6, "m"),
    "l L": (1e-3, "m3"),
    "kg": (1.0, "kg"),
    "lb": (0.45359237, "kg"),
    "N newton newtons": (1.0, "kg m s-2"),
    "lbf lbs": (4.4482216152605, "kg m s-2"),
    "Nm J": (1.0, "kg m2 s-2"),
    "Ncm": (0.01, "kg m2 s-2"),
    "Nmm": (0.001, "kg m2 s-2"),
    "W watt watts VA": (1.0, "kg m2 s-3"),
    "Pa": (1.0, "kg m-1 s-2"),
    "bar": (1e5, "kg m-1 s-2"),
    "psi": (6894.757293168, "kg m-1 s-2"),
    "A amps ampere amperes App Arms Apk": (1.0, "A"),
    "V volt volts Vpp Vrms Vpk Vp": (1.0, "kg m2 s-3 A-1"),
    "Ohm ohm ohms Ω ω": (1.0, "kg m2 s-3 A-2"),
    "S siemens mho": (1.0, "kg-1 m-2 s3 A2"),
    "F": (1.0, "kg-1 m-2 s4 A2"),
    "H": (1.0, "kg m2 s-2 A-2"),
    "T": (1.0, "kg s-2 A-1"),
    "Wb Vs": (1.0, "kg m2 s-2 A-1"),
    "C As": (1.0, "A s"),
    "Ah": (3600.0, "A s"),
    "K": (1.0, "K"),
    "°C degC": (1.0, "celsius"),
    "°F degF": (1.0, "fahrenheit"),
    "g gn": (1.0, "g"),  # gravity or gram: it is compatible with itself only
    "sample samples sa smp": (1.0, "sample"),
    "count counts cnt cnts inc incr incs increment increments tick ticks digit digits LSB raw": (
        1.0,
        "count",
    ),
    "strain": (1.0, "strain"),
    "FS eu pu px div step bit bits bool sequence mic": (1.0, "unit"),
    "% percent prozent pct": (1e-2, ""),
    "‰": (1e-3, ""),
    "ppm": (1e-6, ""),
    "π pi": (pi, ""),
    "1 - abs lin lin. linear ratio none unitless dimensionless n/a": (1.0, ""),
}
_RATIOS = ("1", *[*_UNITS][-1].split())  # units of a ratio
#: Mark, number, exponent, symbol, power. A symbol ends with its word, or a long one could be cut in
#: too many ways.
_FACTOR = (
    r"([/*·×⋅.x]|\bper\b|)\s*(?:(?<![^\W\d_xπ])(\d+(?:\.\d+)?(?:e[-+]?\d+)?(?![\d.]))(?:\^(-?\d+))?"
    r"|(°[CF]?|%|‰|[^\W\d_]+(?![^\W\d_]))"
    r"(?:(?:\^|\*\*)?(-[1-4]|(?:[2-4]|(?<=[*^])1)(?!\d)))?)\s*"
)


class Unit(NamedTuple):
    """A unit: factor to base units and their powers, decades of a ratio per unit of a scale, and
    its text.
    """

    factor: float
    powers: tuple[tuple[str, int], ...] = ()
    decades: float = 0.0
    text: str = ""


@lru_cache(1)
def _known_symbols() -> dict[str, tuple[float, str, str]]:
    """Return factor, powers and symbol by spelling, also in lower case if a prefix keeps its own
    letter.
    """
    units = {symbol: (*one, symbol) for names, one in _UNITS.items() for symbol in names.split()}
    found = {
        prefix + symbol: (scale * one[0], *one[1:])
        for prefix, scale in _PREFIXES.items()
        for symbol, one in units.items()
    }
    small = {
        prefix + symbol.lower(): found[prefix + symbol]
        for prefix in _PREFIXES
        for symbol in units
        if len(symbol) > 1 and symbol != "Grad" and prefix != "m"
    }
    return small | found | units


def find_symbol(symbol: str) -> tuple[float, str, str] | None:
    """Return factor, powers and bare symbol of a unit in one word."""
    known = _known_symbols()
    others = (symbol.lower(), symbol[0] + symbol[1:].lower()) if len(symbol) > 1 else ()
    return next((known[one] for one in (symbol, *others) if one in known), None)


@lru_cache(4096)
def parse_unit(written: str) -> Unit | None:
    """Parse a unit without its brackets; None if it is no unit, or ambiguous.

    >>> [parse_unit(one).factor for one in ("mm/N", "kOhm", "x10 s", "m/(N*s2)", "percent")]
    [0.001, 1000.0, 10.0, 1.0, 0.01]
    >>> parse_unit("dB").decades, parse_unit("dB re 1 mm/N").factor, [parse_unit(one) for one in ("grad", "mhz", "R1")]
    (0.05, 0.001, [None, None, None])
    """
    if len(written) > _MAX_LENGTH:
        return None
    written = _normalize(written).strip()
    if written in _SCALES or (len(written) > 1 and written.lower() in map(str.lower, _SCALES)):
        return Unit(
            1.0,
            (),
            _SCALES.get(written) or {one.lower(): _SCALES[one] for one in _SCALES}[written.lower()],
            written,
        )
    if found := re.fullmatch(r"dB\s*(?:re[fl]?\.?\s*1?\s*(.+)|\((.+)\)|(Ω|Ohm))", written, re.I):
        of = parse_unit(found[1] or found[2] or found[3])
        return of and of._replace(decades=_SCALES["dB"])
    if written.lower() in _RATIOS:
        return Unit(1.0, text=written)
    turned = str.maketrans("*·×⋅. /", "//////*")
    flat = re.sub(
        r"/\s*\(([^()]*)\)", lambda some: "/" + some[1].strip().translate(turned), written
    )
    flat = re.sub(r"^\(([^()]*)\)", r"\1", flat)
    if re.fullmatch(f"(?:{_FACTOR})+", flat):
        factors = re.findall(_FACTOR, flat)
    else:
        factors = []
    scale, powers = 1.0, Counter[str]()
    for mark, number, exponent, symbol, power in factors:
        n = int(power or exponent or 1) * (-1 if mark in ("/", "per") else 1)
        if symbol:
            one = find_symbol(symbol)
        else:
            one = float(number), "", ""
        if one is None or (number and mark in ("/", "per")):
            return None
        scale *= one[0] ** n
        powers.update(
            {base: n * int(k or 1) for base, k in re.findall(r"([a-z]+)(-?\d*)", one[1], re.I)}
        )
    has_symbol = any(symbol for _, _, _, symbol, _ in factors)
    if has_symbol:
        return Unit(
            scale, tuple(sorted((base, n) for base, n in powers.items() if n)), 0.0, written
        )
    return None


def _parse_powers(written: str) -> tuple[tuple[str, int], ...]:
    """Return the powers of base units in a unit, none if it is unknown."""
    unit = parse_unit(written)
    if unit:
        return unit.powers
    return ()


def parse_bracket(head: str, inside: str) -> Unit | None:
    """Parse the unit in brackets behind a name; None also for a node or a part of a circuit, as in
    V(in), I(m).
    """
    unit, of = parse_unit(inside), {"V": "V", "I": "A"}.get(head)
    if of and unit and unit.powers != _parse_powers(of):
        return None
    return unit


def _normalize(written: str) -> str:
    """Return a name without accents and with one spelling of minus signs, primes, degrees and
    squares.
    """
    written = re.sub(
        "[ºᵒ˚]", "°", re.sub("(?<!⁻)²", "^2", written.replace("ℜ", "Re").replace("ℑ", "Im"))
    )
    written = "".join(
        one for one in unicodedata.normalize("NFKD", written) if not unicodedata.combining(one)
    )
    return re.sub("[′’‘´`]", "'", re.sub('"|″', "''", re.sub("[−–—]", "-", written)))


#: Words by meaning. If a name has several quantities, the first one here decides: "gain: real" is a
#: real part.
_QUANTITIES = {
    "std": "std stdev stddev sigma σ",
    "coherence": "coh coherence koharenz γ gamma msc",
    "phase": (
        "phase pha phas phz ph phi φ ϕ theta θ angle ang cang arg argument fase winkel phasen"
        " phasenwinkel phasengang"
    ),
    "imaginary": "im imag img imaginary imaginar imaginaire imaginarteil reactance",
    "real": "re real rea reel reelle realteil resistance",
    "magnitude": (
        "mag magnitude magn gain ampl amplitude amp abs mod modulus ratio impedance betrag"
        " verstarkung amplitudengang ganancia guadagno"
    ),
    "frequency": (
        "f w freq freqs frequency frequencies frequenz frequence frecuencia frequenza frequentie"
        " omega ω wout"
    ),
}
#: Signs, inverses of G and ("loss") of its magnitude, powers, words without meaning, and words
#: never ignored.
_WORDS = {
    "minus": "minus neg negative negated",
    "conjugate": "conj conjugate conjugated",
    "lag": "lag lagging",
    "lead": "lead leading",
    "inverse": "inverse inv reciprocal",
    "loss": "attenuation attn loss",
    "squared": "squared square",
    "power": "power",
    "log": "log",
    "filler": (
        "of the in part component value values response data frf wrapped unwrapped shift linear as"
        " function axis insertion return transmission"
    ),
    "no_name": (
        "normalized normalised normiert scaled relative rel error err delta difference margin slope"
    ),
}
ROLES = {word: role for role, listed in (_WORDS | _QUANTITIES).items() for word in listed.split()}
#: Replacements in a name, in this order, before its words are looked up; ⟪⟫ enclose the object of a
#: quantity.
_REWRITTEN = (
    (r"standard[ _]deviation|std\.?[ _]dev\b\.?", " std "),
    (r"(?:frequency|freq)[ _]?response(?:[ _]?function)?|transfer[ _]?function", " "),
    (r"([12])0\s*[*·.]?\s*log(?:10)?(?![^\W_])", r" dB\g<1>0 "),
    (r"loss[ _]modulus", " imag "),
    (r"storage[ _]modulus", " real "),
    (r"(?<![^\W_])([^\W\d_])''(?:\([ab]\))?", r" imag ⟪\1⟫ "),
    (r"(?<![^\W_])([^\W\d_])'(?:\([ab]\))?", r" real ⟪\1⟫ "),  # for a + j b
    (r"\^\s*2(?!\d|[^\[(]*[\])])", " squared "),  # but not in a unit
    (r"\(\*\)", "(°)"),  # spelling of some programs
    (r"∠", " phase "),
    (r"(?<![^\W_])([SZYG])\((\d)[,;](\d)\)", r"\1\2\3"),
    (r"_rad_(?:per_)?s(?:ec)?$", " rad/s"),
    (r"(?<![^\W_])([^\W\d_]\d{0,2})\((?:f|s|z|[ij][*·]?[wω])\)", r"\1"),  # H(f), G(jw)
    (r"^([^\[(|]*[^\W_])\.(?=[^\W\d])", r"⟪\1⟫ "),  # the struct of a variable
    (r"(?:^|(?<=[(=:\[\s|]))-(?=[^\s\d\-\])])|^-", " minus "),
    (r"(?<![\w.^])1\s*/\s*(?=[^\W\d]|[|(])", " inverse "),
    (r"\|\s*([^|]+?)\s*\|", r" abs(\1)"),
)
#: Functions of the object of a quantity: "Re(Z)", "dB(S(2,1))".
_FUNCTION = re.compile(
    r"(?<![^\W_])(re|im|real|imag|imaginary|abs|arg|ang|angle|phase|mag|magnitude|db|conj|(?:c?ang)_(?:deg|rad))"
    r"\(((?:[^()]|\([^()]*\))+)\)",
    re.I,
)
_BRACKET = re.compile(r"\s*(?:\[([^\[\]]*)\]|\(((?:[^()]|\([^()]*\))*)\)|\{([^{}]*)\})")
_TAIL = re.compile(r"(?<=[\w)'⟫\]>|])(?:\s*([/_,])\s*|\s+(?:-\s+|(in)\s+)?)(?=[^\s(\[⟪-])")
#: Borders of words written as one: "Zmod", "ReZ", "FreqHz", "MagdB".
_GLUED = re.compile(
    r"(?<=(?<![^\W\d_])[ZYGH])(?=(?:re|im|img|mod|abs|mag|ph|phz|phase|arg|real|imag)(?![^\W\d_]))|"
    r"(?<=[^\W\d_][a-z])(?=[A-Z][a-z]|[A-Z]{2}|dB|[ZYGH](?![^\W_]))"
)
_SOCKET = r"(?:channel|chan|ch|trace|trc|tr|kanal)\s*\d*(?![^\W_])"
_WORD = re.compile(
    rf"[⟪⟫()\[\]]|{_SOCKET}|log10|dB[12]0|[^\W\d_]+\d*|\d+(?:\.\d+)?|[^\w\s:;,./#()\[\]{{}}+=<>-]",
    re.I,
)


class ColumnName(NamedTuple):
    """Parsed name of a column: its quantity and how to use the numbers.

    The quantity is one of `_QUANTITIES`, "complex", "level" for a signal, or empty; `part` is that
    of a standard deviation. With `inverse` the numbers belong to 1/G, with `is_conjugate` to its
    conjugate; `scale` is their power of G. `label` is common to the columns of one FRF: `of_what`,
    and the socket. `unknown` are words in no table, hence names of a thing, or words that must not
    be ignored.
    """

    quantity: str = ""
    part: str = ""
    sign: int = 1
    inverse: bool = False
    is_conjugate: bool = False
    scale: float = 1.0
    unit: Unit | None = None
    of_what: str = ""
    label: str = ""
    unknown: tuple[str, ...] = ()


@lru_cache(4096)
def parse_name(name: str, stated: str = "", *, is_complex: bool = False) -> ColumnName:
    """Parse the name of a column, with the unit that the file states apart from the name.

    Spellings of one meaning are first rewritten to one, with ⟪⟫ around the object of a quantity.
    The unit is then split off, each other word gets its role from `ROLES`, and `_combine` decides.
    `is_complex` is for a column of complex numbers, which needs no word for its quantity.

    >>> column = parse_name("-Im(Z)/Ohm")
    >>> column.quantity, column.sign, column.unit.text, column.of_what, column.unknown
    ('imaginary', -1, 'Ohm', 'Z', ())
    >>> [parse_name(name).quantity for name in ("CH2 Phase lag (deg)", "Temp (°C)", "Zmod", "S11(DB)", "Z/Ohm", "dB")]
    ['phase', '', 'magnitude', 'magnitude', 'magnitude', 'magnitude']
    """
    if len(name) > _MAX_LENGTH:
        return ColumnName(unknown=(name,))
    # the readers of files append ".2", ".3" to a name that occurs again
    written = _normalize(re.sub(r"\.\d+$", "", name)).strip()
    if _is_scale(written):
        unit_text, written = written, ""
    else:
        unit_text, written = stated, written
    for pattern, other in _REWRITTEN:
        written = re.sub(pattern, other, written, flags=re.I)
    # functions of functions: once for each level of brackets
    while (inner := _FUNCTION.sub(_rewrite_function, written)) != written:
        written = inner
    if unit_text:
        unit_text, written = unit_text, written
    else:
        unit_text, written = _split_unit(written)
    found: defaultdict[str, list[str]] = defaultdict(list)
    # depth in ⟪⟫ and in brackets; is_first holds up to the first word with a meaning
    depth, brackets, last, is_first = 0, 0, "", True
    for token in _WORD.findall(_GLUED.sub(" ", written)):
        depth += {"⟪": 1, "⟫": -1}.get(token, 0)
        brackets += {"(": 1, "[": 1, ")": -1, "]": -1}.get(token, 0)
        role = ROLES.get(token.lower(), "filler" if token in "⟪⟫()[]" else "name")
        if is_complex and token.lower() == "in":
            role = "name"  # V(in)
        elif re.fullmatch(_SOCKET, token, re.I):
            role = "socket"
        elif (role == "minus" and last.isdigit()) or (
            role in _QUANTITIES and len(token) == 1 and not is_first
        ):
            role = "name"  # the direction of a node, "6 minus x"; the f of "H f"
        elif role == "name" and not depth and _is_scale(token):
            role = "unit"
        found[role].append(token)
        # the object of a quantity, and a symbol like Z or S11, names the FRF: nothing to ask about
        is_known = depth or (not brackets and re.fullmatch(r"[^\W\d_]|[A-Z]\d+", token))
        if role == "no_name" or (role == "name" and not is_known):
            found["unknown"].append(token)
        last, is_first = token, is_first and (depth > 0 or role in ("filler", "unit"))
    return _combine(found, unit_text, is_complex)


def _combine(found: defaultdict[str, list[str]], unit_text: str, is_complex: bool) -> ColumnName:
    """Return the combined meaning of the words of a name; words that do not fit are unknown."""
    names = found["name"] + found["no_name"]
    unit_text = unit_text or next(iter(found["unit"]), "")
    unit, named = parse_unit(unit_text), [one for one in _QUANTITIES if found[one]]
    named = (
        ["phase"] * bool(found["lag"] + found["lead"]) + ["magnitude"] * bool(found["loss"]) + named
    )
    quantity = next(
        (one for one in _QUANTITIES if one in named),
        "" if found["unknown"] else _quantity_of_unit(unit, names),
    )
    if quantity == "magnitude" and unit and unit.powers in map(_parse_powers, "VAW"):
        return ColumnName(
            "level"
        )  # several Bode plotters write the amplitude of the excitation, too
    if is_complex:
        quantity, named, found["unknown"] = "complex", [], found["no_name"]
    if quantity == "std":
        part = next((one for one in named if one != "std"), "")
    else:
        part = ""
    logs = [one for one in found["unit"] if parse_unit(one) != unit] + found["log"]
    if quantity == "frequency":
        called = {one.lower() for one in found["frequency"]}
        if called & {"w", "omega", "ω", "wout"}:
            default = "rad/s"
        elif "f" in called:
            default = "Hz"
        else:
            default = ""
        if not unit_text:
            unit = parse_unit(default)
        if logs and all(one.lower() in ("log", "log10", "lg") for one in logs):
            unit, logs = (unit or Unit(TURN))._replace(decades=1.0), []
    if quantity == "magnitude" and found["squared"]:
        unit = unit or Unit(1.0)  # decibels are never squared
    in_scale = unit is not None and unit.decades > 0
    n_squares = len(found["squared"]) + len(found["power"]) * (not in_scale)
    odd = {  # words without meaning for the quantity
        "lag": quantity != "phase",
        "lead": quantity != "phase",
        "loss": quantity != "magnitude",
        "inverse": quantity in ("std", "coherence", "frequency"),
        "power": quantity not in ("magnitude", "coherence"),
        "squared": (
            quantity not in ("magnitude", "coherence") or (in_scale and unit != parse_unit("dB10"))
        ),
        **{one: one not in (quantity, "magnitude", part) for one in _QUANTITIES},
    }
    unknown = found["unknown"] + [word for role in odd if odd[role] for word in found[role]]
    unknown += [one for one in logs if not (in_scale and one.lower() == "log")]
    unknown += [unit_text] * (bool(unit_text) and quantity != "" and not suits(quantity, unit))
    label = re.sub(r"(?<=[^\W\d_])(?=\d)", " ", " ".join(found["socket"] + names))
    return ColumnName(
        quantity,
        part,
        (-1) ** (len(found["minus"]) + len(found["lag"])),
        len(found["inverse"] + found["loss"]) % 2 == 1,
        len(found["conjugate"]) % 2 == 1,
        2.0**n_squares if quantity == "magnitude" else 1.0,
        unit,
        " ".join(names),
        label,
        tuple(unknown),
    )


def _quantity_of_unit(unit: Unit | None, names: list[str]) -> str:
    """Return the quantity implied by a unit alone, as in "dB", "S11(DEG)" and "Z/ohm"; empty for
    other units.
    """
    is_impedance = (
        names in (["Z"], ["Y"]) and unit and unit.powers in map(_parse_powers, ("Ohm", "S"))
    )
    if unit is not None and (unit.decades > 0 or is_impedance):
        return "magnitude"
    return next((one for one in ("phase", "frequency") if suits(one, unit)), "")


def suits(quantity: str, unit: Unit | None) -> bool:
    """Return whether a unit belongs to a quantity, or to "time"."""
    if unit is None:
        return False
    if quantity in ("frequency", "time"):
        return (
            unit.powers == ((("s", 1),) if quantity == "time" else (("rad", 1), ("s", -1)))
            or unit.decades == 1.0
        )
    if quantity == "phase":
        return not unit.decades and (
            unit.powers == (("rad", 1),) or (not unit.powers and unit.factor == pi)
        )
    return quantity in ("magnitude", "std") or (
        not unit.decades and (quantity != "coherence" or not unit.powers)
    )


def convert(column: ColumnName, x: np.ndarray) -> np.ndarray:
    """Return the numbers of a column in SI units, a frequency in Hz; sign, scale and inverse are
    applied.

    >>> convert(parse_name("Attenuation (dB)"), np.array([20.0])), convert(parse_name("f [rad/min]"), np.array([60.0]))
    (array([0.1]), array([0.15915494]))
    """
    unit = column.unit or Unit(1.0)
    turns = column.is_conjugate and column.quantity in ("phase", "imaginary")
    x = x * (-column.sign if turns else column.sign)
    x = unit.factor * (10 ** (unit.decades * x) if unit.decades else x)
    if column.quantity == "phase":
        if column.inverse:
            return -x
        return x
    with np.errstate(divide="ignore", invalid="ignore"):
        if column.quantity == "frequency":
            x = x / TURN
        elif column.scale != 1:
            x = x ** (1 / column.scale)
        if column.inverse and column.quantity in ("magnitude", "complex"):
            x = 1 / x
    if column.is_conjugate and column.quantity == "complex":
        return np.conj(x)
    return x


def _rewrite_function(found: re.Match[str]) -> str:
    """Return a function as words: its argument is the object of the quantity, a unit or a quantity:
    "Im(Ohm)".
    """
    argument = found[2].strip()
    is_unit = parse_unit(argument) and (argument in "°%" or len(argument) > 1)
    is_written = argument.islower() and found[1].lower() in ("phase", "angle", "mag", "magnitude")
    is_word = is_unit or (len(argument) > 1 and (is_written or argument.lower() in ROLES))
    if is_word:
        return f" {found[1]} [{argument}] "
    return f" {found[1]} ⟪{argument}⟫ "


def _split_unit(written: str) -> tuple[str, str]:
    """Split a name into the unit in it, in brackets or behind a mark or a blank, and the rest.

    >>> _split_unit("Gain [dB] (CH2)"), _split_unit("freq/Hz"), _split_unit("Re H"), _split_unit("mag_db")
    (('dB', 'Gain (CH2)'), ('Hz', 'freq'), ('', 'Re H'), ('db', 'mag'))
    """
    for found in reversed(list(_BRACKET.finditer(written))):
        inside = next((part for part in found.groups() if part), "").strip()
        head = written[: found.end() - len(found[0].lstrip())]
        if parse_bracket(head, inside) and (inside != "1" or found[1]):
            return inside, written[: found.start()] + written[found.end() :]
    for found in _TAIL.finditer(written):
        tail = written[found.end() :].strip()
        is_letter = (
            len(tail) == 1 and tail.isalnum()
        ) or tail == "in"  # a name, except behind a stroke or "in"
        if parse_unit(tail) and (found[1] == "/" or found[2] or not is_letter):
            return tail, written[: found.start()]
    return "", written


def _is_scale(word: str) -> bool:
    """Return whether a word is a unit of ratios, angles or frequencies, which names contain without
    brackets, too.
    """
    if len(word) > 1 or word in "°%":
        unit = parse_unit(word)
    else:
        unit = None
    return unit is not None and (
        unit.decades > 0 or suits("phase", unit) or suits("frequency", unit) or word == "%"
    )
