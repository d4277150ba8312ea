"""Bounds of mu, of the worst gain and of gamma that hold at every frequency, against searches of
another kind.

    python -m benchmarks.bounds_mu parameters 500      # real parameters whose mu is at one frequency
    python -m benchmarks.bounds_mu mixed 500           # a complex block beside them
    python -m benchmarks.bounds_mu lags 500            # mixsyn of stiff lags

A bound is exceeded where a loop that was drawn does what the bound excludes: a perturbation that
takes a pole across the stability boundary, a member of the set with a larger gain, a controller
with a smaller norm. Parameters are drawn at corners, on edges and inside, and moved by the method
of Nelder and Mead; gains are read on a grid around the poles of the closed loop. What is printed:
how many bounds were exceeded, and how far above the best of the search they lie.
"""

from __future__ import annotations

import argparse
import itertools
import time

import control
import numpy as np
from scipy.optimize import minimize

import robust
from tests.support.responses import response

ROUNDING = 1e-6  # relative: a bound that a search exceeds by less is not exceeded
N_DRAWN = 400


def drawn_loop(seed: int, *, complex_block: bool) -> tuple[control.StateSpace, list]:
    """One to four real parameters in masses on springs or in lags, with one channel of performance,
    and the blocks.
    """
    rng = np.random.default_rng([31, seed, complex_block])
    r, modes = int(rng.integers(1, 5)), int(rng.integers(1, 4))
    if rng.random() < 0.7:
        omega, zeta = 10 ** rng.uniform(-2, 2, modes), 10 ** rng.uniform(-3, -0.3, modes)
        A = np.zeros((2 * modes, 2 * modes))
        for k in range(modes):
            A[2 * k : 2 * k + 2, 2 * k : 2 * k + 2] = [
                [0, omega[k]],
                [-omega[k], -2 * zeta[k] * omega[k]],
            ]
    else:
        A = rng.standard_normal((2 * modes, 2 * modes))
        A -= (np.linalg.eigvals(A).real.max() + 10 ** rng.uniform(-3, 0)) * np.eye(2 * modes)
    n, m = len(A), r + complex_block
    B, C = rng.standard_normal((n, m + 1)), rng.standard_normal((m + 1, n))
    if rng.random() < 0.5:  # parameters of dampings and stiffnesses: one place each
        B[:, :r], C[:r] = 0, 0
        for k in range(r):
            row = 2 * int(rng.integers(modes)) + 1
            B[row, k], C[k, row - int(rng.integers(2))] = 1, 1
    blocks = [(1, 1, "real")] * r + [(1, 1)] * complex_block
    N = control.ss(A, B, C, np.zeros((m + 1, m + 1)))
    size = brute_size(N, r, complex_block, rng)[0]
    scale = np.ones(m + 1)
    scale[:m] = (
        size * rng.uniform(0.3, 1.1) if np.isfinite(size) else 1.0
    )  # so that mu is 0.3 to 1.1
    return control.ss(A, B * scale, C, np.zeros((m + 1, m + 1))), blocks


def closed(N: control.StateSpace, x: np.ndarray) -> np.ndarray:
    """Return (K, n, n) of the loop with parameters, and complex numbers behind them, (K, m)."""
    m = x.shape[1]
    return N.A + N.B[:, :m] @ (x[:, :, None] * N.C[:m])


def drawn_points(
    r: int, complex_block: bool, rng: np.random.Generator, n: int = N_DRAWN
) -> np.ndarray:
    """Return (K, r + 1 or r) corners, edges and insides of the box; complex numbers of modulus one
    behind.
    """
    inside = rng.uniform(-1, 1, (n, r))
    edges = np.where(np.arange(r) == rng.integers(r, size=(n, 1)), inside, np.sign(inside))
    x = np.concatenate([np.array(list(itertools.product((-1.0, 1.0), repeat=r))), edges, inside])
    phase = np.exp(2j * np.pi * rng.random((len(x), 1)))
    return np.hstack([x, phase]) if complex_block else x


def smallest_unstable(N: control.StateSpace, x: np.ndarray) -> np.ndarray:
    """Return (K,) the least factor on each point at which a pole has crossed; inf for none up to
    1e3 of the first.
    """
    sizes = np.geomspace(1e-4, 1e4, 120)
    found = np.full(len(x), np.inf)
    for size in sizes[::-1]:
        found[np.linalg.eigvals(closed(N, size * x)).real.max(axis=1) > 0] = size
    high = np.where(np.isfinite(found), found, 1.0)
    low = high / (sizes[1] / sizes[0])
    for _ in range(30):
        middle = (low + high) / 2
        unstable = np.linalg.eigvals(closed(N, middle[:, None] * x)).real.max(axis=1) > 0
        low, high = np.where(unstable, low, middle), np.where(unstable, middle, high)
    return np.where(np.isfinite(found), high, np.inf)


