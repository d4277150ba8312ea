"""The machine behind delay and lag of a drive: what a trace leaves once both are taken off, and its fit."""

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
from robust.analysis.performance import classical_margins
from robust.friction.reading.balance import HALF_WIDTH, motion_of_record
from robust.friction.reading.in_motion import fit_linear
from robust.lti.connections import in_series
from robust.lti.lti import response
from robust.models.fit.nominal import NominalFit
from robust.models.sets.orders import NEAR_BEST, UNDAMPED, doubtful_roots, scan_orders
from robust.servo.gains.p_pi import cascade

#: Poles of a machine that are tried, two more than zeros: one mass, one whose friction slips, two masses, ...
_ORDERS = range(2, 6)


#: An unstable pole above this share of the last line is a lead, and no machine that falls over.
_LEAD = 0.3


#: Largest change of G that a pole and a zero make which cancel.
_CANCELLED = 0.05


#: Periods of the drive by which a delay as read may be off: on 180 axes it was less.
_DELAY_ERROR = 0.05


#: By which an unstable pole raises the logarithm of the likelihood where scatter does so once in a hundred times.
_SURE = 3.32


#: Turns by which the phase may rise over the band; an antiresonance gives half a turn, a delay that is too long any.
_MOST_RISE = 0.75


#: Mean of unit phasors above which F lines agree on a lead; that of random phases is 0 +- 1/sqrt(2 F).
_AGREE = 0.5


def fit_machine(bla: nlfrf.Bla, timings: Sequence[Drive], *, actual: bool) -> tuple[nlfrf.Bla, NominalFit, Drive]:
    """Return the BLA of the machine, its fit, and the settings with a delay and lag that the trace does not refute.

    What is taken off too much leaves a machine that leads. Where the best fit leads with all timings, as where a pole
    and a zero above the band nearly cancel, the best one that does not lead is taken: the radius of the set holds what
    it leaves.

    timings : settings with the delays that are tried, in their order.
    """
    not_leading, reason = [], ""
    for timing in timings:
        s, machine = 1j * bla.omega, bla
        if not actual:  # delay and lag of the current loop are in the trace
            machine = bla.times(np.exp(s * timing.delay) * (1 + s * timing.lag), output_unit=bla.output_units)
        late = "" if actual else _reason_of_late_settings(machine, timing)
        if late:
            reason = reason or late
            continue
        best, others = fit_orders(machine, cascade(timing, output_unit=bla.input_units[0]))
        leads = "" if actual else _reason_of_lead(best.G, machine, timing)
        if not leads:
            return machine, best, timing
        reason = reason or leads
        not_leading += [
            (one.cost, machine, one, timing) for one in others if not _reason_of_lead(one.G, machine, timing)
        ]
    if not not_leading:
        raise ValueError(reason)
    return min(not_leading, key=lambda one: one[0])[1:]


def timings_of(record: nlfrf.Record, settings: Drive, masses: int, *, slides: bool) -> list[Drive]:
    """Return the settings, and with delay and lag as a trace shows them of an axis that slides, the likelier first.

    The lag is kept as far as there is so much, or that which the trace shows. slides : whether the axis is known to.
    """
    numbers, stds = fit_linear(motion_of_record(record, 1), masses)
    late, std = numbers["delay"], stds["delay"]
    if not (numbers["mass"] > 0 and 0 < late < np.inf and np.isfinite(std)):
        return [settings]
    later = late - settings.delay - settings.lag > max(HALF_WIDTH * std, _DELAY_ERROR * settings.dt)
    lag = min(max(settings.lag, numbers["lag"] if later else 0.0), late)
    traced = replace(settings, lag=lag, delay_periods=(late - lag) * settings.fs)
    # the phase of a load is read as delay, too: 4 of 59 axes showed up to 0.8 periods more than they had
    return [traced, settings] if slides and later and masses == 1 else [settings, traced]


