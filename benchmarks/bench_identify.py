"""Speed of `identify` against a bare rfft of the same record, and against peers that are installed, in one run."""

from __future__ import annotations

import resource

import numpy as np

import nlfrf
from benchmarks.timing import best, side_by_side

#: Wanted [ms], on a machine where the peer took PEER_THERE [ms]: relative to the peer they mean the same anywhere.
WANTED = {"fast": 3.0, "fast, roughness": 1.0, "fast, local transient": 20.0, "robust, M = 7": 1.5}
PEER_THERE = {"M = 1": 1.0, "M = 7": 4.1}
PEER = "best-linear-approximation"


def record_of(n_samples, n_periods, n_realizations, n_lines):
    """A static cubic with noise on its output, on a special-odd grid of about n_lines lines."""
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(
        fs=n_samples, n_samples=n_samples, f_min=1, f_max=4 * n_lines, n_realizations=n_realizations, rng=rng
    )
    u = np.repeat(ms.u[:, None], n_periods, axis=1)
    y = u + 0.1 * u**3 + 0.01 * rng.standard_normal(u.shape)
    return nlfrf.Record(u=u, y=y, fs=n_samples, lines=ms.lines)


def peer(record):
    """The package best-linear-approximation on the same record, where it is installed (Python 3.12 or later)."""
    try:
        from best_linear_approximation import robust
    except ImportError:
        return None
    u, y = (np.moveaxis(x, 2, 0)[:, None] for x in (record.u, record.y))  # samples, channels, M, P
    bins = record.lines.excited
    return lambda: robust.noisy_input(u, y, fs=record.fs, excited_bins=bins, show_warnings=False)


def bare_rfft(record):
    """What cannot be saved: the spectra of all periods."""
    return np.fft.rfft(record.u), np.fft.rfft(record.y)


def main():
    """Print the table."""
    small, several = record_of(4096, 2, 1, 100), record_of(4096, 2, 7, 100)
    cases = {
        "fast": (small, {}),
        "fast, roughness": (small, {"level_from": "roughness"}),
        "fast, local transient": (small, {"transient": "local"}),
        "robust, M = 7": (several, {}),
    }
    functions = {
        name: lambda record=record, options=options: nlfrf.identify(record, **options)
        for name, (record, options) in cases.items()
    }
    peers = {name: peer(record) for name, record in (("M = 1", small), ("M = 7", several))}
    bare = {"M = 1": lambda: bare_rfft(small), "M = 7": lambda: bare_rfft(several)}
    times = side_by_side(
        functions
        | {f"bare {name}": run for name, run in bare.items()}
        | {f"peer {name}": run for name, run in peers.items() if run is not None},
        300,
    )
    print(f"N = 4096, P = 2, F = 100; {PEER} gives FRF and variances, no levels")
    for name, (record, _) in cases.items():
        size = "M = 7" if record is several else "M = 1"
        said = f"  {name:<22} {1e3 * times[name]:6.2f} ms (wanted {WANTED[name]:g})"
        said += f", {times[name] / times[f'bare {size}']:5.1f} times a bare rfft"
        if f"peer {size}" in times:
            ratio, wanted = times[name] / times[f"peer {size}"], WANTED[name] / PEER_THERE[size]
            said += f", {ratio:.2f} times {PEER} (wanted {wanted:.2f})"
        print(said)
    if peers["M = 7"] is None:
        print(f"  {PEER} is not installed here (it needs Python 3.12)")
    else:
        for name in peers:
            print(f"  {PEER}, {name}: {1e3 * times[f'peer {name}']:.2f} ms ({PEER_THERE[name]} where targets were set)")
        bla, G = nlfrf.identify(several, transient="none"), peers["M = 7"]().G
        pairs = ((bla.G, G.value), (bla.var_noise, G.noise.var), (bla.var_total, G.total.var))
        apart = max(np.max(np.abs(np.squeeze(b) / a - 1)) for a, b in pairs)
        print(f"  its G and both variances agree with ours to {apart:.0e}")
    large = record_of(65536, 4, 10, 5000)
    ours = best(lambda: nlfrf.identify(large), 7)
    bare = best(lambda: bare_rfft(large), 7)
    print("N = 65536, P = 4, M = 10, F = 5000")
    print(f"  {1e3 * ours:.0f} ms, {ours / bare:.2f} times the bare rfft of {1e3 * bare:.0f} ms (target 2.5)")
    print("2^22 samples in one record")
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    long = record_of(1 << 21, 2, 1, 1000)
    size = (long.u.nbytes + long.y.nbytes) / 1024
    made = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    elapsed = best(lambda: nlfrf.identify(long), 1)
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    print(
        f"  {elapsed:.2f} s; peak memory {(after - before) / size:.1f} times the record's {size / 1024:.0f} MB, "
        f"{(made - before) / size:.1f} of them to make it (target 6)"
    )


if __name__ == "__main__":
    main()
