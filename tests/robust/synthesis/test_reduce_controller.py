"""Controllers of lower order: error bounds in closed form, what is exact by construction, what the
check keeps.
"""

from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust import (
    UncertaintyModel,
    check,
    fit_nominal,
    mixsyn,
    ncfsyn,
    performance_weight,
    reduce_controller,
    sampled,
    uncertainty,
)
from robust.lti.truncation import (
    balanced_candidates,
    coprime_factor_candidates,
    weighted_candidates,
)
from tests.support.printed import unwrapped
from tests.support.responses import response

BOOK = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
W = control.tf([0.05, 0.1], [0.02, 1])


def model(G=BOOK, w=W, perturbation="LTI"):
    omega = np.geomspace(1e-2, 1e2, 40)
    return UncertaintyModel(
        G,
        w,
        "multiplicative",
        omega,
        0.99 * np.abs(response(control.ss(w), omega)),
        perturbation=perturbation,
    )


def matrices(system):
    system = control.ss(system)
    return system.A, system.B, system.C, system.D


def random_stable(rng, n):
    A = rng.standard_normal((n, n))
    A = A - (np.linalg.eigvals(A).real.max() + 0.3) * np.eye(n)
    return A, rng.standard_normal((n, 1)), rng.standard_normal((1, n)), rng.standard_normal((1, 1))


def hankel(A, B, C):
    P, Q = control.lyap(A, B @ B.T), control.lyap(A.T, C.T @ C)
    return np.sort(np.sqrt(np.linalg.eigvals(P @ Q).real))[::-1]


def test_the_error_stays_below_twice_the_tail_of_the_hankel_singular_values():
    """Glover 1984, Enns 1984; SP eq. 11.25; nor below the first one left out."""
    rng = np.random.default_rng(0)
    for _ in range(2):
        K = random_stable(rng, 7)
        sizes = hankel(*K[:3])
        rounded = 2e-8 * sizes[0]  # a root of an eigenvalue of P Q: half the digits
        for way, n, (A, B, C, D) in balanced_candidates(K):
            error = control.ss(*K) - control.ss(A, B, C, D)
            bound = 2 * sizes[n:].sum() * (1 + 1e-6) + 2 * rounded
            assert robust.certify_norm(error, bound).holds, (way, n)
            if n < 7:
                reached = np.abs(response(error, np.r_[0.0, np.geomspace(1e-3, 1e3, 4000)])).max()
                assert reached >= sizes[n] * (1 - 1e-6) - rounded


def test_what_is_exact_by_construction():
    K = random_stable(np.random.default_rng(1), 6)
    at_zero, at_infinity = response(control.ss(*K), np.array([0.0]))[0], K[3][0, 0]
    for ways in (
        balanced_candidates(K),
        weighted_candidates(
            K, matrices(control.tf([1], [1, 1])), matrices(control.tf([1, 0.1], [1, 2]))
        ),
    ):
        for way, _, small in ways:
            if "residualised" in way:
                assert response(control.ss(*small), np.array([0.0]))[0] == pytest.approx(
                    at_zero, rel=1e-8
                )
            else:
                assert small[3][0, 0] == at_infinity


def test_weights_of_one_change_nothing_and_a_band_is_kept():
    rng = np.random.default_rng(2)
    K = random_stable(rng, 6)
    one = (np.zeros((0, 0)), np.zeros((0, 1)), np.zeros((1, 0)), np.eye(1))
    omega = np.geomspace(1e-2, 1e2, 50)
    for (_, n, a), (_, m, b) in zip(
        balanced_candidates(K), weighted_candidates(K, one, one), strict=True
    ):
        assert n == m
        np.testing.assert_allclose(
            response(control.ss(*a), omega), response(control.ss(*b), omega), rtol=1e-6
        )
    # two modes of one size: the weight says which one stays
    two = matrices(control.tf([1], [1, 0.1, 1]) + control.tf([100], [1, 1, 100]))
    low = matrices(control.tf([1], [1, 1, 1]))
    small = {n: s for way, n, s in weighted_candidates(two, low, low) if "truncated" in way}[2]
    assert np.abs(np.linalg.eigvals(small[0])) == pytest.approx([1, 1], rel=0.05)


