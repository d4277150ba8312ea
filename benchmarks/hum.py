"""Hum of the mains in a single realisation: what is said of it, what the bound then holds, and how often it is seen
where there is none.

python -m benchmarks.hum [--plants 40]

Plants drawn by chance, four records each, on odd lines of which half are detection lines, 2.1 s long so that 50 and
150 Hz fall on odd lines; sound, and with hum on the output that keeps step with the periods, nearly does, or does not.
Then modes narrower than the lines are apart, which nothing tells from a hum.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import nlfrf
from benchmarks.coverage import frfs
from benchmarks.drawn import drawn
from benchmarks.plants import mode, played

FS, N, P = 1000, 2100, 4
TRUTH, RECORDS = 300, 4
HUM = (50.0, 50.02, 49.95, 50.2)  # Hz
SIZES = (0.003, 0.02, 0.2)  # over the rms of the output; a third of it at three times the frequency
SAYS = "stands out of its neighbours"


def records_of(plant, number, kind):
    """Multisine, inputs and outputs of some realisations, and the FRF that the bound is to hold."""
    rng = np.random.default_rng([50, number])
    ms = nlfrf.multisine(kind, fs=FS, n_samples=N, f_min=1, f_max=180, rng=rng)
    u, y = played(ms, plant, TRUTH + RECORDS, rng)
    truth = frfs(u[:TRUTH], y[:TRUTH], ms.lines.excited).mean(axis=0)
    return ms, u[TRUTH:], y[TRUTH:], truth, rng


def hum(size, frequency, rng):
    """(P N,) hum and its third harmonic, of an rms of one at the first."""
    t = np.arange(P * N) / FS
    parts = ((1, size), (3, size / 3))
    return sum(a * 2**0.5 * np.sin(2 * np.pi * m * frequency * t + rng.uniform(0, 2 * np.pi)) for m, a in parts)


def outcome(ms, u, y, truth):
    """Whether it was told, or the record refused, and error over bound on each line; nan where refused."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", nlfrf.DataWarning)
        try:
            bla = nlfrf.identify(nlfrf.record_from_samples(u=u, y=y, fs=FS, n_samples=N, lines=ms.lines))
        except ValueError:
            return True, np.full(ms.f.size, np.nan)
    return any(SAYS in str(one.message) for one in said), np.abs(bla.G - truth) / bla.bound()


def attack(numbers, noise=0.003, sizes=SIZES, frequencies=HUM):
    """{size and frequency: rows (told, error over bound at 50 Hz, share of lines held)}; (0, 0) is sound."""
    found = {}
    for number in numbers:
        plant, _ = drawn(number)
        kind = ("special-odd", "random-odd")[number % 2]
        ms, us, ys, truth, rng = records_of(plant, number, kind)
        at = int(np.argmin(np.abs(ms.f - HUM[0])))
        if abs(ms.f[at] - HUM[0]) > 1 / N * FS / 2:
            continue  # a detection line
        for u, y in zip(us, ys, strict=True):
            u, y, size = np.tile(u, P), np.tile(y, P), np.std(y)
            y = y + noise * size * rng.standard_normal(y.size)
            for of, frequency in ((0.0, 0.0), *((of, f) for of in sizes for f in frequencies)):
                told, over = outcome(ms, u, y + size * hum(of, frequency, rng) if of else y, truth)
                held = np.nan if np.isnan(over).any() else np.mean(over < 1)
                found.setdefault((of, frequency), []).append((told, over[at], held))
    return {key: np.array(rows, dtype=float) for key, rows in found.items()}


def narrow(n):
    """Share told of modes at 50 Hz whose width is a share of the distance of two lines, and held there."""
    for width in (0.1, 0.3, 1.0, 3.0):
        rows = []
        for number in range(n):
            zeta = width * 4 / (N / FS) / HUM[0] / 2
            ms, us, ys, truth, rng = records_of(
                lambda u, fs, zeta=zeta: mode(u, fs, 0.2, 20) + 0.2 * mode(u, fs, zeta, 50.1) + 0.02 * u**3,
                number,
                "special-odd",
            )
            y = np.tile(ys[0], P)
            told, over = outcome(ms, np.tile(us[0], P), y + 0.003 * np.std(y) * rng.standard_normal(y.size), truth)
            rows.append((told, np.mean(over < 1)))
        yield width, *np.mean(rows, axis=0)


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=40)
    chosen = parser.parse_args()
    print("hum [of the rms], Hz: told; of those not told error over bound at 50 Hz, median and most; lines held")
    for (of, frequency), rows in attack(range(chosen.plants)).items():
        silent = rows[rows[:, 0] == 0, 1]
        median, most = (np.nanmedian(silent), np.nanmax(silent)) if silent.size else (np.nan, np.nan)
        print(
            f"  {of:5.1%} {frequency:6.2f}: {int(rows[:, 0].sum()):3d} of {len(rows)}; {median:5.2f} {most:6.2f};"
            f" {np.nanmean(rows[:, 2]):.1%}"
        )
    print("a mode whose half-power width is a share of the distance of two lines: told, lines held")
    for width, told, held in narrow(chosen.plants):
        print(f"  {width:g}: {told:.0%}, {held:.1%}")


if __name__ == "__main__":
    main()
