"""Claims that a sampled set contains a continuous one: against sums over thousands of aliases, and
tampered with.
"""

import json
from dataclasses import replace

import control
import numpy as np
import pytest

from robust import check, save
from robust.analysis.sampled_set import sampled_set
from robust.io.certificates import verify_certificate
from robust.proofs.exact.claim import to_matrices
from robust.proofs.exact.claim_files import content_digest, from_plain, to_plain
from robust.proofs.exact.folded_sets import FoldedClaim, FoldedPart, decide_folded
from tests.robust.analysis.test_sampled_set import INPUT, MIXED, SETS, made, number, rising

T = 0.05
ALIASES = "every alias in the weights"  # the claim
ONE = to_matrices(number(1.0))


def gain(x):
    return to_matrices(number(x))


def holds(part):
    return decide_folded(FoldedClaim(dt=T, parts=(part,)))[ALIASES].holds


def folded_sum(weight, omega, n=2000):
    """Brute force: sum over 2 n + 1 aliases of |h_k w(omega_k)|."""
    at = omega[:, None] + 2 * np.pi / T * np.arange(-n, n + 1)
    hold = np.abs(np.sinc(omega * T / 2 / np.pi)[:, None] * omega[:, None] / at)
    return (
        hold * np.abs(np.polyval(weight.num[0][0], 1j * at) / np.polyval(weight.den[0][0], 1j * at))
    ).sum(axis=1)


@pytest.mark.parametrize("seed", range(6))
def test_a_gain_is_proved_above_the_largest_sum_and_not_below(seed):
    """A roll-off with a mode, below or far above Nyquist; its sums over all aliases by brute
    force.
    """
    rng = np.random.default_rng(seed)
    mode, damping = np.pi / T * np.exp(rng.uniform(-2, 1.5)), rng.uniform(0.03, 0.5)
    weight = control.tf([1.0], [1 / 40, 1]) * control.tf(
        [mode**2], [1, 2 * damping * mode, mode**2]
    )
    omega = (
        np.unique(np.concatenate([np.linspace(1e-3, 1, 1500), 1 - np.geomspace(1e-6, 0.1, 200)]))
        * np.pi
        / T
    )
    largest = folded_sum(weight, omega).max()
    part = FoldedPart(
        plant=None,
        sampled=None,
        left=(to_matrices(control.ss(weight)),),
        right=(ONE,),
        sampled_left=(gain(1.02 * largest),),
        sampled_right=(ONE,),
    )
    assert holds(part)
    assert not holds(replace(part, sampled_left=(gain(0.98 * largest),)))
    halves = {"sampled_left": (gain(4 * 1.02 * largest),), "sampled_right": (gain(0.25),)}
    assert holds(replace(part, **halves))  # what stands left and what right is a matter of scale
    assert not holds(replace(part, **halves | {"right": (gain(1.1),)}))


def integrating():
    A = [[0, 1, 0], [0, -3, 0], [0, 0, -5]]
    plant = control.StateSpace(
        A, [[0, 0], [3, 1], [0, 2]], [[1, 0, 0], [0, 0, 1]], np.zeros((2, 2))
    )
    return made(plant, "input", (rising(0.1), rising(0.1)), (number(1.0), number(1.0)))


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("form", [*SETS, "integrating"])
def test_weights_of_the_search_are_proved_and_smaller_ones_are_not(form):
    found = sampled_set(SETS[form] if form in SETS else integrating(), 0.02)
    certificate = found.certify_aliases()
    assert certificate.holds, certificate.reason
    assert certificate.judged == "proved, rigorous"
    assert certificate.verify().proved == (ALIASES,)
    part = found.claim.parts[0]
    shrunk = replace(
        part, sampled_left=tuple(replace(w, C=0.9 * w.C, D=0.9 * w.D) for w in part.sampled_left)
    )
    assert not decide_folded(replace(found.claim, parts=(shrunk,)))[ALIASES].holds
    if part.plant is not None:
        other = replace(part, plant=replace(part.plant, C=1.3 * part.plant.C))
        assert not decide_folded(replace(found.claim, parts=(other,)))[ALIASES].holds


def test_a_sum_that_has_no_bound_is_not_proved():
    flat = FoldedPart(
        plant=None,
        sampled=None,
        left=(ONE,),
        right=(ONE,),
        sampled_left=(gain(50.0),),
        sampled_right=(ONE,),
    )
    assert not holds(flat)


def test_the_certificate_of_a_check_carries_the_aliases(tmp_path):
    K, path = control.StateSpace([], [], [], 1.5 * np.eye(2), 0.02), tmp_path / "proof.json"
    report = check(INPUT, K)
    assert [one.subject for one in report.proofs.certificates] == ["robust stability", ALIASES]
    assert f"{ALIASES} at all frequencies: yes, exact arithmetic, proved, rigorous" in str(report)
    save(report, path)
    assert verify_certificate(path, model=INPUT, K=K).proved == (
        "nominal stability",
        "robust stability",
        ALIASES,
    )
    assert not verify_certificate(
        path, model=made(MIXED, "input", INPUT.left[::-1], INPUT.right), K=K
    ).verified
    content = json.loads(path.read_text())
    claim = from_plain(FoldedClaim, content["claim"]["claims"][ALIASES])
    assert to_plain(claim) == to_plain(report.proofs.certificates[-1].claim)
    content["claim"]["claims"][ALIASES]["parts"][0]["left"][0]["D"][0][0] *= 1.5
    content["digest"] = content_digest(
        {name: entry for name, entry in content.items() if name != "digest"}
    )
    path.write_text(json.dumps(content))
    assert f"{ALIASES}: NOT verified: " in str(verify_certificate(path))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"left": ()}, "weights must be as many"),
        (
            {"right": (to_matrices(control.ss([], [], [], np.ones((2, 2)))),)},
            "weights must have one input",
        ),
        ({"plant": ONE}, "plant and sampled must be given together"),
        (
            {"plant": ONE, "sampled": to_matrices(control.ss([], [], [], np.ones((2, 2))))},
            "must be square, with 1 channels",
        ),
    ],
)
def test_parts_that_do_not_fit_are_refused(change, text):
    part = {"plant": None, "sampled": None, "left": (ONE,), "right": (ONE,)}
    part |= {"sampled_left": (ONE,), "sampled_right": (ONE,)}
    with pytest.raises(ValueError, match=text):
        FoldedPart(**part | change)


def test_a_sampling_time_of_zero_is_refused():
    with pytest.raises(ValueError, match="dt must be a sampling time"):
        FoldedClaim(dt=0.0, parts=())
