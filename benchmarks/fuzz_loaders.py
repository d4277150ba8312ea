"""Load thousands of damaged files of each format and of JSON: only documented errors, no hang, no
blow-up of memory.

python -m benchmarks.fuzz_loaders [--files 2000]
"""

from __future__ import annotations

import argparse
import resource
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import nlfrf
import robust
from tests.nlfrf.io.test_files import FORMATS, fuzz_loader  # the same fuzz as in the tests, longer
from tests.robust.io.test_certificates import K, make_model
from tests.support.measurement_files import damaged


def fuzz_json(folder, n, rng):
    """(name, refused) of n damaged files of each kind of JSON; all but a ValueError in a clean line
    is let through.
    """
    report = robust.check(make_model(), K)
    kinds = (
        ("model", make_model(), robust.load),
        ("controller", K, robust.load),
        ("certificate", report, robust.io.verify_certificate),
    )
    for name, thing, load in kinds:
        path = folder / f"{name}.json"
        robust.save(thing, path)
        content, refused = path.read_bytes(), 0
        for _ in range(n):
            path.write_bytes(damaged(content, rng))
            try:
                load(path)
            except ValueError as error:
                refused += 1
                if not str(error).isprintable():
                    raise AssertionError("a refusal has one clean line") from error
        yield name, refused


def main():
    """Print what happened."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--files", type=int, default=2000)
    n = parser.parse_args().files
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, rng=rng)
    u = np.repeat(ms.u[:, None, :], 3, axis=1)
    record = nlfrf.Record(u=u, y=u**3 + 0.01 * rng.standard_normal(u.shape), fs=512, lines=ms.lines)
    warnings.simplefilter("ignore")
    for suffix in FORMATS:
        begin = time.perf_counter()
        with tempfile.TemporaryDirectory() as folder:
            refused = fuzz_loader(record, suffix, Path(folder), n=n, seed=1)
        elapsed = time.perf_counter() - begin
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
        print(
            f"{suffix:<5} {n} damaged files: {refused} refused, {n - refused} read, none else; "
            f"{elapsed:.1f} s, peak memory so far {peak:.0f} MB"
        )
    with tempfile.TemporaryDirectory() as folder:
        for name, refused in fuzz_json(Path(folder), n, rng):
            print(f"{name} {n} damaged files: {refused} refused, {n - refused} read, none else")


if __name__ == "__main__":
    main()
