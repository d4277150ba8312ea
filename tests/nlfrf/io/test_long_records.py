"""Long records: what they take of memory, and that block by block they are what they are as a
whole.
"""

import subprocess
import sys
import warnings
from pathlib import Path

import numpy as np
import pytest

import nlfrf
from nlfrf._base import numbers as transforms
from nlfrf._base import own_process
from nlfrf.io.measurement_files import read_channels
from nlfrf.records import excited_lines as detection
from nlfrf.records import period
from nlfrf.records.screening import input as faults
from tests.support.long_records import written

ROOT = Path(__file__).parents[3]
N, P = 1 << 18, 4  # a million samples of u and y: 16.8 MB
#: In a process of its own: what was imported before, or remembered, counts for nobody.
PEAK = """
import sys, tracemalloc
import nlfrf, h5py, pandas, scipy.fft
nlfrf.load_record(sys.argv[2]) if sys.argv[2] else None  # a short one: what the first use of a reader imports
tracemalloc.start()
record = nlfrf.load_record(sys.argv[1])
loaded = tracemalloc.get_traced_memory()[1]
bla = nlfrf.identify(record)
print(loaded, tracemalloc.get_traced_memory()[1], record.n_samples, bla.experiment.n_periods)
"""


@pytest.mark.attack(every=3)
@pytest.mark.parametrize(
    ("name", "kept", "noise"),
    [
        ("r.npz", False, 0.003),
        ("g.npz", False, 0.0),
        ("k.npz", True, 0.003),
        ("r.h5", False, 0.003),
        ("r.csv", False, 0),
    ],
)
def test_a_long_record_takes_twice_its_file_at_most(name, kept, noise, tmp_path):
    record = written(tmp_path / name, N, P, noise, kept)
    written(tmp_path / f"short-{name}", 1024, 2, noise, kept)
    done = subprocess.run(
        [sys.executable, "-c", PEAK, tmp_path / name, tmp_path / f"short-{name}"],
        check=True,
        capture_output=True,
        text=True,
        cwd=ROOT,
    )
    loaded, identified, n_samples, n_periods = map(int, done.stdout.split())
    size = max((tmp_path / name).stat().st_size, record.u.nbytes + record.y.nbytes)
    assert (n_samples, n_periods) == (N, P)
    assert loaded < 2 * size
    assert identified < 2 * size


def extremes_of(x):
    """Both extremes, each with four times the samples at the level next to it."""
    levels, counts = np.unique(x, return_counts=True)
    return [
        (levels[i], 4 * counts[j] if levels.size > 1 else 0)
        for i, j in ((-1, -2 % levels.size), (0, 1 % levels.size))
    ]


@pytest.mark.parametrize("step", [7, 64, 1000, 1001])
def test_checks_by_blocks_are_those_of_the_whole(step, monkeypatch):
    rng = np.random.default_rng(step)
    monkeypatch.setattr(transforms, "BLOCK_ENTRIES", step)
    for x in (
        rng.integers(-3, 4, 3003).astype(float),
        np.clip(rng.standard_normal(2002), -1, 1.5),
        np.repeat(rng.standard_normal(40), rng.integers(1, 90, 40)),
        np.ones(1001),
    ):
        share = sum(
            np.mean(x == e)
            for e, below in extremes_of(x)
            if runs(x == e).max() > 2 and np.sum(x == e) > below
        )
        assert faults.clipped_share(x) == pytest.approx(share, rel=1e-12)
        edges = np.flatnonzero(np.concatenate([[True], np.diff(x) != 0, [True]]))
        longest = int(np.argmax(np.diff(edges)))
        length, begin = np.diff(edges)[longest], edges[longest]
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always")
            faults.warn_about_channel("y", x, 1)
        assert f"constant for {length} samples from sample {begin} on" in str(told[-1].message)
        assert transforms.is_constant(x) == (np.ptp(x) == 0)
        assert transforms.streams_equal(x, x.copy())
        assert not transforms.streams_equal(x, np.append(x[:-1], np.pi))
        for bad in (np.nan, np.inf):
            assert not transforms.all_finite(np.append(x, bad))
    assert transforms.all_finite(np.full(3 * step, 1e308))  # whose sum is none


