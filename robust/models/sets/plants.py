"""Sets that contain given plants: the entry for one channel and for several."""

from __future__ import annotations

from collections.abc import Sequence

from nlfrf._base.arguments import keep_warnings, require_integer
from robust._base.types import AnySystem
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.family import DIAGONAL, is_full, make_family_set
from robust.models.sets.family_members import require_plants
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
    """Make an uncertainty set around a nominal model that contains each plant of a list.

    The set contains FRFs on their lines, and systems at all frequencies, zero and infinity
    included. For systems this is proved with exact polynomials (`UncertaintyModel.contains`). No
    probability is stated for the set.

    Use this for models at several operating points, or for FRFs with unknown scatter. For a
    measured BLA use `uncertainty`, whose set contains the next measurement with a stated
    confidence.

    Parameters
    ----------
    plants : list of control.StateSpace, TransferFunction or FrequencyResponseData
        Plants, all with one channel or all with several channels. For one channel at least one
        plant, or the nominal, must be an FRF; the radius is computed on its lines.
    nominal : NominalFit, control system or control.FrequencyResponseData, optional
        Nominal model, continuous or discrete. For several channels it must be a system; the default
        is a fit of the mean response of the plants.
    form : str, optional
        "multiplicative" (default), "additive", "inverse-multiplicative" or "inverse-additive". For
        several channels "elements", "additive", "input", "output", "inverse-additive",
        "inverse-input" or "inverse-output"; the default is the first form of `choose_form`.
    weights : str
        "diagonal": one weight for each channel. "full", for several channels: the weights W_l and
        W_r on both sides of Delta are matrices. The set is then smaller if the deviations have a
        common direction.
    omega_B : float, optional
        Bandwidth [rad/s] of the loop for which the form is chosen, for several channels. Default:
        the middle of the band of the plants.
    order : int, optional
        Order of each weight. Default for one channel: it is raised, up to 12, as long as one more
        state lowers the mean of |weight|/radius by 0.1 dB. Default for several channels: 4.
    below, above : "flat" or float
        Assumption about the radius outside the lines of the FRFs, as in `uncertainty`.
    perturbation : str
        Class of Delta, as in `UncertaintyModel`. With "LTI" or "operator" you claim that the plant
        is in the set.

    Returns
    -------
    UncertaintyModel

    Raises
    ------
    ValueError
        Plants that no set of this form can contain, a form that does not exist, or an order that is
        too low.

    Notes
    -----
    For several channels the smallest W_l and W_r are computed at each frequency, by minimising tr
    W_l W_l* + tr W_r* W_r; weights are then fitted above them. The result depends on the units, so
    scale inputs and outputs first (SP 1.4). If full weights of this order do not cover the plants,
    the weights are diagonal, with a warning.

    References
    ----------
    SP 7.4 and 8.2.3.

    Examples
    --------
    A lag whose gain has an error of up to 20 %:

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
    if order is not None:
        order = require_integer("order", order, least=0)
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
