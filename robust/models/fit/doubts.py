"""`DesignWarning` for a fit or a weight that is usable but suspicious."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import data_warning
from robust._base.warnings import DesignWarning
from robust.lti.lti import response
from robust.models.fit.nominal_fit import NominalFit
from robust.models.fit.search import FrfData
from robust.models.fit.weights import MAX_CHOSEN_ORDER

#: Cost over that of scatter alone, above which a fit to one record is suspicious. A fit with a
#: class error has a larger cost: 16 for two poles of the rig, where the least cost is below 10.
_COST_LIMIT = 20.0
OUTSIDE_FACTOR = 1.5  # smallest factor outside the band at which a pole is reported
# least scatter over |G| in the check; otherwise an exact record would make any model suspicious
_HARMLESS_SHARE = 1e-3
_INTEGRATOR_RATIO = 1e-6  # a pole below this fraction of the first line is an integrator
_EXCESSIVE_RATIO = (
    10.0  # mean of |weight| over the radius [dB], above which the weight is suspicious
)


def warn_of_fit(fit: NominalFit, lines: FrfData) -> None:
    """Warn of a fit far from the data of one record, or with poles outside the measured band."""
    omega, var = lines.omega, np.maximum(lines.var, (_HARMLESS_SHARE * np.abs(lines.G)) ** 2)
    ratio = float(np.sum(np.abs(fit.residual) ** 2 / var)) / fit.expected_cost
    if lines.n_records == 1 and ratio > _COST_LIMIT:
        data_warning(
            f"a nominal model of {fit.G.nstates} poles does not fit the measurement: its cost"
            f" is {ratio:.3g} times the cost that the variance of the FRF explains, and the"
            f" misfit is added to the radius; {fit.describe_class_error()}",
            DesignWarning,
        )
    far = _poles_outside(fit.G, omega)
    if far.size:
        where = ", ".join(f"{w / 2 / np.pi:.4g}" for w in far)
        data_warning(
            f"the nominal model has a pole where nothing was measured, at {where} Hz; the band"
            f" is {omega.min() / 2 / np.pi:.4g} to {omega.max() / 2 / np.pi:.4g} Hz. Measure at"
            " this frequency if the bound stays below |G| there, which friction may prevent; or"
            " use fewer poles if the FRF allows it",
            DesignWarning,
        )


def _poles_outside(G: control.StateSpace, omega: np.ndarray) -> np.ndarray:
    """Return the sizes [rad/s] of poles outside the band of the lines, one for each pair; without
    integrators.
    """
    p = G.poles()
    with np.errstate(divide="ignore"):
        if G.dt:
            p = np.log(p.astype(complex)) / G.dt
    size = np.sort(np.abs(p[p.imag >= 0]))
    low, high = omega.min(), omega.max()
    return size[
        ((size < low / OUTSIDE_FACTOR) & (size > _INTEGRATOR_RATIO * low))
        | (size > high * OUTSIDE_FACTOR)
    ]


def checked_weight(
    weight: control.StateSpace, omega: np.ndarray, radius: np.ndarray, *, order: int | None
) -> control.StateSpace:
    """Return the weight; warn if its mean over the lines [rad/s] lies far above its radius.

    order : requested order; None if it was chosen here.
    """
    excess = float(np.mean(20 * np.log10(np.abs(response(weight, omega)) / radius)))
    if excess > _EXCESSIVE_RATIO:
        data_warning(
            f"the weight of order {weight.nstates} is {excess:.1f} dB above the radius on"
            " average over the measured lines: the set is much larger than the measurement"
            " requires. "
            + (
                "Leave out the order, so that it is chosen"
                if order is not None and order < MAX_CHOSEN_ORDER
                else (
                    "The radius scatters from line to line, and no weight can follow it:"
                    " average more realisations"
                )
            ),
            DesignWarning,
        )
    return weight
