"""Check of a loop with several uncertainties: nominal stability, bounds by mu, certificates (SP 8.9, 8.10).

The upper bound of mu over a grid decides what is worth proving, the lower bound gives a counter-example. Only
`robust.mu.certify` and `certify_scaled`, which hold between the frequencies, make a proof.
"""

from __future__ import annotations

import time
from dataclasses import replace

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_positive, short_form
from nlfrf._base.values import value
from robust._base.states import Verdict
from robust._base.types import Blocks
from robust.analysis.findings import Margins, Proofs, ReportCurves
from robust.analysis.report import RobustnessReport
from robust.analysis.text import SAMPLES_ONLY, nominal_verdict, structure_proof_sentences
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.lti.stability import StabilityResult
from robust.models.sets.interconnection import UncertainSystem
from robust.mu.blocks import block_structure, blocks_with_kinds
from robust.mu.certification import certify
from robust.mu.parameters import Crossing, ParameterMargin, find_crossing, parameter_margin
from robust.mu.perturbations import search_perturbation
from robust.mu.scalings import mu_bound_at, refine_grid
from robust.proofs.search.certificate import Certificate, failed_certificate
from robust.proofs.search.intervals import SLACK
from robust.proofs.search.scaled_kyp import certify_scaled
from robust.proofs.search.stability import decide_stability

DEFAULT_GAP = 0.05  # between proof and counter-example, to which an undecided verdict is pursued
MAX_PARAMETER_RATIO = 100.0  # largest real parameters searched, over the smallest complex ones that break the loop


def check_structure(
    system: UncertainSystem,
    *,
    certify: bool = True,
    gap: float | None = None,
    solver: str | None = None,
    time_cap: float = 60.0,
) -> RobustnessReport:
    """Check a loop with several uncertainties by the structured singular value, and say what was proved.

    Parameters
    ----------
    system : UncertainSystem
        From `interconnection`.
    certify : bool
        Prove the result at all frequencies; without it nothing better than "not certified" comes out.
    gap : float, optional
        With real parameters: relative distance between margin_rs and margin_broken, for which their box is cut up part
        by part (`parameter_margin`). When not given it is cut up, to 5 %, only where the verdict is still open.
    solver : str, optional
        "CLARABEL" or "SCS" of cvxpy, for the proof by P and a scaling; one after the other when not given.
    time_cap : float
        Seconds. Where they were too few the bounds found by then, larger ones, are what is judged, and the reason says
        so.

    Returns
    -------
    RobustnessReport
        A bad loop is a result, not an error. With an "operator" block among others the scalings have to be the same at
        every frequency (Shamma 1994), and only that is accepted as a proof.

    Raises
    ------
    ValueError
        Anything that is not an UncertainSystem.

    References
    ----------
    SP 8.9 (RS), 8.10 (RP); Packard & Doyle 1993.

    Examples
    --------
    >>> from robust.models.sets.interconnection import Block, interconnection
    >>> lag = control.ss([[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y")
    >>> K = control.ss([], [], [], [[-4.0]], inputs="y", outputs="u")
    >>> blocks = {"pole": Block("y", "pole", 2.5, kind="real"), "actuator": Block("u", "u", 0.5)}
    >>> report = check_structure(interconnection([lag, K], blocks))      # s + 5 - 2.5 d1 + 2 d2: 4.5 of 5
    >>> report.verdict, round(report.margins.rs, 3)
    ('robust', 1.111)
    """
    if not isinstance(system, UncertainSystem):
        raise ValueError(f"system must be an UncertainSystem, from interconnection(), got {short_form(system)}")
    if not system.blocks:
        raise ValueError("system must have at least one block to check, got none")
    deadline = time.monotonic() + require_positive("time_cap", time_cap)
    omega = structure_grid(system.N)
    nominal = decide_stability(system.N)
    if not nominal.stable:
        return report_on_unstable_loop(omega, nominal)
    curves = bound_curves(system, omega, deadline - 0.5 * time_cap)
    broken, worst = find_worst_perturbation(system, curves, deadline - 0.3 * time_cap)
    certificates = (
        prove_stability_and_performance(system, curves, solver, deadline)
        if certify and curves.peak < 1 and not broken <= 1
        else ()
    )
    still_open = certify and broken > 1 and not any(one.holds for one in certificates)
    cut = (
        subdivide_parameters(system, DEFAULT_GAP if gap is None else require_positive("gap", gap), deadline)
        if still_open or gap
        else None
    )
    if cut is not None:
        broken, worst, certificates = apply_parameter_margin(
            system, cut, broken=broken, worst=worst, certificates=certificates
        )
    stable = bool(certificates and certificates[0].holds)
    performs = len(certificates) == 2 and certificates[1].holds
    verdict, reason = decide_structure_verdict(
        system, curves, broken=broken, certify=certify, certificates=certificates, cut=cut
    )
    proved, not_proved = structure_proof_sentences(system, stable, performs)
    return RobustnessReport(
        verdict=verdict,
        nominally_stable=True,
        curves=ReportCurves(omega=curves.omega, rs=curves.mu, rp=curves.mu_rp, np_=np.full(curves.omega.size, np.nan)),
        margins=Margins(
            rs=max(1 / curves.peak if curves.peak > 0 else np.inf, cut.proved if cut else 0.0),
            omega_rs=float(curves.omega[curves.mu.argmax()]),
            rp=1 / curves.peak_rp if curves.peak_rp > 0 else np.nan,
            omega_rp=float(curves.omega[curves.mu_rp.argmax()]) if system.inputs else np.nan,
            broken=broken,
            worst=worst,
        ),
        proofs=Proofs(certificates=certificates, robustly_stable=stable, robust_performance=performs),
        reason=reason,
        proved=proved,
        not_proved=not_proved,
    )


