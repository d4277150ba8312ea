"""
13. A real motor bench, from file to controller
===============================================

A motor and a load joined by a flexible coupling (KU Leuven, published with the FdiTools toolbox;
the records are not part of this project). The input is an odd-odd multisine of current, 20 periods
of one second; the output is the motor angle. The detection lines of this grid cannot be corrected,
and the input is not clean.

::

    python examples/13_motor_bench.py --data FOLDER_WITH_motor_bench
"""

import argparse
import os
import sys
import warnings
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from nlfrf.plot import plot_bla, plot_input
from robust.plot import plot_check, plot_fit, plot_nyquist, plot_weight

parser = argparse.ArgumentParser(
    description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter
)
parser.add_argument("--data", type=Path, default=Path(os.environ.get("NLFRF_DATA", "data")))
parser.add_argument("--out", type=Path, default=Path("demo/13"), help="folder for the pictures")
args = parser.parse_args()
file, out = args.data / "motor_bench" / "MultisineTypeB.mat", args.out
if not file.is_file():
    print(f"skipped: there is no {file}; give the folder of the records by --data or NLFRF_DATA")
    sys.exit()
out.mkdir(parents=True, exist_ok=True)

# %%
# The record: current in, angle out. The first period is a transient.
cut = {"fs": 2500, "n_samples": 2500, "n_discard": 1}
record = nlfrf.load_record(
    file, u="iq_adx", y="theta_mx", hold="band-limited", **cut
)  # a measured current
print(
    f"{record.n_periods} periods of {record.n_samples} samples at {record.fs:g} Hz,"
    f" {record.lines.excited.size} lines"
)

# %%
# The BLA. identify warns that odd-odd detection lines read too low, and uses the roughness of the
# FRF instead.
with warnings.catch_warnings(record=True) as said:
    warnings.simplefilter("always")
    bla = nlfrf.identify(record)
print(bla)
for warning in said:
    print(fill(f"warning: {warning.message}", 100))
with warnings.catch_warnings():
    warnings.simplefilter("ignore")
    print(nlfrf.second_opinion(record))

# %%
# A model: the angle integrates twice, the coupling adds a resonance and an anti-resonance,
# electronics a delay.
scan = robust.models.scan_orders(bla, n_poles=(2, 4, 6), relative_degree=1, delay="estimate")
print(scan)
nominal = scan.fit
print(nominal)
model = robust.uncertainty(bla, nominal, order=6)
print(model)

# %%
# A position controller at 2.5 kHz with one sample of computation, by loop shaping, faster until the
# check refuses.
dt = 1 / record.fs
plant = robust.sampled(model.nominal, dt, dt)
accepted = None
for crossover in (10.0, 20.0, 30.0, 40.0):
    design = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * crossover))
    seen = robust.check(
        model, design.K, delay=dt, certify=False
    )  # a look at a grid; the proof comes for the last one
    print(
        f"crossover {crossover:3.0f} Hz: gamma {design.gamma:.2f}, max rs"
        f" {seen.curves.rs.max():.2f}"
    )
    if not seen.curves.rs.max() < 0.7:
        break
    accepted = design.K
assert accepted is not None, "no controller was accepted"
K = accepted
report = robust.check(model, K, delay=dt)

# %%
# Save the results.
print(report.summary)
robust.save(K, out / "controller.json", delay=dt)
robust.save(
    model, out / "model.json"
)  # robust report model.json controller.json makes a page of them
figure, axes = plt.subplots(3, 2, figsize=(17, 13), layout="constrained")
panels = [(plot_input, record), (plot_bla, bla), (plot_fit, nominal), (plot_weight, model)]
panels += [(plot_check, report), (plot_nyquist, report)]
for ax, (draw, what) in zip(axes.flat, panels, strict=True):
    draw(what, ax=ax)
figure.savefig(out / "motor.png", dpi=85)
print(f"wrote {out}/motor.png, model.json and controller.json")
