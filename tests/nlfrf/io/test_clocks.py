"""What a file says of its clock is understood, or asked for: never taken for something else."""

import numpy as np
import pytest

import nlfrf

FS, N, P = 1000.0, 500, 6
U = np.tile(nlfrf.multisine(fs=FS, n_samples=N, f_min=2, f_max=200, rng=1).u[0], P)
Y = np.convolve(U, [0.5, 0.3, 0.1])[: U.size]
T = np.arange(U.size) / FS


def saved(tmp_path, **arrays):
    np.savez(tmp_path / "run.npz", u=U, y=Y, **arrays)
    return tmp_path / "run.npz"


def clock_above(line, folder, delimiter=",", decimal="."):
    """The sampling frequency that is found in a line above a table; nan without one."""
    rows = np.random.default_rng(0).standard_normal((400, 2))
    table = [delimiter.join(f"{x:.6f}".replace(".", decimal) for x in row) for row in rows]
    (folder / "run.csv").write_text(
        "\n".join([line, delimiter.join("uy"), *table]), encoding="utf-8"
    )
    return nlfrf.inspect_file(folder / "run.csv").channels[0].fs


def test_rates_in_any_unit_above_a_table(tmp_path):
    for number, prefix in ((2.5, "k"), (2, "M"), (1.25, "G"), (800, "")):
        scale = {"": 1, "k": 1e3, "M": 1e6, "G": 1e9}[prefix]
        for unit in ("Hz", "S/s", "Sa/s", "samples/s", "sps"):
            for line in (
                f"Sample rate: {number} {prefix}{unit}",
                f"Sampling Rate,{number}{prefix}{unit},",
            ):
                assert clock_above(line, tmp_path) == number * scale, line
        line = f"Sampling frequency [{prefix}Hz]: {number}"
        assert clock_above(line, tmp_path) == number * scale
    for unit, second in (
        ("ns", 1e-9),
        ("usec", 1e-6),
        ("µs", 1e-6),
        ("milliseconds", 1e-3),
        ("s", 1),
        ("min", 60),
    ):
        assert clock_above(f"Sample interval: 20 {unit}", tmp_path) == pytest.approx(
            1 / (20 * second), rel=1e-11
        )


def test_numbers_of_a_clock_as_people_write_them(tmp_path):
    for line, fs in {
        "Sample rate: 1 000 Hz": 1000,
        "Sample rate: 1'000 Hz": 1000,
        "fs = 1e3": 1000,
        "Sampling rate = 10kHz, Range = 5V": 10_000,
        "Sample rate: 2000  # nominal": 2000,
        "Sample rate [Hz],1000,1000": 1000,
    }.items():
        assert clock_above(line, tmp_path) == fs, line
    for line, fs in {
        "Abtastrate: 2,5 kHz": 2500,
        "Abtastrate: 1.000,0 Hz": 1000,
        "dt = 1,25 ms": 800,
    }.items():
        assert clock_above(line, tmp_path, ";", ",") == pytest.approx(fs), line
    for line in (
        "Sample rate: 51,200 Hz",
        "Sample rate [Hz],1000,2000",
        "Load cell, FS: 100 N",
        "samplerate=-5 Hz",
    ):
        assert np.isnan(clock_above(line, tmp_path)), (
            line
        )  # may be read in two ways, or as no clock


def test_units_of_clocks_that_are_variables(tmp_path):
    import h5py

    def written(name, number, unit):
        with h5py.File(tmp_path / "run.h5", "w") as file:
            file["u"], file["y"], file[name] = U, Y, number
            file[name].attrs["unit"] = unit
        return nlfrf.load_record(tmp_path / "run.h5").fs

    assert written("fs", 1.0, "kHz") == FS
    assert written("dt", 1.0, "ms") == FS
    with pytest.raises(ValueError, match="fs must be given"):
        written("dt", 1.0, "ticks")


def test_clocks_that_contradict_each_other(tmp_path):
    with pytest.raises(
        ValueError, match=r"fs must be given: 'run.npz' has 100 Hz by 'Ts' and 1000 Hz by 'fs'"
    ):
        nlfrf.load_record(saved(tmp_path, fs=FS, Ts=0.01))
    assert nlfrf.load_record(saved(tmp_path, fs=FS, Ts=1e-3, t=T)).fs == FS
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"fs is 500 Hz by 'fs' of 'run.npz' and 1000 Hz by the time channel 't'",
    ):
        assert nlfrf.load_record(saved(tmp_path, fs=500.0, t=T)).fs == 500
    assert nlfrf.load_record(saved(tmp_path, fs=FS, Ts=0.01), fs=100).fs == 100


