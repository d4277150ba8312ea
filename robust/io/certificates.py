"""Certificates in files: what a check proved, so that someone else can prove it again."""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from pathlib import Path
from typing import Any, TypeAlias

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import format_count, keep_warnings, one_line, repeat_warnings, short_form
from nlfrf._base.files import LOAD_OPTIONS, MEASURED_RECORDS, RECORD_SCHEMAS, parse_json_of, require_file_of
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust._base.types import Controller
from robust.analysis.findings import Proofs
from robust.analysis.loop import assemble_loop
from robust.analysis.loop_proofs import stability_claim
from robust.analysis.report import RobustnessReport
from robust.analysis.sampled_set import set_on_controller_time_base
from robust.friction.classes import AnyFriction, FrictionAtPorts, any_maxwell_slip
from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.verify import verify_friction
from robust.friction.nominal import machines_of_nominal
from robust.friction.plant import FrictionPlant, friction_plant
from robust.friction.proof.certify import FrictionProof, plant_matrices
from robust.friction.proof.linear_uncertainty import friction_frequency_test
from robust.friction.proof.prove import prove_friction
from robust.friction.reading.assumed_class import FrictionClass
from robust.friction.reading.friction_class import friction_class
from robust.friction.reading.levels import require_si
from robust.friction.units import position_unit_of
from robust.io.models import CERTIFICATE_SCHEMAS, PathLike, load_bla, load_model
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
from robust.proofs.exact.verification import Verification


def certificate_path(report: Path, number: int = 0) -> Path:
    """Return the certificate beside a text report, of several proofs by number.

    >>> certificate_path(Path("r.txt")).name, certificate_path(Path("r.txt"), 1).name
    ('r.certificate.json', 'r.2.certificate.json')
    """
    return report.with_suffix(f".{number + 1}.certificate.json" if number else ".certificate.json")


def save_certificate(report: RobustnessReport | FrictionProof, path: PathLike) -> None:
    """Write what was proved as JSON: plant, controller, delay, weights and claim as given, and a digest of it all.

    Of several channels it holds the loop with its perturbations pulled out, P and the scaling of each claim.
    """
    if isinstance(report, FrictionProof) and report.certificate is not None:
        save_friction_proof(report, path)
        return
    known = report.proofs if isinstance(report, RobustnessReport) else Proofs()
    proofs = [c for c in known.certificates if c.holds]
    found = [c.claim for c in proofs if isinstance(c.claim, LoopClaim)]
    scaled = {c.subject: c.claim for c in proofs if isinstance(c.claim, ScaledClaim | IntervalClaim | FoldedClaim)}
    how = [{"subject": c.subject, "found by": c.method} for c in proofs if c.claim is not None]
    warned = getattr(report, "warnings", ())
    if isinstance(report, RobustnessReport) and scaled and not found:
        given = report.given
        write_claim(path, ChannelsClaim(claims=scaled, form=report.form, delay=given.delay), found=how, warnings=warned)
        return
    if not found:
        raise ValueError(
            "report must hold a proof that can be repeated, got "
            + (f"the verdict {report.verdict!r}" if hasattr(report, "verdict") else short_form(report))
        )
    claim = replace(
        found[0],
        claims=tuple(name for claim in found for name in claim.claims),
        scaling=found[-1].scaling,
    )
    write_claim(path, claim, found=how, warnings=warned)


def save_friction_proof(proof: FrictionProof, path: PathLike, basis: FrictionBasis | None = None) -> None:
    """Write a proof with friction, and what its class was read from."""
    certificate = proof.certificate
    if certificate is None or not isinstance(certificate.claim, FrictionClaim):
        raise ValueError(f"report must hold a proof of a single loop, got the verdict {proof.verdict!r}")
    units = proof.friction.units
    write_claim(
        path,
        certificate.claim,
        found=[{"subject": certificate.subject, "found by": certificate.method}],
        read_from=None if basis is None else {"evidence": basis.description, "files": list(basis.sources)},
        units={"K0": f"{units.force}/{units.position}", "microdamping": units.damping},
        warnings=() if basis is None else basis.warnings,
    )


