"""Several uncertainties joined by name: closed forms, python-control's own joining, perturbations
that break.
"""

import time

import control
import numpy as np
import pytest
from scipy.linalg import expm

from robust.analysis import check_structure
from robust.models import Block, interconnection


def lag_loop(pole, actuator, gain=4.0, **block):
    """s + 1 + gain - pole d1 + gain actuator d2."""
    lag = control.ss(
        [[-1.0]], [[1.0, 1.0]], [[1.0]], [[0.0, 0.0]], inputs=["u", "pole"], outputs="y"
    )
    K = control.ss([], [], [], [[-gain]], inputs="y", outputs="u")
    blocks = {
        "pole": Block("y", "pole", pole, kind="real"),
        "actuator": Block("u", "u", actuator, **block),
    }
    return interconnection([lag, K], blocks)


def test_margins_in_closed_form():
    """The pole is at -5 + pole d1 - 4 actuator d2: the margin is 5/(pole + 4 actuator), at zero
    frequency.
    """
    report = check_structure(lag_loop(2.0, 0.5))
    assert report.margins.rs == pytest.approx(5 / 4, rel=1e-6)
    assert report.margins.omega_rs == 0
    assert report.margins.broken == pytest.approx(5 / 4, rel=1e-6)
    assert report.margins.worst == pytest.approx({"pole": 1.0, "actuator": 1.0}, rel=1e-3)
    assert report.verdict == "robust"
    assert (
        "every constant value of pole and every stable linear actuator, all at once"
        in report.proved
    )
    assert "verdict: ROBUST" in " ".join(str(report).split())


def test_what_it_takes_to_be_called_robust():
    broken = check_structure(lag_loop(4.0, 0.5))
    assert broken.verdict == "not robust"
    assert broken.margins.broken == pytest.approx(5 / 6, rel=1e-6)
    assert (
        check_structure(lag_loop(2.0, 0.5, perturbation="statistical")).verdict
        == "statistically robust"
    )
    assert check_structure(lag_loop(2.0, 0.5), certify=False).verdict == "not certified"
    unstable = check_structure(lag_loop(1.0, 0.1, gain=-2.0))
    assert unstable.verdict == "not robust"
    assert np.isnan(unstable.margins.rs)
    assert "nominal loop is unstable: a pole at 1" in unstable.reason


def test_an_operator_needs_one_scaling_for_all_frequencies():
    report = check_structure(lag_loop(1.0, 0.5, perturbation="operator"))
    assert report.verdict == "robust"
    assert "KYP" in report.proofs.certificates[0].method
    assert "nonlinear ones included" in report.proved
    # where the best scaling changes with frequency there is no such proof, though mu is below one
    low, high = control.tf([1], [1, 1]), control.tf([1, 0], [1, 1])
    cross = [
        control.ss(control.tf([0.9], [1, 1]), inputs="a", outputs="y1"),
        control.ss(control.tf([0.9, 0], [1, 1]), inputs="b", outputs="y2"),
    ]
    assert low is not high
    both = {
        "one": Block("y2", "a", perturbation="operator"),
        "two": Block("y1", "b", perturbation="operator"),
    }
    assert check_structure(interconnection(cross, both)).proofs.robustly_stable


def test_a_repeated_operator_is_not_proved_as_a_repeated_number():
    """Poles at -0.1 +- j sqrt(1 - 0.09 d^2) for a constant d, stable for every complex |d| <= 1; a
    d that switches between 1 and -1 each quarter turn pumps the loop up."""
    A, push = np.array([[-0.1, 1.0], [-1.0, -0.1]]), 0.3 * np.array([[0.0, 1.0], [1.0, 0.0]])
    quarter = np.pi / 2 / np.sqrt(0.91)
    assert (
        np.abs(np.linalg.eigvals(expm((A - push) * quarter) @ expm((A + push) * quarter))).max()
        > 1.2
    )
    plant = control.ss(
        A, np.eye(2), push, np.zeros((2, 2)), inputs=["d1", "d2"], outputs=["y1", "y2"]
    )
    for perturbation, verdict in (("LTI", "robust"), ("operator", "not certified")):
        block = Block(["y1", "y2"], ["d1", "d2"], kind="repeated", perturbation=perturbation)
        assert check_structure(interconnection([plant], {"d": block})).verdict == verdict


