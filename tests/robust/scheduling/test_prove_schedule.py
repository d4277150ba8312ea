"""Scheduled loops: against closed forms, refuted by trajectories, refused with a line that names
the parameter.
"""

import control
import numpy as np
import pytest

import robust
from robust import prove_schedule
from robust.models import LpvModel


def spring(k, c):
    return control.ss([[0, 1], [-k, -c]], [[0], [1]], [[1, 0]], 0)


def between(low, high, c, **options):
    return LpvModel.from_points([spring(low, c), spring(high, c)], at=[0, 1], **options)


def lag(**options):
    one = control.ss(-1, 1, 1, 0)
    return LpvModel.from_points([one, one], at=[0, 1], **options)


# ---- Closed forms.


@pytest.mark.parametrize(("excess", "outcome"), [(1.02, "holds"), (0.98, "undecided")])
def test_a_spring_that_jumps_at_will(excess, outcome):
    """x'' + c x' + k x with k anywhere in [4, 6] has a common V if and only if c > sqrt(6) -
    sqrt(4).
    """
    c = excess * (np.sqrt(6) - 2)
    assert prove_schedule(between(4.0, 6.0, c), 0.0, rate=np.inf, limit=False).outcome == outcome


@pytest.mark.parametrize(("shrink", "outcome"), [(0.6175, "holds"), (0.6185, "violated")])
def test_two_matrices_with_the_golden_ratio(shrink, outcome):
    """The joint spectral radius of [1 1; 0 1] and [1 0; 1 1] is (1 + sqrt(5))/2:

    P = 1 proves it, A1 A2 attains it.
    """
    shear = np.array([[1.0, 1.0], [0.0, 1.0]])
    pair = [control.ss(shrink * A, [[0], [1]], [[1, 0]], 0, 1.0) for A in (shear, shear.T)]
    plant = LpvModel.from_points(pair, at=[0, 1])
    proof = prove_schedule(plant, control.ss([], [], [], 0.0, 1.0), rate=np.inf)
    assert proof.outcome == outcome
    assert (proof.broken is not None) is (outcome == "violated")


def test_any_realisation_of_one_fixed_controller_gives_the_same_answer():
    """A constant change of the states of K changes x'P(p)x into another such V, at every rate.

    So one transfer function as K for all operating points is sound, whichever way it is realised.
    """
    plant, K = between(4.0, 6.0, 0.2), control.tf([2.0, 1.0], [1.0, 3.0, 8.0])
    turn = np.array([[1.0, 2.0], [-0.5, 3.0]])
    own = control.ss(K)
    turned = control.ss(
        np.linalg.solve(turn, own.A @ turn), np.linalg.solve(turn, own.B), own.C @ turn, own.D
    )
    proofs = [prove_schedule(plant, one, rate=0.5) for one in (K, turned)]
    assert {one.outcome for one in proofs} == {"holds"}
    rates = [one.provable for one in proofs]
    assert np.isfinite(rates).all()
    assert max(rates) < 1.25 * min(rates)  # they are searched to 20 percent


@pytest.mark.parametrize(("gain", "norm"), [("S", 1.0), ("GS", 0.5)])
def test_gains_of_a_loop_that_does_not_move_are_its_norms(gain, norm):
    """G = 1/(s + 1) and K = 1: S = (s + 1)/(s + 2), G S = 1/(s + 2)."""
    known = {"rate": 1.0, "gain": gain, "limit": False, "degree": 0}
    assert prove_schedule(lag(), 1.0, level=1.002 * norm, **known).holds
    assert not prove_schedule(lag(), 1.0, level=0.998 * norm, **known).holds


@pytest.mark.parametrize(
    ("form", "norm"),
    [
        ("multiplicative", 0.5),
        ("additive", 1.0),
        ("inverse-multiplicative", 1.0),
        ("inverse-additive", 0.5),
    ],
)
def test_sets_of_every_form_up_to_the_norm_of_their_loop(form, norm):
    """|w| times the norm of T, K S, S or G S is below one."""
    for factor in (0.99, 1.01):
        weight = control.ss([], [], [], factor / norm)
        plant = lag(weight=weight, form=form)
        assert prove_schedule(plant, 1.0, rate=1.0, limit=False, degree=0).holds is (factor < 1)


@pytest.mark.parametrize("delay", [0.0, 0.05])
def test_a_sampled_lag_is_stable_up_to_its_limit(delay):
    """x+ = q x + (1 - q) u, u = -k x: k < (1 + q)/(1 - q), with one sample of delay k < 1/(1
    - q).
    """
    q = np.exp(-0.05)
    limit = (1 + q) / (1 - q) if not delay else 1 / (1 - q)
    for factor in (0.99, 1.01):
        K = control.ss([], [], [], factor * limit, 0.05)
        assert prove_schedule(lag(), K, rate=1.0, delay=delay, limit=False).holds is (factor < 1)


# ---- Three answers.


@pytest.fixture(scope="module")
def mathieu():
    """Return the proof of a lightly damped spring that goes too fast."""
    return prove_schedule(between(4.0, 6.0, 0.1, over="position", unit="m"), 0.0, rate=1.5)


def test_a_fast_schedule_is_refuted_by_a_trajectory(mathieu):
    assert mathieu.outcome == "violated"
    assert 0 < mathieu.provable < mathieu.broken.rate <= 1.5
    assert "refuted: a trajectory grows" in str(mathieu)
    assert not mathieu.verify().verified


