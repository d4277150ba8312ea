"""How far the uncertainty of a system may grow until its gain reaches a level."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_positive, short_form
from nlfrf._base.values import value
from robust.models.sets.interconnection import UncertainSystem
from robust.mu.skewed import skewed_margin
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability

_GAP = 0.05  # relative distance of what is proved and what was found, to which the box of real parameters is cut


@value
class _RobustGain:
    """Between which factors on all perturbations the gain of a system reaches a level.

    Fields
    ------
    level : float
        The gain.
    proved : float
        Factor up to which the gain stays below the level, at every frequency and for every perturbation; 0: none is
        proved.
    broken : float
        Factor at which a perturbation that was found brings it to the level, or makes the loop unstable; inf where none
        was found.
    worst : dict of str to float
        That perturbation: of each real block its number, of the others their largest singular value, in units of the
        size of the block. Empty where none was found.
    omega : float
        Where the gain reaches the level [rad/s].
    delta : (drives, reads) ndarray
        The same perturbation as one matrix.
    certificates : tuple of Certificate
        The proof, on each part into which the box of real parameters was cut.
    reason : str
        Why broken is more than 5 % above proved; empty where it is not.

    References
    ----------
    SP 8.10.3 (skewed mu).

    Examples
    --------
    >>> lag = control.ss([[-5.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["pole", "d"], outputs="y")
    >>> from robust.models import Block, interconnection
    >>> system = interconnection([lag], {"pole": Block("y", "pole", kind="real")}, inputs="d", outputs="y")
    >>> print(robgain(system, 0.5))                                                     # 1/(s + 5 - pole)
    the gain stays below 0.5 up to 2.99 times the uncertainty, and reaches it at 3 times: pole 3 at 0 Hz
    """

    level: float
    proved: float
    broken: float
    worst: dict[str, float]
    omega: float
    delta: np.ndarray
    certificates: tuple[Certificate, ...]
    reason: str

    def __str__(self) -> str:
        text = f"the gain stays below {self.level:.4g} up to {self.proved:.4g} times the uncertainty"
        if self.worst:
            worst = ", ".join(f"{name} {number:.4g}" for name, number in self.worst.items())
            text += f", and reaches it at {self.broken:.4g} times: {worst} at {format_hertz(self.omega)}"
        return "; ".join(filter(None, (text, self.reason)))


def robgain(system: UncertainSystem, level: float) -> _RobustGain:
    """Find how far the uncertainty may grow until the gain from inputs to outputs reaches a level.

    Parameters
    ----------
    system : UncertainSystem
        With a performance: of `interconnection`, or `UncertaintyModel.loop` with a weight.
    level : float
        Gain that is to stay below.

    Returns
    -------
    RobustGain
        Factors on the sizes of all blocks together. The gain is proved to stay below the level at every frequency, by
        what `robust.analysis.check_structure` proves with. Both factors are 0 where the gain without perturbations
        reaches the level.

    Raises
    ------
    ValueError
        A system without a performance, a level that is not positive.

    References
    ----------
    SP 8.10.3; Seiler, Packard & Balas 2010.

    Examples
    --------
    s^2 + (1 + d) s + 1 with half of its damping left has a gain of 1/(0.5 sqrt(1 - 1/16)):

    >>> from robust.models import Block, interconnection
    >>> mode = control.ss(
    ...     [[0, 1], [-1, -1]], [[0, 0], [-1, 1]], np.eye(2), np.zeros((2, 2)), inputs=["b", "f"], outputs=["x", "v"])
    >>> system = interconnection([mode], {"damping": Block("v", "b", kind="real")}, inputs="f", outputs="x")
    >>> found = robgain(system, 2 / np.sqrt(1 - 1 / 16))
    >>> {name: round(number, 4) for name, number in found.worst.items()}, bool(0.475 < found.proved < found.broken)
    ({'damping': -0.5}, True)
    """
    if not isinstance(system, UncertainSystem):
        raise ValueError(f"system must be an UncertainSystem, as interconnection makes it, got {short_form(system)}")
    if not system.inputs:
        raise ValueError("system must have inputs and outputs for its gain, got one without")
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
    unstable = f"without a perturbation the system is {nominal}" if nominal.unstable else ""
    return _RobustGain(
        level=level,
        proved=0.0 if unstable else found.level,
        broken=0.0 if unstable else found.broken,
        worst=system.perturbation_by_name(delta) if np.isfinite(found.broken) and not unstable else {},
        omega=found.omega,
        delta=delta,
        certificates=() if unstable else found.certificates,
        reason=unstable or found.reason,
    )