def test_performance_is_a_block_like_any_other():
    """G = 1/(s + 1), K = 9, input gain +-20 %: worst error at zero frequency 1/(1 + 7.2), between
    1/8 and 1/8.5.
    """
    for demand, met in ((8.0, True), (8.5, False)):
        systems = [
            control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y"),
            control.ss([], [], [], [[9.0]], inputs="e", outputs="u"),
            control.summing_junction(["r", "-y"], "e"),
            control.ss([[-1.0]], [[1.0]], [[demand]], [[0.0]], inputs="e", outputs="z"),
        ]
        gain = {"gain": Block("u", "u", 0.2, kind="real")}
        report = check_structure(interconnection(systems, gain, inputs="r", outputs="z"))
        assert report.proofs.robustly_stable
        assert report.proofs.robust_performance is met
        assert (report.margins.rp > 1) is met


def test_an_interconnection_agrees_with_joining_by_python_control():
    rng = np.random.default_rng(0)
    A = -np.eye(3) + 0.3 * rng.standard_normal((3, 3))
    B = rng.standard_normal((3, 2))
    C = rng.standard_normal((2, 3))
    G = control.ss(A, B, C, np.zeros((2, 2)), inputs=["u", "f"], outputs=["y", "v"])
    K = control.ss([[-2.0]], [[1.0]], [[0.3]], [[0.2]], inputs="e", outputs="u")
    error = control.summing_junction(["r", "-y"], "e")
    system = interconnection(
        [G, K, error], {"d": Block("v", "f", 0.4, kind="real")}, inputs="r", outputs="y"
    )
    for d in (-1.0, 0.0, 0.7):
        spring = control.ss([], [], [], [[0.4 * d]], inputs="v", outputs="f")
        other = control.interconnect([G, K, error, spring], inputs="r", outputs="y")
        s = 1j * np.array([0.1, 1.0, 10.0])
        closed = control.ss([], [], [], [[d]]).lft(system.N)
        assert closed(s) == pytest.approx(other(s), rel=1e-9)


def test_the_worst_perturbation_does_break_the_loop():
    """A resonance with uncertain stiffness and a gain: the constant perturbation found puts poles
    on the axis.
    """
    mass = control.ss(
        [[0, 1], [-100, -2]],
        [[0, 0], [1, 1]],
        [[1, 0]],
        [[0, 0]],
        inputs=["u", "spring"],
        outputs="x",
    )
    K = control.ss([[-5.0]], [[1.0]], [[-100.0]], [[0.0]], inputs="x", outputs="u")
    system = interconnection(
        [mass, K],
        {
            "spring": Block("x", "spring", 40.0, kind="real"),
            "gain": Block("u", "u", 0.3, kind="real"),
        },
    )
    report = check_structure(system)
    assert report.margins.rs <= report.margins.broken * (1 + 1e-9)
    assert report.margins.broken < 1.05 * report.margins.rs
    values = {name: number * report.margins.broken for name, number in report.margins.worst.items()}
    poles = control.ss([], [], [], np.diag(list(values.values()))).lft(system.N).poles()
    assert np.min(np.abs(poles.real)) < 1e-3 * np.abs(poles).max()


