"""Weights of the filters, a judged certificate, and the claim it makes, of a loop and a class of friction."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import field, replace
from typing import Protocol

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
    destabilizing_stiffness,
    loop_frequencies,
    mobility,
)
from robust.friction.proof.dissipation import ROUNDED_UP, bristle_dissipation, maxwell_slip_dissipation
from robust.friction.proof.multipliers import (
    bristle_multipliers,
    bristle_terms,
    filter_rates,
    largest_share,
    maxwell_slip_multipliers,
    multiplier_terms,
)
from robust.friction.proof.ports import (
    coupling_of_rests,
    weights_of_ports,
)
from robust.friction.proof.settling import largest_rest, settling_numbers
from robust.friction.proof.storage import METHOD, JudgedStorage, certified_dissipation
from robust.lti.lti import timebase
from robust.proofs.exact.claim import Matrices, to_matrices
from robust.proofs.search.certificate import Certificate, failed_certificate

# ---- From weights to a judged certificate for the friction of a class, up to the stiffest that is proved.

SUBJECT = "the stored energy falls"
N_POINTS = 300  # of the frequencies of a cone program
COUPLINGS = (
    0.9,
    0.99,
)  # of the forces at two ports, of what a definite matrix allows: slack for what the sampler folds
MIN_SHARE = 1e-9  # share of a row that has to be left
ONE_SIDED = 1e-9  # of the largest displacement at rest: what is smaller is none

BISECTION_RATIO = 1.02  # ratio of the two ends where a bisection stops
MAX_RATIO = 64.0  # times what was asked


@value(copy=False)
class Multipliers:
    """Weights of the filters of a class of friction, and the block that only bristles have.

    Fields
    ------
    rates, weights : (J,) ndarray
        Rates [rad/s] of the filters, the reference first, and their weights mu_j.
    free : float
        Weight of f v.
    block, bounds : (3, 3), (2,) ndarray
        Of bristles, empty for Maxwell slip; see `FrictionClaim`.
    """

    rates: np.ndarray
    weights: np.ndarray
    free: float
    block: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))
    bounds: np.ndarray = field(default_factory=lambda: np.zeros(0))


class Storage(Protocol):
    """A stored energy: its coordinates, its Bernstein coefficients, the intervals of each span."""

    @property
    def V(self) -> np.ndarray:
        """(n, n) coordinates."""

    @property
    def P(self) -> np.ndarray:
        """(I, 4, n, n) coefficients."""

    @property
    def counts(self) -> np.ndarray:
        """(S,) intervals."""


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
    numbers : tuple of Multipliers
        Where it holds, one a port: all that a `FrictionClaim` needs besides loop, class and energy.
    energy : Energy or None
    """

    certificate: Certificate
    multipliers: np.ndarray
    omega: np.ndarray
    form: np.ndarray
    numbers: tuple[Multipliers, ...]
    energy: JudgedStorage | None


def certify_friction(
    loop: FrictionLoop, friction: AnyFriction | FrictionAtPorts, reference: float, *, quick: bool = False
) -> FrictionCertificate:
    """Prove that the energy of the loop falls with every friction of the class, or say what failed last.

    reference : rate of the filter that the others of Maxwell slip are measured against [rad/s]. Quick: with the first
    set of filters only, and without the finest intervals.
    """
    if isinstance(friction, AnyFriction) and friction.kind == "bristle":
        return certify_bristle(
            loop,
            friction.K0,
            rho=friction.stiction,
            microdamping=friction.microdamping,
            reference=reference,
            quick=quick,
        )
    return certify_maxwell_slip(
        loop, friction.K0, rho=friction.stiction, bristle_time=friction.bristle_time, reference=reference, quick=quick
    )


