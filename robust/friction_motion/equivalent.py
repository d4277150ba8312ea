"""A friction law at an amplitude as a spring and a damper: what it answers to a sine."""

from __future__ import annotations

from typing import Any

import numpy as np

import nlfrf

__all__ = ["describing_function"]

POINTS, PERIODS = 256, 3  # of a sine that friction is driven by
FINEST = 4096  # integration steps a point


def describing_function(friction: Any, amplitude: float, omega: float) -> complex:
    """k_eq + j w c_eq [N/m] of a law at an amplitude [m] and a frequency [rad/s].

    >>> from nlfrf.friction import VaryingSliders
    >>> stop = VaryingSliders(stiffness=[64e3], strength=[1.0])           # an elastic-plastic element
    >>> N = describing_function(stop, 2e-5, 300.0)
    >>> bool(abs(N / (53644.66 + 13926.06j) - 1) < 1e-3)
    True
    """
    # half a point off, so that no sample falls on a reversal: the force there is one or the other, which would turn
    # a friction that only slides by pi/POINTS, 1.2 % of it into a spring
    phase = 2 * np.pi / POINTS * (np.arange(PERIODS * POINTS) + 0.5)
    fs = omega * POINTS / (2 * np.pi)
    steps = 4
    while True:
        try:
            motion = nlfrf.drive(friction, amplitude * omega * np.cos(phase), fs=fs, oversampling=steps)
            break
        except ValueError:  # steps too long for the law; what else is wrong is so at the finest too
            if steps >= FINEST:
                raise
            steps *= 4
    last = slice(-POINTS, None)
    turn = np.exp(-1j * phase[last])
    force = motion.friction[last] - getattr(friction, "sigma2", 0.0) * motion.drive[last]
    return complex((turn @ force) / (turn @ motion.x[last]))
