"""Experiments on a rig: every realisation of a multisine, run to steady state, several at a time."""

from __future__ import annotations

import os
import warnings
from collections.abc import Callable
from concurrent.futures import Executor, Future, ThreadPoolExecutor, as_completed
from typing import Any

import numpy as np

from nlfrf import packing
from nlfrf.checks import DataWarning, integer, one_of
from nlfrf.multisine import Multisine
from nlfrf.record import Record
from nlfrf.rig import Rig, advance, at_rest, refuse_long_step, step_refusal, warn_lost
from nlfrf.values import value

#: Change from one period to the next, relative to the rms of the position, above which a record is called unsettled.
UNSETTLED = 1e-4


@value
class Experiment:
    """One realisation of a multisine on a rig, and how it is integrated: all that a worker needs."""

    rig: Rig
    ms: Multisine
    n_periods: int
    n_discard: int
    oversampling: int
    hold: str


@value
class Outcome:
    """What a worker gives back.

    Fields
    ------
    y : (P, N) ndarray
        Position [m]; empty where the step was too long to be stable.
    change : float
        Rms change from the last period but one to the last, relative to the rms; nan where there is only one.
    lost : float
        Turning points forgotten for lack of memory.
    """

    y: np.ndarray
    change: float
    lost: float


def simulate(
    rig: Rig,
    ms: Multisine,
    *,
    n_periods: int = 1,
    n_discard: int = 2,
    oversampling: int = 1,
    hold: str = "band-limited",
    executor: Executor | None = None,
    progress: Callable[[int, int], Any] | None = None,
) -> Record:
    """Run every realisation of a multisine through a rig, from rest to steady state: force in, position out.

    Parameters
    ----------
    rig : Rig
        The machine.
    ms : Multisine
        The force [N], M realisations of N samples.
    n_periods : int
        Periods P kept.
    n_discard : int
        Periods run before, for the transient to die out.
    oversampling : int
        Integration steps per sample. An even number of steps a period keeps the point symmetry of the friction,
        so that nothing but rounding appears on even lines.
    hold : str
        The force between samples: "band-limited", the multisine itself; "zoh", each sample held.
    executor : concurrent.futures.Executor, optional
        Where the realisations are run; one thread per core when not given. The result does not depend on it.
    progress : callable, optional
        Called with the realisations done and the total, after each one.

    Returns
    -------
    Record
        u, y (M, P, N), with the lines of the multisine.

    Raises
    ------
    ValueError
        A step too long to be stable, with the oversampling that would do; numbers out of range.

    Warns
    -----
    DataWarning
        Where the last two periods still differ by more than 1e-4 of the rms.

    Examples
    --------
    The paper's rig, driven on odd lines, answers on odd lines only: even lines hold rounding.

    >>> from nlfrf.multisine import multisine
    >>> from nlfrf.rig import paper_rig
    >>> ms = multisine(fs=2048, n_samples=2048, f_min=2, f_max=140, rms=0.25, rng=1)
    >>> record = simulate(paper_rig(), ms)
    >>> spectrum = np.abs(np.fft.rfft(record.y[0, 0]))
    >>> bool(spectrum[ms.lines.even].max() < 1e-6 * spectrum[ms.lines.odd].max())
    True
    """
    n_periods = integer("n_periods", n_periods, least=1)
    n_discard = integer("n_discard", n_discard, least=0)
    oversampling = integer("oversampling", oversampling, least=1)
    one_of("hold", hold, ("band-limited", "zoh"))
    refuse_long_step(rig, ms.fs, oversampling)
    experiments = [
        Experiment(
            rig=rig,
            ms=one_realization(ms, m),
            n_periods=n_periods,
            n_discard=n_discard,
            oversampling=oversampling,
            hold=hold,
        )
        for m in range(ms.n_realizations)
    ]
    if executor is None:
        with ThreadPoolExecutor(max_workers=os.cpu_count()) as threads:
            outcomes = run_all(experiments, threads, progress)
    else:
        outcomes = run_all(experiments, executor, progress)
    change = max(outcome.change for outcome in outcomes)
    if change > UNSETTLED:
        warnings.warn(
            f"steady state was not reached: the last two periods differ by {change:.1e} of the rms. "
            f"Raise n_discard above {n_discard}",
            DataWarning,
            stacklevel=2,
        )
    warn_lost(sum(outcome.lost for outcome in outcomes))
    y = np.stack([outcome.y for outcome in outcomes])
    u = np.broadcast_to(ms.u[:, np.newaxis, :], y.shape)
    return Record(u=u, y=y, fs=ms.fs, lines=ms.lines)


