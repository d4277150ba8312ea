"""One loop proved by a matrix from cvxpy: it agrees with exact arithmetic, and says where it has no
say.
"""

import shutil
import subprocess

import control
import numpy as np
import pytest
from scipy.io import loadmat

import robust
from robust import UncertaintyModel, check
from robust.mu.intervals import certify_intervals
from robust.proofs.exact.channel_files import ChannelsClaim
from tests.robust.proofs.exact.test_interval_kyp import opposed
from tests.support.forms import UNSCALED
from tests.support.printed import unwrapped

LAG = control.tf([1], [1, 1])


def model(form="multiplicative", *, weight=0.5, plant=LAG, perturbation="LTI"):
    lines = np.array([1.0, 2.0])
    w = control.tf([weight, 0.2 * weight], [0.5, 1])
    return UncertaintyModel(plant, w, form, lines, np.full(2, 1e-3), perturbation=perturbation)


@pytest.mark.parametrize("form", UNSCALED)
@pytest.mark.parametrize("solver", [None, "SCS"])
def test_it_holds_just_under_the_limit_and_fails_just_above(form, solver):
    """rs is in proportion to the weight: at 0.99 of the limit it is proved, at 1.01 by nothing."""
    rs = max(check(model(form, weight=0.1), 0.5).curves.rs) / 0.1
    for factor, holds in ((0.99, True), (1.01, False)):
        report = check(model(form, weight=factor / rs), 0.5, proof="lmi", solver=solver)
        assert report.proofs.robustly_stable == holds, str(report)
        assert report.verdict == ("robust" if holds else "not robust")


def test_both_say_which_proved_what():
    report = check(model(), 0.5, w_P=control.tf([0.3], [1]), proof="both")
    found = [(c.subject, c.method, hasattr(c.claim, "storage")) for c in report.proofs.certificates]
    subjects = ("robust stability", "robust performance")
    assert found == [
        (s, method, method == "scaled KYP")
        for method in ("exact arithmetic", "scaled KYP")
        for s in subjects
    ]
    assert "robust performance at all frequencies: yes, scaled KYP, proved, rigorous" in unwrapped(
        str(report)
    )
    assert all(c.verify().verified for c in report.proofs.certificates)


def test_P_is_a_storage_function_of_the_loop():
    """The lag and the gain 0.5 with |w| <= 0.2 constant: b = 0.1/(s + 1.5), and P solves its scalar
    inequality.
    """
    one = UncertaintyModel(
        LAG, control.tf([0.2], [1]), "multiplicative", np.array([1.0]), np.array([0.1])
    )
    proof = check(one, 0.5, proof="lmi").proofs.certificates[0]
    P = proof.claim.storage
    assert P.shape == (1, 1)
    (P,) = P
    assert proof.claim.system.A[0, 0] == pytest.approx(-1.5)
    b, c, x = proof.claim.system.B[0, 0], proof.claim.system.C[0, 0], proof.claim.scalings[0][0, 0]
    assert -3 * P[0] + x * c**2 + (P[0] * b) ** 2 / x < 0


@pytest.mark.parametrize(
    ("given", "K", "options", "reason"),
    [
        (model(), 0.5, {"delay": 0.1}, "the delay of a continuous loop is not a state space"),
        (
            model(),
            control.tf([0.5], [1], 0.01),
            {},
            "no inequality covers the aliases of a continuous plant",
        ),
        (model("coprime", weight=0.1), 0.5, {}, "no inequality is set up for the coprime form"),
    ],
)
def test_where_no_inequality_covers_the_loop_it_says_so(given, K, options, reason):
    alone = check(given, K, proof="lmi", **options)
    assert alone.verdict == "not certified"
    assert reason in alone.reason
    assert check(given, K, proof="both", **options).proofs.robustly_stable


def test_an_operator_needs_one_scaling_and_gets_it():
    report = check(model(perturbation="operator"), 0.5, w_P=control.tf([0.3], [1]), proof="lmi")
    assert (report.verdict, report.proofs.robust_performance) == ("robust", True)


