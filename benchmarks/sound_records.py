"""Records that look like faults and are none: how often they are refused or warned of, and what their bound holds.

python -m benchmarks.sound_records [--records 40]

A resonance at 20 Hz that starts from rest and rings on, or settled behind much noise; then the same with samples of the
output lost at a place drawn by chance, which has to be told.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from scipy import signal

import nlfrf

FS, N = 512, 1024


def played(damping, n_periods, seed, *, settled, noise=1e-3):
    """Design, input, output and the true FRF as a function of frequency."""
    rng = np.random.default_rng(seed)
    ms = nlfrf.multisine(fs=FS, n_samples=N, f_min=0.5, f_max=100, rng=rng)
    w = 2 * np.pi * 20
    b, a, _ = signal.cont2discrete(([w * w], [1, 2 * damping * w, w * w]), 1 / FS)
    u = np.tile(ms.u[0], n_periods)
    y = signal.lfilter(b[0], a, u)
    if settled:
        y = np.tile(signal.lfilter(b[0], a, np.tile(ms.u[0], 60))[-N:], n_periods)
    y = y + noise * np.std(y) * rng.standard_normal(y.size)
    return ms, u, y, lambda f: signal.freqz(b[0], a, 2 * np.pi * f / FS)[1]


def without(y, n, seed):
    """The same with n samples lost, not in the first or last half period."""
    at = int(np.random.default_rng(seed).integers(N // 2, y.size - N // 2))
    return np.concatenate([y[:at], y[at + n :], y[-N : -N + n]])


def outcome(u, y, truth):
    """What is said, "refused", "warned" or nothing, and the share of the lines that the bound holds."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(nlfrf.record_from_samples(u, y, fs=FS, n_samples=N))
        except ValueError:
            return "refused", np.nan
    return "warned" if said else "", np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=40)
    n = parser.parse_args().records
    cases = [
        (f"rings, damping {damping:g}", damping, n_periods, False, 1e-3, 0)
        for damping in (0.003, 0.01, 0.03)
        for n_periods in (2, 3, 4)
    ]
    cases += [
        (f"noise {noise:g} times y", 0.1, n_periods, True, noise, 0)
        for noise in (1, 3, 10)
        for n_periods in (3, 4, 8, 12)
    ]
    cases += [
        (f"{lost} samples lost", 0.1, n_periods, True, noise, lost)
        for lost in (1, 5)
        for n_periods in (2, 3, 8)
        for noise in (1e-3, 0.1)
    ]
    print(f"{'case':<20} {'periods':>7} {'noise':>6} {'refused':>8} {'warned':>7}   of {n}; the bound holds")
    for name, damping, n_periods, settled, noise, lost in cases:
        found = []
        for seed in range(n):
            _, u, y, truth = played(damping, n_periods, seed, settled=settled, noise=noise)
            found.append(outcome(u, without(y, lost, seed) if lost else y, truth))
        words, shares = [word for word, _ in found], [share for _, share in found if share == share]
        held = f"{100 * np.mean(shares):.1f} %" if shares else "-"
        print(f"{name:<20} {n_periods:>7} {noise:>6g} {words.count('refused'):>8} {words.count('warned'):>7}   {held}")


if __name__ == "__main__":
    main()
