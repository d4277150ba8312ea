"""A flow with jumps, a supply that it cannot exceed, and what else of the stored energy there is."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value

__all__ = ["Block", "Dissipation"]


@value
class Block:
    """A nonlinearity that acts at the first jump: y+ = J y - enters w, and 2 w seen'y >= weight w^2.

    Fields
    ------
    enters, seen : (n,) ndarray
    weight : float
        Positive.
    """

    enters: np.ndarray
    seen: np.ndarray
    weight: float


@value
class Dissipation:
    """A flow with jumps, a supply it cannot exceed, and what of the stored energy is not z'Pz.

    Fields
    ------
    A : (n, n) ndarray
    B : (n, m) ndarray
        Flow z' = A z + B d.
    spans : (S,) ndarray
    jumps : (S, n, n) ndarray
        How long each flow lasts [s], and the jump before it; none where nothing is sampled.
    Q, N, R : (n, n), (n, m), (m, m) ndarray
        Supply z'Qz + 2 z'Nd + d'Rd.
    stored : (n + E, n + E) ndarray
        The rest of the stored energy, a form in z and E more (forces that rest).
    B_error : (n, m) ndarray
    stored_error : (n + E, n + E) ndarray
        How far an entry may be off, because the rest xi_e is known to rounding only.
    block : Block or None
        What else acts at the first jump.
    """

    A: np.ndarray
    B: np.ndarray
    spans: np.ndarray
    jumps: np.ndarray
    Q: np.ndarray
    N: np.ndarray
    R: np.ndarray
    stored: np.ndarray
    B_error: np.ndarray
    stored_error: np.ndarray
    block: Block | None = None
