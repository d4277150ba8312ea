"""Attack on the friction proofs that are no search: every passive friction, and every bounded one.

Controllers with resonances down to a width of 1e-6, sampled and continuous, whole delays: what is
proved for every passive friction is held against springs and masses on a fine grid around each
resonance, and the damping that is said to be needed against Colgate and Schenkel's criterion on a
fine grid. Machines with modes up to 60 times faster than the clock: error_bound is held against its
closed form, kick_sure against the force that takes most off the unstable mode.

python -m benchmarks.bench_friction_attack [--loops 400]
"""

from __future__ import annotations

import argparse
from collections import Counter
from typing import Any

import control
import numpy as np
from scipy.linalg import expm

import robust
from robust.friction.loop import friction_loop
from robust.friction.plant import FrictionPlant

T = 1e-3
SLOW = 0.01  # the clock of the fast machines [s]


def sampled_resonance(
    gain: float, residue: float, radius: float, angle: float
) -> control.StateSpace:
    """A gain with a resonance beside it: poles radius exp(+-j angle)."""
    peak = [residue, -residue * np.cos(angle)]
    return control.ss(
        control.tf([gain], [1.0], T)
        + control.tf(peak, [1, -2 * radius * np.cos(angle), radius**2], T)
    )


def continuous_resonance(
    size: float, phase: float, omega: float, zeta: float
) -> control.StateSpace:
    """A light mode whose residue has that phase."""
    num = [size * np.cos(phase), size * (np.cos(phase) * zeta * omega - np.sin(phase) * omega)]
    return control.ss(control.tf(num, [1, 2 * zeta * omega, omega**2 * (1 + zeta**2)]))


def fine_need(K: control.StateSpace, n: int = 4001) -> float:
    """[Ns/m] by Colgate and Schenkel, on a grid that is fine around every pole."""
    angles = [np.linspace(1e-4, np.pi, n)]
    for pole in K.poles():
        angles.append(np.angle(pole) + (1 - np.abs(pole)) * np.sinh(np.linspace(-8, 8, n)))
    w = np.concatenate(angles)
    z = np.exp(1j * w[(w > 1e-4) & (w <= np.pi)])
    response = (K.C @ np.linalg.solve(z[:, None, None] * np.eye(K.nstates) - K.A, K.B) + K.D)[
        :, 0, 0
    ]
    return float((T / 2 * ((1 - 1 / z) * response).real / (1 - z.real)).max())


def passive_loop(
    rng: np.random.Generator,
) -> tuple[tuple[float, float, float], Any, float, float, float]:
    """Mass, stiffness and damping; a controller with a sharp resonance; the delay; where it is
    [rad/s] and how wide.
    """
    width = 10 ** rng.uniform(-6, -2)
    numbers = (1.0, 0.0 if rng.random() < 0.3 else 1e4, 10 ** rng.uniform(0, 2))
    if rng.random() < 0.5:
        angle = rng.uniform(0.3, 2.5)
        residue = 10 ** rng.uniform(-1, 3) * width / 1e-4
        K = sampled_resonance(100.0 + numbers[1], residue, 1 - width, angle)
        return numbers, K, T * float(rng.integers(0, 2)), angle / T, width / T
    omega = 10 ** rng.uniform(2, 3)
    size = 10 ** rng.uniform(1, 5) * width * omega
    K = continuous_resonance(size, np.radians(rng.uniform(-90, 90)), omega, width)
    return numbers, K, 0.0, omega, width * omega


def worst_member(
    numbers: tuple[float, float, float], K: Any, delay: float, omega: float, width: float
) -> float:
    """Growth of the loop with the worst spring, or spring and mass, that puts its resonance beside
    the controller's.
    """
    mass, stiffness, damping = numbers
    worst = -np.inf
    for more in (0.0, 3.0):
        loop = friction_loop(robust.friction_plant(mass + more, stiffness, damping), K, delay)
        beside = omega + width * np.sinh(np.linspace(-6, 6, 61))
        springs = (mass + more) * beside**2 - stiffness
        worst = max(
            worst, max((loop.growth(spring) for spring in springs[springs > 0]), default=-np.inf)
        )
    return worst


