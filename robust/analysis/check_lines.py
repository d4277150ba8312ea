"""The check on measured lines only: a loop whose plant is known as an FRF and nowhere else."""

from __future__ import annotations

from typing import Any

import numpy as np

from nlfrf.shared.arguments import integer, nonnegative
from nlfrf.shared.wording import hertz
from robust.analysis.report import RobustnessReport
from robust.systems.closed_loop import factor_allowed, worst_sensitivity
from robust.systems.lti import constant, response, timebase
from robust.systems.nyquist import unstable_poles, winding
from robust.systems.realisation import state_space
from robust.uncertain.forms import worst_terms
from robust.uncertain.measured import as_seen, on_lines, sampling_time

__all__ = ["check_lines"]


def check_lines(model: Any, K: Any, *, w_P: Any, delay: float, n_unstable: int) -> RobustnessReport:
    """Stability by the winding number of 1 + L, and the curves, all on the lines of the FRF."""
    K = state_space("K", K)
    w_P = None if w_P is None else state_space("w_P", w_P)
    delay, n_unstable = nonnegative("delay", delay), integer("n_unstable", n_unstable, least=0)
    omega, G, form, w, perturbation = on_lines(model)
    if not np.all(omega > 0):
        raise ValueError(f"model must have an FRF on positive frequencies, got a line at {omega.min():g} rad/s")
    if not np.isfinite(G).all():
        where = hertz(omega[np.argmax(~np.isfinite(G))])
        raise ValueError(f"model must have a finite FRF on every line, got {G[~np.isfinite(G)][0]} at {where}")
    dt = timebase(K) if not constant(K) else 0.0
    if dt and omega[-1] * dt >= np.pi:
        raise ValueError(f"K must be sampled fast enough for the lines up to {hertz(omega[-1])}, got dt = {dt:g} s")
    sampled_frf = sampling_time(model)
    if sampled_frf and dt and abs(sampled_frf / dt - 1) > 1e-9:
        raise ValueError(f"K must have the sampling time of the FRF, {sampled_frf:g} s, got {dt:g} s")
    hold = " with zero-order hold" if dt and not sampled_frf else ""
    G = as_seen(model, omega, G, dt, delay)
    k = response(K, omega)
    S, a, b = worst_terms(form, w, G, k)
    encirclements, clear = winding(omega, G, K, dt)
    wanted = n_unstable + unstable_poles(K, dt)
    nominally_stable = clear and encirclements == wanted
    nothing = np.full(omega.size, np.nan)
    has_set = bool(np.isfinite(w).all())
    rs = np.abs(b) if nominally_stable and has_set else nothing
    w_P_size = None if w_P is None else np.abs(response(w_P, omega))
    np_ = w_P_size * np.abs(S) if nominally_stable and w_P_size is not None else nothing
    rp = w_P_size * worst_sensitivity(S, a, b) if nominally_stable and w_P_size is not None and has_set else nothing
    violated = nominally_stable and has_set and rs.max() >= 1
    disk = np.abs(S - 0.5)
    lines_only = "holds on the measured lines only"
    if not nominally_stable:
        verdict = "not robust" if clear else "not certified"
        reason = (
            f"unstable: on the measured lines 1 + L winds {encirclements} times about zero, stability needs {wanted}"
            if clear
            else "the lines are too far apart, or end too early, to count how often 1 + L winds about zero"
        )
    elif violated:
        verdict, reason = "not robust", f"a plant of the set is unstable in this loop: rs = {rs.max():.4g}"
    elif has_set:
        verdict, reason = "not certified", f"rs stays below {rs.max():.4g}, but this {lines_only}: fit a nominal model"
    else:
        verdict, reason = "not certified", f"the FRF comes without uncertainty, and all of this {lines_only}"
    margin_rp, where_rp = np.nan, np.nan
    if np.isfinite(np_).all() and has_set:
        factors = factor_allowed(np_, a, b) if np_.max() < 1 else np.where(np_ < 1, 1.0, 0.0)
        margin_rp, where_rp = float(factors.min()), float(omega[factors.argmin()])
    return RobustnessReport(
        omega=omega,
        S=S,
        T=1 - S,
        rs=rs,
        np_=np_,
        rp=rp,
        nominally_stable=nominally_stable,
        margin_rs=float(1 / rs.max()) if np.isfinite(rs).all() else np.nan,
        margin_rp=margin_rp,
        omega_rs=float(omega[rs.argmax()]) if np.isfinite(rs).all() else np.nan,
        omega_rp=where_rp,
        disk_margin=float(1 / disk.max()) if nominally_stable else np.nan,
        omega_disk=float(omega[disk.argmax()]) if nominally_stable else np.nan,
        perturbation=perturbation,
        verdict=verdict,
        reason=reason,
        advice="Fit a nominal model (fit_nominal, uncertainty) to have the check proved at all frequencies.",
        proved="Nothing; computed on the measured lines only.",
        not_proved="Anything between and outside the measured lines.",
        context=f"{omega.size} lines, {hertz(omega[0])} to {hertz(omega[-1])}{hold}; controller {K.nstates} states",
        G=G,
        K=k,
        radius=np.abs(w),
        form=form,
        w_P=w_P_size,
    )
