"""Pictures of records and second opinions: they show the numbers that are there, and name what is
missing.
"""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from matplotlib import pyplot as plt

from nlfrf import Record, identify, multisine, second_opinion
from nlfrf import plot as pictures
from nlfrf.plot.signals import plot_screened
from nlfrf.records.screened import screen_streams
from tests.support.pictures import labels, notes

MS = multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
U = np.stack([MS.u[0], MS.u[0]])[None]


def test_samples_are_drawn_period_by_period(ax):
    record = Record(u=U, y=2 * U, fs=128, lines=MS.lines)
    pictures.plot_samples(record, signal="y", ax=ax)
    first, last = ax.get_lines()
    assert np.array_equal(last.get_ydata(), record.y[0, 1])
    assert first.get_xdata()[-1] == pytest.approx(127 / 128)
    assert "y: 2 periods over one another; without the mean: rms 2" in ax.get_title()
    with pytest.raises(ValueError, match="signal must be one of the record, got 'r'"):
        pictures.plot_samples(record, signal="r", ax=ax)
    with pytest.raises(ValueError, match="signal must be one of 'u', 'y', 'r'"):
        pictures.plot_samples(record, signal="force", ax=ax)


def test_the_input_shows_what_stands_where_nothing_was_to_be(ax):
    clean = Record(u=U, y=U, fs=128, lines=MS.lines)
    pictures.plot_input(clean, ax=ax)
    assert labels(ax) == ["excited lines"]  # no entry without a line
    assert notes(ax) == ["odd detection lines and even detection lines: more than 120 dB lower"]
    ax.clear()
    dirty = U + 1e-2 * np.cos(2 * np.pi * 5 * np.arange(128) / 128)
    pictures.plot_input(Record(u=dirty, y=U, fs=128, lines=MS.lines), ax=ax)
    assert "odd detection lines" in labels(ax)
    odd = next(line for line in ax.get_lines() if line.get_label() == "odd detection lines")
    f, level = odd.get_data()
    assert level[f == 5][0] == pytest.approx(-40.0)
    assert ax.get_ylim()[0] < -40


def test_a_screened_record_shows_what_is_left_out_and_what_is_wrong(ax):
    u = np.concatenate([np.zeros(200), np.tile(MS.u[0], 4), np.zeros(60)])
    y = 2 * u
    y[300] = 50.0
    rows = np.delete(np.arange(u.size), 400)
    found = screen_streams(
        [u[rows], y[rows]], ["u [N]", "y [m]"], n_inputs=1, fs=128, period=128, place=rows
    )
    top, bottom = plot_screened(found, ax=ax)[:, 0]
    assert (top.get_ylabel(), bottom.get_ylabel(), bottom.get_xlabel()) == (
        "u [N]",
        "y [m]",
        "time [s]",
    )
    assert top.get_title() == "4 whole periods of 128 samples"
    assert labels(top.figure.axes[-1]) == [
        "silence, left out: 200 samples, 60 samples",
        "samples lost or repeated: 1 sample",
        "a period begins",
        f"1 outlier, the first at {300 / 128:.4g} s",
    ]
    curve = top.get_lines()[0].get_ydata()
    assert np.flatnonzero(np.isnan(curve)).tolist() == [400]
    (marked,) = (line for line in bottom.get_lines() if line.get_marker() == "o")
    assert marked.get_xydata().tolist() == [[300 / 128, 50.0]]


def test_a_record_without_clock_or_period_is_drawn_over_samples(ax):
    found = screen_streams(
        [np.random.default_rng(1).standard_normal(300)], ["u"], n_inputs=1, fs=np.nan, period=0.0
    )
    (only,) = plot_screened(found, ax=ax)[:, 0]
    assert (only.get_title(), only.get_xlabel(), only.get_xlim()) == (
        "no channel repeats",
        "sample",
        (0, 299),
    )
    with pytest.raises(ValueError, match="screened must be of type ScreenedStreams"):
        plot_screened(U)


