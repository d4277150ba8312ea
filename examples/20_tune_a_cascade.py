"""
20. A cascade tuned at once: position P, velocity PI and notch, on three levels of the rig
==========================================================================================

A PLC has a position loop, a velocity loop and a notch. They cannot be tuned one by one: a machine
on a spring has a zero that cancels the integrator of its velocity loop, so the position loop is
needed too. Here all are tuned together, for three levels of motion and with a computation delay, as
stiff against a force as the margins allow. Each level is then checked with its own set.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt

import nlfrf
import robust
from robust.plot import plot_limits
from robust.tuning import Limit, Notch, Pid, Plants

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/20"), help="folder for the picture")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The rig at three levels: a nominal and a set around each.
ms = nlfrf.multisine(fs=4096, n_samples=8192, f_min=2, f_max=140, n_realizations=4, rng=1)
levels = (0.025, 0.25, 2.5)
blas = nlfrf.level_study(nlfrf.paper_rig(), ms, levels).blas
models = [robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2, n_zeros=0)) for bla in blas]
for level, model in zip(levels, models, strict=True):
    print(
        f"{level:5g} N rms: spring {1 / model.nominal.dcgain():.0f} N/m, radius up to"
        f" {model.radius.max():.2f}"
    )

# %%
# The fixed parts, joined by signal names; the velocity is the difference of positions, as in the
# drive.
T, delay = 1e-3, 0.5e-3
velocity = control.tf([1 / T, -1 / T], [1, 0], T, inputs="y", outputs="v")
system = [
    control.summing_junction(["u", "d"], "force"),
    control.summing_junction(["r", "-y"], "e_x"),
    control.summing_junction(["v_ref", "-v"], "e_v"),
    velocity,
]
blocks = {
    "K_x": Pid(kp=30.0, reads="e_x", drives="v_ref"),
    "K_v": Pid(kp=150.0, ki=2e3, reads="e_v", drives="u_c"),
    "notch": Notch(omega=500.0, reads="u_c", drives="u"),
}

# %%
# Margins and stiffness below 0.3 Hz are hard; the peak of the compliance, in um/N, is minimised.
design = robust.tune(
    system,
    Plants(models, inputs="force", outputs="y"),
    blocks,
    hard=[
        Limit("d", "force", 1.8, worst=True),
        Limit("r", "y", 1.8),
        Limit("d", "y", 3e-6, band=(0, 2.0)),
    ],
    soft=[Limit("d", "y", 1e-6)],
    dt=T,
    delay=delay,
    n_starts=2,
    rng=1,
)
print(design)
K_x, K_v = design.blocks["K_x"], design.blocks["K_v"]
print(
    f"into the drive: Kv = {K_x.kp:.4g} 1/s, Kp = {K_v.kp:.4g} Ns/m, Tn ="
    f" {1e3 * K_v.kp / K_v.ki:.4g} ms"
)

# %%
# The proof, level by level, by ``check``.
K = design.controller("y", "u")
for level, model in zip(levels, models, strict=True):
    report = robust.check(model, K, delay=delay)
    print(
        f"{level:5g} N rms: {report.verdict}, the set may be {report.margins.rs:.3g} times as large"
    )

figure, ax = plt.subplots(figsize=(8, 5), layout="constrained")
plot_limits(design, ax=ax)
figure.savefig(out / "tuned.png", dpi=120)
