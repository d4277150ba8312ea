"""Sets from families of plants of several channels: every member inside, the forms against their
formulas.
"""

import control
import numpy as np
import pytest

import robust
from robust.models import choose_form
from robust.models.sets.block_weights import smallest_block_weights
from tests.support.printed import unwrapped
from tests.support.responses import response_by_channel

G = control.ss(np.diag([-1.0, -3.0]), np.eye(2), [[1.0, 0.4], [-0.3, 2.0]], 0.1 * np.eye(2))


def family(n=4, seed=0, spread=0.2):
    """Lags with other gains, time constants and coupling."""
    rng = np.random.default_rng(seed)
    k = lambda *shape: 1 + spread * rng.uniform(-1, 1, shape)  # noqa: E731
    return [
        control.ss(G.A * k(2)[:, None], G.B * k(2, 2), G.C * k(2, 2), G.D * k(2, 2))
        for _ in range(n)
    ]


def largest_gains(E, L, R):
    """Gains of L^-1/2 E R^-1/2."""
    roots = [np.linalg.inv(np.linalg.cholesky(X)) for X in (L, R)]
    return np.linalg.norm(roots[0] @ E @ np.swapaxes(roots[1].conj(), -1, -2), 2, (-2, -1))


def on_lines(system, omega):
    return np.moveaxis(response_by_channel(system, omega), 2, 0)


@pytest.mark.parametrize(
    "form",
    ["additive", "input", "output", "inverse-additive", "inverse-input", "inverse-output"],
)
def test_a_perturbed_plant_is_that_of_the_book_and_as_far_as_its_delta(form):
    """SP 8.2.3, figure 8.5: the six places of a full block; the deviation is read back from the
    plant.
    """
    rng = np.random.default_rng(1)
    W_l, W_r, Delta = rng.normal(size=(3, 2, 2))
    Delta /= 2 * np.linalg.norm(Delta, 2)
    gains = [(control.ss([], [], [], W / 3),) for W in (W_l, W_r)]
    model = robust.UncertaintyModel(
        G, form=form, left=gains[0], right=gains[1], omega=np.array([0.7, 2.0])
    )
    E, eye, H = W_l @ Delta @ W_r / 9, np.eye(2), G(0.7j)
    expected = {
        "additive": H + E,
        "input": H @ (eye + E),
        "output": (eye + E) @ H,
        "inverse-additive": H @ np.linalg.inv(eye + E @ H),
        "inverse-input": H @ np.linalg.inv(eye + E),
        "inverse-output": np.linalg.inv(eye + E) @ H,
    }[form]
    plant = model.perturbed(Delta)
    np.testing.assert_allclose(plant(0.7j), expected, rtol=1e-10)
    np.testing.assert_allclose(model.distance(plant), 0.5, rtol=1e-9)
    assert np.all(
        np.abs(on_lines(plant, model.omega) - on_lines(G, model.omega))
        <= np.moveaxis(model.entry_radius(model.omega), 2, 0) * (1 + 1e-9)
    )


@pytest.mark.parametrize("form", ["output", "inverse-input"])
def test_robust_stability_is_the_condition_of_the_book(form):
    """SP 8.55 and 8.58: sigma(W_r T W_l) and sigma(W_r S_i W_l)."""
    K = np.array([[0.5, 0.2], [-0.1, 0.4]])
    W = [
        control.ss([], [], [], x) for x in (np.diag([0.3, 0.1]), np.array([[0.5, 0.1], [0.0, 2.0]]))
    ]
    model = robust.UncertaintyModel(G, form=form, left=W[:1], right=W[1:], omega=np.array([0.7]))
    H = G(0.7j)
    S, S_i = np.linalg.inv(np.eye(2) + H @ K), np.linalg.inv(np.eye(2) + K @ H)
    X = np.eye(2) - S if form == "output" else S_i
    found = model.loop(K).loop(0.7j)
    np.testing.assert_allclose(
        np.linalg.svd(found)[1], np.linalg.svd(W[1].D @ X @ W[0].D)[1], rtol=1e-10
    )


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", ["output", "inverse-additive", "inverse-output"])
def test_the_margin_is_where_a_plant_of_the_set_breaks_the_loop(form):
    """The smallest perturbation found breaks the loop just beyond the margin; no plant drawn from
    the set does.
    """
    model = robust.uncertainty_of_plants(family(3), G, form=form, order=1, perturbation="LTI")
    K = control.ss(np.zeros((2, 2)), np.eye(2), [[1.3, 0.4], [-0.2, 0.8]], np.eye(2))
    report = robust.check(model, K)
    worst = robust.analysis.breaking_perturbation(model, K)
    assert report.verdict == "robust"
    assert worst.size == pytest.approx(report.margins.rs, rel=0.02)
    poles = [
        (plant * K).feedback(np.eye(2)).poles() for plant in (worst.plant(0.98), worst.plant(1.02))
    ]
    assert [bool(p.real.max() < 0) for p in poles] == [True, False]
    for plant in model.sample(5, rng=1):
        assert (plant * K).feedback(np.eye(2)).poles().real.max() < 0