def brute_size(
    N: control.StateSpace, r: int, complex_block: bool, rng: np.random.Generator
) -> tuple[float, np.ndarray]:
    """Return the size of the smallest perturbation found to destabilise, and it: drawn, then
    moved.
    """
    points = drawn_points(r, complex_block, rng)
    sizes = smallest_unstable(N, points)
    best, x = float(sizes.min()), points[sizes.argmin()]
    if not np.isfinite(best):
        return best, x

    def point(y: np.ndarray) -> np.ndarray:
        real = (
            y[:r] / max(float(np.abs(y[:r]).max()), 1e-9)
            if not complex_block
            else np.clip(y[:r], -1, 1)
        )
        return np.append(real + 0j, np.exp(1j * y[r:])) if complex_block else real

    start = np.append(x[:r].real, np.angle(x[r:])) if complex_block else x
    moved = minimize(
        lambda y: min(float(smallest_unstable(N, point(y)[None])[0]), 1e6), start, method="Nelder-Mead",
        options={"maxfev": 60},
    )  # fmt: skip
    return min(best, float(moved.fun)), point(moved.x)


def brute_gain(
    N: control.StateSpace, r: int, complex_block: bool, rng: np.random.Generator
) -> float:
    """Return the largest gain found of members of the set, inf where one is unstable."""
    points = drawn_points(r, complex_block, rng)
    best = 0.0
    poles = np.linalg.eigvals(closed(N, points))
    if poles.real.max() > 0:
        return np.inf
    for x, p in zip(points, poles, strict=True):
        best = max(best, gain_of(N, x, p))
    if not complex_block:

        def lower(y: np.ndarray) -> float:
            x = np.clip(y, -1, 1)
            p = np.linalg.eigvals(closed(N, x[None])[0])
            return -np.inf if p.real.max() > 0 else -gain_of(N, x, p)

        gains = [gain_of(N, x, p) for x, p in zip(points[:40], poles[:40], strict=True)]
        best = max(
            best,
            -minimize(
                lower, points[int(np.argmax(gains))], method="Nelder-Mead", options={"maxfev": 60}
            ).fun,
        )
    return best


def gain_of(N: control.StateSpace, x: np.ndarray, p: np.ndarray) -> float:
    """Return the largest gain of the performance channel on a grid around the poles."""
    omega = np.concatenate([[0.0], *(abs(q) * np.array([0.3, 0.7, 1, 1.5, 3]) for q in p)])
    omega = np.concatenate(
        [omega, *(q.imag + abs(q.real) * np.linspace(-3, 3, 25) for q in p if q.imag >= 0)]
    )
    A, m = closed(N, x[None])[0], len(x)
    g = np.linalg.solve(1j * omega[:, None, None] * np.eye(len(A)) - A, N.B[:, m:][None])
    return float(np.abs(N.C[m:] @ g).max())


def compare(seed: int, *, complex_block: bool) -> dict[str, float]:
    """Return bounds over what the search found, of one loop: below one is exceeded."""
    N, blocks = drawn_loop(seed, complex_block=complex_block)
    r, m, rng = len(blocks) - complex_block, len(blocks), np.random.default_rng(seed)
    begin = time.process_time()
    mu = robust.mu.bounds(control.ss(N.A, N.B[:, :m], N.C[:m], N.D[:m, :m]), blocks)
    gain = robust.mu.worst_gain(N, blocks)
    seconds = time.process_time() - begin
    size = brute_size(N, r, complex_block, rng)[0]
    reached = brute_gain(N, r, complex_block, rng)
    below = 1 / size if np.isfinite(size) else 0.0
    return {
        "mu": mu.upper.max() / below if below else np.nan,
        "mu, own": mu.upper.max() / mu.lower.max() if mu.lower.max() else np.nan,
        "mu, lower": mu.lower.max() / below if below else np.nan,
        "gain": (
            gain.upper.max() / reached
            if np.isfinite(reached) or np.isfinite(gain.upper.max())
            else 1.0
        ),
        "gain, own": gain.upper.max() / gain.lower.max() if np.isfinite(gain.lower.max()) else 1.0,
        "proved": bool(mu.certificates and (gain.certificates or np.isinf(gain.lower.max()))),
        "seconds": seconds,
    }


