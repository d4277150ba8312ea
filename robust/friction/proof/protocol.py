"""The interface of a class of friction (`FrictionClass`, and `CertifiedClass` for a proof by a
storage function), and the result of a proof (`FrictionProof`).

The fields of a class are its limits, and its methods decide whether a loop is proved. A new class
is one more module of `robust.friction.classes`.
"""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Sequence
from dataclasses import field
from typing import TYPE_CHECKING, ClassVar, NamedTuple, Self

import numpy as np

from nlfrf._base.arguments import require_real
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.exact.claim import Actuator
from robust.friction.exact.classes import PortClaim
from robust.friction.loop import FrictionLoop
from robust.friction.plant import FrictionPlant
from robust.friction.proof.ports import bound_of_ports
from robust.friction.proof.storage import JudgedStorage
from robust.friction.units import MechanicalUnits, format_length, mechanical_units
from robust.pages.section import Fact
from robust.pages.text import format_facts
from robust.proofs.search.certificate import Certificate

if TYPE_CHECKING:
    import control


class ProofTask(NamedTuple):
    """A loop that is to be proved.

    machine, K, delay : the linear part without its delay, the controller, the whole delay [s].
    loop : the sliding loop of these.
    forces : (P,) largest friction force at each port [N]; nan if unknown.
    """

    machine: FrictionPlant
    K: control.StateSpace
    delay: float
    loop: FrictionLoop
    forces: np.ndarray


class FrictionCertificate(NamedTuple):
    """The numbers that prove that the energy of a loop falls; or the last failure, in `reason`.

    ports : the class at each port with the weights of its filters. A `FrictionClaim` needs them
    beside loop and energy. actuator : for a proof with an actuator that saturates; `reason` is then
    why rest is not proved from every state.
    """

    reason: str
    ports: tuple[PortClaim, ...] = ()
    energy: JudgedStorage | None = None
    actuator: Actuator | None = None

    @property
    def kick(self) -> float:
        """Initial velocity [m/s] of a proof with an actuator: infinite for every state, minus
        infinite for no proof.
        """
        if self.actuator is None:
            return -np.inf
        if self.actuator.share < 1:
            return self.actuator.kick
        return np.inf


