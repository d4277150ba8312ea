"""How far a machine is proved with an actuator that saturates: shares it may miss, tried one after another."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.friction_proof.classes import AnyFriction
from robust.friction_proof.dissipation import maxwell_slip_dissipation
from robust.friction_proof.multipliers import filter_rates
from robust.friction_proof.proof import reference_rate
from robust.saturation.dissipation import saturated
from robust.saturation.kick import kick_within
from robust.saturation.loop import CutLoop, cut_open
from robust.saturation.multipliers import SaturationWeights, saturation_rows, saturation_weights
from robust.sliding.machine import SlidingMachine
from robust.sliding.response import frequencies
from robust.storage.search import Energy, certified_dissipation

__all__ = ["Reach", "kick_of", "reaches"]

N_POINTS = 200
N_SETS = 2  # of filters of the friction
FORGETS = np.geomspace(1e-3, 1.0, 10)  # of a sample
RATES = np.geomspace(1e-2, 30.0, 10)  # over the reference, where nothing is sampled
#: What of asked - h an actuator may miss, at most: the larger, the further it reaches, and the harder to prove.
SHARES = (0.02, 0.1, 0.3, 0.5, 0.7, 0.8, 0.9, 0.95, 0.98)
MISSES = 2  # in a row, after which larger shares are left


@value(copy=False)
class Reach:
    """A kick that is proved, and the numbers it is proved with.

    Fields
    ------
    kick, share : float
    sector : float
    forgets, weights : (J,) ndarray
        Filters of the actuator.
    numbers : dict
        Weights of the friction, and the energy.
    """

    kick: float
    share: float
    sector: float
    forgets: np.ndarray
    weights: np.ndarray
    numbers: dict[str, Any]


def reaches(machine: SlidingMachine, K: Any, friction: AnyFriction, delay: float, left: float) -> Reach | None:
    """The furthest that was found; from every state where that is proved. left : limit less friction [N]."""
    cut = cut_open(machine, K, delay)
    if cut.open_growth() < 0:
        everywhere = reach_of(machine, K, friction, delay, cut, 1.0, np.inf)
        if everywhere is not None:
            return everywhere
    best, missed = None, 0
    for share in SHARES:
        found = reach_of(machine, K, friction, delay, cut, share, left / (1 - share))
        missed = missed + 1 if found is None else 0
        if found is not None and (best is None or found.kick > best.kick):
            best = found
        if missed == MISSES and share > SHARES[MISSES]:
            break
    return best


def reach_of(
    machine: SlidingMachine, K: Any, friction: AnyFriction, delay: float, cut: CutLoop, share: float, reach: float
) -> Reach | None:
    """What is proved with one share, where anything is."""
    omega, reference = frequencies(cut.loop, N_POINTS), reference_rate(machine, cut.loop)
    fastest = 1 / friction.bristle_time if friction.bristle_time else np.inf
    forgets = FORGETS if cut.loop.T else RATES * reference
    for rates in filter_rates(reference, fastest)[:N_SETS]:
        table = saturation_rows(cut, omega, rates, friction.K0, friction.stiction, forgets, share)
        weights = saturation_weights(table, rates.size)
        if weights is None or not weights.mu[1:].any():
            continue
        own = weights.given > 0
        wider = cut_open(machine, K, delay, forgets[own])
        form = maxwell_slip_dissipation(wider.loop, rates, weights.mu, friction.K0, friction.stiction)
        form = saturated(form, wider, share, weights.sector, weights.given[own])
        failed, energy = certified_dissipation(form)
        if energy is not None and not failed:
            kick = kick_of(machine, wider, energy, reach) if np.isfinite(reach) else np.inf
            numbers = friction_numbers(rates, weights, energy)
            filters = {"forgets": forgets[own], "weights": weights.given[own]}
            return Reach(kick=kick, share=share, sector=weights.sector, numbers=numbers, **filters)
    return None


def friction_numbers(rates: np.ndarray, weights: SaturationWeights, energy: Energy) -> dict[str, Any]:
    """What a claim keeps of weights and energy."""
    used = np.append(True, weights.mu[2:] > 0)
    found = {"rates": rates[used], "weights": weights.mu[1:][used], "free": float(weights.mu[0])}
    nothing = {"block": np.zeros((0, 0)), "bounds": np.zeros(0)}  # of bristles
    return found | nothing | {name: getattr(energy, name) for name in ("V", "P", "counts")}


def kick_of(machine: SlidingMachine, cut: CutLoop, energy: Energy, reach: float) -> float:
    """The kick [m/s] up to which an energy keeps what is asked for within reach [N]."""
    size = energy.V.shape[0]
    hit = np.zeros(size)
    hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
    return kick_within(energy, np.pad(cut.asked, (0, size - cut.asked.size)), hit, reach)