def certify_maxwell_slip(
    loop: FrictionLoop,
    K0: float | np.ndarray,
    *,
    rho: float | np.ndarray,
    bristle_time: float,
    reference: float,
    quick: bool = False,
) -> FrictionCertificate:
    """Prove that the energy of the loop falls with every friction of the class, or say what failed last.

    K0, rho : of several ports one each. Quick: with the first set of filters only, and without the finest intervals.
    """
    several, stiffest, ratios = loop.B.ndim > 1, np.atleast_1d(K0), np.atleast_1d(rho)
    omega = loop_frequencies(loop, N_POINTS if several else 900)
    response = mobility(loop, omega)
    balanced = False
    if several:
        wrong, balanced = coupling_of_rests(loop)
        if wrong:
            return friction_certificate(wrong, np.zeros((2, 0)), omega=omega, form=np.full(omega.size, np.nan))
    reason = "no weights of the filters make every frequency dissipate"
    fastest = 1 / bristle_time if bristle_time else np.inf
    found = np.zeros((2, 0))
    form = np.full(omega.size, np.nan)
    for rates in filter_rates(reference, fastest)[: 1 if quick else None]:
        weights = (
            weights_of_ports(response, omega, rates=rates, K0=stiffest, rho=ratios, balanced=balanced)
            if several
            else weights_of_port(response, omega, rates=rates, K0=stiffest[0], rho=ratios[0])
        )
        if weights is None:
            continue
        mu, form = weights
        found = np.vstack([np.tile(np.append(0.0, rates), mu.shape[0]), mu.ravel()])[:, mu.ravel() > 0]
        reason, energy = certified_dissipation(maxwell_slip_dissipation(loop, rates, mu=mu, K0=K0, rho=rho), quick)
        if not reason:
            numbers = []
            for own in mu:
                used = np.append(True, own[2:] > 0)
                numbers.append(Multipliers(rates=rates[used], weights=own[1:][used], free=float(own[0])))
            return friction_certificate("", found, omega=omega, form=form, numbers=tuple(numbers), energy=energy)
    return friction_certificate(reason, found, omega=omega, form=form)


def weights_of_port(
    response: np.ndarray, omega: np.ndarray, *, rates: np.ndarray, K0: float, rho: float
) -> tuple[np.ndarray, np.ndarray] | None:
    """Return (1, 1 + J) weights of the filters at one port and (W,) the dissipation with them; None of none."""
    table = multiplier_terms(response, omega, rates=rates, K0=K0, rho=rho)
    mu, share = maxwell_slip_multipliers(table)
    if not share > 0 or not (mu[1:] > 0).any():
        return None
    mu[mu < 1e-9 * mu.max()] = 0
    return mu[np.newaxis], table @ mu / np.abs(table * mu).max(axis=1)


def certify_bristle(
    loop: FrictionLoop, K0: float, *, rho: float, microdamping: float, reference: float, quick: bool = False
) -> FrictionCertificate:
    """Search the multipliers of creeping bristles (stiffness K0, stiction rho), and certify what they prove."""
    omega = loop_frequencies(loop, N_POINTS)
    response = mobility(loop, omega)
    reason, found, form = "no weights make every frequency dissipate", np.zeros((2, 0)), np.full(omega.size, np.nan)
    for rates in filter_rates(reference, np.inf)[: 1 if quick else 2]:
        table = bristle_terms(response, omega, rates=rates, K0=K0, microdamping=microdamping)
        weights = bristle_multipliers(table, rho)
        if weights is None:
            continue
        chosen = np.concatenate([[weights.mu], weights.nu])
        found = np.vstack([np.append(0.0, rates), chosen])[:, chosen > 0]
        form = largest_share(table, weights)
        reason, energy = certified_dissipation(
            bristle_dissipation(loop, rates, weights=weights, K0=K0, microdamping=microdamping), quick
        )
        if not reason:
            used = weights.nu > 0
            numbers = Multipliers(
                rates=rates[used], weights=weights.nu[used], free=weights.mu, block=weights.block, bounds=weights.bounds
            )
            return friction_certificate("", found, omega=omega, form=form, numbers=(numbers,), energy=energy)
    return friction_certificate(reason, found, omega=omega, form=form)


