"""Controllers of lower order that keep the proved properties."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace
from typing import cast

import control
import numpy as np

from nlfrf._base.arguments import format_count, require_integer, require_nonnegative
from nlfrf._base.values import value
from robust._base.types import Controller, LinearSystem, Weight
from robust.analysis.loop import assemble_loop
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.lti.connections import closed_loop
from robust.lti.grids import structure_grid
from robust.lti.lti import response, response_by_channel, timebase, with_names
from robust.lti.minimal import channel_units
from robust.lti.norms import continuous_image, to_discrete
from robust.lti.realisation import multivariable
from robust.lti.truncation import (
    balanced_candidates,
    coprime_factor_candidates,
    weighted_candidates,
)
from robust.models.sets.forms import ADDITIVE, DEFAULT_FORM
from robust.models.sets.measured import FrfSource, lines_of
from robust.models.sets.model import UncertaintyModel, has_several_channels
from robust.pages.section import Fact
from robust.pages.text import format_facts

_LEAST_RADIUS = 1e-9  # relative radius of the set around a plant without a set
_MAX_CHANGE_OF_T = 0.1  # limit of max |T_r - T| without a proved performance


@value
class Reduction:
    """A controller of lower order, with the result of its check.

    Fields
    ------
    K : control.StateSpace
        The reduced controller; or the given controller, if no controller of lower order keeps the
        proved properties.
    order : int
        Number of states of K.
    method : str
        Method of the reduction: "balanced", "weighted by the loop" or "coprime factors", each
        truncated (exact at high frequency) or residualised (exact at zero frequency); "not reduced"
        if K is the given controller.
    kept : bool
        True if the check of K proves all that the check of the given controller proves.
    report, before : RobustnessReport
        Reports on the reduced and on the given controller.
    reason : str
        Reason why the order is not lower, or the property that was lost.
    n_tried : int
        Number of candidates tried.
    full_order : int
        Number of states of the given controller.

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
    >>> print(found)
    order 3 to 1, balanced, residualised: all proofs are kept
    before:      robust, max rs 0.37, |S| reaches 1.53 over the set
    reduced:     robust, max rs 0.369, |S| reaches 1.52 over the set
    """

    K: control.StateSpace
    order: int
    method: str
    kept: bool
    report: RobustnessReport
    before: RobustnessReport
    reason: str
    n_tried: int
    full_order: int

    def __str__(self) -> str:
        if self.order == self.full_order:
            return (
                f"order {self.order}, not reduced ({format_count(self.n_tried, 'candidate')}):"
                f" {self.reason}"
            )
        if self.kept:
            end = "all proofs are kept"
        else:
            end = f"not all proofs are kept: {self.reason}"
        facts = []
        for label, report in (("before", self.before), ("reduced", self.report)):
            found = [report.headline]
            if np.isfinite(report.margins.rs):
                found.append(f"max {report.curves.measure} {1 / report.margins.rs:.3g}")
            if np.isfinite(report.margins.S_worst):
                found.append(f"|S| reaches {report.margins.S_worst:.3g} over the set")
            facts.append(Fact(label, ", ".join(found)))
        return (
            f"order {self.full_order} to {self.order}, {self.method}: {end}\n{format_facts(facts)}"
        )


def reduce_controller(
    K: Controller,
    model: FrfSource | LinearSystem,
    w_P: Weight | None = None,
    *,
    order: int | None = None,
    delay: float = 0.0,
    max_candidates: int = 300,
) -> Reduction:
    """Reduce the order of a controller while its proved properties are kept.

    Use this before you implement a controller of high order.

    Candidates come from three methods, each with truncation and with residualisation: balanced
    reduction, balanced reduction weighted by the loop (G S before and S after the error of K), and
    reduction of the coprime factors of K. From the lowest order upwards, the best candidate of each
    order is checked in full. The first candidate that keeps the verdict is the result; if robust
    performance was proved, it must be kept, too. Otherwise the change of T must stay below 0.1,
    because K = 0 would keep the verdict for a stable plant.

    Parameters
    ----------
    K : control.StateSpace, TransferFunction
        Controller, continuous or sampled, with one or several channels.
    model, w_P, delay
        As for `check`. If `model` is a plant without uncertainty, as for `mixsyn`, stability and
        max |w_P S| < 1 are kept.
    order : int, optional
        Order of the reduced controller, which is then returned even if it loses a property.
    max_candidates : int
        Largest number of reduced controllers to check. If none of them suffices, K is returned
        unchanged.

    Returns
    -------
    Reduction

    Raises
    ------
    ValueError
        A controller for which the check proves nothing (give an `order` then), or an order that is
        not lower than that of K.

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
    given, model = model, _plant_as_set(model)
    alone = model is not given  # the plant was given without a set
    K = multivariable("K", K)
    delay = require_nonnegative("delay", delay)
    max_candidates = require_integer("max_candidates", max_candidates, least=1)
    if order is not None and require_integer("order", order, least=0) >= K.nstates:
        raise ValueError(f"order must be below the {K.nstates} states of K, got {order}")
    before = check(model, K, w_P=w_P, delay=delay)
    if order is None:
        _require_proved(before)
    by_order = _candidates_by_order(K, model, order, w_P=w_P, delay=delay)
    n_tried = 0
    if K.nstates:
        reason = "no controller of lower order keeps the proofs"
    else:
        reason = "a gain has no states"
    for n in sorted(by_order):
        if n_tried >= max_candidates:
            reason = f"{n_tried} candidates were tried below order {n}"
            break
        n_tried += len(by_order[n])
        for method, small in _rank_candidates(
            by_order[n],
            model,
            w_P=w_P,
            delay=delay,
            whole=K,
            before=before,
            every=order is not None,
        ):
            report = check(model, small, w_P=w_P, delay=delay)
            kept, lost = _compare_reports(
                report, before, _change_of_T(model, K, small=small, before=before)
            )
            if kept or order is not None:
                return Reduction(
                    K=with_names(small, K.input_labels, K.output_labels),
                    order=n,
                    method=method,
                    kept=kept,
                    report=_without_set(report) if alone else report,
                    before=_without_set(before) if alone else before,
                    reason=lost,
                    n_tried=n_tried,
                    full_order=K.nstates,
                )
    if alone:
        before = _without_set(before)
    return Reduction(
        K=K,
        order=K.nstates,
        method="not reduced",
        kept=True,
        report=before,
        before=before,
        reason=reason,
        n_tried=n_tried,
        full_order=K.nstates,
    )


