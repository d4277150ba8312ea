"""A judged certificate and its claim, for a loop and the weights of a class of friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from robust._base.states import FrictionVerdict, Outcome
from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.classes import PortClaim
from robust.friction.exact.verify import verify_friction
from robust.friction.loop import FrictionLoop
from robust.friction.plant import FrictionPlant
from robust.friction.proof.protocol import FrictionCertificate, FrictionProof, ProofTask
from robust.friction.proof.settling import SettlingNumbers
from robust.friction.proof.storage import METHOD, JudgedStorage
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.search.certificate import Certificate, failed_certificate

# ---- From weights to a judged certificate for the friction of a class.

_SUBJECT = "the stored energy falls"
_SATURATED_SUBJECT = "the stored energy falls, the actuator saturated or not"
_SETTLING_SUBJECT = "the position settles within a bound"
_SETTLING_METHOD = "semidefinite program, Bernstein, exact arithmetic"


def certified_verdict(
    undecided: FrictionProof,
    task: ProofTask,
    search: Callable[[FrictionLoop, float], FrictionCertificate],
) -> FrictionProof:
    """Return the proof with the certificate that a search finds for the loop and a reference rate,
    if it finds one.
    """
    try:
        found = search(task.loop, reference_rate(task.machine, task.loop))
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return replace(undecided, reason=f"numerical failure: {error}")
    if found.energy is None:
        certificate = failed_certificate(_SUBJECT, 0.0, found.reason)
        return replace(undecided, reason=found.reason, certificate=certificate)
    claim = build_claim(task, found.ports, found.energy)
    return replace(undecided, verdict=FrictionVerdict.PROVED, certificate=certificate_of(claim))


def settled_by_bound(proof: FrictionProof) -> FrictionProof:
    """Return the bound for any friction as the result, if rest is not decided."""
    if proof.verdict is not FrictionVerdict.NOT_DECIDED or not np.isfinite(proof.error_bound):
        return proof
    return replace(proof, verdict=FrictionVerdict.SETTLES, settling_error=proof.error_bound)


def certificate_of(claim: FrictionClaim) -> Certificate:
    """Return the certificate of a judged claim: that the energy falls, or that the position settles
    within a bound.
    """
    settling, subject = claim.settling, _SUBJECT if claim.actuator is None else _SATURATED_SUBJECT
    return Certificate(
        subject=subject if settling is None else _SETTLING_SUBJECT,
        outcome=Outcome.HOLDS,
        level=0.0 if settling is None else settling.error,
        method=METHOD if settling is None else _SETTLING_METHOD,
        intervals=np.array([[0.0, np.inf]]),
        reason="",
        claim=claim,
        again=verify_friction,
    )


def build_claim(
    task: ProofTask, ports: tuple[PortClaim, ...], stored: JudgedStorage | SettlingNumbers
) -> FrictionClaim:
    """Return the claim of the certificate with all its numbers."""
    return FrictionClaim(
        machine=plant_matrices(task.machine),
        controller=to_matrices(task.K),
        delay=float(task.delay),
        ports=ports,
        V=stored.V,
        P=stored.P,
        counts=stored.counts,
    )


def plant_matrices(machine: FrictionPlant) -> Matrices:
    """Return the machine as a system from (force, force at each port) to (measured, displacement at
    each port).
    """
    inputs = np.column_stack([machine.B_force, machine.B_port])
    outputs = np.vstack([machine.C_measured, machine.C_port])
    return Matrices(
        A=machine.A, B=inputs, C=outputs, D=np.zeros((outputs.shape[0], inputs.shape[1]))
    )


def reference_rate(machine: FrictionPlant, loop: FrictionLoop) -> float:
    """Return the rate [rad/s] of the reference filter:

    1.5 times the resonance, or the median rate of the loop.
    """
    if machine.resonance:
        return 1.5 * machine.resonance
    poles = loop.poles()
    poles = poles[np.abs(poles) > 1e-6]
    if loop.T:
        rates = np.abs(np.log(poles.astype(complex))) / loop.T
    else:
        rates = np.abs(poles)
    return float(np.clip(np.median(rates), 1.0, 1e3))
