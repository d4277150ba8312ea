"""Sets that contain given plants: the entry for one channel and for several."""

from __future__ import annotations

from collections.abc import Sequence

from nlfrf._base.arguments import keep_warnings, require_integer
from robust._base.types import AnySystem
from robust.models.fit.nominal import NominalFit
from robust.models.sets.family import DIAGONAL, is_full, make_family_set, require_plants
from robust.models.sets.model import UncertaintyModel, count_channels
from robust.models.sets.radius import Extrapolation, checked_slope
from robust.models.sets.single_family import make_set_of_plants


@keep_warnings
def uncertainty_of_plants(
    plants: Sequence[AnySystem],
    nominal: NominalFit | AnySystem | float | None = None,
    *,
    form: str | None = None,
    weights: str = DIAGONAL,
    omega_B: float | None = None,
    order: int | None = None,
    below: str | float = "flat",
    above: str | float = 20.0,
    perturbation: str = "statistical",
) -> UncertaintyModel:
    """Turn a list of plants into a set around a nominal model that contains each of them.

    Systems lie inside at all frequencies, zero and infinity included, which is proved by exact
    polynomials (`UncertaintyModel.contains`); FRFs lie inside on their lines. The set has no
    confidence.

    Use this for models of several operating points, or for FRFs without a known scatter. For a
    measured BLA use `uncertainty`, whose set contains the next measurement.

    Parameters
    ----------
    plants : list of control.StateSpace, TransferFunction or FrequencyResponseData
        The plants, all with one channel or all with several. For one channel at least one of them,
        or the nominal, is an FRF, on whose lines the radius is read.
    nominal : NominalFit, control system or control.FrequencyResponseData, optional
        The model in the middle, continuous or discrete. For several channels a system, or a fit of
        the mean response when not given.
    form : str, optional
        "multiplicative" (when not given), "additive", "inverse-multiplicative" or
        "inverse-additive". For several channels "elements", "additive", "input", "output",
        "inverse-additive", "inverse-input" or "inverse-output"; when not given, the first form of
        `choose_form`.
    weights : str
        "diagonal": one weight a channel. "full", for several channels: W_l and W_r are matrices,
        and the set is smaller if deviations share a direction.
    omega_B : float, optional
        Bandwidth [rad/s] of the loop for which the form is chosen, for several channels; the middle
        of their band when not given.
    order : int, optional
        Order of each weight. When not given, it is 4 for several channels, and for one grows up to
        12 as long as a state saves 0.1 dB of the mean excess.
    below, above : "flat" or float
        Assumption outside the lines of FRFs, as in `uncertainty`.
    perturbation : str
        The class; "LTI" and "operator" are claims of the user about the plant.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        Plants that no set of the form holds, a form that does not exist, an order too low.

    Notes
    -----
    For several channels the set has the least tr W_l W_l* + tr W_r* W_r at each frequency, before
    the fit. So scale inputs and outputs first (SP 1.4). If full weights of the order do not cover
    the plants, the weights are diagonal, with a warning.

    References
    ----------
    SP 7.4 and 8.2.3.

    Examples
    --------
    A lag whose gain is up to 20 % off:

    >>> import control
    >>> import numpy as np
    >>> omega = np.logspace(-2, 2, 50)
    >>> plants = [control.frd(control.tf([gain], [1, 1]), omega) for gain in (0.8, 1.2)]
    >>> model = uncertainty_of_plants(plants, control.tf([1], [1, 1]), order=0, above="flat")
    >>> round(float(model.radius.max()), 6), all(model.contains(plant) for plant in plants)
    (0.2, True)
    """
    many, full = require_plants(plants), is_full(weights)
    rules = Extrapolation(below=checked_slope("below", below), above=checked_slope("above", above))
    order = None if order is None else require_integer("order", order, least=0)
    if count_channels(many[0]) != (1, 1):
        return make_family_set(
            many,
            nominal,
            form=form,
            full=full,
            order=order,
            rules=rules,
            perturbation=perturbation,
            omega_B=omega_B,
        )
    if full or omega_B is not None:
        raise ValueError("weights and omega_B must be left out for plants with one channel")
    return make_set_of_plants(
        many, nominal, form=form, order=order, rules=rules, perturbation=perturbation
    )
