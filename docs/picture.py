"""The pictures of the README and of the page on servo axes: `make picture`."""

from __future__ import annotations

from pathlib import Path
from tempfile import TemporaryDirectory

import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot as plt
from matplotlib.figure import Figure

import nlfrf
import robust
from docs.gallery import outputs
from nlfrf.plot import plot_bla, plot_blas
from nlfrf.rig import Drive
from nlfrf.signals import AxisLimits
from robust import servo
from robust.plot import plot_friction_force, plot_nyquist
from robust.servo import design_experiment, design_ramp, play_experiment
from robust.servo.checking.friction import force_over_position

STATIC = Path(__file__).resolve().parent / "_static"


def draw_result() -> None:
    """One record, its BLA and bound; the loop designed on it, with every plant the record
    allows.
    """
    folder = outputs("01_identify_then_design")
    bla = nlfrf.load(folder / "bla.npz")
    report = robust.check(
        robust.load(folder / "model.json"),
        robust.load(folder / "controller.json"),
        certify=False,
    )
    figure, (left, right) = plt.subplots(
        1, 2, figsize=(11, 4.9), layout="constrained", gridspec_kw={"width_ratios": [1.55, 1]}
    )
    plot_bla(bla, ax=left)
    left.set_title("One record of a machine with friction: its FRF and the bound")
    plot_nyquist(report, ax=right)
    right.set_title("The loop, with every plant in the set")
    save(figure, "result.png")


def draw_servo_axis() -> None:
    """A simulated axis with friction, played at rest and in motion: its FRF, and the friction that
    was read.
    """
    axis = nlfrf.servo_axis("linear motor")
    limits = AxisLimits(force=400, travel=0.5)
    band = {"fs": 4000, "n_samples": 4000, "f_min": 9, "rng": 1}
    ramp = design_ramp(axis, nlfrf.multisine(f_max=100, **band), rms=60, n_levels=16, limits=limits)
    moving = design_experiment(
        axis, nlfrf.multisine(f_max=400, **band), base_velocity=0.1, strokes=1, limits=limits
    )
    gains = Drive(
        fs=4000,
        kv=100,
        kp=143,
        kp_unit="A/(m/s)",
        tn=0.01,
        torque_constant=52.8,
        lag=0.3e-3,
        delay_periods=1,
    )
    with TemporaryDirectory() as name:
        traces = []
        for kind, experiment in (("at rest", ramp), ("in motion", moving)):
            played, trace = (Path(name, f"{kind}{end}.csv") for end in ("", " trace"))
            nlfrf.save(experiment, played)
            play_experiment(axis, played, trace)
            traces.append(trace)
        records, labels, conditions = servo.read_experiments(traces, [ramp, moving], gains)
    found = servo.check(records, gains, names=labels, conditions=conditions)
    labels = [label.replace(" trace.csv", ",") for label in labels]
    figure, (left, right) = plt.subplots(1, 2, figsize=(12, 5.4), layout="constrained")
    plot_blas([nlfrf.identify(record) for record in records], labels, ax=left)
    fit = found.friction.fit
    loops = {
        label: force_over_position(record, fit)
        for label, record in zip(labels[:3], records, strict=False)
    }
    plot_friction_force(loops, fit, ax=right)
    save(figure, "servo_axis.png")


def save(figure: Figure, name: str) -> None:
    """Write a picture and say how large it is."""
    figure.savefig(STATIC / name, dpi=80)
    print(f"wrote {STATIC / name}: {(STATIC / name).stat().st_size / 1024:.0f} kB")


if __name__ == "__main__":
    draw_result()
    draw_servo_axis()
