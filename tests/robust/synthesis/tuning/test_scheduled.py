"""Scheduled numbers: the loops at the operating points are those of a tuning at each, and the
controller between them is one polynomial.
"""

import shutil

import control
import numpy as np
import pytest

import robust
from benchmarks import attack_schedule as harness
from robust import friction_plant
from robust.friction import MaxwellSlip
from robust.models import LpvModel
from robust.synthesis.tuning.parameters import controller_of_blocks

JOINED = [control.summing_junction(["r", "-y"], "e"), control.summing_junction(["v", "d"], "u")]
POINTS = np.array([-0.2, 0.1, 0.4])


def lag(gain):
    return control.ss(-1.0, gain, 1.0, 0.0)


def spring(p):
    return control.ss([[0, 1], [-900 * (1 + p), -6]], [[0], [1]], [[1, 0]], 0)


def pid(**changes):
    return robust.tuning.Pid(**{"kp": 2.0, "ki": 1.0, "reads": "e", "drives": "v"} | changes)


# ---- A block.


def test_a_scheduled_number_is_a_polynomial_with_its_ends():
    one = robust.tuning.Notch(omega=[200.0, 260.0, 300.0], scheduled={"omega": 2})
    assert [one.at(theta).omega for theta in (-1, 1)] == [200.0, 300.0]
    assert one.at(0.0).omega == pytest.approx((200 + 2 * 260 + 300) / 4)
    thetas = np.linspace(-1, 1, 41)
    found = np.array([one.at(theta).omega for theta in thetas])
    assert np.abs(np.polyval(np.polyfit(thetas, found, 2), thetas) - found).max() < 1e-10
    assert not one.at(0.3).scheduled


def test_matrices_and_slopes_go_with_the_operating_point():
    blocks = {
        "K": pid(kd=0.1, filter_time=0.02, scheduled={"kp": 1, "ki": 2, "kd": 1}),
        "notch": robust.tuning.Notch(
            omega=[30.0, 40.0], scheduled={"omega": 1}, reads="a", drives="b"
        ),
    }
    controller = controller_of_blocks(blocks, 0.01)
    x = controller.start + 0.1 * np.random.default_rng(3).normal(size=controller.start.size)
    for theta in (-1.0, 0.4):
        frozen = {name: one.at(theta) for name, one in controller.blocks_at(x).items()}
        fixed = controller_of_blocks(frozen, 0.01)
        assert np.allclose(controller.matrix(x, theta), fixed.matrix(fixed.start), rtol=1e-12)
        for k, slope in enumerate(controller.slopes(x, theta)):
            step = 1e-6 * np.eye(x.size)[k]
            wanted = controller.matrix(x + step, theta) - controller.matrix(x - step, theta)
            assert np.allclose(slope, wanted / 2e-6, rtol=1e-6, atol=1e-6 * np.abs(wanted).max())


# ---- Tuning.


def test_a_schedule_is_as_good_as_a_tuning_at_each_point():
    """With as many coefficients as points the loops are independent; one gain for both is worse."""
    plants = [lag(1.0), lag(4.0)]
    limits = {
        "hard": [
            robust.tuning.Limit("r", "u", 10.0),
            robust.tuning.Limit("d", "u", 1.05),
            robust.tuning.Limit("r", "y", 1.2),
        ],
        "soft": [robust.tuning.Limit("r", "e", 1.0, band=(0.0, 0.3))],
        "delay": 0.1,
        "n_starts": 1,
    }
    kp = pid(ki=0.0)
    alone = [
        robust.tune(
            JOINED, robust.tuning.Plants(one, inputs="u", outputs="y"), {"K": kp}, **limits
        ).gamma
        for one in plants
    ]
    together = robust.tuning.Plants(
        plants, inputs="u", outputs="y", at=[0.0, 3.0], over="load", unit="kg"
    )
    moving = robust.tune(JOINED, together, {"K": pid(ki=0.0, scheduled={"kp": 1})}, **limits)
    still = robust.tune(JOINED, together, {"K": kp}, **limits)
    assert moving.met
    assert moving.gamma == pytest.approx(max(alone), rel=1e-3)
    assert still.gamma > 1.3 * moving.gamma
    K = moving.schedule("y", "u")
    assert (K.order, len(K.D), K.over, K.unit) == (0, 2, "load", "kg")
    assert [K.at(p).D[0, 0] for p in (0.0, 3.0)] == pytest.approx(moving.blocks["K"].kp.tolist())
    with pytest.raises(ValueError, match="scheduled must be empty for one system"):
        moving.controller("y", "u")


