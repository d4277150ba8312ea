"""How often the 95 % bound from one record holds: the table of the README.

python -m benchmarks.coverage [--records 200]
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np

import nlfrf
from benchmarks.plants import RMS, realisations, resonance

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


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=200)
    parser.add_argument("--plant")
    parser.add_argument("--kind")
    parser.add_argument("--realizations", type=int)
    chosen = parser.parse_args()
    print("{:<11} {:<12} {:>2} {:<27} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6} {:>6}".format(*HEADER))
    for plant, kind, n_realizations in cases():
        if chosen.plant not in (None, plant) or chosen.kind not in (None, kind):
            continue
        if chosen.realizations not in (None, n_realizations):
            continue
        for row in measure(plant, kind, chosen.records, n_realizations=n_realizations):
            print(ROW.format(*row), flush=True)


if __name__ == "__main__":
    main()
