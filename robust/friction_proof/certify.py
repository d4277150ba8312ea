"""From weights to a judged certificate for the friction of a class, up to the stiffest that is proved."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.shared.values import value
from robust.certificates.certificate import Certificate, refused
from robust.friction_proof.bristle_dissipation import bristle_dissipation
from robust.friction_proof.bristle_multipliers import bristle_rows, bristle_weights, largest_share
from robust.friction_proof.classes import AnyFriction
from robust.friction_proof.dissipation import maxwell_slip_dissipation
from robust.friction_proof.multipliers import filter_rates, rows, weights
from robust.shared.states import Outcome
from robust.sliding.loop import SlidingLoop
from robust.sliding.response import frequencies, mobility
from robust.sliding.springs import unstable_spring
from robust.storage.search import METHOD, Energy, certified_dissipation

__all__ = ["FrictionCertificate", "certify", "certify_maxwell_slip", "proved_limits"]

SUBJECT = "the stored energy falls"
N_POINTS = 300  # of the frequencies of a cone program

WITHIN = 1.02  # ratio of the two ends where a bisection stops
LARGEST = 64.0  # times what was asked


@value
class FrictionCertificate:
    """What was proved, with the weights it was proved with.

    Fields
    ------
    certificate : Certificate
    multipliers : (2, J) ndarray
        Rates a_j [rad/s] (zero for the weight of f v) and weights mu_j.
    omega, form : (W,) ndarray
        The integrand with these weights over frequency [rad/s], over its largest part.
    numbers : dict or None
        Where it holds: all that a `FrictionClaim` needs besides loop, class and energy.
    energy : Energy or None
    """

    certificate: Certificate
    multipliers: np.ndarray
    omega: np.ndarray
    form: np.ndarray
    numbers: dict[str, Any] | None
    energy: Energy | None


def certify(loop: SlidingLoop, friction: AnyFriction, reference: float, *, quick: bool = False) -> FrictionCertificate:
    """Prove that the energy of the loop falls with every friction of the class, or say what failed last.

    reference : rate of the filter that the others of Maxwell slip are measured against [rad/s]. Quick: with the first
    set of filters only, and without the finest intervals.
    """
    if friction.kind == "bristle":
        return certify_bristle(loop, friction.K0, friction.stiction, friction.microdamping, reference, quick=quick)
    return certify_maxwell_slip(loop, friction.K0, friction.stiction, friction.bristle_time, reference, quick=quick)


def certify_maxwell_slip(
    loop: SlidingLoop, K0: float, rho: float, bristle_time: float, reference: float, *, quick: bool = False
) -> FrictionCertificate:
    """Prove that the energy of the loop falls with every friction of the class, or say what failed last.

    Quick: with the first set of filters only, and without the finest intervals.
    """
    omega = frequencies(loop)
    response = mobility(loop, omega)
    reason = "no weights of the filters make every frequency dissipate"
    fastest = 1 / bristle_time if bristle_time else np.inf
    found = np.zeros((2, 0))
    form = np.full(omega.size, np.nan)
    for rates in filter_rates(reference, fastest)[: 1 if quick else None]:
        table = rows(response, omega, rates, K0, rho)
        mu, share = weights(table)
        if not share > 0 or not (mu[1:] > 0).any():
            continue
        mu[mu < 1e-9 * mu.max()] = 0
        found = np.vstack([np.append(0.0, rates), mu])[:, mu > 0]
        form = table @ mu / np.abs(table * mu).max(axis=1)
        reason, energy = certified_dissipation(maxwell_slip_dissipation(loop, rates, mu, K0, rho), quick)
        if not reason:
            used = np.append(True, mu[2:] > 0)
            numbers = {"rates": rates[used], "weights": mu[1:][used], "free": float(mu[0]), **nothing_of_bristles()}
            return outcome("", found, omega, form, numbers, energy)
    return outcome(reason, found, omega, form)


def certify_bristle(
    loop: SlidingLoop, K0: float, rho: float, microdamping: float, reference: float, *, quick: bool = False
) -> FrictionCertificate:
    """The same of bristles that creep."""
    omega = frequencies(loop, N_POINTS)
    response = mobility(loop, omega)
    reason, found, form = "no weights make every frequency dissipate", np.zeros((2, 0)), np.full(omega.size, np.nan)
    for rates in filter_rates(reference, np.inf)[: 1 if quick else 2]:
        table = bristle_rows(response, omega, rates, K0, microdamping)
        weights = bristle_weights(table, rho)
        if weights is None:
            continue
        chosen = np.concatenate([[weights.mu], weights.nu])
        found = np.vstack([np.append(0.0, rates), chosen])[:, chosen > 0]
        form = largest_share(table, weights)
        reason, energy = certified_dissipation(bristle_dissipation(loop, rates, weights, K0, microdamping), quick)
        if not reason:
            used = weights.nu > 0
            numbers = {"rates": rates[used], "weights": weights.nu[used], "free": weights.mu}
            numbers |= {"block": weights.block, "bounds": weights.bounds}
            return outcome("", found, omega, form, numbers, energy)
    return outcome(reason, found, omega, form)


def nothing_of_bristles() -> dict[str, np.ndarray]:
    """What Maxwell slip leaves empty."""
    return {"block": np.zeros((0, 0)), "bounds": np.zeros(0)}


def outcome(
    reason: str,
    found: np.ndarray,
    omega: np.ndarray,
    form: np.ndarray,
    numbers: dict[str, Any] | None = None,
    energy: Energy | None = None,
) -> FrictionCertificate:
    """What was proved, where no reason speaks against it."""
    intervals = np.array([[0.0, np.inf]])
    proof = Certificate(
        subject=SUBJECT, outcome=Outcome.HOLDS, level=0.0, method=METHOD, intervals=intervals, reason=""
    )
    certificate = refused(SUBJECT, 0.0, reason) if reason else proof
    return FrictionCertificate(
        certificate=certificate, multipliers=found, omega=omega, form=form, numbers=numbers, energy=energy
    )


def proved_limits(loop: SlidingLoop, friction: AnyFriction, reference: float) -> tuple[float, float]:
    """Largest K0 at this rho, and largest rho at this K0, that a proof was found for; both are proved as they stand."""

    def proved(**changed: float) -> bool:
        other = replace(friction, **changed)  # type: ignore[arg-type]
        if unstable_spring(loop, other.K0, other.damper) is not None:
            return False
        return certify(loop, other, reference, quick=True).certificate.holds

    return (
        friction.K0 * largest(lambda ratio: proved(K0=ratio * friction.K0)),
        friction.stiction * largest(lambda ratio: proved(stiction=ratio * friction.stiction)),
    )


def largest(holds: Callable[[float], bool]) -> float:
    """Largest ratio from one on that holds, as a bisection finds it; at most `LARGEST`."""
    low = 1.0
    high = 2.0
    while high <= LARGEST and holds(high):
        low, high = high, 2 * high
    if high > LARGEST:
        return low
    while high / low > WITHIN:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low
