"""`prove_friction`: proof that a loop comes to rest from every state, with every friction of a
class.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from nlfrf._base.arguments import as_list, require_kind, short_form
from robust._base.states import FrictionVerdict
from robust._base.types import Controller
from robust.friction.bounds import divergence_velocity
from robust.friction.loop import (
    FrictionLoop,
    destabilizing_stiffness,
    format_pole_modulus,
    friction_loop,
)
from robust.friction.plant import FrictionPlant, separate_delay
from robust.friction.proof.ports import largest_forces
from robust.friction.proof.protocol import FrictionClass, FrictionProof, ProofTask
from robust.friction.proof.saturation import limits_of_force, with_actuator
from robust.lti.lti import timebase
from robust.lti.realisation import state_space

if TYPE_CHECKING:
    import control

#: Verdicts with a claim.
_CLAIMED = (FrictionVerdict.PROVED, FrictionVerdict.PROVED_LOCALLY, FrictionVerdict.SETTLES)
_NOT_CLAIMED = "{other}a saturated actuator, quantisation, another linear part."


def prove_friction(
    machine: FrictionPlant,
    K: Controller,
    friction: FrictionClass | Sequence[FrictionClass],
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
    saturation: float | None = None,
) -> FrictionProof:
    """Prove that a loop comes to rest with every friction law of a class, or refute it.

    Use this for a machine whose friction law is unknown, but bounded by a known class (see "What
    can be proved of a machine with friction" in the guide). Sampler and hold are part of the loop.
    The proof holds for this linear plant and this class only.

    Parameters
    ----------
    machine : FrictionPlant
        The linear plant, from `friction_plant` or `two_mass_plant`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y); sampled, or continuous and proper. Poles and zeros are not
        cancelled.
    friction : FrictionClass or sequence of FrictionClass
        Class of friction, from `robust.friction`; the page "Prove rest with a class of friction" has
        a table of them. For a machine with several friction ports, such as motor and load, one class
        for each port, all of a kind that may act at several ports, such as `MaxwellSlip`.
    delay : float
        Delay [s] from the sampling instant to the change of the force. It may be a fraction of a
        sample, or several samples.
    Fs : float or sequence of float, optional
        Largest friction force [N], one for each port. The result then contains `error_bound`, a
        bound on the final distance from rest, and for one port `kick_sure`, an initial velocity
        from which the loop diverges.
    saturation : float, optional
        Largest force of the actuator [N], for one port and a class that is proved by a storage
        function. It must exceed Fs, which must be given. With `MaxwellSlip` the proof then holds for
        the loop with a saturated actuator, from every state or up to an initial velocity. With
        another class the result contains only the velocity up to which the actuator does not
        saturate. The proof is for K without anti-windup.

    Returns
    -------
    FrictionProof
        After a numerical failure the verdict is "not decided", with the reason.

    Raises
    ------
    ValueError
        A value that is not a friction plant or not a class of friction, a controller that is not
        proper, a delay with a continuous controller, an `Fs` that differs from the limit of the class,
        a saturation that does not exceed Fs, or a saturation with another class.

    References
    ----------
    A. Rantzer, Int. J. Robust Nonlinear Control 11, 2001; J. Colgate, G. Schenkel, J. Robotic
    Systems 14, 1997; S. Tarbouriech and others, *Stability and Stabilization of Linear Systems with
    Saturating Actuators*, 2011.

    Examples
    --------
    >>> from robust.friction import MaxwellSlip
    >>> from robust import friction_plant
    >>> rig = friction_plant(1.0, 80e3, 0.4)
    >>> prove_friction(rig, 1e3, MaxwellSlip(64e3)).verdict             # the controller is a spring
    'proved'
    >>> import control
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_friction(rig, PD, MaxwellSlip(64e3), Fs=1.0, saturation=20.0)
    >>> proof.verdict, proof.actuator.kick > 2 * proof.actuator.kick_linear
    ('proved up to a kick', True)
    """
    require_kind("machine", machine, FrictionPlant)
    ports = _friction_of_ports(machine, friction)
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    loop = friction_loop(machine, K, delay)
    forces = largest_forces(machine, Fs)
    if saturation is None:
        known = None
    else:
        known = limits_of_force(machine, ports[0], forces, saturation)
    forces = np.array(
        [one.largest_force(float(force)) for one, force in zip(ports, forces, strict=True)]
    )
    # a proof with an actuator has no bound of the position
    task = ProofTask(
        machine, K, delay, loop, forces if known is None else np.full(forces.size, np.nan)
    )
    spring = destabilizing_stiffness(loop, *np.transpose([one.stuck() for one in ports]))
    proof = FrictionProof(
        verdict=FrictionVerdict.NOT_DECIDED,
        reason="",
        claim="",
        not_claimed=_NOT_CLAIMED.format(other=ports[0].excluded),
        machine=machine,
        friction=ports,
        counterexample=spring,
        kick_sure=_sure_kick(task),
        error_bound=ports[0].error_bound(loop, task.forces),
    )
    if spring is None:
        proof = ports[0].decide(proof, task, ports[1:])
    else:
        proof = replace(
            proof, verdict=FrictionVerdict.REFUTED, reason=_describe_counterexample(proof, loop)
        )
    if known is not None:
        proof = with_actuator(proof, task, known)
    if proof.verdict not in _CLAIMED:
        return proof
    return replace(proof, claim=_describe_claim(proof, K, delay=delay, forces=forces))


def _friction_of_ports(
    machine: FrictionPlant, friction: FrictionClass | Sequence[FrictionClass]
) -> tuple[FrictionClass, ...]:
    """Return the class for each port; refuse classes that do not fit the machine or each other."""
    given = tuple(as_list(friction))
    for one in given:
        if not isinstance(one, FrictionClass):
            raise ValueError(
                "friction must be a class such as robust.friction.MaxwellSlip(64e3), got"
                f" {short_form(one)}"
            )
        if len(given) > 1 and not (one.joins_ports and type(one) is type(given[0])):
            raise ValueError(
                "friction must be of one kind, such as MaxwellSlip at each of several ports, got"
                f" {one.description}"
            )
        if one.position_unit != machine.position_unit:
            raise ValueError(
                f"friction must be in the units of the machine, {machine.position_unit}, got"
                f" {one.position_unit}"
            )
    if len(given) != machine.n_ports:
        raise ValueError(
            f"friction must be a class for each friction port of the machine, {machine.n_ports},"
            f" got {len(given)}"
        )
    return given


def prove_all(
    machines: Sequence[FrictionPlant],
    K: control.StateSpace,
    friction: FrictionClass | Sequence[FrictionClass],
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
) -> tuple[FrictionProof, ...]:
    """Prove the loop for each machine; the weakest result comes first, because a claim must hold
    with each damping.
    """
    proofs = [prove_friction(machine, K, friction, delay=delay, Fs=Fs) for machine in machines]
    worth = (
        FrictionVerdict.REFUTED,
        FrictionVerdict.NOT_DECIDED,
        FrictionVerdict.SETTLES,
        FrictionVerdict.PROVED,
    )
    return tuple(sorted(proofs, key=lambda proof: worth.index(proof.verdict)))


def _sure_kick(task: ProofTask) -> float:
    """Return the velocity at one port from which the loop diverges; inf if there is none."""
    machine, loop, forces = task.machine, task.loop, task.forces
    unstable = not loop.growth() < 0
    if not (
        machine.n_ports == 1
        and np.isfinite(forces[0])
        and unstable
        and machine.velocity @ machine.B_port > 0
    ):
        return np.inf
    hit = np.zeros(loop.F.shape[0])
    hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
    return divergence_velocity(loop, hit, float(forces[0]))


def _describe_counterexample(proof: FrictionProof, loop: FrictionLoop) -> str:
    """Describe the member of the class that makes the loop unstable."""
    assert proof.counterexample is not None
    kappa, pole = proof.counterexample
    if loop.T:
        size = f"|z| = {format_pole_modulus(abs(pole))}"
    else:
        size = f"real part {pole.real:.4g} rad/s"
    if not np.any(kappa):
        return f"the sliding loop is unstable: without friction it has a pole of {size}"
    springs = [
        f"{friction.stuck_element} of {stiffness / 1e3:.4g} {friction.units.stiffness}{place}"
        for friction, stiffness, place in zip(
            proof.friction, np.atleast_1d(kappa), proof.machine.places, strict=True
        )
    ]
    return (
        f"refuted for the class: with {' and '.join(springs)} that does not "
        f"slip, its rests are unstable ({size}); your friction may be another member"
    )


def _describe_claim(
    proof: FrictionProof, K: control.StateSpace, *, delay: float, forces: np.ndarray
) -> str:
    """State the claim in one sentence. forces : (P,) largest friction at each port."""
    machine, units, dt = proof.machine, proof.units, timebase(K)
    if dt:
        clock = f"sampled at {1 / dt / 1e3:.4g} kHz"
    else:
        clock = "with a continuous controller"
    if delay:
        late = f" with {1e3 * delay:.4g} ms of delay"
    else:
        late = ""
    linear = f"for the linear part {machine.description}, {clock}{late}"
    scope = f"with {proof.scope}, {linear}"
    most = " and ".join(
        f"{force:g} {units.force}{place}"
        for force, place in zip(forces, machine.places, strict=True)
    )
    if proof.verdict is FrictionVerdict.SETTLES:
        bound = f"{proof.settling_error:.3g} {units.position}"
        settles = f"Settles within {bound} of rest from every state with {proof.scope}"
        return f"{settles} of at most {most}, {linear}. It may keep moving within this distance."
    actuator = proof.actuator
    if actuator is not None and proof.verdict is FrictionVerdict.PROVED_LOCALLY:
        hit = f"a kick of at most {1e3 * actuator.kick:.3g} m{units.velocity} at the friction port"
        rest = f"At rest and relaxed, comes to rest again after {hit}"
    else:
        rest = proof.friction[0].describe_proved(proof)
    if actuator is None:
        return f"{rest} {scope}."
    limited = f"with an actuator of {actuator.limit:g} {units.force}"
    return f"{rest} {scope}, {limited} and friction of at most {most}."