def test_the_smallest_weights_of_one_matrix_are_its_polar_factors():
    rng = np.random.default_rng(2)
    E = rng.normal(size=(1, 5, 2, 3)) + 1j * rng.normal(size=(1, 5, 2, 3))
    L, R = smallest_block_weights(E, full=True)
    for k in range(5):
        U, s, Vh = np.linalg.svd(E[0, k], full_matrices=False)
        np.testing.assert_allclose(L[k], (U * s) @ U.conj().T, atol=0.02 * s[0])
        np.testing.assert_allclose(R[k], (Vh.conj().T * s) @ Vh, atol=0.02 * s[0])


@pytest.mark.parametrize("full", [False, True])
def test_the_smallest_weights_hold_every_matrix_and_none_that_are_near_are_smaller(full):
    rng = np.random.default_rng(3)
    E = rng.normal(size=(6, 4, 2, 2)) + 1j * rng.normal(size=(6, 4, 2, 2))
    L, R = smallest_block_weights(E, full=full)
    assert largest_gains(E, L, R).max() == pytest.approx(1.0, abs=1e-9)
    size = np.trace(L[0] + R[0]).real
    for _ in range(200):  # whatever else holds them has the larger traces
        A, B = (rng.normal(size=(2, 2, 2)) * [[[1]], [[1j]]]).sum(axis=0), 0.1 * rng.random()
        X, Y = (
            np.diag(np.diag(Z).real) if not full else Z for Z in (A + A.conj().T, A.conj().T @ A)
        )
        other, right = L[0] + B * X * size / 10, R[0] + B * Y * size / 10
        if np.linalg.eigvalsh(other)[0] > 0:
            excess = largest_gains(E[:, 0], other, right).max()
            assert np.trace(other + right).real * excess >= size * (1 - 1e-4)


@pytest.mark.attack(every=6)
@pytest.mark.parametrize("weights", ["diagonal", "full"])
@pytest.mark.parametrize("form", ["additive", "output", "inverse-input"])
def test_every_plant_of_the_family_lies_inside_at_frequencies_that_were_not_looked_at(
    form, weights
):
    plants = family()
    model = robust.uncertainty_of_plants(plants, G, form=form, weights=weights, perturbation="LTI")
    omega = np.geomspace(1e-4, 1e5, 3000)
    far = [
        model.normalized_distance(omega, on_lines(plant, omega), on_lines(G, omega))
        for plant in plants
    ]
    assert 0.9 < np.max(far) <= 1
    assert all(model.contains(plant) for plant in plants)
    assert ([w.noutputs for w in model.left], model.structure) == (
        [1, 1] if weights == "diagonal" else [2],
        [(2, 2)],
    )
    assert (
        "4 plants that were given, each inside, systems at all frequencies" in model.origin.source
    )
    assert np.isnan(model.confidence)
    for weight in model.weights:  # stable and minimum phase
        assert np.all(weight.poles().real < 0)
        assert np.all(weight.zeros().real < 0)


@pytest.mark.parametrize("weights", ["diagonal", pytest.param("full", marks=pytest.mark.attack)])
def test_a_sampled_family_keeps_its_clock(weights):
    plants = [robust.sampled(plant, 0.1) for plant in family(3)]
    model = robust.uncertainty_of_plants(plants, form="output", weights=weights, order=3)
    assert {w.dt for w in model.weights if w.nstates} <= {0.1}
    omega = np.linspace(1e-3, np.pi / 0.1, 2000)
    far = [
        model.normalized_distance(omega, on_lines(p, omega), on_lines(model.nominal, omega))
        for p in plants
    ]
    assert np.max(far) <= 1 + 1e-6


