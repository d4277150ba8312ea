"""The page of a check of a drive: its verdict with pictures of FRF, friction, loop, step and
rest.
"""

from __future__ import annotations

import os
import warnings
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import nlfrf
from nlfrf import Record
from nlfrf._base.arguments import require_kind
from nlfrf._base.files import page_path, write_text
from nlfrf.plot import plot_blas
from robust._base.states import FrictionVerdict
from robust.pages.html import draw_picture, render_page
from robust.pages.section import Picture
from robust.plot import (
    RestCase,
    plot_check,
    plot_friction_fit,
    plot_friction_force,
    plot_loop,
    plot_nyquist,
    plot_rest,
    plot_step,
)
from robust.servo.checking.findings import DriveCheck, DriveVerdict
from robust.servo.checking.friction import force_over_position
from robust.servo.checking.simulation import SHOWN

#: Style of the page for a verdict; the default is that of a warning.
_STYLES = dict.fromkeys(DriveVerdict, "") | {
    DriveVerdict.PASSED: "robust",
    DriveVerdict.NOT_PASSED: "not-robust",
}


def write_page(
    path: str | os.PathLike[str],
    found: DriveCheck,
    records: Sequence[Record],
    *,
    title: str = "Check of a drive",
) -> None:
    """Write the result of a check of a drive as one HTML file with pictures.

    The command `robust servo check ... -o page.html` writes the same file.

    Parameters
    ----------
    path : path
        The ``.html`` file; written whole or not at all.
    found : DriveCheck
        From `robust.servo.check`.
    records : sequence of nlfrf.Record
        Traces that were checked, in the same order.
    title : str
        Heading.

    Raises
    ------
    ValueError
        A path that does not end in .html, or a number of records that differs from the number of
        checked traces.

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
    >>> found = check([record], gains)
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_page(Path(folder, "page.html"), found, [record])
    ...     text = Path(folder, "page.html").read_text(encoding="utf-8")
    >>> found.conclusion[:20] in text, "http" in text.replace("http-equiv", "")
    (True, False)
    """
    path = page_path(path)
    require_kind("found", found, DriveCheck)
    if len(records) != len(found.traces):
        raise ValueError(
            f"records must be the {len(found.traces)} traces of the check, got {len(records)}"
        )
    names = [  # levels of one pre-test may have one name
        f"{trace.name}, {np.std(record.u):.3g} {record.u_unit} rms"
        for trace, record in zip(found.traces, records, strict=True)
    ]
    at_rest = {name: records[k] for k, name in enumerate(names) if not found.traces[k].moving}
    pictures = {
        "traces": _pictures_of_traces(records, names),
        "friction": _pictures_of_friction(found, at_rest),
        "loop": [
            draw_picture(
                "L in the complex plane, with discs of the set.",
                plot_nyquist,
                found.report,
                square=True,
            ),
            draw_picture(
                "Loop gain and sensitivities of the nominal loop.", plot_loop, found.report
            ),
            draw_picture(
                "Stability of the set: each curve must stay below one.", plot_check, found.report
            ),
        ],
    }
    if found.step is not None:
        unit = found.settings.base_unit
        pictures["step"] = [
            draw_picture("A step of the position set point.", plot_step, found.step, unit=unit)
        ]
    text = render_page(
        [replace(section, pictures=pictures.get(section.name, ())) for section in found.sections],
        title=title,
        verdict=found.verdict,
        style=_STYLES[found.verdict],
        heading=found.verdict.capitalize(),
        lines=found.findings[:1],
    )
    write_text(path, text)


def _pictures_of_traces(records: Sequence[Record], names: Sequence[str]) -> list[Picture]:
    """Draw the FRF of each trace with its bound."""
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.DataWarning)  # the check has shown them
        blas = [nlfrf.identify(record) for record in records]
    caption = "FRF from force to position of each trace, with its 95 % bound."
    return [draw_picture(caption, plot_blas, blas, names, tall=True)]


def _pictures_of_friction(found: DriveCheck, at_rest: dict[str, Record]) -> list[Picture]:
    """Draw force over position if machine and friction are known, the fit, and the distances from
    the set point.
    """
    friction, pictures = found.friction, []
    fit, force = friction.fit, friction.force
    read, machine = fit or force, fit if force is None else force.sliding
    one_mass = (
        machine is not None
        and np.isfinite(machine.stds["mass"])
        and not (fit is not None and fit.load_mass)
    )
    if read is not None and machine is not None and one_mass and at_rest:
        loops = {name: force_over_position(record, machine) for name, record in at_rest.items()}
        caption = (
            "Friction force over the position: commanded force minus mass and viscous friction."
            " Sticking is a line."
        )
        pictures.append(draw_picture(caption, plot_friction_force, loops, read))
    if fit is not None:
        caption = (
            "Stiffness and damping of the friction over the motion, measured and for the class that"
            " was read."
        )
        pictures.append(draw_picture(caption, plot_friction_fit, fit, tall=True))
    if cases := _rest_cases(found):
        unit = found.settings.base_unit
        caption = "Largest final distance from the set point, at rest or hunting."
        pictures.append(draw_picture(caption, plot_rest, cases, unit=unit, asked=found.asked))
    return pictures


def _rest_cases(found: DriveCheck) -> list[RestCase]:
    """Return verdict and largest distance from the set point: for the class, for any friction, and
    for each change.

    An unknown distance is not finite.
    """
    friction, cases = found.friction, []
    if friction.proofs:
        within = friction.within
        if friction.proved:
            within = 0.0 if friction.has_integral else friction.error_bound
        cases.append(
            RestCase(
                "these gains, with the class that was read", friction.proofs[0].verdict, within
            )
        )
    if friction.largest is not None and np.isfinite(friction.error_bound):
        name = f"these gains, with any friction of at most {friction.largest_forces}"
        cases.append(RestCase(name, FrictionVerdict.SETTLES, friction.error_bound))
    if (seen := friction.simulated) is not None:
        far = max(seen.offset, seen.amplitude)
        name = f"these gains, simulated in {seen.ended} runs" + " (hunts)" * seen.hunts
        cases.append(RestCase(name, None, 0.0 if far < SHOWN else far))
    return cases + [RestCase(cure.change, cure.verdict, cure.error) for cure in friction.cures]
