"""Stability of a loop or of a matrix of doubles, decided where floating point cannot tell.

The characteristic polynomial of a matrix of doubles is exact over the rationals, and Routh's array decides: stable or
not, with nothing in between. A plant behind a hold has balls for coefficients, made smaller until they decide; only a
pole exactly on the boundary stays undecided there.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from robust.verification.axis import loop_axis
from robust.verification.claim import Matrices
from robust.verification.exact import Quotient, mapped, rational_matrix
from robust.verification.half_line import Decision, proved, undecided
from robust.verification.stability import hurwitz_with_delay, routh

__all__ = ["stable_loop", "stable_matrix", "stable_quotients"]


BITS = (256, 1024, 4096)


def stable_loop(plant: Matrices, controller: Matrices, *, delay: float = 0.0) -> Decision:
    """Whether every pole of u = K (r - y) around the plant, hidden modes included, is strictly stable.

    Hold and delay count as in `LoopClaim`, the delay of a continuous loop as it is. It `holds` where
    it is stable, and is `violated` where it is not.

    >>> import numpy as np
    >>> one = np.ones((1, 1))
    >>> def gain(k): return Matrices(A=np.zeros((0, 0)), B=np.zeros((0, 1)), C=np.zeros((1, 0)), D=k * one)
    >>> lag = Matrices(A=-one, B=one, C=one, D=0 * one)                       # 1/(s + 1): stable for K > -1
    >>> [stable_loop(lag, gain(k)).holds for k in (-1.0, np.nextafter(-1, 0))]
    [False, True]
    """
    from flint import ctx

    found = undecided("not looked at", needs_digits=True)
    for bits in BITS:
        with ctx.workprec(bits):
            G, K, _, rest = loop_axis(plant, controller, delay)
            found = stable_quotients(G, K, rest)
        if not found.needs_digits:
            break
    return found


def stable_matrix(A: np.ndarray, *, discrete: bool = False) -> Decision:
    """Whether every eigenvalue of a matrix of doubles lies in the open left half plane, or inside the unit circle.

    >>> import numpy as np
    >>> [stable_matrix(np.array([[0.0, 1.0], [-1.0, d]])).holds for d in (0.0, -5e-324, 5e-324)]
    [False, True, False]
    """
    n = len(A)
    if not n:
        return proved()
    p = rational_matrix(np.asarray(A, dtype=float)).charpoly()
    return routh(mapped(Quotient(num=p, den=p, degree=n)).den if discrete else p, n)


def stable_quotients(G: Quotient, K: Quotient, delay: Any) -> Decision:
    """Whether the loop of two quotients on one axis, and a delay (fmpq), is stable, at the precision of the moment."""
    from flint import arb_poly

    kind = type(G.num) if type(G.num) is type(K.num) else arb_poly
    N, D = kind(G.num) * kind(K.num), kind(G.den) * kind(K.den)
    if delay > 0:
        return hurwitz_with_delay(D, N, G.degree + K.degree, delay)
    return routh(N + D, G.degree + K.degree)
