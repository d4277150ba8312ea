"""Realisations whose outputs stand beside other inputs than they answer, and hostile ones that are
sound.

python -m benchmarks.mispaired [--records 100]

Up to forty modes with a delay drawn by chance, with a cubic before them, then nothing but noise, a
third power, a square and a sine: on all grids, of 2 to 50 realisations, from little noise to thirty
times the output. None of these may be refused. Then plants of `benchmarks.drawn` whose outputs
moved on by one realisation, or of which one turned.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import numpy as np

import nlfrf
from benchmarks.drawn import drawn, drawn_case
from benchmarks.plants import played

N = 512
GRIDS = ("special-odd", "random-odd", "odd", "full", "odd-odd")


def hostile(number):
    """A sound record whose FRF is far from smooth, or lost in noise and distortion."""
    rng = np.random.default_rng([8, number])
    n = int(rng.choice([2, 3, 5, 7, 20, 50], p=[0.3, 0.2, 0.2, 0.2, 0.07, 0.03]))
    n_periods = 1 + number % 2
    kind, low = GRIDS[number % len(GRIDS)], int(rng.integers(1, 20))
    band = dict(fs=N, n_samples=N, f_min=low, f_max=int(rng.integers(low + 30, 240)))
    n_log = 30 if kind != "odd-odd" and rng.random() < 0.25 else None
    ms = nlfrf.multisine(kind, **band, n_log=n_log, n_realizations=n, rng=rng)
    u, f = np.repeat(ms.u[:, None], n_periods, axis=1), np.arange(N // 2 + 1)
    modes = rng.uniform(2, 250, int(rng.integers(1, 40)))
    H = np.sum(
        [rng.standard_normal() / (1 - (f / one) ** 2 + 0.01j * f / one) for one in modes], axis=0
    )
    H = H * np.exp(-2j * np.pi * f * rng.uniform(0, 0.9))
    x = (0 * u, u**3, u**2, np.sin(5 * u), u, u + u**3)[number % 6]
    y = x if number % 6 < 4 else np.fft.irfft(np.fft.rfft(x) * H, N)
    y = y + (np.std(y) or 1.0) * 10 ** rng.uniform(-2, 1.5) * rng.standard_normal(u.shape)
    return nlfrf.Record(u=u, y=y, fs=N, lines=ms.lines)


def said_of(record):
    """What is said of the pairing: "refused", "warned" or nothing."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            nlfrf.identify(record)
        except ValueError as error:
            if not str(error).startswith(("y must follow the u", "y must have the same sign")):
                raise
            return "refused"
    return "warned" if any("does not follow u" in str(one.message) for one in said) else ""


def main() -> None:
    """Print how many of each are refused and warned of."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=100)
    n_records = parser.parse_args().records
    told = Counter(said_of(hostile(number)) for number in range(6 * n_records))
    print(
        f"hostile, sound: {told['refused']} refused (wanted 0), {told['warned']} warned of, of"
        f" {6 * n_records}"
    )
    told = {name: Counter() for name in ("sound", "moved on", "turned")}
    for number in range(n_records):
        kind, _, n_periods, snr, change, _ = drawn_case(number)
        rng = np.random.default_rng(number)
        ms = nlfrf.multisine(kind, **dict(fs=1024, n_samples=1024) | change, rng=rng)
        u, y = played(ms, drawn(number)[0], (2, 3, 7)[number % 3], rng)
        u, y = (np.repeat(x[:, None], n_periods, axis=1) for x in (u, y))
        if snr is not None:
            y = y + np.sqrt(np.mean(y**2)) * 10 ** (-snr / 20) * rng.standard_normal(y.shape)
        turned = y.copy()
        turned[0] *= -1
        for name, wrong in (("sound", y), ("moved on", np.roll(y, 1, axis=0)), ("turned", turned)):
            told[name][said_of(nlfrf.Record(u=u, y=wrong, fs=1024, lines=ms.lines))] += 1
    for name, count in told.items():
        print(f"{name}: {count['refused']} refused, {count['warned']} warned of, of {n_records}")


if __name__ == "__main__":
    main()