def _reason_of_lead(machine: control.StateSpace, bla: nlfrf.Bla, settings: Drive) -> str:
    """Why a delay is not that of the traces: what is left where it is too long is fitted by unstable poles."""
    fast = machine.poles()[machine.poles().real > 0]
    fast = fast[np.abs(fast) > _LEAD * bla.omega[-1]]
    if not fast.size:
        return ""
    return (
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of "
        f"{1e3 * settings.lag:g} ms: without them the machine leads, as with an unstable pole at "
        f"{format_hertz(float(np.abs(fast).max()))}"
    )


def fit_orders(machine: nlfrf.Bla, K: control.StateSpace) -> tuple[NominalFit, tuple[NominalFit, ...]]:
    """Return the fit of a machine, and those of every order: stable, unless an unstable pole is more than scatter.

    Where scatter explains no fit, what the class misses is kept from the crossover of the loop with the gains.

    A free axis has its pole at zero, and a few lines above it cannot tell on which side. A loop that is stable with the
    one and not with the other would be judged by scatter. A pole of friction that falls with speed is kept; one that a
    zero cancels is fitted to a single line and is none of the machine, however much it is worth.
    """
    free, held = (
        scan_orders(machine, n_poles=_ORDERS, relative_degree=2, delay=0.0, stable=stable) for stable in (False, True)
    )
    kept = [k for k, fit in enumerate(free.fits) if not _cancels_unstable_pole(fit.G)]
    unstable = bool(kept) and free.criterion[kept].min() + _SURE < held.criterion.min()
    scan = held
    if unstable:
        scan = replace(free, fits=tuple(free.fits[k] for k in kept), sizes=tuple(free.sizes[k] for k in kept))
    omega_c = classical_margins(machine.omega, machine.G * response(K, machine.omega)).crossover
    if np.any(scan.fit.class_std) and not np.isnan(omega_c):
        each = [
            scan_orders(machine, n_poles=(n,), relative_degree=2, delay=0.0, stable=not unstable, omega_c=omega_c)
            for n in _ORDERS
        ]
        each = [
            one for one in each if not _cancels_unstable_pole(one.fit.G) and UNDAMPED not in doubtful_roots(one.fit)
        ]
        if each:  # |S| is bounded over the set: one near the smallest, not the first that is small enough
            least = min(float(one.loop_radius[0]) for one in each)
            best = next(one for one in each if one.loop_radius[0] <= NEAR_BEST * least)
            return best.fit, (*(one.fit for one in each), *scan.fits)
    return replace(scan.fit, omega_c=omega_c), scan.fits  # the weight of the set is fitted for the crossover, too


def _cancels_unstable_pole(G: control.StateSpace) -> bool:
    """Whether a zero z stands so close to an unstable pole p that both change G(jw) by at most |z - p| / Re p < 5 %.

    >>> s = control.tf("s")
    >>> _cancels_unstable_pole(control.ss((s - 1.01) / (s - 1) / s**2)), _cancels_unstable_pole(control.ss(1 / (s - 1)))
    (True, False)
    """
    zeros, poles = G.zeros(), G.poles()
    return any(np.any(np.abs(zeros - p) < _CANCELLED * p.real) for p in poles if p.real > 0)


def _reason_of_late_settings(machine: nlfrf.Bla, settings: Drive) -> str:
    """Why a delay is too long: it turns the phase of what is left up by more than a machine can, or by a whole turn."""
    omega, steps = machine.omega, machine.G[1:] * machine.G[:-1].conj()
    widths = np.diff(omega)
    longest, period = settings.delay + settings.lag, 2 * np.pi / float(widths.min())
    if longest >= period:  # a whole turn from line to line is none
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
        f"delay must be no longer than in the traces, got {1e3 * settings.delay:g} ms, and a lag of "
        f"{1e3 * settings.lag:g} ms: without them the machine leads: its phase rises by {turns:.2g} turns over the band"
    )


def behind_lag(machine: control.StateSpace, lag: float) -> control.StateSpace:
    """Return a machine behind the lag of the current loop [s]."""
    if not lag:
        return machine
    return in_series(control.StateSpace([[-1 / lag]], [[1 / lag]], [[1.0]], [[0.0]], 0), machine, dt=0)
