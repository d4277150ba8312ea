"""A second record held against a model: p-values on true nulls, power, and what is told of a
change.
"""

from functools import cache

import control
import numpy as np
import pytest
from scipy.stats import kstest

import nlfrf
import robust
from benchmarks import validation as harness
from robust import uncertainty, validate
from robust.models.sets.records import RecordSummary
from tests.support.bla import make_bla
from tests.support.printed import unwrapped
from tests.support.responses import response

F = np.sort(np.concatenate([8 * np.arange(60) + 1, 8 * np.arange(60) + 3])) * 0.25
W0 = 2 * np.pi * 60


def plant(s, gain=1.0, ratio=1.0, delay=0.0):
    w = W0 * ratio
    return gain * 1e4 / W0**2 * w**2 / (s * s + 30 * ratio * s + w**2) * np.exp(-s * delay)


SIZE = np.abs(plant(2j * np.pi * F))
NOMINAL = control.ss(control.tf([1e4], [1, 30, W0**2]))


def record(seed, scatter=0.05, f=F, **change):
    return make_bla(
        lambda s: plant(s, **change),
        f,
        f0=0.25,
        sigma_distortion=scatter * np.interp(f, F, SIZE),
        rng=seed,
    )


def pair(seed, nominal=NOMINAL, **change):
    return validate(harness.model_of(record(2 * seed), nominal), record(2 * seed + 1, **change))


@cache
def rig(n_poles):
    """40 pairs of records of the rig with friction, nothing changed, and two changes."""
    rng = np.random.default_rng(5)
    ms, y = harness.played("rig", 80, 150, rng)
    changes = {
        name: harness.CHANGES[name] for name in ("nothing", "gain + 3 %", "resonance + 0.5 %")
    }
    return harness.judged(ms, y, 40, n_poles, None, rng, changes)


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("frf", [False, True])
def test_p_values_are_uniform_where_nothing_has_changed(frf):
    """120 pairs of gaussian records whose levels are estimates themselves; the FRF as nominal is no
    exception.
    """
    seen = [pair(seed, None if frf else NOMINAL) for seed in range(120)]
    p = np.array([one.p_value for one in seen])
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean(p < 0.05) < 0.12
    assert np.mean([one.n_outside for one in seen]) == pytest.approx(seen[0].n_expected, rel=0.35)
    assert 0.85 < np.median([one.change.level for one in seen]) < 1.15


def test_on_the_rig_it_is_uniform_and_sees_small_changes():
    """The seeded part of benchmarks.validation: 40 pairs, two periods each, the FRF as nominal."""
    found = rig(0)
    p = {name: np.array([one.p_value for one in seen]) for name, seen in found.items()}
    assert kstest(p["nothing"], "uniform").pvalue > 0.01
    assert np.mean(p["gain + 3 %"] < 0.05) >= 0.8
    assert np.mean(p["resonance + 0.5 %"] < 0.05) >= 0.8
    gain = np.array([one.change.gain for one in found["gain + 3 %"]]) - [
        one.change.gain for one in found["nothing"]
    ]
    assert np.median(gain) == pytest.approx(0.03, rel=0.1)


@pytest.mark.parametrize(
    ("change", "name", "size"),
    [
        ({"gain": 1.1}, "gain", 0.1),
        ({"delay": 1e-3}, "delay", 1e-3),
        ({"ratio": 1.03}, "frequency", 0.03),
    ],
)
@pytest.mark.parametrize("frf", [False, True])
def test_a_change_is_told_by_its_name(change, name, size, frf):
    seen = pair(3, None if frf else NOMINAL, **change)
    assert seen.p_value < 1e-4
    assert getattr(seen.change, name) == pytest.approx(size, rel=0.35)
    assert f"{name} +" in unwrapped(seen)


def test_more_scatter_is_a_matter_of_level_and_not_of_shape():
    """Scatter of the second record four times what it says of itself."""
    p, level, outside = [], [], []
    for seed in range(30):
        first = record(3 * seed)
        said = record(3 * seed + 1)
        rough = record(3 * seed + 2, scatter=0.2)
        model = harness.model_of(first, NOMINAL)
        # a level over thirteen lines where the FRF is rougher is not believed to be larger than it
        # says
        liar = nlfrf.Bla(**(vars(said) | {"G": rough.G}))
        seen = validate(model, liar)
        p.append(seen.p_value)
        level.append(seen.change.p_level)
        outside.append(seen.n_outside - seen.n_expected)
    assert kstest(p, "uniform").pvalue > 0.01
    assert max(level) < 1e-6
    assert min(outside) > 10


