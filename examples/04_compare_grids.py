"""
4. Compare grids: why odd-odd misleads
======================================

Every grid gives the same best linear approximation, but the detection lines show different parts of
the distortion. Around a resonance only combinations f1 + f2 - f3 of neighbouring lines matter. On
an odd-odd grid (4k+1) these fall on excited lines again, so its detection lines (4k+3) show little
distortion.
"""

import argparse
import warnings
from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import nlfrf

parser = argparse.ArgumentParser(description=__doc__)
parser.add_argument("--out", type=Path, default=Path("demo/04"), help="folder for the pictures")
out = parser.parse_args().out
out.mkdir(parents=True, exist_ok=True)

N_RECORDS = 12
rig = nlfrf.paper_rig()


def db(amplitude):
    """Amplitude in decibels."""
    return 20 * np.log10(amplitude)


figure, axes = plt.subplots(3, 1, figsize=(9, 11), sharex=True, sharey=True, layout="constrained")
print("                  level over truth [dB]   95 % bound holds BLA")
print("grid        lines   band at resonance     band  at resonance   level")
for ax, kind in zip(axes, ("odd-odd", "special-odd", "random-odd"), strict=True):
    # 1. True values: the BLA and the scatter about it, from many realisations at the same rms.
    ms = nlfrf.multisine(
        kind,
        fs=2048,
        n_samples=8192,
        f_min=2,
        f_max=140,
        rms=0.25,
        n_realizations=2 * N_RECORDS,
        rng=1,
    )
    record = nlfrf.simulate(rig, ms)
    U, Y = (
        np.fft.rfft(signal[:, 0], axis=1)[:, ms.lines.excited] for signal in (record.u, record.y)
    )
    each = Y / U
    truth, scatter = each.mean(axis=0), each.std(axis=0, ddof=1)
    near = np.abs(ms.f - 59) < 3

    # 2. One record: first the detection lines without correction, then the default of identify. On
    # odd-odd it warns,
    #    and uses the roughness of the FRF over the excited lines instead.
    for level_from, style in (("detection", "--"), ("auto", "-")):
        levels, inside = [], []
        for m in range(N_RECORDS):
            one = replace(record, u=record.u[m : m + 1], y=record.y[m : m + 1])
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", nlfrf.DataWarning)
                bla = nlfrf.identify(one, level_from=level_from)
            levels.append(
                bla.var_distortion / (bla.grid_factor if level_from == "detection" else 1)
            )
            inside.append(np.abs(bla.G - truth) <= bla.bound())
        level, inside = np.sqrt(np.mean(levels, axis=0)), 100 * np.mean(inside, axis=0)
        over = db(level / scatter)
        what = (
            f"{bla.level_source}, calibrated"
            if bla.level_source == "detection"
            else bla.level_source
        )
        print(
            f"{kind:12s} {ms.f.size:4d} {np.median(over):6.1f} {np.median(over[near]):12.1f}"
            f" {inside.mean():8.1f} % {inside[near].mean():9.1f} %   "
            + ("detection lines, uncorrected" if level_from == "detection" else f"identify: {what}")
        )
        label = "detection lines, uncorrected" if level_from == "detection" else f"identify: {what}"
        ax.plot(ms.f, db(level), style, label=label)
    ax.plot(ms.f, db(scatter), "k.", ms=3, label="true scatter of one realisation")
    ax.plot(ms.f, db(np.abs(truth)), "k-.", lw=1, label="|BLA|")
    ax.set(title=f"{kind} grid", ylabel="[dB re 1 m/N]")
    ax.grid(alpha=0.3)
    ax.legend(fontsize="small")
axes[-1].set_xlabel("frequency [Hz]")
figure.savefig(out / "grids.png", dpi=100)
print(
    "Far below 0 dB at the resonance: the detection lines do not show the distortion, and no"
    " correction"
)
print("can help.")
print(f"wrote {out}/grids.png")
