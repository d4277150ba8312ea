"""The worst plant of a set really is in it and really is that bad; weights by formula; order scan;
loop bounds.
"""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, performance_weight, worst_case
from robust.analysis import sample_loops
from robust.lti import discretize
from robust.models import control_weight, delay_weight, makeweight, scan_orders
from tests.support.bla import make_bla
from tests.support.forms import FORMS, PERTURBED, worst_sensitivity
from tests.support.printed import unwrapped
from tests.support.responses import response

LINES = np.array([0.1, 1.0, 10.0])
LAG = control.ss(control.tf([2], [1, 1]))
W = control.ss(control.tf([0.1, 0.05], [0.2, 1]))


def model(form="multiplicative", scale=1.0, nominal=LAG, weight=W):
    weight = control.StateSpace(weight.A, weight.B, weight.C * scale, weight.D * scale, weight.dt)
    radius = 0.999 * np.abs(response(weight, LINES))
    return UncertaintyModel(nominal, weight, form, LINES, radius, perturbation="LTI")


@pytest.mark.parametrize(
    ("form", "kind"),
    [(form, kind) for form in FORMS for kind in ("continuous", "discrete", "sampled")][:14],
)
def test_the_worst_plant_lies_in_the_set_and_is_as_bad_as_said(form, kind):
    T = 0.02
    nominal, weight, K = LAG, W, control.tf([3], [1, 2])
    if kind == "discrete":
        nominal, weight, K = (
            control.ss(control.sample_system(control.ss(x), T, "bilinear")) for x in (LAG, W, K)
        )
    if kind == "sampled":
        K = control.sample_system(control.ss(K), T, "bilinear")
        weight = weight * control.ss(control.tf([1], [0.05, 1])) if form == "additive" else weight
    set_ = model(form, nominal=nominal, weight=weight)
    w_P = performance_weight(1.0, M_S=2.0, A=0.1)
    worst = worst_case(set_, K, w_P)
    report = check(set_, K, w_P=w_P)
    assert report.verdict == "robust"
    assert worst.stable
    assert set_.contains(worst.plant)
    assert abs(worst.delta) == pytest.approx(1.0)
    # a sampled loop also sees what folds down: aliases that add little are left out of the plant
    assert worst.achieved == pytest.approx(
        np.max(report.curves.rp), rel=1e-2 if kind == "sampled" else 2e-4
    )
    assert np.max(worst.gain) == pytest.approx(
        worst.achieved, rel=1e-2 if kind == "sampled" else 2e-3
    )


@pytest.mark.attack(every=2)
@pytest.mark.parametrize(("size", "stable"), [(0.2, True), (2.0, False)])
def test_the_worst_plant_of_a_sampled_set_puts_every_alias_in_phase(size, stable):
    """A light mode above the Nyquist frequency: what it folds down makes most of the worst case,
    and it is met.
    """
    w1 = 2 * np.pi * 16
    nominal = LAG + control.ss(control.tf([0.45 * w1**2], [1, 0.06 * w1, w1**2]))
    K = control.ss([], [], [], [[0.5]], 0.05)
    set_ = model(nominal=nominal, weight=control.ss([], [], [], [[size]]))
    worst, report = worst_case(set_, K), check(set_, K)
    assert report.verdict == ("robust" if stable else "not certified")
    assert worst.stable == stable
    assert set_.contains(worst.plant)
    if stable:
        assert worst.gain.max() > 1.3 * np.abs(report.curves.S).max()
        assert worst.plant.nstates >= set_.nominal.nstates + 4
        assert worst.achieved == pytest.approx(worst.gain.max(), rel=0.02)
    else:  # but for what aliases of less than 0.3 % add it stands on the boundary
        assert worst.achieved > 30


@pytest.mark.parametrize("T", [0.0, 0.02])
@pytest.mark.parametrize(
    ("form", "scale"), [(form, scale) for form in FORMS for scale in (1.0, 40.0)][:9]
)
def test_the_worst_plant_is_as_bad_as_said_behind_a_delay(form, T, scale):
    K = control.ss(control.tf([3], [1, 2]))
    nominal, weight = LAG, control.ss(control.tf([0.1], [0.5, 1]))
    if T:
        nominal, weight, K = (control.sample_system(x, T, "bilinear") for x in (nominal, weight, K))
    worst = worst_case(model(form, scale, nominal, weight), K, delay=0.1)
    assert abs(worst.delta) <= 1 + 1e-12
    assert np.isinf(worst.gain.max()) == (scale > 1)
    if (
        scale > 1
    ):  # on the stability boundary: a pole on the axis where the sensitivity is looked at
        assert worst.achieved > 1e3
    else:
        assert worst.achieved == pytest.approx(worst.gain.max(), rel=1e-4)
    at = np.array([worst.omega_worst])
    L = response(worst.plant, at) * response(K, at) * np.exp(-0.1j * at)
    assert 1 / worst.achieved == pytest.approx(
        np.abs(1 + L)[0], rel=1e-6 if scale == 1 else 0.5, abs=1e-13
    )