def test_unstable_and_integrating_modes_stay():
    K = (
        control.tf([1, 2], [1, 0])
        * control.tf([1], [1, -0.5])
        * control.tf([1], [0.01, 1])
        * control.tf([1, 4], [1, 5])
    )
    for _, n, (A, *_) in balanced_candidates(matrices(K)):
        unstable = np.sort(np.linalg.eigvals(A).real)[-2:]
        assert n >= 2
        np.testing.assert_allclose(unstable, [0.0, 0.5], atol=1e-9)
    exact = [
        small
        for way, n, small in coprime_factor_candidates(matrices(K))
        if "residualised" in way and n == 3
    ]
    assert np.abs(np.linalg.eigvals(exact[0][0])).min() < 1e-8  # M(0) = 0 is kept


def test_all_states_are_the_controller_itself():
    K = random_stable(np.random.default_rng(4), 5)
    A = np.block(
        [[K[0], np.zeros((5, 2))], [np.zeros((2, 5)), -np.eye(2)]]
    )  # two states that nothing drives
    B, C = np.vstack([K[1], np.zeros((2, 1))]), np.hstack([K[2], np.ones((1, 2))])
    omega = np.geomspace(1e-2, 1e2, 50)
    for ways in (balanced_candidates((A, B, C, K[3])), coprime_factor_candidates((A, B, C, K[3]))):
        small = {n: s for _, n, s in ways}[5]
        np.testing.assert_allclose(
            response(control.ss(*small), omega), response(control.ss(*K), omega), rtol=1e-6
        )


@pytest.mark.parametrize("dt", [0, 0.01])
def test_performance_that_was_proved_is_proved_again(dt):
    w_P = performance_weight(2, M_S=2.5)
    K = mixsyn(model(), performance_weight(3, M_S=2.2), w_u=0.3, dt=dt).K
    found = reduce_controller(K, model(), w_P)
    assert found.before.proofs.robust_performance
    assert found.kept
    assert found.order == 1 < K.nstates == 5
    again = check(model(), found.K, w_P=w_P)
    assert again.verdict == "robust"
    assert again.proofs.robust_performance
    assert found.K.dt == K.dt


def assert_words_of_a_plant(report):
    text = unwrapped(report)
    assert "no set of plants was given" in text
    assert "with the given plant, at all frequencies." in report.proved
    assert not any(
        word in text
        for word in (
            "of the set",
            "whole set",
            "over the set",
            "uncertainty may grow",
            "weight of order",
            "perturbation",
        )
    )


@pytest.mark.parametrize("dt", [0, 0.01])
def test_the_plant_alone_that_mixsyn_took(dt):
    """SP 2.17 with a demand that is met with room: of four states three keep stability and |w_P S|
    < 1, proved.
    """
    G = control.tf([200], np.polymul([10, 1], np.polymul([0.05, 1], [0.05, 1])))
    w_P = performance_weight(10, M_S=2, A=1e-3)
    K = mixsyn(G, w_P, w_u=0.1, dt=dt).K
    found = reduce_controller(K, G, w_P)
    assert (found.order, found.kept, K.nstates) == (3, True, 4)
    assert found.report.proofs.robust_performance
    assert_words_of_a_plant(found.report)
    assert_words_of_a_plant(found.before)
    with pytest.raises(ValueError, match="K must have a proved property that can be kept"):
        reduce_controller(-K, G, w_P)


@pytest.mark.attack
def test_a_plant_of_several_channels_alone():
    G = control.ss(-np.eye(2), np.eye(2), [[1.0, 0.2], [0.1, 1.0]], np.zeros((2, 2)))
    w_P = performance_weight(1.0, M_S=2, A=1e-2)
    found = reduce_controller(mixsyn(G, w_P, w_u=0.1).K, G, w_P)
    assert found.kept
    assert found.order < 4
    assert found.report.proofs.robust_performance
    assert_words_of_a_plant(found.report)


@pytest.mark.attack
@pytest.mark.parametrize("tall", [True, False])
def test_a_plant_that_is_not_square(tall):
    """The set that a plant alone stands for was one at its inputs, which such a plant cannot
    have.
    """
    G = control.ss([[-1.0]], [[1.0]], [[1.0], [0.5]], np.zeros((2, 1)))
    K = control.ss(np.diag([-1.0, -50.0]), 0.3 * np.ones((2, 2)), [[1.0, 1.0]], np.zeros((1, 2)))
    if not tall:
        G, K = (control.ss(one.A.T, one.C.T, one.B.T, one.D.T) for one in (G, K))
    found = reduce_controller(K, G, order=1)
    assert found.K.nstates == 1
    np.testing.assert_allclose(found.K(0), K(0), rtol=1e-6)
    assert found.report.proofs.robustly_stable


