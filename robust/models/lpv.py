"""``LpvModel``: a plant or a controller with matrices that are polynomials of an operating
point.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import control
import numpy as np
from numpy.typing import ArrayLike

from nlfrf._base.arguments import (
    require_choice,
    require_integer,
    require_real,
    require_real_array,
)
from nlfrf._base.values import value
from robust._base.types import SystemField, Weight
from robust.lti.lti import one_sampling_time
from robust.lti.realisation import multivariable
from robust.models.sets.forms import DEFAULT_FORM, FORMS
from robust.proofs.exact.claim import LpvMatrices

_LEVELS = ("level", "amplitude", "excitation", "excitation level")


@value
class LpvModel(LpvMatrices):
    """Linear parameter-varying (LPV) model: its matrices are polynomials of an operating point.

    The polynomials are in theta = (2 p - low - high)/(high - low), which is in [-1, 1] for an
    operating point p in [low, high]. The states mean the same at all operating points, so that x' =
    A(theta) x + B(theta) u also holds while theta moves. This is an assumption, because models at
    fixed operating points do not show it (Tóth 2010).

    Fields
    ------
    A, B, C, D : (d + 1, n, n), (d + 1, n, m), (d + 1, p, n), (d + 1, p, m) ndarray
        Coefficients, lowest power of theta first.
    points : (N,) ndarray
        Operating points from which the model was made, increasing. The range is from the first to
        the last.
    dt : float
        Sampling time [s]; 0 for continuous.
    over, unit : str
        Name and unit of the operating point.
    weight : control.StateSpace or None
        Weight W of the set of plants around the model, for every operating point.
    form : str
        Form of the uncertainty: "multiplicative" (at the input of the plant), "additive",
        "inverse-multiplicative" or "inverse-additive". Delta is any causal operator with a gain of
        at most one.
    held_out : float
        Largest error at an operating point that was left out of the fit, divided by the weight; nan
        if none was left out.

    References
    ----------
    Rugh & Shamma, "Research on gain scheduling", Automatica, 2000.
    Tóth, "Modeling and Identification of Linear Parameter-Varying Systems", 2010.

    Examples
    --------
    >>> import control
    >>> soft, stiff = (control.ss([[0, 1], [-k, -0.2]], [[0], [1]], [[1, 0]], 0) for k in (100.0, 140.0))
    >>> plant = LpvModel.from_points([soft, stiff], at=[-0.25, 0.25], over="position", unit="m")
    >>> print(plant)
    order 2, continuous, polynomials of degree 1 of position from -0.25 to 0.25 m
    >>> plant.at(0.0).A[1]
    array([-120. ,   -0.2])
    """

    points: np.ndarray
    over: str = "operating point"
    unit: str = ""
    weight: SystemField = None
    form: str = DEFAULT_FORM
    held_out: float = float("nan")

    def __post_init__(self) -> None:
        if self.over in _LEVELS:
            raise ValueError(
                "over must be a position, a load or another state of the machine, got"
                f" {self.over!r}: a BLA at a level is an average over its record, and no state"
                " of the plant"
            )
        _require_increasing(self.points)
        require_choice(
            "form",
            self.form,
            tuple(name for name, form in FORMS.items() if "M" not in form.rs_factors),
        )
        super().__post_init__()

    @classmethod
    def from_points(
        cls,
        systems: Sequence[control.StateSpace],
        *,
        at: ArrayLike,
        degree: int | None = None,
        over: str = "operating point",
        unit: str = "",
        weight: Weight | None = None,
        form: str = DEFAULT_FORM,
    ) -> LpvModel:
        """Return the model that interpolates the systems at given operating points.

        Parameters
        ----------
        systems : list of control.StateSpace
            One system at each operating point, all with the same states, inputs, outputs and
            sampling time. The states must mean the same at every point (displacement and velocity
            of each mode, for example).
        at : (N,) array_like
            Operating points, increasing.
        degree : int, optional
            Degree of the polynomials, at most N - 1, which is the default. With a lower degree they
            are a least-squares fit to the matrices of the systems.
        over, unit : str
            Name and unit of the operating point.
        weight : control.StateSpace or number, optional
            Weight of the set of plants.
        form : str
            Form of the set.

        Returns
        -------
        LpvModel

        Raises
        ------
        ValueError
            Only one operating point, points that do not increase, a number of systems that differs
            from the number of points, transfer functions, or systems that differ in order, channels
            or sampling time.

        Examples
        --------
        >>> import control
        >>> gains = LpvModel.from_points([control.ss([], [], [], k) for k in (1.0, 2.0, 5.0)], at=[0, 1, 2])
        >>> gains.D.ravel(), float(gains.at(2).D[0, 0])
        (array([2., 2., 1.]), 5.0)
        """
        at, degree = require_points(at, len(systems), degree, "system")
        found = [multivariable("systems", system) for system in systems]
        for given, system in zip(systems, found, strict=True):
            if isinstance(given, control.TransferFunction) and system.nstates:
                raise ValueError(
                    "systems must be state-space systems whose states mean the same at every"
                    " operating point, got a transfer function, which has no states: give matrices"
                    " to control.ss"
                )
        sizes = {(system.nstates, system.ninputs, system.noutputs) for system in found}
        if len(sizes) > 1:
            raise ValueError(
                "systems must have the same states, inputs and outputs at every operating point,"
                " got "
                + " and ".join(f"{n} states, {m} inputs, {p} outputs" for n, m, p in sorted(sizes))
            )
        parts: dict[str, Any] = {
            name: _polynomials_through(
                np.array([getattr(system, name) for system in found], dtype=float), at, degree
            )
            for name in "ABCD"
        }
        return cls(
            **parts,
            points=at,
            dt=one_sampling_time(system.dt for system in found),
            over=over,
            unit=unit,
            weight=None if weight is None else multivariable("weight", weight),
            form=form,
        )

    @property
    def half_range(self) -> float:
        """Half of the range of operating points: d theta/dt = (dp/dt)/half_range."""
        return float(self.points[-1] - self.points[0]) / 2

    def at(self, point: float) -> control.StateSpace:
        """Return the linear model at a fixed operating point.

        Parameters
        ----------
        point : float
            Operating point, inside the range.

        Returns
        -------
        control.StateSpace

        Raises
        ------
        ValueError
            A point outside the range.
        """
        point = require_real("point", point)
        if not self.points[0] <= point <= self.points[-1]:
            raise ValueError(f"point must lie in {self.describe_range()}, got {point:g}")
        powers = to_theta(point, self.points) ** np.arange(len(self.A))
        matrices = (np.tensordot(powers, getattr(self, name), 1) for name in "ABCD")
        return control.StateSpace(*matrices, self.dt, remove_useless_states=False)

    def describe_range(self) -> str:
        """Return the range in words."""
        return f"{self.over} from {self.points[0]:g} to {self.points[-1]:g} {self.unit}".rstrip()

    def __str__(self) -> str:
        if self.dt:
            clock = f"{1 / self.dt:g} Hz"
        else:
            clock = "continuous"
        text = (
            f"order {self.order}, {clock}, polynomials of degree {len(self.A) - 1} of"
            f" {self.describe_range()}"
        )
        text += "" if self.weight is None else f"; {self.form} weight"
        if np.isnan(self.held_out):
            return text
        return f"{text}\n  left-out point: {self.held_out:.2g} of the weight"


def constant_model(name: str, system: object, like: LpvModel) -> LpvModel:
    """Return an `LpvModel` unchanged, and a system as a constant `LpvModel`."""
    if isinstance(system, LpvModel):
        return system
    if isinstance(system, list | tuple):
        raise ValueError(
            f"{name} must be an LpvModel, got {len(system)} systems: LpvModel.from_points(systems,"
            " at=points)"
        )
    return LpvModel.from_points(
        [multivariable(name, system)] * 2,
        at=like.points[[0, -1]],
        degree=0,
        over=like.over,
        unit=like.unit,
    )


def require_points(
    at: ArrayLike, count: int, degree: int | None, what: str
) -> tuple[np.ndarray, int]:
    """Return operating points for a number of systems, and the degree, by default the largest."""
    at = require_real_array("at", at, ndim=1)
    _require_increasing(at)
    if count != at.size:
        raise ValueError(
            f"at must have one operating point for each {what}, got {at.size} for {count}"
        )
    if degree is None:
        degree = at.size - 1
    else:
        degree = require_integer("degree", degree, least=0)
    if degree > at.size - 1:
        raise ValueError(
            f"degree must be at most {at.size - 1} for {at.size} operating points, got {degree}"
        )
    return at, degree


def _polynomials_through(values: np.ndarray, at: np.ndarray, degree: int) -> np.ndarray:
    """Return (d + 1, ...) coefficients in theta of the polynomials closest to values (N, ...) at
    operating points. What is the same at all points does not go with theta, exactly.
    """
    powers = to_theta(at, at)[:, None] ** np.arange(degree + 1)
    known = values.reshape(len(at), -1)
    flat = np.linalg.lstsq(powers, known, rcond=None)[0]
    constant = np.all(known == known[0], axis=0)
    flat[:, constant] = 0.0
    flat[0, constant] = known[0, constant]
    return flat.reshape(degree + 1, *values.shape[1:])


def to_theta(point: ArrayLike, at: np.ndarray) -> np.ndarray:
    """Return theta of operating points: -1 and 1 at the ends of the range of `at`."""
    return np.asarray((2 * np.asarray(point, dtype=float) - at[0] - at[-1]) / (at[-1] - at[0]))


def _require_increasing(at: np.ndarray) -> None:
    if at.ndim != 1 or at.size < 2 or not np.isfinite(at).all() or not np.all(np.diff(at) > 0):
        if np.size(at) == 1:
            got = "one"
        else:
            got = f"{np.asarray(at).tolist()}"
        raise ValueError(f"at must be at least two operating points that increase, got {got}")
