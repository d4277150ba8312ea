"""What screening finds stands where it was planted, and nothing stands in a sound record."""

from pathlib import Path

import numpy as np
import pytest
from matplotlib.figure import Figure

import nlfrf
from nlfrf import multisine
from nlfrf.records.screened import screen_streams
from tests.nlfrf.test_cli import nlfrf_command  # noqa: F401 (a fixture)

N, P, FS = 400, 5, 1000.0
MS = multisine("special-odd", fs=FS, n_samples=N, f_min=2.5, f_max=200, rng=3)
U = np.tile(MS.u[0], P)
Y = np.convolve(np.tile(U, 2), np.exp(-np.arange(60) / 8.0))[U.size : 2 * U.size]  # steady state


def screened(u, y, **given):
    """Screen one input and one output of that period."""
    return screen_streams(
        [u, y], ["u [N]", "y [m]"], n_inputs=1, fs=FS, period=given.pop("period", N), **given
    )


def found_in(streams):
    """Fault and place of each span."""
    return [(span.fault.value, span.first, span.end) for span in streams.spans]


@pytest.mark.parametrize("seed", range(12))
def test_a_sound_record_has_nothing_but_periods(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(64, 700))
    ms = multisine("special-odd", fs=FS, n_samples=n, f_min=FS / n, f_max=FS / 3, rng=rng)
    u = np.tile(ms.u[0], P)
    y = u**3 + u + 10.0 ** rng.uniform(-6, -1) * rng.standard_normal(u.size)
    found = screened(u, y, period=n)
    assert found.starts.tolist() == [n * j for j in range(P)]
    assert not found.spans
    assert not any(map(len, found.outliers))


def test_silence_and_what_fills_no_period_are_left_out():
    u, y = (np.concatenate([np.zeros(333), x, x[:90], np.zeros(120)]) for x in (U, Y))
    found = screened(u, y)
    assert found.starts.tolist() == [333 + N * j for j in range(P)]
    end = 333 + P * N
    assert found_in(found) == [
        ("silence, left out", 0, 333),
        ("no whole period, left out", end, end + 90),
        ("silence, left out", end + 90, end + 210),
    ]


def test_rows_that_a_time_column_shows_to_be_lost_are_holes():
    rows = np.delete(np.arange(U.size), [*range(500, 540), 1500])
    found = screened(U[rows], Y[rows], place=rows)
    assert found_in(found) == [
        ("samples lost or repeated", 500, 540),
        ("samples lost or repeated", 1500, 1501),
    ]
    assert [span.extent for span in found.spans] == ["40 samples", "1 sample"]
    assert np.array_equal(
        np.flatnonzero(np.isnan(found.samples[1])), np.setdiff1d(np.arange(U.size), rows)
    )
    assert found.starts.tolist() == [N * j for j in range(P)]


@pytest.mark.parametrize("lost", [1, 7, 30])
def test_samples_lost_without_a_word_are_in_the_period_that_lacks_them(lost):
    u, y = (np.delete(x, np.arange(950, 950 + lost)) for x in (U, Y))
    found = screened(u, y)
    assert found_in(found)[0] == ("samples lost or repeated", 2 * N, 3 * N)
    assert found.spans[0].extent == f"{lost} sample{'s' * (lost > 1)} lost in period 3"
    assert found.starts.tolist() == [0, N, 2 * N, 3 * N - lost]
    alone = screened(U, np.append(np.delete(Y, np.arange(950, 950 + lost)), Y[:lost]))
    assert ("samples lost or repeated", 2 * N, 3 * N) in found_in(alone)


def test_a_period_that_does_not_repeat_is_named():
    u = U.copy()
    u[N : N + 150] = np.random.default_rng(1).standard_normal(150)
    assert ("period differs from the others", N, 2 * N) in found_in(screened(u, Y))


@pytest.mark.parametrize("seed", range(20))
def test_every_span_lies_inside_a_record_that_lost_samples_at_many_places(seed):
    """Or that has another period than was found, or none: whatever is found, it can be drawn."""
    rng = np.random.default_rng(seed)
    kept = np.delete(np.arange(U.size), rng.integers(0, U.size, 12))
    u = U[kept] if seed % 2 else rng.standard_normal(U.size)
    found = screened(u, u**3, period=float(rng.uniform(60, 900)))
    n = found.samples.shape[1]
    assert all(0 <= span.first < span.end <= n for span in found.spans)
    assert np.all((found.starts >= 0) & (found.starts + round(found.period) <= n + 1))


def test_outliers_stand_at_their_samples_and_positions_are_unwrapped():
    y = Y.copy()
    y[[700, 1111]] = 60 * np.array([1, -1]) * np.abs(Y).max()
    assert screened(U, y).outliers[1].tolist() == [700, 1111]
    turning = np.linspace(0, 1800, U.size) + 20 * Y / np.abs(Y).max()
    assert np.allclose(screened(U, turning % 360).samples[1], turning)


@pytest.fixture
def drawn(nlfrf_command, monkeypatch):  # noqa: F811
    """Draw a file by the command; gives title, label and curve of each pair of axes, and what was
    said.
    """

    def run(name):
        seen = []

        def keep(figure, path, **_):
            Path(path).touch()
            for ax in figure.axes[:2]:
                seen.append((ax.get_title(), ax.get_ylabel(), ax.get_lines()[0].get_data()))

        with monkeypatch.context() as look:
            look.setattr(Figure, "savefig", keep)
            code, _, said = nlfrf_command("inspect", name, "--plot", f"{name}.svg")
        assert (code == 0) == bool(seen)
        return seen, said

    return run


def test_a_file_is_drawn_with_all_its_channels(drawn, tmp_path):
    t = np.arange(U.size) / FS
    np.savetxt(
        tmp_path / "run.csv",
        np.column_stack([t, U, Y]),
        delimiter=",",
        header="time [s],force [N],position [mm]",
        comments="",
    )
    record = nlfrf.load_record(tmp_path / "run.csv", u="force", y="position")
    nlfrf.save(record, tmp_path / "own.npz")
    for name in ("run.csv", "own.npz"):
        (title, first, force), (_, second, position) = drawn(name)[0]
        assert title == f"{P} whole periods of {N} samples"
        assert (first, second) == ("force [N]", "position [mm]")
        np.testing.assert_allclose(force, [t, U], atol=1e-9)
        np.testing.assert_allclose(position, [t, Y], atol=1e-9)
    nlfrf.save(nlfrf.identify(record), tmp_path / "bla.npz")
    assert "plot must show a record, got bla.npz: nlfrf plot draws nlfrf-bla" in drawn("bla.npz")[1]


def test_a_table_of_an_frf_is_no_record(drawn, tmp_path):
    np.savetxt(
        tmp_path / "bode.csv",
        np.column_stack([np.arange(1, 40), -np.arange(1, 40), -np.arange(1, 40)]),
        delimiter=",",
        header="Frequency (Hz),Gain (dB),Phase (deg)",
        comments="",
    )
    assert "plot must show a record" in drawn("bode.csv")[1]
