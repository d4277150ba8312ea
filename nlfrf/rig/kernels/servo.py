"""Compiled drive: a P-PI cascade with a current loop around a machine with one or two masses,
sample by sample.

`coupled.advance_axes` steps the masses; it is the only integrator of coupled masses. The current is
exact: between two changes of its set point a first-order lag is an exponential, which the
integrator takes as its drive.

The kernel calls kernels of other files and carries a digest of them, for the reason given in
`loops`.
"""

# mypy: disable-error-code="untyped-decorator"
from __future__ import annotations

import math
from collections.abc import Callable
from pathlib import Path

import numpy as np

from nlfrf.rig.kernels.compiled import njit
from nlfrf.rig.kernels.coupled import N_ROWS, advance_axes, invert_free_mass
from nlfrf.rig.kernels.data import X
from nlfrf.rig.kernels.loops import CALLED_FILES, digest_files

Array = np.ndarray
#: Numbers of the drive, in the order of the kernel.
GAINS = (
    "kv",
    "feedforward",
    "kp",
    "integral",
    "smoothing",
    "current_limit",
    "lag",
    "delay",
    "resolution",
)
_KV, _FEEDFORWARD, _KP, _INTEGRAL, _SMOOTHING, _LIMIT, _LAG, _DELAY, _RESOLUTION = range(len(GAINS))
#: Columns of the output of the drive.
SIGNALS = ("position", "velocity", "velocity_set", "current_set", "current", "unlimited")
_POSITION, _VELOCITY, _VELOCITY_SET, _CURRENT_SET, _CURRENT, _UNLIMITED = range(len(SIGNALS))


def _build_servo_kernel(stamp: str) -> Callable[..., int]:
    """Return the kernel, cached under the digest of the files that it calls."""

    @njit(cache=True, nogil=True, error_model="numpy")
    def servo(
        machine: Array,
        laws: Array,
        grids: Array,
        states: Array,
        stacks: Array,
        encoder: int,
        force_constant: float,
        gains: Array,
        filters: Array,
        position_every: int,
        closed: bool,
        position: Array,
        velocity: Array,
        current: Array,
        noise: Array,
        fs: float,
        steps: int,
        rows: Array,
        signals: Array,
    ) -> int:
        """Return the number of samples until the end, or until the machine diverged.

        position, velocity, current, noise (n,); rows (n, 4, axes): position, velocity, z, friction;
        signals (n, 6); filters (S, 6), second-order sections.
        """
        samples, axes = position.size, states.shape[0]
        if len(stamp) == 0:
            return 0
        work, sections = np.zeros((N_ROWS, axes)), np.zeros((filters.shape[0], 2))
        invert_free_mass(machine, laws, states)
        drive, out = np.zeros((steps + 1, 3, axes)), np.empty((1, 4, axes))
        whole = int(gains[_DELAY])
        part = gains[_DELAY] - whole
        limit, lag, resolution = gains[_LIMIT], gains[_LAG], gains[_RESOLUTION]
        sum_of_errors, speed, by_position, i = 0.0, 0.0, 0.0, 0.0
        last, last_set = states[encoder, X], position[0]
        for k in range(samples):
            y = states[encoder, X] + noise[k]
            if resolution > 0.0:
                y = resolution * np.round(y / resolution)
            if k == 0:  # a drive has read its encoder before it is switched on
                last = y
            speed += gains[_SMOOTHING] * ((y - last) * fs - speed)
            last = y
            current_set_point, error = 0.0, 0.0
            if closed:
                if k % position_every == 0:
                    ahead = (position[k] - last_set) * fs / position_every
                    by_position = gains[_KV] * (position[k] - y) + gains[_FEEDFORWARD] * ahead
                    last_set = position[k]
                error = by_position + velocity[k] - speed
                current_set_point = gains[_KP] * error + sum_of_errors
                for s in range(filters.shape[0]):  # direct form II, transposed
                    new = filters[s, 0] * current_set_point + sections[s, 0]
                    sections[s, 0] = (
                        filters[s, 1] * current_set_point - filters[s, 4] * new + sections[s, 1]
                    )
                    sections[s, 1] = filters[s, 2] * current_set_point - filters[s, 5] * new
                    current_set_point = new
            unlimited = current_set_point + current[k]
            limited = min(max(unlimited, -limit), limit)
            if (unlimited - limited) * error <= 0.0:  # anti-windup: no further into the limit
                sum_of_errors += gains[_INTEGRAL] * error
            signals[k, _POSITION], signals[k, _VELOCITY] = y, speed
            signals[k, _VELOCITY_SET] = by_position + velocity[k] if closed else 0.0
            signals[k, _CURRENT_SET], signals[k, _CURRENT], signals[k, _UNLIMITED] = (
                limited,
                i,
                unlimited,
            )
            for piece in range(2):
                span = part if piece == 0 else 1.0 - part
                if span <= 0.0:
                    continue
                place = k - whole - 1 + piece
                target = signals[place, _CURRENT_SET] if place >= 0 else 0.0
                count = int(np.ceil(span * steps))
                h = span / (count * fs)
                keep = math.exp(-0.5 * h / lag) if lag > 0.0 else 0.0
                if lag == 0.0:
                    i = target
                for j in range(count):
                    for s in range(3):
                        if s > 0:
                            i = target + (i - target) * keep
                        drive[j, s, 0] = force_constant * i
                if not advance_axes(
                    machine, laws, grids, states, stacks, work, drive[:count], h, out
                ):
                    return k
                if piece == 0 or part == 0.0:
                    for row in range(4):
                        for axis in range(axes):
                            rows[k, row, axis] = out[0, row, axis]
        return samples

    return servo


_HASHED_FILES = (
    *CALLED_FILES,
    *(Path(__file__).parent / f"{name}.py" for name in ("coupled", "loops")),
)
step_servo: Callable[..., int] = _build_servo_kernel(digest_files(*_HASHED_FILES))
