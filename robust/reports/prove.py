"""Machine and class of friction from the files of a command; an error names the next command to
run.
"""

from __future__ import annotations

import hashlib
import shlex
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias

import numpy as np

import nlfrf
from nlfrf._base.arguments import format_count, keep_warnings, repeat_warnings
from nlfrf._base.files import LOAD_OPTIONS, MEASURED_RECORDS, RECORD_SCHEMAS, require_file_of
from nlfrf._base.values import value
from robust.friction.classes.maxwell_slip import MaxwellSlip
from robust.friction.nominal import machines_of_nominal
from robust.friction.plant import FrictionPlant
from robust.friction.proof.protocol import FrictionProof
from robust.friction.reading.assumed_class import MachineWithFriction
from robust.friction.reading.from_blas import highest_level
from robust.friction.reading.levels import require_si
from robust.friction.reading.machine_with_friction import machine_with_friction
from robust.friction.units import position_unit_of
from robust.io.certificates import certificate_path, save_friction_proof
from robust.io.models import load_bla, load_model
from robust.models.sets.model import UncertaintyModel

if TYPE_CHECKING:
    pass

#: Options of `nlfrf.load_record`, by name.
LoadOptions: TypeAlias = Mapping[str, Any]
#: Kinds of files from which a machine and its friction can be read.
_MACHINE_FILES = (
    "nlfrf-bla",
    "nlfrf-frm",
    *RECORD_SCHEMAS,
    *MEASURED_RECORDS,
    "robust-model",
    "robust-matrix-model",
)
_NOMINAL = Path("nominal.json")  # output file of the commands in messages


@value
class MachineFiles:
    """Files of a machine with friction (one model, or BLAs or records at several levels), and
    options for reading them.

    controller : used in the commands of messages only. nominal : with BLAs, the model around which
    they are read. stiffness : presliding stiffness of the friction [N/m]; with levels it replaces
    the one that is read. stiction, free, masses : as for `machine_with_friction`. load : options of
    `nlfrf.load_record`, for traces.
    """

    files: tuple[Path, ...]
    controller: Path
    nominal: Path | None = None
    stiffness: float | None = None
    stiction: float = 1.5
    free: bool = False
    masses: int = 1
    load: LoadOptions = field(default_factory=dict)

    def prove(self, files: Sequence[Path], *, nominal: Path | None = None) -> str:
        """Return the command line of `robust prove`, with --nominal if a nominal is given."""
        if nominal is None:
            around = []
        else:
            around = ["--nominal", nominal]
        return _join("robust", "prove", *files, self.controller, *around)

    def prove_model(self, model: Path = _NOMINAL) -> str:
        """Return the command `robust prove` for a model and its friction stiffness."""
        return f"{self.prove([model])} --stiffness {self.stiffness or 'NEWTON_PER_METRE'}"

    def identify(self, record: Path) -> str:
        """Return the command line that identifies the BLA of a record, with the same options for
        reading it.
        """
        options = [(f"--{LOAD_OPTIONS[name]}", option) for name, option in self.load.items()]
        words = [word for pair in options for word in pair if word is not True]
        return _join("nlfrf", "identify", record, *words, "-o", _bla_of(record))


@value
class _FrictionBasis:
    """Machines (one for each damping to prove) and class of friction for a proof, with a
    description for the report.

    sources : name, kind, SHA-256 and reading options of each file. levels : the class as read from
    levels; None with a nominal or a model. warnings : warnings of the files.
    """

    machines: tuple[FrictionPlant, ...]
    friction: tuple[MaxwellSlip, ...]
    description: str
    sources: tuple[dict[str, object], ...]
    levels: MachineWithFriction | None = None
    warnings: tuple[str, ...] = ()

    def __str__(self) -> str:
        return "\n".join([self.description, *(f"warning: {text}" for text in self.warnings)])


