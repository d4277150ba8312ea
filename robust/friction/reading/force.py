"""Friction force without a friction law: the commanded force minus inertia and viscous force.

    f(t) = u(t - delay) - m x'' - c x'

Mass, viscous friction and delay come from records in motion, where friction slides and its law does
not matter. From records at rest, f grows with the level while friction sticks, and stops growing at
the break-away force.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

import nlfrf
from nlfrf._base.numbers import smallest_step
from nlfrf._base.values import value
from robust.friction.reading.balance import as_real, force_of_motion, motion_of_record
from robust.friction.reading.friction_fit import FrictionFit
from robust.friction.reading.in_motion import SlidingFit, identify_sliding
from robust.friction.reading.numbers import HALF_WIDTH, number_facts, unit_of
from robust.lti.sampling import hold_correction
from robust.pages.section import Fact
from robust.pages.text import format_facts

#: Share of its peak that steps of the encoder may contribute to a force; beyond it the force is cut
#: off in frequency.
_MOST_STEPS = 0.015
#: Peak acceleration of one step of the encoder, over omega^2 times the step, after the filter with
#: edge omega.
_STEP_ACCELERATION = 0.153
#: Highest edge, relative to half the sampling frequency, and number of oscillations at the edge for
#: which its filter rings. Of 178 axes the interval of the break-away force contained 169, 171 and
#: 170 with 0.4, 0.55 and 0.8.
_HIGHEST, _RINGS = 0.55, 6
#: Largest share of the samples that may lie above a peak.
_ABOVE_PEAK = 5e-4
#: Largest change of a position from period to period, relative to its rms.
_MOST_CHANGE = 0.2
#: Largest share of samples at a limit of the force; a level with more is not used.
_CLIPPED = 2e-3
#: Exponent of the level with which the peak force still rises at break-away; it is one while
#: friction sticks. This and the following: set on 24 axes with six laws of friction, 13 of them
#: with stiction two to four times Coulomb friction, and tried on others
#: (benchmarks/bench_stranger.py).
_FLAT = 0.155
#: Uncertainty of the break-away force from peaks: they were 5 % low to 7 % high, as crests of a
#: filtered force are.
_SCATTER_LOW, _SCATTER_HIGH = 0.08, 0.03
#: Peaks that fall with the level by more than this share may come from a speed at which stiction
#: has fallen already. The excess over Coulomb friction is then larger by up to the second factor.
#: It is larger by up to the first if the peaks do not fall, or if the fall is seen at higher
#: speeds. Set on 60 axes, half of which jump when they break away.
_FALLEN, _EXCESS, _EXCESS_FALLEN = 0.07, 1.25, 3.0
#: Share of Coulomb friction below which a peak that does not rise comes from steps of the encoder.
_BELOW_COULOMB = 0.7
#: Number of steps of the encoder that may add up in a peak.
_STEPS_TOGETHER = 2.0
#: Least rms of a position over the step of the encoder for estimates of stiffness and damping, and
#: standard deviations of their ends.
_FEWEST_STEPS, _FEWEST_STEPS_DAMPING, _SIGMAS = 4.0, 10.0, 3.0
#: Sticking levels have at least this share of the largest stiffness; levels at which no element
#: slips have the second. There Maxwell slip has no damping: friction with a damping above a share
#: of the stiffness, at the middle of the lines, creeps. The highest of these levels may have begun
#: to slip.
_STICKS, _NONE_SLIPS, _CREEPS = 0.9, 0.985, 0.01
#: Number of highest levels that show the fall of the friction with speed, and the share of their
#: peak that steps of the encoder may make there.
_LEVELS_STRIBECK, _STEPS_STRIBECK = 4, 0.1
#: Stribeck velocities that are tried [m/s] or [rad/s]; the highest look like viscous friction.
_STRIBECK_VELOCITIES, _FASTEST_STRIBECK = np.geomspace(2e-4, 0.1, 40), 0.06
#: Least reduction of the variance by a Stribeck curve; share of this gain that the whole interval
#: reaches; factor by which a filtered force makes the velocity too high. Set on 32 axes and tried
#: on 22 others: of the 30 that show a velocity the interval contains 29; the last has Dahl
#: friction, which has none.
_SHOWN, _REACHED, _TOO_HIGH = 0.01, 0.75, 1.5
#: Distance from a reversal, relative to the deflection at the largest friction force, from which
#: friction slides.
_SLIDES_AFTER = 6.0
#: Least number of sliding samples for its fall, least number of slides between reversals for its
#: mean, and share of Coulomb friction by which traces of the same friction may differ. The
#: difference was 4 % on 12 axes with six laws; on 26 others no contradiction was found. Of 16 axes
#: whose friction grew by 30 % it was found on 13: the levels of the others ended at speeds at which
#: stiction had not fallen.
_FEWEST_SAMPLES, _FEWEST_SLIDES, _SLIDE_ERROR = 300, 5, 0.05
_HOLDS_BOTH = "The interval of the break-away force covers both. "
#: Highest edge for the friction force, relative to the antiresonance of a load: below it motor and
#: load move as one. Of 38 axes with a load the interval of the break-away force contained 34, 35
#: and 36 with 0.23, 0.35 and 0.45.
_RIGID = 0.45


@value
class _CoupledLoad:
    """A load behind the spring of a motor, with its share of the friction."""

    # mass, stiffness, damping: mass [kg], spring [N/m] and damper [Ns/m] between motor and load
    mass: float
    stiffness: float
    damping: float
    share: float  # share of the friction that acts on the load; nan if it is unknown


@value
class FrictionForce:
    """Mass and friction force of an axis from records in motion and at rest, without a friction
    law.

    References
    ----------
    F. Al-Bender, J. Swevers, "Characterization of friction force dynamics", IEEE Control Systems 28
    (6), 2008.
    """

    sliding: SlidingFit  # mass, viscous and Coulomb friction, delay with lag
    # (2,) interval of the break-away force [N], found by trial to hold in 95 %; nan if the levels
    # do not show it
    Fs: np.ndarray
    # (2,) interval of the presliding stiffness [N/m]; nan if the encoder resolves no motion before
    # break-away
    K0: np.ndarray
    # largest damping over stiffness while friction sticks [s]; creep looks like damping too. nan as
    # for K0.
    bristle_time: float
    # True if friction has damping, or creeps, while it sticks. Maxwell slip does neither.
    creeps: bool
    # (2,) interval of the velocity over which stiction falls [m/s] or [rad/s]; nan if the levels do
    # not show it. Only the lower end is nan if stiction has fallen before the axis slides.
    stribeck: np.ndarray
    reason: str = ""  # reason why the break-away force is unknown; empty if it is known
    # difference between the friction in motion and at rest, if there is one, and its meaning. `Fs`
    # then covers both.
    contradiction: str = ""
    # the load, if motor and load were identified separately in motion
    load: _CoupledLoad | None = None

    @property
    def facts(self) -> list[Fact]:
        """Return machine and friction, each number with its interval."""
        units, (low, high) = self.sliding.units, self.K0 / 1e3
        kilo, rows = unit_of("kF/L", units), number_facts(self.sliding)
        if np.isfinite(self.Fs).all():
            rows.append(Fact("break-away force", f"{self.Fs[0]:.4g} to {self.Fs[1]:.4g}", units[0]))
        if np.isfinite(high):
            damped = f"its damping is at most {1e3 * self.bristle_time:.3g} ms of it"
            damped *= bool(np.isfinite(self.bristle_time))
            rows.append(Fact("presliding stiffness", f"{low:.4g} to {high:.4g}", kilo, damped))
        elif np.isfinite(low):
            rows.append(
                Fact(
                    "presliding stiffness",
                    f"at least {low:.4g}",
                    kilo,
                    "the encoder resolves no more",
                )
            )
        if np.isfinite(self.stribeck).all():
            speeds = " to ".join(f"{1e3 * one:.2g}" for one in self.stribeck)
            rows.append(Fact("falls with speed over", speeds, f"m{unit_of('L/s', units)}"))
        if self.creeps:
            rows.append(
                Fact("below break-away", "the friction creeps, or is damped: it is no Maxwell slip")
            )
        return rows

    def __str__(self) -> str:
        return format_facts(self.facts)


class _LevelPeak(NamedTuple):
    """Level of the excitation, peak of the friction force [N], its error bound [N], and its mean
    amplitude [N].
    """

    level: float
    peak: float
    error: float
    amplitude: float = 0.0


def read_friction_force(
    moving: Sequence[nlfrf.Record],
    velocities: Sequence[float],
    levels: Sequence[nlfrf.Record],
    *,
    masses: int = 1,
) -> FrictionForce:
    """Read mass, delay and friction force of an axis, without a friction law.

    Parameters
    ----------
    moving : sequence of Record
        Records in motion, as for `identify_sliding`.
    velocities : (R,) sequence of float
        Base velocity of each [m/s].
    levels : sequence of Record
        Records at rest with the same signals and units, from sticking to sliding.
    masses : int
        As for `identify_sliding`. The friction is that of motor and load together, at frequencies
        where they move as one.

    Raises
    ------
    ValueError
        As for `identify_sliding`.
    """
    sliding = identify_sliding(moving, velocities, masses=masses)
    sizes = [np.abs(np.asarray(one.u[0])) for one in levels]
    limited = [np.mean(size > (1 - 1e-9) * size.max()) > _CLIPPED for size in sizes]
    whole = [one for one, cut_off in zip(levels, limited, strict=True) if not cut_off]
    kept = [one for one in whole if _repeats(one)]
    # below the first level that repeats the axis hunts by itself
    if kept:
        first = next((k for k, one in enumerate(whole) if one is kept[0]), 0)
    else:
        first = len(whole)
    shown = sorted(_peak_of_level(one, sliding) for one in whole[first:])
    peaks = [_peak_of_level(one, sliding) for one in kept]
    Fs, reason = _break_away(shown, abs(sliding.coulomb), falls_later=True)
    K0, bristle_time, damped = _stiffness_at_rest(kept, peaks, sliding, float(Fs[0]))
    f, v, slides = _slides_of(kept, sliding, float(Fs[1] / K0[0]) if np.isfinite(K0[0]) else 0.0)
    stribeck = _stribeck_velocity(f, v, abs(sliding.coulomb))
    if not np.isfinite(stribeck).all():
        Fs, reason = _break_away(shown, abs(sliding.coulomb))
    if np.isfinite(Fs[1]):
        largest = float(Fs[1])
    else:
        largest = max((one.peak for one in shown), default=0.0)
    contradiction = ""
    if (grown := _growth_of_friction(sliding, f, v, slides)) is not None:
        at_rest, factor = grown
        Fs = Fs * [1.0, max(1.0, factor)]
        low, high = np.sort(np.abs(sliding.interval("coulomb")))
        contradiction = (
            f"the friction is {low:.4g} to {high:.4g} {sliding.units[0]} in motion and"
            f" {at_rest[0]:.4g} to {at_rest[1]:.4g} where it slides at rest: it has grown between"
            " the traces, or rises with speed by more than a viscous one."
            f" {_HOLDS_BOTH * bool(np.isfinite(Fs).all())}Measure all traces again, in one session"
        )
    return FrictionForce(
        sliding=sliding,
        Fs=Fs,
        K0=K0,
        bristle_time=bristle_time,
        creeps=damped > _falling_slope(sliding, largest, float(stribeck[1])),
        stribeck=stribeck,
        reason=reason,
        contradiction=contradiction,
        load=coupled_load(sliding, np.nan) if sliding.load_mass else None,
    )


def coupled_load(machine: SlidingFit | FrictionFit, share: float) -> _CoupledLoad:
    """Return the load of an identified machine, with its share of the friction."""
    damping = max(0.0, machine.coupling_damping)
    return _CoupledLoad(
        mass=machine.load_mass, stiffness=machine.coupling, damping=damping, share=share
    )


def _repeats(record: nlfrf.Record) -> bool:
    """Return whether a level repeats in each period.

    A level that hunts by itself has a jump at the end of a period.
    """
    y = np.asarray(record.y)[0]
    changes = np.std(y - y.mean(axis=0), axis=-1).max() + np.ptp(y.mean(axis=-1))
    return bool(changes < max(_MOST_CHANGE * np.std(y.mean(axis=0)), 2 * smallest_step(record.y)))


def _peak_of_level(record: nlfrf.Record, sliding: SlidingFit) -> _LevelPeak:
    """Return the peak of the friction force at one level, up to the frequency where steps of the
    encoder are small.
    """
    edge = edge_of_level(record, sliding)
    f, _, v = _friction_over_time(record, sliding, edge)
    acceleration = np.gradient(v) * record.fs
    quiet = _STEP_ACCELERATION * sliding.mass * smallest_step(record.y) * edge**2
    return _LevelPeak(
        level=float(np.std(record.r if record.r is not None else record.u)),
        peak=float(np.sort(np.abs(f))[-max(1, int(_ABOVE_PEAK * f.size))]),
        error=HALF_WIDTH * sliding.stds["mass"] * float(np.abs(acceleration).max()) / 2
        + _STEPS_TOGETHER * quiet,
        amplitude=float(np.sqrt(2) * f.std()),
    )


def edge_of_level(record: nlfrf.Record, machine: SlidingFit | FrictionFit) -> float:
    """Return the frequency [rad/s] up to which the friction force of a level is computed; it
    includes all lines.
    """
    u = np.asarray(record.u)[0].mean(axis=0)
    edge = _quiet_edge(record, machine, _MOST_STEPS * float(np.abs(u - u.mean()).max()))
    edge = max(2 * np.pi * record.f0 * float(record.lines.excited[-1]), edge)
    return min(edge, _usable_edge(record, machine))


def _usable_edge(record: nlfrf.Record, machine: SlidingFit | FrictionFit) -> float:
    """Return the highest frequency [rad/s] at which a record can show a friction force."""
    return min(_HIGHEST * np.pi * record.fs, _rigid_edge(machine))


def _quiet_edge(record: nlfrf.Record, machine: SlidingFit | FrictionFit, most: float) -> float:
    """Return the frequency [rad/s] up to which an encoder step makes less than `most` [N]."""
    step = _STEP_ACCELERATION * machine.mass * smallest_step(record.y)
    if step:
        return float(np.sqrt(most / step))
    return np.inf


def friction_of_period(
    record: nlfrf.Record, machine: SlidingFit | FrictionFit, edge: float
) -> tuple[np.ndarray, np.ndarray]:
    """Return position [m] and friction force [N] (n,) of the mean period, band-limited."""
    u, y = (np.asarray(one)[0].mean(axis=0) for one in (record.u, record.y))
    f, Y, _ = _friction_of_signals(u, y, record, machine, edge)
    return np.fft.irfft(Y, n=f.size), f


def _friction_over_time(
    record: nlfrf.Record, machine: SlidingFit | FrictionFit, edge: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return friction force [N], position [m] and velocity [m/s] of all periods (n,), up to a
    frequency [rad/s].

    An axis that jumps does so at other times in each period. The mean of its periods, or one period
    that is assumed periodic, has accelerations that never occurred. The ends, where the filter
    rings, are left out.
    """
    u, y = (np.asarray(one)[0].ravel() for one in (record.u, record.y))
    y = y - np.linspace(y[0], y[-1], y.size)
    f, Y, omega = _friction_of_signals(u, y, record, machine, edge)
    x, v = (np.fft.irfft(one, n=f.size) for one in (Y, 1j * omega * Y))
    rings = min(f.size // 10, max(f.size // 100, int(_RINGS * 2 * np.pi * record.fs / edge)))
    return f[rings:-rings], x[rings:-rings], v[rings:-rings]


def _friction_of_signals(
    u: np.ndarray,
    y: np.ndarray,
    record: nlfrf.Record,
    machine: SlidingFit | FrictionFit,
    edge: float,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return the friction force (n,) up to a frequency [rad/s], the spectrum of the motion, and
    frequencies [rad/s].

    The filter is a raised cosine, one half at the edge. A force that reverses jumps by twice its
    size. After a sharp filter it overshoots by 18 % of that size, after this one by 1 %.
    """
    omega = 2 * np.pi * record.fs / u.size * np.arange(u.size // 2 + 1)
    roll = (1 + np.cos(np.pi * np.minimum(omega / (2 * edge), 1.0))) / 2
    U, Y = np.fft.rfft(u) * roll, np.fft.rfft(y) * roll
    U[0] = Y[0] = 0.0
    held = hold_correction(omega, record.hold, fs=record.fs, dt=0.0)
    force = U * np.exp(-1j * omega * machine.delay) / held
    force -= force_of_motion(machine, omega, max(machine.damping, 0.0)) * Y
    return np.fft.irfft(force, n=u.size), Y, omega


def _rigid_edge(machine: SlidingFit | FrictionFit) -> float:
    """Return the frequency [rad/s] up to which motor and load move as one."""
    if machine.load_mass:
        return _RIGID * float(np.sqrt(machine.coupling / machine.load_mass))
    return np.inf


def _slides_of(
    levels: Sequence[nlfrf.Record], sliding: SlidingFit, deflection: float
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Return force f sgn v (n,) [N], speed |v| (n,) and number of the slide (n,) of every sliding
    sample.

    The samples are far from the last reversal, at the highest levels. The number is -1 if the
    filter of the force mixes the slide with its neighbours.

    deflection : displacement of sticking friction at its largest force [m].
    """
    forces, speeds, slides, count = [np.zeros(0)], [np.zeros(0)], [np.zeros(0, dtype=int)], 0
    for record in levels[-_LEVELS_STRIBECK:]:
        most = _STEPS_STRIBECK * float(np.abs(np.asarray(record.u)).max())
        edge = min(_quiet_edge(record, sliding, most), _usable_edge(record, sliding))
        f, x, v = _friction_over_time(record, sliding, edge)
        turns = np.flatnonzero(np.diff(np.sign(v)))
        if not turns.size:
            continue
        sample = np.arange(v.size)
        last = np.searchsorted(turns, sample) - 1
        far = (np.abs(x - x[turns[last]]) > _SLIDES_AFTER * deflection) & (
            np.abs(v) > _STRIBECK_VELOCITIES[0]
        )
        far &= last >= 0
        following = turns[np.minimum(last + 1, turns.size - 1)]
        smeared = (
            np.minimum(sample - turns[last], np.abs(following - sample)) < np.pi * record.fs / edge
        )
        smeared |= (
            edge < 2 * np.pi * record.f0 * record.lines.excited[-1]
        )  # turns that are not seen
        forces.append((f * np.sign(v))[far])
        speeds.append(np.abs(v)[far])
        slides.append(np.where(smeared, -1, count + last)[far])
        count += turns.size
    return np.concatenate(forces), np.concatenate(speeds), np.concatenate(slides)


def _growth_of_friction(
    sliding: SlidingFit, f: np.ndarray, v: np.ndarray, slides: np.ndarray
) -> tuple[np.ndarray, float] | None:
    """Return the sliding force of the levels (2,) [N], and the largest factor between it and the
    trace in motion.

    None if both agree. Friction that falls with speed is larger at the lower speeds of the levels,
    never smaller.
    """
    if v.size < _FEWEST_SAMPLES:
        return None
    fast = (v > np.median(v)) & (slides >= 0)
    means = np.array([f[fast & (slides == one)].mean() for one in np.unique(slides[fast])])
    if means.size < _FEWEST_SLIDES:
        return None
    viscous = HALF_WIDTH * sliding.stds["damping"] * float(v[fast].mean())
    half = (
        HALF_WIDTH * float(means.std(ddof=1)) / np.sqrt(means.size)
        + viscous
        + _SLIDE_ERROR * abs(sliding.coulomb)
    )
    low, high = means.mean() - half, means.mean() + half
    coulomb = np.sort(np.abs(sliding.interval("coulomb")))
    if coulomb[0] > high > low > 0:
        return np.array([low, high]), float(coulomb[1] / low)
    return None


def _stribeck_velocity(f: np.ndarray, v: np.ndarray, coulomb: float) -> np.ndarray:
    """Return the interval of the velocity over which sliding friction (n,) falls with its speed.

    f sgn v = Fc + (Fs - Fc) exp(-(v / vs)^2) + c |v|. If no fall shows, the lower end is nan, and
    the upper end is the speed above which the force is that of Coulomb friction [N].
    """
    unknown = np.full(2, np.nan)
    if v.size < _FEWEST_SAMPLES:
        return unknown
    cells = np.digitize(v, _STRIBECK_VELOCITIES)
    means = np.bincount(cells, f) / np.maximum(np.bincount(cells), 1)
    falls = np.flatnonzero(means > (1 + _SLIDE_ERROR) * coulomb)
    unknown[1] = _STRIBECK_VELOCITIES[
        min(falls[-1] if falls.size else cells.min(), _STRIBECK_VELOCITIES.size - 1)
    ]
    without = _fit_stribeck(f, v, None)
    costs = np.array([_fit_stribeck(f, v, vs) for vs in _STRIBECK_VELOCITIES])
    gains, best = without - costs, int(np.argmin(costs))
    if not (gains[best] > _SHOWN * costs[best] and _STRIBECK_VELOCITIES[best] < _FASTEST_STRIBECK):
        return unknown
    near = _STRIBECK_VELOCITIES[gains > _REACHED * gains[best]]
    return np.array([near[0] / _TOO_HIGH, near[-1]])


def _fit_stribeck(f: np.ndarray, v: np.ndarray, vs: float | None) -> float:
    """Return the residual sum of squares of Coulomb and viscous friction, with a fall over vs; a
    rise is excluded.
    """
    columns = [np.ones(v.size), v] + ([] if vs is None else [np.exp(-((v / vs) ** 2))])
    X = np.column_stack(columns)
    found = np.linalg.solve(X.T @ X + 1e-12 * np.diag((X**2).sum(axis=0)), X.T @ f)
    if vs is None or found[2] > 0:
        return float(((f - X @ found) ** 2).sum())
    return np.inf


def _break_away(
    peaks: Sequence[_LevelPeak], coulomb: float, *, falls_later: bool = False
) -> tuple[np.ndarray, str]:
    """Return the interval of the break-away force, at which the peak force stops rising with the
    level.

    falls_later : True if friction falls with speed while it slides, and so not before it breaks
    away.
    """
    unknown = np.full(2, np.nan)
    if len(peaks) < 2:
        return unknown, f"the friction force needs two levels or more at rest, got {len(peaks)}"
    # While elements stick, the force follows the level (slope one over logarithms); once all slip,
    # it does not rise any more (slope zero).
    level, peak, error, _ = (np.array(one) for one in zip(*peaks, strict=True))
    slope = np.diff(np.log(np.maximum(peak, 1e-300))) / np.maximum(np.diff(np.log(level)), 1e-9)
    breaks = peak[:-1] > _BELOW_COULOMB * coulomb
    flat = np.flatnonzero((slope <= _FLAT) & breaks)
    if flat.size:
        k = int(flat[0])
        found = float(np.median(peak[k : k + 3]))
    else:  # damped bristles give a force above break-away at speed: the peak rises again
        k = int(np.argmin(np.where(breaks, slope, np.inf)))
        found = float(peak[k])
        if k == slope.size - 1 or not breaks[k] or slope[k] > 2 * _FLAT:
            return (
                unknown,
                (
                    f"the force of friction still rises with the level, to {peak[-1]:.3g} at the"
                    " highest: the axis does not break away there. Raise the level"
                ),
            )
    fell = not falls_later and peak[k:].min() < (1 - _FALLEN) * found
    high = (1 + _SCATTER_HIGH) * found
    factor = _EXCESS_FALLEN if fell else _EXCESS
    high = max(high, min(coulomb, found) + factor * (high - min(coulomb, found)))
    return np.array([max(0.0, (1 - _SCATTER_LOW) * found - error[k]), high + error[k]]), ""


def _stiffness_at_rest(
    levels: Sequence[nlfrf.Record], peaks: Sequence[_LevelPeak], sliding: SlidingFit, Fs: float
) -> tuple[np.ndarray, float, float]:
    """Return the interval of the stiffness, the largest damping over it of sticking friction, and
    the least damping.

    The least damping [Ns/m] is that beyond the viscous friction in motion, at levels where no
    element slips; -inf if it is unknown. Of all laws considered here, that of Leuven bends most:
    dF/dx = K0 (1 - F/Fs)^2, so that the stiffness of a swing up to F is K0 (1 - F/Fs). This bounds
    K0 at every level below break-away. Rigid friction moves only at Fs, and has no bound. A load
    that sticks is behind its coupling, so the stiffness of its friction may be larger by the effect
    of the coupling.

    peaks : of each level. Fs : the least break-away force [N]; if it is nan, the largest peak takes
    its place.
    """
    if np.isfinite(Fs):
        least = Fs
    else:
        least = (1 - _SCATTER_LOW) * max((one.peak - one.error for one in peaks), default=0.0)
    read, kept = [], []
    for record, one in zip(levels, peaks, strict=True):
        if (found := _spring_and_damper(record, sliding)) is not None:
            read.append(found)
            kept.append(1 - one.amplitude / least if one.peak + one.error < least else 0.0)
    unknown = np.full(2, np.nan), np.nan, -np.inf
    if not read:
        return unknown
    k, k_std, c, c_std, steps, middle = (np.array(one) for one in zip(*read, strict=True))
    sure = k - _SIGMAS * k_std
    if not sure.max() > 0:
        return unknown
    stiff = k > _STICKS * k[np.argmax(sure)]
    highest = [(k[i] + _SIGMAS * k_std[i]) / kept[i] for i in range(k.size) if kept[i] > 0]
    K0 = np.array(
        [sure.max(), _before_coupling(max(sure.max(), min(highest, default=np.inf)), sliding)]
    )
    clear = stiff & (steps > _FEWEST_STEPS_DAMPING)
    if not clear.any() or stiff.sum() < 2:  # of one level alone it is not known whether it sticks
        return K0, np.nan, -np.inf
    none_slips = np.flatnonzero(clear & (k > _NONE_SLIPS * k[clear].max()))
    none_slips = none_slips[np.argsort(steps[none_slips])][:-1]
    damped = (c - _SIGMAS * c_std - _CREEPS * k / middle)[none_slips].max(initial=-np.inf)
    # every level shows damping and creep together: the least of them is nearest to the damping
    return (
        K0,
        max(0.0, float((c + _SIGMAS * c_std)[clear].min())) / float(sure.max()),
        float(damped),
    )


def _before_coupling(stiffness: float, machine: SlidingFit) -> float:
    """Return the largest friction stiffness of motor and load together [N/m] for a stiffness seen
    at the motor.

    With friction stiffnesses K1 and K2 the motor shows K1 + k K2 / (k + K2); K1 + K2 is largest for
    K1 = 0.
    """
    if not machine.load_mass:
        return stiffness
    left = 1 - stiffness / max(machine.interval("coupling")[0], np.finfo(float).tiny)
    if left > 0:
        return stiffness / left
    return np.inf


def _falling_slope(sliding: SlidingFit, Fs: float, fastest: float) -> float:
    """Return the largest amount by which the viscous friction in motion may be below that of the
    machine [Ns/m].

    If friction still falls there, its slope d/dv (Fs - Fc) exp(-(v/vs)^2) is part of it, for vs up
    to the fastest [m/s].
    """
    v = float(np.abs(sliding.velocities).min())
    vs = float(np.fmin(fastest, v))  # at vs = v it is steepest
    falls = max(0.0, Fs - float(np.abs(sliding.interval("coulomb")).min()))
    return (
        2 * falls * v / vs**2 * float(np.exp(-((v / vs) ** 2)))
        + HALF_WIDTH * sliding.stds["damping"]
    )


def _spring_and_damper(record: nlfrf.Record, sliding: SlidingFit) -> tuple[float, ...] | None:
    """Return spring [N/m] and damper [Ns/m] closest to the friction force of a level, each with its
    deviation.

    The last two numbers are the rms of the motion in steps of the encoder, and the middle of the
    lines [rad/s]. None if the motion is too small, or if friction is more of a damper than a
    spring, as it is while it slides.
    """
    motion = motion_of_record(record, 1)
    kept = motion.excited & (motion.omega < _rigid_edge(sliding))
    omega, U, Y = motion.omega[kept], motion.U[:, kept], motion.Y[:, kept]
    motion_rms, step = np.sqrt((np.abs(Y) ** 2).sum(axis=1).mean() / 2), smallest_step(record.y)
    if not motion_rms > _FEWEST_STEPS * step:
        return None
    force = (
        U * np.exp(-1j * omega * sliding.delay)
        - force_of_motion(sliding, omega, sliding.damping) * Y
    )
    columns = np.stack([as_real([one]) for one in (Y, 1j * omega * Y)], axis=-1)
    target, size = as_real([force]), np.linalg.norm(columns, axis=0)
    found = np.linalg.lstsq(columns / size, target, rcond=None)[0]
    left = float(((target - columns / size @ found) ** 2).sum() / max(1, target.size - 2))
    std = np.sqrt(left * np.diag(np.linalg.inv((columns / size).T @ (columns / size)))) / size
    k, c = found / size
    if not k > c * omega[0]:
        return None
    tail = float(motion_rms / max(step, np.finfo(float).tiny)), float(np.exp(np.log(omega).mean()))
    return float(k), float(std[0]), float(c), float(std[1]), *tail
