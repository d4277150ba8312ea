"""The 95 % bound where it once did not hold: a seeded part of `python -m benchmarks.coverage
--hard`.
"""

import numpy as np
import pytest

from benchmarks.coverage import frfs, measure_hard, subset_of
from benchmarks.drawn import drawn_case
from benchmarks.plants import cubic, fifth_power, mode, played, spring
from nlfrf import Record, identify, multisine, reduce_crest
from nlfrf.bla.line_index import index_lines
from nlfrf.bla.local_models import fit_locally
from nlfrf.signals import LineGrid

FINE = dict(n_samples=2048, f_min=0.5, f_max=90)


def complex_normal(rng, shape):
    return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / np.sqrt(2)


@pytest.mark.attack(every=6)
@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
@pytest.mark.parametrize(
    ("case", "before"),
    [
        (
            ("cubic", "special-odd", 7, 2, 30, {}, 1),
            "the same file played seven times: 33 % for the BLA",
        ),
        (
            ("weak", "full", 20, 2, 20, {}, 0),
            "noise that hides the distortion: 80 % for a new realisation",
        ),
        (
            ("cubic", "full", 1, 1, None, dict(f_max=50), 0),
            "84 % on the first line, 82 % for a new realisation",
        ),
        (("cubic", "odd", 1, 1, None, dict(f_max=24), 0), "a narrow band: 79 % on the first line"),
        (
            ("Wiener", "odd", 1, 1, None, dict(f_max=100), 0),
            "distortion behind a mode: 45 % on the first line",
        ),
        (("Wiener", "special-odd", 1, 1, None, dict(f_max=40), 0), "60 % on the last line"),
        (
            ("Wiener", "special-odd", 1, 1, None, dict(f_min=10), 0),
            "2.2 times as wide as it had to be",
        ),
        (("sensor", "special-odd", 1, 1, None, dict(f_min=3, f_max=170), 0), "2.3 times as wide"),
        (
            ("one way", "random-odd", 1, 1, None, FINE, 0),
            "a level that rises towards the last line: 66 % there",
        ),
        (("one way", "odd", 1, 1, None, FINE, 0), "74 % on the first line"),
        (
            ("slipping", "full", 1, 1, None, FINE, 0),
            "a level that falls with frequency: 63 % on the first line",
        ),
        (("slipping", "special-odd", 1, 2, 20, FINE, 0), "87 % on the first three lines"),
        (
            ("Hammerstein", "odd-odd", 1, 1, None, dict(f_max=60), 0),
            "a mode between two lines: 2.0 times as wide",
        ),
        (("softening", "odd", 1, 1, None, dict(f_min=5, f_max=30), 0), "2.4 times as wide"),
        (("one way", "special-odd", 1, 1, None, dict(f_min=3, f_max=170), 0), "1.7 times as wide"),
        (
            ("245", *drawn_case(245)),
            "an exponential behind a mode: 64 % at three times its resonance",
        ),
    ],
    ids=lambda case: "-".join(map(str, case[:4])) if isinstance(case, tuple) else "",
)
def test_the_bound_holds_on_every_line(case, before):
    n_records = 60 if case[2] > 1 else 240
    row = measure_hard("", *case, n_records, np.random.default_rng(1))
    scores = np.array(
        row[8:16]
    )  # over all lines, the first three, the last three, the worst; of the BLA, of a new one
    assert np.all(scores[[0, 4]] > 92.5), before
    assert np.all(scores[[1, 2, 5, 6]] > 88), before  # three lines of 60 records: sigma 1.6 %
    assert np.all(scores[[3, 7]] > 78), before
    assert row[16] < 1.6


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")
def test_a_realisation_of_low_peaks_does_not_stand_for_others():
    """The distortion of a fifth power on few lines is a matter of the peaks:

    87 % of new realisations were held.
    """
    case = ("fifth", "odd", 1, 1, None, dict(f_min=5, f_max=30), 0)
    scores = np.array(measure_hard("", *case, 240, np.random.default_rng(1))[8:16])
    # known to be short of 93 by a percent: roughness does not see what is common to all lines,
    # which is most of it here
    assert scores[0] > 91.5
    assert scores[4] > 91
    assert np.all(scores[[1, 2, 5, 6]] > 88)


@pytest.mark.filterwarnings("ignore::nlfrf.DataWarning")  # of chosen phases
@pytest.mark.parametrize(
    ("plant", "f_max", "options", "least"),
    [
        (cubic, 400, {"target": 2.0}, 92),  # it was 57 %
        (fifth_power, 120, {"n_draws": 97}, 86),  # it was 78
    ],
    ids=["cubic, clipped to 2", "fifth power, best of 97"],
)
def test_low_peaks_tell_the_gain_they_put_on_all_lines(plant, f_max, options, least):
    """Phases that were chosen distort less than random ones, all in one direction: no scatter shows
    it.
    """
    rng = np.random.default_rng(3)
    ms = multisine(fs=1024, n_samples=1024, f_min=1, f_max=f_max, rng=rng)
    k = ms.lines.excited
    truth = frfs(*played(ms, plant, 1000, rng), k).mean(axis=0)
    low = [
        reduce_crest(subset_of(ms, 1, rng), oversampling=1, rng=rng, **options).u for _ in range(80)
    ]
    held = []
    for u in low:
        bla = identify(Record(u=u[:, None], y=plant(u, 1024)[:, None], fs=1024, lines=ms.lines))
        held.append(np.abs(bla.G - truth) < bla.bound())
    assert 100 * np.mean(held) > least


def test_a_stepped_mass_on_a_linear_spring_is_the_mode():
    """The table is as good as its plants: what is integrated is held against what is exact."""
    u = multisine(fs=1024, n_samples=1024, f_min=1, f_max=200, n_realizations=2, rng=0).u
    np.testing.assert_allclose(
        spring(u, 1024, (1.0, 0.0, 0.0, 0.0), 0.1, 30.0, 3), mode(u, 1024, 0.1, 30.0), atol=2e-3
    )
    pushed = (
        spring(u, 1024, (1.0, 0.0, 1.0, 0.0), 0.1, 30.0, 3),
        spring(-u, 1024, (2.0, 0.0, -1.0, 0.0), 0.1, 30.0, 3),
    )
    np.testing.assert_allclose(
        pushed[0], -pushed[1], atol=1e-12
    )  # twice as stiff one way, seen from either side


def test_a_denominator_is_not_fitted_to_noise():
    """One window in five had one, and at the ends of the band it took a level with it."""
    rng = np.random.default_rng(0)
    where = index_lines(LineGrid(excited=np.arange(1, 101)))
    noise = complex_normal(rng, (400, 100))
    fit = fit_locally(1 + 0.1 * noise, np.ones(noise.shape), index=where)
    assert np.mean(fit.dof < 6) < 0.01
    told = fit.variance[:, [0, 1, 50, 98, 99]] / 0.01
    np.testing.assert_allclose(told.mean(axis=0), 1.0, atol=4 / np.sqrt(6 * 400))
    np.testing.assert_allclose(told.var(axis=0), 1 / 6, rtol=0.4)
