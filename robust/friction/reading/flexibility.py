"""Signs in the levels that the machine is not one rigid mass on Maxwell slip."""

from __future__ import annotations

import numpy as np

import nlfrf
from robust.friction.reading.balance import STEP, Candidate, Motion, as_real
from robust.friction.reading.search import WORTH, gain_of, tangent_of

#: Standard deviations by which a lag must exceed the delay that contains it to count as a mode.
_DISTINCT = 3.0
#: Shares of mass and friction that are tried for a load; only their ratio matters.
_LOADS = ((1.0, 0.0), (1.0, 0.5), (1.0, 1.0), (0.5, 1.0))
#: Bins beyond this multiple of the highest line are noise and are left out for an oscillating load.
_HARMONICS = 3


def _compliance_column(
    level: Motion, candidate: Candidate, mass_share: float, friction_share: float
) -> np.ndarray:
    """Return (M, W) derivative of the force of one mass by the compliance 1/k between it and a
    share of it as a load.

    The load reacts with N = -m2 w^2 Y2 + F2(y2), and y2 = y - N/k. To first order in 1/k this is
    N0, the reaction of one mass, plus 1/k (m2 w^2 N0 + d/de F2(y - e n0)).
    """
    n = level.x.shape[1]
    omega = 2 * np.pi * level.fs / n * np.arange(n // 2 + 1)
    mass = mass_share * candidate.numbers["mass"]
    law = nlfrf.friction.VaryingSliders(
        stiffness=candidate.stiffness,
        strength=candidate.stiffness * candidate.breakaway,
        stiction=candidate.stiction,
        vs=candidate.vs,
    )

    def friction(x: np.ndarray, v: np.ndarray) -> np.ndarray:
        forces = nlfrf.friction.element_forces(law, np.tile(x, 2), np.tile(v, 2), fs=level.fs)
        return np.asarray(friction_share * forces[:, n:].sum(axis=0))

    found = np.empty(level.U.shape, dtype=complex)
    for i, (x, v) in enumerate(zip(level.x, level.v, strict=True)):
        held = friction(x, v)
        reaction = np.fft.rfft(held) - mass * omega**2 * np.fft.rfft(x)
        reaction[_HARMONICS * level.lines[-1] :] = 0.0
        behind, behind_speed = np.fft.irfft(reaction, n), np.fft.irfft(1j * omega * reaction, n)
        step = STEP * x.std() / behind.std()
        slope = (friction(x - step * behind, v - step * behind_speed) - held) / step
        found[i] = 2 / n * (mass * omega**2 * reaction + np.fft.rfft(slope))[level.lines]
    return found


def sign_of_mode(
    levels: list[Motion],
    weights: list[np.ndarray],
    *,
    candidate: Candidate,
    stds: dict[str, float],
    unit: str,
) -> str | None:
    """Return the evidence that the machine is not one rigid mass; None if there is none.

    To first order a load on a spring is a term -w^4, and while friction slides it looks like a lag
    of the force. A lag that is longer than the delay that contains it is a mode. If the load has
    friction, a positive compliance of its connection improves the fit: for one mass it came out
    negative or without improvement (benchmarks/read_machine.py, preset and random machines).
    """
    if candidate.terms.softening:
        return f"a term w^4 of {candidate.numbers['softening']:.2g} {unit} improves the fit"
    delay = candidate.numbers["delay"]
    lag = float(np.sqrt(max(0.0, candidate.numbers.get("lag_squared", 0.0))))
    if lag > delay + _DISTINCT * np.hypot(stds["lag"], stds["delay"]):
        return (
            f"the force lags by {1e3 * lag:.3g} +- {1e3 * stds['lag']:.1g} ms, more than its whole"
            f" delay of {1e3 * delay:.3g} ms, as it does below a mode above the band"
        )
    Q, left = tangent_of(levels, weights, candidate)
    tried = []
    for shares in _LOADS:
        columns = [_compliance_column(one, candidate, *shares) for one in levels]
        tried.append(
            gain_of(as_real([c / std for c, std in zip(columns, weights, strict=True)]), Q, left)
        )
    worth = max((worth for worth, amount in tried if amount > 0), default=0.0)
    if worth > WORTH:
        load = "a flexible load behind the motor, or friction that breaks away more slowly,"
        return f"{load} improves the fit (F ratio {worth:.3g}, chance {WORTH:g})"
    return None


def stuck_stiffness(levels: list[Motion], stds: list[np.ndarray], candidate: Candidate) -> float:
    """Return the stiffness [N/m] of a free axis that no element explains; zero by chance."""
    Q, left = tangent_of(levels, stds, candidate)
    worth, amount = gain_of(
        as_real([one.Y / std for one, std in zip(levels, stds, strict=True)]), Q, left
    )
    if worth > WORTH and amount > 0:
        return amount
    return 0.0
