"""Model of the machine from a trace, after delay and lag of the drive are removed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import control
import numpy as np

import nlfrf
from nlfrf._base.arguments import (
    format_hertz,
)
from nlfrf.rig import Drive
from robust.analysis.classical import classical_margins
from robust.friction.reading.balance import motion_of_record
from robust.friction.reading.in_motion import fit_linear
from robust.friction.reading.numbers import HALF_WIDTH
from robust.lti.connections import in_series
from robust.lti.lti import response
from robust.models.fit.nominal_fit import NominalFit
from robust.models.sets.orders import NEAR_BEST, UNDAMPED, doubtful_roots, scan_orders
from robust.servo.gains.p_pi import cascade

#: Numbers of poles to try, two more than zeros: one mass, one mass with slipping friction, two
#: masses, ...
_ORDERS = range(2, 6)


#: Unstable poles above this fraction of the band are fitted to an over-compensated delay; the
#: machine is not unstable.
_LEAD = 0.3


#: Largest relative change of G by a pole and a zero that count as cancelling.
_CANCELLED = 0.05


#: Largest error of a delay read from a trace, in periods of the drive: on 180 axes it was less.
_DELAY_ERROR = 0.05


#: Gain of log-likelihood by an unstable pole that scatter alone exceeds once in a hundred times.
_SURE = 3.32


#: Largest rise of the phase of a machine over the band, in turns. An antiresonance gives half a
#: turn; a removed delay that is too long gives any number.
_MOST_RISE = 0.75


#: Mean of unit phasors above which F lines agree on a lead; that of random phases is 0 +- 1/sqrt(2
#: F).
_AGREE = 0.5


def fit_machine(
    bla: nlfrf.Bla, timings: Sequence[Drive], *, actual: bool
) -> tuple[nlfrf.Bla, NominalFit, Drive]:
    """Return the BLA of the machine, its fit, and the settings with a delay and lag that the trace
    does not refute.

    If too much delay is removed, the rest leads: its phase rises. If the best fit leads with all
    timings (a pole and a zero above the band may nearly cancel), the best fit without lead is used,
    and the radius of the set contains its misfit.

    timings : settings with the delays to try, in this order.
    """
    not_leading, reason = [], ""
    for timing in timings:
        s, machine = 1j * bla.omega, bla
        if not actual:  # the trace contains delay and lag of the current loop
            machine = bla.times(
                np.exp(s * timing.delay) * (1 + s * timing.lag), output_unit=bla.output_units
            )
        if actual:
            late = ""
        else:
            late = _reason_of_late_settings(machine, timing)
        if late:
            reason = reason or late
            continue
        best, others = _fit_orders(machine, cascade(timing, output_unit=bla.input_units[0]))
        if actual:
            leads = ""
        else:
            leads = _reason_of_lead(best.G, machine, timing)
        if not leads:
            return machine, best, timing
        reason = reason or leads
        not_leading += [
            (one.cost, machine, one, timing)
            for one in others
            if not _reason_of_lead(one.G, machine, timing)
        ]
    if not not_leading:
        raise ValueError(reason)
    return min(not_leading, key=lambda one: one[0])[1:]


def timings_of(record: nlfrf.Record, settings: Drive, masses: int, *, slides: bool) -> list[Drive]:
    """Return the settings as given, and with delay and lag read from a trace, the likelier first.

    The lag of the settings is kept, except if the trace shows more delay in all, or less than this
    lag. slides : True if the axis is known to slide in the trace.
    """
    numbers, stds = fit_linear(motion_of_record(record, 1), masses)
    late, std = numbers["delay"], stds["delay"]
    if not (numbers["mass"] > 0 and 0 < late < np.inf and np.isfinite(std)):
        return [settings]
    later = late - settings.delay - settings.lag > max(HALF_WIDTH * std, _DELAY_ERROR * settings.dt)
    lag = min(max(settings.lag, numbers["lag"] if later else 0.0), late)
    traced = replace(settings, lag=lag, delay_periods=(late - lag) * settings.fs)
    # the phase of a load looks like delay: 4 of 59 axes showed up to 0.8 periods more than they had
    if slides and later and masses == 1:
        return [traced, settings]
    return [settings, traced]


def _reason_of_lead(machine: control.StateSpace, bla: nlfrf.Bla, settings: Drive) -> str:
    """Return the reason why a delay is too long for the traces: fast unstable poles; empty if there
    are none.
    """
    fast = machine.poles()[machine.poles().real > 0]
    fast = fast[np.abs(fast) > _LEAD * bla.omega[-1]]
    if not fast.size:
        return ""
    return (
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of"
        f" {1e3 * settings.lag:g} ms: with both removed the machine would lead its force, as with"
        f" an unstable pole at {format_hertz(float(np.abs(fast).max()))}"
    )


def _fit_orders(
    machine: nlfrf.Bla, K: control.StateSpace
) -> tuple[NominalFit, tuple[NominalFit, ...]]:
    """Return the fit of a machine, and those of every order: stable, unless scatter does not
    explain an unstable pole.

    If scatter explains no fit, the misfit is weighted away from the crossover of the loop with
    these gains.

    A free axis has a pole at zero, and scatter decides on which side of the axis it is fitted. The
    loop may be stable with one and not with the other, so a stable fit is preferred. An unstable
    pole by friction that falls with speed is kept. An unstable pole that a zero cancels is fitted
    to a single line, and is rejected however likely it is.
    """
    free, held = (
        scan_orders(machine, n_poles=_ORDERS, relative_degree=2, delay=0.0, stable=stable)
        for stable in (False, True)
    )
    kept = [k for k, fit in enumerate(free.fits) if not _cancels_unstable_pole(fit.G)]
    unstable = bool(kept) and free.criterion[kept].min() + _SURE < held.criterion.min()
    scan = held
    if unstable:
        scan = replace(
            free, fits=tuple(free.fits[k] for k in kept), sizes=tuple(free.sizes[k] for k in kept)
        )
    omega_c = classical_margins(machine.omega, machine.G * response(K, machine.omega)).crossover
    if np.any(scan.fit.class_std) and not np.isnan(omega_c):
        each = [
            scan_orders(
                machine,
                n_poles=(n,),
                relative_degree=2,
                delay=0.0,
                stable=not unstable,
                omega_c=omega_c,
            )
            for n in _ORDERS
        ]
        each = [
            one
            for one in each
            if not _cancels_unstable_pole(one.fit.G) and UNDAMPED not in doubtful_roots(one.fit)
        ]
        # |S| is bounded over the set, so a radius near the smallest is needed, not just one below a
        # limit
        if each:
            least = min(float(one.loop_radius[0]) for one in each)
            best = next(one for one in each if one.loop_radius[0] <= NEAR_BEST * least)
            return best.fit, (*(one.fit for one in each), *scan.fits)
    return (
        replace(scan.fit, omega_c=omega_c),
        scan.fits,
    )  # the weight of the set uses the crossover too


def _cancels_unstable_pole(G: control.StateSpace) -> bool:
    """Return whether a zero z cancels an unstable pole p: both change G(jw) by at most |z - p| / Re
    p < 5 %.

    >>> s = control.tf("s")
    >>> _cancels_unstable_pole(control.ss((s - 1.01) / (s - 1) / s**2)), _cancels_unstable_pole(control.ss(1 / (s - 1)))
    (True, False)
    """
    zeros, poles = G.zeros(), G.poles()
    return any(np.any(np.abs(zeros - p) < _CANCELLED * p.real) for p in poles if p.real > 0)


def _reason_of_late_settings(machine: nlfrf.Bla, settings: Drive) -> str:
    """Return the reason why a delay is too long: the remaining phase rises too much over the band
    or between lines.
    """
    omega, steps = machine.omega, machine.G[1:] * machine.G[:-1].conj()
    widths = np.diff(omega)
    longest, period = settings.delay + settings.lag, 2 * np.pi / float(widths.min())
    if longest >= period:  # a whole turn from line to line does not show
        return (
            f"delay must be below {1e3 * period:.4g} ms, one over the distance of the lines, got "
            f"{1e3 * settings.delay:g} ms"
        )
    leads = np.linspace(0, longest, 2 + int(4 * longest * widths.max()))
    agree = np.mean((steps / np.abs(steps)) * np.exp(-1j * np.outer(leads, widths)), axis=1).real
    k = int(np.argmax(agree))
    turns = leads[k] * (omega[-1] - omega[0]) / (2 * np.pi)
    if not (agree[k] > _AGREE and turns > _MOST_RISE):
        return ""
    return (
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of"
        f" {1e3 * settings.lag:g} ms: with both removed the machine would lead its force, by a"
        f" phase that rises by {turns:.2g} turns over the band"
    )


def behind_lag(machine: control.StateSpace, lag: float) -> control.StateSpace:
    """Return a machine behind the lag of the current loop [s]."""
    if not lag:
        return machine
    return in_series(
        control.StateSpace([[-1 / lag]], [[1 / lag]], [[1.0]], [[0.0]], 0), machine, dt=0
    )
