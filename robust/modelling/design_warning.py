"""``DesignWarning``, and what is warned of: a fit or a weight that is usable but suspicious."""

from __future__ import annotations

import warnings
from typing import Any

import control
import numpy as np

from robust.systems.lti import response

__all__ = ["OUTSIDE", "DesignWarning", "suspected", "warn_of_fit"]


COSTLY = 10.0  # cost over what scatter alone leaves, from which a fit to one record is suspicious
OUTSIDE = 1.5  # how far outside the band a pole lies at least to be named
HARMLESS = 1e-3  # of |G|: scatter below it counts as this much, or an exact record would make any model suspicious
INTEGRATOR = 1e-6  # of the first line: a pole below it is one at zero
EXCESSIVE = 10.0  # mean of |weight| over the radius [dB], from which the weight is suspicious


class DesignWarning(UserWarning):
    """A result that is usable but suspicious: the model or the design limits what it means.

    Examples
    --------
    >>> issubclass(DesignWarning, UserWarning)  # warnings.simplefilter("error", DesignWarning) stops at each
    True
    """


def warn_of_fit(
    G: control.StateSpace, measured: Any, residual: np.ndarray, expected: float, *, one_record: bool
) -> None:
    """Warn of a fit that misses what was measured, or that has poles where nothing was measured.

    Parameters
    ----------
    G : control.StateSpace
        The model without its delay.
    measured : Lines
        What it was fitted to: omega [rad/s], G and variance var of each line.
    residual : (F,) complex ndarray
        What it leaves.
    expected : float
        What scatter alone would leave of sum |residual|^2 / var; nan where no variance was given.
    one_record : bool
        Whether it is the BLA of one record: misfit is the point of a family of several levels.
    """
    omega, var = measured.omega, np.maximum(measured.var, (HARMLESS * np.abs(measured.G)) ** 2)
    ratio = float(np.sum(np.abs(residual) ** 2 / var)) / expected
    if one_record and ratio > COSTLY:
        warnings.warn(
            f"a nominal model of {G.nstates} poles misses what was measured: its cost is {ratio:.3g} times what "
            "scatter alone would leave, and the misfit goes into the radius. More poles or a delay: robust orders "
            "(scan_orders) says what the data ask for",
            DesignWarning,
            stacklevel=3,
        )
    far = poles_outside(G, omega)
    if far.size:
        where = ", ".join(f"{w / 2 / np.pi:.4g}" for w in far)
        warnings.warn(
            f"the nominal model has a pole where nothing was measured, at {where} Hz; the band is "
            f"{omega.min() / 2 / np.pi:.4g} to {omega.max() / 2 / np.pi:.4g} Hz. Take fewer poles, or measure there",
            DesignWarning,
            stacklevel=3,
        )


def poles_outside(G: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Sizes [rad/s] of the poles of a model outside the band of its lines, once a pair; integrators are meant."""
    p = G.poles()
    with np.errstate(divide="ignore"):
        p = np.log(p.astype(complex)) / G.dt if G.dt else p
    size = np.sort(np.abs(p[p.imag >= 0]))
    low, high = omega.min(), omega.max()
    return size[((size < low / OUTSIDE) & (size > INTEGRATOR * low)) | (size > high * OUTSIDE)]


def suspected(weight: control.StateSpace, omega: np.ndarray, radius: np.ndarray) -> control.StateSpace:
    """The weight itself, with a warning where it lies far above its radius, in the mean over the lines [rad/s]."""
    excess = float(np.mean(20 * np.log10(np.abs(response(weight, omega)) / radius)))
    if excess > EXCESSIVE:
        warnings.warn(
            f"the weight of order {weight.nstates} lies {excess:.1f} dB above the radius in the mean over the measured "
            f"lines: the set is much larger than what was measured asks for. Give it a higher order",
            DesignWarning,
            stacklevel=3,
        )
    return weight
