"""A proof of a machine with friction, made again over the rationals: what holds is verified, what
was changed not.
"""

import json
from dataclasses import fields, replace

import control
import numpy as np
import pytest

from robust import friction_plant, prove_friction, save
from robust.friction import Bristle, MaxwellSlip
from robust.io import verify_certificate
from tests.support.friction_loops import ORACLES, RIG, T, pd, pid
from tests.support.printed import unwrapped
from tests.support.signed import signed

SLIP = MaxwellSlip(64e3, 1.05)
(KP, KI, KD, _), _, _ = ORACLES["P1"]


@pytest.fixture(scope="module")
def proof():
    return prove_friction(RIG, pid(KP, KI, KD), SLIP)


def test_what_is_proved_is_verified(proof):
    found = proof.certificate.verify()
    assert found.verified
    assert str(found).count("proved, rigorous") == 4


@pytest.mark.parametrize(
    ("K", "friction", "delay"),
    [
        (pid(40e3, 1e6, 120.0), SLIP, T),
        (pd(20e3, 60.0), Bristle(64e3, 1 / 0.7, 13.0), 0.3e-3),
        (control.ss(control.tf([60.0, 20e3, 3e5], [1e-5, 1, 0])), SLIP, 0.0),
    ],
)
def test_delays_bristles_and_continuous_controllers(K, friction, delay):
    proof = prove_friction(RIG, K, friction, delay=delay)
    assert proof.verdict == "proved"
    assert proof.certificate.verify().verified


@pytest.mark.parametrize(
    ("changes", "failed"),
    [
        ({"K0": 6.4e6}, "the energy"),
        ({"stiction": 3.0}, "the energy"),
        ({"delay": T}, "the claim"),
        ({"free": -1.0}, "weights of the class"),
        ({"bristle_time": 1.0}, "weights of the class"),
        ({"counts": np.array([1])}, "the energy falls between samples"),
    ],
)
def test_a_stronger_claim_than_was_proved_fails(proof, changes, failed):
    claim = proof.certificate.claim
    ports = tuple(
        replace(port, **{k: v for k, v in changes.items() if hasattr(port, k)})
        for port in claim.ports
    )
    others = {name: value for name, value in changes.items() if hasattr(claim, name)}
    found = proof.certificate.again(replace(claim, ports=ports, **others))
    assert not found.verified
    assert failed in unwrapped(found.failed)


def test_an_energy_that_is_not_one_fails(proof):
    claim = proof.certificate.claim
    steps = claim.P.copy()
    steps[1] *= 1 + 1e-9  # no longer what the interval before it ends with
    for P in (-claim.P, 0.5 * claim.P, claim.P[::-1], 1e6 * claim.P, steps):
        assert not proof.certificate.again(replace(claim, P=P)).verified


def test_a_block_that_is_negative_somewhere_fails():
    proof = prove_friction(RIG, pd(20e3, 60.0), Bristle(64e3, 1 / 0.7, 13.0))
    claim = proof.certificate.claim
    assert proof.certificate.verify().verified
    (port,) = claim.ports
    wrong = replace(port, block=port.block - np.diag([1.0, 0.0, 0.0]))
    assert "negative somewhere" in unwrapped(
        proof.certificate.again(replace(claim, ports=(wrong,))).failed
    )


def test_files(proof, tmp_path):
    path = tmp_path / "proof.json"
    save(proof, path)
    assert verify_certificate(path, model=RIG, K=pid(KP, KI, KD)).verified
    other = verify_certificate(path, model=friction_plant(1.0, 80e3), K=pid(KP, KI, 1.01 * KD))
    assert not other.verified
    assert {name for name, _ in other.failed} == {"the machine", "the controller"}
    path.write_text(path.read_text().replace('"stiction": 1.05', '"stiction": 1.06'))
    with pytest.raises(ValueError, match="whose digest does not fit"):
        verify_certificate(path)
    with pytest.raises(ValueError, match="report must contain a proof"):
        save(prove_friction(RIG, pid(KP, KI, KD), MaxwellSlip(64e5, 1.05)), path)


def test_a_file_without_an_entry_is_refused(proof, tmp_path):
    path = tmp_path / "proof.json"
    save(proof, path)
    content = json.loads(path.read_text())
    del content["claim"]["counts"]
    path.write_text(json.dumps(signed(content)))
    with pytest.raises(ValueError, match="'counts' is a required property"):
        verify_certificate(path)


def test_a_file_tells_the_classes_by_their_entries(proof, tmp_path):
    bristle = prove_friction(RIG, pd(20e3, 60.0), Bristle(64e3, 1 / 0.7, 13.0))
    entries = []
    for one in (proof, bristle):
        save(one, tmp_path / "proof.json")
        assert verify_certificate(tmp_path / "proof.json").verified
        (port,) = json.loads((tmp_path / "proof.json").read_text())["claim"]["ports"]
        (own,) = one.certificate.claim.ports
        assert set(port) == {field.name for field in fields(own)}
        entries.append(set(port))
    assert entries[0] != entries[1]


def test_a_file_gives_every_number_back(proof, tmp_path):
    save(proof, tmp_path / "proof.json")
    content, claim = (
        json.loads((tmp_path / "proof.json").read_text())["claim"],
        proof.certificate.claim,
    )
    for name in ("V", "P", "counts"):
        assert np.array_equal(content[name], getattr(claim, name))
    (port,), (own,) = content["ports"], claim.ports
    for name in port:
        assert np.array_equal(port[name], getattr(own, name))
    for name in "ABCD":
        assert np.array_equal(content["machine"][name], getattr(claim.machine, name))
        assert np.array_equal(content["controller"][name], getattr(claim.controller, name))