def test_a_time_channel_of_other_samples_or_that_runs_backwards_is_no_clock(tmp_path):
    with pytest.raises(
        ValueError,
        match=r"fs must be given: the time channel 't' has 6000 samples, and 'y' has 3000",
    ):
        nlfrf.load_record(saved(tmp_path, t=np.arange(2 * U.size) / 2000))
    assert nlfrf.load_record(saved(tmp_path, time=np.arange(2 * U.size) / 2000, t=T)).fs == FS
    with pytest.raises(
        ValueError, match=r"time channel 't' runs backwards at sample 1500, from 1.499 to 0"
    ):
        nlfrf.load_record(saved(tmp_path, t=np.r_[T[:1500], T[:1500]]))
    with pytest.raises(
        ValueError, match=r"time channel 't' runs backwards at sample 2, from 2.998 to 2.997"
    ):
        nlfrf.load_record(saved(tmp_path, t=T[::-1]))
    rng = np.random.default_rng(0)
    for quantity in (
        20 + 0.1 * U,
        20 + 1e-5 * np.arange(U.size) + 1e-3 * rng.standard_normal(U.size),
    ):
        with pytest.raises(
            ValueError, match=r"fs must be given: the time channel 'T' runs backwards"
        ):
            nlfrf.load_record(saved(tmp_path, T=quantity))
        assert nlfrf.load_record(saved(tmp_path, T=quantity, t=T)).fs == FS
    for start in (45_000, 739_000):
        with pytest.raises(ValueError, match=r"Hz if these are seconds, .* Hz if they are days"):
            nlfrf.load_record(saved(tmp_path, t=start + T / 86400))


def test_each_run_of_a_file_has_the_clock_beside_it(tmp_path):
    runs = {
        f"{run}.{name}": held
        for run, fs in (("a", 1e3), ("b", 2e3))
        for name, held in (("time", np.arange(U.size) / fs), ("u", U), ("y", Y))
    }
    np.savez(tmp_path / "run.npz", **runs)
    for run, fs in (("a", 1e3), ("b", 2e3)):
        assert nlfrf.load_record(tmp_path / "run.npz", u=f"{run}.u", y=f"{run}.y").fs == fs
    with pytest.raises(ValueError, match=r"u must name a signal of 'run.npz', one of .*; got 'x'"):
        nlfrf.load_record(tmp_path / "run.npz", u="x", y="a.y")


# A step without a unit


def readings(step):
    """The frequencies that a step may stand for, as messages list them."""
    return (
        f"{1 / step:g} Hz if these are seconds, {1e3 / step:g} Hz if they are milliseconds and "
        f"{1e6 / step:g} Hz if they are microseconds"
    ).replace("+", ".")


def test_a_sampling_time_below_a_second_without_a_unit_is_doubtful(tmp_path):
    for clock in (
        {"Ts": 0.02},
        {"dt": 0.02},
        {"SampleTime": 0.02},
        {"Sampling_Interval": np.full(U.size, 0.02)},
    ):
        with pytest.warns(
            nlfrf.DataWarning,
            match=rf"names no unit and is 0.02: {readings(0.02)}; seconds are taken",
        ):
            assert nlfrf.load_record(saved(tmp_path, **clock)).fs == 50
        assert (
            nlfrf.load_record(saved(tmp_path, **clock), fs=4000).fs == 4000
        )  # what was given is not held against it
    with pytest.warns(
        nlfrf.DataWarning,
        match=rf"time channel 't' names no unit and steps by 0.25: {readings(0.25)}",
    ):
        assert nlfrf.load_record(saved(tmp_path, t=250 * T)).fs == 4
    with pytest.warns(nlfrf.DataWarning, match="'Ts' names no unit and is 0.02"):
        assert nlfrf.load_record(saved(tmp_path, Ts=0.02, t=20 * T)).fs == 50  # neither has a unit
    for ts in (0.05, 0.25, 1.0, 125.0):  # which a drive may well have in milliseconds
        with pytest.raises(
            ValueError,
            match=rf"fs must be given: the sampling time 'Ts' names no unit and is {ts:g}: ",
        ):
            nlfrf.load_record(saved(tmp_path, Ts=ts))
        assert nlfrf.load_record(saved(tmp_path, Ts=ts), fs=8000).fs == 8000


