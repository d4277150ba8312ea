"""Whether "met" is met: designs from noisy FRFs of random machines, and tunings, judged apart from
what made them.

Machines with and without a free mode, a spring, one or two modes, two lags or a right-half-plane
zero, of either sign and with a delay, continuous or behind the hold of the controller. Their FRFs
begin below the lowest corner or above it and scatter by 2 to 40 % at their first lines; of every
other one no line is off by more than its bound. Of each design that is met the poles of the true
loop are computed, and its largest |S| between the first line and the last.

"unstable": met, and the true loop is not. "exceeded": met without "on N lines", and the true |S| is
more than 1 % above its limit. Both must be 0 while the true FRF lies within the bound on every
line; the others are listed apart.

Tunings are those of benchmarks.attack_tune with light modes in weights and sets and with bounds
that are systems. Each hard limit, at worst over the set where it says so, is looked at around the
poles and zeros of all of them.

python -m benchmarks.attack_met [--designs 2000] [--first 0] [--tunings 300]
"""

from __future__ import annotations

import argparse
import time
import warnings
from collections import Counter
from typing import Any

import control
import numpy as np
from scipy.linalg import expm

import nlfrf
import robust
from robust._base.states import Stability
from robust.lti.lti import poles, to_s_plane, zeros
from tests.support.random_tunings import dense_frequencies, random_tuning, true_loop
from tests.support.responses import at_points, response, response_by_channel

KINDS = ("free", "sprung", "two", "two free", "lag", "two lags", "zero", "lag and integrator")
STRUCTURES = ("PID", "PID", "PI", "PD", "P", "lead", 2)
#: Radius of the discs over the standard deviation of a line: 95 % of a complex normal.
BOUND = np.sqrt(-np.log(0.05))
ALLOWED = 1.01
PADE_ORDER = 8


class Machine:
    """A transfer function with a delay [s], continuous or as a controller with a clock sees it
    behind its hold.
    """

    def __init__(self, num: np.ndarray, den: np.ndarray, delay: float, dt: float) -> None:
        self.dt, self.delay = dt, delay
        G = control.ss(control.tf(num, den))
        if not dt:
            lag = control.tf(*control.pade(delay, PADE_ORDER)) if delay else 1
            self.rational, self.seen = G, control.ss(G * lag)
            return
        n, whole = G.nstates, int(delay / dt + 1e-9)

        def hold(t: float) -> tuple[np.ndarray, np.ndarray]:
            M = expm(np.block([[G.A, G.B], [np.zeros((1, n + 1))]]) * t)
            return M[:n, :n], M[:n, n:]

        F, all_of_it = hold(dt)
        late = hold(max(dt * (whole + 1) - delay, 0.0))[
            1
        ]  # what the newest input does within its sample
        A = np.block([[F, all_of_it - late], [np.zeros((1, n + 1))]])
        B = np.vstack([late, [[1.0]]])
        C = np.c_[G.C, 0.0]
        for _ in range(whole):
            A, B = np.block([[A, B], [np.zeros((1, len(A) + 1))]]), np.vstack([0 * B, [[1.0]]])
            C = np.c_[C, 0.0]
        self.seen = self.rational = control.StateSpace(A, B, C, 0, dt, remove_useless_states=False)

    def response(self, omega: np.ndarray) -> np.ndarray:
        """(W,) response at omega [rad/s], the delay exact."""
        if self.dt:
            return response(self.rational, omega)
        return response(self.rational, omega) * np.exp(-1j * omega * self.delay)

    def is_unstable(self, K: control.StateSpace) -> bool:
        """Whether a pole of the loop lies outside, by its eigenvalues."""
        P = self.seen
        loop = 1 / (1 + P.D * K.D)
        A = np.block(
            [
                [P.A - P.B @ K.D @ P.C * loop, P.B @ K.C * loop],
                [-K.B @ P.C * loop, K.A - K.B @ P.D @ K.C * loop],
            ]
        )
        p = np.linalg.eigvals(A)
        return bool(
            np.abs(p).max() > 1 + 1e-9 if self.dt else p.real.max() > 1e-9 * np.abs(p).max()
        )


