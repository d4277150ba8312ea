"""Hysteresis with non-local memory: the force along a path, from the virgin curve (the force on the
way out from rest).

A virgin curve y(z) is odd, and concave and increasing for z > 0. After a turning point (zm, Fm) the
force follows the branch Fm + 2 y((z - zm) / 2) (Masing). An inner loop that closes is removed from
the memory, and the force continues along the older branch as if the inner loop had not occurred.

The memory is the list of the turning points, or for `MaxwellSlip` the forces of parallel elements,
each a spring that slips at its strength. Both give the same force for a piecewise-linear curve.
"""

from __future__ import annotations

import warnings

import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import DataWarning, require_real_array
from nlfrf.rig.kernels import data as kernel_data
from nlfrf.rig.kernels.data import initial_memory
from nlfrf.rig.laws.curves import (
    Curve,
    ElasticPlastic,
    Exponential,
    Linear,
    MaxwellSlip,
    Parabola,
    Table,
    Tanh,
)

_CURVE_CODES: dict[type, int] = {
    Linear: kernel_data.SPRING,
    Tanh: kernel_data.TANH,
    Exponential: kernel_data.EXPONENTIAL,
    Parabola: kernel_data.PARABOLA,
    ElasticPlastic: kernel_data.ELASTIC_PLASTIC,
    Table: kernel_data.TABLE,
    MaxwellSlip: kernel_data.ELEMENTS,
}


def hysteresis_force(curve: Curve, z: ArrayLike) -> np.ndarray:
    """Return the hysteresis force along a path of displacements, from rest at z = 0.

    Parameters
    ----------
    curve : Linear, Tanh, Exponential, Parabola, ElasticPlastic, Table or MaxwellSlip
        The virgin curve (force on the way out from rest), or the elements.
    z : (n,) ndarray
        Displacements [m]; between two values the motion is monotonic.

    Returns
    -------
    (n,) ndarray
        Forces [N] at these displacements.

    Raises
    ------
    ValueError
        The displacements are not a finite (n,) array.

    References
    ----------
    G. Masing 1926; E. Madelung 1905 (wiping-out rule).

    Examples
    --------
    A closed inner loop does not change the force afterwards: at z = 3 it is that of the virgin
    curve.

    >>> curve = Exponential(1.0, 1.0)
    >>> bool(np.isclose(hysteresis_force(curve, [2, 1, 1.5, 1, 3])[-1], 1 - np.exp(-3.0), rtol=1e-14))
    True
    """
    from nlfrf.rig.kernels import leuven as kernels

    path = np.array(require_real_array("z", z, ndim=1))
    packed, grid = pack_curve(curve)
    memory = initial_memory(packed, grid)
    force = np.empty_like(path)
    kernels.follow_path(packed, grid, memory.state, memory.stack, path, force)
    warn_of_forgotten_loops(memory.state[kernel_data.LOST])
    return force


def warn_of_forgotten_loops(lost: float) -> None:
    """Warn if the memory of turning points was too short."""
    if lost:
        text = (
            f"the hysteresis memory of {kernel_data.STACK_DEPTH} turning points overflowed {lost:g}"
            " times"
        )
        warnings.warn(f"{text}; the innermost loops were forgotten", DataWarning, stacklevel=3)


def pack_curve(curve: Curve) -> tuple[kernel_data.Curve, kernel_data.Grid]:
    """Return the parameters of a curve and its grid for compiled code."""
    if type(curve) not in _CURVE_CODES:
        raise ValueError(
            f"curve must be one of {', '.join(kind.__name__ for kind in _CURVE_CODES)}, got"
            f" {curve!r}"
        )
    numbers = kernel_data.Curve(_CURVE_CODES[type(curve)], float(curve.K0), float(curve.Fy))
    return numbers, curve.grid
