"""``Certificate``: a proof that holds at every frequency, with its method."""

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
    """A proof of a bound with its method, or the reason why there is no proof.

    A bound for a loop with one input and one output is proved in exact arithmetic from the given
    matrices. A bound for several channels is proved by matrices that satisfy an inequality, which
    is checked over the rationals (scaled and generalised KYP lemma); `verify` repeats the check. A
    proof by scalings on frequency intervals is exact, too, but the certificate does not contain
    what `verify` needs. Any other outcome is judged in floating point, with tolerances far above
    the rounding errors.

    Fields
    ------
    subject : str
        Subject of the bound.
    outcome : Outcome
        "holds" only if the bound is proved; "violated" only if it is disproved; otherwise
        "undecided".
    level : float
        Level of the claim: the norm (H-infinity norm or mu) is below this level at every frequency.
    method : str
        Rigorous methods are "exact arithmetic", "scaled KYP" (with matrices P and X, see
        `robust.proofs.exact.scaled_kyp`) and "generalised KYP" (with P, Q and X for every frequency
        interval, see `robust.proofs.exact.interval_kyp`). For friction the method is "periodic
        Riccati equation, Bernstein". Empty without a method.
    intervals : (I, 2) ndarray
        Frequency intervals [rad/s] of the proof; for a norm one interval, from 0 to inf (or to
        the Nyquist frequency). For a violated bound, the frequency of the violation.
    reason : str
        Reason why the bound is not proved, as text; empty if it is proved.
    claim : LoopClaim or another
        The claim with every number as given, from which `verify` proves it again; None if it is not
        kept.
    again : callable, optional
        Function behind `verify`, called as again(claim, time_cap=seconds).

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
        """Arithmetic of the result: "proved, rigorous" or "judged in floating point"."""
        exact = self.method in (EXACT, SCALED_KYP, GENERALISED_KYP, PIECES)
        if exact:
            return "proved, rigorous"
        return "judged in floating point"

    def verify(self, *, time_cap: float = 60.0) -> Verification:
        """Prove the claim again with outward rounding, without the search for the proof.

        Parameters
        ----------
        time_cap : float
            Processor time [s] after which the remaining claims count as not verified.

        Returns
        -------
        Verification
            The claims that are "proved, rigorous", and the other claims with their reasons.

        References
        ----------
        F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic",
        2017.
        """
        if self.again is not None:
            return self.again(self.claim, time_cap=time_cap)
        if self.holds:
            reason = f"{self.judged}: its exact claim is not kept"
        else:
            reason = self.reason
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
    if np.isnan(violated_at):
        where = np.zeros((0, 2))
    else:
        where = np.full((1, 2), violated_at)
    return Certificate(
        subject=subject, outcome=outcome, level=level, method="", intervals=where, reason=reason
    )
