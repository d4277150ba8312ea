"""Friction in the loop of a drive: read from traces at rest, and the loop proved with it."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

import nlfrf
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust.friction.balance import HALF_WIDTH, format_rounded
from robust.friction.identification import FrictionFit, identify_friction
from robust.friction.levels import FrictionClass
from robust.friction.plant import FrictionPlant, pad_states
from robust.friction.prove import FrictionProof
from robust.io.certificates import prove_all
from robust.synthesis.drive.cascade import cascade
from robust.synthesis.drive.cures import FrictionCure, friction_cures
from robust.synthesis.drive.settings import DriveSettings

__all__ = ["DriveFriction", "judge_friction"]

#: Levels from which friction is read.
FEWEST_LEVELS = 3


@value
class DriveFriction:
    """What traces at rest say of the friction of an axis, and of its loop with that friction.

    Fields
    ------
    fit : FrictionFit or None
        Machine and friction, with intervals.
    assumed : FrictionClass or None
        Machine and class that the loop was proved with.
    proofs : tuple of FrictionProof
        The verdicts.
    cures : tuple of FrictionCure
        What a change of the drive does to a verdict that is not proved.
    note : str
        Why nothing was read, or nothing proved.
    largest : float or None
        Largest friction force [N] or [Nm] of the bounds: stated, or the upper end of what was read.
    """

    fit: FrictionFit | None = None
    assumed: FrictionClass | None = None
    proofs: tuple[FrictionProof, ...] = ()
    cures: tuple[FrictionCure, ...] = ()
    note: str = ""
    largest: float | None = None

    @property
    def proved(self) -> bool:
        """Whether the loop comes to rest with every friction of the class, by a proof."""
        return bool(self.proofs) and all(proof.verdict is FrictionVerdict.PROVED for proof in self.proofs)

    @property
    def delay(self) -> str:
        """Delay and lag of the current loop together, as the traces show them; empty where they do not."""
        if self.fit is None or not np.isfinite(self.fit.stds["delay"]):
            return ""
        half = 1e3 * HALF_WIDTH * self.fit.stds["delay"]
        return f"{format_rounded(1e3 * self.fit.delay, half)} +- {half:.1g} ms"

    def __str__(self) -> str:
        rows = []
        if self.fit is not None:
            free = "" if self.fit.stds["stiffness"] else " of a machine without a spring to ground"
            rows = [f"read from {len(self.fit.levels)} traces at rest{free}:", str(self.fit)]
        if self.assumed is None:
            return "\n".join([*rows, f"not judged: {self.note}"])
        if self.largest is not None:
            largest = f"{self.largest:.4g} {self.assumed.friction.units.force}"
            rows.append(f"largest friction force for the bound below, the upper end of Fs or as given: {largest}")
        return "\n".join([*rows, str(self.assumed), *map(str, self.proofs), *map(str, self.cures)])


def judge_friction(
    records: Sequence[nlfrf.Record],
    settings: DriveSettings,
    *,
    actual: bool,
    stiction: float,
    Fs: float | None,
    spring: bool,
    masses: int,
) -> DriveFriction:
    """Read the friction from traces at rest, and prove the loop with it; the other parameters as of `check_drive`.

    records : force in, position out, each at rest.
    actual : whether their input is the actual force, in which delay and lag of the settings do not show.
    """
    if len(records) < FEWEST_LEVELS:
        return DriveFriction(
            note=f"it takes traces at rest at three levels or more, from sticking to sliding, got {len(records)}"
        )
    unit = records[0].u_unit
    if unit == "A":
        return DriveFriction(note="it takes a force, and the gains have no torque_constant")
    try:
        fit = identify_friction(records, free=not spring, masses=masses)
    except ValueError as error:
        return DriveFriction(note=str(error))
    try:
        assumed = fit.assumed_class(stiction=stiction)
    except ValueError as error:
        return DriveFriction(fit=fit, note=str(error))
    # the loop has delay and lag of the settings: the machine keeps what the traces show beyond them
    known = 0.0 if actual else settings.delay + settings.lag
    machine = friction_behind_lag(replace(assumed.machine, delay=max(0.0, fit.delay - known)), settings.lag)
    if Fs is None and np.isfinite(fit.stds["Fs"]):
        Fs = fit.interval("Fs")[1]
    proofs = prove_all((machine,), cascade(settings, output_unit=unit), assumed.friction, delay=settings.delay, Fs=Fs)
    cures: tuple[FrictionCure, ...] = ()
    if Fs is not None and proofs[0].verdict is not FrictionVerdict.PROVED:
        cures = friction_cures(machine, settings, assumed.friction, Fs=Fs, output_unit=unit)
    return DriveFriction(fit=fit, assumed=assumed, proofs=proofs, cures=cures, largest=Fs)


def friction_behind_lag(machine: FrictionPlant, lag: float) -> FrictionPlant:
    """Return a machine behind the lag of the current loop [s], its friction acting behind it too."""
    if not lag:
        return machine
    n = machine.A.shape[0]
    A = np.block([[machine.A, machine.B_force[:, None]], [np.zeros((1, n)), np.array([[-1 / lag]])]])
    return replace(
        machine,
        A=A,
        B_force=np.append(np.zeros(n), 1 / lag),
        B_port=pad_states(machine.B_port.T, n + 1).T,
        C_measured=pad_states(machine.C_measured, n + 1),
        C_port=pad_states(machine.C_port, n + 1),
        description=f"{machine.description}, behind a current loop of {1e3 * lag:g} ms",
    )
