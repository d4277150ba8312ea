"""No verdict of robustness where brute force breaks the loop: random loops of two and three inputs
and outputs.

    python -m benchmarks.soundness_matrix [loops] [perturbations]

Each loop: a random plant and controller, continuous or sampled, a set of one of the forms with
random weights. Tried against the verdict: the breaking perturbation found, and random ones near it,
by the poles of the loop, at 0.99 of the margin and (the breaking one) at 1.01.
"""

from __future__ import annotations

import sys

import control
import numpy as np

import robust
from robust.models.sets.forms import MATRIX_FORMS
from robust.models.sets.model import UncertaintyModel


def random_system(rng, n, n_out, n_in, dt, gain):
    """A stable system with modes around 1 rad/s, or around a tenth of the sampling frequency."""
    if not n:
        return control.StateSpace([], [], [], gain * rng.standard_normal((n_out, n_in)), dt)
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 10 ** rng.uniform(-2, 0)) * np.eye(n)
    B, C = rng.standard_normal((n, n_in)), gain * rng.standard_normal((n_out, n))
    if dt:
        system = control.StateSpace(A, B, C, np.zeros((n_out, n_in)), 0)
        return robust.sampled(system, dt)
    return control.StateSpace(A, B, C, np.zeros((n_out, n_in)), 0)


def random_weight(rng, dt):
    """A weight of order one, or a number."""
    if rng.random() < 0.3:
        return control.StateSpace([], [], [], [[10 ** rng.uniform(-1.5, 0)]], dt)
    pole = 10 ** rng.uniform(-1, 1)
    low = 10 ** rng.uniform(-1.5, 0)
    high = 10 ** rng.uniform(-1.5, 0.5)
    weight = control.StateSpace([[-pole]], [[1.0]], [[(low - high) * pole]], [[high]], 0)
    return robust.lti.discretize(weight, dt) if dt else weight


def random_case(seed):
    """A set and a controller around which the nominal loop is stable."""
    rng = np.random.default_rng(seed)
    n, form = int(rng.integers(2, 4)), MATRIX_FORMS[seed % 3]
    dt = 0.1 if rng.random() < 0.5 else 0.0
    while True:
        G = random_system(rng, int(rng.integers(2, 6)), n, n, dt, 1.0)
        K = random_system(rng, int(rng.integers(0, 3)), n, n, dt, 10 ** rng.uniform(-1.5, 0.5))
        left = () if form == "elements" else tuple(random_weight(rng, dt) for _ in range(n))
        right = tuple(random_weight(rng, dt) for _ in range(n * n if form == "elements" else n))
        model = UncertaintyModel(
            nominal=G,
            form=form,
            left=left,
            right=right,
            omega=np.array([1.0]),
            radius=np.array(
                [[0.999 * abs(w(np.exp(0.1j) if dt else 1j))] for w in (*left, *right)]
            ),
            confidence=0.95,
            perturbation="LTI",
        )
        N = model.loop(K).loop
        p = N.poles()
        if (np.abs(p).max() < 1 - 1e-4) if dt else (p.real.max() < -1e-3):
            return model, K, rng


def closed_with(N, Delta, size):
    """Poles of N closed through size Delta, a batch (A, B, C, D) of systems, (T, .); nan without a
    solution.
    """
    A, B, C, D = Delta
    C, D = size * C, size * D
    T, m, n = len(A), A.shape[1], N.nstates
    around = np.eye(D.shape[1]) - D @ N.D
    solved = np.linalg.cond(around) < 1e12
    X = np.linalg.inv(np.where(solved[:, None, None], around, np.eye(D.shape[1])))
    gain = X @ np.concatenate([D @ N.C, C], axis=2)  # u = gain (x, x_Delta)
    read = N.D @ gain + np.concatenate(
        [np.broadcast_to(N.C, (T, *N.C.shape)), np.zeros((T, N.noutputs, m))], axis=2
    )
    whole = np.zeros((T, n + m, n + m))
    whole[:, :n, :n], whole[:, n:, n:] = N.A, A
    whole[:, :n] += N.B @ gain
    whole[:, n:] += B @ read
    return np.where(solved[:, None], np.linalg.eigvals(whole), np.nan)


def broken(N, Delta, size):
    """(T,) bool: whether N closed through size Delta has a pole beyond the boundary."""
    p = closed_with(N, Delta, size)
    return np.any(np.isnan(p) | (np.abs(p) > 1 + 1e-9 if N.dt else p.real > 1e-9), axis=1)


