"""The worst plant of a set, as a system to replay."""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.values import value
from robust.analysis.aliases import in_phase
from robust.analysis.loop import Loop, assemble, in_loop, nominal_instability, sensitivity, stable_with
from robust.systems.closed_loop import worst_perturbation
from robust.systems.connections import in_series
from robust.systems.lti import response, timebase
from robust.uncertain.forms import FORMS
from robust.uncertain.model import UncertaintyModel
from robust.uncertain.perturbations import perturbed, with_phase, with_phases, within

__all__ = ["WorstCase", "worst_case"]


@value
class WorstCase:
    """The largest sensitivity over a set, and a plant of the set that has it.

    Fields
    ------
    omega : (W,) ndarray
        Frequencies [rad/s].
    gain : (W,) ndarray
        Largest |S_p| over the set (|w_P S_p| with w_P); inf where a plant of the set puts a pole on the boundary.
    omega_worst : float
        Where it is largest, or where a perturbation destabilises the loop [rad/s].
    plant : control.StateSpace
        A plant of the set that reaches it there: continuous for a continuous nominal, also under a sampled K, where
        each alias that adds more than 0.3 % has its own phase (in an inverse form only the frequency itself).
    delta : complex
        The perturbation there; of modulus below one where less suffices to destabilise.
    achieved : float
        |S_p| (|w_P S_p|) of the loop with that plant at omega_worst, recomputed.
    stable : bool
        Whether the loop with that plant is stable.

    References
    ----------
    SP 7.6.3.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> worst = worst_case(model, 2.0)
    >>> worst.stable, bool(abs(worst.achieved - worst.gain.max()) < 1e-3)
    (True, True)
    """

    omega: np.ndarray
    gain: np.ndarray
    omega_worst: float
    plant: control.StateSpace
    delta: complex
    achieved: float
    stable: bool


def worst_case(model: UncertaintyModel, K: Any, w_P: Any = None, *, delay: float = 0.0) -> WorstCase:
    """The plant of the set that hurts a controller most, to replay it in a simulation.

    Parameters
    ----------
    model : UncertaintyModel
        With a parametric nominal.
    K : control.StateSpace, TransferFunction or float
        Controller, continuous or discrete, negative feedback.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight on S; 1 when not given.
    delay : float
        Computation delay [s].

    Returns
    -------
    WorstCase

    Raises
    ------
    ValueError
        A nominal loop that is not stable, or parts that do not fit each other.

    References
    ----------
    SP 7.6.3 (worst-case plants), 8.10.3.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> at, radius = np.array([1.0, 2.0]), np.array([0.1, 0.2])
    >>> model = UncertaintyModel(control.tf([1], [1, 1]), control.tf([0.2], [1]), "multiplicative", at, radius)
    >>> worst = worst_case(model, 2.0)
    >>> bool(np.all(model.distance(worst.plant) <= 1 + 1e-9))             # a plant of the set
    True
    """
    if not isinstance(model, UncertaintyModel) or model.measured_only:
        raise ValueError("model must be an UncertaintyModel with a parametric nominal to make plants of")
    loop = assemble(model, K, w_P, delay)
    nominal = nominal_instability(loop)
    if not nominal.stable:
        raise ValueError(f"K must stabilise the nominal plant for its worst case to mean anything, got it {nominal}")
    omega = loop.grid(model.omega)
    band = (float(model.omega[0]), float(model.omega[-1]))
    peak_b, where = loop.peak(lambda points: loop.curves(points).rs, omega, band)
    if peak_b < 1:
        where = loop.peak(lambda points: loop.curves(points).worst, omega, band)[1]
    there = loop.curves(where)
    phased = phases_of_aliases(loop, where)
    delta = complex(-1 / there.b[0]) if peak_b >= 1 else complex(worst_perturbation(there.a, there.b)[0])
    delta *= np.exp(1j * where * lead_of(loop, delay)) / max(1.0, abs(delta))
    turn = FORMS[model.form].turn(in_series(model.nominal, model.shaping), model.weight, where)
    # the weight brings its own phase, which the perturbation is relative to
    Delta = with_phase(where, delta / turn, timebase(model.nominal) or timebase(model.weight))
    if phased is not None:  # every alias that counts has a phase of its own
        delta = np.exp(1j * phased[1][0]) / max(1.0, peak_b)
        Delta = with_phases(*phased) * abs(delta)
    plant = perturbed(model.form, model.nominal, model.weight, Delta, model.shaping)
    if FORMS[model.form].scaled and not within(model, plant):  # other forms need no factors: they are made as they are
        raise ValueError("model must have a worst plant that floating point can tell, got one outside the set of it")
    seen = in_loop(plant, loop, delay)
    at, omega = np.array([where]), np.unique(np.append(omega, where))
    S = sensitivity(plant, seen, loop, at)
    achieved = np.abs(S if loop.w_P is None else S * response(loop.w_P, at))[0]
    return WorstCase(
        omega=omega,
        gain=loop.curves(omega).worst,
        omega_worst=where,
        plant=plant,
        delta=delta,
        achieved=float(achieved),
        # a perturbation that was made to put a pole on the boundary does, whatever side rounding leaves it on
        stable=peak_b < 1 and stable_with(plant, seen, loop),
    )


def phases_of_aliases(loop: Loop, omega: float) -> tuple[np.ndarray, np.ndarray] | None:
    """Frequencies and phases of the worst Delta at omega [rad/s] where aliases count; None where they do not.

    In an inverse form the worst plant is that of the frequency itself.
    """
    if loop.aliases is None or loop.aliases.inverse:
        return None
    found = in_phase(loop.at_points(loop.curves(omega)))
    return found if found[0].size > 1 else None


def lead_of(loop: Loop, delay: float) -> float:
    """Time [s] by which Delta leads what the terms call Delta: they put it behind delay and hold, the plant before."""
    lag = delay + (loop.dt / 2 if loop.unsampled is not None else 0.0)
    return FORMS[loop.form].lead * lag
