"""The factor on the uncertainty of a system at which its gain reaches a level."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_positive, short_form
from nlfrf._base.values import value
from robust.models.sets.interconnection import UncertainSystem
from robust.mu.skewed import skewed_margin
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability

# relative distance of the proved and the found factor at which the subdivision of the parameter box
# stops
_GAP = 0.05


@value
class _RobustGain:
    """Bounds of the factor on all perturbations at which the gain of a system reaches a level
    (skewed mu, SP 8.10.3).

    >>> lag = control.ss([[-5.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["pole", "d"], outputs="y")
    >>> from robust.models import Block, interconnection
    >>> system = interconnection([lag], {"pole": Block("y", "pole", kind="real")}, inputs="d", outputs="y")
    >>> print(robgain(system, 0.5))                                                     # 1/(s + 5 - pole)
    the gain stays below 0.5 up to 2.99 times the uncertainty, and reaches it at 3 times: pole 3 at 0 Hz
    """

    level: float  # the gain
    # the gain stays below the level up to this factor, at every frequency; 0 if nothing is proved
    proved: float
    # at this factor a perturbation brings the gain to the level or makes the loop unstable; inf:
    # none
    broken: float
    # that perturbation: value of each real block, largest singular value of the others, over the
    # size of the block
    worst: dict[str, float]
    omega: float  # frequency at which the gain reaches the level [rad/s]
    delta: np.ndarray  # (drives, reads) the same perturbation as one matrix
    certificates: tuple[Certificate, ...]  # the proof for each part of the box of real parameters
    reason: str  # why broken is more than 5 % above proved; else empty

    def __str__(self) -> str:
        text = (
            f"the gain stays below {self.level:.4g} up to {self.proved:.4g} times the uncertainty"
        )
        if self.worst:
            worst = ", ".join(f"{name} {number:.4g}" for name, number in self.worst.items())
            text += (
                f", and reaches it at {self.broken:.4g} times: {worst} at"
                f" {format_hertz(self.omega)}"
            )
        return "; ".join(filter(None, (text, self.reason)))


def robgain(system: UncertainSystem, level: float) -> _RobustGain:
    """Find the factor on all uncertainties at which the gain from inputs to outputs reaches a
    level.

    Use this for the reserve of a design. A factor of 2 means that the gain stays below the level
    with twice the uncertainty.

    Parameters
    ----------
    system : UncertainSystem
        A system with a performance channel: from `interconnection`, or from `UncertaintyModel.loop`
        with a weight.
    level : float
        Upper limit of the gain.

    Returns
    -------
    RobustGain
        Its fields `proved` and `broken` are factors on the sizes of all blocks together. Up to
        `proved` the gain is proved to stay below the level at every frequency, with the methods of
        `check_structure`. With the factor `broken` the perturbation `worst` raises the gain to the
        level at the frequency `omega`. Both factors are 0 if the gain reaches the level without
        perturbations.

    Raises
    ------
    ValueError
        A system without a performance channel, a level that is not positive.

    References
    ----------
    SP 8.10.3; Seiler, Packard & Balas 2010.

    Examples
    --------
    1/(s^2 + (1 + d) s + 1) with d = -0.5, half of its damping, has a gain of 1/(0.5 sqrt(1 -
    1/16)):

    >>> from robust.models import Block, interconnection
    >>> mode = control.ss(
    ...     [[0, 1], [-1, -1]], [[0, 0], [-1, 1]], np.eye(2), np.zeros((2, 2)), inputs=["b", "f"], outputs=["x", "v"])
    >>> system = interconnection([mode], {"damping": Block("v", "b", kind="real")}, inputs="f", outputs="x")
    >>> found = robgain(system, 2 / np.sqrt(1 - 1 / 16))
    >>> {name: round(number, 4) for name, number in found.worst.items()}, bool(0.475 < found.proved < found.broken)
    ({'damping': -0.5}, True)
    """
    if not isinstance(system, UncertainSystem):
        raise ValueError(
            f"system must be an UncertainSystem, from interconnection(), got {short_form(system)}"
        )
    if not system.inputs:
        raise ValueError(
            "system must have inputs and outputs between which its gain is computed, got none:"
            " give them to interconnection()"
        )
    level = require_positive("level", level)
    nominal, N = decide_stability(system.N), system.N
    rows = system.loop.noutputs
    size = np.where(np.arange(N.noutputs) < rows, 1.0, 1 / level)[:, None]
    growing = np.arange(len(system.with_performance)) < len(system.structure)
    found = skewed_margin(
        control.StateSpace(N.A, N.B, size * N.C, size * N.D, N.dt),
        system.with_performance,
        growing=growing,
        gap=_GAP,
    )
    delta = found.delta[: system.loop.ninputs, :rows]
    if nominal.unstable:
        unstable = f"without a perturbation the system is {nominal}"
    else:
        unstable = ""
    return _RobustGain(
        level=level,
        proved=0.0 if unstable else found.level,
        broken=0.0 if unstable else found.broken,
        worst=(
            system.perturbation_by_name(delta) if np.isfinite(found.broken) and not unstable else {}
        ),
        omega=found.omega,
        delta=delta,
        certificates=() if unstable else found.certificates,
        reason=unstable or found.reason,
    )
