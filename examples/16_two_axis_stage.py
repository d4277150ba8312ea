"""A stage of two axes: a set of experiments, a verdict on a controller matrix, the machine.

Two masses on springs, coupled, with friction on both axes, measured at two points that mix them. Two experiments with
both inputs on give the frequency response matrix and a bound: for its entries, and for the matrix as a whole.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numba
import numpy as np

import nlfrf
import robust

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/16"), help="folder for the picture")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

FS, N = 512.0, 2048
MASS, STIFFNESS, DAMPING = np.array([1.0, 1.5]), np.array([25e3, 136e3]), np.array([6.0, 12.0])
POINTS = np.array([[1.0, 0.15], [-0.1, 1.0]])


@numba.njit
def drive(force, gains, steps=32):
    """Positions (2, n) at the two points under force - controller; LuGre friction, Runge-Kutta of order two."""
    x, v, z, before, total = np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2), np.zeros(2)
    y, h = np.empty_like(force), 1 / FS / steps
    for k in range(force.shape[1]):
        y[:, k] = POINTS @ x
        error = gains[3] * force[:, k] - y[:, k]  # with gains the "force" is where to go
        total, change, before = total + error / FS, (error - before) * FS, error
        u = force[:, k] if not gains[3, 0] else gains[0] * error + gains[1] * change + gains[2] * total
        for _ in range(steps):
            X, V, Z = x, v, z
            for share in (0.5, 1.0):
                dz = V - 3e4 * np.abs(V) / (0.7 + 0.3 * np.exp(-((V / 0.01) ** 2))) * Z
                spring = STIFFNESS * X + 9e3 * (X - X[::-1]) + DAMPING * V + 2 * (V - V[::-1])
                a = (u - spring - 3e4 * Z - 13 * dz - 0.4 * V) / MASS
                X, V, Z = x + share * h * V, v + share * h * a, z + share * h * dz
            x, v, z = X, V, Z
    return y


# 1. Two experiments, both inputs on in each; two periods after one to settle, and a little noise.
ms = nlfrf.multisine(
    "random-odd", fs=FS, n_samples=N, f_min=2, f_max=100, rms=(6.0, 8.0), n_inputs=2, n_draws=50, rng=1
)
u = np.tile(ms.u, (1, 1, 3))
y = np.stack([drive(u[:, m], np.zeros((4, 2))) for m in range(2)], axis=1)
y += 1e-3 * y.std() * np.random.default_rng(2).standard_normal(y.shape)
u, y = (signal.reshape(2, 2, 3, N)[:, :, 1:] for signal in (u, y))
record = nlfrf.MultiRecord(u=u, y=y, fs=FS, lines=ms.lines, inputs=("Fx", "Fy"), outputs=("x", "y"))
frm = nlfrf.identify(record)

# 2. A nominal with four states, and the set around it: chosen before looking, one disc an entry.
fit = robust.fit_nominal(frm, n_poles=4, dt=1 / FS)
model = robust.uncertainty(frm, fit, form="elements", order=4)
print(f"{frm}\n\n{fit}\n{model}\n")


# 3. A PID an axis. The verdict is about every plant of the set, and the whole matrix.
def controller(kp, kd, ki):
    tops = [[p + d * FS + i / FS, -p - 2 * d * FS, d * FS] for p, d, i in zip(kp, kd, ki, strict=True)]
    return control.append(*(control.ss(control.tf(top, [1, -1, 0], 1 / FS)) for top in tops))


pid = {"careful": ([1e3, 4e3], [10.0, 30.0], [4e5, 2e6]), "greedy": ([2e4, 8e4], [50.0, 150.0], [1e6, 5e6])}
reports = {name: robust.check(model, controller(*gains)) for name, gains in pid.items()}
print(*(f"--- {name} ---\n{report}\n" for name, report in reports.items()), sep="\n")
careful = controller(*pid["careful"])
worst = robust.breaking_perturbation(model, careful)
radii = [np.abs((worst.plant(x) * careful).feedback(np.eye(2)).poles()).max() for x in (0.99, 1.01)]
print(f"largest pole with 0.99 and 1.01 of the breaking perturbation: {radii[0]:.5f} and {radii[1]:.5f}")

# 4. On the machine, with its friction: a step of 50 um along the first axis.
goal = np.outer([50e-6, 0], np.arange(1024) >= 100)
moved = drive(goal, np.array([*pid["careful"], [1.0, 1.0]]))
print(f"on the machine: after {924 / FS:.1f} s off by {1e6 * np.abs(moved[:, -1] - goal[:, -1]).max():.2f} um")

figure, axes = plt.subplots(2, 3, figsize=(15, 7), layout="constrained")
for j, i in np.ndindex(2, 2):
    curves = {"measured": frm.G, "nominal, 4 states": fit.response, "95 % bound of the entry": frm.bound()}
    for (label, curve), style in zip(curves.items(), (".", "-", "--"), strict=True):
        axes[j, i].loglog(frm.f, np.abs(curve[j, i]), style, lw=1, ms=3, label=label)
    axes[j, i].set(title=f"{frm.outputs[j]} by {frm.inputs[i]}", xlabel="frequency [Hz]", ylabel="[m/N]")
for (name, report), style in zip(reports.items(), ("-", "--"), strict=True):
    axes[0, 2].loglog(report.omega[1:] / 2 / np.pi, report.mu[1:], style, label=name)
axes[0, 2].axhline(1, color="k", lw=0.8)
axes[0, 2].set(title="mu: below one is robustly stable", xlabel="frequency [Hz]", ylabel="[-]")
axes[1, 2].plot(np.arange(1024) / FS, 1e6 * moved.T, label=["x", "y"])
axes[1, 2].set(title="the step on the machine", xlabel="time [s]", ylabel="position [um]")
for ax in (axes[0, 0], axes[0, 2], axes[1, 2]):
    ax.legend(fontsize="small")
figure.savefig(out / "stage.png", dpi=90)
print(f"wrote {out}/stage.png")
