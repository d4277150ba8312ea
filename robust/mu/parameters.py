"""The largest box of real parameters for a stable loop, between a proof and a counter-example
(`robust.mu.skewed`).
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import format_count, format_hertz, require_integer, require_positive
from nlfrf._base.values import value
from robust._base.types import Blocks, LinearSystem
from robust.lti.realisation import multivariable
from robust.mu.blocks import structure_for
from robust.mu.skewed import MOST_BOXES, real_parameters, skewed_margin
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability


@value
class ParameterMargin:
    """Bounds of the factor on all perturbations at which a loop loses its stability.

    Fields
    ------
    proved : float
        Factor up to which the loop is proved to be stable for every parameter of the box and every
        perturbation; 0 if nothing is proved.
    broken : float
        Factor at which a perturbation was found that makes the loop unstable; inf if none was
        found.
    worst : (r,) ndarray
        Parameters at `broken`, block by block, each divided by its size, so that it is in [-1, 1];
        nan for a complex block.
    omega : float
        Frequency at which the pole crosses the stability boundary [rad/s].
    boxes : (L, r, 2) ndarray
        Ends of the boxes into which the whole box is cut, in parameters that are in [-1, 1] at the
        factor `proved`.
    certificates : tuple of Certificate
        Proof for each of these boxes, at all frequencies.
    met : bool
        True if `broken` is within the gap above `proved`.
    reason : str
        Reason why `met` is False; otherwise empty.

    References
    ----------
    Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997.

    Examples
    --------
    >>> import control
    >>> lag = control.ss([[-5.0]], [[1.0]], [[1.0]], [[0.0]])           # s + 5 - d
    >>> found = parameter_margin(lag, [(1, 1, "real")])
    >>> round(found.broken, 3), bool(4.75 < found.proved < 5)
    (5.0, True)
    >>> print(found)
    stable up to 4.985 times the blocks, proved on 1 part; 5 times (+1) puts a pole on the boundary at 0
      Hz
    """

    proved: float
    broken: float
    worst: np.ndarray
    omega: float
    boxes: np.ndarray
    certificates: tuple[Certificate, ...]
    met: bool
    reason: str

    def __str__(self) -> str:
        proved = (
            f"stable up to {self.proved:.4g} times the blocks, proved on"
            f" {format_count(len(self.boxes), 'part')}"
        )
        if np.isfinite(self.broken):
            worst = ", ".join("complex" if np.isnan(one) else f"{one:+.3g}" for one in self.worst)
            broken = (
                f"{self.broken:.4g} times ({worst}) puts a pole on the boundary at"
                f" {format_hertz(self.omega)}"
            )
        else:
            broken = "no destabilising value was found"
        return f"{proved}; {broken}{f'. {self.reason}' * bool(self.reason)}"


def parameter_margin(
    N_ss: LinearSystem, blocks: Blocks, *, gap: float = 0.05, max_boxes: int = MOST_BOXES
) -> ParameterMargin:
    """Find the largest box of real parameters for which the loop is proved to be stable.

    The result is sharp within a relative gap: a box that is larger by `gap` contains an unstable
    loop. If no unstable loop was found in the larger box, the field `met` of the result is False.

    Use this for physical parameters with tolerances, for which complex perturbations would be too
    conservative.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system to which the perturbation is connected (`UncertainSystem.loop`), continuous or
        discrete.
    blocks : list
        Blocks as for `upper`, with at least one real block. The box of the real blocks is
        subdivided; complex blocks are not.
    gap : float
        Relative distance between the proved size of the box and a size that contains an unstable
        loop.
    max_boxes : int
        Largest number of parts into which the box is subdivided. If it is reached, the result
        contains the margins so far, and the reason.

    Returns
    -------
    ParameterMargin
        The margins are factors on the sizes of all perturbations together, that is 1/mu.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss, no real block, or a system that is not stable.

    References
    ----------
    Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997; de Gaston & Safonov 1988.

    Examples
    --------
    The parameter d occurs twice in (s + 1)^2 + d^2. Complex values of size one make the system
    unstable, real values never do.

    >>> import control
    >>> N = control.ss(-np.eye(2), np.eye(2), [[0.0, 1.0], [-1.0, 0.0]], np.zeros((2, 2)))
    >>> found = parameter_margin(N, [(2, 2, "real")])
    >>> found.broken, found.proved > 100
    (inf, True)
    """
    N = multivariable("N_ss", N_ss)
    s = structure_for("blocks", blocks, (N.noutputs, N.ninputs), of="N_ss")
    gap, left = require_positive("gap", gap), require_integer("max_boxes", max_boxes, least=1)
    if "real" not in s.kinds:
        raise ValueError(
            "blocks must contain a real one, got none: use robust.mu.certify for complex blocks"
        )
    nominal = decide_stability(N)
    if not nominal.stable:
        raise ValueError(f"N_ss must be stable, got one that is {nominal}")
    found = skewed_margin(N, blocks, gap=gap, max_boxes=left)
    middles, halves = (
        np.array([box[k] for box in found.boxes]).reshape(-1, len(s.kinds)) for k in (0, 1)
    )
    return ParameterMargin(
        proved=found.level,
        broken=found.broken,
        worst=real_parameters(found.delta, s) / found.broken,
        omega=found.omega,
        boxes=np.stack([middles - halves, middles + halves], axis=-1),
        certificates=found.certificates,
        met=not found.reason,
        reason=found.reason,
    )
