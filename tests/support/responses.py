"""Frequency responses by python-control alone: an oracle that shares no arithmetic with robust."""

import numpy as np


def response_by_channel(system, omega):
    """(n_out, n_in, W) response at omega [rad/s]; inf at a pole on the axis."""
    omega, dt = np.atleast_1d(np.asarray(omega, dtype=float)), float(system.dt or 0)
    points = np.exp(1j * omega * dt) if dt else 1j * omega
    return system(points, squeeze=False, warn_infinite=False)


def response(system, omega):
    """(W,) response of one channel at omega [rad/s]."""
    return response_by_channel(system, omega)[0, 0]
