"""
15. Several uncertainties: stiffness and damping as numbers, distortion as a disc
=================================================================================

Friction makes a machine stiff in small motions and soft in large ones. One disc that covers all
levels contains far too many plants: near the resonance it has plants of either sign. Here spring
and damper are real parameters, the rest is a small disc, and the structured singular value checks
all of them at once.
"""

import argparse
from pathlib import Path

import control
import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/15"), help="folder for the picture")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The rig at three levels, 20 dB apart, and a mass, a damper and a spring fitted to each.
ms = nlfrf.multisine(fs=4096, n_samples=8192, f_min=2, f_max=140, n_realizations=4, rng=1)
levels = (0.025, 0.25, 2.5)
blas = nlfrf.level_study(nlfrf.paper_rig(), ms, levels).blas
fits = [robust.fit_nominal(bla, n_poles=2, n_zeros=0) for bla in blas]
mck = []
for level, fit in zip(levels, fits, strict=True):
    den = np.poly(fit.G.poles()).real
    mck.append(den / (fit.G.dcgain() * den[-1]))
    print(
        f"{level:5g} N rms: mass {mck[-1][0]:.3f} kg, damping {mck[-1][1]:.1f} Ns/m, stiffness"
        f" {mck[-1][2]:.0f} N/m"
    )
low, high = np.min(mck, axis=0), np.max(mck, axis=0)
m, c, k = (low + high) / 2
dm, dc, dk = (high - low) / 2
print(
    f"damping {c:.1f} +- {dc:.1f}, stiffness {k:.0f} +- {dk:.0f}; the mass hardly moves: +-"
    f" {100 * dm / m:.1f} %"
)

# %%
# The rest: misfit and distortion of each level about its own spring, and one mass for all levels.
models = [robust.uncertainty(bla, fit, order=4) for bla, fit in zip(blas, fits, strict=True)]
omega = models[0].omega
s = 1j * omega
rest = np.zeros(omega.size)
for model, (m_own, c_own, k_own) in zip(models, mck, strict=True):
    ratio = (m * s**2 + c_own * s + k_own) / (m_own * s**2 + c_own * s + k_own)
    rest = np.maximum(rest, np.abs(ratio - 1) + np.abs(ratio) * model.radius)
w_rest = robust.fit_weight(omega, rest, order=4).W
over_levels = robust.uncertainty(
    list(blas), robust.fit_nominal(list(blas), n_poles=3, n_zeros=2), order=4
)
print(
    f"largest relative radius: one disc over the levels {over_levels.radius.max():.1f}, the rest"
    f" {rest.max():.2f}"
)

# %%
# The machine with its perturbations pulled out, joined by the names of the signals. An integral
# controller.
state = [[0, 1], [-k / m, -c / m]]
into = [[0, 0, 0], [1 / m, 1 / m, 1 / m]]
mass = control.ss(
    state, into, np.eye(2), np.zeros((2, 3)), inputs=["F", "spring", "damper"], outputs=["x", "v"]
)
sensor = control.summing_junction(["x", "d"], "y")
blocks = {
    "stiffness": robust.models.Block("x", "spring", dk, kind="real"),
    "damping": robust.models.Block("v", "damper", dc, kind="real"),
    "distortion": robust.models.Block("x", "d", w_rest, perturbation="statistical"),
}


def controller(crossover):
    """-K: integral action with the crossover [Hz] on the mean spring, and a roll-off under the
    resonance.
    """
    lag = 2 * np.pi * 8
    K = control.tf(
        [2 * np.pi * crossover * k * lag**2], np.polymul([1, 1e-3], np.polymul([1, lag], [1, lag]))
    )
    return K, control.ss(-K, inputs="y", outputs="F")


# %%
# The same controllers with both sets.
print("\ncrossover    one disc over the levels       spring, damper and a disc (mu)")
accepted = {}
for crossover in (1.0, 2.0, 4.0):
    K, minus_K = controller(crossover)
    disc = robust.check(over_levels, K, certify=False)
    system = robust.models.interconnection([mass, sensor, minus_K], blocks)
    structured = robust.analysis.check_structure(system, certify=False)
    print(f"{crossover:6.2f} Hz {disc.margins.rs:15.2f} {structured.margins.rs:32.2f}")
    if structured.margins.rs > 1:
        accepted = dict(crossover=crossover, disc=disc, system=system)
report = robust.analysis.check_structure(accepted["system"])
print(
    f"margins: the factor by which the whole set may grow.\n\nThe loop of {accepted['crossover']:g}"
    f" Hz:\n{report}"
)

figure, (left, right) = plt.subplots(1, 2, figsize=(15, 6), layout="constrained")
for level, bla, style in zip(levels, blas, ("-", "--", "-."), strict=True):
    left.semilogx(
        bla.f, 20 * np.log10(np.abs(bla.G)), style, lw=1.5, label=f"{level:g} N rms, measured"
    )
corners = [
    1 / (m * s**2 + (c + i * dc) * s + k + j * dk)
    for i in (-1, 0, 1)
    for j in np.linspace(-1, 1, 41)
]
size = 20 * np.log10(np.abs(corners))
left.fill_between(
    omega / 2 / np.pi, size.min(axis=0), size.max(axis=0), color="0.85", label="springs and dampers"
)
left.set(
    xlabel="frequency [Hz]", ylabel="|x / F| [dB re 1 m/N]", title="One machine at three levels"
)
disc = accepted["disc"]
right.loglog(
    disc.curves.omega / 2 / np.pi, disc.curves.rs, "--", label="one disc over the levels: |w T|"
)
right.loglog(
    report.curves.omega[1:] / 2 / np.pi,
    report.curves.rs[1:],
    label="spring, damper and a disc: mu, upper bound",
)
right.axhline(1, color="k", lw=0.8)
right.set(
    xlim=(0.05, 500),
    ylim=(1e-3, 20),
    xlabel="frequency [Hz]",
    ylabel="below one: robustly stable [-]",
)
right.set_title(f"The loop of {accepted['crossover']:g} Hz against both sets")
for ax in (left, right):
    ax.grid(True, which="both", lw=0.3)
    ax.legend(fontsize="small")
figure.savefig(out / "several.png", dpi=90)
print(f"wrote {out}/several.png")
