"""Crossover asked for and got, in the design and on the command line; and the noise that an encoder
makes in u.
"""

import re
import sys

import control
import numpy as np
import pytest

import robust
from robust import UncertaintyModel, check, cli, design_frf, load, save
from robust.lti.grids import Peak
from robust.models import Origin
from robust.synthesis.hinf.design import Design, DesignedLoop
from tests.support.printed import unwrapped

HZ = 2 * np.pi
MODE = control.tf([(HZ * 40) ** 2], [1, 0.04 * HZ * 40, (HZ * 40) ** 2]) * control.tf(
    [1], [0.05, 1]
)


@pytest.mark.parametrize("structure", ["PI", "PID"])
def test_a_crossover_is_limited_on_every_line_above(structure):
    """Of a mode above it |L| would come back over one, as it did while one line alone was
    limited.
    """
    most = HZ * 8
    design = design_frf(MODE, structure, M_S=2.0, omega_c=(HZ * 1, most), dt=1e-3)
    omega = np.linspace(most, 0.999e3 * np.pi, 20_000)
    L = robust.sampled(MODE, 1e-3)(np.exp(1e-3j * omega)) * design.K(np.exp(1e-3j * omega))
    assert np.abs(L).max() <= 1 + 2e-3
    assert HZ * 1 * 0.98 <= design.loop.crossovers[-1] <= most * 1.02
    assert "asked 1 Hz to 8 Hz; nominal" in str(design).replace("\n    ", " ")


def test_one_number_is_a_least_crossover():
    design = design_frf(control.tf([1], [0.05, 1]), "PI", M_S=1.5, omega_c=HZ * 2, dt=1e-3)
    assert design.loop.crossovers[-1] > HZ * 4
    assert "asked 2 Hz or above" in design.loop_in_words


