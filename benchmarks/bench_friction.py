"""Speed of the friction bench: compilation, one period, against LSODA at the same accuracy, the
whole reproduction.
"""

from __future__ import annotations

import argparse
import math
import os
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
from scipy.integrate import solve_ivp

from benchmarks.timing import best, of_children
from nlfrf.friction import Coulomb, GeneralizedMaxwellSlip, Leuven, LuGre
from nlfrf.hysteresis import MaxwellSlip
from nlfrf.rig import run
from nlfrf.rig.bench.rig import Rig, initial_memory, integrate_rig
from nlfrf.signals.multisine import multisine

SLIDING = {"Fs": 1.0, "Fc": 0.7, "vs": 0.01, "sigma2": 0.4}
#: Elements that slip one after the other at 0.1 to 3.5 times Fs/K0.
ELEMENTS = MaxwellSlip(np.full(16, 4e3), 4e3 / 64e3 * np.geomspace(0.1, 3.5, 16))
LAWS = {
    "Leuven, stack (target 15)": Leuven(),
    "Leuven, 16 elements (target 25)": Leuven(curve=ELEMENTS),
    "LuGre": LuGre(sigma0=64e3, sigma1=13.0, **SLIDING),
    "generalised Maxwell-slip, 16": GeneralizedMaxwellSlip(
        stiffness=ELEMENTS.stiffness, alpha=ELEMENTS.strength / ELEMENTS.Fy, C=20.0, **SLIDING
    ),
    "Coulomb": Coulomb(**SLIDING),
}
FIRST = "import nlfrf, numpy; nlfrf.rig.run(nlfrf.paper_rig(), numpy.ones(99), fs=4096.0)"


def first_use():
    """A fresh process with an empty cache of compiled code, and the same again with what it left
    there [s].
    """
    with tempfile.TemporaryDirectory() as folder:
        environment = {**os.environ, "NUMBA_CACHE_DIR": folder}
        return [
            best(
                lambda: subprocess.run([sys.executable, "-c", FIRST], env=environment, check=True),
                1,
                of_children,
            )
            for _ in "12"
        ]


def one_period_each():
    """One 4 s period at 4096 Hz on one core, at the paper's three levels [ms]."""
    for name, law in LAWS.items():
        rig, times = Rig(1.0, 80e3, law), []
        for rms in (0.025, 0.25, 2.5):
            ms = multisine(fs=4096, n_samples=16384, f_min=1, f_max=143.5, rms=rms, rng=1)
            # at the begin, the middle and the end of each step
            u = ms.sampled(2 * ms.n_samples)[0]
            drive = np.stack([u[0::2], u[1::2], np.roll(u[0::2], -1)], axis=1)
            memory = initial_memory(rig)
            times.append(
                1e3
                * best(
                    lambda r=rig, m=memory, d=drive: integrate_rig(
                        r, m, drive=d, h=1 / 4096, substeps=1
                    ),
                    15,
                )
            )
        print(f"  {name:<32}" + "".join(f"{t:8.1f} ms" for t in times))


def against_lsoda():
    """LuGre, 1 s at 4096 Hz: LSODA, and the same or a smaller error by the bench, in one run."""
    sigma0, fs, n = 64e3, 4096.0, 4096
    rig = Rig(1.0, 80e3, LAWS["LuGre"])
    ms = multisine(fs=fs, n_samples=n, f_min=1, f_max=143.5, rms=1.0, rng=1)
    u = ms.u[0]
    exact = run(rig, u, fs=fs, oversampling=64).x
    samples = np.append(u, u[-1]).tolist()

    def derivative(t, state):
        x, v, z = state
        i = min(int(t * fs), n - 1)
        force = samples[i] + (samples[i + 1] - samples[i]) * (t * fs - i)
        s = 0.7 + 0.3 * math.exp(-((v / 0.01) ** 2))
        dz = v - sigma0 * abs(v) / s * z
        return v, force - 80e3 * x - (sigma0 * z + 13.0 * dz + 0.4 * v), dz

    t = np.arange(n) / fs
    for rtol in (1e-4, 1e-6, 1e-8):
        begin = time.process_time()
        # the largest step as long as a sample: without it LSODA steps over the corners of the force
        theirs = solve_ivp(
            derivative,
            (0, t[-1]),
            [0, 0, 0],
            "LSODA",
            rtol=rtol,
            atol=[rtol * 1e-5, rtol * 1e-3, rtol * 1e-5],
            t_eval=t,
            max_step=1 / fs,
        )
        elapsed = time.process_time() - begin
        error = np.sqrt(np.mean((theirs.y[0] - exact) ** 2)) / exact.std()
        for oversampling in (1, 2, 4, 8):
            ours = (
                np.sqrt(np.mean((run(rig, u, fs=fs, oversampling=oversampling).x - exact) ** 2))
                / exact.std()
            )
            if ours <= error:
                break
        mine = best(lambda k=oversampling: run(rig, u, fs=fs, oversampling=k), 9)
        print(
            f"  LSODA at rtol {rtol:g}: {elapsed:.2f} s, error {error:.1e}; ours {1e3 * mine:.2f}"
            f" ms, error {ours:.1e}: {elapsed / mine:.0f} times faster (target 100)"
        )


def main():
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument(
        "--full", action="store_true", help="also the reproduction with 100 realisations"
    )
    options = parser.parse_args()
    cold, warm = first_use()
    print(
        f"First use in a fresh process: {cold:.1f} s (target 20); from the cache on disk:"
        f" {warm:.1f} s"
    )
    print("One 4 s period at 4096 Hz, one core; 0.025, 0.25 and 2.5 N rms")
    one_period_each()
    print("LuGre, 1 s at 4096 Hz")
    against_lsoda()
    if options.full:
        sys.path.append(str(Path(__file__).parents[1] / "examples" / "paper"))
        from reproduce import reproduce

        with tempfile.TemporaryDirectory() as folder:
            elapsed = best(lambda: reproduce(folder, n_realizations=100), 1, time.perf_counter)
        print(f"reproduce with 100 realisations: {elapsed:.0f} s (target 180)")


if __name__ == "__main__":
    main()
