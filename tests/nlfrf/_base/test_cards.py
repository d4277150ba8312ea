"""Values at a prompt and in a notebook: one line, an instant table, a small picture of few."""

import importlib
import time
from dataclasses import fields, is_dataclass

import numpy as np
import pytest

import nlfrf
import robust
from nlfrf._base.values import Sketch, html_card, svg_sketch, thin_curve
from tests.support.measurement_files import FS, MS, N, P, U, Y

HELD = [np.linspace(-1, 1, 100_000).reshape(2, -1), 3.5, "a word <&>", None, ("a", "b"), {"a": np.ones(3)}, [1] * 50]


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
def test_every_public_value_is_one_line_and_an_instant_table(name):
    kind = VALUES[name]
    thing = object.__new__(kind)
    for i, field in enumerate(fields(kind)):
        object.__setattr__(thing, field.name, HELD[i % len(HELD)])
    said = repr(thing)
    assert "\n" not in said
    assert len(said) < 200
    assert said.startswith(f"{kind.__name__}(")
    if kind.__str__ is object.__str__ and not hasattr(kind, "_sketch_"):
        begin = time.process_time()
        told = thing._repr_html_()
        assert time.process_time() - begin < 0.1
        assert told.count("<tr>") == len(fields(kind))
        assert "<&>" not in told


@pytest.fixture(scope="module")
def record():
    u, y = U.reshape(1, P, N), Y.reshape(1, P, N)
    return nlfrf.Record(u=u, y=y, fs=FS, lines=MS.lines, u_name="force", u_unit="N", y_unit="mm")


def test_a_record_and_a_bla_have_a_picture_and_the_meaning_of_their_fields(record):
    told = record._repr_html_()
    assert told.count("<polyline") == 2
    assert "Sampling frequency [Hz]" in told
    assert "array(1, 3, 250) from -2.149 to 2.149" in told
    bla = nlfrf.identify(record)
    told = bla._repr_html_()
    assert told.count("<polyline") == 2
    assert str(bla).splitlines()[0].split("<")[0][:20] in told
    assert "<svg" not in MS._repr_html_()
    assert len(repr(bla)) < 200


def test_a_report_is_no_wall_of_numbers_any_more():
    import control

    model = robust.UncertaintyModel(
        control.tf([1], [1, 1]), control.tf([0.2], [1]), "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2])
    )
    report = robust.check(model, 2.0)
    assert len(repr(report).splitlines()) == 1
    told = report._repr_html_()
    assert "STATISTICALLY ROBUST" in told
    assert "<polyline" in told
    assert len(told) < 40_000


def test_a_curve_keeps_its_extremes_when_it_is_thinned():
    y = np.zeros(100_000)
    y[54_321], y[7] = 9.0, -5.0
    x, few = thin_curve(np.arange(y.size, dtype=float), y)
    assert few.size == 400
    assert (few.max(), few.min()) == (9.0, -5.0)
    assert x[few.argmax()] == 54_321
    assert svg_sketch(Sketch("f", "dB", [("empty", np.ones(2), np.full(2, np.nan))], log=True)) == ""


def test_a_value_inside_a_value_is_named_only(record):
    assert "lines=LineGrid(...)" in repr(nlfrf.Record(u=record.u, y=record.y, fs=FS, lines=MS.lines))
    assert html_card(record) == record._repr_html_()
