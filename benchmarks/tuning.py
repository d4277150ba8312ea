"""Static and low-order output feedback by `tune` on COMPleib:

H-infinity norms beside what was found before.

Anchors are those that no controller of any order beats: they are to be reached to five digits. The
other numbers are those of a prototype of the same method. Each norm is compared with that of the
loop made again from the blocks.

python -m benchmarks.tuning [--data FOLDER] [--starts 4] [NAME or NAME:ORDER ...]

FOLDER holds problems.npz (see NLFRF_DATA); skipped where absent.
"""

from __future__ import annotations

import argparse
import os
import time
import warnings
from pathlib import Path

import numpy as np

import robust
from robust import tuning
from robust.lti.norms import hinf_norm
from tests.support.compleib import generalised

FOLDER = (
    Path(os.environ.get("NLFRF_DATA", Path(__file__).parents[2] / "shared" / "data")) / "compleib"
)
ANCHORS = {
    "AC2": 0.111489,
    "AC17": 6.61243,
    "AGS": 8.17324,
    "BDT1": 0.266212,
    "CM1_IS": 0.816497,
    "PSM": 0.920243,
    "REA3": 74.2513,
    "REA2:1": 1.13409,
}
BEFORE = {
    "AC4": 0.93547,
    "AC7": 0.065091,
    "AC8": 2.0050,
    "AC12": 0.32394,
    "AC15": 15.1687,
    "AC16": 14.8562,
    "AC18": 10.6972,
    "HE1": 0.15382,
    "HE5": 8.8952,
    "REA1": 0.86592,
    "REA2": 1.1489,
    "WEC1": 4.0500,
    "MFP": 31.5899,
    "EB2": 2.0201,
    "NN2": 2.2216,
    "NN8": 2.8881,
    "NN9": 29.31,
    "NN13": 14.058,
    "NN15": 0.098090,
    "NN16": 0.95559,
    "TMD": 2.5161,
    "NN2:1": 1.76442,
    "AC4:1": 0.55741,
}


def designed(
    problems: np.lib.npyio.NpzFile, name: str, order: int, n_starts: int
) -> tuple[tuning.TunedDesign, float]:
    """The best of several starts, and the norm of its loop made again."""
    P, n_y, n_u = generalised(problems, name)
    n_w, n_z = P.ninputs - n_u, P.noutputs - n_y
    w, u, z, y = (
        [f"{letter}{k}" for k in range(n)]
        for letter, n in zip("wuzy", (n_w, n_u, n_z, n_y), strict=True)
    )
    K = (
        tuning.StateSpace(n_states=order, reads=y, drives=u)
        if order
        else tuning.Gain(K=np.zeros((n_u, n_y)), reads=y, drives=u)
    )
    plant = tuning.Plants(P, inputs=[*w, *u], outputs=[*z, *y])
    design = robust.tune(
        [], plant, {"K": K}, soft=[tuning.Limit(w, z)], n_starts=n_starts, time_cap=120.0, rng=1
    )
    return design, hinf_norm(design.loop(w, z))[0] if design.limits else np.inf


def main() -> None:
    """One line a problem, then what is asked of all of them."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--data", type=Path, default=FOLDER, help="folder of problems.npz")
    parser.add_argument("--starts", type=int, default=4)
    parser.add_argument("names", nargs="*", help="problems; all where none is named")
    given = parser.parse_args()
    if not (given.data / "problems.npz").exists():
        print(f"no published problems in {given.data}")
        return
    warnings.simplefilter("ignore")
    problems, known = np.load(given.data / "problems.npz"), ANCHORS | BEFORE
    ratios, seconds, apart, missed = [], [], [], []
    print("problem   order       gamma      before    ratio  certified   starts within 0.5 %     s")
    for name in given.names or known:
        problem, _, order = name.partition(":")
        begin = time.process_time()
        design, norm = designed(problems, problem, int(order or 0), given.starts)
        seconds.append(time.process_time() - begin)
        before = known.get(name, np.nan)
        ratio = design.gamma / before
        same = sum(one <= 1.005 * min(design.spread) for one in design.spread)
        away = norm / design.gamma - 1
        row = (
            f"{problem:8} {order or 0:>6} {design.gamma:11.6g} {before:11.6g} {ratio:8.5f}"
            f" {away:10.1e}"
        )
        print(f"{row} {same:>8} of {len(design.spread)}       {seconds[-1]:8.1f}", flush=True)
        ratios.append(ratio)
        apart.append(abs(away))
        if name in ANCHORS and abs(ratio - 1) > 1e-5:
            missed.append(f"{name}: anchor missed by {ratio - 1:.1e}")
        elif ratio > 1.005:
            missed.append(f"{name}: {100 * (ratio - 1):.1f} % above what was found before")
    print(
        f"{len(ratios)} problems: median {np.median(seconds):.1f} s of CPU for {given.starts}"
        f" starts; largest distance from the norm of the loop made again {max(apart):.1e}"
    )
    print(
        "\n".join(missed)
        or "every anchor to five digits, nothing more than 0.5 % above what was found before"
    )


if __name__ == "__main__":
    main()
