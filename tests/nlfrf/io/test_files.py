"""Files: exact round trips, names that are listed, damaged files refused, nothing half written."""

import resource
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.io import savemat

import nlfrf
from tests.support.measurement_files import damaged

FORMATS = [".npz", ".mat", ".h5", ".csv"]


@pytest.fixture(scope="module")
def record():
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, rng=rng)
    u = np.repeat(ms.u[:, None, :], 3, axis=1)
    return nlfrf.Record(u=u, y=u**3 + 0.01 * rng.standard_normal(u.shape), fs=512, lines=ms.lines)


def same(one, two):
    for name in (field.name for field in fields(one)):
        a, b = getattr(one, name), getattr(two, name)
        if hasattr(a, "__dataclass_fields__"):
            same(a, b)
        else:
            np.testing.assert_array_equal(a, b)
            assert type(a) is type(b)


@pytest.mark.parametrize("suffix", FORMATS)
def test_records_round_trip_exactly(record, suffix, tmp_path):
    path = tmp_path / f"record{suffix}"
    nlfrf.save(record, path)
    same(nlfrf.load_record(path, n_samples=512), record)
    if suffix != ".csv":
        assert nlfrf.load_record(path, n_discard=2).n_periods == 1


def test_a_reference_travels_along(record, tmp_path):
    with_r = nlfrf.Record(u=record.u, y=record.y, r=2 * record.u, fs=record.fs, lines=record.lines)
    nlfrf.save(with_r, tmp_path / "r.npz")
    same(nlfrf.load_record(tmp_path / "r.npz", r="r"), with_r)


def test_blas_and_multisines_round_trip_exactly(record, tmp_path):
    bla = nlfrf.identify(record)
    nlfrf.save(bla, tmp_path / "bla.npz")
    same(nlfrf.load(tmp_path / "bla.npz"), bla)
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, n_realizations=2, rng=0)
    nlfrf.save(ms, tmp_path / "ms.npz")
    same(nlfrf.load(tmp_path / "ms.npz"), ms)
    assert isinstance(nlfrf.load(tmp_path / "bla.npz"), nlfrf.Bla)
    nlfrf.save(record, tmp_path / "r.csv")
    with pytest.raises(ValueError, match=r"path must hold a multisine or .*got .*, which is a BLA"):
        nlfrf.load_record(tmp_path / "r.csv", n_samples=512, design=tmp_path / "bla.npz")


def test_blas_and_multisines_round_trip_in_hdf5(record, tmp_path):
    bla = nlfrf.identify(record)
    nlfrf.save(bla, tmp_path / "bla.h5")
    same(nlfrf.load(tmp_path / "bla.h5"), bla)
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, n_realizations=2, rng=0)
    nlfrf.save(ms, tmp_path / "ms.h5")
    same(nlfrf.load(tmp_path / "ms.h5"), ms)


def test_csv_of_a_bla_holds_its_numbers(record, tmp_path):
    bla = nlfrf.identify(record)
    nlfrf.export_csv(bla, tmp_path / "bla.csv")
    header, *_ = (tmp_path / "bla.csv").read_text().splitlines()
    assert header.split(",")[:4] == ["f [Hz]", "Re G", "Im G", "bound"]
    table = np.loadtxt(tmp_path / "bla.csv", delimiter=",", skiprows=1)
    np.testing.assert_array_equal(table[:, 1] + 1j * table[:, 2], bla.G)
    np.testing.assert_array_equal(table[:, 3], bla.bound())


@pytest.mark.parametrize("suffix", [".csv", ".mat", ".wav"])
def test_a_generator_plays_the_samples_and_the_design_lies_beside(suffix, tmp_path):
    from scipy.io import loadmat, wavfile

    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, n_realizations=2, rng=0)
    path = tmp_path / f"ms{suffix}"
    nlfrf.save(ms, path)
    same(nlfrf.load(tmp_path / "ms.npz"), ms)
    with pytest.raises(ValueError, match=r"the design of a played signal may be in ms\.npz"):
        nlfrf.load(path)
    if suffix == ".csv":
        played = np.loadtxt(path, delimiter=",", skiprows=1)[:, 1:].T
    elif suffix == ".mat":
        played = loadmat(path)["u"]
    else:
        fs, samples = wavfile.read(path)
        assert fs == 512
        played = samples.T * np.load(tmp_path / "ms.npz")["peak"]
    np.testing.assert_allclose(played, ms.u, atol=1e-6 if suffix == ".wav" else 0)


