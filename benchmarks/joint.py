"""How often a set holds a *whole* new FRF, against what is estimated for it; and what all lines
together would cost.

    python -m benchmarks.joint [--records 20] [--fresh 400] [--only rig]

For each case sets are made of single records, at 95 % per line, and FRFs of fresh realisations,
without noise, are held against each. "new" and "BLA": how many lie in the set as a whole, and the
estimate beside it, both as means over the sets; "rms" of the estimate over single sets. "together":
the same with simultaneous=True, and by how much its radius is larger.
"""

from __future__ import annotations

import argparse
import warnings
from dataclasses import replace

import control
import numpy as np

import nlfrf
import robust
from benchmarks.plants import OTHERS, STATIC, spring

DESIGNS = {
    "rig": dict(fs=4096, n_samples=16384, f_min=1.25, f_max=150, rms=0.25),
    "static": dict(fs=1024, n_samples=2048, f_min=1, f_max=200),
    "Duffing": dict(fs=512, n_samples=2048, f_min=1, f_max=60),
}
#: Plant, poles of the nominal (0: the FRF itself, -1: a gain), order of the weight, realisations,
#: SNR [dB].
CASES = (
    ("rig", 0, 1, 1, None),
    ("rig", 0, 2, 1, None),
    ("rig", 0, 5, 1, None),
    ("rig", 3, 1, 1, None),
    ("rig", 3, 4, 1, None),
    ("rig", 8, 4, 1, None),
    ("rig", 0, 4, 2, None),
    ("rig", 3, 4, 2, None),
    ("rig", 0, 4, 1, 30),
    ("rig", 3, 4, 1, 30),
    ("cubic", 0, 1, 1, None),
    ("cubic", 0, 4, 1, None),
    ("cubic", -1, 3, 1, None),
    ("quintic", 0, 4, 1, None),
    ("quintic", -1, 2, 1, None),
    ("saturation", 0, 3, 1, None),
    ("even", -1, 2, 1, None),
    ("Wiener", 0, 4, 1, None),
    ("Wiener", 2, 3, 1, None),
    ("Hammerstein", 0, 4, 1, None),
    ("Hammerstein", 2, 2, 1, None),
    ("Duffing", 0, 4, 1, None),
    ("Duffing", 2, 4, 1, None),
)


def steady(plant, n, rng):
    """A multisine of n realisations, and the (n, N) steady-state output of a plant to it."""
    ms = nlfrf.multisine(
        "special-odd", **DESIGNS.get(plant, DESIGNS["static"]), n_realizations=n, rng=rng
    )
    if plant == "rig":
        return ms, nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=1).y[:, 0]
    if plant == "Duffing":
        return ms, spring(ms.u, ms.fs, (1.0, 0.001, 0.0, 0.0), 0.02, 30.0, 3)
    return ms, (STATIC | OTHERS)[plant](ms.u, ms.fs)


def frfs(ms, y):
    """(n, F) FRF of each realisation."""
    k = ms.lines.excited
    return np.fft.rfft(y)[:, k] / np.fft.rfft(ms.u)[:, k]


def recorded(ms, y, rows, snr, rng):
    """The record of some realisations, two periods."""
    u, out = (np.repeat(signal[rows][:, None], 2, axis=1) for signal in (ms.u, y))
    if snr is not None:
        out = out + np.sqrt(np.mean(out**2)) * 10 ** (-snr / 20) * rng.standard_normal(out.shape)
    return nlfrf.Record(u=u, y=out, fs=ms.fs, lines=ms.lines)


def set_of(bla, n_poles, order, **more):
    """The set of a record around one of the nominals."""
    if n_poles < 0:
        return robust.uncertainty(
            bla, control.ss([], [], [], [[float(np.mean(bla.G.real))]]), order=order, **more
        )
    nominal = robust.frd(bla) if n_poles == 0 else robust.fit_nominal(bla, n_poles=n_poles)
    return robust.uncertainty(bla, nominal, order=order, **more)


def held(model, omega, G):
    """Share of the FRFs (n, F) that lie in the set on all lines."""
    return float(np.mean(np.all(model.is_within(omega, G, model.at(omega)), axis=1)))


def measure(case, ms, y, n_records, rng):
    """Rows (n, 6): held and estimated, new realisation and BLA; held together; its radius over that
    per line.
    """
    _, n_poles, order, M, snr = case
    fresh = frfs(replace(ms, phase=ms.phase[M * n_records :]), y[M * n_records :])
    rows = []
    for i in range(n_records):
        bla = nlfrf.identify(recorded(ms, y, M * i + np.arange(M), snr, rng))
        model, wide = (set_of(bla, n_poles, order, simultaneous=every) for every in (False, True))
        truth = fresh.mean(axis=0)[None]
        rows.append(
            (
                held(model, bla.omega, fresh),
                model.joint.frf,
                held(model, bla.omega, truth),
                model.joint.bla,
                held(wide, bla.omega, fresh),
                float(np.median(wide.radius / model.radius)),
            )
        )
    return np.array(rows)


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=20)
    parser.add_argument("--fresh", type=int, default=400)
    parser.add_argument("--only", default="")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    played, errors = {}, []
    print(
        "plant       poles order  M   SNR | new: held estimate rms | BLA: held estimate | together:"
        " held   radius x"
    )
    for case in CASES:
        plant, n_poles, order, M, snr = case
        if chosen.only not in plant:
            continue
        rng = np.random.default_rng(1)
        if plant not in played:
            played[plant] = steady(plant, 2 * chosen.records + chosen.fresh, rng)
        found = measure(case, *played[plant], chosen.records, rng)
        mean, rms = found.mean(axis=0), np.sqrt(np.mean((found[:, 0] - found[:, 1]) ** 2))
        errors.append(mean[1] - mean[0])
        nominal = {0: "FRF", -1: "gain"}.get(n_poles, n_poles)
        print(
            f"{plant:<12} {nominal:>4} {order:>5} {M:>2} {snr or 'none':>5} |"
            f"     {mean[0]:6.3f} {mean[1]:8.3f} {rms:.2f} |"
            f"      {mean[2]:.3f} {mean[3]:8.3f} |         {mean[4]:6.3f} {mean[5]:10.2f}",
            flush=True,
        )
    errors = np.array(errors)
    print(
        f"estimate less what was held: mean {errors.mean():+.3f}, |.| {np.abs(errors).mean():.3f},"
        f" at most {np.abs(errors).max():.3f} over {errors.size} cases"
    )


if __name__ == "__main__":
    main()
