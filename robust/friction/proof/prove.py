"""A proof for a given linear part: with every friction of a class, from every state, the loop comes to rest."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import short_form
from nlfrf._base.values import value
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
from robust.friction.proof.certify import NOT_IN_CLASS, Finding, certified_verdict, describe_scope, settling_verdict
from robust.friction.proof.ports import (
    bound_of_ports,
    friction_of_ports,
    largest_forces,
)
from robust.friction.proof.saturation import limits_of_force, with_actuator
from robust.friction.units import MechanicalUnits, format_length
from robust.lti.realisation import state_space
from robust.proofs.search.certificate import Certificate

#: Verdicts with a claim.
CLAIMED = (FrictionVerdict.PROVED, FrictionVerdict.SETTLES)
#: A pole this close to the stability boundary, in 1/s or of |z|, is said to be on it.
ROUNDING = 1e-9
NOT_CLAIMED = "Not claimed: {other}a saturated actuator, quantisation, another linear part."


@value
class FrictionProof:
    """What is proved of a loop around a machine with friction, for a whole class of friction laws.

    Fields
    ------
    verdict : FrictionVerdict
        "proved": with every friction of the class, from every state, after any disturbance that ends, the machine comes
        to rest, with integral action where it should. "refuted", said of the class and not of the machine: a named
        member makes the loop unstable; yours may be another: the loop may hunt. "settles": not decided, but with every
        friction of the class, of at most Fs, it stays within `settling_error` in the end. "not decided": none of them.
    claim, not_claimed, reason : str
        What is proved, in one sentence; what is not; why the verdict is what it is.
    machine : FrictionPlant
        The linear part.
    friction : AnyFriction or FrictionAtPorts
        The class.
    counterexample : tuple of (float, complex) or None
        A spring, what never slips of a friction, in [N/m] (of several ports a tuple, one each), and the pole it puts
        outside the stable region.
    K0_max, stiction_max : float
        Largest presliding stiffness [N/m] and largest ratio of a slider for which the proof was found too, one at a
        time; nan unless asked for.
    error_bound : float
        How far from rest the position (of several ports each displacement there) stays in the end with any friction of
        at most Fs [m]; nan where no Fs was given, the sliding loop is not stable, or its fastest mode is too fast for
        its clock or its slowest one to follow.
    settling_error : float
        How far from rest the position stays in the end with every friction of the class of at most Fs [m]: the smaller
        of a bound of the class, which `certificate.verify()` proves over the rationals, and `error_bound`, which is in
        floating point. nan where no Fs was given, the loop comes to rest, or there is none.
    kick_sure : float
        Velocity [m/s] from which the machine surely runs away with every friction of at most Fs; nan where no Fs was
        given, the sliding loop is stable, or none was found.
    certificate : Certificate or None
        What was judged, where anything was; `certificate.verify()` proves it again over the rationals.
    multipliers : (2, J) ndarray
        Rates [rad/s] and weights of the filters it was proved with; rate zero: the weight of the friction itself.
    omega, form : (W,) ndarray
        The dissipation with these weights over frequency [rad/s], negative, over its largest part.
    saturation : float
        Largest force of the actuator [N]; infinite where none was given.
    kick : float
        Velocity at the friction port [m/s] of a kick on the machine at rest and relaxed, up to which it comes to rest
        though its actuator saturates; infinite where it does from every state, zero where no kick is proved, nan where
        nothing saturates. With it `verdict` is "proved", from every state, or "proved up to a kick", beyond which
        nothing is said.
    kick_linear : float
        The part of it up to which the actuator never saturates at all [m/s].
    share : float
        What of the force that is asked for, less what holds the friction, the actuator may miss on the way; one where
        it may miss all of it, zero where it never saturates.

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
    >>> from nlfrf.axis import Drive
    >>> from robust.drive import cascade
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
    counterexample: tuple[float | tuple[float, ...], complex] | None
    K0_max: float
    stiction_max: float
    error_bound: float
    settling_error: float
    kick_sure: float
    certificate: Certificate | None
    multipliers: np.ndarray
    omega: np.ndarray
    form: np.ndarray
    saturation: float = np.inf
    kick: float = np.nan
    kick_linear: float = np.nan
    share: float = np.nan

    def __str__(self) -> str:
        lines = [f"{self.verdict}: {self.claim or self.reason}"]
        if self.claim and self.reason:
            settles = self.verdict is FrictionVerdict.SETTLES
            lines.append(f"Whether it comes to rest is not decided: {self.reason}." if settles else self.reason)
        if np.isfinite(self.K0_max) and isinstance(self.friction, AnyFriction):
            times = self.K0_max / self.friction.K0
            lines.append(
                f"Proved up to {times:.3g} times this presliding stiffness, or stiction {self.stiction_max:.3g}."
            )
        if np.isfinite(self.error_bound):
            lines.append(
                "Whatever the friction, if never above the given force: in the end, at rest or hunting, at most "
                f"{format_length(self.error_bound, self.units.position)} off, in proportion to the force."
            )
        if np.isfinite(self.kick_sure):
            lines.append(f"Surely runs away from a kick of {self.kick_sure:.3g} {self.units.velocity}.")
        return "\n".join([*lines, self.not_claimed])

    @property
    def units(self) -> MechanicalUnits:
        """Units of its numbers."""
        return self.machine.units


