"""Integrate a body with friction under a force, with the compiled code of its friction law."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.data import Memory
from nlfrf.rig.laws.own import OwnFriction, UserLawData


def integrate(
    body: kernel_data.Body,
    law: kernel_data.Law,
    *,
    grid: kernel_data.Grid,
    memory: Memory,
    drive: np.ndarray,
    h: float,
    substeps: int,
) -> np.ndarray | None:
    """Integrate over `drive` (n, 3), with steps h [s] and the kernel of the law.

    Returns (n / substeps, 4): position, velocity, z and friction force at the start of every
    `substeps`-th step; None if the step was too long to be stable.
    """
    if isinstance(law, UserLawData):
        return _integrate_user_law(
            body, law.functions, memory=memory, drive=drive, h=h, substeps=substeps
        )
    from nlfrf.rig.kernels import leuven, slip

    kernels: dict[float, Callable[..., bool]] = {
        kernel_data.COULOMB: slip.advance_coulomb,
        kernel_data.GMS: slip.advance_gms,
        kernel_data.SLIDERS: slip.advance_sliders,
    }
    kernel = kernels.get(law.form, leuven.advance_hysteretic)
    out = np.empty((drive.shape[0] // substeps, 4))
    stable = kernel(body, law, grid, memory.state, memory.stack, drive, h, substeps, out)
    if stable:
        return out
    return None


def _integrate_user_law(
    body: kernel_data.Body,
    law: OwnFriction,
    *,
    memory: Memory,
    drive: np.ndarray,
    h: float,
    substeps: int,
) -> np.ndarray | None:
    """Integrate a law of user functions; its state takes the place of the turning points of other
    laws.
    """
    from nlfrf.rig.kernels.loops import compile_user_law

    kernel, _ = compile_user_law(law.derivative, law.force, law.rest.size)
    state, z = memory.state, memory.stack[0, : law.rest.size]
    if not state[kernel_data.DEPTH]:  # a machine at rest
        z[:] = law.rest
        state[kernel_data.DEPTH] = 1.0
    out = np.empty((drive.shape[0] // substeps, 4))
    place = state[[kernel_data.X, kernel_data.V]]
    own = z.copy()
    stable = kernel(body, place, own, np.ascontiguousarray(drive), float(h), int(substeps), out)
    state[[kernel_data.X, kernel_data.V]], z[:] = place, own
    if stable:
        return out
    return None
