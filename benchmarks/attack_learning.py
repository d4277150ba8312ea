"""Whether a learning filter contracts as it states: random loops and sets, plants of each set,
trials with an end.

Plants are made as systems and sampled, apart from `design_learning`. "Above": |Q (1 - L J_p)| of a
plant of the set above the factor that was printed, somewhere; must be 0. "Reached": the share of
the factor that a plant made for its worst frequency has there. "Trials": how much of the changes of
the input is left after a trial with an end, most.

python -m benchmarks.attack_learning [--loops 300] [--plants 200] [--first 0]
"""

from __future__ import annotations

import argparse
import warnings

import control
import numpy as np
from scipy.signal import dlsim, fftconvolve, firwin

import robust
from robust.analysis.aliases import evaluate_aliases
from robust.lti.lti import response, timebase
from robust.models.sets.perturbations import random_delta, with_phase, with_phases
from robust.synthesis import Learning
from tests.support.random_loops import roots, zpk

_LONGEST = 20000  # samples of a trial: a loop whose trial of ten time constants is longer has none
FORMS = ("multiplicative", "additive", "inverse-multiplicative", "inverse-additive")


def random_problem(rng: np.random.Generator) -> dict:
    """A stable or integrating plant, continuous or sampled, a sampled controller, a set that leaves
    the loop stable.
    """
    sampled = rng.random() < 0.5
    form = FORMS[rng.integers(4)] if sampled else FORMS[rng.integers(2)]
    dt = float(10 ** rng.uniform(-3.3, -2))
    top = np.log10(np.pi / dt)
    n = int(rng.integers(1, 5))
    poles = roots(rng, n, top - 2.3, top - 0.3, -2)
    zeros = roots(rng, int(rng.integers(0, n)), top - 1.5, top + 0.3, -2)
    real = np.flatnonzero(poles.imag == 0)
    if rng.random() < 0.3 and real.size:
        poles[real[0]] = 0.0
    G = zpk(zeros, poles, np.prod(np.abs(poles[poles != 0])) / max(np.prod(np.abs(zeros)), 1e-9))
    delay = 0.0 if sampled else float(rng.choice([0.0, 0.3, 1.0, 1.7])) * dt
    seen = robust.sampled(G, dt, delay)
    shape = control.ss([], [], [], [[1.0]], dt)
    if rng.random() < 0.6:
        shape = control.ss([[1.0]], [[1.0]], [[10 ** rng.uniform(-2.5, -1)]], [[1.0]], dt)
    stable = [
        gain
        for gain in np.geomspace(1e-4, 1e4, 60)
        if np.abs(control.feedback(1, seen * (gain * shape)).poles()).max(initial=0) < 1 - 1e-6
    ]
    if not stable:
        raise ValueError("no gain is stable")
    K = stable[-1] * 10 ** rng.uniform(-1.2, -0.2) * shape
    corner = 10 ** rng.uniform(top - 2, top)
    high = 10 ** rng.uniform(-0.3, 1)
    low = 10 ** rng.uniform(-2, -0.3)
    w = control.ss(control.tf([high / corner, low], [1 / corner, 1]))
    if (
        form == "additive" and not sampled
    ):  # one that does not fall off has no bound under a sampler
        w = control.ss(w * control.tf([1], [1 / 10**top, 1]))
    nominal = robust.sampled(G, dt) if sampled else G
    w = control.ss(control.sample_system(w, dt, "tustin")) if sampled else w
    omega = np.geomspace(1e-3, 0.9, 40) * np.pi / dt
    one = robust.UncertaintyModel(nominal, w, form, omega, perturbation="LTI")
    size = rng.uniform(0.1, 0.9) * robust.check(one, K, delay=delay, certify=False).margins.rs
    w = control.ss(w.A, w.B, size * w.C, size * w.D, w.dt)
    model = robust.UncertaintyModel(nominal, w, form, omega, perturbation="LTI")
    return {"model": model, "K": K, "delay": delay, "factor": float(rng.choice([0.5, 0.8, 0.95]))}


def gap_of(
    learning: Learning, plant: control.StateSpace, omega: np.ndarray, known: np.ndarray
) -> np.ndarray:
    """|Q (1 - L J_p)| (W,) of one plant; known: Q and L there."""
    G = seen_by(learning, plant)
    at = response(G, omega)
    J = at / (1 + at * response(learning.K, omega))
    return np.abs(known[0] * (1 - known[1] * J))


def seen_by(learning: Learning, plant: control.StateSpace) -> control.StateSpace:
    """The plant behind hold and delay."""
    if timebase(plant):
        return plant
    return robust.sampled(plant, learning.dt, learning.delay)


