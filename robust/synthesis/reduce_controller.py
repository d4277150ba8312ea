"""Controllers of lower order that keep what was proved: candidates by model reduction, each judged by the check."""

from __future__ import annotations

import time
from collections.abc import Iterator
from typing import Any

import control
import numpy as np

from nlfrf import Bla
from nlfrf.shared.arguments import integer, nonnegative, positive
from nlfrf.shared.values import value
from robust.analysis.check import check
from robust.analysis.loop import assemble
from robust.analysis.report import RobustnessReport
from robust.synthesis.reduction import balanced, of_factors, weighted
from robust.systems.bilinear import continuous_image, to_discrete
from robust.systems.lti import response, timebase
from robust.systems.realisation import state_space

__all__ = ["Reduction", "reduce_controller"]


CLOSE = 0.1  # max |T_r - T| where no performance was proved


@value
class Reduction:
    """A controller of lower order, and what the check says of it.

    Fields
    ------
    K : control.StateSpace
        The reduced controller; the one that was given where none of lower order keeps what was proved.
    order : int
        Its states.
    method : str
        How it was reduced: "balanced", "weighted by the loop" or "coprime factors", truncated (exact at high
        frequencies) or residualised (exact at zero); "not reduced" otherwise.
    kept : bool
        Whether its check proves what the check of the controller that was given proves.
    report, before : RobustnessReport
        Of the reduced controller and of the one that was given.
    reason : str
        Why it is not lower, or what was lost.
    n_tried : int
        Candidates looked at.

    References
    ----------
    SP 11.2 to 11.4.

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2, 0.2], [0.05, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.2]), perturbation="LTI")
    >>> K = control.tf([2, 2], [1, 0]) * control.tf([1], [1e-3, 1]) * control.tf([1, 3.01], [1, 3])
    >>> found = reduce_controller(K, model)                # what is left is the integrator and its gain
    >>> found.order, found.kept, found.report.verdict
    (1, True, 'robust')
    """

    K: control.StateSpace
    order: int
    method: str
    kept: bool
    report: RobustnessReport
    before: RobustnessReport
    reason: str
    n_tried: int


def reduce_controller(
    K: Any, model: Any, w_P: Any = None, *, order: int | None = None, delay: float = 0.0, time_cap: float = 30.0
) -> Reduction:
    """Find the controller of lowest order that keeps what the check of a controller proves.

    Looked at are balanced truncation, the same weighted by the loop (G S before and S behind the error of K: what the
    loop sees of it), and that of the coprime factors of K, each truncated and residualised. From the lowest order on
    the best is checked in full, until one keeps the verdict, and robust performance where that was proved. Where it was
    not, K = 0 would keep the verdict on a stable plant: then max |T_r - T| has to stay below 0.1 too.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction
        Controller, continuous or sampled.
    model, w_P, delay
        As for `check`.
    order : int, optional
        This order and no other: the best of it, kept or not.
    time_cap : float
        Seconds; where they are over K comes back as it was.

    Returns
    -------
    Reduction

    Raises
    ------
    ValueError
        A controller of which the check proves nothing (give an order then), an order that is no lower.

    References
    ----------
    SP 11.2 to 11.4; Moore 1981; Enns 1984; Meyer 1990; Anderson & Liu 1989 (weights from the loop).

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([0.2, 0.2], [0.05, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.2]), perturbation="LTI")
    >>> K = control.tf([1], [1e-4, 1]) * control.tf([3], [1e-3, 1])
    >>> found = reduce_controller(K, model)                             # the gain of 3 alone
    >>> found.order, round(float(found.K.D[0, 0]), 6)
    (0, 3.0)
    """
    K, delay = state_space("K", K), nonnegative("delay", delay)
    deadline = time.monotonic() + positive("time_cap", time_cap)
    if order is not None and integer("order", order, least=0) >= K.nstates:
        raise ValueError(f"order must be below the {K.nstates} states of K, got {order}")
    before = check(model, K, w_P=w_P, delay=delay)
    if order is None and not before.verdict.is_robust:
        raise ValueError(
            f"K must be one of which something is proved, got '{before.verdict}': {before.reason}. Give an order "
            "to reduce it all the same."
        )
    by_order: dict[int, list[tuple[str, control.StateSpace]]] = {}
    for method, n, small in candidates(K, model, w_P, delay):
        if order in (None, n) and n < K.nstates:
            by_order.setdefault(n, []).append((method, small))
    n_tried, reason = 0, "no controller of lower order keeps what was proved" if K.nstates else "a gain has no states"
    for n in sorted(by_order):
        if time.monotonic() > deadline:
            reason = f"the time cap was reached below order {n}"
            break
        n_tried += len(by_order[n])
        for method, small in ranked(by_order[n], model, w_P, delay, before, every=order is not None):
            report = check(model, small, w_P=w_P, delay=delay)
            kept, lost = compared(small, report, before)
            if kept or order is not None:
                told = {"report": report, "before": before, "reason": lost, "n_tried": n_tried}
                return Reduction(K=small, order=n, method=method, kept=kept, **told)
    return Reduction(
        K=K,
        order=K.nstates,
        method="not reduced",
        kept=True,
        report=before,
        before=before,
        reason=reason,
        n_tried=n_tried,
    )