def runs(flags):
    """Lengths of the runs of flags that are set, and 0."""
    edges = np.flatnonzero(np.diff(np.concatenate([[False], flags, [False]]).astype(int)))
    return np.append(edges[1::2] - edges[::2], 0)


@pytest.mark.parametrize("n", [1 << 18, 300_000, 3 * 98_304, 2 * 131_101])
def test_a_long_transform_at_some_lines_is_that_of_the_whole(n):
    x = np.random.default_rng(n).standard_normal((2, n))
    lines = np.unique(np.random.default_rng(1).integers(0, n // 2 + 1, 300))
    X = np.fft.rfft(x)[:, lines]
    np.testing.assert_allclose(
        transforms.rfft_at(x, lines), X, rtol=0, atol=1e-12 * np.abs(X).max()
    )


BLOCK_ROWS = 1 << 16  # of a table


def rows_of_table(begin, end):
    """Rows of a table as text, and its numbers; one of them is infinite, which stands for none."""
    t = np.arange(begin, end)
    table = np.column_stack([t / 1000, np.sin(t % 300), np.cos(t % 300)])
    table[17, 1] = np.inf
    text = "".join(f"{a!r},{b!r},{c!r}\n" for a, b, c in table.tolist())
    table[17, 1] = np.nan
    return text, table


@pytest.mark.parametrize("rows", [300, BLOCK_ROWS - 1, BLOCK_ROWS, BLOCK_ROWS + 1, 3 * BLOCK_ROWS])
def test_a_table_read_by_blocks_is_that_of_the_whole(rows, tmp_path):
    text, table = rows_of_table(0, rows)
    (tmp_path / "t.csv").write_text(f"t [s],u,y\n{text}")
    found = read_channels(tmp_path / "t.csv").arrays
    np.testing.assert_array_equal(np.column_stack(list(found.values())), table)


def test_a_table_that_grows_as_it_is_read_has_all_its_rows(tmp_path, monkeypatch):
    import pandas as pd

    text, table = rows_of_table(0, 4000)
    path, read_csv = tmp_path / "t.csv", pd.read_csv
    path.write_text(f"t [s],u,y\n{text}")
    more, appended = rows_of_table(4000, 4000 + BLOCK_ROWS + 100)

    def grown(*args, **options):
        with path.open("a") as stream:
            stream.write(more)
        return read_csv(*args, **options)

    monkeypatch.setattr(pd, "read_csv", grown)
    found = read_channels(path).arrays
    np.testing.assert_array_equal(
        np.column_stack(list(found.values())), np.concatenate([table, appended])
    )


@pytest.mark.own_process
def test_hdf5_read_by_blocks_is_that_of_the_whole(tmp_path, monkeypatch):
    """A megabyte at a time, or a row that is longer."""
    import h5py

    n, path = 150_001, tmp_path / "x.h5"
    x = np.random.default_rng(0).standard_normal((n, 3))
    rows = np.zeros(n, dtype=[("a", "f4"), ("b", "i4", (2,)), ("text", "S3")])
    rows["a"], rows["b"] = x[:, 0], 100 * x[:, :2]
    with h5py.File(path, "w") as file:
        file["plain"], file["other"], file["number"], file["table"] = (
            x,
            x[:, 0].astype(">f4"),
            3.0,
            rows,
        )
        for name, array, options in (
            ("packed", x, {"compression": "gzip", "chunks": (64, 3)}),
            ("wide", x.T, {}),
        ):
            file.create_dataset(name, data=array, **options).attrs["columns"] = ["t", "u", "y"]
    arrays = read_channels(path).arrays
    for group in ("packed", "wide"):
        np.testing.assert_array_equal(
            np.column_stack([arrays[f"{group}.{name}"] for name in "tuy"]), x
        )
    np.testing.assert_array_equal(arrays["plain"], x)
    np.testing.assert_array_equal(arrays["other"], x[:, 0].astype("f4"))
    np.testing.assert_array_equal(arrays["table.b"], rows["b"])
    assert (arrays["number"], "table.text" in arrays) == (3.0, False)


@pytest.mark.own_process
def test_an_answer_that_is_cut_or_too_long_is_refused(tmp_path, monkeypatch):
    import h5py

    path, python, answer = tmp_path / "x.h5", tmp_path / "python", tmp_path / "answer"
    with h5py.File(path, "w") as file:
        for name in "uy":
            file.create_dataset(name, data=np.zeros(100_000), compression="gzip")
    child = sys.executable

    def first(n):
        """Give the first n bytes of what the child says."""
        python.write_text(f'#!/bin/sh\n"{child}" "$@" > "{answer}" && head -c {n} "{answer}"\n')
        python.chmod(0o755)
        monkeypatch.setattr(sys, "executable", str(python))
        return read_channels(path).arrays

    assert list(first(10**9)) == ["u", "y"]
    size = answer.stat().st_size
    for cut in (0, 40, size // 2, size - 1):  # a child that ends early
        with pytest.raises(ValueError, match=r"must be a readable .h5 file, got .* crashed"):
            first(cut)
    monkeypatch.setattr(own_process, "UNPACKED", 1000)
    with pytest.raises(ValueError, match=r"it unpacks to 0.0016 GB, but a file of .* may unpack"):
        first(10**9)


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".csv"])
def test_a_long_file_that_ends_early_is_refused_in_one_line(suffix, tmp_path):
    path = tmp_path / f"r{suffix}"
    written(path, 1 << 15, 2, kept=True)
    content = path.read_bytes()
    path.write_bytes(content[: len(content) // 3])
    with pytest.raises(ValueError, match="must") as refusal:
        nlfrf.load_record(path, n_samples=1 << 15)
    assert "\n" not in str(refusal.value)


@pytest.mark.parametrize(
    ("n_samples", "n_periods", "band", "noise"),
    [
        (1 << 17, 4, (1, 500), 0.0),  # a generator's: found to the last bit
        (1 << 17, 4, (1, 500), 0.05),  # smooth: looked at coarsely
        (1000, 300, (1, 400), 0.05),  # short periods, many
        (60_007, 5, (1, 28_000), 0.3),  # broad band, a prime number
        (99_991, 4, (30_000, 40_000), 0.1),  # narrow band, far up
        (1 << 17, 2, (1, 20), 0.0001),  # two periods alone
    ],
)
def test_the_period_of_a_long_signal_is_that_of_its_whole_autocorrelation(
    n_samples, n_periods, band, noise
):
    rng = np.random.default_rng(n_samples)
    ms = nlfrf.multisine(fs=n_samples, n_samples=n_samples, f_min=band[0], f_max=band[1], rng=rng)
    u = np.tile(ms.u[0], n_periods) + 0.3
    u = u + noise * rng.standard_normal(u.size)
    assert u.size > period.LONG_SIGNAL
    assert period.detect_period(u) == pytest.approx(n_samples, abs=0.05)
    if noise < 0.01 or band[0] > 1:  # else noise moves the top of a flat peak
        assert period.detect_period(u) == pytest.approx(lag_of_repetition(u, n_samples), abs=0.01)


def lag_of_repetition(u, near):
    """The lag near this one at which the whole autocorrelation, over the energy of the pieces that
    overlap, is largest: the top of a band-limited interpolation.
    """
    u = u - u.mean()
    spectrum = np.abs(np.fft.rfft(u, 2 * u.size)) ** 2
    energy = np.append(0.0, np.cumsum(u**2))
    turns = 1j * np.pi / u.size * np.arange(spectrum.size)
    lags = near + np.arange(-4, 5) / 4
    for _ in range(3):
        overlap = np.interp([lags, u.size - lags], np.arange(energy.size), energy)
        rho = [np.sum(spectrum * np.exp(turns * lag)).real for lag in lags]
        rho /= np.sqrt((energy[-1] - overlap[0]) * overlap[1])
        lags = lags[np.argmax(rho)] + (lags - lags.mean()) / 4
    return lags.mean()


def test_a_long_period_between_samples_and_a_late_start_are_found():
    t, k = np.arange(400_000), np.arange(1, 300)
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, k.size)
    turns = 2 * np.pi * t / 50_000.37
    u = sum(np.cos(one * turns + phase) for one, phase in zip(k, phases, strict=True))
    assert period.detect_period(u) == pytest.approx(50_000.37, abs=0.01)
    assert period.detect_period(np.append(np.zeros(60_000), u)) == pytest.approx(
        50_000.37, abs=0.01
    )
    noise = np.random.default_rng(0).standard_normal(200_000)
    with pytest.raises(ValueError, match="u must repeat at least once"):
        period.detect_period(noise)
    with pytest.raises(ValueError, match="u must repeat at least once"):
        period.detect_period(np.ones(200_000))


def test_faults_of_long_periods_are_found_coarsely_as_they_are_in_full(monkeypatch):
    n = 1 << 18
    ms = nlfrf.multisine(fs=n, n_samples=n, f_min=1, f_max=400, rng=1)
    u = np.tile(ms.u[0], 6) + 1e-3 * np.random.default_rng(0).standard_normal(6 * n)
    late = np.concatenate([u[: 2 * n - 50], u[2 * n - 41 :]])  # nine samples lost
    found = faults.track_input(late, n)
    monkeypatch.setattr(faults, "BLOCK_ENTRIES", 1 << 30)  # at every sample
    whole = faults.track_input(late, n)
    assert found.fault == whole.fault
    assert "9 lost before period 3" in found.fault
    np.testing.assert_allclose(found.delay, whole.delay, atol=0.01)


def test_lines_of_long_periods_are_those_found_in_all_of_them(monkeypatch):
    n = 1 << 18
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=n, n_samples=n, f_min=1, f_max=n / 8, n_log=200, rng=rng)
    u = np.tile(ms.u[0], (1, 5, 1)) + 0.01 * rng.standard_normal((1, 5, n))
    found = detection.detect_lines(u)
    np.testing.assert_array_equal(found.excited, ms.lines.excited)
    np.testing.assert_array_equal(detection.detect_lines(u[:, :2]).excited, ms.lines.excited)
    power, _ = detection.line_powers(u)
    monkeypatch.setattr(detection, "BLOCK_ENTRIES", 1 << 30)
    whole, _ = detection.line_powers(u)
    np.testing.assert_allclose(power, whole, rtol=1e-9)


@pytest.mark.parametrize("n", [2, 3, 1000, 70_001])
def test_the_frequency_of_a_time_axis_by_blocks(n, tmp_path, monkeypatch):
    monkeypatch.setattr(transforms, "BLOCK_ENTRIES", 64)
    t = np.round(np.arange(n) / 16384, 6)

    def sampling_frequency(seconds):
        np.savez(tmp_path / "t.npz", t=seconds, u=np.ones(n))
        return read_channels(tmp_path / "t.npz").sampling_frequency(None, ("u",))

    assert sampling_frequency(t) == pytest.approx(16384, rel=2e-2 if n < 4 else 1e-3)
    if n > 3:
        assert sampling_frequency(
            np.where(np.arange(n) == n // 2, np.nan, t) + 1e6
        ) == sampling_frequency(t)


@pytest.mark.parametrize("kind", ["<f8", ">f8", "<f4", "<i4", "?"])
def test_members_of_an_npz_file_are_what_numpy_reads(kind, tmp_path):
    few = np.random.default_rng(0).standard_normal((1100, 17))  # over and over: quickly packed
    x = np.tile(100 * few, 59).astype(kind)
    held = {"rows": x, "columns": np.asfortranarray(x), "small": x[:2, :3], "text": np.array("u")}
    np.savez(tmp_path / "x.npz", **held)
    np.savez_compressed(tmp_path / "z.npz", **held)
    for name in "xz":
        found = read_channels(tmp_path / f"{name}.npz").arrays
        for key, array in held.items():
            np.testing.assert_array_equal(found[key], array)
            assert found[key].dtype == array.dtype
    content = bytearray((tmp_path / "x.npz").read_bytes())
    content[len(content) // 3] ^= 1  # one bit of a sample
    (tmp_path / "x.npz").write_bytes(content)
    with pytest.raises(ValueError, match=r"must be a readable .npz file, got 'x.npz': Bad CRC-32"):
        nlfrf.load_record(tmp_path / "x.npz")
