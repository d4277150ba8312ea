"""Tables and records composed of the parts of names and units, and of names that the grammar does
not know.

python -m benchmarks.names --files 3000 --seed 0   # counts, every other answer without a word, some refusals
python -m benchmarks.names --write 17 folder       # the file of one seed, and what became of it

Of each the truth is known. Right is G within 1 %, or the rate within 1e-6; warned is another answer
with a warning; refused one line. Counted are other answers without a word, of which there must be
none, and refusals of what is composed of the own parts of the grammar, also with foreign columns
beside: at most 3 %.
"""

from __future__ import annotations

import argparse
import enum
import re
import sys
import tempfile
import warnings
from collections import Counter
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

import nlfrf
from benchmarks.readers_here import readers_in_this_process

TOLERANCE, MOST_REFUSED = 0.01, 0.03
F = np.geomspace(2.0, 900.0, 40)
G = 3 / (1 - (F / 150) ** 2 + 0.1j * F / 150) * np.exp(-2j * np.pi * F * 3e-4)
FS, N = 1000.0, 200
U = np.tile(nlfrf.multisine(fs=FS, n_samples=N, f_min=5, f_max=200, rng=1).u[0], 4)
Y = np.convolve(U, [0.5, 0.3, 0.1])[: U.size]


class Outcome(enum.Enum):
    """What became of a file."""

    RIGHT = "right"
    WARNED = "another answer, with a word"
    REFUSED = "refused"
    WRONG = "ANOTHER ANSWER WITHOUT A WORD"


@dataclass
class Case:
    """One file: what is written, which kind it is, and what is right: a deviation, or a rate, or
    neither (refuse).
    """

    kind: str
    write: Callable[[Path], Path]
    about: str
    is_frf: bool = True
    is_own: bool = True  # composed of the own parts of the grammar
    may_be_read: bool = True  # else a contradiction, or something that nobody can know
    options: dict = field(default_factory=dict)
    std: np.ndarray | None = None
    gain: float = 1.0  # of G in the unit that all of its parts are in


# ---- The parts, each with what the numbers are