def passes(numbers, omega, dt):
    """States (a, b, c, d) of all-passes of first order that are these numbers (T, n) at omega (T,):

    |d| times +-1.
    """
    at = 2 / dt * np.tan(omega * dt / 2) if dt else omega
    size, phase = np.abs(numbers), np.angle(numbers)
    sign = np.where(phase <= 0, 1.0, -1.0)
    lag = np.clip(np.where(phase <= 0, -phase, np.pi - phase), 1e-3, np.pi - 1e-3)
    c = at[:, None] / np.tan(lag / 2)
    a, b, c, d = -c, np.ones_like(c), 2 * c * size * sign, -size * sign
    if not dt:
        return a, b, c, d
    a, b, c = a * dt / 2, b * np.sqrt(dt / 2), c * np.sqrt(dt / 2)
    back = 1 / (1 - a)
    return back * (1 + a), np.sqrt(2) * back * b, np.sqrt(2) * back * c, d + c * back * b


def diagonals(numbers):
    """(T, n, n) of (T, n)."""
    return numbers[:, :, None] * np.eye(numbers.shape[1])


def as_systems(delta, omega, dt, full):
    """`interpolate_perturbation` of many matrices (T, n, n) at once: of rank one, or diagonal."""
    if not full:
        return tuple(diagonals(part) for part in passes(np.einsum("tii->ti", delta), omega, dt))
    U, sizes, Vh = np.linalg.svd(delta)
    a1, b1, c1, d1 = passes(Vh[:, 0] * sizes[:, :1], omega, dt)
    a2, b2, c2, d2 = passes(U[:, :, 0], omega, dt)
    none = np.zeros((*a2.shape, a1.shape[1]))
    return (
        np.block(
            [[diagonals(a1), none.swapaxes(1, 2)], [b2[:, :, None] * c1[:, None], diagonals(a2)]]
        ),
        np.concatenate([diagonals(b1), b2[:, :, None] * d1[:, None]], axis=1),
        np.concatenate([d2[:, :, None] * c1[:, None], diagonals(c2)], axis=2),
        d2[:, :, None] * d1[:, None],
    )


def near(rng, Delta_at, omega, dt, full, n):
    """n perturbations of gain one near one that breaks, at frequencies near by."""
    spread = 10 ** rng.uniform(-3, -0.3, n)
    there = omega * np.exp(spread * rng.standard_normal(n))
    there = np.minimum(there, np.pi / dt * 0.999) if dt else there
    if not full:
        turned = np.diag(Delta_at) * np.exp(
            2j * spread[:, None] * rng.standard_normal((n, len(Delta_at)))
        )
        return as_systems(diagonals(turned), there, dt, full)
    noise = rng.standard_normal((2, n, *Delta_at.shape))
    other = Delta_at + spread[:, None, None] * (noise[0] + 1j * noise[1])
    U, _, Vh = np.linalg.svd(other)  # its direction of largest gain
    return as_systems(U[:, :, :1] @ Vh[:, :1], there, dt, full)


def trial(seed, n_tries):
    """Verdict, margin, size of the breaking perturbation, how many broke the loop at 0.99, whether
    it does at 1.01.
    """
    model, K, rng = random_case(seed)
    report = robust.check(model, K)
    N, dt = model.loop(K).loop, float(model.nominal.dt or 0)
    worst = robust.analysis.breaking_perturbation(model, K)
    at = worst.Delta(np.exp(1j * worst.omega * dt) if dt else 1j * worst.omega, squeeze=False)
    W = worst.Delta
    own = tuple(part[None] for part in (W.A, W.B, W.C, W.D))
    size = 0.99 * report.margins.rs
    some = near(rng, at, worst.omega, dt, model.form != "elements", n_tries)
    n_broken = int(broken(N, own, size).sum() + broken(N, some, size).sum())
    return report, worst, n_broken, bool(broken(N, own, 1.01 * worst.size)[0])


def main(n_loops=500, n_tries=1000):
    """Print what was found, and every contradiction."""
    wrong, apart, missed, verdicts, gaps = 0, [], 0, {}, []
    for seed in range(n_loops):
        report, worst, n_broken, breaks = trial(seed, n_tries)
        verdicts[report.verdict] = verdicts.get(report.verdict, 0) + 1
        if n_broken or (report.verdict == "robust" and worst.size <= 0.99):
            wrong += 1
            print(
                f"seed {seed}: {report.verdict}, margin {report.margins.rs:.4f}, {n_broken} break"
                " the loop at 0.99"
            )
        (gaps if worst.model.form == "elements" else apart).append(
            abs(worst.size / report.margins.rs - 1)
        )
        if not breaks:
            missed += 1
            print(
                f"seed {seed}: {worst.model.form}, the loop is stable with 1.01 times the breaking"
                " perturbation"
            )
    print(f"{n_loops} loops, {n_tries + 1} perturbations each: {verdicts}")
    print(f"contradicted: {wrong}; breaking perturbation not unstable at 1.01: {missed}")
    print(
        f"full blocks: margin and breaking perturbation apart by at most {100 * max(apart):.3f} %"
    )
    print(
        f"entries: by at most {100 * max(gaps):.3f} %, in the median {100 * np.median(gaps):.3f} %"
    )


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
