"""A proof of a machine with friction, made again over the rationals: what holds is verified, what
was changed not.
"""

from dataclasses import fields, replace
from typing import get_args

import control
import numpy as np
import pytest

from robust import friction_plant, prove_friction, save
from robust.friction import Bristle, MaxwellSlip
from robust.friction.exact.claim import FrictionClaim
from robust.friction.exact.classes import PortClaim
from robust.friction.exact.loops import equilibrium, exact_loop
from robust.friction.exact.verify import verify_friction
from robust.friction.loop import friction_loop
from robust.io import verify_certificate
from robust.proofs.exact.claim_files import from_plain, to_plain
from tests.support.friction_loops import ORACLES, RIG, T, pd, pid
from tests.support.printed import unwrapped

SLIP = MaxwellSlip(64e3, 1.05)
(KP, KI, KD, _), _, _ = ORACLES["P1"]


@pytest.fixture(scope="module")
def proof():
    return prove_friction(RIG, pid(KP, KI, KD), SLIP)


def floats(matrix):
    return np.array([[float(x.p) / float(x.q) for x in row] for row in matrix.tolist()])


@pytest.mark.parametrize("delay", [0.0, 0.3e-3, 1e-3, 1.7e-3])
def test_the_loop_is_built_anew_and_is_the_same(proof, delay):
    exact = exact_loop(replace(proof.certificate.claim, delay=delay))
    mine = friction_loop(RIG, pid(KP, KI, KD), delay)
    assert np.allclose(floats(exact.F), mine.F, rtol=1e-14)
    assert np.allclose([floats(jump) for jump in exact.jumps], mine.jumps, rtol=1e-14)
    assert np.allclose(floats(equilibrium(exact))[:, 0], mine.rest()[0], rtol=1e-9, atol=1e-18)
    assert sum(float(span.p) / float(span.q) for span in exact.spans) == pytest.approx(T)


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
    found = verify_friction(replace(claim, ports=ports, **others))
    assert not found.verified
    assert failed in unwrapped(found.failed)


def test_an_energy_that_is_not_one_fails(proof):
    claim = proof.certificate.claim
    steps = claim.P.copy()
    steps[1] *= 1 + 1e-9  # no longer what the interval before it ends with
    for P in (-claim.P, 1e6 * claim.P, steps):
        assert not verify_friction(replace(claim, P=P)).verified


def test_a_block_that_is_negative_somewhere_fails():
    claim = prove_friction(RIG, pd(20e3, 60.0), Bristle(64e3, 1 / 0.7, 13.0)).certificate.claim
    assert verify_friction(claim).verified
    (port,) = claim.ports
    wrong = replace(port, block=port.block - np.diag([1.0, 0.0, 0.0]))
    assert "negative somewhere" in unwrapped(verify_friction(replace(claim, ports=(wrong,))).failed)


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
    with pytest.raises(ValueError, match="claim must have the entries"):
        from_plain(FrictionClaim, {"K0": 1.0})


def test_a_file_tells_the_classes_by_their_entries():
    entries = [frozenset(one.name for one in fields(port)) for port in get_args(PortClaim)]
    assert len(set(entries)) == len(entries) > 1


def test_content_gives_every_number_back(proof):
    claim = proof.certificate.claim
    again = from_plain(FrictionClaim, to_plain(claim))
    assert to_plain(again) == to_plain(claim)
    assert np.array_equal(again.P, claim.P)
