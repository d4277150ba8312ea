"""Gains that no controller changes: a lower bound of every closed-loop norm."""

from __future__ import annotations

import numpy as np

from robust.synthesis.hinf.generalised_plant import Plant, dual_plant

# rounding for rows of length one; gamma below it counts as a lower bound of zero
KERNEL_TOLERANCE = 1e-13
# distance of a pole from its frequency on the axis, for the scaled plant (mean pole one)
_ON_AXIS = 1e-9
_ANY_POINT = 1.2345  # in scaled time: a generic point, where no plant has a zero except by chance


def unchangeable_gain(plant: Plant, omega: np.ndarray) -> float:
    """Return the largest gain that no controller changes, at frequencies (W,) of the scaled plant.

    If (A - s) x + B1 w = 0 and C2 x + D21 w = 0, y and u stay zero for any K, and z = C1 x + D11 w.
    Such w exist at every frequency if P21 has fewer independent rows than columns, otherwise where
    it loses rank: especially at poles of the plant on the axis and at infinity. The same holds for
    the transposed plant.
    """
    return max(_unmeasured_gain(side, omega) for side in (plant, dual_plant(plant)))


def _unmeasured_gain(plant: Plant, omega: np.ndarray) -> float:
    """Return `unchangeable_gain` for disturbances that do not show in y."""
    if plant.A.size:
        poles = np.linalg.eigvals(plant.A)
    else:
        poles = np.zeros(0)
    everywhere = _unmeasured_space(plant, _ANY_POINT, 0).shape[1]
    gains = [0.0]
    for w in omega:
        is_special = w in (0, np.inf) or np.any(np.abs(poles - 1j * w) < _ON_AXIS)
        kernel = _unmeasured_space(
            plant, 1j * w if np.isfinite(w) else w, 0 if is_special else everywhere
        )
        n = len(kernel) - plant.B1.shape[1]
        z = np.hstack([plant.C1, plant.D11])[:, -len(kernel) :] @ kernel
        gains += [float(np.linalg.norm(z @ np.linalg.pinv(kernel[n:]), 2))] if kernel.size else []
    return max(gains)


def _unmeasured_space(plant: Plant, s: complex, dimension: int) -> np.ndarray:
    """Return states and disturbances (n + n_w, k), at infinity disturbances alone, with y = u = 0
    at s.

    `dimension` is the known dimension, or 0 for the directions that are zero to rounding.
    """
    n = plant.A.shape[0]
    if np.isfinite(s):
        pencil = np.block([[plant.A - s * np.eye(n), plant.B1], [plant.C2, plant.D21]])
    else:
        pencil = plant.D21
    rows = np.linalg.norm(pencil, axis=1, keepdims=True)
    _, sizes, V = np.linalg.svd(pencil / np.where(rows > 0, rows, 1.0))
    rank = len(V) - dimension if dimension else np.count_nonzero(sizes > KERNEL_TOLERANCE)
    return V[rank:].conj().T
