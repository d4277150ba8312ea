"""The lines that a nominal model is fitted to, with their variances, behind the hold that the model has."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import real_array
from nlfrf.shared.values import value
from nlfrf.shared.wording import shown
from robust.systems.sampling import hold_between

__all__ = ["Lines", "behind_hold", "measured_lines"]


@value
class Lines:
    """Measured lines of one or several records, one after the other: omega, G, variance, dof (F,); their hold."""

    omega: np.ndarray
    G: np.ndarray
    var: np.ndarray
    dof: np.ndarray
    hold: str = "unknown"


def measured_lines(bla: Any, std: np.ndarray | None, dt: float) -> Lines:
    """Lines, variances and degrees of freedom behind whatever was given, behind the hold that a model of dt has."""
    hold = "unknown"
    if isinstance(bla, control.FrequencyResponseData):
        if (bla.ninputs, bla.noutputs) != (1, 1):
            raise ValueError(f"bla must have one input and one output, got {bla.ninputs} and {bla.noutputs}")
        G = np.asarray(bla.frdata[0, 0], dtype=complex)
        if std is None:
            if np.any(G) and not np.all(G):
                at = float(np.asarray(bla.omega)[np.argmin(np.abs(G))])
                raise ValueError(
                    f"std must be given where G is zero on a line, where 1/|G| is no weight: at {at:g} rad/s"
                )
            var, dof = np.abs(G) ** 2 + np.finfo(float).tiny, np.full(G.size, np.nan)
        else:
            var, dof = real_array("std", std, ndim=1) ** 2, np.full(G.size, np.inf)
            if var.shape != G.shape or np.any(var <= 0):
                raise ValueError(f"std must hold one positive number per line ({G.size}), got {shown(std)}")
        omega = np.asarray(bla.omega, dtype=float)
    else:
        many = list(bla) if isinstance(bla, Sequence) else [bla]
        if not many or not all(isinstance(b, Bla) for b in many):
            raise ValueError(
                f"bla must be an nlfrf.Bla, a list of them or a control.FrequencyResponseData, got {shown(bla)}"
            )
        if std is not None:
            raise ValueError("std must only be given with a FrequencyResponseData, got it with a Bla")
        omega = np.concatenate([b.omega for b in many])
        many = [behind_hold(b, dt) for b in many]
        G = np.concatenate([b.G for b in many])
        var = np.concatenate([b.var_bound for b in many])
        dof = np.concatenate([b.dof for b in many])
        hold = many[0].hold if len({b.hold for b in many}) == 1 else "unknown"
    if not (np.isfinite(G).all() and np.any(G)):
        raise ValueError("bla must hold a finite FRF that is not zero everywhere")
    if np.any(omega <= 0):
        raise ValueError(f"bla must hold positive frequencies only, got {omega.min():g} rad/s")
    # below a millionth of |G| a variance is rounding, and would make its line the only one that counts
    floor = (1e-6 * np.abs(G)) ** 2 + (1e-9 * np.abs(G).max()) ** 2
    return Lines(omega=omega, G=G, var=np.maximum(var, floor), dof=np.where(np.isinf(dof), 1e12, dof), hold=hold)


def behind_hold(bla: Bla, dt: float) -> Bla:
    """The same BLA as a model of sampling time dt describes it: without a hold (dt = 0), or behind one of dt.

    What the record's hold was is said by `bla.hold`; where nobody said it, nothing is changed.
    """
    factor = hold_between(bla.omega, bla.hold, bla.fs, dt)
    if np.all(factor == 1):
        return bla
    square = np.abs(factor) ** 2
    variances: dict[str, Any] = {
        name: getattr(bla, name) * square
        for name in ("var_noise", "var_total", "var_distortion", "var_even", "var_bound")
    }
    return replace(bla, G=bla.G * factor, **variances)
