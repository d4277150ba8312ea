"""A PID from a TOML file: every form against its formula, units, refusals, and the commands that
take it.
"""

import re
import sys
from pathlib import Path

import control
import numpy as np
import pytest

import robust
from nlfrf._base.units import split_unit, unit_factor, units_differ
from robust import UncertaintyModel, cli, load, save
from robust.io import verify_certificate
from robust.models import Origin
from robust.synthesis.pid_file import load_pid
from tests.support.printed import unwrapped

S = 1j * np.geomspace(1e-1, 1e4, 60)
Z = np.exp(1e-3j * np.geomspace(1e-1, 3e3, 60))


def written(tmp_path, text, name="pid.toml"):
    """Write a file; lines by semicolons."""
    path = tmp_path / name
    path.write_text(text.replace("; ", "\n"))
    return path


def form_of_hand(form, numbers, s):
    """K(s) of a form, as it stands in textbooks."""
    Kp, Ti, Td, Tf = numbers
    if form == "series":
        return Kp * (1 + 1 / (Ti * s)) * (Td * s + 1) / (Tf * s + 1)
    if form == "ideal":
        return Kp * (1 + 1 / (Ti * s) + Td * s / (Tf * s + 1))
    return Kp + Kp / Ti / s + Kp * Td * s / (Tf * s + 1)


@pytest.mark.parametrize("form", ["parallel", "ideal", "series"])
@pytest.mark.parametrize("seed", range(4))
def test_every_form_is_its_formula(tmp_path, form, seed):
    """Continuous in s; sampled in the s of the trapezoidal rule."""
    rng = np.random.default_rng(seed)
    numbers = 10 ** rng.uniform([-2, -3, -3, -3], [6, 1, 0, -1])
    numbers[0] *= rng.choice([1, -1])
    Kp, Ti, Td, Tf = numbers.tolist()
    rest = f'Ti = "{Ti!r} s"; Td = "{1e3 * Td!r} ms"'
    if form == "parallel":
        rest = f'Ki = "{Kp / Ti!r} A/m/s"; Kd = "{Kp * Td!r} A s/m"'
    for dt, points, s in ((0.0, S, S), (1e-3, Z, 2e3 * (Z - 1) / (Z + 1))):
        text = (
            f'form = "{form}"; sample_time = "{dt!r} s"; Kp = "{Kp!r} A/m"; {rest}; Tf = "{Tf!r} s"'
        )
        found = load_pid(written(tmp_path, text))
        assert np.allclose(found.K(points), form_of_hand(form, numbers, s), rtol=1e-9)
        assert (found.unit, found.dt) == ("A/m", dt)


def test_a_series_without_derivative_is_the_ideal_form(tmp_path):
    text = 'form = "{}"; sample_time = "0 s"; Kp = 3.0; Ti = "2 s"'
    one, other = (load_pid(written(tmp_path, text.format(form))).K for form in ("series", "ideal"))
    assert np.allclose(one(S), 3 * (1 + 1 / (2 * S)), rtol=1e-12)
    assert np.allclose(one(S), other(S), rtol=1e-12)
    # equal times: the derivative is cancelled by its filter
    equal = load_pid(written(tmp_path, text.format("series") + '; Td = "20 ms"; Tf = "20 ms"'))
    assert (equal.pid.kp, equal.pid.ki, equal.pid.kd) == (3.0, 1.5, 0.0)


