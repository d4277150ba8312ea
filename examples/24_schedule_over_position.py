"""
24. A schedule over position: four records, one design, C code, proved while the axis moves
===========================================================================================

The belt of a gantry is softer in the middle, so its resonance moves with the position, and a notch
has to follow it. Four records give four frequency responses; a model interpolates between them,
with one weight. A PID with a notch is tuned for all four at once, with gains that are polynomials
of the position. That each frozen loop is stable proves nothing for an axis that moves: the proof is
for every motion up to a speed, and for every plant of the set. It is for the controller as it is
written in C, with coefficients in single precision.
"""

import argparse
import warnings
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.models import LpvModel, interpolate
from robust.plot import plot_schedule
from robust.tuning import Limit, Notch, Pid, Plants

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument(
    "--out", type=Path, default=Path("demo/24"), help="folder for files and the picture"
)
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)
warnings.simplefilter(
    "ignore", robust.DesignWarning
)  # one start, and no weight in the tuning: the proof has it

# %%
# The machine: a motor and a carriage on a belt whose stiffness goes with the position, on a weak
# spring to ground.
T, POSITIONS, SPEED = 1e-3, np.array([-0.25, -0.08, 0.08, 0.25]), 1.0  # s, m, m/s


def machine(p):
    """The frozen plant at a position [m], from force [N] to the position of the carriage [m]."""
    k = 2e4 * (1 + 1.2 * p + 2 * p**2)  # N/m, between a motor of 4 kg and a carriage of 1 kg
    A = [[0, 0, 1, 0], [0, 0, 0, 1], [-(k + 400) / 4, k / 4, -2.5, 1], [k, -k, 4, -8]]
    return control.ss(A, [[0], [0], [1 / 4], [0]], [[0, 1, 0, 0]], 0)


# %%
# A record at each position: a multisine as force, held over each sample, two periods in steady
# state with noise.
ms = nlfrf.multisine(
    "random-odd", fs=1 / T, n_samples=4000, f_min=0.5, f_max=100, rms=20.0, n_realizations=2, rng=1
)
rng, blas, u = np.random.default_rng(24), [], np.repeat(ms.u[:, None], 2, axis=1)
for p in POSITIONS:
    G = control.sample_system(machine(p), T, "zoh")
    played = [
        control.forced_response(G, U=np.tile(one, 4)).outputs.reshape(4, -1)[2:] for one in ms.u
    ]
    y = np.array(played) + 1.2e-6 * rng.normal(size=u.shape)
    blas.append(nlfrf.identify(nlfrf.Record(u=u, y=y, fs=ms.fs, lines=ms.lines, hold="zoh")))
plant = interpolate(
    blas, at=POSITIONS, n_poles=4, degree=2, dt=T, order=2, over="position", unit="m"
)
print(plant)

# %%
# A PID with a notch, one sample of computation delay. Two gains and the frequency of the notch go
# with the position.
junctions = [
    control.summing_junction(["u", "d"], "force"),
    control.summing_junction(["r", "-y"], "e"),
]
blocks = {
    "K": Pid(
        kp=800,
        ki=4e3,
        kd=40,
        filter_time=3e-3,
        lower={"filter_time": 2e-3},
        scheduled={"kp": 1, "kd": 1},
        reads="e",
        drives="u_c",
    ),
    "notch": Notch(
        omega=150.0, width=0.6, depth=0.3, scheduled={"omega": 2}, reads="u_c", drives="u"
    ),
}
design = robust.tune(
    junctions,
    Plants(plant, inputs="force", outputs="y"),
    blocks,
    hard=[Limit("d", "force", 1.6), Limit("r", "y", 1.5), Limit("d", "y", 1e-4, band=(0, 1.0))],
    soft=[Limit("d", "y", 1e-4)],
    dt=T,
    delay=T,
    n_starts=1,
)
print(design)

# %%
# The schedule as C for the target. The rounded coefficients come back: K is what runs there.
rounded = robust.io.export_c(design.schedule("y", "u"), out / "axis.h")
K = rounded.K
print(rounded)

# %%
# The proof: every motion up to 1 m/s, every plant of the set, the position moving within each
# sample too.
proof = robust.prove_schedule(plant, K, rate=SPEED, delay=T)
print(proof)
if proof.holds:
    robust.save(proof, out / "schedule.json")
    print(robust.io.verify_certificate(out / "schedule.json"))

# %%
# Played: the true machine goes to and fro at 1 m/s while its error decays from a push, with the
# controller of the schedule, and with the one of the middle alone.


def play(controller, n=1000):  # the machine and its position move within every sample
    x, state, late, trace = np.array([0, 0, 0.1, 0.0]), np.zeros(controller.order), 0.0, []
    for k in range(n):
        p, ahead = (
            0.25 * (2 / np.pi) * np.arcsin(np.sin(2 * np.pi * t * SPEED))
            for t in (k * T, (k + 0.5) * T)
        )
        now, law = control.sample_system(machine(ahead), T, "zoh"), controller.at(p)
        trace.append(y := x[1])
        u = -(law.C @ state + law.D[:, 0] * y)[0]
        x, state, late = now.A @ x + now.B[:, 0] * late, law.A @ state + law.B[:, 0] * y, u
    return np.array(trace)


# %%
# The picture: the controller at each position, and the machine after the push.
middle = LpvModel.from_points([K.at(0.0)] * 2, at=POSITIONS[[0, -1]], over="position", unit="m")
figure, (left, right) = plt.subplots(1, 2, figsize=(12, 4.5), layout="constrained")
plot_schedule(K, ax=left)
for name, controller in {"schedule": K, "controller of the middle": middle}.items():
    trace = play(controller)
    print(
        f"{name}: at most {1e3 * np.abs(trace[300:500]).max():.2f} mm from 0.3 to 0.5 s after the"
        " push"
    )
    right.plot(np.arange(trace.size) * T, 1e3 * trace, label=name)
right.set(xlabel="time [s]", ylabel="position of the carriage [mm]", title="After a push, at 1 m/s")
right.legend()
figure.savefig(out / "schedule.png", dpi=120)
