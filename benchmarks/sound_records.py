"""Records that look like faults and are none: how often they are refused or warned of, and what
their bound holds.

python -m benchmarks.sound_records [--records 40]

A resonance at 20 Hz that starts from rest and rings on, or settled behind much noise; then the same
with samples of the input, the output or both lost or repeated at a place drawn by chance, which has
to be told: anywhere but among the first sixteen, where what stands before the gap is too short to
be found again. Then at two places of one period.
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


def without(y, n, seed, first=16):
    """The same with n samples lost, or one repeated -n times, anywhere but among the first."""
    at = int(np.random.default_rng(seed).integers(first, y.size))
    if n > 0:
        return np.concatenate([y[:at], y[at + n :], y[-N : -N + n]])[: y.size]
    return np.concatenate([y[:at], np.full(-n, y[at]), y[at:]])[: y.size]


def without_twice(y, n, later, seed):
    """The same with n samples lost, or -n repeated, and behind them in one period as many as
    `later` says.
    """
    rng = np.random.default_rng([seed, 7])
    period = N * int(rng.integers(y.size // N))
    at = int(rng.integers(16, N - 200))
    spoilt = y
    for place, lost in ((int(rng.integers(at + 50, N)), later), (at, n)):
        place += period
        held = np.full(max(-lost, 0), spoilt[place])
        spoilt = np.concatenate([spoilt[:place], held, spoilt[place + max(lost, 0) :]])
    return np.append(spoilt, y[-N:])[: y.size] if spoilt.size < y.size else spoilt[: y.size]


def outcome(u, y, truth, resample=False):
    """What is said, "refused", "warned" or nothing, and the share of the lines that the bound
    holds.
    """
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(
                nlfrf.record_from_samples(u, y, fs=FS, n_samples=N, resample=resample)
            )
        except ValueError:
            return "refused", np.nan
    return "warned" if said else "", np.mean(np.abs(bla.G - truth(bla.f)) < bla.bound())


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=40)
    n = parser.parse_args().records
    cases = [
        (f"rings, damping {damping:g}", damping, n_periods, False, 1e-3)
        for damping in (0.003, 0.01, 0.03)
        for n_periods in (2, 3, 4)
    ]
    cases += [
        (f"noise {noise:g} times y", 0.1, n_periods, True, noise)
        for noise in (1, 3, 10)
        for n_periods in (3, 4, 8, 12)
    ]
    print(
        f"{'case':<20} {'periods':>7} {'noise':>6} {'refused':>8} {'warned':>7}   of {n}; the bound"
        " holds"
    )
    for name, damping, n_periods, settled, noise in cases:
        runs = (played(damping, n_periods, seed, settled=settled, noise=noise) for seed in range(n))
        tell(f"{name:<20} {n_periods:>7} {noise:>6g}", [outcome(*run[1:]) for run in runs])
    print(
        "\nsamples lost (+) or repeated (-): refused, warned, the bound holds; then the same with"
        " resample=True"
    )
    for where in ("y", "u", "both"):
        for lost in (1, 5, -3):
            for n_periods in (2, 3, 4, 8):
                for noise in (1e-3, 0.1):
                    found, cured = [], []
                    for seed in range(n):
                        _, u, y, truth = played(0.1, n_periods, seed, settled=True, noise=noise)
                        y = y if where == "u" else without(y, lost, seed)
                        u = u if where == "y" else without(u, lost, seed)
                        found.append(outcome(u, y, truth))
                        cured.append(outcome(u, y, truth, resample=True))
                    tell(f"{f'{lost:+d} in {where}':<20} {n_periods:>7} {noise:>6g}", found, cured)
    print("\nthe same at two places of one period")
    for where in ("y", "u", "both"):
        for first, later in ((1, -1), (5, -5), (1, 1), (3, 1)):
            for n_periods in (2, 3, 4, 8):
                for noise in (1e-3, 0.1):
                    found, cured = [], []
                    for seed in range(n):
                        _, u, y, truth = played(0.1, n_periods, seed, settled=True, noise=noise)
                        y = y if where == "u" else without_twice(y, first, later, seed)
                        u = u if where == "y" else without_twice(u, first, later, seed)
                        found.append(outcome(u, y, truth))
                        cured.append(outcome(u, y, truth, resample=True))
                    tell(
                        f"{f'{first:+d} {later:+d} in {where}':<20} {n_periods:>7} {noise:>6g}",
                        found,
                        cured,
                    )


def tell(case, *outcomes):
    """A row of how many were refused or warned of, and what the bound of the others holds."""
    for found in outcomes:
        words, shares = [word for word, _ in found], [share for _, share in found if share == share]
        held = f"{100 * np.mean(shares):5.1f} %" if shares else "      -"
        case += f" {words.count('refused'):>8} {words.count('warned'):>7}   {held}"
    print(case, flush=True)


if __name__ == "__main__":
    main()
