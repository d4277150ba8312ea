"""A level of mu from P and one scaling: closed forms to the last bit, and what must not pass."""

from dataclasses import replace

import control
import numpy as np
import pytest

import robust
from robust.lti.grids import structure_grid
from robust.lti.lti import response_by_channel
from robust.proofs.exact.claim import Matrices
from robust.proofs.exact.claim_files import from_plain, to_plain
from robust.proofs.exact.interval_kyp import verify_level
from robust.proofs.exact.scaled_kyp import ScaledClaim
from robust.proofs.search.scaled_kyp import certify_scaled
from tests.support.scaled_loops import STRUCTURES, random_loop

ONE = np.ones((1, 1))
FULL = (1, 1, "full")


def lag_claim(level, *, dt=0.0):
    """1/(s + 1), or 0.5/(z - 0.5): the norm is one, at zero frequency, with P = 1 in continuous
    time, 2 in discrete.
    """
    if dt:
        system, P = Matrices(A=ONE / 2, B=ONE / 2, C=ONE, D=0 * ONE, dt=dt), 2 * ONE
    else:
        system, P = Matrices(A=-ONE, B=ONE, C=ONE, D=0 * ONE), ONE
    return ScaledClaim(
        system=system, blocks=(FULL,), level=level, P=P, T=ONE, scalings=(ONE,), skews=(0 * ONE,)
    )


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_the_level_itself_fails_and_the_next_double_passes(dt):
    assert not verify_level(lag_claim(1.0, dt=dt)).verified
    assert verify_level(lag_claim(np.nextafter(1, 2), dt=dt)).verified


@pytest.mark.parametrize(
    ("change", "reason"),
    [
        ({"P": -ONE}, "P does not pass"),
        ({"P": 0 * ONE}, "P does not pass"),
        ({"scalings": (-ONE,)}, "does not commute"),
        ({"skews": (ONE,)}, "does not commute"),
        ({"system": Matrices(A=ONE, B=ONE, C=ONE, D=0 * ONE)}, "P does not pass"),
        ({"system": Matrices(A=-ONE, B=ONE, C=2 * ONE, D=0 * ONE)}, "the inequality does not pass"),
    ],
)
def test_what_is_changed_does_not_pass(change, reason):
    assert verify_level(lag_claim(1.5)).verified
    found = verify_level(replace(lag_claim(1.5), **change))
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
    system = Matrices(
        A=np.zeros((0, 0)),
        B=np.zeros((0, 2)),
        C=np.zeros((2, 0)),
        D=np.array([[0.0, 4.0], [0.0, 0.0]]),
    )
    known = {"system": system, "P": np.zeros((0, 0)), "T": np.zeros((0, 0)), "level": 0.1}
    two = ScaledClaim(blocks=(FULL, FULL), scalings=(ONE, 1e5 * ONE), skews=(0 * ONE,) * 2, **known)
    assert verify_level(two).verified
    assert not verify_level(
        ScaledClaim(blocks=((2, 2, "full"),), scalings=(ONE,), skews=(0 * ONE,), **known)
    ).verified
    with pytest.raises(ValueError, match="scalings must fit"):
        ScaledClaim(
            blocks=((2, 2, "full"),), scalings=(np.diag([1.0, 1e5]),), skews=(0 * ONE,), **known
        )


def test_a_real_parameter_in_two_places_needs_its_skew_matrix():
    """(s + 1)^2 + d^2: no real d breaks it, a complex one of size one does."""
    N = control.ss(-np.eye(2), np.eye(2), [[0.0, 1.0], [-1.0, 0.0]], np.zeros((2, 2)))
    real = certify_scaled(N, [(2, 2, "real")], 0.01)
    assert real.verify().verified
    assert np.any(real.claim.skews[0])
    assert certify_scaled(N, [(2, 2, "repeated")], 0.999) is None
    assert certify_scaled(N, [(2, 2, "repeated")], 1.001).verify().verified
    assert not verify_level(replace(real.claim, skews=(np.zeros((2, 2)),))).verified


def test_a_claim_survives_its_file_to_the_last_bit():
    claim = certify_scaled(
        random_loop(np.random.default_rng(5), 4, STRUCTURES[2], 0.1), STRUCTURES[2], 1e3
    ).claim
    again = from_plain(ScaledClaim, to_plain(claim))
    assert to_plain(again) == to_plain(claim)
    assert verify_level(again).verified
    with pytest.raises(ValueError, match="claim must have the entries"):
        from_plain(ScaledClaim, {"level": 1.0})


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
    response = response_by_channel(N, structure_grid(N))
    upper = robust.mu.upper(response, blocks).value.max()
    lower = robust.mu.lower(response[:, :, ::10], blocks).value.max()
    assert certify_scaled(N, blocks, 2 * upper, solver=solver).verify().verified
    assert certify_scaled(N, blocks, 0.999 * lower, solver=solver) is None


def test_mu_of_several_blocks_is_proved_over_the_rationals():
    """diag(1, 2)/(s + 1) in other units: mu of two scalars is two."""
    lag = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]])
    proof = robust.mu.certify(control.append(1e6 * lag, 2e-6 * lag), [(1, 1), (1, 1)], 1.001e6)
    assert (proof.holds, proof.method, proof.judged) == (True, "scaled KYP", "proved, rigorous")
    assert proof.level == 1.001e6
    assert proof.verify().proved == ("stability", "structured singular value")
