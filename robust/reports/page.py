"""The report of a whole run, from the record to the verdict, in one self-contained HTML file."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import replace
from types import NoneType
from typing import TypeVar

import control

import nlfrf
from nlfrf import Bla, Record
from nlfrf._base.arguments import add_warnings, as_list, require_kind
from nlfrf._base.files import page_path, write_text
from robust._base.channels import require_matrix, require_single
from robust._base.types import Controller, Weight
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.analysis.signals import LoopSignals
from robust.analysis.text import describe_confidence
from robust.friction.proof.protocol import FrictionProof
from robust.lti.realisation import multivariable, state_space
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.model import UncertaintyModel, describe_no_set
from robust.pages.html import render_page
from robust.pages.section import Section
from robust.reports.data import (
    bla_section,
    cross_check_section,
    excitation_section,
    nominal_section,
    set_section,
)
from robust.reports.sections import (
    channels_section,
    check_section,
    loop_section,
    settings_section,
    worst_case_section,
)
from robust.reports.verdicts import describe_proof, friction_section, require_report_of


def write_report(
    path: str | os.PathLike[str],
    model: UncertaintyModel,
    K: Controller,
    *,
    bla: Bla | Sequence[Bla] | None = None,
    record: Record | Sequence[Record] | None = None,
    nominal: NominalFit | None = None,
    w_P: Weight | None = None,
    delay: float = 0.0,
    report: RobustnessReport | None = None,
    friction: FrictionProof | None = None,
    signals: LoopSignals | None = None,
    title: str = "Controller report",
    notes: str = "",
) -> RobustnessReport:
    """Write a report on a design as one HTML file: measurement, model, controller, check, proofs.

    Use this to archive a design or to give it to a colleague. The command `robust report` writes
    the same file.

    Parameters
    ----------
    path : path
        The ``.html`` file; written whole or not at all.
    model : UncertaintyModel
        Nominal plant and the set around it.
    K : control.StateSpace, TransferFunction or float
        The controller, negative feedback u = K (r - y).
    bla : nlfrf.Bla or list of them, optional
        The BLA behind the model; identified from the record if not given.
    record : nlfrf.Record or list of them, optional
        The record behind the BLA.
    nominal : NominalFit, optional
        Fit of the nominal plant; the report shows its cost.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight of the loop.
    delay : float
        Computation delay [s], as in `check`.
    report : RobustnessReport, optional
        Result of an earlier `check` of this loop, which contains its own demand and delay. By
        default the loop is checked here.
    friction : FrictionProof, optional
        Result of `prove_friction` for the same controller, which the report shows in addition.
    signals : LoopSignals, optional
        Signals that act on the loop, as in `check`. Not allowed together with `report`, which
        contains its own signals.
    title, notes : str
        Heading of the report, and further text in it.

    Returns
    -------
    RobustnessReport
        Result of the check that the file shows.

    Raises
    ------
    ValueError
        A path that does not end in .html; a `report`, `delay` or `w_P` of another loop; a
        `friction` that is not a FrictionProof; and the errors of `check`.
    FileNotFoundError
        A folder that does not exist.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import control
    >>> import numpy as np
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.1], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.05, 0.05]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     report = write_report(Path(folder, "report.html"), model, 2.0)
    ...     text = Path(folder, "report.html").read_text(encoding="utf-8")
    >>> report.verdict in text, "http" in text.replace("http-equiv", "")
    (True, False)
    """
    path = page_path(path)
    if not isinstance(model, UncertaintyModel):
        raise ValueError(f"model must be an UncertaintyModel, got {describe_no_set(model)}")
    single, records = model.is_single, _as_list(record)
    K = (state_space if single else multivariable)("K", K)
    for one in _as_list(bla):
        (require_single if single else require_matrix)("bla", one)
    _require_results(report, nominal, friction, single=single)
    blas = _as_list(bla) or [nlfrf.identify(one) for one in records]
    # records and BLAs may have newer warnings than the file of the model
    known: list[Record | Bla | NominalFit] = [*records, *blas, *_as_list(nominal)]
    model = add_warnings(model, [text for one in known for text in one.warnings])
    if report is None:
        report = check(model, K, w_P=w_P, delay=delay, signals=signals)
    elif signals is not None:
        raise ValueError("signals must be left out with a report: give them to its check, got both")
    else:
        require_report_of(report, model, K=K, w_P=w_P, delay=delay)
        report = replace(
            add_warnings(report, model.warnings), confidence=describe_confidence(model)
        )
    text = render_page(
        _sections_of(model, K, report, records, blas, nominal=nominal, friction=friction),
        title=title,
        notes=notes,
        verdict=report.verdict,
        style=report.verdict.replace(" ", "-"),
        heading=report.headline.capitalize(),
        lines=(
            report.meaning,
            *report.conditions,
            *([] if friction is None else [describe_proof(friction)]),
        ),
        warnings=[*filter(None, [report.warning_of_margins]), *report.warnings],
    )
    write_text(path, text)
    return report


def _require_results(report: object, nominal: object, friction: object, *, single: bool) -> None:
    """Refuse results of other kinds, and a friction proof for several channels."""
    for name, given, kind in (
        ("report", report, RobustnessReport),
        ("nominal", nominal, NominalFit),
        ("friction", friction, FrictionProof),
    ):
        require_kind(name, given, kind, NoneType)
    if friction is not None and not single:
        raise ValueError(
            "friction must be left out for several channels, because the proof is for a single"
            " loop only, got a FrictionProof"
        )


def _sections_of(
    model: UncertaintyModel,
    K: control.StateSpace,
    report: RobustnessReport,
    records: list[Record],
    blas: list[Bla],
    *,
    nominal: NominalFit | None,
    friction: FrictionProof | None,
) -> list[Section]:
    """Return the sections of the page in their order."""
    single = model.is_single
    w_P, delay = report.given.demand, report.given.delay  # the page reports what was checked
    return [
        Section(
            "verdict",
            "Verdict",
            "The result of the check of this controller with this set.",
            report.findings,
        ),
        *([] if friction is None else [friction_section(report, friction)]),
        *([excitation_section(records, blas)] if single else []),
        bla_section(blas),
        *([cross_check_section(records)] if single else []),
        nominal_section(model, nominal, blas),
        set_section(model),
        (loop_section if single else channels_section)(report, model, K),
        check_section(report),
        worst_case_section(model, K, report=report, delay=delay),
        settings_section(model, K, w_P=w_P, delay=delay),
    ]


Thing = TypeVar("Thing")


def _as_list(thing: Thing | Sequence[Thing] | None) -> list[Thing]:
    if thing is None:
        return []
    return as_list(thing)
