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
from robust.mu.intervals import certify_intervals
from tests.support.scaled_loops import STRUCTURES, bounds_on_grid, random_loop
from tests.support.signed import signed

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
    assert robust.mu.certify(opposed(dt), BLOCKS, 0.999).method == "generalised KYP"
    one = robust.mu.certify(opposed(dt), BLOCKS, 1.001)
    assert one.method == "scaled KYP"
    assert one.verify().verified


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
    """A multiple of a matrix, which may be complex."""
    product = factor * (M.re + 1j * M.im)
    return replace(M, re=product.real, im=product.imag)


def test_what_is_changed_does_not_pass(proof):
    claim, verify = proof.claim, proof.again
    first, *_, last = claim.pieces
    wrong = {
        "the level": replace(claim, level=0.9 * claim.level),
        "P": changed(claim, P=replace(first.P, re=1e3 * np.eye(2), im=np.zeros((2, 2)))),
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
    assert {name for name, one in wrong.items() if verify(one).verified} == set()
    for name in ("stability", "T"):
        assert "stability" not in verify(replace(claim, **{name: 0 * getattr(claim, name)})).proved
    A = claim.system.A
    unstable = replace(
        claim, system=replace(claim.system, A=A + (2 if claim.system.dt else 1.5) * np.eye(len(A)))
    )
    assert "stability" not in verify(unstable).proved


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
    upper, lower = bounds_on_grid(N, blocks)
    found = certify_intervals(N, blocks, 1.5 * upper)
    assert found.verify().verified, found.reason
    assert any(
        K.im.any() or K.re.any() for piece in found.claim.pieces for K in piece.skews
    ) == any(kind == "real" for _, _, kind in blocks)
    assert not certify_intervals(N, blocks, 0.999 * lower).holds


def test_a_file_gives_every_number_back_and_is_verified(tmp_path):
    loop = opposed() * (1 / (1.01 * PEAK))
    loop = control.StateSpace(loop, inputs=["a", "b"], outputs=["y", "z"])
    system = robust.models.interconnection(
        [loop], {"one": robust.models.Block("y", "a"), "two": robust.models.Block("z", "b")}
    )
    report, path = robust.analysis.check_structure(system), tmp_path / "proof.json"
    (proof,) = report.proofs.certificates
    assert proof.method == "generalised KYP"
    robust.save(report, path)
    assert verify_certificate(path).proved == ("nominal stability", "robust stability")
    content = json.loads(path.read_text())
    written, claim = content["claim"]["claims"]["robust stability"], proof.claim
    assert (written["level"], written["cuts"]) == (claim.level, claim.cuts.tolist())
    for piece, kept in zip(written["pieces"], claim.pieces, strict=True):
        for name in ("P", "Q"):
            assert piece[name]["re"] == getattr(kept, name).re.tolist()
            assert piece[name]["im"] == getattr(kept, name).im.tolist()
    written["level"] *= 0.9
    path.write_text(json.dumps(signed(content)))
    assert "robust stability: NOT verified: the inequality does not pass from" in str(
        verify_certificate(path)
    )