FREQUENCIES = {
    "Hz": F,
    "kHz": F / 1e3,
    "mHz": 1e3 * F,
    "MHz": F / 1e6,
    "rad/s": 2 * np.pi * F,
    "krad/s": 2e-3 * np.pi * F,
    "rad/min": 120 * np.pi * F,
    "rpm": 60 * F,
    "CPM": 60 * F,
    "deg/s": 360 * F,
    "rev/s": F,
    "x10 Hz": F / 10,
    "cycles/min": 60 * F,
    "rad/sec": 2 * np.pi * F,
    "Hertz": F,
    "10^3 rad/s": 2e-3 * np.pi * F,
    "KHZ": F / 1e3,
}
ANGLES = {
    "deg": 1.0,
    "°": 1.0,
    "rad": np.pi / 180,
    "mrad": np.pi / 0.18,
    "gon": 1 / 0.9,
    "turns": 1 / 360,
}
ANGLES |= {
    "pi rad": 1 / 180,
    "π rad": 1 / 180,
    "degrees": 1.0,
    "radians": np.pi / 180,
    "rev": 1 / 360,
    "arcmin": 60.0,
}
SCALES = {
    "dB": 20.0,
    "Np": np.log(10),
    "B": 2.0,
    "log10": 1.0,
    "decibel": 20.0,
    "dB20": 20.0,
    "dB10": 10.0,
}
RATIOS = {
    "V/V": 1.0,
    "%": 100.0,
    "1": 1.0,
    "mV/V": 1e3,
    "m/N": 1.0,
    "A/V": 1.0,
    "rad/Nm": 1.0,
    "ratio": 1.0,
    "ppm": 1e6,
}
UNITS = (
    "m/N",
    "Ohm",
    "(m/s^2)/N",
    "V/A",
    "rad/(N*m)",
    "S",
    "m/s/V",
    "g/N",
    "counts/V",
    "deg/A",
    "Nm/rad",
)
PREFIXES = {"": 1.0, "m": 1e3, "u": 1e6, "k": 1e-3, "µ": 1e6, "M": 1e-6}
FREQUENCY_WORDS = (
    "f",
    "Frequency",
    "Freq",
    "freq",
    "FREQUENCY",
    "Frequenz",
    "Fréquence",
    "frequency",
    "Freq.",
)
MAGNITUDE_WORDS = (
    "Gain",
    "Magnitude",
    "Mag",
    "Amplitude",
    "|G|",
    "abs(G)",
    "Betrag",
    "mag",
    "GAIN",
    "Modulus",
    "Amp",
)
PHASE_WORDS = (
    "Phase",
    "phase",
    "Phase angle",
    "arg(G)",
    "∠G",
    "Winkel",
    "Argument",
    "PHASE",
    "Phi",
    "Ang",
    "Theta",
)
REAL_WORDS = {
    "Re": "Im",
    "Real": "Imag",
    "Re(Z)": "Im(Z)",
    "Z'": "Z''",
    "Zreal": "Zimag",
    "Zre": "Zim",
    "real": "imaginary",
    "Re G": "Im G",
    "Real part": "Imaginary part",
    "ReZ": "ImZ",
    "Z_re": "Z_im",
    "H real": "H imag",
    "Réel": "Imaginaire",
    "Real(S21)": "Imag(S21)",
    "ℜ": "ℑ",
    "Z′": "Z″",
}
LABELS = ("", "", "", "CH2 ", "Trace 1: ", "S21 ", "Tr1 ", "Channel 1 ", "H ", "sys.")
FOREIGN = {
    "Temp (°C)": 21.5,
    "Status": 1.0,
    "Index": np.arange(40.0),
    "time/s": 3.0 * np.arange(40),
    "Comment": 0.0,
    "Amplitude (Vpp)": 0.5,
    "<I>/mA": 0.1,
    "cycle number": 1.0,
    "I Range": 11.0,
    "Level (dBm)": -10.0,
    "Err": 0.0,
    "Bias": 0.0,
    "Cs/µF": 1 / F,
    "Zsig": 1.0,
    "Settling (ms)": 20.0,
    "Group delay (s)": 3e-4,
    "THD (%)": 0.1,
    "Input (V)": 1.0,
    "Output (V)": np.abs(G),
    "Phase error (deg)": 0.2,
    "Gain margin (dB)": 6.0,
    "VSWR": 1.1,
    "Averages": 10.0,
    "Position (deg)": 90 + 0 * F,
    "Speed (rpm)": 1500 + 0 * F,
    "Harmonic": 1.0,
    "Valid": 1.0,
}
#: Words and units of real headers and of none that are in no table of the grammar, and what they do
#: to the numbers.
STRANGE_SCALES = {
    "dBr": lambda x: x + 17,
    "mB": lambda x: 100 * x,
    "dBc": lambda x: x - 30,
    "log2": lambda x: x / 6.02,
    "stops": lambda x: x / 6.02,
    "dB/10": lambda x: x / 10,
    "cB": lambda x: 10 * x,
    "dBFS": lambda x: x - 6,
    "octaves": lambda x: x / 6.02,
    "dBµ": lambda x: x + 120,
    "norm.": lambda x: x / 40,
    "a.u.": lambda x: x / 3,
    "‱": lambda x: 1e4 * 10 ** (x / 20),
    "1/16": lambda x: 16 * 10 ** (x / 20),
    "Q15": lambda x: 2**15 * 10 ** (x / 20),
}
STRANGE_ANGLES = {
    "grad": 1 / 0.9,
    "brad": 256 / 360,
    "mil": 17.8,
    "°/45": 1 / 45,
    "cdeg": 100.0,
    "sign": -1.0,
    "pu": 1 / 360,
    "LSB": 182.0,
    "ticks": 10.0,
    "% of turn": 1 / 3.6,
    "quadrants": 1 / 90,
    "h": 1 / 15,
    "s": 1e-3,
    "samples": 0.3,
    "x": 2.0,
}
STRANGE_FREQUENCIES = {
    "rad/sample": 2 * np.pi * F / 2000,
    "normalised": F / 1000,
    "x pi rad/sample": F / 1000,
    "BPM": 60 * F,
    "bins": F / 0.5,
    "decades": np.log10(F),
    "octaves": np.log2(F),
    "mhz": F / 1e6,
    "1/s": 2 * np.pi * F,
    "orders": F / 25,
    "cycles/sample": F / 2000,
    "FS/2": F / 1000,
    "s": F,
    "rad": 2 * np.pi * F,
    "fN": F / 1000,
    "kcps?": F / 1e3,
}
STRANGE_WORDS = {  # what they do to magnitude [dB] and phase [deg]
    "normalised": (-9.0, 1.0),
    "relative": (-9.0, 1.0),
    "scaled": (12.0, 1.0),
    "delta": (-9.0, 0.1),
    "error": (-60.0, 0.01),
    "margin": (6.0, 0.5),
    "residual": (-40.0, 0.1),
    "mirrored": (0.0, -1.0),
    "flipped": (0.0, -1.0),
    "swapped": (0.0, -1.0),
    "corrected": (3.0, 0.9),
    "smoothed": (0.5, 0.99),
    "tolerance": (-50.0, 0.1),
    "limit": (10.0, 1.0),
    "opposite": (0.0, -1.0),
    "return difference of": (-3.0, 0.5),
    "sensitivity of": (-3.0, 0.5),
    "per step": (-20.0, 0.1),
    "halved": (-6.0, 0.5),
}


