"""Faults of raw records, injected one by one: what is said of each, and what is left of it after
the cure.

    python -m benchmarks.faults

prints the table of `docs/guide/faults.md`. A resonance with a cubic spring, eight periods of 2000
samples of a special-odd multisine, noise of 1e-3; the error is the median of |G - G_sound| /
|G_sound| over the lines, G_sound from the same record without the fault; in brackets the share of
the lines that its 95 % bound holds.
"""

from __future__ import annotations

import warnings
from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np

import nlfrf
from nlfrf.records.screening.input import interpolate_bandlimited

N, P, FS = 2000, 8, 1000.0
ROUNDING = 1e-14  # of an error that is none


class Fault(NamedTuple):
    """A fault: what it is, what it does to the arguments, the words that are said, and the
    arguments that cure it.
    """

    on: str
    name: str
    inject: Callable[..., dict[str, Any]]
    said: str
    cure: dict[str, Any] | None = None
    refused: bool = True


def sound(
    seed: int = 0, n_periods: int = P, kind: str = "special-odd"
) -> tuple[nlfrf.Multisine, np.ndarray, np.ndarray]:
    """Design, input and output of a sound experiment, two periods longer than it is used."""
    ms = nlfrf.multisine(kind, fs=FS, n_samples=N, f_min=0.5, f_max=200, rng=seed)
    return ms, *through_plant(ms.u[0], n_periods)