def random_machine(rng: np.random.Generator) -> tuple[str, np.ndarray, np.ndarray, float, float]:
    """A kind, numerator, denominator, delay [s] and corner [rad/s]."""
    kind = KINDS[rng.integers(len(KINDS))]
    w, zeta = 2 * np.pi * 10 ** rng.uniform(0, 1.2), 10 ** rng.uniform(-2, -0.3)
    num, den = np.array([w**2]), np.array([1, 2 * zeta * w, w**2])
    if kind == "free":
        den = np.array([1, w * 10 ** rng.uniform(-2, 0.5), 0])
    elif kind in ("two", "two free"):
        high, dip = w * rng.uniform(3, 8), w * rng.uniform(1.5, 2.8)
        num = high**2 * (
            np.array([1, 2 * zeta * dip, dip**2]) if rng.random() < 0.6 else np.array([dip**2])
        )
        den = np.polymul(den if kind == "two" else [1, 0.3 * w, 0], [1, 2 * zeta * high, high**2])
    elif kind == "lag":
        num, den = np.array([w]), np.array([1, w])
    elif kind == "two lags":
        num, den = np.array([5 * w**2]), np.polymul([1, w], [1, 5 * w])
    elif kind == "zero":
        num, den = 4 / 3 * w * np.array([-1, 3 * w]), np.polymul([1, w], [1, 4 * w])
    elif kind == "lag and integrator":
        den = np.array([1, w, 0])
    size = rng.choice([1, 1, 1, -1]) * 10 ** rng.uniform(-3, 3)
    return kind, size * num, den, float(rng.choice([0, 0, 0.02, 0.1])) / w * 2 * np.pi, w


def random_task(seed: int) -> dict[str, Any]:
    """A machine, its scattered FRF as a Bla, and what is asked of the design."""
    rng = np.random.default_rng([67, seed])
    kind, num, den, delay, w = random_machine(rng)
    centre = w * 10 ** rng.uniform(-0.6, 0.5)
    dt = 2 * np.pi / centre / rng.choice([20, 40, 80]) if rng.random() < 0.6 else 0.0
    top = min(12 * centre, 0.9 * np.pi / dt) if dt else 15 * max(centre, w)
    first = min(min(w, centre) * 10 ** rng.uniform(-1.5, 0.4), centre / 3)
    if rng.random() < 0.5:
        omega = np.geomspace(first, top, int(rng.choice([40, 100, 250])))
    else:
        step = first * rng.choice([1, 2])
        omega = first + step * np.arange(min(1500, max(20, int((top - first) / step))))
        omega = omega[omega * dt < 0.95 * np.pi]
    machine = Machine(num, den, delay, dt)
    G0 = machine.response(omega)
    scatter = rng.uniform(0.02, 0.4) / (1 + omega / first / rng.uniform(2, 20)) + 10 ** rng.uniform(
        -3, -1.5
    )
    noise = (rng.standard_normal(omega.size) + 1j * rng.standard_normal(omega.size)) / np.sqrt(2)
    if seed % 2 == 0:
        noise *= np.minimum(1, 0.999 * BOUND / np.abs(noise))
    clock = {"fs": 1 / dt, "hold": "zoh"} if dt else {}
    bla = nlfrf.bla_from_frf(
        omega / 2 / np.pi, G0 * (1 + scatter * noise), std=scatter * np.abs(G0), **clock
    )
    asked: dict[str, Any] = {"M_S": float(rng.choice([1.6, 2.0, 2.5])), "dt": dt}
    if rng.random() < 0.5:
        asked["omega_c"] = centre / 3
    structure = STRUCTURES[rng.integers(len(STRUCTURES))]
    if structure in ("PID", "PD") and rng.random() < 0.3:
        asked["positive"] = bool(num[-1] > 0)
    return {
        "seed": seed,
        "kind": kind,
        "machine": machine,
        "bla": bla,
        "structure": structure,
        "asked": asked,
        "within": bool(np.all(np.abs(noise) <= BOUND)),
        "sign": float(np.sign(num[-1])),
        "n_integrators": int(den[-1] == 0),
    }


