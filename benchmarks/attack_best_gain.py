"""Whether a PID of `design_frf` has the largest integral gain that its demands allow: against
differential evolution.

Two-mass systems (collocated or not, speed or position), lags with modes and integrators, all with a
delay and a radius of uncertainty, sampled; PI or PID with positive gains and a given filter time,
|S| <= M_S for the whole set. The rival searches the gains themselves over eight decades on lines of
its own, and counts how its loop winds about -1. Also printed: how long a design takes (processor
time), which must not grow with what is won.

python -m benchmarks.attack_best_gain [--plants 60]
"""

from __future__ import annotations

import argparse
import time
import warnings
from functools import cache

import control
import numpy as np
from scipy.optimize import differential_evolution

import robust
from nlfrf._base.values import value

NEAR = 0.9  # of the best gain known
LINES = 700
DECADES = 4  # either way of the gains tried


@value
class Case:
    """A plant with its set, and what is asked of the loop: structure, M_S, sampling time, delay,
    filter time [s].
    """

    model: robust.UncertaintyModel
    structure: str
    M_S: float
    dt: float
    delay: float
    filter_time: float


def case(rng: np.random.Generator) -> Case:
    """A random plant of any speed and gain."""
    speed = 10 ** rng.uniform(-1, 3)  # of the fastest loop that is of interest [rad/s]
    kind = rng.integers(4)
    lag = 10 ** rng.uniform(-2, 0) * speed
    G = control.tf([1], [1 / lag, 1])
    if kind < 3:
        zeta = 10 ** rng.uniform(-2, -0.5)
        resonance = speed * 10 ** rng.uniform(-1, 0.5)
        ratio = rng.uniform(0.3, 0.95)
        mode = control.tf([1], [1 / resonance**2, 2 * zeta / resonance, 1])
        if kind != 1:  # collocated: a zero below its pole
            mode *= control.tf(
                [1 / (ratio * resonance) ** 2, 2 * zeta / (ratio * resonance), 1], [1]
            )
        G = G * mode
    if kind == 2 or (kind == 3 and rng.random() < 0.3):
        G = G * control.tf([speed], [1, 0])
    if kind == 3:
        G = G * control.tf([1], np.polymul([1 / speed, 1], [3 / speed, 1]))
    dt = 10 ** rng.uniform(-1.5, -0.5) / speed
    least, most = 10 ** rng.uniform(-1.7, -0.7), rng.uniform(0.5, 3.0)
    corner = speed * 10 ** rng.uniform(-0.3, 1)
    w = control.tf([most / corner, least], [1 / corner, 1])
    omega = np.geomspace(1e-3, 1.0, 60) * 0.9 * np.pi / dt
    G = G * 10 ** rng.uniform(-3, 3)
    model = robust.UncertaintyModel(
        control.ss(G), w, "multiplicative", omega, np.abs(w(1j * omega))
    )
    return Case(
        model=model,
        structure="PI" if rng.random() < 0.25 else "PID",
        M_S=rng.uniform(1.4, 2.5),
        dt=dt,
        delay=float(dt * rng.integers(0, 6)),
        filter_time=float(dt * rng.uniform(0.7, 4)),
    )


@cache
def lines(asked: Case) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Frequencies dense about the modes, the bilinear s, the plant with hold and delay there, the
    weight.
    """
    G = control.sample_system(control.ss(asked.model.nominal), asked.dt, "zoh")
    roots = np.abs(asked.model.nominal.poles())
    near = (roots[roots > 1e-6 * roots.max(), None] * np.linspace(0.8, 1.25, 80)).ravel()
    omega = np.unique(np.concatenate([np.geomspace(1e-5, 1, LINES) * np.pi / asked.dt, near]))
    omega = omega[omega < np.pi / asked.dt]
    z = np.exp(1j * omega * asked.dt)
    g = G(z) * z ** -round(asked.delay / asked.dt)
    s = 2 / asked.dt * (z - 1) / (z + 1)
    return omega, s, g, np.abs(asked.model.weight(1j * omega))


def reached(asked: Case, gains: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(N,) worst |S| over M_S and whether the loop is stable, for gains (N, 3)."""
    _, s, g, w = lines(asked)
    parts = np.array([np.ones_like(s), 1 / s, s / (asked.filter_time * s + 1)])
    L = g * (gains @ parts)
    distance = np.abs(1 + L) - w * np.abs(L)
    with np.errstate(divide="ignore"):
        worst = np.where(
            distance.min(axis=1) > 0,
            1 / np.maximum(distance, 1e-300).min(axis=1) / asked.M_S,
            np.inf,
        )
    F = 1 + L
    turn = np.sum(
        np.angle(F[:, 1:] / F[:, :-1]), axis=1
    )  # up to Nyquist: a quarter for each integrator of the loop
    integrators = 1 + (np.abs(asked.model.nominal.poles()).min() < 1e-9 / asked.dt)
    return worst, np.abs(turn - integrators * np.pi / 2) < 1.0


def rival(asked: Case, seed: int, generations: int = 250) -> float:
    """The largest integral gain that differential evolution finds; zero without any."""
    omega, _, g, _ = lines(asked)
    middle = np.sqrt(omega[0] * omega[-1])
    size, few = 1 / np.abs(np.interp(middle, omega, np.abs(g))), asked.structure == "PI"

    def gains(x: np.ndarray) -> np.ndarray:
        found = size * np.exp(np.atleast_2d(x)) * [1, middle, 1 / middle]
        return found * [1, 1, 0] if few else found

    def cost(x: np.ndarray) -> np.ndarray:
        K = gains(x.T)
        worst, stable = reached(asked, K)
        return np.where(
            stable,
            np.where(worst <= 1, -np.log(K[:, 1] / size / middle), 1e3 + np.minimum(worst, 1e3)),
            1e5,
        )

    found = differential_evolution(
        cost,
        [(-DECADES * np.log(10), DECADES * np.log(10))] * 3,
        popsize=20,
        maxiter=generations,
        tol=1e-6,
        polish=False,
        vectorized=True,
        updating="deferred",
        rng=seed,
    )
    return float(gains(found.x)[0, 1]) if found.fun < 1e3 else 0.0


def designed(asked: Case) -> tuple[float, float]:
    """Integral gain of `design_frf`, zero where it finds none, and its processor time [s]."""
    began = time.process_time()
    try:
        design = robust.design_frf(
            asked.model,
            asked.structure,
            M_S=asked.M_S,
            dt=asked.dt,
            delay=asked.delay,
            positive=True,
            filter_time=None if asked.structure == "PI" else asked.filter_time,
        )
    except ValueError:
        return 0.0, time.process_time() - began
    return (robust.io.pid_gains(design.K).ki if design.met else 0.0), time.process_time() - began


def main() -> None:
    """Print what share of designs is near the best one, and those that are not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--plants", type=int, default=60)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    shares, seconds = [], []
    for i in range(args.plants):
        asked = case(np.random.default_rng([args.seed, i]))
        gain, took = designed(asked)
        best = max(gain, rival(asked, i))
        shares.append(gain / best if best else 1.0)
        seconds.append(took)
    near = np.array(shares) >= NEAR
    print(
        f"{near.sum()} of {len(near)} designs have at least {NEAR:g} of the best integral gain"
        " known, ",
        end="",
    )
    print(
        f"the worst {min(shares):.2g} of it; {np.median(seconds):.2g} s in the middle,"
        f" {max(seconds):.2g} s at most"
    )
    if not near.all():
        print(f"  less: {np.flatnonzero(~near).tolist()} of seed {args.seed}")


if __name__ == "__main__":
    main()
