"""A proof for a given linear plant: with every friction of a class, from every state, the loop comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import short_form
from robust._base.states import FrictionVerdict
from robust._base.types import Controller
from robust.friction.classes import AnyFriction, FrictionAtPorts
from robust.friction.passivity import passive_verdict
from robust.friction.plant import (
    FrictionLoop,
    FrictionPlant,
    destabilizing_stiffness,
    divergence_velocity,
    friction_loop,
    separate_delay,
)
from robust.friction.proof.certify import (
    NOT_IN_CLASS,
    FrictionProof,
    certified_verdict,
    describe_scope,
    settling_verdict,
)
from robust.friction.proof.ports import (
    bound_of_ports,
    friction_of_ports,
    largest_forces,
)
from robust.friction.proof.saturation import limits_of_force, with_actuator
from robust.lti.realisation import state_space

if TYPE_CHECKING:
    import control

#: Verdicts with a claim.
_CLAIMED = (FrictionVerdict.PROVED, FrictionVerdict.PROVED_LOCALLY, FrictionVerdict.SETTLES)
#: A pole this close to the stability boundary, in 1/s or in |z|, is on it.
_ROUNDING = 1e-9
_NOT_CLAIMED = "{other}a saturated actuator, quantisation, another linear part."


def prove_friction(
    machine: FrictionPlant,
    K: Controller,
    friction: AnyFriction | FrictionAtPorts | Sequence[AnyFriction],
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
    saturation: float | None = None,
) -> FrictionProof:
    """Prove that a loop comes to rest with every friction of a class, or refute it; sampler and hold are included.

    Use this for a machine whose friction law is unknown and whose limits are known: see "What can be proved of a
    machine with friction" in the guide. A proof names its class and its linear plant, and does not hold for others.
    Parameters
    ----------
    machine : FrictionPlant
        The linear plant, from `friction_plant` or `two_mass_plant`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y); sampled, or continuous and proper. It is used as given: nothing is cancelled.
    friction : AnyFriction, FrictionAtPorts or sequence of AnyFriction
        The class: `any_maxwell_slip`, `any_bristle`, `any_bounded` or `any_passive`. For a machine with several
        friction ports, as on motor and load: one `any_maxwell_slip` for each port.
    delay : float
        Delay from the sample to the change of the force [s]; a fraction of a sample, or several samples.
    Fs : float or sequence of float, optional
        Largest friction force [N], one for each port. It adds `error_bound`, a distance from rest, and for one port
        `kick_sure`, an initial velocity from which the loop diverges.
    saturation : float, optional
        Largest force of the actuator [N]. It must exceed Fs, which must then be given. The proof is then for the loop
        with a saturated actuator: from every state, or up to an initial velocity. For one port and `any_maxwell_slip`;
        `any_bristle` gives only the velocity up to which the actuator does not saturate. K has no anti-windup.

    Returns
    -------
    FrictionProof
        After a numerical failure the verdict is "not decided", with its reason.

    Raises
    ------
    ValueError
        Not a friction plant, not a class of friction, a controller that is not proper, a delay with a continuous
        controller, an `Fs` that differs from that of `any_bounded`, or a saturation of at most Fs or with another
        class.

    References
    ----------
    A. Rantzer, Int. J. Robust Nonlinear Control 11, 2001; J. Colgate, G. Schenkel, J. Robotic Systems 14, 1997; S.
    Tarbouriech and others, *Stability and Stabilization of Linear Systems with Saturating Actuators*, 2011.

    Examples
    --------
    >>> from robust.friction import any_maxwell_slip
    >>> from robust import friction_plant
    >>> rig = friction_plant(1.0, 80e3, 0.4)
    >>> prove_friction(rig, 1e3, any_maxwell_slip(64e3)).verdict             # the controller is a spring
    'proved'
    >>> import control
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_friction(rig, PD, any_maxwell_slip(64e3), Fs=1.0, saturation=20.0)
    >>> proof.verdict, proof.kick > 2 * proof.kick_linear
    ('proved up to a kick', True)
    """
    if not isinstance(machine, FrictionPlant):
        raise ValueError(f"machine must be a friction_plant, got {short_form(machine)}")
    given = friction_of_ports(machine, friction)
    if given.position_unit != machine.position_unit:
        raise ValueError(
            f"friction must be in the units of the machine, {machine.position_unit}, got {given.position_unit}"
        )
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    loop = friction_loop(machine, K, delay)
    forces = largest_forces(machine, Fs)
    known = None if saturation is None else limits_of_force(machine, given, forces, saturation)
    if given.kind == "bounded" and isinstance(given, AnyFriction):
        if np.isfinite(forces[0]) and forces[0] != given.Fs:
            raise ValueError(
                f"Fs must be that of the class, {given.Fs:g} {given.units.force}, or left out, got {forces[0]:g}"
            )
        forces = np.array([given.Fs])
    spring = destabilizing_stiffness(loop, np.nan_to_num(given.K0), given.microdamping)
    kick_sure, error_bound = _bounds_of_bounded(machine, loop, forces, given) if known is None else (np.nan, np.nan)
    proof = FrictionProof(
        verdict=FrictionVerdict.NOT_DECIDED,
        reason="",
        claim="",
        not_claimed=_NOT_CLAIMED.format(other=NOT_IN_CLASS[given.kind]),
        machine=machine,
        friction=given,
        counterexample=spring,
        kick_sure=kick_sure,
        error_bound=error_bound,
    )
    if spring is not None:
        proof = replace(proof, verdict=FrictionVerdict.REFUTED, reason=_describe_counterexample(spring, loop, given))
    elif given.kind in ("Maxwell slip", "bristle"):
        proof = certified_verdict(proof, K, delay=delay, loop=loop)
        if proof.verdict is FrictionVerdict.NOT_DECIDED and np.isfinite(forces).all() and known is None:
            proof = settling_verdict(proof, K, delay=delay, loop=loop, forces=forces)
    elif given.kind == "bounded":
        proof = _bounded_verdict(proof, loop)
    else:
        verdict, reason = passive_verdict(machine, K, delay=delay, loop=loop)
        proof = replace(proof, verdict=verdict, reason=reason)
    if known is not None:
        proof = with_actuator(proof, K, delay=delay, known=known)
    if proof.verdict not in _CLAIMED:
        return proof
    return replace(proof, claim=_describe_claim(proof, describe_scope(machine, given, K=K, delay=delay), forces))


def prove_all(
    machines: Sequence[FrictionPlant],
    K: control.StateSpace,
    friction: AnyFriction | FrictionAtPorts,
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
) -> tuple[FrictionProof, ...]:
    """Prove the loop for each machine; the weakest result comes first, because a claim must hold with each damping."""
    proofs = [prove_friction(machine, K, friction, delay=delay, Fs=Fs) for machine in machines]
    worth = (FrictionVerdict.REFUTED, FrictionVerdict.NOT_DECIDED, FrictionVerdict.SETTLES, FrictionVerdict.PROVED)
    return tuple(sorted(proofs, key=lambda proof: worth.index(proof.verdict)))


def _bounds_of_bounded(
    machine: FrictionPlant, loop: FrictionLoop, forces: np.ndarray, friction: AnyFriction | FrictionAtPorts
) -> tuple[float, float]:
    """Return the divergence velocity (for one port) and the steady error bound; nan if there is none."""
    kick = np.nan
    unstable = not loop.growth() < 0
    if machine.n_ports == 1 and np.isfinite(forces[0]) and unstable and machine.velocity @ machine.B_port > 0:
        hit = np.zeros(loop.F.shape[0])
        hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
        least = divergence_velocity(loop, hit, float(forces[0]))
        kick = least if np.isfinite(least) else np.nan
    damped = float(np.nan_to_num(friction.bristle_time)) if friction.kind == "bounded" else 0.0
    return kick, bound_of_ports(loop, forces, damped)


def _bounded_verdict(proof: FrictionProof, loop: FrictionLoop) -> FrictionProof:
    """Return "proved" if the bound is finite; else "not decided": on the stability boundary, or too long to compute."""
    if np.isfinite(proof.error_bound):
        return replace(proof, verdict=FrictionVerdict.PROVED)
    growth = loop.growth() + 0.0
    size = f"|z| = {_format_pole_modulus(1 + growth)}" if loop.T else f"real part {growth:.4g} rad/s"
    what = "is on the stability boundary" if growth >= -_ROUNDING else "has modes too far apart for the computation"
    return replace(
        proof,
        reason=f"no bound was found: the sliding loop, with all states of its controller, {what} (without friction "
        f"it has a pole of {size})",
    )


def _describe_counterexample(
    spring: tuple[float | tuple[float, ...], complex], loop: FrictionLoop, friction: AnyFriction | FrictionAtPorts
) -> str:
    """Describe the member of the class that makes the loop unstable."""
    kappa, pole = spring
    size = f"|z| = {_format_pole_modulus(abs(pole))}" if loop.T else f"real part {pole.real:.4g} rad/s"
    if not np.any(kappa):
        return f"the sliding loop is unstable: without friction it has a pole of {size}"
    still = "a bristle" if friction.kind == "bristle" else "a spring"
    places = friction.names if isinstance(friction, FrictionAtPorts) else ()
    springs = [f"{still} of {stiffness / 1e3:.4g} {friction.units.stiffness}" for stiffness in np.atleast_1d(kappa)]
    springs = [f"{spring} at {name}" for spring, name in zip(springs, places, strict=True)] if places else springs
    return (
        f"refuted for the class: with {' and '.join(springs)} that does not "
        f"slip, its rests are unstable ({size}); your friction may be another member"
    )


def _format_pole_modulus(size: float) -> str:
    """Format the modulus of a pole with enough digits to distinguish it from one."""
    digits = 6 if size == 1 else int(np.clip(np.ceil(3 - np.log10(abs(size - 1))), 6, 16))
    return f"{size:.{digits}g}"


def _describe_claim(proof: FrictionProof, scope: str, forces: np.ndarray) -> str:
    """State the claim in one sentence. scope : the loop it holds for. forces : (P,) largest friction at each port."""
    friction, units = proof.friction, proof.machine.units
    places = [f" at {name}" for name in friction.names] if isinstance(friction, FrictionAtPorts) else [""]
    most = " and ".join(f"{force:g} {units.force}{place}" for force, place in zip(forces, places, strict=True))
    if proof.verdict is FrictionVerdict.SETTLES:
        bound = f"{proof.settling_error:.3g} {units.position}"
        settles = f"Settles within {bound} of rest from every state {scope}, of at most {most}"
        return f"{settles}. It may keep moving within this distance."
    if proof.verdict is FrictionVerdict.PROVED_LOCALLY:
        hit = f"a kick of at most {1e3 * proof.kick:.3g} m{units.velocity} at the friction port"
        rest = f"At rest and relaxed, comes to rest again after {hit}"
    elif friction.kind == "bounded":
        rest = f"Stays within {proof.error_bound:.3g} {units.position} of rest in the end"
    else:
        rest = "Comes to rest from every state"
    limited = f", with an actuator of {proof.saturation:g} {units.force} and friction of at most {most}"
    return f"{rest} {scope}{limited if np.isfinite(proof.saturation) else ''}."