def test_frfs_are_held_on_their_lines_and_a_nominal_is_found():
    omega = np.geomspace(0.05, 50, 40)
    frfs = [control.frd(plant, omega) for plant in family(5)]
    model = robust.uncertainty_of_plants(frfs, form="output")
    assert all(model.contains(frf) for frf in frfs)
    assert "each inside, FRFs at their 40 lines" in model.origin.source
    mean = np.mean([frf.frdata for frf in frfs], axis=0)
    spread = np.abs([frf.frdata - mean for frf in frfs]).max(axis=0)
    assert np.median(np.abs(response_by_channel(model.nominal, omega) - mean) / spread) < 0.2
    assert (
        model.origin.extrapolation
        == "below the band flat, above it rising 20 dB/decade over 2 decades"
    )


def test_the_form_is_that_of_the_least_weight_times_t_or_s():
    """Gains of the outputs that are wrong behind a plant that is nearly singular: the input form is
    large.
    """
    H = np.array([[87.8, -86.4], [108.2, -109.6]])
    G = control.ss(-np.eye(2) / 75, np.eye(2), H / 75, np.zeros((2, 2)))
    plants = [control.ss(G.A, G.B, np.diag(k) @ G.C, G.D) for k in ([0.8, 1.2], [1.2, 0.8])]
    ranking = choose_form(plants, G, omega_B=0.1)
    assert ranking.best == "output"
    sizes = dict(zip(ranking.forms, ranking.measures, strict=True))
    assert sizes["output"] == pytest.approx(0.2, rel=0.01)  # |T| = 1 at low frequency
    assert sizes["input"] > 1
    assert str(ranking).splitlines()[0].startswith("output ")
    model = robust.uncertainty_of_plants(plants, G, omega_B=0.1)
    assert model.form == "output"
    assert "by the weight times |T| or |S| at 0.1 rad/s" in model.origin.source
    turned = [control.ss(G.A, G.B @ np.diag(k), G.C, G.D) for k in ([0.8, 1.2], [1.2, 0.8])]
    assert choose_form(turned, G, omega_B=0.1).best == "input"


def test_a_plant_that_is_not_square_has_an_additive_set():
    *plants, nominal = (control.ss(one.A, one.B, one.C[:1], one.D[:1]) for one in (*family(2), G))
    model = robust.uncertainty_of_plants(plants, nominal, weights="full", order=0)
    assert (model.form, model.structure) == ("additive", [(2, 1)])
    assert all(model.contains(plant) for plant in plants)
    with pytest.raises(
        ValueError, match="form must be elements or additive for a plant that is not square"
    ):
        robust.uncertainty_of_plants(plants, form="output")


@pytest.mark.attack
def test_matrix_weights_are_near_the_smallest_ones_and_below_diagonal_ones():
    """Deviations along one direction that is no channel: two diagonal weights cost more than the
    matrices.
    """
    s = [control.tf([k], [1, 1]) for k in (0.8, 1.2, 1.3)]
    turn = np.array([[0.8, -0.6], [0.6, 0.8]])
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    change = [
        control.ss([[-1.0]], turn[:1], (k(0).real - 1) * turn[:1].T, np.zeros((2, 2))) for k in s
    ]
    plants = [control.ss(G + one) for one in change]
    sizes, omega = {}, np.geomspace(0.05, 20, 30)
    for weights in ("diagonal", "full"):
        model = robust.uncertainty_of_plants(plants, G, form="additive", weights=weights, order=2)
        left, right = np.split(model.weight_gains(omega) ** 2, 2)
        sizes[weights] = np.sqrt(left.sum(axis=0) * right.sum(axis=0))
    exact = 0.3 / np.sqrt(1 + omega**2)  # one singular value
    assert np.median(sizes["full"] / exact) < 1.1
    assert np.median(sizes["diagonal"] / sizes["full"]) > 1.2


def test_a_pole_that_crosses_asks_for_an_inverse_form():
    """SP 7.2.3 and 8.2.3: (s - a) with a of either sign, which no multiplicative error holds."""
    plants = [
        control.append(*(control.ss([[-p]], [[1]], [[1]], [[0]]) for p in (a, 2.0)))
        for a in (-0.2, 0.2)
    ]
    nominal = control.ss(np.diag([-0.01, -2.0]), np.eye(2), np.eye(2), np.zeros((2, 2)))
    with pytest.raises(
        ValueError, match="an inverse if the number of poles in the right half plane differs"
    ):
        robust.uncertainty_of_plants(plants, nominal, form="output")
    ranking = choose_form(plants, nominal, omega_B=2.0)
    assert all(form.startswith("inverse") for form in ranking.forms)
    assert len(ranking.refused) == 3
    model = robust.uncertainty_of_plants(plants, nominal, form="inverse-output", perturbation="LTI")
    assert robust.check(model, 2.0 * np.eye(2)).verdict == "robust"


