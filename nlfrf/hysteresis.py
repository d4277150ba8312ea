"""Hysteresis with non-local memory: virgin curves, and the force they give along a path.

A virgin curve y(z) is odd, and concave and increasing for z > 0. After a turning point (zm, Fm) the force runs
on the branch Fm + 2 y((z - zm) / 2) (Masing); an inner loop that closes is wiped out of the memory, and the
force goes on along the older branch as if the inner loop had not been.

The memory is kept in one of two ways. A virgin curve keeps a stack of turning points. `MaxwellSlip` keeps
the forces of parallel elements, each a spring that slips at its strength. For a piecewise-linear curve the two
are the same operator.
"""

from __future__ import annotations

import warnings
from typing import Any

import numpy as np

from nlfrf import packing
from nlfrf.checks import DataWarning, integer, positive, real_array
from nlfrf.values import frozen, value

NO_GRID = np.zeros((3, 1))


@value(kw_only=False)
class Yielding:
    """A virgin curve of two numbers: its stiffness at the origin K0 [N/m] and its largest force Fy [N]."""

    K0: float
    Fy: float

    def __post_init__(self) -> None:
        positive("K0", self.K0)
        positive("Fy", self.Fy)


@value(kw_only=False)
class Linear:
    """A spring that never yields, y = K0 z: no hysteresis of its own. With n = 1 it makes the Leuven model LuGre.

    Parameters
    ----------
    K0 : float
        Stiffness [N/m].

    Raises
    ------
    ValueError
        A K0 that is not positive.

    Examples
    --------
    >>> Linear(64e3).K0
    64000.0
    """

    K0: float

    Fy = np.inf  # it never yields

    def __post_init__(self) -> None:
        positive("K0", self.K0)

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        return self.K0 * np.asarray(z, dtype=float)


@value(kw_only=False)
class Tanh(Yielding):
    """y = Fy tanh(K0 z / Fy): odd distortion that starts with the third power of the displacement.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        Numbers that are not positive.

    References
    ----------
    G. Masing 1926 (the rule that makes a loop of a virgin curve); the curve is ours, fitted to the paper's resonances.

    Examples
    --------
    The branch after a turning point is the virgin curve at twice the size: from y(1) back to -y(1).

    >>> hysteresis_force(Tanh(1.0, 1.0), [1.0, -1.0]).round(6)
    array([ 0.761594, -0.761594])
    """

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        return self.Fy * np.tanh(self.K0 / self.Fy * np.asarray(z, dtype=float))


