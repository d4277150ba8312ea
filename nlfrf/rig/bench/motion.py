"""The motion of a rig under any force, from rest; the friction force of a prescribed motion."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_choice, require_integer, require_positive
from nlfrf.rig.bench.rig import (
    Rig,
    initial_memory,
    integrate_rig,
    require_stable_step,
    unstable_step_error,
    warn_of_coarse_step,
)
from nlfrf.rig.bench.trajectory import Trajectory, require_samples
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.rig.laws.integration import integrate
from nlfrf.rig.laws.laws import Friction, pack_law

_UNITS = {"x": "m", "v": "m/s", "z": "m", "friction": "N"}


def run_rig(rig: Rig, force: ArrayLike, *, fs: float, oversampling: int, hold: str) -> Trajectory:
    """Run the rig from rest under any force (n,), or (n_u, n) for several axes, periodic or not."""
    samples = require_samples("signal", force, channels=rig.n_inputs if rig.several else None)
    fs = require_positive("fs", fs)
    require_choice("hold", hold, ("linear", "zoh"))
    require_stable_step(rig.stable_step, fs, require_integer("oversampling", oversampling, least=1))
    warn_of_coarse_step(rig.poles(1.0), fs, oversampling)

    def integrate_at(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory, drive = initial_memory(rig), _force_at_substeps(samples, steps, hold)
        return integrate_rig(rig, memory, drive=drive, h=1 / (fs * steps), substeps=steps), memory

    return _move(integrate_at, samples, fs=fs, oversampling=oversampling, unit="N")


def run_law(friction: Friction, v: ArrayLike, *, fs: float, oversampling: int) -> Trajectory:
    """Return the friction force for a prescribed velocity, linear between samples, from rest."""
    velocity = require_samples("signal", v)
    fs = require_positive("fs", fs)
    require_integer("oversampling", oversampling, least=1)
    law, grid = pack_law(friction)
    body = packing.Body(True, 1.0, 0.0, 0.0)

    def integrate_at(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory = packing.initial_memory(law.curve, grid)
        drive = _force_at_substeps(velocity, steps, "linear")
        return integrate(
            body, law, grid=grid, memory=memory, drive=drive, h=1 / (fs * steps), substeps=steps
        ), memory

    return _move(integrate_at, velocity, fs=fs, oversampling=oversampling, unit="m/s")


def _move(
    integrate_at: Callable[[int], tuple[np.ndarray | None, packing.Memory]],
    drive: np.ndarray,
    *,
    fs: float,
    oversampling: int,
    unit: str,
) -> Trajectory:
    """Return the result of the integrator at an oversampling; refuse an unstable step."""
    out, memory = integrate_at(oversampling)
    if out is None:
        raise unstable_step_error(
            fs, oversampling, lambda steps: integrate_at(steps)[0] is not None
        )
    warn_of_forgotten_loops(memory.state[..., packing.LOST].sum())
    signals = {"drive": drive.copy()} | dict(zip(_UNITS, np.moveaxis(out, 0, -1), strict=True))
    return Trajectory(
        t=np.arange(drive.shape[-1]) / fs, signals=signals, units={"drive": unit} | _UNITS
    )


def _force_at_substeps(samples: np.ndarray, oversampling: int, hold: str) -> np.ndarray:
    """Return the force at start, middle and end of each integration step, (n oversampling, 3) or
    (.., 3, n_u).

    With hold "linear" the samples (n,) or (n_u, n) are interpolated, and the last one is held; else
    each is held.
    """
    step = np.arange(oversampling)[:, np.newaxis]
    if hold == "linear":
        fraction = (step + np.array([0.0, 0.5, 1.0])) / oversampling
    else:
        fraction = np.zeros((oversampling, 3))
    rise = np.diff(samples, append=samples[..., -1:])
    force = samples[..., np.newaxis, np.newaxis] + rise[..., np.newaxis, np.newaxis] * fraction
    force = force.reshape(*samples.shape[:-1], -1, 3)
    if samples.ndim == 1:
        return force
    return np.moveaxis(force, 0, -1)
