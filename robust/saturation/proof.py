"""A proof for a machine with friction whose actuator saturates: from every state, or up to a kick."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.values import value
from robust.certificates.certificate import Certificate
from robust.friction_proof.certify import certify
from robust.friction_proof.classes import AnyFriction
from robust.friction_proof.proof import OTHER, claimed, prove_friction, reference_rate, scope
from robust.friction_verification.claim import Actuator, FrictionClaim
from robust.friction_verification.verify import verify_friction
from robust.saturation.loop import CutLoop, cut_open
from robust.saturation.search import Reach, kick_of, reaches
from robust.shared.states import FrictionVerdict, Outcome
from robust.sliding.machine import SlidingMachine, separate_delay
from robust.storage.search import METHOD
from robust.systems.realisation import state_space

__all__ = ["SaturatedProof", "prove_saturated"]

SUBJECT = "the stored energy falls, the actuator saturated or not"
NOT_CLAIMED = (
    "Not claimed: {other}friction above {Fs:g} N, an actuator of less than {limit:g} N, quantisation, another linear "
    "part."
)
NOTHING = "Not claimed: anything with an actuator that saturates."


@value
class SaturatedProof:
    """What is proved of a loop around a machine with friction whose actuator saturates.

    Fields
    ------
    verdict : FrictionVerdict
        "proved": from every state. "proved up to a kick": from rest, relaxed, up to `kick`; beyond it nothing is said.
        "refuted": without saturation already, of the class and not of the machine. "not decided".
    claim, not_claimed, reason : str
        What is proved, in one sentence; what is not; why the verdict is what it is.
    friction : AnyFriction
        The class.
    Fs, limit : float
        Largest friction force and largest force of the actuator [N].
    kick : float
        Velocity at the friction port [m/s] of a kick on the machine at rest and relaxed, up to which it comes to rest;
        infinite where it does from every state, zero where no kick is proved.
    kick_linear : float
        The part of it up to which the actuator never saturates at all [m/s].
    share : float
        What of the force that is asked for, less what holds the friction, the actuator may miss on the way; one where
        it may miss all of it, zero where it never saturates.
    certificate : Certificate or None
        What was judged; `certificate.verify()` proves it again over the rationals. With a share of zero that of the
        loop that does not saturate.

    References
    ----------
    S. Tarbouriech, G. Garcia, J. Gomes da Silva, I. Queinnec, *Stability and Stabilization of Linear Systems with
    Saturating Actuators*, Springer, 2011 (sectors that hold on a region).

    Examples
    --------
    >>> from robust import any_maxwell_slip, sliding_machine
    >>> rig = sliding_machine(1.0, 80e3, 40.0)
    >>> prove_saturated(rig, 1e3, any_maxwell_slip(64e3), Fs=1.0, limit=20.0).verdict
    'proved'
    """

    verdict: FrictionVerdict
    claim: str
    not_claimed: str
    reason: str
    friction: AnyFriction
    Fs: float
    limit: float
    kick: float
    kick_linear: float
    share: float
    certificate: Certificate | None

    def __str__(self) -> str:
        said = self.claim if self.verdict.is_proved else self.reason
        more = [self.reason] if self.verdict.is_proved and self.reason else []
        return "\n".join([f"{self.verdict}: {said}", *more, self.not_claimed])


def prove_saturated(
    machine: SlidingMachine, K: Any, friction: AnyFriction, *, Fs: float, limit: float, delay: float = 0.0
) -> SaturatedProof:
    """Prove that a loop comes to rest with every friction of a class though its actuator saturates, or up to a kick.

    Parameters
    ----------
    machine : SlidingMachine
        The linear part, from `sliding_machine`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y), without anti-windup; sampled, or continuous and proper.
    friction : AnyFriction
        The class: `any_maxwell_slip`; of `any_bristle` only how far the actuator never saturates.
    Fs : float
        Largest friction force [N].
    limit : float
        Largest force of the actuator [N], more than Fs.
    delay : float
        From sampling to the force changing [s].

    Returns
    -------
    SaturatedProof
        A numerical failure is "not decided", with its reason.

    Raises
    ------
    ValueError
        As `prove_friction`; another class; a limit that is not above Fs.

    References
    ----------
    Tarbouriech and others, 2011; P. Park, *Stability criteria of sector- and slope-restricted Lur'e systems*, IEEE
    Trans. Automatic Control 47, 2002.

    Examples
    --------
    >>> import control
    >>> from robust import any_maxwell_slip, sliding_machine
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_saturated(sliding_machine(1.0, 80e3, 0.4), PD, any_maxwell_slip(64e3), Fs=1.0, limit=20.0)
    >>> proof.verdict, proof.kick > 2 * proof.kick_linear
    ('proved up to a kick', True)
    """
    Fs, limit = positive("Fs", Fs), positive("limit", limit)
    if not limit > Fs:
        raise ValueError(f"limit must be above Fs, the largest friction force, got {limit:g} N and Fs = {Fs:g} N")
    plain = prove_friction(machine, K, friction, delay=delay)
    machine, delay = separate_delay(machine, delay)
    if friction.kind not in ("Maxwell slip", "bristle"):
        raise ValueError(f"friction must be any_maxwell_slip(...) or any_bristle(...), got {friction.words}")
    known: dict[str, Any] = {"friction": friction, "Fs": Fs, "limit": limit}
    if plain.verdict is not FrictionVerdict.PROVED:
        return nothing(plain.verdict, f"without saturation: {plain.reason}", known)
    K = state_space("K", K)
    cut = cut_open(machine, K, delay)
    rest, offset = cut.loop.rest()
    left = limit - Fs * float(abs(cut.asked @ rest) + np.abs(cut.asked) @ offset)
    if left <= 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "holding the friction takes all of the limit", known)
    if not machine.velocity @ machine.B_port > 0:
        return nothing(FrictionVerdict.NOT_DECIDED, "a kick at the friction port moves no velocity at once", known)
    try:
        linear = certify(cut.loop, friction, reference_rate(machine, cut.loop)).energy
        kick_linear = 0.0 if linear is None else kick_of(machine, cut, linear, left)
        reach = reaches(machine, K, friction, delay, left) if friction.kind == "Maxwell slip" else None
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return nothing(FrictionVerdict.NOT_DECIDED, f"numerical failure: {error}", known)
    everywhere = np.isinf(kick_linear) or (reach is not None and reach.share == 1)
    certificate, kick, share = plain.certificate, kick_linear, 0.0
    if reach is not None and reach.kick > kick_linear:
        exact = claimed(machine, K, delay, friction, reach.numbers)
        certificate, kick, share = certificate_of(exact, reach, known), reach.kick, reach.share
    return SaturatedProof(
        verdict=FrictionVerdict.PROVED if everywhere else FrictionVerdict.PROVED_LOCALLY,
        claim=claim(np.inf if everywhere else kick, scope(machine, friction, K, delay), Fs, limit),
        reason="" if everywhere else why_local(cut, friction),
        not_claimed=NOT_CLAIMED.format(other=OTHER[friction.kind], Fs=Fs, limit=limit),
        kick=kick,
        kick_linear=kick_linear,
        share=share,
        certificate=certificate,
        **known,
    )


def nothing(verdict: FrictionVerdict, reason: str, known: dict[str, Any]) -> SaturatedProof:
    """Nothing is proved with the actuator."""
    numbers: dict[str, Any] = {"kick": 0.0, "kick_linear": 0.0, "share": 0.0, "certificate": None}
    return SaturatedProof(verdict=verdict, claim="", not_claimed=NOTHING, reason=reason, **numbers, **known)


def certificate_of(claim: FrictionClaim, reach: Reach, known: dict[str, Any]) -> Certificate:
    """What was judged, with the actuator in it."""
    kick = reach.kick if np.isfinite(reach.kick) else 0.0
    limits: dict[str, float] = {"limit": known["limit"], "Fs": known["Fs"], "kick": kick, "share": reach.share}
    actuator = Actuator(sector=reach.sector, forgets=reach.forgets, weights=reach.weights, **limits)
    return Certificate(
        subject=SUBJECT,
        outcome=Outcome.HOLDS,
        level=0.0,
        method=METHOD,
        intervals=np.array([[0.0, np.inf]]),
        reason="",
        claim=replace(claim, actuator=actuator),
        again=verify_friction,
    )


def claim(kick: float, scope: str, Fs: float, limit: float) -> str:
    """What is proved, in one sentence: from every state where the kick is infinite, else up to that kick."""
    rest = "Comes to rest from every state"
    if np.isfinite(kick):
        hit = f"a kick of at most {1e3 * kick:.3g} mm/s at the friction port"
        rest = f"At rest and relaxed, comes to rest again after {hit}"
    return f"{rest} {scope}, with an actuator of {limit:g} N and friction of at most {Fs:g} N."


def why_local(cut: CutLoop, friction: AnyFriction) -> str:
    """Why it is not proved from every state."""
    if friction.kind != "Maxwell slip":
        return f"From every state: not tried for a {friction.kind}; the kick is one that never saturates the actuator."
    if cut.open_growth() < 0:
        return "From every state: no weights were found for all that an actuator may miss."
    return (
        "From every state: not to be had by a quadratic energy. With the actuator at its limit the loop is open and "
        "does not come to rest by itself (a controller that integrates without anti-windup, a machine without damping)."
    )
