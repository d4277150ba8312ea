"""Frequency grids that see every mode, and the peaks of curves on them."""

from __future__ import annotations

from collections.abc import Callable

import control
import numpy as np

from robust.systems.lti import in_s, poles, timebase, zeros

__all__ = ["highest", "loop_grid", "plant_lines", "structure_grid"]

#: Of the frequencies of a loop, how far from their median [as a factor] one still widens the grid that all share.
FARTHEST_MODE = 1e9
#: Where a mode is looked at that lies farther away, relative to it.
BESIDE = np.array([0.1, 0.3, 0.7, 1.0, 1.4, 3.0, 10.0])
#: Ripples of a delay that are looked at, and points on each.
RIPPLES, POINTS = 150, 8
#: Maxima that are looked at closer: all within this factor of the largest, and no more than so many.
NEARLY, MOST_MAXIMA = 0.9, 40


def loop_grid(
    lines: np.ndarray, loop_poles: np.ndarray, systems: list[control.StateSpace], dt: float, delay: float = 0.0
) -> np.ndarray:
    """Frequencies [rad/s] dense enough to look at a loop: the lines, a log grid, every mode of loop and systems.

    The poles of the loop are given on its time base dt, the systems each on their own; a delay [s] makes ripples.
    """
    top = np.pi / dt if dt else np.inf
    roots = [in_s(loop_poles, dt)]
    for system in systems:
        if system.nstates:
            roots += [in_s(poles(system), timebase(system)), in_s(zeros(system), timebase(system))]
    s = np.concatenate(roots)
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    size = np.concatenate([np.abs(lines), np.abs(s)])
    centre = np.median(size)
    size = size[(size > centre / FARTHEST_MODE) & (size < FARTHEST_MODE * centre)]
    low, high = size.min() / 100, min(size.max() * 100, top)
    sharp = s[(np.abs(s.real) < 0.5 * np.abs(s)) & (s.imag > 0)]
    keep = lines if lines.size <= 2000 else lines[:: lines.size // 2000 + 1]
    ripples = np.arange(1, RIPPLES * POINTS) * (2 * np.pi / (POINTS * delay)) if delay else np.zeros(0)
    omega = np.concatenate([keep, np.geomspace(low, high, 500), around(sharp, 41), ripples])
    far = np.abs(s)[(np.abs(s) <= centre / FARTHEST_MODE) | (np.abs(s) >= FARTHEST_MODE * centre)]
    omega = np.concatenate([omega[(omega >= low) & (omega <= high)], np.outer(far, BESIDE).ravel()])
    return np.unique(omega[(omega > 1e-150) & (omega < min(1e150, top * (1 - 1e-9)))])


def structure_grid(N: control.StateSpace) -> np.ndarray:
    """Frequencies [rad/s] for mu: zero, around every pole, dense where damping is light; up to Nyquist."""
    dt = timebase(N)
    p = N.poles().astype(complex) if N.nstates else np.ones(1, complex)
    with np.errstate(all="ignore"):
        s = np.log(np.where(p == 0, 1e-300, p)) / dt if dt else p
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    size = np.abs(s) if s.size else np.ones(1)
    size = size[(size > 1e-9 * np.median(size)) & (size < FARTHEST_MODE * np.median(size))]
    top = np.pi / dt if dt else np.inf
    low, high = size.min() / 30, min(size.max() * 30, top)
    sharp = s[(np.abs(s.real) < 0.3 * np.abs(s)) & (s.imag > 0)]
    omega = np.unique(np.concatenate([np.geomspace(low, high, 120), around(sharp, 21)]))
    # at zero frequency (and at Nyquist) N is real, and real perturbations reach what they reach nowhere near it
    return np.concatenate([[0.0], omega[(omega >= low) & (omega <= high)], [top] if dt else []])


def around(sharp: np.ndarray, n: int) -> np.ndarray:
    """n frequencies [rad/s] around each lightly damped root of the upper half plane, a half width apart at its peak."""
    return (sharp.imag[:, None] + np.abs(sharp.real)[:, None] * np.tan(np.linspace(-1.4, 1.4, n))).ravel()


def plant_lines(G: control.StateSpace, dt: float, otherwise: tuple[float, ...]) -> np.ndarray:
    """Frequencies [rad/s] of the poles and zeros of a plant below Nyquist; the others where it has none."""
    lines = np.array(otherwise) if otherwise else np.array([0.1 / dt if dt else 1.0])
    if G.nstates:
        s = in_s(np.concatenate([poles(G), zeros(G)]), dt)
        size = np.abs(s[np.isfinite(s) & (np.abs(s) > 0)])
        below = size < (np.pi / dt if dt else np.inf) * 0.999
        lines = size[below] if np.any(below) else lines
    return np.unique(lines)


def highest(
    curve: Callable[[np.ndarray], np.ndarray], omega: np.ndarray, band: tuple[float, float], top: float
) -> tuple[float, float]:
    """Largest value of a curve and where: on the grid, far outside it up to `top`, and refined.

    Where the curve is flat, the place is the one nearest to the band.
    """
    points = np.unique(np.concatenate([omega, [omega[0] * 1e-5, min(omega[-1] * 1e5, top * (1 - 1e-12))]]))
    values = curve(points)
    values = np.where(np.isnan(values), np.inf, values)
    best, where = float(values.max()), float(points[values.argmax()])
    inner = np.flatnonzero((values[1:-1] >= values[:-2]) & (values[1:-1] >= values[2:])) + 1
    inner = inner[np.argsort(-values[inner])][:MOST_MAXIMA]
    inner = np.concatenate([inner[:5], inner[5:][values[inner[5:]] > NEARLY * best]])
    low, high = np.log(points[inner - 1]), np.log(points[inner + 1])
    for _ in range(6 if inner.size else 0):  # all maxima at once, ten times closer each time
        near = low[:, None] + np.linspace(0, 1, 21) * (high - low)[:, None]
        zoom = curve(np.exp(near.ravel())).reshape(near.shape)
        zoom = np.where(np.isnan(zoom), np.inf, zoom)
        peak = zoom.argmax(axis=1)
        each = np.arange(inner.size)
        if zoom.max() > best:
            best, where = float(zoom.max()), float(np.exp(near.flat[zoom.argmax()]))
        low, high = near[each, np.maximum(peak - 1, 0)], near[each, np.minimum(peak + 1, 20)]
    flat = points[values >= best * (1 - 1e-4)]
    if flat.size:
        away = np.abs(np.log(np.clip(flat, *band) / flat))
        if away.min() < abs(np.log(np.clip(where, *band) / where)):
            where = float(flat[away.argmin()])
    return best, where
