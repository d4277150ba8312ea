"""Experiments on a rig: every realisation of a multisine, run to steady state, several at a time."""

from __future__ import annotations

import warnings
from concurrent.futures import Executor
from dataclasses import replace
from typing import Any, overload

import numpy as np

from nlfrf.bench.rig import Rig, advance, at_rest
from nlfrf.bench.runs import Arrays, Progress, run_all
from nlfrf.bench.steps import refuse_long_step, step_refusal, warn_coarse
from nlfrf.excitation.multisine import Multisine
from nlfrf.excitation.orthogonal import OrthogonalMultisine
from nlfrf.friction import kernel_data as packing
from nlfrf.friction.hysteresis import warn_lost
from nlfrf.records.record import Record
from nlfrf.records.several import MultiRecord
from nlfrf.shared.arguments import DataWarning, integer, of_kind, one_of, positive
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
    ms: Multisine | OrthogonalMultisine
    n_periods: int
    n_discard: int
    oversampling: int
    hold: str


@overload
def simulate(
    rig: Rig,
    ms: Multisine,
    *,
    n_periods: int = ...,
    n_discard: int = ...,
    oversampling: int = ...,
    hold: str = ...,
    accuracy: float | None = ...,
    executor: Executor | None = ...,
    progress: Progress | None = ...,
    resume: Any = ...,
) -> Record: ...


@overload
def simulate(
    rig: Rig,
    ms: OrthogonalMultisine,
    *,
    n_periods: int = ...,
    n_discard: int = ...,
    oversampling: int = ...,
    hold: str = ...,
    accuracy: float | None = ...,
    executor: Executor | None = ...,
    progress: Progress | None = ...,
    resume: Any = ...,
) -> MultiRecord: ...


def simulate(
    rig: Rig,
    ms: Multisine | OrthogonalMultisine,
    *,
    n_periods: int = 1,
    n_discard: int = 2,
    oversampling: int = 1,
    hold: str = "band-limited",
    accuracy: float | None = None,
    executor: Executor | None = None,
    progress: Progress | None = None,
    resume: Any = None,
) -> Record | MultiRecord:
    """Run every realisation of a multisine through a rig, from rest to steady state: force in, position out.

    Parameters
    ----------
    rig : Rig
        The machine.
    ms : Multisine, or OrthogonalMultisine for a rig of several inputs
        The forces [N], M realisations or experiments of N samples.
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
    Record, or MultiRecord of an OrthogonalMultisine
        u, y (M, P, N), or with an axis of channels in front, with the lines of the multisine and the names of the rig.

    Raises
    ------
    ValueError
        A multisine of other inputs than the rig has; a step too long to be stable, with the oversampling that would do;
        an accuracy that is not reached; an executor that dies; numbers out of range.

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
    of_kind("rig", rig, Rig)
    of_kind("ms", ms, Multisine, OrthogonalMultisine)
    experiment = Experiment(
        rig=rig,
        ms=ms,
        n_periods=integer("n_periods", n_periods, least=1),
        n_discard=integer("n_discard", n_discard, least=0),
        oversampling=integer("oversampling", oversampling, least=1),
        hold=one_of("hold", hold, ("band-limited", "zoh")),
    )
    refuse_other_inputs(rig, ms)
    n_runs = ms.phase.shape[-2]
    realizations = [replace(experiment, ms=replace(ms, phase=ms.phase[..., m : m + 1, :])) for m in range(n_runs)]
    if accuracy is None:
        refuse_long_step(rig.stable_step, ms.fs, oversampling)
        warn_coarse(rig.poles(1.0), ms.fs, oversampling)
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
    return recorded(rig, ms, np.stack([outcome["y"] for outcome in outcomes], axis=-3), hold)


def run_experiment(experiment: Experiment) -> Arrays:
    """Integrate one realisation from rest; runs in a worker.

    Gives y (P, N) or (n_y, P, N), the change from the last period but one to the last (rms over rms; nan where there is
    only one), and how many turning points were forgotten for lack of memory.
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
        periods = [*periods[-max(experiment.n_periods - 1, 1) :], measured(experiment, out[:, 0])]
    change = np.nan
    if len(periods) > 1:
        change = difference(periods[-2], periods[-1])
    y = np.stack(periods[-experiment.n_periods :], axis=-2)
    return {"y": y, "change": np.array(change), "lost": np.array(memory.state[..., packing.LOST].sum())}


def measured(experiment: Experiment, x: np.ndarray) -> np.ndarray:
    """(N,) position of the only axis or at the only sensor, or (n_y, N) of several, from those of the axes."""
    if not experiment.rig.several:
        return x.copy()
    y: np.ndarray = experiment.rig.sensors @ x.T
    return y if isinstance(experiment.ms, OrthogonalMultisine) else y[0]


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


def refuse_other_inputs(rig: Rig, ms: Multisine | OrthogonalMultisine) -> None:
    """Refuse a multisine that does not drive the inputs that the rig has."""
    if isinstance(ms, OrthogonalMultisine):
        if not rig.several or rig.n_inputs != ms.n_inputs:
            raise ValueError(f"ms must drive {rig.n_inputs} inputs, as the rig has, got {ms.n_inputs}")
    elif (rig.n_inputs, rig.n_outputs) != (1, 1):
        raise ValueError(
            f"ms must be made with n_inputs={rig.n_inputs} for a rig of {rig.n_inputs} inputs and {rig.n_outputs} "
            "outputs, got one of a single input"
        )


def recorded(rig: Rig, ms: Multisine | OrthogonalMultisine, y: np.ndarray, hold: str) -> Record | MultiRecord:
    """What was measured, with the names and units of the rig."""
    u = np.broadcast_to(ms.u[..., np.newaxis, :], (*ms.u.shape[:-1], *y.shape[-2:]))
    if isinstance(ms, OrthogonalMultisine):
        return MultiRecord(u=u, y=y, fs=ms.fs, lines=ms.lines, inputs=rig.inputs, outputs=rig.outputs, hold=hold)
    names = {"u_name": rig.inputs[0], "y_name": rig.outputs[0], "u_unit": "N", "y_unit": "m"}
    return Record(u=u, y=y, fs=ms.fs, lines=ms.lines, hold=hold, **names)


def one_period(ms: Multisine | OrthogonalMultisine, oversampling: int, hold: str) -> np.ndarray:
    """(n, 3) or (n, 3, n_u) force at the begin, middle and end of every integration step of one period."""
    if hold == "zoh":
        u = np.repeat(ms.u[..., 0, :].T, oversampling, axis=0)
        return np.stack([u, u, u], axis=1)
    u = ms.sampled(2 * ms.n_samples * oversampling)[..., 0, :].T
    return np.stack([u[0::2], u[1::2], np.roll(u[0::2], -1, axis=0)], axis=1)
