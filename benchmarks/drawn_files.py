"""Measurement files drawn by chance, each with the FRF that belongs to it: ordinary ones, faulty
ones, many layouts.

`draw(seed)` gives one `Case`. A `Run` is the record behind it: a resonance driven by a multisine,
in steady state or from rest, with noise, friction, offsets and quantisation. What a writer does to
it is the kind of the file.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np
from scipy import signal

import nlfrf

#: Words for time, input and output, and the units that go with the latter two.
LANGUAGES = (
    ("time", "force", "position", "N", "mm"),
    ("t", "u", "y", "V", "V"),
    ("Time", "Torque", "Speed", "Nm", "rpm"),
    ("Zeit", "Kraft", "Weg", "N", "mm"),
    ("Zeit", "Strom", "Drehzahl", "A", "1/min"),
    ("temps", "couple", "vitesse", "Nm", "rad/s"),
    ("tiempo", "fuerza", "posición", "N", "m"),
    ("tempo", "coppia", "velocità", "Nm", "rad/s"),
    ("tijd", "kracht", "positie", "N", "mm"),
    ("Time", "motor current", "encoder", "A", "counts"),
    ("time", "shaker", "acc", "V", "g"),
)
#: Channels that are no part of the experiment, and their units.
EXTRAS = {"temperature": "°C", "status": "-", "enable": "-", "spare": "V", "bus voltage": "V"}
RATES = (
    200,
    256,
    400,
    500,
    512,
    800,
    1000,
    1024,
    1200,
    2000,
    2048,
    2500,
    4000,
    5000,
    8000,
    10000,
    20000,
    25600,
    50000,
)


@dataclass
class Run:
    """Streams u, y (n,) and what is known of them: rate [Hz], samples of a period, lines [Hz], FRF,
    and its scatter.
    """

    fs: float
    N: int
    P: int
    f: np.ndarray
    u: np.ndarray
    y: np.ndarray
    G: np.ndarray
    scatter: np.ndarray  # (F,) standard deviation of |G| from noise over one period
    ba: tuple[np.ndarray, np.ndarray]

    @property
    def t(self) -> np.ndarray:
        """Time of each sample [s]."""
        return np.arange(self.u.size) / self.fs

    @property
    def lines(self) -> np.ndarray:
        """Numbers of the lines that are excited."""
        return np.rint(self.f * self.N / self.fs).astype(int)

    def measured(self) -> np.ndarray:
        """The FRF of the streams by NumPy, over all periods but the first."""
        U, Y = (
            np.fft.rfft(one.reshape(-1, self.N)[1:].mean(axis=0))[self.lines]
            for one in (self.u, self.y)
        )
        return Y / U

    def at(self, f: np.ndarray) -> np.ndarray:
        """The FRF of a linear system at any frequencies [Hz]."""
        return signal.freqz(*self.ba, f, fs=self.fs)[1]


@dataclass
class Case:
    """One file: how it is written, how it is loaded, and what is right."""

    kind: str
    run: Run
    file: str
    write: str | bytes | Callable[[Path], object]
    u: str
    y: str
    sound: bool = False  # nothing is wrong with the file, and all that is needed stands in it
    options: dict = field(default_factory=dict)
    unit: str | None = None  # of the FRF, where the file states it
    words: str = "."  # what a warning or a refusal that names the kind says, as a pattern
    allowed: str = "$^"  # what a warning of a sound file may say
    gain: float = 1.0  # from the run to the file
    any_lines: bool = (
        False  # hits have no lines of their own: the system decides at those of the estimate
    )
    table: str = ""  # how an FRF stands in a table, empty for records
    seed: int = 0

    def save(self, folder: Path) -> Path:
        """Write the file into a folder."""
        path = folder / self.file
        content = self.write
        if isinstance(content, str):
            content = content.encode("utf-8")
        if isinstance(content, bytes):
            path.write_bytes(content)
        else:
            content(path)
        return path


# ---- Records


def friction(u, fs, rng):
    """Velocity of a mass under a force u (n,) that must overcome Coulomb friction, after two more
    periods of it.
    """
    level, v = rng.uniform(0.1, 0.8) * np.std(u), 0.0
    rate, sharp = rng.uniform(0.05, 0.3), 0.05 * np.std(u)
    out = np.empty(u.size)
    for k, force in enumerate(u):
        for _ in range(4):
            v += 0.25 * rate * (force - v - level * np.tanh(v / sharp))
        out[k] = v
    return out


def record(rng, like="plain", *, P=None, smooth=False, fs=None):
    """One `Run`: "plain", "resonant", "noisy", "friction", "high crest", "quantised", "from rest"
    or "drifting".
    """
    N = int(rng.integers(200, 401))
    P = int(rng.integers(2 if like == "from rest" else 3, 6)) if P is None else P
    fs = float(rng.choice(RATES)) if fs is None else fs
    f_max = (0.08 if smooth else rng.uniform(0.08 if like == "from rest" else 0.2, 0.4)) * fs
    if smooth or like == "from rest":
        N = int(rng.integers(500, 701) if smooth else rng.integers(800, 1601))
    f_min = (1 if like != "from rest" else rng.integers(1, 5)) * fs / N
    ms = nlfrf.multisine(fs=fs, n_samples=N, f_min=f_min, f_max=f_max, rng=rng)
    lines, u = ms.lines.excited, ms.u[0]
    if like == "high crest":
        phases = 2 * np.pi * rng.uniform(0, 0.15, lines.size)
        spectrum = np.zeros(N // 2 + 1, dtype=complex)
        spectrum[lines] = np.exp(1j * phases)
        u = np.fft.irfft(spectrum, N)
    u = u / np.std(u) * 10 ** rng.uniform(-1, 2)
    damping = rng.uniform(0.005, 0.03) if like == "resonant" else rng.uniform(0.05, 0.4)
    damping = 10 ** rng.uniform(-1.7, -0.4) if like == "from rest" else damping
    w = 2 * np.pi * rng.uniform(0.05 if like == "from rest" else 0.25, 0.8) * f_max
    gain = 10 ** rng.uniform(-1, 1.5)
    b, a = signal.bilinear([gain * w * w], [1, 2 * damping * w, w * w], fs)
    f = np.fft.rfftfreq(N, 1 / fs)
    H = signal.freqz(b, a, f, fs=fs)[1]
    y = np.fft.irfft(np.fft.rfft(u) * H, N)
    u, y = np.tile(u, P), np.tile(y, P)
    if like == "friction":
        y = gain * friction(np.tile(u[:N], P + 2), fs, rng)[2 * N :]
    elif like == "from rest":
        y = signal.lfilter(b, a, u)
    clean = np.tile(y[-N:], P)
    exponents = {"noisy": (-1.5, -0.3), "from rest": (-3.0, -1.5)}.get(like, (-5.0, -2.5))
    noise = np.std(y) * 10 ** rng.uniform(*exponents)
    y = y + noise * rng.standard_normal(y.size)
    if rng.random() < 0.4:
        u, y = (one + rng.uniform(-3, 3) * np.std(one) for one in (u, y))
    if like == "drifting":
        y = y + rng.uniform(-0.1, 0.1) * np.std(y) * np.linspace(0, 1, y.size)
    if like == "quantised":
        u, y = (
            np.round(one / (step := 2 * np.abs(one).max() / 2 ** rng.integers(8, 13))) * step
            for one in (u, y)
        )
    U = np.fft.rfft(u[:N])[lines]
    G = np.fft.rfft(clean[:N])[lines] / U if like in ("friction",) else H[lines]
    floor = noise if like != "quantised" else np.hypot(noise, np.ptp(y) / 2**8)
    return Run(fs, N, P, f[lines], u, y, G, floor * np.sqrt(N) / np.abs(U), (b, a))


# ---- Writers of text


def decimals(values):
    """Digits behind the point that show a time axis, or a thousandth of a percent of a stream."""
    step = np.median(np.abs(np.diff(values))) or 1.0
    return max(int(np.ceil(-np.log10(step))) + 4, 1)


def cells(values, *, decimal=".", digits=9):
    """A column as texts."""
    if isinstance(values, list):
        return values
    if np.asarray(values).dtype.kind in "iu":
        return [str(v) for v in values.tolist()]
    form = f"{{:.{digits}g}}"
    texts = [form.format(v) for v in values.tolist()]
    return texts if decimal == "." else [text.replace(".", decimal) for text in texts]


def rows(*columns, sep=",", decimal=".", digits=9, end="\n", last=""):
    """Rows of columns, each a stream or ready texts."""
    parts = [cells(column, decimal=decimal, digits=digits) for column in columns]
    return "".join(sep.join(row) + last + end for row in zip(*parts, strict=True))


def time_cells(t, *, decimal="."):
    """A time axis with as many decimals as it needs."""
    form = f"{{:.{decimals(t)}f}}"
    return [form.format(v).replace(".", decimal) for v in t.tolist()]


def extra_columns(rng, n, most=3):
    """Names and streams of channels that are no part of the experiment."""
    names = list(rng.permutation(list(EXTRAS))[: int(rng.integers(0, most))])
    streams = {
        "temperature": np.round(20 + np.cumsum(rng.standard_normal(n)) * 1e-3, 3),
        "status": rng.integers(0, 2, n),
        "enable": np.ones(n, dtype=int),
        "spare": np.zeros(n),
        "bus voltage": np.round(48 + 0.05 * rng.standard_normal(n), 3),
    }
    return [(str(name), streams[str(name)]) for name in names]


def dialect(rng, separators=",;\t"):
    """Separator, decimal sign and end of line, as one country and program write them."""
    sep = str(rng.choice(list(separators)))
    decimal = "," if sep in ";\t" and rng.random() < 0.5 else "."
    return dict(sep=sep, decimal=decimal, end=str(rng.choice(["\n", "\r\n"])))


def in_unit(t, rng, units=("s", "ms", "us")):
    """A time axis in a unit drawn by chance, and that unit."""
    unit = str(rng.choice(units))
    return t * {"s": 1.0, "ms": 1e3, "us": 1e6, "min": 1 / 60}[unit], unit


def table(rng, run, *, u=None, y=None, names=None, stated=None, t=None):
    """An ordinary table of columns: text, the names of input and output, and the unit of the FRF
    where stated.
    """
    how = dialect(rng)
    sep, end = how["sep"], how["end"]
    time, one, two, unit_u, unit_y = LANGUAGES[rng.integers(len(LANGUAGES))]
    one, two = names or (one, two)
    unit_u, unit_y = stated or (unit_u, unit_y)
    t, unit_t = in_unit(run.t if t is None else t, rng)
    style = str(rng.choice(["brackets", "row", "none"]))
    if style == "none" and run.fs <= 150:
        style = "brackets"
    if style == "none":
        t, unit_t = t / {"s": 1.0, "ms": 1e3, "us": 1e6}[unit_t], ""
    left, right = rng.choice(["[]", "()"])
    extras = extra_columns(rng, t.size)
    columns = [
        (time, unit_t, time_cells(t, decimal=how["decimal"])),
        (one, unit_u, run.u if u is None else u),
    ]
    columns += [
        (two, unit_y, run.y if y is None else y),
        *((name, EXTRAS[name], stream) for name, stream in extras),
    ]
    if rng.random() < 0.3:
        columns[1:] = [columns[k] for k in 1 + rng.permutation(len(columns) - 1)]
    quote = '"' if rng.random() < 0.2 else ""
    head = [
        f"{name} {left}{unit}{right}" if style == "brackets" else name for name, unit, _ in columns
    ]
    text = sep.join(f"{quote}{cell}{quote}" for cell in head) + end
    if style == "row":
        text += sep.join(unit for _, unit, _ in columns) + end
    if rng.random() < 0.3:
        lines = [
            "Date: 2024-03-01",
            "Operator: N. N.",
            "Test bench 3",
            "Remark: sweep after warm-up",
        ]
        text = (
            "".join(f"{line}{end}" for line in rng.permutation(lines)[: rng.integers(1, 4)]) + text
        )
    text += rows(*(stream for *_, stream in columns), **how)
    encoding = str(rng.choice(["utf-8", "utf-8-sig", "latin-1", "utf-16"], p=[0.5, 0.2, 0.2, 0.1]))
    unit = f"{unit_y}/{unit_u}" if style != "none" else None
    return text.encode(encoding), one, two, unit


# ---- Kinds

KINDS: dict[str, tuple[float, Callable[[np.random.Generator], Case]]] = {}


def kind(name, weight):
    """Register what draws a file of a kind, and how often it is drawn."""

    def register(make):
        KINDS[name] = weight, make
        return make

    return register


def draw(seed):
    """The case of a seed."""
    rng = np.random.default_rng([seed, 53])
    names = list(KINDS)
    weights = np.array([KINDS[name][0] for name in names])
    return draw_kind(names[rng.choice(len(names), p=weights / weights.sum())], seed)


def draw_kind(name, seed):
    """The case of a kind and a seed."""
    case = KINDS[name][1](np.random.default_rng([seed, 54]))
    case.kind, case.seed = name, seed
    return case


LIKE = (
    "plain",
    "resonant",
    "noisy",
    "friction",
    "high crest",
    "quantised",
    "from rest",
    "drifting",
)
TRANSIENT = r"transient|from rest|first period"


def sound_table(like):
    """Who draws an ordinary table with a record like this."""

    def make(rng):
        run = record(rng, like)
        content, u, y, unit = table(rng, run)
        suffix = str(rng.choice([".csv", ".txt", ".dat", ".tsv", ".asc"]))
        return Case(
            "", run, f"run{suffix}", content, u, y, sound=True, unit=unit, allowed=TRANSIENT
        )

    return make


for _like in LIKE:
    kind(f"sound table, {_like}", 5.0)(sound_table(_like))


@kind("sound table of blanks", 3.0)
def blanks(rng):
    run = record(rng, str(rng.choice(LIKE)), fs=float(rng.choice(RATES[3:])))
    time, u, y = "t", "u", "y"
    mark = str(rng.choice(["", "# ", "% "]))
    text = f"{mark}{time} {u} {y}\n" + rows(
        time_cells(run.t), run.u, run.y, sep=" " * int(rng.integers(1, 4))
    )
    return Case("", run, "run.txt", text, u, y, sound=True, allowed=TRANSIENT)


@kind("sound table, rate in the preamble", 3.0)
def rate_above(rng):
    run = record(rng, str(rng.choice(LIKE)))
    how = dialect(rng, ",;")
    sep, end = how["sep"], how["end"]
    number = f"{run.fs:g}".replace(".", how["decimal"])
    step = f"{1e3 / run.fs:.12g}".replace(".", how["decimal"])
    said = [
        f"Sample rate{sep}{number} Hz",
        f"Sampling interval (ms){sep}{step}",
        f"fs [Hz]{sep}{number}",
    ]
    lines = [str(rng.choice(said)), f"Device{sep}DAQ 7", "Comment: none"]
    _, u, y, *_ = LANGUAGES[rng.integers(len(LANGUAGES))]
    text = "".join(f"{line}{end}" for line in rng.permutation(lines)) + sep.join([u, y]) + end
    return Case(
        "", run, "run.csv", text + rows(run.u, run.y, **how), u, y, sound=True, allowed=TRANSIENT
    )


@kind("sound table, index with an empty name", 3.0)
def index(rng):
    run = record(rng, str(rng.choice(LIKE)), fs=float(rng.choice(RATES[3:])))
    how = dialect(rng)
    sep, end = how["sep"], how["end"]
    head = sep.join([str(rng.choice(["", '""', "index", "#"])), "time", "force", "position"]) + end
    text = head + rows(
        np.arange(run.u.size), time_cells(run.t, decimal=how["decimal"]), run.u, run.y, **how
    )
    return Case("", run, "run.csv", text, "force", "position", sound=True, allowed=TRANSIENT)


@kind("sound position in degrees or counts", 4.0)
def positions(rng):
    run = record(
        rng,
        str(rng.choice(["plain", "noisy", "from rest", "friction"])),
        smooth=bool(rng.random() < 0.5),
    )
    turn, unit = [
        (360.0, "deg"),
        (2 * np.pi, "rad"),
        (1.0, "rev"),
        (4096.0, "counts"),
        (65536.0, "counts"),
    ][rng.integers(5)]
    gain = rng.uniform(0.2, 0.95) * turn / np.ptp(run.y) * (1 if rng.random() < 0.5 else 10)
    y = gain * (run.y - run.y.min()) + rng.uniform(0.0, 0.05) * turn + turn * rng.integers(-2, 3)
    if unit == "counts":
        y = np.round(y).astype(int)
        run.scatter = np.hypot(
            run.scatter,
            0.3 / gain * np.sqrt(run.N) / np.abs(np.fft.rfft(run.u[: run.N])[run.lines]),
        )
    name = str(rng.choice(["angle", "position", "encoder"]))
    content, u, name, unit_of_G = table(rng, run, y=y, names=("current", name), stated=("A", unit))
    return Case(
        "",
        run,
        "run.csv",
        content,
        u,
        name,
        sound=True,
        unit=unit_of_G,
        gain=gain,
        allowed=TRANSIENT,
    )


def made(rng, likes=LIKE):
    """A record of any sort, and names and units."""
    return record(rng, str(rng.choice(likes))), *LANGUAGES[rng.integers(len(LANGUAGES))]


@kind("sound .npz or .mat", 6.0)
def arrays(rng):
    run, _, u, y, *_ = made(rng)
    u, y = (name.encode("ascii", "ignore").decode().replace(" ", "_") for name in (u, y))
    way = rng.integers(5)
    step = {"Ts": 1 / run.fs} if run.fs > 150 and rng.random() < 0.5 else {"fs": run.fs}
    if way == 0:
        return Case(
            "",
            run,
            "run.npz",
            lambda p: np.savez(p, **{u: run.u, y: run.y}, **step),
            u,
            y,
            sound=True,
            allowed=TRANSIENT,
        )
    from scipy.io import savemat

    if way == 1:
        content = {u: run.u, y: run.y} | step
    elif way == 2:
        content, u, y = {"data": np.column_stack([run.t, run.u, run.y])}, "data.2", "data.3"
    elif way == 3:
        content = {"run": {u: run.u[:, None], y: run.y[:, None]} | step}
    else:
        content = {"t": run.t, u: run.u, y: run.y}
    if way in (2, 4) and run.fs <= 150:
        run = record(rng, fs=1000.0)
        content = (
            {"t": run.t, u: run.u, y: run.y}
            if way == 4
            else {"data": np.column_stack([run.t, run.u, run.y])}
        )
    return Case(
        "", run, "run.mat", lambda p: savemat(p, content), u, y, sound=True, allowed=TRANSIENT
    )


@kind("sound .h5, .parquet or .wav", 4.0)
def columns(rng):
    run, _, u, y, unit_u, unit_y = made(rng)
    way = rng.integers(3)
    if way == 0:

        def write(path):
            import h5py

            with h5py.File(path, "w") as file:
                for name, data, unit in ((u, run.u, unit_u), (y, run.y, unit_y)):
                    file[name] = data
                    file[name].attrs["unit"] = unit
                file.attrs["fs"] = run.fs

        return Case(
            "", run, "run.h5", write, u, y, sound=True, unit=f"{unit_y}/{unit_u}", allowed=TRANSIENT
        )
    if way == 1:

        def write(path):
            import pyarrow as pa
            from pyarrow import parquet

            named = [("time", run.t, "s"), (u, run.u, unit_u), (y, run.y, unit_y)]
            fields = [pa.field(n, pa.float64(), metadata={"unit": unit}) for n, _, unit in named]
            table = pa.Table.from_arrays(
                [pa.array(a) for _, a, _ in named], schema=pa.schema(fields)
            )
            parquet.write_table(table, path)

        return Case(
            "",
            run,
            "run.parquet",
            write,
            u,
            y,
            sound=True,
            unit=f"{unit_y}/{unit_u}",
            allowed=TRANSIENT,
        )
    from scipy.io import wavfile

    scale = 1.2 * max(np.abs(run.u).max(), np.abs(run.y).max())
    data = (np.column_stack([run.u, run.y]) / scale).astype(np.float32)
    return Case(
        "",
        run,
        "run.wav",
        lambda p: wavfile.write(p, int(run.fs), data),
        "ch1",
        "ch2",
        sound=True,
        allowed=TRANSIENT,
    )


def uff(run, *, x, step, unit_x, names, units, start=(0.0, 0.0)):
    """Write both streams as datasets of type 58."""

    def write(path):
        import pyuff

        file = pyuff.UFF(str(path))
        for name, data, unit, begin in zip(names, (run.u, run.y), units, start, strict=True):
            about = dict(
                binary=0, func_type=1, rsp_node=1, rsp_dir=3, ref_dir=0, ref_node=0, id1=name
            )
            about |= dict(abscissa_spacing=1, abscissa_min=begin, abscissa_inc=step)
            about |= dict(ordinate_axis_units_lab=unit, abscissa_axis_units_lab=unit_x)
            about |= dict(
                rsp_ent_name="NONE",
                ref_ent_name="NONE",
                ord_data_type=4,
                num_pts=data.size,
                data=data,
            )
            about |= dict(x=x + begin)  # pyuff takes the start from here
            about |= dict(
                abscissa_spec_data_type=17, ordinate_spec_data_type=13, orddenom_spec_data_type=0
            )
            file.write_sets(pyuff.prepare_58(**about), "add")

    return write


def tdms(run, *, names, units, step, more=({}, {})):
    """Write both streams as waveforms of a group."""

    def write(path):
        import nptdms

        channels = []
        for name, data, unit, extra in zip(names, (run.u, run.y), units, more, strict=True):
            about = {"wf_increment": step, "wf_start_offset": 0.0, "wf_samples": data.size} | extra
            about |= {"unit_string": unit} if unit else {}
            channels.append(nptdms.ChannelObject("run", name, data, properties=about))
        with nptdms.TdmsWriter(str(path)) as writer:
            writer.write_segment(channels)

    return write


def lvm(run, *, names, units, x_columns="One", delays=(0.0, 0.0), decimal="."):
    """The text of a LabVIEW measurement file."""
    head = ["LabVIEW Measurement\t", "Writer_Version\t2", "Reader_Version\t2", "Separator\tTab"]
    head += [
        f"Decimal_Separator\t{decimal}",
        "Multi_Headings\tYes",
        f"X_Columns\t{x_columns}",
        "Time_Pref\tRelative",
    ]
    head += ["***End_of_Header***\t", "\t", "Channels\t2\t\t"]
    multi = x_columns == "Multi"
    gap = "\t\t" if multi else "\t"
    head += [f"Samples\t{run.u.size}{gap}{run.u.size}\t", f"Y_Unit_Label\t{gap.join(units)}\t"]
    X0 = gap.join(f"{d:.9E}".replace(".", decimal) for d in delays)
    step = f"{1 / run.fs:.15E}".replace(".", decimal)
    head += [f"X_Dimension\tTime{gap}Time\t", f"X0\t{X0}\t", f"Delta_X\t{step}{gap}{step}\t"]
    head += ["***End_of_Header***\t\t\t"]
    how = dict(sep="\t", decimal=decimal)
    first, second = (time_cells(run.t + d, decimal=decimal) for d in delays)
    if multi:
        head += [f"X_Value\t{names[0]}\tX_Value\t{names[1]}\tComment"]
        return "\n".join(head) + "\n" + rows(first, run.u, second, run.y, **how)
    head += [f"X_Value\t{names[0]}\t{names[1]}\tComment"]
    if x_columns == "No":
        first = [""] * run.u.size
    return "\n".join(head) + "\n" + rows(first, run.u, run.y, **how)


@kind("sound .uff, .tdms, .lvm or .mf4", 8.0)
def instruments(rng):
    run, _, u, y, *units = made(rng)
    u, y = (name.encode("ascii", "ignore").decode() for name in (u, y))
    unit = f"{units[1]}/{units[0]}"
    way = rng.choice(["uff", "tdms", "lvm", "mf4"], p=[0.32, 0.32, 0.32, 0.04])
    more = dict(sound=True, unit=unit, allowed=TRANSIENT)
    if way == "uff":
        return Case(
            "",
            run,
            "run.uff",
            uff(
                run,
                x=run.t,
                step=1 / run.fs,
                unit_x=str(rng.choice(["s", "sec", "NONE"])),
                names=(u, y),
                units=units,
            ),
            u,
            y,
            **more,
        )
    if way == "tdms":
        return Case(
            "", run, "run.tdms", tdms(run, names=(u, y), units=units, step=1 / run.fs), u, y, **more
        )
    if way == "lvm":
        x_columns = str(rng.choice(["One", "Multi", "No"]))
        content = lvm(
            run, names=(u, y), units=units, x_columns=x_columns, decimal=str(rng.choice([".", ","]))
        )
        return Case("", run, "run.lvm", content, u, y, **more)

    def write(path):
        import asammdf

        with asammdf.MDF(version="4.10") as file:
            file.append([asammdf.Signal(run.u, run.t, name=u, unit=units[0])])
            file.append([asammdf.Signal(run.y, run.t, name=y, unit=units[1])])
            file.save(path, overwrite=True)

    return Case("", run, "run.mf4", write, u, y, **more)


# ---- Headers


def chain(rng):
    """A run from force to position, and the command in front of the amplifier."""
    run = record(rng, "plain", fs=float(rng.choice(RATES[3:])))
    lag = signal.bilinear([1.0], [1 / (2 * np.pi * rng.uniform(0.05, 0.2) * run.fs), 1.0], run.fs)
    spectrum = np.fft.rfft(run.u[: run.N])
    H = signal.freqz(*lag, np.fft.rfftfreq(run.N, 1 / run.fs), fs=run.fs)[1]
    return run, np.tile(np.fft.irfft(spectrum / H, run.N), run.P)


HEADER = r"\bnames?\b|header|column"
INDICES = ("row numbers", "row numbers in quotes", "times", "epoch seconds", "milliseconds")


def index_column(style, run):
    """A column that the header does not name."""
    n = np.arange(run.u.size)
    if style == "row numbers":
        return n
    if style == "row numbers in quotes":
        return [f'"{k + 1}"' for k in n]
    if style == "times":
        return time_cells(run.t)
    if style == "epoch seconds":
        return [f"{v:.6f}" for v in 1.7e9 + run.t]
    return time_cells(1e3 * run.t)


@kind("header: one or two names less", 10.0)
def names_less(rng):
    run, command = chain(rng)
    sep = str(rng.choice([",", ";", "\t", " "]))
    quote = '"' if rng.random() < 0.4 else ""
    left = [str(one) for one in rng.permutation(INDICES)[: int(rng.integers(1, 3))]]
    inner = [("command", command), ("force", run.u), ("position", run.y)]
    timed = rng.random() < 0.5
    if timed:
        inner.insert(0, ("time", time_cells(run.t)))
    inner += extra_columns(rng, run.u.size, 2) if sep != " " else []
    head = sep.join(f"{quote}{name}{quote}" for name, _ in inner) + "\n"
    text = head + rows(
        *(index_column(style, run) for style in left), *(stream for _, stream in inner), sep=sep
    )
    options = {} if timed else {"fs": run.fs}
    return Case(
        "",
        run,
        str(rng.choice(["run.csv", "run.txt"])),
        text,
        "force",
        "position",
        options=options,
        words=HEADER,
    )


@kind("header: one name too many", 3.0)
def names_more(rng):
    run, command = chain(rng)
    sep = str(rng.choice([",", ";", "\t"]))
    inner = [
        ("time", time_cells(run.t)),
        ("command", command),
        ("force", run.u),
        ("position", run.y),
    ]
    head = sep.join(
        [
            *(name for name, _ in inner),
            str(rng.choice(["comment", "Bemerkung", "shapers:", "flag"])),
        ]
    )
    text = head + "\n" + rows(*(stream for _, stream in inner), sep=sep)
    return Case("", run, "run.csv", text, "force", "position", words=HEADER)


# ---- Units of the abscissa, and brackets


@kind("unit of the abscissa in the file", 8.0)
def unit_of_abscissa(rng):
    run, time, u, y, *units = made(rng, ("plain", "resonant", "noisy"))
    u, y = (name.encode("ascii", "ignore").decode() for name in (u, y))
    x, unit = in_unit(run.t, rng, ("ms", "ms", "us", "min", "s"))
    step, words, way = float(x[1]), r"unit|second|\bfs\b|\bms\b|\bmin\b", rng.integers(4)
    more = dict(words=words, unit=f"{units[1]}/{units[0]}")
    if way == 0:
        return Case(
            "",
            run,
            "run.uff",
            uff(run, x=x, step=step, unit_x=unit, names=(u, y), units=units),
            u,
            y,
            **more,
        )
    if way == 1:
        about = {"wf_xname": "Time", "wf_xunit_string": unit}
        return Case(
            "",
            run,
            "run.tdms",
            tdms(run, names=(u, y), units=units, step=step, more=(about, about)),
            u,
            y,
            **more,
        )
    how = dialect(rng)
    sep, end = how["sep"], how["end"]
    if way == 2:
        text = sep.join([time, u, y]) + end + sep.join([unit, *units]) + end
        return Case(
            "",
            run,
            "run.csv",
            text + rows(time_cells(x, decimal=how["decimal"]), run.u, run.y, **how),
            u,
            y,
            **more,
        )
    number = f"{step:.12g}".replace(".", how["decimal"])
    lines = [
        f"Horizontal Units{sep}{unit}",
        f"Sample Interval{sep}{number}",
        f"Vertical Units{sep}{units[0]}",
    ]
    text = "".join(f"{line}{end}" for line in rng.permutation(lines))
    stamped = rng.random() < 0.5
    text += sep.join([*(["Time"] if stamped else []), u, y]) + end
    streams = [time_cells(x, decimal=how["decimal"])] if stamped else []
    return Case("", run, "run.csv", text + rows(*streams, run.u, run.y, **how), u, y, words=words)


@kind("brackets in names, unit in the file", 5.0)
def brackets(rng):
    run, time, u, y, *units = made(rng, ("plain", "resonant", "noisy"))
    u, y = (name.encode("ascii", "ignore").decode() for name in (u, y))
    tags = [
        ("[ch 1]", "[ch 2]"),
        ("[ai0]", "[ai1]"),
        ("(left)", "(right)"),
        ("[Dev1/ai0]", "[Dev1/ai1]"),
    ]
    one, two = (
        f"{name} {tag}" for name, tag in zip((u, y), tags[rng.integers(len(tags))], strict=True)
    )
    more = dict(unit=f"{units[1]}/{units[0]}", words=r"unit|bracket")
    way = rng.integers(4)
    if way == 0:
        content = uff(run, x=run.t, step=1 / run.fs, unit_x="s", names=(one, two), units=units)
        return Case("", run, "run.uff", content, one, two, **more)
    if way == 1:
        content = tdms(run, names=(one, two), units=units, step=1 / run.fs)
        return Case("", run, "run.tdms", content, f"run.{one}", f"run.{two}", **more)
    if way == 2:
        return Case("", run, "run.lvm", lvm(run, names=(one, two), units=units), one, two, **more)
    how = dialect(rng)
    sep, end = how["sep"], how["end"]
    text = sep.join([time, one, two]) + end + sep.join(["s", *units]) + end
    text += rows(time_cells(run.t, decimal=how["decimal"]), run.u, run.y, **how)
    return Case("", run, "run.csv", text, one, two, **more)


# ---- Positions that wrap, channels that start late, steps without a unit


@kind("position that wraps", 8.0)
def wraps(rng):
    run = record(rng, str(rng.choice(["plain", "noisy", "from rest"])), smooth=True)
    turn, low, unit, whole = [
        (360.0, -180.0, "deg", False),
        (360.0, 0.0, "deg", False),
        (2 * np.pi, 0.0, "rad", False),
        (2 * np.pi, -np.pi, "rad", False),
        (1.0, 0.0, "rev", False),
        (256.0, 0.0, "counts", True),
        (4096.0, 0.0, "counts", True),
        (65536.0, 0.0, "counts", True),
        (65536.0, -32768.0, "counts", True),
    ][rng.integers(9)]
    y = run.y - run.y.mean()
    most = 0.3 * turn / np.abs(np.diff(y)).max()
    least = 0.6 * turn / np.abs(y).max()
    gain = (
        rng.uniform(0.5, 1.0) * most
        if rng.random() < 0.6 or most < least
        else rng.uniform(0.1, 0.5) * least
    )
    crossing = low + rng.choice([0.0, turn]) + rng.uniform(-0.5, 0.5) * gain * np.std(y)
    y = gain * y + crossing
    y = (y - low) % turn + low
    y = (
        np.round(y) % turn
        if whole and low == 0
        else (np.round(y) - low) % turn + low
        if whole
        else y
    )
    steps = 0.3 / gain if whole else 0.0  # standard deviation of what is rounded
    run.scatter = np.hypot(
        run.scatter, steps * np.sqrt(run.N) / np.abs(np.fft.rfft(run.u[: run.N])[run.lines])
    )
    name = str(rng.choice(["angle", "position", "encoder", "phi"]))
    bare = rng.random() < 0.3
    column = name if bare else f"{name} [{unit}]"
    text = f"time [s],current [A],{column}\n" + rows(
        time_cells(run.t), run.u, y.astype(int) if whole else y
    )
    unit = None if bare else f"{unit}/A"
    return Case(
        "",
        run,
        "run.csv",
        text,
        "current",
        name,
        unit=unit,
        gain=gain,
        words=r"\bwrap|\bturns?\b|counter",
    )


def late(run, delay):
    """The output sampled later by `delay` seconds, as a clock that starts later does."""
    spectrum = np.fft.rfft(run.y[: run.N]) * np.exp(
        2j * np.pi * np.fft.rfftfreq(run.N, 1 / run.fs) * delay
    )
    return np.tile(np.fft.irfft(spectrum, run.N), run.P)


@kind("channels that start at different times", 6.0)
def starts(rng):
    run, _, u, y, *units = made(rng, ("plain", "resonant"))
    u, y = (name.encode("ascii", "ignore").decode() for name in (u, y))
    steps = rng.uniform(0.2, 0.8) if rng.random() < 0.5 else float(rng.integers(1, 60))
    delay = max(round(steps / run.fs, 6), 2e-6)
    moved = replace(run, y=late(run, delay))
    words = r"start|same moment|later|\bshift|X0|delay|align|clock"
    way = rng.integers(4)
    more = dict(words=words, unit=f"{units[1]}/{units[0]}")
    if way == 0:
        begin = np.datetime64("2024-03-01T10:00:00", "us")
        about = [
            {"wf_start_time": begin},
            {"wf_start_time": begin + np.timedelta64(round(1e6 * delay), "us")},
        ]
        content = tdms(moved, names=(u, y), units=units, step=1 / run.fs, more=about)
        return Case("", run, "run.tdms", content, u, y, **more)
    if way == 1:
        x_columns = str(rng.choice(["Multi", "No"]))
        content = lvm(moved, names=(u, y), units=units, x_columns=x_columns, delays=(0.0, delay))
        return Case("", run, "run.lvm", content, u, y, **more)
    if way == 2:
        content = uff(
            moved,
            x=run.t,
            step=1 / run.fs,
            unit_x="s",
            names=(u, y),
            units=units,
            start=(0.0, delay),
        )
        return Case("", run, "run.uff", content, u, y, **more)
    text = f"time (s),{u},time (s),{y}\n" + rows(
        time_cells(run.t), run.u, time_cells(run.t + delay), moved.y
    )
    return Case("", run, "run.csv", text, u, y, words=words)


@kind("step below a second without a unit", 5.0)
def step_without_unit(rng):
    step = float(rng.choice([0.02, 0.05, 0.1, 0.125, 0.2, 0.25, 0.4, 0.5, 0.8]))
    scale = float(
        rng.choice([1e-3, 1e-3, 1e-6])
    )  # it is in milliseconds or microseconds, and does not say so
    run = record(rng, "plain", fs=1 / (step * scale))
    key = str(rng.choice(["Ts", "dt", "sample_time", "SampleTime"]))
    words = r"names no unit|without a unit|no unit|milliseconds|\bfs must"
    content = {key: step, "u": run.u, "y": run.y}
    way = rng.integers(3)
    if way == 0:
        return Case("", run, "run.npz", lambda p: np.savez(p, **content), "u", "y", words=words)
    from scipy.io import savemat

    if way == 1:
        return Case("", run, "run.mat", lambda p: savemat(p, content), "u", "y", words=words)
    return Case(
        "", run, "run.mat", lambda p: savemat(p, {"log": content}), "log.u", "log.y", words=words
    )


# ---- Faults of the samples


@kind("outliers", 8.0)
def outliers(rng):
    run = record(rng, str(rng.choice(["plain", "noisy", "resonant", "friction"])))
    u, y = run.u.copy(), run.y.copy()
    spoilt = u if rng.random() < 0.2 else y
    n = int(rng.integers(1, 4))
    at = rng.integers(5, y.size - 10)
    if rng.random() < 0.5:
        centre = spoilt.mean()
        spoilt[rng.choice(y.size, n, replace=False)] = centre + rng.choice([-1, 1]) * np.std(
            spoilt
        ) * 10 ** (rng.uniform(1.3, 4))
    else:
        value = float(rng.choice([999.0, -999.0, 9999.0, -9999.0, 1e6, 32767.0]))
        shrink = min(1.0, abs(value) / 20 / np.abs(spoilt).max())
        if spoilt is y:
            y *= shrink
            run.G, run.scatter, run.y = shrink * run.G, shrink * run.scatter, shrink * run.y
        elif shrink < 1:
            value = 20 * np.abs(spoilt).max()
        spoilt[at : at + n] = value
    content, one, two, unit = table(rng, run, u=u, y=y)
    return Case(
        "",
        run,
        "run.csv",
        content,
        one,
        two,
        unit=unit,
        words=r"outlier|spike|\b9999?\b|no value|far from",
    )


def padded(rng, run, before, behind):
    """Input and output with a logger that ran before the excitation began and after it ended, from
    rest.
    """
    u = np.concatenate([np.zeros(before), run.u - run.u.mean(), np.zeros(behind)])
    y = signal.lfilter(*run.ba, u)
    hiss = 10 ** rng.uniform(-5, -2.3) if rng.random() < 0.7 else 0.0
    u, y = (one + hiss * np.std(one) * rng.standard_normal(one.size) for one in (u, y))
    if rng.random() < 0.4:
        u, y = (one + rng.uniform(-2, 2) * np.std(one) for one in (u, y))
    return u, y


@kind("silence before or behind", 8.0)
def silence(rng):
    run = record(rng, "plain", P=int(rng.integers(4, 7)))
    before = int(rng.uniform(0.25, 3.3) * run.N) if rng.random() < 0.8 else 0
    behind = int(rng.uniform(0.25, 3.3) * run.N) if rng.random() < 0.5 or not before else 0
    u, y = padded(rng, run, before, behind)
    content, one, two, unit = table(rng, run, u=u, y=y, t=np.arange(u.size) / run.fs)
    run.scatter = run.scatter + 0.01 * np.abs(run.G).max()
    words = r"silen|stands? still|\bquiet|\bbefore the (?:excitation|signal|input)|at rest|\bcut\b"
    return Case("", run, "run.csv", content, one, two, unit=unit, words=words)


@kind("lost samples", 6.0)
def lost(rng):
    run = record(rng, str(rng.choice(["plain", "noisy", "from rest"])), P=int(rng.integers(3, 7)))
    n = int(10 ** rng.uniform(0, 2))
    at = int(rng.integers(16, run.u.size - n - 16))
    kept = np.delete(np.arange(run.u.size), np.arange(at, at + n))
    words = r"lost|resample|out of place|\bgap|missing|time jumps|whole period"
    if repeated := rng.random() < 0.2:
        kept = np.insert(np.arange(run.u.size), at, np.full(n, at))
    text = "u,y\n" + rows(run.u[kept], run.y[kept])
    if repeated or rng.random() < 0.6:
        return Case("", run, "run.csv", text, "u", "y", options={"fs": run.fs}, words=words)
    text = "time [s],u,y\n" + rows(time_cells(run.t[kept]), run.u[kept], run.y[kept])
    return Case("", run, "run.csv", text, "u", "y", words=words)


@kind("period of no whole number of samples", 4.0)
def other_clock(rng):
    run = record(rng, str(rng.choice(["plain", "noisy"])), P=int(rng.integers(4, 7)))
    ratio = 1 + rng.choice([-1, 1]) * 10 ** rng.uniform(
        -3.5, -1
    )  # of the clock of the logger over that of the player
    n = int(run.N * (run.P - 0.1) * min(ratio, 1.0))
    at = 2 * np.pi * np.outer(np.arange(n) / ratio / run.N, np.arange(run.N // 2 + 1))
    basis = np.concatenate([np.cos(at), -np.sin(at)], axis=1)
    u, y = (
        basis @ np.concatenate([2 * (X := np.fft.rfft(one[: run.N]) / run.N).real, 2 * X.imag])
        - X[0].real
        for one in (run.u - run.u.mean(), run.y - run.y.mean())
    )
    how = dict(words=r"whole number|resample|clock")
    text = "time [s],u,y\n" + rows(time_cells(np.arange(n) / (run.fs * ratio)), u, y)
    return Case("", run, "run.csv", text, "u", "y", **how)


@kind("hits of a hammer", 3.0)
def hits(rng):
    run = record(rng, "plain", P=4)
    n = run.N * run.P
    u = np.zeros(n)
    places = np.cumsum(run.N + rng.integers(-3, 4, run.P)) - run.N // 2
    for at in places[places < n - 10]:
        u[at : at + 4] += rng.uniform(0.7, 1.3) * np.array([0.4, 1.0, 0.6, 0.1])
    y = signal.lfilter(*run.ba, u)
    u, y = (one + 1e-4 * np.abs(one).max() * rng.standard_normal(n) for one in (u, y))
    content, one, two, unit = table(rng, run, u=u, y=y)
    return Case(
        "",
        run,
        "run.csv",
        content,
        one,
        two,
        unit=unit,
        any_lines=True,
        words=r"\bhits?\b|impuls|hammer|repeat|no period|not periodic",
    )


# ---- Layouts of instruments


def centred(run):
    """Time from the middle of the record, as of a trigger there."""
    return run.t - run.t[run.u.size // 2]


def scope(rng):
    """A record in volts, and two channel names of an oscilloscope."""
    run = record(rng, str(rng.choice(["plain", "noisy", "quantised", "resonant"])))
    first = int(rng.integers(1, 4))
    return run, f"CH{first}", f"CH{first + 1}"


def instrument(
    run,
    file,
    text,
    u,
    y,
    *,
    unit=None,
    sound=True,
    encoding="utf-8",
    gain=1.0,
    words=".",
    options=None,
):
    """The case of a layout."""
    return Case(
        "",
        run,
        file,
        text.encode(encoding),
        u,
        y,
        sound=sound,
        unit=unit,
        allowed=TRANSIENT,
        gain=gain,
        words=words,
        options=options or {},
    )


@kind("layout: Rigol", 1.5)
def rigol(rng):
    run, one, two = scope(rng)
    start = f"{-run.u.size / 2 / run.fs:.6e},{1 / run.fs:.6e}"
    text = f"X,{one},{two},Start,Increment\nSequence,Volt,Volt,{start}\n"
    return instrument(
        run, "rigol.csv", text + rows(np.arange(run.u.size), run.u, run.y, last=",,"), one, two
    )


@kind("layout: Siglent", 1.5)
def siglent(rng):
    run, one, two = scope(rng)
    lines = [
        f"Record Length,{run.u.size}",
        f"Sample Interval,{1 / run.fs:.9g}",
        "Vertical Units,V",
        f"Vertical Scale,{one}:0.5 {two}:0.5,,",
        "Horizontal Units,s,,",
        "Model Number,SDS1104",
    ]
    text = "\n".join(rng.permutation(lines)) + f"\n\nSource,{one},{two}\nSecond,Volt,Volt\n"
    return instrument(
        run, "siglent.csv", text + rows(time_cells(centred(run)), run.u, run.y), one, two
    )


@kind("layout: Tektronix TDS", 1.5)
def tektronix_tds(rng):
    run, *_ = scope(rng)
    lines = [
        f"Record Length,{run.u.size:.6e},",
        f"Sample Interval,{1 / run.fs:.6e},",
        "Source,CH1,",
        f"Trigger Point,{run.u.size / 2:.12e},",
        "Vertical Units,V,",
        "Vertical Scale,5.0e-01,",
        "Yzero,0.0,",
        "Horizontal Units,s,",
        "Horizontal Scale,4.0e-01,",
        "Pt Fmt,Y,",
        "Probe Atten,1.0,",
    ]
    head = [*lines[:2], *rng.permutation(lines[2:])] + [",,"] * run.u.size
    body = rows(time_cells(centred(run)), run.u, run.y).splitlines()
    text = "".join(f"{left},{right}\n" for left, right in zip(head, body, strict=False))
    return instrument(run, "tek0000.csv", text, "col5", "col6")


@kind("layout: Tektronix MSO", 1.5)
def tektronix_mso(rng):
    run, one, two = scope(rng)
    lines = [
        f"Label,{one},{two}",
        "Waveform Type,ANALOG",
        "Horizontal Units,s",
        f"Sample Interval,{1 / run.fs:.6E}",
        f"Record Length,{run.u.size}",
        f"Zero Index,{run.u.size // 2}",
        "Vertical Units,V,V",
    ]
    text = "\n".join(["Model,MSO24", *rng.permutation(lines)]) + f"\n,,\n,,\nTIME,{one},{two}\n"
    return instrument(run, "mso.csv", text + rows(time_cells(centred(run)), run.u, run.y), one, two)


@kind("layout: Keysight", 1.5)
def keysight(rng):
    run, *_ = scope(rng)
    one, two = [("1", "2"), ("2", "3"), ("Ch1", "Ch2")][rng.integers(3)]
    text = f"x-axis,{one},{two}\nsecond,Volt,Volt\n"
    return instrument(
        run, "scope_1.csv", text + rows(time_cells(centred(run)), run.u, run.y), one, two
    )


@kind("layout: PicoScope", 1.5)
def picoscope(rng):
    run, *_ = scope(rng)
    t, unit = in_unit(centred(run), rng)
    milli = bool(rng.random() < 0.5)
    one, two = [("Channel A", "Channel B"), ("Kanal A", "Kanal C")][rng.integers(2)]
    how = dict(sep=",", decimal=".") if rng.random() < 0.6 else dict(sep=";", decimal=",")
    sep = how["sep"]
    time = "Time" if one.startswith("Ch") else "Zeit"
    text = f"{time}{sep}{one}{sep}{two}\n({unit}){sep}(V){sep}({'mV' if milli else 'V'})\n\n"
    y = run.y * 1e3 if milli else run.y
    return instrument(
        run,
        "pico.csv",
        text + rows(time_cells(t, decimal=how["decimal"]), run.u, y, **how),
        one,
        two,
        gain=1e3 if milli else 1.0,
        unit="mV/V" if milli else "V/V",
    )


@kind("layout: LeCroy", 1.5)
def lecroy(rng):
    run, *_ = scope(rng)
    one, two = [("Ampl C1", "Ampl C2"), ("C1", "C3"), ("Ampl", "Ampl2")][rng.integers(3)]
    text = f"LECROYHDO{rng.integers(10000)},0,Waveform\nSegments,1,SegmentSize,{run.u.size}\n"
    text += f"Segment,TrigTime,TimeSinceSegment1\n#1,01-Jan-2024 10:00:00,0\nTime,{one},{two}\n"
    return instrument(
        run, "lecroy.csv", text + rows(time_cells(centred(run)), run.u, run.y), one, two
    )


@kind("layout: Moku", 1.5)
def moku(rng):
    run, *_ = scope(rng)
    one, two = [("Input A", "Input B"), ("Input 1", "Input 2")][rng.integers(2)]
    lines = [
        f"{one} (on), DC , 1 MOhm , 10 Vpp",
        f"Acquisition rate: {run.fs:.10e} Hz, Precision mode",
        "Acquired 2024-01-01 T 10:00:00 +0000",
    ]
    text = "".join(f"% {line}\r\n" for line in ["Moku:Go Data Logger", *rng.permutation(lines)])
    text += f"% Time (s), {one} (V), {two} (V)\r\n"
    return instrument(
        run,
        "moku.csv",
        text + rows(time_cells(run.t), run.u, run.y, sep=", ", end="\r\n"),
        one,
        two,
        unit="V/V",
    )


@kind("layout: WaveForms", 1.5)
def waveforms(rng):
    run, *_ = scope(rng)
    lines = [
        "#Device Name: Discovery2",
        "#Serial Number: SN:0",
        f"#Sample rate: {run.fs:g}Hz",
        f"#Samples: {run.u.size}",
        "#Trigger: Source: None",
        "#Date Time: 2024-01-01 10:00:00.000",
    ]
    text = (
        "\n".join(["#Digilent WaveForms Oscilloscope Acquisition", *rng.permutation(lines)])
        + "\n\n"
    )
    text += "Time (s),Channel 1 (V),Channel 2 (V)\n"
    return instrument(
        run,
        "ad2.csv",
        text + rows(time_cells(centred(run)), run.u, run.y),
        "Channel 1",
        "Channel 2",
        unit="V/V",
    )


@kind("layout: Mitsubishi MR", 2.0)
def mitsubishi(rng):
    run = record(rng, str(rng.choice(["plain", "noisy", "friction"])))
    one, two = [
        ("Torque", "Servo motor speed"),
        ("Torque command", "Feedback pulses"),
        ("Moment", "Drehzahl"),
    ][rng.integers(3)]
    more = int(rng.integers(0, 3))
    lines = [
        f"Number of sampling data,{run.u.size}",
        f"Sampling time interval(ms),{1e3 / run.fs:.6g}",
    ]
    text = "\n".join([f"Axis{rng.integers(1, 9)}", *rng.permutation(lines)]) + "\n"
    text += (
        ",".join(["Time", "Analog 1", "Analog 2", *(f"Digital {k + 1}" for k in range(more))])
        + "\n"
    )
    text += ",".join(["ms", one, two, *("INP", "RD")[:more]]) + "\n"
    bits = [rng.integers(0, 2, run.u.size) for _ in range(more)]
    return instrument(
        run, "mr.csv", text + rows(time_cells(1e3 * run.t), run.u, run.y, *bits), one, two
    )


@kind("layout: DAQExpress", 2.0)
def daqexpress(rng):
    run = record(rng, "plain")
    one, two = [("Force", "Input 1"), ("Voltage_1", "Voltage_2"), ("Kraft", "Weg")][rng.integers(3)]
    stamp, step = "Timestamp,2024-01-01 10:00:00", f"Interval,{1 / run.fs:.9g}"
    text = (
        f'{stamp},{stamp}\n{step},{step}\nChannel name,"{one}",Channel'
        f' name,"{two}"\nUnit,"V",Unit,"V"\n'
    )
    text += rows(time_cells(run.t), run.u, time_cells(run.t), run.y)
    return instrument(run, "daqx.csv", text, one, two, encoding="utf-8-sig", unit="V/V")


@kind("layout: Klipper", 1.5)
def klipper(rng):
    run = record(rng, "plain", fs=float(rng.choice([3200.0, 3211.7, 1600.0])))
    head = "##overflows=0,errors=0\n" if rng.random() < 0.5 else ""
    text = f"{head}#time,accel_x,accel_y,accel_z\n"
    times = [f"{v:.6f}" for v in rng.uniform(10, 9000) + run.t]
    return instrument(
        run,
        "raw_data.csv",
        text + rows(times, run.u, run.y, np.full(run.u.size, 9806.0)),
        "accel_x",
        "accel_y",
    )


@kind("layout: Yaskawa", 1.5)
def yaskawa(rng):
    run = record(rng, "plain", fs=float(rng.choice([1000.0, 2000.0, 4000.0, 8000.0])))
    one, two = [
        ("Torque reference[%]", "Feedback speed[min-1]"),
        ("Torque reference [%]", "Position error [um]"),
    ][rng.integers(2)]
    lines = [f"Sampling time,{1e6 / run.fs:g},[us]", f"Data number,{run.u.size}"]
    text = (
        "\n".join(["SigmaWin+ Trace", *rng.permutation(lines)])
        + f"\n{one},{two}\n"
        + rows(run.u, run.y)
    )
    return instrument(
        run, "sigmawin.csv", text, one.split("[")[0].strip(), two.split("[")[0].strip()
    )


@kind("layout: flight controllers, microseconds unsaid", 2.0)
def flight(rng):
    run = record(rng, "plain", fs=float(rng.choice([250.0, 500.0, 1000.0, 2000.0])))
    times = [str(round(v)) for v in rng.integers(10**6, 10**9) + 1e6 * run.t]
    words = r"unit|\bfs must"
    if rng.random() < 0.5:
        text = "timestamp,actuator,rate\n" + rows(times, run.u, run.y)
        return instrument(run, "px4.csv", text, "actuator", "rate", sound=False, words=words)
    lines = ['"Data version","2"', f'"looptime","{1e6 / run.fs:g}"', '"gyro_scale","0x3f800000"']
    text = "\n".join(['"Product","Blackbox flight data recorder by X"', *rng.permutation(lines)])
    text += '\n"loopIteration","time","axisP[0]","gyroADC[0]","flightModeFlags (flags)"\n'
    text += rows(8 * np.arange(run.u.size), times, run.u, run.y, ["ANGLE_MODE"] * run.u.size)
    return instrument(run, "blackbox.csv", text, "axisP[0]", "gyroADC[0]", sound=False, words=words)


@kind("layout: thousands and decimal commas", 1.5)
def thousands(rng):
    run = record(rng, "plain")
    y = 1500 + 900 * run.y / np.abs(run.y).max()
    gain = 900 / np.abs(run.y).max()
    speed = [f"{v:,.4f}".replace(",", "#").replace(".", ",").replace("#", ".") for v in y.tolist()]
    t, unit = in_unit(run.t, rng, ("s", "ms"))
    text = f"Zeit [{unit}];Moment [Nm];Drehzahl [1/min]\n"
    text += rows(time_cells(t, decimal=","), run.u, speed, sep=";", decimal=",")
    how = dict(encoding=str(rng.choice(["utf-8", "latin-1"])), gain=gain)
    words = (  # it may be refused: a point between digits is rarely one of thousands
        r"thousand|separator|group|holds"
    )
    return instrument(
        run, "drehzahl.csv", text, "Moment", "Drehzahl", sound=False, words=words, **how
    )


@kind("layout: dates and times", 2.0)
def stamps(rng):
    run = record(rng, "plain", fs=float(rng.choice([200, 250, 500, 1000, 2000])))
    moments = np.datetime64("2024-03-01T23:59:58", "us") + np.round(1e6 * run.t).astype(
        "timedelta64[us]"
    )
    texts = [str(one) for one in moments]
    style, sep, decimal = rng.integers(4), ",", "."
    if style == 1:
        texts = [one.replace("T", " ") + "Z" for one in texts]
    elif style == 2:
        sep, decimal = ";", ","
        texts = [f"{one[8:10]}.{one[5:7]}.{one[:4]} {one[11:].replace('.', ',')}" for one in texts]
    elif style == 3:
        texts = [f"{one[:10]}{sep}{one[11:]}" for one in texts]
    name = (
        f"Date{sep}Time"
        if style == 3
        else str(rng.choice(["timestamp", "Zeitstempel", "Time", "Uhrzeit"]))
    )
    text = (
        sep.join([name, "Moment", "Drehzahl"])
        + "\n"
        + rows(texts, run.u, run.y, sep=sep, decimal=decimal)
    )
    return instrument(run, "stamps.csv", text, "Moment", "Drehzahl")


# ---- Tables of an FRF


@kind("FRF table", 8.0)
def frf_table(rng):
    run = record(rng, "resonant")
    f, G = run.f, run.G
    how = dialect(rng)
    sep, end = how["sep"], how["end"]
    way = str(rng.choice(["dB and degrees", "magnitude and phase", "Re and Im", "UFF 58"]))
    case = Case(
        "",
        run,
        "bode.csv",
        "",
        "",
        "",
        words=r"frequency response|\bFRF\b|bla_from_frf|robust model",
        table=way,
    )
    if way == "UFF 58":
        df = float(f[1] - f[0])
        grid = df * np.arange(round(f[-1] / df) + 1)

        def write(path):
            import pyuff

            H = run.at(grid)
            about = dict(
                binary=0,
                func_type=4,
                rsp_node=1,
                rsp_dir=3,
                ref_dir=3,
                ref_node=1,
                id1="FRF 1z/1z",
                data=H,
            )
            about |= dict(
                abscissa_spacing=1,
                abscissa_min=0.0,
                abscissa_inc=df,
                ordinate_axis_units_lab="mm/N",
                x=grid,
            )
            about |= dict(
                rsp_ent_name="NONE", ref_ent_name="NONE", ord_data_type=6, num_pts=grid.size
            )
            about |= dict(
                abscissa_spec_data_type=18, ordinate_spec_data_type=8, orddenom_spec_data_type=13
            )
            pyuff.UFF(str(path)).write_sets(pyuff.prepare_58(**about), "add")

        case.file, case.write = "frf.uff", write
        case.run = replace(run, f=grid[1:], G=run.at(grid[1:]), scatter=0 * grid[1:])
        return case
    phase = np.degrees(np.angle(G))
    phase = np.degrees(np.unwrap(np.angle(G))) if rng.random() < 0.5 else phase
    first = str(rng.choice(["Frequency (Hz)", "f [Hz]", "Freq(Hz)", "Frequenz [Hz]"]))
    if way == "dB and degrees":
        names = [
            ("Trace 1: Gain: Magnitude (dB)", "Trace 1: Gain: Phase (°)"),
            ("Gain (dB)", "Phase (°)"),
            ("Magnitude [dB]", "Phase [deg]"),
            ("CH2 Amp(dB)", "CH2 Phase(Deg)"),
        ][rng.integers(4)]
        values = (20 * np.log10(np.abs(G)), phase)
    elif way == "magnitude and phase":
        rad = rng.random() < 0.4
        names = ("Magnitude [mm/N]", "Phase [rad]" if rad else "Phase [deg]")
        values = (np.abs(G), np.radians(phase) if rad else phase)
    else:
        names = [("Re", "Im"), ("Real [mm/N]", "Imag [mm/N]"), ("Re(H)", "Im(H)")][rng.integers(3)]
        values = (G.real, G.imag)
    columns, head = [f, *values], [first, *names]
    if rng.random() < 0.3:
        columns.append(1 - 1e-3 * rng.random(f.size))
        head.append("Coherence")
    case.write = (sep.join(head) + end + rows(*columns, **how)).encode("utf-8")
    return case
