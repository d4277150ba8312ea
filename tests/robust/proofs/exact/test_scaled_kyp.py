"""A level of mu from P and one scaling: closed forms to the last bit, and what must not pass."""

import json
from dataclasses import fields, replace

import control
import numpy as np
import pytest

import robust
from robust.mu import certify
from tests.support.exact_claims import matrices
from tests.support.scaled_loops import STRUCTURES, bounds_on_grid, random_loop
from tests.support.signed import signed

ONE = np.ones((1, 1))
FULL = (1, 1, "full")


LAG = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
PROVED = certify(LAG, [FULL], 1.5)
verify = PROVED.again


def lag_claim(level, *, dt=0.0):
    """1/(s + 1), or 0.5/(z - 0.5): the norm is one, at zero frequency, with P = 1 in continuous
    time, 2 in discrete.
    """
    lag = control.ss([[0.5]], [[0.5]], [[1.0]], [[0.0]], dt) if dt else LAG
    return replace(
        PROVED.claim,
        system=matrices(lag),
        level=level,
        P=2 * ONE if dt else ONE,
        T=ONE,
        scalings=(ONE,),
        skews=(0 * ONE,),
    )


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_the_level_itself_fails_and_the_next_double_passes(dt):
    assert not verify(lag_claim(1.0, dt=dt)).verified
    assert verify(lag_claim(np.nextafter(1, 2), dt=dt)).verified


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"P": -ONE}, "P does not pass"),
        ({"P": 0 * ONE}, "P does not pass"),
        ({"scalings": (-ONE,)}, "does not commute"),
        ({"skews": (ONE,)}, "does not commute"),
        ({"system": matrices(control.ss([[1.0]], [[1.0]], [[1.0]], [[0.0]]))}, "P does not pass"),
        ({"system": matrices(2 * LAG)}, "the inequality does not pass"),
    ],
)
def test_what_is_changed_does_not_pass(change, reason):
    assert verify(lag_claim(1.5)).verified
    found = verify(replace(lag_claim(1.5), **change))
    assert not found.verified
    assert reason in str(found)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"blocks": (FULL, FULL)}, "blocks must add up to D"),
        ({"blocks": ((1, 1, "other"),)}, "of a known kind"),
        ({"level": 0.0}, "level must be positive"),
        ({"P": np.eye(2)}, "P must fit system and blocks"),
        ({"T": np.nan * ONE}, "T must hold finite numbers"),
    ],
)
def test_what_is_no_claim_is_refused(change, message):
    with pytest.raises(ValueError, match=message):
        replace(lag_claim(1.5), **change)


def test_a_scaling_that_mixes_channels_of_two_blocks_is_no_scaling():
    """[0 4; 0 0]: mu of two scalars is zero, of one 2 x 2 block four; a full X would prove
    anything.
    """
    known = {
        "system": matrices(control.ss([], [], [], [[0.0, 4.0], [0.0, 0.0]])),
        "P": np.zeros((0, 0)),
        "T": np.zeros((0, 0)),
        "level": 0.1,
    }
    two = replace(
        PROVED.claim,
        blocks=(FULL, FULL),
        scalings=(ONE, 1e5 * ONE),
        skews=(0 * ONE,) * 2,
        **known,
    )
    assert verify(two).verified
    one = {"blocks": ((2, 2, "full"),), "scalings": (ONE,), "skews": (0 * ONE,)}
    assert not verify(replace(two, **one)).verified
    with pytest.raises(ValueError, match="scalings must fit"):
        replace(two, **one | {"scalings": (np.diag([1.0, 1e5]),)})


def test_a_real_parameter_in_two_places_needs_its_skew_matrix():
    """(s + 1)^2 + d^2: no real d breaks it, a complex one of size one does."""
    N = control.ss(-np.eye(2), np.eye(2), [[0.0, 1.0], [-1.0, 0.0]], np.zeros((2, 2)))
    real = certify(N, [(2, 2, "real")], 0.01)
    assert real.method == "scaled KYP"
    assert real.verify().verified
    assert np.any(real.claim.skews[0])
    assert not certify(N, [(2, 2, "repeated")], 0.999).holds
    assert certify(N, [(2, 2, "repeated")], 1.001).verify().verified
    assert not verify(replace(real.claim, skews=(np.zeros((2, 2)),))).verified


def test_a_claim_survives_its_file_to_the_last_bit(tmp_path):
    lag = control.ss([[-1.0]], [[1.0]], [[1 / 3]], [[0.0]], inputs="a", outputs="y")
    system = robust.models.interconnection([lag], {"one": robust.models.Block("y", "a")})
    report, path = robust.analysis.check_structure(system), tmp_path / "proof.json"
    (claim,) = (proof.claim for proof in report.proofs.certificates)
    assert isinstance(claim, type(PROVED.claim))
    robust.save(report, path)
    assert robust.io.verify_certificate(path).verified
    content = json.loads(path.read_text())
    written = content["claim"]["claims"]["robust stability"]
    assert set(written) == {one.name for one in fields(claim)}
    for name in ("P", "T"):
        assert np.array_equal(written[name], getattr(claim, name))
    for name in ("scalings", "skews"):
        assert np.array_equal(written[name], getattr(claim, name))
    del written["level"]
    path.write_text(json.dumps(signed(content)))
    with pytest.raises(ValueError, match="must be as its schema says"):
        robust.io.verify_certificate(path)


@pytest.mark.parametrize("solver", ["CLARABEL", "SCS"])
@pytest.mark.parametrize("dt", [0.0, 0.1])
@pytest.mark.parametrize(
    "blocks", STRUCTURES[:4], ids=lambda blocks: "-".join(f"{b[2]}{b[0]}x{b[1]}" for b in blocks)
)
def test_both_solvers_prove_a_level_above_mu_and_none_below(blocks, dt, solver):
    """The lower bound of mu comes with the perturbation that breaks the loop: no level under it may
    be proved.
    """
    N = random_loop(np.random.default_rng(len(blocks) + blocks[0][0]), 4, blocks, dt)
    upper, lower = bounds_on_grid(N, blocks)
    proof = certify(N, blocks, 2 * upper, solver=solver)
    assert proof.method == "scaled KYP"
    assert proof.verify().verified
    assert not certify(N, blocks, 0.999 * lower, solver=solver).holds


def test_mu_of_several_blocks_is_proved_over_the_rationals():
    """diag(1, 2)/(s + 1) in other units: mu of two scalars is two."""
    lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    proof = certify(control.append(1e6 * lag, 2e-6 * lag), [(1, 1), (1, 1)], 1.001e6)
    assert (proof.holds, proof.method, proof.judged) == (True, "scaled KYP", "proved, rigorous")
    assert proof.level == 1.001e6
    assert proof.verify().proved == ("stability", "structured singular value")