def decide_structure_verdict(
    system: UncertainSystem,
    curves: MuCurves,
    *,
    broken: float,
    certify: bool,
    certificates: tuple[Certificate, ...],
    cut: ParameterMargin | None,
) -> tuple[Verdict, str]:
    """Decide the verdict on a loop with several uncertainties and give its reason."""
    if broken <= 1:
        return (
            Verdict.NOT_ROBUST,
            f"a perturbation of the set, {broken:.3f} times as large as allowed, makes the loop singular",
        )
    peak, where = curves.peak, float(curves.omega[curves.mu.argmax()])
    if certificates and certificates[0].holds:
        samples = SAMPLES_ONLY if system.N.dt else ""
        if any(block.perturbation == "statistical" for block in system.blocks.values()):
            return Verdict.STATISTICALLY_ROBUST, "the loop is stable with every linear plant of the set" + samples
        return Verdict.ROBUST, "every perturbation of the set leaves the loop stable" + samples
    if peak >= 1:
        reached = f"the upper bound of mu reaches {peak:.4g} at {format_hertz(where)}"
        late = " by the time cap" if curves.hit_time_cap else ""
        parts = "" if cut is None else f"; part by part {cut.proved:.3g} times the set is proved, then {cut.reason}"
        return Verdict.NOT_CERTIFIED, f"{reached}{late}, but no perturbation was found that breaks the loop{parts}"
    if not certify:
        return (
            Verdict.NOT_CERTIFIED,
            f"mu stays below {peak:.4g} on the grid, and no proof was asked for (certify=False)",
        )
    return (
        Verdict.NOT_CERTIFIED,
        f"mu stays below {peak:.4g} on the grid, but no proof was found: {certificates[0].reason}",
    )


def report_on_unstable_loop(omega: np.ndarray, nominal: StabilityResult) -> RobustnessReport:
    """Return the report on a loop whose nominal is not stable: no bounds."""
    nothing = np.full(omega.size, np.nan)
    return RobustnessReport(
        curves=ReportCurves(omega=omega, rs=nothing, np_=nothing, rp=nothing),
        nominally_stable=False,
        verdict=nominal_verdict(nominal),
        reason=f"the nominal loop is {nominal}",
        proved="Nothing.",
        not_proved="Everything: mu means nothing for a loop that is not stable.",
    )


