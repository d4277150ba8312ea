"""The check on measured lines only: a loop whose plant is known as an FRF and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.arguments import integer, nonnegative
from nlfrf.shared.wording import hertz
from robust.analysis.curves import Peaks, loop_curves, peaks_on_lines
from robust.analysis.report import RobustnessReport, fill_report
from robust.analysis.verdict import on_lines_only, probability_of
from robust.systems.grids import beside_modes, interpolated
from robust.systems.lti import clock_of, refuse_other_clock, response, timebase
from robust.systems.nyquist import unstable_poles, winding
from robust.systems.realisation import state_space
from robust.uncertain.measured import as_seen, on_lines, sampling_time

__all__ = ["check_lines"]


def check_lines(model: Any, K: Any, *, w_P: Any, delay: float, n_unstable: int) -> RobustnessReport:
    """Stability by the winding number of 1 + L, and the curves, all on the lines of the FRF.

    And on what lies between them where the controller, which is known there, has modes.
    """
    K = state_space("K", K)
    delay, n_unstable = nonnegative("delay", delay), integer("n_unstable", n_unstable, least=0)
    omega, G, form, w, perturbation, W = on_lines(model)
    dt, sampled_frf = timebase(K), sampling_time(model) or None
    refuse_misfit(omega, G, dt)
    refuse_other_clock("K", K, "the FRF", sampled_frf)
    w_P = None if w_P is None else state_space("w_P", w_P)
    if w_P is not None and timebase(w_P):  # a continuous one may stand over a sampled loop
        refuse_other_clock("w_P", w_P, "the loop", sampled_frf or clock_of(K))
    encirclements, clear = winding(omega, as_seen(model, omega, G, dt, delay), K, dt)
    at, lines = np.union1d(omega, beside_modes(K, (omega[0], omega[-1]))), omega
    measured, w, W = (interpolated(at, lines, part) for part in (G, w, W))
    G = as_seen(model, at, measured, dt, delay)
    W = W * measured / G  # the set is one about what was measured: hold and delay stand with the controller
    wanted = n_unstable + unstable_poles(K, dt)
    stable, has_set = clear and encirclements == wanted, bool(np.isfinite(w).all())
    curves = loop_curves(form, at, G, response(K, at), w, None if w_P is None else response(w_P, at), W)
    peaks = peaks_on_lines(curves) if stable else Peaks()
    hold = " with zero-order hold" if dt and not sampling_time(model) else ""
    words = on_lines_only(
        omega,
        peaks.rs[0],
        encirclements=encirclements,
        wanted=wanted,
        clear=clear,
        has_set=has_set,
        loop=f"{hold}; controller {K.nstates} states",
    )
    of = {"demand": w_P, "delay": delay, "band": omega[[0, -1]], "unit": getattr(model, "unit", "")}
    of["probability"] = probability_of(model)
    return fill_report(curves, peaks, words, perturbation=perturbation, stable=stable, **of)


def refuse_misfit(omega: np.ndarray, G: np.ndarray, dt: float) -> None:
    """Refuse an FRF that has no finite value somewhere, or lines that the controller is too slow for."""
    if not np.all(omega > 0):
        raise ValueError(f"model must have an FRF on positive frequencies, got a line at {omega.min():g} rad/s")
    if not np.isfinite(G).all():
        where = hertz(omega[np.argmax(~np.isfinite(G))])
        raise ValueError(f"model must have a finite FRF on every line, got {G[~np.isfinite(G)][0]} at {where}")
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(f"K must be sampled fast enough for the lines up to {hertz(omega[-1])}, got dt = {dt:g} s")
