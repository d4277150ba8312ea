"""The limit of every plant of a set: the disc formula against brute force, and the tuner's number against `check`'s."""

import control
import numpy as np
import pytest

import robust
from robust import tuning
from robust.models.sets.forms import FORMS, plant_numerator
from robust.synthesis.tuning.limits import largest_over_discs

ERROR = control.summing_junction(["r", "-y"], "e")
FORCE = control.summing_junction(["u", "d"], "f")


@pytest.mark.parametrize("seed", range(20))
def test_the_disc_of_a_channel(seed):
    """Centre plus radius is the largest over the circle |Delta| = 1, and no Delta inside has more."""
    rng = np.random.default_rng(seed)
    N11, N12, N21, N22 = rng.normal(size=4) + 1j * rng.normal(size=4)
    N11 *= rng.uniform(0, 0.95) / abs(N11)
    one = np.ones((1, 1, 1))
    found = largest_over_discs(N22 * one, N21 * one[0], N12 * one[0], np.array([N11]))[0]
    Delta = np.exp(1j * np.linspace(0, 2 * np.pi, 20001))
    circle = np.abs(N22 + N21 * Delta * N12 / (1 - N11 * Delta))
    assert circle.max() <= found * (1 + 1e-12)
    assert circle.max() == pytest.approx(found, rel=1e-6)
    inside = 0.7 * Delta
    assert np.abs(N22 + N21 * inside * N12 / (1 - N11 * inside)).max() <= found


def test_the_inverse_form_keeps_its_numerator():
    """S = 0.1, w = 0.5: the shortcut |S|/(1 - w |S|) gives 0.105, the largest is 0.1 (1 + 0.5)/(1 + 0.05) = 0.143."""
    S, w = 0.1, 0.5
    G = np.array([9.0 + 0j])
    row = FORMS["inverse-multiplicative"]
    a, g = row.a(np.array([w]), G, G, G / G), plant_numerator("inverse-multiplicative", np.array([w]), G)
    assert abs(g[0]) < 1e-15
    # d and -a Delta act before the plant, S is seen before that: u' = S (d - a Delta), f = S d + (1 - S) a Delta
    N11, N12, N21, N22 = -a * S, np.array([[S]]), (a * (1 - S))[None], np.array([[[S]]])
    found = largest_over_discs(N22 + 0j, N21 + 0j, N12 + 0j, N11 + 0j)[0]
    assert found == pytest.approx(0.1 * 1.5 / 1.05, rel=1e-12)
    singular = largest_over_discs(N22 + 0j, N21 + 0j, N12 + 0j, np.array([1.0 + 0j]))[0]
    assert np.isinf(singular)


def sampled_set(form, *, continuous=False):
    """A mode with a set of this form around it, sampled at 1 kHz."""
    G = control.tf([1e4], [1, 20, 1e4])
    G = control.ss(G) if continuous else robust.sampled(G, 1e-3)
    clock = 0 if continuous else 1e-3
    weight = control.tf([0.25, 50], [1, 100]) if continuous else control.ss(control.tf([0.15], [1], clock))
    omega = np.geomspace(1, 2000, 60)
    return robust.UncertaintyModel(G, weight, form, omega, np.full(60, 0.05))


@pytest.mark.parametrize("form", list(FORMS))
def test_the_tuner_has_the_number_of_check(form):
    """|S| at worst by `check` on the controller that comes out, every form, hold and delay inside."""
    model = sampled_set(form)
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(model, inputs="f", outputs="y"),
        {"K": tuning.Pid(kp=0.1, ki=5.0, reads="e", drives="u")},
        hard=[tuning.Limit("d", "f", 2.0, worst=True)],
        soft=[tuning.Limit("d", "y", 1.0, band=(0, 10))],
        delay=1e-3,
        rng=1,
        n_starts=1,
    )
    report = robust.check(model, design.controller("y", "u"), delay=1e-3, certify=False)
    found = next(one for one in design.limits if one.hard)
    worst = robust.check(model, design.controller("y", "u"), w_P=1 / (2.0 * found.ratio), delay=1e-3, certify=False)
    assert found.known is tuning.Known.LINES
    assert found.n_lines > 1000
    assert np.max(worst.rp) == pytest.approx(1.0, abs=1e-6)
    assert np.max(report.rs) < 1


def test_a_continuous_set_under_a_clock_counts_its_aliases():
    model = sampled_set("multiplicative", continuous=True)
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(model, inputs="f", outputs="y"),
        {"K": tuning.Pid(kp=0.1, ki=5.0, reads="e", drives="u")},
        hard=[tuning.Limit("d", "f", 2.0, worst=True)],
        soft=[tuning.Limit("d", "y", 1.0, band=(0, 10))],
        dt=1e-3,
        delay=1e-3,
        rng=1,
        n_starts=1,
    )
    found = next(one for one in design.limits if one.hard)
    K = design.controller("y", "u")
    worst = robust.check(model, K, w_P=1 / (2.0 * found.ratio), delay=1e-3, certify=False)
    assert np.max(worst.rp) == pytest.approx(1.0, abs=1e-6)


def test_the_worst_of_a_channel_is_no_less_than_of_any_plant():
    """Compliance y/d of sampled plants of the set stays below the worst that is said."""
    model = sampled_set("multiplicative")
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(model, inputs="f", outputs="y"),
        {"K": tuning.Pid(kp=0.1, ki=5.0, reads="e", drives="u")},
        hard=[tuning.Limit("d", "f", 1.8, worst=True)],
        soft=[tuning.Limit("d", "y", 1.0, worst=True)],
        rng=1,
        n_starts=1,
    )
    K = design.controller("y", "u")
    omega = np.geomspace(1, 3000, 4000)
    z = np.exp(1j * omega * 1e-3)
    for plant in model.sample(20, rng=3):
        G = plant(z)
        assert np.abs(G / (1 + G * K(z))).max() <= design.gamma * (1 + 1e-6)


def test_a_start_outside_the_set_is_brought_in():
    """With |w T| above one at the start the worst case is infinite; the search still has a slope there."""
    G = robust.sampled(control.tf([1], [1, 1]), 0.1)
    weight = control.ss(control.tf([0.9], [1], 0.1))
    model = robust.UncertaintyModel(G, weight, "multiplicative", np.array([0.1, 1.0]), np.full(2, 0.8))
    design = robust.tune(
        [ERROR, FORCE],
        tuning.Plants(model, inputs="f", outputs="y"),
        {"K": tuning.Pid(kp=12.0, ki=1.0, reads="e", drives="u")},
        hard=[tuning.Limit("d", "f", 3.0, worst=True)],
        soft=[tuning.Limit("r", "e", 1.0, band=(0.0, 0.1))],
        rng=1,
        n_starts=1,
    )
    assert design.met
    assert robust.check(model, design.controller("y", "u"), certify=False).margin_rs > 1
