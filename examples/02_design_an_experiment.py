"""
2. Design an experiment for a machine
=====================================

This example chooses length, resolution, level and crest factor of an experiment, each by a number.
The machine is the built-in rig, a mass on a spring with friction and a resonance near 59 Hz.
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
from nlfrf.plot import plot_excitation, plot_spectrum

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/02"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# sampling frequency [Hz], band [Hz], what the actuator can do [N]
FS = 2048
BAND = (1.0, 150.0)
LIMIT = 1.0
rig = nlfrf.paper_rig()

# %%
# Resolution. f0 = fs / N, and a period takes 1 / f0. A special-odd grid excites two lines of eight,
# so the lines of the FRF lie about 4 f0 apart: several of them should fall on a resonance,
# otherwise its shape is unknown.
print("resolution   period   lines in the band   lines on the resonance (59 +- 2 Hz)")
for n_samples in (1024, 2048, 4096, 8192):
    ms = nlfrf.multisine(fs=FS, n_samples=n_samples, f_min=BAND[0], f_max=BAND[1], rng=1)
    near = np.count_nonzero(np.abs(ms.f - 59) <= 2)
    print(f"{ms.f0:7.2f} Hz {1 / ms.f0:7.2f} s {ms.f.size:12d} {near:20d}")

# %%
# Level. The distortion depends on it, so measure at the level at which the machine will work. The
# peak determines the actuator: with random phases it is 3 to 4 times the rms.
N = 8192
band = dict(fs=FS, n_samples=N, f_min=BAND[0], f_max=BAND[1])
ms = nlfrf.multisine("special-odd", **band, rms=0.25, rng=2)
print(
    f"\nrms {ms.rms:g} N peaks at {ms.rms * ms.crest_factor[0]:.2f} N: crest factor"
    f" {ms.crest_factor[0]:.2f}"
)

# %%
# Crest factor. If the actuator is the limit, take the best of some random draws. They are still
# random, so the bound holds, except for laws as steep as a fifth power. (With target= the phases
# are optimised and no longer random: only for nearly linear plants, and with a warning.)
drawn = nlfrf.reduce_crest(ms, rng=1)
for name, signal in (("as drawn", ms), ("best of some draws", drawn)):
    crest = signal.crest_factor[0]
    print(f"{name}: crest factor {crest:.2f}, so up to {LIMIT / crest:.2f} N rms under {LIMIT:g} N")

# %%
# Time. Transients decay in the first periods, and two more periods separate noise from distortion.
# The distortion of one realisation does not average away, so further periods help only against
# noise.
noise = 2e-6  # of the position sensor [m]
rng = np.random.default_rng(2)
print("\nperiods kept   time      bound   noise   distortion     (medians, relative to |G|)")
for n_periods in (2, 4, 16):
    record = nlfrf.simulate(rig, drawn, n_periods=n_periods, n_discard=2)
    record = replace(record, y=record.y + noise * rng.standard_normal(record.y.shape))
    bla = nlfrf.identify(record)
    parts = [bla.bound(), np.sqrt(bla.var_noise), np.sqrt(bla.var_distortion)]
    bound, from_noise, distortion = (100 * np.median(part / np.abs(bla.G)) for part in parts)
    print(
        f"{n_periods:8d} {(n_periods + 2) * N / FS:12.0f} s {bound:8.1f} % {from_noise:5.1f} %"
        f" {distortion:8.1f} %"
    )
print(
    "Periods average noise and make the variances more certain, but do not reduce the distortion."
)
print("Beyond a few periods use the time for other realisations.")

# %%
# Several realisations average the distortion too.
many = replace(drawn, phase=np.random.default_rng(3).uniform(0, 2 * np.pi, (7, drawn.f.size)))
record = nlfrf.simulate(rig, many, n_periods=2, n_discard=2)
bla = nlfrf.identify(replace(record, y=record.y + noise * rng.standard_normal(record.y.shape)))
print(
    f"seven realisations of two periods, {7 * 4 * N / FS:.0f} s:"
    f" {100 * np.median(bla.bound() / abs(bla.G)):.1f} %"
)

nlfrf.save(drawn, out / "excitation.csv")  # for the generator; the design stands beside it as .npz
figure, (top, bottom) = plt.subplots(2, 1, figsize=(9, 8), layout="constrained")
plot_excitation(drawn, ax=top)
plot_spectrum(drawn, ax=bottom)
figure.savefig(out / "excitation.png", dpi=110)
print(f"wrote {out}/excitation.csv and excitation.png")
