"""Random records through the screening: sound ones, and ones with lost samples, silence, wraps,
outliers or hits.

    python -m benchmarks.bench_screening [--records 400] [--seed 0]

The plants have one or two modes anywhere in the band and a damping of 0.01 to 0.5, half of them a
cubic spring and drag. They start from rest and run for two to eight periods with noise of 0 to 5 %
of y. Each row counts what was found; "silent" are wrong answers without a warning, neither from the
record nor from `identify`.
"""

from __future__ import annotations

import argparse
import re
import warnings
from collections import Counter
from typing import NamedTuple

import numpy as np

import nlfrf

# sampling frequency [Hz], samples of a period, periods, and those before them
FS = 1024.0
N = 1024
LONGEST = 8
WARM = 8
STEPS = 2  # of the integration in each sample
BATCH = 500
EVERY = 4  # records of which one has the faults that take long
HELD = 0.8  # share of the lines that the bound of a right answer holds at least
SCREENED = r"outlier|wraps at|hits of a hammer|to be unwrapped"
TURNS = (
    (360, -180),
    (360, 0),
    (2 * np.pi, 0),
    (2 * np.pi, -np.pi),
    (1, 0),
    (256, 0),
    (256, -128),
    (4096, 0),
    (65536, 0),
)


class Run(NamedTuple):
    """One record: excited lines, input, output from rest, number of periods, generator, and the FRF
    on these lines.
    """

    lines: np.ndarray
    u: np.ndarray
    y: np.ndarray
    n_periods: int
    rng: np.random.Generator
    G: np.ndarray

    def cut(self, first=0, more=0):
        """Input and output of that many periods, and so many more, from one on."""
        some = slice(first * N, (first + self.n_periods + more) * N)
        return self.u[some], self.y[some]


def runs(n, seed=0):
    """n random records, a batch of them simulated at once."""
    for first in range(0, n, BATCH):
        yield from one_batch(min(BATCH, n - first), np.random.default_rng([seed, first]))


def designs(n, rng):
    """n multisines of some grid and band."""
    kinds = ("special-odd", "special-odd", "odd", "full")
    return [
        nlfrf.multisine(
            kinds[rng.integers(4)],
            fs=FS,
            n_samples=N,
            f_min=1,
            f_max=rng.uniform(60, 400),
            rng=int(rng.integers(1 << 30)),
        )
        for _ in range(n)
    ]