def model_of(G, unit="", dt=0.0):
    w = control.tf([0.1], [1], dt) if dt else control.tf([0.1], [1])
    omega = np.array([1.0, 300.0])
    return UncertaintyModel(
        G, w, "multiplicative", omega, np.array([0.05, 0.1]), origin=Origin(unit=unit)
    )


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    monkeypatch.chdir(tmp_path)
    save(model_of(MODE, "m/N"), "model.json")

    def run(line):
        monkeypatch.setattr(sys, "argv", ["robust", *line.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        printed = capsys.readouterr()
        return stop.value.code or 0, printed.out, printed.err

    return run


def test_the_command_prints_what_was_asked_and_got(command):
    code, out, err = command("design model.json --bandwidth 5 --sample-time 1e-3 -o K.json")
    at = re.search(r"crossovers? ([\d.Hz, ]+), asked 5 Hz", out)[1]
    got = float(at.split(", ")[-1].removesuffix(" Hz"))
    seen = (
        robust.margins.classical_margins(robust.sampled(MODE, 1e-3) * load("K.json")).crossover / HZ
    )
    assert got == pytest.approx(seen, rel=2e-3)
    assert ("off by more than a factor of 2" in err) == (
        not any(2.5 <= float(one.removesuffix(" Hz")) <= 10 for one in at.split(", "))
    )
    err = command(
        "design model.json --bandwidth 5 --crossover-within 1.001 --sample-time 1e-3 -o K.json"
    )[2]
    assert f"{at}, asked 5 Hz: off by more than a factor of 1.001 (--crossover-within)" in err
    out = command("design model.json --method mixsyn --bandwidth 1 -o m.json")[1]
    assert re.search(r"bandwidth of S [\d.]+ Hz, asked 1 Hz", out)
    code, _, err = command("design model.json --bandwidth 5 --crossover-within 1 -o K.json")
    assert code == 2
    assert "--crossover-within must be a factor above 1, got 1" in err


def test_a_pid_crosses_over_within_a_factor_of_two(command):
    pid = "design model.json --method pid --structure PI --bandwidth 1 --sample-time 1e-3 -o K.json"
    code, out, _ = command(pid)
    assert code == 0
    assert re.search(r"crossover (1\.\d+|2) Hz, asked 1 Hz to 2 Hz;", out)
    assert "asked 1 Hz or above" in command(f"{pid} --crossover-within inf")[1]


@pytest.mark.parametrize("g", [0.3, -0.7])
def test_the_noise_of_an_encoder_is_its_closed_form(g):
    """G = g/z, K = k: K S = k z/(z + k g), whose impulse response is k (-k g)^n."""
    k, dt = 1.2, 1e-2
    report = check(model_of(control.tf([g], [1, 0], dt), dt=dt), control.ss([], [], [], [[k]], dt))
    assert report.encoder_noise == pytest.approx(
        k / np.sqrt(1 - (k * g) ** 2) / np.sqrt(12), rel=1e-9
    )
    assert "a step of 1 unit of y adds" in unwrapped(str(report))


def test_the_noise_of_an_encoder_is_that_of_rounding():
    """Rounded y of a slow motion over many steps, simulated, against the number of the report."""
    K, step = robust.shaping.pid(3.0, 20.0, 0.05, filter_time=2e-3, dt=1e-3), 1e-3
    plant = control.tf([1], [0.05, 1])
    G = robust.sampled(plant, 1e-3)
    report = check(model_of(plant, "m/N"), K)
    y = 40 * step * np.sin(2 * np.pi * 0.9 * np.arange(40_000) * 1e-3) * np.linspace(1, 2, 40_000)
    rounding = step * np.round(y / step) - y
    u = control.forced_response(control.feedback(K, G), inputs=rounding).outputs
    assert np.std(u[2000:]) / step == pytest.approx(report.encoder_noise, rel=0.1)
    text = unwrapped(str(report))
    assert f"a step of 1 um adds {1e-6 * report.encoder_noise:.3g} N rms to u" in text
    continuous = check(model_of(plant, "m/N"), control.tf([1.0], [1, 0]))
    assert np.isnan(continuous.encoder_noise)
    assert "encoder:" not in str(continuous)


def test_a_crossover_below_the_one_asked_is_named():
    """|L| falls below one at 0.32 Hz; a mode lifts it above one again near 2 Hz, which was
    asked.
    """
    design = Design(
        K=control.ss([], [], [], [[2.0]]), gamma=float("nan"), omega_c=(HZ * 2,),
        loop=DesignedLoop(
            crossovers=(2.0, HZ * 1.9, HZ * 2.1), peak_S=Peak(2.0, 2.0), peak_T=Peak(2.0, 2.0)
        ),
    )  # fmt: skip
    assert (
        "|L| crosses one at 0.3183 Hz already: a mode may reach the crossover asked"
        in design.loop_in_words
    )


def test_every_crossover_is_printed(command):
    """One near the wanted crossover is enough; a mode adds others."""
    mode = control.tf([1], [1, 0.05]) * control.tf([1], [1 / (HZ * 20) ** 2, 0.01 / (HZ * 20), 1])
    save(model_of(mode, "m/N"), "light.json")
    _, out, err = command("design light.json --bandwidth 12 --sample-time 1e-3 -o K.json")
    at = re.search(r"crossovers ([\d., Hz]+), asked 12 Hz", out)
    assert at, out + err
    assert "off by more than" not in err


def test_a_mode_at_the_crossover_does_not_meet_it(command):
    """|L| fell below one at 1.6 Hz and only a mode at 12 Hz lifted it above: every limit was met."""
    stage = control.tf([HZ**2], [1, 0.6 * HZ, HZ**2])
    mode = control.tf([-0.01 * (12 * HZ) ** 2], [1, 0.02 * 12 * HZ, (12 * HZ) ** 2])
    save(model_of(stage + mode), "model.json")
    line = "design model.json --method pid --bandwidth 12 --sample-time 0.002 --delay 0.002"
    code, out, _ = command(f"{line} -o K.json")
    said = unwrapped(out)
    assert code == 1
    assert re.search(
        r"LIMITS NOT MET; not found: the loop crosses over at \S+ Hz, asked 12 Hz", said
    )
    assert "to meet the limits: a lower --bandwidth; or a larger --peak; or a --structure" in said
    assert "prove it" not in said
    assert "--crossover-within" not in said
