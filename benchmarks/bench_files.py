"""Files and imports: CSV against pandas, long records against their size, what `import nlfrf` takes
beyond NumPy.
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import warnings
from pathlib import Path

import nlfrf
from benchmarks.timing import in_turn
from nlfrf.io.readers import tables
from tests.support.long_records import written

SIZES = {"4 thousand rows": (2048, 2), "a million rows": (250_000, 4)}
SHORTER, LONG = (1 << 20, 4), (1 << 22, 4)  # samples of a period, periods
#: Memory before, its peaks after loading and after identify [kB], and the processor's time of both
#: [s].
MEASURED = """
import resource, sys, time, nlfrf, pandas, scipy.fft
def peak(): return next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM'))
def spent():
    used = [resource.getrusage(who) for who in (resource.RUSAGE_SELF, resource.RUSAGE_CHILDREN)]
    return sum(one.ru_utime + one.ru_stime for one in used)
nlfrf.load_record, nlfrf.identify
import nlfrf.io.records, nlfrf.bla.identify
before, begin = peak(), spent()
record = nlfrf.load_record(sys.argv[1])
loaded, middle = peak(), spent()
nlfrf.identify(record)
print(before, loaded, peak(), middle - begin, spent() - middle)
"""


def against_pandas(folder: Path) -> None:
    """The table alone, then with clock, period, lines and the faults of both channels looked
    for.
    """
    import pandas as pd

    for label, size in SIZES.items():
        path = folder / "run.csv"
        written(path, *size, kept=True)
        times = in_turn(
            {
                "pandas": lambda path=path: pd.read_csv(path),
                "read": lambda path=path: tables.contents(path),
                "load": lambda path=path: nlfrf.load_record(path),
            },
            20 if size[0] < 10_000 else 5,
        )
        print(
            f"CSV, {label}: pandas.read_csv {1e3 * times['pandas']:.1f} ms; the table with its"
            f" layout found {times['read'] / times['pandas']:.2f} times that; load_record, which"
            " finds clock, period and lines and looks for faults,"
            f" {times['load'] / times['pandas']:.1f} times"
        )


def long_records(folder: Path) -> None:
    """What a process that loads and identifies takes of memory over the file, and of time one over
    the other.
    """
    cases = [
        (SHORTER, ".npz", True),
        (SHORTER, ".h5", False),
        (SHORTER, ".h5", True),
        (SHORTER, ".csv", True),
    ]
    for size, suffix, kept in [
        (SHORTER, ".npz", False),
        *cases,
        (LONG, ".npz", False),
        (LONG, ".npz", True),
    ]:
        path = folder / f"long{suffix}"
        record = written(path, *size, kept=kept)
        held = record.u.nbytes + record.y.nbytes
        del record
        said = [
            subprocess.run(
                [sys.executable, "-c", MEASURED, path], check=True, capture_output=True, text=True
            ).stdout.split()
            for _ in range(3)
        ]
        before, loaded, identified = (1024 * min(int(one[i]) for one in said) for i in range(3))
        load, identify = (min(float(one[i]) for one in said) for i in (3, 4))
        file = max(held, path.stat().st_size)
        print(
            f"{suffix}{' of nlfrf.save' if kept else ', streams alone'},"
            f" {size[0] * size[1] / 1e6:.0f} M samples, {path.stat().st_size / 1e6:.0f} MB: peak"
            f" memory {(loaded - before) / file:.2f} times the file to load,"
            f" {(identified - before) / file:.2f} with identify; loaded in {load:.2f} s,"
            f" {load / identify:.1f} times identify ({identify:.2f} s)"
        )
        path.unlink()


def imports() -> None:
    """Least processor time of a process that imports and ends."""

    def least(code: str) -> float:
        spent = []
        for _ in range(7):
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            subprocess.run([sys.executable, "-c", code], check=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        return min(spent)

    numpy = least("import numpy")
    for code in ("import numpy, nlfrf", "import nlfrf; nlfrf.identify", "import numpy, robust"):
        print(f"{code}: {least(code) - numpy:.3f} s beyond NumPy's {numpy:.3f} s")


def main() -> None:
    """Print it."""
    warnings.simplefilter("ignore")
    imports()
    with tempfile.TemporaryDirectory() as folder:
        against_pandas(Path(folder))
        long_records(Path(folder))


if __name__ == "__main__":
    main()
