"""Gains of a drive checked against traces of its axis, on one page: set, worst case, friction, step.

    u* -->[delay]-->[1/(lag s + 1)]-->[ machine ]--> y        delay and lag are those of the settings

The machine is what a trace leaves once delay and lag are taken off, where its input is the set point of the current.
"""

from __future__ import annotations

import warnings
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import format_hertz, ratio_unit, require_kind
from nlfrf._base.values import value
from robust._base.states import FrictionVerdict
from robust._base.warnings import DesignWarning
from robust.analysis.loop import assemble_loop
from robust.analysis.performance import StepResponse, measure_step, simulate_step
from robust.analysis.report import RobustnessReport
from robust.analysis.robustness import check
from robust.analysis.worst_plant import WorstCase, worst_case
from robust.friction.levels import FrictionClass
from robust.friction.plant import FrictionPlant, friction_plant
from robust.friction.prove import FrictionProof
from robust.friction.reading import friction_class
from robust.io.certificates import highest_level, prove_all
from robust.lti.connections import in_series
from robust.models.fit.nominal import NominalFit
from robust.models.fit.orders import scan_orders
from robust.models.sets.build import uncertainty
from robust.models.sets.model import UncertaintyModel
from robust.synthesis.drive.cascade import cascade, with_set_point
from robust.synthesis.drive.cures import FrictionCure, friction_cures
from robust.synthesis.drive.settings import DriveSettings
from robust.synthesis.drive.units import POSITIONS

__all__ = ["DriveCheck", "check_drive", "read_trace"]

#: Poles of a machine that are tried, two more than zeros: one mass, one whose friction slips, two masses, ...
ORDERS = range(2, 6)
#: An unstable pole above this share of the last line is a lead, and no machine that falls over.
LEAD = 0.3
#: Orders of the weight that are tried.
WEIGHT_ORDERS = (4, 6, 8)


@value
class DriveCheck:
    """What the traces of an axis say of the gains of its drive.

    Fields
    ------
    settings : DriveSettings
        The gains, for a position in m or rad.
    unit : str
        Unit of the force that they ask for: "N", "Nm", or "A" without a torque constant.
    traces : tuple of str
        What each trace holds.
    base : str
        Which of them the set is made of.
    report : RobustnessReport
        Margins, set, verdict and proof.
    worst : WorstCase or None
        The worst plant of the set; none where the nominal loop is unstable.
    step : StepResponse or None
        A step of the position set point; none where the nominal loop is unstable.
    friction : FrictionClass or None
        What the levels say of the friction.
    proofs : tuple of FrictionProof
        The verdicts with it, the least proved first.
    friction_note : str
        Why there is no friction verdict.
    cures : tuple of FrictionCure
        What a change of the drive does to a verdict that is not proved, where the friction force is known.
    actual : bool
        Whether the input of the traces is the actual current, so that nothing in them shows delay and lag.
    """

    settings: DriveSettings
    unit: str
    traces: tuple[str, ...]
    base: str
    report: RobustnessReport
    worst: WorstCase | None
    step: StepResponse | None
    friction: FrictionClass | None
    proofs: tuple[FrictionProof, ...]
    friction_note: str
    actual: bool
    cures: tuple[FrictionCure, ...] = ()

    @property
    def is_exact(self) -> bool:
        """Whether the controller that was checked is the drive itself, not its mean over a slower position loop."""
        return self.settings.position_every == 1

    @property
    def proved(self) -> bool:
        """Whether the loop is stable with the whole set, and comes to rest with the friction where it was judged."""
        at_rest = all(proof.verdict is FrictionVerdict.PROVED for proof in self.proofs)
        return self.report.robustly_stable and at_rest and self.is_exact

    @property
    def assumption(self) -> str:
        """What is taken from the settings and not from the traces."""
        timing = f"delay {1e3 * self.settings.delay:g} ms and lag {1e3 * self.settings.lag:g} ms"
        if self.actual:
            return f"assumed: {timing} of the current loop, which a trace of the actual current does not show"
        return f"{timing} of the current loop taken off; what is wrong with them counts as misfit"

    def __str__(self) -> str:
        position = self.settings.base_unit
        linear = str(self.report)
        if not self.is_exact:
            linear += (
                f"\nan approximation: the position loop runs once in {self.settings.position_every} periods, and this "
                "is its mean over the phase; nothing is proved of the drive itself"
            )
        parts = {
            "drive": str(self.settings),
            "traces": "\n".join([*self.traces, self.assumption]),
            f"linear loop, from {self.base} ({ratio_unit(position, self.unit)})": linear,
        }
        if self.worst is not None:
            k = int(np.argmax(self.worst.gain))
            where = format_hertz(self.worst.omega[k])
            worst = f"|S| at most {self.worst.gain[k]:.3g} over the set, at {where}"
            parts["worst case"] = (
                worst if self.worst.stable else f"a plant of the set makes the loop unstable, at {where}"
            )
        parts["friction"] = f"not judged: {self.friction_note}"
        if self.proofs:
            parts["friction"] = "\n".join([str(self.friction), *map(str, self.proofs), *map(str, self.cures)])
        if self.step is not None:
            parts["step of the position set point"] = f"of 1 {position} {self.step}"
        return "\n\n".join(f"{title}\n{content}" for title, content in parts.items())


