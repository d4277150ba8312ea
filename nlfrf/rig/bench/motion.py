"""The motion of a rig through any force, from rest; the friction of a motion that is prescribed."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import require_choice, require_integer, require_kind, require_positive, require_real_array
from nlfrf._base.values import value
from nlfrf.rig.bench.rig import (
    Rig,
    initial_memory,
    integrate_rig,
    require_stable_step,
    unstable_step_error,
    warn_of_coarse_step,
)
from nlfrf.rig.kernels import data as packing
from nlfrf.rig.laws.hysteresis import warn_of_forgotten_loops
from nlfrf.rig.laws.integration import integrate
from nlfrf.rig.laws.laws import Friction, pack_law


@value
class Motion:
    """Motion of a rig, sample by sample.

    Fields
    ------
    t : (n,) ndarray
        Time [s].
    drive : (n,) or (n_u, n) ndarray
        Force on the mass [N], or velocity of a prescribed motion [m/s].
    x, v, z : (n,) or (axes, n) ndarray
        Position [m], velocity [m/s], and deflection of the friction [m].
    friction : (n,) or (axes, n) ndarray
        Friction force [N].

    Examples
    --------
    >>> from nlfrf import paper_rig
    >>> from nlfrf.rig import run
    >>> motion = run(paper_rig(), np.zeros(4), fs=1000)
    >>> motion.t.tolist(), motion.x.tolist()
    ([0.0, 0.001, 0.002, 0.003], [0.0, 0.0, 0.0, 0.0])
    """

    t: np.ndarray
    drive: np.ndarray
    x: np.ndarray
    v: np.ndarray
    z: np.ndarray
    friction: np.ndarray


def run(rig: Rig, force: ArrayLike, *, fs: float, oversampling: int = 1, hold: str = "linear") -> Motion:
    """Run the rig from rest through any force, periodic or not.

    Parameters
    ----------
    rig : Rig
        The machine.
    force : (n,) ndarray, or (n_u, n) of a rig of matrices
        Force on the mass [N].
    fs : float
        Sampling frequency [Hz].
    oversampling : int
        Integration steps per sample.
    hold : str
        The force between samples: "linear", or "zoh" (held).

    Returns
    -------
    Motion

    Raises
    ------
    ValueError
        A step too long to be stable, with the oversampling that would do; no sample.

    Examples
    --------
    A force below the static friction moves the mass by a few micrometres and does not set it free.

    >>> from nlfrf import paper_rig
    >>> motion = run(paper_rig(), np.full(4000, 0.5), fs=4000.0)
    >>> bool(2e-6 < motion.x[-1] < 8e-6)
    True
    """
    require_kind("rig", rig, Rig)
    samples = require_samples("force", force, channels=rig.n_inputs if rig.several else None)
    fs = require_positive("fs", fs)
    oversampling = require_integer("oversampling", oversampling, least=1)
    require_choice("hold", hold, ("linear", "zoh"))

    def attempt(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory = initial_memory(rig)
        return integrate_rig(
            rig, memory, drive=force_at_substeps(samples, steps, hold), h=1 / (fs * steps), substeps=steps
        ), memory

    require_stable_step(rig.stable_step, fs, oversampling)
    warn_of_coarse_step(rig.poles(1.0), fs, oversampling)
    out, memory = attempt(oversampling)
    if out is None:
        raise unstable_step_error(fs, oversampling, lambda steps: attempt(steps)[0] is not None)
    warn_of_forgotten_loops(memory.state[..., packing.LOST].sum())
    return to_motion(samples, out, fs)


def drive(friction: Friction, v: ArrayLike, *, fs: float, oversampling: int = 1) -> Motion:
    """Compute the friction force for a prescribed motion, from rest: to draw hysteresis loops and Stribeck curves.

    Parameters
    ----------
    friction : Coulomb, Dahl, LuGre, Leuven or GeneralizedMaxwellSlip
        The friction law.
    v : (n,) ndarray
        Velocity [m/s], straight between samples.
    fs : float
        Sampling frequency [Hz].
    oversampling : int
        Integration steps per sample.

    Returns
    -------
    Motion
        With the velocity as its drive.

    Raises
    ------
    ValueError
        As in `run`.

    Examples
    --------
    At constant velocity the friction settles on the Stribeck curve, with the viscous part on top.

    >>> from nlfrf.friction import Leuven
    >>> motion = drive(Leuven(), np.full(2000, 0.01), fs=10e3)
    >>> round(float(motion.friction[-1]), 4)
    0.8144
    """
    velocity = require_samples("v", v)
    fs = require_positive("fs", fs)
    oversampling = require_integer("oversampling", oversampling, least=1)
    law, grid = pack_law(friction)
    body = packing.Body(True, 1.0, 0.0, 0.0)

    def attempt(steps: int) -> tuple[np.ndarray | None, packing.Memory]:
        memory = packing.initial_memory(law.curve, grid)
        samples = force_at_substeps(velocity, steps, "linear")
        return integrate(body, law, grid=grid, memory=memory, drive=samples, h=1 / (fs * steps), substeps=steps), memory

    out, memory = attempt(oversampling)
    if out is None:
        raise unstable_step_error(fs, oversampling, lambda steps: attempt(steps)[0] is not None)
    warn_of_forgotten_loops(memory.state[packing.LOST])
    return to_motion(velocity, out, fs)


def require_samples(name: str, signal: ArrayLike, *, channels: int | None = None) -> np.ndarray:
    """Return the signal (n,), or (channels, n) where channels are given, as an array of at least one sample."""
    samples = require_real_array(name, signal, ndim=1 if channels is None else 2)
    if channels is not None and len(samples) != channels:
        raise ValueError(f"{name} must have {channels} channels, as the rig has, got {len(samples)}")
    if samples.size == 0:
        raise ValueError(f"{name} must hold at least one sample, got none")
    return samples


def to_motion(drive: np.ndarray, out: np.ndarray, fs: float) -> Motion:
    """Return the output of the integrator as a `Motion`."""
    x, v, z, friction = np.moveaxis(out, 0, -1)
    return Motion(t=np.arange(drive.shape[-1]) / fs, drive=drive, x=x, v=v, z=z, friction=friction)


def force_at_substeps(samples: np.ndarray, oversampling: int, hold: str) -> np.ndarray:
    """Return the force at begin, middle and end of each integration step, (n oversampling, 3) or (.., 3, n_u).

    samples (n,) or (n_u, n) are interpolated with hold "linear", the last one held, and held one period otherwise.
    """
    step = np.arange(oversampling)[:, np.newaxis]
    fraction = (step + np.array([0.0, 0.5, 1.0])) / oversampling if hold == "linear" else np.zeros((oversampling, 3))
    rise = np.diff(samples, append=samples[..., -1:])
    force = samples[..., np.newaxis, np.newaxis] + rise[..., np.newaxis, np.newaxis] * fraction
    force = force.reshape(*samples.shape[:-1], -1, 3)
    return force if samples.ndim == 1 else np.moveaxis(force, 0, -1)