NAMED = re.compile(r"[GHZ∠|]|S21")  # words that say of what, beside which no other label stands


def bracketed(rng, word, unit):
    """A name with its unit in any of the usual ways."""
    ways = (
        ["{} ({})", "{} [{}]", "{}({})", "{}[{}]", "{} in {}", "{}/{}"]
        if "/" not in word
        else ["{} ({})", "{} [{}]"]
    )
    if unit in ("1", "ratio"):
        ways = ["{} [{}]", "{}[{}]"]
    elif "/" in unit or " " in unit:
        ways = ways[:2]
    if unit in ("dB", "deg", "rad", "Hz", "kHz", "rpm"):
        ways += ["{} {}", "{}_{}"]
    return str(rng.choice(ways)).format(word, unit)


def frequency(rng):
    """A column of frequencies."""
    if rng.random() < 0.15:
        return ("omega", 2 * np.pi * F) if rng.random() < 0.5 else ("f", F)
    unit = str(rng.choice([*FREQUENCIES]))
    return bracketed(rng, str(rng.choice(FREQUENCY_WORDS)), unit), FREQUENCIES[unit]


def magnitude(rng, label):
    """A column of magnitudes, its unit behind it."""
    word = str(rng.choice([one for one in MAGNITUDE_WORDS if not (label and NAMED.search(one))]))
    x = np.abs(G)
    way = rng.random()
    if way < 0.1:
        word = str(
            rng.choice(
                [
                    "Attenuation",
                    "Loss",
                    "Inverse gain",
                    "Insertion loss",
                    *["1/|G|"] * (not label),
                ]
            )
        )
        x = 1 / x
    elif way < 0.15 and not label:
        return label + str(rng.choice(["|G|^2", "Magnitude squared", "|G|²"])), x**2
    elif way < 0.2 and not label:
        return label + str(rng.choice(["20*log10|G|", "20log10(|G|)", "20 log|G|"])), 20 * np.log10(
            x
        )
    if rng.random() < 0.7:
        unit = str(rng.choice([*SCALES]))
        x = (-1 if way > 0.95 else 1) * SCALES[unit] * np.log10(x)
        word = f"-{word}" if way > 0.95 and not label else word
        x = -x if way > 0.95 and label else x
    else:
        unit = str(rng.choice([*RATIOS]))
        x = RATIOS[unit] * x
    if way > 0.95 and not label and unit not in SCALES:
        word = word.removeprefix("-")
    return bracketed(rng, label + word, unit), x


