"""Judge a loop whose plant is known as an FRF: on its lines only, with stability by the winding
number of 1 + L.
"""

from __future__ import annotations

from functools import cached_property

import control
import numpy as np

from nlfrf._base.arguments import format_hertz, require_integer, require_nonnegative
from nlfrf._base.values import value
from robust._base.states import Stability
from robust._base.types import Controller, Weight
from robust.analysis.classical import frequencies_of_crossings
from robust.analysis.curves import Curves, loop_curves, margins_on_lines
from robust.analysis.disk import LoopMargins, disk_margins, winding_of_matrix
from robust.analysis.findings import (
    Effort,
    Findings,
    Given,
    Margins,
    Proofs,
    ReportCurves,
    decide_verdict,
)
from robust.analysis.text import LINES_ADVICE, LINES_NOT_PROVED, LINES_PROVED, explain_lines
from robust.lti.connections import require_shape
from robust.lti.grids import (
    controller_mode_lines,
    interpolate_frf,
    lines_with_modes,
    peak_of,
    refine_peaks,
)
from robust.lti.low_frequency import read_below
from robust.lti.lti import (
    common_sampling_time,
    require_sampling_time,
    response,
    response_by_channel,
    timebase,
)
from robust.lti.realisation import multivariable, repeat_over_channels, state_space
from robust.lti.stability import describe_unresolved, unstable_poles, winding_number
from robust.models.sets.forms import plant_numerator
from robust.models.sets.measured import PlantLines, lines_of_frf


@value
class LoopOnLines:
    """A plant that is known as an FRF only, with a controller around it."""

    plant: PlantLines  # of one channel
    K: control.StateSpace
    w_P: control.StateSpace | None  # performance weight
    delay: float  # computation delay [s] in addition to that of the FRF
    n_unstable: int  # unstable open-loop poles of the plant

    @property
    def omega(self) -> np.ndarray:
        """(W,) lines [rad/s]."""
        return self.plant.omega

    @property
    def G(self) -> np.ndarray:
        """(W,) complex plant."""
        return self.plant.G[0, 0]

    @property
    def dt(self) -> float:
        """Sampling time of the controller [s]; 0 for a continuous one."""
        return timebase(self.K)

    @property
    def given(self) -> Given:
        """Input of the check: class, demand, delay, band and unit."""
        return Given(
            perturbation=self.plant.perturbation,
            demand=self.w_P,
            delay=self.delay,
            dt=self.dt,
            band=self.omega[[0, -1]],
            unit=self.plant.unit,
        )

    def with_hold_and_delay(self, omega: np.ndarray, G: np.ndarray) -> np.ndarray:
        """Return the plant (W,) with hold and delay."""
        return G * self.plant.hold_and_delay_factor(omega, dt=self.dt, delay=self.delay)

    def curves_at(self, at: np.ndarray) -> Curves:
        """Curves at frequencies (W,) from the first line to the last, the FRF interpolated."""
        measured, w, W = (
            interpolate_frf(at, self.omega, part) for part in (self.G, self.plant.w, self.plant.W)
        )
        G = self.with_hold_and_delay(at, measured)
        # the set is around the measured plant: hold and delay belong to the controller
        W = W * measured / G
        if self.w_P is None:
            w_P = None
        else:
            w_P = response(self.w_P, at)
        return loop_curves(self.plant.form, at, G=G, K=response(self.K, at), w=w, w_P=w_P, W=W)

    @cached_property
    def curves(self) -> Curves:
        """Curves on the lines, and between them around the modes of the controller, which is known
        there, with the peaks and the crossings of the loop.
        """
        modes = controller_mode_lines(self.K, (self.omega[0], self.omega[-1]))
        at = np.union1d(self.omega, modes)
        found = self.curves_at(at)
        if not modes.size:
            return found
        names = [
            name
            for name in ("rs", "half_disk", "S_worst", "np_", "rp")
            if np.isfinite(getattr(found, name)).all()
        ]

        def stacked(of: Curves) -> np.ndarray:
            return np.array([getattr(of, name) for name in names])

        peaks = refine_peaks(
            lambda omega: stacked(self.curves_at(omega)),
            at,
            values=stacked(found),
            band=(at[0], at[-1]),
        )
        crossings = frequencies_of_crossings(
            lambda omega: self.curves_at(omega).loop_gain,
            at,
            found.loop_gain,
            roots=np.zeros(0),  # `at` has the modes
        )
        places = np.setdiff1d(np.concatenate([[peak.omega for peak in peaks], crossings]), at)
        # between two neighbouring lines without a mode nothing is looked at
        k = np.searchsorted(at, places)
        places = places[np.isin(at[k], modes) | np.isin(at[k - 1], modes)]
        if places.size:
            return found.merge(self.curves_at(places))
        return found