def judged(seed: int) -> dict[str, Any]:
    """What is said of one design, and what is true of it."""
    task = random_task(seed)
    machine, omega = task["machine"], task["bla"].omega
    began = time.perf_counter()
    found = {key: task[key] for key in ("seed", "kind", "structure", "within")}
    try:
        design = robust.design_frf(task["bla"], task["structure"], **task["asked"])
    except ValueError as error:
        return {
            **found,
            "word": "refused",
            "why": str(error),
            "seconds": time.perf_counter() - began,
        }
    fine = np.geomspace(omega[0], omega[-1], 8000)
    L = machine.response(fine) * design.K(
        np.exp(1j * fine * machine.dt) if machine.dt else 1j * fine
    )
    undecided = design.stability is Stability.UNDECIDED
    return {
        **found,
        "word": "met" if design.met else "undecided" if undecided else "missed",
        "why": design.reason,
        "unstable": machine.is_unstable(design.K),
        "over": float(np.abs(1 / (1 + L)).max() / task["asked"]["M_S"]),
        "on_lines": design.n_lines > 0,
        "seconds": time.perf_counter() - began,
    }


def with_modes(rng: np.random.Generator, dt: float) -> control.StateSpace:
    """A gain of one with a light mode, where it is 3 to 30 times as large or as small, continuous
    or of a clock.
    """
    w = 10 ** rng.uniform(-0.7, 0.7)
    zeta = 10 ** rng.uniform(-3.5, -1.5)
    times = 10 ** rng.uniform(0.5, 1.5)
    num, den = [1, 2 * zeta * times * w, w**2], [1, 2 * zeta * w, w**2]
    W = control.ss(control.tf(*((num, den) if rng.random() < 0.7 else (den, num))))
    return control.sample_system(W, dt, method="tustin") if dt else W


def random_modal_tuning(seed: int) -> dict[str, Any]:
    """A tuning of `random_tuning` with light modes in sets, weights and bounds."""
    rng = np.random.default_rng([68, seed])
    task = random_tuning(rng, n_starts=1, time_cap=5.0)
    dt, plants = task["dt"], task["plant"]
    models = []
    for model in plants.models:
        if isinstance(model, robust.UncertaintyModel):
            weight = model.weight * with_modes(rng, float(model.nominal.dt or 0))
            model = robust.UncertaintyModel(
                model.nominal, weight, model.form, model.omega, model.radius / 40
            )
        models.append(model)
    task["plant"] = robust.tuning.Plants(models, inputs=plants.inputs, outputs=plants.outputs)
    hard = []
    for limit in task["hard"]:
        bound, weight = limit.bound, limit.weight
        if rng.random() < 0.5:
            bound = bound * with_modes(rng, dt if rng.random() < 0.5 else 0.0)
        elif rng.random() < 0.5:
            weight = with_modes(rng, dt if rng.random() < 0.5 else 0.0)
        hard.append(
            robust.tuning.Limit(
                limit.inputs, limit.outputs, bound, weight=weight, worst=limit.worst
            )
        )
    return {**task, "hard": hard}