def phase(rng, label):
    """A column of phases."""
    words = [one for one in PHASE_WORDS if not (label and NAMED.search(one))]
    word, x = str(rng.choice(words)), np.degrees(np.angle(G))
    x = np.degrees(np.unwrap(np.angle(G))) if rng.random() < 0.5 else x
    unit = str(rng.choice([*ANGLES]))
    way = rng.random()
    if way < 0.1:
        word, x = word + " lag", -x
    elif way < 0.2 and not label:
        word, x = str(rng.choice(["-", "−", "minus ", "neg "])) + word, -x
    elif way < 0.25:
        word, x = "conj " + word, -x
    return bracketed(rng, label + word, unit), ANGLES[unit] * x


def parts(rng, label):
    """Two columns of real and imaginary part."""
    words = [one for one in REAL_WORDS.items() if not (label and NAMED.search(one[0]))]
    real, imaginary = words[rng.integers(len(words))]
    x, y = G.real, G.imag
    way = rng.random()
    if way < 0.3 and not label:
        imaginary, y = str(rng.choice(["-", "−", "minus ", "neg "])) + imaginary, -y
    elif way < 0.4:
        imaginary, y = imaginary + " (conj)", -y
    if rng.random() < 0.6:
        unit = str(rng.choice(UNITS))
        a, b = (str(one) for one in rng.choice([*PREFIXES], 2))
        b = a if rng.random() < 0.7 or unit[0] in "(" else b
        a, b = ("", "") if unit[0] in "(grcdN" else (a, b)
        ways = "{} [{}]" if rng.random() < 0.5 else "{} ({})"
        columns = [
            (ways.format(label + one, p + unit), PREFIXES[p] * z)
            for one, p, z in ((real, a, x), (imaginary, b, y))
        ]
        return columns, (
            PREFIXES[a] if PREFIXES[a] == PREFIXES[b] else 1.0
        )  # in the unit of both, else in that without a prefix
    return [(label + real, x), (label + imaginary, y)], 1.0


def own_table(rng):
    """A table of the own parts of the grammar, some with foreign columns and a second form."""
    is_twice = rng.random() < 0.15
    label = "CH2 " if is_twice else str(rng.choice(LABELS))
    polar, (cartesian, gain) = [magnitude(rng, label), phase(rng, label)], parts(rng, label)
    columns, kind = (
        (cartesian, "own parts: real and imaginary")
        if rng.random() < 0.5
        else (polar, "own parts: polar")
    )
    may_be_read, std, gain = True, None, gain if columns is cartesian else 1.0
    if is_twice and not (unit_of(polar) or unit_of(cartesian)):
        columns, kind = [*cartesian, *polar], "two forms"
        if rng.random() < 0.5:
            k = int(rng.choice([1, 3]))
            columns[k] = (columns[k][0], -columns[k][1])
            kind, may_be_read = "two forms that contradict", False
    elif rng.random() < 0.25:
        unit, share = [("dB", 10**0.05 - 1), ("%", 0.1), ("deg", np.pi / 18)][rng.integers(3)]
        columns = [*columns, (f"Std ({unit})", {"dB": 1.0, "%": 10.0, "deg": 10.0}[unit] + 0 * F)]
        kind, std = f"{kind}, deviation", share * np.abs(G)
    if rng.random() < 0.4:
        kind += ", foreign columns"
        for name in rng.choice([*FOREIGN], rng.integers(1, 4), replace=False):
            columns.insert(rng.integers(len(columns) + 1), (str(name), FOREIGN[str(name)] + 0 * F))
    case = table_case(rng, kind, [frequency(rng), *columns], may_be_read=may_be_read, std=std)
    return replace(case, gain=gain)


