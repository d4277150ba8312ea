"""Bilinear maps: between the circle and the axis, z = (1 + s T/2)/(1 - s T/2), and between discs and half planes."""

from __future__ import annotations

import control
import numpy as np

from robust.systems.lti import Matrices, timebase

__all__ = ["continuous_image", "from_half_plane", "to_continuous", "to_discrete", "to_half_plane"]


def to_continuous(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Bilinear image z = (1 + s)/(1 - s): keeps stability and norms; omega maps to tan(omega dt / 2)."""
    n = A.shape[0]
    inverse = inverted(A + np.eye(n), "z = -1 (the Nyquist frequency)")
    return inverse @ (A - np.eye(n)), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D - C @ inverse @ B


def to_discrete(
    A: np.ndarray, B: np.ndarray, C: np.ndarray, D: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """The way back from `to_continuous`: s = (z - 1)/(z + 1)."""
    n = A.shape[0]
    inverse = inverted(np.eye(n) - A, "s = 2/dt (or where prewarping puts that)")
    return inverse @ (np.eye(n) + A), np.sqrt(2) * inverse @ B, np.sqrt(2) * C @ inverse, D + C @ inverse @ B


def inverted(A: np.ndarray, place: str) -> np.ndarray:
    """The inverse a bilinear map needs, or a refusal that names the pole in its way."""
    try:
        return np.linalg.inv(A)
    except np.linalg.LinAlgError:
        raise np.linalg.LinAlgError(
            f"system must have no pole at {place}, got one: the bilinear map would send it to infinity"
        ) from None


def continuous_image(system: control.StateSpace) -> Matrices:
    """The matrices in continuous time; discrete systems through the bilinear map, which keeps the norm."""
    matrices = (system.A, system.B, system.C, system.D)
    return to_continuous(*matrices) if timebase(system) else matrices


def to_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """The image under p = (s - a)/(1 - s/b), which takes the circle through a and b, both real, onto the axis.

    With 0 < a < b the disc between them becomes the right half plane of p, with b < a < 0 all that lies outside of it.

    >>> A, B, C, D = to_half_plane((np.eye(1), np.eye(1), np.eye(1), np.zeros((1, 1))), 1.0, 3.0)
    >>> float(A[0, 0]), round(float((D - C @ np.linalg.solve(A - 1, B))[0, 0]), 12)   # p = 1 is s = 1.5: 1/(1.5 - 1)
    (0.0, 2.0)
    """
    A, B, C, D = matrices
    inverse = np.linalg.inv(np.eye(A.shape[0]) - A / b)
    across, root = inverse @ B, np.sqrt(1 - a / b)
    return inverse @ (A - a * np.eye(A.shape[0])), root * across, root * C @ inverse, D + C @ across / b


def from_half_plane(matrices: Matrices, a: float, b: float) -> Matrices:
    """The way back from `to_half_plane`: s = (p + a)/(1 + p/b)."""
    return to_half_plane(matrices, -a, -b)
