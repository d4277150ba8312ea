"""Mixed-sensitivity synthesis: the controller of least norm for weighted S, K S and T together."""

from __future__ import annotations

from typing import TypeGuard

import control

from nlfrf._base.arguments import require_nonnegative
from robust._base.types import Controller, Weight
from robust.lti.connections import weighted_plant
from robust.lti.lti import is_constant, timebase, with_names
from robust.lti.realisation import multivariable, stable_weight
from robust.lti.sampling import delayed, discretize, sampled
from robust.models.sets.forms import FORMS
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.hinf.design import Design
from robust.synthesis.hinf.hinfsyn import hinfsyn
from robust.synthesis.hinf.riccati_pair import MOST_STEPS

_PADE_ORDER = 4
_WEIGHTED_PORTS = {"w_P": "e", "w_u": "u", "w_T": "y"}  # the signal that each weight reads


def mixsyn(
    model: UncertaintyModel | Controller,
    w_P: Weight,
    w_u: Weight | None = None,
    w_T: Weight | None = None,
    *,
    dt: float = 0.0,
    delay: float = 0.0,
    gamma_min: float = 0.0,
    factor: float = 1.01,
    n_steps: int = MOST_STEPS,
) -> Design:
    """Design a mixed-sensitivity controller: minimise the H-infinity norm of [w_P S; w_u K S; w_T
    T].

    Use this first, for a plant with one uncertainty. Use `dk_iteration` for several uncertainties
    or for robust performance.

    The order of the weights is that of python-control and MATLAB: `mixsyn(G, w1, w2, w3)` weights
    S, K S and T. If gamma < 1, every weight is met: |S| < 1/|w_P|, |K S| < 1/|w_u|, |T| < 1/|w_T|.
    The weight of an `UncertaintyModel` is added as a weight on T, S or K S, depending on the form
    of the set. gamma < 1 then includes stability of the loop with every plant of the set.

    Parameters
    ----------
    model : UncertaintyModel, control.StateSpace, TransferFunction
        Plant with one or several inputs and outputs, continuous or discrete.
    w_P : control system or float
        Weight on S (`performance_weight`). It must be stable: use a slow pole instead of an
        integrator. For several channels each of w_P, w_u and w_T is one weight that is used for
        every channel, or a matrix (`control.append`).
    w_u : control system or float, optional
        Weight on K S (`control_weight`).
    w_T : control system or float, optional
        Weight on T, in addition to the weight of the model.
    dt : float
        Sampling time [s] of the controller for a continuous plant. The design then uses the sampled
        plant with hold and delay, and weights are converted by the bilinear map. 0: time base of
        the plant.
    delay : float
        Computation delay [s]. In continuous time it is a Padé approximation.
    gamma_min : float
        Sufficient gamma: the search stops once gamma is this small.
    factor : float
        Ratio of gamma of the controller to the least gamma found, at least 1.
    n_steps : int
        Largest number of values of gamma that are tried. The best controller so far is returned.

    Returns
    -------
    Design
        gamma is recomputed from the closed loop; it is inf if no controller was found, and `reason`
        states why. gamma_min is a lower bound for all controllers. Without w_u no controller
        reaches the infimum; ever faster controllers approach it.

    Raises
    ------
    ValueError
        An unstable or improper weight, sampling times that differ, a plant that no controller can
        stabilise.

    References
    ----------
    SP 2.8.3, 3.5.3 and 9.3.6; Zhou, Doyle & Glover 1996, 17.

    Examples
    --------
    SP Example 2.17.

    >>> import numpy as np
    >>> from robust import performance_weight
    >>> G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    >>> design = mixsyn(G, performance_weight(10, M_S=1.5, A=1e-4), w_u=1)
    >>> round(design.gamma_min, 3), bool(design.gamma < 1.38)
    (1.366, True)
    """
    dt, delay = require_nonnegative("dt", dt), require_nonnegative("delay", delay)
    G = multivariable("model", model.nominal if _is_unstructured_model(model) else model)
    n_y, n_u, step = G.noutputs, G.ninputs, timebase(G)
    names = G.output_labels, G.input_labels
    if step and dt and abs(step / dt - 1) > 1e-9:
        raise ValueError(f"dt must be the sampling time of the plant, {step:g} s, got {dt:g} s")
    if dt and not step:
        G = sampled(G, dt, delay)
    else:
        G = delayed(G, delay, order=_PADE_ORDER)
    dt = step or dt
    stacked = [
        (
            _WEIGHTED_PORTS[name],
            weight_on_time_base(name, w, dt=dt, n=n_u if name == "w_u" else n_y),
        )
        for name, w in _weights_with_model(model, w_P, w_u, w_T)
    ]
    G = control.StateSpace(G.A, G.B, G.C, G.D, dt)
    P = weighted_plant(G, n_y, n_u=n_u, weights=stacked)
    found = hinfsyn(P, n_y, n_u, gamma_min=gamma_min, factor=factor, n_steps=n_steps)
    K = control.StateSpace(found.K.A, found.K.B, found.K.C, found.K.D, dt)
    with_names(K, *names)
    if found.found:
        reason = found.reason
    else:
        reason = f"not found: {found.reason}"
    return Design(
        K=K,
        gamma=found.gamma,
        gamma_min=found.gamma_min,
        met=found.found,
        reason=reason,
        certificate=found.certificate,
        CL=found.CL,
    )


def _weights_with_model(
    model: UncertaintyModel | Controller, w_P: Weight, w_u: Weight | None, w_T: Weight | None
) -> list[tuple[str, Weight]]:
    """Return the weights with their names, that of the model as a weight on the transfer function
    that its form perturbs.
    """
    weights: dict[str, list[Weight | None]] = {"w_P": [w_P], "w_u": [w_u], "w_T": [w_T]}
    if _is_unstructured_model(model):
        place = FORMS[model.form].weighted_transfer
        if not place:
            possible = ", ".join(name for name, form in FORMS.items() if form.weighted_transfer)
            raise ValueError(f"model must be of the form {possible}, got {model.form}")
        weights[place].append(model.weight)
    return [(name, w) for name, many in weights.items() for w in many if w is not None]


def _is_unstructured_model(model: object) -> TypeGuard[UncertaintyModel]:
    """Return True for a model with a parametric nominal; refuse one without, or with a structured
    perturbation.
    """
    if not isinstance(model, UncertaintyModel):
        return False
    if not model.is_single:
        raise ValueError(
            "model must be a plant or an UncertaintyModel, got one with several channels: use"
            " dk_iteration for its perturbation, or mixsyn(model.nominal, ...) for its nominal"
            " alone"
        )
    if model.measured_only:
        raise ValueError(
            "model must have a parametric nominal for a synthesis, got an FRF: see design_frf"
        )
    return True


def weight_on_time_base(name: str, w: Weight, *, dt: float, n: int) -> control.StateSpace:
    """Return a stable weight on n signals, on the time base of the loop."""
    w = stable_weight(name, w, dt=dt, n=n)
    if dt and not timebase(w) and not is_constant(w):
        w = discretize(w, dt)
    return control.StateSpace(w.A, w.B, w.C, w.D, dt)
