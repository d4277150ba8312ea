"""The controller check: nominal stability, then what the whole set does to it, then what of that is proved.

                      w Delta
                    +---------+           multiplicative: reads u, acts at p_in    G (1 + w Delta)
                    |         v           additive:       reads u, acts at p_out   G + w Delta
                    |        p_in   p_out inv. mult.:     reads y, acts at p_out   G / (1 + w Delta)
                    |         |       |   inv. additive:  reads y, acts at p_in    G / (1 + w G Delta)
    r --->(+)- e ->[ K ]- u -(+)-[ G ]-(+)---+--> y
          -^                                 |
           +---------------------------------+    u = K (r - y),  S = 1/(1 + G K),  T = 1 - S

A controller that runs sampled is checked sampled: hold and computation delay go into G first.
"""

from __future__ import annotations

from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import one_of
from nlfrf.shared.wording import shown
from robust.analysis.check_lines import check_lines
from robust.analysis.loop import Loop, assemble, nominal_instability, performance_margin
from robust.analysis.proofs import prove_performance, prove_stability
from robust.analysis.report import RobustnessReport
from robust.analysis.verdict import advice, context, judge, sentences
from robust.certificates.certificate import Certificate
from robust.certificates.solver import SOLVERS
from robust.systems.lti import response
from robust.uncertain.model import UncertaintyModel

__all__ = ["check"]


def check(
    model: Any,
    K: Any,
    *,
    w_P: Any = None,
    delay: float = 0.0,
    certify: bool = True,
    solver: str = "CLARABEL",
    n_unstable: int = 0,
) -> RobustnessReport:
    """Check a controller against a model with uncertainty, and say what was proved.

    Parameters
    ----------
    model : UncertaintyModel, nlfrf.Bla or control.FrequencyResponseData
        The plant. An FRF (alone, as a Bla with its bound, or as the nominal of a model) is known on its lines only,
        and so is the result.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback u = K (r - y). A discrete K on a continuous nominal is the normal case: the
        nominal is discretised with zero-order hold and delay included, the radius taken up to Nyquist.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight: |w_P S_p| <= 1 is asked of every plant of the set.
    delay : float
        Computation delay [s] on top of what the model contains.
    certify : bool
        Prove the result over all frequencies; without it nothing better than "not certified" comes out.
    solver : str
        "CLARABEL" or "SCS", for the bounded-real certificate.
    n_unstable : int
        Unstable open-loop poles of an FRF, for the winding number.

    Returns
    -------
    RobustnessReport
        A bad controller is a result, not an error.

    Raises
    ------
    ValueError
        Parts that do not fit each other: sampling times, an unstable w_P, a loop without a solution.

    References
    ----------
    SP 7.5 (robust stability), 7.6 (robust performance), 8.6; Seiler, Packard & Gahinet 2020 (disk margins).

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([1, 0.2], [0.5, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.5]), perturbation="LTI")
    >>> report = check(model, 2.0)                       # |w T| peaks at |w| -> 2, T = 2/(s + 3): 0.98 near 5 rad/s
    >>> report.verdict, bool(abs(report.margin_rs - 1 / max(report.rs)) < 1e-3)
    ('robust', True)
    """
    one_of("solver", solver, SOLVERS)
    if isinstance(model, (Bla, control.FrequencyResponseData)) or getattr(model, "measured_only", False):
        return check_lines(model, K, w_P=w_P, delay=delay, n_unstable=n_unstable)
    if not isinstance(model, UncertaintyModel):
        raise ValueError(f"model must be an UncertaintyModel, a Bla or a FrequencyResponseData, got {shown(model)}")
    loop = assemble(model, K, w_P, delay)
    omega = loop.grid(model.omega)
    wrong = nominal_instability(loop)
    if wrong:
        return unstable(model, loop, omega, wrong)
    band = (float(model.omega[0]), float(model.omega[-1]))
    peak_rs, omega_rs = loop.peak(loop.rs, omega, band)
    margin_rp, omega_rp = performance_margin(loop, omega, band)
    half, omega_disk = loop.peak(loop.half_disk, omega, band)
    peaks = np.array([omega_rs, omega_rp, omega_disk])
    omega = np.unique(np.concatenate([omega, peaks[(peaks > omega[0]) & (peaks < omega[-1])]]))
    S = loop.terms(omega)[0]
    certificates: list[Certificate] = []
    violation = peak_rs >= 1
    if certify and not violation:
        certificates.append(prove_stability(loop, omega, solver))
        violation = certificates[0].reason.startswith("violated")
    robustly_stable = bool(certificates and certificates[0].holds and not violation)
    performance = False
    if w_P is not None and robustly_stable:
        certificates.append(prove_performance(loop, omega, one_scaling=model.perturbation == "operator"))
        performance = certificates[-1].holds
    verdict, reason = judge(model, loop, peak_rs, omega_rs, violation, certify, certificates, robustly_stable)
    proved, not_proved = sentences(model, loop, omega, robustly_stable, performance)
    return RobustnessReport(
        omega=omega,
        S=S,
        T=1 - S,
        rs=loop.rs(omega),
        np_=loop.nominal(omega),
        rp=loop.rp(omega),
        nominally_stable=True,
        robustly_stable=robustly_stable,
        robust_performance=performance,
        margin_rs=1 / peak_rs if peak_rs > 0 else np.inf,
        margin_rp=margin_rp,
        omega_rs=omega_rs,
        omega_rp=omega_rp,
        disk_margin=1 / half if half > 0 else np.inf,
        omega_disk=omega_disk,
        certificates=tuple(certificates),
        perturbation=model.perturbation,
        verdict=verdict,
        reason=reason,
        advice=advice(model, omega_rs),
        proved=proved,
        not_proved=not_proved,
        context=context(model, loop),
        w_P=None if w_P is None else np.abs(response(loop.w_P, omega)),
        form=model.form,
        **responses(loop, omega),
    )


def responses(loop: Loop, omega: np.ndarray) -> dict[str, Any]:
    """What the loop is made of, on the grid of the report."""
    return {
        "G": loop.plant(omega),
        "K": response(loop.K, omega),
        "radius": np.abs(response(loop.weight, omega)),
    }


def unstable(model: UncertaintyModel, loop: Loop, omega: np.ndarray, reason: str) -> RobustnessReport:
    """The report on a loop that is not stable to begin with: no margins."""
    nothing = np.full(omega.size, np.nan)
    S = loop.terms(omega)[0]
    undecided = reason.startswith("undecided")
    return RobustnessReport(
        omega=omega,
        S=S,
        T=1 - S,
        rs=nothing,
        np_=nothing,
        rp=nothing,
        nominally_stable=False,
        perturbation=model.perturbation,
        verdict="not certified" if undecided else "not robust",
        reason=reason,
        advice="Lower the gain or the bandwidth until the nominal loop is stable; nothing else can be said before.",
        proved="Nothing.",
        not_proved="Everything: margins mean nothing for a loop that is not stable.",
        context=context(model, loop),
        w_P=None,
        form=model.form,
        **responses(loop, omega),
    )
