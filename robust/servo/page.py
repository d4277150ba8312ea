"""The page of a check of a drive: its verdict with pictures of FRF, friction, loop, step and rest."""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence

import numpy as np

import nlfrf
from nlfrf import Record
from nlfrf._base.arguments import require_kind
from nlfrf._base.files import page_path, write_text
from robust._base.states import FrictionVerdict
from robust.plot.friction import RestCase
from robust.reports import parts
from robust.reports.parts import Banner, Section, render_page
from robust.servo.checking.findings import LEGEND, BaseMotion, Conditions, DriveCheck, DriveVerdict, describe_parameters
from robust.servo.checking.friction import force_over_position
from robust.servo.checking.simulation import SHOWN

#: Colours of the page for a verdict; one that was not judged has those of a warning.
_STYLES = dict.fromkeys(DriveVerdict, "") | {DriveVerdict.PASSED: "robust", DriveVerdict.NOT_PASSED: "not-robust"}


def write_page(
    path: str | os.PathLike[str],
    found: DriveCheck,
    records: Sequence[Record],
    *,
    names: Sequence[str] = (),
    conditions: Sequence[Conditions] = (),
    title: str = "Check of a drive",
) -> None:
    """Write a check of the gains of a drive as one HTML file with pictures, as `robust servo check -o page.html` does.

    Parameters
    ----------
    path : path
        The ``.html`` file; written whole or not at all.
    found : DriveCheck
        From `robust.servo.checking.judge.check`.
    records : sequence of nlfrf.Record
        The traces that were checked.
    names : sequence of str
        Of the traces.
    conditions : sequence of Conditions
        Under which each was recorded; those that are not known to be in motion count as at rest.
    title : str
        Heading.

    Raises
    ------
    ValueError
        A path that does not end in .html, no traces, or names or conditions that are not one a trace.

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> from nlfrf.rig import Drive
    >>> from robust.servo import check
    >>> axis = nlfrf.servo_axis("linear motor")
    >>> ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rms=60, rng=1)
    >>> record = nlfrf.rig.simulate_servo(axis, ms, n_periods=2, base_velocity=0.1)
    >>> gains = Drive(fs=4000, kv=20, kp=40, kp_unit="A/(m/s)", tn=0.05, torque_constant=52.8)
    >>> found = check([record], gains, conditions=[Conditions(motion=BaseMotion.MOVING, velocity=0.1)])
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(Path(folder, "page.html"), found, [record])
    ...     text = Path(folder, "page.html").read_text(encoding="utf-8")
    >>> found.conclusion[:20] in text, "http" in text.replace("http-equiv", "")
    (True, False)
    """
    path = page_path(path)
    require_kind("found", found, DriveCheck)
    names = list(names) or [f"trace {k + 1}" for k in range(len(records))]
    if not records or len(names) != len(records):
        raise ValueError(f"names must be one a trace, of at least one, got {len(names)} for {len(records)}")
    names = [  # levels of one pre-test may have one name
        f"{name}, {np.std(record.u):.3g} {record.u_unit} rms" for name, record in zip(names, records, strict=True)
    ]
    under = list(conditions) or [Conditions()] * len(records)
    if len(under) != len(records):
        raise ValueError(f"conditions must be one a trace, got {len(under)} for {len(records)}")
    at_rest = {
        name: record
        for name, record, one in zip(names, records, under, strict=True)
        if one.motion is not BaseMotion.MOVING
    }
    lines = found.findings[0], *(f"{name}: {answer}" for name, answer in found.answers.items()), *found.findings[1:]
    banner = Banner(style=_STYLES[found.verdict], heading=found.verdict.capitalize(), lines=lines)
    sections = [
        _traces_section(found, records, names),
        _friction_section(found, at_rest),
        _rest_section(found),
        _loop_section(found),
        *([] if found.step is None else [_step_section(found)]),
        Section(name="words", title="Words", lead="What the words of this page mean.", printed=LEGEND),
    ]
    warned = tuple(doubt.description for doubt in found.doubts)
    page = {"verdict": found.verdict, "banner": banner, "warnings": warned, "sections": sections}
    write_text(path, render_page(title=title, notes="", **page))