def unit_of(columns):
    """Whether a form of G is in another unit than 1, which is not that of another form."""
    return any(
        one in name
        for name, _ in columns
        for one in ("/N", "Ohm", "V/A", "A/V", "S]", "S)", "/V", "/A", "/rad", "Nm")
    )


def table_case(rng, kind, columns, *, is_own=True, may_be_read=True, std=None):
    """A table as a file."""
    sep = str(rng.choice([",", ";", "\t"]))
    sep = sep if all(sep not in name for name, _ in columns) else "\t"
    digits = int(rng.choice([9, 12, 17]))
    head = sep.join(name for name, _ in columns)
    rows = "\n".join(
        sep.join(f"{x:.{digits}g}" for x in row)
        for row in zip(*(x for _, x in columns), strict=True)
    )
    suffix = str(rng.choice([".csv", ".txt", ".dat"]))

    def write(folder):
        path = folder / f"table{suffix}"
        path.write_text(f"{head}\n{rows}\n", encoding="utf-8")
        return path

    return Case(kind, write, head, is_own=is_own, may_be_read=may_be_read, std=std)


def strange_table(rng):
    """A table with one name that the grammar does not know, which changes what the numbers are."""
    db, degrees = 20 * np.log10(np.abs(G)), np.degrees(np.angle(G))
    axis, first, second = ("Frequency (Hz)", F), ("Gain (dB)", db), ("Phase (deg)", degrees)
    which = rng.integers(5)
    if which == 0:
        unit = str(rng.choice([*STRANGE_SCALES]))
        first = (bracketed(rng, "Gain", unit), STRANGE_SCALES[unit](db))
    elif which == 1:
        unit = str(rng.choice([*STRANGE_ANGLES]))
        second = (bracketed(rng, "Phase", unit), STRANGE_ANGLES[unit] * degrees)
    elif which == 2:
        unit = str(rng.choice([*STRANGE_FREQUENCIES]))
        axis = (bracketed(rng, "Frequency", unit), STRANGE_FREQUENCIES[unit])
    else:
        word = str(rng.choice([*STRANGE_WORDS]))
        shift, turn = STRANGE_WORDS[word]
        word = word.capitalize() if rng.random() < 0.5 else word
        ways = ("{0} {1}", "{1} {0}", "{1} ({0})", "{1}_{0}", "{1}, {0}")
        way = ways[rng.integers(len(ways))]
        if which == 3 or shift:
            first = (way.format(word, "gain") + " (dB)", db + shift)
        if which == 4 or turn != 1:
            second = (way.format(word, "phase") + " (deg)", turn * degrees)
    return table_case(rng, "names that are not known", [axis, first, second], is_own=False)


