"""Zeros, poles and gain of a single-loop system in many digits, for responses that doubles cannot tell."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.verification.claim import Matrices
from robust.verification.exact import quotient

__all__ = ["Roots", "roots_of"]


@value
class Roots:
    """gain prod (s - zeros) / prod (s - poles); of a discrete system all about z = 1, with z - 1 in place of s."""

    zeros: np.ndarray
    poles: np.ndarray
    gain: float

    def at(self, points: np.ndarray) -> np.ndarray:
        """(W,) values at s, or z - 1; infinite at a pole."""
        with np.errstate(divide="ignore", invalid="ignore"):
            logs = np.log(points[:, None] - self.zeros).sum(axis=1) - np.log(points[:, None] - self.poles).sum(axis=1)
            values = self.gain * np.exp(logs)
        on_pole = (points[:, None] == self.poles).any(axis=1)
        return np.where(on_pole, np.inf, np.where((points[:, None] == self.zeros).any(axis=1), 0.0, values))


def roots_of(system: Matrices) -> Roots:
    """The exact transfer function, its roots to the last digit.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> found = roots_of(Matrices(A=-one, B=one, C=one, D=one))                       # (s + 2)/(s + 1)
    >>> found.zeros.real.tolist(), found.poles.real.tolist(), found.gain
    ([-2.0], [-1.0], 1.0)
    """
    from flint import fmpq_poly

    exact = quotient(system)
    shift = fmpq_poly([1, 1] if system.dt else [0, 1])
    num, den = exact.num(shift), exact.den(shift)
    if not num:
        return Roots(zeros=np.zeros(0, complex), poles=roots(den), gain=0.0)
    lead = num[num.degree()] / den[den.degree()]
    return Roots(zeros=roots(num), poles=roots(den), gain=float(int(lead.p) / int(lead.q)))


def roots(p: Any) -> np.ndarray:
    """All roots of a fmpq_poly, each as often as it is one."""
    found = [complex(root) for root, many in p.numer().complex_roots() for _ in range(many)] if p.degree() > 0 else []
    return np.array(found, dtype=complex)
