"""``Certificate``: what was proved at every frequency, and how."""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.values import value
from robust._base.states import Outcome
from robust.proofs.exact.claim import LoopClaim
from robust.proofs.exact.loops import Verification, verify_loop
from robust.proofs.exact.scaled_kyp import ScaledClaim

if TYPE_CHECKING:
    import cvxpy

EXACT, SCALED_KYP, GENERALISED_KYP = "exact arithmetic", "scaled KYP", "generalised KYP"  # nothing in floating point


@value
class Certificate:
    """What was proved, how, and if not, why not.

    A loop with one input and one output is proved in exact arithmetic from the matrices as they were given, one with
    several by matrices that are checked over the rationals (scaled and generalised KYP); `verify` repeats that. Any
    other outcome is judged in floating point, with slacks far above its rounding. A norm is the structured singular
    value of one full block.

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
        How a claim of another kind is proved again: again(claim, time_cap=seconds).

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
        return "proved, rigorous" if self.method in (EXACT, SCALED_KYP, GENERALISED_KYP) else "judged in floating point"

    @property
    def P(self) -> np.ndarray | None:
        """Of a proof by "scaled KYP" the matrix P of the states of its claim, in doubles; None of another proof.

        x' P x is a storage function: the inequality of `robust.proofs.exact.scaled_kyp` holds with it, with the system
        and the scalings of the claim.
        """
        return self.claim.storage if isinstance(self.claim, ScaledClaim) else None

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
        if isinstance(self.claim, LoopClaim):
            return verify_loop(self.claim, time_cap=time_cap)
        if self.again is not None:
            return self.again(self.claim, time_cap=time_cap)
        reason = "judged in floating point only: no exact claim is kept of it" if self.holds else self.reason
        return Verification(verified=False, proved=(), failed=((self.subject, reason),), bits=0)


def failed_certificate(
    subject: str, level: float, reason: str, *, outcome: Outcome = Outcome.UNDECIDED, violated_at: float = np.nan
) -> Certificate:
    """Return a certificate that does not hold: undecided, or violated, at a frequency [rad/s] where one is known."""
    where = np.zeros((0, 2)) if np.isnan(violated_at) else np.full((1, 2), violated_at)
    return Certificate(subject=subject, outcome=outcome, level=level, method="", intervals=where, reason=reason)


# ---- Convex programs, solved under a time cap by solvers that may fail in any way.


SCS_STEPS = 20_000  # some seconds for 32 states


def solve_program(
    problem: cvxpy.Problem, solver: str, time_cap: float | None = None, *, eps: float = 1e-7, steps: int = SCS_STEPS
) -> str:
    """Solve a cvxpy problem. Empty where the solver came back, else what failed; what it found is for others to judge.

    problem : cvxpy.Problem; solver : its name there; time_cap : seconds, None: its steps are counted, not its time;
    eps, steps : tolerance of SCS, and how many steps it takes where no time caps it.
    """
    caps = {
        "CLARABEL": {} if time_cap is None else {"time_limit": time_cap},
        "SCS": {"eps": eps, **({"max_iters": steps} if time_cap is None else {"time_limit_secs": time_cap})},
    }
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # "may be inaccurate": it may well be
            problem.solve(solver=solver, **caps.get(solver, {}))
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:  # CLARABEL can panic with an exception that is no Exception
        return f"the solver {solver} failed: {type(error).__name__}" + (f": {error}" if str(error) else "")
    return ""


SOLVERS = ("CLARABEL", "SCS")