@value(kw_only=False)
class Exponential(Yielding):
    """y = Fy (1 - exp(-K0 |z| / Fy)) sgn z: curved from the origin on, so small motions already lose energy.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        Numbers that are not positive.

    References
    ----------
    P. Dahl, *A solid friction model*, Aerospace Corporation, 1968: the curve of its model of exponent one.

    Examples
    --------
    >>> curve = Exponential(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        z = np.asarray(z, dtype=float)
        return -np.sign(z) * self.Fy * np.expm1(-self.K0 / self.Fy * np.abs(z))


@value(kw_only=False)
class Parabola(Yielding):
    """y = K0 z - (K0 z)^2 / (4 Fy) up to Fy at z = 2 Fy / K0, flat beyond: a uniform density of yielding elements.

    Parameters
    ----------
    K0 : float
        Stiffness at the origin [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        Numbers that are not positive.

    References
    ----------
    G. Masing 1926 (the rule that makes a loop of a virgin curve).

    Examples
    --------
    >>> curve = Parabola(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        z = np.asarray(z, dtype=float)
        rest = np.maximum(1 - self.K0 / (2 * self.Fy) * np.abs(z), 0)
        return np.sign(z) * self.Fy * (1 - rest**2)


@value(kw_only=False)
class ElasticPlastic(Yielding):
    """y = K0 z up to Fy, flat beyond: a single yielding element (Jenkins).

    Parameters
    ----------
    K0 : float
        Stiffness [N/m].
    Fy : float
        Largest force [N].

    Raises
    ------
    ValueError
        Numbers that are not positive.

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis*, J. Applied Mechanics 33 (1966): one Jenkin element.

    Examples
    --------
    >>> curve = ElasticPlastic(64e3, 1.0)
    >>> curve.K0, curve.Fy
    (64000.0, 1.0)
    """

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        return np.clip(self.K0 * np.asarray(z, dtype=float), -self.Fy, self.Fy)


@value(kw_only=False)
class Table:
    """A measured virgin curve: straight lines between points, flat beyond the last one.

    Parameters
    ----------
    z : (n,) ndarray
        Displacements [m], increasing. Positive only, the origin is added; or on both sides, then symmetric.
    F : (n,) ndarray
        Forces [N] at these displacements.

    Raises
    ------
    ValueError
        A curve that is not odd, not concave or not increasing for z > 0.

    Examples
    --------
    >>> float(Table([1e-6, 3e-6], [0.1, 0.2])(-2e-6).round(12))
    -0.15
    """

    z: Any
    F: Any

    def __post_init__(self) -> None:
        z, force = real_array("z", self.z, ndim=1), real_array("F", self.F, ndim=1)
        if z.size < 1 or force.shape != z.shape:
            raise ValueError(f"F must have one force for each of the {z.size} displacements z, got {force.size}")
        if np.any(np.diff(z) <= 0):
            raise ValueError(f"z must be increasing, got {z[1:][np.diff(z) <= 0][0]:g} after a larger or equal one")
        if z[0] < 0:
            odd = np.allclose(z, -z[::-1], rtol=1e-9, atol=0) and np.allclose(force, -force[::-1], rtol=1e-9, atol=0)
            if not odd:
                raise ValueError("F must be an odd curve, F(-z) = -F(z) at every point, got one that is not")
        z, force = z[z > 0], force[z > 0]
        if z.size == 0:
            raise ValueError("z must hold at least one positive displacement, got none")
        slope = np.diff(force, prepend=0.0) / np.diff(z, prepend=0.0)
        if slope[0] <= 0 or np.any(slope < 0):
            raise ValueError(f"F must be increasing for z > 0, got a slope of {slope.min():g} N/m")
        bent = np.flatnonzero(np.diff(slope) > 1e-9 * slope[0])
        if bent.size:
            i = int(bent[0]) + 1
            raise ValueError(
                f"F must be concave for z > 0 (slopes that do not grow), "
                f"got {slope[i]:g} after {slope[i - 1]:g} N/m at z = {z[i - 1]:g} m"
            )
        object.__setattr__(self, "z", frozen(z, True))
        object.__setattr__(self, "F", frozen(force, True))

    @property
    def K0(self) -> float:
        """Stiffness at the origin [N/m]."""
        return float(self.F[0] / self.z[0])

    @property
    def Fy(self) -> float:
        """Largest force [N]."""
        return float(self.F[-1])

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        z = np.asarray(z, dtype=float)
        return np.sign(z) * np.interp(np.abs(z), np.append(0.0, self.z), np.append(0.0, self.F))


@value(kw_only=False)
class MaxwellSlip:
    """Parallel elements, each a spring that slips when its force reaches its strength.

    The same operator as a `Table` of its knots, with the forces of the elements as the memory.

    Parameters
    ----------
    stiffness : (E,) ndarray
        Stiffness k_i of each element [N/m].
    strength : (E,) ndarray
        Force W_i at which each element slips [N]; infinite for a spring that never slips.

    Raises
    ------
    ValueError
        Stiffnesses and strengths that are not positive or not one for one.

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis*, J. Applied Mechanics 33 (1966).

    Examples
    --------
    >>> hysteresis_force(MaxwellSlip([2.0, 1.0], [1.0, 2.0]), [0.5, 1.0, 3.0, 2.5]).tolist()
    [1.5, 2.0, 3.0, 1.5]
    """

    stiffness: Any
    strength: Any

    def __post_init__(self) -> None:
        stiffness = real_array("stiffness", self.stiffness, ndim=1)
        strength = np.asarray(self.strength, dtype=float)
        if strength.shape != stiffness.shape or stiffness.size < 1:
            raise ValueError(
                f"strength must have one value for each of the {stiffness.size} stiffnesses, got shape {strength.shape}"
            )
        for name, array in (("stiffness", stiffness), ("strength", strength)):
            if not np.all(array > 0):
                raise ValueError(f"{name} must be positive for every element, got {array.min():g}")
            object.__setattr__(self, name, frozen(array, True))

    @property
    def K0(self) -> float:
        """Stiffness of all elements together [N/m]."""
        return float(self.stiffness.sum())

    @property
    def Fy(self) -> float:
        """Largest force [N]."""
        return float(self.strength.sum())

    @property
    def knots(self) -> np.ndarray:
        """(E,) displacement at which each element first slips [m]."""
        return self.strength / self.stiffness

    def __call__(self, z: Any) -> np.ndarray:
        """Virgin curve y(z) [N]."""
        z = np.asarray(z, dtype=float)[..., np.newaxis]
        return np.clip(self.stiffness * z, -self.strength, self.strength).sum(axis=-1)


Curve = Linear | Tanh | Exponential | Parabola | ElasticPlastic | Table | MaxwellSlip

KINDS: dict[type, int] = {
    Linear: packing.SPRING,
    Tanh: packing.TANH,
    Exponential: packing.EXPONENTIAL,
    Parabola: packing.PARABOLA,
    ElasticPlastic: packing.ELASTIC_PLASTIC,
    Table: packing.TABLE,
    MaxwellSlip: packing.ELEMENTS,
}


def hysteresis_force(curve: Curve, z: Any) -> np.ndarray:
    """Force along a path of displacements that starts at rest at z = 0, with all its memory.

    Parameters
    ----------
    curve : Linear, Tanh, Exponential, Parabola, ElasticPlastic, Table or MaxwellSlip
        The virgin curve, or the elements.
    z : (n,) ndarray
        Displacements [m]; between two of them the motion goes one way.

    Returns
    -------
    (n,) ndarray
        Forces [N] at these displacements.

    Raises
    ------
    ValueError
        Displacements that are not one finite path.

    References
    ----------
    G. Masing 1926; E. Madelung 1905 (wiping out).

    Examples
    --------
    A closed inner loop leaves no trace: 3 is reached with the same force with it and without it.

    >>> curve = Exponential(1.0, 1.0)
    >>> bool(np.isclose(hysteresis_force(curve, [2, 1, 1.5, 1, 3])[-1], curve(3.0), rtol=1e-14))
    True
    """
    from nlfrf import kernels

    path = np.array(real_array("z", z, ndim=1))
    packed, grid = packed_curve(curve)
    memory = packing.at_rest(packed, grid)
    force = np.empty_like(path)
    kernels.follow(packed, grid, memory.state, memory.stack, path, force)
    warn_lost(memory.state[packing.LOST])
    return force


def warn_lost(lost: float) -> None:
    """Warn where the memory of turning points was too short."""
    if lost:
        said = f"the hysteresis memory of {packing.STACK_DEPTH} turning points overflowed {lost:g} times"
        warnings.warn(f"{said}; the innermost loops were forgotten", DataWarning, stacklevel=3)


def fit_maxwell_slip(curve: Curve, *, n_elements: int = 16, decades: float = 2.0) -> MaxwellSlip:
    """Elements that stand for a curve: its chords between graded knots.

    Graded, because elements are exactly linear below the first knot: evenly spaced ones would show no
    hysteresis, and no distortion, in small motions. Half of the knots go where the curve bends, half are spread
    over the powers of ten below. Where the curve consists of straight lines already, with no
    more corners than elements, the elements are exact.

    Parameters
    ----------
    curve : Linear, Tanh, Exponential, Parabola, ElasticPlastic or Table
        The virgin curve.
    n_elements : int
        Elements at most.
    decades : float
        Powers of ten from the first knot to the displacement where the curve ends.

    Returns
    -------
    MaxwellSlip

    Raises
    ------
    ValueError
        Fewer than one element, decades that are not positive.

    References
    ----------
    W. D. Iwan, *A distributed-element model for hysteresis*, J. Applied Mechanics 33 (1966).

    Examples
    --------
    >>> elements = fit_maxwell_slip(Tanh(64e3, 1.0), n_elements=32)
    >>> z = np.linspace(0, 1e-4, 1000)
    >>> bool(np.abs(elements(z) - np.tanh(64e3 * z)).max() < 5e-3)
    True
    """
    n_elements = integer("n_elements", n_elements, least=1)
    decades = positive("decades", decades)
    packed_curve(curve)
    if isinstance(curve, MaxwellSlip):
        return curve
    if isinstance(curve, Linear):
        return MaxwellSlip(stiffness=[curve.K0], strength=[np.inf])
    if isinstance(curve, ElasticPlastic):
        return MaxwellSlip(stiffness=[curve.K0], strength=[curve.Fy])
    if isinstance(curve, Table) and curve.z.size <= n_elements:
        knots = curve.z
    else:
        knots = graded_knots(curve, n_elements, decades)
    force = np.append(np.asarray(curve(knots[:-1])), curve.Fy)
    slope = np.append(np.diff(force, prepend=0.0) / np.diff(knots, prepend=0.0), 0.0)
    stiffness = -np.diff(slope)
    used = stiffness > 1e-12 * curve.K0  # a knot on a straight piece needs no element
    return MaxwellSlip(stiffness=stiffness[used], strength=(stiffness * knots)[used])


def graded_knots(curve: Curve, n_knots: int, decades: float) -> np.ndarray:
    """Knots up to the end of a curve: their density is the mean of sqrt|y''|, which evens out the error, and 1/z."""
    far = curve.Fy / curve.K0 * np.geomspace(1, 1e6, 2000)
    end = far[np.argmax(curve(far) >= (1 - 0.05 / n_knots**2) * curve.Fy)]
    z = end * np.logspace(-decades, 0, 2000)
    bend = np.sqrt(np.abs(np.gradient(np.gradient(curve(z), z), z)))
    share = np.concatenate([[0.0], np.cumsum((bend[1:] + bend[:-1]) / 2 * np.diff(z))])
    place = share / share[-1] + np.linspace(0, 1, z.size)
    return np.interp(np.linspace(0, place[-1], n_knots), place, z)


def packed_curve(curve: Curve) -> tuple[packing.Curve, packing.Grid]:
    """The curve as the compiled code reads it."""
    if type(curve) not in KINDS:
        raise ValueError(f"curve must be one of {', '.join(kind.__name__ for kind in KINDS)}, got {curve!r}")
    grid = NO_GRID
    if isinstance(curve, Table):
        z, force = np.append(0.0, curve.z), np.append(0.0, curve.F)
        grid = np.stack([z, force, np.append(np.diff(force) / np.diff(z), 0.0)])
    if isinstance(curve, MaxwellSlip):
        grid = np.stack([curve.stiffness, curve.strength, np.zeros(curve.stiffness.size)])
    return packing.Curve(KINDS[type(curve)], float(curve.K0), float(curve.Fy)), grid