@value(copy=False)
class MuCurves:
    """Hold upper bounds of mu (W,) for stability and (nan without it) performance, and the breaking parameters."""

    omega: np.ndarray
    mu: np.ndarray
    mu_rp: np.ndarray
    parameters: Crossing | None
    hit_time_cap: bool

    @property
    def peak(self) -> float:
        """Return the largest bound for stability."""
        return float(self.mu.max())

    @property
    def peak_rp(self) -> float:
        """Return the largest bound for performance, nan without it."""
        return float(self.mu_rp.max())


def bound_curves(system: UncertainSystem, omega: np.ndarray, deadline: float) -> MuCurves:
    """Compute both bounds on one grid with the peaks of each, and the real parameters that break the loop."""
    now = time.monotonic()
    half = now + (0.4 if system.inputs else 0.7) * (deadline - now)
    first, known = refine_grid(system.loop, system.structure, omega=omega, deadline=half)
    parameters = find_parameter_crossing(system, first, peak=float(known.max()), deadline=deadline)
    omega = first if parameters is None else np.union1d(first, parameters.omega)
    rp = np.full(omega.size, np.nan)
    if system.inputs:
        seen, rp_seen = refine_grid(system.N, system.with_performance, omega=omega, deadline=deadline)
        omega = np.union1d(omega, seen)
        rp = complete_bounds(system.N, system.with_performance, omega=omega, known=(seen, rp_seen), deadline=deadline)
    mu = complete_bounds(system.loop, system.structure, omega=omega, known=(first, known), deadline=deadline)
    if parameters is not None:  # it is a fact, the bound comes after the last digits of the frequency
        mu = np.where(omega == parameters.omega, np.maximum(mu, 1 / parameters.size), mu)
    return MuCurves(
        omega=omega,
        mu=mu,
        mu_rp=rp,
        parameters=parameters,
        hit_time_cap=time.monotonic() > now + 0.9 * (deadline - now),
    )


def stability_bound_at(system: UncertainSystem, omega: float, time_cap: float = 10.0) -> float:
    """Return the upper bound of mu for stability at one frequency [rad/s]."""
    return float(
        mu_bound_at(system.loop, system.structure, omega=np.array([omega]), deadline=time.monotonic() + time_cap)[0]
    )


def complete_bounds(
    N: control.StateSpace,
    blocks: Blocks,
    *,
    omega: np.ndarray,
    known: tuple[np.ndarray, np.ndarray],
    deadline: float,
) -> np.ndarray:
    """Return the bound (W,) at omega, computed only where it is not known."""
    at, values = known
    found = np.full(omega.size, np.nan)
    found[np.searchsorted(omega, at)] = values
    new = np.isnan(found)
    if new.any():
        found[new] = mu_bound_at(N, blocks, omega=omega[new], deadline=deadline)
    return found


def prove_stability_and_performance(
    system: UncertainSystem, curves: MuCurves, solver: str | None, deadline: float
) -> tuple[Certificate, ...]:
    """Prove stability, and performance where stability is proved and the grid does not contradict it."""
    stability = prove_bound(
        system, system.loop, blocks=system.structure, subject="robust stability", solver=solver, deadline=deadline
    )
    if not (stability.holds and curves.peak_rp < 1):
        return (stability,)
    performance = prove_bound(
        system,
        system.N,
        blocks=system.with_performance,
        subject="robust performance",
        solver=solver,
        deadline=deadline,
    )
    return stability, performance


def subdivide_parameters(system: UncertainSystem, gap: float, deadline: float) -> ParameterMargin | None:
    """Subdivide the box of real parameters until proof and counter-example meet; None without real ones, or time.

    The scalings on each part change with frequency, which says nothing of nonlinear perturbations.
    """
    kinds = {"real" if b.kind == "real" else b.perturbation for b in system.blocks.values()}
    left = deadline - time.monotonic()
    if "real" not in kinds or "operator" in kinds or left <= 0:
        return None
    return parameter_margin(system.loop, system.structure, gap=gap, time_cap=left)


