"""Learning filters: closed forms of the disc, the factor against plants of the set, trials, files,
refusals.
"""

import warnings
from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust import cli
from robust.proofs.exact.learning import LearningClaim, prove_learning

T = 0.05
OMEGA = np.geomspace(0.1, 50, 30)
PI = robust.lti.discretize(control.tf([1, 1.5], [1, 0]), T)


def make(form="multiplicative", size=0.2, sampled=False, perturbation="LTI"):
    """A mass on a spring, with a weight that is constant where it may be."""
    G = control.tf([4], [1, 1.6, 4])
    dt = T if sampled else 0
    # of a continuous additive set the weight has to fall off, or what folds down has no bound
    w = (
        control.ss([], [], [], [[size]], dt)
        if sampled or form != "additive"
        else control.tf([size], [0.2, 1])
    )
    return robust.UncertaintyModel(
        robust.sampled(G, T) if sampled else G, w, form, OMEGA, perturbation=perturbation
    )


@pytest.fixture(scope="module")
def aliased():
    return robust.design_learning(make("additive"), PI, delay=0.7 * T)


@pytest.fixture(scope="module")
def sampled():
    return robust.design_learning(make(sampled=True), PI)


def least_factor(learning, omega):
    """The best factor in the closed form of a multiplicative set: |w| |1 - T| / |1 - |w|^2 T*|."""
    z = np.exp(1j * omega * T)
    L = learning.model.nominal(z) * PI(z)
    closed, w = L / (1 + L), abs(learning.model.weight.D[0, 0])
    return abs(w * (1 - closed)) / abs(1 - w**2 * np.conj(closed))


def test_the_factor_is_that_of_the_closed_form(sampled):
    omega = np.geomspace(0.05, 20, 7)
    wanted = [least_factor(sampled, one) for one in omega]
    assert np.allclose(sampled.without_Q(omega), wanted, rtol=1e-9)
    centre, radius = sampled.disc(omega)
    assert np.allclose(radius / np.abs(centre), wanted, rtol=1e-9)


@pytest.mark.parametrize("which", ["aliased", "sampled"])
def test_no_plant_of_the_set_has_a_larger_factor(which, request):
    learning = request.getfixturevalue(which)
    omega = np.geomspace(0.02, 0.999 * np.pi / T, 150)
    Q, L, z = learning.Q(omega), learning.filter(omega), np.exp(1j * omega * T)
    largest = 0.0
    for plant in learning.model.sample(12, rng=1):
        G = (plant if plant.dt else robust.sampled(plant, T, learning.delay))(z)
        largest = max(largest, np.abs(Q * (1 - L * G / (1 + G * PI(z)))).max())
    assert learning.proved
    assert 0.2 * learning.factor < largest <= learning.factor


def test_a_level_below_the_largest_factor_is_not_proved(sampled):
    (stability,) = robust.check(sampled.model, sampled.K).proofs.certificates
    claim = LearningClaim(
        loop=stability.claim, omega_Q=sampled.omega_Q, full=sampled.full, level=sampled.factor
    )
    assert prove_learning(claim, time_cap=20).holds
    assert not prove_learning(replace(claim, level=0.99 * sampled.factor), time_cap=2).holds


@pytest.mark.parametrize("form", ["inverse-multiplicative", "inverse-additive"])
def test_inverse_forms_of_a_sampled_model_are_proved(form):
    learning = robust.design_learning(make(form, sampled=True), PI)
    assert learning.proved
    assert 0 < learning.factor < 0.8


def test_coprime_factors_have_a_disc_and_no_proof():
    learning = robust.design_learning(make("coprime", 0.1, sampled=True), PI)
    omega = np.array([0.3, 2.0])
    centre, radius = learning.disc(omega)
    for plant in learning.model.sample(5, rng=1):
        G = plant(np.exp(1j * omega * T))
        J = G / (1 + G * PI(np.exp(1j * omega * T)))
        assert np.all(np.abs(J - centre) <= radius * (1 + 1e-6))
    assert not learning.proved
    assert "not proved between them: the coprime form has no such proof" in " ".join(
        f"{learning}".split()
    )


def test_a_larger_set_learns_less():
    cutoffs = [
        robust.design_learning(make(size=size, sampled=True), PI, factor=0.3).omega_Q
        for size in (0.25, 0.4)
    ]
    assert cutoffs[0] > cutoffs[1]


def test_the_nominal_inverse_holds_on_a_grid_and_learns_less(sampled):
    plain = robust.design_learning(make(sampled=True), PI, L="nominal", factor=0.3)
    best = robust.design_learning(make(sampled=True), PI, factor=0.3)
    assert plain.omega_Q <= best.omega_Q
    assert not plain.proved
    assert f"on {plain.omega.size} frequencies up to Nyquist, not proved" in " ".join(
        f"{plain}".split()
    )


def trials(learning, plant, n=800, count=6):
    """The rms error of trials on a linear plant."""
    t, J = np.arange(n) * T, control.feedback(plant, PI)
    r = np.interp(t, [2, 6], [0, 1])
    free = r - control.forced_response(control.feedback(plant * PI), t, r).outputs
    u, found = np.zeros(n), []
    for _ in range(count):
        e = free - control.forced_response(J, t, u).outputs
        found.append(float(np.linalg.norm(e)))
        u = learning.update(u, e)
    return np.array(found), u


