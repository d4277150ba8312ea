"""Files of claims on loops with several channels."""

from __future__ import annotations

from collections.abc import Mapping
from typing import ClassVar

from nlfrf._base.values import value
from robust.proofs.exact.folded_sets import FoldedClaim, decide_folded
from robust.proofs.exact.interval_kyp import IntervalClaim
from robust.proofs.exact.polynomials import Decision
from robust.proofs.exact.scaled_kyp import LEVEL, STABLE, ScaledClaim
from robust.proofs.exact.verification import Verification, summarise_claims


@value
class ChannelsClaim:
    """The claims of a file on a loop, by their subjects, with form and delay [s] of their set."""

    SCHEMA: ClassVar[str] = "robust-mu-certificate"
    UNITS: ClassVar[Mapping[str, str]] = {"dt": "s", "delay": "s"}
    LOOP: ClassVar[str] = (
        "q = N p, p = Delta q; N was put together from plant, weights and controller in floating"
        " point"
    )

    claims: dict[str, ScaledClaim | IntervalClaim | FoldedClaim]
    form: str
    delay: float


def verify_channels(given: ChannelsClaim) -> Verification:
    """Prove every claim of a file again, over the rationals or in balls rounded outward."""
    decided: dict[str, Decision] = {}
    for subject, claim in given.claims.items():
        if isinstance(claim, FoldedClaim):
            decided |= decide_folded(claim)
        else:
            found = claim.decide()
            decided |= {"nominal stability": found[STABLE], subject: found[LEVEL]}
    return summarise_claims(decided)