def test_filters_follow_with_their_own_frequency(tmp_path):
    """Sampled, a filter has at its frequency the response of the continuous one."""
    text = (
        'sample_time = "1 ms"; Kp = "2 V/V"; [[filters]]; notch = "60 Hz"; bandwidth = "20 Hz";'
        ' depth = "10 %"; '
    )
    text += '[[filters]]; low_pass = "0.2 kHz"; zeta = 0.6'
    found = load_pid(written(tmp_path, text))
    at = {f: complex(found.K(np.exp(2e-3j * np.pi * f))) for f in (60, 200)}
    tan = np.tan(np.pi * 1e-3 * np.array([60, 200]))
    p = 1j * tan[0] / tan[1]
    assert at[60] == pytest.approx(2 * 0.1 / (p * p + 1.2 * p + 1), rel=1e-9)
    q = 1j * tan[1] / tan[0]
    assert at[200] == pytest.approx(2 * (q * q + q / 30 + 1) / (q * q + q / 3 + 1) / 1.2j, rel=1e-9)
    assert load(tmp_path / "pid.toml").nstates == 4


PID = (
    'sample_time = "1 ms"; delay = "0.5 ms"; Kp = "800 N/m"; Ki = "5 N/(mm s)"; Kd = "3 Ns/m"; Tf ='
    ' "2 ms"'
)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (
            ("Kp =", "kp ="),
            (
                r"pid.toml must have no entry 'kp', did you mean Kp\? Known: Kd, Ki, Kp, Tf,"
                r" delay, "
            ),
        ),
        (('Kp = "800 N/m"; ', ""), "pid.toml must have an entry Kp, the gain, got none"),
        (
            ('sample_time = "1 ms"; ', ""),
            'an entry sample_time, such as "1 ms", or "0 s" for a continuous PID, got',
        ),
        (
            ("Ki =", "Ti ="),
            (
                'no entry Ti in the parallel form, which takes Kp, Ki, Kd and Tf. form = "parallel"'
                " takes"
            ),
        ),
        (
            ("Kp =", 'form = "series"; Kp ='),
            "no entry Ki in the series form, which takes Kp, Ti, Td and Tf",
        ),
        (
            ("Kp =", 'form = "serial"; Kp ='),
            "form must be one of 'parallel', 'ideal', 'series', got 'serial'",
        ),
        (("; Tf =", "; Kt ="), "must have no entry 'Kt'"),
        (
            ('; Tf = "2 ms"', ""),
            "pid.toml must have Kd and Tf, the time constant of its filter, or none of them, got K",
        ),
        (('Kd = "3 Ns/m"; ', ""), r"got Tf alone. A low_pass in \[\[filters\]\] filters the whole"),
        (("2 ms", "0 ms"), "Tf must be positive, got 0"),
        (
            ('"800 N/m"', '"0,8"'),
            "Kp must be a number with its unit, of u over y, such as \"800 N/m\", got '0,8'",
        ),
        (("800 N/m", "1 800 N/m"), "Kp must be a number with its unit"),
        (
            ("N/(mm s)", "N/mm"),
            "Ki must be a number with its unit, N/m/s, as Kp has N/m, got '5 N/mm'",
        ),
        (('"3 Ns/m"', "3"), "Kd must be a number with its unit, N/m s, as Kp has N/m, got 3"),
        (
            ('"800 N/m"', "800"),
            r"Ki must be a number with its unit, 1/s, as Kp has no unit, got '5 N/\(mm s\)'",
        ),
        (
            ('"800 N/m"', "true"),
            'Kp must be a number with its unit, of u over y, such as "800 N/m", got True',
        ),
        (("800 N", "1e999 N"), "Kp must be a number with its unit"),
        (("0.5 ms", "-1 ms"), "delay must be zero or positive, got -0.001"),
        (
            ('"1 ms"', '"1 kHz"'),
            'sample_time must be a number with its unit, such as "1 s" or "1 ms"',
        ),
        (
            ("Kp =", 'kv = "3 1/s"; Kp ='),
            "got the gains of a drive; go on with: robust servo check TRACE",
        ),
        (("Kp =", "Kp = ="), "path must be a TOML file with a PID, got 'pid.toml'"),
        (("Kp =", "filters = 3; Kp ="), r"filters must be tables \[\[filters\]\], got 3"),
        (
            ("2 ms", '2 ms"; [[filters]]; notch = "500 Hz"; bandwidth = "9 Hz'),
            "notch must lie below half the sampling ",
        ),
        (
            ("2 ms", '2 ms"; [[filters]]; notch = "50 Hz'),
            "filters must have an entry bandwidth with notch, got none",
        ),
    ],
)
def test_what_is_not_well_written_is_one_line(tmp_path, change, message):
    assert change[0] in PID
    with pytest.raises(ValueError, match=message) as refusal:
        load_pid(written(tmp_path, PID.replace(*change, 1)))
    assert "\n" not in str(refusal.value)