@value(kw_only=False)
class FrictionClass(ABC):
    """A class of friction laws: all laws within its limits.

    Here friction is the friction force without its viscous part. A class has its limits as fields,
    `excluded`, `description` and `decide`. The rest has defaults; override what does not hold for
    the class:

    - `largest_force`: the given Fs. A class with a limit of its own returns that limit, and refuses
      an Fs that differs from it. A class with a viscous part returns nan, because its force grows
      with the velocity. Then no bound of the motion is proved.
    - `error_bound`: that of any friction force up to Fs. A class whose force exceeds Fs, as with the
      damping of bristles, returns a larger bound, or nan.
    - `stuck`: no spring is tried. A class with laws that stick returns the stiffest spring: if the
      loop with it is unstable, the class is refuted.
    - `describe_proved`: rest from every state. A class that proves less says so.
    - `stuck_element`, `joins_ports`: words of a counterexample, and friction at one port alone.

    A class that is proved by a storage function derives from `CertifiedClass`. A class inside another
    one calls that class in `decide` and does not inherit from it, for example
    `Passive(position_unit=self.position_unit).decide(undecided, task)`.

    The velocity of a port is the rate of its displacement, and a positive friction force opposes a
    positive velocity.

    Fields
    ------
    position_unit : str
        "m", or "rad" for a machine that turns: forces are then in Nm, and N/m stands for Nm/rad.
    """

    position_unit: str = field(default="m", kw_only=True)

    #: Laws that are not in the class; the beginning of what a proof does not claim.
    excluded: ClassVar[str]
    #: An element that does not slip, in the text of a counterexample.
    stuck_element: ClassVar[str] = "a spring"
    #: True if the class may act at several ports at once.
    joins_ports: ClassVar[bool] = False

    def __post_init__(self) -> None:
        mechanical_units(self.position_unit)

    @property
    def units(self) -> MechanicalUnits:
        """Units of position, force, stiffness and damping."""
        return mechanical_units(self.position_unit)

    @property
    @abstractmethod
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""

    @abstractmethod
    def decide(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return the proof, if one is found, of a loop that no stuck element makes unstable.

        If rest is not decided, return `settled_by_bound(undecided)` of `proof/certify.py`, or the
        same with a smaller `settling_error`, if the class has one. `error_bound` holds for any
        friction.

        others : the classes at the other friction ports.
        """

    def stuck(self) -> tuple[float, float]:
        """Return stiffness [N/m] and damping [Ns/m] of the stiffest element that never slips; zero
        if none is tried.
        """
        return 0.0, 0.0

    def largest_force(self, Fs: float) -> float:
        """Return the largest force [N] of the class; Fs if the class has no limit. nan if
        unknown.
        """
        return Fs

    def error_bound(self, loop: FrictionLoop, forces: np.ndarray) -> float:
        """Return the bound of the final distance from rest, with any friction up to these forces;
        inf if there is none.
        """
        return bound_of_ports(loop, forces)

    def describe_proved(self, proof: FrictionProof) -> str:
        """Return what is proved, in words."""
        return "Comes to rest from every state"


@value(kw_only=False)
class CertifiedClass(FrictionClass):
    """A class of friction that is proved by a storage function.

    The level sets of this function also show up to which initial velocity an actuator does not
    saturate.
    """

    @abstractmethod
    def certify(
        self, loop: FrictionLoop, reference: float, others: Sequence[Self] = ()
    ) -> FrictionCertificate:
        """Prove that the storage function of the loop decreases. reference : rate [rad/s]; others :
        classes at the other ports.
        """

    def region(self, task: ProofTask, known: Actuator, left: float) -> FrictionCertificate:
        """Prove rest with an actuator that saturates. left : its limit minus the force that holds
        the friction [N].
        """
        return FrictionCertificate(
            "not tried for this class; up to this kick the actuator does not saturate."
        )


def require_stiction(stiction: float) -> float:
    stiction = require_real("stiction", stiction)
    if stiction < 1:
        raise ValueError(
            "stiction must be at least 1, the ratio of largest to smallest slip force, got"
            f" {stiction:g}"
        )
    return stiction


@value
class SaturatedActuator:
    """An actuator that saturates, and the motion from which rest is proved with it.

    Fields
    ------
    limit : float
        Largest force of the actuator [N].
    kick : float
        Largest initial velocity at the friction port [m/s] from which rest is proved although the
        actuator saturates. The machine starts from rest, without force in the springs of the
        friction. Infinite if rest is proved from every state, zero if nothing is proved.
    kick_linear : float
        Initial velocity [m/s] up to which the actuator does not saturate.
    share : float
        Sector gain of the proof: fraction of the commanded force that the saturated actuator may
        fail to deliver, not counting the force that holds the friction. Zero if the actuator never
        saturates; one if it may deliver nothing.

    References
    ----------
    S. Tarbouriech and others, *Stability and Stabilization of Linear Systems with Saturating
    Actuators*, 2011.

    Examples
    --------
    >>> SaturatedActuator(limit=20.0).kick
    0.0
    """

    limit: float
    kick: float = 0.0
    kick_linear: float = 0.0
    share: float = 0.0


@value
class FrictionProof:
    """Result of a proof that a loop comes to rest with every friction law of a class.

    Fields
    ------
    verdict : FrictionVerdict
        One of:

        - "proved": the machine comes to rest with every friction of the class, from every state and
          after any disturbance that ends; with integral action it comes to rest at the set point.
        - "refuted": a member of the class, `counterexample`, makes the loop unstable. The friction
          of the machine may be another member.
        - "settles": rest is not decided, but the position finally stays within `settling_error`
          with every friction of the class of at most Fs.
        - "not decided": none of these.
    claim, not_claimed, reason : str
        What is proved, what is not proved, and the reason for the verdict, in one sentence each.
    machine : FrictionPlant
        The linear plant.
    friction : tuple of FrictionClass
        The class at each friction port.
    counterexample : tuple of (float, complex) or None
        Stiffness [N/m] of a spring, and the unstable pole of the loop with this spring. The spring
        is a member of the class: a friction that never slips. For several ports: a tuple with one
        stiffness for each port.
    error_bound : float
        Bound [m] on the final distance of the position from rest, with any friction of at most Fs;
        for several ports a bound on each displacement. inf if no Fs was given, if the loop without
        friction is not stable, or if its modes are too fast for the sampling time or too slow to
        compute the bound.
    settling_error : float
        Bound [m] on the final distance of the position from rest, with every friction of the class
        of at most Fs. It is the smaller of two bounds: one for the class, which
        `certificate.verify()` proves over the rationals, and `error_bound`, which is computed in
        floating point. inf if no Fs was given, if the loop comes to rest, or if no bound was found.
    kick_sure : float
        Initial velocity [m/s] from which the machine diverges with every friction of at most Fs;
        inf if no Fs was given, if the loop without friction is stable, or if no such velocity was
        found.
    certificate : Certificate or None
        The certificate behind the verdict, or None; `certificate.verify()` proves it again over the
        rationals.
    actuator : SaturatedActuator or None
        Limit of the actuator, and the initial velocity `actuator.kick` up to which rest is proved
        with it; None if no saturation was given. With saturation `verdict` is "proved" (from every
        state) or "proved up to a kick" (up to this velocity).

    References
    ----------
    A. Rantzer, *Friction analysis based on integral quadratic constraints*, Int. J. Robust
    Nonlinear Control 11, 2001; A. Bisoffi, M. Da Lio, A. Teel, L. Zaccarian, IEEE Trans. Automatic
    Control 63, 2018 (PID and Coulomb friction).

    Examples
    --------
    >>> import control
    >>> from robust.friction import MaxwellSlip
    >>> from robust import prove_friction, friction_plant
    >>> PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)         # 20 kN/m and 60 Ns/m at 1 kHz
    >>> proof = prove_friction(friction_plant(1.0, 80e3, 0.4), PD, MaxwellSlip(64e3))
    >>> proof.verdict, proof.counterexample
    ('proved', None)
    >>> from nlfrf.rig import Drive
    >>> from robust.servo import cascade
    >>> K = cascade(Drive(fs=1000, kv=31, kp=126, kp_unit="N/(m/s)", tn=0.04), output_unit="N")
    >>> proof = prove_friction(friction_plant(1.0, 0.0), K, MaxwellSlip(1e5, 2.0), Fs=1.0)
    >>> proof.verdict, bool(proof.settling_error < 0.8 * proof.error_bound)
    ('settles', True)
    """

    verdict: FrictionVerdict
    claim: str
    not_claimed: str
    reason: str
    machine: FrictionPlant
    friction: tuple[FrictionClass, ...]
    counterexample: tuple[float | tuple[float, ...], complex] | None = None
    error_bound: float = np.inf
    settling_error: float = np.inf
    kick_sure: float = np.inf
    certificate: Certificate | None = None
    actuator: SaturatedActuator | None = None

    @property
    def facts(self) -> tuple[Fact, ...]:
        """Return verdict, claim, what is not decided, the bound for any friction, and what is not
        claimed.
        """
        settles, bounded = self.verdict is FrictionVerdict.SETTLES, np.isfinite(self.error_bound)
        kick = f"certain after a kick of {self.kick_sure:.3g} {self.units.velocity}"
        return (
            Fact(self.verdict, self.claim or self.reason),
            Fact("rest not decided" if settles else "because", self.reason if self.claim else ""),
            Fact(
                "any friction",
                format_length(self.error_bound, self.units.position) if bounded else "",
                meaning=(
                    "largest final distance, at rest or hunting, up to the given force;"
                    " proportional to it"
                ),
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

    @property
    def scope(self) -> str:
        """Noun phrase for the friction at each port, for texts."""
        at = zip(self.friction, self.machine.places, strict=True)
        return " and ".join(f"every {friction.description}{place}" for friction, place in at)
