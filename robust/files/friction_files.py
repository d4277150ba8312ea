"""What a proof for a machine with friction starts from, read from files: machines, a class, in words where from."""

from __future__ import annotations

import shlex
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

import nlfrf
from nlfrf.shared.wording import counted
from robust.files.certificates import certificate_of, save_certificate
from robust.files.models import load_controller, load_model
from robust.friction_proof.classes import AnyFriction, any_maxwell_slip
from robust.friction_proof.flexible import machines_of_nominal
from robust.friction_proof.levels import friction_class, require_si
from robust.friction_proof.linear_uncertainty import friction_frequency_test
from robust.friction_proof.proof import FrictionProof, prove_friction
from robust.shared.states import FrictionVerdict
from robust.sliding.machine import SlidingMachine

__all__ = ["class_from_files", "controller_of", "linear_part_tested", "prove_all", "save_proofs"]


def class_from_files(
    files: Sequence[Path], controller: Path, nominal: Path | None, stiffness: float | None, stiction: float
) -> tuple[tuple[SlidingMachine, ...], AnyFriction, str]:
    """From one model and a stiffness [N/m], or from BLAs at three levels or more and perhaps a model at the highest.

    Raises
    ------
    ValueError
        Files that do not make a machine and its friction; each message ends with the command that goes on.
    """
    models = [path for path in files if path.suffix.lower() == ".json"]
    blas = [path for path in files if path not in models]
    if len(models) == 1 and blas and nominal is None:
        raise ValueError(
            f"machine must be one model or BLAs at three levels, got both; {go_on(prove(blas, controller, models[0]))}"
        )
    if models:
        return from_model(models, controller, stiffness, stiction)
    if len(blas) < 3:
        fit = f"robust model {quote(blas[-1])} --poles 4 --zeros 2 -o nominal.json"
        raise ValueError(
            f"machine must be BLAs at three levels, from sticking to sliding, or one model with the stiffness of the "
            f"friction, got {counted(len(blas), 'BLA')}; "
            + go_on(fit, prove(["nominal.json"], controller, stiffness=stiffness or "NEWTON_PER_METRE"))
        )
    measured = [nlfrf.load_bla(path) for path in blas]
    highest = blas[highest_level(measured)]
    if nominal is None:
        fit = f"robust model {quote(highest)} --poles 4 --zeros 2 -o nominal.json"
        with going_on(
            "for a machine that is flexible or well damped " + go_on(fit, prove(blas, controller, "nominal.json"))
        ):
            found = friction_class(measured, stiction=stiction)
    else:
        given = machine_of(nominal, highest, prove(blas, controller, "nominal.json"))
        with going_on(go_on(prove([nominal], controller, stiffness=stiffness or "NEWTON_PER_METRE"))):
            found = friction_class(measured, nominal=given, stiction=stiction)
    friction = found.friction if stiffness is None else any_maxwell_slip(stiffness, stiction)
    return found.machines, friction, f"{found}\n"


def highest_level(blas: Sequence[nlfrf.Bla]) -> int:
    """The BLA whose friction slips most: it adds no stiffness there, and the least damping.

    Gains at the lowest line within 5 % of each other count as equal, because levels that all slip differ by chance.
    """
    gains = [abs(bla.G[0]) for bla in blas]
    return max(range(len(blas)), key=lambda k: (gains[k] > 0.95 * max(gains), np.abs(blas[k].G).max()))


