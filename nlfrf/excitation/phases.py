"""What vectors of random phases have in common by chance."""

from __future__ import annotations

__all__ = ["in_common"]


def in_common(chance: float, n: float) -> float:
    """The share of power that unit vectors of n random phases have in common, but for so small a chance.

    They have more than c in common with probability (1 - c)^(n - 1).

    >>> round(in_common(0.01, 2), 2), round(in_common(0.01, 100), 3)
    (0.99, 0.045)
    """
    return float(1 - chance ** (1 / (n - 1)))