def test_matlab_7_3_files_are_read(record, tmp_path):
    import h5py

    with h5py.File(tmp_path / "m.mat", "w", userblock_size=512) as file:
        file["u"], file["run/angle"] = record.u.reshape(1, -1), record.y.reshape(-1, 1)
    with (tmp_path / "m.mat").open("r+b") as stream:
        stream.write(b"MATLAB 7.3 MAT-file, Platform: any")
    read = nlfrf.load_record(tmp_path / "m.mat", u="u", y="run.angle", fs=512)
    np.testing.assert_array_equal(read.y, record.y)


def test_foreign_files_by_name(record, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    savemat(tmp_path / "m.mat", {"current": u, "run": {"angle": y, "note": "first"}, "fs": 512})
    read = nlfrf.load_record(tmp_path / "m.mat", u="current", y="run.angle")
    np.testing.assert_array_equal(read.u, record.u)
    np.testing.assert_array_equal(read.lines.excited, record.lines.excited)
    assert read.fs == 512
    t = np.arange(u.size) / 512
    table = np.column_stack([t, u, y])
    np.savetxt(
        tmp_path / "m.csv",
        table,
        delimiter=";",
        header="time [s];current [A];angle (rad)",
        comments="",
    )
    read = nlfrf.load_record(tmp_path / "m.csv", u="current", y="angle", n_samples=512)
    np.testing.assert_allclose(read.y, record.y, rtol=1e-12)
    assert read.fs == 512


@pytest.mark.parametrize("fs", [0.1, 1 / 3, 1000.5, 11_025, 16_384, 65_536, 2e6])
def test_a_record_in_csv_keeps_its_sampling_frequency(record, fs, tmp_path):
    nlfrf.save(replace(record, fs=fs), tmp_path / "r.csv")
    assert nlfrf.load_record(tmp_path / "r.csv", n_samples=512).fs == pytest.approx(fs, rel=2e-12)


def test_the_sampling_frequency_of_any_time_axis(tmp_path):
    def sampling_frequency(t):
        u = np.resize(np.random.default_rng(0).standard_normal(500), t.size)
        np.savez(tmp_path / "t.npz", t=t, u=u, y=0.5 * u)
        return nlfrf.inspect_file(tmp_path / "t.npz").channels[0].fs

    t = np.arange(20_000) / 11_025
    assert sampling_frequency(np.round(t, 6)) == 11_025
    assert sampling_frequency(np.round(t, 4) + 7) == pytest.approx(
        11_025, rel=1e-4
    )  # most steps are printed as 0.0001
    jitter = 5e-6 * np.random.default_rng(0).standard_normal(t.size)
    assert sampling_frequency(t + jitter) == pytest.approx(11_025, rel=1e-4)
    gaps = np.delete(np.arange(20_000) / 1000, [500, 501, 7000, 9000])
    assert sampling_frequency(gaps) == 1000
    assert np.isnan([sampling_frequency(np.zeros(10)), sampling_frequency(-t)]).all()


@pytest.mark.parametrize(
    ("name", "unit"), [("t [ms]", 1e-3), ("Time (us)", 1e-6), ("time", 1.0), ("t [ s ]", 1.0)]
)
def test_time_in_other_units(record, name, unit, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    table = np.column_stack([np.arange(u.size) / 512 / unit, u, y])
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header=f"{name},u,y", comments="")
    assert nlfrf.load_record(tmp_path / "m.csv", n_samples=512).fs == pytest.approx(512, rel=1e-9)
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="t [ticks],u,y", comments="")
    with pytest.raises(
        ValueError,
        match=r"fs must be given: the unit of the time channel 't \[ticks\]' is not known",
    ):
        nlfrf.load_record(tmp_path / "m.csv", n_samples=512)