def test_a_sampling_time_is_sure_by_its_unit_its_size_or_another_clock(tmp_path):
    import h5py

    assert nlfrf.load_record(saved(tmp_path, Ts=1e-3)).fs == FS
    assert nlfrf.load_record(saved(tmp_path, Ts_ms=0.25)).fs == 4000
    assert nlfrf.load_record(saved(tmp_path, Ts_s=0.25)).fs == 4
    for fs in (4.0, 4000.0, 4e6):  # by whichever unit, the two agree
        assert nlfrf.load_record(saved(tmp_path, Ts=0.25, fs=fs)).fs == fs
        assert nlfrf.load_record(saved(tmp_path, Ts=0.25, time_s=np.arange(U.size) / fs)).fs == fs
    assert (
        nlfrf.load_record(saved(tmp_path, Ts=125.0, time_us=125.0 * np.arange(U.size))).fs == 8000
    )
    with pytest.raises(
        ValueError, match=r"fs must be given: 'run.npz' has 4 Hz by 'Ts' and 500 Hz by 'fs'"
    ):
        nlfrf.load_record(saved(tmp_path, Ts=0.25, fs=500.0))
    with pytest.warns(
        nlfrf.DataWarning,
        match=r"fs is 4 Hz by 'Ts' of 'run.npz' and 1000 Hz by the time channel 't'",
    ):
        assert nlfrf.load_record(saved(tmp_path, Ts=0.25, t=T)).fs == 4
    with h5py.File(tmp_path / "run.h5", "w") as file:
        file["u"], file["y"], file["dt"] = U, Y, 0.25
        file["dt"].attrs["unit"] = "ms"
    assert nlfrf.load_record(tmp_path / "run.h5").fs == 4000


def test_a_time_in_microseconds_without_a_unit_names_that_reading(tmp_path):
    with pytest.raises(
        ValueError, match=r"steps by 1000: 0.001 Hz .* 1 Hz .* and 1000 Hz if they are microseconds"
    ):
        nlfrf.load_record(saved(tmp_path, timestamp=9e8 + 1e6 * T))


# Units that a file states, and those in a name


def test_the_unit_that_a_file_states_wins_over_brackets_in_a_name(tmp_path):
    import h5py

    rows = np.column_stack([1e3 * T, U, Y])
    np.savetxt(
        tmp_path / "a.csv",
        rows,
        delimiter=",",
        header="time [s],u [ai0],y [mm]\nms,N,mm",
        comments="",
    )
    with h5py.File(tmp_path / "a.h5", "w") as file:
        for name, held, unit in (
            ("time [s]", 1e3 * T, "ms"),
            ("u [ai0]", U, "N"),
            ("y [mm]", Y, "mm"),
        ):
            file[name] = held
            file[name].attrs["unit"] = unit
    for suffix in (".csv", ".h5"):
        record = nlfrf.load_record(tmp_path / f"a{suffix}")
        assert (record.u_name, record.u_unit, record.y_unit) == ("u [ai0]", "N", "mm")
        assert record.fs == FS
    np.savetxt(tmp_path / "b.csv", rows, delimiter=",", header="time [ms],u [N],y [g]", comments="")
    record = nlfrf.load_record(tmp_path / "b.csv")
    assert (record.u_unit, record.y_unit, record.fs) == ("N", "g", FS)


def test_moments_are_in_seconds_whatever_the_name_of_their_column_says(tmp_path):
    import pyarrow as pa
    from pyarrow import parquet

    moments = np.datetime64("2026-11-22T10:00", "ns") + (1e9 * T).astype("timedelta64[ns]")
    parquet.write_table(pa.table({"time_ms": moments, "u": U, "y": Y}), tmp_path / "run.parquet")
    assert nlfrf.load_record(tmp_path / "run.parquet").fs == FS


