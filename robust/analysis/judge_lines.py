"""Judge a loop whose plant is known as an FRF: on its lines only, with stability by the winding number of 1 + L."""

from __future__ import annotations

from functools import cached_property

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_integer, require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Stability
from robust._base.types import Controller, Weight
from robust.analysis.curves import Curves, loop_curves, margins_on_lines
from robust.analysis.findings import Effort, Findings, Given, Margins, Proofs, decide_verdict
from robust.analysis.text import LINES_ADVICE, LINES_NOT_PROVED, LINES_PROVED, explain_lines
from robust.lti.grids import controller_mode_lines, interpolate_frf
from robust.lti.low_frequency import read_below
from robust.lti.lti import common_sampling_time, require_sampling_time, response, timebase
from robust.lti.realisation import state_space
from robust.lti.stability import unstable_poles, winding_number
from robust.models.sets.forms import plant_numerator
from robust.models.sets.measured import FrfSource, frf_sampling_time, hold_and_delay_factor, origin_of, parts_on_lines


@value
class LoopOnLines:
    """A plant that is known as an FRF and nowhere else, with a controller around it.

    Fields
    ------
    source : Bla, FrequencyResponseData or UncertaintyModel
        Where the plant is from.
    K : control.StateSpace
        Controller.
    w_P : control.StateSpace or None
        Performance weight.
    delay : float
        Computation delay [s] on top of what the FRF contains.
    n_unstable : int
        Unstable open-loop poles of the plant.
    omega : (W,) ndarray
        Lines [rad/s].
    G, w, W : (W,) complex ndarray
        Plant, weight (nan: no set), and what the plant is scaled by where the form depends on its units.
    form, perturbation : str
        Form and class of the set.
    """

    source: FrfSource
    K: control.StateSpace
    w_P: control.StateSpace | None
    delay: float
    n_unstable: int
    omega: np.ndarray
    G: np.ndarray
    w: np.ndarray
    W: np.ndarray
    form: str
    perturbation: str

    @property
    def dt(self) -> float:
        """Return the sampling time of the controller [s], 0 for a continuous one."""
        return timebase(self.K)

    @property
    def given(self) -> Given:
        """Return what model and controller fix: class, demand, delay, band and unit."""
        unit, band = getattr(origin_of(self.source), "unit", ""), self.omega[[0, -1]]
        return Given(perturbation=self.perturbation, demand=self.w_P, delay=self.delay, band=band, unit=unit)

    def with_hold_and_delay(self, omega: np.ndarray, G: np.ndarray) -> np.ndarray:
        """Return the plant (W,) as the controller sees it."""
        return G * hold_and_delay_factor(self.source, omega, dt=self.dt, delay=self.delay)

    @cached_property
    def curves(self) -> Curves:
        """Return the curves on the lines, and between them where the controller, which is known there, has modes."""
        at = np.union1d(self.omega, controller_mode_lines(self.K, (self.omega[0], self.omega[-1])))
        measured, w, W = (interpolate_frf(at, self.omega, part) for part in (self.G, self.w, self.W))
        G = self.with_hold_and_delay(at, measured)
        W = W * measured / G  # the set is one about what was measured: hold and delay stand with the controller
        w_P = None if self.w_P is None else response(self.w_P, at)
        return loop_curves(self.form, at, G=G, K=response(self.K, at), w=w, w_P=w_P, W=W)


def assemble_on_lines(
    model: FrfSource, K: Controller, *, w_P: Weight | None, delay: float, n_unstable: int
) -> LoopOnLines:
    """Put an FRF and a controller together, or refuse what does not fit."""
    K = state_space("K", K)
    delay, n_unstable = require_nonnegative("delay", delay), require_integer("n_unstable", n_unstable, least=0)
    omega, G, form, w, perturbation, W = parts_on_lines(model)
    sampled_frf = frf_sampling_time(model) or None
    require_usable_frf(omega, G, timebase(K))
    require_sampling_time("K", K, reference="the FRF", wanted=sampled_frf)
    w_P = None if w_P is None else state_space("w_P", w_P)
    if w_P is not None and timebase(w_P):  # a continuous one may stand over a sampled loop
        require_sampling_time("w_P", w_P, reference="the loop", wanted=sampled_frf or common_sampling_time(K))
    return LoopOnLines(
        source=model,
        K=K,
        w_P=w_P,
        delay=delay,
        n_unstable=n_unstable,
        omega=omega,
        G=G,
        w=w,
        W=W,
        form=form,
        perturbation=perturbation,
    )


def require_usable_frf(omega: np.ndarray, G: np.ndarray, dt: float) -> None:
    """Refuse an FRF that has no finite value somewhere, or lines that the controller is too slow for."""
    if not np.all(omega > 0):
        raise ValueError(f"model must have an FRF on positive frequencies, got a line at {omega.min():g} rad/s")
    if not np.isfinite(G).all():
        where = format_hertz(omega[np.argmax(~np.isfinite(G))])
        raise ValueError(f"model must have a finite FRF on every line, got {G[~np.isfinite(G)][0]} at {where}")
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(
            f"K must be sampled fast enough for the lines up to {format_hertz(omega[-1])}, got dt = {dt:g} s"
        )


def judge_lines(loop: LoopOnLines, effort: Effort) -> Findings:
    """Return what is found of a loop on the lines of its FRF; nothing of it is a proof, whatever the effort."""
    omega, K, dt = loop.omega, loop.K, loop.dt
    G = loop.with_hold_and_delay(omega, loop.G)
    radius = np.abs(plant_numerator(loop.form, np.nan_to_num(loop.w), G=G, W=loop.W * loop.G / G))
    readings = read_below(omega, G, radius, n_unstable=loop.n_unstable)
    encirclements, clear = winding_number(omega, G, K=K, dt=dt, readings=readings)
    wanted = loop.n_unstable + unstable_poles(K, dt)
    met = Stability.STABLE if encirclements == wanted else Stability.UNSTABLE
    nominal, has_set = met if clear else Stability.UNDECIDED, bool(np.isfinite(loop.curves.w).all())
    stable = nominal is Stability.STABLE
    margins = margins_on_lines(loop.curves) if stable else Margins()
    proofs, hold = Proofs(violated=has_set and margins.largest_rs >= 1), dt and not frf_sampling_time(loop.source)
    return Findings(
        verdict=decide_verdict(nominal, proofs, statistical=False),
        nominally_stable=stable,
        curves=loop.curves.shown(stable),
        margins=margins,
        proofs=proofs,
        form=loop.form,
        reason=explain_lines(nominal, encirclements, wanted=wanted, peak=margins.largest_rs, has_set=has_set),
        advice=LINES_ADVICE,
        proved=LINES_PROVED,
        not_proved=LINES_NOT_PROVED,
        context=f"{omega.size} lines, {format_hertz(omega[0])} to {format_hertz(omega[-1])}"
        f"{' with zero-order hold' if hold else ''}; controller {K.nstates} states",
    )
