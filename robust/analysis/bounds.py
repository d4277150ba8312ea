"""Bounds on |L| for shaping a loop by hand: the region that |L| must avoid at any phase (SP 7.63 to
7.66).
"""

from __future__ import annotations

import numpy as np

from robust._base.types import Weight
from robust.lti.lti import response
from robust.lti.realisation import state_space
from robust.models.sets.forms import FORMS, relative_radius
from robust.models.sets.model import UncertaintyModel, require_one_channel


def loop_bounds(model: UncertaintyModel, w_P: Weight) -> tuple[np.ndarray, np.ndarray]:
    """Return bounds on |L| for manual loop shaping: at least `low` and at most `high`.

    Use this to draw the targets for |L| before you shape it, for instance with `design_frf`. If |L|
    meets the bound at a frequency, robust performance holds there for every phase of L; otherwise
    it fails for some phase. Where no bound exists, as around the crossover, the phase decides:
    `low` is zero and `high` infinite. If |w_P| and the uncertainty are both above one, no |L|
    suffices: `low` is infinite and `high` zero.

    Parameters
    ----------
    model : UncertaintyModel
        The set.
    w_P : control.StateSpace or TransferFunction
        Performance weight.

    Returns
    -------
    low : (W,) ndarray
        Lower bound of |L| at the frequencies `model.omega`.
    high : (W,) ndarray
        Upper bound of |L| at the frequencies `model.omega`.

    Raises
    ------
    ValueError
        A form that is not a relative deviation (coprime); a weight with several inputs or outputs;
        a weight that is not a system.

    References
    ----------
    SP eq. 7.63 to 7.66 for the multiplicative form; the other forms by the same triangle
    inequalities.

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
    require_one_channel(
        model, "use loop_gains for its singular values", "to be shaped by |L|", parametric=False
    )
    omega = model.omega
    p = np.abs(response(state_space("w_P", w_P), omega))
    w, size = np.abs(response(model.weight, omega)), np.abs(model.at(omega))
    w = relative_radius(model.form, w, size)
    with np.errstate(divide="ignore", invalid="ignore"):
        if FORMS[model.form].inverse:
            # |1 + w Delta| ranges from 1 - w to 1 + w: p |1 + w Delta| <= ||L| - |1 + w Delta|| is
            # required for all
            least, most = (1 + w) * (1 + p), (1 - w) * (1 - p)
            hopeless = np.zeros(omega.size, dtype=bool)
            demand_low, demand_high = (p >= 1) | (w >= 1), np.zeros(omega.size, dtype=bool)
        else:
            least, most = (1 + p) / (1 - w), (1 - p) / (1 + w)
            hopeless = (p >= 1) & (w >= 1)
            demand_low, demand_high = (p >= 1) & (w < 1), (w >= 1) & (p < 1)
    low, high = np.where(demand_low, least, 0.0), np.where(demand_high, most, np.inf)
    return np.where(hopeless, np.inf, low), np.where(hopeless, 0.0, high)