def from_model(
    models: Sequence[Path], controller: Path, stiffness: float | None, stiction: float
) -> tuple[tuple[SlidingMachine, ...], AnyFriction, str]:
    """One model, and the stiffness of its friction, which no model shows."""
    model = models[0]
    if len(models) > 1:
        raise ValueError(
            f"machine must be one model, got {len(models)}; "
            + go_on(prove([model], controller, stiffness=stiffness or "NEWTON_PER_METRE"))
        )
    if stiffness is None:
        raise ValueError(
            f"stiffness must be given with a model [N/m], got none for {model}; "
            + go_on(prove([model], controller, stiffness="NEWTON_PER_METRE"))
            + ", or read it from BLAs at three levels: "
            + prove(["LOW.npz", "MID.npz", "HIGH.npz"], controller, model)
        )
    G = machine_of(model, Path("BLA.npz"), prove(["nominal.json"], controller, stiffness=stiffness))
    machines, description = machines_of_nominal(G)
    return machines, any_maxwell_slip(stiffness, stiction), f"{description}\n"


def machine_of(path: Path, bla: Path, command: str) -> Any:
    """The nominal of a model in a file, from force to position; a refusal has the command that fits one."""
    model = load_model(path)
    if getattr(model, "measured_only", True):
        fit = f"robust model {quote(bla)} --poles 4 --zeros 2 -o nominal.json"
        raise ValueError(
            f"machine must have a parametric nominal of one input and output, got {path} without; {go_on(fit, command)}"
        )
    require_si("machine", model.unit)
    poles = max(2, model.nominal.nstates)
    fit = f"robust model {quote(bla)} --poles {poles} --zeros {poles - 2} -o nominal.json"
    with going_on(go_on(fit, command)):
        machines_of_nominal(model.nominal)
    return model.nominal


def prove(
    files: Sequence[Path | str],
    controller: Path,
    nominal: Path | str | None = None,
    stiffness: float | str | None = None,
) -> str:
    """The command line that proves."""
    words = ["robust prove", *map(quote, files), quote(controller)]
    words += [] if nominal is None else ["--nominal", quote(nominal)]
    return " ".join(words + ([] if stiffness is None else ["--stiffness", f"{stiffness}"]))


def quote(path: Path | str) -> str:
    """A path as a shell takes it."""
    return shlex.quote(str(path))


def go_on(*commands: str) -> str:
    """The end of a refusal: what to run next."""
    return "go on with: " + "; ".join(commands)


@contextmanager
def going_on(how: str) -> Iterator[None]:
    """Add to a refusal the command that goes on."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{error}; {how}") from None


def controller_of(path: Path, plant: Path) -> Any:
    """The controller in a file, which a command makes where it holds none."""
    with going_on(go_on(f"robust design {quote(plant)} --bandwidth HERTZ --sample-time SECONDS -o K.json")):
        return load_controller(path)


def prove_all(
    machines: Sequence[SlidingMachine], K: Any, friction: AnyFriction, **options: Any
) -> tuple[FrictionProof, ...]:
    """A proof for each machine, the least proved first: what is claimed of a machine has to hold with each damping."""
    proofs = [prove_friction(machine, K, friction, **options) for machine in machines]
    worth = (FrictionVerdict.REFUTED, FrictionVerdict.NOT_DECIDED, FrictionVerdict.PROVED)
    return tuple(sorted(proofs, key=lambda proof: worth.index(proof.verdict)))


def linear_part_tested(files: Sequence[Path], nominal: Path | None, K: Any, friction: AnyFriction, delay: float) -> str:
    """What a frequency test says of the mass and stiffness of BLAs, within two standard deviations; else nothing."""
    if len(files) == 1 or nominal is not None:
        return ""
    found = friction_class([nlfrf.load_bla(path) for path in files], stiction=friction.stiction)
    errors = {"mass": 2 * found.mass_std, "stiffness": 2 * found.stiffness_std}
    test = friction_frequency_test(found.machine, K, friction, delay=delay, margin=True, **errors)
    return f"\n\nTwo standard deviations. {test}"


def save_proofs(proofs: Sequence[FrictionProof], out: Path) -> None:
    """Certificates of those that are proved, beside a result: out.certificate.json, out.2.certificate.json."""
    proved = [proof for proof in proofs if proof.certificate is not None and proof.certificate.claim is not None]
    for number, proof in enumerate(proved):
        save_certificate(proof, certificate_of(out, number))