def one_batch(n, rng):
    """Records of n plants x'' = w^2 (u - x - c x^3) - 2 zeta w x' - q |x'| x', two modes each, by
    Runge and Kutta.
    """
    played = designs(n, rng)
    u = np.stack([ms.u[0] for ms in played])
    w = 2 * np.pi * 10 ** rng.uniform(np.log10(1.5), np.log10(200), (2, n))
    zeta = 10 ** rng.uniform(-2, np.log10(0.5), (2, n))
    ratio = 2 * np.pi * np.fft.rfftfreq(N, 1 / FS) / w[..., None]
    H = 1 / (1 - ratio**2 + 2j * zeta[..., None] * ratio)
    size = np.std(np.fft.irfft(np.fft.rfft(u) * H, N), axis=-1)
    second = rng.choice([0.0, 1.0, -1.0], n) * 10 ** rng.uniform(-1.5, 0.5, n)
    mix = np.stack([np.ones(n), second]) / size
    nonlinear = rng.random(n) < 0.5
    c = nonlinear * 10 ** rng.uniform(-3, -1.3, (2, n)) / size**2
    q = nonlinear * 10 ** rng.uniform(-3, -1, (2, n)) * 0.3 / size
    fine = np.ascontiguousarray(np.fft.irfft(np.fft.rfft(u), 2 * STEPS * N).T) * 2 * STEPS
    h = 1 / (STEPS * FS)
    x, v, y = np.zeros((2, n)), np.zeros((2, n)), np.empty(((WARM + LONGEST) * N, n))

    def acceleration(x, v, force):
        return w * w * (force - x - c * x**3) - (2 * zeta * w + q * np.abs(v)) * v

    for k in range(y.shape[0] * STEPS):
        if k % STEPS == 0:
            y[k // STEPS] = (mix * x).sum(axis=0)
        force = [fine[(2 * k + i) % len(fine)] for i in range(3)]
        a1 = acceleration(x, v, force[0])
        a2 = acceleration(x + h / 2 * v, v + h / 2 * a1, force[1])
        a3 = acceleration(x + h / 2 * (v + h / 2 * a1), v + h / 2 * a2, force[1])
        a4 = acceleration(x + h * (v + h / 2 * a2), v + h * a3, force[2])
        x, v = x + h * v + h * h / 6 * (a1 + a2 + a3), v + h / 6 * (a1 + 2 * a2 + 2 * a3 + a4)
    changes = np.sum(np.diff(y.reshape(WARM + LONGEST, N, n), axis=0) ** 2, axis=1)
    settles = changes[-3:].max(axis=0) < np.maximum(
        changes[1], 1e-6 * np.sum(y[-N:] ** 2, axis=0)
    )  # no subharmonics
    for i, ms in enumerate(played):
        if not settles[i]:
            continue
        own = np.random.default_rng(rng.integers(1 << 30))
        noise = own.choice([0.0, 10 ** own.uniform(-4, -1.3), 10 ** own.uniform(-2, -1.3)])
        settled, lines = y[-N:, i], ms.lines.excited
        noisy = y[:, i] + noise * np.std(settled) * own.standard_normal(len(y))
        G = np.fft.rfft(settled)[lines] / np.fft.rfft(u[i])[lines]
        yield Run(
            lines, np.tile(u[i], WARM + LONGEST), noisy, int(own.integers(2, LONGEST + 1)), own, G
        )


def stick_slip(n, rng):
    """Velocity and position of n machines that stick and slip, four periods from rest."""
    u = np.stack([ms.u[0] for ms in designs(n, rng)], axis=1)
    w, zeta = 2 * np.pi * 10 ** rng.uniform(0.5, 2, n), 10 ** rng.uniform(-2, -0.3, n)
    slip = rng.uniform(0.2, 1.5, n) * w * w / FS
    x, v, out = np.zeros(n), np.zeros(n), np.empty((2, 4 * N, n))
    for k in range(4 * N):
        v = v + (w * w * (u[k % N] - x) - 2 * zeta * w * v) / FS
        v = np.sign(v) * np.maximum(np.abs(v) - slip, 0)
        x = x + v / FS
        out[:, k] = v, x
    for one, velocity, position in zip(u.T, *out.transpose(0, 2, 1), strict=True):
        for y in (velocity, position):
            if np.ptp(y) > 0:
                yield np.tile(one, 4), y + 1e-4 * np.std(y) * rng.standard_normal(y.size)


def screen(u, y, **options):
    """What was said of a record: the refusal or the warnings, whether it was refused, and the
    record.
    """
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        refusal, record = [], None
        try:
            record = nlfrf.record_from_samples(u, y, fs=FS, n_samples=N, **options)
        except ValueError as error:
            refusal = [str(error)]
    return " | ".join([*(str(one.message) for one in found), *refusal]), record


def judge(u, y, run, factor=1.0, wanted="", **options):
    """Return "refused", "warned" (as `wanted`), "right", "warned later" or "silent"."""
    said, record = screen(u, y, **options)
    if record is None:
        return "refused"
    if wanted and re.search(wanted, said):
        return "warned"
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        bla = nlfrf.identify(record)
    if bla.G.size == run.G.size and np.mean(np.abs(bla.G - factor * run.G) < bla.bound()) >= HELD:
        return "right"
    return "warned later" if said or found else "silent"


def sound_kinds(u, y, rng):
    """Two outputs that are sound and look as if they were not: number of the kind, input and
    output.
    """
    turn, start = TURNS[rng.integers(len(TURNS))]
    y = (y - np.median(y)) / np.std(y)
    level = rng.uniform(0.1, 1)
    relay = np.sign(y) * 0.98 + 0.004 * rng.standard_normal(y.size)
    pulses = np.zeros(u.size)
    pulses[rng.integers(N) :: N] = 1.0  # as of a multisine whose phases are zero
    kinds = (
        (u, y),
        (u, np.clip(y, -level, level)),
        (u, np.clip(relay, -1, 1)),
        (pulses, pulses + 0.02 * y),
        (u, y**3),  # high crest
        (u, np.round(rng.integers(4, 64) * y / np.ptp(y))),  # few levels
    )
    for i in rng.choice(len(kinds), 2, replace=False):
        u, y = kinds[i]
        if rng.integers(2):  # as wide as a turn
            whole = turn - 1 if turn >= 256 else turn
            y = start + whole * (y - y.min()) / np.ptp(y)
            y = np.round(y) if turn >= 256 else y
        yield i, u, y


def lost(run, where, settled, rng):
    """Input and output of a run with 1 to 100 samples lost from one or both, anywhere."""
    u, y = run.cut(WARM - 1 if settled else 0, more=1)
    n, at = round(10 ** rng.uniform(0, 2)), int(rng.integers(run.n_periods * N))
    u, y = (
        np.delete(x, np.s_[at : at + n]) if where in (name, "both") else x
        for x, name in ((u, "u"), (y, "y"))
    )
    return u[: run.n_periods * N], y[: run.n_periods * N]


def silent(run, rng):
    """Input and output of a run with silence before and often behind, and noise on both."""
    u, y = run.cut()
    before = int(rng.uniform(0.25, 3.3) * N)
    behind = int(rng.choice([0.0, rng.uniform(0.2, 1.5)]) * N)
    noise = 10 ** rng.uniform(-5, -2.5) * rng.integers(2)
    pad = [np.concatenate([np.zeros(before), x, np.zeros(behind)]) for x in (u, y)]
    return [x + noise * np.std(x) * rng.standard_normal(x.size) for x in pad]


def wrapped(run, rng):
    """Input, output that wraps, its factor, and its largest step in turns; the amplitude is 0.05 to
    2 turns.
    """
    u, y = run.cut(WARM - 1)
    turn, start = TURNS[rng.integers(len(TURNS))]
    factor = turn * 10 ** rng.uniform(-1.3, 0.3) / np.std(y)
    y = factor * y + turn * rng.uniform(0, 1)
    y = np.round(y) if turn >= 256 else y
    return u, (y - start) % turn + start, factor, np.abs(np.diff(y)).max() / turn


def spiked(y, rng):
    """An output with a spike, or a few marks of no value."""
    y = y.copy()
    if rng.integers(2):
        y[rng.integers(y.size)] = (
            rng.choice([-1, 1]) * 10 ** rng.uniform(0.5, 4) * np.abs(y - np.median(y)).max()
        )
    else:
        y[rng.integers(y.size, size=rng.integers(1, 30))] = rng.choice(
            [999.0, -9999.0, 1e10]
        ) * np.std(y)
    return y


def hit(rng):
    """A force of three to ten hits by hand, eight periods long, and the time of the first one."""
    force = 1e-3 * rng.standard_normal(8 * N)
    for at in np.cumsum(rng.uniform(0.5, 1.2, rng.integers(3, 7)) * N).astype(int):
        force[at : at + 6] += rng.uniform(0.6, 1.4) * np.hanning(6)
    return force


def tally(title, found):
    """Print a row of counts."""
    print(
        f"{title:<50}" + ", ".join(f"{n} {word}" for word, n in sorted(found.items())), flush=True
    )


def main(arguments=None) -> dict[str, Counter]:
    """Print the table and return its rows."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=400)
    parser.add_argument("--seed", type=int, default=0)
    options = parser.parse_args(arguments)
    rows: dict[str, Counter] = {}

    def count(title, word):
        rows.setdefault(title, Counter())[word] += 1

    for k, run in enumerate(runs(options.records, options.seed)):
        rng, (u, y) = run.rng, run.cut()
        said, record = screen(u, y)
        count("sound, from rest", "refused" if record is None else "warned" if said else "passed")
        cured, again = screen(u, y, resample=True)
        same = again is not None and record is not None and np.array_equal(again.y, record.y)
        worse = not same and judge(u, y, run) == "right" != judge(u, y, run, resample=True)
        count("sound, from rest, resample=True", "worse" if worse else "as good")
        if re.search(SCREENED, said + cured):
            count("sound, false alarms of wraps, outliers, hits", "from rest")
        for where, settled in (
            ("y", True),
            *((("both", True), ("u", True), ("y", False)) if k % EVERY == 0 else ()),
        ):
            title = f"samples lost from {where}, {'settled' if settled else 'from rest'}"
            count(
                title,
                judge(
                    *lost(run, where, settled, rng),
                    run,
                    wanted="lost or repeated|samples of y were lost",
                ),
            )
        for i, u, looks in sound_kinds(*run.cut(WARM - 1), rng):
            found = re.search(SCREENED, screen(u, looks)[0])
            count(
                "sound, false alarms of wraps, outliers, hits", f"of kind {i}" if found else "none"
            )
        if k % EVERY:
            continue
        u, y = silent(run, rng)
        said = screen(u, y)[0]
        count(
            "silence before and behind",
            judge(u, y, run) + (", one warning" if "silent" in said and "|" not in said else ""),
        )
        u, y, factor, step = wrapped(run, rng)
        kind = "over 0.45" if step > 0.45 else "up to 0.45"
        count(f"position that wraps, steps {kind} of a turn", judge(u, y, run, factor))
        u, y = run.cut(WARM - 1)
        count("outliers", "found" if "outlier" in screen(u, spiked(y, rng))[0] else "silent")
        force = hit(rng)
        found = "hits" in screen(force, np.convolve(force, y[:200])[: force.size])[0]
        count("hits of a hammer", "found" if found else "silent")
    for u, y in stick_slip(options.records // 2, np.random.default_rng([options.seed, 1])):
        found = re.search(SCREENED, screen(u, y)[0])
        count("sound, false alarms of wraps, outliers, hits", "of stick-slip" if found else "none")
    for title, found in rows.items():
        tally(title, found)
    return rows


if __name__ == "__main__":
    main()