G = control.ss([[-1.0]], [[1.0]], [[1.0]], [[0.0]], inputs="u", outputs="y")


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (
            lambda: interconnection([G], {"d": Block("x", "u")}),
            "must read outputs of the systems .y., got 'x'",
        ),
        (
            lambda: interconnection([G], {"d": Block("y", "v")}),
            "must drive inputs of the systems .u., got 'v'",
        ),
        (
            lambda: interconnection([G], {}),
            "a source for every input, got no output that drives 'u'",
        ),
        (
            lambda: interconnection([G], {"d": Block("y", "u")}, inputs="u"),
            "outputs must be given together with inputs",
        ),
        (lambda: interconnection([], {}), "systems must hold at least one"),
        (lambda: Block("y", ["u", "v"], kind="real"), "drives must name as many signals as reads"),
        (
            lambda: Block("y", "u", control.tf([1], [1, -1])),
            "size must be a number or a stable weight",
        ),
        (lambda: Block("y", "u", control.tf([1, 0], [1])), "size must be proper"),
        (lambda: Block("y", "u", kind="imaginary"), "kind must be one of"),
        (lambda: check_structure(G), "system must be an UncertainSystem"),
        (
            lambda: interconnection(
                [G, control.ss(0.5, 1, 1, 0, 0.1, inputs="y", outputs="u")], {}
            ),
            "systems must have one sampling time .*, got 0 s and 0.1 s",
        ),
        (
            lambda: interconnection(
                [control.ss([], [], [], 1.0, inputs="y", outputs="y")], {"d": Block("y", "y")}
            ),
            "well posed",
        ),
    ],
)
def test_refusals(call, message):
    with pytest.raises(ValueError, match=message):
        call()


@pytest.mark.attack
def test_an_answer_comes_where_scalings_are_many():
    """Two parameters repeated eight times on eight states: no answer in four minutes before."""
    rng, n = np.random.default_rng(0), 8
    A = rng.standard_normal((n, n))
    A = A - (np.linalg.eigvals(A).real.max() + 0.5) * np.eye(n)
    plant = control.ss(
        A, np.hstack([np.eye(n)] * 2), rng.standard_normal((2 * n, n)), np.zeros((2 * n, 2 * n)),
        inputs=[f"w{k}" for k in range(2 * n)], outputs=[f"z{k}" for k in range(2 * n)],
    )  # fmt: skip
    halves = [range(n), range(n, 2 * n)]
    blocks = {
        f"p{k}": Block([f"z{i}" for i in half], [f"w{i}" for i in half], 0.2, kind="real")
        for k, half in enumerate(halves)
    }
    begin = time.process_time()
    report = check_structure(interconnection([plant], blocks))
    assert time.process_time() - begin < 100
    assert report.verdict == "not certified"
    assert "on parts of the box" in report.reason
    assert np.isfinite(report.curves.rs).all()
    assert report.margins.rs <= report.margins.broken


def test_an_open_verdict_on_real_parameters_is_decided_part_by_part():
    """One parameter in three places: mu with real blocks proves 2.196, and 4.196 breaks the loop;
    the set is 2.5.
    """
    rng, n = np.random.default_rng(2), 3
    A = rng.standard_normal((n, n))
    A -= (np.linalg.eigvals(A).real.max() + 0.2) * np.eye(n)
    B, C = rng.standard_normal((n, n)), rng.standard_normal((n, n))
    w, z = [f"w{k}" for k in range(n)], [f"z{k}" for k in range(n)]
    plant = control.ss(A, B, C, np.zeros((n, n)), inputs=w, outputs=z)
    report = check_structure(
        interconnection([plant], {"d": Block(z, w, 2.5, kind="real")}), gap=0.6
    )
    assert report.verdict == "robust", report.reason
    assert 1 < report.margins.rs <= report.margins.broken <= 1.6 * report.margins.rs
    assert 2.5 * report.margins.broken == pytest.approx(4.1956, rel=1e-4)
    assert abs(report.margins.worst["d"]) == pytest.approx(1.0)
    d = np.linspace(-1, 1, 2001) * 2.5 * report.margins.rs
    assert np.linalg.eigvals(A + d[:, None, None] * (B @ C)).real.max() < 0
