"""The experiment on a running drive, on the four simulated axes: spectra that are reached, levels
that are named.

python -m benchmarks.bench_experiment
"""

from __future__ import annotations

import sys
import tempfile
import warnings
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

import nlfrf
from nlfrf.io import load_trace
from nlfrf.signals import AxisLimits
from robust.servo import design_experiment, design_ramp, find_levels, play_experiment

N = 4000
PRESETS = {
    "linear motor": (0.15, 30),
    "belt": (0.15, 30),
    "ball screw": (0.05, 300),
    "joint": (0.5, 5),
}
RAMPS = (("position", 300), ("position", 60), ("force", 300), ("velocity", 150))


def traced(
    axis: nlfrf.rig.ServoAxis, experiment: Any, folder: Path
) -> tuple[Any, tuple[nlfrf.Record, ...]]:
    """What the simulated axis did, and the records of its trace."""
    nlfrf.save(experiment, folder / "play.csv")
    trace = play_experiment(axis, folder / "play.csv", folder / "trace.csv")
    return trace, load_trace(folder / "trace.csv", folder / "play.npz")


def spectra(record: nlfrf.Record) -> tuple[np.ndarray, np.ndarray]:
    """Force and position on the excited lines, mean over periods."""
    U, Y = (
        2 / N * np.fft.rfft(one.mean(axis=(0, 1)))[record.lines.excited]
        for one in (record.u, record.y)
    )
    return U, Y


def slips(axis: nlfrf.rig.ServoAxis, x: np.ndarray) -> np.ndarray:
    """(masses, elements) peak of each mass over the displacement at which an element of its
    friction slips.
    """
    laws = [law for law in (axis.motor_friction, axis.load_friction) if law is not None]
    peaks = np.abs(x - x.mean(axis=1, keepdims=True)).max(axis=1)
    return np.array(
        [peak * law.stiffness / law.strength for peak, law in zip(peaks, laws, strict=True)]
    )


def main(
    presets: tuple[str, ...] = tuple(PRESETS), ramps: tuple[tuple[str, int], ...] = RAMPS
) -> None:
    """Print both tables."""
    warnings.simplefilter("ignore", nlfrf.DataWarning)
    folder = Path(tempfile.mkdtemp())
    print(
        "preset, force of a line over that asked for: at rest from, to; in motion largest error;"
        " error of the FRF there"
    )
    for name in presets:
        axis = nlfrf.servo_axis(name)
        free = replace(axis, motor_friction=None, load_friction=None)
        velocity, rms = PRESETS[name]
        ratios, errors = [], [0.0]
        for motion in ({}, {"base_velocity": velocity, "strokes": 1}):
            ms = nlfrf.multisine(fs=axis.drive.fs, n_samples=N, f_min=2, f_max=300, rng=1)
            experiment = design_experiment(free, ms, rms=rms, **motion)
            for record in traced(axis, experiment, folder)[1]:
                U, Y = spectra(record)
                ratios.append(np.abs(U) / experiment.force_amplitude)
                if motion:
                    G = experiment.position_response / experiment.force_response
                    errors.append(
                        float(
                            np.max(
                                np.abs(Y / U - G)
                                / np.maximum(np.abs(G), 0.1 * np.median(np.abs(G)))
                            )
                        )
                    )
        moving = max(float(np.abs(one - 1).max()) for one in ratios[1:])
        print(
            f"{name:13} {ratios[0].min():.2f} {ratios[0].max():.1f}  {moving:.2%} "
            f" {max(errors):.2%}"
        )
    print(
        "preset, port, f_max: rms and peak over the slip of the weakest element at sticks, bends;"
        " strongest at slides"
    )
    for name in presets:
        axis = nlfrf.servo_axis(name)
        free = replace(axis, motor_friction=None, load_friction=None)
        most = 0.5 * axis.drive.limit * axis.force_constant
        limits = (
            AxisLimits(force=most, velocity=0.3)
            if axis.motion == "linear"
            else AxisLimits(force=most, velocity=1)
        )
        for port, f_max in ramps:
            ms = nlfrf.multisine(fs=axis.drive.fs, n_samples=N, f_min=2, f_max=f_max, rng=1)
            ramp = design_ramp(free, ms, limits=limits, port=port)
            levels = find_levels(traced(axis, ramp, folder)[1], ramp)
            row = [levels.reason]
            for rms, record, state in zip(
                levels.rms, levels.records, ("sticks", "bends", "slides"), strict=False
            ):
                ms = nlfrf.multisine(fs=record.fs, n_samples=N, f_min=3, f_max=0.98 * f_max, rng=2)
                experiment = design_experiment(record, ms, rms=rms, port=port, n_discard=4)
                trace, _ = traced(axis, experiment, folder)
                ratio = slips(axis, trace.x[:, 4 * N : 6 * N])
                row.append(f"{rms:8.3g} {ratio.min() if state == 'slides' else ratio.max():6.2f}")
            print(f"{name:13} {port:9} {f_max:4d} {'  '.join(row)}")


if __name__ == "__main__":
    sys.exit(main())