def worst_delta(learning: Learning, omega: float) -> control.StateSpace:
    """A perturbation of gain one whose plant has the largest |1 - L J_p| at a frequency, all its
    aliases in phase.
    """
    loop, at = learning.loop, np.array([omega])
    centre, radius = (part[0] for part in learning.disc(at))
    L = learning.filter(at)[0]
    away = 1 - L * centre
    J = centre - radius * (away / abs(away) if abs(away) > 1e-12 else 1.0) / L * abs(L)
    curves = loop.curves(at)
    G_p = J / (1 - J * curves.K[0])
    if loop.aliases is None:
        w = response(loop.weight, at)[0]
        deviated = {
            "multiplicative": G_p / curves.G[0] - 1,
            "additive": G_p - curves.G[0],
            "inverse-multiplicative": curves.G[0] / G_p - 1,
            "inverse-additive": 1 / G_p - 1 / curves.G[0],
        }[loop.form]
        delta = complex(deviated / w)
        return with_phase(omega, delta / max(abs(delta), 1.0), learning.dt)
    aliased = evaluate_aliases(loop.aliases, at, S=curves.S, KS=curves.K_S, sampled=curves.G)
    frequencies = omega + loop.aliases.spacing * np.concatenate([[0], loop.aliases.single_indices])
    w = loop.aliases.responders[1](np.abs(frequencies))
    acts = (
        np.where(frequencies < 0, w.conj(), w)
        * (aliased.hG if loop.aliases.F_includes_plant else aliased.h)[0]
    )
    keep = np.abs(acts) > 0.003 * np.abs(acts).sum()
    keep[0] = True
    # the delay by whole samples that `alias_terms` holds is part of acts, as it is of G_p
    phases = np.angle(G_p - curves.G[0]) - np.angle(acts[keep])
    return with_phases(np.abs(frequencies[keep]), np.where(frequencies[keep] < 0, -phases, phases))


def trial_ratio(learning: Learning, plant: control.StateSpace, rng: np.random.Generator) -> float:
    """The largest ratio of the changes of the input in two trials one after the other, from a
    random input, r = 0.
    """
    G = seen_by(learning, plant)
    J = control.ss(control.feedback(G, learning.K))
    n = int(max(10 * learning.settling / learning.dt, 400))
    if n > _LONGEST:
        return np.nan
    band = min(learning.omega_Q * learning.dt / np.pi, 0.9)
    u = (
        np.convolve(rng.standard_normal(n), firwin(101, max(band, 0.02)), "same")
        * np.hanning(n) ** 2
    )
    pulse = dlsim((J.A, J.B, J.C, J.D, learning.dt), np.eye(1, n)[0])[1][:, 0]
    largest, before = 0.0, np.inf
    for k in range(6):
        u = learning.update(u, -fftconvolve(pulse, u)[:n])
        size = float(np.linalg.norm(np.diff(u, prepend=0.0)))
        if k:
            largest = max(largest, size / before)
        before = size
    return largest


def attacked(seed: int, number: int, plants: int) -> dict:
    """What one loop did: refused, or its factor against its plants and trials."""
    rng = np.random.default_rng([seed, number])
    try:
        problem = random_problem(rng)
        learning = robust.design_learning(**problem)
    except ValueError as error:
        return {"refused": str(error)[:100]}
    model, loop = learning.model, learning.loop
    top = min(2 * learning.omega_Q, loop.omega_max)
    omega = np.unique(
        np.append(learning.omega[learning.omega <= top], np.geomspace(top / 1e3, top * 0.999, 50))
    )
    omega = omega[:: max(1, omega.size // 200)]
    known = np.array([learning.Q(omega), learning.filter(omega)])
    where = loop.peak(learning.contraction, learning.omega, loop.band).omega
    largest, made = 0.0, []
    for _ in range(plants):
        Delta = random_delta(
            rng, model.structure, band=(omega[0], omega[-1]), dt=timebase(model.nominal)
        )
        plant = model.perturbed(Delta)
        largest = max(largest, float(gap_of(learning, plant, omega, known).max()))
        made.append(plant)
    at = np.array([where])
    worst = model.perturbed(worst_delta(learning, where))
    there = np.array([learning.Q(at), learning.filter(at)])
    reached = float(gap_of(learning, worst, at, there)[0])
    largest = max(largest, reached, float(gap_of(learning, worst, omega, known).max()))
    trials = max(trial_ratio(learning, plant, rng) for plant in (model.nominal, made[0], worst))
    return {
        "form": loop.form + (", aliases" if loop.aliases is not None else ""),
        "factor": learning.factor,
        "proved": learning.proved,
        "reason": learning.reason,
        "above": largest / learning.factor,
        "reached": reached / learning.factor,
        "trials": trials / learning.factor,
    }


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=300)
    parser.add_argument("--plants", type=int, default=200)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    numbers = range(args.first, args.first + args.loops)
    found = {number: attacked(args.seed, number, args.plants) for number in numbers}
    kept = {number: one for number, one in found.items() if "refused" not in one}
    print(
        f"{len(found)} loops: {len(kept)} with a filter,"
        f" {sum(one['proved'] for one in kept.values())} proved"
    )
    for number, one in found.items():
        if "refused" in one:
            print(f"  {number} refused: {one['refused']}")
    for number, one in kept.items():
        if not one["proved"]:
            print(f"  {number} not proved: {one['reason']}")
    above = [number for number, one in kept.items() if one["above"] > 1]
    print(
        f"above the factor: {len(above)} of {len(kept)}, each with {args.plants + 1} plants {above}"
    )
    for form in sorted({one["form"] for one in kept.values()}):
        of = [one for one in kept.values() if one["form"] == form]
        reached, trials = (np.array([one[name] for one in of]) for name in ("reached", "trials"))
        print(
            f"  {form}: {len(of)} loops; reached {np.median(reached):.3f} of the factor (median),"
            f" {reached.min():.3f} (least); trials with an end {np.nanmedian(trials):.3f} (median),"
            f" {np.nanmax(trials):.3f} (most) of it, above in {np.count_nonzero(trials > 1)} of"
            f" {np.count_nonzero(np.isfinite(trials))}"
        )


if __name__ == "__main__":
    main()