def load_claim(path: PathLike) -> LoopClaim | FrictionClaim | ChannelsClaim:
    """Return what a certificate claims, of a loop, of several channels or of a machine with friction."""
    found = read_claim(path, FrictionClaim) or read_claim(path, ChannelsClaim) or read_claim(path, LoopClaim)
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
    """Prove what a certificate file claims again, with outward rounding, and compare it with the model and K one has.

    Parameters
    ----------
    path : path
        A certificate that `robust.save`, `robust check` or `robust prove` wrote.
    model : UncertaintyModel or FrictionPlant, optional
        What the certificate is said to be about: nominal, weight, form and class are compared number by number; of a
        machine with friction its linear part. Of several channels the loop of model and K is compared, to 1e-6.
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
    stored = parse_json_of(path, *CERTIFICATE_SCHEMAS).get("warnings", ())
    claim = load_claim(path)
    if isinstance(claim, FrictionClaim):
        wrong, found = differences_of_machine(claim, model), partial(verify_friction, claim, time_cap=time_cap)
    elif not isinstance(model, UncertaintyModel | None):
        raise ValueError(f"model must be an UncertaintyModel, got {short_form(model)}")
    elif isinstance(claim, ChannelsClaim):
        wrong, found = differences_of_channels(claim, model, K), partial(verify_channels, claim)
    else:
        wrong, found = differences_of_loop(claim, model), partial(verify_loop, claim, time_cap=time_cap)
    if K is not None and not isinstance(claim, ChannelsClaim):
        other = differing_fields(claim.controller, to_matrices(state_space("K", K)), SYSTEM)
        wrong |= {"the controller": ""} if other else {}
    proved = found()
    return replace(
        proved,
        verified=proved.verified and not wrong,
        failed=(*((part, f"not the one of the certificate{how}") for part, how in wrong.items()), *proved.failed),
        warnings=tuple(map(one_line, stored)),
    )


SYSTEM = (*"ABCD", "dt")  # what two systems are compared by, number by number


def differences_of_loop(claim: LoopClaim, model: UncertaintyModel | None) -> dict[str, str]:
    """Return that the model of one loop is not as in the certificate, and how it differs."""
    if model is None:
        return {}
    mine = stability_claim(model, 0.0, w_P=None, delay=0.0)
    names = differing_fields(claim, mine, ("plant", "weight", "reads", "inverse", "perturbation"))
    return {"the model": f": other {', '.join(names)}"} if names else {}


def differences_of_channels(
    claim: ChannelsClaim, model: UncertaintyModel | None, K: Controller | None
) -> dict[str, str]:
    """Return that the loop of model and controller is not the one of the certificate."""
    if (model is None) != (K is None):
        raise ValueError("model and K must be given together for a certificate of several channels, got one of them")
    if model is None or K is None:
        return {}
    return {} if is_loop_of(claim, model, K) else {"the loop of model and controller": ""}


def differences_of_machine(claim: FrictionClaim, model: object) -> dict[str, str]:
    """Return that a machine with friction is not the one of the certificate."""
    if model is None:
        return {}
    machine = model if isinstance(model, FrictionPlant) else friction_plant(getattr(model, "nominal", model))
    return {"the machine": ""} if differing_fields(claim.machine, plant_matrices(machine), SYSTEM) else {}


LOOP_TOLERANCE = 1e-6  # of the largest entry at a frequency; what rounding moves stays below the slack on the level


def is_loop_of(given: ChannelsClaim, model: UncertaintyModel, K: Controller) -> bool:
    """Return whether the loop of model and controller responds as that of the certificate, at its perturbations."""
    form = next((one for one in (model, model.alternative_form) if one is not None and one.form == given.form), None)
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
            if folded is None or not is_same_folding(claim, folded.claim):
                return False
            continue
        theirs = control.StateSpace(*(getattr(claim.system, name) for name in "ABCD"), claim.system.dt)
        if theirs.noutputs < rows or theirs.ninputs < cols or timebase(theirs) != timebase(mine):
            return False
        off = np.abs(response_by_channel(theirs, omega)[:rows, :cols] - response).max(axis=(0, 1))
        if np.any(off > LOOP_TOLERANCE * np.abs(response).max(axis=(0, 1))):
            return False
    return True


def is_same_folding(claim: FoldedClaim, mine: FoldedClaim) -> bool:
    """Return whether the same continuous set is folded, number by number."""
    if claim.dt != mine.dt or len(claim.parts) != len(mine.parts):
        return False
    pairs = zip(claim.parts, mine.parts, strict=True)
    return not any(differing_fields(*pair, ("plant", "left", "right")) for pair in pairs)


LoadOptions: TypeAlias = Mapping[str, Any]
#: Kinds of files of ours that a machine and its friction are read from.
MACHINE_FILES = ("nlfrf-bla", "nlfrf-frm", *RECORD_SCHEMAS, *MEASURED_RECORDS, "robust-model", "robust-matrix-model")


@value
class FrictionBasis:
    """What a proof with friction starts from.

    Fields
    ------
    machines : tuple of FrictionPlant
        The linear part, with each damping that is to be proved.
    friction : AnyFriction or FrictionAtPorts
        The class.
    description : str
        What was read from what, and how surely.
    sources : tuple of dict
        Of each file its name, its kind, its SHA-256, and the options that it was read with.
    levels : FrictionClass or None
        What was read without a nominal; None with one, and from a model.
    warnings : tuple of str
        What was warned of the records, BLAs and models that it was read from.
    """

    machines: tuple[FrictionPlant, ...]
    friction: AnyFriction | FrictionAtPorts
    description: str
    sources: tuple[dict[str, object], ...]
    levels: FrictionClass | None = None
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([self.description, *(f"warning: {text}" for text in self.warnings)])


@keep_warnings
def class_from_files(
    files: Sequence[Path],
    controller: Path,
    *,
    nominal: Path | None = None,
    stiffness: float | None = None,
    stiction: float = 1.5,
    free: bool = False,
    masses: int = 1,
    load: LoadOptions | None = None,
) -> FrictionBasis:
    """Return machines and friction class of one model and a stiffness [N/m], or of BLAs or records at several levels.

    A stiffness that is given replaces that of the levels. The controller stands in the commands of the messages only.
    `load` has what `nlfrf.load_record` takes, for traces.

    Raises
    ------
    ValueError
        Files that do not make a machine and its friction; each message ends with the command that goes on.
    """
    for path in files:
        require_file_of(path, *MACHINE_FILES)
    models = [path for path in files if path.suffix.lower() == ".json"]
    measured = [path for path in files if path not in models]
    if len(models) == 1 and measured and nominal is None:
        raise ValueError(
            f"machine must be one model or BLAs at three levels, got both; "
            f"{next_command_hint(prove_command(measured, controller, nominal=models[0]))}"
        )
    if models:
        return class_from_model(models, controller, stiffness=stiffness, stiction=stiction)
    load = {} if load is None else load
    records, blas = load_levels(measured, controller, load)
    if records:
        found = class_from_records(
            records,
            controller,
            nominal=nominal,
            stiffness=stiffness,
            stiction=stiction,
            free=free,
            masses=masses,
            load=load,
        )
    else:
        if given := [f"--{LOAD_OPTIONS[name]}" for name in load] + ["--free"] * free + ["--masses"] * (masses != 1):
            raise ValueError(
                f"machine must be records for {' and '.join(given)}, got BLAs; "
                + next_command_hint(prove_command(list(blas), controller, nominal=nominal, stiffness=stiffness))
            )
        found = class_from_bla_files(blas, controller, nominal=nominal, stiffness=stiffness, stiction=stiction)
    friction = found.friction
    if stiffness is not None:
        if not isinstance(friction, AnyFriction):
            raise ValueError(f"stiffness must be left out with two masses, which have one each, got {stiffness:g}")
        friction = any_maxwell_slip(stiffness, friction.stiction, position_unit=friction.position_unit)
    return FrictionBasis(
        machines=found.machines,
        friction=friction,
        description=str(found),
        sources=(
            *(describe_source(path, "record" if records else "BLA", load) for path in measured),
            *(() if nominal is None else (describe_source(nominal, "model"),)),
        ),
        levels=found if nominal is None else None,
    )


def load_levels(
    paths: Sequence[Path], controller: Path, load: LoadOptions
) -> tuple[dict[Path, nlfrf.Record], dict[Path, nlfrf.Bla]]:
    """Return the records or the BLAs in files; refuse both together with the commands that make them alike."""
    levels = {path: load_level(path, load) for path in paths}
    records = {path: one for path, one in levels.items() if isinstance(one, nlfrf.Record)}
    blas = {path: one for path, one in levels.items() if isinstance(one, nlfrf.Bla)}
    if records and blas:
        raise ValueError(
            f"machine must be BLAs alone or records alone, got the BLAs {', '.join(map(str, blas))} and the records "
            f"{', '.join(map(str, records))}: take the records of all levels, or identify these; "
            + next_command_hint(
                *(identify_command(path, load) for path in records),
                prove_command([bla_of(path) if path in records else path for path in levels], controller),
            )
        )
    return records, blas


def load_level(path: Path, load: LoadOptions) -> nlfrf.Bla | nlfrf.Record:
    """Return the BLA in a file, or the record: one of this package, or a trace of any other origin."""
    schema = nlfrf.inspect_file(path).schema
    is_bla = schema and "record" not in schema
    level: nlfrf.Bla | nlfrf.Record = load_bla(path) if is_bla else nlfrf.load_record(path, **load)
    return repeat_warnings(level) if schema else level


def class_from_records(
    records: Mapping[Path, nlfrf.Record],
    controller: Path,
    *,
    nominal: Path | None,
    stiffness: float | None,
    stiction: float,
    free: bool,
    masses: int,
    load: LoadOptions,
) -> FrictionClass:
    """Read the class from records; a refusal has the commands that read it from their BLAs around a nominal."""
    identified = [identify_command(path, load) for path in records]
    largest = bla_of(max(records, key=lambda path: float(np.std(records[path].y))))
    fit = fit_command(largest)
    if len(records) < 3:
        known = prove_command(["nominal.json"], controller, stiffness=stiffness or "NEWTON_PER_METRE")
        raise ValueError(
            f"machine must be records at three levels, from sticking to sliding, got "
            f"{format_count(len(records), 'record')}; " + next_command_hint(*identified, fit, known)
        )
    around = prove_command([bla_of(path) for path in records], controller, nominal=nominal or "nominal.json")
    if nominal is not None:
        raise ValueError(
            "nominal must be left out with records, which are read as one mass with their delay, got one; "
            + next_command_hint(*identified, around)
        )
    with add_next_command(
        "for a machine that is flexible, --masses 2, or around a nominal " + next_command_hint(*identified, fit, around)
    ):
        return friction_class(list(records.values()), stiction=stiction, free=free, masses=masses)


def class_from_bla_files(
    blas: Mapping[Path, nlfrf.Bla],
    controller: Path,
    *,
    nominal: Path | None,
    stiffness: float | None,
    stiction: float,
) -> FrictionClass:
    """Read the class from BLAs, perhaps around a nominal; a refusal has the commands that go on."""
    files, measured = list(blas), list(blas.values())
    if len(files) < 3:
        raise ValueError(
            "machine must be BLAs or records at three levels, from sticking to sliding, or one model with the "
            f"stiffness of the friction, got {format_count(len(files), 'BLA')}; "
            + next_command_hint(
                fit_command(files[-1]),
                prove_command(["nominal.json"], controller, stiffness=stiffness or "NEWTON_PER_METRE"),
            )
        )
    highest = files[highest_level(measured)]
    if nominal is None:
        with add_next_command(
            "for a machine that is flexible or well damped "
            + next_command_hint(fit_command(highest), prove_command(files, controller, nominal="nominal.json"))
        ):
            return friction_class(measured, stiction=stiction)
    around = load_machine(nominal, highest, prove_command(files, controller, nominal="nominal.json")).nominal
    with add_next_command(
        next_command_hint(prove_command([nominal], controller, stiffness=stiffness or "NEWTON_PER_METRE"))
    ):
        return friction_class(measured, nominal=around, stiction=stiction)


def describe_source(path: Path, kind: str, load: LoadOptions | None = None) -> dict[str, object]:
    """Return what a certificate keeps of a file: name, kind and digest, and the options that it was read with."""
    options = {f"--{LOAD_OPTIONS[name]}": str(option) for name, option in (load or {}).items()}
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return {"file": path.name, "kind": kind, "sha256": digest, **({"options": options} if options else {})}


def highest_level(blas: Sequence[nlfrf.Bla]) -> int:
    """Return the BLA whose friction slips most: it adds no stiffness there, and the least damping.

    Gains at the lowest line within 5 % of each other count as equal, because levels that all slip differ by chance.
    """
    gains = [abs(bla.G[0]) for bla in blas]
    return max(range(len(blas)), key=lambda k: (gains[k] > 0.95 * max(gains), np.abs(blas[k].G).max()))


def class_from_model(
    models: Sequence[Path], controller: Path, *, stiffness: float | None, stiction: float
) -> FrictionBasis:
    """One model, and the stiffness of its friction, which no model shows."""
    model = models[0]
    if len(models) > 1:
        raise ValueError(
            f"machine must be one model, got {len(models)}; "
            + next_command_hint(prove_command([model], controller, stiffness=stiffness or "NEWTON_PER_METRE"))
        )
    if stiffness is None:
        raise ValueError(
            f"stiffness must be given with a model [N/m], got none for {model}; "
            + next_command_hint(prove_command([model], controller, stiffness="NEWTON_PER_METRE"))
            + ", or read it from BLAs at three levels: "
            + prove_command(["LOW.npz", "MID.npz", "HIGH.npz"], controller, nominal=model)
        )
    known = load_machine(model, Path("BLA.npz"), prove_command(["nominal.json"], controller, stiffness=stiffness))
    machines, description = machines_of_nominal(known.nominal)
    position_unit = position_unit_of(known.origin.unit)
    return FrictionBasis(
        machines=tuple(replace(machine, position_unit=position_unit) for machine in machines),
        friction=any_maxwell_slip(stiffness, stiction, position_unit=position_unit),
        description=description,
        sources=(describe_source(model, "model"),),
    )


def load_machine(path: Path, bla: Path, command: str) -> UncertaintyModel:
    """Return a model in a file whose nominal is a machine, from force to position, or refuse with a command for one."""
    model = repeat_warnings(load_model(path))
    if getattr(model, "measured_only", True):
        raise ValueError(
            f"machine must have a parametric nominal of one input and output, got {path} without; "
            f"{next_command_hint(fit_command(bla), command)}"
        )
    require_si("machine", model.origin.unit)
    with add_next_command(next_command_hint(fit_command(bla, max(2, model.nominal.nstates)), command)):
        machines_of_nominal(model.nominal)
    return model


def fit_command(bla: Path, poles: int = 4) -> str:
    """Return the command line that fits a nominal to a BLA, with two zeros less than poles."""
    return f"robust model {shell_quote(bla)} --poles {poles} --zeros {poles - 2} -o nominal.json"


def bla_of(record: Path) -> Path:
    """Return the file that a hint gives the BLA of a record."""
    return Path(f"{record.name.partition('.')[0]}-bla.npz")


def identify_command(path: Path, load: LoadOptions) -> str:
    """Return the command line that identifies the BLA of a record, with the options that it was read with."""
    options = [
        f"--{LOAD_OPTIONS[name]}" + ("" if option is True else f" {shell_quote(str(option))}")
        for name, option in load.items()
    ]
    return " ".join(["nlfrf identify", shell_quote(path), *options, f"-o {shell_quote(bla_of(path))}"])


def prove_command(
    files: Sequence[Path | str],
    controller: Path,
    *,
    nominal: Path | str | None = None,
    stiffness: float | str | None = None,
) -> str:
    """Return the command line that proves."""
    words = ["robust prove", *map(shell_quote, files), shell_quote(controller)]
    words += [] if nominal is None else ["--nominal", shell_quote(nominal)]
    return " ".join(words + ([] if stiffness is None else ["--stiffness", f"{stiffness}"]))


def shell_quote(path: Path | str) -> str:
    """Return a path as a shell takes it."""
    return shlex.quote(str(path))


def next_command_hint(*commands: str) -> str:
    """Return the end of a refusal: what to run next."""
    return "go on with: " + "; ".join(commands)


@contextmanager
def add_next_command(how: str) -> Iterator[None]:
    """Add to a refusal the command that goes on."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{error}; {how}") from None


