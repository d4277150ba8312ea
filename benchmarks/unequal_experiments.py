"""Records of two or three inputs, sound and with one channel of another gain in one experiment:
what is said of them.

python -m benchmarks.unequal_experiments [--records 40]

Modes drawn by chance, 2 or 3 inputs, 1 to 3 outputs, 1 to 3 sets, periods as short as a resonance
is wide, noise of 0.01 to 10 %, an output with a cube of itself, settled or from rest. Then one
channel of one experiment 1, 3 or 10 % too high.
"""

from __future__ import annotations

import argparse
import warnings
from collections import Counter

import numpy as np
from scipy import signal

import nlfrf

FS, F_MAX = 256.0, 80.0


def played(seed, n, damping, *, noise=None, cubic=None):
    """Inputs, outputs and lines of a record, and the true matrix (of no cube)."""
    rng = np.random.default_rng(seed)
    n_u, n_y, n_sets = 2 + seed // 4 % 2, 1 + seed // 8 % 3, 1 + seed // 2 % 3
    noise = (1e-4, 1e-2, 0.1)[seed % 3] if noise is None else noise
    cubic = (0.0, 0.01, 0.05)[seed // 3 % 3] if cubic is None else cubic
    w = 2 * np.pi * np.sort(rng.uniform(8, 60, max(n_u, n_y) + 1))
    into, out = rng.standard_normal((w.size, n_u)), rng.standard_normal((n_y, w.size))
    kind = ("special-odd", "random-odd")[seed % 2]
    ms = nlfrf.multisine(
        kind,
        fs=FS,
        n_samples=n,
        f_min=2 * FS / n,
        f_max=F_MAX,
        n_inputs=n_u,
        n_realizations=n_sets,
        rng=rng,
    )
    n_periods, settle = 2 + seed % 2, 0 if seed % 5 == 0 else 40
    y = np.zeros((n_y, ms.n_experiments, n_periods * n))
    G = np.zeros((n_y, n_u, ms.lines.excited.size), dtype=complex)
    f = 2 * np.pi * ms.lines.excited / n
    for k, one in enumerate(w):
        b, a, _ = signal.cont2discrete(([one**2], [1, 2 * damping * one, one**2]), 1 / FS)
        forced = np.tile(np.tensordot(into[k], ms.u, 1), settle + n_periods)
        y += np.multiply.outer(out[:, k], signal.lfilter(b[0], a, forced)[:, settle * n :])
        G += np.multiply.outer(np.outer(out[:, k], into[k]), signal.freqz(b[0], a, f)[1])
    size = y.std(axis=(1, 2), keepdims=True)
    y = y + cubic * (y / size) ** 3 * size + noise * size * rng.standard_normal(y.shape)
    return (
        np.repeat(ms.u[:, :, None], n_periods, axis=2),
        y.reshape(*y.shape[:2], n_periods, n),
        ms.lines,
        G,
    )


def outcome(u, y, lines, G):
    """The warnings, and the share of the entries that the bound holds."""
    with warnings.catch_warnings(record=True) as said:
        warnings.simplefilter("always")
        frm = nlfrf.identify(nlfrf.Record(u=u, y=y, fs=FS, lines=lines))
    return " ".join(str(one.message) for one in said), float(
        np.mean(np.abs(frm.G - G) < frm.bound())
    )


def main() -> None:
    """Print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=40)
    n_records = parser.parse_args().records
    print(f"sound: warned of a channel, of jumps, of {n_records}")
    for damping in (0.1, 0.02, 0.005):
        for n in (128, 192, 256, 384, 512, 1024):
            count = Counter(
                word for e in range(n_records) for word in words(outcome(*played(e, n, damping))[0])
            )
            print(
                f"  damping {damping:<6g} N {n:>5}: {count['channel']:>3} {count['jumps']:>3}",
                flush=True,
            )
    print(
        f"one channel too high in one experiment: told, by its name, of {n_records}; the bound"
        " holds, told and not"
    )
    for n in (256, 512, 1024):
        for noise in (1e-3, 1e-2, 0.1):
            for by in (0.0, 0.01, 0.03, 0.1):
                tell_unequal(n, noise, by, n_records)


def tell_unequal(n, noise, by, n_records):
    """A row: how often it is told, and what the bound holds."""
    told, named, held = 0, 0, {True: [], False: []}
    for e in range(n_records):
        u, y, lines, G = played(5 * e + 1, n, 0.05, noise=noise, cubic=0.0)
        rng = np.random.default_rng(e)
        side, x = (("u", u), ("y", y))[e % 2]
        channel, experiment = rng.integers(x.shape[0]), rng.integers(x.shape[1])
        x[channel, experiment] *= 1 + by
        said, share = outcome(u, y, lines, G)
        found = "channel" in words(said)
        told, named = told + found, named + (found and f"{side}{channel + 1}" in said)
        held[found].append(share)
    shares = " ".join(
        f"{100 * np.mean(some):5.1f} %" if some else "      -" for some in held.values()
    )
    print(
        f"  N {n:>5} noise {noise:<6g} {100 * by:>3g} %: {told:>3} {named:>3}   {shares}",
        flush=True,
    )


def words(said):
    """What the warnings tell of."""
    return [
        name
        for name, word in (("channel", "than in the others"), ("jumps", "jumps"))
        if word in said
    ]


if __name__ == "__main__":
    main()
