"""The function block, run statement by statement, against python-control and the simulated
drive.
"""

import re
from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf.rig import Drive
from robust.servo import cascade, structured_text
from tests.support.linear_axis import frictionless, settings_of

HZ = 2 * np.pi  # rad/s

BASE = Drive(fs=4000, kv=60, kp=143, kp_unit="A/(m/s)", tn=0.01, torque_constant=52.8)


class Block:
    """A function block, translated from its text: declarations are variables, statements are run at
    each call.
    """

    def __init__(self, text):
        text = re.sub(r"\(\*.*?\*\)", "", text, flags=re.DOTALL)
        self.names = {}
        for name, _, start in re.findall(r"(\w+) : (LREAL|BOOL|INT)(?: := ([^;]+))?;", text):
            number = {"TRUE": True, "FALSE": False, "": 0}.get(start.strip())
            self.names[name] = float(start) if number is None else number
        body = text[text.rindex("END_VAR") + len("END_VAR") :].replace("END_FUNCTION_BLOCK", "")
        lines, depth = [], 0
        for one in re.split(r";|(?<=THEN)\s|(?<=ELSE)\s", body):
            statement = " ".join(one.split())
            if not statement:
                continue
            if statement == "END_IF":
                depth -= 1
                continue
            head = re.fullmatch(r"(IF|ELSIF) (.*) THEN", statement)
            if head:
                depth += head[1] == "IF"
                condition = re.sub(r"\b(AND|OR|NOT)\b", lambda word: word[0].lower(), head[2])
                lines.append(
                    "    " * (depth - 1) + {"IF": "if", "ELSIF": "elif"}[head[1]] + f" {condition}:"
                )
            else:
                name, right = statement.split(" := ")
                assert name in self.names, f"{name} is not declared"
                right = re.sub(r"\b(TRUE|FALSE)\b", lambda word: word[0].capitalize(), right)
                lines.append("    " * depth + f"{name} = {right}")
        self.code = compile("\n".join(lines), "block", "exec")

    def call(self, **inputs):
        assert set(inputs) <= set(self.names)
        self.names.update(inputs)
        exec(self.code, {"__builtins__": {}}, self.names)
        return self.names["output"]


def run(settings, **signals):
    block = Block(structured_text(settings))
    return np.array(
        [
            block.call(**dict(zip(signals, row, strict=True)))
            for row in zip(*signals.values(), strict=True)
        ]
    )


@pytest.mark.parametrize(
    "more",
    [
        {},
        {
            "filters": (
                robust.tuning.Notch(omega=HZ * 83.0, width=20.0 / 83.0, depth=0.1),
                robust.tuning.LowPass(omega=HZ * 700.0),
            ),
            "velocity_lag": 0.3e-3,
        },
        {"observer_frequency": 300.0},
        {"tn": np.inf, "position_unit": "mm", "unit_factor": 1e-3, "load_factor": 1e-3},
    ],
    ids=str,
)
def test_the_statements_are_the_controller_sample_by_sample(more):
    settings = replace(BASE, **more)
    y = np.cumsum(np.random.default_rng(0).standard_normal(400)) * 1e-5
    y[0] = 0.0  # the block takes the first position for the one before; here it is
    u = run(settings, position=y, position_set=np.zeros(400))
    wanted = -control.forced_response(cascade(settings), inputs=y).outputs
    assert np.allclose(u, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_two_encoders():
    settings = replace(BASE, encoder="both")
    y = np.cumsum(np.random.default_rng(0).standard_normal((2, 300)), axis=1) * 1e-5
    y[:, 0] = 0.0
    u = run(settings, position=y[0], load_position=y[1], position_set=np.zeros(300))
    wanted = -control.forced_response(cascade(settings), inputs=y).outputs.ravel()
    assert np.allclose(u, wanted, rtol=0, atol=1e-12 * np.abs(wanted).max())


def test_it_is_the_simulated_drive_with_its_limit_and_its_slow_position_loop():
    """The block is given what the drive of a machine at its limit saw: it asks for the same
    current.
    """
    axis = frictionless("belt", position_every=4)
    axis = replace(axis, drive=replace(axis.drive, limit=2.0, velocity_feedforward=0.7))
    r = np.cumsum(np.random.default_rng(5).standard_normal(1500)) * 2e-4
    trace = nlfrf.rig.run(axis, {"position": r, "force": np.full(1500, 40.0)})
    settings = settings_of(axis, limit=2.0)
    u = run(
        settings,
        position=trace.position,
        position_set=r,
        added=np.full(1500, 40.0 / axis.force_constant),
    )
    assert 0.05 < trace.limited.mean() < 0.95
    assert np.allclose(u, trace.current_set, rtol=0, atol=1e-9)


def test_anti_windup_holds_the_integral():
    settings = replace(BASE, limit=5.0)
    block = Block(structured_text(settings))
    for _ in range(2000):  # held for half a second against the limit
        assert block.call(position=0.0, position_set=0.1) in (0.0, 5.0)
        assert block.names["limited"] or block.names["output"] == 0.0
    assert abs(block.names["integral"]) < 5.0
    assert block.call(position=0.0, position_set=-0.1) == -5.0  # turned at once
    without = Block(structured_text(BASE))
    for _ in range(2000):
        without.call(position=0.0, position_set=0.1)
    assert without.names["integral"] > 1e4


def test_it_starts_without_a_jump_and_resets():
    block = Block(structured_text(BASE))
    assert block.call(position=3.0, position_set=3.0) == 0.0
    block.call(position=3.001, position_set=3.0)
    assert block.names["integral"] != 0.0
    assert block.call(position=5.0, position_set=5.0, reset=True) == 0.0


def test_forces_and_numbers_with_their_units():
    text = structured_text(replace(BASE, limit=10.0), name="FB_X", output_unit="N")
    assert "velocity_gain : LREAL := 7550.4; (* N/(m/s) *)" in text
    assert "output_limit : LREAL := 528.0; (* N *)" in text
    assert text.startswith("FUNCTION_BLOCK FB_X\n")
    assert text.endswith("END_FUNCTION_BLOCK\n")
    assert "tn = 10 ms" in text


@pytest.mark.parametrize("name", ["2b", "a b", "IF", "", 3])
def test_refusals(name):
    with pytest.raises(ValueError, match="name must be an identifier of IEC 61131-3, got"):
        structured_text(BASE, name=name)
