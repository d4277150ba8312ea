"""Plants, controllers and weights of another sampling time are refused, FRFs that say they are
sampled included.
"""

import control
import numpy as np
import pytest

import robust

DT = 0.01
LAG = control.ss(control.tf([1], [1, 1]))
SAMPLED = robust.sampled(LAG, DT)
OMEGA = np.geomspace(1, 0.99 * np.pi / DT, 60)
LINES = np.geomspace(0.1, 100, 20)
PI, PI_SAMPLED = control.tf([1, 1], [1, 0]), robust.lti.discretize(control.tf([1, 1], [1, 0]), DT)
FRF = control.frd(SAMPLED(np.exp(1j * OMEGA * DT)), OMEGA, dt=DT)


def around(nominal, lines=LINES):
    return robust.UncertaintyModel(
        nominal, 0.3, "multiplicative", lines, np.full(lines.size, 0.3), perturbation="LTI"
    )


def matrix_set(nominal):
    w = control.ss([], [], [], [[0.1]])
    return robust.UncertaintyModel(
        nominal=nominal, form="additive", left=(w, w), right=(w, w), omega=LINES,
        radius=np.full((4, LINES.size), 0.1), confidence=0.95,
    )  # fmt: skip


@pytest.mark.parametrize("K", [PI, robust.lti.discretize(PI, 2e-3)])
def test_a_sampled_frf_takes_its_own_clock_only(K):
    for model in (FRF, around(FRF, OMEGA)):
        with pytest.raises(
            ValueError, match=r"K must have the sampling time of the FRF, 0.01 s, got"
        ):
            robust.check(model, K)
        assert robust.check(model, PI_SAMPLED).nominally_stable
        assert robust.check(model, 0.5).nominally_stable  # a gain goes with any
    with pytest.raises(ValueError, match=r"K must have the sampling time of G, 0.01 s, got"):
        robust.margins.disk_margins(FRF, K)
    assert robust.margins.disk_margins(FRF, PI_SAMPLED).inputs[0].alpha > 0.5
    with pytest.raises(
        ValueError, match=r"w_P must have the sampling time of the loop, 0.01 s, got 0.02 s"
    ):
        robust.check(FRF, PI_SAMPLED, w_P=robust.lti.discretize(control.tf([0.1], [1, 1]), 0.02))
    assert around(FRF, OMEGA).sample(1, rng=1)[0].dt == DT  # and its plants keep it


def test_a_set_refuses_plants_of_another_clock():
    continuous, clocked, at_twice = around(LAG), around(SAMPLED), robust.sampled(LAG, 2 * DT)
    for asked in ("contains", "distance"):
        with pytest.raises(
            ValueError, match=r"plant must be continuous as the nominal, got one sampled at 0.01 s"
        ):
            getattr(continuous, asked)(SAMPLED)
        with pytest.raises(
            ValueError, match=r"plant must be continuous as the nominal, got one sampled at 0.01 s"
        ):
            getattr(continuous, asked)(FRF)
        with pytest.raises(
            ValueError,
            match=r"plant must have the sampling time of the nominal, 0.01 s, got 0.02 s",
        ):
            getattr(clocked, asked)(at_twice)
        with pytest.raises(ValueError, match=r"nominal, 0.01 s, got a continuous one"):
            getattr(clocked, asked)(control.tf([1], [1, 1]))
    assert continuous.contains(1.1 * LAG)
    assert clocked.contains(1.1 * SAMPLED)
    assert clocked.contains(FRF)
    unsaid = control.ss(SAMPLED.A, SAMPLED.B, SAMPLED.C, SAMPLED.D, None)
    assert clocked.distance(unsaid).max() < 1e-9  # taken on the clock of the set
    numbers = control.frd(SAMPLED(np.exp(1j * LINES * DT)), LINES)
    assert clocked.contains(numbers)
    assert not clocked.contains(3.0)
    assert around(numbers).contains(SAMPLED)  # an FRF that does not say


def test_a_set_of_plants_has_one_clock():
    with pytest.raises(
        ValueError, match=r"plants must be continuous as the nominal, got one sampled at 0.3 s"
    ):
        robust.uncertainty_of_plants(
            [robust.sampled(1.1 * LAG, 0.3), control.frd(1.1 * LAG, LINES)], LAG, order=2
        )
    with pytest.raises(
        ValueError, match=r"plants must have the sampling time of the nominal, 0.01 s, got 0.02 s"
    ):
        robust.uncertainty_of_plants(
            [control.frd(1.1 * FRF.frdata, OMEGA, dt=2 * DT)], FRF, order=2
        )
    assert robust.uncertainty_of_plants([1.1 * FRF], SAMPLED, order=1).radius.max() < 0.11


def test_a_sampled_frf_is_fitted_on_its_clock():
    for dt in (0, DT / 2):
        with pytest.raises(
            ValueError, match=r"dt must be that of bla, a sampled FRF at 0.01 s, got"
        ):
            robust.fit_nominal(FRF, n_poles=1, dt=dt)
    assert robust.fit_nominal(FRF, n_poles=1, dt=DT).G.poles()[0].real == pytest.approx(
        np.exp(-DT), rel=1e-6
    )


def test_a_matrix_set_has_one_clock():
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    Delta = control.ss(-0.5 * np.eye(2), np.eye(2), 0.1 * np.eye(2), np.zeros((2, 2)))
    with pytest.raises(ValueError, match="Delta must be continuous as the model, got one sampled"):
        matrix_set(G).perturbed(robust.sampled(Delta, DT))
    with pytest.raises(
        ValueError,
        match=r"Delta must have the sampling time of the model, 0.01 s, got a continuous",
    ):
        matrix_set(robust.sampled(G, DT)).perturbed(Delta)
    assert matrix_set(G).perturbed(Delta).dt == 0
    with pytest.raises(ValueError, match="w_P must be continuous as the model"):
        matrix_set(G).loop(np.eye(2), w_P=robust.lti.discretize(control.tf([1], [1, 1]), DT))


def test_a_weight_without_a_clock_leaves_the_plants_theirs():
    model = robust.UncertaintyModel(
        SAMPLED, control.tf([0.3], [1]), "multiplicative", LINES, np.full(20, 0.3)
    )
    made = [*model.sample(6, rng=0), robust.worst_case(model, PI_SAMPLED).plant]
    assert {plant.dt for plant in made} == {DT}
    assert all(model.contains(plant) for plant in made)
