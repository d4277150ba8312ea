"""How `validate` judges a second record: where nothing has changed, and where gain, delay or a
resonance have.

    python -m benchmarks.validation [--records 500] [--plant rig] [--f-max 150]

Two records of two periods each, of fresh phases; the model is made of the first, around its FRF or
a fit of it. "KS" is the Kolmogorov-Smirnov distance of the p-values from uniform, beside the one
that 5 % of uniform samples exceed. A changed record is the second one behind a known linear system.
Its power is held against what theory allows: that of the most powerful test of level 5 % that knows
the change and both variances, and of chi-square of three degrees of freedom.
"""

from __future__ import annotations

import argparse
import warnings

import numpy as np
from scipy.stats import kstest, ncx2, norm

import nlfrf
import robust
from benchmarks.plants import OTHERS, STATIC
from robust.models.sets.records import summarize_record

F_N, ZETA = 58.6, 0.0622  # of the rig in small motions, as its fit tells


def moved(f, ratio, *, stiffness=False):
    """(F,) what a resonance that moves by a ratio makes of an FRF; by the spring of a mass, or by
    its mass.
    """
    s, w = 2j * np.pi * f, 2 * np.pi * F_N
    there = (s**2 + 2 * ZETA * w * s + w**2) / (s**2 + 2 * ZETA * w * ratio * s + (w * ratio) ** 2)
    return there if stiffness else there * ratio**2


CHANGES = {
    "nothing": lambda f: np.ones(f.size),
    "gain + 3 %": lambda f: np.full(f.size, 1.03),
    "gain + 5 %": lambda f: np.full(f.size, 1.05),
    "resonance + 0.5 %": lambda f: moved(f, 1.005),
    "resonance + 1 %": lambda f: moved(f, 1.01),
    "the same by its spring, + 0.5 %": lambda f: moved(f, 1.005, stiffness=True),
    "by its spring, + 1 %": lambda f: moved(f, 1.01, stiffness=True),
    "delay + 0.2 ms": lambda f: np.exp(-2j * np.pi * f * 2e-4),
}


def played(plant, n, f_max, rng):
    """A multisine of n realisations and the (n, N) steady-state output to it."""
    if plant == "rig":
        ms = nlfrf.multisine(
            fs=4096, n_samples=16384, f_min=1.25, f_max=f_max, rms=0.25, n_realizations=n, rng=rng
        )
        return ms, nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=1).y[:, 0]
    ms = nlfrf.multisine(fs=1024, n_samples=2048, f_min=1, f_max=f_max, n_realizations=n, rng=rng)
    return ms, (STATIC | OTHERS)[plant](ms.u, ms.fs)


def record_of(ms, u, y, snr, rng):
    """Two periods of one realisation."""
    u, y = (np.repeat(signal[None, None], 2, axis=1) for signal in (u, y))
    if snr is not None:
        y = y + np.sqrt(np.mean(y**2)) * 10 ** (-snr / 20) * rng.standard_normal(y.shape)
    return nlfrf.Record(u=u, y=y, fs=ms.fs, lines=ms.lines)


def behind(y, f, change):
    """(N,) a periodic signal behind a linear system."""
    spectrum = np.fft.rfft(y)
    spectrum[1:] *= change(f[1:])
    return np.fft.irfft(spectrum, y.size)


def model_of(bla, nominal=None):
    """A model that remembers a record, around its FRF where no nominal is given; its weight has no
    say here.
    """
    nominal, ones = robust.frd(bla) if nominal is None else nominal, np.ones(bla.f.size)
    known = (summarize_record(bla),)
    return robust.UncertaintyModel(
        nominal, 2.0, "multiplicative", bla.omega, ones, 0.95, records=known
    )


def judged(ms, y, n_records, n_poles, snr, rng, changes=CHANGES):
    """Change -> the `Validation` of each pair of records."""
    f = np.arange(ms.n_samples // 2 + 1) * ms.fs / ms.n_samples
    u, found = ms.u, {name: [] for name in changes}
    for i in range(n_records):
        first = nlfrf.identify(record_of(ms, u[i], y[i], snr, rng))
        model = model_of(first, robust.fit_nominal(first, n_poles=n_poles).G if n_poles else None)
        for name, change in changes.items():
            j = n_records + i
            second = nlfrf.identify(record_of(ms, u[j], behind(y[j], f, change), snr, rng))
            found[name].append(robust.validate(model, second))
    return found


def allowed(ms, y, change):
    """Power at 5 % of the best test there is, and of the chi-square with three degrees of freedom,
    M = 1.
    """
    k = ms.lines.excited
    each = np.fft.rfft(y)[:, k] / np.fft.rfft(ms.u)[:, k]
    truth = each.mean(axis=0)
    variance = np.mean(np.abs(each - truth) ** 2, axis=0)
    away = 2 * np.sum(np.abs((change(ms.f) - 1) * truth) ** 2 / (2 * variance))
    return norm.sf(norm.isf(0.05) - np.sqrt(away)), ncx2.sf(
        ncx2.isf(0.05, 3, 1e-9), 3, max(away, 1e-9)
    )


def main() -> None:
    """Print the tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=500)
    parser.add_argument("--plant", default="rig")
    parser.add_argument("--f-max", type=float, default=150)
    parser.add_argument("--snr", type=float)
    parser.add_argument("--poles", type=int, nargs="*", default=[0, 3])
    parser.add_argument("--nulls", action="store_true", help="nothing changed, only")
    chosen = parser.parse_args()
    warnings.simplefilter("ignore")
    rng = np.random.default_rng(1)
    ms, y = played(chosen.plant, 2 * chosen.records, chosen.f_max, rng)
    for n_poles in chosen.poles:
        print(
            f"{chosen.plant}, {ms.f.size} lines, {chosen.records} pairs, nominal"
            f" {n_poles or 'the FRF'}"
        )
        changes = {name: CHANGES[name] for name in (["nothing"] if chosen.nulls else CHANGES)}
        found = judged(ms, y, chosen.records, n_poles, chosen.snr, rng, changes)
        for name, seen in found.items():
            p = np.array([one.p_value for one in seen])
            share = " ".join(f"{np.mean(p < level):.3f}" for level in (0.01, 0.05, 0.1, 0.5))
            text = f"  {name:<32} p < 0.01, 0.05, 0.1, 0.5: {share}"
            if name == "nothing":
                outside, wanted = np.mean([one.n_outside for one in seen]), seen[0].n_expected
                text += (
                    f"; KS {kstest(p, 'uniform').statistic:.3f} ({1.358 / np.sqrt(p.size):.3f} at 5"
                    " %); lines outside "
                )
                text += f"{outside:.2f}, expected {wanted:.2f}"
                if seen[0].change is not None:
                    p, level = (
                        np.array([getattr(one.change, part) for one in seen])
                        for part in ("p_level", "level")
                    )
                    text += (
                        f"; level {np.median(level):.3f}, log power sd"
                        f" {np.std(2 * np.log(level)):.3f}, its p < "
                    )
                    text += " ".join(
                        f"{at:g}: {np.mean(p < at):.3f}" for at in (0.01, 0.05, 0.1, 0.5)
                    )
            else:
                best, chi = allowed(ms, y, CHANGES[name])
                text += f"; theory {best:.2f}, {chi:.2f}"
            print(text, flush=True)


if __name__ == "__main__":
    main()
