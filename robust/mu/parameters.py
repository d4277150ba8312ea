"""The largest box of real parameters a loop bears, between a proof and a counter-example (`robust.mu.skewed`)."""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_integer, require_positive
from nlfrf._base.values import value
from robust._base.types import Blocks, LinearSystem
from robust.lti.realisation import multivariable
from robust.mu.blocks import structure_for
from robust.mu.skewed import MOST_BOXES, real_parameters, skewed_margin
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.stability import decide_stability


@value
class ParameterMargin:
    """Between which factors on all perturbations a loop loses its stability.

    Fields
    ------
    proved : float
        Factor up to which it is stable for every parameter of the box and every perturbation; 0: nothing is proved.
    broken : float
        Factor at which a perturbation that was found breaks it; inf where none was found.
    worst : (r,) ndarray
        The parameters at `broken`, of size up to one as in `boxes`, block by block; nan for a complex block.
    omega : float
        Where the pole crosses [rad/s].
    boxes : (L, r, 2) ndarray
        Ends of the boxes into which the box was cut at `proved`, of size up to one.
    certificates : tuple of Certificate
        The proof on each of them, at all frequencies.
    met : bool
        Whether broken is within the gap of proved.
    reason : str
        Why not.

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
    """

    proved: float
    broken: float
    worst: np.ndarray
    omega: float
    boxes: np.ndarray
    certificates: tuple[Certificate, ...]
    met: bool
    reason: str


def parameter_margin(
    N_ss: LinearSystem, blocks: Blocks, *, gap: float = 0.05, max_boxes: int = MOST_BOXES
) -> ParameterMargin:
    """Find how large real parameters may be, to a stated gap: proved on every part of the box, broken just above.

    Parameters
    ----------
    N_ss : control.StateSpace
        Stable system that the perturbation closes (`UncertainSystem.loop`), continuous or discrete.
    blocks : list
        As for `upper`, at least one of them real. Real blocks are cut, complex ones are taken whole.
    gap : float
        Relative distance between what is proved and what breaks the loop.
    max_boxes : int
        Parts of the box to look at; the margins known by then are returned, and why they are not closer.

    Returns
    -------
    ParameterMargin
        The margins are those of the perturbations all at once: 1 over the structured singular value.

    Raises
    ------
    ValueError
        Blocks that do not add up to N_ss or none of them real, a system that is not stable.

    References
    ----------
    Balemi, Boyd & Balakrishnan 1991; Newlin & Young 1997; de Gaston & Safonov 1988.

    Examples
    --------
    One parameter in two places, (s + 1)^2 + d^2: complex ones of size one break it, real ones of no size do.

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
        raise ValueError("blocks must hold a real one, got none: robust.mu.certify is for complex ones")
    nominal = decide_stability(N)
    if not nominal.stable:
        raise ValueError(f"N_ss must be stable, got one that is {nominal}")
    found = skewed_margin(N, blocks, gap=gap, max_boxes=left)
    middles, halves = (np.array([box[k] for box in found.boxes]).reshape(-1, len(s.kinds)) for k in (0, 1))
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
