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

from dataclasses import replace

import control
import numpy as np

from nlfrf import Bla
from nlfrf._base.arguments import format_hertz, keep_warnings, require_choice, require_integer, require_nonnegative
from robust._base.channels import is_single
from robust._base.types import Controller, Weight
from robust.analysis.aliases import RsBreakdown, rs_breakdown
from robust.analysis.curves import Peaks, loop_curves, peaks_on_lines
from robust.analysis.disk import disk_margins
from robust.analysis.findings import Given
from robust.analysis.lmi_proofs import METHODS, ProofMethod, prove_set_by
from robust.analysis.loop import Loop, assemble_loop, decide_nominal_stability, find_curve_peaks
from robust.analysis.loop_level import LoopSignals, predict_level, require_one_channel_loop
from robust.analysis.loop_proofs import stability_claim
from robust.analysis.report import RobustnessReport
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.analysis.structured import check_structure
from robust.analysis.text import (
    describe_aliases,
    describe_confidence,
    texts_of_frf,
    texts_of_stable_loop,
    texts_of_unstable_loop,
)
from robust.analysis.worst_plant import largest_gains, performance_loop
from robust.lti.grids import controller_mode_lines, extend_grid, interpolate_frf
from robust.lti.lti import common_sampling_time, require_sampling_time, response, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import unstable_poles, winding_number
from robust.models.sets.measured import (
    FrfSource,
    add_hold_and_delay,
    frf_sampling_time,
    parts_on_lines,
    warn_of_unknown_hold,
)
from robust.models.sets.model import UncertaintyModel, describe_no_set, has_several_channels
from robust.proofs.search.certificate import SOLVERS

# ---- The check on measured lines only: a loop whose plant is known as an FRF and nowhere else.


def check_lines(
    model: FrfSource, K: Controller, *, w_P: Weight | None, delay: float, n_unstable: int
) -> RobustnessReport:
    """Check on the lines of the FRF only: stability by the winding number of 1 + L, and the curves.

    Frequencies between the lines are added where the controller, which is known there, has modes.
    """
    K = state_space("K", K)
    delay, n_unstable = require_nonnegative("delay", delay), require_integer("n_unstable", n_unstable, least=0)
    omega, G, form, w, perturbation, W = parts_on_lines(model)
    dt, sampled_frf = timebase(K), frf_sampling_time(model) or None
    require_usable_frf(omega, G, dt)
    require_sampling_time("K", K, reference="the FRF", wanted=sampled_frf)
    w_P = None if w_P is None else state_space("w_P", w_P)
    if w_P is not None and timebase(w_P):  # a continuous one may stand over a sampled loop
        require_sampling_time("w_P", w_P, reference="the loop", wanted=sampled_frf or common_sampling_time(K))
    encirclements, clear = winding_number(omega, add_hold_and_delay(model, omega, G=G, dt=dt, delay=delay), K=K, dt=dt)
    at, lines = np.union1d(omega, controller_mode_lines(K, (omega[0], omega[-1]))), omega
    measured, w, W = (interpolate_frf(at, lines, part) for part in (G, w, W))
    G = add_hold_and_delay(model, at, G=measured, dt=dt, delay=delay)
    W = W * measured / G  # the set is one about what was measured: hold and delay stand with the controller
    wanted = n_unstable + unstable_poles(K, dt)
    stable, has_set = clear and encirclements == wanted, bool(np.isfinite(w).all())
    curves = loop_curves(form, at, G=G, K=response(K, at), w=w, w_P=None if w_P is None else response(w_P, at), W=W)
    peaks = peaks_on_lines(curves) if stable else Peaks()
    hold = " with zero-order hold" if dt and not frf_sampling_time(model) else ""
    words = texts_of_frf(
        omega,
        peaks.rs[0],
        encirclements=encirclements,
        wanted=wanted,
        clear=clear,
        has_set=has_set,
        loop=f"{hold}; controller {K.nstates} states",
    )
    unit = getattr(model, "unit", "")
    return RobustnessReport(
        nominally_stable=stable,
        curves=curves.shown(stable),
        margins=peaks.margins,
        given=Given(perturbation=perturbation, form=form, demand=w_P, delay=delay, band=omega[[0, -1]], unit=unit),
        confidence=describe_confidence(model),
        **words,
    )