@pytest.fixture(scope="module")
def moved():
    """Return a design for a spring that moves, its plant with a weight."""
    weight = control.ss([], [], [], 0.1, 5e-3)
    known = {"at": POINTS, "over": "position", "unit": "m"}
    plant = LpvModel.from_points([spring(p) for p in POINTS], weight=weight, **known)
    blocks = {
        "K": pid(kp=300.0, ki=900.0, drives="a", scheduled={"kp": 1, "ki": 2}),
        "notch": robust.tuning.Notch(omega=40.0, scheduled={"omega": 2}, reads="a", drives="v"),
    }
    design = robust.tune(
        JOINED,
        robust.tuning.Plants(plant, inputs="u", outputs="y"),
        blocks,
        hard=[robust.tuning.Limit("d", "u", 2.0, worst=True)],
        soft=[robust.tuning.Limit("d", "y", 2e-3, band=(0.0, 4.0))],
        dt=5e-3,
        delay=5e-3,
        n_starts=1,
    )
    return design, plant


def test_the_schedule_is_the_tuned_blocks_at_every_point(moved):
    design, plant = moved
    K = design.schedule("y", "u")
    assert (K.over, K.unit, K.dt) == ("position", "m", 5e-3)
    assert np.array_equal(K.points, POINTS)
    for p in (-0.2, 0.03, 0.1, 0.4):
        theta = float(np.clip((p - 0.1) / 0.3, -1, 1))
        parts = [design.blocks[name].at(theta).system(5e-3) for name in ("K", "notch")]
        z = np.exp(1j * np.geomspace(1e-3, 3.0, 30))
        wanted, at = parts[0](z) * parts[1](z), K.at(p)
        assert np.abs(at(z) / wanted - 1).max() < 1e-3
        assert np.abs(at.poles() - 1).min() == 0  # the integrator does not move
    loop = design.loop("d", "y", plant=2)
    frozen = control.sample_system(plant.at(0.4), 5e-3)
    late = control.tf([1], [1, 0], 5e-3)
    closed = control.feedback(frozen * late, K.at(0.4))
    assert loop(0.9 + 0.1j) == pytest.approx(closed(0.9 + 0.1j), rel=1e-3)


def test_the_set_of_an_lpv_model_is_tuned_and_proved(moved):
    design, plant = moved
    assert design.met, str(design)
    proof = robust.prove_schedule(
        plant, design.schedule("y", "u"), rate=0.1, delay=5e-3, limit=False
    )
    assert proof.holds, str(proof)


def test_frfs_at_operating_points_are_scheduled():
    omega = np.geomspace(0.05, 30, 80)
    frfs = [control.frd(lag(g)(1j * omega), omega) for g in (1.0, 4.0)]
    design = robust.tune(
        JOINED,
        robust.tuning.Plants(frfs, inputs="u", outputs="y", at=[0, 1]),
        {"K": pid(ki=0.0, kp=[1.0, 0.25], scheduled={"kp": 1})},
        hard=[robust.tuning.Limit("r", "y", 0.8)],
        soft=[robust.tuning.Limit("r", "e", 1.0, band=(0.0, 0.3))],
        n_starts=1,
    )
    low, high = design.blocks["K"].kp
    assert low / high == pytest.approx(4.0, rel=2e-3)


def test_messages_name_the_operating_point():
    omega = np.geomspace(0.05, 30, 80)
    third = control.tf([4.0], [1, 3, 3, 1])  # stable with a gain below 2
    frfs = [control.frd(G(1j * omega), omega) for G in (lag(1.0), third)]
    known = {"at": [0.1, 0.3], "over": "position", "unit": "m", "inputs": "u", "outputs": "y"}
    limits = {"hard": [robust.tuning.Limit("r", "y", 0.8)], "n_starts": 1}
    with pytest.raises(ValueError, match=r"does not stabilise plant at position = 0\.3 m\. Design"):
        robust.tune(
            JOINED, robust.tuning.Plants(frfs, **known), {"K": pid(kp=10.0, ki=0.0)}, **limits
        )
    with pytest.raises(
        ValueError, match=r"must have lines of plant at position = 0\.1 m in its band"
    ):
        robust.tune(
            JOINED,
            robust.tuning.Plants(frfs[:1] * 2, **known),
            {"K": pid(kp=0.1, ki=0.0)},
            hard=[robust.tuning.Limit("r", "y", 0.8, band=(100.0, 200.0))],
            n_starts=1,
        )
    plants = robust.tuning.Plants([lag(1.0), lag(4.0)], **known)
    missed = robust.tune(
        JOINED, plants, {"K": pid(ki=0.0)}, hard=[robust.tuning.Limit("r", "y", 1e-3)], n_starts=1
    )
    for text in (str(missed), missed.reason):
        assert "on plant at position = 0.3 m" in text
        assert "plant 1" not in text


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("seed", [10_002, 10_003])
def test_a_random_structure_is_scheduled_as_it_was_tuned(seed, tmp_path):
    """The seeded part of benchmarks.attack_schedule: response and limits of the schedule, and the
    code of a sampled one.
    """
    design, loop = harness.random_design(np.random.default_rng(seed))
    assert design.stable
    K = design.schedule("y", "v")
    off, excess = harness.largest_errors(design, K, loop)
    assert off < 1e-3
    assert -0.01 < excess < 1e-3
    if K.dt and shutil.which("cc"):
        assert harness.code_error(K, tmp_path) < 1e-9