def passive_attack(n: int, rng: np.random.Generator) -> tuple[Counter, list]:
    """Verdicts, and the loops that are proved and unstable with a member, or need more than is
    said.
    """
    verdicts: Counter = Counter()
    broken = []
    for _ in range(n):
        numbers, K, delay, omega, width = passive_loop(rng)
        proof = robust.prove_friction(
            robust.friction_plant(*numbers), K, robust.friction.Passive(), delay=delay
        )
        verdicts[proof.verdict] += 1
        if proof.verdict != "proved":
            continue
        rounding = 1e-11 if K.dt else 1e-11 * omega
        late = K * control.ss(control.tf([1], [1] + [0] * round(delay / T), T)) if delay else K
        needed = fine_need(late) if K.dt else -np.inf
        if worst_member(numbers, K, delay, omega, width) > rounding or needed > numbers[2]:
            broken.append((numbers, K, delay, proof.reason))
    return verdicts, broken


def bang_bang(zeta: float) -> float:
    """How far |f| <= k drives a mass on a spring k, in closed form."""
    return float(1 / np.tanh(np.pi * zeta / 2 / np.sqrt(1 - zeta**2)))


def fast_machine(swings: float, zeta: float) -> tuple[FrictionPlant, float]:
    """1 kg that swings so often in a sample, and its stiffness [N/m]."""
    omega = 2 * np.pi * swings / SLOW
    return robust.friction_plant(1.0, omega**2, 2 * zeta * omega), omega**2


def steps(machine: FrictionPlant, K: Any, n: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Flow of an nth of a sample, what 1 N in it makes, and the jump."""
    loop = friction_loop(machine, K)
    size = loop.B.size
    block = np.zeros((size + 1, size + 1))
    block[:size, :size], block[:size, size] = loop.F, loop.B
    both = expm(block * loop.T / n)
    return both[:size, :size], both[:size, size], loop.jumps[0]


def hunted(machine: FrictionPlant, K: Any, samples: int, n: int = 512) -> float:
    """[m] reached by a friction of 1 N along the motion."""
    flow, push, jump = steps(machine, K, n)
    state, reached = np.zeros(push.size), 0.0
    for _ in range(samples):
        state = jump @ state
        for _ in range(n):
            state = flow @ state + push * (-1.0 if state[1] >= 0 else 1.0)
            reached = max(reached, abs(state[0]))
    return reached


def stopping_kick(machine: FrictionPlant, K: Any, n: int) -> float:
    """[m/s] from which the friction of 1 N that takes most off a real unstable mode just
    stops it.
    """
    flow, push, jump = steps(machine, K, n)
    poles, left = np.linalg.eig((np.linalg.matrix_power(flow, n) @ jump).T)
    i = int(np.argmax(np.abs(poles)))
    pole, w = poles[i].real, left[:, i].real
    row, taken = w, 0.0
    for _ in range(n):
        taken += abs(row @ push)
        row = row @ flow
    hit = np.zeros(push.size)
    hit[:2] = machine.B_port / (machine.velocity @ machine.B_port)
    return float(taken / (abs(pole) - 1) / abs(w @ hit))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--loops", type=int, default=400, help="loops with a sharp resonance")
    args = parser.parse_args()
    verdicts, broken = passive_attack(args.loops, np.random.default_rng(0))
    print(
        f"Passive, sharp resonances: {dict(verdicts)}; proved and unstable with a member:"
        f" {len(broken)}"
    )
    for case in broken[:5]:
        print("   ", case)
    for swings in (0.3, 3.0, 10.0, 20.0, 32.0, 50.0):
        machine, k = fast_machine(swings, 0.01)
        K = control.StateSpace([], [], [], [[1e-9 * k]], SLOW)
        bound = robust.prove_friction(machine, K, robust.friction.Bounded(1.0)).error_bound * k
        print(
            f"{swings:5g} swings a sample: error_bound {bound:.5g}/k, right"
            f" {bang_bang(0.01):.5g}/k; ",
            end="",
        )
        machine, k = fast_machine(swings, 0.05 if swings < 5 else 0.02)
        K = control.StateSpace([], [], [], [[-1.3 * k]], SLOW)
        kick = robust.prove_friction(machine, K, robust.friction.MaxwellSlip(k), Fs=1.0).kick_sure
        print(
            f"kick_sure over the least that is: {kick / stopping_kick(machine, K, 16384):.5f}",
            flush=True,
        )


if __name__ == "__main__":
    main()