def require_usable_frf(omega: np.ndarray, G: np.ndarray, dt: float) -> None:
    """Refuse an FRF that has no finite value somewhere, or lines that the controller is too slow for."""
    if not np.all(omega > 0):
        raise ValueError(f"model must have an FRF on positive frequencies, got a line at {omega.min():g} rad/s")
    if not np.isfinite(G).all():
        where = format_hertz(omega[np.argmax(~np.isfinite(G))])
        raise ValueError(f"model must have a finite FRF on every line, got {G[~np.isfinite(G)][0]} at {where}")
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(
            f"K must be sampled fast enough for the lines up to {format_hertz(omega[-1])}, got dt = {dt:g} s"
        )


@keep_warnings
def check(
    model: UncertaintyModel | Bla | control.FrequencyResponseData,
    K: Controller,
    *,
    w_P: Weight | None = None,
    delay: float = 0.0,
    certify: bool = True,
    proof: ProofMethod = "exact",
    solver: str | None = None,
    n_unstable: int = 0,
    signals: LoopSignals | None = None,
) -> RobustnessReport:
    """Check a controller against a model with uncertainty, and say what was proved.

    Parameters
    ----------
    model : UncertaintyModel, nlfrf.Bla or control.FrequencyResponseData
        The plant. An FRF (alone, as a Bla with its bound, or as the nominal of a model) is known on its lines only,
        and so is the result.
    K : control.StateSpace, TransferFunction or float
        Controller, negative feedback u = K (r - y). A discrete K on a continuous nominal is the normal case: the
        nominal is discretised with zero-order hold and delay included, and the set acts at every alias: what folds
        down from above the Nyquist frequency is part of verdict, margin and certificate. Of several channels it is part
        of the sampled set that is checked, whose weights cover it on a grid.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight: |w_P S_p| <= 1 is asked of every plant of the set.
    delay : float
        Computation delay [s] on top of what the model contains.
    certify : bool
        Prove the result over all frequencies; without it nothing better than "not certified" comes out.
    proof : str
        How one loop is proved: "exact" (polynomials in exact arithmetic), "lmi" (a matrix P and a scaling from cvxpy,
        verified over the rationals, which leaves aliases and delays of continuous loops open), or "both", where what
        either proves is proved. Several channels are proved by P and a scaling, whatever is asked for.
    solver : str, optional
        "CLARABEL" or "SCS", for P and the scaling. When not given one loop takes CLARABEL, several channels both.
    n_unstable : int
        Unstable open-loop poles of an FRF, for the winding number.
    signals : LoopSignals, optional
        Reference, disturbance and noise, from which the report predicts the level at which the loop moves the machine,
        as `predict_level` does; of an UncertaintyModel with a parametric nominal.

    Returns
    -------
    RobustnessReport
        A bad controller is a result, not an error. Of several channels by `check_structure`.

    Raises
    ------
    ValueError
        Parts that do not fit each other: sampling times, an unstable w_P, a loop without a solution, signals that do
        not fit the loop or the model.

    References
    ----------
    SP 7.5 (robust stability), 7.6 (robust performance), 8.6; Seiler, Packard & Gahinet 2020 (disk margins);
    Dullerud & Glover, IEEE Trans. Automatic Control 38, 1993 (sampled sets).

    Examples
    --------
    >>> from robust import UncertaintyModel
    >>> lag, w = control.tf([1], [1, 1]), control.tf([1, 0.2], [0.5, 1])
    >>> model = UncertaintyModel(lag, w, "multiplicative", np.array([1.0]), np.array([0.5]), perturbation="LTI")
    >>> report = check(model, 2.0)                       # |w T| peaks at |w| -> 2, T = 2/(s + 3): 0.98 near 5 rad/s
    >>> report.verdict, bool(abs(report.margins.rs - 1 / max(report.curves.rs)) < 1e-3)
    ('robust', True)
    """
    require_choice("proof", proof, METHODS)
    if solver is not None:
        require_choice("solver", solver, SOLVERS)
    if signals is not None:
        require_one_channel_loop(model)
    if has_several_channels(model):
        return check_matrix(model, K, w_P=w_P, delay=delay, certify=certify, proof=proof, solver=solver)
    if is_single(model) or isinstance(model, control.FrequencyResponseData) or getattr(model, "measured_only", False):
        return check_lines(model, K, w_P=w_P, delay=delay, n_unstable=n_unstable)
    if not isinstance(model, UncertaintyModel):
        raise ValueError(
            f"model must be an UncertaintyModel, a Bla or a FrequencyResponseData, got {describe_no_set(model)}"
        )
    loop = assemble_loop(model, K, w_P=w_P, delay=delay)
    if loop.dt:
        warn_of_unknown_hold(model, loop.dt)
    omega = loop.grid(model.omega)
    given = Given(
        perturbation=model.perturbation,
        form=model.form,
        demand=loop.w_P,
        delay=float(delay),
        band=model.omega[[0, -1]],
        unit=model.unit,
    )
    confidence = describe_confidence(model)
    claim = stability_claim(model, K, w_P=loop.w_P, delay=delay)
    nominal = decide_nominal_stability(loop)
    if not nominal.stable:
        return RobustnessReport(
            nominally_stable=False,
            curves=loop.curves(omega).shown(stable=False),
            given=given,
            confidence=confidence,
            **texts_of_unstable_loop(model, loop, nominal),
        )
    curves = loop.curves(extend_grid(omega, loop.omega_max))
    peaks = find_curve_peaks(loop, curves, (float(model.omega[0]), float(model.omega[-1])))
    places = np.array([peaks.rs[1], peaks.margin_rp[1], peaks.half_disk[1], peaks.S_worst[1]])
    curves = curves.merge(loop.curves(places[~np.isnan(places)])).in_band(omega[0], omega[-1])
    proofs = prove_set_by(loop, curves, peaks.rs[0], claim=claim, certify=certify, proof=proof, solver=solver)
    folding = rs_breakdown_at_peak(loop, peaks, (float(model.omega[0]), float(model.omega[-1])))
    return RobustnessReport(
        nominally_stable=True,
        curves=curves.shown(stable=True),
        margins=peaks.margins,
        proofs=proofs,
        given=given,
        level=None if signals is None else predict_level(model, K, signals, delay=delay),
        confidence=confidence,
        folding="" if folding is None else describe_aliases(folding, model),
        **texts_of_stable_loop(model, loop, peaks=peaks, proofs=proofs, folding=folding, certify=certify),
    )


