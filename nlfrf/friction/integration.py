"""One run of a body through a force by the compiled code that fits its friction law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf.friction import kernel_data

__all__ = ["integrate"]


def integrate(
    body: kernel_data.Body,
    law: kernel_data.Law,
    grid: kernel_data.Grid,
    memory: kernel_data.Memory,
    drive: np.ndarray,
    h: float,
    substeps: int,
) -> np.ndarray | None:
    """The compiled integration.

    Returns (n / substeps, 4): position, velocity, z and friction force at the begin of every `substeps`-th step;
    None where the step was too long to be stable.
    """
    kernel: Callable[..., bool]
    if law.form == kernel_data.COULOMB:
        from nlfrf.friction.slip_kernels import advance_coulomb as kernel
    elif law.form == kernel_data.GMS:
        from nlfrf.friction.slip_kernels import advance_gms as kernel
    elif law.form == kernel_data.SLIDERS:
        from nlfrf.friction.slider_kernels import advance_sliders as kernel
    else:
        from nlfrf.friction.leuven_kernels import advance_hysteretic as kernel
    out = np.empty((drive.shape[0] // substeps, 4))
    stable = kernel(body, law, grid, memory.state, memory.stack, drive, h, substeps, out)
    return out if stable else None
