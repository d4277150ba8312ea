"""Judge a loop by the structured singular value: nominal stability, bounds of mu, certificates (SP
8.9, 8.10).

The upper bound of mu over a grid decides whether a proof is tried; the lower bound gives a
counter-example. Only `robust.mu.certify` and `certify_with_one_scaling`, which hold between the
frequencies, make a proof.
"""

from __future__ import annotations

from dataclasses import replace

import control
import numpy as np

from robust._base.types import Blocks
from robust.analysis.curves import MuCurves
from robust.analysis.findings import Effort, Findings, Margins, Proofs, ReportCurves, decide_verdict
from robust.analysis.loop_of_channels import LoopOfChannels, set_gain
from robust.analysis.sampled_set import SampledSet
from robust.analysis.text import (
    ALIASES_NOT_PROVED,
    NO_MU,
    NOTHING_PROVED,
    SAMPLES_ONLY,
    explain_mu,
    structure_proof_sentences,
)
from robust.lti.grids import Peak, peak_of, structure_grid
from robust.lti.lti import response_by_channel
from robust.models.sets.interconnection import UncertainSystem
from robust.mu.blocks import block_structure, blocks_with_kinds
from robust.mu.certification import certify
from robust.mu.crossings import Crossing, find_crossing
from robust.mu.parameters import ParameterMargin, parameter_margin
from robust.mu.perturbations import search_perturbation
from robust.mu.scalings import mu_bound_at, refine_grid
from robust.proofs.search.certificate import Certificate
from robust.proofs.search.scaled_kyp import certify_with_one_scaling
from robust.proofs.search.stability import decide_stability

# relative distance of proof and counter-example at which the search for an open verdict stops
_DEFAULT_GAP = 0.05
# largest real parameters searched, over the smallest complex ones that break the loop
_MAX_PARAMETER_RATIO = 100.0


def judge_mu(loop: LoopOfChannels, effort: Effort) -> Findings:
    """Return the findings by mu for the form with the strongest result, with the largest |S| over
    the set.
    """
    found = {form: judge_system(system, effort) for form, system in loop.systems.items()}
    form = _best_form(found)
    taken = replace(found[form], form=form)
    if len(found) > 1:
        taken = replace(
            taken, reason=f"{taken.reason}; of the forms {' and '.join(found)}, {form} gives most"
        )
    if taken.nominally_stable:
        system = loop.sensitivity(form)
        S = set_gain(system.N, system.structure, curve=False, certify=effort.certify)
        margins = replace(taken.margins, peak_S=S.peak, S_worst_lines=S.n_lines)
        taken = replace(taken, margins=margins)
    if folded := loop.folded(form):
        return _add_aliases(taken, loop.systems[form], folded)
    return taken


def _add_aliases(found: Findings, system: UncertainSystem, folded: SampledSet) -> Findings:
    """Add the proof that the sampled set contains the continuous one, if stability is proved for
    the sampled set.
    """
    proofs, proved = found.proofs, False
    if proofs.robustly_stable:
        certificate = folded.certify_aliases()
        proofs = replace(proofs, certificates=(*proofs.certificates, certificate))
        proved = certificate.holds
    found = replace(found, folding=folded.describe(proved=proved), proofs=proofs)
    if not proved:
        return replace(found, not_proved=f"{ALIASES_NOT_PROVED}; {found.not_proved}")
    sentences = structure_proof_sentences(system, proofs, folded=True)
    return replace(
        found,
        reason=found.reason.replace(SAMPLES_ONLY, ""),
        proved=sentences[0],
        not_proved=sentences[1],
    )


def _best_form(found: dict[str, Findings]) -> str:
    """Return the form with the most proofs, then with the larger margin."""

    def established(form: str) -> tuple[bool, bool, float]:
        proofs, margin = found[form].proofs, float(np.nan_to_num(found[form].margins.rs, nan=-1.0))
        return proofs.robust_performance, proofs.robustly_stable, margin

    return max(found, key=established)


