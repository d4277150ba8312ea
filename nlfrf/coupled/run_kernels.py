"""Compiled runs of several coupled masses: through forces that are given, and in a sampled loop.

Kept on disk with a digest of the files that they call, for the reason given in `loop_kernels`.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
from numba import njit

from nlfrf.coupled.step_kernels import N_ROWS, advance_axes, let_free
from nlfrf.friction.kernel_data import X
from nlfrf.friction.loop_kernels import CALLED, digest

__all__ = ["run_axes", "run_axes_loop"]

Array = np.ndarray
kept = njit(cache=True, nogil=True, error_model="numpy")


def stamped_run(stamp: str) -> Callable[..., bool]:
    """Steps through given forces, known to the cache by the digest."""

    @kept
    def run(
        machine: Array,
        laws: Array,
        grids: Array,
        states: Array,
        stacks: Array,
        drive: Array,
        h: float,
        substeps: int,
        out: Array,
    ) -> bool:
        work = np.zeros((N_ROWS, machine.shape[1]))
        if len(stamp) == 0:
            return False
        let_free(machine, laws, states)
        return advance_axes(machine, laws, grids, states, stacks, work, drive, h, substeps, out)

    return run


@njit(nogil=True, error_model="numpy")
def times(M: Array, x: Array, out: Array) -> None:
    """out = M x."""
    for row in range(M.shape[0]):
        total = 0.0
        for column in range(M.shape[1]):
            total += M[row, column] * x[column]
        out[row] = total


@njit(nogil=True, error_model="numpy")
def control(A: Array, B: Array, C: Array, D: Array, x: Array, new: Array, e: Array, u: Array) -> None:
    """Output u of the controller for the error e; its state x goes on by one sample, by way of `new`."""
    for row in range(u.size):
        total = 0.0
        for i in range(e.size):
            total += D[row, i] * e[i]
        for i in range(x.size):
            total += C[row, i] * x[i]
        u[row] = total
    for row in range(x.size):
        total = 0.0
        for i in range(e.size):
            total += B[row, i] * e[i]
        for i in range(x.size):
            total += A[row, i] * x[i]
        new[row] = total
    x[:] = new


def stamped_loop(stamp: str) -> Callable[..., int]:
    """The sampled loop, known to the cache by the digest."""

    @kept
    def loop(
        machine: Array,
        laws: Array,
        grids: Array,
        states: Array,
        stacks: Array,
        sensors: Array,
        actuators: Array,
        A: Array,
        B: Array,
        C: Array,
        D: Array,
        r: Array,
        disturbance: Array,
        noise: Array,
        fs: float,
        saturation: Array,
        resolution: Array,
        delay: float,
        steps: int,
        rows: Array,
        y: Array,
        u: Array,
    ) -> int:
        """Samples till the end, or till the loop ran away.

        r, noise, y (n, n_y); disturbance, u (n, n_u); rows (n, 4, axes): position, velocity, z, friction.
        """
        n, axes, samples = sensors.shape[0], sensors.shape[1], r.shape[0]
        if len(stamp) == 0:
            return 0
        work, x, new = np.zeros((N_ROWS, axes)), np.zeros(A.shape[0]), np.zeros(A.shape[0])
        let_free(machine, laws, states)
        drive, out, force = np.empty((steps + 1, 3, axes)), np.empty((1, 4, axes)), np.empty(actuators.shape[1])
        e, whole = np.empty(n), int(delay)
        part = delay - whole
        for k in range(samples):
            times(sensors, states[:, X], e)
            for i in range(n):
                y[k, i] = e[i] + noise[k, i]
                if resolution[i] > 0.0:
                    y[k, i] = resolution[i] * np.round(y[k, i] / resolution[i])
                e[i] = r[k, i] - y[k, i]
            control(A, B, C, D, x, new, e, u[k])
            for i in range(force.size):
                u[k, i] = min(max(u[k, i], -saturation[i]), saturation[i])
            for piece in range(2):
                span = part if piece == 0 else 1.0 - part
                if span <= 0.0:
                    continue
                asked = k - whole - 1 + piece
                for i in range(force.size):
                    force[i] = disturbance[k, i] + (u[asked, i] if asked >= 0 else 0.0)
                count = int(np.ceil(span * steps))
                for i in range(axes):
                    total = 0.0
                    for column in range(force.size):
                        total += actuators[i, column] * force[column]
                    drive[:count, :, i] = total
                h = span / (count * fs)
                if not advance_axes(machine, laws, grids, states, stacks, work, drive[:count], h, count, out):
                    return k
                if piece == 0 or part == 0.0:
                    rows[k] = out[0]
        return samples

    return loop


STAMP = digest(Path(__file__).parent / "step_kernels.py", *CALLED)
run_axes: Callable[..., Any] = stamped_run(STAMP)
run_axes_loop: Callable[..., Any] = stamped_loop(STAMP)
