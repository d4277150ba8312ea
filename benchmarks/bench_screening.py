"""Screening of random records: sound ones from rest, with lost samples, silence, wraps and outliers; counts of each.

    python -m benchmarks.bench_screening [--records 400] [--only NAME ...]

Plants of one or two modes anywhere in the band, damping 0.01 to 0.5, half of them with a cubic spring and drag, are
played from rest for two to eight periods; noise 0 to 5 % of y. Every row prints what was said and how often.
"""

from __future__ import annotations

import argparse
import time
import warnings
from typing import NamedTuple

import numpy as np

import nlfrf

FS, N, LONGEST, WARM = 1024.0, 1024, 8, 14  # sampling frequency [Hz], period [samples], periods, and before settled ones
OVERSAMPLING = 2


class Run(NamedTuple):
    """One record: design, input and output from rest (WARM + LONGEST periods), periods to use, noise, true FRF or None."""

    ms: nlfrf.Multisine
    u: np.ndarray
    y: np.ndarray
    n_periods: int
    rng: np.random.Generator
    G: np.ndarray | None


def runs(n, seed=0, batch=200):
    """n random records, simulated `batch` at a time."""
    for first in range(0, n, batch):
        yield from one_batch(min(batch, n - first), np.random.default_rng([seed, first]))


def one_batch(n, rng):
    """Records of n plants (x'' = w^2 (f - x - c x^3) - 2 zeta w x' - q |x'| x', two modes each), by RK4 at once."""
    designs = [
        nlfrf.multisine(
            ("special-odd", "odd", "full")[int(rng.integers(8)) // 3], fs=FS, n_samples=N, f_min=1,
            f_max=float(rng.uniform(60, 400)), rms=1.0, rng=int(rng.integers(1 << 30)),
        )
        for _ in range(n)
    ]  # fmt: skip
    u = np.stack([ms.u[0] for ms in designs])
    w = 2 * np.pi * 10 ** rng.uniform(np.log10(1.5), np.log10(200), (2, n))
    zeta = 10 ** rng.uniform(-2, np.log10(0.5), (2, n))
    share = np.stack([np.ones(n), rng.choice([0.0, 1.0, -1.0], n) * 10 ** rng.uniform(-1.5, 0.5, n)])
    f = np.fft.rfftfreq(N, 1 / FS)
    H = np.stack([1 / (1 - (2 * np.pi * f / w[:, i, None]) ** 2 + 2j * zeta[:, i, None] * 2 * np.pi * f / w[:, i, None])
                  for i in range(n)], axis=1)  # fmt: skip
    size = np.std(np.fft.irfft(np.fft.rfft(u) * H, N), axis=-1)
    nonlinear = rng.random(n) < 0.5
    c = np.where(nonlinear, 10 ** rng.uniform(-3, -1.3, (2, n)), 0.0) / size**2
    q = np.where(nonlinear, 10 ** rng.uniform(-3, -1, (2, n)), 0.0) * w / (w * size) * 0.3
    y = share[0] * 0.0
    fine = OVERSAMPLING
    held = np.fft.irfft(np.fft.rfft(u), 2 * fine * N) * 2 * fine
    h = 1 / (fine * FS)
    x, v = np.zeros((2, 2, n))
    out = np.empty((n, (WARM + LONGEST) * N))
    mix = share / np.maximum(size, 1e-300)

    def acceleration(x, v, force):
        return w * w * (force - x - c * x**3) - 2 * zeta * w * v - q * np.abs(v) * v

    for k in range(out.shape[1] * fine):
        if k % fine == 0:
            out[:, k // fine] = (mix * x).sum(axis=0)
        j = 2 * k % held.shape[1]
        f0, f1, f2 = held[:, j], held[:, j + 1], held[:, (j + 2) % held.shape[1]]
        a1 = acceleration(x, v, f0)
        v2 = v + h / 2 * a1
        a2 = acceleration(x + h / 2 * v, v2, f1)
        v3 = v + h / 2 * a2
        a3 = acceleration(x + h / 2 * v2, v3, f1)
        v4 = v + h * a3
        a4 = acceleration(x + h * v3, v4, f2)
        x = x + h / 6 * (v + 2 * v2 + 2 * v3 + v4)
        v = v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    for i, ms in enumerate(designs):
        own = np.random.default_rng([int(rng.integers(1 << 30)), i])
        G = None if nonlinear[i] else (mix[:, i, None] * H[:, i])[:, ms.lines.excited].sum(axis=0)
        noise = own.choice([0.0, 10 ** own.uniform(-4, np.log10(0.05)), 10 ** own.uniform(-2, np.log10(0.05))])
        noisy = out[i] + noise * np.std(out[i, -N:]) * own.standard_normal(out.shape[1])
        yield Run(ms, np.tile(u[i], WARM + LONGEST), noisy, int(own.integers(2, LONGEST + 1)), own, G)
