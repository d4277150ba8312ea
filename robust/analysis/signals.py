"""Signals that act on a loop: reference, disturbance and noise of a sensor, each noise in a band or
a step.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import (
    require_kind,
    require_nonnegative,
    require_real,
)
from nlfrf._base.values import value


@value(kw_only=False)
class NoiseSignal:
    """Noise in a loop, with constant power density between two frequencies and zero elsewhere.

    Fields
    ------
    rms : float
        Root mean square, in the unit of the signal.
    omega_min, omega_max : float
        Band [rad/s]. Without an upper end (inf) the band of a sampled loop ends at its Nyquist
        frequency.

    Raises
    ------
    ValueError
        A negative rms, an empty band.

    References
    ----------
    K. J. Åström, *Introduction to Stochastic Control Theory*, 1970, chapter 4.

    Examples
    --------
    >>> NoiseSignal(0.1, omega_max=600.0).omega_min
    0.0
    """

    rms: float
    omega_min: float = 0.0
    omega_max: float = float("inf")

    def __post_init__(self) -> None:
        require_nonnegative("rms", self.rms)
        require_nonnegative("omega_min", self.omega_min)
        if self.omega_max != np.inf:
            require_real("omega_max", self.omega_max)
        if self.omega_max <= self.omega_min:
            raise ValueError(
                f"omega_max must lie above omega_min, {self.omega_min:g} rad/s, got"
                f" {self.omega_max:g}"
            )


@value(kw_only=False)
class StepSignal:
    """A step in a loop at rest.

    Fields
    ------
    height : float
        Height, in the unit of the signal.

    Raises
    ------
    ValueError
        A height that is not one finite real number.

    References
    ----------
    SP 2.4.1.

    Examples
    --------
    >>> StepSignal(1e-3).height
    0.001
    """

    height: float

    def __post_init__(self) -> None:
        require_real("height", self.height)


@value
class LoopSignals:
    """Signals r, d and n that act on the loop u = K (r - y - n), y = G (u + d).

    Fields
    ------
    reference, disturbance, noise : NoiseSignal, StepSignal or None
        Reference r and measurement noise n, in the unit of y, and disturbance d at the plant input,
        in the unit of u. At least one signal is required.

    Raises
    ------
    ValueError
        No signal at all, or a value that is not a signal.

    References
    ----------
    SP 2.2.1.

    Examples
    --------
    >>> signals = LoopSignals(reference=StepSignal(1e-3), noise=NoiseSignal(1e-7))
    >>> sorted(signals.named())
    ['noise', 'reference']
    """

    reference: NoiseSignal | StepSignal | None = None
    disturbance: NoiseSignal | StepSignal | None = None
    noise: NoiseSignal | StepSignal | None = None

    def __post_init__(self) -> None:
        if not self.named():
            raise ValueError("reference, disturbance or noise must be given, got none of them")
        for name, signal in self.named().items():
            require_kind(name, signal, NoiseSignal, StepSignal)

    def named(self) -> dict[str, NoiseSignal | StepSignal]:
        """Return the given signals, by name."""
        every = {"reference": self.reference, "disturbance": self.disturbance, "noise": self.noise}
        return {name: signal for name, signal in every.items() if signal is not None}
