"""Plants drawn by chance: a law between two linear parts, or in the spring of a mass; each number
is another plant.
"""

from __future__ import annotations

import numpy as np

from benchmarks.plants import mode, spring

SETTLED = 8  # periods of two seconds: a ten-millionth is left of the slowest transient
GRIDS = ("special-odd", "random-odd", "odd", "full")
LAWS = {
    "power": lambda x, a: np.sign(x) * np.abs(x) ** (1 + 3 * a),
    "saturation": lambda x, a: np.tanh((0.5 + 2 * a) * x),
    "dead zone": lambda x, a: x - np.clip(x, -0.2 - 0.6 * a, 0.2 + 0.6 * a),
    "one way": lambda x, a: np.maximum(x, (2 * a - 1) * x),
    "step": lambda x, a: np.sign(x) * (np.abs(x) > a),
    "wave": lambda x, a: np.sin((1 + 2 * a) * x),
    "exponential": lambda x, a: np.expm1((0.2 + 0.8 * a) * x),
}


def drawn(number):
    """(plant of u and fs, what it is) from a number."""
    rng = np.random.default_rng([2026, number])
    zeta, f_n = 10 ** rng.uniform(-1.6, -0.3, 2), 10 ** rng.uniform(0.9, 1.9, 2)
    if rng.random() < 0.4:
        parts = rng.random(3) < 0.6
        parts[rng.integers(3)] = True
        law = (rng.uniform(0.3, 1), *(rng.uniform(0.2, 1, 3) * (0.02, 1.5, 0.6) * parts))
        damping = max(zeta[0], 0.025)
        said = f"mode {f_n[0]:.0f} Hz {damping:.3f}, spring " + " ".join(
            f"{part:.2g}" for part in law
        )
        return (lambda u, fs: spring(u, fs, law, damping, f_n[0], SETTLED)), said
    name = list(LAWS)[rng.integers(len(LAWS))]
    share, a = rng.uniform(0.1, 1.0), rng.random()
    before, behind = (int(chance < 0.5) for chance in rng.random(2))

    def plant(u, fs):
        x = mode(u, fs, zeta[0], f_n[0]) if before else u
        x = x / np.sqrt(np.mean(x**2))
        y = (1 - share) * x + share * LAWS[name](x, a)
        return mode(y, fs, zeta[1], f_n[1]) if behind else y

    parts = [f"mode {f_n[0]:.0f} Hz {zeta[0]:.3f}"] * before + [f"{share:.2f} {name} {a:.2f}"]
    return plant, ", ".join(parts + [f"mode {f_n[1]:.0f} Hz {zeta[1]:.3f}"] * behind)


def drawn_case(number):
    """(grid, M, P, SNR [dB], what differs of the design, no file played again) from a number."""
    rng = np.random.default_rng([1977, number])
    f_min = rng.choice([0.5, 2.0, 8.0, 20.0])
    change = dict(
        n_samples=2048, f_min=float(f_min), f_max=float(f_min + rng.choice([40.0, 80.0, 160.0]))
    )
    kind = GRIDS[number % len(GRIDS)]
    periods, snr = ((1, None), (1, None), (2, 30), (2, 15))[rng.integers(4)]
    return kind, int(rng.choice([1, 1, 1, 2, 5])), periods, snr, change, 0