@pytest.mark.parametrize("form", FORMS)
def test_where_the_set_is_too_large_a_plant_destabilises(form):
    K = control.tf([3], [1, 2])
    margin = check(model(form), K).margins.rs
    for scale, stable in ((0.98 * margin, True), (1.02 * margin, False)):
        worst = worst_case(model(form, scale), K)
        assert np.isinf(worst.gain).any() != stable
        if not stable:
            # the smallest perturbation that reaches the boundary, then a little more
            assert abs(worst.delta) == pytest.approx(
                1 / 1.02, rel=1e-3 if form != "coprime" else 0.05
            )
            assert worst.achieved > 1e3
        assert worst.stable == stable


def test_worst_case_refuses_an_unstable_loop():
    with pytest.raises(ValueError, match="K must stabilise the nominal plant"):
        worst_case(model(), -5.0)
    with pytest.raises(ValueError, match="model must be an UncertaintyModel"):
        worst_case(LAG, 1.0)


def test_sampled_loops_have_the_delay_itself():
    """At w delay = 40 an approximation has lost the phase, and with it the bound of the whole
    set.
    """
    family = sample_loops(
        model("multiplicative"), control.tf([0.4], [0.01, 1]), 10, delay=4.0, rng=0
    )
    assert family.stable.all()
    assert np.all(np.abs(family.S) <= family.worst * (1 + 1e-6))


@pytest.mark.parametrize("T", [0.0, 0.02])
def test_sampled_loops_stay_under_the_worst_case(T):
    K = control.ss([], [], [], [[1.5]], T) if T else 1.5
    family = sample_loops(model(), K, 40, delay=T, rng=3)
    assert family.stable.all()
    assert family.S.shape == (40, family.omega.size)
    slack = 1.005 if T else 1 + 1e-9
    assert np.all(np.abs(family.S) <= family.worst * slack)
    assert np.max(np.abs(family.S) / family.worst) > 0.9


@pytest.mark.parametrize("dt", [0.0, 0.01])
def test_sampled_plants_have_one_gain_of_at_most_one_at_all_frequencies(dt):
    """Their perturbation is a stable all-pass: half of them stand on the rim, at every frequency."""
    nominal, weight = (control.sample_system(x, dt, "bilinear") if dt else x for x in (LAG, W))
    set_, omega = model(nominal=nominal, weight=weight), np.geomspace(0.1, 300, 200)
    w, gains = response(weight, omega), []
    for plant in set_.sample(50, rng=1):
        assert np.all(np.abs(plant.poles()) < 1) if dt else np.all(plant.poles().real < 0)
        size = np.abs((response(plant, omega) / response(nominal, omega) - 1) / w)
        assert np.ptp(size) < 1e-9
        gains.append(size.max())
    assert max(gains) <= 1 + 1e-9
    assert 10 < np.sum(np.array(gains) > 1 - 1e-9) < 40


@pytest.mark.parametrize("form", FORMS[:4])
def test_perturbed_systems_are_what_the_formula_says(form):
    G = control.ss([[-1.0, 0], [1, -2]], [[1.0], [0]], [[0, 3.0]], [[0.5]])
    Delta = -0.9 * control.ss(control.tf(np.poly([4.0, 40.0]), np.poly([-4.0, -40.0])))
    omega = np.geomspace(0.1, 100, 30)
    wanted = PERTURBED[form](*(response(s, omega) for s in (G, W, Delta)))
    found = model(form, nominal=G).perturbed(Delta)
    assert response(found, omega) == pytest.approx(wanted, rel=1e-9)


@pytest.mark.parametrize("form", FORMS[:4])
def test_loop_bounds_are_sufficient(form):
    """Any L above low or below high meets |w_P| max |S_p| <= 1, whatever its phase."""
    set_, w_P = model(form, 2.0), performance_weight(2.0, M_S=2.0, A=1e-2)
    low, high = robust.shaping.loop_bounds(set_, w_P)
    G, w, p = response(LAG, LINES), response(set_.weight, LINES), np.abs(response(w_P, LINES))
    assert np.isfinite(low[low > 0]).all()
    assert (low > 0).any() or np.isfinite(high).any()
    for angle in np.linspace(0, 2 * np.pi, 37):
        for k, (least, most) in enumerate(zip(low, high, strict=True)):
            size = least * 1.0001 if least > 0 else most * 0.9999 if np.isfinite(most) else None
            if size:
                K = size * np.exp(1j * angle) / G[k : k + 1]
                worst = worst_sensitivity(form, w[k : k + 1], G=G[k : k + 1], K=K)
                assert p[k] * worst[0] <= 1


