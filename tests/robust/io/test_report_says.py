"""The report page says what the check was made with."""

import re

import control
import numpy as np
import pytest

from robust import (
    UncertaintyModel,
    check,
    friction_plant,
    performance_weight,
    prove_friction,
    worst_case,
)
from robust.friction import MaxwellSlip
from robust.reports import write_report

pytestmark = pytest.mark.usefixtures("undrawn")

PLANT = control.tf([1], [1, 1])
MODEL = UncertaintyModel(
    PLANT,
    control.tf([0.2], [1]),
    "multiplicative",
    np.array([1.0, 2.0]),
    np.array([0.1, 0.2]),
    perturbation="LTI",
)


def plain(path):
    return re.sub(r"\s+", " ", re.sub(r"<[^>]+>", " ", path.read_text(encoding="utf-8")))


@pytest.mark.attack(every=3)
@pytest.mark.parametrize("delay", [0.0, 0.02])
@pytest.mark.parametrize("w_P", [None, performance_weight(0.5, M_S=3.0, A=0.1)])
def test_a_report_that_was_made_before_is_told_with_what_it_was_made_with(tmp_path, w_P, delay):
    report = check(MODEL, 2.0, w_P=w_P, delay=delay)
    assert report.given.delay == delay
    assert (report.given.demand is None) == (w_P is None)
    write_report(tmp_path / "r.html", MODEL, 2.0, report=report)
    text = plain(tmp_path / "r.html")
    assert ("none asked for" in text) == (w_P is None)
    assert f"{1e3 * delay:g} ms, and" in text
    worst = worst_case(MODEL, 2.0, delay=delay)
    assert f"{worst.gain.max():.4g}" in text or f"{worst.achieved:.3g}" in text
    again = tmp_path / "again.html"
    write_report(again, MODEL, 2.0, w_P=w_P, delay=delay)
    stamped = r"\d{4}-\d\d-\d\d \d\d:\d\d [A-Z+\-\d]*"
    assert re.sub(stamped, "", plain(again)) == re.sub(stamped, "", text)


def test_another_delay_than_that_of_the_report_is_refused(tmp_path):
    with pytest.raises(ValueError, match=r"delay must be that of the report, 0 s, got 0\.02 s"):
        write_report(tmp_path / "r.html", MODEL, 2.0, delay=0.02, report=check(MODEL, 2.0))
    assert not list(tmp_path.iterdir())


def test_a_report_of_another_loop_is_refused(tmp_path):
    """One page would have told of two controllers."""
    wider = UncertaintyModel(
        MODEL.nominal, 1.01 * MODEL.weight, MODEL.form, MODEL.omega, MODEL.radius
    )
    for model, K in ((MODEL, 2.001), (wider, 2.0)):
        with pytest.raises(
            ValueError, match="report must be the result of check for this model and this K"
        ):
            write_report(tmp_path / "r.html", model, K, report=check(MODEL, 2.0))
    assert not list(tmp_path.iterdir())


def test_a_report_of_another_set_on_lines_is_refused(tmp_path):
    """Known on its lines only: the size of K alone said nothing of sign, form, radius or plant."""
    omega = np.geomspace(1, 100, 40)
    measured = control.frd(1 / (1 + 0.1j * omega), omega)
    other = control.frd(1.1 / (1 + 0.1j * omega), omega)

    def lines(G=measured, form="multiplicative", radius=0.1):
        return UncertaintyModel(
            G, control.tf([1.05 * radius], [1]), form, omega, np.full(40, radius)
        )

    report = check(lines(), 2.0)
    for model, K in (
        (lines(), -2.0),
        (lines(other), 2.0),
        (lines(form="inverse-multiplicative"), 2.0),
        (lines(radius=0.11), 2.0),
    ):
        with pytest.raises(
            ValueError, match="report must be the result of check for this model and this K"
        ):
            write_report(tmp_path / "r.html", model, K, report=report)
    assert not list(tmp_path.iterdir())
    write_report(tmp_path / "r.html", lines(), 2.0, report=report)


@pytest.mark.parametrize(
    ("denominator", "dt", "named"),
    [
        ([1, 1, 0], 0.0, "0 Hz (integrator); 0.1592 Hz"),
        (np.poly([1.0, np.exp(-0.01)]), 0.01, "0 Hz (integrator); 0.1592 Hz"),
        ([1, 0, 0], 0.0, "0 Hz (integrator); 0 Hz (integrator)"),
        ([1, 0, 4], 0.0, "0.3183 Hz, damping 0"),
    ],
)
def test_integrators_are_named(tmp_path, denominator, dt, named):
    K = control.ss(control.tf([1], denominator, dt))
    write_report(tmp_path / "r.html", MODEL, K, report=check(MODEL, K, certify=False))
    section = plain(tmp_path / "r.html").partition("Controller and loop u = K (r - y).")[2]
    assert f" poles {named} zeros none " in section


def test_another_demand_than_that_of_the_report_is_refused(tmp_path):
    w_P = performance_weight(0.5, M_S=3.0, A=0.1)
    for before, asked in ((None, w_P), (w_P, performance_weight(0.4, M_S=3.0, A=0.1))):
        with pytest.raises(ValueError, match="w_P must be that of the report, got another one"):
            write_report(
                tmp_path / "r.html", MODEL, 2.0, w_P=asked, report=check(MODEL, 2.0, w_P=before)
            )
    assert not list(tmp_path.iterdir())
    write_report(tmp_path / "r.html", MODEL, 2.0, w_P=w_P, report=check(MODEL, 2.0, w_P=w_P))


def test_both_verdicts_stand_side_by_side(tmp_path):
    """A set that the check is content with, a loop that runs away while it slides: the page says
    both.
    """
    rig = control.ss(control.tf([1], [1, 0.4, 80e3]))
    stuck = UncertaintyModel(
        control.ss(control.tf([1], [1, 60, 140e3])),
        control.tf([0.05], [1]),
        "multiplicative",
        np.array([10.0, 1000.0]),
        np.array([0.04, 0.04]),
        perturbation="LTI",
    )
    K = control.ss([[1.0]], [[1.0]], [[400.0]], [[0.0]], 1e-3)
    report = check(stuck, K)
    proof = prove_friction(friction_plant(rig), K, MaxwellSlip(64e3), Fs=1.0)
    assert (report.verdict, proof.verdict) == ("robust", "refuted")
    write_report(tmp_path / "r.html", stuck, K, report=report, friction=proof)
    text = plain(tmp_path / "r.html")
    assert "Two verdicts" in text
    banner = text[: text.index("1. Verdict")] if "1. Verdict" in text else text[:2000]
    assert "refuted (with one friction of the class the loop is unstable; the friction" in banner
    assert f"surely runs away from a kick of {proof.kick_sure:.3g} m/s" in banner
    row = re.search(r"verdict robust refuted meaning (.*?) because", text).group(1)
    assert "keeps every plant of the set stable, which is proved" in row
    assert "may be another" in row
    assert (
        f"surely, with any friction of the given force, from a kick of {proof.kick_sure:.3g} m/s"
        in text
    )
    write_report(tmp_path / "without.html", stuck, K, report=report)
    assert "Two verdicts" not in plain(tmp_path / "without.html")
    with pytest.raises(
        ValueError, match="friction must be of type FrictionProof or NoneType, got 1"
    ):
        write_report(tmp_path / "bad.html", stuck, K, report=report, friction=1)
