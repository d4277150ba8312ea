"""The measurement behind a fit: one or several BLAs or an FRF, checked, and its lines as data."""

from __future__ import annotations

import itertools
from collections.abc import Sequence
from typing import TypeAlias

import control
import numpy as np

from nlfrf import Bla, bla_from_frf
from nlfrf._base.arguments import (
    as_list,
    format_hertz,
    require_positive,
    require_real_array,
    short_form,
)
from nlfrf._base.units import units_differ
from robust._base.channels import is_single, require_matrix
from robust.lti.lti import SAMPLING_TOLERANCE
from robust.lti.sampling import hold_correction
from robust.models.fit.class_error import loop_tolerance
from robust.models.fit.search import FrfData

#: A BLA, several BLAs, or an FRF of another origin.
Measurement: TypeAlias = "Bla | Sequence[Bla] | control.FrequencyResponseData"
_MAX_POLES = 40


def matrices_given(bla: object) -> list[Bla]:
    """Return the given matrices, for one level or several, with the same channels; an empty list
    for other input.
    """
    many = as_list(bla)
    require_same_units(many)
    matrices = [one for one in many if isinstance(one, Bla) and not one.is_single]
    if not matrices:
        return []
    for one in many:
        require_matrix("bla", one)
        for name in ("inputs", "outputs"):
            if getattr(one, name) != getattr(matrices[0], name):
                raise ValueError(
                    f"bla must be matrices of the same {name}, got"
                    f" {', '.join(getattr(matrices[0], name))} and {', '.join(getattr(one, name))}"
                )
    return matrices


def require_same_units(given: object) -> None:
    """Refuse a list of BLAs whose units differ; unknown units match any."""
    blas = [one for one in as_list(given) if isinstance(one, Bla)]
    for one, other in itertools.combinations(blas, 2):
        for name in ("input_units", "output_units"):
            for pair in zip(getattr(one, name), getattr(other, name), strict=False):
                if units_differ(*pair):
                    # of G, for one channel
                    whole = one.unit, other.unit
                    first, second = whole if units_differ(*whole) else pair
                    raise ValueError(
                        f"bla must be records in the same units, got {first} and {second}"
                    )


def require_same_channels(frm: Bla, known: object, of: str) -> None:
    """Refuse a record with other channel names, or in another order; unnamed channels match any."""
    for name, letter in (("inputs", "u"), ("outputs", "y")):
        first, second = tuple(getattr(known, name)), tuple(getattr(frm, name))
        unnamed = (), tuple(f"{letter}{i + 1}" for i in range(len(second)))
        if first != second and first not in unnamed and second not in unnamed:
            raise ValueError(
                f"bla must be a matrix of the same {name} as {of}, {', '.join(first)}, got"
                f" {', '.join(second)}"
            )


def bla_with_deviation(frf: control.FrequencyResponseData, std: np.ndarray | None) -> Bla:
    """Return the `Bla` of an FRF with the standard deviation of its entries."""
    if std is None:
        raise ValueError(
            f"std must be given with an FRF of {frf.ninputs} inputs and {frf.noutputs} outputs. Or"
            " give nlfrf.bla_from_frf(...) of it, which also takes a coherence"
        )
    G = np.asarray(frf.frdata, dtype=complex)
    several = G.shape[:2] != (1, 1)
    return bla_from_frf(
        np.asarray(frf.omega, dtype=float) / (2 * np.pi),
        G if several else G[0, 0],
        std=std,
        inputs=tuple(frf.input_labels) if several else (),
        outputs=tuple(frf.output_labels) if several else (),
    )


def frd(bla: Bla) -> control.FrequencyResponseData:
    """Return the best linear approximation (BLA) as an FRF object of python-control.

    Use this to plot the BLA with python-control, or to multiply and compare it with models.

    Parameters
    ----------
    bla : nlfrf.Bla
        A measured BLA, or a matrix of them.

    Returns
    -------
    control.FrequencyResponseData
        Inputs and outputs as measured, at the excited lines [rad/s].

    Raises
    ------
    ValueError
        Any other type than Bla.

    Examples
    --------
    >>> import nlfrf
    >>> ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    >>> record = nlfrf.Record(u=ms.u[None], y=2 * ms.u[None] + 0.1 * ms.u[None] ** 3, fs=128, lines=ms.lines)
    >>> measured = frd(nlfrf.identify(record))
    >>> bool(np.allclose(measured.omega, 2 * np.pi * ms.f))
    True
    """
    if not isinstance(bla, Bla):
        raise ValueError(f"bla must be an nlfrf.Bla, got {short_form(bla)}")
    if bla.is_single:
        names = {}
    else:
        names = {"inputs": list(bla.inputs), "outputs": list(bla.outputs)}
    return control.FrequencyResponseData(bla.G, bla.omega, name="bla", **names)


def bla_behind_hold(bla: Bla, dt: float) -> Bla:
    """Return a BLA as a model of sampling time dt describes it: without a hold (dt = 0), or behind
    a hold of dt.

    The correction is for the `hold` of the record; an unknown hold is left uncorrected.
    """
    factor = hold_correction(bla.omega, bla.hold, fs=bla.fs, dt=dt)
    if np.all(factor == 1):
        return bla
    return bla.times(factor, output_unit=bla.output_units)