def test_a_sampled_loop_goes_to_a_file_and_back(tmp_path):
    plant, K = control.tf([0.1], [1, -0.9], 0.1), control.tf([0.5], [1], 0.1)
    one = UncertaintyModel(
        plant,
        control.tf([0.3], [1], 0.1),
        "additive",
        np.array([1.0]),
        np.array([0.1]),
        perturbation="LTI",
    )
    report = check(one, K, proof="lmi", delay=0.2)
    robust.save(report, tmp_path / "proof.json")
    found = robust.io.verify_certificate(tmp_path / "proof.json", model=one, K=K)
    assert found.proved == ("nominal stability", "robust stability")
    assert not robust.io.verify_certificate(
        tmp_path / "proof.json", model=one, K=1.001 * K
    ).verified


def test_a_proof_for_matlab_holds_there(tmp_path):
    report = check(model(), 0.5, w_P=control.tf([0.3], [1]), proof="lmi")
    robust.io.export_matlab(report, tmp_path / "proof.mat")
    proofs = loadmat(tmp_path / "proof.mat", simplify_cells=True)["content"]["proofs"]
    assert [p["subject"] for p in proofs] == ["robust stability", "robust performance"]
    np.testing.assert_array_equal(proofs[1]["P"], report.proofs.certificates[1].claim.storage)
    with pytest.raises(ValueError, match="content must hold a proof by scaled KYP"):
        robust.io.export_matlab(check(model(), 0.5), tmp_path / "none.mat")
    if shutil.which("octave") is not None:
        command = ["octave", "-q", "--eval", "disp(load_proof() < 0)"]
        said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert said.stdout.split() == ["1", "1"], said.stderr


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"proof": "none"}, "proof must be one of 'exact', 'lmi', 'both', got 'none'"),
        ({"solver": "MOSEK"}, "solver must be one of"),
    ],
)
def test_refusals(options, message):
    with pytest.raises(ValueError, match=message):
        check(model(), 0.5, **options)


@pytest.mark.parametrize("dt", [0.0, 0.1])
def test_every_interval_of_a_proof_for_matlab_holds_there(dt, tmp_path):
    """The inequality of each interval, from the file alone; mu of opposed integrals needs a scaling
    for each.
    """
    claim = certify_intervals(opposed(dt), [(1, 1, "full"), (1, 1, "full")], 0.8).claim
    robust.io.export_matlab(
        ChannelsClaim(claims={"mu": claim}, form="", delay=0.0), tmp_path / "proof.mat"
    )
    (p,) = np.atleast_1d(loadmat(tmp_path / "proof.mat", simplify_cells=True)["content"]["proofs"])
    A, B, CD, n, m = p["A"], p["B"], np.hstack([p["C"], p["D"]]), len(p["A"]), p["D"].shape[1]
    one, pieces = np.eye(n), np.atleast_1d(p["pieces"])
    g, f = np.hstack([A + one, B]) if dt else np.eye(n, n + m), np.hstack([A - one if dt else A, B])
    falls = A.T @ p["P"] @ A - p["P"] if dt else A.T @ p["P"] + p["P"] @ A
    assert np.linalg.eigvalsh(p["P"])[0] > 0 > np.linalg.eigvalsh(falls)[-1]
    assert len(pieces) == len(claim.pieces) > 1
    for q in pieces:
        (a, b), u = q["ends"], np.eye(n + m)[n:]
        along = 0.5j * f.T @ q["Q"] @ g
        along, square = along + along.conj().T, g.T @ q["Q"] @ g
        within = (
            along - a * square
            if np.isinf(b)
            else (a + b) * along - f.T @ q["Q"] @ f - a * b * square
        )
        across = u.T @ np.reshape(q["K"], (m, -1)) @ CD
        M = f.T @ q["P"] @ g + g.T @ q["P"] @ f + within + CD.T @ q["X_L"] @ CD
        M = M - across - across.conj().T - p["level"] ** 2 * u.T @ q["X_R"] @ u
        assert np.linalg.eigvalsh(M)[-1] < 0 < np.linalg.eigvalsh(q["Q"])[0]
    if shutil.which("octave") is not None:
        command = ["octave", "-q", "--eval", "disp(load_proof() < 0)"]
        said = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True, check=False)
        assert said.stdout.split() == ["1"], said.stderr