def test_several_blas_lie_over_one_another_with_their_bounds(ax):
    """A gain, and one of the other sign: 0 dB and 20 dB, phases within one turn."""
    noise = 1e-3 * np.random.default_rng(1).standard_normal(U.shape)
    blas = [
        identify(Record(u=U, y=gain * U + noise, fs=128, lines=MS.lines)) for gain in (1.0, -10.0)
    ]
    top, bottom = pictures.plot_blas(blas, ["soft", "stiff"], ax=ax)
    for k, (decibel, degrees) in enumerate(((0, 0), (20, -180))):
        assert top.get_lines()[k].get_ydata() == pytest.approx(decibel, abs=0.1)
        assert bottom.get_lines()[k].get_ydata() == pytest.approx(degrees, abs=1)
    assert labels(bottom) == ["soft", "stiff", "95 % bound of each"]
    top, _ = pictures.plot_blas(8 * blas[:1], [f"level {k}" for k in range(8)])
    assert len({(line.get_color(), line.get_linestyle()) for line in top.get_lines()}) == 8
    plt.close(top.figure)
    with pytest.raises(ValueError, match="labels must be a list of 2, one per Bla, got"):
        pictures.plot_blas(blas, ["soft"])


def test_an_opinion_shows_both_readings(ax):
    opinion = second_opinion(Record(u=U[:, :1], y=U[:, :1] ** 3, fs=128, lines=MS.lines))
    pictures.plot_opinion(opinion, ax=ax)
    curves = {line.get_label(): line.get_ydata() for line in ax.get_lines()}
    assert curves["roughness of the FRF"] == pytest.approx(10 * np.log10(opinion.roughness))
    assert curves["odd detection lines, corrected for the grid"] == pytest.approx(
        10 * np.log10(opinion.detection)
    )
    assert ("more than 6 dB apart" in curves) == bool(opinion.disagree.any())


def test_a_system_without_a_linear_part_can_be_drawn(ax):
    bla = identify(Record(u=U, y=U**2, fs=128, lines=MS.lines))
    pictures.plot_bla(bla, ax=ax)
    assert not any("detection lines" in label for label in labels(ax))


@pytest.mark.parametrize("draw", [pictures.plot_bla, pictures.plot_levels])
def test_rounding_does_not_flatten_the_picture(ax, draw):
    # as small as rounding, which is exactly zero on some processors
    draw(identify(Record(u=U, y=U + 0.1 * U**3 + 1e-14 * U**2, fs=128, lines=MS.lines)), ax=ax)
    low, high = ax.get_ylim()
    assert 160 <= high - low < 180
    (said,) = notes(ax)
    assert said.startswith("even")
    assert said.endswith("more than 160 dB lower")
    assert "odd" not in said
    assert not [label for label in labels(ax) if label.startswith("even")]


def test_detection_lines_of_both_kinds_are_seen_under_the_excited_ones(ax):
    pictures.plot_spectrum(MS, ax=ax)
    excited, odd, even = (line.get_data() for line in ax.get_lines())
    assert np.array_equal(excited[0], MS.lines.excited)
    both = np.concatenate([MS.lines.odd, MS.lines.even])
    assert np.array_equal(np.sort(np.concatenate([odd[0], even[0]])), np.sort(both))
    assert excited[1].min() > odd[1].max() == even[1].max() == 0
    assert labels(ax)[1:] == ["odd detection, nothing played", "even detection, nothing played"]


def test_of_a_long_multisine_the_first_lines_are_seen_one_by_one(ax):
    """Three stripes over the whole band said nothing."""
    long = multisine(fs=4096, n_samples=16384, f_min=1.25, f_max=150, rng=1)
    pictures.plot_spectrum(long, ax=ax)
    start, end = ax.get_xlim()
    assert end - start <= 51
    assert all(line.get_xdata().size < 30 for line in ax.get_lines())
    assert (
        ax.get_xlabel()
        == f"harmonic of 0.25 Hz; it continues like this up to {long.lines.excited[-1]}"
    )


# A bound over 100 %: no lower edge, which a logarithmic axis cannot show


