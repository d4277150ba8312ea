"""
5. Levels as a plant family: one controller for small and large motions
=======================================================================

A machine with friction is stiff in small motions and soft in large ones. Each level has its own
best linear approximation, and a controller for all levels needs a set that contains all of them.
The budget of its radius shows the part that is caused by the change of the machine with the level.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.plot import plot_budget, plot_fit, plot_set, plot_weight

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/05"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The same multisine at three levels, 20 dB apart: from creep under the friction to sliding. Four
# realisations each.
rig = nlfrf.paper_rig()
ms = nlfrf.multisine(fs=4096, n_samples=8192, f_min=1, f_max=140, n_realizations=4, rng=1)
study = nlfrf.level_study(rig, ms, [0.025, 0.25, 2.5])
print("level [N rms]   largest |G| at   |G| there [m/N]   distortion under |G|, median [dB]")
for level, bla, distortion in zip(study.rms, study.blas, study.distortion, strict=True):
    k = int(np.argmax(np.abs(bla.G)))
    print(
        f"{level:13.3g} {bla.f[k]:13.2f} Hz {abs(bla.G[k]):14.3g}"
        f" {10 * np.log10(np.median(distortion)):22.1f}"
    )
for low, high, growth in zip(study.rms[:-1], study.rms[1:], study.growth, strict=True):
    print(
        f"from {low:g} to {high:g} N the distortion grows by {np.median(growth):.0f} dB per 20 dB"
    )

# %%
# One nominal model for all three, and a set for each choice of levels.
cases = {
    "0.25 N alone": [study.blas[1]],
    "0.025 and 0.25 N": study.blas[:2],
    "all three": study.blas,
}
models, fits = {}, {}
for name, blas in cases.items():
    fits[name] = robust.fit_nominal(list(blas), n_poles=3, n_zeros=2)
    models[name] = model = robust.uncertainty(list(blas), fits[name], order=4)
    at = [int(np.argmin(np.abs(model.omega - 2 * np.pi * f))) for f in (10, 45, 59)]
    radius = ", ".join(f"{model.radius[k]:.2f}" for k in at)
    part = model.budget["level"]
    share = ", ".join(f"{100 * part[k] / model.radius[k]:.0f} %" for k in at)
    print(
        f"{name}: relative radius at 10, 45, 59 Hz {radius}\n  share caused by the change of level"
        f" {share}"
    )

# %%
# If the radius is above one, the set contains plants of either sign, and no controller can have
# gain there. So a family costs bandwidth. Find the fastest loop that the check accepts for each
# set, first on a grid.
CROSSOVERS = (1.0, 8.0, 64.0)
for name, model in models.items():
    plant = robust.sampled(model.nominal, 1e-3)
    accepted = None
    for crossover in CROSSOVERS:
        K = robust.ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * crossover)).K
        if not robust.check(model, K, certify=False).margins.rs > 1:
            break
        accepted = crossover, K
    if accepted is None:
        low = np.abs(robust.check(model, 0.0, certify=False).curves.radius[0])
        print(
            f"{name}: no integrating loop; the weight is {low:.2f} at low frequency. Schedule the"
            " controller."
        )
    else:
        report = robust.check(model, accepted[1])
        print(f"{name}: crossover up to {accepted[0]:g} Hz of {CROSSOVERS[-1]:g}; {report.verdict}")

figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
plot_fit(fits["all three"], ax=axes[0, 0])
plot_set(models["all three"], study.blas, ax=axes[0, 1])
plot_weight(models["all three"], ax=axes[1, 0])
plot_budget(models["all three"], ax=axes[1, 1])
figure.savefig(out / "family.png", dpi=90)
robust.save(models["all three"], out / "family.json")
print(f"wrote {out}/family.png and family.json")