def friction_certificate(
    reason: str,
    rates_and_weights: np.ndarray,
    *,
    omega: np.ndarray,
    form: np.ndarray,
    numbers: tuple[Multipliers, ...] = (),
    energy: JudgedStorage | None = None,
) -> FrictionCertificate:
    """Return the certificate of a proof, where the reason why not is empty, else of that reason.

    `rates_and_weights` (2, n) are the filters and weights found, `form` (W,) the dissipation at omega, `numbers` and
    `energy` the exact multipliers and storage of a proof.
    """
    intervals = np.array([[0.0, np.inf]])
    proof = Certificate(
        subject=SUBJECT, outcome=Outcome.HOLDS, level=0.0, method=METHOD, intervals=intervals, reason=""
    )
    certificate = failed_certificate(SUBJECT, 0.0, reason) if reason else proof
    return FrictionCertificate(
        certificate=certificate, multipliers=rates_and_weights, omega=omega, form=form, numbers=numbers, energy=energy
    )


def proved_limits(loop: FrictionLoop, friction: AnyFriction, reference: float) -> tuple[float, float]:
    """Largest K0 at this rho, and largest rho at this K0, that a proof was found for; both are proved as they stand."""

    def proved(**changed: float) -> bool:
        other = replace(friction, **changed)  # type: ignore[arg-type]
        if destabilizing_stiffness(loop, other.K0, other.damper) is not None:
            return False
        return certify_friction(loop, other, reference, quick=True).certificate.holds

    return (
        friction.K0 * largest_ratio(lambda ratio: proved(K0=ratio * friction.K0)),
        friction.stiction * largest_ratio(lambda ratio: proved(stiction=ratio * friction.stiction)),
    )


def largest_ratio(holds: Callable[[float], bool]) -> float:
    """Return the largest ratio from one on that holds, found by bisection; at most `MAX_RATIO`."""
    low = 1.0
    high = 2.0
    while high <= MAX_RATIO and holds(high):
        low, high = high, 2 * high
    if high > MAX_RATIO:
        return low
    while high / low > BISECTION_RATIO:
        middle = float(np.sqrt(low * high))
        low, high = (middle, high) if holds(middle) else (low, middle)
    return low


SETTLING_SUBJECT = "the position settles within a bound"
SETTLING_METHOD = "semidefinite program, Bernstein, exact arithmetic"
SETTLING_ROUNDED_UP = 1 + 1e-9
NOT_IN_CLASS = {
    "bristle": "rigid stiction, another damping of the bristles, ",
    "Maxwell slip": "a law that creeps below break-away (LuGre, Dahl, Leuven), rigid stiction, ",
    "bounded": "a viscous part of the friction, ",
    "passive": "LuGre with less damping than sigma1 (Fs - Fc)/Fc, ",
}


@value(copy=False)
class Finding:
    """What was found of a loop and a class, by the names of the fields of `FrictionProof`."""

    verdict: FrictionVerdict
    reason: str
    K0_max: float = np.nan
    stiction_max: float = np.nan
    settling_error: float = np.nan
    certificate: Certificate | None = None
    multipliers: np.ndarray = field(default_factory=lambda: np.zeros((2, 0)))
    omega: np.ndarray = field(default_factory=lambda: np.zeros(0))
    form: np.ndarray = field(default_factory=lambda: np.zeros(0))