@pytest.fixture(scope="module")
def drowned():
    """A BLA whose bound exceeds it at both ends, and by far."""
    ms = multisine(fs=512, n_samples=1024, f_min=1, f_max=200, rng=3)
    G = 1 / (1 + (1j * ms.f / 30) ** 2 + 0.1j * ms.f / 30)
    u = np.repeat(ms.u[:, None], 3, axis=1)
    U = np.fft.rfft(ms.u[0])
    U[ms.lines.excited] *= G
    y = np.repeat(np.fft.irfft(U, ms.n_samples)[None, None], 3, axis=1)
    y = y + 0.25 * np.std(y) * np.random.default_rng(0).standard_normal(y.shape)
    return identify(Record(u=u, y=y, fs=512, lines=ms.lines))


def edges_of(ax):
    """(f, lowest) of every band that is drawn."""
    return [
        path.vertices
        for band in ax.collections
        for path in band.get_paths()
        if len(path.vertices) > 2
    ]


@pytest.mark.parametrize("picture", [pictures.plot_bla, pictures.plot_bode])
def test_a_bound_over_100_percent_is_hatched_named_and_no_curtain(picture, drowned):
    over = drowned.bound() > np.abs(drowned.G)
    assert 0.2 < over.mean() < 0.9
    made = picture(drowned)
    top, legend = (made, made) if not isinstance(made, tuple) else made
    assert any(
        "over 100 %: G may be 0" in text.get_text() for text in legend.get_legend().get_texts()
    )
    assert any(band.get_hatch() for band in top.collections)
    size = 20 * np.log10(np.abs(drowned.G))
    for vertices in edges_of(top):
        deepest = np.interp(vertices[:, 0], drowned.f, size) - 20
        assert np.all(vertices[:, 1] >= deepest - 1e-9)
    # the axis follows what is drawn as curves and points
    drawn = np.concatenate([np.asarray(line.get_ydata(), float) for line in top.get_lines()])
    drawn = drawn[np.isfinite(drawn)]
    low, high = top.get_ylim()
    free = max(6, 0.08 * np.ptp(drawn))
    assert drawn.min() - free - 1e-9 <= low <= drawn.min()
    assert drawn.max() <= high <= drawn.max() + free + 1e-9
    plt.close("all")


def test_a_bound_below_100_percent_has_no_word_of_it():
    bla = identify(Record(u=U, y=U + 0.05 * U**3, fs=128, lines=MS.lines))
    assert np.all(bla.bound() < np.abs(bla.G))
    ax = pictures.plot_bla(bla)
    assert not any("100 %" in text.get_text() for text in ax.get_legend().get_texts())
    assert not any(band.get_hatch() for band in ax.collections)
    plt.close("all")


def test_a_bode_picture_takes_the_two_axes_of_subplots_and_other_pictures_refuse_them():
    bla = identify(Record(u=U, y=U + 0.1 * U**3, fs=128, lines=MS.lines))
    figure, both = plt.subplots(2, 1)
    try:
        assert pictures.plot_bode(bla, ax=both) is not None
        assert figure.axes == list(both)  # drawn where it was asked for
        assert all(one.get_lines() for one in both)
        assert pictures.plot_bla(bla, ax=np.array([[both[0]]])) is both[0]
        with pytest.raises(
            ValueError,
            match=r"ax must be one Axes, got an array of 2; give one of them, such as ax.flat",
        ):
            pictures.plot_bla(bla, ax=both)
        with pytest.raises(
            ValueError, match=r"ax must be one Axes, or 2 of them, got an array of 3"
        ):
            pictures.plot_bode(bla, ax=[*both, both[0]])
    finally:
        plt.close(figure)


def test_the_phase_has_its_bound(ax):
    bla = identify(Record(u=U, y=2 * U + 0.01 * U**3, fs=128, lines=MS.lines))
    pictures.plot_phase(bla, ax=ax)
    assert ax.get_lines()[0].get_ydata() == pytest.approx(np.degrees(np.angle(bla.G)))
    top = ax.collections[0].get_paths()[0].vertices[:, 1].max()
    assert top == pytest.approx(
        np.degrees(np.max(np.angle(bla.G) + np.arcsin(bla.bound(0.95) / np.abs(bla.G))))
    )