def test_trials_learn_on_the_worst_plant(sampled):
    plant = sampled.model.perturbed(control.ss([], [], [], [[-1.0]], T))
    sizes, u = trials(sampled, plant)
    assert np.all(np.diff(sizes) < 0)
    assert sizes[-1] < sizes[0] / 20
    assert np.isclose(u[-1], u[-10], rtol=1e-3)  # held in the end


def test_update_keeps_shape_and_limit(sampled):
    e = np.sin(np.arange(400) * T)
    u = sampled.update(np.zeros((400, 1)), e[:, None])
    assert u.shape == (400, 1)
    limited = replace(sampled, u_max=0.1).update(np.zeros(400), e)
    assert np.abs(limited).max() == pytest.approx(0.1)
    assert np.abs(u).max() > 0.1


def test_update_is_linear_and_zero_of_nothing(sampled):
    rng = np.random.default_rng(2)
    u, e = rng.standard_normal((2, 300))
    zero = np.zeros(300)
    assert np.abs(sampled.update(zero, zero)).max() == 0
    assert np.allclose(
        sampled.update(u, e), sampled.update(u, zero) + sampled.update(zero, e), atol=1e-9
    )


def test_a_file_gives_the_filter_back(aliased, tmp_path):
    robust.save(aliased, tmp_path / "learning.json")
    back = robust.load(tmp_path / "learning.json")
    e = np.sin(np.arange(300) * T)
    assert np.array_equal(back.update(0 * e, e), aliased.update(0 * e, e))
    assert f"{back}" == f"{aliased}"


REFUSED = {
    "model must be an UncertaintyModel": lambda: robust.design_learning(
        control.tf([1], [1, 1]), PI
    ),
    "K must be sampled": lambda: robust.design_learning(make(), control.tf([1], [1])),
    'got the class "operator"': lambda: robust.design_learning(make(perturbation="operator"), PI),
    "multiplicative or additive for a sampled K": lambda: robust.design_learning(
        make("inverse-additive"), PI
    ),
    "factor must be below 1": lambda: robust.design_learning(make(), PI, factor=1.5),
    "u_max must be a positive": lambda: robust.design_learning(make(), PI, u_max=0),
    'L must be "set", "nominal" or a system': lambda: robust.design_learning(make(), PI, L="best"),
    "K must stabilise every plant of the set": lambda: robust.design_learning(make(size=3.0), PI),
    "omega_Q must give a factor per trial below 1": lambda: robust.design_learning(
        make(size=0.3, sampled=True), PI, L=control.ss([], [], [], [[50.0]], T), omega_Q=20.0
    ),
}


@pytest.mark.parametrize("message", REFUSED)
def test_refusals(message):
    with pytest.raises(ValueError, match=message):
        REFUSED[message]()


def test_trials_that_do_not_fit(sampled):
    with pytest.raises(ValueError, match="e must have a sample for each of the 300 of u, got 299"):
        sampled.update(np.zeros(300), np.zeros(299))
    with pytest.raises(
        ValueError, match=r"u must be real samples of one channel, \(n,\) or \(n, 1\)"
    ):
        sampled.update(np.zeros((300, 2)), np.zeros(300))
    with pytest.raises(ValueError, match="e must be finite, got nan"):
        sampled.update(np.zeros(300), np.full(300, np.nan))
    with pytest.warns(robust.DesignWarning, match="is shorter than the longest time constant"):
        sampled.update(np.zeros(5), np.zeros(5))


def test_the_commands_design_and_step(tmp_path, capsys):
    model, K, learning, u, e, following = (
        tmp_path / name for name in ("m.json", "k.json", "l.json", "u.csv", "e.csv", "next.csv")
    )
    robust.save(make(sampled=True), model)
    robust.save(PI, K, delay=0.0)
    u.write_text("\n".join(["0"] * 300))
    e.write_text("t,e\n" + "\n".join(f"{k},{np.sin(k * T)}" for k in range(300)))
    cli.app(["learn", str(model), str(K), "-o", str(learning)], standalone_mode=False)
    cli.app(
        ["learn", "step", str(learning), str(u), str(e), "-o", str(following)],
        standalone_mode=False,
    )
    found = np.loadtxt(following, delimiter=",", skiprows=1)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        wanted = robust.load(learning).update(np.zeros(300), np.sin(np.arange(300) * T))
    assert np.allclose(found[:, 1], wanted, rtol=1e-12)
    assert "u: column 'col1' of u.csv, which has no times\ne: column 'e' of e.csv\n300 samples" in (
        capsys.readouterr().out
    )
    e.write_text("t [s],e\n" + "\n".join(f"{0.5 * T * k},{np.sin(k * T)}" for k in range(300)))
    with pytest.raises(ValueError, match=r"e must be sampled every 0\.05 s like the controller"):
        cli.app(
            ["learn", "step", str(learning), str(u), str(e), "-o", str(following)],
            standalone_mode=False,
        )


def test_pictures(sampled):
    from matplotlib.figure import Figure

    left, right = Figure().subplots(1, 2)
    robust.plot.plot_contraction(sampled, ax=left)
    robust.plot.plot_trials(np.array([2.0, 1.0, 0.5]), ax=right)
    assert np.allclose(right.get_lines()[0].get_ydata(), [1, 0.5, 0.25])
    assert left.get_lines()[0].get_ydata().max() <= sampled.factor
