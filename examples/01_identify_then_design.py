"""
1. From one record of a machine with friction to a controller with a checked claim
==================================================================================

::

    python examples/01_identify_then_design.py                      the built-in rig
    python examples/01_identify_then_design.py FILE --input NAME --output NAME --fs HZ --period SAMPLES
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from nlfrf.plot import plot_bla, plot_levels, plot_phase
from robust.plot import plot_check, plot_loop, plot_set, plot_weight

parser = argparse.ArgumentParser()
parser.add_argument(
    "file", nargs="?", help="measured record; default: a simulation of the built-in rig"
)
parser.add_argument("--input", default="u")
parser.add_argument("--output", default="y")
parser.add_argument("--fs", type=float)
parser.add_argument("--period", type=int)
parser.add_argument("--discard", type=int, default=1)
parser.add_argument(
    "--poles", type=int, help="of the nominal model; default: as many as the data need"
)
parser.add_argument("--bandwidth", type=float, default=20.0, help="crossover of the loop [Hz]")
parser.add_argument("--sample-time", type=float, default=1e-3, help="of the controller [s]")
parser.add_argument("--out", type=Path, default=Path("demo"))
args = parser.parse_args()
args.out.mkdir(parents=True, exist_ok=True)

# %%
# One record: a special-odd multisine through the machine, two periods of it, and a little sensor
# noise.
if args.file:
    record = nlfrf.load_record(
        args.file,
        u=args.input,
        y=args.output,
        fs=args.fs,
        n_samples=args.period,
        n_discard=args.discard,
    )
else:
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=150, rms=0.25, rng=2
    )
    print(
        "simulating the rig: a mass on a spring with friction (the first run compiles the"
        " integrator) ..."
    )
    record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, n_discard=2)
    noise = 1e-8 * np.random.default_rng(2).standard_normal(record.y.shape)
    record = replace(record, y=record.y + noise)
nlfrf.save(record, args.out / "record.npz")

# %%
# Its best linear approximation, with the level of its distortion and a bound.
bla = nlfrf.identify(record)
nlfrf.save(bla, args.out / "bla.npz")
print(bla)

# %%
# A nominal plant with the fewest poles whose misfit is within the scatter of the lines, and the
# uncertainty that covers the bound.
orders = range(1, 6) if args.poles is None else [args.poles]
scan = robust.models.scan_orders(bla, n_poles=orders)
nominal = scan.fit
left = [
    f"{n} poles {ratio:.3g}"
    for n, ratio in zip(scan.n_poles, scan.cost / scan.expected_cost, strict=True)
]
print(f"{scan.best} poles taken; squared error over that of scatter alone:\n  {', '.join(left)}")
model = robust.uncertainty(bla, nominal, order=4)
robust.save(model, args.out / "model.json")
print(nominal)

# %%
# A sampled controller by H-infinity loop shaping, for the sampled plant.
plant = robust.sampled(model.nominal, args.sample_time)
design = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * args.bandwidth))
robust.save(design.K, args.out / "controller.json")

# %%
# The check: what holds for the loop, and for which perturbations.
w_P = robust.performance_weight(2 * np.pi * args.bandwidth / 6, M_S=2.5, A=1e-2)
report = robust.check(model, design.K, w_P=w_P)
robust.reports.write_report(
    args.out / "report.html",
    model,
    design.K,
    bla=bla,
    record=record,
    nominal=nominal,
    report=report,
)
(args.out / "report.txt").write_text(f"{bla}\n{nominal}\n{report}\n")
print(report.summary)

pictures = {
    "bla.png": ((plot_bla, bla), (plot_phase, bla), (plot_levels, bla)),
    "model.png": ((plot_set, model, bla), (plot_weight, model)),
    "check.png": ((plot_loop, report), (plot_check, report)),
}
for name, panels in pictures.items():
    figure, axes = plt.subplots(
        len(panels), 1, figsize=(9, 4.5 * len(panels)), layout="constrained"
    )
    for ax, (draw, *what) in zip(axes, panels, strict=True):
        draw(*what, ax=ax)
    figure.savefig(args.out / name, dpi=110)
files = ", ".join(sorted(p.name for p in args.out.glob("*.[npj]*")))
print(
    f"{args.out}:\n  report.html and report.txt have the whole result; in the same folder:\n "
    f" {files}"
)