@keep_warnings
def read_basis(given: MachineFiles) -> _FrictionBasis:
    """Return machines and friction class from one model and a stiffness, or from BLAs or records at
    several levels.

    Each error message ends with the next command to run.
    """
    for path in given.files:
        require_file_of(path, *_MACHINE_FILES)
    models = [path for path in given.files if path.suffix.lower() == ".json"]
    measured = [path for path in given.files if path not in models]
    if len(models) == 1 and measured and given.nominal is None:
        raise ValueError(
            "machine must be one model or BLAs at three levels, got both; "
            + _go_on(given.prove(measured, nominal=models[0]))
        )
    if models:
        return _basis_of_model(models, given)
    records, blas = _load_levels(measured, given)
    if records:
        found = _class_of_records(records, given)
    else:
        found = _class_of_blas(blas, given)
    friction = found.friction
    if given.stiffness is not None:
        if len(friction) > 1:
            raise ValueError(
                "stiffness must be left out with two masses, each of which has its own, got"
                f" {given.stiffness:g}"
            )
        friction = (replace(friction[0], K0=given.stiffness),)
    sources = [
        _describe_source(path, "record" if records else "BLA", given.load) for path in measured
    ]
    return _FrictionBasis(
        machines=found.machines,
        friction=friction,
        description=str(found),
        sources=(
            *sources,
            *([] if given.nominal is None else [_describe_source(given.nominal, "model")]),
        ),
        levels=found if given.nominal is None else None,
    )


def _load_levels(
    paths: Sequence[Path], given: MachineFiles
) -> tuple[dict[Path, nlfrf.Record], dict[Path, nlfrf.Bla]]:
    """Return the records or the BLAs in files; for both, the error has the commands that make BLAs
    of all.
    """
    levels = {path: _load_level(path, given.load) for path in paths}
    records = {path: one for path, one in levels.items() if isinstance(one, nlfrf.Record)}
    blas = {path: one for path, one in levels.items() if isinstance(one, nlfrf.Bla)}
    if records and blas:
        proved = given.prove([_bla_of(path) if path in records else path for path in levels])
        raise ValueError(
            f"machine must be BLAs alone or records alone, got the BLAs {', '.join(map(str, blas))}"
            f" and the records {', '.join(map(str, records))}: take the records of all levels, or"
            " identify these; " + _go_on(*map(given.identify, records), proved)
        )
    return records, blas


def _load_level(path: Path, load: LoadOptions) -> nlfrf.Bla | nlfrf.Record:
    """Return the BLA or the record in a file, or the record of a trace of any origin."""
    schema = nlfrf.inspect_file(path).schema
    is_bla = schema and "record" not in schema
    level: nlfrf.Bla | nlfrf.Record = load_bla(path) if is_bla else nlfrf.load_record(path, **load)
    if schema:
        return repeat_warnings(level)
    return level


def _class_of_records(
    records: Mapping[Path, nlfrf.Record], given: MachineFiles
) -> MachineWithFriction:
    """Return the class from records; an error has the commands that read it from their BLAs around
    a nominal.
    """
    identified = [given.identify(path) for path in records]
    fit = _fit_command(_bla_of(max(records, key=lambda path: float(np.std(records[path].y)))))
    if len(records) < 3:
        raise ValueError(
            "machine must be records at three levels, from sticking to sliding, got "
            f"{format_count(len(records), 'record')}; "
            + _go_on(*identified, fit, given.prove_model())
        )
    around = given.prove([_bla_of(path) for path in records], nominal=given.nominal or _NOMINAL)
    if given.nominal is not None:
        raise ValueError(
            "nominal must be left out with records, which are read as one mass with a delay, got"
            " one; " + _go_on(*identified, around)
        )
    with _add_next_command(
        "for a machine that is flexible, --masses 2, or around a nominal "
        + _go_on(*identified, fit, around)
    ):
        return machine_with_friction(
            list(records.values()), stiction=given.stiction, free=given.free, masses=given.masses
        )


def _class_of_blas(blas: Mapping[Path, nlfrf.Bla], given: MachineFiles) -> MachineWithFriction:
    """Return the class from BLAs, around a nominal if given; errors name the next command."""
    files, measured = list(blas), list(blas.values())
    options = [f"--{LOAD_OPTIONS[name]}" for name in given.load]
    if wrong := options + ["--free"] * given.free + ["--masses"] * (given.masses != 1):
        again = given.prove(files, nominal=given.nominal)
        again += "" if given.stiffness is None else f" --stiffness {given.stiffness}"
        raise ValueError(
            f"machine must be records for {' and '.join(wrong)}, got BLAs; {_go_on(again)}"
        )
    if len(files) < 3:
        raise ValueError(
            "machine must be BLAs or records at three levels, from sticking to sliding, or one"
            f" model with the stiffness of the friction, got {format_count(len(files), 'BLA')}; "
            + _go_on(_fit_command(files[-1]), given.prove_model())
        )
    highest = files[highest_level(measured)]
    if given.nominal is None:
        fitted = _go_on(_fit_command(highest), given.prove(files, nominal=_NOMINAL))
        with _add_next_command(f"for a machine that is flexible or well damped {fitted}"):
            return machine_with_friction(measured, stiction=given.stiction)
    around = _load_machine(given.nominal, highest, given.prove(files, nominal=_NOMINAL)).nominal
    with _add_next_command(_go_on(given.prove_model(given.nominal))):
        return machine_with_friction(measured, nominal=around, stiction=given.stiction)