def prove_all(
    machines: Sequence[FrictionPlant],
    K: control.StateSpace,
    friction: AnyFriction | FrictionAtPorts,
    *,
    delay: float = 0.0,
    Fs: float | Sequence[float] | None = None,
) -> tuple[FrictionProof, ...]:
    """Prove each machine, weakest result first: a claim on a machine has to hold with each damping."""
    proofs = [prove_friction(machine, K, friction, delay=delay, Fs=Fs) for machine in machines]
    worth = (FrictionVerdict.REFUTED, FrictionVerdict.NOT_DECIDED, FrictionVerdict.SETTLES, FrictionVerdict.PROVED)
    return tuple(sorted(proofs, key=lambda proof: worth.index(proof.verdict)))


def describe_frequency_test(basis: FrictionBasis, K: control.StateSpace, delay: float) -> str:
    """Describe the frequency test of mass and stiffness of levels within two standard deviations; else empty."""
    found = basis.levels
    if found is None or not isinstance(basis.friction, AnyFriction):
        return ""
    errors = {"mass": 2 * found.mass_std, "stiffness": 2 * found.stiffness_std}
    test = friction_frequency_test(found.machine, K, basis.friction, delay=delay, margin=True, **errors)
    return f"\n\nTwo standard deviations. {test}"


def save_proofs(proofs: Sequence[FrictionProof], out: Path, basis: FrictionBasis) -> None:
    """Certificates of those that are proved, beside a result: out.certificate.json, out.2.certificate.json."""
    proved = [proof for proof in proofs if proof.certificate is not None and proof.certificate.claim is not None]
    for number, proof in enumerate(proved):
        save_friction_proof(proof, certificate_path(out, number), basis)
