"""Virgin curves of hysteresis: the force over displacement on the way out from rest.

A virgin curve y(z) is odd, and concave and increasing for z > 0.
"""

from __future__ import annotations

import numpy as np

from nlfrf._base.arguments import require_positive, require_real_array
from nlfrf._base.values import ArrayField, freeze_array, value
from nlfrf.rig.kernels import data as kernel_data

NO_GRID = np.zeros((3, 1))  # of a curve that is given by its two parameters alone


@value(kw_only=False)
class _YieldingCurve:
    """A virgin curve with two parameters: stiffness at the origin K0 [N/m] and largest force Fy
    [N].
    """

    K0: float
    Fy: float

    def __post_init__(self) -> None:
        require_positive("K0", self.K0)
        require_positive("Fy", self.Fy)

    @property
    def grid(self) -> kernel_data.Grid:
        """Points or elements for compiled code: none."""
        return NO_GRID


@value(kw_only=False)
class Linear:
    """Virgin curve of a linear spring, y = K0 z, which has no hysteresis.

    The virgin curve is the force y over the displacement z of the first push from rest. With this
    one and n = 1 the Leuven model is the LuGre model.

    Parameters
    ----------
    K0 : float
        Stiffness [N/m].

    Raises
    ------
    ValueError
        K0 is not positive.

    Examples
    --------
    >>> Linear(64e3).K0
    64000.0
    """

    K0: float

    Fy = np.inf  # it never yields

    def __post_init__(self) -> None:
        require_positive("K0", self.K0)

    @property
    def grid(self) -> kernel_data.Grid:
        """Points or elements for compiled code: none."""
        return NO_GRID


@value(kw_only=False)
class Tanh(_YieldingCurve):
    """Virgin curve y = Fy tanh(K0 z / Fy), with distortion of third and higher odd order.

    The virgin curve is the force y over the displacement z of the first push from rest.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        K0 or Fy is not positive.

    References
    ----------
    G. Masing 1926 (rule for a loop from a virgin curve); the curve is our choice, fitted to the
    resonances in the paper of `nlfrf.paper_rig`.

    Examples
    --------
    After a turning point the branch is the virgin curve, enlarged by two: from y(1) it leads to
    -y(1).

    >>> from nlfrf.rig.laws.hysteresis import hysteresis_force
    >>> hysteresis_force(Tanh(1.0, 1.0), [1.0, -1.0]).round(6)
    array([ 0.761594, -0.761594])
    """


@value(kw_only=False)
class Exponential(_YieldingCurve):
    """Virgin curve y = Fy (1 - exp(-K0 |z| / Fy)) sgn z.

    The virgin curve is the force y over the displacement z of the first push from rest. This one is
    curved at the origin, so even small motions lose energy.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        K0 or Fy is not positive.

    References
    ----------
    P. Dahl, *A solid friction model*, Aerospace Corporation, 1968: the curve of Dahl's model with
    exponent 1.

    Examples
    --------
    >>> curve = Exponential(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """


@value(kw_only=False)
class Parabola(_YieldingCurve):
    """Virgin curve y = K0 z - (K0 z)^2 / (4 Fy) up to z = 2 Fy / K0, and constant Fy beyond.

    The virgin curve is the force y over the displacement z of the first push from rest. This one is
    that of many parallel elements, each a spring that yields at a force of its own, with a uniform
    density of yield points.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        K0 or Fy is not positive.

    References
    ----------
    G. Masing 1926 (rule for a loop from a virgin curve).

    Examples
    --------
    >>> curve = Parabola(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """


@value(kw_only=False)
class ElasticPlastic(_YieldingCurve):
    """Virgin curve of one Jenkin element: y = K0 z up to Fy, and constant beyond.

    The virgin curve is the force y over the displacement z of the first push from rest. A Jenkin
    element is a spring in series with a slider that slips at the force Fy.

    Parameters
    ----------
    K0 : float
        Stiffness [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        K0 or Fy is not positive.

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis*, J. Applied Mechanics 33 (1966): one
    Jenkin element.

    Examples
    --------
    >>> curve = ElasticPlastic(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """


