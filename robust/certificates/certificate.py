"""``Certificate``: what was proved at every frequency, and how."""

from __future__ import annotations

import numpy as np

from nlfrf.shared.values import value

__all__ = ["Certificate", "refused"]


@value
class Certificate:
    """What was proved, how, and if not, why not.

    Fields
    ------
    subject : str
        What the bound is about.
    holds : bool
        True only if the numbers were judged and passed.
    level : float
        The norm is below this level at every frequency.
    method : str
        "KYP" (P from cvxpy), "KYP, P from a Riccati equation", "interval by interval" (from the responses),
        "Hamiltonian with one scaling, interval by interval" (operator perturbations), or "".
    intervals : (I, 2) ndarray
        Frequency intervals [rad/s] on which the proof was made; [0, inf] (or Nyquist) for a KYP certificate.
    reason : str
        Why it does not hold; empty when it does.

    References
    ----------
    Boyd, El Ghaoui, Feron & Balakrishnan 1994, 2.7.3.

    Examples
    --------
    >>> import control
    >>> from robust import certify_norm
    >>> proof = certify_norm(control.tf([1], [1, 1]), 1.1)
    >>> proof.holds, certify_norm(control.tf([1], [1, 1]), 0.9).holds
    (True, False)
    """

    subject: str
    holds: bool
    level: float
    method: str
    intervals: np.ndarray
    reason: str


def refused(subject: str, level: float, reason: str) -> Certificate:
    """A certificate that does not hold."""
    return Certificate(subject=subject, holds=False, level=level, method="", intervals=np.zeros((0, 2)), reason=reason)
