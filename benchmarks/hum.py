"""Hum of the mains in a single realisation: what is said of it, what the bound then holds, and how
often it is seen where there is none.

python -m benchmarks.hum [--plants 40]

Plants drawn by chance, four records each, on odd lines of which half are detection lines, 2.1 s
long so that 50 and 150 Hz fall on odd lines; sound, and with hum on the output that keeps step with
the periods, nearly does, or does not. Then modes narrower than the lines are apart, which nothing
tells from a hum; and sets of two and of three inputs, with hum on one output in each experiment.
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
SAYS = "differs from its neighbours"


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
    return sum(
        a * 2**0.5 * np.sin(2 * np.pi * m * frequency * t + rng.uniform(0, 2 * np.pi))
        for m, a in parts
    )


def outcome(ms, u, y, truth):
    """Whether it was told, or the record refused, and error over bound on each line; nan where
    refused.
    """
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always", nlfrf.DataWarning)
        try:
            bla = nlfrf.identify(
                nlfrf.record_from_samples(u=u, y=y, fs=FS, n_samples=N, lines=ms.lines)
            )
        except ValueError:
            return True, np.full(ms.f.size, np.nan)
    return any(SAYS in str(one.message) for one in said), np.abs(bla.G - truth) / bla.bound()


def attack(numbers, noise=0.003, sizes=SIZES, frequencies=HUM):
    """{size and frequency: rows (told, error over bound at 50 Hz, share of lines held)}; (0, 0) is
    sound.
    """
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
    """Share told of modes at 50 Hz whose width is a share of the distance of two lines, and held
    there.
    """
    for width in (0.1, 0.3, 1.0, 3.0):
        rows = []
        for number in range(n):
            zeta = width * 4 / (N / FS) / HUM[0] / 2
            ms, us, ys, truth, rng = records_of(
                lambda u, fs, zeta=zeta: (
                    mode(u, fs, 0.2, 20) + 0.2 * mode(u, fs, zeta, 50.1) + 0.02 * u**3
                ),
                number,
                "special-odd",
            )
            y = np.tile(ys[0], P)
            told, over = outcome(
                ms, np.tile(us[0], P), y + 0.003 * np.std(y) * rng.standard_normal(y.size), truth
            )
            rows.append((told, np.mean(over < 1)))
        yield width, *np.mean(rows, axis=0)


def stage(n_inputs, rng):
    """A matrix of FRFs, of frequencies (F,) to (n, n, F): two modes that all entries share."""
    zeta, f_n = 10 ** rng.uniform(-1.5, -0.7, 2), np.sort(rng.uniform(15, 160, 2))
    shapes = rng.standard_normal((2, n_inputs, n_inputs))

    def G(f):
        modes = [w**2 / (w**2 - f**2 + 2j * z * w * f) for w, z in zip(f_n, zeta, strict=True)]
        return sum(shape[:, :, None] * one for shape, one in zip(shapes, modes, strict=True))

    return G


def set_of(number, n_inputs, size=0.0, kind="special-odd", cubic=0.02, noise=0.003):
    """Multisine and record of one set through a stage, with hum on its second output in each
    experiment.
    """
    rng = np.random.default_rng([7, number])
    ms = nlfrf.multisine(kind, fs=FS, n_samples=N, f_min=1, f_max=180, n_inputs=n_inputs, rng=rng)
    G, x = stage(n_inputs, rng), ms.u + cubic * ms.u**3
    y = np.fft.irfft(np.einsum("jik,imk->jmk", G(np.fft.rfftfreq(N, 1 / FS)), np.fft.rfft(x)), N)
    u, y = (np.repeat(signal[:, :, None], P, axis=2) for signal in (ms.u, y))
    scale = np.std(y, axis=(1, 2, 3), keepdims=True)
    y = y + noise * scale * rng.standard_normal(y.shape)
    for m in range(n_inputs):
        y[1, m] += scale[1, 0] * hum(size, HUM[0], rng).reshape(P, N)
    return ms, nlfrf.Record(u=u, y=y, fs=FS, lines=ms.lines)


def several(n):
    """Size, inputs, share told of sets with hum, and of those not told error over bound in its row,
    at the most.
    """
    for size in (0.0, *SIZES):
        for n_inputs in (2, 3):
            told, over = [], [np.nan]
            for number in range(n):
                ms, record = set_of(number, n_inputs, size)
                k = int(np.argmin(np.abs(ms.f - HUM[0])))
                with warnings.catch_warnings(record=True) as said:
                    warnings.simplefilter("always", nlfrf.DataWarning)
                    frm = nlfrf.identify(record)
                told.append(any(SAYS in str(one.message) for one in said))
                if not told[-1]:
                    off = frm.G - nlfrf.identify(set_of(number, n_inputs)[1]).G
                    over.append(np.max(np.abs(off[1, :, k]) / frm.bound()[1, :, k]))
            yield size, n_inputs, np.mean(told), np.nanmax(over) if len(over) > 1 else np.nan


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--plants", type=int, default=40)
    chosen = parser.parse_args()
    print(
        "hum [of the rms], Hz: told; of those not told error over bound at 50 Hz, median and most;"
        " lines held"
    )
    for (of, frequency), rows in attack(range(chosen.plants)).items():
        silent = rows[rows[:, 0] == 0, 1]
        median, most = (
            (np.nanmedian(silent), np.nanmax(silent)) if silent.size else (np.nan, np.nan)
        )
        print(
            f"  {of:5.1%} {frequency:6.2f}: {int(rows[:, 0].sum()):3d} of {len(rows)};"
            f" {median:5.2f} {most:6.2f}; {np.nanmean(rows[:, 2]):.1%}"
        )
    print("a mode whose half-power width is a share of the distance of two lines: told, lines held")
    for width, told, held in narrow(chosen.plants):
        print(f"  {width:g}: {told:.0%}, {held:.1%}")
    print(
        "hum [of the rms] in one set of several inputs: told; of those not told error over bound at"
        " the most"
    )
    for size, n_inputs, told, over in several(chosen.plants):
        print(f"  {size:5.1%}, {n_inputs} inputs: {told:.0%}; {over:.2f}")


if __name__ == "__main__":
    main()
