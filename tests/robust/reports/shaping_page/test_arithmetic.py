"""The arithmetic of the shaping page against `check`: the same numbers at each of its frequencies,
and verdicts.
"""

import json
from dataclasses import replace
from importlib.resources import files

import control
import numpy as np
import pytest

import robust
from robust.analysis.loop import assemble_loop
from robust.lti.connections import closed_loop
from tests.support.browser import browser
from tests.support.shaped_loops import random_loop, shaped, written_content

SCRIPT = files("robust.reports.shaping_page").joinpath("arithmetic.js").read_text(encoding="utf-8")
BEYOND = 1e100

ASK = """
function asked(content, state, omega, times) {
  const problem = prepare(content), answer = evaluate(problem, state), m = answer.models[0];
  const there = shaped(problem, fixed(problem, Float64Array.from(omega)), partsOf(state, problem.dt), state.gain);
  const of = loopCurves(there, 0, problem.models[0].inverse, problem.demand);
  const plain = values => Array.from(values, x => (Number.isFinite(x) ? x : 1e300));
  return { S: plain(of.S), T: plain(of.T), rs: plain(of.rs), rp: plain(of.rp), stable: m.stable,
    clear: m.clear, count: m.count, maxRs: m.maxRs.value, disk: m.disk,
    step: plain(stepResponse(answer.omega, m.Tr, times, problem.dt)),
    K: realised(content, state), pid: pidGains(state, problem.dt), python: pythonOf(content, state) };
}
"""


@pytest.fixture(scope="module")
def ask(tmp_path_factory):
    """Put a loop to the arithmetic in a browser."""
    with browser(tmp_path_factory.mktemp("profile")) as page:
        page.run(SCRIPT + ASK + "0")

        def asked(content, state, omega=(), times=()):
            given = ", ".join(
                json.dumps(part) for part in (content, state, list(omega), list(times))
            )
            return page.run(f"asked({given})")

        asked.peaks = lambda values: page.run(f"peaks({list(values)})")
        yield asked


def near(found, wanted):
    """Largest difference, relative above one; what is beyond every bound in both is equal."""
    found, wanted = np.minimum(np.asarray(found), BEYOND), np.minimum(np.asarray(wanted), BEYOND)
    return np.max(np.abs(found - wanted) / np.maximum(1, np.abs(wanted)))