def test_without_performance_the_loop_stays_where_it_was():
    """K = 0 keeps every verdict on a stable plant: the closed loop may move by a tenth."""
    K = ncfsyn(BOOK, control.tf([1, 2], [1, 0])).K
    found = reduce_controller(K, model())
    assert 0 < found.order < K.nstates
    omega = np.geomspace(1e-3, 1e3, 2000)
    loops = [response(control.ss(BOOK), omega) * response(each, omega) for each in (K, found.K)]
    T = [L / (1 + L) for L in loops]
    assert 0 < np.abs(T[0] - T[1]).max() < 0.1
    lower = reduce_controller(K, model(), order=found.order - 1)
    assert not lower.kept
    assert "moved" in lower.reason or "verdict" in lower.reason
    assert lower.order == lower.K.nstates == found.order - 1


def test_a_statistical_set_and_a_sampled_controller():
    K = ncfsyn(sampled(control.ss(BOOK), 0.01), control.tf([1.02, -0.98], [1, -1], 0.01)).K
    found = reduce_controller(K, model(perturbation="statistical"))
    assert found.report.verdict == "statistically robust"
    assert found.order < K.nstates


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: reduce_controller(control.tf([100], [1, 1, 0]), model()),
            "K must have a proved property that can be kept",
        ),
        (
            lambda: reduce_controller(control.tf([1], [1, 1]), model(), order=1),
            "order must be below the 1 states of K",
        ),
        (lambda: reduce_controller("K", model()), "K must be"),
        (
            lambda: reduce_controller(control.tf([1], [1, 1]), model(), max_candidates=0),
            "max_candidates must be",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


def test_the_demo_needs_one_state_of_five():
    """`make demo`: ncfsyn gives the rig a K of 5 states; one (a PI) keeps the verdict and the
    demand.
    """
    ms = nlfrf.multisine(
        "special-odd", fs=4096, n_samples=16384, f_min=1.25, f_max=150, rms=0.25, rng=2
    )
    record = nlfrf.simulate(nlfrf.paper_rig(), ms, n_periods=2, n_discard=2)
    noise = 1e-8 * np.random.default_rng(2).standard_normal(record.y.shape)
    bla = nlfrf.identify(replace(record, y=record.y + noise))
    model = uncertainty(bla, fit_nominal(bla, n_poles=3, delay=0.0), order=4)
    plant = sampled(model.nominal, 1e-3)
    K = ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * 5)).K
    w_P = performance_weight(2 * np.pi * 5 / 6, M_S=2.5, A=1e-2)
    before = check(model, K, w_P=w_P)
    assert K.nstates == 5
    assert (before.verdict, before.proofs.robust_performance) == ("statistically robust", True)
    found = reduce_controller(K, model, w_P)
    assert found.order <= 2
    again = check(model, found.K, w_P=w_P)
    assert (again.verdict, again.proofs.robust_performance) == ("statistically robust", True)
    assert again.margins.rs > 0.9 * before.margins.rs
    # and no lower: a static K loses the demand
    assert not reduce_controller(K, model, w_P, order=0).report.proofs.robust_performance


@pytest.mark.parametrize(
    ("n_u", "n_y"), [(1, 1), pytest.param(2, 1, marks=pytest.mark.attack), (1, 2)]
)
def test_the_weights_of_the_loop_fit_a_plant_of_any_shape(n_u, n_y):
    """A mode at 1000 rad/s dominates K, and the loop does not see it. Without weights K keeps this
    mode, and T moves by 0.127.
    """
    G = control.ss([[-1.0]], np.ones((1, n_u)), np.ones((n_y, 1)), np.zeros((n_y, n_u)))
    A = np.array([[-0.2, 0.0, 0.0], [0.0, 0.0, 1e3], [0.0, -1e3, -100.0]])
    B = np.outer([0.2, 0.0, 1e3], np.ones(n_y))
    C = np.outer(np.ones(n_u), [1.0, 3.0, 0.0])
    found = reduce_controller(control.ss(A, B, C, np.zeros((n_u, n_y))), G, order=1)
    assert found.method.startswith("weighted by the loop")
    assert found.kept


@pytest.mark.parametrize("K", [1.0, control.ss([], [], [], [[2.0]])])
def test_a_gain_has_nothing_to_reduce(K):
    model = UncertaintyModel(
        control.tf([1], [1, 1]),
        control.tf([0.2], [1]),
        "multiplicative",
        np.array([1.0]),
        np.array([0.2]),
    )
    found = reduce_controller(K, model)
    assert (found.order, found.kept, found.n_tried, found.reason) == (
        0,
        True,
        0,
        "a gain has no states",
    )
    with pytest.raises(ValueError, match="order must be below the 0 states of K"):
        reduce_controller(K, model, order=0)