def candidates(
    K: control.StateSpace, model: Any, w_P: Any, delay: float
) -> Iterator[tuple[str, int, control.StateSpace]]:
    """(method, order, controller) by every way that works on this controller."""
    if not K.nstates:
        return
    dt = timebase(K)
    image = continuous_image(K)
    ways = [lambda: balanced(image), lambda: of_factors(image)]
    if not measured(model):
        loop = assemble(model, K, w_P, delay)
        before, behind = (continuous_image(loop.closed((o,), (i,))) for o, i in (("y", "p_in"), ("e", "r")))
        if np.all(np.linalg.eigvals(before[0]).real < 0):
            ways.append(lambda: weighted(image, before, behind))
    for way in ways:
        try:
            for method, n, small in way():
                if all(np.isfinite(part).all() for part in small):
                    yield method, n, control.StateSpace(*(to_discrete(*small) if dt else small), K.dt)
        except (np.linalg.LinAlgError, ValueError):
            continue


def measured(model: Any) -> bool:
    """Whether the plant is known on its lines only."""
    return isinstance(model, (Bla, control.FrequencyResponseData)) or getattr(model, "measured_only", False)


def ranked(
    small: list[tuple[str, control.StateSpace]],
    model: Any,
    w_P: Any,
    delay: float,
    before: RobustnessReport,
    *,
    every: bool,
) -> list[tuple[str, control.StateSpace]]:
    """Those that may keep what was proved, by their curves, the best first; all where one has to be returned."""
    found = []
    for method, K in small:
        try:
            report = check(model, K, w_P=w_P, delay=delay, certify=False)
        except ValueError:  # a loop without a solution
            continue
        performs = report.margin_rp >= 1 if before.robust_performance else moved(K, before) <= CLOSE
        if (report.margin_rs > 1 and performs) or every:
            size = report.margin_rp if before.robust_performance else -moved(K, before)
            found.append((report.nominally_stable, float(np.nan_to_num(size)), method, K))
    return [(method, K) for _, _, method, K in sorted(found, key=lambda one: one[:2], reverse=True)]


def compared(K: control.StateSpace, report: RobustnessReport, before: RobustnessReport) -> tuple[bool, str]:
    """Whether everything that was proved before is proved again, and what is not."""
    if before.verdict.is_robust and report.verdict != before.verdict:
        return False, f"the verdict is '{report.verdict}' where it was '{before.verdict}': {report.reason}"
    if before.robust_performance and not report.robust_performance:
        return False, "robust performance is not proved any more"
    if not before.robust_performance and not moved(K, before) <= CLOSE:
        return False, f"the closed loop moved by {moved(K, before):.3g}"
    return True, ""


def moved(K: control.StateSpace, before: RobustnessReport) -> float:
    """max |T_r - T| of the nominal loop on its grid, inf where nothing is known of it."""
    with np.errstate(all="ignore"):
        d = before.T * (1 - response(K, before.omega) / before.K)  # (W,) (K - K_r) G S
        change = np.abs(before.S * d / (1 - d))
    return float(np.nanmax(change)) if np.isfinite(change).any() else np.inf
