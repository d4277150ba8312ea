"""Speed of `identify` against a bare rfft of the same record, and against peers that are installed,
in one run.
"""

from __future__ import annotations

import resource
from dataclasses import replace

import numpy as np

import nlfrf
from benchmarks.timing import best, in_turn

#: Wanted, as a share of the time of the peer.
WANTED = {
    "fast": 0.6,
    "fast, roughness": 0.6,
    "fast, first record of its grid": 0.6,
    "robust, M = 7": 0.2,
}
PEER = "best-linear-approximation"


def record_of(n_samples, n_periods, n_realizations, n_lines):
    """A static cubic with noise on its output, on a special-odd grid of about n_lines lines."""
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(
        fs=n_samples,
        n_samples=n_samples,
        f_min=1,
        f_max=4 * n_lines,
        n_realizations=n_realizations,
        rng=rng,
    )
    u = np.repeat(ms.u[:, None], n_periods, axis=1)
    y = u + 0.1 * u**3 + 0.01 * rng.standard_normal(u.shape)
    return nlfrf.Record(u=u, y=y, fs=n_samples, lines=ms.lines)


def peer(record):
    """The package best-linear-approximation on the same record, where it is installed (Python 3.12
    or later).
    """
    try:
        from best_linear_approximation import robust
    except ImportError:
        return None
    u, y = (np.moveaxis(x, 2, 0)[:, None] for x in (record.u, record.y))  # samples, channels, M, P
    bins = record.lines.excited
    return lambda: robust.noisy_input(u, y, fs=record.fs, excited_bins=bins, show_warnings=False)


def of_its_own(record):
    """The same record on a grid that nobody has seen."""
    return replace(record, lines=nlfrf.signals.LineGrid(excited=record.lines.excited))


def several_channels():
    """A matrix of six by six with covariance against a bare rfft of its record; wanted at
    most 2.5.
    """
    print("6 inputs, 6 outputs, with covariance")
    for n_samples, n_lines, n_periods in ((16384, 500, 2), (65536, 500, 4), (65536, 5000, 4)):
        rng = np.random.default_rng(0)
        ms = nlfrf.multisine(
            fs=n_samples, n_samples=n_samples, f_min=1, f_max=4 * n_lines, n_inputs=6, rng=rng
        )
        u = np.repeat(ms.u[:, :, None], n_periods, axis=2)
        y = np.tensordot(rng.standard_normal((6, 6)), u + 0.05 * u**3, axes=(1, 0))
        record = nlfrf.Record(
            u=u, y=y + 0.01 * rng.standard_normal(y.shape), fs=n_samples, lines=ms.lines
        )
        times = in_turn(
            {
                "ours": lambda record=record: nlfrf.identify(record),
                "bare": lambda r=record: bare_rfft(r),
            },
            5,
        )
        print(
            f"  N = {n_samples}, P = {n_periods}, F = {n_lines}: {1e3 * times['ours']:.0f} ms, "
            f"{times['ours'] / times['bare']:.1f} times a bare rfft"
        )


def bare_rfft(record):
    """What cannot be saved: the spectra of all periods."""
    return np.fft.rfft(record.u), np.fft.rfft(record.y)


def main():
    """Print the table."""
    small, several = record_of(4096, 2, 1, 100), record_of(4096, 2, 7, 100)
    cases = {
        "fast": (small, {}),
        "fast, roughness": (small, {"level_from": "roughness"}),
        "fast, first record of its grid": (small, {}),
        "fast, local transient": (small, {"transient": "local"}),
        "robust, M = 7": (several, {}),
    }
    functions = {
        name: lambda record=record, options=options, first="first" in name: nlfrf.identify(
            of_its_own(record) if first else record, **options
        )
        for name, (record, options) in cases.items()
    }
    peers = {name: peer(record) for name, record in (("M = 1", small), ("M = 7", several))}
    bare = {"M = 1": lambda: bare_rfft(small), "M = 7": lambda: bare_rfft(several)}
    times = in_turn(
        functions
        | {f"bare {name}": run for name, run in bare.items()}
        | {f"peer {name}": run for name, run in peers.items() if run is not None},
        100,
    )
    print(f"N = 4096, P = 2, F = 100, in turn; {PEER} gives FRF and variances, no levels")
    print("what depends on the grid alone is remembered, but for the first record of each")
    for name, (record, _) in cases.items():
        size = "M = 7" if record is several else "M = 1"
        said = (
            f"  {name:<30} {1e3 * times[name]:6.2f} ms, {times[name] / times[f'bare {size}']:5.1f}"
            " times a bare rfft"
        )
        if f"peer {size}" in times:
            said += f", {times[name] / times[f'peer {size}']:.2f} times {PEER}"
            said += f" (wanted {WANTED[name]:g})" if name in WANTED else ""
        print(said)
    if peers["M = 7"] is None:
        print(f"  {PEER} is not installed here (it needs Python 3.12)")
    else:
        bla, G = nlfrf.identify(several, transient="none"), peers["M = 7"]().G
        pairs = ((bla.G, G.value), (bla.var_noise, G.noise.var), (bla.var_total, G.total.var))
        apart = max(np.max(np.abs(np.squeeze(b) / a - 1)) for a, b in pairs)
        print(f"  its G and both variances agree with ours to {apart:.0e}")
    large = record_of(65536, 4, 10, 5000)
    ours = best(lambda: nlfrf.identify(large), 7)
    bare = best(lambda: bare_rfft(large), 7)
    print("N = 65536, P = 4, M = 10, F = 5000")
    print(
        f"  {1e3 * ours:.0f} ms, {ours / bare:.2f} times the bare rfft of {1e3 * bare:.0f} ms"
        " (target 2.5)"
    )
    print("2^22 samples in one record")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    long = record_of(1 << 21, 2, 1, 1000)
    size = (long.u.nbytes + long.y.nbytes) / 1024
    made = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    elapsed = best(lambda: nlfrf.identify(long), 1)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"  {elapsed:.2f} s; peak memory {(after - before) / size:.1f} times the record's"
        f" {size / 1024:.0f} MB, {(made - before) / size:.1f} of them to make it (target 6)"
    )
    several_channels()


if __name__ == "__main__":
    main()