def judge_system(system: UncertainSystem, effort: Effort) -> Findings:
    """Return the findings for a loop whose perturbations are pulled out."""
    statistical = any(block.perturbation == "statistical" for block in system.blocks.values())
    omega, nominal = structure_grid(system.N), decide_stability(system.N)
    if not nominal.stable:
        nothing = np.full(omega.size, np.nan)
        return Findings(
            verdict=decide_verdict(nominal.state, Proofs(), statistical=statistical),
            nominally_stable=False,
            curves=ReportCurves(omega=omega, rs=nothing, np_=nothing, rp=nothing),
            reason=f"the nominal loop is {nominal}",
            proved=NOTHING_PROVED,
            not_proved=NO_MU,
        )
    curves, parameters = _bound_curves(system, omega)
    broken, worst = _find_worst_perturbation(system, curves, parameters)
    certificates: tuple[Certificate, ...] = ()
    if effort.certify and curves.peak < 1 and not broken <= 1:
        certificates = _prove_stability_and_performance(system, curves, effort.solver)
    still_open = effort.certify and broken > 1 and not any(one.holds for one in certificates)
    cut = None
    if still_open or effort.gap:
        cut = _subdivide_parameters(system, _DEFAULT_GAP if effort.gap is None else effort.gap)
    if cut is not None:
        broken, worst, certificates = _apply_parameter_margin(
            system, cut, broken=broken, worst=worst, certificates=certificates
        )
    proofs = Proofs(
        certificates=certificates,
        robustly_stable=bool(certificates and certificates[0].holds),
        robust_performance=len(certificates) == 2 and certificates[1].holds,
        violated=broken <= 1,
    )
    proved = structure_proof_sentences(system, proofs, folded=False)
    return Findings(
        verdict=decide_verdict(nominal.state, proofs, statistical=statistical),
        nominally_stable=True,
        curves=ReportCurves(
            omega=curves.omega,
            rs=curves.mu,
            rp=curves.mu_rp,
            np_=np.full(curves.omega.size, np.nan),
        ),
        margins=Margins(
            peak_rs=_smaller_bound(curves, cut),
            peak_rp=peak_of(curves.omega, curves.mu_rp) if system.inputs else None,
            broken=broken,
            worst=worst,
        ),
        proofs=proofs,
        reason=explain_mu(
            system,
            curves,
            broken=broken,
            proofs=proofs,
            cut=cut,
            certify=effort.certify,
        ),
        proved=proved[0],
        not_proved=proved[1],
    )


def _smaller_bound(curves: MuCurves, cut: ParameterMargin | None) -> Peak:
    """Return the largest bound of mu: on the grid, or the smaller one that the subdivision of the
    parameter box proved.
    """
    if cut is not None and cut.proved * curves.peak > 1:
        return Peak(1 / cut.proved, cut.omega)
    return Peak(curves.peak, curves.omega_peak)


def _bound_curves(system: UncertainSystem, omega: np.ndarray) -> tuple[MuCurves, Crossing | None]:
    """Compute both bounds on one grid that contains the peaks of each, and the real parameters that
    break the loop.
    """
    first, known = refine_grid(system.loop, system.structure, omega=omega)
    parameters = _find_parameter_crossing(system, first, peak=float(known.max()))
    if parameters is None:
        omega = first
    else:
        omega = np.union1d(first, parameters.omega)
    rp = np.full(omega.size, np.nan)
    if system.inputs:
        seen, rp_seen = refine_grid(system.N, system.with_performance, omega=omega)
        omega = np.union1d(omega, seen)
        rp = _complete_bounds(system.N, system.with_performance, omega=omega, known=(seen, rp_seen))
    mu = _complete_bounds(system.loop, system.structure, omega=omega, known=(first, known))
    if (
        parameters is not None
    ):  # the crossing is exact; the bound may miss it by the last digits of the frequency
        mu = np.where(omega == parameters.omega, np.maximum(mu, 1 / parameters.size), mu)
    return MuCurves(omega=omega, mu=mu, mu_rp=rp), parameters


def _complete_bounds(
    N: control.StateSpace,
    blocks: Blocks,
    *,
    omega: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
) -> np.ndarray:
    """Return the bound (W,) at omega; compute it only at frequencies without a known value."""
    at, values = known
    found = np.full(omega.size, np.nan)
    found[np.searchsorted(omega, at)] = values
    new = np.isnan(found)
    if new.any():
        found[new] = mu_bound_at(N, blocks, omega=omega[new])
    return found


def _prove_stability_and_performance(
    system: UncertainSystem, curves: MuCurves, solver: str | None
) -> tuple[Certificate, ...]:
    """Prove stability, and performance if stability is proved and the grid allows it."""
    stability = _prove_bound(
        system, system.loop, blocks=system.structure, subject="robust stability", solver=solver
    )
    if not (stability.holds and curves.peak_rp < 1):
        return (stability,)
    performance = _prove_bound(
        system,
        system.N,
        blocks=system.with_performance,
        subject="robust performance",
        solver=solver,
    )
    return stability, performance


