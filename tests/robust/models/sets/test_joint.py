"""The probability that a whole FRF lies in a set: against closed forms, against fresh FRFs, in
words and in files.
"""

import re
from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

import nlfrf
import robust
from benchmarks import joint as harness
from benchmarks.coverage_matrix import static_record
from robust import UncertaintyModel, check, frd, load, save, uncertainty
from robust.models.sets import joint
from robust.models.sets.joint import probability_of_frf
from robust.models.sets.records import RecordSummary
from tests.support.bla import make_bla
from tests.support.printed import unwrapped
from tests.support.responses import response

F = np.sort(np.concatenate([8 * np.arange(40) + 1, 8 * np.arange(40) + 3])) * 0.25
PLANT = control.ss(control.tf([1e4], [1, 30, 3600.0]))
SIZE = np.abs(PLANT(2j * np.pi * F))


def measured(rng=0, **sigmas):
    return make_bla(lambda s: 1e4 / (s * s + 30 * s + 3600.0), F, f0=0.25, rng=rng, **sigmas)


@cache
def static(gain=1.0, seed=0):
    rng = np.random.default_rng(seed)
    ms, y = harness.steady("cubic", 1, rng)
    return nlfrf.identify(harness.recorded(ms, gain * y, np.arange(1), None, rng))


@cache
def matrix(seed):
    ms = nlfrf.multisine(
        "random-odd", fs=512, n_samples=512, f_min=1, f_max=60, n_inputs=2, rng=seed
    )
    return nlfrf.identify(static_record(ms, rng=seed))


def test_wide_sets_hold_everything_and_narrow_ones_nothing():
    bla = measured(sigma_distortion=0.05 * SIZE)
    model = uncertainty(bla, PLANT, order=2)
    assert model.joint.frf > 0.9
    known = response(model.weight, bla.omega)
    assert uncertainty(bla, PLANT, order=2, confidence=0.2).joint.frf < 0.05
    assert np.all(np.abs(known) >= model.radius * (1 - 1e-6))


@pytest.mark.parametrize("q", [2.2, 2.6, 3.0])
def test_closed_form_where_the_scatter_is_known(q, monkeypatch):
    """White scatter s on F lines, discs of radius q s about the BLA:

    (1 - exp(-q^2))^F; half from v and s each.
    """
    monkeypatch.setattr(
        joint, "draw_level_errors", lambda n, F, rng: (np.ones((n, F)), np.ones((n, 1)))
    )
    monkeypatch.setattr(joint, "N_DRAWS", 20_000)
    monkeypatch.setattr(joint, "N_NUMBERS", 1 << 22)
    omega, ones = 2 * np.pi * F, np.ones(F.size)
    G = PLANT(1j * omega)
    model = UncertaintyModel(PLANT, 0.05 * q, "multiplicative", omega, 0.05 * ones, 0.95)
    half = (0.05 * SIZE) ** 2 / 2
    known = RecordSummary(omega=omega, G=G, variance=half, scatter=half, confirmed=1.0)
    new, bla = probability_of_frf(model, known, 0 * ones)
    p = (1 - np.exp(-(q**2))) ** F.size
    assert abs(new - p) < 4 * np.sqrt(p * (1 - p) / 20_000) + 1e-4
    assert bla > (1 - np.exp(-2 * q**2)) ** F.size - 0.02


@pytest.mark.attack(every=4)
@pytest.mark.parametrize(
    ("case", "n_sets", "least"),
    [
        (("even", -1, 2, 1, 30), 6, 0.9),
        (("cubic", 0, 4, 1, None), 18, 0.5),  # one of its sets is off by 0.2
        (("Hammerstein", 2, 2, 1, None), 6, 0.9),
        (("saturation", 0, 2, 2, None), 6, 0.7),
    ],
    ids=lambda case: "-".join(map(str, case)) if isinstance(case, tuple) else "",
)
def test_estimate_against_fresh_realisations(case, n_sets, least):
    """Means over some sets, each held against 150 FRFs it has not seen.

    One set's own number may be off by 0.2.
    """
    rng = np.random.default_rng(4)
    ms, y = harness.steady(case[0], n_sets * case[3] + 150, rng)
    fresh = harness.frfs(replace(ms, phase=ms.phase[-150:]), y[-150:])
    rows = []
    for i in range(n_sets):
        bla = nlfrf.identify(
            harness.recorded(ms, y, case[3] * i + np.arange(case[3]), case[4], rng)
        )
        model = harness.set_of(bla, *case[1:3])
        rows.append((harness.held(model, bla.omega, fresh), model.joint.frf, model.joint.bla))
    held, estimate, bla_estimate = np.mean(rows, axis=0)
    assert held > least
    assert abs(held - estimate) < 0.15
    assert bla_estimate > 0.95


