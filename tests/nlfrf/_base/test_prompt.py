"""Values at a prompt: one line each."""

import importlib
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import nlfrf
import robust
from tests.support.measurement_files import FS, MS, N, P, U, Y

HELD = [
    np.linspace(-1, 1, 100_000).reshape(2, -1),
    3.5,
    "a word <&>",
    None,
    ("a", "b"),
    {"a": np.ones(3)},
    [1] * 50,
]


def public_values():
    for module in (
        nlfrf,
        robust,
        importlib.import_module("nlfrf.friction"),
        importlib.import_module("nlfrf.hysteresis"),
    ):
        for name in module.__all__:
            thing = getattr(module, name)
            if isinstance(thing, type) and is_dataclass(thing):
                yield f"{module.__name__}.{name}", thing


VALUES = dict(public_values())


@pytest.mark.parametrize("name", VALUES)
def test_every_public_value_is_one_line(name):
    kind = VALUES[name]
    thing = object.__new__(kind)
    for i, field in enumerate(fields(kind)):
        object.__setattr__(thing, field.name, HELD[i % len(HELD)])
    said = repr(thing)
    assert "\n" not in said
    assert len(said) < 200
    assert said.startswith(f"{kind.__name__}(")


@pytest.fixture(scope="module")
def record():
    u, y = U.reshape(1, P, N), Y.reshape(1, P, N)
    return nlfrf.Record(u=u, y=y, fs=FS, lines=MS.lines, u_name="force", u_unit="N", y_unit="mm")


def test_a_report_is_no_wall_of_numbers_any_more():
    import control

    model = robust.UncertaintyModel(
        control.tf([1], [1, 1]),
        control.tf([0.2], [1]),
        "multiplicative",
        np.array([1.0, 2.0]),
        np.array([0.1, 0.2]),
    )
    report = robust.check(model, 2.0)
    assert len(repr(report).splitlines()) == 1


def test_a_value_inside_a_value_is_named_only(record):
    assert "lines=LineGrid(...)" in repr(
        nlfrf.Record(u=record.u, y=record.y, fs=FS, lines=MS.lines)
    )