def assemble_on_lines(
    plant: PlantLines, K: Controller, *, w_P: Weight | None, delay: float, n_unstable: int
) -> LoopOnLines:
    """Assemble an FRF and a controller; refuse parts that do not fit."""
    K = state_space("K", K)
    sampled_frf = plant.dt or None
    _require_usable_frf(plant.omega, plant.G, K, sampled_frf)
    if w_P is not None:
        w_P = state_space("w_P", w_P)
    if w_P is not None and timebase(w_P):  # a continuous weight is allowed for a sampled loop
        require_sampling_time(
            "w_P", w_P, reference="the loop", wanted=sampled_frf or common_sampling_time(K)
        )
    return LoopOnLines(
        plant=plant,
        K=K,
        w_P=w_P,
        delay=require_nonnegative("delay", delay),
        n_unstable=require_integer("n_unstable", n_unstable, least=0),
    )


@value
class MatrixLoopOnLines:
    """An FRF with several channels, without a set, and a controller around it."""

    G: control.FrequencyResponseData  # plant with hold and delay
    K: control.StateSpace
    w_P: control.StateSpace | None  # performance weight
    delay: float  # computation delay [s] in addition to that of the FRF
    n_unstable: int  # unstable open-loop poles of the plant
    n_lines: int  # number of measured lines; G has more at the modes of the controller

    @property
    def wanted(self) -> int:
        """Number of times that det(I + L) has to wind around zero for stability."""
        return self.n_unstable + unstable_poles(self.K, timebase(self.K))

    @property
    def given(self) -> Given:
        """Input of the check: demand, delay and band."""
        band = np.asarray(self.G.omega)[[0, -1]]
        return Given(demand=self.w_P, delay=self.delay, dt=timebase(self.K), band=band)

    @property
    def channels(self) -> LoopMargins:
        return disk_margins(self.G, self.K, n_unstable=self.wanted)


def assemble_matrix_on_lines(
    G: control.FrequencyResponseData,
    K: Controller,
    *,
    w_P: Weight | None,
    delay: float,
    n_unstable: int,
) -> MatrixLoopOnLines:
    """Assemble an FRF with several channels and a controller; refuse parts that do not fit."""
    K, omega = multivariable("K", K), np.asarray(G.omega, dtype=float)
    require_shape(K, G.noutputs, G.ninputs)
    delay = require_nonnegative("delay", delay)
    plant = lines_of_frf(G)
    _require_usable_frf(omega, plant.G, K, plant.dt or None)
    n_lines, (omega, G_at) = omega.size, lines_with_modes(omega, plant.G, K)
    seen = G_at * plant.hold_and_delay_factor(omega, dt=timebase(K), delay=delay)
    return MatrixLoopOnLines(
        G=control.FrequencyResponseData(
            seen, omega, inputs=G.input_labels, outputs=G.output_labels
        ),
        K=K,
        w_P=None if w_P is None else repeat_over_channels("w_P", w_P, G.noutputs),
        delay=delay,
        n_unstable=require_integer("n_unstable", n_unstable, least=0),
        n_lines=n_lines,
    )