@pytest.mark.parametrize("delimiter", [";", "\t"])
def test_decimal_commas_and_the_code_page_of_a_spreadsheet(record, delimiter, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    rows = [
        f"{a!r}{delimiter}{b!r}".replace(".", ",")
        for a, b in zip(u.tolist(), y.tolist(), strict=True)
    ]
    text = "\r\n".join([f"Kraft [N]{delimiter}Weg [µm]", *rows, ""])
    (tmp_path / "m.csv").write_bytes(text.encode("cp1252"))
    read = nlfrf.load_record(tmp_path / "m.csv", u="Kraft", y="Weg [µm]", fs=512, n_samples=512)
    np.testing.assert_array_equal(read.u, record.u)
    np.testing.assert_array_equal(read.y, record.y)


def test_the_header_that_numpy_writes_and_a_row_without_numbers(record, tmp_path):
    table = np.column_stack(
        [np.arange(record.u.size) / 512, record.u.reshape(-1), record.y.reshape(-1)]
    )
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="t,u,y")
    read = nlfrf.load_record(tmp_path / "m.csv", n_samples=512)
    np.testing.assert_array_equal(read.lines.excited, record.lines.excited)
    table[7] = np.nan
    np.savetxt(tmp_path / "m.csv", table, delimiter=",", header="t,u,y")
    with pytest.raises(
        ValueError, match=r"u must be finite, got 1 nan or infinite numbers, the first at 7"
    ):
        nlfrf.load_record(tmp_path / "m.csv", n_samples=512)
    with pytest.raises(ValueError, match="y must name at least one output, got none"):
        nlfrf.load_record(tmp_path / "m.csv", y=[])


def test_a_stored_record_is_not_cut_anew(record, tmp_path):
    nlfrf.save(record, tmp_path / "r.npz")
    with pytest.raises(ValueError, match=r"n_samples must be that of the record, 512, got 100"):
        nlfrf.load_record(tmp_path / "r.npz", n_samples=100)


def test_a_name_that_fits_two_channels_is_refused(tmp_path):
    a = np.arange(9.0)
    np.savez(tmp_path / "m.npz", **{"u (V)": a, "u (A)": 2 * a, "y": a}, fs=1.0)
    with pytest.raises(
        ValueError, match=r"u must name a signal of 'm.npz', one of u \(A\), u \(V\), y; got 'u'"
    ):
        nlfrf.load_record(tmp_path / "m.npz")


def test_a_wav_file_cannot_hold_a_broken_sampling_frequency(tmp_path):
    ms = nlfrf.multisine(fs=512.5, n_samples=512, f_min=2, f_max=100, rng=0)
    with pytest.raises(
        ValueError, match=r"fs of a \.wav file must be a whole number of at least 1, got 512\.5"
    ):
        nlfrf.save(ms, tmp_path / "ms.wav")
    assert not list(tmp_path.iterdir())


