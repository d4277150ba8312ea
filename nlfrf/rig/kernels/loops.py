"""Compiled sampled loops: a controller, hold and delay around a body with friction, a whole stack
in one call.

This kernel calls those of other files, which the cache of compiled code on disk does not check. So
a digest of these files is part of it: if one of them changes, the code is compiled anew. The kernel
must close over nothing but the digest, because the cache treats a compiled function in the closure
as a new one in every process.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable
from functools import lru_cache
from pathlib import Path
from types import FunctionType

import numpy as np
from numpy.typing import ArrayLike

from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.compiled import njit
from nlfrf.rig.kernels.data import Body, Law, X
from nlfrf.rig.kernels.leuven import advance_hysteretic
from nlfrf.rig.kernels.slip import advance_coulomb, advance_gms, advance_sliders

# mypy: disable-error-code="untyped-decorator"


Array = np.ndarray
CALLED_FILES = tuple(Path(__file__).parent / f"{name}.py" for name in ("data", "leuven", "slip"))


def digest_files(*files: Path) -> str:
    """Return the SHA-256 of files whose kernels another file calls."""
    return hashlib.sha256(b"".join(path.read_bytes() for path in files)).hexdigest()


@njit(nogil=True, error_model="numpy")
def _control_step(
    i: int, A: Array, B: Array, C: Array, D: Array, x: Array, new: Array, e: float
) -> float:
    """Return the output of the i-th controller for the error e, and step its state x, with `new` as
    work space.
    """
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


@njit(nogil=True, error_model="numpy")  # compiled and cached with its caller
def _advance_law(
    body: Body,
    law: Law,
    grid: Array,
    state: Array,
    stack: Array,
    drive: Array,
    h: float,
    n: int,
    out: Array,
) -> bool:
    """Advance n steps with the kernel of the law."""
    if law.form == kernel_data.SLIDERS:
        return bool(advance_sliders(body, law, grid, state, stack, drive, h, n, out))
    if law.form == kernel_data.GMS:
        return bool(advance_gms(body, law, grid, state, stack, drive, h, n, out))
    if law.form == kernel_data.COULOMB:
        return bool(advance_coulomb(body, law, grid, state, stack, drive, h, n, out))
    return bool(advance_hysteretic(body, law, grid, state, stack, drive, h, n, out))


def _build_loops_kernel(stamp: str) -> Callable[..., None]:
    """Return the kernel, cached under the digest of the files that it calls."""

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
        delays: Array,
        saturations: Array,
        resolutions: Array,
        fs: float,
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
            saturation, resolution = saturations[i], resolutions[i]
            commanded = np.zeros(samples + whole + 1)
            lengths[i] = samples
            state, stack = states[i], stacks[i]
            for k in range(samples):
                y = state[X] + noise[i, k]
                if resolution > 0.0:
                    y = resolution * np.round(y / resolution)
                e = r[i, k] - y
                u = min(max(_control_step(i, A, B, C, D, xc, new, e), -saturation), saturation)
                commanded[k + whole] = u
                for piece in range(2):
                    span = part if piece == 0 else 1.0 - part
                    if span <= 0.0:
                        continue
                    force = disturbance[i, k]
                    if piece == 1:
                        force += commanded[k]
                    elif k > 0:
                        force += commanded[k - 1]
                    n = int(np.ceil(span * steps))
                    for j in range(n):
                        drive[j, 0] = drive[j, 1] = drive[j, 2] = force
                    h = span / (n * fs)
                    if not _advance_law(body, law, grid, state, stack, drive[:n], h, n, out):
                        lengths[i] = k
                        break
                    if piece == 0 or part == 0.0:
                        rows[i, k, 0], rows[i, k, 1], rows[i, k, 4] = (
                            out[0, 0],
                            out[0, 1],
                            out[0, 3],
                        )
                if lengths[i] < samples:
                    break
                rows[i, k, 2], rows[i, k, 3] = y, u

    return loops


run_loops = _build_loops_kernel(digest_files(*CALLED_FILES))


def _wrap_loops_kernel(steps: Callable[..., bool], compiled: bool) -> Callable[..., None]:
    """Return the kernel of the loops around user-defined steps, compiled if these are."""
    source = run_loops.py_func  # type: ignore[attr-defined]
    around = {**source.__globals__, "_advance_law": steps}
    plain = FunctionType(source.__code__, around, source.__name__, None, source.__closure__)
    return njit(nogil=True, error_model="numpy")(plain) if compiled else plain


@lru_cache(maxsize=64)
def compile_user_law(
    derivative: Callable[..., ArrayLike], force: Callable[..., float], size: int
) -> tuple[Callable[..., bool], bool]:
    """Return the code that steps a law of user functions, and whether numba compiled it."""
    plain = _build_user_stepper(_return_array(derivative), force)
    try:
        quick = [
            njit(error_model="numpy")(getattr(function, "py_func", function))
            for function in (derivative, force)
        ]
        compiled = njit(error_model="numpy")(_build_user_stepper(*quick))
        trial = Body(False, 1.0, 0.0, 0.0)
        compiled(trial, np.zeros(2), np.zeros(size), np.zeros((1, 3)), 1e-9, 1, np.zeros((1, 4)))
    except (
        Exception
    ):  # numba raises many types; an error in the functions appears when they run uncompiled
        return plain, False
    return compiled, True


@lru_cache(maxsize=64)
def user_law_loops(
    derivative: Callable[..., ArrayLike], force: Callable[..., float], size: int
) -> Callable[..., None]:
    """Return `run_loops` for a law of user functions, with its state in the place of turning
    points.
    """
    kernel, compiled = compile_user_law(derivative, force, size)

    def advance(
        body: Body,
        law: Law,
        grid: Array,
        state: Array,
        stack: Array,
        drive: Array,
        h: float,
        n: int,
        out: Array,
    ) -> bool:
        return kernel(body, state[:2], stack[0, :size], drive, h, n, out)  # X and V come first

    return _wrap_loops_kernel(njit(error_model="numpy")(advance) if compiled else advance, compiled)


def _return_array(derivative: Callable[..., ArrayLike]) -> Callable[..., Array]:
    """Return the derivative, wrapped to return an array from any sequence."""

    def wrapped(x: float, v: float, z: Array) -> Array:
        return np.asarray(derivative(x, v, z), dtype=float)

    return wrapped


def _build_user_stepper(
    derivative: Callable[..., Array], force: Callable[..., float]
) -> Callable[..., bool]:
    """Return a fourth-order Runge-Kutta stepper over position, velocity and state."""

    def advance(
        body: Body, place: Array, z: Array, drive: Array, h: float, substeps: int, out: Array
    ) -> bool:
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
                    kv = (
                        u - body.damping * vs - body.stiffness * xs - force(xs, vs, zs)
                    ) / body.mass
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