def test_a_derivative_that_rings_is_warned_of(tmp_path):
    with pytest.warns(robust.DesignWarning, match=r"Tf = 0.4 ms is below half a sample of 1 ms"):
        load_pid(written(tmp_path, PID.replace("2 ms", "0.4 ms")))


def test_units_are_products_of_powers():
    same = [
        "Nms/rad",
        "N m s/rad",
        "N·m·s/rad",
        "Nm/(rad/s)",
        "1/(rad/(Nm s))",
        "s/rad Nm",
        "kN mm s/rad",
        "1e0 N",
    ]
    for unit in same[:-1]:
        assert split_unit(unit) == (1.0, {"N": 1, "m": 1, "s": 1, "rad": -1}), unit
    assert unit_factor("N/mm", "N/m") == pytest.approx(1000)
    assert unit_factor("um/A", "m/mA") == pytest.approx(1e-9)
    assert unit_factor("kgm²/s²", "kg mm^2/ms^2") == pytest.approx(1.0)
    assert np.isnan(unit_factor("N/m", "N/m^2"))
    for unit in (
        "",
        "(",
        "))((",
        "/",
        "//",
        "^",
        "m^",
        "1/",
        "%",
        "µ",
        "a^-2 b",
    ):  # of a file: whatever it says
        split_unit(unit)
    assert not units_differ("rad/Nm", "rad/(N m)")
    assert units_differ("mm/N", "m/N")


def test_the_file_of_the_page_is_the_controller_of_its_script(tmp_path):
    page = (Path(__file__).parents[3] / "docs" / "howto" / "check_pid.md").read_text(
        encoding="utf-8"
    )
    (text,) = re.findall(r"```toml\n(.*?)```", page, re.DOTALL)
    (tmp_path / "pid.toml").write_text(text)
    found = load_pid(tmp_path / "pid.toml")
    K = robust.shaping.pid(20e3, 300e3, 60.0, filter_time=1e-3, dt=1e-3)
    K = K * robust.shaping.notch(2 * np.pi * 58.5, depth=0.3, width=20.0 / 58.5, dt=1e-3)
    assert np.allclose(found.K(Z), K(Z), rtol=1e-9)
    assert found.delay == pytest.approx(5e-4)


