"""``Certificate``: what was proved at every frequency, and how."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.proofs.exact.verification import Verification

EXACT, SCALED_KYP, GENERALISED_KYP = "exact arithmetic", "scaled KYP", "generalised KYP"  # nothing in floating point
PIECES = "scalings, each where it holds"  # neither, but no claim is kept of it


@value
class Certificate:
    """What was proved, how, and if not, why not.

    A loop with one input and one output is proved in exact arithmetic from the matrices as they were given, one with
    several by matrices that are checked over the rationals (scaled and generalised KYP); `verify` repeats that. What is
    proved by scalings, each where it holds, is exact too, but not kept to be repeated. Any other outcome is judged in
    floating point, with slacks far above its rounding. A norm is the structured singular value of one full block.

    Fields
    ------
    subject : str
        What the bound is about.
    outcome : Outcome
        "holds" only if the numbers were judged and passed; "violated" only if what had to be below the level was proved
        not to be; else "undecided".
    level : float
        The norm is below this level at every frequency.
    method : str
        "exact arithmetic", "scaled KYP" (P and X, see `robust.proofs.exact.scaled_kyp`) and "generalised KYP" (P, Q and
        X of every interval, see `robust.proofs.exact.interval_kyp`), all proved, rigorous; "periodic Riccati equation,
        Bernstein" (friction), or "".
    intervals : (I, 2) ndarray
        Frequency intervals [rad/s] on which the proof was made; [0, inf] (or Nyquist) of a norm; where it is violated.
    reason : str
        Why it does not hold, for people; empty when it does.
    claim : LoopClaim or another
        What holds, with every number as given, to be proved again; None where the proof is of another kind (mu).
    again : callable, optional
        How the claim is proved again: again(claim, time_cap=seconds).

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
    >>> print(proof.verify())
    stability: proved, rigorous
    structured singular value: proved, rigorous
    """

    subject: str
    outcome: Outcome
    level: float
    method: str
    intervals: np.ndarray
    reason: str
    claim: object = None
    again: Callable[..., Verification] | None = None

    @property
    def holds(self) -> bool:
        """Whether the bound was proved."""
        return self.outcome is Outcome.HOLDS

    @property
    def violated(self) -> bool:
        """Whether a frequency was found at which the bound fails."""
        return self.outcome is Outcome.VIOLATED

    @property
    def judged(self) -> str:
        """In which arithmetic it was judged: "proved, rigorous" to the last bit, or "judged in floating point"."""
        exact = self.method in (EXACT, SCALED_KYP, GENERALISED_KYP, PIECES)
        return "proved, rigorous" if exact else "judged in floating point"

    def verify(self, *, time_cap: float = 60.0) -> Verification:
        """Prove it again with outward rounding, from the claim alone: nothing of what found it is used.

        Parameters
        ----------
        time_cap : float
            Seconds of processor time after which what is left counts as not verified, however busy the machine is.

        Returns
        -------
        Verification
            What is "proved, rigorous", and what is not, with the reason.

        References
        ----------
        F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", 2017.
        """
        if self.again is not None:
            return self.again(self.claim, time_cap=time_cap)
        reason = f"{self.judged}: no exact claim is kept of it" if self.holds else self.reason
        return Verification(proved=(), failed=((self.subject, reason),))


def failed_certificate(
    subject: str, level: float, reason: str, *, outcome: Outcome = Outcome.UNDECIDED, violated_at: float = np.nan
) -> Certificate:
    """Return a certificate that does not hold: undecided, or violated, at a frequency [rad/s] where one is known."""
    where = np.zeros((0, 2)) if np.isnan(violated_at) else np.full((1, 2), violated_at)
    return Certificate(subject=subject, outcome=outcome, level=level, method="", intervals=where, reason=reason)
