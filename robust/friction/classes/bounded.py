"""Any friction up to a largest force."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar, Self

import numpy as np

from nlfrf._base.arguments import require_nonnegative, require_positive
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.loop import FrictionLoop, format_pole_modulus
from robust.friction.proof.ports import bound_of_ports
from robust.friction.proof.protocol import FrictionClass, FrictionProof, ProofTask

#: A pole this close to the stability boundary, in 1/s or in |z|, is on it.
_ROUNDING = 1e-9


@value(kw_only=False)
class Bounded(FrictionClass):
    """Class of all friction laws whose force does not exceed a bound Fs.

    The friction force is f = s + tau s', with |s| <= Fs and a constant tau from 0 to
    `bristle_time`. The force s may depend on anything. The class contains LuGre (s = sigma0 z, tau
    = sigma1/sigma0), Dahl, every Maxwell-slip law, and rigid stiction.

    Use this class if only the largest force is known. The proof is then a bound on the final
    distance from the rest position, not a proof that the machine comes to rest.

    Fields
    ------
    Fs : float
        Largest friction force, without viscous friction [N].
    bristle_time : float
        Largest ratio of damping to stiffness of the bristles [s].
    position_unit : str
        "m", or "rad" with Nm.

    Raises
    ------
    ValueError
        A force that is not positive, or a negative time.

    References
    ----------
    B. Armstrong-Hélouvry, *Control of Machines with Friction*, Kluwer, 1991.

    Examples
    --------
    >>> Bounded(1.0).Fs
    1.0
    """

    Fs: float
    bristle_time: float = 0.0

    excluded: ClassVar[str] = "a viscous part of the friction, "

    def __post_init__(self) -> None:
        super().__post_init__()
        object.__setattr__(self, "Fs", require_positive("Fs", self.Fs))
        object.__setattr__(
            self, "bristle_time", require_nonnegative("bristle_time", self.bristle_time)
        )

    @property
    def description(self) -> str:
        """Noun phrase for the laws of the class, for texts."""
        damped = (
            f" on bristles with a damping of up to {1e3 * self.bristle_time:.3g} ms times their"
            " stiffness"
        )
        return f"friction of at most {self.Fs:g} {self.units.force}" + damped * (
            self.bristle_time > 0
        )

    def largest_force(self, Fs: float) -> float:
        """Return the largest force of the class [N]; a given Fs must be equal to it."""
        if np.isfinite(Fs) and Fs != self.Fs:
            raise ValueError(
                f"Fs must be left out or equal to Fs of the class, {self.Fs:g}"
                f" {self.units.force}, got {Fs:g}"
            )
        return self.Fs

    def error_bound(self, loop: FrictionLoop, forces: np.ndarray) -> float:
        """Return the largest final distance from rest; inf if none is known."""
        return bound_of_ports(loop, forces, self.bristle_time)

    def describe_proved(self, proof: FrictionProof) -> str:
        """Describe the proved distance from rest in a sentence."""
        return f"Eventually stays within {proof.error_bound:.3g} {proof.units.position} of rest"

    def decide(
        self, undecided: FrictionProof, task: ProofTask, others: Sequence[Self] = ()
    ) -> FrictionProof:
        """Return "proved" if a finite bound is found, else "not decided" with the reason."""
        if np.isfinite(undecided.error_bound):
            return replace(undecided, verdict=FrictionVerdict.PROVED)
        growth = task.loop.growth() + 0.0
        if task.loop.T:
            size = f"|z| = {format_pole_modulus(1 + growth)}"
        else:
            size = f"real part {growth:.4g} rad/s"
        if growth >= -_ROUNDING:
            what = "is on the stability boundary"
        else:
            what = "has modes too far apart for the computation"
        return replace(
            undecided,
            reason=(
                f"no bound was found: the sliding loop, with all states of its controller, {what}"
                f" (without friction it has a pole of {size})"
            ),
        )
