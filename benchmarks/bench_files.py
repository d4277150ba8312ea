"""Files and imports: CSV against pandas, long records against their size, what `import nlfrf` takes beyond NumPy."""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import time
import warnings
from pathlib import Path

import numpy as np

import nlfrf
from benchmarks.timing import in_turn
from nlfrf.readers import tables

SIZES = {"4 thousand rows": (2048, 2), "a million rows": (250_000, 4)}
LONG = (1 << 20, 4)  # samples of a period, periods
#: Of Linux: the peak of this program alone, where getrusage has that of the one which started it.
PEAK = "print(next(line.split()[1] for line in open('/proc/self/status') if line.startswith('VmHWM')))"


def written(path: Path, n_samples: int, n_periods: int) -> nlfrf.Record:
    """A record on disk, as its suffix says."""
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=1000, n_samples=n_samples, f_min=1000 / n_samples, f_max=2e6 / n_samples / 8, rng=rng)
    u = np.tile(ms.u[:, None], (1, n_periods, 1))
    record = nlfrf.Record(u=u, y=u + 0.1 * u**3 + 0.01 * rng.standard_normal(u.shape), fs=1000, lines=ms.lines)
    if path.suffix == ".csv":
        nlfrf.save_record(record, path)
    else:  # as an instrument writes it: no periods, no lines
        np.savez(path, u=record.u.ravel(), y=record.y.ravel(), fs=1000.0)
    return record


def against_pandas(folder: Path) -> None:
    """The table alone, then with clock, period, lines and the faults of both channels looked for."""
    import pandas as pd

    for label, size in SIZES.items():
        path = folder / "run.csv"
        written(path, *size)
        times = in_turn(
            {
                "pandas": lambda path=path: pd.read_csv(path),
                "read": lambda path=path: tables.contents(path),
                "load": lambda path=path: nlfrf.load_record(path),
            },
            20 if size[0] < 10_000 else 5,
        )
        print(
            f"CSV, {label}: pandas.read_csv {1e3 * times['pandas']:.1f} ms; the table with its layout found "
            f"{times['read'] / times['pandas']:.2f} times that; load_record, which finds clock, period and lines and "
            f"looks for faults, {times['load'] / times['pandas']:.1f} times"
        )


def long_records(folder: Path) -> None:
    """Peak memory of a process that loads, over the size of the samples; its time over that of identify."""
    for suffix in (".npz", ".csv"):
        path = folder / f"long{suffix}"
        record = written(path, *LONG)
        size = record.u.nbytes + record.y.nbytes
        begin = time.process_time()
        nlfrf.identify(record)
        identified = time.process_time() - begin
        code = f"import nlfrf, time\nnlfrf.load_record\na=time.process_time()\n{PEAK}\n"
        code += f"nlfrf.load_record({str(path)!r}, n_samples={LONG[0]})\nprint(time.process_time() - a)\n{PEAK}"
        said = subprocess.run([sys.executable, "-c", code], check=True, capture_output=True, text=True).stdout.split()
        peak = 1024 * (int(said[2]) - int(said[0])) / max(size, path.stat().st_size)
        print(
            f"{suffix}, {record.u.size / 1e6:.0f} M samples, {path.stat().st_size / 1e6:.0f} MB: loaded in "
            f"{float(said[1]):.2f} s (identify {identified:.2f} s), peak memory {peak:.1f} times the file"
        )


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