#: Names as programs write them, and what stands below.
REAL_HEADERS = {
    "EC-Lab": (
        "freq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm\t|Z|/Ohm\tPhase(Z)/deg\ttime/s\t<Ewe>/V\t<I>/mA",
        "f re -im mag deg 1 1 1",
    ),
    "EC-Lab, two": ("freq/Hz\tRe(Z)/Ohm\t-Im(Z)/Ohm\tRe(Y)/Ohm-1\tIm(Y)/Ohm-1", "f re -im iy jy"),
    "Gamry": (
        "\tPt\tTime\tFreq\tZreal\tZimag\tZsig\tZmod\tZphz\tIdc\n\t#\ts\tHz\tohm\tohm\tV\tohm\t°\tA",
        ". n n f re im 1 mag deg 1",
    ),
    "ZPlot": (
        "  Freq(Hz)\tAmpl\tBias\tTime(Sec)\tZ'(a)\tZ''(b)\tGD\tErr\tRange\nEnd Comments",
        "f 1 0 n re im 0 0 5",
    ),
    "CHI": ("Freq/Hz, Z'/ohm, Z\"/ohm, Z/ohm, Phase/deg", "f re im mag deg"),
    "Nova": (
        "Index;Frequency (Hz);Z' (Ω);-Z'' (Ω);Z (Ω);-Phase (°);Time (s)",
        "n f re -im mag -deg n",
    ),
    "Parstat": (
        "Elapsed Time (s)\tFrequency (Hz)\tZre (ohms)\tZim (ohms)\t|Vac| (V)\t|Iac| (A)",
        "n f re im 1 1",
    ),
    "VNA, R&S": ("freq[Hz];re:Trc1_S21;im:Trc1_S21", "f re im"),
    "VNA, Keysight": ("Freq(Hz),S21(DB),S21(DEG)", "f dB deg"),
    "VNA, Copper Mountain": ("Frequency, Hz;S21 Log Mag, dB;S21 Phase, deg", "f dB deg"),
    "HFSS": ('"Freq [GHz]","dB(S(2,1)) []","ang_deg(S(2,1)) [deg]"', "GHz dB deg"),
    "SR785": ("Frequency (Hz)\tMag (dB)\tPhase (deg)", "f dB deg"),
    "analyser, Nyquist": ("X-Axis Hz,Real,Imaginary", "f re im"),
    "vibration": ("Frequency - Hz;Amplitude - g/N;Phase - deg", "f mag deg"),
    "Bode 100": (
        "Frequency (Hz);Trace 1: Gain: Real;Trace 1: Gain: Imaginary;Trace 1: Gain: Magnitude (dB)",
        "f re im dB",
    ),
    "drive": ("Frequency [Hz];Amplitude [dB];Phase [°]", "f dB deg"),
    "SigmaWin": ("Frequency[Hz],Gain[dB],Phase[deg]", "f dB deg"),
    "Startdrive": ("f [Hz];|G| [dB];arg(G) [°]", "f dB deg"),
    "Analog Discovery": (
        "Frequency (Hz),Channel 1 Magnitude (dB),Channel 2 Magnitude (dB),Channel 2 Phase (*)",
        "f 0 dB deg",
    ),
    "PicoScope": ("Frequency Log(Hz), Gain (dB), Phase (deg)", "log dB deg"),
    "Rohde scope": ("Frequency in Hz,Gain in dB,Phase in °,Amplitude in Vpp", "f dB deg 1"),
    "MATLAB table": ("Frequency_rad_s,Magnitude_dB,Phase_deg", "w dB deg"),
}


def real_table(rng):
    """A table with the names of a program."""
    name = str(rng.choice([*REAL_HEADERS]))
    head, held = REAL_HEADERS[name]
    phase_deg, admittance = np.degrees(np.angle(G)), 1 / G
    values = {
        "f": F,
        "re": G.real,
        "im": G.imag,
        "-im": -G.imag,
        "mag": np.abs(G),
        "deg": phase_deg,
        "-deg": -phase_deg,
    }
    values |= {
        "dB": 20 * np.log10(np.abs(G)),
        "GHz": F / 1e9,
        "log": np.log10(F),
        "w": 2 * np.pi * F,
        "n": np.arange(40.0),
    }
    values |= {"iy": admittance.real, "jy": admittance.imag}
    sep = next(one for one in ("\t", ";", ",") if one in head)
    columns = [
        None if one == "." else values.get(one, 0 * F + float(one) if one.isdigit() else F)
        for one in held.split()
    ]
    rows = "\n".join(
        sep.join("" if x is None else f"{x[k]:.9g}" for x in columns) for k in range(F.size)
    )

    def write(folder):
        path = folder / "table.txt"
        path.write_text(f"{head}\n{rows}\n", encoding="utf-8")
        return path

    return Case("names of programs", write, f"{name}: {head}")


# ---- Clocks of records, and units beside them

