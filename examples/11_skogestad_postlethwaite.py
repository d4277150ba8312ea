"""
11. Examples of Skogestad & Postlethwaite, redone with the book's numbers
=========================================================================

S. Skogestad, I. Postlethwaite, Multivariable Feedback Control, 2nd ed., Wiley 2005. Each line
prints the number of the book and the one computed here, which shows that the terms are those of the
book.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import robust
from robust.lti.lti import response
from robust.plot import plot_check

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/11"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)


def compare(what, book, here):
    """One row: the book's number and ours."""
    print(f"{what:57s} book {book:>13}  here {here}")


# %%
# Section 7.5.2, the uncertain plant with a zero in the right half plane: a model, a weight that
# covers a very different plant, and a PI controller by Ziegler and Nichols.
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
    "error of the extreme plant at low, 0.1 rad/s, high",
    "0.33 1 5.25",
    " ".join(f"{r:.2f}" for r in relative),
)
fast, slow = robust.check(model, 1.13 * K), robust.check(model, 0.31 * K)
compare(
    "K_c = 1.13: nominally stable, robustly stable",
    "yes, no",
    f"{fast.nominally_stable}, {fast.proofs.robustly_stable}",
)
compare(
    "K_c = 0.31: just robustly stable, max |w_I T|",
    "1",
    f"{slow.curves.rs.max():.3f} ({slow.verdict})",
)
gains = np.arange(0.2, 0.7, 0.01)
largest = max(k for k in gains if robust.check(model, k * K, certify=False).curves.rs.max() < 1)
compare("largest gain with robust stability", "0.31", f"{largest:.2f}")
unstable = min(k for k in gains if np.any(control.feedback(k * K * G_extreme).poles().real >= 0))
compare("gain at which the extreme plant itself becomes unstable", "0.58", f"{unstable:.2f}")

# %%
# Example 9.3: Glover-McFarlane loop shaping of a disturbance process.
G_d = 200 / ((10 * s + 1) * (0.05 * s + 1) ** 2)
W_1 = (s + 2) / s
design = robust.ncfsyn(G_d, W_1)
compare("Example 9.3: gamma_min", "2.34", f"{design.gamma_min:.3f}")
compare(
    "Example 9.3: largest coprime uncertainty, 1/gamma_min", "0.43", f"{1 / design.gamma_min:.3f}"
)

# %%
# Example 2.17: the H-infinity norm of [w_P S; w_u K S] for the same plant, by a controller of order
# two from the FRF, compared with the book's smallest one over all orders.
w_P = robust.performance_weight(10, M_S=1.5, A=1e-4)
fixed = robust.design_frf(
    control.frequency_response(G_d, 10 * omega), 2, w_P=w_P, w_u=1.0, n_iterations=20
)
compare("Example 2.17: gamma; here of order two, from the FRF", "1.37", f"{fixed.gamma:.3f}")

# %%
# Example 8.5: the structured singular value depends on the structure.
M = np.array([[2.0, 2.0], [-1.0, -1.0]])[:, :, None]
sizes = [
    float(robust.mu.upper(M, b).value[0])
    for b in ([(2, 2)], [(1, 1), (1, 1)], [(2, 2, "repeated")])
]
compare(
    "Example 8.5: full block, two numbers, one number twice",
    "3.162 3 1",
    " ".join(f"{m:.3f}" for m in sizes),
)

# %%
# Section 8.11.3: the distillation column with an inverse-based controller. Nominal performance and
# robust stability hold, but with 20 % of gain error in each input performance is lost.
w = np.geomspace(1e-3, 1e2, 300)
G_0 = np.array([[87.8, -86.4], [108.2, -109.6]])[:, :, None]
lag, S, T = 75j * w + 1, 1j * w / (1j * w + 0.7), 0.7 / (1j * w + 0.7)  # G = G_0/lag, G K = 0.7/s
w_I, w_P = (1j * w + 0.2) / (0.5j * w + 1), (0.5j * w + 0.05) / (1j * w)
one, inverse = np.eye(2)[:, :, None], np.linalg.inv(G_0[:, :, 0])[:, :, None]
top = np.concatenate([-w_I * T * one, -w_I * T * lag * inverse], axis=1)
N = np.concatenate([top, np.concatenate([w_P * S / lag * G_0, w_P * S * one], axis=1)])
mu = robust.mu.upper(N, [(1, 1), (1, 1), (2, 2)]).value
peaks = f"{np.abs(w_P * S).max():.2f} {np.abs(w_I * T).max():.2f} {mu.max():.2f}"
compare("Section 8.11.3: nominal performance, robust stability, mu", "0.5 0.53 5.78", peaks)

figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
for ax, report, gain in ((axes[0, 0], fast, 1.13), (axes[0, 1], slow, 0.31)):
    plot_check(report, ax=ax).set_title(f"K_c = {gain}: {report.verdict}")
L = control.ss(G_d) * design.K
axes[1, 0].loglog(
    omega, np.abs(response(control.ss(G_d * W_1), omega)), "--", label="shaped plant G W_1"
)
axes[1, 0].loglog(omega, np.abs(response(L, omega)), label="with the robustifying controller")
axes[1, 0].set(xlabel="frequency [rad/s]", ylabel="|L|", title="Example 9.3: the shape is kept")
curves = (
    (mu, "robust performance"),
    (np.abs(w_I * T), "robust stability"),
    (np.abs(w_P * S), "nominal performance"),
)
for (curve, name), style in zip(curves, ("-", "--", "-."), strict=True):
    axes[1, 1].loglog(w, curve, style, label=name)
axes[1, 1].set(
    xlabel="frequency [rad/s]", ylabel="mu, must stay below 1", title="Section 8.11.3: distillation"
)
for ax in axes[1]:
    ax.axhline(1, color="0.5", lw=0.8)
    ax.grid(alpha=0.3)
    ax.legend()
figure.savefig(out / "book.png", dpi=90)
print(f"wrote {out}/book.png")