def test_delay_weight_covers_every_delay_and_gain():
    omega = np.geomspace(1e-2, 1e5, 3000)
    for gain in (0.0, 0.2):
        size = np.abs(response(delay_weight(0.01, gain=gain), omega))
        for theta in np.linspace(0, 0.01, 21):
            for k in (1 - gain, 1 + gain):
                assert np.all(size >= np.abs(k * np.exp(-1j * omega * theta) - 1) * (1 - 1e-9))
        radius = np.max(
            [np.abs((1 + gain) * np.exp(-1j * omega * t) - 1) for t in np.linspace(0, 0.01, 2001)],
            axis=0,
        )
        assert np.max(size / radius) < 1.06


def test_control_weight():
    for order in (1, 2):
        size = np.abs(
            response(control_weight(50.0, M_u=4.0, A=0.01, order=order), np.array([1e-6, 1e9]))
        )
        assert size == pytest.approx([0.25, 100.0], rel=1e-4)


@pytest.mark.parametrize("dt", [0.0, 0.05])
@pytest.mark.parametrize(("dc", "high"), [(1e3, 0.5), (1e-3, 40.0)])
def test_makeweight_has_its_three_gains_and_no_other_in_between(dc, high, dt):
    top = np.pi / dt if dt else 1e12
    for order in (1, 2, 5):
        W = makeweight(dc, (7.0, 0.8), high, order=order, dt=dt)
        assert W.nstates == order
        assert np.abs(response(W, np.array([1e-9, 7.0, top]))) == pytest.approx(
            [dc, 0.8, high], rel=1e-6
        )
        size = np.abs(response(W, np.geomspace(1e-3, min(top, 1e6), 500)))
        assert np.all(np.diff(size) * np.sign(high - dc) > -1e-9 * size[1:])
        assert np.all(np.abs(W.poles()) < 1) if dt else np.all(W.poles().real < 0)
        assert np.all(np.abs(W.zeros()) < 1) if dt else np.all(W.zeros().real < 0)
    steep, flat = (
        np.abs(response(makeweight(dc, 7.0, high, order=n, dt=dt), np.array([9.0])))[0]
        for n in (3, 1)
    )
    assert abs(np.log(steep)) > abs(np.log(flat))


def test_makeweight_inverts_a_performance_weight():
    """1/w_P of first order has A at zero, M_S far above and its own gain at omega_B."""
    w_P, at = performance_weight(10.0, M_S=1.5, A=1e-3), np.array([10.0])
    W = makeweight(1e3, (10.0, float(np.abs(response(w_P, at))[0])), 1 / 1.5)
    omega = np.geomspace(1e-3, 1e4, 50)
    assert response(W, omega) == pytest.approx(response(w_P, omega), rel=1e-9)


def test_discretize():
    K = control.tf([1, 2], [0.05, 1])
    for prewarp in (0.0, 30.0):
        Kd = discretize(K, 0.02, prewarp=prewarp)
        at = np.array([prewarp or 1e-6])
        assert response(Kd, at) == pytest.approx(response(control.ss(K), at), rel=1e-9)
    ours, theirs = discretize(K, 0.02), control.sample_system(control.ss(K), 0.02, "bilinear")
    omega = np.linspace(1, 150, 20)
    assert response(ours, omega) == pytest.approx(response(theirs, omega), rel=1e-9)


