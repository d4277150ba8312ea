"""The coprime form: its disc by brute force, its margin by `ncf_margin`, its plants by `nu_gap`;
scaling, refusals.
"""

import control
import numpy as np
import pytest
from scipy.io import loadmat

import robust
from robust import (
    UncertaintyModel,
    check,
    fit_nominal,
    frd,
    load,
    ncfsyn,
    performance_weight,
    sampled,
    save,
    uncertainty,
    worst_case,
)
from robust.analysis import sample_loops
from robust.io import export_matlab
from robust.lti import discretize
from tests.support.bla import make_bla
from tests.support.exact_claims import loop_claim, matrices, proved
from tests.support.forms import PERTURBED, chord
from tests.support.random_loops import closed_loop_poles, dense_grid, random_case, tf_response, zpk
from tests.support.responses import response

LINES = np.array([0.1, 1.0, 10.0])
PLANTS = {
    "lag": (control.tf([2], [1, 1]), control.tf([3], [1, 2])),
    "integrator": (control.tf([1], [1, 0]), control.tf([1, 0.5], [0.1, 1])),
    "unstable": (control.tf([1], [1, -0.2]), control.tf([3, 1], [1, 0])),
    "undamped": (control.tf([1], [1, 0, 1]), control.tf([0.5, 1.0], [0.05, 1.0])),
    "biproper": (control.tf([1, 3], [2, 1]), control.tf([0.4, 1], [1, 1])),
}


def the_model(G, w, W1=1.0, W2=1.0):
    w = w if isinstance(w, control.StateSpace) else control.ss([], [], [], [[w]], G.dt)
    return UncertaintyModel(
        G,
        w,
        "coprime",
        LINES * (0.1 if G.dt else 1),
        np.full(3, 1e-6),
        perturbation="LTI",
        scaling=(W1, W2),
    )


def on_lines(G, eps):
    """A set around responses that were measured, one a line, in the units of the plant."""
    omega = np.arange(1.0, G.size + 1)
    return UncertaintyModel(
        control.frd(G, omega),
        eps,
        "coprime",
        omega,
        np.full(G.size, 0.99 * eps),
        scaling=(1.0, 1.0),
    )


def test_the_set_is_that_of_perturbed_factors():
    """(N + d_N)/(M + d_M) with |[d_N, d_M]| <= eps fills the disc, no more."""
    rng = np.random.default_rng(1)
    for eps in rng.uniform(0.02, 0.95, 40):
        G = np.full(4000, rng.normal() + 1j * rng.normal())
        model = on_lines(G, eps)
        M = 1 / np.sqrt(1 + np.abs(G) ** 2)
        d = rng.normal(size=(2, 4000)) + 1j * rng.normal(size=(2, 4000))
        d *= eps / np.linalg.norm(d, axis=0)
        made = control.frd((G * M + d[0]) / (M + d[1]), model.omega)
        assert model.contains(made)
        assert 0.98 < model.distance(made).max() <= 1 + 1e-12
        (sample,) = model.sample(1, rng=0)
        assert np.all(model.distance(sample) <= 1 + 1e-9)
        rim = PERTURBED["coprime"](G, eps, np.exp(1j * np.linspace(0, 2 * np.pi, 4000)))
        assert model.distance(control.frd(rim, model.omega)) == pytest.approx(1, rel=1e-9)


@pytest.mark.parametrize("name", PLANTS)
@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_a_flat_weight_is_robust_up_to_the_ncf_margin(name, dt):
    """Stable for all of |w| = eps if and only if eps < ncf_margin (Vinnicombe); samples keep their
    distance.
    """
    G, K = map(control.ss, PLANTS[name])
    if dt:
        G, K = sampled(G, dt), discretize(K, dt)
    margin = robust.margins.ncf_margin(G, K)
    for factor, verdict in ((0.999, "robust"), (1.001, "not robust")):
        report = check(the_model(G, factor * margin), K)
        assert report.verdict == verdict
        assert report.margins.rs == pytest.approx(1 / factor, rel=1e-6)
    model = the_model(G, 0.9 * margin)
    for plant in model.sample(5, rng=0):
        assert robust.margins.nu_gap(G, plant) <= 0.9 * margin * (1 + 1e-6)
    family = sample_loops(model, K, 5, rng=1)
    assert family.stable.all()
    assert np.all(np.abs(family.S) <= family.worst * (1 + 1e-6))
    worst = worst_case(model, K)
    assert robust.margins.nu_gap(G, worst.plant) == pytest.approx(0.9 * margin, rel=1e-6)
    assert worst.stable
    assert worst.achieved == pytest.approx(worst.gain.max(), rel=1e-2)
    beyond = worst_case(the_model(G, 1.1 * margin), K)
    assert robust.margins.nu_gap(G, beyond.plant) == pytest.approx(margin, rel=1e-3)
    assert beyond.achieved > 1e3


