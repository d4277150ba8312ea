"""An actuator that saturates: what is proved with it comes to rest, and the proof is no proof once
a number is off.
"""

from dataclasses import replace
from functools import cache

import control
import numpy as np
import pytest

import nlfrf
from robust import prove_friction
from robust.friction import Bristle, MaxwellSlip, Passive
from robust.friction.plant import friction_plant
from robust.io import verify_certificate
from tests.support.friction_loops import ORACLES, RIG, T, pd, pid
from tests.support.printed import unwrapped

LIMIT, FS = 20.0, 1.0
SLIP = MaxwellSlip(64e3, 1.05)


def played(law, K, delay, kick, c=0.4, force=0.0):
    """Largest force of the actuator, and swing of the last tenth over the largest, after a kick."""
    rig = nlfrf.rig.Rig(1.0, 80e3, law, c)
    disturbance = np.where(np.arange(4000) < 40, force, 0.0)
    response = nlfrf.rig.run(
        rig,
        np.zeros(4000),
        nlfrf.rig.Controller(K, delay=delay, saturation=LIMIT),
        disturbance=disturbance,
        initial=(0.0, kick),
        oversampling=16,
    )
    return np.abs(response.u).max(), np.ptp(response.x[-400:]) / np.ptp(response.x)


def laws(seed, n):
    rng = np.random.default_rng(seed)
    for _ in range(n):
        elements = {
            "stiffness": 64e3 * rng.dirichlet(np.ones(3)),
            "strength": FS * rng.dirichlet(np.ones(3)),
        }
        yield nlfrf.friction.VaryingSliders(
            stiction=1.05, vs=0.01, dwell=0.05, wavelength=1e-4, asymmetry=0.3, **elements
        )


@cache
def oracle_proof(name):
    (Kp, Ki, Kd, delay), _, _ = ORACLES[name]
    return prove_friction(RIG, pid(Kp, Ki, Kd), SLIP, Fs=FS, saturation=LIMIT, delay=delay)


@pytest.fixture(params=["P1", "P3", "P4"])
def with_integral_action(request):
    (Kp, Ki, Kd, delay), _, _ = ORACLES[request.param]
    return pid(Kp, Ki, Kd), delay, oracle_proof(request.param)


@pytest.mark.filterwarnings("ignore:the hysteresis memory")
def test_a_kick_that_saturates_is_proved_and_comes_to_rest(with_integral_action):
    K, delay, proof = with_integral_action
    assert proof.verdict == "proved up to a kick"
    assert proof.actuator.kick > 4 * proof.actuator.kick_linear
    for law in laws(0, 3):
        force, swing = played(law, K, delay, 0.999 * proof.actuator.kick)
        assert force == LIMIT or proof.actuator.kick < LIMIT / (K.D[0, 0] * 4e-4)
        assert swing < 0.05
        assert played(law, K, delay, proof.actuator.kick_linear)[0] < LIMIT
    assert "a quadratic energy cannot prove it" in unwrapped(proof)


def test_it_is_proved_again_over_the_rationals(with_integral_action):
    proof = with_integral_action[2]
    assert proof.certificate.verify().verified


@pytest.mark.parametrize(
    ("name", "factor", "part"),
    [
        ("kick", 1.05, "the actuator stays within reach"),
        ("limit", 0.95, "the actuator stays within reach"),
        ("Fs", 2.0, "the actuator stays within reach"),
        ("share", 1.1, "the energy falls at samples"),
        ("sector", 1e-3, "the energy falls at samples"),
    ],
)
def test_a_number_that_is_off_is_found(name, factor, part):
    certificate = oracle_proof("P4").certificate
    own = certificate.claim.actuator
    wrong = replace(own, **{name: factor * getattr(own, name)})
    again = replace(certificate, claim=replace(certificate.claim, actuator=wrong)).verify()
    assert not again.verified
    assert part in dict(again.failed)


def test_weights_that_no_actuator_allows_are_found():
    certificate = oracle_proof("P4").certificate
    own = certificate.claim.actuator
    for wrong in (
        {"sector": -own.sector},
        {"share": 1.5},
        {"limit": 0.5},
        {"forgets": 2 + 0 * own.forgets},
    ):
        claim = replace(certificate.claim, actuator=replace(own, **wrong))
        assert "weights of the class" in dict(replace(certificate, claim=claim).verify().failed)


