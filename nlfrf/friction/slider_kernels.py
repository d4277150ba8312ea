"""Compiled time stepping of Maxwell slip whose sliders vary.

Stands alone for the reason given in `leuven_kernels`. Fourth-order Runge-Kutta steps of the mass; an element follows
the motion until its slider gives way, and then holds what the slider holds. The trial stages leave no trace.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math

import numpy as np
from numba import njit

from nlfrf.friction.kernel_data import Body, F, Law, V, X

__all__ = ["advance_sliders", "commit_sliders", "sliders_force"]


Array = np.ndarray
compiled = njit(cache=True, nogil=True, error_model="numpy")
#: Rows of the memory of the elements: force, direction of slip, time of rest, number drawn.
FORCE, SLIP, REST, DRAWN = range(4)


@compiled
def held(law: Law, grid: Array, stack: Array, i: int, d: float, x: float, v: float) -> float:
    """What the slider of an element holds, or slips at, in the direction d."""
    m = 1.0
    if stack[SLIP, i] == d:
        q = v / law.vs
        m *= math.exp(-q * q)
    elif grid[4, i] > 0.0:
        m *= 1.0 - math.exp(-stack[REST, i] / grid[4, i])
    if grid[3, i] > 0.0:
        m *= 0.5 * (1.0 + math.cos(grid[3, i] * x + grid[2, i]))
    if d < 0.0:
        m *= 1.0 - grid[5, i]
    if grid[6, i] > 0.0:
        m *= stack[DRAWN, i]
    least = 1.0 / law.n
    return grid[1, i] * (least + (1.0 - least) * m)


@compiled
def force_after(law: Law, grid: Array, stack: Array, i: int, move: float, x: float, v: float) -> float:
    """Force of an element after a move."""
    force = stack[FORCE, i] + grid[0, i] * move
    if abs(force) * law.n <= grid[1, i]:  # less than any slider slips at
        return force
    d = 1.0 if force > 0.0 else -1.0
    most = held(law, grid, stack, i, d, x, v)
    return d * most if abs(force) > most else force


@compiled
def sliders_force(law: Law, grid: Array, stack: Array, move: float, x: float, v: float) -> float:
    """Force of all elements after a move."""
    force = 0.0
    for i in range(grid.shape[1]):
        force += force_after(law, grid, stack, i, move, x, v)
    return force


@compiled
def commit_sliders(law: Law, grid: Array, stack: Array, move: float, x: float, v: float, h: float) -> None:
    """The elements at the end of a step: which slip now, and how long the others have rested."""
    for i in range(grid.shape[1]):
        stuck = stack[FORCE, i] + grid[0, i] * move
        force = force_after(law, grid, stack, i, move, x, v)
        if force == stuck:
            if stack[SLIP, i] != 0.0:
                drawn = stack[DRAWN, i] * 9301.0 + 0.49297 + 0.618 * grid[6, i] + 0.31 * i
                stack[DRAWN, i] = drawn - math.floor(drawn)
                stack[REST, i] = 0.0
            stack[SLIP, i] = 0.0
            stack[REST, i] += h
        else:
            stack[SLIP, i] = 1.0 if stuck > 0.0 else -1.0
            # once it gives way it slips at what it slips at, which is no more than what it held
            most = held(law, grid, stack, i, stack[SLIP, i], x, v)
            force = stack[SLIP, i] * min(abs(force), most)
        stack[FORCE, i] = force


@compiled
def advance_sliders(
    body: Body, law: Law, grid: Array, state: Array, stack: Array, drive: Array, h: float, substeps: int, out: Array
) -> bool:
    """Elements with sliders that vary, over the steps of `drive`; arguments as in the other kernels."""
    x, v, w, k, c = state[X], state[V], 1.0 / body.mass, body.stiffness, body.damping
    for j in range(drive.shape[0]):
        u1, u2, u3 = drive[j, 0], drive[j, 1], drive[j, 2]
        if body.driven:
            v = u1
        f1 = sliders_force(law, grid, stack, 0.0, x, v)
        if j % substeps == 0:
            i = j // substeps
            out[i, 0], out[i, 1], out[i, 2], out[i, 3] = x, v, 0.0, f1
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                break
        if body.driven:
            x1, v1 = x + h / 6.0 * (u1 + 4.0 * u2 + u3), u3
        else:
            a1 = w * (u1 - k * x - c * v - f1)
            v2, x2 = v + 0.5 * h * a1, x + 0.5 * h * v
            a2 = w * (u2 - k * x2 - c * v2 - sliders_force(law, grid, stack, x2 - x, x2, v2))
            v3, x3 = v + 0.5 * h * a2, x + 0.5 * h * v2
            a3 = w * (u2 - k * x3 - c * v3 - sliders_force(law, grid, stack, x3 - x, x3, v3))
            v4, x4 = v + h * a3, x + h * v3
            a4 = w * (u3 - k * x4 - c * v4 - sliders_force(law, grid, stack, x4 - x, x4, v4))
            x1 = x + h / 6.0 * (v + 2.0 * v2 + 2.0 * v3 + v4)
            v1 = v + h / 6.0 * (a1 + 2.0 * a2 + 2.0 * a3 + a4)
        commit_sliders(law, grid, stack, x1 - x, x1, v1, h)
        x, v = x1, v1
    state[X], state[V] = x, v
    state[F] = sliders_force(law, grid, stack, 0.0, x, v)
    return abs(x) < 1e150 and abs(v) < 1e150