@pytest.fixture
def command(monkeypatch, capsys, tmp_path):
    """Run the command in a folder with a model in m/N; gives exit code, standard output, standard
    error.
    """
    monkeypatch.chdir(tmp_path)
    G, w = control.tf([1e-3], [0.01, 1]), control.tf([0.3], [1])
    omega, origin = np.array([1.0, 50.0]), Origin(unit="m/N")
    save(
        UncertaintyModel(G, w, "multiplicative", omega, np.array([0.2, 0.3]), origin=origin),
        "model.json",
    )

    def run(line):
        monkeypatch.setattr(sys, "argv", ["robust", *line.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        printed = capsys.readouterr()
        return stop.value.code or 0, printed.out, printed.err

    return run


def test_the_commands_take_it(command, tmp_path):
    written(tmp_path, PID + '; [[filters]]; notch = "60 Hz"; bandwidth = "20 Hz"; depth = 0.1')
    code, out, err = command("check model.json pid.toml -o report.txt")
    assert (code, err) == (0, "")
    assert (
        "PID parallel, Kp + Ki/s + Kd s/(Tf s + 1): Kp = 800 N/m, Ki = 5000 N/m/s, Kd = 3 N/m s, Tf"
        " = 0.002 s" in out
    )
    assert "PID behind it: notch at 60 Hz" in out
    assert "a delay of 0.0005 s in the plant" in unwrapped(out)
    certificate = tmp_path / "report.certificate.json"
    assert verify_certificate(certificate, K=load("pid.toml")).verified
    assert command(f"verify {certificate.name} --controller pid.toml --model model.json")[0] == 0
    # the same controller as a file of the package
    save(load("pid.toml"), "pid.json", delay=5e-4, unit="m/N")
    by_name = {name: command(f"check model.json {name}")[1] for name in ("pid.toml", "pid.json")}
    assert by_name["pid.toml"].partition("\nPID")[0] == by_name["pid.json"].rstrip()
    assert command("export pid.toml -o K.csv")[0] == command("export pid.toml -o K.mat")[0] == 0
    code, out, err = command("export pid.toml -o K.h")
    assert (code, err) == (0, "")
    assert "static inline" in (tmp_path / "K.h").read_text()
    assert command("shape model.json --controller pid.toml --sample-time 1e-3 -o page.html")[0] == 0
    assert "K = robust.load(" in (tmp_path / "page.html").read_text()


def test_reduce_writes_the_controller_and_what_is_kept(command, tmp_path):
    """An integrator and two fast lags: the lags go; nothing of a PI does; a gain for it loses the
    loop.
    """
    slow = (
        control.tf([800.0, 5000.0], [1, 0])
        * control.tf([1], [1e-4, 1])
        * control.tf([1], [5e-5, 1])
    )
    save(robust.lti.discretize(slow, 1e-3), "K.json", delay=5e-4, unit="m/N")
    code, out, err = command("reduce model.json K.json -o small.json")
    assert (code, err) == (0, "")
    assert re.search(
        r"^order 3 to 1, .*: all proofs are kept\nbefore: +statistically robust, max rs"
        r" 0\.\d+, \|S",
        out,
    )
    assert out.endswith("wrote small.json\n")
    checked = command("check model.json small.json")[
        1
    ]  # of the delay that the file was written with
    assert "STATISTICALLY ROBUST" in checked
    assert "a delay of 0.0005 s" in unwrapped(checked)
    written(tmp_path, 'sample_time = "1 ms"; delay = "0.5 ms"; Kp = "800 N/m"; Ki = "5 N/(mm s)"')
    assert "order 1, not reduced (" in command("reduce model.json pid.toml -o same.json")[1]
    assert np.allclose(load("same.json")(Z), load("pid.toml")(Z), rtol=1e-12)
    code, out, _ = command(
        "reduce model.json pid.toml --order 0 --bandwidth 1 --error 0.01 -o gain.json"
    )
    assert code == 1
    assert "order 1 to 0" in out
    assert "not all proofs are kept: " in out
    assert load("gain.json").nstates == 0
    assert (
        "order must be below the 1 states of K, got 1"
        in command("reduce model.json pid.toml --order 1 -o x.json")[2]
    )


def test_units_and_delay_that_the_file_leaves_open_are_named(command, tmp_path):
    written(tmp_path, PID.replace("800 N/m", "0.8 N/mm"))
    code, _, err = command("check model.json pid.toml")
    assert code == 2
    assert (
        "for a plant in m/N, the unit of the model, got pid.toml for mm/N: Kp must be in N/m" in err
    )
    written(tmp_path, 'sample_time = "1 ms"; Kp = 800; Ki = 5000.0')
    code, out, err = command("check model.json pid.toml")
    assert code == 0
    assert "pid.toml has no unit for Kp: N/m is assumed, because the model is in m/N" in err
    assert "pid.toml has no computation delay: zero is assumed" in err
    assert "PID parallel, Kp + Ki/s: Kp = 800 N/m" in out
