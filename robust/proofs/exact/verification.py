"""``Verification``: the proved claims, the failed claims, and the reasons."""

from __future__ import annotations

from nlfrf._base.arguments import format_hertz
from nlfrf._base.values import value
from robust.proofs.exact.polynomials import Decision


@value
class Verification:
    """Result of a proof with outward rounding, claim by claim.

    Fields
    ------
    proved : tuple of str
        The proved claims.
    failed : tuple of (str, str)
        The claims that are not proved, and the reason of each, for people.
    violated : tuple of str
        The failed claims that are proved false; the other failed claims are undecided.
    warnings : tuple of str
        Warnings in the certificate about its model, which no proof uses.

    References
    ----------
    F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE
    Trans. Computers, 2017.

    Examples
    --------
    >>> print(Verification(proved=("nominal stability",), failed=(("norm", "too large"),)))
    nominal stability: proved, rigorous
    norm: NOT verified: too large
    """

    proved: tuple[str, ...]
    failed: tuple[tuple[str, str], ...]
    violated: tuple[str, ...] = ()
    warnings: tuple[str, ...] = ()

    @property
    def verified(self) -> bool:
        """True if every claim is proved, rigorously."""
        return not self.failed

    def __str__(self) -> str:
        lines = [f"{claim}: proved, rigorous" for claim in self.proved]
        lines += [f"{claim}: NOT verified: {reason}" for claim, reason in self.failed]
        return "\n".join(lines + [f"warning: {text}" for text in self.warnings])


def summarise_claims(decided: dict[str, Decision]) -> Verification:
    """Return the verification of decisions, claim by claim."""
    return Verification(
        proved=tuple(name for name, found in decided.items() if found.holds),
        failed=tuple(
            (name, _describe_failure(found)) for name, found in decided.items() if not found.holds
        ),
        violated=tuple(name for name, found in decided.items() if found.violated),
    )


def _describe_failure(found: Decision) -> str:
    if found.violated_at >= 0:
        return f"violated at {format_hertz(found.violated_at)}"
    return found.reason
