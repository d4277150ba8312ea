"""The limit of every plant of a set: gains and slopes against brute force, and the tuner's number
against `check`'s.
"""

import control
import numpy as np
import pytest

import robust
from robust import tuning
from robust.synthesis.tuning.worst import (
    disc_slope,
    largest_gain,
    scaled_gain,
    scaled_slopes,
)
from tests.support.forms import FORMS
from tests.support.random_tunings import matrix_set

ERROR = control.summing_junction(["r", "-y"], "e")
FORCE = control.summing_junction(["u", "d"], "f")


@pytest.mark.parametrize("seed", range(20))
def test_the_disc_of_a_channel(seed):
    """Centre plus radius is the largest over the circle |Delta| = 1, and no Delta inside has
    more.
    """
    rng = np.random.default_rng(seed)
    N11, N12, N21, N22 = rng.normal(size=4) + 1j * rng.normal(size=4)
    N11 *= rng.uniform(0, 0.95) / abs(N11)
    found, _ = disc_slope(np.array([[N11, N12], [N21, N22]]))
    Delta = np.exp(1j * np.linspace(0, 2 * np.pi, 20001))
    circle = np.abs(N22 + N21 * Delta * N12 / (1 - N11 * Delta))
    assert circle.max() <= found * (1 + 1e-12)
    assert circle.max() == pytest.approx(found, rel=1e-6)
    inside = 0.7 * Delta
    assert np.abs(N22 + N21 * inside * N12 / (1 - N11 * inside)).max() <= found


def random_loop(rng, blocks, channel, gain):
    """N of a loop around blocks of this gain, with a channel of this shape."""
    n, m = sum(b[0] for b in blocks) + channel[0], sum(b[1] for b in blocks) + channel[1]
    N = rng.normal(size=(n, m)) + 1j * rng.normal(size=(n, m))
    return N * gain / np.linalg.norm(N[: n - channel[0], : m - channel[1]], 2)


def gain_with_scalings(N, blocks, d):
    """Least g for which D N D^-1 diag(1, 1/g) has a gain of one at most, by bisection."""
    sides = [np.concatenate([np.repeat(d, [b[k] for b in blocks]), np.ones(2)]) for k in (0, 1)]
    scaled = sides[0][:, None] * N / sides[1]
    channel = np.arange(N.shape[1]) >= N.shape[1] - 2
    low, high = -20.0, 20.0
    for _ in range(80):
        middle = (low + high) / 2
        bounded = np.linalg.norm(scaled / np.where(channel, np.exp(middle), 1.0), 2) <= 1
        low, high = (low, middle) if bounded else (middle, high)
    return np.exp(high)


@pytest.mark.parametrize(
    "blocks", [((1, 1),), ((2, 3),), ((1, 1), (1, 1)), ((1, 1), (2, 1), (1, 2))]
)
@pytest.mark.parametrize("gain", [0.6, 1.5])
def test_slopes_of_the_worst_case(blocks, gain):
    """By differences of N in every direction, inside the set and where a start outside is carried
    on.
    """
    rng = np.random.default_rng(len(blocks))
    d = rng.uniform(0.5, 2.0, len(blocks))
    N = random_loop(rng, blocks, (2, 2), gain)
    ((found, Q), *_) = scaled_slopes(N, blocks, d)
    assert found == pytest.approx(scaled_gain(N[None], blocks, d[None])[0], rel=1e-12)
    if gain < 1:
        proves = 30 * d**0.2
        ((bound, _), *_) = scaled_slopes(N, blocks, proves)
        assert bound == pytest.approx(gain_with_scalings(N, blocks, proves), rel=1e-9)
    direction = rng.normal(size=N.shape) + 1j * rng.normal(size=N.shape)
    step = 1e-5 * np.array([-2, -1, 1, 2])
    values = [scaled_slopes(N + h * direction, blocks, d)[0][0] for h in step]
    difference = (values[0] - 8 * values[1] + 8 * values[2] - values[3]) / (12e-5)
    assert (Q.conj() * direction).sum().real == pytest.approx(difference, rel=1e-6)