def rs_breakdown_at_peak(loop: Loop, peaks: Peaks, band: tuple[float, float]) -> RsBreakdown | None:
    """Split the largest rs of a set of continuous plants under a sampled controller; None for any other."""
    if loop.aliases is None:
        return None
    total, omega = peaks.rs
    return rs_breakdown(loop.with_aliases(loop.curves(omega)), band, total)


def check_matrix(
    model: UncertaintyModel,
    K: Controller,
    *,
    w_P: Weight | None,
    delay: float,
    certify: bool,
    proof: ProofMethod,
    solver: str | None,
) -> RobustnessReport:
    """Check several channels by the blocks of the best form, with the margins of every loop; one by `check`."""
    if model.is_single:
        return check(model, K, w_P=w_P, delay=delay, certify=certify, proof=proof, solver=solver)
    forms = [
        set_on_controller_time_base(form, K, delay) for form in (model, model.alternative_form) if form is not None
    ]
    reports = {form.form: check_structure(form.loop(K, w_P=w_P), certify=certify, solver=solver) for form, _ in forms}
    taken = best_form(reports)
    found = reports[taken]
    reason = found.reason
    if len(forms) > 1:
        reason += f"; of the forms {' and '.join(reports)} the {taken} one says most"
    known = replace(
        found,
        reason=reason,
        channels=disk_margins(forms[0][0], K),
        given=Given(
            perturbation=model.perturbation,
            form=taken,
            demand=w_P,
            delay=float(delay) if forms[0][1] else 0.0,
            band=model.omega[[0, -1]],
        ),
        confidence=describe_confidence(model),
    )
    taken_form, folding = next((form, words) for form, words in forms if form.form == taken)
    if known.nominally_stable:
        omega, S_worst = largest_gains(performance_loop(taken_form, K, None), taken_form.omega)
        at = int(S_worst.argmax())
        margins = replace(known.margins, S_worst=float(S_worst[at]), omega_S_worst=float(omega[at]))
        known = replace(known, margins=margins)
    if not folding:
        return known
    not_proved = f"That the weights of the sampled set cover every alias; {found.not_proved}"
    return replace(known, folding=folding, not_proved=not_proved)


def best_form(reports: dict[str, RobustnessReport]) -> str:
    """Return the form whose report proves most, then that of the larger margin."""

    def established(form: str) -> tuple[bool, bool, float]:
        report = reports[form]
        proofs, margin = report.proofs, float(np.nan_to_num(report.margins.rs, nan=-1.0))
        return proofs.robust_performance, proofs.robustly_stable, margin

    return max(reports, key=established)
