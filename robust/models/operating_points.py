"""One model of a plant measured at several operating points: modes paired by frequency,
polynomials, one weight.

A local FRF determines the plant at a fixed operating point only up to a change of states, which may
depend on the operating point. So a realisation has to be assumed (De Caigny, Camino & Swevers 2011;
Tóth 2010). Here the states of each mode are its displacement and its velocity,

    x1' = -a1 x1 + x2 + c1 u,  x2' = -a0 x1 + c0 u,  y = sum of all x1,    (c1 s + c0)/(s^2 + a1 s + a0) for each pair

with polynomials of the operating point for a0, a1, c1 and c0. Two real poles are a pair, too; a
single remaining real pole has a section of its own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np
from numpy.typing import ArrayLike
from scipy.linalg import block_diag

from nlfrf import Bla
from nlfrf._base.arguments import (
    data_warning,
    require_kind,
    require_nonnegative,
)
from robust._base.warnings import DesignWarning
from robust.lti.lti import response
from robust.models.fit.nominal import fit_nominal
from robust.models.fit.nominal_fit import NominalFit
from robust.models.lpv import LpvModel, require_points
from robust.models.sets.build import uncertainty
from robust.models.sets.forms import DEFAULT_FORM, FORMS
from robust.models.sets.radius import Extrapolation, checked_slope, fit_covering_weight


def interpolate(
    blas: Sequence[Bla],
    *,
    at: ArrayLike,
    n_poles: int,
    degree: int = 2,
    dt: float = 0.0,
    delay: float = 0.0,
    form: str = DEFAULT_FORM,
    order: int | None = None,
    confidence: float = 0.95,
    below: str | float = "flat",
    above: str | float = "flat",
    over: str = "operating point",
    unit: str = "",
) -> LpvModel:
    """Fit one parameter-dependent model with one weight to BLAs at several operating points.

    A nominal is fitted at each operating point. Its poles are paired by frequency, and the
    coefficients of the pairs are interpolated by polynomials of the operating point. The weight
    covers the local bounds at all points around the interpolated model, so that it contains the
    interpolation error at these points.

    The error between the points is tested by leaving out each inner point in turn. A model is made
    from the other points, and its error at the left-out point is divided by the weight. `held_out`
    is the largest of these numbers. It should be below one. With degree N - 1 the model from the
    other points has degree N - 2.

    Parameters
    ----------
    blas : list of nlfrf.Bla
        One BLA for each operating point, with one input and one output. All BLAs have the same
        lines.
    at : (N,) array_like
        Operating points, increasing. Do not give levels of excitation: a BLA at one level is an
        average over the motion.
    n_poles : int
        Number of poles at each point.
    degree : int
        Degree of the polynomials, at most N - 1.
    dt : float
        Sampling time [s] of the controller for which the weight is made; 0 for a continuous
        controller. The plant is continuous in both cases.
    delay : float
        Known delay [s] of the plant in the records. The model does not contain it, so give it to
        `prove_schedule`.
    form : str
        Form of the set, as in `LpvModel`.
    order : int, optional
        Order of the weight.
    confidence : float
        Probability of the local bounds on each line.
    below, above : "flat" or float
        Assumption about the radius outside the measured band, as in `uncertainty`.
    over, unit : str
        Name and unit of the operating point.

    Returns
    -------
    LpvModel

    Warns
    -----
    DesignWarning
        A left-out point outside the weight; warnings of the fits.

    Raises
    ------
    ValueError
        Only one operating point, points that do not increase, a number of BLAs that differs from
        the number of points, lines that differ, modes too close to be distinguished, or an
        interpolated plant that is unstable where the fits are stable.

    References
    ----------
    De Caigny, Camino & Swevers, "Interpolation-based modeling of MIMO LPV systems", IEEE TCST,
    2011.

    Examples
    --------
    >>> import nlfrf
    >>> f, points = np.linspace(1, 40, 80), np.linspace(-1, 1, 5)
    >>> s = 2j * np.pi * f
    >>> frfs = [1 / (s**2 + 3 * s + (80 + 8 * p)**2) for p in points]
    >>> blas = [nlfrf.bla_from_frf(f, G, std=0.01 * np.abs(G)) for G in frfs]
    >>> plant = interpolate(blas, at=points, n_poles=2, degree=2, over="position", unit="m")
    >>> plant.order, plant.held_out < 0.1
    (2, True)
    """
    points, degree = require_points(at, len(blas), degree, "BLA")
    _require_same_lines(blas)
    dt = require_nonnegative("dt", dt)
    fits = [fit_nominal(bla, n_poles=n_poles, delay=delay) for bla in blas]
    sections = np.array([_sections(fit.G) for fit in fits])
    _require_apart(sections, points, over, unit)
    known = {"over": over, "unit": unit, "form": form}
    plant = LpvModel.from_points(_realise(sections), at=points, degree=degree, **known)
    models = [
        uncertainty(bla, replace(fit, G=plant.at(p)), form=form, confidence=confidence, order=order)
        for bla, fit, p in zip(blas, fits, points, strict=True)
    ]
    radius = np.max([model.radius for model in models], axis=0)
    rules = Extrapolation(below=checked_slope("below", below), above=checked_slope("above", above))
    omega = blas[0].omega
    weight = fit_covering_weight(omega, radius, order=order, rules=rules, dt=dt)
    held_out = _held_out(sections, points, degree, fits, weight, omega, form)
    _warn_of_held_out(held_out, points.size, degree)
    return replace(plant, weight=weight, held_out=held_out)


def _require_same_lines(blas: Sequence[Bla]) -> None:
    """Refuse anything but BLAs on the same lines."""
    for bla in blas:
        require_kind("blas", bla, Bla)
        if bla.omega.shape != blas[0].omega.shape or not np.allclose(
            bla.omega, blas[0].omega, rtol=1e-9
        ):
            raise ValueError("blas must have the same lines at every operating point, got others")


def _warn_of_held_out(held_out: float, n_points: int, degree: int) -> None:
    """Warn if a left-out point is outside the weight around the model of the other points."""
    if not held_out > 1:
        return
    tried = n_points - 2
    change = ", or change the degree"
    if degree > tried:
        change = f" (the {tried + 1} other points allow a degree of {tried} only, not {degree})"
    data_warning(
        f"a left-out operating point deviates by {held_out:.2g} times the weight from the"
        " model of the other points, so the model may be wrong between the points: add"
        f" operating points{change}",
        DesignWarning,
    )


def _sections(G: control.StateSpace) -> np.ndarray:
    """Return (S, 4) a0, a1, c0, c1 of each pair of poles, the slowest first; a1 and c1 of a single
    pole are nan.
    """
    poles, modes = np.linalg.eig(G.A)
    residues = (G.C @ modes).ravel() * np.linalg.solve(modes, G.B).ravel()
    real = np.flatnonzero(np.abs(poles.imag) <= 1e-9 * np.abs(poles))
    real = real[np.argsort(np.abs(poles[real]))]
    upper = np.flatnonzero(poles.imag > 1e-9 * np.abs(poles))
    pairs = [(poles[i], poles[i].conj(), residues[i], residues[i].conj()) for i in upper]
    pairs += [
        (poles[i], poles[j], residues[i], residues[j])
        for i, j in zip(real[::2], real[1::2], strict=False)
    ]
    made = [
        [(p * q).real, -(p + q).real, -(r * q + s * p).real, (r + s).real] for p, q, r, s in pairs
    ]
    made.sort(key=lambda row: abs(row[0]))
    if real.size % 2:
        made.append([-poles[real[-1]].real, np.nan, residues[real[-1]].real, np.nan])
    return np.array(made)


def _require_apart(sections: np.ndarray, points: np.ndarray, over: str, unit: str) -> None:
    """Refuse sections that cannot be told apart from point to point by their frequency."""
    if np.any(np.isnan(sections).any(axis=2) != np.isnan(sections[0]).any(axis=1)):
        raise ValueError(
            "n_poles must give real or complex poles at every operating point alike, got a"
            " pair that is real at one point and complex at another"
        )
    pairs = np.flatnonzero(~np.isnan(sections[0, :, 1]))
    size = np.log(np.maximum(np.abs(sections[:, pairs, 0]), 1e-300)) / 2
    moves, gaps = np.abs(np.diff(size, axis=0)), np.diff(size, axis=1)
    for k in range(len(points) - 1):
        for i in range(pairs.size - 1):
            if max(moves[k, i], moves[k, i + 1]) >= min(gaps[k, i], gaps[k + 1, i]):
                f = np.exp(size[k, [i, i + 1]]) / 2 / np.pi
                raise ValueError(
                    f"at must have more operating points between {points[k]:g} and"
                    f" {points[k + 1]:g} {unit}".rstrip()
                    + f": the modes at {f[0]:.3g} and {f[1]:.3g} Hz move by more than their"
                    " distance between these points, and cannot be paired"
                )


def _realise(sections: np.ndarray) -> list[control.StateSpace]:
    """Return the plant at each point in one realisation."""
    made = []
    for point in sections:
        A, B, C = [], [], []
        for a0, a1, c0, c1 in point:
            single = np.isnan(a1)
            A.append([[-a0]] if single else [[-a1, 1.0], [-a0, 0.0]])
            B += [c0] if single else [c1, c0]
            C += [1.0] if single else [1.0, 0.0]
        made.append(control.StateSpace(block_diag(*A), np.array(B)[:, None], [C], 0))
    return made


def _held_out(
    sections: np.ndarray,
    points: np.ndarray,
    degree: int,
    fits: Sequence[NominalFit],
    weight: control.StateSpace,
    omega: np.ndarray,
    form: str,
) -> float:
    """Return the largest error at an inner point of the model from the others, in units of the
    weight; nan without.
    """
    found = [np.nan]
    W = np.abs(response(weight, omega))
    for k in range(1, points.size - 1):
        others = np.arange(points.size) != k
        plant = LpvModel.from_points(
            _realise(sections[others]), at=points[others], degree=min(degree, points.size - 2)
        )
        error = FORMS[form].deviation(
            response(fits[k].G, omega), response(plant.at(points[k]), omega)
        )
        found.append(float(np.max(np.abs(error) / W)))
    if len(found) > 1:
        return float(np.nanmax(found))
    return np.nan
