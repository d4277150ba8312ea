"""A discrete controller as second-order sections, the form in which it runs on a target."""

from __future__ import annotations

from typing import Any

import control
import numpy as np
from scipy.signal import sosfreqz

from robust.systems.lti import on_axis, poles, response, timebase, zeros
from robust.systems.realisation import in_order, paired, state_space

__all__ = ["controller_sections", "roots_and_gain"]


def controller_sections(K: Any) -> np.ndarray:
    """A discrete controller as second-order sections, the form in which it runs on a target.

    Parameters
    ----------
    K : control.StateSpace or TransferFunction
        Discrete controller.

    Returns
    -------
    (n, 6) ndarray
        Rows b0 b1 b2 1 a1 a2, run one after the other: y = b0 u + b1 u[k-1] + ... - a1 y[k-1] - a2 y[k-2].

    Raises
    ------
    ValueError
        A continuous controller, or one whose sections do not reproduce its response.

    Examples
    --------
    >>> controller_sections(control.tf([1, -0.5], [1, -0.9], 0.01)).tolist()
    [[1.0, -0.5, 0.0, 1.0, -0.9, 0.0]]
    """
    K = state_space("K", K)
    dt = timebase(K)
    if not dt:
        raise ValueError("K must be discrete to have sections, got a continuous controller: sample it first")
    z, p, gain = roots_and_gain(K)
    sections = chained(z, p, gain)
    angles = np.geomspace(1e-2, 0.99 * np.pi, 60)
    wanted = response(K, angles / dt)
    error = np.abs(sosfreqz(sections, worN=angles)[1] - wanted) / np.maximum(np.abs(wanted), 1e-300)
    if not error.max() < 1e-6:
        raise ValueError(f"K must be a system whose roots make sections of it, got an error of {error.max():.2g}")
    return sections


def chained(z: np.ndarray, p: np.ndarray, gain: float) -> np.ndarray:
    """(n, 6) sections in z^-1: poles nearest the circle last, each with the zeros nearest to them."""
    pole_pairs, pole_rest = paired(p)
    zero_pairs, zero_rest = paired(z)
    groups: list[tuple[complex, ...]] = [*pole_pairs, *((r,) for r in pole_rest)]
    free: list[tuple[complex, ...]] = [*zero_pairs, *((r,) for r in zero_rest)]
    rows = []
    for group in sorted(groups, key=lambda g: abs(abs(g[0]) - 1)):
        mine: tuple[complex, ...] = ()
        fitting = [zs for zs in free if len(zs) <= len(group)]
        # pairs of zeros must all find a pair of poles
        if len(group) == 2 and any(len(zs) == 2 for zs in free):
            fitting = [zs for zs in fitting if len(zs) == 2]
        if fitting:
            mine = min(fitting, key=lambda zs: abs(zs[0] - group[0]))
            free.remove(mine)
        top = np.concatenate([np.zeros(len(group) - len(mine)), np.poly(mine).real if mine else [1.0]])
        rows.append([*top, *np.zeros(3 - top.size), *np.poly(group).real, *np.zeros(2 - len(group))])
    rows = rows[::-1] or [[1.0, 0.0, 0.0, 1.0, 0.0, 0.0]]
    sections = np.array(rows)
    sections[0, :3] *= gain
    return sections


def roots_and_gain(system: control.StateSpace) -> tuple[np.ndarray, np.ndarray, float]:
    """Zeros, poles and gain, the gain fitted where the response is neither very large nor very small."""
    z, p, dt = in_order(zeros(system)), in_order(poles(system)), timebase(system)
    size = np.concatenate([np.abs(np.log(r[r != 0].astype(complex)) / dt if dt else r) for r in (z, p)])
    centre = float(np.exp(np.median(np.log(size[size > 0])))) if np.any(size > 0) else 1.0
    omega = centre * np.geomspace(0.1, 10, 21)
    omega = np.minimum(omega, 0.99 * np.pi / dt) if dt else omega
    s = on_axis(omega, dt)
    ratio = response(system, omega) * np.prod(s[:, None] - p, axis=1) / np.prod(s[:, None] - z, axis=1)
    return z, p, float(np.median(ratio.real))
