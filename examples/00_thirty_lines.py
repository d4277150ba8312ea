"""
0. From a stored record to a checked controller in thirty lines
===============================================================

This example needs numpy, scipy, control, cvxpy and matplotlib besides the two packages. The weight
is a transfer function of python-control, which also shapes and closes the loop. cvxpy finds the
certificate.
"""

import argparse
import sys
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/00"), help="folder for the picture")
parser.add_argument(
    "--record", type=Path, default=Path(sys.argv[0]).parent / "data" / "record.npz", help="record"
)
args = parser.parse_args()
out = args.out
out.mkdir(parents=True, exist_ok=True)

# %%
# One special-odd multisine record of a mass on a spring with friction: force [N] in, position [m]
# out, 4 s a period.
record = nlfrf.load_record(args.record)
bla = nlfrf.identify(record)
print(
    f"BLA on {bla.f.size} lines, 95 % bound of {100 * np.median(bla.bound() / np.abs(bla.G)):.1f} %"
    " in the median"
)

# %%
# A nominal model, and a multiplicative weight W that covers its uncertainty: G_p = G (1 + W Delta).
model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=3))
G, W = model.nominal, model.weight

# %%
# Loop shaping: an integrator that rolls off at 20 Hz, below the resonance at 60 Hz; a gain for a
# crossover at 4 Hz.
s, omega_c = control.tf("s"), 2 * np.pi * 4
shape = 1 / s / (s / (2 * np.pi * 20) + 1) ** 2
K = shape / abs((G * shape)(1j * omega_c))
L = G * K
S, T = control.feedback(1, L), control.feedback(L, 1)
gain_margin, phase_margin, *_ = control.margin(L)
print(f"nominal margins: a factor of {gain_margin:.2f}, {phase_margin:.0f} deg")

# %%
# Robust stability of the set is ``|W T| < 1`` at every frequency: a matrix inequality for cvxpy,
# then checked exactly.
certificate = robust.certify_norm(W * T, 1.0, solver="CLARABEL")
print(f"|W T| < 1 at every frequency: {certificate.outcome} ({certificate.method} lemma)")
print(robust.check(model, K).verdict)

# %%
# The picture.
f = np.geomspace(0.1, 300, 500)
figure, ax = plt.subplots(figsize=(8, 5), layout="constrained")
ax.loglog(bla.f, np.abs(bla.G) / abs(G(0)), ".k", label="|G| of the record over its stiffness")
ax.loglog(bla.f, bla.bound() / abs(G(0)), ".", color="tab:red", label="its 95 % bound")
for name, system in (("|S|", S), ("|T|", T), ("|W T|", W * T)):
    ax.loglog(f, np.abs(system(2j * np.pi * f)), label=name)
ax.axhline(1, color="0.5", lw=0.8)
ax.set(xlabel="frequency [Hz]", ylabel="magnitude", ylim=(1e-4, 30))
ax.legend()
ax.grid(True, which="both", alpha=0.2)
figure.savefig(out / "loop.png", dpi=120)
print(f"picture: {out / 'loop.png'}")