def judged_tuning(seed: int) -> dict[str, Any]:
    """What is said of one tuning, and the largest ratio of a hard limit on a grid of its own over
    what was said.
    """
    try:
        design = robust.tune(**random_modal_tuning(seed))
    except ValueError as error:
        return {"seed": seed, "word": "refused", "why": str(error), "unstable": False, "over": 0.0}
    over, unstable = 0.0, False
    for one in design.limits:
        loop = true_loop(design, one.plant, one.limit.inputs, one.limit.outputs)
        p = loop.poles()
        unstable |= bool(np.any(np.abs(p) > 1 + 1e-9) if design.dt else np.any(p.real > 1e-9))
        model, parts = design.plant.models[one.plant], [one.limit.bound, one.limit.weight]
        parts += [model.weight, model.nominal] if isinstance(model, robust.UncertaintyModel) else []
        roots = [
            to_s_plane(np.append(poles(x), zeros(x)), x.dt or 0)
            for x in parts
            if isinstance(x, control.StateSpace)
        ]
        s = np.concatenate([np.zeros(0, complex), *roots])
        s = s[np.isfinite(s) & (np.abs(s.imag) * design.dt < np.pi) & (s.real != 0)]
        omega = dense_frequencies(
            np.append(p, np.exp(s * design.dt) if design.dt else s), design.dt, one.limit.band
        )
        if (
            one.limit.worst
            and one.limit.outputs == ("f",)
            and not (design.dt and not model.nominal.dt)
        ):
            gains, broken = worst_gains(design, one.plant, omega)
            unstable |= broken
        elif one.limit.worst:
            continue
        else:
            H = response_by_channel(loop, omega)
            gains = np.linalg.svd(np.moveaxis(H, 2, 0), compute_uv=False)[:, 0]
        over = max(over, float((gains * one.limit.factor(omega)).max()) / max(one.ratio, 1e-12))
    word = "met" if design.met else "missed"
    return {"seed": seed, "word": word, "why": design.reason, "unstable": unstable, "over": over}


def worst_gains(design: Any, plant: int, omega: np.ndarray) -> tuple[np.ndarray, bool]:
    """(W,) largest |S| over perturbations of modulus one, tried all around, and whether one of them
    destabilises.
    """
    model, K = design.plant.models[plant], design.controller("y", "f")
    at = np.exp(1j * omega * design.dt) if design.dt else 1j * omega
    late = (
        np.exp(-1j * omega * design.delay)
        if design.dt
        else control.tf(*control.pade(design.delay, 8))(at)
    )
    G, weight, k = (at_points(one, at)[0, 0] for one in (model.nominal, model.weight, K))
    G, w = G * late, np.abs(weight)
    turns = np.exp(2j * np.pi * np.arange(360) / 360)[:, None]
    size = w / np.abs(G) if model.form == "additive" else w
    relative = 1 / (1 + size * turns) if model.form.startswith("inverse") else 1 + size * turns
    seen = size * np.abs((1 if model.form.startswith("inverse") else G * k) / (1 + G * k))
    return np.abs(1 / (1 + G * k * relative)).max(axis=0), bool(seen.max() >= 1)


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=2000)
    parser.add_argument("--tunings", type=int, default=300)
    parser.add_argument("--first", type=int, default=0)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    for what, judge, count in (
        ("designs", judged, args.designs),
        ("tunings", judged_tuning, args.tunings),
    ):
        found = [judge(seed) for seed in range(args.first, args.first + count)]
        words = Counter(str(one["word"]) for one in found)
        met = [one for one in found if one["word"] == "met"]
        print(
            f"{count} {what}: {', '.join(f'{n} {word}' for word, n in sorted(words.items()))}; ",
            end="",
        )
        print(f"{sum(bool(one.get('on_lines')) for one in met)} met on lines only")
        wrong = {
            "unstable": [one for one in met if one["unstable"]],
            "exceeded": [one for one in met if one["over"] > ALLOWED and not one.get("on_lines")],
        }
        for word, bad in wrong.items():
            for where, inside in (
                ("within the bound on every line", True),
                ("off by more than it on a line", False),
            ):
                seeds = [one["seed"] for one in bad if one.get("within", True) is inside]
                print(f"  {word}, the FRF {where}: {len(seeds)} {seeds or ''}")


if __name__ == "__main__":
    main()
