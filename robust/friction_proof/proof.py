"""A proof for a given linear part: with every friction of a class, from every state, the loop comes to rest."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.friction_proof.certify import certify, proved_limits
from robust.friction_proof.classes import AnyFriction
from robust.friction_proof.dissipation import SLIGHTLY
from robust.friction_proof.passivity import passive_verdict
from robust.friction_verification.claim import FrictionClaim
from robust.friction_verification.verify import verify_friction
from robust.shared.states import FrictionVerdict
from robust.sliding.bounded import hunting_bound, sure_kick
from robust.sliding.loop import SlidingLoop, sliding_loop
from robust.sliding.machine import SlidingMachine, separate_delay
from robust.sliding.springs import unstable_spring
from robust.systems.lti import timebase
from robust.systems.realisation import state_space
from robust.verification.claim import Matrices, as_given

__all__ = ["OTHER", "FrictionProof", "claimed", "matrices_of", "prove_friction", "reference_rate", "scope"]

CLASS = ("K0", "stiction", "bristle_time", "microdamping")
#: A pole this close to the stability boundary, in 1/s or of |z|, is said to be on it.
ROUNDING = 1e-9
NOT_CLAIMED = "Not claimed: {other}a saturated actuator, quantisation, another linear part."
OTHER = {
    "bristle": "rigid stiction, another damping of the bristles, ",
    "Maxwell slip": "a law that creeps below break-away (LuGre, Dahl, Leuven), rigid stiction, ",
    "bounded": "a viscous part of the friction, ",
    "passive": "LuGre with less damping than sigma1 (Fs - Fc)/Fc, ",
}


@value
class FrictionProof:
    """What is proved of a loop around a machine with friction, for a whole class of friction laws.

    Fields
    ------
    verdict : FrictionVerdict
        "proved": with every friction of the class, from every state, after any disturbance that ends, the machine comes
        to rest, with integral action where it should. "refuted", said of the class and not of the machine: a named
        member makes the loop unstable; yours may be another. "not decided": neither.
    claim, not_claimed, reason : str
        What is proved, in one sentence; what is not; why the verdict is what it is.
    machine : SlidingMachine
        The linear part.
    friction : AnyFriction
        The class.
    counterexample : tuple of (float, complex) or None
        A spring, what never slips of a friction, in [N/m], and the pole it puts outside the stable region.
    K0_max, stiction_max : float
        Largest presliding stiffness [N/m] and largest ratio of a slider for which the proof was found too, one at a
        time; nan unless asked for.
    error_bound : float
        How far from rest the position stays in the end with any friction of at most Fs [m]; nan where no Fs was given,
        the sliding loop is not stable, or its fastest mode is too fast for its clock or its slowest one to follow.
    kick_sure : float
        Velocity [m/s] from which the machine surely runs away with every friction of at most Fs; nan where no Fs was
        given, the sliding loop is stable, or none was found.
    certificate : Certificate or None
        What was judged, where anything was; `certificate.verify()` proves it again over the rationals.
    multipliers : (2, J) ndarray
        Rates [rad/s] and weights of the filters it was proved with; rate zero: the weight of the friction itself.
    omega, form : (W,) ndarray
        The dissipation with these weights over frequency [rad/s], negative, over its largest part.

    References
    ----------
    A. Rantzer, *Friction analysis based on integral quadratic constraints*, Int. J. Robust Nonlinear Control 11, 2001;
    A. Bisoffi, M. Da Lio, A. Teel, L. Zaccarian, IEEE Trans. Automatic Control 63, 2018 (PID and Coulomb friction).

    Examples
    --------
    >>> import control
    >>> from robust import any_maxwell_slip, prove_friction, sliding_machine
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_friction(sliding_machine(1.0, 80e3, 0.4), PD, any_maxwell_slip(64e3))
    >>> proof.verdict, proof.counterexample
    ('proved', None)
    """

    verdict: FrictionVerdict
    claim: str
    not_claimed: str
    reason: str
    machine: SlidingMachine
    friction: AnyFriction
    counterexample: Any
    K0_max: float
    stiction_max: float
    error_bound: float
    kick_sure: float
    certificate: Any
    multipliers: np.ndarray
    omega: np.ndarray
    form: np.ndarray

    def __str__(self) -> str:
        lines = [f"{self.verdict}: {self.claim if self.verdict.is_proved else self.reason}"]
        if self.verdict.is_proved and self.reason:
            lines.append(self.reason)
        if np.isfinite(self.K0_max):
            times = self.K0_max / self.friction.K0
            lines.append(
                f"Proved up to {times:.3g} times this presliding stiffness, or stiction {self.stiction_max:.3g}."
            )
        if np.isfinite(self.error_bound):
            lines.append(
                f"Whatever the friction, if never above the given force: at most {self.error_bound:.3g} m off."
            )
        if np.isfinite(self.kick_sure):
            lines.append(f"Surely runs away from a kick of {self.kick_sure:.3g} m/s.")
        return "\n".join([*lines, self.not_claimed])


def prove_friction(
    machine: SlidingMachine,
    K: Any,
    friction: AnyFriction,
    *,
    delay: float = 0.0,
    Fs: float | None = None,
    limits: bool = False,
) -> FrictionProof:
    """Prove that a loop comes to rest with every friction of a class, through sampler and hold, or refute it.

    Parameters
    ----------
    machine : SlidingMachine
        The linear part, from `sliding_machine`.
    K : control.StateSpace, TransferFunction or float
        Controller, u = K (r - y); sampled, or continuous and proper. Used as it is: nothing is cancelled.
    friction : AnyFriction
        The class: `any_maxwell_slip`, `any_bristle`, `any_bounded`, `any_passive`.
    delay : float
        From sampling to the force changing [s]; any part of a sample, or several.
    Fs : float, optional
        Largest friction force [N]: also says how far such a friction can hunt, or from which kick the loop runs away.
    limits : bool
        Whether to look for the largest stiffness and stiction that are still proved.

    Returns
    -------
    FrictionProof
        A numerical failure is "not decided", with its reason.

    Raises
    ------
    ValueError
        No sliding machine, no class of friction, a controller that is not proper, a delay with a continuous controller,
        an `Fs` that is not that of `any_bounded`.

    References
    ----------
    A. Rantzer, Int. J. Robust Nonlinear Control 11, 2001; J. Colgate, G. Schenkel, J. Robotic Systems 14, 1997.

    Examples
    --------
    >>> from robust import any_maxwell_slip, sliding_machine
    >>> rig = sliding_machine(1.0, 80e3, 0.4)
    >>> prove_friction(rig, 1e3, any_maxwell_slip(64e3)).verdict             # a spring more, and nothing else
    'proved'
    """
    if not isinstance(machine, SlidingMachine):
        raise ValueError(f"machine must be a sliding_machine, got {shown(machine)}")
    if not isinstance(friction, AnyFriction):
        raise ValueError(f"friction must be a class such as any_maxwell_slip(64e3), got {shown(friction)}")
    K = state_space("K", K)
    machine, delay = separate_delay(machine, delay)
    loop = sliding_loop(machine, K, delay)
    Fs = np.nan if Fs is None else positive("Fs", Fs)
    if friction.kind == "bounded":
        if np.isfinite(Fs) and Fs != friction.Fs:
            raise ValueError(f"Fs must be that of the class, {friction.Fs:g} N, or left out, got {Fs:g}")
        Fs = friction.Fs
    spring = unstable_spring(loop, friction.K0 if np.isfinite(friction.K0) else 0.0, friction.damper)
    found: dict[str, Any] = {"K0_max": np.nan, "stiction_max": np.nan, **no_certificate()}
    found |= bounded_words(machine, loop, Fs)
    if spring is not None:
        found |= {"verdict": FrictionVerdict.REFUTED, "reason": refutation(spring, loop, friction)}
    elif friction.kind in ("Maxwell slip", "bristle"):
        found |= certified(machine, K, delay, loop, friction, limits)
    elif friction.kind == "bounded":
        found |= bounded_verdict(loop, found["error_bound"])
    else:
        found |= dict(zip(("verdict", "reason"), passive_verdict(machine, K, delay, loop), strict=True))
    found["claim"] = claim(machine, friction, K, delay, found) if found["verdict"].is_proved else ""
    return FrictionProof(
        machine=machine,
        friction=friction,
        counterexample=spring,
        not_claimed=NOT_CLAIMED.format(other=OTHER[friction.kind]),
        **found,
    )


def no_certificate() -> dict[str, Any]:
    """The fields of a certificate where none was tried."""
    return {"certificate": None, "multipliers": np.zeros((2, 0)), "omega": np.zeros(0), "form": np.zeros(0)}


def bounded_words(machine: SlidingMachine, loop: SlidingLoop, Fs: float) -> dict[str, float]:
    """Hunting bound and sure kick, whichever there is."""
    stable, kick = loop.growth() < 0, np.nan
    if np.isfinite(Fs) and not stable and machine.velocity @ machine.B_port > 0:
        hit = np.zeros(loop.F.shape[0])
        hit[: machine.A.shape[0]] = machine.B_port / (machine.velocity @ machine.B_port)
        least = sure_kick(loop, hit, Fs)
        kick = least if np.isfinite(least) else np.nan
    bound = Fs * hunting_bound(loop) if np.isfinite(Fs) and stable else np.nan
    return {"kick_sure": kick, "error_bound": bound if np.isfinite(bound) else np.nan}


def bounded_verdict(loop: SlidingLoop, error_bound: float) -> dict[str, Any]:
    """Proved where there is a bound; nothing is said at the stability boundary, or where it takes too long."""
    if np.isfinite(error_bound):
        return {"verdict": FrictionVerdict.PROVED, "reason": ""}
    growth = loop.growth() + 0.0
    size = f"|z| = {beside_one(1 + growth)}" if loop.T else f"real part {growth:.4g} rad/s"
    what = (
        "is on the stability boundary" if growth >= -ROUNDING else "takes too long to follow, as far as its modes lie"
    )
    return {
        "verdict": FrictionVerdict.NOT_DECIDED,
        "reason": f"no bound was found: the sliding loop, with all states of its controller, {what} (without friction "
        f"it has a pole of {size})",
    }


def certified(
    machine: SlidingMachine,
    K: Any,
    delay: float,
    loop: SlidingLoop,
    friction: AnyFriction,
    limits: bool,
) -> dict[str, Any]:
    """The verdict on a loop that no spring refutes."""
    reference = reference_rate(machine, loop)
    try:
        proof = certify(loop, friction, reference)
    except (np.linalg.LinAlgError, ValueError, FloatingPointError) as error:
        return {"verdict": FrictionVerdict.NOT_DECIDED, "reason": f"numerical failure: {error}"}
    holds = proof.certificate.holds
    verdict = FrictionVerdict.PROVED if holds else FrictionVerdict.NOT_DECIDED
    found: dict[str, Any] = {"verdict": verdict, "reason": proof.certificate.reason}
    found |= {name: getattr(proof, name) for name in ("certificate", "multipliers", "omega", "form")}
    if proof.numbers is not None and proof.energy is not None:
        energy = {name: getattr(proof.energy, name) for name in ("V", "P", "counts")}
        exact = claimed(machine, K, delay, friction, proof.numbers | energy)
        found["certificate"] = replace(proof.certificate, claim=exact, again=verify_friction)
    if holds and limits:
        found["K0_max"], found["stiction_max"] = proved_limits(loop, friction, reference)
    return found


def claimed(
    machine: SlidingMachine, K: Any, delay: float, friction: AnyFriction, numbers: dict[str, Any]
) -> FrictionClaim:
    """What the certificate claims, with every number as given."""
    known = {name: float(np.nan_to_num(getattr(friction, name))) for name in CLASS}
    if friction.kind == "Maxwell slip":
        known["stiction"] = max(known["stiction"], SLIGHTLY)
    return FrictionClaim(
        machine=matrices_of(machine),
        controller=as_given(K),
        delay=float(delay),
        kind=friction.kind,
        **(known | numbers),
    )


def matrices_of(machine: SlidingMachine) -> Matrices:
    """The machine as a system: (force, force at the port) to (measured, displacement at the port)."""
    inputs = np.column_stack([machine.B_force, machine.B_port])
    outputs = np.vstack([machine.C_measured, machine.C_port])
    return Matrices(A=machine.A, B=inputs, C=outputs, D=np.zeros((2, 2)))


def reference_rate(machine: SlidingMachine, loop: SlidingLoop) -> float:
    """[rad/s] of the filter that the others are measured against: 1.5 times the resonance, or a pole of the loop."""
    if machine.resonance:
        return 1.5 * machine.resonance
    poles = loop.poles()
    poles = poles[np.abs(poles) > 1e-6]
    rates = np.abs(np.log(poles.astype(complex))) / loop.T if loop.T else np.abs(poles)
    return float(np.clip(np.median(rates), 1.0, 1e3))


def refutation(spring: tuple[float, complex], loop: SlidingLoop, friction: AnyFriction) -> str:
    """Which member of the class makes the loop unstable."""
    kappa, pole = spring
    size = f"|z| = {beside_one(abs(pole))}" if loop.T else f"real part {pole.real:.4g} rad/s"
    if kappa == 0:
        return f"the sliding loop is unstable: without friction it has a pole of {size}"
    still = "a bristle" if friction.kind == "bristle" else "a spring"
    return (
        f"not every friction of the class: with {still} of {kappa / 1e3:.4g} kN/m that does not slip, its rests are "
        f"unstable ({size}); yours may be another member"
    )


def beside_one(size: float) -> str:
    """The size of a pole, with as many digits as tell it from one."""
    digits = 6 if size == 1 else int(np.clip(np.ceil(3 - np.log10(abs(size - 1))), 6, 16))
    return f"{size:.{digits}g}"


def claim(machine: SlidingMachine, friction: AnyFriction, K: Any, delay: float, found: dict[str, Any]) -> str:
    """What is proved, in one sentence."""
    rest = (
        f"Stays within {found['error_bound']:.3g} m of rest in the end"
        if friction.kind == "bounded"
        else "Comes to rest from every state"
    )
    return f"{rest} {scope(machine, friction, K, delay)}."


def scope(machine: SlidingMachine, friction: AnyFriction, K: Any, delay: float) -> str:
    """With which friction, machine and clock a claim is made, in words."""
    dt = timebase(K)
    clock = f"sampled at {1 / dt / 1e3:.4g} kHz" if dt else "with a continuous controller"
    late = f" with {1e3 * delay:.4g} ms of delay" if delay else ""
    return f"with every {friction.words}, for the linear part {machine.words}, {clock}{late}"
