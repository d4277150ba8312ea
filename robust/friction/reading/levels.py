"""Conditions that levels must satisfy before they are used: three or more, of one axis, in SI
units.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from robust.friction.units import position_unit_of

FEWEST_LINES = 8
#: Units of length, angle, force and torque that carry a prefix. The user answers for an unknown
#: unit.
_SCALED_UNITS = {
    *("nm", "um", "µm", "μm", "mm", "cm", "km", "nrad", "urad", "µrad", "μrad", "mrad", "deg", "°"),
    *("mN", "kN", "MN", "mNm", "Nmm", "Ncm", "kNm"),
}


def require_si(name: str, unit: str) -> None:
    """Refuse an FRF whose unit is a known multiple of m/N: mass and stiffness would be wrong by
    that factor.
    """
    parts = {part.strip("() ") for part in unit.split("/")}
    if wrong := sorted(parts & _SCALED_UNITS):
        raise ValueError(
            f"{name} must be in m/N (rad/Nm for a rotary axis), got {unit}: mass and stiffness"
            f" are in kg and N/m, so the prefix of {' and '.join(wrong)} would give wrong"
            " values. Scale the channel before identify"
        )


def require_levels(name: str, units: Sequence[tuple[str, str]], n_lines: Sequence[int]) -> str:
    """Return the position unit of levels, "m" or "rad"; refuse too few levels, two axes, a prefix,
    or too few lines.

    units : position and force unit of each level.
    """
    if len(units) < 3:
        raise ValueError(
            f"{name} must hold at least three levels, from sticking to sliding, got {len(units)}"
        )
    for position, force in units:
        require_si(name, f"{position}/{force}")
    if min(n_lines) < FEWEST_LINES:
        raise ValueError(f"{name} must have at least {FEWEST_LINES} lines each, got {min(n_lines)}")
    found = sorted({position_unit_of(position) for position, _ in units})
    if len(found) > 1:
        given = sorted({position for position, _ in units})
        raise ValueError(f"{name} must be of one axis, got positions in {' and in '.join(given)}")
    return found[0]


def weighted_mean(values: list[float], stds: list[float]) -> tuple[float, float]:
    """Return the mean weighted by inverse variances, and its standard deviation, widened if the
    values scatter more.
    """
    x, weight = np.array(values), 1 / np.maximum(np.array(stds), 1e-300) ** 2
    mean = float(weight @ x / weight.sum())
    excess = float(weight @ (x - mean) ** 2) / max(1, x.size - 1)
    return mean, float(np.sqrt(max(1.0, excess) / weight.sum()))
