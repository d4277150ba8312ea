"""Whether a design of fixed structure is what it says: random plants and demands, judged where its
loop has features.

Lags, integrators and unstable plants with modes and delays, in units from 1e-8 to 1e8 and speeds
from 1e-5 to 1e5, continuous and sampled, as a model and as an FRF. "Unstable": met, or a finite
gamma, with a pole of the true loop outside. "Worse": gamma or a limit missed by more than 1 %
somewhere; of an FRF on the lines alone, as it is known nowhere else. Both must be 0. Sampled FRFs
are left out: what folds down from above Nyquist is not in them.

python -m benchmarks.attack_design_frf [--designs 150]
"""

from __future__ import annotations

import argparse
import warnings
from typing import Any

import control
import numpy as np

import robust
from tests.support.responses import response

STRUCTURES = ("PI", "PID", "lead", "lead-lag", 2, 3, 4)
ALLOWED = 1.01


def plant(rng: np.random.Generator, speed: float) -> tuple[control.StateSpace, int]:
    """A plant of that speed [rad/s], and how many unstable poles it has."""
    kind = rng.integers(5)
    G = control.tf([1], [1 / speed, [1, 1, 1, 0, -rng.uniform(0.2, 1)][kind]])
    for _ in range(rng.integers(0, 3)):
        w, zeta = speed * 10 ** rng.uniform(-0.5, 1.5), 10 ** rng.uniform(-2.5, -0.3)
        mode = control.tf([w * w], [1, 2 * zeta * w, w * w])
        G = (
            G + 10 ** rng.uniform(-2, 0) * rng.choice([1, -1]) * mode
            if rng.random() < 0.6
            else G * mode
        )
    unit = 10 ** rng.uniform(-8, 8) if rng.random() < 0.4 else 1.0
    return control.ss(G * unit), int(kind == 4)


def demands(rng: np.random.Generator, G: control.StateSpace, speed: float) -> dict[str, Any]:
    """A performance weight, with the effort or without, or limits on |S|, |T| and |K S|."""
    M = rng.uniform(1.5, 2.5)
    bandwidth = speed * 10 ** rng.uniform(-1, 0.3)
    size = abs(complex(G(1j * speed)))
    w_P = control.tf([1 / M, bandwidth], [1, bandwidth * 1e-3])
    return [{"w_P": w_P}, {"w_P": w_P, "w_u": 0.1 / size}, {"M_S": M, "M_T": M, "M_u": 100 / size}][
        rng.integers(3)
    ]


def missed(asked: dict[str, Any], design: Any, G: control.StateSpace, omega: np.ndarray) -> float:
    """By what factor gamma, or the worst limit, is missed on the loop of a design."""
    g, k = response(G, omega), response(design.K, omega)
    S = 1 / np.abs(1 + g * k)
    sizes = {
        "w_P": S,
        "w_u": np.abs(k) * S,
        "M_S": S,
        "M_T": np.abs(g * k) * S,
        "M_u": np.abs(k) * S,
    }
    if "w_P" in asked:
        w_u = asked.get("w_u", 0.0)
        return float(
            np.hypot(np.abs(asked["w_P"](1j * omega)) * S, w_u * sizes["w_u"]).max() / design.gamma
        )
    return (
        max(float(sizes[name].max() / limit) for name, limit in asked.items())
        if design.met
        else 0.0
    )


def frequencies(roots: np.ndarray, dt: float) -> np.ndarray:
    """(W,) frequencies [rad/s] dense around every root of a loop, up to Nyquist."""
    s = np.log(np.where(np.abs(roots) < 1e-12, 1e-12, roots).astype(complex)) / dt if dt else roots
    size = np.abs(s)[np.abs(s) > 0]
    top = np.pi / dt if dt else np.inf
    wide = np.geomspace(size.min() / 30, min(size.max() * 30, top * (1 - 1e-6)), 4000)
    near = s.imag[:, None] + np.abs(s.real)[:, None] * np.linspace(-5, 5, 101)
    omega = np.unique(np.concatenate([wide, near.ravel()]))
    return omega[(omega > 0) & (omega < top)]


def judged(rng: np.random.Generator) -> str:
    """What is wrong with one design: "unstable", "worse", "" where nothing is, "none" where there
    is none.
    """
    speed = 10 ** rng.uniform(-5, 5) if rng.random() < 0.5 else 1.0
    G, n_unstable = plant(rng, speed)
    asked, from_lines, sampled = demands(rng, G, speed), rng.random() < 0.3, rng.random() < 0.4
    dt = 10 ** rng.uniform(-2.5, -0.5) / speed if sampled and not from_lines else 0.0
    delay = dt * rng.choice([0, 0.5, 1, 1.3])
    lines = speed * np.geomspace(1e-2, 1e2, int(rng.choice([60, 200, 600])))
    given = control.FrequencyResponseData(G(1j * lines), lines) if from_lines else G
    options = {"dt": dt, "delay": delay, "n_unstable": n_unstable if from_lines else 0}
    structure = STRUCTURES[rng.integers(len(STRUCTURES))]
    try:
        design = robust.design_frf(
            given, structure, stable=bool(rng.random() < 0.7), **options, **asked
        )
    except ValueError:
        return "none"
    true = robust.sampled(G, dt, delay=delay) if dt else G
    poles = control.feedback(control.ss(true * design.K), 1).poles()
    outside = np.abs(poles) > 1 + 1e-9 if dt else poles.real > 1e-9 * speed
    if np.any(outside) and (design.met or np.isfinite(design.gamma)):
        return "unstable"
    omega = frequencies(np.concatenate([poles, design.K.poles(), true.poles()]), dt)
    found = missed(asked, design, true, lines if from_lines else omega)
    return "worse" if found > ALLOWED else ""


def main() -> None:
    """Print what was found."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--designs", type=int, default=150)
    parser.add_argument("--seed", type=int, default=1)
    args = parser.parse_args()
    warnings.simplefilter("ignore")
    found = [judged(np.random.default_rng([args.seed, i])) for i in range(args.designs)]
    count = {what: found.count(what) for what in ("", "unstable", "worse", "none")}
    print(f"{len(found)} designs: {count['none']} refused, {count['']} as they say, ", end="")
    print(f"{count['unstable']} unstable, {count['worse']} worse than they say")
    for what in ("unstable", "worse"):
        if what in found:
            print(
                f"  {what}: {[i for i, one in enumerate(found) if one == what]} of seed {args.seed}"
            )


if __name__ == "__main__":
    main()
