"""What a proof for a machine with friction starts from, read from files: machines, a class, in words where from."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import nlfrf
from robust.files.certificates import save_certificate
from robust.files.models import load_model
from robust.friction_proof.classes import AnyFriction, any_maxwell_slip
from robust.friction_proof.flexible import machines_of_nominal
from robust.friction_proof.levels import friction_class
from robust.friction_proof.linear_uncertainty import friction_frequency_test
from robust.friction_proof.proof import FrictionProof, prove_friction
from robust.sliding.machine import SlidingMachine

__all__ = ["class_from_files", "linear_part_tested", "prove_all", "save_proofs"]


def class_from_files(
    files: Sequence[Path], nominal: Path | None, stiffness: float | None, stiction: float
) -> tuple[tuple[SlidingMachine, ...], AnyFriction, str]:
    """From one model and a stiffness [N/m], or from BLAs at three levels or more and perhaps a model at the highest."""
    if len(files) == 1:
        if stiffness is None:
            raise ValueError("stiffness must be given with a model [N/m]; BLAs at three levels tell it")
        machines, description = machines_of_nominal(nominal_of(files[0]))
        return machines, any_maxwell_slip(stiffness, stiction), f"{description}\n"
    given = None if nominal is None else nominal_of(nominal)
    found = friction_class([nlfrf.load_bla(path) for path in files], nominal=given, stiction=stiction)
    friction = found.friction if stiffness is None else any_maxwell_slip(stiffness, stiction)
    return found.machines, friction, f"{found}\n"


def nominal_of(path: Path) -> Any:
    """The nominal of a model in a file."""
    model = load_model(path)
    if getattr(model, "measured_only", True):
        raise ValueError(f"machine must have a parametric nominal of one input and output, got {path} without")
    return model.nominal


def prove_all(
    machines: Sequence[SlidingMachine], K: Any, friction: AnyFriction, **options: Any
) -> tuple[FrictionProof, ...]:
    """A proof for each machine, the least proved first: what is claimed of a machine has to hold with each damping."""
    proofs = [prove_friction(machine, K, friction, **options) for machine in machines]
    worth = {"refuted": 0, "not decided": 1, "proved": 2}
    return tuple(sorted(proofs, key=lambda proof: worth[proof.verdict]))


def linear_part_tested(files: Sequence[Path], nominal: Path | None, K: Any, friction: AnyFriction, delay: float) -> str:
    """What a frequency test says of the mass and stiffness of BLAs, within two standard deviations; else nothing."""
    if len(files) == 1 or nominal is not None:
        return ""
    found = friction_class([nlfrf.load_bla(path) for path in files], stiction=friction.stiction)
    errors = {"mass": 2 * found.mass_std, "stiffness": 2 * found.stiffness_std}
    test = friction_frequency_test(found.machine, K, friction, delay=delay, margin=True, **errors)
    return f"\n\nTwo standard deviations. {test}"


def save_proofs(proofs: Sequence[FrictionProof], out: Path) -> list[Path]:
    """Certificates of those that are proved, beside a result: out.certificate.json, out.2.certificate.json."""
    written: list[Path] = []
    for proof in proofs:
        if proof.certificate is not None and proof.certificate.claim is not None:
            number = f".{len(written) + 1}" if written else ""
            written.append(out.with_suffix(f"{number}.certificate.json"))
            save_certificate(proof, written[-1])
    return written
