"""
7. Shape a loop by hand between demand and uncertainty
======================================================

The demand needs a high ``|L|`` at low frequency; the uncertainty needs a low one at high frequency.
Between these bounds the loop is built from elements, one by one.
"""

import argparse
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.plot import plot_check, plot_loop_bounds, plot_nyquist

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/07"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The set of plants: the friction rig at two levels, between which its resonance moves, and the
# demand. Four realisations for each level: with fewer, some records allow no integral action at the
# lowest lines.
levels, band = (0.25, 0.5), dict(fs=2048, n_samples=8192, f_min=0.25, f_max=150)  # N rms
ms = [nlfrf.multisine(**band, rms=rms, n_realizations=4, rng=1) for rms in levels]
blas = [nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), m, n_periods=2)) for m in ms]
model = robust.uncertainty(blas, robust.fit_nominal(blas, n_poles=3), order=6)
w_P = robust.performance_weight(2 * np.pi * 1.0, M_S=4, A=0.1)
low, high = robust.shaping.loop_bounds(model, w_P)
f = model.omega / (2 * np.pi)
print(f"|L| must be high up to {f[low > 0].max():.3g} Hz (there above {low[low > 0][-1]:.3g})")
unknown = f[high < np.inf]
if unknown.size:
    print(
        f"|L| must be low from {unknown[0]:.3g} to {unknown[-1]:.3g} Hz: at most {high.min():.2g}"
    )

# %%
# Element by element. Below its resonance the plant is a spring.
stiffness = 1 / abs(blas[0].G[0])
hz = 2 * np.pi
steps = {
    "a gain": 1.0 * stiffness,
    "an integrator": robust.shaping.pid(0.0, hz * 8) * stiffness,
    "a notch over the resonance": (
        robust.shaping.pid(0.0, hz * 8)
        * robust.shaping.notch(hz * 50, depth=0.15, width=1.0)
        * stiffness
    ),
    "roll-off above": (
        robust.shaping.pid(0.0, hz * 8)
        * robust.shaping.notch(hz * 50, depth=0.15, width=1.0)
        * robust.shaping.low_pass(hz * 150, order=1)
        * stiffness
    ),
}
figure, axes = plt.subplots(2, 3, figsize=(20, 9.5), layout="constrained")
print(
    f"\n{'added':28s} {'on the nominal':>14s} {'max rs':>8s} {'max rp':>8s}"
    f" {'lines beyond a bound':>22s}"
)
for ax, (what, K) in zip(axes.flat[:4], steps.items(), strict=True):
    report = robust.check(model, K, w_P=w_P, certify=False)
    L = np.exp(
        np.interp(np.log(model.omega), np.log(report.curves.omega), np.log(np.abs(report.curves.L)))
    )
    stable = "stable" if report.nominally_stable else "unstable"
    rs, rp = (
        np.max(curve) if report.nominally_stable else np.nan
        for curve in (report.curves.rs, report.curves.rp)
    )
    print(f"{what:28s} {stable:>14s} {rs:8.2f} {rp:8.2f} {np.sum((low > L) | (high < L)):22d}")
    plot_loop_bounds(model, w_P, K, ax=ax)
    ax.set_title(f"{what}: {ax.get_title()}", fontsize="medium")

# A line may stay beyond a bound: the bounds hold for any phase of L, the check uses the actual
# phase.

# %%
# The controller runs sampled: each element takes dt and is exact at its own frequency. The check
# adds hold and delay.
dt = 1e-3
K = robust.shaping.pid(0.0, hz * 8, dt=dt) * robust.shaping.notch(
    hz * 50, depth=0.15, width=1.0, dt=dt
)
K = K * robust.shaping.low_pass(hz * 150, order=1, dt=dt) * stiffness
report = robust.check(model, K, w_P=w_P, delay=5e-4)
print(f"\n{report.summary}")
plot_check(report, ax=axes[1, 1])
plot_nyquist(report, ax=axes[1, 2])
figure.savefig(out / "by_hand.png", dpi=75)
robust.save(K, out / "by_hand.json", delay=5e-4)
print(f"wrote {out}/by_hand.png and by_hand.json")
