"""Certificates as files: verified as written; a changed number fails the digest, or the proof where
it breaks it.
"""

import copy
import json

import control
import numpy as np
import pytest

from robust import UncertaintyModel, check, performance_weight, save
from robust.io import verify_certificate
from tests.support.random_loops import random_case, tf_response
from tests.support.signed import signed

OMEGA = np.array([1.0, 2.0])
ALIASED_CLAIMS = (
    "robust stability, every alias included",
    "robust performance, every alias included",
)
G = control.tf([20], [1, 8, 20])
WEIGHT = control.tf([0.09, 0.3], [0.1, 3])
K = control.ss(control.sample_system(control.tf([0.3, 1.0], [1, 0]), 0.01))


def make_model(weight=WEIGHT, **more):
    return UncertaintyModel(
        G, weight, more.pop("form", "multiplicative"), OMEGA, OMEGA * 0.02, **more
    )


@pytest.fixture(scope="module")
def handed(tmp_path_factory):
    """A sampled loop with hold, a fractional delay and performance, checked and written."""
    path = tmp_path_factory.mktemp("proof") / "proof.json"
    report = check(make_model(), K, delay=0.013, w_P=performance_weight(0.02, M_S=6, A=0.9))
    assert [c.holds for c in report.proofs.certificates] == [True, True]
    save(report, path)
    return path


def test_what_was_written_is_verified(handed):
    found = verify_certificate(handed, model=make_model(), K=K)
    assert found.verified
    assert found.proved == ("nominal stability", "stable weights", *ALIASED_CLAIMS)
    assert str(found).count("proved, rigorous") == 4
    entries = json.loads(handed.read_text())
    np.testing.assert_array_equal(entries["claim"]["controller"]["A"], K.A)
    assert entries["claim"]["delay"] == 0.013


def leaves(entries, path=()):
    if isinstance(entries, dict):
        for name, item in entries.items():
            yield from leaves(item, (*path, name))
    elif isinstance(entries, list):
        for k, item in enumerate(entries):
            yield from leaves(item, (*path, k))
    else:
        yield path, entries


def changed(entries, path, value):
    entries = copy.deepcopy(entries)
    there = entries
    for step in path[:-1]:
        there = there[step]
    there[path[-1]] = value
    return entries


def test_any_changed_entry_fails_the_digest(handed, tmp_path):
    """Every number by one unit in its last place, every word, every truth value: nothing is left
    out.
    """
    entries = json.loads(handed.read_text())
    count = 0
    for path, leaf in leaves(entries):
        if isinstance(leaf, bool) or leaf is None:
            value = not leaf
        elif isinstance(leaf, str):
            value = leaf + "x"
        else:
            value = leaf + 1 if isinstance(leaf, int) else float(np.nextafter(leaf, np.inf))
        (tmp_path / "changed.json").write_text(json.dumps(changed(entries, path, value)))
        with pytest.raises(ValueError, match=r"^path must "):
            verify_certificate(tmp_path / "changed.json")
        count += 1
    assert count > 40
    for more in (
        entries | {"note": "mine"},
        {name: item for name, item in entries.items() if name != "found"},
    ):
        (tmp_path / "changed.json").write_text(json.dumps(more))
        with pytest.raises(ValueError, match="whose digest does not fit"):
            verify_certificate(tmp_path / "changed.json")


def resigned(entries, folder):
    path = folder / "resigned.json"
    path.write_text(json.dumps(signed(entries)))
    return path


@pytest.mark.parametrize(
    ("path", "factor", "failed"),
    [
        (("weight", "C"), 3.0, "robust stability"),
        (("controller", "C"), 60.0, "nominal stability"),
        (("plant", "B"), -1.0, "nominal stability"),
        (("performance", "D"), 20.0, "robust performance"),
        (("weight", "A"), -1.0, "stable weights"),
        (("delay",), 200.0, "nominal stability"),
        (("weight", "C"), 0.9, ""),
        (("delay",), 0.5, ""),
    ],
)
def test_with_its_digest_recomputed_it_is_verified_only_where_true(
    handed, tmp_path, path, factor, failed
):
    entries = json.loads(handed.read_text())
    there = entries["claim"]
    for step in path:
        there = there[step]
    more = changed(entries, ("claim", *path), (np.array(there) * factor).tolist())
    found = verify_certificate(resigned(more, tmp_path))
    assert found.verified == (not failed)
    assert [name.partition(",")[0] for name, _ in found.failed][:1] == [failed][: bool(failed)]
    same = verify_certificate(resigned(more, tmp_path), model=make_model(), K=K)
    named = {"plant": "the model", "weight": "the model", "controller": "the controller"}.get(
        path[0]
    )
    assert (named in [name for name, _ in same.failed]) == (named is not None)
    assert not same.verified or named is None


