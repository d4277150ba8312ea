"""How often the 95 % bound from one record holds: the table of the README, and the cases that try it.

python -m benchmarks.coverage [--records 200] [--processes 4]
python -m benchmarks.coverage --hard [--group sparse] [--records 600] [--processes 4]

The hard cases are told line by line: over all lines, on the first three, on the last three, on the worst line, for the
BLA and for a new realisation. What misses the target is marked: B the BLA, N a new realisation, W the width.
"""

from __future__ import annotations

import argparse
import warnings
from concurrent.futures import Executor, ProcessPoolExecutor
from contextlib import nullcontext
from dataclasses import replace

import numpy as np

import nlfrf
from benchmarks.plants import FRESH, PLANTS, RMS, played, realisations, resonance

TRUE_SIGMA = 1.731  # sqrt(F_p) of a known variance at 95 %
SNR = (None, 40, 20)


def measure(plant, kind, n_records, *, n_realizations=1, rng=0, level_from="auto", snrs=SNR, n_truth=400):
    """Rows of coverage for one plant and grid; see `HEADER`."""
    rng = np.random.default_rng(rng)
    n_runs = n_records * n_realizations
    ms, u, y = realisations(plant, kind, n_truth + n_runs + 1, rng)
    k = ms.lines.excited
    each = np.fft.rfft(y, axis=1)[:, k] / np.fft.rfft(u, axis=1)[:, k]
    truth = each.mean(axis=0)
    peak = resonance(plant, k, truth)
    near = slice(None) if peak is None else np.abs(ms.f - ms.f[peak]) <= 3
    for snr in snrs:
        if plant == "linear" and snr is None:
            continue
        n_periods = 1 if snr is None else 2
        sigma = 0.0 if snr is None else np.sqrt(np.mean(y**2)) * 10 ** (-snr / 20)
        G, bound, bound_new = [], [], []
        for i in range(n_records):
            rows = n_truth + i * n_realizations + np.arange(n_realizations)
            shape = (n_realizations, n_periods, u.shape[1])
            noisy = np.broadcast_to(y[rows][:, None], shape) + sigma * rng.standard_normal(shape)
            record = nlfrf.Record(u=np.broadcast_to(u[rows][:, None], shape), y=noisy, fs=ms.fs, lines=ms.lines)
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", nlfrf.DataWarning)
                bla = nlfrf.identify(record, level_from=level_from)
            G.append(bla.G)
            bound.append(bla.bound())
            bound_new.append(bla.bound(of="realization"))
        G, bound, bound_new = map(np.array, (G, bound, bound_new))
        new = each[n_truth + n_realizations * np.arange(1, n_records + 1)]  # one that was not in the record
        inside, inside_new = np.abs(G - truth) < bound, np.abs(G - new) < bound_new
        width = np.median(bound / (TRUE_SIGMA * np.sqrt(np.mean(np.abs(G - truth) ** 2, axis=0))))
        width_near = np.median((bound / (TRUE_SIGMA * np.sqrt(np.mean(np.abs(G - truth) ** 2, axis=0))))[:, near])
        yield (
            plant,
            kind,
            n_realizations,
            bla.level_source,
            "none" if snr is None else f"{snr} dB",
            100 * inside.mean(),
            100 * inside[:, near].mean(),
            100 * inside_new.mean(),
            100 * inside_new[:, near].mean(),
            width,
            width_near,
        )


HEADER = ("plant", "grid", "M", "level from", "SNR", "bla %", "near %", "new %", "near %", "width", "near")
ROW = "{:<11} {:<12} {:>2} {:<27} {:>6} {:>6.1f} {:>6.1f} {:>6.1f} {:>6.1f} {:>6.2f} {:>6.2f}"


def cases():
    """Every case of the table."""
    for kind in ("special-odd", "random-odd"):
        for plant in RMS:
            yield plant, kind, 1
    for kind in ("odd-odd", "full"):
        for plant in RMS:
            yield plant, kind, 1
    for kind in ("special-odd", "random-odd"):
        for plant in RMS:
            yield plant, kind, 2