@pytest.mark.parametrize("n", [2, pytest.param(5, marks=pytest.mark.attack)])
def test_the_order_scan_finds_the_order(n):
    f = np.arange(1, 200, 2) * 0.5

    def plant(s):
        return 1e4 / (s * s + 3 * s + 8e3) + 4e4 / (s * s + 8 * s + 9e4)

    found = []
    for seed in range(n):
        bla = make_bla(plant, f, f0=0.5, sigma_noise=0.01 * np.abs(plant(2j * np.pi * f)), rng=seed)
        scan = scan_orders(bla, n_poles=range(2, 8), relative_degree=2)
        found.append(scan.best)
        assert scan.fit.G.nstates == scan.best
        assert scan.cost[0] > 100 * scan.cost[2]
    assert np.median(found) == 4
    assert "(taken)" in unwrapped(scan)
    with pytest.raises(ValueError, match="n_poles must be at least the relative degree 3"):
        scan_orders(bla, n_poles=[2, 4], relative_degree=3)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: control_weight(-1.0), "omega_bc must be positive"),
        (lambda: control_weight(1.0, A=2.0), "A must be below M_u"),
        (
            lambda: makeweight(1.0, 5.0, 0.1),
            "the gain at crossover must be between dc = 1 and high = 0.1, got 1",
        ),
        (lambda: makeweight(10.0, (5.0, 20.0), 0.1), "the gain at crossover must be between"),
        (
            lambda: makeweight(10.0, 70.0, 0.1, dt=0.05),
            "crossover must lie below the Nyquist frequency 62.8319",
        ),
        (lambda: makeweight(0.0, 5.0, 0.1), "dc must be positive"),
        (lambda: delay_weight(0.0), "delay must be positive"),
        (lambda: delay_weight(1.0, gain=1.0), "gain must be below 1"),
        (lambda: discretize(control.tf([1], [1, 0.5], 0.1), 0.1), "K must be continuous"),
        (lambda: discretize(1.0, 0.1, prewarp=40.0), "prewarp must lie below the Nyquist"),
        (lambda: discretize(control.tf([1], [1, -20.0]), 0.1), "must have no pole at s = 2/dt"),
        (
            lambda: robust.margins.nu_gap(
                control.tf([1], [1, 1], 0.1), control.tf([1], [1, 0.5], 0.1)
            ),
            "must have no pole at z = -1",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


PLANT_2X2 = control.StateSpace(
    [[-1, 0.2], [0, -3]], np.eye(2), [[1, 0.3], [-0.2, 2]], np.zeros((2, 2))
)
K_2X2 = control.StateSpace([], [], [], 3 * np.eye(2))


def set_of_several(form, size):
    """A set around a plant of two inputs and outputs, with weights that rise from 1 to 20 rad/s."""

    def w(x):
        return control.ss(control.tf([0.5 * x * size, x * size], [0.05, 1]))

    omega = np.geomspace(0.1, 30, 20)
    left = () if form == "elements" else tuple(map(w, (0.3, 0.2)))
    gains = (control.ss([], [], [], [[x]]) for x in (0.5, 0.4))
    right = tuple(map(w, (0.1, 0.05, 0.02, 0.1))) if form == "elements" else tuple(gains)
    radius = np.array([np.abs(response(weight, omega)) for weight in (*left, *right)])
    return UncertaintyModel(
        nominal=PLANT_2X2, form=form, left=left, right=right, omega=omega, radius=radius
    )


@pytest.mark.attack(every=5)
@pytest.mark.parametrize("w_P", [None, performance_weight(1.0, M_S=2.0, A=0.1)])
@pytest.mark.parametrize(("form", "size"), [("elements", 0.2), ("additive", 0.1), ("input", 0.1)])
def test_the_worst_plant_of_several_channels_reaches_the_bound(form, size, w_P):
    set_ = set_of_several(form, size)
    worst = worst_case(set_, K_2X2, w_P)
    assert worst.stable
    assert set_.contains(worst.plant)
    assert np.linalg.norm(worst.delta, 2) == pytest.approx(1.0, abs=1e-6)
    assert 0.98 * worst.gain.max() < worst.achieved < worst.gain.max() * (1 + 1e-6)
    s = 1j * worst.omega_worst
    S = np.linalg.inv(np.eye(2) + worst.plant(s) @ K_2X2.D) * (1.0 if w_P is None else w_P(s))
    assert np.linalg.norm(S, 2) == pytest.approx(worst.achieved, rel=1e-9)


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["elements", "additive", "input"])
def test_no_random_plant_of_several_channels_is_beyond_the_worst(form):
    set_ = set_of_several(form, 0.1 if form != "elements" else 0.2)
    family = sample_loops(set_, K_2X2, 20, rng=0)
    assert family.stable.all()
    assert family.S.shape == (20, family.omega.size)
    assert np.all(family.worst * (1 + 1e-6) >= family.S)
    assert family.S.max() > 1.005 * family.nominal.max()  # and they are not the nominal
    plants = set_.sample(5, rng=1)
    assert all(map(set_.contains, plants))
    assert (
        max(set_.distance(plant).max() for plant in plants) > 0.7
    )  # some have |Delta| = 1 under a weight above 0.7


