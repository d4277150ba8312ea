"""Multiplier weights, a judged certificate, and its claim, for a loop and a class of friction."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import control
import numpy as np

from nlfrf._base.values import value
from robust._base.states import FrictionVerdict, Outcome
from robust.friction.classes import AnyFriction, FrictionAtPorts
from robust.friction.exact.claim import FrictionClaim, PortClass, Settling
from robust.friction.exact.verify import verify_friction
from robust.friction.plant import (
    FrictionLoop,
    FrictionPlant,
    loop_frequencies,
    mobility,
)
from robust.friction.proof.dissipation import ROUNDED_UP, bristle_dissipation, maxwell_slip_dissipation
from robust.friction.proof.multipliers import (
    Multipliers,
    bristle_multipliers,
    bristle_terms,
    filter_rates,
    used_multipliers,
)
from robust.friction.proof.ports import (
    coupling_of_rests,
    weights_of_ports,
)
from robust.friction.proof.settling import SettlingNumbers, largest_rest, settling_numbers
from robust.friction.proof.storage import METHOD, JudgedStorage, certified_dissipation
from robust.friction.units import MechanicalUnits, format_length
from robust.lti.lti import timebase
from robust.pages.section import Fact
from robust.pages.text import format_facts
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.search.certificate import Certificate, failed_certificate

# ---- From weights to a judged certificate for the friction of a class.

_SUBJECT = "the stored energy falls"
_SATURATED_SUBJECT = "the stored energy falls, the actuator saturated or not"
_N_POINTS = 300  # of the frequencies of a cone program


class _FrictionCertificate(NamedTuple):
    """The numbers that prove that the energy of a loop falls; or the last failure, in `reason`.

    numbers : weights of the filters, one entry a port. A `FrictionClaim` needs them beside loop, class and energy.
    """

    reason: str
    numbers: tuple[Multipliers, ...] = ()
    energy: JudgedStorage | None = None


def certify_friction(
    loop: FrictionLoop, friction: AnyFriction | FrictionAtPorts, reference: float
) -> _FrictionCertificate:
    """Prove that the energy of the loop falls with every friction of the class; otherwise give the last failure.

    reference : rate of the reference filter of Maxwell slip, to which the other filters are compared [rad/s].
    """
    if isinstance(friction, AnyFriction) and friction.kind == "bristle":
        return _certify_bristle(loop, friction, reference)
    K0, rho = np.atleast_1d(friction.K0), np.atleast_1d(friction.stiction)
    n_ports = loop.columns.shape[1]
    omega = loop_frequencies(loop, _N_POINTS if n_ports > 1 else 900)
    response = mobility(loop, omega).reshape(omega.size, n_ports, n_ports)
    wrong, balanced = coupling_of_rests(loop) if n_ports > 1 else ("", False)
    if wrong:
        return _FrictionCertificate(wrong)
    reason = "no multiplier weights make the loop dissipate at every frequency"
    fastest = 1 / friction.bristle_time if friction.bristle_time else np.inf
    for rates in filter_rates(reference, fastest):
        mu = weights_of_ports(response, omega, rates=rates, K0=K0, rho=rho, balanced=balanced)
        if mu is None:
            continue
        reason, energy = certified_dissipation(maxwell_slip_dissipation(loop, rates, mu=mu, K0=K0, rho=rho))
        if not reason:
            return _FrictionCertificate("", tuple(used_multipliers(rates, own) for own in mu), energy)
    return _FrictionCertificate(reason)


def _certify_bristle(loop: FrictionLoop, friction: AnyFriction, reference: float) -> _FrictionCertificate:
    """Search multipliers for creeping bristles, and certify them."""
    known = {"K0": friction.K0, "microdamping": friction.microdamping}
    omega = loop_frequencies(loop, _N_POINTS)
    response = mobility(loop, omega)
    reason = "no multiplier weights make the loop dissipate at every frequency"
    for rates in filter_rates(reference, np.inf)[:2]:
        table = bristle_terms(response, omega, rates=rates, **known)
        weights = bristle_multipliers(table, rates, friction.stiction)
        if weights is None:
            continue
        reason, energy = certified_dissipation(bristle_dissipation(loop, weights, **known))
        if not reason:
            return _FrictionCertificate("", (weights,), energy)
    return _FrictionCertificate(reason)


_SETTLING_SUBJECT = "the position settles within a bound"
_SETTLING_METHOD = "semidefinite program, Bernstein, exact arithmetic"
_SETTLING_ROUNDED_UP = 1 + 1e-9
NOT_IN_CLASS = {
    "bristle": "rigid stiction, another damping of the bristles, ",
    "Maxwell slip": "a law that creeps below break-away (LuGre, Dahl, Leuven), rigid stiction, ",
    "bounded": "a viscous part of the friction, ",
    "passive": "LuGre with less damping than sigma1 (Fs - Fc)/Fc, ",
}


@value
class FrictionProof:
    """A proof, or its absence, for a loop around a machine with friction, for a whole class of friction laws.

    Fields
    ------
    verdict : FrictionVerdict
        "proved": with every friction of the class, from every state, after any disturbance that ends, the machine comes
        to rest, with integral action at its set point. "refuted": a named member of the class makes the loop unstable.
        This concerns the class and not the machine: its friction may be another member. "settles": rest is not decided,
        but with every friction of the class of at most Fs the position stays within `settling_error` in the end.
        "not decided": none of these.
    claim, not_claimed, reason : str
        What is proved, in one sentence; what is not proved; the reason for the verdict.
    machine : FrictionPlant
        The linear plant.
    friction : AnyFriction or FrictionAtPorts
        The class.
    counterexample : tuple of (float, complex) or None
        Stiffness [N/m] of a spring, which is a friction that never slips, and the pole that it puts outside the stable
        region. For several ports: a tuple with one stiffness each.
    error_bound : float
        Largest distance of the position from rest in the end with any friction of at most Fs [m] (for several ports: of
        each displacement there). nan if no Fs was given, if the sliding loop is not stable, or if its modes are too
        fast for its clock or too slow to compute.
    settling_error : float
        Largest distance of the position from rest in the end with every friction of the class of at most Fs [m]: the
        smaller of a bound for the class, which `certificate.verify()` proves over the rationals, and `error_bound`,
        which is computed in floating point. nan if no Fs was given, if the loop comes to rest, or if there is none.
    kick_sure : float
        Velocity [m/s] from which the machine diverges with every friction of at most Fs; nan if no Fs was given, if the
        sliding loop is stable, or if none was found.
    certificate : Certificate or None
        The judged certificate, if there is one; `certificate.verify()` proves it again over the rationals.
    saturation : float
        Largest force of the actuator [N]; infinite if none was given.
    kick : float
        Largest proved initial velocity at the friction port [m/s]: from rest, with no force in the springs of the
        friction, the machine comes to rest again although its actuator saturates. Infinite if it does so from every
        state, zero if none is proved, nan without saturation. With saturation `verdict` is "proved" (from every state)
        or "proved up to a kick" (nothing is claimed beyond it).
    kick_linear : float
        Initial velocity up to which the actuator does not saturate [m/s].
    share : float
        Sector gain of the proof: the fraction of the commanded force, without the part that holds the friction, that
        the actuator may fail to deliver. One if it may fail to deliver all of it, zero if it never saturates.

    References
    ----------
    A. Rantzer, *Friction analysis based on integral quadratic constraints*, Int. J. Robust Nonlinear Control 11, 2001;
    A. Bisoffi, M. Da Lio, A. Teel, L. Zaccarian, IEEE Trans. Automatic Control 63, 2018 (PID and Coulomb friction).

    Examples
    --------
    >>> import control
    >>> from robust.friction import any_maxwell_slip
    >>> from robust import prove_friction, friction_plant
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_friction(friction_plant(1.0, 80e3, 0.4), PD, any_maxwell_slip(64e3))
    >>> proof.verdict, proof.counterexample
    ('proved', None)
    >>> from nlfrf.rig import Drive
    >>> from robust.servo import cascade
    >>> K = cascade(Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04), output_unit="N")
    >>> proof = prove_friction(friction_plant(1.0, 0.0), K, any_maxwell_slip(1e5, 2.0), Fs=1.0)
    >>> proof.verdict, bool(proof.settling_error < 0.8 * proof.error_bound)
    ('settles', True)
    """

    verdict: FrictionVerdict
    claim: str
    not_claimed: str
    reason: str
    machine: FrictionPlant
    friction: AnyFriction | FrictionAtPorts
    counterexample: tuple[float | tuple[float, ...], complex] | None = None
    error_bound: float = np.nan
    settling_error: float = np.nan
    kick_sure: float = np.nan
    certificate: Certificate | None = None
    saturation: float = np.inf
    kick: float = np.nan
    kick_linear: float = np.nan
    share: float = np.nan

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Return the verdict with its claim, what is left open, the bound for any friction, and what is not claimed."""
        settles, bounded = self.verdict is FrictionVerdict.SETTLES, np.isfinite(self.error_bound)
        kick = f"certain after a kick of {self.kick_sure:.3g} {self.units.velocity}"
        return (
            Fact(self.verdict, self.claim or self.reason),
            Fact("rest not decided" if settles else "because", self.reason if self.claim else ""),
            Fact(
                "any friction",
                format_length(self.error_bound, self.units.position) if bounded else "",
                meaning="largest distance in the end, at rest or hunting, up to the given force; proportional to it",
            ),
            Fact("runs away", kick if np.isfinite(self.kick_sure) else ""),
            Fact("not claimed", self.not_claimed),
        )

    def __str__(self) -> str:
        return format_facts(self.facts)

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, velocity, force, stiffness and damping."""
        return self.machine.units


def certified_verdict(
    undecided: FrictionProof, K: control.StateSpace, *, delay: float, loop: FrictionLoop
) -> FrictionProof:
    """Return the proof, if one is found, of a loop that no spring of the class makes unstable."""
    machine, friction = undecided.machine, undecided.friction
    try:
        found = certify_friction(loop, friction, reference_rate(machine, loop))
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return replace(undecided, reason=f"numerical failure: {error}")
    if found.energy is None:
        certificate = failed_certificate(_SUBJECT, 0.0, found.reason)
        return replace(undecided, reason=found.reason, certificate=certificate)
    claim = build_claim(machine, K, delay=delay, friction=friction, numbers=found.numbers, stored=found.energy)
    return replace(undecided, verdict=FrictionVerdict.PROVED, certificate=certificate_of(claim))


def settling_verdict(
    undecided: FrictionProof, K: control.StateSpace, *, delay: float, loop: FrictionLoop, forces: np.ndarray
) -> FrictionProof:
    """Return a proof of a bound on the position: over the rationals, or else `error_bound` for any friction.

    forces : (P,) the largest friction force at each port.
    """
    machine, friction, error_bound = undecided.machine, undecided.friction, undecided.error_bound
    any_friction = undecided
    if np.isfinite(error_bound):
        any_friction = replace(undecided, verdict=FrictionVerdict.SETTLES, settling_error=error_bound)
    if friction.kind != "Maxwell slip" or friction.bristle_time or not loop.growth() < 0:
        return any_friction
    stiffest, ratios = np.atleast_1d(friction.K0), np.atleast_1d(friction.stiction)
    rests = np.array([largest_rest(Fs, ratio) for Fs, ratio in zip(forces, ratios, strict=True)])
    most = rests.max()
    try:
        shares = rests / most if most else np.ones(rests.size)
        proposed = settling_numbers(loop, stiffest, reference_rate(machine, loop), shares)
        still, off = (part.reshape(-1, forces.size) for part in loop.rest())
    except (np.linalg.LinAlgError, ValueError, FloatingPointError):
        return any_friction
    moved = np.abs(loop.displacements @ still) + np.abs(loop.displacements) @ off
    held = moved @ ((1 + 1 / ratios) / 2 * forces)
    for one in proposed:
        # a bound of zero, for a rest of zero and a stiction of one, could not be claimed
        error = max(float((one.reach * most + held).max()) * _SETTLING_ROUNDED_UP, 1e-300)
        numbers = tuple(Multipliers(rates=one.rates, weights=own, free=0.0) for own in one.weights)
        own_settling = Settling(
            decay=one.decay, Fs=float(forces[0]), error=error, other_Fs=forces[1:], rest_weights=one.rest_weights
        )
        exact = replace(
            build_claim(machine, K, delay=delay, friction=friction, numbers=numbers, stored=one), settling=own_settling
        )
        if verify_friction(exact).verified:
            smaller, proved = error_bound if error_bound < error else error, certificate_of(exact)
            return replace(undecided, verdict=FrictionVerdict.SETTLES, settling_error=smaller, certificate=proved)
    return any_friction


def certificate_of(claim: FrictionClaim) -> Certificate:
    """Return the certificate of a judged claim: that the energy falls, or that the position settles within a bound."""
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
    machine: FrictionPlant,
    K: control.StateSpace,
    *,
    delay: float,
    friction: AnyFriction | FrictionAtPorts,
    numbers: tuple[Multipliers, ...],
    stored: JudgedStorage | SettlingNumbers,
) -> FrictionClaim:
    """Return the claim of the certificate with all its numbers; `numbers` has one entry a port."""
    classes = friction.ports if isinstance(friction, FrictionAtPorts) else (friction,)
    first, *others = (
        PortClass(
            K0=float(np.nan_to_num(one.K0)),
            stiction=max(one.stiction, ROUNDED_UP)
            if one.kind == "Maxwell slip"
            else float(np.nan_to_num(one.stiction)),
            bristle_time=float(np.nan_to_num(one.bristle_time)),
            free=own.free,
            rates=own.rates,
            weights=own.weights,
        )
        for one, own in zip(classes, numbers, strict=True)
    )
    return FrictionClaim(
        machine=plant_matrices(machine),
        controller=to_matrices(K),
        delay=float(delay),
        kind=friction.kind,
        K0=first.K0,
        stiction=first.stiction,
        bristle_time=first.bristle_time,
        microdamping=classes[0].microdamping,
        rates=first.rates,
        weights=first.weights,
        free=first.free,
        block=numbers[0].block,
        bounds=numbers[0].bounds,
        V=stored.V,
        P=stored.P,
        counts=stored.counts,
        other_ports=tuple(others),
    )


def plant_matrices(machine: FrictionPlant) -> Matrices:
    """Return the machine as a system from (force, force at each port) to (measured, displacement at each port)."""
    inputs = np.column_stack([machine.B_force, machine.B_port])
    outputs = np.vstack([machine.C_measured, machine.C_port])
    return Matrices(A=machine.A, B=inputs, C=outputs, D=np.zeros((outputs.shape[0], inputs.shape[1])))


def reference_rate(machine: FrictionPlant, loop: FrictionLoop) -> float:
    """Return the rate [rad/s] of the reference filter: 1.5 times the resonance, or the median rate of the loop."""
    if machine.resonance:
        return 1.5 * machine.resonance
    poles = loop.poles()
    poles = poles[np.abs(poles) > 1e-6]
    rates = np.abs(np.log(poles.astype(complex))) / loop.T if loop.T else np.abs(poles)
    return float(np.clip(np.median(rates), 1.0, 1e3))


def describe_scope(
    machine: FrictionPlant, friction: AnyFriction | FrictionAtPorts, *, K: control.StateSpace, delay: float
) -> str:
    """Describe friction, machine and sampling time for which a claim holds."""
    dt = timebase(K)
    clock = f"sampled at {1 / dt / 1e3:.4g} kHz" if dt else "with a continuous controller"
    late = f" with {1e3 * delay:.4g} ms of delay" if delay else ""
    return f"with every {friction.description}, for the linear part {machine.description}, {clock}{late}"
