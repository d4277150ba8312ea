"""Records as they lie on disks: their direction, their clocks and slow sensors, their rows."""

import shlex

import numpy as np
import pytest

import nlfrf
from benchmarks.records_as_found import (
    FAULTY_CLOCKS,
    FS,
    SLOW_SENSORS,
    SOUND_CLOCKS,
    SOUND_SENSORS,
    is_called_slow,
    tried_clock,
    tried_direction,
    write_table,
)
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)
from tests.support.printed import unwrapped

N = 1000
MS = nlfrf.multisine(fs=FS, n_samples=N, f_min=2, f_max=100, rng=1)
U = np.tile(MS.u[0], 3)
T = np.arange(U.size) / FS


def through_mode(u, damping=0.05, f_0=30.0):
    """The periodic response of a resonance with a square and a cube behind it."""
    f = np.fft.rfftfreq(u.size, 1 / FS)
    y = np.fft.irfft(np.fft.rfft(u) / (1 - (f / f_0) ** 2 + 2j * damping * f / f_0), u.size)
    return y + 0.01 * y**3 / np.var(y) + 0.01 * y**2 / np.std(y)


Y = through_mode(U)


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("number", range(40))
def test_no_proposal_is_wrong_without_a_word(number, tmp_path):
    assert tried_direction(np.random.default_rng([11, number]), tmp_path)[1] != "wrong"


@pytest.mark.parametrize("kind", SOUND_CLOCKS)
def test_a_sound_clock_is_no_fault(kind, tmp_path):
    found = [
        tried_clock(kind, np.random.default_rng([12, k]), tmp_path, resample=False)
        for k in range(2)
    ]
    assert all(one.startswith("right") for one in found)


@pytest.mark.parametrize("kind", FAULTY_CLOCKS)
def test_a_mean_step_is_no_clock(kind, tmp_path):
    assert tried_clock(kind, np.random.default_rng([13, 1]), tmp_path, resample=False) == "refused"
    assert tried_clock(kind, np.random.default_rng([13, 1]), tmp_path, resample=True) in (
        "right, warned",
        "refused",
    )


def test_a_slow_sensor_is_told_from_what_repeats_for_other_reasons():
    for kind in SLOW_SENSORS:
        assert sum(is_called_slow(kind, np.random.default_rng([14, k])) for k in range(5)) >= 4, (
            kind
        )
    for kind in SOUND_SENSORS:
        assert not any(is_called_slow(kind, np.random.default_rng([15, k])) for k in range(5)), kind


# ---- Direction


@pytest.mark.parametrize("names", [("a", "b"), ("b", "a"), ("force", "position")])
def test_one_period_of_our_own_multisine_is_one_period(names, nlfrf_command, tmp_path):  # noqa: F811
    """Behind a resonance y repeats near half a period, with two minus signs; it was proposed as the
    input.
    """
    columns = dict(zip(names, (U[:N], Y[:N]), strict=True))
    write_table(
        tmp_path / "run.csv",
        ["time", *sorted(columns)],
        [T[:N], *(columns[name] for name in sorted(columns))],
    )
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert (found.u, found.y, found.period) == (*names, N)
    assert f"--period {N}" in found.command
    assert "1 period; 25 lines" in found.lines
    assert nlfrf_command(*shlex.split(found.command)[1:])[0] == 0
    code, _, err = nlfrf_command(
        "identify", "run.csv", "--input", names[0], "--output", names[1], "-o", "b.npz"
    )
    assert code == 2
    assert f"give --period {N} if the record is one whole period" in err
    assert "--resample" not in err


def test_a_minus_after_half_a_period_is_no_repetition():
    for x in (U[:N], through_mode(U[:N], damping=0.02)):
        with pytest.raises(
            ValueError,
            match=f"must repeat at least once within its {N} samples.*give n_samples={N}",
        ):
            nlfrf.record_from_samples(x, x, fs=FS)
    assert nlfrf.record_from_samples(U, U, fs=FS).n_samples == N
    t = np.arange(1000)
    decays = np.exp(-t / 200) * np.sin(t / 3)
    with pytest.raises(ValueError, match="u must repeat at least once"):
        nlfrf.record_from_samples(decays, decays, fs=FS)


def test_names_that_lines_contradict_are_asked_for(tmp_path):
    write_table(tmp_path / "run.csv", ["time", "position", "force"], [T, U, Y])
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert (found.u, found.y, found.period) == ("", "", N)
    assert "by its name force is the input, but the multisine is found in position" in found.doubt
    assert "--input INPUT --output OUTPUT" in found.command
    assert "HERTZ" not in found.command
    assert f"guess: none, {found.doubt}" in unwrapped(found)
    write_table(
        tmp_path / "linear.csv", ["time", "a", "b"], [T, U + np.roll(U, 7), U + np.roll(U, 9)]
    )
    assert (
        "neither names nor spectra show which of a and b was played"
        in nlfrf.inspect_file(tmp_path / "linear.csv").doubt
    )