@value(kw_only=False)
class Table:
    """Measured virgin curve (force on the way out from rest): straight lines between given points,
    constant beyond the last one.

    Parameters
    ----------
    z : (n,) ndarray
        Displacements [m], positive and increasing; the point (0, 0) is added.
    F : (n,) ndarray
        Forces [N] at these displacements.

    Raises
    ------
    ValueError
        The curve is not concave or not increasing.

    Examples
    --------
    >>> curve = Table([1e-6, 3e-6], [0.1, 0.2])
    >>> round(curve.K0), curve.Fy
    (100000, 0.2)
    """

    z: ArrayField
    F: ArrayField

    def __post_init__(self) -> None:
        z, force = require_real_array("z", self.z, ndim=1), require_real_array("F", self.F, ndim=1)
        if z.size < 1 or force.shape != z.shape:
            raise ValueError(
                f"F must have one force for each of the {z.size} displacements z, got {force.size}"
            )
        steps = np.diff(z, prepend=0.0)
        if np.any(back := steps <= 0):
            raise ValueError(
                f"z must be positive and increasing, got {z[back][0]:g} after"
                f" {(z - steps)[back][0]:g}"
            )
        slope = np.diff(force, prepend=0.0) / steps
        if slope[0] <= 0 or np.any(slope < 0):
            raise ValueError(f"F must be increasing for z > 0, got a slope of {slope.min():g} N/m")
        kinks = np.flatnonzero(np.diff(slope) > 1e-9 * slope[0])
        if kinks.size:
            i = int(kinks[0]) + 1
            raise ValueError(
                "F must be concave for z > 0 (slopes that do not grow), "
                f"got {slope[i]:g} after {slope[i - 1]:g} N/m at z = {z[i - 1]:g} m"
            )
        object.__setattr__(self, "z", freeze_array(z))
        object.__setattr__(self, "F", freeze_array(force))

    @property
    def K0(self) -> float:
        """Stiffness at the origin [N/m]."""
        return float(self.F[0] / self.z[0])

    @property
    def Fy(self) -> float:
        """Largest force [N]."""
        return float(self.F[-1])

    @property
    def grid(self) -> kernel_data.Grid:
        """(3, n + 1) points for compiled code: displacement, force, slope behind it."""
        z, force = np.append(0.0, self.z), np.append(0.0, self.F)
        return np.stack([z, force, np.append(np.diff(force) / np.diff(z), 0.0)])


@value(kw_only=False)
class MaxwellSlip:
    """Virgin curve of parallel elements, each a spring that slips when its force reaches its
    strength.

    The virgin curve is the force y over the displacement z of the first push from rest. A `Table`
    with the same corners gives the same force along any path.

    Parameters
    ----------
    stiffness : (E,) ndarray
        Stiffness k_i of each element [N/m].
    strength : (E,) ndarray
        Force W_i at which each element slips [N].

    Raises
    ------
    ValueError
        Stiffnesses or strengths are not positive, or differ in number.

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis*, J. Applied Mechanics 33 (1966).

    Examples
    --------
    >>> from nlfrf.rig.laws.hysteresis import hysteresis_force
    >>> hysteresis_force(MaxwellSlip([2.0, 1.0], [1.0, 2.0]), [0.5, 1.0, 3.0, 2.5]).tolist()
    [1.5, 2.0, 3.0, 1.5]
    """

    stiffness: ArrayField
    strength: ArrayField

    def __post_init__(self) -> None:
        stiffness = require_real_array("stiffness", self.stiffness, ndim=1)
        strength = require_real_array("strength", self.strength, ndim=1)
        if strength.shape != stiffness.shape or stiffness.size < 1:
            raise ValueError(
                f"strength must have one value for each of the {stiffness.size} stiffnesses, got"
                f" shape {strength.shape}"
            )
        for name, array in (("stiffness", stiffness), ("strength", strength)):
            if not np.all(array > 0):
                raise ValueError(f"{name} must be positive for every element, got {array.min():g}")
            object.__setattr__(self, name, freeze_array(array))

    @property
    def K0(self) -> float:
        """Stiffness of all elements together [N/m]."""
        return float(self.stiffness.sum())

    @property
    def Fy(self) -> float:
        """Largest force [N]."""
        return float(self.strength.sum())

    @property
    def grid(self) -> kernel_data.Grid:
        """(3, E) elements for compiled code: stiffness, strength, zeros."""
        return np.stack([self.stiffness, self.strength, np.zeros(self.stiffness.size)])


Curve = Linear | Tanh | Exponential | Parabola | ElasticPlastic | Table | MaxwellSlip
