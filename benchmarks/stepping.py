"""Compiled time stepping of the plants that have a state: one realisation after the other, in
steady state.

The same arithmetic over stacks of realisations costs ten to thirty times as much: a step is a few
numbers long.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math

import numpy as np
from numba import njit

compiled = njit(cache=True, nogil=True, error_model="numpy")


@compiled
def step_spring(fine, h, w, zeta, law, n_discard):
    """(M, N) position of a mass by RK4 from rest, of the last period; input (M, 4 N): begin,
    middle, end of each step.

    The force of the spring is law[0] x + law[1] x^3 + law[2] max(x, 0) + law[3] tanh(x).
    """
    n_steps = fine.shape[1] // 2
    y = np.empty((fine.shape[0], n_steps // 2))
    stiff, cubic, one_way, softening = law
    slope_x, slope_v = np.empty(4), np.empty(4)
    for m in range(fine.shape[0]):
        x = v = 0.0
        for period in range(n_discard + 1):
            for i in range(n_steps):
                if period == n_discard and i % 2 == 0:
                    y[m, i // 2] = x
                for k in range(4):
                    ahead = 0.0 if k == 0 else (h if k == 3 else h / 2)
                    before = max(k - 1, 0)
                    x_k, v_k = x + ahead * slope_x[before], v + ahead * slope_v[before]
                    if k == 0:
                        x_k, v_k = x, v
                    f = fine[m, (2 * i + (k + 1) // 2) % fine.shape[1]]
                    force = stiff * x_k + cubic * (x_k * x_k * x_k) + one_way * max(x_k, 0.0)
                    if softening != 0.0:
                        force += softening * math.tanh(x_k)
                    slope_x[k], slope_v[k] = v_k, w * w * (f - force) - 2 * zeta * w * v_k
                x += h / 6 * (slope_x[0] + 2 * slope_x[1] + 2 * slope_x[2] + slope_x[3])
                v += h / 6 * (slope_v[0] + 2 * slope_v[1] + 2 * slope_v[2] + slope_v[3])
    return y


@compiled
def step_slipping(fine, h, n_steps, w, zeta, stiff, slips):
    """(M, N) position of a mass on springs that slip, of the third period, by symplectic steps on
    (M, N n_steps).
    """
    y = np.empty((fine.shape[0], fine.shape[1] // n_steps))
    held = np.empty(slips.size)
    for m in range(fine.shape[0]):
        x = v = total = 0.0
        held[:] = 0.0
        for period in range(3):
            for i in range(fine.shape[1]):
                if period == 2 and i % n_steps == 0:
                    y[m, i // n_steps] = x
                v += h * (w * w * (fine[m, i] - x - total) - 2 * zeta * w * v)
                x += h * v
                total = 0.0
                for j in range(slips.size):
                    held[j] = min(max(held[j] + stiff * (h * v), -slips[j]), slips[j])
                    total += held[j]
    return y


@compiled
def step_backlash(u, half_width):
    """(M, N) what follows u through a play, of the second period."""
    y = np.empty(u.shape)
    for m in range(u.shape[0]):
        x = 0.0
        for _ in range(2):
            for i in range(u.shape[1]):
                x = min(max(x, u[m, i] - half_width), u[m, i] + half_width)
                y[m, i] = x
    return y


@compiled
def step_bilinear(u):
    """(M, N) a low-pass whose pole moves with its input, of the second period."""
    y = np.empty(u.shape)
    for m in range(u.shape[0]):
        x = 0.0
        for _ in range(2):
            for i in range(u.shape[1]):
                x = (0.8 + 0.08 * u[m, i - 1]) * x + 0.2 * u[m, i - 1]
                y[m, i] = x
    return y