@pytest.mark.parametrize("gain", [0.6, 1.5])
def test_slopes_of_the_disc(gain):
    rng = np.random.default_rng(3)
    N = random_loop(rng, ((1, 1),), (1, 1), gain)
    _, Q = disc_slope(N)
    direction = rng.normal(size=N.shape) + 1j * rng.normal(size=N.shape)
    values = [disc_slope(N + step * direction)[0] for step in (-1e-6, 1e-6)]
    assert (Q.conj() * direction).sum().real == pytest.approx(
        (values[1] - values[0]) / 2e-6, rel=1e-6
    )


@pytest.mark.parametrize("blocks", [((1, 1),), ((2, 2),), ((1, 1), (1, 1))])
def test_the_bound_with_scalings_is_the_largest_gain(blocks):
    """Up to three full blocks, that of the channel among them, the bound is exact: a perturbation
    attains it.
    """
    rng = np.random.default_rng(5)
    N = random_loop(rng, blocks, (2, 1), 0.6)
    (bound,) = largest_gain(N[None], blocks)
    perturbations = robust.mu.worst_gain(N, list(blocks))
    assert perturbations.lower[0] == pytest.approx(bound, rel=1e-5)
    m, n = (delta := perturbations.delta[..., 0]).shape
    inner = delta @ np.linalg.inv(np.eye(n) - N[:n, :m] @ delta)
    reached = np.linalg.norm(N[n:, m:] + N[n:, :m] @ inner @ N[:n, m:], 2)
    assert reached <= bound * (1 + 1e-9)


def test_one_disc_in_a_scalar_channel_needs_no_scalings():
    """The closed form and the program agree."""
    N = random_loop(np.random.default_rng(6), ((1, 1),), (1, 1), 0.7)
    assert disc_slope(N)[0] == pytest.approx(largest_gain(N[None], ((1, 1),))[0], rel=1e-7)


def tuned_at_worst(model, dt=0.0):
    """Two PI controllers on a plant of two inputs and outputs, |S| <= 1.5 for the whole set: their
    start misses it.
    """
    errors = [control.summing_junction([f"r{k}", f"-y{k}"], f"e{k}") for k in (1, 2)]
    if dt:
        errors = [
            control.ss([], [], [], e.D, dt, inputs=e.input_labels, outputs=e.output_labels)
            for e in errors
        ]
    r, e, u, y = (["r1", "r2"], ["e1", "e2"], ["u1", "u2"], ["y1", "y2"])
    design = robust.tune(
        errors,
        tuning.Plants(model, inputs=u, outputs=y),
        {f"K{k}": tuning.Pid(kp=5.0, ki=7.0, reads=e[k], drives=u[k]) for k in (0, 1)},
        hard=[tuning.Limit(r, e, 1.5, worst=True), tuning.Limit(r, e, 0.3, band=(0.0, 0.1))],
        dt=dt,
        n_starts=1,
        rng=1,
    )
    return design, design.controller(y, u)


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["additive", "elements", "input"])
def test_the_tuner_has_the_number_of_check_for_several_channels(form):
    """The largest |S| over the set, by mu in both: scaling the demand to the tuner's number makes
    mu one.
    """
    design, K = tuned_at_worst(matrix_set(form, 0.1), 0.1)
    hard = next(one for one in design.limits if one.limit.worst)
    assert design.met
    assert hard.n_lines
    report = robust.check(design.plant.models[0], K, w_P=1 / (1.5 * hard.ratio), certify=False)
    assert np.nanmax(report.curves.rp) <= 1 + 1e-6
    assert np.nanmax(report.curves.rp) == pytest.approx(
        1.0, abs=1e-5
    )  # its grid may miss the top by so much
    assert np.max(report.curves.rs) < 1