def _traces_section(found: DriveCheck, records: Sequence[Record], names: Sequence[str]) -> Section:
    """Return drive and traces, and the FRF of each with its bound."""
    from nlfrf import plot

    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)  # they stand among those of the check
        blas = [nlfrf.identify(record) for record in records]
    return Section(
        name="traces",
        title="Drive and traces",
        lead="At rest friction holds the axis like a spring; in motion it slides, and the axis answers as a mass.",
        facts=(
            ("drive", f"{found.settings}\n{describe_parameters(found.settings)}"),
            ("traces", "\n".join(found.traces)),
            ("timing", found.assumption),
        ),
        pictures=(
            parts.draw_picture(
                plot.plot_blas,
                blas,
                names,
                tall=True,
                caption="FRF from force to position of each trace, with its 95 % bound.",
            ),
        ),
    )


def _friction_section(found: DriveCheck, at_rest: dict[str, Record]) -> Section:
    """Return what was read of the friction, with the force over the position where machine and friction are known."""
    from robust import plot

    friction, pictures = found.friction, []
    fit, force = friction.fit, friction.force
    read, machine = fit or force, fit if force is None else force.sliding
    one_mass = machine is not None and np.isfinite(machine.stds["mass"]) and not (fit is not None and fit.load_mass)
    if read is not None and machine is not None and one_mass and at_rest:
        loops = {name: force_over_position(record, machine) for name, record in at_rest.items()}
        caption = "Force that mass and viscous friction leave of the command, over the position: what sticks is a line."
        pictures.append(parts.draw_picture(plot.plot_friction_force, loops, read, caption=caption))
    if friction.fit is not None:
        caption = "Stiffness and damping of the friction over the motion, measured and of the class that was read."
        pictures.append(parts.draw_picture(plot.plot_friction_fit, friction.fit, tall=True, caption=caption))
    return Section(
        name="friction",
        title="Friction",
        lead="What the traces show of the friction, and what is proved with it.",
        pictures=tuple(pictures),
        printed=str(friction),
    )


def _rest_section(found: DriveCheck) -> Section:
    """Return where the axis rests, or within which distance it moves, as it is and with each change that helps."""
    from robust import plot

    cases, unit = _rest_cases(found), found.settings.base_unit
    caption = "Largest distance from the set point in the end, with the friction that is assumed or with a change."
    return Section(
        name="rest",
        title="What rests where",
        lead="Where the axis is in the end, at rest or hunting.",
        facts=(("stiffness against a force on the axis", found.stiffness or ""),),
        pictures=(parts.draw_picture(plot.plot_rest, cases, unit=unit, asked=found.asked, caption=caption),)
        if cases
        else (),
    )


def _rest_cases(found: DriveCheck) -> list[RestCase]:
    """Return what is known of the rest: with the class that was read, with any friction of a force, with each change.

    Each has a verdict and the largest distance from the set point, not finite where none is known.
    """
    friction, cases = found.friction, []
    if friction.proofs:
        at_set_point = friction.proved and friction.has_integral
        within = 0.0 if at_set_point else friction.error_bound if friction.proved else friction.within
        cases.append(RestCase("these gains, with the class that was read", friction.proofs[0].verdict, within))
    if friction.largest is not None and np.isfinite(friction.error_bound):
        name = f"these gains, with any friction of at most {friction.largest_forces}"
        cases.append(RestCase(name, FrictionVerdict.SETTLES, friction.error_bound))
    if (seen := friction.simulated) is not None:
        far = max(seen.offset, seen.amplitude)
        name = f"these gains, simulated in {seen.ended} runs" + " (hunts)" * seen.hunts
        cases.append(RestCase(name, None, 0.0 if far < SHOWN else far))
    return cases + [RestCase(cure.change, cure.verdict, cure.error) for cure in friction.cures]


def _loop_section(found: DriveCheck) -> Section:
    """Return the linear loop with its set: margins, Nyquist, stability."""
    from robust import plot

    return Section(
        name="loop",
        title="Linear loop",
        lead=f"The set of plants around {found.base}, and the loop that the gains make with each of them.",
        printed=str(found.report),
        pictures=(
            parts.draw_picture(
                plot.plot_nyquist, found.report, square=True, caption="L in the complex plane, with discs of the set."
            ),
            parts.draw_picture(
                plot.plot_loop, found.report, caption="Loop gain and sensitivities of the nominal loop."
            ),
            parts.draw_picture(plot.plot_check, found.report, caption="Stability of the set; it must stay below one."),
        ),
    )


def _step_section(found: DriveCheck) -> Section:
    """Return the step of the position set point."""
    from robust import plot

    return Section(
        name="step",
        title="Step of the position set point",
        lead="Of the nominal linear loop, without limits of current and speed.",
        facts=(("step", str(found.step)),),
        pictures=(
            parts.draw_picture(
                plot.plot_step, found.step, unit=found.settings.base_unit, caption="A step of the position set point."
            ),
        ),
    )