def through_plant(u: np.ndarray, n_periods: int = P) -> tuple[np.ndarray, np.ndarray]:
    """Periods of the input, and of the output of the plant."""
    k = np.arange(N // 2 + 1)
    s, w = 2j * np.pi * k * FS / N, 2 * np.pi * 60
    y = np.fft.irfft(np.fft.rfft(u) / (1 + 0.04 * s / w + (s / w) ** 2))
    y = y + 0.02 * y**3
    return np.tile(u, n_periods + 2), np.tile(y, n_periods + 2)


def cut(u: np.ndarray, y: np.ndarray, seed: int = 0, **more: Any) -> dict[str, Any]:
    """The arguments of `record_from_samples`: eight periods, with noise on the output."""
    return {"u": u[: P * N], "y": noisy(y, seed)[: P * N], "fs": FS, "n_samples": N, **more}


def noisy(y: np.ndarray, seed: int = 0) -> np.ndarray:
    """The output as its sensor sees it."""
    return y + 1e-3 * np.std(y) * np.random.default_rng([seed, 1]).standard_normal(y.size)


def warp(x: np.ndarray, turns: np.ndarray) -> np.ndarray:
    """The periodic signal x read at other times [samples]."""
    return interpolate_bandlimited(x, turns)


def both(change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., dict[str, Any]]:
    """A fault that both signals have."""
    return lambda ms, u, y: cut(change(u), change(y))


def on_y(change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., dict[str, Any]]:
    """A fault that the output alone has."""
    return lambda ms, u, y: cut(u, y) | {"y": change(noisy(y))[: P * N]}


def on_u(change: Callable[[np.ndarray], np.ndarray]) -> Callable[..., dict[str, Any]]:
    """A fault that the recorded input alone has."""
    return lambda ms, u, y: cut(change(u), y)


def lost(*at: int) -> Callable[[np.ndarray], np.ndarray]:
    """Samples that are not there."""
    return lambda x: np.delete(x, list(at))


def repeated(at: int, n: int) -> Callable[[np.ndarray], np.ndarray]:
    """A sample that is there n times more."""
    return lambda x: np.insert(x, at, np.full(n, x[at]))


def clock(ppm: float) -> Callable[[np.ndarray], np.ndarray]:
    """Another clock."""
    return lambda x: warp(x, np.arange((P + 1) * N) * (1 + 1e-6 * ppm))


def drifting(x: np.ndarray) -> np.ndarray:
    """A clock that drifts by half a sample over the record."""
    t = np.arange((P + 1) * N)
    return warp(x, t + 0.5 * (t / (P * N)) ** 2)


def spoilt(first: int, last: int, value: float) -> Callable[[np.ndarray], np.ndarray]:
    """A stretch of samples with another value."""

    def change(x: np.ndarray) -> np.ndarray:
        x = x.copy()
        x[first:last] = value
        return x

    return change


def hit(x: np.ndarray) -> np.ndarray:
    """A blow against the machine in the fifth period."""
    x = x.copy()
    t = np.arange(N) / FS
    x[4 * N + 300 : 5 * N + 300] += 4 * np.std(x) * np.exp(-8 * t) * np.cos(2 * np.pi * 37 * t)
    return x


def growing(share: float) -> Callable[[np.ndarray], np.ndarray]:
    """A gain that drifts by a share over the record."""
    return lambda x: x * (1 + share * np.arange(x.size) / (P * N))


def from_the_middle(factor: float) -> Callable[[np.ndarray], np.ndarray]:
    """A gain that is another one from the middle of the record on."""
    return lambda x: x * np.where(np.arange(x.size) < P * N // 2, 1.0, factor)


def humming(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """A tone of a fifth of the rms on an excited line: it keeps step with the periods."""
    k = ms.lines.excited[40]
    tone = 0.2 * 2**0.5 * np.std(y) * np.sin(2 * np.pi * k * np.arange(y.size) / N)
    return cut(u, y) | {"y": noisy(y + tone)[: P * N]}


def wandering(share: float) -> Callable[[np.ndarray], np.ndarray]:
    """An operating point that wanders by a share of the rms over the record."""
    return lambda x: x + share * np.std(x) * np.arange(x.size) / (P * N)


def saturated(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """An actuator that saturates, measured behind it."""
    return cut(*through_plant(np.clip(ms.u[0], -1.3, 1.3)), n_samples=N)


def masked(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """Samples that were masked as bad."""
    arguments = cut(u, y)
    return arguments | {"u": np.ma.masked_greater(arguments["u"], 2.5)}


def other_design(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """A design that was not played."""
    return cut(u, y, design=sound(99)[0])


def realisations(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """Three realisations, the last one played at twice the level."""
    runs = [
        cut(*(scale * x for x in sound(seed)[1:])) for seed, scale in ((0, 1.0), (1, 1.0), (2, 2.0))
    ]
    return runs[0] | {name: [run[name] for run in runs] for name in "uy"}


def mixed_up(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """Three realisations, the outputs in another order than the inputs."""
    runs = [cut(*sound(seed)[1:]) for seed in range(3)]
    return runs[0] | {"u": [run["u"] for run in runs], "y": [runs[m]["y"] for m in (1, 2, 0)]}


def rewired(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """Three realisations, the sensor turned round before the last one."""
    runs = [cut(*sound(seed)[1:]) for seed in range(3)]
    return runs[0] | {
        "u": [run["u"] for run in runs],
        "y": [runs[0]["y"], runs[1]["y"], -runs[2]["y"]],
    }


def played_again(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """The same file played three times."""
    runs = [cut(u, y, seed) for seed in range(3)]
    return runs[0] | {name: [run[name] for run in runs] for name in "uy"}


def of_another_run(ms: nlfrf.Multisine, u: np.ndarray, y: np.ndarray) -> dict[str, Any]:
    """The input of this run with the output of one of other phases: two files were mixed up."""
    return cut(u, sound(seed=1)[2])


def in_both_and_y(x: np.ndarray) -> np.ndarray:
    """Two samples lost from both."""
    return np.delete(x, [5100, 5101])


RESAMPLE: dict[str, Any] = {"resample": True}
NAN = float("nan")
FAULTS = [
    Fault(
        "u",
        "period given one sample short",
        lambda ms, u, y: cut(u, y) | {"n_samples": N - 1},
        r"the input repeats every 2000 samples; give n_samples=2000",
        {"n_samples": N},
    ),
    Fault(
        "u",
        "period far off",
        lambda ms, u, y: cut(u, y) | {"n_samples": 1400},
        r"its autocorrelation points to 2000",
        {"n_samples": N},
    ),
    Fault(
        "u",
        "noise played instead of a multisine",
        lambda ms, u, y: cut(np.random.default_rng(0).standard_normal(u.size), y),
        r"does not seem to repeat at all",
    ),
    Fault(
        "u", "constant: the wrong channel", on_u(np.ones_like), r"u must vary, got the constant 1"
    ),
    Fault(
        "u",
        "one nan",
        on_u(spoilt(500, 501, NAN)),
        r"u must be finite, got 1 nan or infinite numbers, the first at 500",
    ),
    Fault("u", "masked samples", masked, r"u must have no masked numbers, got \d+"),
    Fault(
        "u",
        "range of the recorder too small: clipped at 1.5 times the rms",
        on_u(lambda u: np.clip(u, -1.5, 1.5)),
        r"u seems clipped: \d+ % of its samples",
        refused=False,
    ),
    Fault(
        "u",
        "actuator saturates at 1.3 times the rms",
        saturated,
        r"u seems clipped: \d+ % of its samples",
        {"design": True},
        refused=False,
    ),
    Fault(
        "u",
        "another grid given by hand",
        lambda ms, u, y: cut(u, y, lines=nlfrf.signals.LineGrid(excited=np.arange(5, 400, 8))),
        r"lines must be excited by the input, got line 5 .* in the record 100 lines are: 1, 3, 9",
        {"lines": None},
    ),
    Fault(
        "u",
        "another design given",
        other_design,
        r"design must be the one that was played, got a correlation of 0\.\d+",
        {"design": True},
    ),
    Fault(
        "u",
        "channel dead for a period",
        on_u(spoilt(6 * N, 7 * N, 0.0)),
        r"the input does not repeat in period 7 of 8",
        RESAMPLE,
    ),
    Fault(
        "both",
        "generator starts 1.5 periods late",
        both(lambda x: np.concatenate([np.zeros(3 * N // 2), x])),
        r"u is silent for 3000 samples \(1\.5 periods\) before the excitation: they are left out",
        {},
        refused=False,
    ),
    Fault(
        "both",
        "period of 2000.37 samples",
        both(lambda x: warp(x, np.arange((P + 1) * N) / 1.000185)),
        r"repeats every 2000\.3\d+ samples, not a whole number",
        RESAMPLE,
    ),
    Fault(
        "both",
        "clock of the generator drifts by half a sample",
        both(drifting),
        r"the clock drifts: the periods begin up to 0\.\d+ samples",
        RESAMPLE,
    ),
    Fault(
        "both",
        "seven samples lost",
        both(lost(*range(4300, 4307))),
        r"7 lost before period 4",
        RESAMPLE,
    ),
    Fault("both", "one sample lost", both(lost(6100)), r"1 lost before period 5", RESAMPLE),
    Fault(
        "both",
        "four samples repeated",
        both(repeated(4300, 4)),
        r"4 repeated before period 4",
        RESAMPLE,
    ),
    Fault(
        "both",
        "one realisation of three at twice the amplitude",
        realisations,
        r"same amplitude spectrum in every realisation, got realisation 2 up to 6\.0 dB",
    ),
    Fault(
        "both",
        "y of another run",
        of_another_run,
        r"y does not follow u in realisation 0",
        refused=False,
    ),
    Fault(
        "both",
        "the files of y in another order than those of u",
        mixed_up,
        r"that of realisation 0 follows u of realisation 1, .* are the files of both in the same"
        r" order",
    ),
    Fault(
        "y",
        "sensor reversed before the last realisation of three",
        rewired,
        r"y must have the same sign in all realisations, got: it changes in realisation 2",
    ),
    Fault(
        "both",
        "one file played three times",
        played_again,
        r"realisations with the same phases",
        refused=False,
    ),
    Fault(
        "y",
        "one sample lost",
        on_y(lost(4600)),
        r"samples of y were lost or repeated, but not of u \(1 lost before period 4\)",
        RESAMPLE,
    ),
    Fault(
        "y",
        "three samples lost, one by one",
        on_y(lost(2600, 6600, 10600)),
        r"1 lost before period 3, 1 lost before period 5, 1 lost before period 7",
        RESAMPLE,
    ),
    Fault(
        "y",
        "one sample lost, and one repeated later in its period",
        on_y(lambda y: np.delete(np.insert(y, 7300, y[7300]), 6400)),
        r"y does not repeat in period 4 of 8",
        RESAMPLE,
    ),
    Fault(
        "y",
        "two samples repeated",
        on_y(repeated(8700, 2)),
        r"2 repeated before period 6",
        RESAMPLE,
    ),
    Fault(
        "y",
        "clock off by 20 ppm",
        on_y(clock(20)),
        r"the clock of y differs from that of u by -20 ppm \(-0\.04 samples a period\)",
        RESAMPLE,
    ),
    Fault(
        "y",
        "clock off by -50 ppm",
        on_y(clock(-50)),
        r"the clock of y differs from that of u by 50 ppm",
        RESAMPLE,
    ),
    Fault(
        "y",
        "clock off by 2 ppm",
        on_y(clock(2)),
        r"the clock of y differs from that of u by -2 ppm .* out of place",
        RESAMPLE,
        refused=False,
    ),
    Fault(
        "y",
        "gain drifts by 10 %",
        on_y(growing(0.1)),
        r"the gain from u to y drifts by \+8(\.\d)? % over the record",
        None,
        refused=False,
    ),
    Fault(
        "y",
        "gain drifts by -3 %",
        on_y(growing(-0.03)),
        r"the gain from u to y drifts by -2\.\d % over the record",
        None,
        refused=False,
    ),
    Fault(
        "y",
        "gain steps by 10 % after half of the record",
        on_y(from_the_middle(1.1)),
        r"the gain from u to y steps by \+10 % before period 5",
        None,
        refused=False,
    ),
    Fault(
        "y",
        "sign changes after half of the record",
        on_y(from_the_middle(-1.0)),
        r"y must stay in step .* y changes its sign before period 5",
        None,
    ),
    Fault(
        "y",
        "sampled at half the rate and held",
        lambda ms, u, y: cut(u, y) | {"y": np.repeat(noisy(y)[: P * N : 2], 2)},
        r"y changes at every 2nd sample only: it was sampled at 500 Hz and held",
        None,
        refused=False,
    ),
    Fault(
        "both",
        "u and y swapped",
        lambda ms, u, y: cut(noisy(y), u) | {"y": u[: P * N]},
        r"y repeats exactly and u does not: are they swapped\?",
        None,
        refused=False,
    ),
    Fault(
        "y",
        "operating point drifts by 30 % of the rms",
        on_y(wandering(0.3)),
        r"the operating point of y drifts by 26 % of its rms",
        None,
        refused=False,
    ),
    Fault(
        "y",
        "a tone of 20 % of the rms that repeats in every period, as mains hum may",
        humming,
        r"G differs from its neighbours at \d+\.5 Hz",
        refused=False,
    ),
    Fault("y", "a shock in one period", on_y(hit), r"y does not repeat in period 5", RESAMPLE),
    Fault(
        "y",
        "channel dead for half a period",
        on_y(spoilt(6 * N, 6 * N + N // 2, 0.0)),
        r"y does not repeat in period 7 of 8.*y is constant for 1000",
        RESAMPLE,
    ),
    Fault(
        "y",
        "clipped at 1.7 times the rms",
        on_y(lambda y: np.clip(y, -1.7 * np.std(y), 1.7 * np.std(y))),
        r"y seems clipped: \d",
        refused=False,
    ),
    Fault(
        "y",
        "constant: the wrong channel",
        lambda ms, u, y: cut(u, y) | {"y": np.zeros(P * N)},
        r"y must vary, got the constant 0",
    ),
    Fault("y", "one inf", on_y(spoilt(77, 78, np.inf)), r"y must be finite"),
    Fault(
        "y",
        "shorter than u",
        lambda ms, u, y: cut(u, y) | {"y": y[: P * N - 5]},
        r"y must be as long as u, 16000 samples, got 15995",
    ),
    Fault(
        "both",
        "two samples lost from both, one more from y",
        lambda ms, u, y: cut(in_both_and_y(u), np.delete(in_both_and_y(y), 10700)),
        r"2 lost before period 4",
        RESAMPLE,
    ),
    Fault(
        "both",
        "clock of the generator drifts, and that of y is 20 ppm off",
        lambda ms, u, y: cut(
            drifting(u), warp(drifting(np.append(y, y[:N])), np.arange(P * N) * (1 + 20e-6))
        ),
        r"the clock drifts",
        RESAMPLE,
    ),
]


class Outcome(NamedTuple):
    """What was said, whether the record was refused, and what is left: median error, share held;
    nan without a cure.
    """

    said: str
    refused: bool
    error: float
    held: float
    error_untreated: float


def attempt(arguments: dict[str, Any]) -> tuple[nlfrf.Bla | None, str]:
    """Identify, and say what was said."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        try:
            bla = nlfrf.identify(nlfrf.record_from_samples(**arguments))
        except ValueError as error:
            return None, "; ".join([str(error), *(str(w.message) for w in caught)])
    return bla, "; ".join(str(w.message) for w in caught)


def outcome(fault: Fault) -> Outcome:
    """One fault, injected and cured."""
    ms, u, y = sound()
    arguments = fault.inject(ms, u, y)
    truth, _ = attempt(cut(u, y))
    if fault.name.startswith("actuator"):  # another input: its own truth
        truth, _ = attempt(arguments | {"lines": ms.lines})
    assert truth is not None
    bla, said = attempt(arguments)
    untreated = error_of(bla, truth)[0] if bla is not None else NAN
    if fault.cure is None:
        return Outcome(said, bla is None, NAN, NAN, untreated)
    cure = fault.cure | ({"design": ms} if "design" in fault.cure else {})
    cured, _ = attempt(arguments | cure)
    error, held = error_of(cured, truth)
    return Outcome(said, bla is None, error, held, untreated)


def error_of(bla: nlfrf.Bla | None, truth: nlfrf.Bla) -> tuple[float, float]:
    """Median relative error over the lines, and the share of them that the bound holds."""
    if bla is None or bla.f.size != truth.f.size:
        return NAN, NAN
    off = np.abs(bla.G - truth.G)
    return float(np.median(off / np.abs(truth.G))), float(np.mean(off < bla.bound()))


def main() -> None:
    """Print the table."""
    print("| on | fault | what is said | cure | error after it |")
    print("|---|---|---|---|---|")
    for fault in FAULTS:
        found = outcome(fault)
        words = ", ".join(f"`{name}`" for name in fault.cure or {}) or (
            "none: measure again" if fault.cure is None else "not needed"
        )
        left = (
            ""
            if np.isnan(found.error)
            else f"{100 * max(found.error - ROUNDING, 0):.2g} % ({100 * found.held:.0f} %)"
        )
        how = "refused" if found.refused else "warned"
        print(
            f"| {fault.on} | {fault.name} | {how}: {found.said[:230].replace('|', ' ')} | {words} |"
            f" {left} |"
        )


if __name__ == "__main__":
    main()
