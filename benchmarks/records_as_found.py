"""Records as they lie on disks: what `inspect` proposes of their direction, and what becomes of
their clocks.

python -m benchmarks.records_as_found [--records 400] [--seed 1]

Directions: a plant of one mode with distortion and noise, driven by a multisine of any grid over
one to four periods, settled or from rest, in open loop or in a closed one with or without its
reference in the file. Names tell the direction, tell nothing, or tell the other one, as where a
position is played and a force answers. What `inspect` proposes is run.

Clocks: such a record behind a time column that is exact, rounded, jitters, or has lost rows: these
are sound. Then one whose rate changes, that a solver chose, with rows of other events or twice.
Each is loaded as it is and with `resample=True`. Sensors: slower than the record, and those that
repeat values for other reasons.

An answer is wrong where the median of |G / G_true - 1| over the lines is above a quarter and the
bound holds G_true on less than half of them. "Without a word" means without a warning.
"""

from __future__ import annotations

import argparse
import shlex
import tempfile
import warnings
from collections import Counter
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy import signal
from scipy.interpolate import CubicSpline

import nlfrf
from nlfrf.records.screening.input import hold_factor, repeated_share

FS = 1000.0
GRIDS = ("special-odd", "odd", "random-odd", "odd-odd", "full")
#: Names of what drives and of what responds; of neither; and of channels that tell the other
#: direction.
NAMES = {
    "named": (
        ("force [N]", "position [mm]"),
        ("Strom", "Drehzahl"),
        ("torque", "speed"),
        ("u", "y"),
        ("drive", "acc"),
    ),
    "nameless": (("a", "b"), ("ch1", "ch2"), ("Signal 1", "Signal 2"), ("AI0", "AI1")),
    "contrary": (("position [mm]", "force [N]"), ("displacement", "load current")),
}
REFERENCES = ("reference", "set point", "cmd", "target")
TOLERANCE = 0.25  # of G, in the median over lines


class Run(NamedTuple):
    """One experiment: signals (n,) as measured, the plant as (b, a), samples in a period."""

    r: np.ndarray
    u: np.ndarray
    y: np.ndarray
    plant: tuple[np.ndarray, np.ndarray]
    n_samples: int

    def truth(self, f: np.ndarray, fs: float = FS) -> np.ndarray:
        """Return the FRF at frequencies [Hz]."""
        return signal.freqz(*self.plant, 2 * np.pi * f / fs)[1]