@pytest.mark.parametrize("form", ["elements", "additive", "input"])
def test_a_set_of_several_channels_that_is_not_stable_has_a_plant_that_shows_it(form):
    set_ = set_of_several(form, 20.0)
    worst = worst_case(set_, K_2X2)
    assert not worst.stable
    assert np.isinf(worst.gain).any()
    assert set_.contains(worst.plant)
    assert np.linalg.norm(worst.delta, 2) <= 1 + 1e-9
    assert worst.achieved > 1e6  # on the boundary
    assert not sample_loops(set_, K_2X2, 20, rng=0).stable.all()
    with pytest.raises(ValueError, match="K must stabilise the nominal plant"):
        worst_case(set_, -K_2X2)
    with pytest.raises(ValueError, match="delay must be in the nominal for several channels"):
        sample_loops(set_, K_2X2, 5, delay=0.1)


@pytest.mark.parametrize("form", FORMS)
def test_the_check_names_the_largest_sensitivity_of_the_worst_plant(form):
    K = control.tf([3], [1, 2])
    report, worst = check(model(form), K), worst_case(model(form), K)
    assert report.margins.S_worst == pytest.approx(worst.achieved, rel=1e-3)
    assert f"max |S|: {report.margins.S_worst:.4g} at" in unwrapped(str(report))
    assert ("thin margins" in str(report)) == (report.margins.S_worst > 2)
    # with any demand the largest |S| is the same one, not that of w_P S
    assert check(model(form), K, w_P=performance_weight(1.0)).margins.S_worst == pytest.approx(
        report.margins.S_worst, rel=1e-9
    )
    if form != "coprime":  # whose weight stays below one
        far = check(model(form, 40.0), K)
        assert not np.isfinite(far.margins.S_worst)
        assert ("max |S|: infinite at" in unwrapped(str(far))) == np.isinf(far.margins.S_worst)
    assert np.isnan(check(model(form), -3.0).margins.S_worst)


def test_the_check_of_several_channels_names_the_largest_singular_value():
    set_ = set_of_several("additive", 0.1)
    K = control.ss([], [], [], 0.5 * np.eye(2), set_.nominal.dt)
    report, worst = check(set_, K), worst_case(set_, K)
    assert report.margins.S_worst == pytest.approx(worst.gain.max(), rel=1e-9)
    said = unwrapped(str(report))
    assert f"max |S|: {report.margins.S_worst:.4g} at" in said
    assert "bound of its largest singular value over the set" in said


def test_a_stable_loop_with_thin_margins_is_warned_of():
    """A light mode under a gain is stable with its whole set, and close to instability with one
    plant of it.
    """
    G = control.ss(control.tf([1], [1, 0.4, 1]))
    set_ = UncertaintyModel(
        G, control.ss([], [], [], [[0.3]]), "multiplicative", LINES, np.full(3, 0.29)
    )
    report = check(set_, 0.8)
    assert report.proofs.robustly_stable
    assert report.margins.S_worst > 2
    found = unwrapped(str(report))
    assert report.summary.startswith("verdict:     STATISTICALLY ROBUST, THIN MARGINS: ")
    assert (
        f"warning: thin margins: |S| reaches {report.margins.S_worst:.3g} over the set, at" in found
    )
    assert "To lower |S|: a lower gain" in found
    assert check(set_, 0.8 * 0.9).margins.S_worst < 0.98 * report.margins.S_worst
    assert "thin margins" not in str(check(set_, 1e-3))


def test_the_peak_of_the_demand_is_the_peak_that_is_warned_of():
    """Where w_P allows |S| = 2.5 a smaller one is no thin margin; a demand without a peak leaves
    the usual limit.
    """
    G = control.ss(control.tf([1], [1, 0.4, 1]))
    set_ = UncertaintyModel(
        G, control.ss([], [], [], [[0.3]]), "multiplicative", LINES, np.full(3, 0.29)
    )
    K = 0.5
    worst = check(set_, K).margins.S_worst
    assert 2.02 < worst < 2.4  # between the customary peak and that of the demand
    strictly_proper, weak = control.tf([0.1], [1, 0.1]), control.tf([0.1], [1])
    for w_P, peak in (
        (performance_weight(1e-3, M_S=2.5), 2.5),
        (performance_weight(1e-3, M_S=2.5, order=2), 2.5),
        (performance_weight(1e-3, M_S=1.5), 1.5),
        (performance_weight(1e-3, M_S=2.5, A=2.4), 2.5),
        (None, 2.0),
        (strictly_proper, 2.0),
        (weak, 2.0),
    ):
        report = check(set_, K, w_P=w_P)
        assert report.peak == pytest.approx(peak, rel=1e-6)
        assert ("thin margins" in str(report)) == bool(report.thin_margins) == (worst > 1.01 * peak)
