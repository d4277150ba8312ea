"""Compiled sampled loops: a controller, hold and delay around a body with friction, a whole stack in one call.

This kernel calls those of other files, which the cache of compiled code on disk does not look at. A digest of these
files is therefore part of it: where one of them changes, the code is compiled anew. The digest must be all that it
closes over: a compiled function among that is another one to the cache in every process.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import hashlib
from collections.abc import Callable
from pathlib import Path
from types import FunctionType

import numpy as np
from numba import njit

from nlfrf.friction import kernel_data
from nlfrf.friction.kernel_data import Body, Law, X
from nlfrf.friction.leuven_kernels import advance_hysteretic
from nlfrf.friction.slider_kernels import advance_sliders
from nlfrf.friction.slip_kernels import advance_coulomb, advance_gms

__all__ = ["CALLED", "digest", "loops_around", "run_loops"]

Array = np.ndarray
NAMES = ("kernel_data", "leuven_kernels", "slip_kernels", "slider_kernels")
CALLED = tuple(Path(__file__).parent / f"{name}.py" for name in NAMES)


def digest(*files: Path) -> str:
    """Of the files whose kernels are called from another."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


@njit(nogil=True, error_model="numpy")
def control_step(i: int, A: Array, B: Array, C: Array, D: Array, x: Array, new: Array, e: float) -> float:
    """Output of the i-th controller for the error e; its state x goes on by one sample, by way of `new`."""
    u = D[i] * e
    for row in range(x.size):
        u += C[i, row] * x[row]
        ahead = B[i, row] * e
        for column in range(x.size):
            ahead += A[i, row, column] * x[column]
        new[row] = ahead
    for row in range(x.size):
        x[row] = new[row]
    return float(u)


@njit(nogil=True, error_model="numpy")  # compiled with its caller, and kept with it
def advance(
    body: Body, law: Law, grid: Array, state: Array, stack: Array, drive: Array, h: float, n: int, out: Array
) -> bool:
    """Some steps of the law at hand."""
    if law.form == kernel_data.SLIDERS:
        return bool(advance_sliders(body, law, grid, state, stack, drive, h, n, out))
    if law.form == kernel_data.GMS:
        return bool(advance_gms(body, law, grid, state, stack, drive, h, n, out))
    if law.form == kernel_data.COULOMB:
        return bool(advance_coulomb(body, law, grid, state, stack, drive, h, n, out))
    return bool(advance_hysteretic(body, law, grid, state, stack, drive, h, n, out))


def stamped(stamp: str) -> Callable[..., None]:
    """The kernel, with the digest among what the cache knows it by."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def loops(
        body: Body,
        law: Law,
        grid: Array,
        states: Array,
        stacks: Array,
        A: Array,
        B: Array,
        C: Array,
        D: Array,
        r: Array,
        disturbance: Array,
        noise: Array,
        fs: float,
        saturation: float,
        resolution: float,
        delays: Array,
        steps: int,
        rows: Array,
        lengths: Array,
    ) -> None:
        if len(stamp) == 0:
            return
        samples = r.shape[1]
        drive, out = np.empty((steps + 1, 3)), np.empty((1, 4))
        for i in range(states.shape[0]):
            xc, new = np.zeros(A.shape[1]), np.zeros(A.shape[1])
            whole = int(delays[i])
            part = delays[i] - whole
            asked = np.zeros(samples + whole + 1)
            lengths[i] = samples
            state, stack = states[i], stacks[i]
            for k in range(samples):
                y = state[X] + noise[i, k]
                if resolution > 0.0:
                    y = resolution * np.round(y / resolution)
                e = r[i, k] - y
                u = min(max(control_step(i, A, B, C, D, xc, new, e), -saturation), saturation)
                asked[k + whole] = u
                for piece in range(2):
                    span = part if piece == 0 else 1.0 - part
                    if span <= 0.0:
                        continue
                    force = disturbance[i, k]
                    if piece == 1:
                        force += asked[k]
                    elif k > 0:
                        force += asked[k - 1]
                    n = int(np.ceil(span * steps))
                    for j in range(n):
                        drive[j, 0] = drive[j, 1] = drive[j, 2] = force
                    h = span / (n * fs)
                    if not advance(body, law, grid, state, stack, drive[:n], h, n, out):
                        lengths[i] = k
                        break
                    if piece == 0 or part == 0.0:
                        rows[i, k, 0], rows[i, k, 1], rows[i, k, 4] = out[0, 0], out[0, 1], out[0, 3]
                if lengths[i] < samples:
                    break
                rows[i, k, 2], rows[i, k, 3] = y, u

    return loops


run_loops = stamped(digest(*CALLED))


def loops_around(steps: Callable[..., bool], compiled: bool) -> Callable[..., None]:
    """The same loops around steps of the user's own, compiled with them where they are."""
    source = run_loops.py_func  # type: ignore[attr-defined]
    around = {**source.__globals__, "advance": steps}
    plain = FunctionType(source.__code__, around, source.__name__, None, source.__closure__)
    return njit(nogil=True, error_model="numpy")(plain) if compiled else plain
