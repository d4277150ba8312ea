"""Steps of a body with friction by functions of the user's own, compiled where they can be."""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

from collections.abc import Callable
from functools import lru_cache
from typing import Any

import numpy as np
from numba import njit

from nlfrf.friction.kernel_data import Body, Law
from nlfrf.friction.loop_kernels import loops_around

__all__ = ["own_loops", "stepper"]

Array = np.ndarray


@lru_cache(maxsize=64)
def stepper(derivative: Callable[..., Any], force: Callable[..., float], size: int) -> tuple[Callable[..., bool], bool]:
    """The code that steps them, and whether it was compiled."""
    plain = stepping(as_array(derivative), force)
    try:
        quick = [njit(error_model="numpy")(getattr(function, "py_func", function)) for function in (derivative, force)]
        compiled = njit(error_model="numpy")(stepping(*quick))
        trial = Body(False, 1.0, 0.0, 0.0)
        compiled(trial, np.zeros(2), np.zeros(size), np.zeros((1, 3)), 1e-9, 1, np.zeros((1, 4)))
    except Exception:  # numba refuses in many ways; whatever is wrong with the functions, the plain ones will say
        return plain, False
    return compiled, True


@lru_cache(maxsize=64)
def own_loops(derivative: Callable[..., Any], force: Callable[..., float], size: int) -> Callable[..., None]:
    """Sampled loops around them: `run_loops`, with their state where others keep their turning points."""
    kernel, compiled = stepper(derivative, force, size)

    def advance(
        body: Body, law: Law, grid: Array, state: Array, stack: Array, drive: Array, h: float, n: int, out: Array
    ) -> bool:
        return kernel(body, state[:2], stack[0, :size], drive, h, n, out)  # X and V come first

    return loops_around(njit(error_model="numpy")(advance) if compiled else advance, compiled)


def as_array(derivative: Callable[..., Any]) -> Callable[..., Array]:
    """The derivative as an array, whatever sequence the function gives."""

    def wrapped(x: float, v: float, z: Array) -> Array:
        return np.asarray(derivative(x, v, z), dtype=float)

    return wrapped


def stepping(derivative: Callable[..., Array], force: Callable[..., float]) -> Callable[..., bool]:
    """Runge and Kutta of order four over position, velocity and state."""

    def advance(body: Body, place: Array, z: Array, drive: Array, h: float, substeps: int, out: Array) -> bool:
        x, v = place[0], place[1]
        for j in range(drive.shape[0]):
            if body.driven:
                v = drive[j, 0]
            if j % substeps == 0:
                i = j // substeps
                out[i, 0], out[i, 1], out[i, 2] = x, v, z[0] if z.size else 0.0
                out[i, 3] = force(x, v, z)
            sx, sv, sz = 0.0, 0.0, np.zeros(z.size)
            kx, kv, kz = 0.0, 0.0, np.zeros(z.size)
            for stage in range(4):
                reach = 0.0 if stage == 0 else (h if stage == 3 else h / 2)
                u = drive[j, 0] if stage == 0 else (drive[j, 2] if stage == 3 else drive[j, 1])
                xs, zs = x + reach * kx, z + reach * kz
                vs = u if body.driven else v + reach * kv
                kx = vs
                kz = derivative(xs, vs, zs)
                if not body.driven:
                    kv = (u - body.damping * vs - body.stiffness * xs - force(xs, vs, zs)) / body.mass
                share = h / 6 if stage in (0, 3) else h / 3
                sx, sv, sz = sx + share * kx, sv + share * kv, sz + share * kz
            x += sx
            v = drive[j, 2] if body.driven else v + sv
            z[:] = z + sz
            if not (abs(x) < 1e150 and abs(v) < 1e150):
                return False
        place[0], place[1] = x, v
        return bool(np.all(np.isfinite(z)))

    return advance