@pytest.mark.parametrize(
    ("plants", "options", "said"),
    [
        (family(), {"form": "nonsense"}, "form must be one of"),
        (family(), {"weights": "some"}, "weights must be one of"),
        (
            family(),
            {"form": "elements", "weights": "full"},
            'weights must be "diagonal" for the form elements',
        ),
        (family(), {"omega_B": -1.0}, "omega_B must be positive"),
        ([G, G], {}, "got none that differs"),
        ([*family(), 3.0], {}, "plants must be a list of systems or FRFs, got 3.0"),
        ([*family(), control.tf([1], [1, 1])], {}, "all have one channel, or all several"),
        ([control.frd(G, [1.0, 2.0]), control.frd(G, [1.0, 3.0])], {}, "on the same lines"),
        ([robust.sampled(G, 0.1), G], {}, "must be continuous as the nominal"),
        (
            family(),
            {"nominal": control.tf([1], [1, 1])},
            "nominal must have 2 outputs and 2 inputs",
        ),
        (family(), {"nominal": control.frd(G, [1.0, 2.0])}, "got an FRF"),
    ],
)
def test_what_is_no_family_is_refused_in_one_line(plants, options, said):
    with pytest.raises(ValueError, match=said) as refused:
        robust.uncertainty_of_plants(plants, **({"nominal": G} | options))
    assert "\n" not in str(refused.value)


def test_what_no_proper_weight_holds_is_refused():
    """Strictly proper plants of other gains: 1/G_p - 1/G rises without end."""
    plants = [control.ss(G.A, G.B, k * G.C, 0 * G.D) for k in (0.8, 1.2)]
    nominal = control.ss(G.A, G.B, G.C, 0 * G.D)
    with pytest.raises(
        ValueError,
        match="form must leave every deviation finite at all frequencies, got inverse-additive",
    ):
        robust.uncertainty_of_plants(plants, nominal, form="inverse-additive")


def test_other_functions_say_which_sets_they_take():
    model = robust.uncertainty_of_plants(family(2), G, form="output", perturbation="LTI")
    with pytest.raises(
        ValueError, match="model must have the form elements, additive or input and one weight"
    ):
        robust.check(model, control.ss([], [], [], np.eye(2), 0.01))
    assert unwrapped(str(model)).startswith(
        "output uncertainty with 2 outputs and 2 inputs, LTI: nominal 2 states"
    )


FULL = {"form": "output", "weights": "full", "order": 1, "perturbation": "LTI"}


@pytest.fixture(scope="module")
def full_set():
    return robust.uncertainty_of_plants(family(2), G, **FULL)


def test_a_set_with_full_weights_comes_back_from_its_file(full_set, tmp_path):
    model = full_set
    robust.save(model, tmp_path / "m.json")
    back = robust.load(tmp_path / "m.json")
    np.testing.assert_array_equal(back.radius, model.radius)
    np.testing.assert_array_equal(back.left[0].A, model.left[0].A)
    assert all(back.contains(plant) for plant in family(2))
    assert robust.check(back, 0.5 * np.eye(2)).verdict == "robust"


def test_a_list_of_plants_may_be_given_to_uncertainty(full_set):
    """It is passed on with all its options; options of a measured BLA are refused, and vice versa."""
    by_list = robust.uncertainty(family(2), G, **FULL)
    assert np.array_equal(by_list.radius, full_set.radius)
    assert by_list.perturbation == full_set.perturbation
    for name, option in {
        "confidence": 0.95,
        "simultaneous": True,
        "even": False,
        "systematic": 8.0,
        "W1": 2.0,
    }.items():
        with pytest.raises(
            ValueError, match=f"^{name} must be left out with plants: it belongs to"
        ):
            robust.uncertainty(family(3), G, **{name: option})
    with pytest.raises(ValueError, match="bla must be an nlfrf"):
        robust.uncertainty([*family(3), 1.0], G)