@pytest.mark.filterwarnings("ignore:the hysteresis memory")
def test_from_every_state_where_the_machine_is_damped():
    machine, K = friction_plant(1.0, 80e3, 40.0), pd(1e3, 10.0)
    proof = prove_friction(machine, K, SLIP, Fs=FS, saturation=LIMIT)
    assert proof.verdict == "proved"
    assert np.isinf(proof.actuator.kick)
    assert "from every state" in proof.claim
    assert proof.certificate.verify().verified
    for law, kick in zip(laws(1, 3), (0.1, 1.0, 10.0), strict=True):
        assert played(law, K, 0.0, kick, c=40.0, force=200.0)[1] < 0.05


def test_a_continuous_controller_too(tmp_path):
    PD = control.ss(control.tf([60.0, 20e3], [1e-4, 1]))
    proof = prove_friction(RIG, PD, SLIP, Fs=FS, saturation=LIMIT)
    assert proof.actuator.kick > proof.actuator.kick_linear > 0
    nlfrf.save(proof, tmp_path / "proof.json")
    assert verify_certificate(tmp_path / "proof.json").verified


def test_part_of_a_sample_late():
    proof = prove_friction(RIG, pid(20e3, 3e5, 60.0), SLIP, Fs=FS, saturation=LIMIT, delay=0.3 * T)
    assert proof.actuator.kick > 2 * proof.actuator.kick_linear
    assert proof.certificate.verify().verified


def test_the_rig_of_the_paper_as_far_as_it_never_saturates():
    proof = prove_friction(
        RIG, pd(20e3, 60.0), Bristle(64e3, 1 / 0.7, 13.0), Fs=FS, saturation=LIMIT
    )
    assert proof.actuator.kick == proof.actuator.kick_linear > 0
    assert proof.actuator.share == 0
    assert "not tried for this class" in proof.reason
    assert "rigid stiction" in proof.not_claimed
    force, swing = played(nlfrf.friction.Leuven(), pd(20e3, 60.0), 0.0, proof.actuator.kick, c=0.0)
    assert force < LIMIT
    assert swing < 0.05


@pytest.mark.parametrize("friction", [SLIP, Bristle(64e3, 1.2)])
def test_an_actuator_that_is_asked_for_nothing_never_saturates(friction):
    proof = prove_friction(friction_plant(1.0, 80e3, 40.0), 0.0, friction, Fs=FS, saturation=LIMIT)
    assert (proof.verdict, proof.actuator.kick, proof.reason) == ("proved", np.inf, "")
    assert "from every state" in proof.claim
    excluded = "LuGre" if friction is SLIP else "rigid stiction"
    assert excluded in proof.not_claimed


def test_the_kick_grows_with_what_the_limit_leaves_over_friction():
    """With integral action the actuator holds the friction: the kick is in proportion to the limit
    less Fs.
    """
    proof = prove_friction(RIG, pid(40e3, 1e6, 120.0), SLIP, Fs=FS, saturation=3.0, delay=T)
    for name in ("kick", "kick_linear"):
        assert getattr(oracle_proof("P3").actuator, name) == pytest.approx(
            19 / 2 * getattr(proof.actuator, name), rel=1e-6
        )


def test_what_is_refuted_without_saturation_is_with_it():
    proof = prove_friction(RIG, pid(0.0, 2e6, 0.0), SLIP, Fs=FS, saturation=LIMIT)
    assert proof.verdict == "refuted"
    assert proof.actuator.kick == 0
    assert " ".join(str(proof).split()).startswith(
        "refuted: without saturation: the sliding loop is unstable"
    )


def test_friction_at_a_port_that_the_actuator_cannot_hold():
    lever = control.ss(
        [[0.0, 1.0], [-80e3, -0.4]],
        [[0.0, 0.0], [0.01, 1.0]],
        [[1.0, 0.0], [1.0, 0.0]],
        np.zeros((2, 2)),
    )
    K = pid(2e6, 3e7, 6e3)
    proof = prove_friction(friction_plant(lever, port=True), K, SLIP, Fs=FS, saturation=LIMIT)
    assert proof.verdict == "not decided"
    assert proof.reason == "the friction alone uses up the limit"


@pytest.mark.parametrize(
    ("friction", "options", "words"),
    [
        (
            SLIP,
            {"saturation": 1.0},
            "saturation must be above Fs, the largest friction force, got 1 N and Fs = 1 N",
        ),
        (SLIP, {"saturation": -1.0}, "saturation must be positive"),
        (SLIP, {"Fs": 0.0}, "Fs must be positive"),
        (
            SLIP,
            {"Fs": None},
            "saturation must be above Fs, the largest friction force, got 20 N and Fs = nan N",
        ),
        (
            Passive(),
            {},
            "saturation must be left out for passive friction",
        ),
    ],
)
def test_refusals(friction, options, words):
    with pytest.raises(ValueError, match=words):
        prove_friction(RIG, pd(20e3, 60.0), friction, **{"Fs": FS, "saturation": LIMIT} | options)