def _subdivide_parameters(system: UncertainSystem, gap: float) -> ParameterMargin | None:
    """Subdivide the box of real parameters until proof and counter-example meet; None without real
    parameters.

    The scalings on each part change with frequency, so the result does not hold for nonlinear
    perturbations.
    """
    kinds = {"real" if b.kind == "real" else b.perturbation for b in system.blocks.values()}
    if "real" not in kinds or "operator" in kinds:
        return None
    return parameter_margin(system.loop, system.structure, gap=gap)


def _apply_parameter_margin(
    system: UncertainSystem,
    cut: ParameterMargin,
    *,
    broken: float,
    worst: dict[str, float] | None,
    certificates: tuple[Certificate, ...],
) -> tuple[float, dict[str, float] | None, tuple[Certificate, ...]]:
    """Merge the counter-example and the proofs with the result of the subdivision."""
    if cut.broken < broken:
        broken, worst = cut.broken, dict(zip(system.blocks, map(float, cut.worst), strict=True))
    if cut.proved >= 1 and not any(one.holds for one in certificates):
        how = f"branch and bound, {len(cut.certificates)} parts of the parameter box"
        whole = replace(cut.certificates[0], subject="robust stability", level=1.0, method=how)
        certificates = (whole, *certificates[1:])
    return broken, worst, certificates


def _find_parameter_crossing(
    system: UncertainSystem, omega: np.ndarray, *, peak: float
) -> Crossing | None:
    """Find real parameters that destabilise the loop, at frequencies between the grid lines."""
    blocks = system.structure
    if not any(block.kind == "real" for block in system.blocks.values()):
        return None
    complex_ = [(*b[:2], "repeated") if b[-1] == "real" else b for b in blocks]
    least = float(
        mu_bound_at(system.loop, complex_, omega=omega).max()
    )  # one over the smallest size of complex numbers that could break the loop
    if least == 0:
        return None
    return find_crossing(
        system.loop,
        block_structure("blocks", blocks),
        least=1 / least,
        limit=min(2 / max(peak, 1e-300), _MAX_PARAMETER_RATIO / least),
    )


def _find_worst_perturbation(
    system: UncertainSystem, curves: MuCurves, parameters: Crossing | None
) -> tuple[float, dict[str, float] | None]:
    """Find the smallest factor, among frequencies with large mu, at which a perturbation makes the
    loop singular.
    """
    omega, mu = curves.omega, curves.mu
    candidates = np.unique(
        np.concatenate([np.argsort(-mu)[:4], np.linspace(0, omega.size - 1, 6).astype(int)])
    )
    responses = np.moveaxis(
        response_by_channel(system.loop, omega[candidates]), 2, 0
    )  # (10, rows, cols)
    cut = block_structure("blocks", system.structure)
    found = search_perturbation(responses, cut, n_starts=2, rng=np.random.default_rng(0))
    k = int(found.value.argmax())
    assert found.delta is not None  # a lower bound comes with its perturbation
    if found.value[k] > 0:
        size, delta = 1 / float(found.value[k]), found.delta[:, :, k]
    else:
        size, delta = np.inf, None
    if parameters is not None and parameters.size < size:
        size, delta = parameters.size, parameters.delta
    if delta is None:
        return np.inf, None
    return size, system.perturbation_by_name(delta / size)


def _prove_bound(
    system: UncertainSystem,
    N: control.StateSpace,
    *,
    blocks: Blocks,
    subject: str,
    solver: str | None,
) -> Certificate:
    """Prove mu < 1 at every frequency, with one constant scaling if a block may be nonlinear.

    A repeated operator counts as a full block: only a scalar scaling commutes with a nonlinear
    operator.
    """
    operators = [
        block.kind != "real" and block.perturbation == "operator"
        for block in system.blocks.values()
    ]
    one_full_block = len(blocks) == 1 and len(blocks[0]) == 2
    if one_full_block or not any(operators):
        return replace(certify(N, blocks, 1.0, solver=solver), subject=subject)
    given = blocks_with_kinds(blocks)
    cut = [
        (*block[:2], "full") if operator else block
        for block, operator in zip(given, operators, strict=False)
    ]
    cut += given[len(operators) :]  # performance
    return certify_with_one_scaling(N, cut, solver=solver, subject=subject)
