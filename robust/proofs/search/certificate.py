"""``Certificate``: a proof for every frequency, and how it was made."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.proofs.exact.verification import Verification

# without floating point
EXACT = "exact arithmetic"
SCALED_KYP = "scaled KYP"
GENERALISED_KYP = "generalised KYP"
PIECES = "scalings, each where it holds"  # exact too, but its claim is not kept


@value
class Certificate:
    """A proof of a bound and its method; or the reason why there is none.

    A loop with one input and one output is proved in exact arithmetic from the given matrices. A
    loop with several is proved by matrices that are checked over the rationals (scaled and
    generalised KYP); `verify` repeats the check. A proof by scalings, each where it holds, is exact
    too, but its claim is not kept. Any other outcome is judged in floating point, with slacks far
    above its rounding. A norm is the structured singular value for one full block.

    Fields
    ------
    subject : str
        Subject of the bound.
    outcome : Outcome
        "holds" only if the numbers were judged and passed; "violated" only if the bound was
        disproved; else "undecided".
    level : float
        The norm is below this level at every frequency.
    method : str
        "exact arithmetic", "scaled KYP" (P and X, see `robust.proofs.exact.scaled_kyp`) and
        "generalised KYP" (P, Q and X of every interval, see `robust.proofs.exact.interval_kyp`),
        all proved, rigorous; "periodic Riccati equation, Bernstein" (friction), or "".
    intervals : (I, 2) ndarray
        Frequency intervals [rad/s] of the proof; [0, inf] (or Nyquist) for a norm; the frequency of
        a violation.
    reason : str
        Reason why it does not hold, for people; empty if it does.
    claim : LoopClaim or another
        The claim with every number as given, for another proof; None for a proof without one (mu).
    again : callable, optional
        Function that proves the claim again: again(claim, time_cap=seconds).

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
        """True if the bound is proved."""
        return self.outcome is Outcome.HOLDS

    @property
    def violated(self) -> bool:
        """True if the bound fails at a known frequency."""
        return self.outcome is Outcome.VIOLATED

    @property
    def judged(self) -> str:
        """Arithmetic of the judgement: "proved, rigorous" to the last bit, or "judged in floating
        point".
        """
        exact = self.method in (EXACT, SCALED_KYP, GENERALISED_KYP, PIECES)
        return "proved, rigorous" if exact else "judged in floating point"

    def verify(self, *, time_cap: float = 60.0) -> Verification:
        """Prove the claim again with outward rounding, from the claim alone and without the search.

        Parameters
        ----------
        time_cap : float
            Seconds of processor time, after which the rest counts as not verified. The load of the
            machine has no effect.

        Returns
        -------
        Verification
            The claims that are "proved, rigorous", and the others with their reasons.

        References
        ----------
        F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic",
        2017.
        """
        if self.again is not None:
            return self.again(self.claim, time_cap=time_cap)
        reason = f"{self.judged}: its exact claim is not kept" if self.holds else self.reason
        return Verification(proved=(), failed=((self.subject, reason),))


def failed_certificate(
    subject: str,
    level: float,
    reason: str,
    *,
    outcome: Outcome = Outcome.UNDECIDED,
    violated_at: float = np.nan,
) -> Certificate:
    """Return a certificate that does not hold: undecided, or violated, with the frequency [rad/s]
    if it is known.
    """
    where = np.zeros((0, 2)) if np.isnan(violated_at) else np.full((1, 2), violated_at)
    return Certificate(
        subject=subject, outcome=outcome, level=level, method="", intervals=where, reason=reason
    )