def drawn_lags(seed: int) -> tuple[control.StateSpace, control.TransferFunction, float]:
    """A plant with poles over 6 to 12 decades, a third with a zero, a third with light modes and
    zeros; w_P and w_u.
    """
    rng = np.random.default_rng([77, seed])
    decades, n = rng.uniform(6, 12), int(rng.integers(2, 5))
    lags = 10 ** np.sort(
        np.r_[rng.uniform(-decades / 2, decades / 2, n - 2), -decades / 2, decades / 2]
    )
    G = control.ss(control.tf([10 ** rng.uniform(-2, 2)], [1]))
    for k, T in enumerate(lags):
        zero = [10 ** rng.uniform(-decades / 2, decades / 2)] if seed % 3 == 1 and not k else []
        G = G * control.ss(control.tf([*zero, 1], [T, 1]))
    for _ in range(int(rng.integers(1, 4)) if seed % 3 == 2 else 0):
        omega = 10 ** rng.uniform(-1, 3)
        above = rng.uniform(1.05, 1.5)
        zetas = 10 ** rng.uniform(-4, -1.5, 2)
        parts = [
            [1 / w**2, 2 * z / w, 1] for w, z in zip((omega * above, omega), zetas, strict=True)
        ]
        G = G * control.ss(control.tf(*parts))
    w_P = robust.performance_weight(
        10 ** rng.uniform(-decades / 3, decades / 3), M_S=2, A=10 ** rng.uniform(-4, -1)
    )
    return G, w_P, 10 ** rng.uniform(-3, 4)


def norm_of(
    G: control.StateSpace, K: control.StateSpace, w_P: control.TransferFunction, w_u: float
) -> float:
    """Return the norm of [w_P S; w_u K S] on a dense grid; inf where the loop is not stable."""
    loop = control.feedback(1, G * K)
    if loop.poles().real.max() >= 0:
        return np.inf
    size = np.abs(np.concatenate([G.poles(), G.zeros(), K.poles(), K.zeros(), loop.poles()]))
    size = size[size > 0]
    light = [
        q.imag * (1 + abs(q.real / q.imag) * np.linspace(-3, 3, 31))
        for q in loop.poles()
        if q.imag > 0
    ]
    omega = np.concatenate(
        [[0], np.geomspace(size.min() / 1e3, size.max() * 1e3, 4000), size, *light]
    )
    k = response(K, omega)
    S = 1 / (1 + response(G, omega) * k)
    return float(np.sqrt(np.abs(w_P(1j * omega) * S) ** 2 + np.abs(w_u * k * S) ** 2).max())


def compare_lags(seed: int) -> dict[str, float]:
    """Return what controllers of other kinds reach over gamma_min, gamma over gamma_min, and what
    falls with w_u.
    """
    G, w_P, w_u = drawn_lags(seed)
    begin = time.process_time()
    design = robust.mixsyn(G, w_P, w_u)
    seconds = time.process_time() - begin
    heavier = robust.mixsyn(G, w_P, 3 * w_u)
    gains = [
        control.ss([], [], [], [[k / abs(G(0).real)]]) for k in [0, *np.geomspace(1e-4, 1e4, 33)]
    ]
    speeds = np.abs(G.poles())
    lags = [
        K * control.ss(control.tf([T, 1], [1 / speed, 1]))
        for K in gains[1::3]
        for speed in speeds
        for T in 1 / speeds
    ]
    best = min(norm_of(G, K, w_P, w_u) for K in (*gains, *lags, design.K, heavier.K))
    return {
        "gamma_min": best / design.gamma_min,
        "gamma": design.gamma / design.gamma_min,
        "heavier w_u": heavier.gamma / design.gamma * 1.02,
        "seconds": seconds,
    }


def print_table(rows: list[dict[str, float]]) -> None:
    """Print how many bounds were exceeded, and how far above the search they lie."""
    for name in rows[0]:
        values = np.array([row[name] for row in rows], dtype=float)
        known = values[np.isfinite(values)]
        exceeded, unknown = int((known < 1 - ROUNDING).sum()), len(values) - len(known)
        print(
            f"{name:12s} {exceeded:4d} of {len(values)} below one; median {np.median(known):.4g}, "
            f"95 % {np.quantile(known, 0.95):.4g}, largest {known.max():.4g}, not finite {unknown}",
            flush=True,
        )


def main() -> None:
    """Draw loops of one kind and print the table."""
    parser = argparse.ArgumentParser(
        description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
    )
    parser.add_argument("kind", choices=["parameters", "mixed", "lags"])
    parser.add_argument("n", type=int)
    parser.add_argument("--first", type=int, default=0)
    given = parser.parse_args()
    rows = []
    for seed in range(given.first, given.first + given.n):
        row = (
            compare_lags(seed)
            if given.kind == "lags"
            else compare(seed, complex_block=given.kind == "mixed")
        )
        rows.append(row)
        if (
            any(row[name] < 1 - ROUNDING for name in row if name not in ("mu, lower", "seconds"))
            or row["seconds"] > 10
        ):
            print(seed, {name: round(float(x), 4) for name, x in row.items()}, flush=True)
        if len(rows) % 20 == 0 or len(rows) == given.n:
            print_table(rows)


if __name__ == "__main__":
    main()
