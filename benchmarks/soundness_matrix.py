"""No verdict of robustness where brute force breaks the loop: random loops of two and three inputs and outputs.

    python -m benchmarks.soundness_matrix [loops] [perturbations]

Each loop: a random plant and controller, continuous or sampled, a set of one of the forms with random weights. Tried
against the verdict: the breaking perturbation found, and random ones near it, by the poles of the loop, at 0.99 of the
margin and (the breaking one) at 1.01.
"""

from __future__ import annotations

import sys

import control
import numpy as np

import robust
from robust.systems.lft import lower
from robust.uncertain.breaking import as_system
from robust.uncertain.matrix_model import MATRIX_FORMS, MatrixUncertainty


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
    pole, low, high = 10 ** rng.uniform(-1, 1), 10 ** rng.uniform(-1.5, 0), 10 ** rng.uniform(-1.5, 0.5)
    weight = control.StateSpace([[-pole]], [[1.0]], [[(low - high) * pole]], [[high]], 0)
    return robust.discretize(weight, dt) if dt else weight


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
        model = MatrixUncertainty(
            nominal=G,
            form=form,
            left=left,
            right=right,
            omega=np.array([1.0]),
            radius=np.array([[0.999 * abs(w(np.exp(0.1j) if dt else 1j))] for w in (*left, *right)]),
            confidence=0.95,
            perturbation="LTI",
        )
        N = model.loop(K).loop
        p = N.poles()
        if (np.abs(p).max() < 1 - 1e-4) if dt else (p.real.max() < -1e-3):
            return model, K, rng


def broken(N, Delta, size):
    """Whether N closed through size Delta has a pole beyond the boundary."""
    D = control.StateSpace(Delta.A, Delta.B, size * Delta.C, size * Delta.D, Delta.dt)
    try:
        p = lower(N, D).poles()
    except ValueError:  # no solution: broken
        return True
    return bool(np.any(np.abs(p) > 1 + 1e-9) if N.dt else np.any(p.real > 1e-9))


def near(rng, Delta_at, omega, spread, dt, full):
    """A perturbation of gain one near one that breaks, at a frequency near by."""
    noise = rng.standard_normal(Delta_at.shape) + 1j * rng.standard_normal(Delta_at.shape)
    there = omega * np.exp(spread * rng.standard_normal())
    there = min(there, np.pi / dt * 0.999) if dt else there
    if full:
        other = Delta_at + spread * noise
        return as_system(other / np.linalg.norm(other, 2), there, dt, full=True)
    turned = np.diag(Delta_at) * np.exp(1j * spread * 2 * rng.standard_normal(len(Delta_at)))
    return as_system(np.diag(turned), there, dt, full=False)


def trial(seed, n_tries):
    """Verdict, margin, size of the breaking perturbation, how many broke the loop at 0.99, whether it does at 1.01."""
    model, K, rng = random_case(seed)
    report = robust.check(model, K)
    N, dt = model.loop(K).loop, float(model.nominal.dt or 0)
    worst = robust.breaking_perturbation(model, K)
    at = worst.Delta(np.exp(1j * worst.omega * dt) if dt else 1j * worst.omega, squeeze=False)
    size = 0.99 * report.margin_rs
    some = [worst.Delta] + [
        near(rng, at, worst.omega, 10 ** rng.uniform(-3, -0.3), dt, model.form != "elements") for _ in range(n_tries)
    ]
    n_broken = sum(broken(N, Delta, size) for Delta in some)
    return report, worst, n_broken, broken(N, worst.Delta, 1.01 * worst.size)


def main(n_loops=500, n_tries=1000):
    """Print what was found, and every contradiction."""
    wrong, apart, missed, verdicts = 0, [], 0, {}
    for seed in range(n_loops):
        report, worst, n_broken, breaks = trial(seed, n_tries)
        verdicts[report.verdict] = verdicts.get(report.verdict, 0) + 1
        if n_broken or (report.verdict == "robust" and worst.size <= 0.99):
            wrong += 1
            print(f"seed {seed}: {report.verdict}, margin {report.margin_rs:.4f}, {n_broken} break the loop at 0.99")
        if worst.model.form != "elements":
            apart.append(abs(worst.size / report.margin_rs - 1))
        missed += not breaks
    print(f"{n_loops} loops, {n_tries + 1} perturbations each: {verdicts}")
    print(f"contradicted: {wrong}; breaking perturbation not unstable at 1.01: {missed}")
    print(f"full blocks: margin and breaking perturbation apart by at most {100 * max(apart):.3f} %")


if __name__ == "__main__":
    main(*(int(a) for a in sys.argv[1:]))