def apply_parameter_margin(
    system: UncertainSystem,
    cut: ParameterMargin,
    *,
    broken: float,
    worst: dict[str, float] | None,
    certificates: tuple[Certificate, ...],
) -> tuple[float, dict[str, float] | None, tuple[Certificate, ...]]:
    """Merge what breaks the loop and what is proved with the result of the subdivision."""
    if cut.broken < broken:
        broken, worst = cut.broken, dict(zip(system.blocks, map(float, cut.worst), strict=True))
    if cut.proved >= 1 and not any(one.holds for one in certificates):
        how = f"branch and bound, {len(cut.certificates)} parts of the parameter box"
        whole = replace(cut.certificates[0], subject="robust stability", level=1.0, method=how)
        certificates = (whole, *certificates[1:])
    return broken, worst, certificates


def find_parameter_crossing(
    system: UncertainSystem, omega: np.ndarray, *, peak: float, deadline: float
) -> Crossing | None:
    """Find real parameters that break the loop: they do so between the lines of any grid, where mu misses them."""
    blocks = system.structure
    if not any(block.kind == "real" for block in system.blocks.values()):
        return None
    complex_ = [(*b[:2], "repeated") if b[-1] == "real" else b for b in blocks]
    now = time.monotonic()
    least = float(
        mu_bound_at(system.loop, complex_, omega=omega, deadline=now + 0.3 * (deadline - now)).max()
    )  # as complex numbers they would have to be this small
    if least == 0:
        return None
    return find_crossing(
        system.loop,
        block_structure("blocks", blocks),
        least=1 / least,
        limit=min(2 / max(peak, 1e-300), MAX_PARAMETER_RATIO / least),
    )


def find_worst_perturbation(
    system: UncertainSystem, curves: MuCurves, deadline: float
) -> tuple[float, dict[str, float] | None]:
    """Find the smallest factor at which a perturbation makes the loop singular, where mu is large, and its parts."""
    omega, mu, parameters = curves.omega, curves.mu, curves.parameters
    candidates = np.unique(np.concatenate([np.argsort(-mu)[:4], np.linspace(0, omega.size - 1, 6).astype(int)]))
    responses = np.moveaxis(response_by_channel(system.loop, omega[candidates]), 2, 0)  # (10, rows, cols)
    cut = block_structure("blocks", system.structure)
    found = search_perturbation(responses, cut, n_starts=2, rng=np.random.default_rng(0), deadline=deadline)
    k = int(found.value.argmax())
    assert found.delta is not None  # of a lower bound
    size, delta = (1 / float(found.value[k]), found.delta[:, :, k]) if found.value[k] > 0 else (np.inf, None)
    if parameters is not None and parameters.size < size:
        size, delta = parameters.size, parameters.delta
    if delta is None:
        return np.inf, None
    parts, r, c = {}, 0, 0
    for name, block in system.blocks.items():
        n, m = block.shape[:2]
        part = delta[c : c + m, r : r + n] / size
        parts[name] = float(part[0, 0].real if block.kind == "real" else np.linalg.norm(part, 2))
        r, c = r + n, c + m
    return size, parts


def prove_bound(
    system: UncertainSystem,
    N: control.StateSpace,
    *,
    blocks: Blocks,
    subject: str,
    solver: str | None,
    deadline: float,
) -> Certificate:
    """Prove mu < 1 at every frequency; with one scaling for all of them where a block may be nonlinear.

    A repeated operator counts as a full block: no scaling but a number commutes with a nonlinear one.
    """
    left = min(10.0, max(deadline - time.monotonic(), 0.1))
    operators = [block.kind != "real" and block.perturbation == "operator" for block in system.blocks.values()]
    one_full_block = len(blocks) == 1 and len(blocks[0]) == 2
    if one_full_block or not any(operators):
        return replace(certify(N, blocks, 1.0, solver=solver, time_cap=left), subject=subject)
    given = blocks_with_kinds(blocks)
    cut = [(*block[:2], "full") if operator else block for block, operator in zip(given, operators, strict=False)]
    cut += given[len(operators) :]  # performance
    found = certify_scaled(N, cut, 1 - SLACK, solver=solver, time_cap=left, subject=subject)
    if found is None:
        return failed_certificate(subject, 1.0, "no scaling that is the same at all frequencies was found")
    return replace(found, level=1.0)
