"""
9. A PID controller from one record, without a parametric model
===============================================================

The record gives the FRF and a disc on every line. A convex program finds the PID with the most
integral action for which every plant in the discs is stable and its sensitivity stays below a
limit. The check follows, on the lines and, with a model, at all frequencies. Then the controller
runs on the nonlinear machine.
"""

import argparse
from pathlib import Path
from textwrap import fill

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
import robust
from robust.plot import plot_check, plot_loop, plot_nyquist

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/09"), help="folder for the pictures")
(out := parser.parse_args().out).mkdir(parents=True, exist_ok=True)

# %%
# One record of the friction rig, two periods of a special-odd multisine at the level the machine
# will work at.
ms = nlfrf.multisine(fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, rng=2)
bla = nlfrf.identify(nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2))
print(bla)

# %%
# The controller runs at 1 kHz with half a millisecond of computation: hold and delay are in the
# plant of the design. The sensitivity may peak at 1.6 for any plant in the discs. Does more
# structure give more integral action?
designs = {}
print(f"\n{'structure':10s} {'integral gain [N/m/s]':>22s} {'steps':>6s}   ended")
for structure in ("I", "PI", "PID"):
    design = robust.design_frf(bla, structure, M_S=1.6, dt=1e-3, delay=5e-4, n_starts=4)
    low = 1e-3  # rad/s: K = ki/s there
    ki = abs(design.K(np.exp(1j * low * 1e-3))) * low
    print(f"{structure:10s} {ki:22.0f} {len(design.history):6d}   limits met: {design.met}")
    print(fill(design.reason, 96, initial_indent="    ", subsequent_indent="    "))
    designs[structure] = design
K = designs["PID"].K

# %%
# An impossible demand: the reason names the demand that cannot be met, and the frequency.
too_much = robust.design_frf(bla, "PID", M_S=1.2, omega_c=2 * np.pi * 40, dt=1e-3, delay=5e-4)
print("\n" + fill(f"a crossover of 40 Hz with |S| <= 1.2: {too_much.reason}", 100))

# %%
# The check on the lines: it holds on the lines only, and every number includes the discs.
on_lines = robust.check(bla, K, delay=5e-4)
print(f"\n{on_lines.summary}")

# %%
# With a model stability is proved at all frequencies, for the linear plants of the set.
nominal = robust.fit_nominal(bla, n_poles=3)
model = robust.uncertainty(bla, nominal, order=4)
report = robust.check(model, K, delay=5e-4)
print(f"\n{report.summary}")

# %%
# On the nonlinear machine with friction: a step of the position and a push.
t = np.arange(2000) / 1000
r = np.where(t > 0.1, 2e-5, 0.0)
push = np.where(t > 1.0, 0.2, 0.0)
print(
    f"\n{'structure':10s} {'reached to 5 % after':>21s} {'error by the push':>18s}"
    f" {'error at the end':>22s}"
)
responses = {}
for structure, design in designs.items():
    run = nlfrf.rig.run(
        nlfrf.paper_rig(), r, nlfrf.rig.Controller(design.K, delay=5e-4), disturbance=push
    )
    late = np.flatnonzero(np.abs(run.e[100:1000]) > 0.05 * r[-1])[-1] / 1000
    after = np.abs(run.e[1000:])
    print(
        f"{structure:10s} {late:19.3f} s {1e6 * after.max():15.2f} um"
        f" {1e6 * after[-100:].mean():19.3f} um"
    )
    assert not run.diverged
    responses[structure] = run

figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
plot_loop(on_lines, ax=axes[0, 0])
plot_nyquist(on_lines, ax=axes[0, 1])
plot_check(report, ax=axes[1, 0])
for (structure, run), style in zip(responses.items(), ("-", "--", "-."), strict=True):
    axes[1, 1].plot(run.t, 1e6 * run.x, style, lw=1.4, label=structure)
axes[1, 1].plot(t, 1e6 * r, "k:", lw=1, label="reference")
axes[1, 1].set(
    xlabel="time [s]",
    ylabel="position [µm]",
    title="On the rig: a step at 0.1 s, a push of 0.2 N at 1 s",
)
axes[1, 1].legend()
axes[1, 1].grid(alpha=0.3)
figure.savefig(out / "pid.png", dpi=90)
robust.save(K, out / "pid.json", delay=5e-4)
print(f"wrote {out}/pid.png and pid.json")
