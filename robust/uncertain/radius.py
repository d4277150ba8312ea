"""How large the disc about a nominal has to be on each measured line, and what that radius is made of."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import nonnegative, one_of
from robust.systems.lti import response
from robust.systems.realisation import frequency_response

__all__ = ["PARTS", "extrapolated", "family", "nominal_response", "record_disc", "slope", "total_of", "worded"]


#: What a radius is made of.
PARTS = ("noise", "odd", "even", "misfit", "level", "systematic")
MISFIT_WINDOW = 9
DECADES_ABOVE = 2.0


def nominal_response(nominal: Any, omega: np.ndarray) -> np.ndarray:
    """(W,) response of the nominal; an FRF is interpolated in log magnitude and phase (it is met on its lines)."""
    if not isinstance(nominal, control.FrequencyResponseData):
        return response(nominal, omega)
    known, G = frequency_response("nominal", nominal, omega)
    if omega[0] < known[0] * (1 - 1e-6) or omega[-1] > known[-1] * (1 + 1e-6):
        raise ValueError("nominal must be an FRF over the whole band of bla, got one that is shorter")
    log = np.interp(omega, known, np.log(np.abs(G))) + 1j * np.interp(omega, known, np.unwrap(np.angle(G)))
    return np.exp(log)


def family(
    many: list[Bla], nominal: Any, p: float, simultaneous: bool, even: bool, systematic: float | None
) -> tuple[np.ndarray, dict[str, np.ndarray]]:
    """Frequencies of all records together, and the parts of the largest absolute radius over the records."""
    omega = np.unique(np.concatenate([b.omega for b in many]))
    discs = [record_disc(b, nominal, p, simultaneous, even, systematic) for b in many]
    total = np.array([spread_over(omega, b.omega, total_of(disc)) for b, disc in zip(many, discs, strict=True)])
    worst = np.nanargmax(np.where(np.isnan(total), -np.inf, total), axis=0)
    parts = {}
    for name in PARTS:
        each = np.array([spread_over(omega, b.omega, disc[name]) for b, disc in zip(many, discs, strict=True)])
        parts[name] = np.take_along_axis(each, worst[None, :], axis=0)[0]
    # what the family as a whole misses is misfit; what one level misses beyond that is the level's doing
    together = np.nanmin([spread_over(omega, b.omega, d["misfit"]) for b, d in zip(many, discs, strict=True)], axis=0)
    if len(many) > 1:
        parts["level"] = np.maximum(parts["misfit"] - together, 0.0)
        parts["misfit"] = parts["misfit"] - parts["level"]
    return omega, parts


def total_of(parts: dict[str, np.ndarray]) -> np.ndarray:
    """The parts of a radius added up."""
    return np.sum(list(parts.values()), axis=0)


def record_disc(
    bla: Bla, nominal: Any, p: float, simultaneous: bool, even: bool, systematic: float | None
) -> dict[str, np.ndarray]:
    """Parts (F,) of the absolute radius about the nominal that one record asks for."""
    F = bla.f.size
    quantile = bla.f_quantile(p, simultaneous=simultaneous)
    noise = np.nan_to_num(bla.var_noise)
    # of a new realisation: the error of G itself, plus the scatter of one realisation, which M does not reduce
    scatter = bla.bound(p, of="realization", simultaneous=simultaneous) ** 2 / quantile
    shares = {
        "noise": np.minimum(noise, scatter),
        "odd": np.maximum(scatter - noise, 0.0),
        "even": np.nan_to_num(bla.var_even) if even else np.zeros(F),
    }
    variance = total_of(shares)
    radius = np.sqrt(quantile * variance)
    parts = {
        name: radius * np.divide(share, variance, out=np.zeros(F), where=variance > 0) for name, share in shares.items()
    }
    parts["misfit"] = misfit(bla, nominal_response(nominal, bla.omega))
    parts["level"] = np.zeros(F)
    parts["systematic"] = np.zeros(bla.f.size) if systematic is None else bla.systematic(systematic)
    total = total_of(parts)
    floor = np.maximum(1e-9 * np.abs(nominal_response(nominal, bla.omega)), np.finfo(float).tiny)
    parts["misfit"] = parts["misfit"] + np.maximum(floor - total, 0.0)  # a disc has a radius even without any scatter
    return parts


def misfit(bla: Bla, model: np.ndarray) -> np.ndarray:
    """(F,) what the model misses beyond scatter: windowed mean of |residual|^2 less the variance, as an amplitude.

    Relative to the model inside the window, or a resonance would spread over its neighbours. A line that sticks out
    of all scatter by itself counts by itself: a window would hide a narrow error.
    """
    square = np.abs(bla.G - model) ** 2
    var = bla.var_bound
    F = square.size
    half = min(MISFIT_WINDOW, F) // 2
    size = np.maximum(np.abs(model) ** 2, np.finfo(float).tiny)
    sums = np.concatenate([[0.0], np.cumsum((square - var) / size)])
    first = np.clip(np.arange(F) - half, 0, max(F - 2 * half - 1, 0))
    last = np.minimum(first + 2 * half + 1, F)
    around = size * (sums[last] - sums[first]) / (last - first)
    alone = np.where(square > bla.f_quantile(0.95, simultaneous=True) * var, square - var, 0.0)
    return np.sqrt(np.maximum(np.maximum(around, alone), 0.0))


def spread_over(omega: np.ndarray, lines: np.ndarray, values: np.ndarray) -> np.ndarray:
    """Values on other frequencies: the larger neighbour inside the band of the lines, nan outside it."""
    right = np.clip(np.searchsorted(lines, omega), 0, lines.size - 1)
    left = np.where(lines[right] == omega, right, np.maximum(right - 1, 0))
    out = np.maximum(values[left], values[right])
    out[(omega < lines[0]) | (omega > lines[-1])] = np.nan
    return out


def extrapolated(
    omega: np.ndarray, radius: np.ndarray, below: float, above: float, dt: float
) -> tuple[np.ndarray, np.ndarray]:
    """The radius continued outside the band by the rule of the user, for the weight to cover."""
    step = np.linspace(0, DECADES_ABOVE, 41)[1:]
    low, high = omega[0] * 10 ** -step[::-1], omega[-1] * 10**step
    if dt:
        nyquist = np.pi / dt * (1 - 1e-9)
        high = np.concatenate([high[high < nyquist], [nyquist]]) if omega[-1] < nyquist else high[:0]
    out = np.concatenate(
        [
            radius[0] * (omega[0] / low) ** (below / 20),
            radius,
            radius[-1] * (high / omega[-1]) ** (above / 20),
        ]
    )
    return np.concatenate([low, omega, high]), out


def slope(name: str, rule: Any) -> float:
    """dB per decade away from the band."""
    return 0.0 if isinstance(rule, str) and one_of(name, rule, ("flat",)) else nonnegative(name, rule)


def worded(rule: float) -> str:
    """The extrapolation rule in words."""
    return "flat" if rule == 0 else f"rising {rule:g} dB/decade over {DECADES_ABOVE:g} decades"