def test_a_stronger_claim_than_was_made_is_judged_too(handed, tmp_path):
    """Performance under one scaling was never claimed: whoever writes it in has to be right."""
    entries = json.loads(handed.read_text())
    for scaling in (1e-3, 1.0):
        more = changed(entries, ("claim", "claims"), ["robust performance with one scaling"])
        more["claim"]["scaling"] = scaling
        assert verify_certificate(resigned(more, tmp_path)).verified == (scaling == 1.0)


@pytest.mark.parametrize(
    ("place", "value"),
    [
        (("claim", "claims"), []),
        (("claim", "claims"), ["the best controller"]),
        (("claim", "reads"), ["w"]),
        (("claim", "delay"), -1.0),
        (("claim", "performance"), None),
        (("claim", "plant", "A"), [[1.0, 2.0]]),
        (("claim", "plant", "D"), [[0.0, 1.0]]),
        (("claim", "plant"), {"A": []}),
        (("claim", "controller"), None),
        (("claim",), []),
        (("version",), 2),
        (("schema",), "robust-model"),
    ],
)
def test_what_is_no_claim_is_refused_in_one_line(handed, tmp_path, place, value):
    entries = changed(json.loads(handed.read_text()), place, value)
    with pytest.raises(ValueError, match="must") as refusal:
        verify_certificate(resigned(entries, tmp_path))
    assert "\n" not in str(refusal.value)


def test_numbers_that_are_none_are_refused(handed, tmp_path):
    text = handed.read_text().replace('"delay": 0.013', '"delay": NaN')
    (tmp_path / "nan.json").write_text(text)
    with pytest.raises(ValueError, match="a number must be finite, got NaN"):
        verify_certificate(tmp_path / "nan.json")
    (tmp_path / "half.json").write_text(text[:500])
    with pytest.raises(ValueError, match="path must be a whole JSON file"):
        verify_certificate(tmp_path / "half.json")


@pytest.mark.parametrize("suffix", [".npz", ".mat", ".csv", ".h5", ""])
def test_what_would_not_be_read_back_is_not_written(suffix, tmp_path):
    path = tmp_path / f"saved{suffix}"
    for thing in (make_model(), K, check(make_model(), K)):
        with pytest.raises(ValueError, match=r"path must end in \.json"):
            save(thing, path)
    assert not path.exists()


def test_a_report_without_a_proof_is_refused(tmp_path):
    report = check(make_model(), 0.1, certify=False)
    with pytest.raises(
        ValueError,
        match="report must contain a proof that can be repeated, got the verdict 'not certified'",
    ):
        save(report, tmp_path / "none.json")


@pytest.mark.parametrize(
    "form", ["multiplicative", "additive", "inverse-multiplicative", "inverse-additive"]
)
@pytest.mark.parametrize("perturbation", ["LTI", "operator"])
def test_what_check_proves_is_verified(form, perturbation):
    """Continuous and sampled, with a delay, linear and nonlinear perturbations; never for a mu
    certificate.
    """
    w_P = performance_weight(0.02, M_S=6, A=0.9)
    for controller, delay in ((0.5, 0.0), (0.5, 0.02), (K, 0.01)):
        # under a sampled controller a weight has to fall off
        weight = WEIGHT * control.tf([1], [0.05, 1]) if controller is K else WEIGHT
        model = make_model(weight, form=form, perturbation=perturbation)
        report = check(model, controller, delay=delay, w_P=w_P)
        held = [c for c in report.proofs.certificates if c.holds]
        assert held
        for certificate in held:
            found = certificate.verify()
            assert found.verified, (certificate.subject, found.failed)


@pytest.mark.parametrize("n", [4, pytest.param(20, marks=pytest.mark.attack)])
def test_random_loops_that_check_certifies_are_verified(n):
    """All of them, with hold, delay and four forms; `benchmarks.bench_verification` does the same
    with 500.
    """
    rng, count = np.random.default_rng(4), 0
    while count < n:
        case = random_case(rng)
        if not case["stable"] or case["target"] >= 1:
            continue
        radius = 0.5 * np.abs(tf_response(case["w"], OMEGA))
        model = UncertaintyModel(
            case["G"], case["w"], case["form"], OMEGA, radius, perturbation="LTI"
        )
        for certificate in check(model, case["K"], delay=case["delay"]).proofs.certificates:
            if certificate.holds:
                found = certificate.verify()
                assert found.verified, (case["kind"], case["form"], found.failed)
                count += 1