def prove_friction(
    machine: FrictionPlant,
    K: Controller,
    friction: AnyFriction | FrictionAtPorts | Sequence[AnyFriction],
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
    saturation: float | None = None,
    limits: bool = False,
) -> FrictionProof:
    """Prove that a loop comes to rest with every friction of a class, through sampler and hold, or refute it.

    Parameters
    ----------
    machine : FrictionPlant
        The linear part, from `friction_plant`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y); sampled, or continuous and proper. Used as it is: nothing is cancelled.
    friction : AnyFriction, FrictionAtPorts or sequence of AnyFriction
        The class: `any_maxwell_slip`, `any_bristle`, `any_bounded`, `any_passive`. With friction at several ports of
        the machine, as on motor and load, `any_maxwell_slip` of each.
    delay : float
        From sampling to the force changing [s]; any part of a sample, or several.
    Fs : float or sequence of float, optional
        Largest friction force [N], of several ports one each: also says how far such a friction can hunt, or (of one
        port) from which kick the loop runs away.
    saturation : float, optional
        Largest force of the actuator [N], more than Fs, which must be given too: proves that the loop comes to rest
        though its actuator saturates, or up to which kick. Of one port and `any_maxwell_slip`; of `any_bristle` only
        how far the actuator never saturates. K is without anti-windup.
    limits : bool
        Whether to look for the largest stiffness and stiction that are still proved; of one port.

    Returns
    -------
    FrictionProof
        A numerical failure is "not decided", with its reason.

    Raises
    ------
    ValueError
        No sliding machine, no class of friction, a controller that is not proper, a delay with a continuous controller,
        an `Fs` that is not that of `any_bounded`, an actuator of no more than Fs or with another class.

    References
    ----------
    A. Rantzer, Int. J. Robust Nonlinear Control 11, 2001; J. Colgate, G. Schenkel, J. Robotic Systems 14, 1997; S.
    Tarbouriech and others, *Stability and Stabilization of Linear Systems with Saturating Actuators*, 2011.

    Examples
    --------
    >>> from robust.friction import any_maxwell_slip
    >>> from robust import friction_plant
    >>> rig = friction_plant(1.0, 80e3, 0.4)
    >>> prove_friction(rig, 1e3, any_maxwell_slip(64e3)).verdict             # a spring more, and nothing else
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
    require_same_units(machine, given)
    if limits and isinstance(given, FrictionAtPorts):
        raise ValueError("limits must be False with friction at several ports, got True")
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
    spring = destabilizing_stiffness(loop, np.nan_to_num(given.K0), given.damper)
    kick_sure, error_bound = bounds_of_bounded(machine, loop, forces, given) if known is None else (np.nan, np.nan)
    if spring is not None:
        found = Finding(verdict=FrictionVerdict.REFUTED, reason=describe_counterexample(spring, loop, given))
    elif given.kind in ("Maxwell slip", "bristle"):
        found = certified_verdict(machine, K, delay=delay, loop=loop, friction=given, limits=limits)
        if found.verdict is FrictionVerdict.NOT_DECIDED and np.isfinite(forces).all() and known is None:
            found = settling_verdict(
                machine,
                K,
                delay=delay,
                loop=loop,
                friction=given,
                forces=forces,
                error_bound=error_bound,
                undecided=found,
            )
    elif given.kind == "bounded":
        found = bounded_verdict(loop, error_bound)
    else:
        verdict, reason = passive_verdict(machine, K, delay=delay, loop=loop)
        found = Finding(verdict=verdict, reason=reason)
    proof = FrictionProof(
        machine=machine,
        friction=given,
        counterexample=spring,
        not_claimed=NOT_CLAIMED.format(other=NOT_IN_CLASS[given.kind]),
        claim=describe_claim(machine, given, K=K, delay=delay, found=found, forces=forces, error_bound=error_bound)
        if found.verdict in CLAIMED
        else "",
        kick_sure=kick_sure,
        error_bound=error_bound,
        verdict=found.verdict,
        reason=found.reason,
        K0_max=found.K0_max,
        stiction_max=found.stiction_max,
        settling_error=found.settling_error,
        certificate=found.certificate,
        multipliers=found.multipliers,
        omega=found.omega,
        form=found.form,
    )
    return (
        proof if known is None else replace(proof, **with_actuator(machine, K, delay=delay, plain=found, known=known))
    )


def require_same_units(machine: FrictionPlant, friction: AnyFriction | FrictionAtPorts) -> None:
    """Refuse a friction in other units than the machine."""
    if friction.position_unit != machine.position_unit:
        raise ValueError(
            f"friction must be in the units of the machine, {machine.position_unit}, got {friction.position_unit}"
        )


def bounds_of_bounded(
    machine: FrictionPlant, loop: FrictionLoop, forces: np.ndarray, friction: AnyFriction | FrictionAtPorts
) -> tuple[float, float]:
    """Return the divergence velocity, of one port, and the steady error bound; nan where there is none."""
    kick = np.nan
    unstable = not loop.growth() < 0
    if machine.n_ports == 1 and np.isfinite(forces[0]) and unstable and machine.velocity @ machine.B_port > 0:
        hit = np.zeros(loop.F.shape[0])
        hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
        least = divergence_velocity(loop, hit, float(forces[0]))
        kick = least if np.isfinite(least) else np.nan
    damped = float(np.nan_to_num(friction.bristle_time)) if friction.kind == "bounded" else 0.0
    return kick, bound_of_ports(loop, forces, damped)


def bounded_verdict(loop: FrictionLoop, error_bound: float) -> Finding:
    """Proved where there is a bound; nothing is said at the stability boundary, or where it takes too long."""
    if np.isfinite(error_bound):
        return Finding(verdict=FrictionVerdict.PROVED, reason="")
    growth = loop.growth() + 0.0
    size = f"|z| = {format_pole_modulus(1 + growth)}" if loop.T else f"real part {growth:.4g} rad/s"
    what = (
        "is on the stability boundary" if growth >= -ROUNDING else "takes too long to follow, as far as its modes lie"
    )
    return Finding(
        verdict=FrictionVerdict.NOT_DECIDED,
        reason=f"no bound was found: the sliding loop, with all states of its controller, {what} (without friction "
        f"it has a pole of {size})",
    )


def describe_counterexample(
    spring: tuple[float | tuple[float, ...], complex], loop: FrictionLoop, friction: AnyFriction | FrictionAtPorts
) -> str:
    """Describe the member of the class that makes the loop unstable."""
    kappa, pole = spring
    size = f"|z| = {format_pole_modulus(abs(pole))}" if loop.T else f"real part {pole.real:.4g} rad/s"
    if not np.any(kappa):
        return f"the sliding loop is unstable: without friction it has a pole of {size}"
    still = "a bristle" if friction.kind == "bristle" else "a spring"
    places = friction.names if isinstance(friction, FrictionAtPorts) else ()
    springs = [f"{still} of {stiffness / 1e3:.4g} {friction.units.stiffness}" for stiffness in np.atleast_1d(kappa)]
    springs = [f"{spring} at {name}" for spring, name in zip(springs, places, strict=True)] if places else springs
    return (
        f"not every friction of the class: with {' and '.join(springs)} that does not "
        f"slip, its rests are unstable ({size}); yours may be another member"
    )


def format_pole_modulus(size: float) -> str:
    """Format the modulus of a pole with as many digits as tell it from one."""
    digits = 6 if size == 1 else int(np.clip(np.ceil(3 - np.log10(abs(size - 1))), 6, 16))
    return f"{size:.{digits}g}"


def describe_claim(
    machine: FrictionPlant,
    friction: AnyFriction | FrictionAtPorts,
    *,
    K: control.StateSpace,
    delay: float,
    found: Finding,
    forces: np.ndarray,
    error_bound: float,
) -> str:
    """State what is proved in one sentence."""
    if found.verdict is FrictionVerdict.SETTLES:
        bound = f"{found.settling_error:.3g} {machine.units.position}"
        largest = [f"{force:g} {machine.units.force}" for force in forces]
        if isinstance(friction, FrictionAtPorts):
            largest = [f"{force} at {name}" for force, name in zip(largest, friction.names, strict=True)]
        most = f"of at most {' and '.join(largest)}"
        scope = describe_scope(machine, friction, K=K, delay=delay)
        return f"Settles within {bound} of rest from every state {scope}, {most}. It may move within that for ever."
    rest = (
        f"Stays within {error_bound:.3g} {machine.units.position} of rest in the end"
        if friction.kind == "bounded"
        else "Comes to rest from every state"
    )
    return f"{rest} {describe_scope(machine, friction, K=K, delay=delay)}."
