"""Certificates in files: a claim with its proof, so that others can prove the claim again."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial, singledispatch
from pathlib import Path

import control
import numpy as np

from nlfrf._base.arguments import one_line, short_form
from nlfrf._base.parsing import parse_json_of
from nlfrf._base.types import JsonObject
from robust._base.types import Controller
from robust.analysis.loop import assemble_loop
from robust.analysis.loop_proofs import stability_claim
from robust.analysis.report import RobustnessReport
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.verify import verify_friction
from robust.friction.plant import FrictionPlant, friction_plant
from robust.friction.proof.certify import plant_matrices
from robust.friction.proof.protocol import FrictionProof
from robust.io.models import CERTIFICATE_SCHEMAS, PathLike
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel, timebase
from robust.lti.realisation import state_space
from robust.models.sets.model import UncertaintyModel
from robust.proofs.exact.channel_files import ChannelsClaim, verify_channels
from robust.proofs.exact.claim import LoopClaim, to_matrices
from robust.proofs.exact.claim_files import differing_fields, read_claim, write_claim
from robust.proofs.exact.folded_sets import FoldedClaim
from robust.proofs.exact.interval_kyp import IntervalClaim
from robust.proofs.exact.loops import verify_loop
from robust.proofs.exact.scaled_kyp import ScaledClaim
from robust.proofs.exact.scheduled_kyp import ScheduleClaim, verify_schedule
from robust.proofs.exact.verification import Verification
from robust.scheduling.prove import ScheduleProof


def certificate_path(report: Path, number: int = 0) -> Path:
    """Return the path of the certificate beside a text report; several proofs have a number.

    >>> certificate_path(Path("r.txt")).name, certificate_path(Path("r.txt"), 1).name
    ('r.certificate.json', 'r.2.certificate.json')
    """
    return report.with_suffix(f".{number + 1}.certificate.json" if number else ".certificate.json")


@singledispatch
def save_certificate(report: object, path: PathLike) -> None:
    """Write a proof as JSON: plant, controller, delay, weights and claim as given, and a digest of
    them.

    For several channels it holds the loop with its perturbations pulled out, P and the scaling of
    each claim.

    report : RobustnessReport, FrictionProof or ScheduleProof
    """
    del path
    got = f"the verdict {report.verdict!r}" if hasattr(report, "verdict") else short_form(report)
    raise ValueError(f"report must contain a proof that can be repeated, got {got}")


_refuse = save_certificate.dispatch(object)


@save_certificate.register(FrictionProof)
def _save_friction_certificate(report: FrictionProof, path: PathLike) -> None:
    if report.certificate is None:
        _refuse(report, path)
    save_friction_proof(report, path)


@save_certificate.register(ScheduleProof)
def _save_schedule_certificate(report: ScheduleProof, path: PathLike) -> None:
    if not report.holds:
        _refuse(report, path)
    certificate = report.certificate
    how = [{"subject": certificate.subject, "found by": certificate.method}]
    write_claim(path, certificate.claim, found=how)  # type: ignore[arg-type]  # a certificate of any claim


@save_certificate.register(RobustnessReport)
def _save_report_certificate(report: RobustnessReport, path: PathLike) -> None:
    proofs = [c for c in report.proofs.certificates if c.holds]
    found = [c.claim for c in proofs if isinstance(c.claim, LoopClaim)]
    scaled = {
        c.subject: c.claim
        for c in proofs
        if isinstance(c.claim, ScaledClaim | IntervalClaim | FoldedClaim)
    }
    how = [{"subject": c.subject, "found by": c.method} for c in proofs if c.claim is not None]
    warned = report.warnings
    if scaled and not found:
        given = report.given
        write_claim(
            path,
            ChannelsClaim(claims=scaled, form=report.form, delay=given.delay),
            found=how,
            warnings=warned,
        )
        return
    if not found:
        _refuse(report, path)
    claim = replace(
        found[0],
        claims=tuple(name for claim in found for name in claim.claims),
        scaling=found[-1].scaling,
    )
    write_claim(path, claim, found=how, warnings=warned)


def save_friction_proof(
    proof: FrictionProof,
    path: PathLike,
    *,
    read_from: JsonObject | None = None,
    warnings: Sequence[str] = (),
) -> None:
    """Write a proof with friction, the source of its class, and the warnings about that."""
    certificate = proof.certificate
    if certificate is None or not isinstance(certificate.claim, FrictionClaim):
        raise ValueError(
            f"report must contain a proof of a single loop, got the verdict {proof.verdict!r}"
        )
    units = proof.units
    write_claim(
        path,
        certificate.claim,
        found=[{"subject": certificate.subject, "found by": certificate.method}],
        read_from=read_from,
        units={"K0": f"{units.force}/{units.position}", "microdamping": units.damping},
        warnings=warnings,
    )


def load_claim(path: PathLike) -> LoopClaim | FrictionClaim | ChannelsClaim | ScheduleClaim:
    """Return the claim in a certificate file."""
    kinds: tuple[type, ...] = (FrictionClaim, ChannelsClaim, ScheduleClaim, LoopClaim)
    found = next(filter(None, (read_claim(path, kind) for kind in kinds)), None)
    if found is None:
        raise ValueError(f"path must be a certificate written by this package, got {str(path)!r}")
    return found


def verify_certificate(
    path: PathLike,
    *,
    model: UncertaintyModel | FrictionPlant | None = None,
    K: Controller | None = None,
    time_cap: float = 60.0,
) -> Verification:
    """Prove the claim of a certificate file again, with outward rounding.

    Use this for a certificate from someone else, or from another version. With `model` and `K` the
    claim is also compared with your plant and your controller.

    Parameters
    ----------
    path : path
        A certificate written by `robust.save`, `robust check` or `robust prove`.
    model : UncertaintyModel or FrictionPlant, optional
        Plant that the certificate should be for. Nominal, weight, form and class are compared
        number by number; for a machine with friction the linear plant is compared. For several
        channels the loop of model and K is compared, to 1e-6.
    K : control.StateSpace, TransferFunction or float, optional
        Controller that you use, compared in the same way.
    time_cap : float
        Computing time [s] after which the remaining claims count as not verified.

    Returns
    -------
    Verification
        The verified claims, and those that are not verified, with reasons. A claim that is not
        verified is a result, not an error.

    Raises
    ------
    ValueError
        A file that is not a certificate, or a file that was changed after it was written (its
        digest does not fit).
    FileNotFoundError
        No such file.

    References
    ----------
    F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE
    Trans. Computers, 2017.

    Examples
    --------
    >>> verify_certificate("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    stored = parse_json_of(path, *CERTIFICATE_SCHEMAS).get("warnings", ())
    claim = load_claim(path)
    if isinstance(claim, FrictionClaim):
        wrong = _differences_of_machine(claim, model)
        found = partial(verify_friction, claim, time_cap=time_cap)
    elif isinstance(claim, ScheduleClaim):
        if model is not None or K is not None:
            raise ValueError(
                "model and K must be left out for a schedule: compare them with robust.load(path)"
            )
        wrong, found = {}, partial(verify_schedule, claim, time_cap=time_cap)
    elif not isinstance(model, UncertaintyModel | None):
        raise ValueError(f"model must be an UncertaintyModel, got {short_form(model)}")
    elif isinstance(claim, ChannelsClaim):
        wrong, found = _differences_of_channels(claim, model, K), partial(verify_channels, claim)
    else:
        wrong = _differences_of_loop(claim, model)
        found = partial(verify_loop, claim, time_cap=time_cap)
    if K is not None and not isinstance(claim, ChannelsClaim | ScheduleClaim):
        other = differing_fields(claim.controller, to_matrices(state_space("K", K)), _SYSTEM)
        wrong |= {"the controller": ""} if other else {}
    proved = found()
    return replace(
        proved,
        failed=(
            *((part, f"not the one of the certificate{how}") for part, how in wrong.items()),
            *proved.failed,
        ),
        warnings=tuple(map(one_line, stored)),
    )


_SYSTEM = (*"ABCD", "dt")  # fields by which two systems are compared, number by number


def _differences_of_loop(claim: LoopClaim, model: UncertaintyModel | None) -> dict[str, str]:
    """Return the differences between the model of one loop and that of the certificate."""
    if model is None:
        return {}
    mine = stability_claim(model, 0.0, w_P=None, delay=0.0)
    names = differing_fields(claim, mine, ("plant", "weight", "reads", "inverse", "perturbation"))
    if names:
        return {"the model": f": other {', '.join(names)}"}
    return {}


def _differences_of_channels(
    claim: ChannelsClaim, model: UncertaintyModel | None, K: Controller | None
) -> dict[str, str]:
    """Return a difference if the loop of model and controller is not the one of the certificate."""
    if (model is None) != (K is None):
        raise ValueError(
            "model and K must be given together for a certificate with several channels, got one of"
            " them"
        )
    if model is None or K is None:
        return {}
    if _is_loop_of(claim, model, K):
        return {}
    return {"the loop of model and controller": ""}


def _differences_of_machine(claim: FrictionClaim, model: object) -> dict[str, str]:
    """Return a difference if a machine with friction is not the one of the certificate."""
    if model is None:
        return {}
    if isinstance(model, FrictionPlant):
        machine = model
    else:
        machine = friction_plant(getattr(model, "nominal", model))
    if differing_fields(claim.machine, plant_matrices(machine), _SYSTEM):
        return {"the machine": ""}
    return {}


# of the largest entry at a frequency; the effect of rounding stays below the slack on the level
_LOOP_TOLERANCE = 1e-6


def _is_loop_of(given: ChannelsClaim, model: UncertaintyModel, K: Controller) -> bool:
    """Return True if the loop of model and controller responds as that of the certificate, at its
    perturbations.
    """
    form = next(
        (
            one
            for one in (model, model.alternative_form)
            if one is not None and one.form == given.form
        ),
        None,
    )
    if form is None:
        return False
    if form.is_single:
        mine, folded = assemble_loop(form, K, w_P=None, delay=given.delay).perturbation_loop, None
    else:
        known, folded = set_on_controller_time_base(form, K, given.delay)
        mine = known.loop(K).loop
    omega = structure_grid(mine)
    response = response_by_channel(mine, omega)
    rows, cols = mine.noutputs, mine.ninputs
    for claim in given.claims.values():
        if isinstance(claim, FoldedClaim):
            if folded is None or not _is_same_folding(claim, folded.claim):
                return False
            continue
        theirs = control.StateSpace(
            *(getattr(claim.system, name) for name in "ABCD"), claim.system.dt
        )
        if theirs.noutputs < rows or theirs.ninputs < cols or timebase(theirs) != timebase(mine):
            return False
        off = np.abs(response_by_channel(theirs, omega)[:rows, :cols] - response).max(axis=(0, 1))
        if np.any(off > _LOOP_TOLERANCE * np.abs(response).max(axis=(0, 1))):
            return False
    return True


def _is_same_folding(claim: FoldedClaim, mine: FoldedClaim) -> bool:
    """Return True if the same continuous set is folded, number by number."""
    if claim.dt != mine.dt or len(claim.parts) != len(mine.parts):
        return False
    pairs = zip(claim.parts, mine.parts, strict=True)
    return not any(differing_fields(*pair, ("plant", "left", "right")) for pair in pairs)
