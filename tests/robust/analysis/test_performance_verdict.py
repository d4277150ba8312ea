"""The verdict line of a robustly stable loop that misses its performance says so."""

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check

LAG = control.tf([1], [1, 1])


def single(M_S):
    model = UncertaintyModel(
        LAG, control.tf([0.2], [1]), "multiplicative", np.array([1.0, 2.0]), perturbation="LTI"
    )
    return check(model, 2.0, w_P=control.ss([], [], [], [[1 / M_S]]))


def several(M_S, **options):
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    model = UncertaintyModel(
        G,
        form="input",
        left=(0.2, 0.2),
        right=(1, 1),
        omega=np.array([1.0, 2.0]),
        perturbation="LTI",
    )
    return check(
        model,
        control.ss([], [], [], 2 * np.eye(2)),
        w_P=control.ss([], [], [], [[1 / M_S]]),
        **options,
    )


@pytest.mark.parametrize(("judge", "missed"), [(single, "not met"), (several, "not proved")])
def test_a_loop_that_misses_its_demand_is_not_called_robust_alone(judge, missed):
    """|S| goes to one at high frequency: at most 0.25 asks for what no loop here has."""
    report = judge(0.25)
    assert report.verdict == "robust"
    assert report.performance == missed
    assert " ".join(str(report).split()).startswith(
        f"verdict: ROBUST, PERFORMANCE {missed.upper()}: "
    )
    assert f"demand {missed} for the whole set" in " ".join(str(report).split())
    if judge is several:
        assert "max mu, allowed is 1" in " ".join(str(report).split())


@pytest.mark.parametrize("judge", [single, several])
def test_a_loop_that_meets_it_is(judge):
    report = judge(2.0)
    assert report.performance == "met"
    assert " ".join(str(report).split()).startswith("verdict: ROBUST: ")
    assert "demand met for the whole set" in " ".join(str(report).split())


def test_without_a_demand_nothing_is_said():
    model = UncertaintyModel(LAG, control.tf([0.2], [1]), "multiplicative", np.array([1.0, 2.0]))
    report = check(model, 2.0)
    assert (report.performance, report.missed_performance) == (None, "")
    report = check(
        model, -2.0, w_P=control.ss([], [], [], [[4.0]])
    )  # unstable: the verdict says more than that
    assert report.performance is None


def test_designs_and_worst_cases_print_what_they_found():
    model = UncertaintyModel(LAG, control.tf([0.2], [1]), "multiplicative", np.array([1.0, 2.0]))
    found = robust.mixsyn(LAG, 0.5, 1.0)
    assert (
        f"controller of order {found.K.nstates}, continuous: gamma {found.gamma:.4g} proved"
        in str(found)
    )
    failed = robust.worst_case(UncertaintyModel(LAG, 3.0, "multiplicative", np.array([1.0])), 2.0)
    assert str(failed).startswith("a plant of the set, of ")
    assert "makes the loop unstable" in str(failed)
    assert f"{robust.worst_case(model, 2.0).achieved:.4g} at " in str(robust.worst_case(model, 2.0))


@pytest.mark.parametrize(
    ("verdict", "size", "options"),
    [
        ("robust", 0.2, {"perturbation": "LTI"}),
        ("statistically robust", 0.2, {"perturbation": "statistical", "confidence": 0.95}),
        ("statistically robust", 0.2, {}),
        ("not robust", 3.0, {"perturbation": "LTI"}),
    ],
)
def test_a_verdict_says_in_twenty_words_what_it_means(verdict, size, options):
    model = UncertaintyModel(
        LAG, control.tf([size], [1]), "multiplicative", np.array([1.0, 2.0]), **options
    )
    report = check(model, 2.0)
    assert report.verdict == verdict
    meaning = report.summary.splitlines()[0].removeprefix(f"verdict:     {verdict.upper()}: ")
    assert 5 < len(meaning.split()) <= 20


def test_conditions_stand_below_the_verdict_one_a_line():
    model = UncertaintyModel(LAG, control.tf([0.2], [1]), "multiplicative", np.array([1.0, 2.0]))
    rows = check(model, 2.0).summary.splitlines()
    assert rows[0].startswith(
        "verdict:     STATISTICALLY ROBUST: this controller keeps every linear plant"
    )
    assert [row for row in rows if row.startswith("condition:")] == [
        'condition:   no class of perturbation is claimed; claim one by perturbation="LTI" or'
        ' "operator"'
    ]
    assert "condition:" not in str(single(2.0))


def test_the_largest_sensitivity_over_a_set_is_proved_only_if_proofs_are_wanted():
    proved, computed = several(3.0), several(3.0, certify=False)
    assert proved.margins.S_worst_lines == 0
    assert "over the set, on" not in str(proved)
    assert f"over the set, on {computed.margins.S_worst_lines} frequencies" in " ".join(
        str(computed).split()
    )
    assert 0.99 * proved.margins.S_worst < computed.margins.S_worst <= proved.margins.S_worst
