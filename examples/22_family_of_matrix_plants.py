"""
22. A family of matrix plants: from a file of eight plants to a verified proof
==============================================================================

Two zones of an oven have separate heaters and are coupled by the wall between them. There are eight
operating points: load, fan and the second heater, each at two values. One set contains all eight
plants, in the form that restricts the loop least. One controller is proved for every plant of the
set, and anyone can verify the proof.
"""

import argparse
from itertools import product
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np
from scipy.io import loadmat, savemat

import robust

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument(
    "--out", type=Path, default=Path("demo/22"), help="folder for files and picture"
)
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)


# %%
# The file, as a colleague sends it: A, B, C, D of the eight plants stacked along the third axis.
# Time in seconds, temperatures as a fraction of the range, inputs as a fraction of full power.
def oven(load, fan, heater):
    """Return the oven with a heat capacity, a heat loss and a second heater that are so many times
    the usual.
    """
    wall = 0.4
    A = np.array([[-fan - wall, wall], [wall, -fan - wall]]) / (600 * load)
    return control.ss(A, np.diag([1.5, 1.2 * heater]) / (600 * load), np.eye(2), np.zeros((2, 2)))


corners = product((0.85, 1.15), (0.8, 1.2), (0.9, 1.1))
A, B, C, D = (
    np.dstack(part) for part in zip(*(control.ssdata(oven(*one)) for one in corners), strict=True)
)
savemat(out / "oven.mat", {"A": A, "B": B, "C": C, "D": D})

# %%
# Load the file. No nominal is given, so the mean response of the eight is fitted. Each form of
# uncertainty has a weight at every frequency; what counts is this weight times T or S of the wanted
# loop, here with 8 mrad/s.
content = loadmat(out / "oven.mat")
plants = [
    control.ss(*(content[name][..., k] for name in "ABCD")) for k in range(content["A"].shape[2])
]
bandwidth = 8e-3  # rad/s
ranking = robust.models.choose_form(plants, omega_B=bandwidth)
print(f"form and largest weight times T or S:\n{ranking}\n")

# %%
# The set. "LTI" is a claim: at every operating point the oven is one linear plant of the set.
model = robust.uncertainty_of_plants(plants, form=ranking.best, order=2, perturbation="LTI")
print(model, model.origin.source, sep="\n")
distances = [model.distance(plant).max() for plant in plants]
print(
    f"the set contains the eight plants: the farthest is at {max(distances):.3f} of the distance to"
    " its boundary"
)

# %%
# D-K iteration for every plant of the set: an error below 1 % at rest, a bandwidth of
# a fifth of the wanted one, and limited heating.
w_P = robust.performance_weight(0.2 * bandwidth, M_S=2.0, A=1e-2)
w_u = 0.2 * control.tf([60, 0.1], [6, 10])
design = robust.dk_iteration(model, w_P=w_P, w_u=w_u, n_rounds=4, order=2)
print(f"\n{design}")

# %%
# The verdict, and the proofs: saved, and verified from the files alone by code that is independent
# of the search.
report = robust.check(model, design.K, w_P=w_P)
print(f"\n{report}")
robust.save(model, out / "model.json")
robust.save(design.K, out / "K.json")
robust.save(report, out / "proof.json")
found = robust.io.verify_certificate(
    out / "proof.json",
    model=robust.load(out / "model.json"),
    K=robust.load(out / "K.json"),
)
print(f"\n{found}\nverified: {found.verified}")

# %%
# The eight loops: a step of zone 1, and its effect on zone 2. The proof covers all plants of the
# family, and more.
t = np.linspace(0, 3600, 600)
figure, axes = plt.subplots(1, 3, figsize=(15, 4.2), layout="constrained")
for plant in plants:
    T = (plant * design.K).feedback(np.eye(2))
    y = control.forced_response(T, t, np.outer([1, 0], np.ones(t.size))).outputs
    axes[0].plot(t, y[0], color="C0", lw=0.8)
    axes[0].plot(t, y[1], color="C1", lw=0.8)
axes[0].set(
    title="a step of zone 1: zones 1 and 2", xlabel="time [s]", ylabel="temperature [of range]"
)
for k, gain in enumerate(model.weight_gains(model.omega)):
    axes[1].loglog(
        model.omega, gain, color=f"C{k}", label=f"{'W_l' if k < 2 else 'W_r'} {k % 2 + 1}"
    )
    axes[1].loglog(model.omega, model.radius[k], ".", color=f"C{k}", ms=3)
axes[1].set(title=f"weights of the {model.form} form", xlabel="frequency [rad/s]", ylabel="[-]")
axes[1].legend()
axes[2].semilogx(report.curves.omega[1:], report.curves.rs[1:], label="robust stability")
axes[2].semilogx(design.omega, design.curve, label="robust performance")
axes[2].axhline(1, color="k", lw=0.8)
axes[2].set(
    title="mu: below one for every plant of the set", xlabel="frequency [rad/s]", ylabel="[-]"
)
axes[2].legend()
figure.savefig(out / "family.png", dpi=90)
print(f"wrote {out}/family.png")