def test_a_sampling_time_in_an_attribute_without_a_unit_is_doubtful(tmp_path):
    import h5py

    def saved_with(**attributes):
        with h5py.File(tmp_path / "run.h5", "w") as file:
            for name, held in (("u", U), ("y", Y)):
                file[name] = held
                file[name].attrs.update(attributes)
        return tmp_path / "run.h5"

    said = rf"the sampling time of 'u' names no unit and is 0.02: {readings(0.02)}"
    with pytest.warns(nlfrf.DataWarning, match=said):
        assert nlfrf.load_record(saved_with(dt=0.02)).fs == 50
    with pytest.raises(ValueError, match=r"fs must be given: the sampling time of 'u' .* is 0.25"):
        nlfrf.load_record(saved_with(dt=0.25))
    assert nlfrf.load_record(saved_with(dt=0.25), fs=4000).fs == 4000
    assert nlfrf.load_record(saved_with(dt=1e-3)).fs == FS
    assert nlfrf.load_record(saved_with(fs=4.0)).fs == 4
    assert nlfrf.load_record(saved_with(wf_increment=0.25)).fs == 4  # which counts in seconds


# Units in a variable or an attribute beside the clock, and two rates above a table


@pytest.mark.parametrize(
    "clock",
    [
        {"fs": 1.0, "fs_unit": "kHz"},
        {"Ts": 1e-3 / 60, "TimeUnit": "minutes"},
        {"dt": 1.0, "dt_unit": "ms"},
        {"sample_rate": 6e4, "sample_rate_unit": "1/min"},
        {"Ts": 1000.0, "time_unit": "us"},
    ],
)
def test_a_unit_beside_a_clock(clock, tmp_path):
    import h5py
    from scipy.io import savemat

    assert nlfrf.load_record(saved(tmp_path, **clock)).fs == pytest.approx(FS)
    savemat(tmp_path / "run.mat", {"z": {"u": U, "y": Y, **clock}})
    assert nlfrf.load_record(tmp_path / "run.mat", u="z.u", y="z.y").fs == pytest.approx(FS)
    for where in ("file", "datasets", "variables"):
        with h5py.File(tmp_path / "run.h5", "w") as file:
            file["u"], file["y"] = U, Y
            for node in {"file": [file], "datasets": [file["u"], file["y"]], "variables": []}[
                where
            ]:
                node.attrs.update(clock)
            for name, held in clock.items() if where == "variables" else ():
                file[name] = held
        assert nlfrf.load_record(tmp_path / "run.h5").fs == pytest.approx(FS)


def test_a_unit_beside_a_clock_that_is_not_known_is_asked_for(tmp_path):
    for clock in (
        {"fs": 1.0, "fs_unit": "mHz"},
        {"Ts": 1.0, "TimeUnit": "jiffies"},
        {"t": T, "t_unit": "ticks"},
    ):
        with pytest.raises(ValueError, match="fs must be given"):
            nlfrf.load_record(saved(tmp_path, **clock))


def test_two_rates_above_a_table(tmp_path):
    rows = "".join(f"{a:.9g},{b:.9g}\n" for a, b in zip(U, Y, strict=True))

    def load(*lines):
        (tmp_path / "run.csv").write_text("".join(f"# {line}\n" for line in lines) + "u,y\n" + rows)
        return nlfrf.load_record(tmp_path / "run.csv").fs

    assert load("ADC sample rate: 10 kHz", "Output sample rate: 1 kHz") == FS
    assert load("Logged at sample rate 1 kHz", "Control sample rate: 8 kHz") == FS
    assert load("Sample rate: 1 kHz", "Sample interval: 1 ms") == FS
    with pytest.warns(
        nlfrf.DataWarning, match="fs is taken as 1000 Hz, the rate above the table over"
    ):
        assert load("Sample rate: 10 kHz", "Decimation: 10") == FS
    with pytest.raises(
        ValueError,
        match=r"fs must be given: 'run.csv' has 1000 Hz by 'line 2.sample rate' and 10000 Hz",
    ):
        load("Sample rate: 10 kHz", "Sampling rate: 1 kHz")


def test_a_node_of_a_circuit_is_no_unit(tmp_path):
    rows = "".join(f"{t:.4f},{a:.9g},{b:.9g}\n" for t, a, b in zip(T, U, Y, strict=True))
    for names, units in (
        ("V(in),V(out)", ("", "")),
        ("I(R1),speed(ref)", ("", "")),
        ("U(V),I(mA)", ("V", "mA")),
    ):
        (tmp_path / "run.csv").write_text(f"time,{names}\n{rows}")
        channels = nlfrf.inspect_file(tmp_path / "run.csv").channels[1:]
        assert tuple(one.unit for one in channels) == units