DESIGN = dict(fs=1024, n_samples=1024, f_min=1, f_max=200)
HARD_ROW = (
    "{:<9} {:<11} {:<11} {:>3} lines M {:<2} P {} {:<6} {:<26}"
    " bla {:5.1f} {:5.1f} {:5.1f} {:5.1f}  new {:5.1f} {:5.1f} {:5.1f} {:5.1f}  width {:.2f} {:.2f} {}"
)


def hard_cases():
    """(group, plant, kind, M, P, SNR [dB], what differs from DESIGN, files that are played again or 0)."""
    for M in (2, 7, 20):
        yield "repeats", "cubic", "special-odd", M, 2, 30, {}, 1
    yield "repeats", "cubic", "special-odd", 6, 2, 30, {}, 3
    sparse = dict(fs=128, n_samples=2048, f_min=0.0625, f_max=40, n_log=60)
    for plant in ("Wiener", "Hammerstein", "cubic"):
        for M in (1, 7, 20):
            yield "sparse", plant, "special-odd", M, 1, None, dict(n_samples=4096, f_min=0.25, n_log=60), 0
    for M in (1, 7):
        yield "sparse", "one-sided", "special-odd", M, 1, None, sparse, 0
    for kind in ("odd", "special-odd", "full"):
        for M in (7, 20):
            for snr in (30, 20, 10):
                yield "noise", "weak", kind, M, 2, snr, {}, 0
    for plant in ("quintic", "saturation"):
        for kind, f_max in (("odd", 300), ("odd-odd", 400), ("special-odd", 400)):
            yield "orders", plant, kind, 1, 1, None, dict(f_max=f_max), 0
    for plant in ("cubic", "saturation", "Wiener", "Hammerstein", "quintic"):
        for kind, f_max in (("odd", 18), ("odd", 24), ("odd-odd", 60), ("full", 14), ("special-odd", 64)):
            yield "narrow", plant, kind, 1, 1, None, dict(f_max=f_max), 0
            yield "narrow", plant, kind, 1, 2, 30, dict(f_max=f_max), 0
    for plant in ("cubic", "even", "Wiener", "Hammerstein"):
        for kind in ("special-odd", "random-odd", "odd", "full"):
            yield "ends", plant, kind, 1, 1, None, dict(f_min=10), 0
    for M in (1, 7):
        for plant in ("cubic", "saturation", "Wiener"):
            yield "crest", plant, "special-odd", M, 1, None, {}, 0
    yield from fresh_cases()


def fresh_cases():
    """Plants that no allowance was chosen on, on other lines, at another seed."""
    wide, fine = dict(f_min=3, f_max=170), dict(n_samples=2048, f_min=0.5, f_max=90)
    for plant in FRESH:
        for kind in ("special-odd", "random-odd", "odd", "full"):
            yield "fresh", plant, kind, 1, 1, None, wide if kind == "special-odd" else fine, 0
        yield "fresh", plant, "special-odd", 1, 2, 20, fine, 0
        yield "fresh", plant, "special-odd", 5, 1, None, wide, 0
        for kind, f_min, f_max in (("odd", 5, 30), ("full", 20, 32), ("special-odd", 17, 68), ("random-odd", 31, 63)):
            yield "fresh-few", plant, kind, 1, 1, None, dict(f_min=f_min, f_max=f_max), 0
        yield "fresh-few", plant, "special-odd", 4, 2, 30, dict(f_min=9, f_max=60), 0