def test_a_pole_that_crosses_the_axis():
    """1/(s + 0.1) and 1/(s - 0.1) lie near each other: one set of this form holds both, and K = 2
    keeps it.
    """
    first, last = control.tf([1], [1, 0.1]), control.tf([1], [1, -0.1])
    model = the_model(
        control.tf([1], [1, 0]), robust.margins.nu_gap(control.tf([1], [1, 0]), last) * 1.001
    )
    assert model.contains(first)
    assert model.contains(last)
    report = check(model, 2.0)
    assert report.verdict == "robust"
    for plant in (first, last):
        assert np.all(control.feedback(plant, 2.0).poles().real < 0)


def test_factors_are_normalised_and_complete(tmp_path):
    G = control.ss(control.tf([1, 3], [2, 1, 4, 0]))
    omega = np.geomspace(1e-2, 1e2, 50)
    for plant in (G, sampled(G, 0.05)):
        export_matlab(the_model(plant, 0.1), tmp_path / "m.mat")
        read = loadmat(tmp_path / "m.mat", simplify_cells=True)["content"]
        N, M = (
            control.ss(
                *(np.reshape(read[name][m], getattr(plant, m).shape) for m in "ABCD"), plant.dt
            )
            for name in "NM"
        )
        n, m = response(N, omega[:40]), response(M, omega[:40])
        assert np.abs(n) ** 2 + np.abs(m) ** 2 == pytest.approx(1.0, rel=1e-9)
        assert n / m == pytest.approx(response(plant, omega[:40]), rel=1e-6)
        assert np.all(np.abs(M.poles()) < 1 if plant.dt else M.poles().real < 0)


def as_claim(case, claims, w_P=None, shaping=(), scaling=1.0, delay=0.0):
    return loop_claim(
        case["G"],
        case["K"],
        case["w"],
        "coprime",
        w_P=w_P,
        delay=delay,
        claims=claims,
        scaling=scaling,
        shaping=tuple(map(matrices, shaping)),
    )


def random_scaling(rng, dt):
    roots = -(10 ** rng.uniform(-1, 1, 2))
    z, p = np.exp(roots * dt) if dt else roots
    return zpk([z + 0j], [p + 0j], 10 ** rng.uniform(-1, 1), dt)


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("seed", range(3))
def test_claims_are_decided_beside_their_limits(seed):
    """Stability, performance, performance with one scaling:

    1e-4 on either side of the largest value of a fine grid.
    """
    rng, count = np.random.default_rng(seed), 0
    while count < 4:
        case = random_case(rng)
        if not case["stable"] or case["kind"] == "sampled":
            continue
        dt, omega = float(case["G"].dt or 0), case["omega"]
        W = random_scaling(rng, dt)
        w_P = (
            zpk([np.exp(-2 * dt)], [np.exp(-0.1 * dt)], 0.1, dt) if dt else zpk([-2.0], [-0.1], 0.1)
        )
        omega = np.unique(
            np.concatenate([omega, dense_grid(dt, W.poles(), W.zeros(), w_P.poles())])
        )
        G, K, w, P, scale = (
            tf_response(x, omega) for x in (case["G"], case["K"], case["w"], w_P, W)
        )
        delay = 0.0 if dt or rng.random() < 0.5 else 10 ** rng.uniform(-6, -4)
        if delay and closed_loop_poles(case["G"], case["K"]).real.max() > -1e-2:
            continue
        L = G * K * np.exp(-1j * omega * delay)
        g, k, S = np.abs(scale * G), np.abs(K / scale), 1 / (1 + L)
        gain = np.sqrt((1 + g**2) * (1 + k**2)) * np.abs(S)
        peak = np.max(np.abs(w) * gain)
        common = {"shaping": (W,), "delay": delay}
        for factor, true in ((1 - 1e-4, True), (1 + 1e-4, False)):
            loop = as_claim(
                case | {"w": case["w"] * (factor / peak)}, ("robust stability",), **common
            )
            assert proved().again(loop).verified == true
        eps = 0.7 / peak * np.abs(w)
        if eps.max() >= 1:
            continue
        edge = eps * np.sqrt(1 - eps**2) * k * (1 + g**2)
        worst = np.abs(P) * (np.abs(1 + L - eps**2 * (1 + g**2)) + edge)
        worst = np.max(worst / (np.abs(1 + L) ** 2 - eps**2 * (1 + g**2) * (1 + k**2)))
        for factor, true in ((1 - 1e-4, True), (1 + 1e-4, False)):
            loop = as_claim(
                case | {"w": case["w"] * (0.7 / peak)},
                ("robust stability", "robust performance"),
                w_P * (factor / worst),
                **common,
            )
            assert proved().again(loop).verified == true
        d, m = 10 ** rng.uniform(-0.5, 0.5), np.sqrt(1 + g**2)
        k_c, Wp = K / scale * np.exp(-1j * omega * delay), P
        X = np.array(
            [
                [-eps * k_c * S * m, d * eps * k_c * S],
                [eps * S * m, d * eps * L * S],
                [-Wp / d * S * m, Wp * S],
            ]
        )
        norm = np.linalg.norm(X.transpose(2, 0, 1), 2, axis=(1, 2)).max()
        for factor, true in ((1 - 1e-4, True), (1 + 1e-4, False)):
            loop = as_claim(
                case | {"w": case["w"] * (0.7 / peak * factor / norm)},
                ("robust performance with one scaling",),
                w_P * (factor / norm),
                scaling=d,
                **common,
            )
            assert proved().again(loop).verified == true
        count += 1