# ---- Refusals.


@pytest.mark.parametrize(
    ("make", "message"),
    [
        (lambda: pid(scheduled={"omega": 1}), "scheduled must give degrees by name"),
        (lambda: pid(scheduled="kp"), "scheduled must give degrees by name"),
        (
            lambda: robust.tuning.Gain(K=1.0, reads="e", drives="v", scheduled={"K": 1}),
            "scheduled must give degrees by name .none here: take Pid.",
        ),
        (
            lambda: pid(scheduled={"kp": 0}),
            r"scheduled\['kp'\] must be a whole number of at least 1",
        ),
        (lambda: pid(kp=[1.0, 2.0], scheduled={"kp": 2}), "kp must start at one number .* or at 3"),
        (lambda: pid(kp=[1.0, -2.0], scheduled={"kp": 1}), "coefficients of one sign"),
        (lambda: pid(kd=0.0, scheduled={"kd": 1}), "kd must start at one number that is not zero"),
        (lambda: pid(kp=[1.0, 2.0]), "kp must be a real number"),
        (
            lambda: robust.tuning.Notch(omega=9.0, scheduled={"omega": 1}).at(1.5),
            "theta must lie between -1 and 1",
        ),
        (
            lambda: robust.tuning.Notch(omega=9.0, scheduled={"omega": 1}).section(100.0),
            "scheduled must be empty",
        ),
        (
            lambda: robust.tuning.Plants(lag(1), inputs="u", outputs="y", at=[0.0]),
            "at must be at least two",
        ),
        (
            lambda: robust.tuning.Plants([lag(1)] * 3, inputs="u", outputs="y", at=[0, 1]),
            "at must have one operating point for each plant, got 2 for 3",
        ),
        (
            lambda: robust.tuning.Plants(
                LpvModel.from_points([lag(1), lag(2)], at=[0, 1]),
                inputs="u",
                outputs="y",
                at=[0, 2],
            ),
            "at must begin and end with the range of the model, operating point from 0 to 1, got",
        ),
    ],
)
def test_bad_schedules_are_refused(make, message):
    with pytest.raises(ValueError, match=message):
        make()


@pytest.mark.parametrize(
    ("plants", "degree", "more", "message"),
    [
        ({}, 1, [], "plant must have at least 2 operating points for K.kp of degree 1, got no"),
        ({"at": [0, 1]}, 2, [], "plant must have at least 3 operating points for K.kp .* got 2"),
        (
            {"at": [0, 1]},
            1,
            [
                robust.tuning.FrictionLimit(friction_plant(1.0, 80e3), MaxwellSlip(64e3)),
            ],
            "hard must hold no friction limit for scheduled blocks",
        ),
    ],
)
def test_schedules_without_points_are_refused(plants, degree, more, message):
    with pytest.raises(ValueError, match=message):
        robust.tune(
            JOINED,
            robust.tuning.Plants([lag(1.0), lag(2.0)], inputs="u", outputs="y", **plants),
            {"K": pid(scheduled={"kp": degree})},
            hard=[robust.tuning.Limit("d", "u", 2.0), *more],
        )


def test_a_design_without_points_has_no_schedule():
    design = robust.tune(
        JOINED,
        robust.tuning.Plants(lag(1.0), inputs="u", outputs="y"),
        {"K": pid(ki=0.0)},
        hard=[robust.tuning.Limit("r", "u", 9.0)],
        n_starts=1,
    )
    with pytest.raises(ValueError, match="plant must have operating points for a schedule"):
        design.schedule("y", "u")
