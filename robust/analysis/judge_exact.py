"""Judge a loop with one channel: curves in closed form, every alias of a sampled loop, proofs in
exact arithmetic.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from robust.analysis.aliases import RsBreakdown, rs_breakdown
from robust.analysis.findings import Effort, Findings, Margins, Proofs, decide_verdict
from robust.analysis.lmi_proofs import prove_set_by
from robust.analysis.loop import Loop, crossings_of, decide_nominal_stability, find_margins
from robust.analysis.text import (
    NO_MARGINS,
    NOTHING_PROVED,
    UNSTABLE_ADVICE,
    advise_on_margin,
    advise_on_weight,
    describe_aliases,
    describe_loop,
    explain_exact,
    proof_sentences,
)
from robust.lti.grids import extend_grid, refine_peaks


def judge_exact(loop: Loop, effort: Effort) -> Findings:
    """Return the findings for a loop with one channel, with proofs at every frequency."""
    statistical = loop.model.perturbation == "statistical"
    nominal, omega = decide_nominal_stability(loop), loop.grid(loop.model.omega)
    if not nominal.stable:
        return Findings(
            verdict=decide_verdict(nominal.state, Proofs(), statistical=statistical),
            nominally_stable=False,
            curves=loop.curves(omega).shown(stable=False),
            form=loop.form,
            reason=f"{nominal}",
            advice=UNSTABLE_ADVICE,
            proved=NOTHING_PROVED,
            not_proved=NO_MARGINS,
            context=describe_loop(loop),
        )
    curves = loop.curves(extend_grid(omega, loop.omega_max))
    margins = find_margins(loop, curves, loop.band)
    peaks = [margins.peak_rs, margins.peak_rp, margins.peak_disk, margins.peak_S]
    if loop.w_P is not None:
        peaks += refine_peaks(
            lambda at: loop.curves(at).rp[None],
            curves.omega,
            values=curves.rp[None],
            band=loop.band,
        )
    places = np.array([peak.omega for peak in peaks if peak is not None])
    curves = curves.merge(loop.curves(places)).in_band(omega[0], omega[-1])
    curves = curves.merge(loop.curves(crossings_of(loop, curves)))
    proofs = prove_set_by(loop, curves, margins.largest_rs, effort)
    folding = _rs_breakdown_at_peak(loop, margins)
    if (
        folding is not None and folding.total >= 1
    ):  # the part of the aliases is a bound, so it disproves nothing alone
        proofs = replace(proofs, violated=folding.single_frequency >= 1)
    proved, not_proved = proof_sentences(loop, proofs)
    T = float(abs(1 - loop.curves(np.array([margins.omega_rs])).S[0]))
    advice = advise_on_margin(
        loop.model, margins.omega_rs, weight=loop.responders["w"], folding=folding, T=T
    )
    return Findings(
        verdict=decide_verdict(nominal.state, proofs, statistical=statistical),
        nominally_stable=True,
        curves=curves.shown(stable=True),
        margins=margins,
        proofs=proofs,
        form=loop.form,
        reason=explain_exact(loop, margins, proofs, folding=folding, certify=effort.certify),
        advice=advice + advise_on_weight(loop, margins),
        proved=proved,
        not_proved=not_proved,
        context=describe_loop(loop),
        folding="" if folding is None else describe_aliases(folding, loop.model),
    )


def _rs_breakdown_at_peak(loop: Loop, margins: Margins) -> RsBreakdown | None:
    """Split the largest rs of a continuous set with a sampled controller; else None."""
    if loop.aliases is None:
        return None
    return rs_breakdown(
        loop.with_aliases(loop.curves(margins.omega_rs)), loop.band, margins.largest_rs
    )