def judge_matrix_lines(loop: MatrixLoopOnLines, _: Effort) -> Findings:
    """Return the findings for several channels on the lines of their FRF; none is a proof."""
    omega, one = np.asarray(loop.G.omega), np.eye(loop.G.noutputs)
    L = np.einsum("jkw,klw->wjl", np.asarray(loop.G.frdata), response_by_channel(loop.K, omega))
    # Nyquist for several channels: det(I + L) has to encircle zero as often as L has unstable poles
    turns, clear = winding_of_matrix(omega, one + L, loop.wanted)
    nominal, nothing = _stability_on_lines(turns, clear, loop.wanted), np.full(omega.size, np.nan)
    if nominal is Stability.UNDECIDED:
        reason = describe_unresolved(
            omega, np.linalg.det(one + L), np.linalg.norm(L, 2, axis=(1, 2))
        )
    else:
        reason = explain_lines(nominal, turns, wanted=loop.wanted, peak=np.nan, has_set=False)
    margins, np_ = Margins(), nothing
    if nominal is Stability.STABLE:
        S = np.linalg.inv(one + L)
        peak = peak_of(omega, np.linalg.norm(S, 2, axis=(1, 2)))
        margins = Margins(peak_S=peak)
        reason += f". The largest singular value of S on {loop.n_lines} lines is {peak}"
        if loop.w_P is not None:
            weighted = np.moveaxis(response_by_channel(loop.w_P, omega), 2, 0) @ S
            np_ = np.linalg.norm(weighted, 2, axis=(1, 2))
            reason += f", that of w_P S {peak_of(omega, np_)}"
    return Findings(
        verdict=decide_verdict(nominal, Proofs(), statistical=False),
        nominally_stable=nominal is Stability.STABLE,
        curves=ReportCurves(omega=omega, rs=nothing, np_=np_, rp=nothing),
        margins=margins,
        reason=reason,
        advice=LINES_ADVICE,
        proved=LINES_PROVED,
        not_proved=LINES_NOT_PROVED,
        context=(
            f"{loop.n_lines} lines, {format_hertz(omega[0])} to {format_hertz(omega[-1])}; controller"
            f" {loop.K.nstates} states"
        ),
    )


def _require_usable_frf(
    omega: np.ndarray, G: np.ndarray, K: control.StateSpace, sampled_frf: float | None
) -> None:
    """Require a finite FRF, and a controller of the same and sufficient sampling rate."""
    dt = timebase(K)
    if not np.all(omega > 0):
        raise ValueError(
            f"model must have an FRF on positive frequencies, got a line at {omega.min():g} rad/s"
        )
    if not np.isfinite(G).all():
        where = format_hertz(omega[np.argmax(~np.isfinite(G).reshape(-1, omega.size).all(axis=0))])
        raise ValueError(
            f"model must have a finite FRF on every line, got {G[~np.isfinite(G)][0]} at {where}"
        )
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(
            f"K must have its Nyquist frequency above the last line, {format_hertz(omega[-1])},"
            f" got dt = {dt:g} s"
        )
    require_sampling_time("K", K, reference="the FRF", wanted=sampled_frf)


def _stability_on_lines(turns: int, clear: bool, wanted: int) -> Stability:
    """Return the stability that a winding number shows."""
    if not clear:
        return Stability.UNDECIDED
    if turns == wanted:
        return Stability.STABLE
    return Stability.UNSTABLE


def judge_lines(loop: LoopOnLines, effort: Effort) -> Findings:
    """Return the findings for one channel on the lines of its FRF; none of them is a proof."""
    plant, omega, K, dt = loop.plant, loop.omega, loop.K, loop.dt
    G = loop.with_hold_and_delay(omega, loop.G)
    radius = np.abs(
        plant_numerator(plant.form, np.nan_to_num(plant.w), G=G, W=plant.W * loop.G / G)
    )
    readings = read_below(omega, G, radius, n_unstable=loop.n_unstable)
    encirclements, clear = winding_number(omega, G, K=K, dt=dt, readings=readings)
    wanted = loop.n_unstable + unstable_poles(K, dt)
    nominal = _stability_on_lines(encirclements, clear, wanted)
    has_set = bool(np.isfinite(loop.curves.w).all())
    stable = nominal is Stability.STABLE
    if stable:
        margins = margins_on_lines(loop.curves)
    else:
        margins = Margins()
    proofs = Proofs(violated=has_set and margins.largest_rs >= 1)
    hold = dt and not plant.dt
    if nominal is Stability.UNDECIDED:
        L = G * response(K, omega)
        reason = describe_unresolved(omega, 1 + L, np.abs(L))
    else:
        reason = explain_lines(
            nominal, encirclements, wanted=wanted, peak=margins.largest_rs, has_set=has_set
        )
    return Findings(
        verdict=decide_verdict(nominal, proofs, statistical=False),
        nominally_stable=stable,
        curves=loop.curves.shown(stable),
        margins=margins,
        proofs=proofs,
        form=plant.form,
        reason=reason,
        advice=LINES_ADVICE,
        proved=LINES_PROVED,
        not_proved=LINES_NOT_PROVED,
        context=(
            f"{omega.size} lines, {format_hertz(omega[0])} to {format_hertz(omega[-1])}"
            f"{' with zero-order hold' if hold else ''}; controller {K.nstates} states"
        ),
    )