@pytest.mark.parametrize("perturbation", ["LTI", "operator"])
@pytest.mark.parametrize("kind", ["continuous", "delay", "sampled"])
def test_what_check_proves_is_verified(perturbation, kind):
    G, K = map(control.ss, PLANTS["unstable"])
    w, W = control.tf([0.04, 0.02], [1, 1]), control.tf([1, 3.0], [1, 1.0])
    delay = 0.05 if kind == "delay" else 0.0
    if kind == "sampled":
        G, K, w, W = sampled(G, 0.02), discretize(K, 0.02), discretize(w, 0.02), discretize(W, 0.02)
    model = UncertaintyModel(
        G, w, "coprime", LINES, np.full(3, 1e-3), perturbation=perturbation, scaling=(2.0, W)
    )  # fmt: skip
    report = check(model, K, delay=delay, w_P=performance_weight(0.05, M_S=8, A=0.9))
    assert report.verdict == "robust"
    assert report.proofs.robust_performance
    for certificate in report.proofs.certificates:
        assert certificate.holds == certificate.verify().verified


def test_the_scaling_is_the_one_of_ncfsyn():
    """A controller for W2 G W1 keeps 1/gamma of the set scaled so; the same loop in other units is
    the same loop.
    """
    G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    W1 = control.tf([1, 2], [1, 0.001])
    design = ncfsyn(G, W1)
    model = the_model(G, 0.99 / design.gamma, W1=W1)
    report = check(model, design.K)
    assert report.verdict == "robust"
    assert report.margins.rs == pytest.approx(1 / 0.99, rel=1e-4)
    units = check(the_model(1e-6 * G, 0.99 / design.gamma, W1=W1, W2=1e6), 1e6 * design.K)
    assert units.margins.rs == pytest.approx(report.margins.rs, rel=1e-6)
    assert (
        check(the_model(1e-6 * G, 0.99 / design.gamma, W1=W1), 1e6 * design.K).verdict
        == "not robust"
    )


F = 0.5 * np.arange(1, 120)
OMEGA = 2 * np.pi * F


def metres_per_newton(s):
    return 1e-6 * 3600 / (s * s + 6 * s + 3600)


def measured(sigma=0.03):
    size = np.abs(metres_per_newton(1j * OMEGA))
    return make_bla(metres_per_newton, F, f0=0.5, sigma_distortion=sigma * size, rng=0)


def test_a_measured_set_is_scaled_to_unit_gain():
    """Metres per newton: unscaled the form would be the additive one, in default scaling it is the
    same in any unit.
    """
    bla = measured()
    nominal = control.ss(control.tf([3.6e-3], [1, 6, 3600]))
    model = uncertainty(bla, nominal, form="coprime", order=3)
    g, log = np.abs(model.at(OMEGA)), np.log(OMEGA)
    middle = np.exp(np.trapezoid(np.log(g), log) / (log[-1] - log[0]))
    assert float(model.scaling[1].D[0, 0]) == pytest.approx(1 / middle, rel=1e-6)
    disc = uncertainty(bla, nominal, form="additive", order=3).radius
    r, g = disc / middle, g / middle
    assert model.radius == pytest.approx(r / np.sqrt((1 + g**2) * (1 + (g - r) ** 2)), rel=1e-9)
    assert np.sum(list(model.budget.values()), axis=0) == pytest.approx(model.radius, rel=1e-9)
    every = np.exp(1j * np.linspace(0, 2 * np.pi, 720))[:, None]
    farthest = model.at(OMEGA) / middle * (1 - r / g)  # of the disc, the point nearest to zero
    plants = np.vstack([model.at(OMEGA) / middle + r * every, farthest])
    assert chord(model.at(OMEGA) / middle, plants).max(axis=0) == pytest.approx(model.radius)
    rim = model.at(OMEGA) + disc * np.exp(1j * np.linspace(0, 60, F.size))
    assert model.contains(control.frd(rim, OMEGA))
    unscaled = uncertainty(bla, nominal, form="coprime", order=3, W1=1.0)
    assert unscaled.radius == pytest.approx(disc, rel=1e-4)
    on_lines = uncertainty(bla, frd(bla), form="coprime", order=3)
    assert on_lines.measured_only
    assert on_lines.contains(on_lines.sample(1, rng=0)[0])


