"""Does a nominal of few poles serve the loop?

Random machines with many modes, their default chain against the truth.

    python -m benchmarks.nominal [--machines 60] [--first 0]

Free and sprung machines with two to eight modes and a delay, measured with scatter that is smallest
at low or at high frequencies, or the same in y. The crossover asked for is a sixth, a third or two
thirds of the lowest mode. The chain: `scan_orders`, `uncertainty`, `ncfsyn`, `check`. Counted are
robust loops, those that the true machine diverges in (goal 0), the order and the seconds; and the
same chain with the scatter alone, by the criterion without a crossover.
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter

import control
import numpy as np

import nlfrf
import robust
from robust.models import scan_orders

F = np.arange(1, 200.25, 0.5)
DT = 1e-3
#: Relative standard deviation of a line, or None for one that is the same in y.
SCATTERS = {
    "falling": lambda size: size * np.interp(F, [1, 200], [5e-3, 1e-4]),
    "level": lambda size: 2e-3 * size,
    "rising": lambda size: size * np.interp(F, [1, 200], [1e-3, 3e-2]),
    "of y": lambda size: np.full(F.size, 2e-3 * np.median(size)),
}


def machine(rng: np.random.Generator) -> tuple[control.StateSpace, float, float]:
    """Return a machine [m/N] with its modes, its delay [s] and its lowest mode [Hz] above the rigid
    one.
    """
    s = control.tf("s")
    modes = np.sort(10 ** rng.uniform(np.log10(35), 2.5, rng.integers(2, 9)))
    f0 = rng.choice([0.0, rng.uniform(1.5, 6.0)])
    plant = 1 / (
        s**2 + 2 * rng.uniform(0.02, 0.3) * max(2 * np.pi * f0, 10) * s + (2 * np.pi * f0) ** 2
    )
    for f in modes:
        w = 2 * np.pi * f
        gain = rng.uniform(0.05, 0.5) * rng.choice([1, 1, -1])
        plant = plant + gain / (s**2 + 2 * 10 ** rng.uniform(-2.3, -1.3) * w * s + w**2)
    return control.ss(plant), rng.choice([0.0, rng.uniform(1e-4, 1e-3)]), float(modes[0])


def diverges(plant: control.StateSpace, delay: float, K: control.StateSpace) -> bool:
    """Whether the loop of the true machine, sampled with its delay, has a pole outside the unit
    circle.
    """
    G = robust.sampled(plant, DT, delay)
    loop = control.feedback(control.series(K, G), 1)
    return bool(np.abs(loop.poles()).max() >= 1)


def chain(
    bla: nlfrf.Bla, omega_c: float, *, named: bool
) -> tuple[str, int, control.StateSpace | None, float]:
    """Return the verdict of the chain, its order, the controller and the seconds of the processor
    for the nominal.
    """
    start = time.process_time()
    fit = scan_orders(bla, omega_c=omega_c if named else None).fit
    seconds = time.process_time() - start
    try:
        model = robust.uncertainty(bla, fit)
        plant = robust.sampled(model.nominal, DT)
        K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, omega_c)).K
        return str(robust.check(model, K).verdict), fit.G.nstates, K, seconds
    except (ValueError, ArithmeticError) as error:
        return f"no loop: {str(error)[:40]}", fit.G.nstates, None, seconds


def main() -> None:
    """Print the counts."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--machines", type=int, default=60)
    parser.add_argument("--first", type=int, default=0)
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    for named in (True, False):
        verdicts, orders, seconds, diverged = Counter(), [], [], 0
        for seed in range(chosen.first, chosen.first + chosen.machines):
            rng = np.random.default_rng(seed)
            plant, delay, lowest = machine(rng)
            s = 2j * np.pi * F
            G = np.ravel(plant(s)) * np.exp(-s * delay)
            std = SCATTERS[list(SCATTERS)[seed % len(SCATTERS)]](np.abs(G))
            e = (rng.standard_normal(F.size) + 1j * rng.standard_normal(F.size)) / np.sqrt(2) * std
            omega_c = 2 * np.pi * lowest * rng.choice([1 / 6, 1 / 3, 2 / 3])
            verdict, n, K, took = chain(nlfrf.bla_from_frf(F, G + e, std=std), omega_c, named=named)
            robustly = verdict in ("robust", "statistically robust")
            verdicts[verdict] += 1
            orders.append(n)
            seconds.append(took)
            if robustly and K is not None and diverges(plant, delay, K):
                diverged += 1
                print(f"  seed {seed}: called {verdict}, and the true machine diverges", flush=True)
        print(
            f"crossover {'named' if named else 'not named'}: {dict(verdicts)}; {diverged} robust"
            f" loops diverge; poles {np.median(orders):g} in the middle, {max(orders)} at most;"
            f" {np.median(seconds):.2f} s for the nominal, {max(seconds):.1f} at most",
            flush=True,
        )


if __name__ == "__main__":
    main()
