"""Feedforward from the model, with what the set of plants makes of it.

    r --->[T_ref]--->(+)-- e -->[ K ]--->(+)-- u -->[ G ]---+--> y       wanted: T_ref r
     |               -^                   ^                 |
     |                +-------------------|-----------------+
     +-------------->[ F ]----------------+

With F = T_ref/G the nominal loop follows exactly, and a plant of the set misses by T_ref S_p (1 - G_p/G) in place of
T_ref S_p: feedforward helps where the plant is known to within itself, and does harm where it is not.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf.shared.arguments import positive
from nlfrf.shared.values import value
from robust.analysis.loop import Loop
from robust.certificates.certificate import Certificate
from robust.synthesis.hinfsyn import hinfsyn
from robust.synthesis.prefilter import fewest_states, following, matching, on_time_base
from robust.systems.lti import response
from robust.systems.realisation import least_stable
from robust.systems.stability import stable
from robust.uncertain.forms import numerator

__all__ = ["Feedforward", "feedforward"]


@value
class Feedforward:
    """A feedforward, and how well the loop follows its reference model with it and without.

    Fields
    ------
    F : control.StateSpace
        Stable, on the time base of the loop: u = K (T_ref r - y) + F r.
    gamma, gamma_min : float
        Norm of [T_ref - G F; effort F] before states were left out, and a lower bound for any F.
    certificate : Certificate or None
        The proof of gamma, or why there is none.
    omega : (W,) ndarray
        Frequencies [rad/s].
    error, error_worst : (W,) ndarray
        |T_ref - y/r| of the nominal loop, and the largest over the set; inf where rs reaches one.
    error_without : (W,) ndarray
        The largest over the set with F = 0.

    References
    ----------
    SP 5.4 (limits of feedforward by uncertainty).

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI")
    >>> found = feedforward(model, 2.0, control.tf([1], [0.5, 1]))
    >>> bool(found.error.max() < found.error_worst.max() < 0.1 < found.error_without.max())
    True
    """

    F: control.StateSpace
    gamma: float
    gamma_min: float
    certificate: Certificate | None
    omega: np.ndarray
    error: np.ndarray
    error_worst: np.ndarray
    error_without: np.ndarray


def feedforward(model: Any, K: Any, reference: Any, *, effort: float = 1e-3, delay: float = 0.0) -> Feedforward:
    """Find what is to be added to u so that a loop follows a reference model, and what the set makes of the result.

    Parameters
    ----------
    model : UncertaintyModel
        Plant with its set, with a parametric nominal that is stable.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback, of T_ref r - y; a sampled one on a continuous nominal as for `check`.
    reference : control.StateSpace, TransferFunction
        T_ref, stable: how y should follow r. Continuous ones go through the bilinear map onto a sampled loop.
    effort : float
        Weight on F, in units of error over those of u: how much of it is bought for how much of the error.
    delay : float
        Computation delay [s].

    Returns
    -------
    Feedforward

    Raises
    ------
    ValueError
        A plant or a reference that is not stable, a loop that is not, sampling times that differ.

    References
    ----------
    SP 5.4.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.1]), perturbation="LTI")
    >>> found = feedforward(model, 2.0, control.tf([1], [0.5, 1]))     # F = (s + 1)/(s/2 + 1): sqrt(5/2) at 2 rad/s
    >>> round(float(found.F.dcgain()), 2), bool(abs(abs(found.F(2j)) - np.sqrt(5 / 2)) < 0.02)
    (1.0, True)
    """
    effort, loop = positive("effort", effort), following(model, K, delay)
    if not stable(loop.G):
        raise ValueError(
            f"model must have a stable nominal to be fed forward to, got a pole at {least_stable(loop.G):.4g}. Close a "
            "loop around it first (cascade), or take prefilter, which feeds the closed loop"
        )
    T_ref = on_time_base(reference, loop.dt)
    found = hinfsyn(matching(T_ref, loop.G, effort, loop.dt), 1, 1)
    if not found.found:
        raise ValueError(f"reference must be one that a feedforward can be found for: {found.reason}")
    omega = loop.grid(model.omega)
    F = fewest_states(found.K, loop.G, omega, loop.dt)
    wanted = response(T_ref, omega)
    error, worst = missed(loop, response(F, omega), wanted, omega)
    return Feedforward(
        F=F,
        gamma=found.gamma,
        gamma_min=found.gamma_low,
        certificate=found.certificate,
        omega=omega,
        error=error,
        error_worst=worst,
        error_without=missed(loop, np.zeros_like(wanted), wanted, omega)[1],
    )


def missed(loop: Loop, f: np.ndarray, wanted: np.ndarray, omega: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """(W,) |S (T_ref - G F)| and the largest |S_p (T_ref - G_p F)| over the set, which no controller divides.

    S_p (T_ref - G_p F) = S (p + q Delta)/(1 + b Delta) fills a disc; inf where |b| reaches one.
    """
    curves = loop.curves(omega)
    S, a, b = curves.S, curves.a, curves.b
    g = numerator(loop.form, curves.w, curves.G, curves.W)
    p, q = wanted - curves.G * f, a * wanted - g * f
    with np.errstate(all="ignore"):
        worst = np.abs(S) * (np.abs(p - q * b.conj()) + np.abs(q - p * b)) / (1 - np.abs(b) ** 2)
    return np.abs(S * p), np.where(np.abs(b) < 1, worst, np.inf)
