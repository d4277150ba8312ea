"""
6. From a best linear approximation to weights
==============================================

A controller is designed for a model, and runs on the machine. The weight covers the difference:
noise, distortion, and the misfit of the model. This example makes each choice by a number.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.lti.lti import response
from robust.plot import plot_budget, plot_fit, plot_orders, plot_weight

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/06"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

ms = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, n_realizations=2, rng=1)
both = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2)
first, second = (
    nlfrf.identify(replace(both, u=both.u[m : m + 1], y=both.y[m : m + 1])) for m in (0, 1)
)

# %%
# How many poles? The fewest that allow a crossover of 20 Hz: the size of T_c times the radius stays
# below one half.
scan = robust.models.scan_orders(first, n_poles=range(1, 6), omega_c=2 * np.pi * 20)
print(scan)
nominal = scan.fit
print(nominal)

# %%
# The set: on every line a disc about the model that contains the FRF of a new realisation with 95
# %. The shares of its radius show which part to reduce.
model = robust.uncertainty(first, nominal, order=4)
print(model)
for name, part in model.budget.items():
    print(f"  {name:10s} {100 * np.mean(part / model.radius):5.1f} % of the radius on average")

# %%
# Which order of the weight? More order, less excess over the radius; but the controller check gets
# more states.
print("\norder of the weight   mean excess   largest excess")
for order in (0, 1, 2, 4):
    fit = robust.fit_weight(model.omega, model.radius, order=order)
    print(f"{order:12d} {fit.mean_excess_db:18.2f} dB {fit.max_excess_db:13.2f} dB")

# %%
# Which form? A relative radius for a plant that keeps its shape, an additive one near zeros, an
# inverse one where poles move. The form that needs the smaller radius at the peak of its own
# sensitivity leaves more room.
print("\nform                     radius at 10 Hz    at 59 Hz")
for form in ("multiplicative", "additive", "inverse-multiplicative"):
    try:
        other = robust.uncertainty(first, nominal, form=form, order=4)
    except ValueError as refusal:
        print(f"{form:22s} {refusal}")
        continue
    at = [int(np.argmin(np.abs(other.omega - 2 * np.pi * f))) for f in (10, 59)]
    print(f"{form:22s} {other.radius[at[0]]:14.3g} {other.radius[at[1]]:14.3g}")

# %%
# Validation: a second record, another realisation, compared with the model of the first.
seen = robust.validate(model, second)
print(f"\n{seen}")

# %%
# Weights by formula: the demand on the loop, and an uncertainty that was not measured, a delay of
# up to a millisecond.
w_P = robust.performance_weight(2 * np.pi * 2, M_S=2, A=1e-2)
w_delay = robust.models.delay_weight(1e-3)
for name, weight in (("|S| allowed", w_P), ("delay, as a radius", w_delay)):
    size = np.abs(response(weight, 2 * np.pi * np.array([1.0, 10.0, 100.0])))
    size = 1 / size if weight is w_P else size
    print(f"{name} at 1, 10, 100 Hz: {size[0]:.3g}, {size[1]:.3g}, {size[2]:.3g}")

figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
panels = ((plot_orders, scan), (plot_fit, nominal), (plot_weight, model), (plot_budget, model))
for ax, (draw, what) in zip(axes.flat, panels, strict=True):
    draw(what, ax=ax)
figure.savefig(out / "weights.png", dpi=90)
robust.save(model, out / "model.json")
print(f"wrote {out}/weights.png and model.json")
