"""Claims that a sampled set contains a continuous one: against sums over thousands of aliases, and
tampered with.
"""

import json
from dataclasses import replace

import control
import numpy as np
import pytest

from robust import check, save
from robust.io import verify_certificate
from tests.robust.analysis.test_sampled_set import INPUT, MIXED, SETS, made, number, rising
from tests.support.exact_claims import matrices
from tests.support.signed import signed

T = 0.05
ALIASES = "every alias in the weights"  # the claim
K = control.StateSpace([], [], [], 1.5 * np.eye(2), 0.02)


@pytest.fixture(scope="module")
def report():
    return check(INPUT, K)


@pytest.fixture(scope="module")
def proof(report):
    """The certificate that the set of a check contains every alias."""
    return report.proofs.certificates[-1]


def gain(x):
    return matrices(number(x))


ONE = gain(1.0)


def part_of(proof, **weights):
    """A part of one channel around no plant, with these weights and gains of one else."""
    plain = dict.fromkeys(("left", "right", "sampled_left", "sampled_right"), (ONE,))
    return replace(proof.claim.parts[0], **{"plant": None, "sampled": None} | plain | weights)


def holds(proof, part):
    return ALIASES in proof.again(replace(proof.claim, dt=T, parts=(part,))).proved


def folded_sum(weight, omega, n=200):
    """Brute force: sum over 2 n + 1 aliases of |h_k w(omega_k)|, which fall with k^-4."""
    at = omega[:, None] + 2 * np.pi / T * np.arange(-n, n + 1)
    hold = np.abs(np.sinc(omega * T / 2 / np.pi)[:, None] * omega[:, None] / at)
    return (
        hold * np.abs(np.polyval(weight.num[0][0], 1j * at) / np.polyval(weight.den[0][0], 1j * at))
    ).sum(axis=1)


@pytest.mark.attack(every=2)
@pytest.mark.parametrize("seed", range(6))
def test_a_gain_is_proved_above_the_largest_sum_and_not_below(seed, proof):
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
    left = (matrices(control.ss(weight)),)
    part = part_of(proof, left=left, sampled_left=(gain(1.02 * largest),))
    assert holds(proof, part)
    assert not holds(proof, replace(part, sampled_left=(gain(0.98 * largest),)))
    halves = {"sampled_left": (gain(4 * 1.02 * largest),), "sampled_right": (gain(0.25),)}
    assert holds(
        proof, replace(part, **halves)
    )  # what stands left and what right is a matter of scale
    assert not holds(proof, replace(part, **halves | {"right": (gain(1.1),)}))


def integrating():
    A = [[0, 1, 0], [0, -3, 0], [0, 0, -5]]
    plant = control.StateSpace(
        A, [[0, 0], [3, 1], [0, 2]], [[1, 0, 0], [0, 0, 1]], np.zeros((2, 2))
    )
    return made(plant, "input", (rising(0.1), rising(0.1)), (number(1.0), number(1.0)))


@pytest.mark.parametrize(
    "form", [*(pytest.param(form, marks=pytest.mark.attack) for form in SETS), "integrating"]
)
def test_weights_of_the_search_are_proved_and_smaller_ones_are_not(form):
    given = SETS[form] if form in SETS else integrating()
    small = control.StateSpace([], [], [], 0.01 * np.eye(2), 0.02)
    certificate = check(given, small).proofs.certificates[-1]
    assert certificate.subject == ALIASES
    assert certificate.holds, certificate.reason
    assert certificate.judged == "proved, rigorous"
    assert certificate.verify().proved == (ALIASES,)
    claim, part = certificate.claim, certificate.claim.parts[0]
    shrunk = replace(
        part, sampled_left=tuple(replace(w, C=0.9 * w.C, D=0.9 * w.D) for w in part.sampled_left)
    )
    assert ALIASES not in certificate.again(replace(claim, parts=(shrunk,))).proved
    if part.plant is not None:
        other = replace(part, plant=replace(part.plant, C=1.3 * part.plant.C))
        assert ALIASES not in certificate.again(replace(claim, parts=(other,))).proved


def test_a_sum_that_has_no_bound_is_not_proved(proof):
    assert not holds(proof, part_of(proof, sampled_left=(gain(50.0),)))


def test_the_certificate_of_a_check_carries_the_aliases(report, tmp_path):
    path = tmp_path / "proof.json"
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
    written, claim = content["claim"]["claims"][ALIASES], report.proofs.certificates[-1].claim
    assert written["dt"] == claim.dt
    for part, kept in zip(written["parts"], claim.parts, strict=True):
        for side in ("left", "right", "sampled_left", "sampled_right"):
            for weight, given in zip(part[side], getattr(kept, side), strict=True):
                for name in "ABCD":
                    matrix = getattr(given, name)
                    assert np.array_equal(np.reshape(weight[name], matrix.shape), matrix)
    written["parts"][0]["left"][0]["D"][0][0] *= 1.5
    path.write_text(json.dumps(signed(content)))
    assert f"{ALIASES}: NOT verified: " in str(verify_certificate(path))


@pytest.mark.parametrize(
    ("change", "text"),
    [
        ({"left": ()}, "weights must be as many"),
        (
            {"right": (matrices(control.ss([], [], [], np.ones((2, 2)))),)},
            "weights must have one input",
        ),
        ({"plant": ONE}, "plant and sampled must be given together"),
        (
            {"plant": ONE, "sampled": matrices(control.ss([], [], [], np.ones((2, 2))))},
            "must be square, with 1 channels",
        ),
    ],
)
def test_parts_that_do_not_fit_are_refused(change, text, proof):
    with pytest.raises(ValueError, match=text):
        part_of(proof, **change)


def test_a_sampling_time_of_zero_is_refused(proof):
    with pytest.raises(ValueError, match="dt must be a sampling time"):
        replace(proof.claim, dt=0.0, parts=())
