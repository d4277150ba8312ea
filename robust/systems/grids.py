"""Frequency grids that see every mode of a loop."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import timebase

__all__ = ["grid"]


def grid(N: control.StateSpace) -> np.ndarray:
    """Frequencies [rad/s]: zero, around every pole, dense where damping is light; up to Nyquist."""
    dt = timebase(N)
    poles = N.poles().astype(complex) if N.nstates else np.ones(1, complex)
    with np.errstate(all="ignore"):
        s = np.log(np.where(poles == 0, 1e-300, poles)) / dt if dt else poles
    s = s[np.isfinite(s) & (np.abs(s) > 0)]
    size = np.abs(s) if s.size else np.ones(1)
    size = size[(size > 1e-9 * np.median(size)) & (size < 1e9 * np.median(size))]
    top = np.pi / dt if dt else np.inf
    low, high = size.min() / 30, min(size.max() * 30, top)
    sharp = s[(np.abs(s.real) < 0.3 * np.abs(s)) & (s.imag > 0)]
    near = sharp.imag[:, None] + np.abs(sharp.real)[:, None] * np.tan(np.linspace(-1.4, 1.4, 21))
    omega = np.unique(np.concatenate([np.geomspace(low, high, 120), near.ravel()]))
    # at zero frequency (and at Nyquist) N is real, and real perturbations reach what they reach nowhere near it
    return np.concatenate([[0.0], omega[(omega >= low) & (omega <= high)], [top] if dt else []])