def _require_proved(before: RobustnessReport) -> None:
    """Refuse a controller of which the check proves nothing."""
    if not before.verdict.is_robust:
        raise ValueError(
            f"K must have a proved property that can be kept, got '{before.verdict}':"
            f" {before.reason}. Give an order to reduce it anyway."
        )


def _candidates_by_order(
    K: control.StateSpace,
    model: FrfSource,
    order: int | None,
    *,
    w_P: Weight | None,
    delay: float,
) -> dict[int, list[tuple[str, control.StateSpace]]]:
    """Return the candidates below the order of K with their methods, of every order or one."""
    found: dict[int, list[tuple[str, control.StateSpace]]] = {}
    for method, n, small in _candidates(K, model, w_P=w_P, delay=delay):
        if order in (None, n) and n < K.nstates:
            found.setdefault(n, []).append((method, small))
    return found


def _plant_as_set(model: FrfSource | LinearSystem) -> FrfSource:
    """Return a plant as the set of those within a billionth of it; anything else unchanged."""
    if lines_of(model) is not None or isinstance(model, UncertaintyModel):
        return model
    G = multivariable("model", model)
    omega, one, small = (
        np.ones(1),
        *(control.StateSpace([], [], [], [[size]], G.dt) for size in (1.0, _LEAST_RADIUS)),
    )
    if G.ninputs == G.noutputs == 1:
        radius = np.full(1, 0.9 * _LEAST_RADIUS)
        return UncertaintyModel(G, small, DEFAULT_FORM, omega, radius, perturbation="LTI")
    if G.ninputs == G.noutputs:
        left, right = (one,) * G.ninputs, (small,) * G.ninputs
        return UncertaintyModel(
            G, form="input", left=left, right=right, omega=omega, perturbation="LTI"
        )
    # a set at the inputs alone cannot move all outputs if there are more of them: every entry, in
    # units of its channels
    rows, columns = channel_units(
        np.median(np.abs(response_by_channel(G, structure_grid(G)[1:])), axis=2)
    )
    left, right = tuple(small * size for size in rows), tuple(one * size for size in columns)
    return UncertaintyModel(
        G, form=ADDITIVE, left=left, right=right, omega=omega, perturbation="LTI"
    )


def _without_set(report: RobustnessReport) -> RobustnessReport:
    """Return the report on a plant that stands for a set, in words for a plant."""
    stable = report.proofs.robustly_stable
    if report.proofs.robust_performance:
        what = "Stability and the performance demand"
    else:
        what = "Stability"
    return replace(
        report,
        margins=replace(report.margins, peak_rs=None, peak_S=None, broken=np.inf, worst=None),
        reason="the loop with this plant is stable" if stable else report.reason,
        advice="",
        proved=f"{what} with the given plant, at all frequencies." if stable else report.proved,
        not_proved="Anything about a different plant.",
        context="",
    )


