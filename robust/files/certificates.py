"""Certificates handed on: what a check proved, in a file that someone else can prove again."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from nlfrf.shared.wording import shown
from robust.analysis.claims import claim_of
from robust.analysis.report import RobustnessReport
from robust.files.json_files import PathLike
from robust.friction_proof.proof import FrictionProof, matrices_of
from robust.friction_verification.claim import FrictionClaim
from robust.friction_verification.file import read_friction_claim, write_friction_claim
from robust.friction_verification.verify import verify_friction
from robust.saturation.proof import SaturatedProof
from robust.sliding.machine import SlidingMachine, sliding_machine
from robust.systems.realisation import state_space
from robust.uncertain.model import UncertaintyModel
from robust.verification.claim import LoopClaim, Matrices, as_given, differences
from robust.verification.file import read_claim, write_claim
from robust.verification.loops import Verification, verify_loop

__all__ = ["certificate_of", "save_certificate", "verify_certificate"]


def certificate_of(report: Path, number: int = 0) -> Path:
    """The certificate beside a text report, of several proofs by number.

    >>> certificate_of(Path("r.txt")).name, certificate_of(Path("r.txt"), 1).name
    ('r.certificate.json', 'r.2.certificate.json')
    """
    return report.with_suffix(f".{number + 1}.certificate.json" if number else ".certificate.json")


def save_certificate(report: RobustnessReport | FrictionProof | SaturatedProof, path: PathLike) -> None:
    """Write what was proved as JSON: plant, controller, delay, weights and claim as given, and a digest of it all.

    Parameters
    ----------
    report : RobustnessReport, FrictionProof or SaturatedProof
        Of `check`, `prove_friction` or `prove_saturated`, with a proof in it.
    path : path
        File to write.

    Raises
    ------
    ValueError
        A report in which nothing is proved that can be proved again.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile, control, numpy as np
    >>> from robust import UncertaintyModel, check
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     save_certificate(check(model, 2.0), f"{folder}/proof.json")
    ...     print(verify_certificate(f"{folder}/proof.json", model=model, K=2.0))
    nominal stability: proved, rigorous
    stable weights: proved, rigorous
    robust stability: proved, rigorous
    """
    proof = report.certificate if isinstance(report, (FrictionProof, SaturatedProof)) else None
    if proof is not None and proof.claim is not None:
        write_friction_claim(path, proof.claim, [{"subject": proof.subject, "found by": proof.method}])
        return
    found = [c for c in getattr(report, "certificates", ()) if c.holds and isinstance(c.claim, LoopClaim)]
    if not found:
        raise ValueError(
            "report must hold a proof of a single loop, got "
            + (f"the verdict {report.verdict!r}" if hasattr(report, "verdict") else shown(report))
        )
    claim = replace(
        found[0].claim,
        claims=tuple(name for c in found for name in c.claim.claims),
        scaling=found[-1].claim.scaling,
    )
    how = [{"subject": c.subject, "found by": c.method} for c in found]
    write_claim(path, claim, how)


def verify_certificate(path: PathLike, *, model: Any = None, K: Any = None, time_cap: float = 60.0) -> Verification:
    """Prove what a certificate file claims again, with outward rounding, and compare it with the model and K one has.

    Parameters
    ----------
    path : path
        A file that `save_certificate`, `robust check` or `robust prove` wrote.
    model : UncertaintyModel or SlidingMachine, optional
        What the certificate is said to be about: nominal, weight, form and class are compared number by number; of a
        machine with friction its linear part.
    K : control.StateSpace, TransferFunction or float, optional
        The controller that runs, compared likewise.
    time_cap : float
        Seconds after which what is left counts as not verified.

    Returns
    -------
    Verification
        Not verified is a result, not an error: each claim with its reason.

    Raises
    ------
    ValueError
        A file that is no certificate, or one whose digest does not fit: something in it was changed.
    FileNotFoundError
        No such file.

    References
    ----------
    F. Johansson, "Arb: efficient arbitrary-precision midpoint-radius interval arithmetic", IEEE Trans. Computers, 2017.

    Examples
    --------
    >>> verify_certificate("nothing.json")
    Traceback (most recent call last):
        ...
    FileNotFoundError: [Errno 2] No such file or directory: 'nothing.json'
    """
    friction = read_friction_claim(path)
    if friction is not None:
        return verified_friction(friction, model, K, time_cap)
    claim = read_claim(path)
    wrong = []
    if model is not None:
        if not isinstance(model, UncertaintyModel):
            raise ValueError(f"model must be an UncertaintyModel, got {shown(model)}")
        mine = claim_of(model, 0.0, None, 0.0)
        names = differences(claim, mine, ("plant", "weight", "reads", "inverse", "perturbation"))
        wrong += [("the model", f"not the one of the certificate: other {', '.join(names)}")] if names else []
    if K is not None and differences(claim, replace(claim, controller=given(K)), ("controller",)):
        wrong.append(("the controller", "not the one of the certificate"))
    found = verify_loop(claim, time_cap=time_cap)
    return replace(found, verified=found.verified and not wrong, failed=(*wrong, *found.failed))


def given(K: Any) -> Matrices:
    """The matrices of a controller."""
    return as_given(state_space("K", K))


def verified_friction(claim: FrictionClaim, model: Any, K: Any, time_cap: float) -> Verification:
    """The claim on a machine with friction, proved again and compared."""
    wrong = []
    if model is not None:
        machine = model if isinstance(model, SlidingMachine) else sliding_machine(getattr(model, "nominal", model))
        if not same(claim.machine, matrices_of(machine)):
            wrong.append(("the machine", "not the one of the certificate"))
    if K is not None and not same(claim.controller, given(K)):
        wrong.append(("the controller", "not the one of the certificate"))
    found = verify_friction(claim, time_cap=time_cap)
    return replace(found, verified=found.verified and not wrong, failed=(*wrong, *found.failed))


def same(mine: Matrices, other: Matrices) -> bool:
    """Whether two systems are the same, number by number."""
    parts = all(np.array_equal(getattr(mine, name), getattr(other, name)) for name in "ABCD")
    return parts and mine.dt == other.dt