def certified_verdict(
    machine: FrictionPlant,
    K: control.StateSpace,
    *,
    delay: float,
    loop: FrictionLoop,
    friction: AnyFriction | FrictionAtPorts,
    limits: bool,
) -> Finding:
    """Return the verdict on a loop that no spring of the class makes unstable."""
    reference = reference_rate(machine, loop)
    try:
        proof = certify_friction(loop, friction, reference)
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return Finding(verdict=FrictionVerdict.NOT_DECIDED, reason=f"numerical failure: {error}")
    holds = proof.certificate.holds
    verdict = FrictionVerdict.PROVED if holds else FrictionVerdict.NOT_DECIDED
    certificate, K0_max, stiction_max = proof.certificate, np.nan, np.nan
    if proof.energy is not None:
        exact = build_claim(machine, K, delay=delay, friction=friction, numbers=proof.numbers, stored=proof.energy)
        certificate = replace(proof.certificate, claim=exact, again=verify_friction)
    if holds and limits and isinstance(friction, AnyFriction):
        K0_max, stiction_max = proved_limits(loop, friction, reference)
    return Finding(
        verdict=verdict,
        reason=proof.certificate.reason,
        K0_max=K0_max,
        stiction_max=stiction_max,
        certificate=certificate,
        multipliers=proof.multipliers,
        omega=proof.omega,
        form=proof.form,
    )


def settling_verdict(
    machine: FrictionPlant,
    K: control.StateSpace,
    *,
    delay: float,
    loop: FrictionLoop,
    friction: AnyFriction | FrictionAtPorts,
    forces: np.ndarray,
    error_bound: float,
    undecided: Finding,
) -> Finding:
    """Return the finding where the position has a bound: over the rationals, else that of any friction up to `forces`.

    forces : (P,) the largest friction force at each port.
    """
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
        # a bound of zero is no claim, and a rest of zero with a stiction of one
        error = max(float((one.reach * most + held).max()) * SETTLING_ROUNDED_UP, 1e-300)
        numbers = tuple(Multipliers(rates=one.rates, weights=own, free=0.0) for own in one.weights)
        own_settling = Settling(
            decay=one.decay, Fs=float(forces[0]), error=error, other_Fs=forces[1:], rest_weights=one.rest_weights
        )
        exact = replace(
            build_claim(machine, K, delay=delay, friction=friction, numbers=numbers, stored=one), settling=own_settling
        )
        if verify_friction(exact).verified:
            certificate = Certificate(
                subject=SETTLING_SUBJECT,
                outcome=Outcome.HOLDS,
                level=error,
                method=SETTLING_METHOD,
                intervals=np.array([[0.0, np.inf]]),
                reason="",
                claim=exact,
                again=verify_friction,
            )
            smaller = error_bound if error_bound < error else error
            return replace(undecided, verdict=FrictionVerdict.SETTLES, settling_error=smaller, certificate=certificate)
    return any_friction


def build_claim(
    machine: FrictionPlant,
    K: control.StateSpace,
    *,
    delay: float,
    friction: AnyFriction | FrictionAtPorts,
    numbers: tuple[Multipliers, ...],
    stored: Storage,
) -> FrictionClaim:
    """Return the claim of the certificate, with every number as given; `numbers` are one a port."""
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
        microdamping=float(np.nan_to_num(classes[0].microdamping)),
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
    """[rad/s] of the filter that the others are measured against: 1.5 times the resonance, or a pole of the loop."""
    if machine.resonance:
        return 1.5 * machine.resonance
    poles = loop.poles()
    poles = poles[np.abs(poles) > 1e-6]
    rates = np.abs(np.log(poles.astype(complex))) / loop.T if loop.T else np.abs(poles)
    return float(np.clip(np.median(rates), 1.0, 1e3))


def describe_scope(
    machine: FrictionPlant, friction: AnyFriction | FrictionAtPorts, *, K: control.StateSpace, delay: float
) -> str:
    """State for which friction, machine and sampling time a claim holds."""
    dt = timebase(K)
    clock = f"sampled at {1 / dt / 1e3:.4g} kHz" if dt else "with a continuous controller"
    late = f" with {1e3 * delay:.4g} ms of delay" if delay else ""
    return f"with every {friction.description}, for the linear part {machine.description}, {clock}{late}"
