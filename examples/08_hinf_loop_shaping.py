"""
8. H-infinity loop shaping, compared with mixed sensitivity
===========================================================

In loop shaping, weights give the loop gain, and the controller robustly stabilises the shaped
plant. gamma_min shows beforehand whether the plant allows this shape. Mixed sensitivity starts from
the demands.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.plot import plot_check, plot_loop

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/08"), help="folder for the pictures")
(out := parser.parse_args().out).mkdir(parents=True, exist_ok=True)

# %%
# The plant of a controller at 1 kHz with half a millisecond of computation, and the set around it.
ms = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, rng=2)
bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=3), order=4)
dt, delay = 1e-3, 5e-4
plant = robust.sampled(model.nominal, dt, delay)

# %%
# How fast? With gamma_min under 4 the shape is possible; 1/gamma is the coprime margin of the loop.
# max rs is the robust-stability measure with the measured set.
print("crossover   gamma_min   margin   max rs")
designs = {}
for crossover in (5.0, 10.0, 20.0, 40.0):
    W1 = robust.shaping.crossover_weight(plant, 2 * np.pi * crossover)
    design = robust.ncfsyn(plant, W1)
    rs = robust.check(model, design.K, delay=delay, certify=False).curves.rs.max()
    print(f"{crossover:6.0f} Hz {design.gamma_min:11.2f} {1 / design.gamma:8.2f} {rs:8.2f}")
    designs[crossover] = design

# %%
# The nu-gap is the distance of two plants for a controller: a loop with a larger margin is stable
# with both. Friction makes the rig softer at a higher level. With the same shaping this is a small
# gap, but a large change of the FRF.
louder = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.5, rng=2)
bla_loud = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), louder, n_periods=2))
other = robust.sampled(robust.fit_nominal(bla_loud, n_poles=3).G, dt, delay)
W1 = robust.shaping.crossover_weight(plant, 2 * np.pi * 10)
change, gap = np.max(np.abs(bla_loud.G / bla.G - 1)), robust.margins.nu_gap(plant * W1, other * W1)
print(
    f"\ntwice the level: the FRF changes by up to {100 * change:.0f} %, the shaped plants are"
    f" {gap:.2f} apart"
)

# %%
# Mixed sensitivity for the same plant: demands on S and K S, and on T from the measured set. Under
# 1 all are met.
stiffness = 1 / abs(bla.G[0])
w_P = robust.performance_weight(2 * np.pi * 5, M_S=2.5, A=1e-2)
mixed = robust.mixsyn(model, w_P, w_u=1 / (20 * stiffness), dt=dt, delay=delay)
print(
    f"\nmixed sensitivity: gamma {mixed.gamma:.2f}, at best {mixed.gamma_min:.2f},"
    f" {mixed.K.nstates} states"
)

# %%
# Both controllers, checked with the whole set and the same demand.
figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
for row, (name, K) in zip(
    axes,
    {"loop shaping, 10 Hz": designs[10.0].K, "mixed sensitivity": mixed.K}.items(),
    strict=True,
):
    report = robust.check(model, K, w_P=w_P, delay=delay)
    print(f"\n--- {name} ---\n{report.summary}")
    plot_loop(report, ax=row[0])
    row[0].set_title(name)
    plot_check(report, ax=row[1])
figure.savefig(out / "hinf.png", dpi=90)
robust.save(mixed.K, out / "mixed.json", delay=delay)
print(f"wrote {out}/hinf.png and mixed.json")