def test_several_levels_tell_the_least_and_sampled_models_tell_it_too():
    one, other = static(seed=1), static(gain=1.1, seed=2)
    model = uncertainty([one, other], frd(one), order=1)
    assert len(model.records) == 2
    far = uncertainty(other, frd(one), order=1)  # it alone makes the radius
    np.testing.assert_allclose(far.radius, model.radius, rtol=1e-12)
    assert model.joint.frf == far.joint.frf < 0.97
    assert model.joint.bla == far.joint.bla
    held = replace(one, hold="zoh")
    sampled = uncertainty(
        held, robust.sampled(control.ss(control.tf([900.0], [1, 900.0])), 1 / 1024), order=2
    )
    assert 0 <= sampled.joint.frf <= 1
    assert UncertaintyModel(PLANT, 0.3, "additive", F, np.full(F.size, 0.1)).joint is None


def test_all_lines_together_is_wider_and_holds_more():
    bla = static(seed=3)
    each, every = (uncertainty(bla, frd(bla), order=3, simultaneous=both) for both in (False, True))
    assert every.joint.frf > 0.98 > each.joint.frf
    assert np.all(every.radius > 1.4 * each.radius)


def test_every_verdict_says_it(tmp_path, undrawn):
    bla = static(seed=3)
    nominal = control.ss([], [], [], [[1.3]])
    model = uncertainty(bla, nominal, order=2)
    report = check(model, control.tf([0.5], [1, 0]))
    said = words(model.joint.frf)
    assert said in "; ".join(report.confidence)
    assert said in " ".join(str(report).split("because")[0].split())
    assert said in unwrapped(model)
    page = tmp_path / "report.html"
    robust.reports.write_report(page, model, control.tf([0.5], [1, 0]), report=report)
    assert page.read_text(encoding="utf-8").count(said) >= 2
    on_lines = check(uncertainty(bla, frd(bla), order=2), control.tf([0.1], [1, 1.0]))
    assert "each line of another realisation" in str(on_lines).replace("\n", " ").replace("  ", " ")
    together = uncertainty(bla, nominal, order=2, simultaneous=True)
    assert "all lines together" in check(together, control.tf([0.5], [1, 0])).confidence[0]
    made = UncertaintyModel(
        PLANT, 0.3, "multiplicative", F, np.full(F.size, 0.1), perturbation="LTI"
    )
    assert check(made, 0.1).confidence == ()


def test_files_keep_it(tmp_path):
    model = uncertainty(static(seed=5), control.ss([], [], [], [[1.0]]), order=1)
    save(model, tmp_path / "model.json")
    again = load(tmp_path / "model.json")
    assert (again.joint.frf, again.joint.bla) == (model.joint.frf, model.joint.bla)
    for part in ("omega", "G", "variance", "scatter", "confirmed"):
        np.testing.assert_array_equal(
            getattr(again.records[0], part), getattr(model.records[0], part)
        )
    save(UncertaintyModel(PLANT, 0.3, "additive", F, np.full(F.size, 0.1)), tmp_path / "own.json")
    assert load(tmp_path / "own.json").joint is None


def with_probability(model, p):
    """The set, as if this had come out."""
    return replace(model, joint=replace(model.joint, frf=p))


def words(p):
    """A probability as it is printed."""
    if 0.01 <= p <= 0.99:
        return f"about {100 * p:.0f} %"
    return "over 99 %" if p > 0.5 else "under 1 %"


def test_words_are_no_finer_than_the_estimate():
    model = uncertainty(static(seed=5), control.ss([], [], [], [[1.0]]), order=1)
    assert [
        re.search(r"(over|about|under) \d+ %", unwrapped(with_probability(model, p)))[0]
        for p in (1.0, 0.994, 0.87, 0.5, 0.0)
    ] == [
        "over 99 %",
        "over 99 %",
        "about 87 %",
        "about 50 %",
        "under 1 %",
    ]


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["elements", "additive", "input"])
def test_matrices(form):
    """Means over four sets, each held against 30 matrices it has not seen."""
    fresh, rows = [matrix(100 + seed).G for seed in range(30)], []
    for one in map(matrix, range(4)):
        nominal = control.ss([], [], [], one.G.real.mean(axis=2))
        model = uncertainty(one, nominal, form=form, order=0, above="flat")
        G0 = np.repeat(nominal.D[None], one.f.size, axis=0)
        lines_first = np.array([np.moveaxis(G, 2, 0) for G in fresh])
        held = np.mean(np.all(model.normalized_distance(one.omega, lines_first, G0) <= 1, axis=1))
        rows.append((held, model.joint.frf, model.joint.bla))
        assert words(model.joint.frf) in unwrapped(model)
    held, estimate, bla = np.mean(rows, axis=0)
    assert abs(held - estimate) < 0.15
    assert bla > 0.9
    assert words(model.joint.frf) in unwrapped(
        check(model, control.ss([], [], [], 0.05 * np.eye(2)), certify=False)
    )
