"""FRFs in files: the tables of Bode plotters and analysers, functions of universal files, complex arrays."""

from __future__ import annotations

import os
import re
from pathlib import Path
from typing import NamedTuple

import numpy as np

from nlfrf._base.arguments import MissingArgumentError, data_warning, require_positive
from nlfrf.bla.bla import Bla
from nlfrf.bla.from_frf import bla_from_frf
from nlfrf.io.channels import Channels, read_channels
from nlfrf.io.readers.clock import UNIT_SUFFIX

#: Words in the name of a column that say its quantity; the first quantity counts, as in "Trace 1: Gain: Real".
QUANTITIES = {
    "std": r"std\w*|sigma|σ",
    "coherence": r"coh\w*|kohärenz|γ²",
    "phase": r"pha\w*|winkel|phi|φ|ϕ|theta|θ|angle|arg(?:ument)?|deg\w*|grad|°|º",
    "real": r"re|real(?:teil|part)?|r[eé]el(?:le)?",
    "imaginary": r"im|imag\w*",
    "magnitude": r"mag\w*|gain|ampl\w*|amp|abs\w*|mod(?:ulus)?|betrag|verstärkung|ratio|db|\|",
    "frequency": r"f|freq\w*|fréq\w*|omega|ω|w|[kmg]?hz",
    "": r"m?rad(?:ians?)?|log|in|of",  # no quantity, and no part of the name of a channel either
}
PARTS = (("complex",), ("real", "imaginary"), ("magnitude", "phase"))  # of G, the first that is there counts
PHASES = ("imaginary", "phase")  # parts that go with the other part of their own channel only
WORDS = re.compile(r"[^\W\d_]+|\d+|[°º*%|]")
TURN = 2 * np.pi
#: Hz, radians and shares in units, which are words of a name or stand beside it; * is what some files make of °.
SCALES = {
    "frequency": {
        "Hz": 1.0,
        "hz": 1.0,
        "HZ": 1.0,
        "kHz": 1e3,
        "khz": 1e3,
        "KHz": 1e3,
        "MHz": 1e6,
        "GHz": 1e9,
        "mHz": 1e-3,
    }
    | dict.fromkeys(("rad", "omega", "Omega", "ω", "w"), 1 / TURN),
    "phase": {"rad": 1.0, "Rad": 1.0, "radian": 1.0, "radians": 1.0, "Radians": 1.0, "mrad": 1e-3}
    | dict.fromkeys(("deg", "Deg", "degree", "degrees", "Degrees", "grad", "Grad", "°", "º", "*"), TURN / 360),
    "coherence": {"%": 0.01},
    "magnitude": {"%": 0.01},
}
#: Units of a signal and not of a ratio: several Bode plotters write the amplitude of the excitation, too.
LEVEL_UNIT = re.compile(r"[munµμ]?[VAW](?:pp|pk|p|rms)?|dB(?:[mVu]|mV|µV|FS|SPL)\w*", re.I)
NO_UNIT = re.compile(r"dB.*|%|1|abs|lin(ear)?|ratio", re.I)  # of a ratio of like quantities
#: No FRF in dB lies between 0 and 1 throughout, none reaches 200; a phase of more turns without a unit is no radians.
MIN_DB, MAX_DB, MAX_TURNS = 1.0, 200.0, 20
SAME_FRF = 0.01  # relative difference of an FRF that a file holds in two forms
#: What a variance needs, and why.
NEEDS = {
    "n_averages": "a coherence gives a variance only with the number of independent averages, which the file lacks",
    "relative_std": "the file holds no coherence, and a swept sine shows no distortion, so nothing says how far G may "
    "be off. Give sqrt(E|G - E G|^2)/|G| by the scatter of repeated sweeps (0.1 dB is 0.012, 1 degree is 0.017), "
    "export the coherence, or measure with a multisine of nlfrf design, which shows the distortion",
}


class FrfTable(NamedTuple):
    """An FRF in a file: increasing frequencies [Hz], the names of the columns behind G, and the unit of G."""

    f: np.ndarray
    G: np.ndarray
    std: np.ndarray | None
    coherence: np.ndarray | None
    columns: tuple[str, ...]
    unit: str


