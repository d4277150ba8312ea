"""Examples of Skogestad & Postlethwaite, redone with the book's numbers.

S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005. Each line prints the book's number
and the one found here, so that you can see that the words mean what the book means by them.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import robust
from robust.lti import response
from robust.plot import plot_check, plot_loop

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/11"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)


def compare(what, book, here):
    """One row: the book's number and ours."""
    print(f"{what:62s} book {book:>8}   here {here}")


# 1. Section 7.5.2, the uncertain plant with a zero in the right half plane: a model, a weight that covers a very
#    different plant, and a PI controller by Ziegler and Nichols.
s = control.tf("s")
G = 3 * (-2 * s + 1) / ((5 * s + 1) * (10 * s + 1))
G_extreme = 4 * (-3 * s + 1) / (4 * s + 1) ** 2
w_I = (10 * s + 0.33) / ((10 / 5.25) * s + 1)
K = (12.7 * s + 1) / (12.7 * s)
omega = np.geomspace(1e-3, 1e2, 200)
radius = np.abs(response(control.ss(w_I), omega))
model = robust.UncertaintyModel(G, w_I, "multiplicative", omega, radius, perturbation="LTI")

relative = np.abs(control.frequency_response(G_extreme / G - 1, [1e-4, 0.1, 1e4]).complex.squeeze())
compare(
    "relative error of the extreme plant at low, 0.1 rad/s, high", "0.33 1 5.25", " ".join(f"{r:.2f}" for r in relative)
)
fast, slow = robust.check(model, 1.13 * K), robust.check(model, 0.31 * K)
compare("K_c = 1.13: nominally stable, robustly stable", "yes, no", f"{fast.nominally_stable}, {fast.robustly_stable}")
compare("K_c = 0.31: just robustly stable, max |w_I T|", "1", f"{slow.rs.max():.3f} ({slow.verdict})")
gains = np.arange(0.2, 0.7, 0.01)
largest = max(k for k in gains if robust.check(model, k * K, certify=False).rs.max() < 1)
compare("largest gain with robust stability", "0.31", f"{largest:.2f}")
unstable = min(k for k in gains if np.any(control.feedback(k * K * G_extreme).poles().real >= 0))
compare("gain at which the extreme plant itself becomes unstable", "0.58", f"{unstable:.2f}")

# 2. Example 9.3: Glover-McFarlane loop shaping of a disturbance process.
G_d = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
W_1 = (s + 2) / s
design = robust.ncfsyn(G_d, W_1)
compare("Example 9.3: gamma_min", "2.34", f"{design.gamma_min:.3f}")
compare("Example 9.3: largest coprime uncertainty, 1/gamma_min", "0.43", f"{1 / design.gamma_min:.3f}")
L_shaped, L_final = control.ss(G_d * W_1), control.ss(G_d) * design.K
crossings = []
for L in (L_shaped, L_final):
    gain, phase, _, crossover = control.margin(L)
    crossings.append(f"{gain:.2f}, {phase:.1f} deg at {crossover:.1f} rad/s")
compare("  gain and phase margin of the shaped plant", "-", crossings[0])
compare("  with the robustifying controller", "-", crossings[1])

# 3. Section 2.8.2, the weight that asks for performance: the numbers it is made from are its asymptotes.
w_P = robust.performance_weight(10, M_S=1.5, A=1e-4)
low, high = np.abs(response(w_P, np.array([1e-8, 1e8])))
compare("w_P with M = 1.5, A = 1e-4: 1/|w_P| at low and high frequency", "1e-4 1.5", f"{1 / low:.0e} {1 / high:.2f}")

figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
plot_check(fast, ax=axes[0, 0])
axes[0, 0].set_title(f"K_c = 1.13: {fast.verdict}")
plot_check(slow, ax=axes[0, 1])
axes[0, 1].set_title(f"K_c = 0.31: {slow.verdict}")
plot_loop(slow, ax=axes[1, 0])
w = np.geomspace(0.1, 1000, 400)
for L, name in ((L_shaped, "shaped plant G W_1"), (L_final, "with the robustifying controller")):
    axes[1, 1].loglog(w, np.abs(response(control.ss(L), w)), label=name)
axes[1, 1].axhline(1, color="0.5", lw=0.8)
axes[1, 1].set(xlabel="frequency [rad/s]", ylabel="|L|", title="Example 9.3: the shape is kept")
axes[1, 1].grid(alpha=0.3)
axes[1, 1].legend()
figure.savefig(out / "book.png", dpi=90)
print(f"wrote {out}/book.png")