def read_trace(path: Path, settings: DriveSettings, *, actual: bool = False, **load: Any) -> nlfrf.Record:
    """Read a trace of a drive in the units of its velocity loop: position in m or rad, force in N or Nm, or current.

    Parameters
    ----------
    path : Path
        A measurement file as `nlfrf.load_record` reads it.
    settings : DriveSettings
        Of the drive; a position without a unit is in its `position_unit`, an input without one in its output unit.
    actual : bool
        Whether the input is the actual current or force, measured behind the hold; a set point is held.
    load : as for `nlfrf.load_record`.

    Raises
    ------
    ValueError
        Units that are none of a drive, a trace that is not sampled as the drive is.
    """
    record = nlfrf.load_record(path, **load)
    if abs(record.fs / settings.fs - 1) > 1e-6:
        raise ValueError(
            f"trace must be sampled as the velocity loop is, at {settings.fs:g} Hz, got {path.name} at {record.fs:g} "
            "Hz: trace every period, as what lies between decimated samples is lost"
        )
    base, force = settings.base_unit, settings.force_unit
    kind, factor = POSITIONS.get(record.y_unit, ("", 1.0))
    if record.y_unit in ("", settings.position_unit):
        factor = settings.unit_factor
    elif kind != base:
        raise ValueError(
            f"trace must have the position in {settings.position_unit} or a multiple of {base}, got {path.name} in "
            f"{record.y_unit}"
        )
    given = record.u_unit or settings.output_unit
    if given not in ("A", force):
        raise ValueError(f"trace must have an input in A or {force}, got {path.name} in {given}")
    unit = "A" if np.isnan(settings.torque_constant) and "A" in (given, settings.output_unit) else force
    scale = 1.0 if given == unit else settings.torque_constant
    if np.isnan(scale):
        raise ValueError(
            f"torque_constant must be given [{force}/A] between a gain in {settings.kp_unit} and a trace in {given}, "
            "got none"
        )
    return replace(
        record,
        u=record.u * scale,
        y=record.y * factor,
        input_units=(unit,),
        output_units=(base,),
        hold=("band-limited" if actual else "zoh") if record.hold == "unknown" else record.hold,
    )


def check_drive(
    records: Sequence[nlfrf.Record],
    settings: DriveSettings,
    *,
    names: Sequence[str] = (),
    actual: bool = False,
    stiction: float = 1.5,
    Fs: float | None = None,
) -> DriveCheck:
    """Check the gains of a drive against traces of its axis, one a level.

    Parameters
    ----------
    records : sequence of nlfrf.Record
        From `read_trace`: set point of force or current in, position out.
    settings : DriveSettings
        Gains, filters, sampling and units.
    names : sequence of str
        Of the traces.
    actual : bool
        Whether the input is the actual current or force, so that delay and lag are not in the traces.
    stiction : float
        Largest over smallest force of a slider, which no trace shows.
    Fs : float, optional
        Largest friction force [N] or [Nm]: gives a bound of the error where the axis may not come to rest, and what
        changes it.

    Raises
    ------
    ValueError
        Two encoders; traces that make no model.
    """
    require_kind("settings", settings, DriveSettings)
    if settings.encoder == "both":
        raise ValueError('encoder must be "motor" or "load" for a check of one position, got "both"')
    unit, base = records[0].u_unit, settings.base_unit
    settings = replace(settings, position_unit=base, load_unit=base, unit_factor=1.0, load_factor=1.0)
    K = cascade(settings, output_unit=unit)
    blas = [machine_frf(nlfrf.identify(record), settings, actual=actual) for record in records]
    names = list(names) or [f"trace {k + 1}" for k in range(len(blas))]
    chosen = highest_level(blas)
    nominal = scan_orders(blas[chosen], n_poles=ORDERS, relative_degree=2, delay=0.0, stable=False).fit
    require_no_lead(nominal.G, blas[chosen], settings, actual=actual)
    machine = set_around(blas[chosen], nominal)
    model = replace(machine, nominal=behind_lag(machine.nominal, settings.lag))
    report = check(model, K, delay=settings.delay)
    found, proofs, cures, note = judge_friction(blas, settings, unit=unit, stiction=stiction, Fs=Fs)
    return DriveCheck(
        settings=settings,
        unit=unit,
        traces=tuple(map(describe_trace, names, records, blas)),
        base=names[chosen],
        report=report,
        worst=worst_case(model, K, delay=settings.delay) if report.nominally_stable else None,
        step=step_of(model, K, settings=settings, unit=unit) if report.nominally_stable else None,
        friction=found,
        proofs=proofs,
        friction_note=note,
        cures=cures,
        actual=actual,
    )


def machine_frf(bla: nlfrf.Bla, settings: DriveSettings, *, actual: bool) -> nlfrf.Bla:
    """The BLA of the machine alone, without delay and lag of the current loop where they are in the trace."""
    s = 1j * bla.omega
    return bla if actual else bla.times(np.exp(s * settings.delay) * (1 + s * settings.lag))


