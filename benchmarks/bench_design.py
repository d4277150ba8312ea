"""Speed and result of the designs: fixed structures on SP 2.17, mixsyn over orders and on plants
that hang elsewhere.

python -m benchmarks.bench_design

python-control's own mixsyn (with slycot, where installed) runs beside on the plant it can take.
"""

from __future__ import annotations

import time
import warnings

import control
import numpy as np

from robust import design_frf, mixsyn, ncfsyn, performance_weight, sampled
from robust.lti.connections import weighted_plant
from robust.shaping import crossover_weight

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
W_P = performance_weight(10, M_S=1.5, A=1e-4)


def best(task, repeats=5):
    """(result, seconds of the processor) of the fastest of a few runs."""
    seconds, result = [], None
    for _ in range(repeats):
        begin = time.process_time()
        result = task()
        seconds.append(time.process_time() - begin)
    return result, min(seconds)


def fixed_structures():
    """design_frf on SP 2.17 by order (optimum of any order:

    1.366), and PID from a hundred to a thousand lines.
    """
    design_frf(BOOK, 1, w_P=W_P, w_u=1.0)  # what cvxpy loads
    for order in (1, 2, 3, 4, 5):
        design, seconds = best(lambda order=order: design_frf(BOOK, order, w_P=W_P, w_u=1.0))
        print(
            f"design_frf, order {order}: gamma {design.gamma:.4f}, {len(design.history)} steps,"
            f" {seconds:.2f} s"
        )
    for n in (100, 300, 1000):
        omega = np.geomspace(1e-2, 1e3, n)
        lines = control.FrequencyResponseData(control.ss(BOOK)(1j * omega), omega)
        design, seconds = best(lambda lines=lines: design_frf(lines, "PID", M_S=1.6, M_T=1.3), 3)
        print(
            f"design_frf, PID, {n} lines: met {design.met}, {len(design.history)} steps,"
            f" {seconds:.2f} s"
        )


def mixed_sensitivity():
    """mixsyn: SP 2.17, random plants of 5 to 20 states continuous and sampled, and the plants that
    hang elsewhere.
    """
    cases = {
        "SP 2.17": (BOOK, W_P, 1.0),
        "slow pole at 1e-6, biproper weight": (
            control.tf([1], [1, 1e-6]),
            control.tf([0.5, 1], [1, 1e-6]),
            0.1,
        ),
        "SP 2.17, weight with a pole at 1e-6": (BOOK, control.tf([1 / 1.5, 10], [1, 1e-6]), 1.0),
        "SP 2.17, sampled at 100 Hz": (sampled(control.ss(BOOK), 0.01), W_P, 1.0),
        "double integrator": (control.tf([1], [1, 0, 0]), performance_weight(1), 0.1),
    }
    for n in (5, 10, 15, 20):
        np.random.seed(n)  # noqa: NPY002 - python-control draws from the global generator
        plant = control.rss(n, 1, 1, strictly_proper=True)
        cases[f"{n} states"] = (plant, performance_weight(1, A=1e-2), 0.1)
        cases[f"{n} states, sampled"] = (sampled(plant, 0.1), performance_weight(1, A=1e-2), 0.1)
    for name, (plant, w_P, w_u) in cases.items():
        design, seconds = best(lambda p=plant, w=w_P, u=w_u: mixsyn(p, w, w_u=u), 3)
        print(
            f"mixsyn, {name}: gamma {design.gamma:.4f}, at best {design.gamma_min:.4f},"
            f" {seconds:.2f} s"
        )


def beside():
    """python-control's mixsyn on the plants that it takes without hanging:

    SP 2.17, SP 1st ed., Example 3.8.
    """
    try:
        import slycot  # noqa: F401
    except ImportError:
        print("slycot is not installed: no comparison with python-control's mixsyn")
        return
    ours, mine = best(lambda: mixsyn(BOOK, W_P, w_u=1.0))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        (_, _, info), theirs = best(
            lambda: control.mixsyn(control.ss(BOOK), W_P, control.ss([], [], [], [[1.0]]), None), 3
        )
    print(
        f"SP 2.17: gamma {ours.gamma_min:.4f} in {mine:.3f} s; python-control {info[0]:.4f} in"
        f" {theirs:.3f} s"
    )
    one = np.array([[-6.0, -5.0], [1.0, 0.0]])
    A, B = np.kron(np.eye(2), one), np.kron(np.eye(2), [[5.0], [0.0]])
    G = control.StateSpace(A, B, [[0, 1, 0, 1], [2, 1, 0, 2]], np.zeros((2, 2)), 0)
    identity = control.StateSpace([], [], [], np.eye(2), 0)
    for crossovers in ((0.25, 0.25), (0.25, 25), (25, 0.25)):
        w_P = control.append(*(performance_weight(c, M_S=1.5, A=1e-4) for c in crossovers))
        gamma = control.hinfsyn(
            weighted_plant(G, 2, n_u=2, weights=[("e", w_P), ("u", identity)]), 2, 2
        )[2]
        print(
            f"SP 3.8, {crossovers}: gamma {mixsyn(G, w_P, w_u=1).gamma_min:.4f}; python-control"
            f" {gamma:.4f}"
        )


def shaping():
    """ncfsyn on SP Example 9.3 and on a sampled plant of 20 states."""
    design, seconds = best(lambda: ncfsyn(BOOK, control.tf([1, 2], [1, 0])))
    print(f"ncfsyn, SP 9.3: gamma_min {design.gamma_min:.4f}, {1e3 * seconds:.1f} ms")
    np.random.seed(0)  # noqa: NPY002
    plant = sampled(control.rss(20, 1, 1, strictly_proper=True), 0.1)
    design, seconds = best(lambda: ncfsyn(plant, crossover_weight(plant, 1.0)))
    print(f"ncfsyn, 20 states, sampled: gamma_min {design.gamma_min:.3f}, {1e3 * seconds:.1f} ms")


def main():
    """Everything."""
    fixed_structures()
    mixed_sensitivity()
    beside()
    shaping()


if __name__ == "__main__":
    main()
