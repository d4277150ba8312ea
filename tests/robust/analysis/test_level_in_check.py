"""The level of a loop in the check and in the report that is handed over."""

import json
import sys
from dataclasses import replace

import control
import numpy as np
import pytest

import nlfrf
import robust
from robust import UncertaintyModel, cli
from robust.analysis import LoopSignals, NoiseSignal, StepSignal
from tests.robust.analysis.test_loop_level import OMEGA, RADIUS, plant_set, record_of
from tests.support.printed import unwrapped


def test_check_and_report_carry_the_level(tmp_path, undrawn):
    bla = nlfrf.identify(record_of(1, 1, 0.1))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2))
    signals = LoopSignals(noise=NoiseSignal(0.1, 8.9, 9.1))
    report = robust.check(model, 0.5, signals=signals, delay=1e-3)
    alone = robust.analysis.predict_level(model, 0.5, signals, delay=1e-3)
    assert str(report.level) == str(alone)
    flat = unwrapped(report)
    assert f"level: {unwrapped(alone)}" in flat
    assert "level:" not in unwrapped(robust.check(model, 0.5))
    for known in ({"signals": signals}, {"report": robust.check(model, 0.5, signals=signals)}):
        robust.reports.write_report(tmp_path / "report.html", model, 0.5, **known)
        text = (tmp_path / "report.html").read_text(encoding="utf-8")
        assert ">level</th>" in text
        assert "below the measured 0.1" in text
    with pytest.raises(ValueError, match="signals must be left out with a report"):
        robust.reports.write_report(
            tmp_path / "report.html", model, 0.5, report=report, signals=signals, delay=1e-3
        )


def test_a_matrix_has_no_level(tmp_path):
    G = control.ss(-np.eye(2), np.eye(2), np.eye(2), np.zeros((2, 2)))
    w = control.ss([], [], [], [[0.2]])
    known = {"form": "additive", "omega": OMEGA, "radius": np.full((4, 2), 0.2), "confidence": 0.95}
    model = robust.UncertaintyModel(nominal=G, left=(w, w), right=(w, w), **known)
    signals = LoopSignals(noise=NoiseSignal(0.1, 8.9, 9.1))
    for refused in (
        lambda: robust.check(model, np.eye(2), signals=signals),
        lambda: robust.reports.write_report(tmp_path / "r.html", model, np.eye(2), signals=signals),
    ):
        with pytest.raises(ValueError, match="model must have one input and one output"):
            refused()


def test_an_unstable_loop_has_no_level_in_its_report():
    report = robust.check(plant_set(), -2.0, signals=LoopSignals(noise=NoiseSignal(0.1, 8.9, 9.1)))
    assert (report.nominally_stable, report.level) == (False, None)


@pytest.mark.parametrize(
    "model",
    [
        control.frd([1 + 0j], [1.0]),
        UncertaintyModel(control.frd([1 + 0j, 1], OMEGA), 0.2, "additive", OMEGA, RADIUS / 2),
    ],
)
def test_a_plant_on_its_lines_has_no_level(model):
    with pytest.raises(
        ValueError, match="model must be an UncertaintyModel with a parametric nominal"
    ):
        robust.check(model, 1.0, signals=LoopSignals(noise=NoiseSignal(0.1, 8.9, 9.1)))


@pytest.mark.filterwarnings("ignore:a nominal model of 2 poles does not fit")  # behind its hold
def test_the_commands_name_signals_too(tmp_path, undrawn, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    bla = nlfrf.identify(record_of(1, 1, 0.1))
    model = robust.uncertainty(bla, robust.fit_nominal(bla, n_poles=2, dt=1 / bla.fs))
    K = control.ss([], [], [], [[0.5]], 1 / bla.fs)
    robust.save(model, "m.json")
    robust.save(K, "K.json")
    robust.save(plant_set(), "c.json")
    robust.save(0.5, "continuous.json")

    def told(command):
        monkeypatch.setattr(sys, "argv", ["robust", *command.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        return stop.value.code or 0, *capsys.readouterr()

    signals = LoopSignals(
        reference=StepSignal(0.2),
        disturbance=NoiseSignal(0.1, omega_max=2 * np.pi * 60),
        noise=NoiseSignal(0.0),
    )
    level = robust.analysis.predict_level(
        model, K, replace(signals, noise=NoiseSignal(0.0, omega_max=2 * np.pi * 60))
    )
    code, out, _ = told(
        "check m.json K.json --reference-step 0.2 --disturbance 0.1 --noise 0 --up-to 60 --json --no-certify"
    )
    found = json.loads(out)["K.json"]["level"]
    assert (found["u"], found["y"], found["y_state"]) == (level.u, level.y, level.y_state.value)
    code, out, _ = told("check m.json K.json --disturbance 0.1 --no-certify")
    assert unwrapped(
        robust.analysis.predict_level(model, K, LoopSignals(disturbance=NoiseSignal(0.1)))
    ) in unwrapped(out)
    code, _, _ = told("report m.json K.json --disturbance 0.1 -o r.html")
    assert (code, ">level</th>" in (tmp_path / "r.html").read_text(encoding="utf-8")) == (0, True)
    for command, message in (
        ("check c.json continuous.json --noise 0.1", "noise must have a highest frequency"),
        ("check m.json K.json --noise -1", "noise must be zero or positive"),
        ("check m.json K.json --noise 1 --up-to 0", "up-to must be positive"),
    ):
        code, _, err = told(command)
        assert code == 2
        assert message in err
        assert err.count("\n") == 1
