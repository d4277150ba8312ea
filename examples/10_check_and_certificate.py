"""
10. Check a controller, and refuse one
======================================

Three controllers for one machine. The first is accepted, and the report shows what was proved. The
second is the integrator that shaped the first, with the same crossover. It is stable with the
nominal plant but refused, because a plant of the measured set makes the loop unstable; that plant
is simulated. The third is not stable with the nominal plant, so it has no margin.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.plot import plot_check, plot_family, plot_nyquist

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/10"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The machine: the friction rig, one record, a set of plants around a model of three poles.
ms = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, rng=2)
bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=3), order=4)

# %%
# Loop shaping at 1 kHz with a millisecond of computation; the integrator from which it started;
# twice this integrator.
dt, delay = 1e-3, 1e-3
plant = robust.sampled(model.nominal, dt, delay)
integrator = robust.shaping.crossover_weight(plant, 2 * np.pi * 8)
K_shaped = robust.ncfsyn(plant, integrator).K
w_P = robust.performance_weight(2 * np.pi * 0.9, M_S=2.6, A=1e-2)

reports = {}
for name, K in (
    ("shaped", K_shaped),
    ("integrator", integrator),
    ("twice the integrator", 2 * integrator),
):
    reports[name] = report = robust.check(model, K, w_P=w_P, delay=delay)
    print(f"--- {name} ---\n{report if name == 'shaped' else report.summary}\n")

# %%
# The certificate is more than a curve on a grid: its own numbers are checked at all frequencies.
for certificate in reports["shaped"].proofs.certificates:
    print(
        f"{certificate.subject}: {certificate.holds}, {certificate.method},"
        f" {len(certificate.intervals)} intervals"
    )

# %%
# The evidence for the refusal: the plant of the set that makes the loop unstable, and its motion.
worst = robust.worst_case(model, integrator, delay=delay)
inside = model.distance(worst.plant).max()
where = worst.omega_worst / 2 / np.pi
print(
    f"\na plant with |Delta| = {abs(worst.delta):.3f} at {where:.1f} Hz puts a pole on the circle"
)
print(
    f"the set contains this plant: its error is at most {inside:.3f} of the weight on the measured"
    " lines"
)
t = np.arange(0, 2, dt)
figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
for name, machine in (("nominal plant", model.nominal), ("that plant of the set", worst.plant)):
    y = control.step_response(
        control.feedback(integrator * robust.sampled(machine, dt, delay), 1), t
    ).outputs
    axes[0, 0].plot(t, y, lw=1, label=f"integrator, {name}")
    print(
        f"integrator, {name}: after two seconds y still oscillates by {np.ptp(y[-200:]):.3f} of the"
        " step"
    )
axes[0, 0].set(xlabel="time [s]", ylabel="y / r", title="A step of the reference")
axes[0, 0].legend()
plot_check(reports["integrator"], ax=axes[0, 1])
plot_nyquist(reports["integrator"], ax=axes[1, 0])
plot_family(robust.analysis.sample_loops(model, K_shaped, 30, delay=delay, rng=1), ax=axes[1, 1])
figure.savefig(out / "check.png", dpi=90)

# %%
# "Statistically" is a restriction: a distortion bound is no stability proof for the nonlinear
# machine. If you know more (a sector, levels that contain every motion), claim it by
# perturbation="operator".
print(f"wrote {out}/check.png")