def require_fittable(n_poles: int, omega: np.ndarray, dt: float) -> None:
    """Refuse more poles than are fitted, or lines above the Nyquist frequency of the model."""
    if n_poles > _MAX_POLES:
        raise ValueError(f"n_poles must be at most {_MAX_POLES}, got {n_poles}")
    if dt and omega.max() * dt >= np.pi:
        raise ValueError(
            f"dt must put the Nyquist frequency above the last line, {omega.max() / 2 / np.pi:g}"
            f" Hz, got dt = {dt:g} s with Nyquist {0.5 / dt:g} Hz"
        )


def checked_crossover(
    omega_c: float | None,
    omega: np.ndarray,
    G: np.ndarray,
    *,
    var: np.ndarray,
    dof: np.ndarray,
    dt: float,
) -> float:
    """Return the crossover [rad/s] of a loop, nan for none; refuse one that no model of G (..., F)
    can serve.

    var, dof : (..., F), (F,) variance of G, and its degrees of freedom.
    """
    if omega_c is None:
        return float("nan")
    omega_c = require_positive("omega_c", omega_c)
    low, high, asked = omega.min(), omega.max(), f"{format_hertz(omega_c)} ({omega_c:.4g} rad/s)"
    if dt and omega_c * dt >= np.pi:
        raise ValueError(
            f"omega_c must lie below the Nyquist frequency {format_hertz(np.pi / dt)}, got {asked}"
        )
    if not low <= omega_c <= high:
        raise ValueError(
            f"omega_c must lie in the measured band, {format_hertz(low)} to {format_hertz(high)},"
            f" got {asked}"
        )
    k = int(np.argmin(np.abs(omega - omega_c)))
    size = np.abs(G[..., k])
    bound = np.sqrt(
        dof[k] * np.expm1(-np.log(0.05) / dof[k]) * var[..., k]
    )  # 95 % quantile of F(2, 2 dof)
    if np.all(size <= bound):
        raise ValueError(
            f"omega_c must lie where |G| is above its bound, got {asked}, where |G| ="
            f" {size.max():.3g} and its bound {bound.max():.3g}"
        )
    return omega_c


def _given_lines(
    frf: control.FrequencyResponseData, std: np.ndarray | None, dt: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Return omega, G, variance and degrees of freedom of an FRF of another origin; without a std
    relative errors.
    """
    if (frf.ninputs, frf.noutputs) != (1, 1):
        raise ValueError(
            f"bla must have one input and one output, got {frf.ninputs} and {frf.noutputs}"
        )
    if frf.dt and abs(frf.dt - dt) > SAMPLING_TOLERANCE * frf.dt:
        raise ValueError(f"dt must be that of bla, a sampled FRF at {frf.dt:g} s, got {dt:g} s")
    omega, G = np.asarray(frf.omega, dtype=float), np.asarray(frf.frdata[0, 0], dtype=complex)
    if std is None:
        if np.any(G) and not np.all(G):
            at = omega[np.argmin(np.abs(G))]
            raise ValueError(
                "std must be given for an FRF that is zero on a line, because the default"
                f" weight 1/|G| is infinite: at {at:g} rad/s"
            )
        return omega, G, np.abs(G) ** 2 + np.finfo(float).tiny, np.full(G.size, np.nan)
    var = require_real_array("std", std, ndim=1) ** 2
    if var.shape != G.shape or np.any(var <= 0):
        raise ValueError(
            f"std must hold one positive number per line ({G.size}), got {short_form(std)}"
        )
    return omega, G, var, np.full(G.size, np.inf)


def measured_lines(
    bla: Measurement, std: np.ndarray | None, dt: float, omega_c: float | None
) -> FrfData:
    """Return lines, variances and degrees of freedom of an FRF, with the hold of a model of dt.

    The tolerance of each line is that of a loop with the crossover omega_c [rad/s].
    """
    hold, n_records = "unknown", 0
    if isinstance(bla, control.FrequencyResponseData):
        omega, G, var, dof = _given_lines(bla, std, dt)
    else:
        many = as_list(bla)
        if not many or not all(map(is_single, many)):
            raise ValueError(
                "bla must be an nlfrf.Bla, a list of them or a control.FrequencyResponseData, got"
                f" {short_form(bla)}"
            )
        if std is not None:
            raise ValueError(
                "std must only be given with a FrequencyResponseData, got it with a Bla"
            )
        n_records, omega = len(many), np.concatenate([b.omega for b in many])
        many = [bla_behind_hold(b, dt) for b in many]
        G = np.concatenate([b.G for b in many])
        var = np.concatenate([b.var_bound for b in many])
        dof = np.concatenate([b.dof for b in many])
        hold = many[0].hold if len({b.hold for b in many}) == 1 else "unknown"
    if not (np.isfinite(G).all() and np.any(G)):
        raise ValueError("bla must hold a finite FRF that is not zero everywhere")
    if np.any(omega <= 0):
        raise ValueError(f"bla must hold positive frequencies only, got {omega.min():g} rad/s")
    # below a millionth of |G| a variance is rounding, and its line would dominate the fit
    floor = (1e-6 * np.abs(G)) ** 2 + (1e-9 * np.abs(G).max()) ** 2
    dof, crossover = (
        np.where(np.isinf(dof), 1e12, dof),
        checked_crossover(omega_c, omega, G, var=var, dof=dof, dt=dt),
    )
    tolerance = loop_tolerance(omega, G, crossover)
    if (
        np.isnan(dof).any() and omega_c is not None
    ):  # without a scatter the loop alone weighs the lines
        var = tolerance**2
    return FrfData(
        omega=omega,
        G=G,
        var=np.maximum(var, floor),
        dof=dof,
        tolerance=tolerance,
        omega_c=crossover,
        hold=hold,
        n_records=n_records,
    )