def _describe_source(path: Path, kind: str, load: LoadOptions | None = None) -> dict[str, object]:
    """Return the entry of a file in a certificate: name, kind, digest, reading options."""
    options = {f"--{LOAD_OPTIONS[name]}": str(option) for name, option in (load or {}).items()}
    digest = hashlib.sha256(path.read_bytes()).hexdigest()
    return {
        "file": path.name,
        "kind": kind,
        "sha256": digest,
        **({"options": options} if options else {}),
    }


def _basis_of_model(models: Sequence[Path], given: MachineFiles) -> _FrictionBasis:
    """Return machines and class from one model and a given stiffness of the friction, which no
    model shows.
    """
    model = models[0]
    if len(models) > 1:
        raise ValueError(
            f"machine must be one model, got {len(models)}; {_go_on(given.prove_model(model))}"
        )
    if given.stiffness is None:
        levels = given.prove(
            [Path(f"{level}.npz") for level in ("LOW", "MID", "HIGH")], nominal=model
        )
        raise ValueError(
            f"stiffness must be given with a model [N/m], got none for {model};"
            f" {_go_on(given.prove_model(model))}, or read it from BLAs at three levels: {levels}"
        )
    known = _load_machine(model, Path("BLA.npz"), given.prove_model())
    machines, description = machines_of_nominal(known.nominal)
    position_unit = position_unit_of(known.origin.unit)
    return _FrictionBasis(
        machines=tuple(replace(machine, position_unit=position_unit) for machine in machines),
        friction=(MaxwellSlip(given.stiffness, given.stiction, position_unit=position_unit),),
        description=description,
        sources=(_describe_source(model, "model"),),
    )


def _load_machine(path: Path, bla: Path, command: str) -> UncertaintyModel:
    """Return the model in a file; refuse one whose nominal is no machine from force to position."""
    model = repeat_warnings(load_model(path))
    if getattr(model, "measured_only", True):
        raise ValueError(
            f"machine must have a parametric nominal with one input and output, got {path} without;"
            f" {_go_on(_fit_command(bla), command)}"
        )
    require_si("machine", model.origin.unit)
    with _add_next_command(_go_on(_fit_command(bla, max(2, model.nominal.nstates)), command)):
        machines_of_nominal(model.nominal)
    return model


def _fit_command(bla: Path, poles: int = 4) -> str:
    """Return the command line that fits a nominal to a BLA, with two zeros fewer than poles."""
    return _join("robust", "model", bla, "--poles", poles, "--zeros", poles - 2, "-o", _NOMINAL)


def _bla_of(record: Path) -> Path:
    """Return the path for the BLA of a record in messages."""
    return Path(f"{record.name.partition('.')[0]}-bla.npz")


def _join(*words: object) -> str:
    """Return words as a command line, with quotes for the shell."""
    return shlex.join(map(str, words))


def _go_on(*commands: str) -> str:
    """Return the end of an error message: the next commands."""
    return "go on with: " + "; ".join(commands)


@contextmanager
def _add_next_command(how: str) -> Iterator[None]:
    """Add the next command to an error message."""
    try:
        yield
    except ValueError as error:
        raise ValueError(f"{error}; {how}") from None


def save_proofs(proofs: Sequence[FrictionProof], out: Path, basis: _FrictionBasis) -> None:
    """Save the certificates of proofs: out.certificate.json, out.2.certificate.json, ..."""
    proved = [
        proof
        for proof in proofs
        if proof.certificate is not None and proof.certificate.claim is not None
    ]
    for number, proof in enumerate(proved):
        read_from = {"evidence": basis.description, "files": list(basis.sources)}
        save_friction_proof(
            proof, certificate_path(out, number), read_from=read_from, warnings=basis.warnings
        )