def test_score_test_is_chi_square_for_known_directions():
    """400 draws of scatter whose sizes differ ten times from what the record says of itself: a
    score over its own covariance.
    """
    rng, f = np.random.default_rng(0), np.arange(1.0, 81.0)
    lag = control.ss(control.tf([1], [0.01, 1]))
    G = response(lag, 2 * np.pi * f)
    model = robust.UncertaintyModel(
        lag, 0.5, "multiplicative", 2 * np.pi * f, np.full(f.size, 0.2), 0.95
    )
    std = 1e-3 * np.abs(G)
    sizes = std * np.exp(rng.normal(size=f.size))
    p = []
    for _ in range(400):
        e = sizes * (rng.normal(size=f.size) + 1j * rng.normal(size=f.size))
        p.append(validate(model, nlfrf.bla_from_frf(f, G + e, std=std)).p_value)
    # 0.07 at 5 %: 80 lines of very different size count for fewer
    assert kstest(p, "uniform").statistic < 0.1


def test_the_record_of_the_model_itself_says_nothing():
    first = record(0)
    seen = validate(uncertainty(first, NOMINAL, order=1), first)
    assert (seen.p_value, seen.n_outside, seen.n_outside_set) == (1.0, 0, 0)
    assert seen.change is None
    assert "shape and level: the record is that of the model; 0 lines" in unwrapped(seen)


def test_of_several_levels_the_nearest_counts():
    levels = [record(seed, gain=gain) for seed, gain in ((0, 1.0), (1, 1.5))]
    model = uncertainty(levels, NOMINAL, order=1)
    assert validate(model, record(7, gain=1.5)).p_value > 0.01
    assert validate(model, record(8, gain=1.0)).p_value > 0.01
    assert validate(model, record(9, gain=1.25)).p_value < 1e-4


def test_other_lines_are_interpolated_and_models_without_a_record_are_exact():
    model = uncertainty(record(0), NOMINAL, order=1)
    other = record(11, f=F[::2])
    assert validate(model, other).n_lines == F[::2].size
    assert validate(model, other).p_value > 0.01
    bare = robust.UncertaintyModel(
        NOMINAL, 0.5, "multiplicative", 2 * np.pi * F, np.full(F.size, 0.2), 0.95
    )
    assert validate(bare, record(12)).p_value > 0.01
    assert validate(bare, record(12, gain=1.1)).p_value < 1e-4
    few = validate(uncertainty(record(0), NOMINAL, order=1), record(12, f=F[::20]))
    assert few.n_lines == 6
    assert np.isnan(few.p_value)
    assert few.change is None
    assert "shape and level: not tested on fewer than 8 lines" in unwrapped(few)


@pytest.mark.parametrize("step", [2, 4, 8])
def test_a_record_on_finer_lines_is_no_other_machine(step):
    """Read at eight lines between two of its own, the first record scattered as one: p < 0.05 in 90
    % of nulls.
    """
    seen = []
    for seed in range(80):
        first = record(2 * seed, f=np.arange(1 + step / 2, 480, step) * 0.25)
        model = harness.model_of(first, NOMINAL)
        seen.append(validate(model, record(2 * seed + 1, f=np.arange(1, 481) * 0.25)))
    p = np.array([one.p_value for one in seen])
    assert kstest(p, "uniform").pvalue > 0.01
    assert np.mean(p < 0.05) < 0.13
    assert seen[0].n_expected == pytest.approx(0.05 * 480 / step, rel=0.05)
    assert seen[0].n_lines == seen[0].distance.size == seen[0].omega.size
    changed = record(1000, f=np.arange(1, 481) * 0.25, gain=1.1)
    assert validate(model, changed).p_value < 1e-3


FINE, COARSE, FEW = np.arange(1.0, 50), np.arange(2.0, 50, 7), np.array([3.2, 3.4, 3.6])