def run_all(
    experiments: list[Experiment], executor: Executor, progress: Callable[[int, int], Any] | None
) -> list[Outcome]:
    """The outcome of each experiment, in their order; what was not begun is cancelled when one fails."""
    futures: dict[Future[Outcome], int] = {}
    outcomes: dict[int, Outcome] = {}
    try:
        for m, experiment in enumerate(experiments):
            futures[executor.submit(run_experiment, experiment)] = m
        for future in as_completed(futures):
            m = futures[future]
            outcome = future.result()
            if outcome.y.size == 0:
                raise refusal(experiments[m])
            outcomes[m] = outcome
            if progress is not None:
                progress(len(outcomes), len(experiments))
    except BaseException:
        for future in futures:
            future.cancel()
        raise
    return [outcomes[m] for m in range(len(experiments))]


def run_experiment(experiment: Experiment) -> Outcome:
    """Integrate one realisation from rest; runs in a worker."""
    rig, ms, steps = experiment.rig, experiment.ms, experiment.oversampling
    memory = at_rest(rig)
    drive = one_period(ms, steps, experiment.hold)
    n_total = experiment.n_discard + experiment.n_periods
    kept = np.empty((experiment.n_periods, ms.n_samples))
    x = before = None
    for period in range(n_total):
        before = x
        out = advance(rig, memory, drive, 1 / (ms.fs * steps), steps)
        if out is None:
            return Outcome(y=np.empty((0, 0)), change=np.nan, lost=0.0)
        x = out[:, 0]
        if period >= experiment.n_discard:
            kept[period - experiment.n_discard] = x
    change = np.nan if before is None or x is None else float(np.sqrt(np.mean((x - before) ** 2) / np.mean(x**2)))
    return Outcome(y=kept, change=change, lost=float(memory.state[packing.LOST]))


def one_period(ms: Multisine, oversampling: int, hold: str) -> np.ndarray:
    """(n, 3) force at the begin, middle and end of every integration step of one period."""
    if hold == "zoh":
        return np.repeat(np.repeat(ms.u[0], oversampling)[:, np.newaxis], 3, axis=1)
    u = ms.sampled(2 * ms.n_samples * oversampling)[0]
    return np.stack([u[0::2], u[1::2], np.roll(u[0::2], -1)], axis=1)


def one_realization(ms: Multisine, m: int) -> Multisine:
    """The multisine with realisation m alone."""
    return Multisine(
        fs=ms.fs,
        n_samples=ms.n_samples,
        kind=ms.kind,
        lines=ms.lines,
        amplitude=ms.amplitude,
        phase=ms.phase[m : m + 1],
    )


def refusal(experiment: Experiment) -> ValueError:
    """The refusal of a step that was too long for this experiment, with one that would do."""

    def stable(oversampling: int) -> bool:
        finer = Experiment(
            rig=experiment.rig,
            ms=experiment.ms,
            n_periods=experiment.n_periods,
            n_discard=experiment.n_discard,
            oversampling=oversampling,
            hold=experiment.hold,
        )
        return run_experiment(finer).y.size > 0

    return step_refusal(experiment.ms.fs, experiment.oversampling, stable)