@pytest.mark.attack(every=4)
@pytest.mark.filterwarnings("ignore::robust.DesignWarning")
@pytest.mark.parametrize("seed", range(50))
def test_fifty_designs_agree_with_check(seed, ask, tmp_path):
    model, w_P, begin, dt, delay, state = random_loop([seed])
    content = written_content(tmp_path, model, w_P=w_P, K=begin, dt=dt, delay=delay)
    K = shaped(state, 1.0 if begin is None else begin, dt)
    report = robust.check(model, K, w_P=w_P, delay=delay, certify=False)
    loop = assemble_loop(model, K, w_P=w_P, delay=delay)
    # which the page says, and leaves to the check
    left_out = loop.aliases is not None and loop.aliases.inverse
    assert left_out == ("aliases left to the check" in content["models"][0]["set"])
    curves = (replace(loop, continuous_plant=None) if left_out else loop).curves(
        report.curves.omega
    )
    found = ask(content, state, report.curves.omega)
    assert near(found["S"], np.abs(curves.S)) < 1e-6
    assert near(found["T"], np.abs(1 - curves.S)) < 1e-6
    assert near(found["rs"], curves.rs) < 1e-6
    safe = curves.rs < 1 - 1e-9  # on the edge itself both are beyond every bound
    assert not safe.any() or near(np.array(found["rp"])[safe], curves.rp[safe]) < 1e-6
    assert found["clear"]
    assert found["stable"] == report.nominally_stable, (report.reason, found["count"])
    if report.nominally_stable:
        largest = 1 / report.margins.rs if report.margins.rs else np.inf
        assert left_out or min(found["maxRs"], BEYOND) == pytest.approx(
            min(largest, BEYOND), rel=1e-3
        )
        assert found["disk"] == pytest.approx(report.margins.disk, rel=1e-3)
    # what the page writes out is that controller
    written = control.StateSpace(
        *[np.reshape(found["K"][n], getattr(K, n).shape) for n in "ABCD"], dt
    )
    at = report.curves.omega[:: report.curves.omega.size // 20]
    z = np.exp(1j * at * dt) if dt else 1j * at
    assert written(z) == pytest.approx(K(z), rel=1e-6)


def test_designs_of_every_kind_are_among_them():
    loops = [random_loop([seed]) for seed in range(50)]
    assert len({loop[0].form for loop in loops}) == 4
    assert sum(loop[3] > 0 for loop in loops) >= 10
    assert sum(loop[4] > 0 for loop in loops) >= 10


@pytest.mark.parametrize("dt", [0.0, 0.05])
@pytest.mark.parametrize("delay", [0.0, 0.1])
def test_the_step_response_is_that_of_the_loop(dt, delay, ask, tmp_path):
    """Against a simulation in the time domain; where continuous, the delay is a Padé approximation
    of high order.
    """
    plant, w = control.tf([4], [1, 0.8, 4]), control.tf([0.1], [1])
    model = robust.UncertaintyModel(
        plant, w, "multiplicative", np.array([0.1, 10.0]), np.array([0.1, 0.1])
    )
    state = {"gain": 0.3, "elements": [{"kind": "integrator", "f": 0.2}]}
    content = written_content(tmp_path, model, w_P=None, K=None, dt=dt, delay=delay)
    loop = assemble_loop(model, shaped(state, 1.0, dt), w_P=None, delay=delay)
    times = np.arange(0, 400) * 0.05
    T = control.StateSpace(*closed_loop(loop.G, loop.K, ("y",), ("r",)), dt)
    wanted = control.step_response(T, times).outputs
    found = ask(content, state, times=times.tolist())["step"]
    assert np.max(np.abs(np.array(found) - wanted)) < 5e-3 * np.max(wanted)


@pytest.mark.parametrize("dt", [0.0, 0.01])
@pytest.mark.parametrize("kinds", [(), ("integrator",), ("lead",), ("integrator", "lead")])
def test_pid_gains_are_those_of_the_controller(kinds, dt, ask, tmp_path):
    numbers = {"integrator": {"f": 0.5}, "lead": {"f": 3.0, "phase": 40.0}}
    state = {"gain": 2.5, "elements": [{"kind": kind} | numbers[kind] for kind in kinds]}
    model = random_loop([3])[0]
    gains = ask(written_content(tmp_path, model, w_P=None, K=None, dt=dt, delay=0.0), state)["pid"]
    assert gains.pop("rest") == []
    K, wanted = robust.shaping.pid(**gains, dt=dt), shaped(state, 1.0, dt)
    at = np.array([0.3, 3.0, 30.0, 200.0])
    z = np.exp(1j * at * dt) if dt else 1j * at
    assert K(z) == pytest.approx(wanted(z), rel=1e-9)


def test_a_shape_that_is_no_pid_has_no_gains(ask, tmp_path):
    content = written_content(tmp_path, random_loop([3])[0], w_P=None, K=None, dt=0, delay=0.0)
    twice = [{"kind": "integrator", "f": 0.5}] * 2
    assert ask(content, {"gain": 1.0, "elements": twice})["pid"] is None
    filtered = [{"kind": "roll-off", "f": 50.0, "order": 1, "zeta": 0.7}]
    assert ask(content, {"gain": 2.0, "elements": filtered})["pid"]["rest"] == ["roll-off"]


@pytest.mark.parametrize(
    ("values", "where"),
    [
        ([3, 1, 2, 4, 1, 9], [3]),  # neither end is one
        ([3, 1, 5, 1, 4, 1], [2, 4]),
        ([1, 1.02, 1, 1.03, 1], []),  # ripple
        ([1, 2, 1.95, 2.1, 2.05, 1], [3]),  # of ripple on a peak the highest
        ([5, 4, 3, 2, 1], []),
        ([1, 2, 3, 4, 5], []),
        ([], []),
    ],
)
def test_a_peak_stands_between_two_valleys(values, where, ask):
    assert ask.peaks(values) == where


@pytest.mark.parametrize("seed", [1, 4, 9])
def test_the_python_to_paste_makes_the_same_loop(seed, ask, tmp_path, monkeypatch, capsys):
    model, w_P, begin, dt, delay, state = random_loop([seed])
    monkeypatch.chdir(tmp_path)
    robust.save(model, "model.json")
    text = ask(written_content(tmp_path, model, w_P=w_P, K=begin, dt=dt, delay=delay), state)[
        "python"
    ]
    names: dict = {}
    exec(compile(text, "pasted", "exec"), names)
    assert "verdict:" in capsys.readouterr().out
    K = shaped(state, 1.0 if begin is None else begin, dt)
    at = np.array([0.5, 5.0, 20.0])
    z = np.exp(1j * at * dt) if dt else 1j * at
    assert names["K"](z) == pytest.approx(K(z), rel=1e-9)
    assert robust.load("controller.json").dt == pytest.approx(dt)