@pytest.mark.parametrize(
    ("first", "second", "reader", "read"),
    [
        (FINE, COARSE, 1, COARSE),
        (COARSE, FINE, 0, COARSE),
        (FINE, FINE, 0, FINE),
        (FINE, FINE[:-1] + 0.5, 0, FINE[1::2]),
        (FINE, FEW, 1, FEW[:1]),
        (np.array([3.0, 10.0]), FEW, 1, FEW[:1]),
        (np.array([2.0, 3.0, 9.0]), np.array([1.0, 5.0]), 1, np.array([5.0])),
    ],
)
def test_each_line_is_read_once(first, second, reader, read):
    """One record has another FRF on the lines that are read, or on all others."""
    lag = control.ss(control.tf([1], [0.1, 1]))
    for on_read in (True, False):
        records = []
        for k, f in enumerate((first, second)):
            G = response(lag, 2 * np.pi * f)
            other = (k == reader) & (np.isin(f, read) == on_read)
            records.append(nlfrf.bla_from_frf(f, np.where(other, 5 * G, G), std=0.1 * np.abs(G)))
        model = uncertainty(records[0], lag, order=0, below="flat", above="flat")
        seen = validate(model, records[1])
        assert seen.n_expected == pytest.approx((1 - model.confidence) * read.size)
        assert seen.n_outside == (read.size if on_read else 0)


def test_around_an_frf_the_holds_of_two_records_are_held_together():
    """The hold in the second record was a delay of half a sample that the machine had got since."""
    at = np.sinc(F / 1024) * np.exp(-1j * np.pi * F / 1024)
    hold = {"f0": 0.25, "sigma_distortion": 0.01 * SIZE, "fs": 1024.0}
    first = make_bla(plant, F, rng=1, hold="band-limited", **hold)
    second = make_bla(plant(2j * np.pi * F) * at, F, rng=2, hold="zoh", **hold)
    model = uncertainty(first, robust.frd(first), order=1)
    assert abs(validate(model, second).change.delay) < 5e-5
    assert validate(model, second).p_value > 0.01
    with pytest.raises(
        ValueError, match="bla must have lines of the FRF that is the nominal of the model"
    ):
        validate(model, record(3, f=np.arange(10, 400) * 0.3))


def test_slopes_are_exact_on_uneven_lines():
    """log G is a parabola over log omega: a shift of the axis is told without error."""
    f = np.exp(np.sort(np.random.default_rng(1).uniform(1, 4, 30)))
    first, second = (
        nlfrf.bla_from_frf(f, np.exp(-(0.3 + 0.2j) * x - 0.1 * x**2), std=np.full(f.size, 1e-6))
        for x in (np.log(f), np.log(f / (1 + 1e-4)))
    )
    model = uncertainty(first, robust.frd(first))
    change = validate(model, second).change
    assert change.frequency == pytest.approx(1e-4, rel=2e-4)
    assert abs(change.gain) < 1e-9
    assert abs(change.delay) < 1e-9


def test_interpolation_is_exact_where_it_should_be():
    omega = np.array([1.0, 2.0, 4.0])
    one = RecordSummary(
        omega=omega, G=np.exp(1j * omega), variance=omega, scatter=omega, confirmed=1.0
    )
    there = one.on_lines(np.array([1.5, 3.0]))
    np.testing.assert_allclose(there.G, np.exp(1j * there.omega), rtol=1e-12)
    np.testing.assert_allclose(there.variance, [1.5, 3.0])


def test_the_conclusion_says_what_changed_and_whether_the_set_holds_it():
    """A gain 30 % higher is another shape; the same record is no change."""
    ms = nlfrf.multisine(fs=128, n_samples=128, f_min=1, f_max=40, rng=1)
    first, louder = (
        nlfrf.identify(
            nlfrf.Record(u=ms.u[None], y=(g * ms.u + 0.02 * ms.u**3)[None], fs=128, lines=ms.lines)
        )
        for g in (1.0, 1.3)
    )
    assert str(robust.validate(first, first)).endswith("conclusion: no significant change (at 1 %)")
    assert "the FRF has another shape" in robust.validate(first, louder).conclusion
    model = robust.uncertainty(first, control.tf([1.0], [1]), order=0, above="flat")
    assert robust.validate(model, louder).conclusion.endswith(
        "the set does not contain every line of this record"
    )