CLOCKS = {
    "Hz": ("rate", FS),
    "kHz": ("rate", FS / 1e3),
    "MHz": ("rate", FS / 1e6),
    "1/min": ("rate", 60 * FS),
    "kS/s": ("rate", FS / 1e3),
    "s": ("step", 1 / FS),
    "ms": ("step", 1e3 / FS),
    "us": ("step", 1e6 / FS),
    "minutes": ("step", 1 / FS / 60),
    "seconds": ("step", 1 / FS),
    "milliseconds": ("step", 1e3 / FS),
    "µs": ("step", 1e6 / FS),
    "hours": ("step", 1 / FS / 3600),
}
STRANGE_CLOCKS = {
    "mHz": ("rate", 1e3 * FS),
    "bpm": ("rate", 60 * FS),
    "ticks": ("step", 8e6 / FS),
    "frames": ("step", 25 / FS),
    "jiffies": ("step", 100 / FS),
    "shakes": ("step", 1e8 / FS),
    "BogoHz": ("rate", FS / 7),
    "sidereal s": ("step", 1.0027 / FS),
}
NAMES_OF_CLOCKS = {
    "rate": ("fs", "sample_rate", "SampleRate", "sampling_frequency"),
    "step": ("Ts", "dt", "sample_time", "SamplingInterval"),
}


def record(rng):
    """A record whose clock states its unit beside it, in an array, a struct or an attribute."""
    strange = rng.random() < 0.3
    table = STRANGE_CLOCKS if strange else CLOCKS
    unit = str(rng.choice([*table]))
    kind, number = table[unit]
    name = str(rng.choice(NAMES_OF_CLOCKS[kind]))
    axis = kind == "step" and rng.random() < 0.3
    if axis:
        name, number = str(rng.choice(["t", "time", "Time"])), number * np.arange(U.size)
    beside = str(
        rng.choice(
            [
                f"{name}_unit",
                f"{name}Unit",
                f"{name}_units",
                *(["TimeUnit", "time_unit"] * (kind == "step")),
            ]
        )
    )
    how = str(rng.choice(["npz", "mat", "struct", "h5", "attributes", "group"][: 4 if axis else 6]))

    def write(folder):
        import h5py
        from scipy.io import savemat

        held = {name: number, beside: unit, "force": U, "acc": Y}
        path = folder / f"run.{ {'npz': 'npz', 'mat': 'mat', 'struct': 'mat'}.get(how, 'h5') }"
        if how == "npz":
            np.savez(path, **held)
        elif how in ("mat", "struct"):
            savemat(path, held if how == "mat" else {"run": held})
        else:
            with h5py.File(path, "w") as file:
                home = file.create_group("run") if how == "group" else file
                for key, one in held.items():
                    if how == "h5" or key in ("force", "acc"):
                        home[key] = one
                    else:
                        home.attrs[key] = one
        return path

    home = "run." if how in ("struct", "group") else ""
    about = f"{how}: {name}, {beside}={unit!r}"
    options = {"u": f"{home}force", "y": f"{home}acc"}
    kind = "records with a unit that is not known" if strange else "records"
    return Case(
        kind,
        write,
        about,
        is_frf=False,
        is_own=not strange,
        may_be_read=not strange,
        options=options,
    )


def preamble(rng):
    """A record below a preamble of one rate or two."""
    ways = [
        ("Sample rate: 1 kHz", True),
        ("ADC sample rate: 10 kHz\n# Output sample rate: 1 kHz", True),
        ("Sample rate: 5 kHz\n# Decimation: 5", True),
        ("Sampling interval: 1 ms", True),
        ("Sample rate: 10 kHz\n# Sampling rate: 1 kHz", False),
        ("Sample rate: 1000 mHz", False),
        ("Recorded at sample rate 1 kHz\n# Control sample rate: 8 kHz", True),
    ]
    head, may_be_read = ways[rng.integers(len(ways))]

    def write(folder):
        path = folder / "run.csv"
        rows = "\n".join(f"{a:.9g},{b:.9g}" for a, b in zip(U, Y, strict=True))
        path.write_text(f"# {head}\nforce,acc\n{rows}\n", encoding="utf-8")
        return path

    options = {"u": "force", "y": "acc"}
    return Case(
        "preambles",
        write,
        head,
        is_frf=False,
        is_own=may_be_read,
        may_be_read=may_be_read,
        options=options,
    )


