"""Records as they lie on disks: what `inspect` proposes of their direction, and what becomes of their clocks.

python -m benchmarks.records_as_found [--records 400] [--seed 1]

Directions: a plant of one mode with distortion and noise, driven by a multisine of any grid over one to four periods,
settled or from rest, in open loop or in a closed one with or without its reference in the file. Names tell the
direction, tell nothing, or tell the other one, as where a position is played and a force answers. What `inspect`
proposes is run.

Clocks: such a record behind a time column that is exact, rounded, jitters, or has lost rows, or from an encoder, a
converter or a plant that stands still: these are sound. Then one whose rate changes, that a solver chose, or with rows
of other events; and a sensor that is slower than the record. Each is loaded as it is and with `resample=True`.

An answer is wrong where the median of |G / G_true - 1| over the lines is above a quarter and the bound holds G_true on
less than half of them. "Without a word" means without a warning.
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

import nlfrf

FS = 1000.0
GRIDS = ("special-odd", "odd", "random-odd", "odd-odd", "full")
#: Names of what drives and of what responds; of neither; and of channels that tell the other direction.
NAMES = {
    "named": (("force [N]", "position [mm]"), ("Strom", "Drehzahl"), ("torque", "speed"), ("u", "y"), ("drive", "acc")),
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
    n, n_periods = int(rng.choice([1000, 2000, 4096])), n_periods or int(rng.choice([1, 1, 2, 3, 4]))
    grid, band = GRIDS[rng.integers(len(GRIDS))], rng.uniform(60, 300)
    n_log = 40 if grid in ("odd", "special-odd") and rng.random() < 0.2 else None
    ms = nlfrf.multisine(grid, fs=FS, n_samples=n, f_min=rng.uniform(2, 10) * FS / n, f_max=band, n_log=n_log, rng=rng)
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
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=",".join(names), comments="", fmt="%.9g")


def outcome(run: Run, path: Path, fs: float = FS, **options: Any) -> str:
    """Load and identify: "right", "wrong", either of them with a warning, or "refused"."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(nlfrf.load_record(path, **options))
        except ValueError:
            return "refused"
    G = run.truth(bla.f, fs)
    wrong = np.median(np.abs(bla.G / G - 1)) > TOLERANCE and np.mean(np.abs(bla.G - G) < bla.bound()) < 0.5
    return ("wrong" if wrong else "right") + (", warned" if said else "")


def options_of(command: str) -> dict[str, Any]:
    """Return the arguments of `load_record` that a command of `inspect` has."""
    words = shlex.split(command)[3:]
    given = dict(zip(words[::2], words[1::2], strict=True)) if "--resample" not in words else {"--resample": "1"}
    if "--resample" in words:
        words.remove("--resample")
        given |= dict(zip(words[::2], words[1::2], strict=True))
    names = {"--input": "u", "--output": "y", "--reference": "r"}
    options: dict[str, Any] = {names[word]: given[word] for word in names if word in given}
    return (
        options
        | {"resample": "--resample" in given}
        | ({"n_samples": int(given["--period"])} if "--period" in given and given["--period"].isdigit() else {})
    )


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
    write_table(folder / "run.csv", ["time [s]", *names], [np.arange(run.u.size) / FS, *(columns[n] for n in names)])
    found = nlfrf.inspect_file(folder / "run.csv")
    periods = "one period" if run.u.size == run.n_samples else "several"
    kind = f"{naming}, {'loop with r' if with_reference else 'loop without r' if loop else 'open'}, {periods}"
    words = shlex.split(found.command)
    if not {"INPUT", "OUTPUT", "SAMPLES"}.isdisjoint(words):
        swapped = (found.u, found.y) == (responds, drives)
        return kind, "swapped, asked for the period" if swapped else "asked"
    return kind, outcome(run, folder / "run.csv", **options_of(found.command))


def main() -> None:
    """Print what became of the records of each kind."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--seed", type=int, default=1)
    given = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        count: dict[str, Counter[str]] = {}
        for number in range(given.records):
            kind, what = tried_direction(np.random.default_rng([given.seed, number]), Path(folder))
            count.setdefault(kind, Counter())[what] += 1
            if what == "wrong":
                print(f"wrong without a word: number {number}, {kind}")
    for kind in sorted(count):
        print(f"{kind:32} {', '.join(f'{n} {what}' for what, n in count[kind].most_common())}")


if __name__ == "__main__":
    main()