def load_frf(
    path: str | os.PathLike[str],
    *,
    relative_std: float | None = None,
    n_averages: float | None = None,
    channel: str = "",
    hold: str = "unknown",
    fs: float | None = None,
) -> Bla:
    """Read an FRF that a Bode plotter or an analyser measured, with the variance that makes it a `Bla`.

    Parameters
    ----------
    path : path
        A table with frequencies [Hz] or [rad/s] and magnitude (ratio or dB) and phase, or real and imaginary part; a
        universal file with FRFs; an .npz or .h5 file with a complex array and its frequencies. Columns go by name.
    relative_std : float, optional
        Standard deviation of G over |G|, as a complex number: see `std` of `bla_from_frf`.
    n_averages : float, optional
        Independent averages behind the coherence, or sweeps behind the standard deviation.
    channel : str
        Which FRF, where the file has several: what the names of its columns share, as in "CH2".
    hold, fs
        As in `bla_from_frf`.

    Returns
    -------
    Bla
        As of `bla_from_frf`. Lines at 0 Hz and lines without numbers are left out.

    Raises
    ------
    ValueError
        A file without an FRF, several without `channel`, a unit that is not known, no variance.

    Warns
    -----
    DataWarning
        A column whose unit is not stated, with the unit that was taken.

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
    tables, name = find_frfs(file), Path(path).name
    if not tables:
        raise ValueError(
            "path must hold an FRF, by name: frequencies that rise or fall throughout, with magnitude and phase or "
            f"real and imaginary part, got {name!r} with {', '.join(file.arrays)}; call the columns as in "
            "'f [Hz],gain [dB],phase [deg]'; nlfrf inspect shows what a file holds"
        )
    wanted = "".join(WORDS.findall(channel)).lower()
    chosen = [one for one in tables if "".join(one.split()).lower() == wanted or not channel]
    if len(chosen) != 1:
        listed = ", ".join(map(repr, tables))
        raise ValueError(f"channel must name one of the FRFs of {name!r}, {listed}; got {channel or 'none'!r}")
    table = tables[chosen[0]]
    std = table.std if relative_std is None else require_positive("relative_std", relative_std) * np.abs(table.G)
    missing = "relative_std" if table.coherence is None else "n_averages"
    if std is None and (table.coherence is None or n_averages is None):
        raise MissingArgumentError(missing, NEEDS[missing])
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


def group_columns(file: Channels) -> dict[str, dict[str, str]]:
    """Return the columns of numbers by the label that their names share, then by quantity."""
    groups: dict[str, dict[str, str]] = {}
    for name, array in file.arrays.items():
        quantity, label = classify_column(name, file.unit(name))
        if array.dtype.kind in "fiuc" and np.squeeze(array).ndim == 1 and np.isfinite(array).any():
            groups.setdefault(label, {}).setdefault("complex" if array.dtype.kind == "c" else quantity, name)
    return groups


def find_frfs(file: Channels) -> dict[str, FrfTable]:
    """Find the FRFs in the channels of a file, each once, by what the names of their columns share."""
    groups = group_columns(file)
    whole = [label for label, group in groups.items() if not group.keys().isdisjoint(("complex", "real", "magnitude"))]
    shared = {  # what goes with any FRF of a file: frequencies and unlabelled columns; of one FRF all
        quantity: name
        for label, group in reversed(groups.items())
        for quantity, name in group.items()
        if quantity == "frequency" or (len(whole) == 1 and quantity != "std") or (not label and quantity not in PHASES)
    }
    tables: dict[str, FrfTable] = {}
    for label in whole:
        table = read_frf(file, shared | groups[label])
        same = [one.G for one in tables.values() if table and one.G.shape == table.G.shape]
        if table and not any(np.all(np.abs(G - table.G) <= SAME_FRF * np.abs(G)) for G in same):
            tables[label] = table
    return tables


def classify_column(name: str, unit: str) -> tuple[str, str]:
    """Return the quantity of a column, empty where it is none of an FRF, and the rest of its name.

    >>> classify_column("CH2 Amplitude (dB)", "dB"), classify_column("Amplitude (Vpp)", "Vpp")
    (('magnitude', 'CH 2'), ('', ''))
    """
    words = WORDS.findall(UNIT_SUFFIX.sub("", name))
    known = [
        quantity
        for some in (words, WORDS.findall(unit))
        for quantity, pattern in QUANTITIES.items()
        if any(re.fullmatch(pattern, word, re.I) for word in some) and not LEVEL_UNIT.fullmatch(unit)
    ]
    rest = [word for word in words if not any(re.fullmatch(one, word, re.I) for one in QUANTITIES.values())]
    return next(iter(known), ""), " ".join(rest)


def read_frf(file: Channels, names: dict[str, str]) -> FrfTable | None:
    """Read an FRF by the names of its columns; None where a part is missing or no frequencies go with it."""
    parts = next((some for some in PARTS if {*some, "frequency"} <= names.keys()), ("frequency",))
    x = {one: read_column(file, names[one], one) for one in (*parts, "frequency", "coherence", "std") if one in names}
    f, first, other = (x.get(one, np.zeros(0)) for one in ("frequency", parts[0], parts[-1]))
    steps = np.diff(f[np.isfinite(f)])
    if f is first or len({one.size for one in x.values()}) > 1 or abs(np.sign(steps).sum()) < max(steps.size, 1):
        return None
    G = first if len(parts) == 1 else first + 1j * other if "real" in parts else first * np.exp(1j * other)
    used = np.flatnonzero(np.isfinite(G) & (f > 0) & (G != 0))[:: 1 if np.nanargmax(f) > np.nanargmin(f) else -1]
    std, coherence = (x[one][used] if one in x else None for one in ("std", "coherence"))
    unit = NO_UNIT.sub("", file.unit(names[parts[0]]))
    return FrfTable(f[used], G[used], std, coherence, tuple(names[one] for one in parts), unit) if used.size else None


def read_column(file: Channels, name: str, quantity: str) -> np.ndarray:
    """Read a column in Hz, radians or as a ratio, by the unit that its name or the file states, else by its range."""
    x, unit = np.ravel(file.arrays[name]), file.unit(name)
    words = WORDS.findall(f"{name} {unit}")
    if quantity == "magnitude" and ("db" in map(str.lower, words) or np.nanmin(x) <= 0):
        return np.asarray(10 ** (x / 20))
    scales = SCALES.get(quantity, {})
    scale = next((scales[word] for word in reversed(words) if word in scales), None)
    if scale is None and quantity in ("frequency", "phase") and unit:
        data_warning(
            f"{name!r} of {Path(file.path).name!r} is in {unit}, where {', '.join(scales)} are known: left out"
        )
        return np.full(x.size, np.nan)
    if scale is None:
        taken, other, scale = unit_by_range(x, quantity)
        if taken and not unit:
            data_warning(
                f"{name!r} of {Path(file.path).name!r} names no unit and is taken for {taken}, not {other}: write the "
                "unit behind the name, as in 'phase [rad]', 'gain [dB]'"
            )
    return np.asarray((10**x if quantity == "frequency" and "log" in map(str.lower, words) else x) * scale)


def unit_by_range(x: np.ndarray, quantity: str) -> tuple[str, str, float]:
    """Return what a column without a unit is taken for, what it may be as well, both empty where it is sure; its scale.

    >>> unit_by_range(np.array([-0.1, 3.0]), "phase"), unit_by_range(np.array([0.0, 170.0, -170.0]), "phase")[0]
    (('radians', 'degrees', 1.0), '')
    """
    high, step = np.nanmax(np.abs(x)), np.nanmax(np.abs(np.diff(x)), initial=0.0)
    if quantity == "magnitude":
        return ("a ratio", "decibels", 1.0) if MIN_DB <= high <= MAX_DB else ("", "", 1.0)
    if quantity != "phase":
        return "", "", 1.0
    units = [("radians", 1.0), ("degrees", TURN / 360)]
    (other, _), (taken, scale) = units if high > TURN else units[::-1]
    wraps = step > (TURN if high > TURN else TURN / 2) or high > MAX_TURNS * TURN
    return ("", "", scale) if wraps else (taken, other, scale)


def describe_frfs(tables: dict[str, FrfTable]) -> tuple[str, tuple[str, ...]]:
    """Return what the FRFs of a file are and what the first lacks, in words, and the options that it needs."""
    if not tables:
        return "", ()
    (label, frf), *others = tables.items()
    about = f"FRF:   {frf.f.size} lines from {frf.f[0]:g} to {frf.f[-1]:g} Hz in {' and '.join(map(repr, frf.columns))}"
    about += "".join(f", and of {other!r}" for other, _ in others)
    channel = ("--channel", label) if others else ()
    if frf.std is not None:
        return about, channel
    missing, option = ("relative_std", "relative-std") if frf.coherence is None else ("n_averages", "averages")
    return f"{about}\nneeds: {NEEDS[missing]}", (f"--{option}", option.upper(), *channel)
