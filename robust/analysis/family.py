"""Closed loops with random plants of a set, as an illustration of a verdict (not a proof)."""

from __future__ import annotations

import control
import numpy as np

from nlfrf._base.arguments import require_integer
from nlfrf._base.values import value
from robust._base.types import Controller
from robust.analysis.loop import assemble_loop, is_stable_with, perturbed_sensitivity, plant_in_loop
from robust.analysis.loop_of_channels import performance_loop, set_gain
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.lti.connections import closed_loop
from robust.lti.lti import response_by_channel
from robust.lti.realisation import multivariable
from robust.models.sets.model import UncertaintyModel, require_parametric
from robust.proofs.search.stability import decide_stability


@value
class LoopFamily:
    """Closed loops with random plants of a set.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    S : (n, W) complex ndarray
        Sensitivity with each of the n plants; for several channels its largest singular value.
    stable : (n,) ndarray of bool
        Whether each loop is stable.
    nominal : (W,) complex ndarray
        Sensitivity with the nominal plant; for several channels its largest singular value.
    worst : (W,) ndarray
        Largest |S_p| over the whole set. For several channels an upper bound, whose largest value
        is proved to hold at all frequencies.
    band : (2,) ndarray or None
        First and last measured frequency [rad/s].

    References
    ----------
    SP 7.4 (the set of plants).

    Examples
    --------
    >>> import control
    >>> from robust import UncertaintyModel
    >>> w = control.tf([0.2], [1])
    >>> model = UncertaintyModel(control.tf([1], [1, 1]), w, "multiplicative", np.array([1.0]), np.array([0.1]))
    >>> family = sample_loops(model, 2.0, 5, rng=0)
    >>> bool(family.stable.all()), bool(np.all(np.abs(family.S) <= family.worst * (1 + 1e-6)))
    (True, True)
    """

    omega: np.ndarray
    S: np.ndarray
    stable: np.ndarray
    nominal: np.ndarray
    worst: np.ndarray
    band: np.ndarray | None = None


def sample_loops(
    model: UncertaintyModel,
    K: Controller,
    n: int = 50,
    *,
    delay: float = 0.0,
    rng: np.random.Generator | int | None = None,
) -> LoopFamily:
    """Close the loop around n random plants of the set.

    Use this to see the spread of the loops that a verdict covers, for instance with
    `robust.plot.plot_family`.

    Parameters
    ----------
    model, K, delay
        As in `worst_case`.
    n : int
        Number of plants.
    rng : numpy Generator, int or None
        Random generator of the perturbations, or its seed.

    Returns
    -------
    LoopFamily

    Raises
    ------
    ValueError
        A model without a parametric nominal, or parts that do not fit each other.

    References
    ----------
    SP 7.4.

    Examples
    --------
    >>> import control
    >>> from robust import UncertaintyModel
    >>> at, radius = np.array([1.0, 2.0]), np.array([0.1, 0.2])
    >>> model = UncertaintyModel(control.tf([1], [1, 1]), control.tf([0.2], [1]), "multiplicative", at, radius)
    >>> sample_loops(model, 2.0, 5, rng=0).stable.tolist()
    [True, True, True, True, True]
    """
    require_parametric(model, "to make plants of")
    n = require_integer("n", n, least=1)
    if not model.is_single:
        return _sample_matrix_loops(model, K, n=n, delay=delay, rng=rng)
    loop = assemble_loop(model, K, w_P=None, delay=delay)
    plants = model.sample(n, rng)
    omega = loop.grid(model.omega)
    omega = omega[omega >= model.omega[0] / 10]
    seen = [plant_in_loop(plant, loop, delay) for plant in plants]
    nominal = loop.curves(omega)
    return LoopFamily(
        omega=omega,
        S=np.array(
            [perturbed_sensitivity(*pair, loop, omega) for pair in zip(plants, seen, strict=True)]
        ),
        stable=np.array([is_stable_with(*pair, loop) for pair in zip(plants, seen, strict=True)]),
        nominal=nominal.S,
        worst=nominal.worst_performance,
        band=model.omega[[0, -1]],
    )


def _sample_matrix_loops(
    model: UncertaintyModel,
    K: Controller,
    *,
    n: int,
    delay: float,
    rng: np.random.Generator | int | None,
) -> LoopFamily:
    """Close the loop around n random plants with several channels."""
    K, band = multivariable("K", K), model.omega[[0, -1]]
    model, _ = set_on_controller_time_base(model, K, delay)
    system = performance_loop(model, K, None)
    found = set_gain(system.N, system.structure)
    loops = []
    for plant in (model.nominal, *model.sample(n, rng)):
        loops.append(control.StateSpace(*closed_loop(plant, K, ("e",), ("r",)), plant.dt))
    S = np.array(
        [
            np.linalg.norm(
                np.moveaxis(response_by_channel(loop, found.omega), 2, 0), 2, axis=(1, 2)
            )
            for loop in loops
        ]
    )
    return LoopFamily(
        omega=found.omega,
        S=S[1:],
        stable=np.array([decide_stability(loop).stable for loop in loops[1:]]),
        nominal=S[0],
        worst=found.gain,
        band=band,
    )