def require_no_lead(machine: control.StateSpace, bla: nlfrf.Bla, settings: DriveSettings, *, actual: bool) -> None:
    """Refuse a delay that is longer than in the traces: what is left then leads, and is fitted by unstable poles."""
    fast = machine.poles()[machine.poles().real > 0]
    fast = fast[np.abs(fast) > LEAD * bla.omega[-1]]
    if fast.size and not actual:
        raise ValueError(
            f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of "
            f"{1e3 * settings.lag:g} ms: without them the machine leads, as with an unstable pole at "
            f"{format_hertz(float(np.abs(fast).max()))}"
        )


def set_around(bla: nlfrf.Bla, nominal: control.StateSpace | NominalFit) -> UncertaintyModel:
    """The set of plants around a nominal, its weight of the lowest order that is not far above the radius."""
    for order in WEIGHT_ORDERS[:-1]:
        with warnings.catch_warnings(), suppress(ValueError, DesignWarning):
            warnings.simplefilter("error", DesignWarning)
            return uncertainty(bla, nominal, order=order)
    return uncertainty(bla, nominal, order=WEIGHT_ORDERS[-1])


def behind_lag(machine: control.StateSpace, lag: float) -> control.StateSpace:
    """A machine behind the lag of the current loop [s]."""
    if not lag:
        return machine
    return in_series(control.StateSpace([[-1 / lag]], [[1 / lag]], [[1.0]], [[0.0]], 0), machine, dt=0)


def friction_behind_lag(machine: FrictionPlant, lag: float) -> FrictionPlant:
    """The same of a machine with friction, which acts behind the lag."""
    if not lag:
        return machine
    n = machine.A.shape[0]
    A = np.block([[machine.A, machine.B_force[:, None]], [np.zeros((1, n)), np.array([[-1 / lag]])]])
    return replace(
        machine,
        A=A,
        B_force=np.append(np.zeros(n), 1 / lag),
        B_port=np.append(machine.B_port, 0.0),
        C_measured=np.append(machine.C_measured, 0.0),
        C_port=np.append(machine.C_port, 0.0),
        description=f"{machine.description}, behind a current loop of {1e3 * lag:g} ms",
    )


def judge_friction(
    blas: list[nlfrf.Bla], settings: DriveSettings, *, unit: str, stiction: float, Fs: float | None
) -> tuple[FrictionClass | None, tuple[FrictionProof, ...], tuple[FrictionCure, ...], str]:
    """What the levels say of the friction, the proofs with it and what changes them, or why there are none."""
    if len(blas) < 3:
        return None, (), (), f"it takes traces at three levels or more, from sticking to sliding, got {len(blas)}"
    if unit == "A":
        return None, (), (), "it takes a force, and the gains have no torque_constant"
    try:
        found = friction_class(blas, stiction=stiction)
    except ValueError as error:
        return None, (), (), str(error)
    base = settings.base_unit
    friction = replace(found.friction, position_unit=base)
    # without a nominal the levels give a single mass
    mass = 1 / float(found.machine.velocity @ found.machine.B_port)
    plain = friction_plant(mass, found.stiffness_low, position_unit=base)
    machine = friction_behind_lag(plain, settings.lag)
    K = cascade(settings, output_unit=unit)
    cures: tuple[FrictionCure, ...] = ()
    proofs = prove_all((machine,), K, friction, delay=settings.delay, Fs=Fs)
    if Fs is not None and proofs[0].verdict is not FrictionVerdict.PROVED:
        cures = friction_cures(machine, settings, friction, Fs=Fs, output_unit=unit)
    return found, proofs, cures, ""


def step_of(model: UncertaintyModel, K: control.StateSpace, *, settings: DriveSettings, unit: str) -> StepResponse:
    """The step of the position set point, through the loops of the drive."""
    G, drive = assemble_loop(model, K, w_P=None, delay=settings.delay).G, with_set_point(settings, output_unit=unit)
    A = np.block([[G.A, G.B @ drive.C], [drive.B[:, 1:] @ G.C, drive.A]])
    direct = np.zeros_like(A)
    direct[: G.nstates, : G.nstates] = G.B @ drive.D[:, 1:] @ G.C
    B = np.vstack([G.B @ drive.D[:, :1], drive.B[:, :1]])
    C = np.hstack([G.C, np.zeros((1, drive.nstates))])
    closed = control.StateSpace(A + direct, B, C, 0, K.dt, remove_useless_states=False)
    t, y = simulate_step(closed)
    final = float(np.real(closed.dcgain()))
    return measure_step(t, y[0], u=np.full(t.size, np.nan), final=final, cut=True)


def describe_trace(name: str, record: nlfrf.Record, bla: nlfrf.Bla) -> str:
    """Level and band of a trace, a row."""
    force, motion = np.sqrt(np.mean(record.u**2)), np.std(record.y)
    return (
        f"{name}: {force:.3g} {record.u_unit} rms, {motion:.3g} {record.y_unit} rms, {bla.f.size} lines from "
        f"{bla.f[0]:.4g} to {bla.f[-1]:.4g} Hz"
    )