def test_the_trajectory_grows_when_it_is_integrated(mathieu):
    from scipy.integrate import solve_ivp

    broken = mathieu.broken
    times = broken.step * np.arange(broken.points.size + 1)
    points = np.append(broken.points, broken.points[0])
    assert np.abs(np.diff(points) / broken.step).max() <= broken.rate * (1 + 1e-9)

    def flow(t, X):
        k = np.interp(t, times, 4 + 2 * points)
        return (np.array([[0, 1], [-k, -0.1]]) @ X.reshape(2, 2)).ravel()

    period = solve_ivp(
        flow, (0, times[-1]), np.eye(2).ravel(), rtol=1e-10, atol=1e-12, max_step=broken.step
    ).y[:, -1]
    assert np.abs(np.linalg.eigvals(period.reshape(2, 2))).max() > 1


def test_the_provable_rate_is_proved_and_far_above_nothing(mathieu):
    again = prove_schedule(
        mathieu.plant, 0.0, rate=mathieu.provable, degree=mathieu.degree, limit=False
    )
    assert again.holds
    assert mathieu.broken.rate < 2.5 * mathieu.provable


def test_frozen_loops_that_are_not_stable_are_not_proved():
    K = LpvModel.from_points([control.ss([], [], [], k) for k in (1.0, -7.0)], at=[0, 1])
    proof = prove_schedule(between(4.0, 6.0, 1.0), K, rate=0.01)
    assert (proof.outcome, proof.broken.rate) == ("violated", 0)
    assert "unstable with the operating point held at 1 (proved)" in str(proof)


def test_a_scheduled_sampled_loop_with_its_set(tmp_path):
    """Notch and gains follow the stiffness; the certificate is proved again from its file."""
    points = np.array([0.0, 0.5, 1.0])
    systems = [spring(k, 2.0) for k in 100 + 60 * points]
    plant = LpvModel.from_points(
        systems, at=points, over="position", unit="m", weight=control.ss([], [], [], 0.1, 0.005)
    )
    K = LpvModel.from_points(
        [control.ss([[0.9]], [[1.0]], [[0.1 * g]], [[g]], 0.005) for g in (15.0, 19.0, 25.0)],
        at=points,
        over="position",
        unit="m",
    )
    proof = prove_schedule(plant, K, rate=0.3, delay=0.005, limit=False)
    assert proof.holds, str(proof)
    robust.save(proof, tmp_path / "proof.json")
    assert robust.io.verify_certificate(tmp_path / "proof.json").verified
    compliance = prove_schedule(plant, K, rate=0.3, delay=0.005, gain="GS", level=0.3, limit=False)
    assert compliance.holds, str(compliance)
    with pytest.raises(ValueError, match="model and K must be left out for a schedule"):
        robust.io.verify_certificate(tmp_path / "proof.json", K=1.0)


# ---- Refusals.

PLANT = between(4.0, 6.0, 1.0, over="position", unit="m")


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"rate": 0.0}, "rate must be positive, got 0"),
        ({"rate": -1.0}, "rate must be positive, got -1"),
        ({"rate": np.nan}, "rate must be finite"),
        ({"plant": spring(4.0, 1.0)}, "plant must be of type LpvModel"),
        ({"K": [1.0, 2.0]}, "K must be an LpvModel, got 2 systems: LpvModel.from_points"),
        (
            {"K": between(1.0, 2.0, 1.0, over="position", unit="mm")},
            "K must be scheduled over the range of the plant",
        ),
        (
            {"K": between(1.0, 2.0, 1.0)},
            "K must be scheduled over the range of the plant, position from 0 to 1 m, got",
        ),
        ({"K": np.ones((2, 1))}, "K must have 1 inputs and 1 outputs"),
        ({"delay": 0.1}, "delay must be zero for a continuous K, got 0.1 s"),
        (
            {"K": control.ss([], [], [], 1.0, 0.01), "delay": 0.015},
            "delay must be a whole number of samples of 0.01 s",
        ),
        ({"gain": "T"}, "gain must be one of"),
        ({"gain": "S"}, "level must be given with gain 'S'"),
        ({"gain": "S", "level": 0.0}, "level must be positive"),
        ({"degree": -1}, "degree must be a whole number of at least 0"),
        ({"plant": LpvModel.from_points([1.0, 2.0], at=[0, 1])}, "plant must have states"),
        (
            {"plant": LpvModel.from_points([control.ss(-1, 1, 1, 1)] * 2, at=[0, 1])},
            "plant must have no direct",
        ),
        (
            {"plant": lag(weight=control.ss(-1, 1, 1, 0)), "K": control.ss([], [], [], 1.0, 0.01)},
            "weight must have the sampling time of K, 0.01 s, got a continuous one",
        ),
        (
            {
                "plant": lag(weight=control.ss(0.5, 1, 1, 0, 0.02)),
                "K": control.ss([], [], [], 1.0, 0.01),
            },
            "weight must have the sampling time of K, 0.01 s, got 0.02 s",
        ),
        (
            {"plant": lag(weight=control.ss(0.5, 1, 1, 0, 0.02))},
            "weight must be continuous like K, got 0.02 s",
        ),
    ],
)
def test_what_does_not_fit_is_refused(change, message):
    given = {"plant": PLANT, "K": 1.0, "rate": 1.0} | change
    with pytest.raises(ValueError, match=message):
        prove_schedule(given.pop("plant"), given.pop("K"), **given)
