"""A level of mu interval by interval: closed forms that one scaling cannot prove, and what must not
pass.
"""

import json
from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust.io import verify_certificate
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.mu.intervals import certify_intervals
from robust.proofs.exact.channel_files import ChannelsClaim
from robust.proofs.exact.claim_files import content_digest, from_plain, to_plain, write_claim
from robust.proofs.exact.interval_kyp import ComplexMatrix, IntervalClaim, verify_level
from robust.proofs.search.scaled_kyp import certify_scaled
from tests.support.scaled_loops import STRUCTURES, random_loop

BLOCKS = [(1, 1, "full"), (1, 1, "full")]
PEAK = np.sqrt(0.5)


def opposed(dt=0.0):
    """[0, 1/(s + 1); s/(s + 1), 0]: mu^2 is w/(1 + w^2), at most 1/2, where one scaling reaches 1
    at both ends.
    """
    N = control.StateSpace(
        -np.eye(2), np.eye(2), np.array([[0.0, 1.0], [-1.0, 0.0]]), np.array([[0.0, 0], [1, 0]]), 0
    )
    return robust.lti.discretize(N, dt) if dt else N


@pytest.fixture(scope="module", params=[0.0, 0.5], ids=["continuous", "sampled"])
def proof(request):
    return robust.mu.certify(opposed(request.param), BLOCKS, 1.01 * PEAK)


def test_what_one_scaling_cannot_prove_intervals_do(proof):
    assert (proof.holds, proof.method, proof.judged) == (
        True,
        "generalised KYP",
        "proved, rigorous",
    )
    assert proof.verify().verified
    assert proof.verify().proved == ("stability", "structured singular value")
    assert len(proof.claim.pieces) > 1
    dt = proof.claim.system.dt
    assert proof.intervals[0, 0] == 0
    assert proof.intervals[-1, 1] == (pytest.approx(np.pi / dt) if dt else np.inf)
    assert np.array_equal(proof.intervals[1:, 0], proof.intervals[:-1, 1])
    assert certify_scaled(opposed(dt), BLOCKS, 0.999) is None
    assert certify_scaled(opposed(dt), BLOCKS, 1.001).verify().verified


def test_below_mu_nothing_is_proved_and_the_frequency_is_named():
    refused = robust.mu.certify(opposed(), BLOCKS, 0.999 * PEAK)
    assert not refused.holds
    assert (
        "the bound does not stay below the level: at 0.1" in refused.reason
    )  # 1 rad/s are 0.159 Hz
    assert not refused.verify().verified


def test_what_is_left_is_named_with_its_interval():
    left = certify_intervals(opposed(), BLOCKS, 1.0001 * PEAK, most=1)
    assert not left.holds
    assert "undecided from 0 Hz to" in left.reason


def changed(claim, k=0, **parts):
    """The claim with other parts of a piece."""
    return replace(
        claim, pieces=(*claim.pieces[:k], replace(claim.pieces[k], **parts), *claim.pieces[k + 1 :])
    )


def times(factor, M):
    """A multiple of a matrix."""
    return ComplexMatrix.of(factor * (M.re + 1j * M.im))


def test_what_is_changed_does_not_pass(proof):
    claim = proof.claim
    first, *_, last = claim.pieces
    wrong = {
        "the level": replace(claim, level=0.9 * claim.level),
        "P": changed(claim, P=ComplexMatrix.of(1e3 * np.eye(2))),
        "P that is not Hermitian": changed(claim, P=times(1j, first.P)),
        "Q": changed(claim, Q=times(-1, first.Q)),
        "no Q": changed(claim, Q=times(0, first.Q)),
        "X": changed(claim, scalings=tuple(times(-1, X) for X in first.scalings)),
        "X of another interval": changed(claim, scalings=last.scalings),
        "K on a complex block": changed(
            claim, skews=(times(1j, first.scalings[0]), first.skews[1])
        ),
        "the pieces": replace(claim, pieces=claim.pieces[::-1]),
        "the cuts": replace(claim, cuts=1000 * claim.cuts),
        "the gain": replace(
            claim, system=replace(claim.system, C=1.1 * claim.system.C, D=1.1 * claim.system.D)
        ),
    }
    assert {name for name, one in wrong.items() if verify_level(one).verified} == set()
    for name in ("stability", "T"):
        assert (
            "stability"
            not in verify_level(replace(claim, **{name: 0 * getattr(claim, name)})).proved
        )
    A = claim.system.A
    unstable = replace(
        claim, system=replace(claim.system, A=A + (2 if claim.system.dt else 1.5) * np.eye(len(A)))
    )
    assert "stability" not in verify_level(unstable).proved


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (lambda one: {"cuts": one.cuts[:-1]}, "cuts must be one fewer than pieces"),
        (lambda one: {"cuts": -one.cuts}, "positive and increasing"),
        (lambda one: {"cuts": np.full(one.cuts.shape, np.nan)}, "positive and increasing"),
        (lambda one: {"T": np.eye(3)}, "pieces must hold finite matrices that fit"),
        (lambda one: {"level": 0.0}, "level must be positive"),
        (lambda one: {"blocks": (*one.blocks, (1, 1, "full"))}, "blocks must add up to D"),
    ],
)
def test_claims_that_do_not_fit_are_refused(proof, change, message):
    with pytest.raises(ValueError, match=message):
        replace(proof.claim, **change(proof.claim))


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize("blocks", STRUCTURES[2:], ids=str)
def test_random_loops_are_proved_above_the_bound_and_not_below_mu(blocks, dt):
    N = random_loop(np.random.default_rng(len(blocks)), 5, blocks, dt)
    response = response_by_channel(N, structure_grid(N))
    upper = robust.mu.upper(response, blocks).value.max()
    lower = robust.mu.lower(response[:, :, ::10], blocks).value.max()
    found = certify_intervals(N, blocks, 1.5 * upper)
    assert found.verify().verified, found.reason
    assert any(
        K.im.any() or K.re.any() for piece in found.claim.pieces for K in piece.skews
    ) == any(kind == "real" for _, _, kind in blocks)
    assert not certify_intervals(N, blocks, 0.999 * lower).holds


def test_a_file_gives_every_number_back_and_is_verified(proof, tmp_path):
    claim, path = proof.claim, tmp_path / "proof.json"
    again = from_plain(IntervalClaim, json.loads(json.dumps(to_plain(claim))))
    assert to_plain(again) == to_plain(claim)
    write_claim(path, ChannelsClaim(claims={"robust stability": claim}, form="", delay=0.0))
    assert verify_certificate(path).proved == ("nominal stability", "robust stability")
    content = json.loads(path.read_text())
    content["claim"]["claims"]["robust stability"]["level"] *= 0.9
    content["digest"] = content_digest(
        {name: entry for name, entry in content.items() if name != "digest"}
    )
    path.write_text(json.dumps(content))
    assert "robust stability: NOT verified: the inequality does not pass from" in str(
        verify_certificate(path)
    )
