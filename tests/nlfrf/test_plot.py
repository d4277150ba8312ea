"""Pictures of records and second opinions: they show the numbers that are there, and name what is missing."""

import matplotlib
import numpy as np
import pytest

matplotlib.use("Agg")

from nlfrf import Record, identify, multisine, second_opinion
from nlfrf import plot as pictures
from tests.support.pictures import labels, notes

MS = multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
U = np.stack([MS.u[0], MS.u[0]])[None]


def test_samples_are_drawn_period_by_period(ax):
    record = Record(u=U, y=2 * U, fs=128, lines=MS.lines)
    pictures.plot_samples(record, signal="y", ax=ax)
    first, last = ax.get_lines()
    assert np.array_equal(last.get_ydata(), record.y[0, 1])
    assert first.get_xdata()[-1] == pytest.approx(127 / 128)
    assert "y: 2 periods over one another, rms 2" in ax.get_title()
    with pytest.raises(ValueError, match="signal must be one that the record has, got 'r'"):
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


def test_an_opinion_shows_both_readings(ax):
    opinion = second_opinion(Record(u=U[:, :1], y=U[:, :1] ** 3, fs=128, lines=MS.lines))
    pictures.plot_opinion(opinion, ax=ax)
    curves = {line.get_label(): line.get_ydata() for line in ax.get_lines()}
    assert curves["roughness of the FRF"] == pytest.approx(10 * np.log10(opinion.roughness))
    assert curves["odd detection lines, calibrated"] == pytest.approx(10 * np.log10(opinion.detection))
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
    assert ax.get_xlabel() == f"harmonic of 0.25 Hz; it goes on like this up to {long.lines.excited[-1]}"