def _candidates(
    K: control.StateSpace, model: FrfSource, *, w_P: Weight | None, delay: float
) -> Iterator[tuple[str, int, control.StateSpace]]:
    """Yield (method, order, controller) for every method that applies to this controller."""
    if not K.nstates:
        return
    dt = timebase(K)
    image = continuous_image(K)
    ways = [lambda: balanced_candidates(image), lambda: coprime_factor_candidates(image)]
    if lines_of(model) is None:
        # to first order T changes by (S G) (K_r - K) S: y from p_in behind K, e from r before it
        # (Anderson & Liu 1989)
        pairs = ((("y",), ("p_in",)), (("e",), ("r",)))
        if has_several_channels(model):
            closed_loops = [
                control.StateSpace(*closed_loop(model.nominal, K, *pair), model.nominal.dt)
                for pair in pairs
            ]
        else:
            # no lines: a set
            loop = assemble_loop(cast("UncertaintyModel", model), K, w_P=w_P, delay=delay)
            closed_loops = [loop.closed_loop(*pair) for pair in pairs]
        behind, before = map(continuous_image, closed_loops)
        if np.all(np.linalg.eigvals(before[0]).real < 0):
            ways.append(lambda: weighted_candidates(image, before, behind))
    for way in ways:
        try:
            for method, n, small in way():
                if all(np.isfinite(part).all() for part in small):
                    yield (
                        method,
                        n,
                        control.StateSpace(*(to_discrete(*small) if dt else small), K.dt),
                    )
        except (np.linalg.LinAlgError, ValueError):
            continue


def _rank_candidates(
    small: list[tuple[str, control.StateSpace]],
    model: FrfSource,
    *,
    w_P: Weight | None,
    delay: float,
    whole: control.StateSpace,
    before: RobustnessReport,
    every: bool,
) -> list[tuple[str, control.StateSpace]]:
    """Sort reduced controllers by their curves, best first, and drop those that cannot keep the
    proved properties.
    """
    found = []
    for method, K in small:
        try:
            report = check(model, K, w_P=w_P, delay=delay, certify=False)
        except ValueError:  # a loop without a solution
            continue
        change = _change_of_T(model, whole, small=K, before=before)
        if before.proofs.robust_performance:
            performs = report.margins.rp >= 1
        else:
            performs = change <= _MAX_CHANGE_OF_T
        if (report.margins.rs > 1 and performs) or every:
            size = report.margins.rp if before.proofs.robust_performance else -change
            found.append((report.nominally_stable, float(np.nan_to_num(size)), method, K))
    return [(method, K) for _, _, method, K in sorted(found, key=lambda one: one[:2], reverse=True)]


def _compare_reports(
    report: RobustnessReport, before: RobustnessReport, change: float
) -> tuple[bool, str]:
    """Return True if everything proved before is proved again, and a description of the loss."""
    if before.verdict.is_robust and report.verdict != before.verdict:
        return (
            False,
            f"the verdict is '{report.verdict}' instead of '{before.verdict}': {report.reason}",
        )
    if before.proofs.robust_performance and not report.proofs.robust_performance:
        return False, "robust performance is no longer proved"
    if not before.proofs.robust_performance and not change <= _MAX_CHANGE_OF_T:
        return False, f"the closed loop moved by {change:.3g}"
    return True, ""


def _change_of_T(
    model: FrfSource, K: control.StateSpace, *, small: control.StateSpace, before: RobustnessReport
) -> float:
    """Return max |T_r - T| of the nominal loop on the grid of its report, inf if it is unknown."""
    if has_several_channels(model):
        G, one = response_by_channel(model.nominal, before.curves.omega), np.eye(model.n_outputs)
        L = (
            np.moveaxis(
                np.einsum("jkw,klw->jlw", G, response_by_channel(part, before.curves.omega)), 2, 0
            )
            for part in (K, small)
        )
        S, S_r = (np.linalg.inv(one + part) for part in L)
        return float(np.linalg.norm(S_r - S, 2, axis=(1, 2)).max())
    with np.errstate(all="ignore"):
        d = before.curves.T * (
            1 - response(small, before.curves.omega) / before.curves.K
        )  # (W,) (K - K_r) G S
        change = np.abs(before.curves.S * d / (1 - d))
    if np.isfinite(change).any():
        return float(np.nanmax(change))
    return np.inf
