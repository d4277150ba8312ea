"""Experiments on a rig: every realisation of a multisine, run to steady state, several at a time."""

from __future__ import annotations

import warnings
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.bench.rig import Rig, advance, at_rest, refuse_long_step, step_refusal, warn_coarse
from nlfrf.bench.runs import Arrays, Progress, run_all
from nlfrf.excitation.multisine import Multisine
from nlfrf.friction import kernel_data as packing
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.records.record import Record
from nlfrf.shared.arguments import DataWarning, integer, one_of, positive
from nlfrf.shared.values import value

__all__ = ["Experiment", "run_experiment", "simulate"]


#: Change from one period to the next, relative to the rms of the position, above which a record is called unsettled.
UNSETTLED = 1e-4
#: Integration steps per sample beyond which no accuracy is sought.
MOST_STEPS = 64


@value
class Experiment:
    """One realisation of a multisine on a rig, and how it is integrated: all that a worker needs."""

    rig: Rig
    ms: Multisine
    n_periods: int
    n_discard: int
    oversampling: int
    hold: str


def simulate(
    rig: Rig,
    ms: Multisine,
    *,
    n_periods: int = 1,
    n_discard: int = 2,
    oversampling: int = 1,
    hold: str = "band-limited",
    accuracy: float | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: Any = None,
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
    accuracy : float, optional
        Largest error of the position that is allowed, rms over rms: `oversampling` is doubled until halving the
        step changes the first realisation by less, from a step too long to be stable too.
    executor : concurrent.futures.Executor, optional
        Where the realisations are run; one thread per core when not given. The result does not depend on it.
    progress : callable, optional
        Called with the realisations done and the total, after each one.
    resume : path, optional
        Folder that keeps every finished realisation. Run again after an interruption, with the same arguments,
        only the others are computed.

    Returns
    -------
    Record
        u, y (M, P, N), with the lines of the multisine.

    Raises
    ------
    ValueError
        A step too long to be stable, with the oversampling that would do; an accuracy that is not reached; an
        executor that dies; numbers out of range.

    Warns
    -----
    DataWarning
        Where the last two periods still differ by more than 1e-4 of the rms, where the step is coarse for the
        resonance of the stuck rig, or where the memory of turning points was too short.

    Examples
    --------
    The paper's rig, driven on odd lines, answers on odd lines only: even lines hold rounding.

    >>> from nlfrf.excitation.multisine import multisine
    >>> from nlfrf.bench.rig import paper_rig
    >>> ms = multisine(fs=2048, n_samples=8192, f_min=2, f_max=140, rms=0.25, rng=1)
    >>> record = simulate(paper_rig(), ms, n_discard=4)
    >>> spectrum = np.abs(np.fft.rfft(record.y[0, 0]))
    >>> bool(spectrum[ms.lines.even].max() < 1e-9 * spectrum[ms.lines.odd].max())
    True
    """
    experiment = Experiment(
        rig=rig,
        ms=ms,
        n_periods=integer("n_periods", n_periods, least=1),
        n_discard=integer("n_discard", n_discard, least=0),
        oversampling=integer("oversampling", oversampling, least=1),
        hold=one_of("hold", hold, ("band-limited", "zoh")),
    )
    realizations = [replace(experiment, ms=replace(ms, phase=ms.phase[m : m + 1])) for m in range(ms.n_realizations)]
    if accuracy is None:
        refuse_long_step(rig, ms.fs, oversampling)
        warn_coarse(rig, ms.fs, oversampling)
    else:
        steps = steps_for(realizations[0], positive("accuracy", accuracy))
        realizations = [replace(realization, oversampling=steps) for realization in realizations]
    outcomes = run_all(run_experiment, realizations, executor=executor, progress=progress, resume=resume)
    change = np.array([float(outcome["change"]) for outcome in outcomes])
    if np.any(change > UNSETTLED):
        warnings.warn(
            f"steady state was not reached: the last two periods differ by {change.max():.1e} of the rms. "
            f"Raise n_discard above {n_discard}",
            DataWarning,
            stacklevel=2,
        )
    warn_lost(float(sum(outcome["lost"] for outcome in outcomes)))
    y = np.stack([outcome["y"] for outcome in outcomes])
    u = np.broadcast_to(ms.u[:, np.newaxis, :], y.shape)
    return Record(u=u, y=y, fs=ms.fs, lines=ms.lines, hold=hold)


def run_experiment(experiment: Experiment) -> Arrays:
    """Integrate one realisation from rest; runs in a worker.

    Gives y (P, N), the change from the last period but one to the last (rms over rms; nan where there is only
    one), and how many turning points were forgotten for lack of memory.
    """
    outcome = attempt(experiment)
    if outcome is None:
        fs, steps = experiment.ms.fs, experiment.oversampling
        raise step_refusal(fs, steps, lambda finer: attempt(replace(experiment, oversampling=finer)) is not None)
    return outcome


def attempt(experiment: Experiment) -> Arrays | None:
    """What `run_experiment` gives; None where the step was too long to be stable."""
    rig, ms, steps = experiment.rig, experiment.ms, experiment.oversampling
    memory = at_rest(rig)
    drive = one_period(ms, steps, experiment.hold)
    periods: list[np.ndarray] = []
    for _ in range(experiment.n_discard + experiment.n_periods):
        out = advance(rig, memory, drive, 1 / (ms.fs * steps), steps)
        if out is None:
            return None
        periods = [*periods[-max(experiment.n_periods - 1, 1) :], out[:, 0].copy()]
    change = np.nan
    if len(periods) > 1:
        change = difference(periods[-2], periods[-1])
    y = np.stack(periods[-experiment.n_periods :])
    return {"y": y, "change": np.array(change), "lost": np.array(memory.state[packing.LOST])}


def difference(y: np.ndarray, of: np.ndarray) -> float:
    """Rms of y - of over the rms of `of`; zero where they are equal, as those of a mass that never moved."""
    return float(np.linalg.norm(y - of) / max(np.linalg.norm(of), np.finfo(float).tiny))


def steps_for(experiment: Experiment, accuracy: float) -> int:
    """Integration steps per sample with which halving the step changes the position by less than `accuracy`."""
    coarse = attempt(experiment)
    while True:
        finer = replace(experiment, oversampling=2 * experiment.oversampling)
        fine = attempt(finer)
        error = np.inf if coarse is None or fine is None else difference(coarse["y"], fine["y"])
        if error <= accuracy:
            return experiment.oversampling
        if finer.oversampling > MOST_STEPS:
            why = f"halving the step still changes the position by {error:.1e}"
            if np.isinf(error):
                why = "the step is still too long to be stable in sliding"
            raise ValueError(
                f"accuracy must be one that {MOST_STEPS} integration steps per sample reach ({why}), "
                f"got {accuracy:g}. Raise the sampling frequency"
            )
        experiment, coarse = finer, fine


def one_period(ms: Multisine, oversampling: int, hold: str) -> np.ndarray:
    """(n, 3) force at the begin, middle and end of every integration step of one period."""
    if hold == "zoh":
        return np.repeat(np.repeat(ms.u[0], oversampling)[:, np.newaxis], 3, axis=1)
    u = ms.sampled(2 * ms.n_samples * oversampling)[0]
    return np.stack([u[0::2], u[1::2], np.roll(u[0::2], -1)], axis=1)