def test_an_output_with_empty_detection_lines_is_warned_of():
    noise = 1e-4 * np.random.default_rng(1).standard_normal((2, U.size))
    shaped = U + 0.5 * np.roll(U, 3)  # uneven, so that its level says nothing
    with pytest.warns(
        nlfrf.DataWarning, match=r"found in y, its detection lines are empty, .* dB below .*swapped"
    ):
        nlfrf.record_from_samples(
            through_mode(shaped) + noise[0], shaped + noise[1], fs=FS, n_samples=N
        )


# ---- Clocks and rows


def test_where_a_clock_varies_is_said(tmp_path):
    t, u, y = (np.insert(x, [1200, 2000], x[[1200, 2000]]) for x in (T, U, Y))
    write_table(tmp_path / "run.csv", ["time", "force", "position"], [t, u, y])
    said = r"vary from 0 to 0.001 s, usually 0.001 s: they are unequal from 1.2\d*, 2\S* s on"
    with pytest.raises(
        ValueError,
        match=rf"the time steps must be equal, but 'run.csv'.*{said}; resample=True interpolates",
    ):
        nlfrf.load_record(tmp_path / "run.csv", u="force", y="position")
    with pytest.warns(
        nlfrf.DataWarning, match=rf"{said}; its rows were interpolated to equal steps at 1000 Hz"
    ):
        record = nlfrf.load_record(tmp_path / "run.csv", u="force", y="position", resample=True)
    np.testing.assert_allclose(record.u[0], U.reshape(3, N), atol=1e-6)
    with (
        pytest.warns(nlfrf.DataWarning, match="the given fs is used"),
        pytest.raises(ValueError, match="n_samples"),
    ):
        nlfrf.load_record(tmp_path / "run.csv", u="force", y="position", fs=FS)
    found = nlfrf.inspect_file(tmp_path / "run.csv")
    assert "clock: the steps of the time column vary" in str(found)
    assert found.command.endswith("--resample -o run-bla.npz")


