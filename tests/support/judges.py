"""The judges of a loop, and what each says of it in the same words."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial

import control
import numpy as np

import robust
from robust import UncertaintyModel, check, worst_case
from robust.analysis import check_structure
from robust.analysis.findings import ReportCurves
from robust.models import Block, interconnection
from tests.support.forms import UNSCALED
from tests.support.loops import Loop, Structure
from tests.support.responses import response


@dataclass(frozen=True)
class Said:
    """What a judge says; None where it says nothing."""

    stable: bool | None = None  # of the nominal loop
    robust: bool | None = None  # proved of the set
    refuted: bool | None = None
    met: bool | None = None  # proved of the demand
    rs: float | None = None  # the margin is at least this factor
    broken: float | None = None  # and at most this one, of these parameters
    worst: dict[str, float] | None = None
    at: float | None = None  # [rad/s]
    S: float | None = None  # the largest |S| over the set is at most this
    lines: int | None = None  # on so many frequencies; 0 if on all
    shown: float | None = None  # and at least this, by a plant
    rp: float | None = None  # the largest |w_P S| over the set
    disk: float | None = None
    why: str = ""
    plant: control.StateSpace | None = None  # that shows it, at a frequency [rad/s]
    omega: float | None = None
    curves: ReportCurves | None = None


def model_of(loop: Loop) -> UncertaintyModel:
    """The set around the plant; its lines are where nothing happens."""
    lines = np.array([0.3, 1.3, 2.6]) * min(1.0, 1 / (loop.G.dt or 1.0))
    return set_around(loop, control.ss(loop.G), lines)


def set_around(loop: Loop, nominal, lines: np.ndarray) -> UncertaintyModel:
    w = control.ss(loop.weight)
    radius = 0.5 * np.abs(response(w, lines))
    return UncertaintyModel(nominal, w, loop.form, lines, radius, perturbation=loop.perturbation)


def of_report(report, *, demand=False) -> Said:
    """A report in these words."""
    margins, curves = report.margins, report.curves
    decided = report.nominally_stable or report.verdict == "not robust"
    numbers = {
        "rs": margins.rs,
        "broken": margins.broken,
        "S": margins.S_worst,
        "disk": margins.disk,
    }
    if demand and curves.S is not None:
        numbers["rp"] = float(np.max(curves.rp))
    return Said(
        stable=report.nominally_stable if decided else None,
        robust=report.proofs.robustly_stable,
        met=report.proofs.robust_performance if demand else None,
        refuted=report.nominally_stable and report.verdict == "not robust",
        why=report.reason,
        at=margins.omega_rs,
        worst=margins.worst,
        lines=margins.S_worst_lines,
        curves=curves if report.nominally_stable else None,
        **{name: None if np.isnan(number) else float(number) for name, number in numbers.items()},
    )


def by_check(loop: Loop, **options) -> Said:
    report = check(model_of(loop), loop.K, w_P=loop.demand, delay=loop.delay, **options)
    return of_report(report, demand=loop.demand is not None)


def by_lines(loop: Loop) -> Said:
    """On the response of the plant, with lines where the loop is worst."""
    top = 1e3 if loop.delay else 1e5
    at = loop.omega[loop.omega < top]
    worst = [at[np.argsort(np.abs(loop.curve(name, at)))[-20:]] for name in ("S", "rs")]
    modes = [abs(p.imag) + abs(p.real) * np.linspace(-5, 5, 41) for p in loop.G.poles()]
    at = np.geomspace(min(1e-3, np.min(worst)), top, 600)
    at = np.unique([*at, *np.ravel(worst), *np.ravel(modes)])
    at = at[at > 0]
    if loop.delay:  # that turns by less than a radian from line to line
        at = np.union1d(at, np.arange(at[0], top, 0.5 / loop.delay))
    model = set_around(loop, control.frd(response(control.ss(loop.G), at), at), at)
    return replace(of_report(check(model, loop.K, delay=loop.delay)), why="")


def by_worst_case(loop: Loop) -> Said:
    try:
        worst = worst_case(model_of(loop), loop.K, delay=loop.delay)
    except ValueError as refused:
        if "K must stabilise the nominal plant" not in str(refused):
            raise
        return Said(stable=False, why=str(refused))
    bound = float(worst.gain.max())
    return Said(
        stable=True,
        S=bound,
        shown=worst.achieved if np.isfinite(bound) else None,
        plant=worst.plant,
        omega=worst.omega_worst,
    )


def by_disk_margin(loop: Loop) -> Said:
    found = robust.margins.disk_margin(control.ss(loop.in_loop) * control.ss(loop.K))
    return Said(stable=found.alpha > 0, disk=found.alpha if found.alpha > 0 else None)


# where Delta of a form reads, and where it acts: u before and p behind the plant, v behind r or d
PLACES = {
    "multiplicative": ("u", "u"),
    "additive": ("u", "y"),
    "inverse-multiplicative": ("p", "y"),
    "inverse-additive": ("p", "u"),
}


def joined(loop: Loop | Structure, *, performance: bool = False):
    """The loop with its uncertainty pulled out, and from a disturbance at the output to v, if
    asked for.
    """
    if isinstance(loop, Structure):
        blocks = {
            name: Block(reads, drives, size, kind=kind)
            for name, (reads, drives, size, kind) in loop.blocks.items()
        }
        return interconnection(loop.systems, blocks)
    reads, drives = PLACES[loop.form]
    dt, K = loop.dt, control.ss(loop.K)

    def wire(one, other):
        return control.ss([], [], [], [[1.0]], dt, inputs=one, outputs=other)

    systems = [
        control.ss(loop.G, inputs="u", outputs="y"),
        wire("y", "p"),
        control.summing_junction(["p", "d"], "v") if performance else wire("p", "v"),
        control.ss(K.A, K.B, -K.C, -K.D, dt, inputs="v", outputs="u"),
    ]
    more = {"inputs": "d", "outputs": "v"} if performance else {}
    blocks = {"set": Block(reads, drives, control.ss(loop.weight))}
    return interconnection(systems, blocks, **more)


def by_structure(loop: Loop | Structure, **options) -> Said:
    return replace(of_report(check_structure(joined(loop), **options)), why="")


def by_mu(loop: Loop | Structure) -> Said:
    system = joined(loop)
    found = robust.mu.bounds(system.loop, system.structure)
    return Said(rs=1 / found.upper.max(), broken=1 / found.lower.max())


def by_worst_gain(loop: Loop) -> Said:
    system = joined(loop, performance=True)
    found = robust.mu.worst_gain(system.N, system.structure)
    return Said(S=found.upper.max(), shown=found.lower.max())


def by_boxes(loop: Structure) -> Said:
    system = joined(loop)
    found = robust.mu.parameter_margin(system.loop, system.structure)
    return Said(rs=found.proved, broken=found.broken)


TWO = {
    "multiplicative": "input",
    "additive": "additive",
    "inverse-multiplicative": "inverse-input",
    "inverse-additive": "inverse-additive",
}


def twice(loop: Loop) -> Said:
    """Two of it side by side: mu of two equal loops under one full block is the number of one."""
    G, K, w = map(control.ss, (loop.G, loop.K, loop.weight))
    one, unit = model_of(loop), control.ss([], [], [], [[1.0]], loop.dt)
    both = UncertaintyModel(
        control.append(G, G),
        form=TWO[loop.form],
        left=(w, w),
        right=(unit, unit),
        omega=one.omega,
        radius=np.array([one.radius] * 2 + [0 * one.radius + 1] * 2),
        perturbation=loop.perturbation,
    )
    report = check(both, control.append(K, K), w_P=loop.demand)
    return of_report(report, demand=loop.demand is not None)


def one_channel(loop) -> bool:
    return isinstance(loop, Loop)


def rational(loop) -> bool:
    """Whether it is a state space as it stands: no separate delay, no aliases."""
    return isinstance(loop, Loop) and loop.kind != "sampled" and not loop.delay


def one_place(loop) -> bool:
    return rational(loop) and loop.form in UNSCALED


def is_measurable(loop) -> bool:
    """Whether an FRF of the plant shows it: no hidden modes, no poles on the axis but an integrator
    of K.
    """
    if not one_channel(loop) or loop.kind != "continuous" or loop.known:
        return False
    if not (loop.stable or loop.delay):
        return False
    damped = [-np.cos(np.angle(p)) > 1e-3 for p in loop.K.poles() if p]
    return loop.G.poles().real.max() < -1e-3 and all(damped) and loop.delay < 1


def has_many_aliases(loop) -> bool:
    """Whether worst_case proves for seconds what aliases add."""
    if loop.kind != "sampled":
        return False
    return "inverse" in loop.form or np.abs(loop.G.poles()).max() > np.pi / loop.dt


def joins(loop) -> bool:
    """Whether its parts are joined without leaving the stable loops."""
    return (isinstance(loop, Structure) or one_place(loop)) and loop.stable and not loop.rounds


def with_parameters_only(loop) -> bool:
    return isinstance(loop, Structure) and {kind for *_, kind in loop.blocks.values()} == {"real"}


@dataclass(frozen=True)
class Judge:
    """A judge, the loops that it can be asked about, and how close it comes to the truth."""

    says: Callable[..., Said]
    hears: Callable[[Loop | Structure], bool]
    loss: float = 1e-5  # what a margin may lie below the truth
    miss: float = 0.0  # what it may lie above: between lines
    every: int = 1  # of so many loops, one in `make test`
    decides: bool = True  # whether each loop is stable
    proves: float = np.inf  # each set and each demand that is met by this share, and refutes others
    rounds: bool = False  # joins G and K in doubles: may lose a loop that is stable by one ulp


def short(loop) -> bool:
    """A loop of one channel without a delay of hundreds of samples, or of many turns."""
    return one_channel(loop) and loop.delay < min(50.0, 100 * (loop.dt or np.inf))


JUDGES = {
    "check": Judge(by_check, one_channel, proves=0.0),
    "check without certificates": Judge(partial(by_check, certify=False), short, every=3),
    "check by an inequality": Judge(partial(by_check, proof="lmi"), rational, every=8),
    "check on lines": Judge(by_lines, is_measurable, miss=1e-3),
    "worst_case": Judge(
        by_worst_case,
        lambda loop: short(loop) and not has_many_aliases(loop),
        loss=5e-3,
        miss=1e-4,
        every=2,
    ),
    "disk_margin": Judge(
        by_disk_margin,
        lambda loop: short(loop) and (loop.kind == "sampled" or rational(loop)),
        loss=1e-3,
        miss=1e-3,
        every=2,
        rounds=True,
    ),
    "check_structure": Judge(
        by_structure, lambda loop: isinstance(loop, Structure), miss=1e-6, proves=1e-6
    ),
    "check_structure without certificates": Judge(
        partial(by_structure, certify=False), one_place, loss=2e-3, miss=1e-3, every=2, rounds=True
    ),
    "mu": Judge(by_mu, joins, loss=5e-3, every=20, decides=False),
    "mu.worst_gain": Judge(
        by_worst_gain,
        lambda loop: joins(loop) and one_place(loop),
        loss=5e-3,
        every=60,
        decides=False,
    ),
    "parameter_margin": Judge(by_boxes, with_parameters_only, loss=0.05, every=6, decides=False),
    "check of two side by side": Judge(
        twice, one_place, loss=2e-3, miss=1e-3, every=12, proves=1e-4, rounds=True
    ),
}