def test_on_measured_lines_hold_and_delay_stand_with_the_controller():
    """rs = eps sqrt((1 + g^2)(1 + k^2)) |S| with g of what was measured and k = |K| times the
    hold.
    """
    bla = measured()
    model = uncertainty(bla, frd(bla), form="coprime", order=3)
    W = float(model.scaling[1].D[0, 0])
    K = control.ss([], [], [], [[2e4]], 0.004)
    with pytest.warns(UserWarning, match="hold of the record"):
        report = check(model, K, delay=0.001)
    x = OMEGA * 0.002
    hold = np.sinc(x / np.pi) * np.exp(-1j * (x + OMEGA * 0.001))
    L = bla.G * hold * 2e4
    g, k = np.abs(W * bla.G), np.abs(2e4 * hold / W)
    eps = np.abs(response(model.weight, OMEGA))
    assert report.curves.rs == pytest.approx(
        eps * np.sqrt((1 + g**2) * (1 + k**2)) / np.abs(1 + L), rel=1e-6
    )


def test_files_keep_the_scaling(tmp_path):
    fit = fit_nominal(measured(), n_poles=2, n_zeros=0)
    model = uncertainty(
        measured(), fit, form="coprime", order=2, W1=control.tf([1, 30], [1, 3.0]), W2=1e6
    )
    save(model, tmp_path / "m.json")
    again = load(tmp_path / "m.json")
    for read, kept in zip(again.scaling, model.scaling, strict=True):
        for matrix in "ABCD":
            assert np.array_equal(getattr(read, matrix), getattr(kept, matrix))
    K = control.tf([2e4], [1, 1.0])
    assert check(again, K).margins.rs == check(model, K).margins.rs
    export_matlab(model, tmp_path / "m.mat")
    assert "case 'coprime'" in (tmp_path / "load_m.m").read_text()


def test_refusals():
    G = control.tf([1], [1, 1])
    with pytest.raises(
        ValueError, match=r"weight must stay below one for the coprime form, got 1.2"
    ):
        the_model(G, 1.2)
    with pytest.raises(
        ValueError, match="W1 must be stable with a stable inverse and a direct term, got 1 states"
    ):
        the_model(G, 0.1, W1=control.tf([1, 1], [1, 0]))
    with pytest.raises(
        ValueError, match=r"W2 must have the sampling time of the nominal, 0 s, got 0.1 s"
    ):
        the_model(G, 0.1, W2=control.tf([1, 0.5], [1, 0.2], 0.1))
    with pytest.raises(ValueError, match="W1 and W2 must be left out except for the coprime form"):
        UncertaintyModel(G, 0.1, "additive", LINES, np.full(3, 0.1), scaling=(2.0, 1.0))
    with pytest.raises(
        ValueError, match=r"K must have the sampling time of the nominal model for the coprime form"
    ):
        check(the_model(G, 0.1), control.ss([], [], [], [[1.0]], 0.1))
    with pytest.raises(
        ValueError, match="form must be a relative deviation of the plant here, got coprime"
    ):
        robust.shaping.loop_bounds(the_model(G, 0.1), performance_weight(1.0))
    with pytest.raises(
        ValueError,
        match=r"reaches \|G\| \+ 1/\|G\| of the scaled plant, got coprime with a radius of",
    ):
        uncertainty(
            measured(sigma=3.0), control.ss(control.tf([3.6e-3], [1, 6, 3600])), form="coprime"
        )
    with pytest.raises(ValueError, match="below and above must give a radius outside the band"):
        uncertainty(
            measured(), control.ss(control.tf([3.6e-3], [1, 6, 3600])), form="coprime", below=40.0
        )