@pytest.mark.parametrize(("u", "y"), [("u", "y"), (["u", "v"], ["y"])])
def test_rows_without_a_channel_do_not_hide_the_clock(u, y, tmp_path):
    """a0402523: "the period of u seems to be 999.68 samples"; a shorter y ended in an
    UnboundLocalError.
    """
    kept = np.arange(U.size) != 1700
    late = np.where(np.arange(U.size) < 5, np.nan, Y)
    v = np.roll(U, N // 2) + np.cos(2 * np.pi * 77 * T)
    np.savez(tmp_path / "lost.npz", time_s=T[kept], u=U[kept], v=v[kept], y=late[kept])
    with pytest.warns(nlfrf.DataWarning, match="one sample lost; period 1 is whole"):
        assert np.shape(nlfrf.load_record(tmp_path / "lost.npz", u=u, y=y, n_samples=N).y)[-2:] == (
            1,
            N,
        )
    np.savez(tmp_path / "short.npz", time_s=np.where(T < 1.5, T, 2 * T - 1.5), u=U, v=v, y=Y[:-9])
    with pytest.raises(
        ValueError, match=r"y must (be as long as|have the experiments and samples of) u"
    ):
        nlfrf.load_record(tmp_path / "short.npz", u=u, y=y, resample=True)


def test_two_rates_are_no_lost_rows(tmp_path):
    def lost(t):
        np.savez(tmp_path / "run.npz", time_s=t, u=U, y=Y)
        return nlfrf.inspect_file(tmp_path / "run.npz").lost

    two_rates = np.cumsum(np.r_[np.full(2000, 1e-3), np.full(1000, 2e-3)])
    assert lost(two_rates) == (
        "the steps of the time column vary from 0.001 to 0.002 s, usually 0.001 s: they are unequal"
        " from 2.002 s on"
    )
    assert lost(T) == ""
    assert lost(np.floor(T)) == ""  # printed in whole seconds


def test_moments_are_clocks_by_their_type(tmp_path):
    pd = pytest.importorskip("pandas")
    pytest.importorskip("pyarrow")
    frame = pd.DataFrame(
        {"u": U, "y": Y}, index=pd.date_range("2026-01-01", periods=U.size, freq="1ms")
    )
    frame.to_parquet(tmp_path / "index.parquet")
    frame.rename_axis("when").reset_index().to_feather(tmp_path / "when.feather")
    frame.to_csv(tmp_path / "frame.csv")
    np.savez(tmp_path / "array.npz", u=U, y=Y, stamp=frame.index.to_numpy())
    for name in ("index.parquet", "when.feather", "frame.csv", "array.npz"):
        assert nlfrf.load_record(tmp_path / name).fs == FS, name


@pytest.mark.parametrize(
    ("late", "said"), [(0.0, "were merged$"), (0.5, "0.5 samples later than u, and G includes")]
)
def test_channels_that_take_turns_are_merged(late, said, tmp_path):
    rows = [
        f"{t:.6f},{u:.9g},\n{t + late / FS:.6f},,{y:.9g}\n" for t, u, y in zip(T, U, Y, strict=True)
    ]
    (tmp_path / "run.csv").write_text("time,u,y\n" + "".join(rows))
    with pytest.warns(nlfrf.DataWarning, match=said):
        record = nlfrf.load_record(tmp_path / "run.csv")
    assert record.fs == FS
    np.testing.assert_allclose(record.y.ravel(), Y, atol=1e-6)
    assert nlfrf.inspect_file(tmp_path / "run.csv").period == N


def test_realisations_are_cut_out_of_a_stream(nlfrf_command, tmp_path):  # noqa: F811
    two = nlfrf.multisine(fs=FS, n_samples=N, f_min=2, f_max=100, n_realizations=2, rng=2).u
    u = np.concatenate(
        [np.zeros(500), np.tile(two[0], 3), np.zeros(700), np.tile(two[1], 3), np.zeros(300)]
    )
    write_table(tmp_path / "run.csv", ["time", "u", "y"], [7 + np.arange(u.size) / FS, u, 0.5 * u])
    record = nlfrf.load_record(tmp_path / "run.csv", start=[1.5, 5.2], stop=[3.5, 7.2])
    assert record.u.shape == (2, 2, N)
    np.testing.assert_allclose(record.u[:, 0], two, atol=1e-6)
    assert nlfrf.load_record(tmp_path / "run.csv", start=0.5, stop=3.5).n_periods == 3
    windows = "--start 1.5 --stop 3.5 --start 5.2 --stop 7.2"
    assert nlfrf_command(*f"identify run.csv {windows} -o bla.npz".split())[0] == 0
    assert nlfrf.load(tmp_path / "bla.npz").experiment.n_realizations == 2
    with pytest.raises(ValueError, match="start must have one stop for each, got 2 and 1"):
        nlfrf.load_record(tmp_path / "run.csv", start=[1, 2], stop=3)
    with pytest.raises(
        ValueError,
        match=r"start and stop must be inside 'run.csv', from 0 to 7.499 s, got 90 to inf s",
    ):
        nlfrf.load_record(tmp_path / "run.csv", start=90.0)
    nlfrf.save(record, tmp_path / "r.npz")
    with pytest.raises(
        ValueError, match="start and stop must be left out for a record that was saved"
    ):
        nlfrf.load_record(tmp_path / "r.npz", start=1.0)


def test_a_matrix_of_periods_is_a_stream(tmp_path):
    columns = {"u": U.reshape(3, N), "y": Y.reshape(3, N)}
    for name, arrays in (("rows", columns), ("columns", {key: x.T for key, x in columns.items()})):
        np.savez(tmp_path / f"{name}.npz", **arrays, t=T[:N])
        record = nlfrf.load_record(tmp_path / f"{name}.npz")
        np.testing.assert_array_equal(record.u[0], columns["u"])
        assert record.fs == FS
        assert (
            nlfrf.inspect_file(tmp_path / f"{name}.npz").u,
            nlfrf.inspect_file(tmp_path / f"{name}.npz").y,
        ) == (
            "u",
            "y",
        )
    record = nlfrf.record_from_samples(columns["u"].T, columns["y"].T, fs=FS)
    np.testing.assert_array_equal(record.y[0], columns["y"])
    np.savez(
        tmp_path / "two.npz", u=np.random.default_rng(1).standard_normal((N, 2)), y=Y[:N], fs=FS
    )
    with pytest.raises(
        ValueError, match=r"u must name one stream of samples, .* its columns are u.1, u.2"
    ):
        nlfrf.load_record(tmp_path / "two.npz")


# ---- Headers


def test_names_stand_above_their_columns(tmp_path):
    def names(head, end=""):
        rows = [
            f"{1000 * t:g};{u:.6g};{y:.6g}{end}\n" for t, u, y in zip(T[:50], U, Y, strict=False)
        ]
        (tmp_path / "run.csv").write_text(head + "".join(rows))
        return [channel.name for channel in nlfrf.inspect_file(tmp_path / "run.csv").channels]

    assert names("ms_today;current_motor;erpm;\n", ";") == ["ms_today", "current_motor", "erpm"]
    assert names("ms_today;current_motor;erpm;event;\n", ";;") == [
        "ms_today",
        "current_motor",
        "erpm",
    ]
    assert names("time [s];u [N];y [m]\n# operator;date;rig\n") == ["time [s]", "u [N]", "y [m]"]
    assert names("# operator;date;rig\ntime [s];u [N];y [m]\n") == ["time [s]", "u [N]", "y [m]"]
    assert names("# time; u; y\n# s; N; mm\n") == ["time", "u", "y"]


def test_a_transposed_table_is_called_so(tmp_path):
    (tmp_path / "run.csv").write_text(
        "".join(",".join(f"{x:.6g}" for x in row) + "\n" for row in (T, U, Y))
    )
    with pytest.raises(ValueError, match=r"it has 3 rows of 3000 columns: transpose it") as refusal:
        nlfrf.inspect_file(tmp_path / "run.csv")
    assert len(str(refusal.value)) < 250