def test_several_outputs_share_the_input(record, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    np.savez(tmp_path / "m.npz", u=u, motor=y, load=2 * y)
    motor, load = nlfrf.load_record(tmp_path / "m.npz", y=["motor", "load"], fs=512)
    np.testing.assert_array_equal(2 * motor.y, load.y)
    assert motor.u is load.u
    together = nlfrf.identify([motor, load])
    same(together[0], nlfrf.identify(motor))
    same(together[1], nlfrf.identify(load))


def test_names_that_are_not_there_are_answered_with_those_that_are(tmp_path):
    np.savez(tmp_path / "m.npz", current=np.arange(9.0), angle=np.arange(9.0), fs=1.0, note="x")
    with pytest.raises(
        ValueError, match=r"u must name a signal of 'm.npz', one of angle, current; got 'force'"
    ):
        nlfrf.load_record(tmp_path / "m.npz", u="force", y="angle")
    np.savez(tmp_path / "n.npz", u=np.arange(9.0), y=np.arange(9.0))
    with pytest.raises(
        ValueError, match=r"fs must be given: 'n.npz' has neither fs nor a time channel"
    ):
        nlfrf.load_record(tmp_path / "n.npz")


@pytest.mark.parametrize("suffix", FORMATS)
def test_damaged_files_are_refused(record, suffix, tmp_path):
    whole = tmp_path / f"whole{suffix}"
    nlfrf.save(record, whole)
    content = whole.read_bytes()
    cut = tmp_path / f"cut{suffix}"
    for broken in (b"", content[: len(content) // 2], b"not a measurement"):
        cut.write_bytes(broken)
        with pytest.raises(ValueError, match=r"path must|n_samples|u must|y must"):
            nlfrf.load_record(cut, n_samples=512 * 3)


def test_pickles_are_never_read(tmp_path):
    np.savez(tmp_path / "p.npz", u=np.array([{"a": 1}], dtype=object), y=np.arange(5.0))
    with pytest.raises(ValueError, match=r"path must be a readable \.npz file"):
        nlfrf.load_record(tmp_path / "p.npz")


def test_missing_files_and_unknown_suffixes(tmp_path):
    with pytest.raises(FileNotFoundError, match="path must be an existing file"):
        nlfrf.load_record(tmp_path / "no.mat")
    (tmp_path / "m.xls").write_text("x")
    with pytest.raises(
        ValueError,
        match=r"path must end in \.mat, .*\.wav, got 'm.xls'; save the sheet as \.csv; arrays",
    ):
        nlfrf.load_record(tmp_path / "m.xls")


def test_a_file_is_written_whole_or_not_at_all(record, tmp_path):
    path = tmp_path / "out.npz"
    path.write_text("before")

    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (1000, limits[1]))  # as a disk that is full
    try:
        with pytest.raises(OSError, match="large"):
            nlfrf.save(record, path)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert path.read_text() == "before"
    assert [p.name for p in tmp_path.iterdir()] == ["out.npz"]
    with pytest.raises(ValueError, match=r"path must end in \.npz, \.mat, \.h5 or \.csv"):
        nlfrf.save(record, tmp_path / "out.txt")
    with pytest.raises(FileNotFoundError, match="path must lie in an existing folder"):
        nlfrf.save(record, tmp_path / "no" / "out.npz")


@pytest.mark.data
def test_motor_bench_loads_in_spite_of_objects_in_the_file(measured):
    path = measured / "motor_bench" / "MultisineTypeB.mat"
    record = nlfrf.load_record(path, u="iq_adx", y="theta_mx", n_samples=2500, n_discard=1)
    assert record.u.shape == (1, 19, 2500)
    assert record.fs == 2500
    np.testing.assert_array_equal(record.lines.excited, np.arange(13, 250, 4))


@pytest.mark.data
def test_dspace_recordings_name_their_channels(measured):
    path = measured / "linear_guide" / "exp1.mat"
    with pytest.raises(
        ValueError, match=r"one of enc1 \(mm\), enc2 \(mm\), input \(V\), time; got 'force'"
    ):
        nlfrf.load_record(path, u="force", y="enc1")
    record = nlfrf.load_record(path, u="input", y="enc1")
    assert record.fs == 1000
    assert record.n_periods == 20


@pytest.mark.data
def test_the_linear_guide_repeats_one_sample_early(measured):
    # designed for 5000 samples, played with 4999: read as 5000 it would be 16 % distortion
    path = measured / "linear_guide" / "exp1.mat"
    with pytest.raises(
        ValueError, match="got 5000: the input repeats every 4999 samples; give n_samples=4999"
    ):
        nlfrf.load_record(path, u="input", y="enc1", n_samples=5000)
    record = nlfrf.load_record(path, u="input", y="enc1")
    assert record.n_samples == 4999
    np.testing.assert_array_equal(record.lines.excited, np.arange(1, 101))


# Fuzz: whatever happens to a file, only documented errors come out


@pytest.mark.own_process
@pytest.mark.filterwarnings(
    "ignore"
)  # readers may warn about what they find; here only errors count
@pytest.mark.parametrize(
    ("suffix", "n"),
    [
        *((suffix, 4 if suffix in (".h5", ".mat") else 80) for suffix in FORMATS),
        *(pytest.param(suffix, 15, marks=pytest.mark.attack) for suffix in (".h5", ".mat")),
    ],
)
def test_damaged_files_raise_documented_errors_only(record, suffix, n, tmp_path):
    """Those of foreign libraries with a process for each file."""
    fuzz_loader(record, suffix, tmp_path, n=n, seed=0)


@pytest.mark.own_process
def test_a_reader_that_hangs_is_stopped(record, tmp_path, monkeypatch):
    from nlfrf._base import own_process

    nlfrf.save(record, tmp_path / "r.h5")
    monkeypatch.setattr(own_process, "SECONDS", 0.01)
    with pytest.raises(ValueError, match=r"its library did not finish within 0.01"):
        nlfrf.load_record(tmp_path / "r.h5")


def fuzz_loader(record, suffix, folder, *, n, seed):
    """Load n damaged files of one format; anything but a ValueError or a record is let through to
    the caller.
    """
    rng = np.random.default_rng(seed)
    whole = folder / f"whole{suffix}"
    nlfrf.save(record, whole)
    content = whole.read_bytes()
    path = folder / f"damaged{suffix}"
    refused = 0
    for _ in range(n):
        path.write_bytes(damaged(content, rng))
        message = ""
        try:
            nlfrf.load_record(path, n_samples=512)
        except ValueError as error:
            message = str(error)
        refused += bool(message)
        assert "\n" not in message
    return refused


# What a file says of its clock, its channels and its runs


def columns(path, header, *arrays):
    np.savetxt(
        path, np.column_stack(arrays), delimiter=",", header=header, comments="", fmt="%.17g"
    )


def test_a_clock_without_a_unit_is_not_guessed(record, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    n = np.arange(u.size)
    columns(tmp_path / "ms.csv", "time,u,y", n, u, y)  # milliseconds, or a count of samples
    with pytest.raises(
        ValueError,
        match=r"'time' names no unit and steps by 1: 1 Hz if these are seconds, 1000 Hz if",
    ):
        nlfrf.load_record(tmp_path / "ms.csv", n_samples=512)
    assert nlfrf.load_record(tmp_path / "ms.csv", n_samples=512, fs=1000).fs == 1000
    columns(tmp_path / "slow.csv", "time,u,y", 0.05 * n, u, y)
    with pytest.warns(
        nlfrf.DataWarning, match=r"20 Hz if these are seconds, 20000 Hz if .* seconds are taken"
    ):
        assert nlfrf.load_record(tmp_path / "slow.csv", n_samples=512).fs == 20


def test_a_sampling_frequency_that_is_not_that_of_the_file_is_warned_of(record, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    columns(tmp_path / "m.csv", "time [s],u,y", np.arange(u.size) / 2000, u, y)
    with pytest.warns(
        nlfrf.DataWarning, match=r"fs was given as 1000 Hz, but the time channel .* gives 2000 Hz"
    ):
        assert nlfrf.load_record(tmp_path / "m.csv", n_samples=512, fs=1000).fs == 1000
    assert nlfrf.load_record(tmp_path / "m.csv", n_samples=512, fs=2000).fs == 2000
    np.savez(tmp_path / "m.npz", u=u, y=y, fs=512.0)
    with pytest.warns(
        nlfrf.DataWarning, match=r"fs was given as 500 Hz, but fs of 'm.npz' gives 512 Hz"
    ):
        nlfrf.load_record(tmp_path / "m.npz", n_samples=512, fs=500)


def test_names_and_units_come_from_the_file_and_travel(record, tmp_path):
    u, y = record.u.reshape(-1), record.y.reshape(-1)
    columns(tmp_path / "m.csv", "t [s],drive force [N],stage (µm)", np.arange(u.size) / 512, u, y)
    read = nlfrf.load_record(
        tmp_path / "m.csv", u="drive force", y="stage", n_samples=512, hold="zoh"
    )
    labels = (read.u_name, read.u_unit, read.y_name, read.y_unit)
    assert labels == ("drive force", "N", "stage", "µm")
    for suffix in (".npz", ".h5", ".mat"):
        nlfrf.save(read, tmp_path / f"again{suffix}")
        same(nlfrf.load_record(tmp_path / f"again{suffix}"), read)


def test_a_channel_axis_is_reserved(record, tmp_path):
    nlfrf.save(record, tmp_path / "r.npz")
    with np.load(tmp_path / "r.npz") as archive:
        content = dict(archive)
    assert str(content["axes"]) == "realization period sample"
    np.savez(
        tmp_path / "many.npz", **content | {"axes": np.array("channel realization period sample")}
    )
    with pytest.raises(
        ValueError,
        match=r"path must hold signals with the axes 'realization period sample', got 'ch",
    ):
        nlfrf.load_record(tmp_path / "many.npz")
    np.savez(tmp_path / "newer.npz", **content | {"version": np.array(3)})
    with pytest.raises(ValueError, match=r"path must hold schema version 1 of nlfrf-record, got 3"):
        nlfrf.load_record(tmp_path / "newer.npz")


def test_runs_in_several_files_are_one_record(tmp_path):
    rng = np.random.default_rng(0)
    ms = nlfrf.multisine(fs=512, n_samples=512, f_min=1, f_max=100, n_realizations=3, rng=rng)
    for m, row in enumerate(ms.u):
        u = np.tile(row, 3 + m)
        np.savez(tmp_path / f"raw{m}.npz", u=u, y=u**3, z=u, fs=512.0)
    raw = [tmp_path / f"raw{m}.npz" for m in range(3)]
    record = nlfrf.load_record(raw)
    assert record.u.shape == (3, 3, 512)
    both = nlfrf.load_record(raw, y=["y", "z"])
    assert both[0].u is both[1].u
    runs = [nlfrf.load_record(path) for path in raw]
    same(nlfrf.join_records(runs), record)
    for m, run in enumerate(runs):
        nlfrf.save(run, tmp_path / f"run{m}.npz")
    stored = [tmp_path / f"run{m}.npz" for m in range(3)]
    same(nlfrf.load_record(stored), record)
    with pytest.raises(
        ValueError, match="path must be records that this package wrote, or none of them"
    ):
        nlfrf.load_record([raw[0], stored[1]])
    with pytest.raises(ValueError, match="path must be a file or a list of files, got none"):
        nlfrf.load_record([])
    other = nlfrf.load_record(raw[0], lines=nlfrf.signals.LineGrid(excited=ms.lines.excited[:-1]))
    with pytest.raises(
        ValueError, match=r"records must be of one experiment, with the same lines, got \[1, 3"
    ):
        nlfrf.join_records([runs[0], other])


@pytest.mark.parametrize("suffix", [".npz", ".h5", ".mat"])
def test_a_reference_comes_along(suffix, record, tmp_path):
    with_r = nlfrf.Record(u=record.u, y=record.y, r=2 * record.u, fs=record.fs, lines=record.lines)
    nlfrf.save(with_r, tmp_path / f"r{suffix}")
    same(nlfrf.load_record(tmp_path / f"r{suffix}"), with_r)
    same(nlfrf.load(tmp_path / f"r{suffix}"), with_r)


def test_what_is_asked_of_a_stored_record_is_done_or_refused(record, tmp_path):
    nlfrf.save(record, tmp_path / "r.npz")
    with pytest.raises(
        ValueError, match="resample must be left out for a record that is cut into periods already"
    ):
        nlfrf.load_record(tmp_path / "r.npz", resample=True)
    for names in ({"y": ["y", "y"]}, {"y": 5}, {"u": 3}, {"y": []}, {"r": 3}):
        with pytest.raises(ValueError, match=rf"{next(iter(names))} must name"):
            nlfrf.load_record(tmp_path / "r.npz", **names)


def test_an_output_that_is_the_input_is_told(record, tmp_path):
    np.savez(tmp_path / "m.npz", u=record.u.reshape(-1), y=record.y.reshape(-1), fs=512.0)
    with pytest.warns(nlfrf.DataWarning, match="y names the input itself, 'u': G is 1 in any case"):
        nlfrf.load_record(tmp_path / "m.npz", y="u", n_samples=512)
    with pytest.raises(ValueError, match=r"y must name different outputs, got \['y', 'y'\]"):
        nlfrf.load_record(tmp_path / "m.npz", y=["y", "y"])


def test_of_channels_with_one_name_the_one_that_is_taken_is_told(tmp_path):
    u = np.tile(nlfrf.multisine(fs=100, n_samples=100, f_min=1, f_max=30, rng=1).u[0], 3)
    table = np.stack([np.arange(u.size) / 100, u, 2 * u, 5 * u], axis=1)
    np.savetxt(tmp_path / "run.csv", table, delimiter=",", header="t [s],u,y,y", comments="")
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"has 'y' beside 'y\.4', numbered because their names are equal: y is 'y', the first",
    ):
        record = nlfrf.load_record(tmp_path / "run.csv")
    np.testing.assert_allclose(record.y, 2 * record.u)
    record = nlfrf.load_record(tmp_path / "run.csv", y="y.4")
    np.testing.assert_allclose(record.y, 5 * record.u)
