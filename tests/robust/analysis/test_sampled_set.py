"""A continuous set of several channels under a sampled controller: against brute force and against
one loop.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, sampled, worst_case
from robust.analysis import sample_loops
from robust.analysis.sampled_set import sampled_set
from robust.models import Origin
from robust.models.sets.records import RecordHold
from tests.support.responses import response, response_by_channel

T = 0.02
OMEGA = np.geomspace(0.5, 100, 40)
RECORDED = Origin(hold=RecordHold(kind="zoh", fs=5e3))


def rising(x):
    return control.ss(control.tf([x / 20, x], [1 / 200, 1]))


def number(x):
    return control.ss([], [], [], [[x]])


def made(G, form, left, right):
    radius = np.array([np.abs(response(weight, OMEGA)) for weight in (*left, *right)])
    return UncertaintyModel(
        nominal=G, form=form, left=left, right=right, omega=OMEGA, radius=radius, origin=RECORDED
    )


LAG = control.ss(control.tf([2], [0.3, 1]))
TWICE = control.append(LAG, LAG)
MIXED = control.StateSpace([[-3, 1], [-1, -8]], np.eye(2), [[6, 2], [-1, 9]], np.zeros((2, 2)))
INPUT = made(MIXED, "input", (rising(0.1), rising(0.2)), (number(1.0), number(0.7)))
ROLL = control.ss(control.tf([0.1], [1 / 30, 1]))
ELEMENTS = made(MIXED, "elements", (), (ROLL, 0.5 * ROLL, 0.3 * ROLL, ROLL))
ADDITIVE = made(MIXED, "additive", (ROLL, 0.5 * ROLL), (number(1.0), number(0.7)))
SETS = {"input": INPUT, "elements": ELEMENTS, "additive": ADDITIVE}


@pytest.mark.parametrize("form", SETS)
def test_every_sampled_plant_of_the_continuous_set_is_in_the_sampled_one(form):
    """Random plants of the continuous set, each sampled exactly."""
    found = sampled_set(SETS[form], T).model
    assert found.nominal.dt == T
    largest = 0.0
    for plant in SETS[form].sample(40, rng=1):
        seen = sampled(plant, T)
        G, nominal = (
            np.moveaxis(response_by_channel(part, found.omega), 2, 0)
            for part in (seen, found.nominal)
        )
        away = found.normalized_distance(found.omega, G, nominal)
        assert away.max() <= 1 + 1e-6
        largest = max(largest, away.max())
    assert largest > 0.7


def test_two_equal_loops_are_one():
    """G, W and K times one: the bound of mu is rs of one channel, with every alias, but for what
    the weights add.
    """
    w, K = rising(0.2), number(1.5)
    one = UncertaintyModel(
        LAG, w, "multiplicative", OMEGA, np.abs(response(w, OMEGA)), origin=RECORDED
    )
    two = made(TWICE, "input", (w, w), (number(1.0), number(1.0)))
    discrete = control.StateSpace([], [], [], K.D, T)
    both = control.StateSpace([], [], [], K.D * np.eye(2), T)
    alone, together = check(one, discrete), check(two, both)
    assert alone.verdict == together.verdict == "statistically robust"
    assert together.margins.rs == pytest.approx(alone.margins.rs, rel=0.1)
    assert together.margins.rs <= alone.margins.rs * (1 + 1e-3)  # a bound on the safe side
    assert "the weights of the sampled set cover every alias" in together.folding
    assert "which is proved" in together.folding
    assert "cover every alias" not in together.not_proved
    assert "all aliases from above included" in together.proved
    assert "samples" not in together.reason + together.not_proved


def test_a_report_whose_aliases_are_not_proved_says_that_they_rest_on_a_grid(monkeypatch):
    monkeypatch.setattr("robust.proofs.exact.folded_sets.MOST_INTERVALS", 1)
    K = control.StateSpace([], [], [], 1.5 * np.eye(2), T)
    report = check(ADDITIVE, K)
    assert "in floating point" in report.folding
    text = (
        "That the weights of the sampled set cover every alias between the frequencies of a grid; "
    )
    assert report.not_proved.startswith(text)
    assert "nothing is proved between the samples" in report.reason
    assert not report.proofs.certificates[-1].holds


def test_the_disc_of_an_entry_is_the_sum_over_its_aliases():
    found = sampled_set(ELEMENTS, T)
    each = np.abs(found.omega + 2 * np.pi / T * np.arange(-3000, 3001)[:, None])
    hold = np.abs(2 * np.sin(each * T / 2) / (each * T))
    exact = np.sum(hold * 0.1 / np.sqrt(1 + (each / 30) ** 2), axis=0)  # of ROLL
    np.testing.assert_allclose(
        found.model.radius[0], exact, rtol=2e-3
    )  # one takes more aliases in blocks
    assert np.all(found.model.radius[0] >= exact * (1 - 1e-3))


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", SETS)
def test_the_check_is_that_of_the_sampled_loops(form):
    """A gain inside the margin leaves every sampled loop stable; families and worst cases see the
    same set.
    """
    K = control.StateSpace([], [], [], 1.5 * np.eye(2), T)
    report = check(SETS[form], K)
    assert report.verdict == "statistically robust"
    family = sample_loops(SETS[form], K, 20, rng=0)
    assert family.stable.all()
    assert np.all(family.worst * (1 + 1e-6) >= family.S)
    assert worst_case(SETS[form], K).plant.dt == T
    plants = [sampled(plant, T) for plant in SETS[form].sample(10, rng=2)]
    assert all(np.abs(control.feedback(plant, K).poles()).max() < 1 for plant in plants)
    large = check(SETS[form], control.StateSpace([], [], [], 60 * np.eye(2), T))
    assert large.verdict == "not robust"


def test_a_delay_goes_into_the_samples():
    K = control.StateSpace([], [], [], 1.5 * np.eye(2), T)
    late, early = (check(INPUT, K, delay=delay, certify=False) for delay in (0.013, 0.0))
    assert late.margins.rs < early.margins.rs
    assert late.given.delay == 0.013


def test_what_reaches_the_sampler_unfiltered_is_refused_with_a_cure():
    K = control.StateSpace([], [], [], 0.1 * np.eye(2), T)
    flat = made(MIXED, "elements", (), (rising(0.1),) * 4)
    with pytest.raises(ValueError, match=r'model must have weights that fall .* form="input"'):
        check(flat, K)
    with pytest.raises(ValueError, match="model must have a sampled nominal for the class"):
        check(replace(INPUT, perturbation="operator"), K)


def test_one_channel_is_folded_alias_by_alias():
    one = UncertaintyModel(
        LAG, ROLL, "additive", OMEGA, np.abs(response(ROLL, OMEGA)), perturbation="LTI"
    )
    with pytest.raises(
        ValueError, match="model must have several channels to be folded into a sampled set"
    ):
        sampled_set(one, T)
