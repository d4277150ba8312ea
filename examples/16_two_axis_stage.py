"""
16. A stage of two axes: a set of experiments, a verdict on a controller matrix, the machine
============================================================================================

Two masses on springs, coupled, with friction on both axes, measured at two points that mix them.
Two experiments with both inputs on give the frequency response matrix and a bound: for its entries,
and for the matrix as a whole.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/16"), help="folder for the picture")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

FS, N = 512.0, 2048
# or nlfrf.rig.Rig(mass=..., stiffness=..., damping=..., friction=[..., ...], sensors=...)
stage = nlfrf.rig.two_axis_stage()

# %%
# Two experiments, each with both forces; one period to settle, two to keep, and a little noise.
ms = nlfrf.multisine(
    "random-odd",
    fs=FS,
    n_samples=N,
    f_min=2,
    f_max=100,
    rms=(6.0, 8.0),
    n_inputs=2,
    n_draws=50,
    rng=1,
)
record = nlfrf.simulate(stage, ms, n_periods=2, n_discard=3, oversampling=8, hold="zoh")
noise = np.random.default_rng(2).standard_normal(record.y.shape)
record = replace(record, y=record.y + 1e-3 * record.y.std() * noise)
frm = nlfrf.identify(record)

# %%
# A nominal with four states, and the set around it with one disc for each entry, chosen before the
# verdict.
fit = robust.fit_nominal(frm, n_poles=4, dt=1 / FS)
model = robust.uncertainty(frm, fit, form="elements", order=4)
print(f"{frm}\n\n{fit}\n{model}\n")


# %%
# One PID for each axis. The verdict holds for every plant of the set, with the whole matrix.
def controller(kp, kd, ki):
    axes = zip(kp, kd, ki, strict=True)
    return control.append(
        *(robust.shaping.pid(p, i, d, filter_time=0.5 / FS, dt=1 / FS) for p, d, i in axes)
    )


pids = {
    "careful": controller([1e3, 4e3], [10.0, 30.0], [4e5, 2e6]),
    "greedy": controller([2e4, 8e4], [50.0, 150.0], [1e6, 5e6]),
}
reports = {name: robust.check(model, K) for name, K in pids.items()}
print(*(f"--- {name} ---\n{report}\n" for name, report in reports.items()), sep="\n")
worst = robust.analysis.breaking_perturbation(model, pids["careful"])
radii = [
    np.abs((worst.plant(x) * pids["careful"]).feedback(np.eye(2)).poles()).max()
    for x in (0.99, 1.01)
]
print(
    f"largest pole with 0.99 and 1.01 of the breaking perturbation: {radii[0]:.5f} and"
    f" {radii[1]:.5f}"
)

# %%
# On the machine, with its friction and actuators of 40 N: a step of 100 um along x, then a kick of
# both axes. Again with an additional delay of half a millisecond, which the model does not contain.
t = np.arange(1024) / FS
goal, kick = np.outer([100e-6, 0], t >= 0.1), np.outer([3, 4], (t >= 1.2) & (t < 1.22))
moves = {}
for (name, K), late in ((one, late) for late in (0.0, 0.5e-3) for one in pids.items()):
    moves[name, late] = move = nlfrf.rig.run(
        stage, goal, nlfrf.rig.Controller(K, delay=late, saturation=40.0), disturbance=kick
    )
    off, swing = np.abs(move.e[:, t < 1.2][:, -1]).max(), np.ptp(move.x[:, t > 1.7], axis=1).max()
    print(
        f"{name}, {1e3 * late:g} ms late: off by {1e6 * off:.2f} um after 1.1 s, swings by"
        f" {1e6 * swing:.2f} um 0.5 s after the kick"
    )

figure, axes = plt.subplots(2, 4, figsize=(19, 7), layout="constrained")
for j, i in np.ndindex(2, 2):
    curves = {
        "measured": frm.G,
        "nominal, 4 states": fit.response,
        "95 % bound of the entry": frm.bound(),
    }
    for (label, curve), style in zip(curves.items(), (".", "-", "--"), strict=True):
        axes[j, i].loglog(frm.f, np.abs(curve[j, i]), style, lw=1, ms=3, label=label)
    axes[j, i].set(
        title=f"{frm.outputs[j]} by {frm.inputs[i]}", xlabel="frequency [Hz]", ylabel="[m/N]"
    )
for (name, report), style in zip(reports.items(), ("-", "--"), strict=True):
    axes[0, 2].loglog(report.curves.omega[1:] / 2 / np.pi, report.curves.rs[1:], style, label=name)
axes[0, 2].axhline(1, color="k", lw=0.8)
axes[0, 2].set(title="mu: below one is robustly stable", xlabel="frequency [Hz]", ylabel="[-]")
for (name, late), move in moves.items():
    for x, axis, style in zip(move.x, frm.outputs, ("-", "--"), strict=True):
        ax, width = axes[1, 2] if late == 0 else axes[0, 3], 2 if name == "careful" else 0.8
        ax.plot(t, 1e6 * x, style, lw=width, zorder=2 + width, label=f"{axis}, {name}")
    if late > 0:
        axes[1, 3].plot(
            t,
            move.u[1],
            lw=2 if name == "careful" else 0.8,
            zorder=len(name),
            label=f"{frm.inputs[1]}, {name}",
        )
axes[1, 2].set(
    title="on the machine: a step, then a kick", xlabel="time [s]", ylabel="position [um]"
)
axes[0, 3].set(title="the same, half a millisecond late", xlabel="time [s]", ylabel="position [um]")
axes[1, 3].set(title="the same, half a millisecond late", xlabel="time [s]", ylabel="force [N]")
for ax in (axes[0, 0], *axes[:, 2:].flat):
    ax.legend(fontsize="small")
figure.savefig(out / "stage.png", dpi=90)
print(f"wrote {out}/stage.png")
