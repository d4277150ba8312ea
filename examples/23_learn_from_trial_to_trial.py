"""
23. Learn from trial to trial: a move that repeats, with friction
=================================================================

A machine that repeats a move repeats its error, and feedback is too slow to remove the error by
friction. Iterative learning control corrects the input of the next trial with the error of the last
one. The filter is designed for the whole set of plants from one record, on the friction rig and on
a simulated linear motor under its drive.
"""

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np
from scipy.signal import firwin

import nlfrf
import robust
from nlfrf.io import load_trace
from nlfrf.signals import AxisLimits
from robust import servo
from robust.plot import plot_contraction, plot_trials

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument(
    "--out", type=Path, default=Path("demo/23"), help="folder for files and the picture"
)
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)
warnings.simplefilter(
    "ignore", robust.DesignWarning
)  # two poles miss some of the axis: the misfit is in the radius

# %%
# Fixed before any filter: ten trials of a move of 1 mm and of 100 mm in 0.3 s, and the band of the
# error that counts.
TRIALS, BAND = 10, 40.0  # Hz


def move(distance, n, dt):
    """A point-to-point move, minimum jerk, from 0.1 s to 0.4 s."""
    s = np.clip((np.arange(n) * dt - 0.1) / 0.3, 0, 1)
    return distance * (10 * s**3 - 15 * s**4 + 6 * s**5)


def rms_in_band(error, dt):
    """Root mean square of what a low-pass without phase leaves of the error."""
    taps = firwin(2 * int(0.03 / dt) + 1, BAND, fs=1 / dt)
    return float(np.sqrt(np.mean(np.convolve(error, taps, "same") ** 2)))


def learn(learning, trial, n):
    """Ten trials: the error of each, the input of the next from it."""
    u, errors = np.zeros(n), []
    for _ in range(TRIALS):
        e = trial(u)
        errors.append(rms_in_band(e, learning.dt))
        u = learning.update(u, e)
    print(
        f"{errors[0] / errors[-1]:.0f} times lower [um]:",
        *(f"{1e6 * error:.2g}" for error in errors),
    )
    return np.array(errors)


# %%
# The rig: a record at a level that slides, a set, a PID from the FRF, and the filter. The move
# slides too.
rig, T, n = nlfrf.paper_rig(), 1e-3, 1000
ms = nlfrf.multisine("special-odd", fs=4096, n_samples=8192, f_min=2, f_max=250, rms=8.0, rng=1)
bla = nlfrf.identify(nlfrf.simulate(rig, ms, n_periods=2, oversampling=2))
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2, n_zeros=0), order=4)
K = robust.design_frf(model, "PID", M_S=2.0, dt=T).K
on_rig = robust.design_learning(model, K, omega_Q=2 * np.pi * 60)
print(f"--- friction rig ---\n{on_rig}")
r = move(1e-3, n, T)
rig_errors = learn(on_rig, lambda u: nlfrf.rig.run(rig, r, K, disturbance=u).e, n)

# %%
# The axis: set points that the drive plays in motion, its trace, a set, and the drive itself as the
# controller.
axis, limits = nlfrf.servo_axis("linear motor"), AxisLimits(force=1000, velocity=0.5, travel=0.6)
rough = nlfrf.rig.ServoAxis(motor_inertia=12, drive=replace(axis.drive, kv=20, kp=40, tn=0.05))
ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rng=3)
played = servo.design_experiment(rough, ms, rms=60, base_velocity=0.1, strokes=1, limits=limits)
nlfrf.save(played, out / "moving.csv")
servo.play_experiment(
    replace(axis, drive=rough.drive), out / "moving.csv", out / "moving-trace.csv"
)
record = load_trace(
    out / "moving-trace.csv", out / "moving.npz", u="force set point", y="position"
)[-1]
bla = nlfrf.identify(record)
model = robust.uncertainty(
    bla, robust.fit_nominal(bla, n_poles=2, n_zeros=0, delay="estimate"), order=4
)
drive = servo.cascade(axis.drive, output_unit="N")
on_axis = robust.design_learning(model, drive, omega_Q=2 * np.pi * 60)
print(f"\n--- servo axis ---\n{on_axis}")
set_point = move(0.1, 4000, 1 / 4000)


def trial(u):
    """One trial of the axis from rest, with a force that is added to that of the velocity loop."""
    run = nlfrf.rig.run(axis, {"position": set_point, "force": u})
    return set_point - run.position


axis_errors = learn(on_axis, trial, 4000)

# %%
# The picture: the largest factor over the set, and the errors.
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
plot_contraction(on_axis, ax=left)
plot_trials(rig_errors, ax=right)
plot_trials(axis_errors, ax=right)
for line, name in zip(right.get_lines(), ("friction rig", "servo axis"), strict=True):
    line.set_label(name)
right.get_lines()[1].set_color("C1")
right.legend()
figure.savefig(out / "learning.png", dpi=120)
