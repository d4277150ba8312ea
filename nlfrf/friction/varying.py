"""Maxwell slip whose sliders vary: with speed, time of rest, position and direction, and at random."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.friction import kernel_data
from nlfrf.friction.curves import MaxwellSlip
from nlfrf.shared.arguments import integer, positive, real
from nlfrf.shared.values import value

__all__ = ["VaryingSliders", "packed_sliders"]


@value
class VaryingSliders:
    """Maxwell slip whose sliders hold more or less, always between a force and its part.

    Elements of a spring and a slider each; a slider of strength W holds, and slips at,

        W [1/stiction + (1 - 1/stiction) m],   0 <= m <= 1,

    m the product of what is asked for: exp(-(v/vs)^2) while it slips, 1 - exp(-rest/dwell) when it has stuck for a
    time, (1 + cos(2 pi x / wavelength)) / 2 along the way, 1 - asymmetry one way, and, where seeded, a number drawn
    anew whenever it sticks. Every one of them lies in `robust.any_maxwell_slip(sum of stiffness, stiction)`.

    Parameters
    ----------
    stiffness : (E,) ndarray
        Of each element [N/m].
    strength : (E,) ndarray
        Largest force of each slider [N].
    stiction : float
        Largest over smallest force of a slider.
    vs : float
        Velocity over which slipping gets easier [m/s]; infinite: it does not.
    dwell : float
        Time of rest over which holding gets harder [s]; zero: at once.
    wavelength : float
        Of the way along which the strength varies [m]; infinite: it does not.
    asymmetry : float
        How much of m is missing in negative direction, 0 to 1.
    seed : int
        Of the numbers drawn; zero for none.

    Raises
    ------
    ValueError
        Elements whose numbers do not fit each other, stiction below one, numbers out of range.

    References
    ----------
    F. Al-Bender, V. Lampaert, J. Swevers, IEEE Trans. Automatic Control 50, 2005 (elements); B. Armstrong-Hélouvry,
    *Control of Machines with Friction*, 1991 (rising static friction, position dependence).

    Examples
    --------
    >>> law = VaryingSliders(stiffness=[4e4, 2.4e4], strength=[0.5, 0.5], stiction=1.4, vs=0.01)
    >>> float(law.strength.sum())
    1.0
    """

    stiffness: Any
    strength: Any
    stiction: float = 1.0
    vs: float = np.inf
    dwell: float = 0.0
    wavelength: float = np.inf
    asymmetry: float = 0.0
    seed: int = 0

    def __post_init__(self) -> None:
        elements = MaxwellSlip(stiffness=self.stiffness, strength=self.strength)
        object.__setattr__(self, "stiffness", elements.stiffness)
        object.__setattr__(self, "strength", elements.strength)
        if real("stiction", self.stiction) < 1:
            raise ValueError(f"stiction must be at least 1, got {self.stiction:g}")
        for name in ("vs", "wavelength"):
            if not np.isposinf(getattr(self, name)):
                positive(name, getattr(self, name))
        if real("dwell", self.dwell) < 0:
            raise ValueError(f"dwell must be zero or positive, got {self.dwell:g}")
        if not 0 <= real("asymmetry", self.asymmetry) <= 1:
            raise ValueError(f"asymmetry must lie between 0 and 1, got {self.asymmetry:g}")
        integer("seed", self.seed, least=0)


def packed_sliders(law: VaryingSliders) -> tuple[kernel_data.Law, kernel_data.Grid]:
    """The law as compiled code reads it: stiffness, strength, phase, and four numbers that all elements share."""
    total, strength = float(np.sum(law.stiffness)), float(np.sum(law.strength))
    n = law.stiffness.size
    grid = np.zeros((7, n))
    grid[0], grid[1] = law.stiffness, law.strength
    grid[2] = 2.399963 * np.arange(n)  # each at a phase of its own, the golden angle apart
    grid[3] = 0.0 if np.isinf(law.wavelength) else 2 * np.pi / law.wavelength
    grid[4], grid[5], grid[6] = law.dwell, law.asymmetry, law.seed
    vs = 1e300 if np.isinf(law.vs) else float(law.vs)
    curve = kernel_data.Curve(kernel_data.VARYING, total, strength)
    return kernel_data.Law(
        kernel_data.SLIDERS, strength, strength / law.stiction, vs, 2.0, 0.0, 0.0, float(law.stiction), curve
    ), grid