def drawn_run(rng: np.random.Generator, *, loop: bool = False, n_periods: int | None = None) -> Run:
    """Draw a grid, a plant of one mode, its distortion and the noise of both sensors."""
    n = int(rng.choice([1000, 2000, 4096]))
    n_periods = n_periods or int(rng.choice([1, 1, 2, 3, 4]))
    grid, band = GRIDS[rng.integers(len(GRIDS))], rng.uniform(60, 300)
    n_log = 40 if grid in ("odd", "special-odd") and rng.random() < 0.2 else None
    ms = nlfrf.multisine(
        grid,
        fs=FS,
        n_samples=n,
        f_min=rng.uniform(2, 10) * FS / n,
        f_max=band,
        n_log=n_log,
        rng=rng,
    )
    w, damping = 2 * np.pi * rng.uniform(0.05, 0.8) * band, 10 ** rng.uniform(-2, -0.3)
    b, a, _ = signal.cont2discrete(([w * w], [1, 2 * damping * w, w * w]), 1 / FS)
    plant, w = (b[0], a), 2 * np.pi * np.fft.rfftfreq(n)
    R, G = np.fft.rfft(ms.u[0]), signal.freqz(*plant, w)[1]
    y = np.fft.irfft(G * R, n)
    scale = float(np.std(y))
    d = rng.choice([0, 0.01, 0.05]) * y**3 / scale**2 + rng.choice([0, 0.02]) * y**2 / scale
    K = rng.uniform(0.1, 0.6) / np.abs(G).max() * np.ones(w.size) if loop else np.zeros(w.size)
    D = np.fft.rfft(d)
    u, y = (np.fft.irfft(X / (1 + K * G), n) for X in (R - K * D, G * R + D))
    if not loop and rng.random() < 0.3:  # from rest
        y = signal.lfilter(*plant, np.tile(u, n_periods)) + np.tile(d, n_periods)
    r, u, y = (np.tile(x, n_periods * n // x.size) for x in (ms.u[0], u, y))
    y = y + 10 ** rng.uniform(-4, -1.5) * scale * rng.standard_normal(y.size)
    u = u + rng.choice([0.0, 10 ** rng.uniform(-4, -2)]) * u.std() * rng.standard_normal(u.size)
    return Run(r, u, y, plant, n)


def write_table(path: Path, names: list[str], columns: list[np.ndarray]) -> None:
    """Write a table of columns with nine digits."""
    np.savetxt(
        path,
        np.column_stack(columns),
        delimiter=",",
        header=",".join(names),
        comments="",
        fmt="%.9g",
    )


def outcome(run: Run, path: Path, fs: float = FS, **options: Any) -> str:
    """Load and identify: "right", "wrong", either of them with a warning, or "refused"."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(nlfrf.load_record(path, **options))
        except ValueError:
            return "refused"
    G = run.truth(bla.f, fs)
    wrong = (
        np.median(np.abs(bla.G / G - 1)) > TOLERANCE
        and np.mean(np.abs(bla.G - G) < bla.bound()) < 0.5
    )
    return ("wrong" if wrong else "right") + (", warned" if said else "")


def options_of(command: str) -> dict[str, Any]:
    """Return the arguments of `load_record` that a command of `inspect` has."""
    words = shlex.split(command)
    value = dict(zip(words, [*words[1:], ""], strict=True))
    names = {"--input": "u", "--output": "y", "--reference": "r"}
    options: dict[str, Any] = {names[word]: value[word] for word in names if word in value}
    options |= {"n_samples": int(value["--period"])} if value.get("--period", "").isdigit() else {}
    return options | {"resample": "--resample" in words}


def tried_direction(rng: np.random.Generator, folder: Path) -> tuple[str, str]:
    """Draw a record; return what kind it is, and what becomes of what `inspect` proposes."""
    naming = ("named", "nameless", "contrary")[int(rng.choice(3, p=[0.5, 0.35, 0.15]))]
    loop = naming != "contrary" and rng.random() < 0.3
    run, pairs = drawn_run(rng, loop=loop), NAMES[naming]
    drives, responds = pairs[rng.integers(len(pairs))]
    columns = {drives: run.u, responds: run.y}
    with_reference = loop and rng.random() < 0.7
    if with_reference:
        columns[REFERENCES[rng.integers(len(REFERENCES))]] = run.r
    names = [str(name) for name in rng.permutation(list(columns))]
    write_table(
        folder / "run.csv",
        ["time [s]", *names],
        [np.arange(run.u.size) / FS, *(columns[n] for n in names)],
    )
    found = nlfrf.inspect_file(folder / "run.csv")
    periods = "one period" if run.u.size == run.n_samples else "several"
    kind = (
        f"{naming}, {'loop with r' if with_reference else 'loop without r' if loop else 'open'},"
        f" {periods}"
    )
    if not {"INPUT", "OUTPUT", "SAMPLES"}.isdisjoint(shlex.split(found.command)):
        return kind, "asked"
    return kind, outcome(run, folder / "run.csv", **options_of(found.command))


# ---- Clocks: times as written, and as they were.

SOUND_CLOCKS = ("exact", "rounded", "coarse", "jitter", "late", "another clock", "lost")
FAULTY_CLOCKS = ("two rates", "solver", "events", "loop", "twice")
SOUND_SENSORS = (
    "as it is",
    "encoder",
    "converter",
    "clipped",
    "dead zone",
    "relay",
    "velocity of an encoder",
)
SLOW_SENSORS = (
    "three of ten",
    "four of five",
    "one of five",
    "asynchronous",
    "a fifth at random",
    "most at random",
)


def drawn_clock(kind: str, rng: np.random.Generator, n: int) -> tuple[np.ndarray, np.ndarray]:
    """Return times (n,) [s] as a file states them, and as they were."""
    t, row = np.arange(n) / FS, np.arange(n)
    some = np.sort(rng.choice(np.arange(5, n - 5), int(rng.choice([1, 3, 30])), replace=False))
    if kind in SOUND_CLOCKS:
        quantum = rng.choice([0.0015, 0.002, 0.005, 0.01, 0.1])
        stall = (rng.random(n) < 0.002) * rng.uniform(1, 8, n)
        stated = {
            "rounded": np.round(t, 4),
            "coarse": np.floor(t / quantum + 1e-9) * quantum,
            "jitter": t + rng.uniform(-0.3, 0.3, n) / FS,
            "late": np.maximum.accumulate(t + (rng.exponential(0.1, n) + stall) / FS),
            "another clock": (
                t * (1 + rng.uniform(-1e-4, 1e-4)) + rng.uniform(-1e-5, 1e-5) * t**2 / t[-1]
            ),
        }.get(kind, t)
        return (np.delete(t, some[:1]),) * 2 if kind == "lost" else (stated, t)
    if kind in ("events", "twice"):
        beyond = rng.uniform(0.05, 0.95, some.size) if kind == "events" else 0.0
        t = np.sort(np.concatenate([t, (row[some] + beyond) / FS]))
        return t, t
    steps = {
        "two rates": np.where(
            row < rng.uniform(0.2, 0.8) * n, 1.0, rng.choice([0.5, 0.8, 1.25, 2.0, 4.0])
        ),
        "solver": rng.gamma(rng.choice([1, 3, 10]), 1.0, n),
        "loop": 1 + rng.exponential(rng.choice([0.03, 0.1, 0.3]), n),
    }[kind]
    t = np.cumsum(steps / (steps.mean() if kind == "solver" else 1.0)) / FS
    t = t[t < n / FS]
    return t, t


def tried_clock(kind: str, rng: np.random.Generator, folder: Path, *, resample: bool) -> str:
    """Draw a record of four periods behind such a time column; return what becomes of it."""
    run = drawn_run(rng, n_periods=4)
    stated, true = drawn_clock(kind, rng, run.u.size)
    whole = np.arange(run.u.size + 1) / FS
    u, y = (CubicSpline(whole, np.append(x, x[0]))(true) for x in (run.u, run.y))
    write_table(folder / "run.csv", ["time [s]", "u", "y"], [stated, u, y])
    return outcome(run, folder / "run.csv", resample=resample)


def drawn_sensor(kind: str, rng: np.random.Generator, y: np.ndarray) -> np.ndarray:
    """Return a signal as a sensor of some kind shows it; every other one of the slow sensors rounds
    as well.
    """
    n, scale = y.size, float(np.std(y))
    row = np.arange(n)
    q = scale * 10 ** rng.uniform(-1.5, 0.0)
    limit = scale * rng.uniform(0.3, 1.5)
    sound = {
        "as it is": y,
        "encoder": np.round(y / q) * q,
        "converter": np.round((y / scale + 0.02 * rng.standard_normal(n)) / 0.01),
        "clipped": np.clip(y, -limit, limit),
        "dead zone": np.sign(y) * np.maximum(np.abs(y) - limit, 0.0),
        "relay": np.sign(y),
        "velocity of an encoder": np.diff(np.round(y / (0.01 * scale)), prepend=0.0),
    }
    if kind in sound:
        return sound[kind]
    fine = scale * 10 ** rng.uniform(-4, -2)
    y = np.round(y / fine) * fine if rng.random() < 0.5 else y
    last = {
        "three of ten": np.floor(np.floor(row * 0.3 + 1e-9) / 0.3 + 1e-9),
        "four of five": np.floor(np.floor(row * 0.8 + 1e-9) / 0.8 + 1e-9),
        "one of five": row // 5 * 5,
        "asynchronous": np.minimum(np.floor(np.floor(row / 3.7) * 3.7), n - 1),
        "a fifth at random": np.maximum.accumulate(np.where(rng.random(n) < 0.2, 0, row)),
        "most at random": np.maximum.accumulate(np.where(rng.random(n) < 0.6, 0, row)),
    }[kind]
    return y[last.astype(int)]


def is_called_slow(kind: str, rng: np.random.Generator) -> bool:
    """Return whether an output through such a sensor is called slower than the record."""
    run = drawn_run(rng, n_periods=4)
    y = drawn_sensor(kind, rng, run.y)
    return repeated_share(y, run.u) > 0 or hold_factor(y) > 1


def print_counts(count: dict[str, Counter[str]]) -> None:
    """Print what became of the records of each kind."""
    for kind, found in count.items():
        print(f"{kind:34} {', '.join(f'{n} {what}' for what, n in found.most_common())}")


def main() -> None:
    """Print what became of the records of each kind."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder, count = Path(name), {}
        for number in range(given.records):
            kind, what = tried_direction(np.random.default_rng([given.seed, number]), folder)
            count.setdefault(kind, Counter())[what] += 1
            if what == "wrong":
                print(f"wrong without a word: number {number}, {kind}")
        print_counts(dict(sorted(count.items())))
        each = max(1, given.records // 24)
        for resample in (False, True):
            print(f"\nclocks, resample={resample}")
            for kind in (*SOUND_CLOCKS, *FAULTY_CLOCKS):
                rngs = (np.random.default_rng([given.seed, 1, number]) for number in range(each))
                print_counts(
                    {
                        kind: Counter(
                            tried_clock(kind, rng, folder, resample=resample) for rng in rngs
                        )
                    }
                )
    print("\nsensors that are called slow")
    for kind in (*SOUND_SENSORS, *SLOW_SENSORS):
        called = [
            is_called_slow(kind, np.random.default_rng([given.seed, 2, number]))
            for number in range(2 * each)
        ]
        print(f"{kind:34} {sum(called)} of {len(called)}")


if __name__ == "__main__":
    main()
