"""Bounds on |L| for shaping a loop by hand: the region it must avoid whatever its phase (SP 7.63 to 7.66)."""

from __future__ import annotations

import numpy as np

from robust._base.types import Weight
from robust.lti.lti import response
from robust.lti.realisation import state_space
from robust.models.sets.forms import FORMS, relative_radius
from robust.models.sets.model import UncertaintyModel, require_one_channel


def loop_bounds(model: UncertaintyModel, w_P: Weight) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds on |L| for shaping a loop by hand: at least `low`, at most `high`, on the lines of the model.

    Robust performance at a frequency whatever the phase of L, exactly: beyond the bounds some phase fails. A demand is
    made where one side is out of reach for every phase; zero and infinity elsewhere (around the crossover the phase
    decides). Where |w_P| and the uncertainty are both above one nothing helps, and low is infinite, high zero.

    Parameters
    ----------
    model : UncertaintyModel
        The set.
    w_P : control.StateSpace or TransferFunction
        Performance weight.

    Returns
    -------
    low : (W,) ndarray
        Least |L|, on `model.omega`.
    high : (W,) ndarray
        Largest |L| there.

    Raises
    ------
    ValueError
        A form that is no relative deviation (coprime); a weight with several inputs or outputs;
        one that is no system at all.

    References
    ----------
    SP eq. 7.63 to 7.66 for the multiplicative form; the others by the same triangle inequalities.

    Examples
    --------
    >>> import control
    >>> from robust import UncertaintyModel
    >>> lag, w, omega = control.tf([1], [1, 1]), control.tf([0.2], [1]), np.array([1.0, 2.0])
    >>> model = UncertaintyModel(lag, w, "multiplicative", omega, omega / 10)
    >>> low, high = loop_bounds(model, control.tf([4], [1, 1]))     # |w_P| > 1 up to 3.9 rad/s, |w| < 1: a lower bound
    >>> bool(np.allclose(low, (1 + 4 / np.sqrt(1 + model.omega**2)) / 0.8)), high.tolist()
    (True, [inf, inf])
    """
    require_one_channel(model, "loop_gains has its singular values", "to be shaped by |L|", parametric=False)
    omega = model.omega
    p = np.abs(response(state_space("w_P", w_P), omega))
    w, size = np.abs(response(model.weight, omega)), np.abs(model.at(omega))
    w = relative_radius(model.form, w, size)
    with np.errstate(divide="ignore", invalid="ignore"):
        if FORMS[model.form].inverse:
            # |1 + w Delta| runs from 1 - w to 1 + w: p |1 + w Delta| <= ||L| - |1 + w Delta|| for all of them
            least, most = (1 + w) * (1 + p), (1 - w) * (1 - p)
            hopeless = np.zeros(omega.size, dtype=bool)
            demand_low, demand_high = (p >= 1) | (w >= 1), np.zeros(omega.size, dtype=bool)
        else:
            least, most = (1 + p) / (1 - w), (1 - p) / (1 + w)
            hopeless = (p >= 1) & (w >= 1)
            demand_low, demand_high = (p >= 1) & (w < 1), (w >= 1) & (p < 1)
    low, high = np.where(demand_low, least, 0.0), np.where(demand_high, most, np.inf)
    return np.where(hopeless, np.inf, low), np.where(hopeless, 0.0, high)