def measure_hard(group, plant, kind, M, P, snr, change, n_files, n_records, rng):
    """One row of `HARD_ROW`."""
    ms = nlfrf.multisine(kind, **DESIGN | change, rng=rng)
    k, n_samples = ms.lines.excited, ms.n_samples
    total, n_truth = 0.0, 0
    while n_truth < 3000:
        u, y = played(ms, plant, 500, rng)
        total = total + np.sum(np.fft.rfft(y)[:, k] / np.fft.rfft(u)[:, k], axis=0)
        n_truth += 500
    u, y = played(ms, plant, M * n_records + 1, rng)
    each = np.fft.rfft(y)[:, k] / np.fft.rfft(u)[:, k]
    truth, new = total / n_truth, each[M * np.arange(1, n_records + 1)]
    if group == "crest":
        drawn = [nlfrf.reduce_crest(subset_of(ms, M, rng), oversampling=1, rng=rng).u for _ in range(n_records)]
        u = np.concatenate(drawn)
        y = PLANTS[plant](u, ms.fs)
    sigma = 0.0 if snr is None else np.sqrt(np.mean(y**2)) * 10 ** (-snr / 20)
    found = []
    for i in range(n_records):
        rows = i * M + (np.arange(M) % n_files if n_files else np.arange(M))
        shape = (M, P, n_samples)
        noisy = np.broadcast_to(y[rows][:, None], shape)
        if sigma:
            noisy = noisy + sigma * rng.standard_normal(shape)
        record = nlfrf.Record(u=np.broadcast_to(u[rows][:, None], shape), y=noisy, fs=ms.fs, lines=ms.lines)
        bla = nlfrf.identify(record)
        found.append((bla.G, bla.bound(), bla.bound(of="realization")))
    G, bound, bound_new = map(np.array, zip(*found, strict=True))
    scores, widths, missed = [], [], ""
    for other, radius, letter in ((truth, bound, "B"), (new, bound_new, "N")):
        inside, error = np.abs(G - other) < radius, np.sqrt(np.mean(np.abs(G - other) ** 2, axis=0))
        whole, first, last = inside.mean(), inside[:, :3].mean(), inside[:, -3:].mean()
        scores += [100 * x for x in (whole, first, last, inside.mean(axis=0).min())]
        widths.append(np.median(radius / (TRUE_SIGMA * error)))
        held = 93 <= scores[-4] <= 99.5 and min(scores[-3:-1]) >= 90 and scores[-1] >= 80
        missed += "" if held else letter
    missed += "W" if widths[0] > (1.6 if k.size >= 10 else 2.0) else ""
    said = "none" if snr is None else f"{snr} dB"
    return group, plant, kind, k.size, M, P, said, bla.level_source, *scores, *widths, missed


def subset_of(ms, n, rng):
    """The same multisine with n realisations of fresh phases."""
    return replace(ms, phase=rng.uniform(0, 2 * np.pi, (n, ms.f.size)))


def row_of_hard(case, n_records):
    """Its row of `HARD_ROW`, in a process of its own; several realisations count for several records."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)
        return measure_hard(*case, max(100, n_records // case[3]), np.random.default_rng(1))


def rows_of(case, n_records):
    """The rows of one case of the table, in a process of its own."""
    plant, kind, n_realizations = case
    return list(measure(plant, kind, n_records, n_realizations=n_realizations))


def print_hard(group, n_records, each):
    """The table of the hard cases."""
    held = total = 0
    chosen = [case for case in hard_cases() if group in (None, case[0])]
    for row in each(row_of_hard, chosen, [n_records] * len(chosen)):
        print(HARD_ROW.format(*row), flush=True)
        held, total = held + (row[-1] == ""), total + 1
    print(f"{held} of {total} cases hold the target")


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--plant")
    parser.add_argument("--kind")
    parser.add_argument("--realizations", type=int)
    parser.add_argument("--hard", action="store_true", help="the cases that try the bound")
    parser.add_argument("--group", help="one group of the hard cases")
    parser.add_argument("--processes", type=int, default=1, help="cases worked on at a time")
    chosen = parser.parse_args()
    several = ProcessPoolExecutor(chosen.processes) if chosen.processes > 1 else nullcontext()
    with several as executor:
        print_tables(chosen, executor)


def print_tables(chosen: argparse.Namespace, executor: Executor | None) -> None:
    """One of the tables; each case has its own random numbers, so that it does not matter who works it out."""
    each = map if executor is None else executor.map
    if chosen.hard or chosen.group:
        print_hard(chosen.group, chosen.records, each)
        return
    print("{:<11} {:<12} {:>2} {:<27} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}".format(*HEADER))
    wanted = chosen.plant, chosen.kind, chosen.realizations
    asked = [case for case in cases() if all(w in (None, c) for w, c in zip(wanted, case, strict=True))]
    for rows in each(rows_of, asked, [chosen.records] * len(asked)):
        for row in rows:
            print(ROW.format(*row), flush=True)


if __name__ == "__main__":
    main()