@pytest.mark.attack
def test_a_continuous_matrix_set_under_a_clock_is_the_sampled_set_of_check():
    design, K = tuned_at_worst(matrix_set("input", 0.0), 0.1)
    hard = next(one for one in design.limits if one.limit.worst)
    assert design.met
    report = robust.check(design.plant.models[0], K, w_P=1 / (1.5 * hard.ratio), certify=False)
    assert np.nanmax(report.curves.rp) == pytest.approx(1.0, abs=1e-5)


def test_a_matrix_without_a_set_is_refused():
    with pytest.raises(
        ValueError, match=r"worst must be False unless every plant is an UncertaintyModel"
    ):
        tuned_at_worst(matrix_set("input", 0.0).nominal)


def sampled_set(form, *, continuous=False):
    """A mode with a set of this form around it, sampled at 1 kHz."""
    G = control.tf([1e4], [1, 20, 1e4])
    G = control.ss(G) if continuous else robust.sampled(G, 1e-3)
    clock = 0 if continuous else 1e-3
    weight = (
        control.tf([0.25, 50], [1, 100])
        if continuous
        else control.ss(control.tf([0.15], [1], clock))
    )
    omega = np.geomspace(1, 2000, 60)
    return robust.UncertaintyModel(G, weight, form, omega, np.full(60, 0.05))


@pytest.mark.parametrize(
    "form",
    [form if "inverse" in form else pytest.param(form, marks=pytest.mark.attack) for form in FORMS],
)
def test_the_tuner_has_the_number_of_check(form):
    """|S| at worst by `check` on the controller that comes out, every form, hold and delay
    inside.
    """
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
    worst = robust.check(
        model, design.controller("y", "u"), w_P=1 / (2.0 * found.ratio), delay=1e-3, certify=False
    )
    assert found.n_lines
    assert found.n_lines > 1000
    assert np.max(worst.curves.rp) == pytest.approx(1.0, abs=1e-6)
    assert np.max(report.curves.rs) < 1


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
    assert np.max(worst.curves.rp) == pytest.approx(1.0, abs=1e-6)


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
    """With |w T| above one at the start the worst case is infinite; the search still has a slope
    there.
    """
    G = robust.sampled(control.tf([1], [1, 1]), 0.1)
    weight = control.ss(control.tf([0.9], [1], 0.1))
    model = robust.UncertaintyModel(
        G, weight, "multiplicative", np.array([0.1, 1.0]), np.full(2, 0.8)
    )
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
    assert robust.check(model, design.controller("y", "u"), certify=False).margins.rs > 1


@pytest.mark.attack
def test_one_disc_in_a_channel_of_several_signals_is_exact():
    """[r, d] to [e, f] over one disc, as a system and on lines: what a plant of the set attains."""
    model = sampled_set("additive")
    z = np.exp(1j * np.geomspace(1.0, 3000.0, 400) * 1e-3)
    frf = control.FrequencyResponseData(model.nominal(z), np.angle(z) * 1e3, dt=1e-3)
    on_lines = robust.UncertaintyModel(frf, model.weight, "additive", frf.omega, np.full(400, 0.1))
    for one in (model, on_lines):
        design = robust.tune(
            [ERROR, FORCE],
            tuning.Plants(one, inputs="f", outputs="y"),
            {"K": tuning.Pid(kp=0.1, ki=5.0, reads="e", drives="u")},
            hard=[tuning.Limit(["r", "d"], ["e", "f"], 6.0, worst=True)],
            dt=1e-3,
            rng=1,
            n_starts=1,
        )
        (hard,) = design.limits
        K = design.controller("y", "u")
        w = 0.15  # u' = f, y = G f + w Delta f; e = r - y, f = K e + d
        at = np.append(z, np.exp(1j * hard.omega * 1e-3))
        G, k = model.nominal(at), K(at)
        S = 1 / (1 + G * k)
        N = np.array([[-w * k * S, k * S, S], [-w * S, S, -G * S], [-w * k * S, k * S, S]])
        bounds = robust.mu.worst_gain(N, [(1, 1)])
        assert bounds.lower.max() == pytest.approx(6.0 * hard.ratio, rel=1e-6)
        assert design.met
