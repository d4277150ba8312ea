"""Controllers that are put around a rig: anything with A, B, C, D and dt, checked and as arrays."""

from __future__ import annotations

from typing import Any

import numpy as np

__all__ = ["matrices"]


def matrices(K: Any, fs: float, n_inputs: int = 1, n_outputs: int = 1) -> tuple[np.ndarray, ...]:
    """A (s, s), B (s, n_inputs), C (n_outputs, s) and D of a sampled controller of so many inputs and outputs."""
    missing = [name for name in ("A", "B", "C", "D", "dt") if not hasattr(K, name)]
    if missing:
        raise ValueError(f"K must have A, B, C, D and dt, got {type(K).__name__} without {', '.join(missing)}")
    dt = K.dt
    if isinstance(dt, (bool, np.bool_)) or dt is None or dt == 0:
        raise ValueError(f"K must be sampled with dt = 1/fs = {1 / fs:g} s, got dt = {dt}. Discretise it first")
    if abs(float(dt) * fs - 1) > 1e-6:
        raise ValueError(f"K must be sampled with dt = 1/fs = {1 / fs:g} s, got dt = {float(dt):g} s")
    given = {name: np.asarray(getattr(K, name)) for name in ("A", "B", "C", "D")}
    for name, matrix in given.items():
        if matrix.dtype.kind not in "fiu":
            raise ValueError(f"K must have real matrices, got {name} of dtype {matrix.dtype}")
        if not np.isfinite(matrix).all():
            raise ValueError(f"K must have finite matrices, got a number in {name} that is not")
    A, B, C, D = (matrix.astype(float) for matrix in given.values())
    D = np.atleast_2d(D)
    if D.shape != (n_outputs, n_inputs):
        wanted = (
            "one input and one output"
            if (n_inputs, n_outputs) == (1, 1)
            else f"{n_inputs} inputs and {n_outputs} outputs"
        )
        raise ValueError(f"K must have {wanted}, got {D.shape[1]} and {D.shape[0]}")
    size = int(np.sqrt(A.size))
    if A.size != size**2 or B.size != size * n_inputs or C.size != size * n_outputs:
        raise ValueError(
            f"K must have A (s, s), B (s, {n_inputs}) and C ({n_outputs}, s), got shapes "
            f"{given['A'].shape}, {given['B'].shape} and {given['C'].shape}"
        )
    return A.reshape(size, size), B.reshape(size, n_inputs), C.reshape(n_outputs, size), D
