"""
17. A measured steering mirror of three axes, from file to verdict
==================================================================

Three piezo actuators tilt and lift a mirror that is measured at three other points (KU Leuven,
CubeSpec fine steering mirror; Floren and others, ISMA 2024, CC BY 4.0; the records are not part of
this project). Two sets of three experiments, two periods each: the first set gives the matrix, its
bound and the model; the second set tests them.

::

    python examples/17_measured_mirror.py --data FOLDER_WITH_fine_steering_mirror
"""

import argparse
import os
import sys
import warnings
from pathlib import Path
from textwrap import fill

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from nlfrf.plot import plot_frm_bounds, plot_singular_values
from robust.plot import plot_check, plot_loop, plot_set

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--data", type=Path, default=Path(os.environ.get("NLFRF_DATA", "data")))
parser.add_argument("--out", type=Path, default=Path("demo/17"), help="folder for the pictures")
args = parser.parse_args()
folder, out = args.data / "fine_steering_mirror", args.out
if not folder.is_dir():
    print(f"skipped: there is no {folder}; give the folder of the records by --data or NLFRF_DATA")
    sys.exit()
out.mkdir(parents=True, exist_ok=True)

# %%
# The records, (samples, channels, experiments, periods), to (channels, experiments, periods,
# samples).
FS = 6400.0
u, y = (np.load(folder / f"{name}_300mV_train.npy").transpose(1, 2, 3, 0) for name in "uy")
names = {"inputs": ("piezo 1", "piezo 2", "piezo 3"), "outputs": ("point 1", "point 2", "point 3")}


def matrix(experiments, first, last):
    lines = nlfrf.signals.LineGrid(excited=np.arange(first, last + 1))
    return nlfrf.identify(
        nlfrf.Record(u=u[:, experiments], y=y[:, experiments], fs=FS, lines=lines, **names),
        transient="none",
    )


# %%
# The matrix and its bound from one set, and the share of the other, independent set inside the
# bound.
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    one, other = (matrix(half, 1, 3839) for half in (slice(0, 3), slice(3, 6)))
    first, second = (matrix(half, 16, 1280) for half in (slice(0, 3), slice(3, 6)))
print(
    *(fill(f"warning: {message}", 100) for message in sorted({str(w.message) for w in said})),
    sep="\n",
)
print(f"\n{first}\n")
for name, frm, new in (("first", one, other), ("second", other, one)):
    apart = new.G - frm.G
    left, right = (np.moveaxis(side, 2, 0) for side in frm.block(of="realization"))
    Z = np.linalg.solve(left, np.moveaxis(apart, 2, 0)) @ np.linalg.inv(right)
    entries = np.mean(np.abs(apart) < frm.bound(of="realization"))
    matrices = np.mean(np.linalg.norm(Z, 2, (1, 2)) < 1)
    print(f"the 95 % bound of the {name} set, on {frm.f.size} lines, contains of the other set")
    print(f"  {100 * entries:.1f} % of the entries and {100 * matrices:.1f} % of the matrices")

# %%
# A nominal with twelve states, and a set with one full block around it, chosen before the verdict.
fit = robust.fit_nominal(
    first.every(8), n_poles=12, dt=1 / FS
)  # an eighth of the lines tells the modes
model = robust.uncertainty(first, fit, form="additive", order=4)
print(f"\n{fit}\n{model}\n{robust.validate(model, second)}\n")


# %%
# Three integrators behind the inverse of the static matrix, rolled off before the modes at 636 Hz
# and above.
def controller(crossover):
    integrator = control.ss(control.tf([2 * np.pi * crossover / FS, 0], [1, -1], 1 / FS))
    lag = control.ss(robust.lti.discretize(control.tf([1], [1 / (2 * np.pi * 150), 1]), 1 / FS))
    turned = control.ss([], [], [], np.linalg.inv(np.real(fit.G(1))), 1 / FS)
    return turned * control.append(*[integrator * lag * lag] * 3)


loops = {f"{crossover} Hz": controller(crossover) for crossover in (70, 140)}
reports = {name: robust.check(model, K) for name, K in loops.items()}
print(*(f"--- {name} ---\n{report}\n" for name, report in reports.items()), sep="\n")
worst = robust.analysis.breaking_perturbation(model, loops["70 Hz"])
sizes = [
    np.abs((worst.plant(x) * loops["70 Hz"]).feedback(np.eye(3)).poles()).max()
    for x in (0.99, 1.01)
]
print(
    f"largest pole with 0.99 and 1.01 of the breaking perturbation: {sizes[0]:.5f} and"
    f" {sizes[1]:.5f}"
)

figure, axes = plt.subplots(2, 2, figsize=(17, 11), layout="constrained")
plot_singular_values(first, of="realization", ax=axes[0, 0])
plot_loop(robust.analysis.loop_gains(fit.G, loops["70 Hz"], omega=model.omega), ax=axes[0, 1])
for ax, (name, report) in zip(axes[1], reports.items(), strict=True):
    plot_check(report, ax=ax).set_title(f"{name}: {report.verdict}")
figure.savefig(out / "verdict.png", dpi=70)
for name, made in (("mirror", plot_set(model, first)), ("bounds", plot_frm_bounds(first))):
    made[0, 0].figure.savefig(out / f"{name}.png", dpi=80)
print(f"wrote mirror.png, bounds.png and verdict.png in {out}")
