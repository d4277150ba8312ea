"""The paper's side remarks on the excitation, tried: which signals give the same best linear approximation.

The power spectrum is the same for all: independent values, each held for 1/64 s, so long that the rig feels
their distribution and not the sum of many of them.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import numpy as np

from nlfrf.bench.rig import Rig, advance, at_rest
from nlfrf.bench.runs import Arrays, run_all
from nlfrf.bench.simulate import Experiment, run_experiment
from nlfrf.bench.steps import step_refusal
from nlfrf.excitation.lines import LineGrid
from nlfrf.records.record import Record
from nlfrf.shared.values import value
from nlfrf.studies.ensembles import F0, FS, Ensemble, ensemble, normalised_difference, paper_multisine
from nlfrf.studies.findings import Finding

__all__ = ["SIGNALS", "side_remarks"]


CLOCK = 64.0
RMS = 0.5
#: Lines on which the held signals are compared: below the clock's Nyquist frequency.
COMPARED = np.arange(4, round(0.45 * CLOCK / F0))
SIGNALS = ("multisine", "another multisine", "Gaussian", "uniform", "binary")


@value
class Held:
    """One period of held values on a rig."""

    rig: Rig
    force: np.ndarray
    n_discard: int


def held_values(signal: str, n_realizations: int, rng: np.random.Generator) -> np.ndarray:
    """(M, n) values of one period, white, of rms 0.5 N."""
    n = round(CLOCK / F0)
    shape = (n_realizations, n)
    if signal == "Gaussian":
        return RMS * rng.standard_normal(shape)
    if signal == "uniform":
        return RMS * rng.uniform(-np.sqrt(3), np.sqrt(3), shape)
    if signal == "binary":
        return RMS * rng.choice([-1.0, 1.0], shape)
    spectrum = np.zeros((n_realizations, n // 2 + 1), dtype=complex)
    spectrum[:, 1 : n // 2] = np.exp(2j * np.pi * rng.uniform(size=(n_realizations, n // 2 - 1)))
    force = np.fft.irfft(spectrum, n)
    return RMS * force / force.std(axis=1, keepdims=True)


def run_held(held: Held) -> Arrays:
    """Integrate one period of held values to steady state, with 4096 steps a second; runs in a worker."""
    n = round(FS / F0)
    force = np.repeat(held.force, n // held.force.size)
    drive = np.repeat(force[:, np.newaxis], 3, axis=1)
    memory, out = at_rest(held.rig), None
    for _ in range(held.n_discard + 1):
        out = advance(held.rig, memory, drive, 1 / FS, 1)
        if out is None:
            raise step_refusal(FS, 1, lambda finer: False)
    assert out is not None
    return {"u": force, "y": out[:, 0]}


def held_ensemble(rig: Rig, signal: str, n_realizations: int, rng: np.random.Generator, **options: Any) -> Ensemble:
    """The ensemble of one held signal."""
    values = held_values(signal, n_realizations, rng)
    results = run_all(run_held, [Held(rig=rig, force=row, n_discard=2) for row in values], **options)
    u, y = (np.stack([result[name] for result in results])[:, np.newaxis, :] for name in ("u", "y"))
    return ensemble(Record(u=u, y=y, fs=FS, lines=LineGrid(excited=COMPARED)))


def random_amplitudes(rig: Rig, n_realizations: int, rng: np.random.Generator, **options: Any) -> Ensemble:
    """The odd multisine at level 1 with amplitudes that are random too, uniform on 0 to sqrt(3) times theirs."""
    ms = paper_multisine("odd", 1, n_realizations=n_realizations, rng=rng)
    amplitude = ms.amplitude * np.sqrt(3) * rng.uniform(size=ms.phase.shape)
    experiments = [
        Experiment(
            rig=rig,
            ms=replace(ms, amplitude=np.maximum(amplitude[m], 1e-12), phase=ms.phase[m : m + 1]),
            n_periods=1,
            n_discard=2,
            oversampling=1,
            hold="band-limited",
        )
        for m in range(n_realizations)
    ]
    results = run_all(run_experiment, experiments, **options)
    y = np.stack([result["y"] for result in results])
    u = np.stack([experiment.ms.u for experiment in experiments])
    return ensemble(Record(u=u, y=y, fs=ms.fs, lines=ms.lines))


def side_remarks(
    rig: Rig,
    odd: Ensemble,
    *,
    rng: np.random.Generator,
    progress: Callable[[int, int], Any] | None = None,
    **options: Any,
) -> tuple[list[Finding], dict[str, Ensemble]]:
    """S1 to S3, and the ensembles behind them; `odd` is the odd multisine at level 1 with random phases only."""
    m = odd.n_realizations
    ensembles: dict[str, Ensemble] = {}
    total = m * (len(SIGNALS) + 1)

    def shifted(done: int) -> Callable[[int, int], Any] | None:
        return None if progress is None else lambda now, _: progress(done + now, total)

    for i, signal in enumerate(SIGNALS):
        ensembles[signal] = held_ensemble(rig, signal, m, rng, progress=shifted(i * m), **options)
    random = random_amplitudes(rig, m, rng, progress=shifted(len(SIGNALS) * m), **options)
    ensembles["random amplitudes"] = random
    difference = {s: normalised_difference(ensembles["multisine"], ensembles[s]) for s in SIGNALS[1:]}
    return judge_remarks(difference, normalised_difference(odd, random)), ensembles


def judge_remarks(difference: dict[str, float], amplitudes: float) -> list[Finding]:
    """The findings S1 to S3 from the differences between the excitations."""
    same, other = {s: difference[s] for s in SIGNALS[1:3]}, {s: difference[s] for s in SIGNALS[3:]}
    return [
        Finding(
            name="S1",
            claim="Gaussian noise of the same power spectrum gives the same BLA as a random-phase multisine.",
            paper="no number",
            ours={f"multisine and {s}, normalised squared difference": q for s, q in same.items()},
            criterion="between 0.7 and 1.3 (1 where they are the same)",
            holds=all(0.7 <= q <= 1.3 for q in same.values()),
        ),
        Finding(
            name="S2",
            claim="Uniform and binary noise of the same power spectrum give another BLA.",
            paper="no number",
            ours={f"multisine and {s}, normalised squared difference": q for s, q in other.items()},
            criterion="more than 1.5, which chance does not give",
            holds=all(q > 1.5 for q in other.values()),
            remark="Only where the rig feels the distribution: with a clock of 256 Hz the spring and the mass sum so "
            "many values that the position is all but Gaussian whatever the force.",
        ),
        Finding(
            name="S3",
            claim="Random amplitudes beside random phases change nothing in expectation.",
            paper="no number",
            ours={"odd grid at level 1, normalised squared difference": amplitudes},
            criterion="between 0.7 and 1.3 (1 where they are the same)",
            holds=0.7 <= amplitudes <= 1.3,
        ),
    ]
