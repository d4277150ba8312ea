"""
3. Identify one record and read the picture
===========================================

A special-odd multisine excites lines 8k+1 and 8k+3. Output on other lines is distortion or noise:
the odd lines without excitation show odd distortion (friction, saturation), the even lines even
distortion (offsets, asymmetry).
"""

import argparse
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf
from nlfrf.plot import plot_bla, plot_levels, plot_opinion, plot_phase

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/03"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

# %%
# The record: input and output as (realisations, periods, samples). From a file it would be
# nlfrf.load_record("run.mat", u="force", y="position", fs=2048, n_samples=8192, n_discard=1)
ms = nlfrf.multisine("special-odd", fs=2048, n_samples=8192, f_min=1, f_max=150, rms=0.25, rng=1)
record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=4)
noise = 2e-8 * np.random.default_rng(2).standard_normal(record.y.shape)
record = replace(record, y=record.y + noise)
print(f"u and y {record.u.shape}: realisations, periods, samples")

# %%
# The best linear approximation.
bla = nlfrf.identify(record)
print(bla)

# %%
# Some lines: size of the FRF, its bound, and the parts of the bound.
print(
    "\n    f [Hz]   |G| [m/N]   95 % bound   noise    distortion   (of one realisation, relative to"
    " |G|)"
)
for f in (5, 30, 59, 100, 140):
    k = int(np.argmin(np.abs(bla.f - f)))
    size = abs(bla.G[k])
    said = [bla.bound()[k], np.sqrt(bla.var_noise[k]), np.sqrt(bla.var_distortion[k])]
    bound, noise_k, distortion = (f"{100 * number / size:8.2f} %" for number in said)
    print(f"{bla.f[k]:10.2f} {size:11.3g} {bound} {noise_k} {distortion}")

# %%
# Two bounds, two questions. "bla": where is the best linear approximation? "realization": where
# will the FRF of the next record of this machine be? A controller needs the second.
new = nlfrf.simulate(nlfrf.paper_rig(), replace(ms, phase=ms.phase[:, ::-1]), n_periods=2)
G_new = nlfrf.identify(new).G
inside = np.mean(np.abs(G_new - bla.G) <= bla.bound(of="realization"))
print(
    f"\nbound of a new realisation: {100 * inside:.0f} % of the lines of another record lie inside"
    " (95 % promised)"
)

# %%
# A second opinion from the same record: the roughness of the FRF. If the two differ, one assumption
# fails.
opinion = nlfrf.second_opinion(record)
print(opinion)

# %%
# The picture. Top: black is the BLA, green its bound. If green is near black, the FRF is unknown.
# Orange dots are odd detection lines, blue dots even ones. The even ones are at the grey noise, so
# the friction is symmetric. Below: the same in the unit of the output, as an analyser shows it.
figure, axes = plt.subplots(2, 2, figsize=(15, 9), layout="constrained")
plot_bla(bla, ax=axes[0, 0])
plot_levels(bla, ax=axes[1, 0])
plot_phase(bla, ax=axes[0, 1])
plot_opinion(opinion, ax=axes[1, 1])
figure.savefig(out / "bla.png", dpi=100)
nlfrf.save(bla, out / "bla.npz")
nlfrf.export_csv(bla, out / "bla.csv")
print(f"wrote {out}/bla.png, bla.npz and bla.csv")
