"""Speed of `identify` against a bare rfft of the same record, and against peers that are installed, in one run."""

from __future__ import annotations

import resource

import numpy as np

import nlfrf
from benchmarks.timing import best

TARGETS = {"fast": "3 ms", "fast, roughness": "1 ms", "robust, M = 7": "1.5 ms", "fast, local transient": "20 ms"}
#: The peer's own time on the machine the targets come from: what they are worth on this one.
PEER_WHERE_TARGETS_WERE_SET = {"M = 1": 1.0, "M = 7": 4.1}


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


def main():
    """Print the table."""
    small, several = record_of(4096, 2, 1, 100), record_of(4096, 2, 7, 100)
    cases = [
        ("fast", small, {}),
        ("fast, roughness", small, {"level_from": "roughness"}),
        ("fast, local transient", small, {"transient": "local"}),
        ("robust, M = 7", several, {}),
    ]
    print("N = 4096, P = 2, F = 100")
    for name, record, options in cases:
        ours = best(lambda record=record, options=options: nlfrf.identify(record, **options), 200)
        bare = best(lambda record=record: (np.fft.rfft(record.u), np.fft.rfft(record.y)), 200)
        print(f"  {name:<22} {1e3 * ours:7.2f} ms (target {TARGETS[name]}), {ours / bare:6.1f} times a bare rfft")
    for name, record in (("M = 1", small), ("M = 7", several)):
        theirs = peer(record)
        if theirs is None:
            print("  best-linear-approximation is not installed here (it needs Python 3.12)")
            break
        peers, ours = best(theirs, 50), best(lambda record=record: nlfrf.identify(record), 200)
        print(
            f"  best-linear-approximation, {name} (FRF and variances, no levels): {1e3 * peers:.2f} ms, "
            f"{peers / ours:.2f} times ours ({PEER_WHERE_TARGETS_WERE_SET[name]} ms where the targets were set)"
        )
        if name == "M = 7":
            bla, G = nlfrf.identify(record, transient="none"), theirs().G
            pairs = ((bla.G, G.value), (bla.var_noise, G.noise.var), (bla.var_total, G.total.var))
            apart = max(np.max(np.abs(np.squeeze(b) / a - 1)) for a, b in pairs)
            print(f"  its G and both variances agree with ours to {apart:.0e}")
    large = record_of(65536, 4, 10, 5000)
    ours = best(lambda: nlfrf.identify(large), 7)
    bare = best(lambda: (np.fft.rfft(large.u), np.fft.rfft(large.y)), 7)
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
