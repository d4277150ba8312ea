"""A sampled controller matrix around several coupled axes."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.bench.controllers import matrices
from nlfrf.bench.loop_response import LoopResponse
from nlfrf.bench.motion import some_samples
from nlfrf.bench.rig import Rig, at_rest
from nlfrf.coupled import machine as axes
from nlfrf.friction import kernel_data as packing
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.shared.arguments import nonnegative, positive, real_array

__all__ = ["MOST_HALVINGS", "loop_of_axes"]


#: How often the step is halved before a loop that runs away is called diverged.
MOST_HALVINGS = 6


def loop_of_axes(
    rig: Rig,
    K: Any,
    r: Any,
    fs: float,
    saturation: Any,
    resolution: Any,
    delay: float,
    disturbance: Any,
    noise: Any,
    initial: Any,
    steps: int,
) -> LoopResponse:
    """What `simulate_loop` gives for a rig of matrices; arguments as there."""
    r = some_samples("r", r, channels=rig.n_outputs)
    n = r.shape[1]
    controller = [np.ascontiguousarray(part) for part in matrices(K, fs, rig.n_outputs, rig.n_inputs)]
    limits = limit("saturation", saturation, rig.n_inputs), limit("resolution", resolution, rig.n_outputs)
    signals = [channels("disturbance", disturbance, rig.n_inputs, n), channels("noise", noise, rig.n_outputs, n)]
    begin = begun(initial, rig.n_axes)
    late = min(nonnegative("delay", delay) * fs, n)  # all later is after the end
    for halving in range(MOST_HALVINGS + 1):  # what does not reach the end is run again before it is believed
        numbers = fs, *limits, late, steps * 2**halving
        length, found, lost = attempt(rig, controller, np.ascontiguousarray(r.T), signals, begin, numbers)
        if length == n:
            break
    warn_lost(lost)
    x, v, friction, y, u = (part[:, :length] for part in found)
    t, ran_away = np.arange(length) / fs, length < n
    return LoopResponse(t=t, r=r[:, :length], u=u, x=x, v=v, y=y, friction=friction, diverged=ran_away)


def attempt(
    rig: Rig, controller: list[np.ndarray], r: np.ndarray, signals: list[np.ndarray], begin: np.ndarray, numbers: Any
) -> tuple[int, list[np.ndarray], float]:
    """One call of the compiled code: samples reached, channels (.., n) of x, v, friction, y and u, loops lost."""
    from nlfrf.coupled.run_kernels import run_axes_loop

    memory = at_rest(rig)
    laws, grids = axes.packed_laws(rig.friction)
    memory.state[:, packing.X], memory.state[:, packing.V] = begin
    dry = laws[:, 0] == packing.COULOMB
    memory.state[dry, packing.DIRECTION] = np.sign(begin[1, dry])
    rows = np.zeros((len(r), 4, rig.n_axes))
    y, u = np.zeros((len(r), rig.n_outputs)), np.zeros((len(r), rig.n_inputs))
    machine = axes.machine(rig.mass, rig.stiffness, rig.damping, rig.cubic)
    places = np.array(rig.sensors), np.array(rig.actuators)
    length = run_axes_loop(
        machine, laws, grids, memory.state, memory.stack, *places, *controller, r, *signals, *numbers, rows, y, u
    )
    x, v = rig.sensors @ rows[:, 0].T, rig.sensors @ rows[:, 1].T
    return int(length), [x, v, rows[:, 3].T, y.T, u.T], float(memory.state[:, packing.LOST].sum())


def limit(name: str, given: Any, n: int) -> np.ndarray:
    """(n,) limits: one for all channels, or one for each; a saturation may be infinite, a resolution zero."""
    if np.ndim(given) > 0 and np.shape(given) != (n,):
        raise ValueError(f"{name} must be one number or {n}, one a channel, got shape {np.shape(given)}")
    check = nonnegative if name == "resolution" else positive
    found = np.broadcast_to(np.asarray(given, dtype=float), (n,)).tolist()
    return np.array([one if name == "saturation" and one == np.inf else check(name, one) for one in found])


def channels(name: str, signal: Any, n_channels: int, n: int) -> np.ndarray:
    """(n, channels) samples; zeros when not given."""
    if signal is None:
        return np.zeros((n, n_channels))
    signal = real_array(name, signal, ndim=2)
    if signal.shape != (n_channels, n):
        raise ValueError(f"{name} must have shape ({n_channels}, {n}), channels and samples of r, got {signal.shape}")
    return np.ascontiguousarray(signal.T)


def begun(initial: Any, n: int) -> np.ndarray:
    """(2, n) positions and velocities of the axes; of one pair each axis has both."""
    initial = np.asarray(initial, dtype=float)
    if initial.shape == (2,):
        initial = np.repeat(initial[:, None], n, axis=1)
    if initial.shape != (2, n):
        raise ValueError(f"initial must hold positions and velocities, shape (2, {n}), got shape {initial.shape}")
    return real_array("initial", initial, ndim=2)