KINDS = (
    (own_table, 0.5),
    (strange_table, 0.2),
    (real_table, 0.1),
    (record, 0.15),
    (preamble, 0.05),
)


def draw(seed: int) -> Case:
    """The case of a seed."""
    rng = np.random.default_rng(seed)
    makers, shares = zip(*KINDS, strict=True)
    return makers[rng.choice(len(makers), p=shares)](rng)


def judge(case: Case, folder: Path) -> tuple[Outcome, str]:
    """What became of a case, and in which words."""
    path = case.write(folder)
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            if case.is_frf:
                bla = nlfrf.io.load_frf(
                    path, **({} if case.std is not None else {"relative_std": 0.01})
                )
            else:
                fs = nlfrf.load_record(path, **case.options).fs
        except ValueError as error:
            return Outcome.REFUSED, str(error)
        finally:
            path.unlink()
    words = "; ".join(str(one.message) for one in caught if "hold" not in str(one.message))
    if not case.is_frf:
        wrong = abs(fs / FS - 1) > 1e-6
        detail = f"{fs:g} Hz"
    else:
        G_read = np.ravel(bla.G) / case.gain
        wrong = (
            bla.f.size != F.size
            or not np.allclose(bla.f, F, rtol=1e-6)
            or not np.allclose(np.abs(G_read / G - 1), 0, atol=TOLERANCE)
        )
        detail = f"f {bla.f[0]:.4g} to {bla.f[-1]:.4g} Hz, G/G0 {complex(G_read[0] / G[0]):.3g}"
        if not wrong and case.std is not None:
            ratio = np.sqrt(bla.var_total) / case.std / case.gain
            wrong = not np.allclose(ratio, 1, rtol=TOLERANCE)
            detail = f"deviation {ratio.mean():.3g} of that"
    if not wrong:
        return Outcome.RIGHT, words
    return (Outcome.WARNED if words else Outcome.WRONG), f"{detail} {words}"


def main() -> int:
    """Print what became of them; 1 where an answer is another without a word, or too much was
    refused.
    """
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=3000)
    parser.add_argument("--seed", type=int, default=0)
    parser.add_argument(
        "--shown", type=int, default=12, help="refusals of own parts that are printed"
    )
    parser.add_argument("--write", nargs=2, metavar=("SEED", "FOLDER"))
    given = parser.parse_args()
    with readers_in_this_process():
        if given.write:
            case = draw(int(given.write[0]))
            print(case.kind, case.about, *judge(case, Path(given.write[1])), sep="\n")
            print(case.write(Path(given.write[1])))
            return 0
        counts: dict[str, Counter[Outcome]] = {}
        wrong, refused, n_own = [], [], 0
        with tempfile.TemporaryDirectory() as folder:
            for seed in range(given.seed, given.seed + given.files):
                case = draw(seed)
                outcome, words = judge(case, Path(folder))
                counts.setdefault(case.kind, Counter())[outcome] += 1
                n_own += case.is_own and case.may_be_read
                line = f"{seed} {case.kind} | {case.about!r} | {words}"
                if outcome is Outcome.WRONG:
                    wrong.append(line)
                elif outcome is not Outcome.RIGHT and case.is_own and case.may_be_read:
                    refused.append(line)
    for kind, found in sorted(counts.items()):
        print(f"{kind}: " + ", ".join(f"{found[one]} {one.value}" for one in Outcome if found[one]))
    for line in [*wrong, *refused[: given.shown]]:
        print(line)
    share = len(refused) / max(n_own, 1)
    print(
        f"{len(wrong)} other answers without a word; {100 * share:.1f} % of {n_own} of own parts"
        " refused or asked"
    )
    return int(bool(wrong) or share > MOST_REFUSED)


if __name__ == "__main__":
    sys.exit(main())
