"""The command `robust servo check`: traces and gains in, one page out, held against the axis behind
the traces.
"""

import html
import io
import json
import re
import sys
import warnings
from contextlib import redirect_stdout
from dataclasses import replace
from types import SimpleNamespace

import control
import numpy as np
import pytest

import nlfrf
import robust
from nlfrf.rig import Drive
from robust import cli
from robust.servo import cascade, load_gains, read_experiments, read_traces, write_page
from robust.servo import check as check_drive
from robust.servo.checking.friction import force_over_position
from robust.servo.checking.rest import bound_and_simulate
from robust.servo.gains.p_pi import with_set_point
from tests.support.linear_axis import frictionless, linear_plant, settings_of

pytestmark = pytest.mark.usefixtures("friction_read_once")

LINEAR = """
fs = "4 kHz"
kv = "100 1/s"
kp = "143 A/(m/s)"
tn = "10 ms"
torque_constant = "52.8 N/A"
lag = "0.3 ms"
delay = "0.25 ms"
"""
ROTARY = """
fs = "4 kHz"
kv = "15 1/s"
kp = "16 A/(rad/s)"
tn = "50 ms"
torque_constant = "12 Nm/A"
lag = "0.5 ms"
delay = "0.25 ms"
"""


#: Experiments at rest from sticking to sliding, and their force [N rms].
LEVELS = {"sticks": 0.3, "bends": 4.0, "slides": 60.0}
AT_REST = [f"{name}-trace.csv" for name in LEVELS]


def trace(axis, rms, *, base_velocity=0.0, f_min=5, f_max=400, n_samples=4000):
    ms = nlfrf.multisine(fs=4000, n_samples=n_samples, f_min=f_min, f_max=f_max, rms=rms, rng=1)
    record = nlfrf.rig.simulate_servo(axis, ms, n_periods=3, base_velocity=base_velocity)
    if axis.resolution:
        return record
    noise = 1e-3 * np.std(record.y) * np.random.default_rng(0).standard_normal(record.y.shape)
    return replace(record, y=record.y + noise)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Traces of a linear motor under a soft drive, at rest and in motion, and of a rotary axis;
    gains of both.
    """
    folder = tmp_path_factory.mktemp("traces")
    axis = nlfrf.servo_axis("linear motor")
    axis = replace(axis, drive=replace(axis.drive, kv=20, kp=40, tn=0.05))
    for name, rms, velocity in (
        ("low", 0.7, 0),
        ("mid", 2.0, 0),
        ("slide", 60.0, 0),
        ("moving", 60.0, 0.1),
    ):
        nlfrf.save(trace(axis, rms, base_velocity=velocity), folder / f"{name}.npz")
    joint = frictionless("joint", kv=2.0, kp=4.0, tn=0.5)
    nlfrf.save(trace(joint, 5.0, f_min=3, f_max=200, n_samples=8000), folder / "joint.npz")
    (folder / "gains.toml").write_text(LINEAR)
    (folder / "joint.toml").write_text(ROTARY)
    return folder


@pytest.fixture(scope="module")
def played(folder):
    """Experiments on the linear motor under the gains that are checked: at rest, in motion, in
    motion in a low band.
    """
    axis = nlfrf.servo_axis("linear motor")
    band = {"fs": 4000, "n_samples": 4000, "f_min": 5, "rng": 1}
    for name, f_max, more in (
        ("rest", 400, {"rms": 5}),
        ("motion", 400, {"rms": 60, "base_velocity": 0.2, "strokes": 1}),
        ("narrow", 60, {"rms": 30, "base_velocity": 0.2}),
        *((name, 100, {"rms": rms, "n_periods": 3}) for name, rms in LEVELS.items()),
    ):
        ms = nlfrf.multisine(f_max=f_max, **band)
        nlfrf.save(
            robust.servo.design_experiment(axis, ms, n_discard=1, **more), folder / f"{name}.csv"
        )
        robust.servo.play_experiment(axis, folder / f"{name}.csv", folder / f"{name}-trace.csv")
    return folder


@pytest.fixture(scope="module")
def motions(played):
    """Conditions of a trace at rest and of one in motion, of which nothing else is told."""
    settings = load_gains(played / "gains.toml")
    (unknown,) = read_traces([played / "moving.npz"], settings)[2]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.io.LevelWarning)  # friction changes the force
        designed = [
            read_experiments(
                [played / f"{name}-trace.csv"], [nlfrf.load(played / f"{name}.npz")], settings
            )[2][0]
            for name in ("rest", "motion")
        ]
    return [unknown._replace(motion=one.motion) for one in designed]


@pytest.fixture(scope="module")
def told(folder, motions):
    """The check of three traces at rest and one in motion, of which it is told which is which."""
    with warnings.catch_warnings():
        warnings.filterwarnings(
            "ignore", "G differs from its neighbours"
        )  # where it sticks, a narrow resonance
        return check_drive(*four_traces(folder), conditions=three_at_rest(motions))


@pytest.fixture(scope="module")
def experiments_at_rest(played):
    """Records of the experiments at rest, as of a trace of which nothing is told, and the gains."""
    settings = load_gains(played / "gains.toml")
    designs = [nlfrf.load(played / f"{name}.npz") for name in LEVELS]
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", nlfrf.io.LevelWarning)  # friction changes the force
        records, _, _ = read_experiments([played / name for name in AT_REST], designs, settings)
    return records, settings


@pytest.fixture(scope="module")
def at_rest(experiments_at_rest, friction_read_once):
    """The check of three traces at rest."""
    records, settings = experiments_at_rest
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")
        return check_drive(records, settings)


def three_at_rest(motions):
    """Conditions of `four_traces`."""
    at_rest, moving = motions
    return [at_rest, at_rest, at_rest, moving]


def four_traces(folder):
    """Three traces at rest and one in motion, and the gains."""
    settings = load_gains(folder / "gains.toml")
    return [
        read_one(folder / f"{name}.npz", settings) for name in ("low", "mid", "slide", "moving")
    ], settings


def read_one(path, settings):
    """A trace in the units of the drive."""
    return read_traces([path], settings)[0][0]


def motor_behind_lag(lag):
    """12 kg with 20 Ns/m behind a current loop; friction acts on the mass without lag."""
    A = [[0, 1, 0], [0, -20 / 12, 1 / 12], [0, 0, -1 / lag]]
    B, C = [[0, 0], [0, 1 / 12], [1 / lag, 0]], [[1, 0, 0], [1, 0, 0]]
    return robust.friction_plant(control.ss(A, B, C, np.zeros((2, 2))), port=True)


@pytest.fixture
def run(folder, monkeypatch, capsys):
    def command(words):
        monkeypatch.chdir(folder)
        monkeypatch.setattr(sys, "argv", ["robust", "servo", "check", *words.split()])
        with pytest.raises(SystemExit) as stop:
            cli.main()
        printed = capsys.readouterr()
        if printed.out.startswith("Gains\n"):  # what was asked comes first, in one short sentence
            first, _, answers = one_line(printed.out).removeprefix("Gains ").partition(". rests: ")
            assert len(first.split()) <= 20, first
            assert " within: " in answers.partition(" Drive and traces ")[0]
        return stop.value.code or 0, printed.out, printed.err

    return command


@pytest.mark.usefixtures("played")
def test_the_first_line_passes_nothing_that_was_not_judged(run, folder):
    """The exit code says it too:

    3 where no friction was judged, without traces at rest or with too few of them.
    """
    (folder / "low.toml").write_text(LINEAR.replace("143", "100"))
    for traces, designs in (("motion", "motion"), ("sticks bends motion", "sticks bends motion")):
        files = " ".join(f"{name}-trace.csv" for name in traces.split())
        code, page, _ = run(
            f"{files} gains.toml " + " ".join(f"--design {name}.npz" for name in designs.split())
        )
        assert code == 3, page
        assert page.startswith(
            "Gains\nlinear loop passed; friction not judged: the axis may hunt with these gains."
        )
        assert "PASSED" not in page.replace("STATISTICALLY ROBUST", "")
    code, page, _ = run("motion-trace.csv low.toml --design motion.npz --peak 1.1")
    assert code == 1
    assert one_line(page).startswith(
        "Gains NOT PASSED, linear loop: thin margins. rests: not known: "
    )
    assert (
        "change: the linear loop first: see the warnings because: The verdict of the linear loop"
        " below only means" in one_line(page)
    )


@pytest.mark.usefixtures("played")
def test_a_stated_force_bounds_the_error_without_traces_at_rest(run, folder):
    """As prove_friction has it for the machine behind the trace, of which the linear model is known
    to 0.1 %.
    """
    code, page, _ = run("motion-trace.csv gains.toml --design motion.npz --force 26")
    page = one_line(page)
    found = re.search(
        r"friction bounded, rest unproved: the axis stays within .* um, proved, and .* "
        r"within: at most (\S+) um off, at rest or hunting: proved for the nominal model, "
        r"friction up to 26 N hunts: not known",
        page,
    )
    assert code == 3, page
    settings = load_gains(folder / "gains.toml")
    plant = motor_behind_lag(settings.lag)
    true = robust.prove_friction(
        plant,
        cascade(settings, output_unit="N"),
        robust.friction.Bounded(26.0),
        delay=settings.delay,
    )
    assert 1e-6 * float(found[1]) == pytest.approx(true.error_bound, rel=0.02)
    assert re.search(
        r"Eventually stays within \S+ m of rest with every friction of at most 26 N", page
    )
    assert "proved: Stays" not in page  # whether it comes to rest is not judged
    code, _, refused = run("motion-trace.csv gains.toml --design motion.npz --force 0")
    assert (code, "--force must be positive" in refused) == (2, True)
    code, page, _ = run("rest-trace.csv gains.toml --design rest.npz --force 26")
    assert (code, "No bound with the given force: there is no linear model" in one_line(page)) == (
        1,
        True,
    )


def test_a_stated_force_has_no_meaning_for_a_loop_in_amperes(folder):
    settings = replace(load_gains(folder / "gains.toml"), torque_constant=np.nan)
    record = nlfrf.load_record(folder / "moving.npz")
    record = replace(record, u=record.u / 52.8, input_units=("A",))
    assert check_drive([record], settings).linear_passed
    with pytest.raises(
        ValueError,
        match="Fs must be left out where traces and gains are in A and no torque_constant",
    ):
        check_drive([record], settings, Fs=26.0)


@pytest.fixture(scope="module")
def short(folder, played, friction_read_once):
    """The gains at 4 ms of tn, not proved at rest: exit code, what was printed, the page, and the
    check itself.
    """
    (folder / "short.toml").write_text(LINEAR.replace('"10 ms"', '"4 ms"').replace("143", "200"))
    designs = " ".join(f"--design {name}.npz" for name in [*LEVELS, "motion"])
    words = (
        f"{' '.join(AT_REST)} motion-trace.csv short.toml {designs} --stiction 4 --within 1 -o"
        " page.html"
    )
    printed, found = io.StringIO(), []

    def kept(*given, **asked):
        found.append(check_drive(*given, **asked))
        return found[-1]

    with pytest.MonkeyPatch.context() as patch, redirect_stdout(printed):
        patch.chdir(folder)
        patch.setattr(sys, "argv", ["robust", "servo", "check", *words.split()])
        patch.setattr("robust.servo.checking.judge.check", kept)
        with pytest.raises(SystemExit) as stop:
            cli.main()
    return (
        stop.value.code,
        printed.getvalue(),
        (folder / "page.html").read_text(encoding="utf-8"),
        found[0],
    )


def test_an_axis_that_settles_may_move_for_ever(short):
    """The gains at less than half of tn: not proved at rest, and the first line says how far the
    axis may move.
    """
    found = short[3]
    wide = replace(found.report, peak=3.0)  # as --peak 3 has it: its margins are not thin then
    others = tuple(doubt for doubt in found.doubts if doubt.kind.name != "THIN_MARGINS")
    assert (len(found.doubts) - len(others), wide.thin_margins) == (1, "")
    found = replace(found, report=wide, doubts=others)
    page = one_line(str(found))
    first = re.search(
        r"^Gains NOT PASSED, friction: rest is not proved; the axis comes to rest in simulation,"
        r" which is no proof\. "
        r"rests: yes in all 12 simulated runs; not proved within: at most (\S+ um) off, at rest or"
        r" hunting: proved for "
        r"friction up to \S+ N\. Within 1 m: yes hunts: not seen in simulation change: to prove"
        r" more: ",
        page,
    )
    assert (found.verdict, bool(first)) == ("not passed", True), page
    assert "It may keep moving within this distance." in page
    assert re.search(r"while the compensation acts: settles, may move within \S+ m for ever", page)


def test_the_page_in_html_shows_what_was_found_in_pictures(short):
    """Text, HTML and JSON show the same facts, each picture is inside the file, and it asks nobody
    for anything.
    """
    code, printed, page, found = short
    assert (code, page.count("<figure>")) == (1, 8)
    assert page.count('src="data:image/svg+xml') == 8
    assert "http" not in page.replace("http-equiv", "")
    assert 'banner not-robust"><strong>Not passed</strong>' in page
    said = one_line(html.unescape(page))
    printed = one_line(printed)
    told = found.to_values()["facts"]
    assert list(told) == ["gains", "traces", "friction", "force", "loop", "step", "words"]
    for section in found.sections:
        assert [one["name"] for one in told[section.name]] == [fact.name for fact in section.facts]
        texts = [
            text
            for fact in section.facts
            if fact.amount
            for text in (fact.name, fact.amount, fact.meaning)
        ]
        cells = [cell for row in section.table for cell in row]
        for text in (section.title, section.lead, *texts, *cells):
            assert one_line(text) in said
            assert one_line(text) in printed
    largest = next(one for one in told["loop"] if one["name"] == "max |S|")
    assert largest["value"]["value"] == found.report.margins.S_worst
    assert "thin margins: |S| reaches" in said
    with pytest.raises(ValueError, match=r"path must end in .html, got 'page.pdf'"):
        write_page("page.pdf", None, [])


@pytest.mark.usefixtures("played")
def test_the_page_of_a_trace_in_motion_says_that_friction_was_not_judged(run, folder):
    assert run("motion-trace.csv gains.toml --design motion.npz -o moving.html")[0] == 3
    page = (folder / "moving.html").read_text(encoding="utf-8")
    assert 'banner "><strong>Linear loop passed; friction not judged</strong>' in page
    assert page.count("<figure>") == 5  # FRF, three of the loop, step


def moved(unknown, force, settings, *, stable=True, machine=None, Fs=None):
    """An unknown friction of a drive with its bound; without a machine the linear model judges
    nothing.
    """
    loop = SimpleNamespace(stable=stable, machine=machine, model=None, report=None, unit="N")
    return bound_and_simulate(
        replace(unknown, force=force, note="", unsimulated=""),
        loop,
        settings,
        frozenset(),
        misled=machine is None,
        Fs=Fs,
        masses=2,  # which were not separated, so that nothing is simulated
        advance=lambda: None,
    )


def test_a_pole_that_ends_at_once_does_not_hide_the_bound(moving):
    """A fit of a trace in motion had a pole at -9e6 rad/s next to a zero, at 4 kHz: no bound could
    follow it.
    """
    rigid, s = control.tf([1 / 12], [1, 20 / 12, 0]), control.tf("s")
    settings = settings_of(nlfrf.servo_axis("linear motor"))
    read = SimpleNamespace(mass=12.0, damping=20.0, load_mass=0.0, delay=0.0, units=("N", "m"))
    force = SimpleNamespace(sliding=read, load=None, bristle_time=np.nan, Fs=np.full(2, np.nan))

    def bound(machine, force):
        return moved(moving[2].friction, force, settings, machine=machine, Fs=26.0).within

    fitted = control.ss(rigid * (s + 9.1e6) / (s + 9e6))
    assert np.isinf(bound(fitted, None))
    plant = motor_behind_lag(settings.lag)
    proof = robust.prove_friction(
        plant,
        cascade(settings, output_unit="N"),
        robust.friction.Bounded(26.0),
        delay=settings.delay,
    )
    assert bound(fitted, force) == pytest.approx(proof.error_bound, rel=1e-9)
    assert bound(control.ss(rigid), None) == pytest.approx(
        proof.error_bound, rel=1e-5
    )  # in other states


@pytest.mark.parametrize("hold", ["band-limited", "zoh"])
def test_the_friction_force_over_position_is_what_mass_and_damping_leave(hold):
    """A spring to ground of 3e5 N/m and a mass: what is left of the command is the spring, whatever
    the delay.
    """
    m, c, k, delay, n, fs = 12.0, 20.0, 3e5, 5e-4, 2000, 4000.0
    ms = nlfrf.multisine(fs=fs, n_samples=n, f_min=4, f_max=200, rms=1e-6, rng=1)
    omega = 2 * np.pi * ms.f0 * np.arange(n // 2 + 1)
    s = 1j * omega
    U = np.fft.rfft(ms.u[0]) * (m * s**2 + c * s + k) * np.exp(s * delay)
    if hold == "zoh":  # which multiplies every line by its own response
        U = U / (np.sinc(omega / fs / 2 / np.pi) * np.exp(-0.5j * omega / fs))
    record = nlfrf.Record(
        u=np.fft.irfft(U)[None, None], y=ms.u[None], fs=fs, lines=ms.lines, hold=hold
    )
    machine = SimpleNamespace(mass=m, damping=c, delay=delay, load_mass=0.0)
    x, force = force_over_position(record, machine)
    # both pass one filter, which falls to a half at its edge, above all lines
    last = record.lines.excited[-1]
    share = np.abs(np.fft.rfft(x)[last] / np.fft.rfft(ms.u[0])[last])
    edge = np.pi / 4 * omega[last] / np.arccos(np.sqrt(share))
    assert edge >= omega[last]
    gain = np.cos(np.pi / 4 * np.minimum(omega / edge, 2.0)) ** 2
    assert np.allclose(x, np.fft.irfft(gain * np.fft.rfft(ms.u[0])), atol=1e-9 * np.ptp(x))
    assert np.allclose(force, k * x, atol=1e-6 * np.ptp(force))


def test_a_check_counts_its_steps(folder):
    seen = []
    record = nlfrf.load_record(folder / "moving.npz")
    check_drive(
        [record], load_gains(folder / "gains.toml"), progress=lambda *step: seen.append(step)
    )
    assert seen == [(done, 6) for done in range(7)]


@pytest.mark.usefixtures("played")
def test_a_warning_of_a_trace_stands_on_the_page_and_counts(run, folder):
    table = (folder / "motion-trace.csv").read_text().splitlines()
    force = table[0].split(",").index("force set point [N]")
    rows = [row.split(",") for row in table[1:]]
    limit = 0.5 * max(float(row[force]) for row in rows)
    for row in rows:
        row[force] = f"{min(max(float(row[force]), -limit), limit):.9g}"
    (folder / "clipped.csv").write_text("\n".join([table[0], *map(",".join, rows)]) + "\n")
    code, page, warned = run("clipped.csv gains.toml --design motion.npz --peak 10")
    assert code == 1
    assert re.search(r"warning: +clipped.csv: u seems clipped: \d", one_line(page))
    assert "u seems clipped" in warned
    assert run("motion-trace.csv gains.toml --design motion.npz")[0] == 3


@pytest.mark.usefixtures("played")
def test_levels_give_every_verdict_on_one_page(run, folder):
    designs = " ".join(f"--design {name}.npz" for name in [*LEVELS, "motion"])
    code, page, _ = run(f"{' '.join(AT_REST)} motion-trace.csv gains.toml {designs} -o page.txt")
    assert code == 0, page
    assert "kp = 143 A/(m/s), tn = 10 ms" in page
    assert "The set of plants around motion-trace.csv" in page
    assert page.startswith(
        "Gains\nPASSED, linear loop and friction: the axis may run with these gains.\n"
    )
    assert "STATISTICALLY ROBUST" in page
    assert re.search(r"max \|S\|: +1\.[5-9]\d* at \d+", page)
    proved = one_line(page)
    assert "proved: Comes to rest from every state with every Maxwell-slip friction" in proved
    assert "behind a current loop of 0.3 ms, sampled at 4 kHz with 0.25 ms of delay" in proved
    assert re.search(
        r"Response of the nominal linear loop, without limits .*\. goes to: 1 10 to 90 % in: ",
        proved,
    )
    row = re.compile(r"^(\w[^\[\n]*?)(?: \[[^]]+\])? +(\S+) \+- (\S+) +(.+?)  ", re.M)
    read = {
        name: (float(value), float(half), assumed)
        for name, value, half, assumed in row.findall(page)
    }
    axis = {
        "mass m": 12.0,
        "viscous friction c": 20.0,
        "presliding stiffness K0": 2000.0,
        "break-away force Fs": 20.0,
    }
    for name, true in axis.items():
        value, half, _ = read[name]
        assert abs(value - true) < 2 * half < 0.2 * true, (
            name
        )  # twice the half-width: 4 standard deviations
    K0, _, largest = read["presliding stiffness K0"]
    assert float(largest.removeprefix("up to ")) == pytest.approx(1.25 * K0, rel=2e-3)
    assert read["stiction over Coulomb friction"][2] == "up to 1.5"
    assert (
        "It rests at the set point, by the integral part. The proof was repeated at both ends of"
        " mass" in proved
    )
    added = float(re.search(r"and with (\S+) ms of additional delay", proved)[1])
    margin = float(re.search(r"the nominal loop tolerates (\S+) ms of additional delay", proved)[1])
    assert 0 < added < margin  # the class has the linear loop in it, without friction
    assert page.replace("wrote page.txt\n", "").strip() in (folder / "page.txt").read_text()


def test_gains_that_are_too_high_are_not_safe(run, folder):
    (folder / "hot.toml").write_text(LINEAR.replace("143", "600"))
    code, page, _ = run("moving.npz hot.toml")
    assert code == 1
    assert "NOT ROBUST" in page
    assert "max |S|" not in page


def test_an_approximation_is_no_proof(run, folder):
    (folder / "slow.toml").write_text(LINEAR + "position_every = 4\n")
    code, page, warning = run("moving.npz slow.toml")
    assert (code, "STATISTICALLY ROBUST" in page) == (1, True)
    assert "nothing is proved of the drive itself" in page
    assert warning.startswith("robust: warning: the position loop runs once in 4 periods")


def test_the_result_as_json(run):
    code, out, _ = run("moving.npz gains.toml --json")
    found = json.loads(out)
    assert list(found)[:4] == [
        "verdict",
        "answers",
        "linear",
        "friction",
    ]  # what is asked of an axis comes first
    assert list(found["answers"]) == ["rests", "within", "hunts"]
    assert list(found["friction"])[:4] == ["outcome", "within", "reason", "simulated"]
    assert (code, found["unit"], found["proved"]) == (3, "N", False)
    assert (found["linear_passed"], found["safe"]) == (True, False)
    assert found["conclusion"].startswith(
        "linear loop passed; friction not judged: the axis may hunt with these gains"
    )
    assert found["report"]["nominally_stable"] is True
    assert "three levels" in found["friction"]["note"]


def test_no_metre_is_said_of_a_radian(run):
    code, page, _ = run("joint.npz joint.toml")
    assert code == 3, page
    assert "rad/Nm" in page
    assert re.search(r"^goes to: +1$", page, re.M)
    assert re.search(r"\d Nm\b", page)
    assert not re.search(r"\bm/N\b|\bN/m\b|\bkN\b|\bkg\b|\d m\b|\bm rms|\d N\b", page)


@pytest.mark.filterwarnings(
    "ignore:G differs from its neighbours"
)  # where it sticks, a narrow resonance
def test_no_metre_is_said_of_a_radian_in_a_proof(experiments_at_rest, at_rest):
    linear, settings = experiments_at_rest
    turned = [replace(one, input_units=("Nm",), output_units=("rad",)) for one in linear]
    fit = replace(
        at_rest.friction.fit, units=("Nm", "rad")
    )  # the numbers are those of the same traces
    found = check_drive(
        turned, replace(settings, kp_unit="A/(rad/s)", position_unit="", load_unit=""), fit=fit
    )
    assert found.friction.proved
    assert "kNm/rad" in str(found)
    assert not re.search(
        r"\bm/N\b|\bN/m\b|\bkN/m\b|\bkg\b(?! m\^2)|\d m\b|\bm rms|\d N\b", str(found)
    )


def exact_margins(axis, settings):
    """Crossover [Hz] and phase margin [deg] of the true linear loop."""
    G = robust.sampled(linear_plant(axis), settings.dt, settings.delay)
    w = 2 * np.pi * np.geomspace(1, 1000, 20001)
    L = (control.series(cascade(settings, output_unit="N"), G))(np.exp(1j * w * settings.dt))
    k = np.flatnonzero((np.abs(L[1:]) < 1) & (np.abs(L[:-1]) >= 1))[-1]
    return w[k] / 2 / np.pi, 180 - abs(np.degrees(np.angle(L[k])))


def least_stiffness(axis, settings):
    """Least |1 + G K| / |G| of the true linear loop, and its frequency [rad/s]."""
    G, K = (
        robust.sampled(linear_plant(axis), settings.dt, settings.delay),
        cascade(settings, output_unit="N"),
    )
    w = 2 * np.pi * np.geomspace(1, 1900, 20001)
    plant, controller = (one(np.exp(1j * w * settings.dt)) for one in (G, K))
    stiffness = np.abs(1 / plant + controller)
    k = np.argmin(stiffness)
    return stiffness[k], w[k]


@pytest.mark.parametrize("actual", [False, True])
def test_margins_and_step_are_those_of_the_axis(actual):
    axis = frictionless("linear motor")
    settings = settings_of(axis)
    record = trace(frictionless("linear motor", kv=20, kp=40, tn=0.05), 5.0)
    if (
        actual
    ):  # what the current loop makes of its set point, by an exact lag behind a delay of one period
        lag = robust.sampled(control.tf([1], [axis.drive.lag, 1]), settings.dt, settings.delay)
        z = np.exp(2j * np.pi * np.arange(2001) / 4000)
        current = np.fft.irfft(np.fft.rfft(record.u) * lag(z) * np.exp(0j), 4000)
        record = replace(record, u=current, hold="band-limited")
    found = check_drive([record], settings, actual=actual)
    crossover, phase = exact_margins(axis, settings)
    margins = found.report.classical
    # the samples of the current have no hold: half a period, 4.5 deg at 50 Hz
    late = 1.5 if actual else 0.05
    assert margins.crossover / 2 / np.pi == pytest.approx(crossover, rel=0.01)
    assert np.degrees(margins.phase_margin) == pytest.approx(phase, abs=2 * late)
    assert (found.linear_passed, found.unit) == (True, "N")
    stiffness, omega = least_stiffness(axis, settings)
    assert found.stiffness == pytest.approx((stiffness, omega), rel=0.02)
    assert ("assumed: delay 0.25 ms and lag 0.3 ms" in str(found)) is actual
    r = np.full(1200, 1e-3)
    r[0] = 0.0
    moved = nlfrf.rig.run(axis, r).position[1:] / 1e-3
    if not actual:
        assert found.step.y == pytest.approx(moved[: found.step.y.size], abs=2e-3)
        assert found.step.y.size > 100


def test_units_of_a_trace_are_taken_to_those_of_the_drive(folder):
    settings = load_gains(folder / "gains.toml")
    record = nlfrf.load_record(folder / "moving.npz")
    named = replace(
        record, u=record.u / 52.8, y=record.y * 1e3, input_units=("A",), output_units=("mm",)
    )
    nlfrf.save(named, folder / "amperes.npz")
    one, other = (read_one(folder / name, settings) for name in ("moving.npz", "amperes.npz"))
    assert np.allclose(one.u, other.u, rtol=1e-12)
    assert np.allclose(one.y, other.y, rtol=1e-12)
    assert (other.u_unit, other.y_unit, other.hold) == ("N", "m", "zoh")
    bare = replace(settings, torque_constant=np.nan)
    assert read_one(folder / "amperes.npz", bare).u_unit == "A"
    with pytest.raises(
        ValueError, match=r"torque_constant must be given \[N/A\] between a gain in A/\(m/s\)"
    ):
        read_one(folder / "moving.npz", replace(bare, kp_unit="A/(m/s)")) and check_drive(
            [read_one(folder / "moving.npz", bare)], bare
        )


@pytest.mark.parametrize(
    ("words", "message"),
    [
        ("moving.npz", "file must be traces and one GAINS.toml, got moving.npz"),
        ("gains.toml", "file must be traces and one GAINS.toml"),
        ("moving.npz gains.toml joint.toml", "file must be traces and one GAINS.toml"),
        (
            "joint.npz gains.toml",
            "trace must have the position in m or a multiple of m, got joint.npz in rad",
        ),
        ("moving.npz none.toml", "none.toml could not be opened"),
        ("moving.npz gains.toml --input w", "--input must name a signal of 'moving.npz'"),
        (
            "rest-trace.csv gains.toml",
            "--design must be given for rest-trace.csv, which looks like the trace of a",
        ),
        (
            "rest-trace.csv gains.toml --input w",
            "--input must name a signal of 'rest-trace.csv', one of current [A]",
        ),
        (
            "motion-trace.csv gains.toml --design rest.npz",
            "got a base velocity of 0 m/s and a position that moves by",
        ),
        (
            "rest-trace.csv gains.toml --design motion.npz",
            "got a base velocity of 0.2 m/s and a position that moves",
        ),
        (
            "rest-trace.csv gains.toml --design rest.npz --discard 2",
            "discard must be left out for an experiment",
        ),
        (
            (
                "rest-trace.csv motion-trace.csv narrow-trace.csv gains.toml --design rest.npz"
                " --design motion.npz"
            ),
            (
                "design must be one for all traces, or one for each, got 2 designs with 2"
                " realisations in all for 3 traces"
            ),
        ),
        (
            "moving.npz gains.toml --fs 1000",
            "trace must be sampled as the velocity loop is, at 4000 Hz, got moving.npz at",
        ),
    ],
)
@pytest.mark.usefixtures("played")
def test_mistakes_are_one_line(run, words, message):
    code, out, err = run(words)
    assert code == 2
    assert message in err
    assert err.strip().splitlines()[-1].startswith("robust: ")
    assert not out


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (('"100 1/s"', "100"), 'kv must be a number with its unit, such as "1 1/s"'),
        (('"10 ms"', '"10 Hz"'), "tn must be a number with its unit"),
        (('"143 A/(m/s)"', "143"), "kp must be a number with its unit"),
        (('"143 A/(m/s)"', '"143 V"'), "kp_unit must be current or force over velocity"),
        (("tn =", "Tn ="), "must have no entry 'Tn', did you mean tn"),
        (('kv = "100 1/s"', ""), "must have an entry kv, got none"),
        (("lag = ", "lag = = "), "path must be a TOML file with the gains of a drive"),
        (("fs =", "filters = 3\nfs ="), r"filters must be tables \[\[filters\]\], got 3"),
        (("delay", "encoder"), "encoder must be one of"),
    ],
)
def test_gains_that_are_not_well_written_are_refused(tmp_path, change, message):
    path = tmp_path / "g.toml"
    path.write_text(LINEAR.replace(*change))
    with pytest.raises(ValueError, match=message):
        load_gains(path)


@pytest.mark.parametrize(
    ("slot", "message"),
    [
        ('bandwidth = "2 Hz"', "filters must each have one of notch, low_pass, biquad"),
        ('notch = "80 Hz"', "filters must have an entry bandwidth with notch, got none"),
        (
            'notch = "80 Hz"\nwidth = "2 Hz"',
            "filters must have no entry 'width'.* Known: bandwidth, depth, notch",
        ),
        ('low_pass = "80"', 'low_pass must be a number with its unit, such as "1 Hz" or "1 kHz"'),
    ],
)
def test_filters_that_are_not_well_written_are_refused(tmp_path, slot, message):
    path = tmp_path / "g.toml"
    path.write_text(f"{LINEAR}\n[[filters]]\n{slot}\n")
    with pytest.raises(ValueError, match=message):
        load_gains(path)


def test_a_file_holds_what_the_settings_hold(tmp_path):
    path = tmp_path / "g.toml"
    path.write_text(
        'fs = "8 kHz"\nkv = "2 (m/min)/mm"\nkp = "2.5 Nm/(rad/s)"\ntn = "4 ms"\ntorque_constant ='
        ' "0.9 Nm/A"\nposition_unit = "counts"\nunit_factor = 6e-6\nvelocity_lag = "0.1 ms"\nlimit'
        ' = "12 Nm"\nvelocity_feedforward = "80 %"\ndelay = "187.5 us"\nposition_every ='
        ' 2\n[[filters]]\nlow_pass = "1 kHz"\nzeta = 0.6\n[[filters]]\nbiquad = "80 Hz"\nzeta ='
        ' 0.5\nnumerator_frequency = "47 Hz"\nnumerator_zeta = 0.02\n[[filters]]\nnotch = "400'
        ' Hz"\nbandwidth = "80 Hz"\ndepth = 0.1\n'
    )
    found = load_gains(path)
    assert (found.fs, found.tn, found.delay_periods, found.position_every) == (
        8000.0,
        0.004,
        1.5,
        2,
    )
    assert found.kv == pytest.approx(2000 / 60)
    assert (found.kp, found.kp_unit, found.limit, found.velocity_feedforward) == (
        2.5,
        "Nm/(rad/s)",
        12.0,
        0.8,
    )
    assert [type(slot) for slot in found.filters] == [
        robust.tuning.LowPass,
        robust.tuning.Biquad,
        robust.tuning.Notch,
    ]
    assert np.allclose(
        found.filters[0].section(8000),
        robust.tuning.LowPass(omega=2 * np.pi * 1000, zeta=0.6).section(8000),
    )
    f = np.array([300.0, 400.0, 500.0])
    # in Hz, exact at 400 Hz
    s = 1j * np.tan(np.pi * f / 8000) / np.tan(np.pi * 400 / 8000) * 400
    band = 80.0
    b, a = found.filters[2].section(8000).reshape(2, 3)
    z = np.exp(2j * np.pi * f / 8000)
    expected = (s**2 + 0.1 * band * s + 400**2) / (s**2 + band * s + 400**2)
    assert np.polyval(b, z) / np.polyval(a, z) == pytest.approx(expected, rel=1e-12)


@pytest.fixture(scope="module")
def moving(folder):
    """The trace in motion, its gains, and the check of both."""
    settings = load_gains(folder / "gains.toml")
    record = read_one(folder / "moving.npz", settings)
    return record, settings, check_drive([record], settings)


@pytest.mark.attack(every=4)
@pytest.mark.parametrize("delay", [0.75e-3, 2.25e-3, 7e-3, 10e-3, 25e-3, 0.1, 0.4, 2.0])
def test_a_delay_that_is_too_long_gives_way_to_that_of_the_trace(moving, delay):
    """The trace has 0.25 ms of delay and 0.3 ms of lag; at 2 s a turn from line to line is none."""
    record, settings, right = moving
    long = check_drive([record], replace(settings, delay_periods=4000 * delay))
    assert long.settings.delay + long.settings.lag == pytest.approx(0.55e-3, abs=0.01e-3)
    assert (
        f"as the trace shows them, instead of {1e3 * delay:g} ms and 0.3 ms as given"
        in one_line(str(long))
    )
    assert long.report.verdict is right.report.verdict
    assert long.report.classical.phase_margin == pytest.approx(
        right.report.classical.phase_margin, abs=0.02
    )


def test_a_filter_that_the_gains_do_not_name_is_read_from_the_trace_in_motion(moving, motions):
    """The trace has 0.55 ms of delay and lag, and the gains name 0.25 ms of them."""
    record, settings, right = moving
    short = check_drive([record], replace(settings, lag=0.0), conditions=motions[1:])
    assert short.settings.delay + short.settings.lag == pytest.approx(0.55e-3, abs=0.01e-3)
    assert (
        "as the trace shows them, instead of 0.25 ms and 0 ms as given (a filter that is missing in"
        " the gains" in one_line(str(short))
    )
    assert short.report.verdict is right.report.verdict
    assert short.report.classical.phase_margin == pytest.approx(
        right.report.classical.phase_margin, abs=0.02
    )
    named = check_drive([record], settings, conditions=motions[1:])
    assert named.settings.lag == settings.lag
    assert "as the trace shows them" not in str(named)


@pytest.mark.filterwarnings(
    "ignore:G differs from its neighbours"
)  # where it sticks, a narrow resonance
def test_a_delay_that_is_too_short_is_in_the_loop_all_the_same(folder, told, motions):
    records, settings = four_traces(folder)
    short = check_drive(
        records, replace(settings, delay_periods=0.0), conditions=three_at_rest(motions)
    )
    margins = [found.report.classical.phase_margin for found in (told, short)]
    assert margins[0] == pytest.approx(margins[1], abs=np.radians(0.5))
    for found in (told, short):  # with lag, that of the traces: 0.55 ms
        (delay,) = re.findall(
            r"sampled at 4 kHz with ([\d.]+) ms of delay", found.friction.proofs[0].claim
        )
        assert float(delay) == pytest.approx(0.25, abs=0.005)
    assert "the traces at rest show 0.5" in one_line(str(short))


@pytest.mark.filterwarnings("ignore:G differs from its neighbours")
def test_friction_that_was_read_before_serves_other_gains(experiments_at_rest, at_rest):
    (records, settings), read = experiments_at_rest, at_rest
    again = check_drive(records[2:], settings, fit=read.friction.fit, Fs=2 * read.friction.largest)
    assert str(again.friction.assumed) == str(read.friction.assumed)
    assert again.friction.error_bound == pytest.approx(2 * read.friction.error_bound, rel=1e-9)
    machines = {(one.machine.A[1, 1], one.machine.B_port[1]) for one in read.friction.proofs}
    low, high = (1 / mass for mass in read.friction.fit.interval("mass"))
    damping = read.friction.fit.interval("damping")[1]
    for end in (low, high):
        for c in (0.0, damping):
            assert any(np.allclose(one, (-c * end, end), rtol=1e-9, atol=1e-12) for one in machines)
    assert "It rests where friction holds it" in str(
        check_drive(records, replace(settings, tn=np.inf), fit=again.friction.fit)
    )
    with pytest.raises(ValueError, match="fit must be of type FrictionFit, got 3"):
        check_drive(records, settings, fit=3)
    with pytest.raises(ValueError, match="fit must be in N and m as the traces, got Nm and rad"):
        check_drive(records, settings, fit=replace(read.friction.fit, units=("Nm", "rad")))


def test_a_proof_holds_with_the_added_delay_and_no_sixteenth_of_a_period_more(at_rest):
    """The loop is proved with every machine of the check with what the page names, and one of them
    is not with the next step.
    """
    found, settings = at_rest.friction, at_rest.settings
    machines, friction = [one.machine for one in found.proofs], found.assumed.friction
    K, beyond = cascade(settings, output_unit="N"), max(0.0, found.fit.delay - found.known_delay)
    held = []
    for added in (found.added_delay, found.added_delay + settings.dt / 16):
        delay = settings.delay + beyond + added
        held.append(
            {robust.prove_friction(one, K, friction, delay=delay).verdict for one in machines}
        )
    assert len(machines) == 5
    assert 0 < found.added_delay < 8 * settings.dt
    assert held[0] == {"proved"} != held[1]


@pytest.mark.filterwarnings("ignore:G differs from its neighbours")
def test_a_proof_and_an_unstable_model_contradict_each_other(folder, at_rest):
    """The linear model of a trace at rest has friction in it; what the levels say together is the
    machine.
    """
    records, settings = four_traces(folder)
    found = check_drive(records[:3], settings, fit=at_rest.friction.fit)
    assert found.friction.proved
    assert not found.safe
    assert not found.report.nominally_stable
    assert [doubt.kind.name for doubt in found.doubts] == ["CONTRADICTED"]
    assert found.report.verdict == "not certified"


def test_a_proof_of_one_mass_does_not_contradict_a_model_in_motion(folder, at_rest, motions):
    """In motion the band is wider, and a mode may make the loop unstable that the levels at rest do
    not reach.
    """
    settings, axis = load_gains(folder / "gains.toml"), frictionless("linear motor", kv=5, kp=10)
    halves = {"motor_inertia": 6.0, "load_inertia": 6.0, "stiffness": 3.0 * (2 * np.pi * 385) ** 2}
    record = trace(replace(axis, **halves, damping=200.0), 60.0, f_max=700)
    found = [
        check_drive([record], settings, fit=at_rest.friction.fit, conditions=[one])
        for one in motions
    ]
    for one in found:
        assert one.friction.proved
        assert not one.report.nominally_stable
    assert [one.doubts[0].kind.name for one in found] == ["CONTRADICTED", "UNSTABLE"]


@pytest.mark.filterwarnings("ignore:G differs from its neighbours")
def test_a_trace_in_motion_gives_no_friction_at_rest(folder, told):
    """By its design it is left out; without one it counts as at rest, and no model of rest explains
    it.
    """
    blind = check_drive(*four_traces(folder))
    assert len(told.friction.fit.levels) == 3
    assert told.friction.proofs
    assert not blind.friction.proofs
    assert "in motion" in blind.friction.note


def test_two_encoders_are_no_trace_of_one_position(folder):
    settings = replace(load_gains(folder / "gains.toml"), encoder="both")
    with pytest.raises(ValueError, match='encoder must be "motor" or "load"'):
        check_drive([read_one(folder / "moving.npz", settings)], settings)


def one_line(page):
    """The page without its line breaks."""
    return " ".join(page.split())


@pytest.mark.usefixtures("played")
def test_a_trace_in_motion_enters_by_its_design(run):
    code, page, warned = run("motion-trace.csv gains.toml --design motion.npz")
    assert (code, warned) == (3, "")
    assert len(re.findall(r"motion-trace.csv (?:for|back)ward +6\d\.?\d* N +63", page)) == 2
    assert "The set of plants around motion-trace.csv" in page
    assert "STATISTICALLY ROBUST" in page
    assert "warning:" not in page


@pytest.mark.attack(every=2)
@pytest.mark.parametrize(
    "seed", [6, 10]
)  # scatter in which a fit has an unstable pole that a zero cancels
def test_a_pole_that_is_fitted_to_scatter_makes_no_loop_unstable(folder, seed):
    axis = nlfrf.servo_axis("linear motor")
    limits = nlfrf.signals.AxisLimits(force=400, travel=0.5)
    motion = {"base_velocity": 0.1, "strokes": 1, "limits": limits}
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=400, rng=seed)
    experiment = robust.servo.design_experiment(axis, ms, **motion)
    nlfrf.save(experiment, folder / f"s{seed}.csv")
    robust.servo.play_experiment(axis, folder / f"s{seed}.csv", folder / f"s{seed}-trace.csv")
    settings = load_gains(folder / "gains.toml")
    records, names, conditions = read_experiments(
        [folder / f"s{seed}-trace.csv"], [experiment], settings
    )
    for record, name, one in zip(records, names, conditions, strict=True):
        found = check_drive([record], settings, names=[name], conditions=[one])
        assert found.linear_passed, found
        assert np.degrees(found.report.classical.phase_margin) == pytest.approx(43.4, abs=1)


def test_a_free_axis_is_not_taken_for_its_resonance_where_scatter_explains_no_fit():
    """Motor and load of 0.45 Hz at low frequency, measured from 4 Hz on, with 60 us that no fit
    without delay has.
    """
    ms = nlfrf.multisine("special-odd", fs=4000, n_samples=2000, f_min=3, f_max=292, rms=1, rng=1)
    motor, load, k, d, c = 14.7, 19.9, 1.14e7, 1540.0, 48.0

    def frf(f):
        s = 2j * np.pi * f
        spring = k + d * s
        both = (motor * s**2 + c * s + spring) * (load * s**2 + c * s + spring) - spring**2
        return np.exp(-60e-6 * s) * (load * s**2 + c * s + spring) / both

    G = np.append(0.0, frf(2.0 * np.arange(1, 1001)))
    U = np.fft.rfft(ms.u[0])
    white = np.fft.rfft(np.random.default_rng(0).standard_normal((8, 2000))) / np.sqrt(2000)
    y = np.fft.irfft(G * (U + 3e-5 * np.median(np.abs(U[ms.lines.excited])) * white))
    record = nlfrf.Record(
        u=np.tile(ms.u, (8, 1))[None],
        y=y[None],
        fs=4000,
        lines=ms.lines,
        hold="band-limited",
        input_units=("N",),
        output_units=("m",),
    )
    settings = Drive(fs=4000, kv=20, kp=2e3, kp_unit="N/(m/s)", lag=0.0, delay_periods=0.0)
    found = check_drive([record], settings, actual=True)
    curves = found.report.curves
    band = (curves.omega > 2 * np.pi * 6) & (curves.omega < 2 * np.pi * 290)
    s = 1j * curves.omega[band]
    held = (1 - np.exp(-s * settings.dt)) / (s * settings.dt)  # by the drive
    off = curves.G[band] / (held * frf(s.imag / (2 * np.pi))) - 1
    assert np.abs(off).max() < 0.02  # a single mass misses the resonance at 185 Hz by far


@pytest.mark.usefixtures("played")
def test_a_trace_at_rest_cannot_judge_the_gains_it_was_recorded_with(run):
    code, page, warned = run("rest-trace.csv gains.toml --design rest.npz")
    page = one_line(page)
    assert code == 1
    assert "verdict: NOT CERTIFIED" in page
    assert "Lower the gain" not in page
    assert "the model is unstable: the nominal loop has a pole at" in page
    held = re.search(r"the axis is held, as by a spring of (\S+) N/m from 9 to 27 Hz", page)
    assert 5e5 < float(held[1]) < 2e6  # below its presliding stiffness of 2e6
    assert (
        "Take a trace in motion: robust servo design ... --velocity V, then --design here" in page
    )
    assert (
        "rest-trace.csv at rest was recorded with these gains, by its design, in a loop that was"
        " stable" in page
    )
    assert "not 5 as designed" in warned


@pytest.mark.usefixtures("played")
@pytest.mark.filterwarnings("ignore:the force is")
def test_gains_that_did_not_run_are_not_called_stable(folder):
    settings = load_gains(folder / "gains.toml")
    experiment = nlfrf.load(folder / "rest.npz")

    head, _, rows = (folder / "rest-trace.csv").read_text().partition("\n")
    (folder / "bare.csv").write_text(re.sub(r" \[(m|N)\]", "", head) + f"\n{rows}")

    def recorded(experiment, trace="rest-trace.csv", **changes):
        changed = replace(settings, position_unit="", **changes)
        return read_experiments([folder / trace], [experiment], changed)[2][0].gains

    for kp, kp_unit, same in (
        (143, "A/(m/s)", "same"),
        (0.143, "A/(mm/s)", "same"),
        (143 * 52.8, "Ns/m", "same"),
        (150, "A s/m", "other"),
    ):
        assert recorded(experiment, kp=kp, kp_unit=kp_unit) == same
    assert recorded(experiment, "bare.csv") == "same"
    assert recorded(experiment, "bare.csv", kp_unit="A s/rad", torque_constant=np.nan) == "other"
    assert recorded(experiment, kp_unit="Ns/m", torque_constant=np.nan) == "unknown"
    assert recorded(replace(experiment, assumed_drive=None)) == "other"


@pytest.mark.usefixtures("played")
def test_a_crossover_outside_the_band_is_named(run):
    code, page, _ = run("narrow-trace.csv gains.toml --design narrow.npz")
    found = re.search(
        r"the loop crosses over at ([\d.]+) Hz, above the measured band of 9 Hz to 59 Hz.* a trace"
        r" up to ([\d.]+) Hz",
        one_line(page),
    )
    assert code == 1
    assert float(found[1]) == pytest.approx(100.6, rel=0.02)  # as the trace of the wide band has it
    assert float(found[2]) == pytest.approx(2 * float(found[1]), rel=1e-3)


@pytest.mark.usefixtures("played")
def test_friction_is_bounded_by_what_is_read_in_motion_where_the_linear_model_does_not_judge(
    run, folder
):
    """The bound of `prove_friction` for the machine behind the trace; nothing passes by it, and it
    says whose it is.
    """
    code, page, _ = run("narrow-trace.csv gains.toml --design narrow.npz --force 26")
    found = re.search(
        r"within: at most (\S+) um off, .* for the machine as read in motion \(its loop is",
        one_line(page),
    )
    settings = load_gains(folder / "gains.toml")
    plant = motor_behind_lag(settings.lag)
    K, any_friction = cascade(settings, output_unit="N"), robust.friction.Bounded(26.0)
    true = robust.prove_friction(plant, K, any_friction, delay=settings.delay)
    assert (code, "the linear loop with its uncertainty is not certified" in one_line(page)) == (
        1,
        True,
    )
    assert 1e-6 * float(found[1]) == pytest.approx(true.error_bound, rel=0.02)


def test_an_unstable_loop_gives_no_bound_of_friction(moving):
    """Neither where the loop of what was read is unstable, nor where the linear model is and
    nothing ran with it.
    """
    settings, late = settings_of(nlfrf.servo_axis("linear motor")), 4e-3
    read = SimpleNamespace(mass=12.0, damping=20.0, load_mass=0.0, delay=late, units=("N", "m"))
    force = SimpleNamespace(sliding=read, load=None, bristle_time=np.nan, Fs=np.array([20.0, 26.0]))

    def judged(slides):
        return moved(moving[2].friction, force, settings, stable=slides)

    assert judged(True).outcome == judged(False).outcome == "open"
    assert (
        "No bound for the machine as read in motion: the sliding loop is unstable"
        in judged(True).note
    )
    assert "there is no linear model" in judged(False).note
    read.delay = 0.0
    assert judged(True).outcome == "settles"


def test_gains_that_did_not_run_here_are_not_robust_and_the_page_says_what_would_change_it(
    run, folder
):
    (folder / "unstable.toml").write_text(LINEAR.replace("143", "600"))
    code, page, _ = run("moving.npz unstable.toml")
    assert (code, "verdict: NOT ROBUST" in one_line(page)) == (1, True)
    assert (
        "If the trace was recorded with these gains, the loop was stable and the model is wrong"
        in one_line(page)
    )


def test_thin_margins_are_warned_of_and_not_safe(run, folder):
    (folder / "thin.toml").write_text(LINEAR.replace("143", "400").replace("100 1/s", "300 1/s"))
    code, page, _ = run("moving.npz thin.toml")
    assert "STATISTICALLY ROBUST" in page
    found = re.search(
        r"thin margins: \|S\| reaches ([\d.]+) over the set, at [\d.]+ Hz, above 2, and the nominal"
        r" phase margin is "
        r"([\d.]+) deg. Usual limits are \|S\| of at most 2 and a phase margin of at least 30 deg",
        one_line(page),
    )
    assert code == 1
    assert float(found[1]) > 15
    assert float(found[2]) < 6
    assert run("moving.npz thin.toml --peak 100")[0] == 3
    assert run("moving.npz gains.toml --peak 1.2")[0] == 1
    assert run("moving.npz gains.toml --peak 0")[0] == 2


def test_the_levels_of_a_pre_test_are_three_traces(folder):
    axis = nlfrf.servo_axis("linear motor")
    settings = load_gains(folder / "gains.toml")
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=100, rng=1)
    ramp = robust.servo.design_ramp(axis, ms, rms=50, n_levels=12)
    nlfrf.save(ramp, folder / "ramp.csv")
    robust.servo.play_experiment(axis, folder / "ramp.csv", folder / "ramp-trace.csv")
    records, names, conditions = read_experiments([folder / "ramp-trace.csv"], [ramp], settings)
    assert names == [f"ramp-trace.csv {state}" for state in ("sticks", "bends", "slides")]
    assert [one[:2] for one in conditions] == [("same", "at rest")] * 3
    assert np.all(np.diff([np.std(one.u) for one in records]) > 0)
    more, states, _ = read_experiments([folder / "ramp-trace.csv"], [ramp], settings, n_levels=6)
    assert len(more) == 6
    assert states[0].endswith("sticks")
    assert states[-1].endswith("slides")
    forces = [np.std(one.u) for one in more]
    assert np.all(np.diff(forces) > 0)
    assert forces[0] == np.std(records[0].u)
    assert forces[-1] >= np.std(records[-1].u)
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=100, rng=1)
    low = robust.servo.design_ramp(axis, ms, rms=2, n_levels=4)
    nlfrf.save(low, folder / "few.csv")
    robust.servo.play_experiment(axis, folder / "few.csv", folder / "few-trace.csv")
    with pytest.raises(
        ValueError, match=r"design of a pre-test must show three levels, got few-trace\.csv: "
    ):
        read_experiments([folder / "few-trace.csv"], [low], settings)


@pytest.mark.usefixtures("played")
def test_a_pre_test_that_shows_no_friction_leaves_it_unjudged(run, folder):
    axis = nlfrf.servo_axis("linear motor")
    ms = nlfrf.multisine(fs=4000, n_samples=4000, f_min=5, f_max=100, rng=1)
    low = robust.servo.design_ramp(axis, ms, rms=2, n_levels=4)
    nlfrf.save(low, folder / "short.csv")
    robust.servo.play_experiment(axis, folder / "short.csv", folder / "short-trace.csv")
    code, page, _ = run(
        "short-trace.csv motion-trace.csv gains.toml --design short.npz --design motion.npz"
    )
    assert code == 3, page
    assert page.startswith("Gains\nlinear loop passed; friction not judged: ")
    assert " not judged: short-trace.csv: " in one_line(page)


def test_what_a_file_leaves_out_is_printed_as_assumed(tmp_path):
    path = tmp_path / "g.toml"
    path.write_text(LINEAR.replace('delay = "0.25 ms"\n', ""))
    assert str(load_gains(path)).endswith("lag 0.3 ms, delay 0.25 ms (delay assumed, not given)")
    path.write_text(LINEAR.replace('lag = "0.3 ms"\ndelay = "0.25 ms"\n', ""))
    assert "(lag and delay assumed, not given)" in str(load_gains(path))
    path.write_text(LINEAR)
    assert "assumed" not in str(load_gains(path))


@pytest.mark.parametrize(
    ("written", "same"),
    [
        ("2 Nms/rad", "2 Nm/(rad/s)"),
        ("2 Nm·s/rad", "2 Nm/(rad/s)"),
        ("2 Ns/m", "2 N/(m/s)"),
        ("2 As/m", "2 A/(m/s)"),
        ("2 A*s/rad", "2 A/(rad/s)"),
    ],
)
def test_a_gain_as_drives_write_it(tmp_path, written, same):
    found = []
    for one in (written, same):
        (tmp_path / "g.toml").write_text(
            f'fs = "4 kHz"\nkv = "100 1/s"\nkp = "{one}"\n', encoding="utf-8"
        )
        settings = load_gains(tmp_path / "g.toml")
        found.append((settings.gain, settings.output_unit, settings.base_unit))
    assert found[0] == found[1]


@pytest.mark.parametrize(
    ("kv", "in_seconds"),
    [
        ("100 1/min", 1.67),
        ("100 (m/min)/mm", 1667),
        ("1000 1/min", None),
        ("0 1/s", None),
        ("3.6 (m/min)/mm", None),
        ("3.6 m/min/mm", None),
    ],
)
def test_a_position_gain_in_a_doubtful_unit_is_warned_of(tmp_path, kv, in_seconds):
    path = tmp_path / "g.toml"
    path.write_text(LINEAR.replace("100 1/s", kv))
    if in_seconds is None:
        assert load_gains(path).kv == pytest.approx(
            {"1000": 1000 / 60, "0": 0.0, "3.6": 60.0}[kv.split()[0]]
        )
        return
    with pytest.warns(
        robust.DesignWarning, match=r"kv = '100 .* 1/s, but drives usually have 5 to 1000 1/s"
    ) as seen:
        found = load_gains(path)
    assert found.kv == pytest.approx(in_seconds, rel=0.01)
    assert f"is {found.kv:.4g} 1/s" in str(seen[0].message)
    assert "drives have 5 to 1000 1/s: look up its unit" in str(found)


def test_the_set_point_passes_a_low_pass_of_kv(told):
    """What the page says beside an overshoot of zero: from set point to position goes kv/(s + kv)
    T.
    """
    curves, settings = told.report.curves, told.settings
    drive = with_set_point(settings, output_unit=told.unit)(np.exp(1j * curves.omega * settings.dt))
    closed = curves.G * drive[0, 0] / (1 - curves.G * drive[0, 1])
    T, s = curves.L / (1 + curves.L), 1j * curves.omega
    low = curves.omega < 2 * np.pi * 300  # of 4 kHz, where differences are derivatives
    np.testing.assert_allclose(closed[low], (T * settings.kv / (s + settings.kv))[low], atol=0.03)
    overshoot = next(
        one for section in told.sections for one in section.facts if one.name == "overshoot"
    )
    assert "kv/(s + kv) smooths the set point" in overshoot.meaning
    assert str(told.report.classical.facts[1]) in overshoot.meaning


@pytest.mark.attack(every=2)
@pytest.mark.parametrize(("kp", "cure"), [(0.10, "raise kp"), (3.0, "lower kp")])
def test_thin_margins_are_cured_in_the_direction_that_helps(folder, kp, cure):
    """A kp that is too low for kv and tn oscillates as one that is too high does: the loop is
    conditionally stable.
    """
    settings = load_gains(folder / "gains.toml")
    record = read_one(folder / "moving.npz", settings)
    low = check_drive([record], replace(settings, kp=settings.kp * kp, kv=60.0, tn=0.012))
    assert low.report.nominally_stable
    assert f"disturbances at that frequency: {cure}" in one_line(str(low))
    way = 1.5 if cure == "raise kp" else 1 / 1.5
    better = check_drive([record], replace(settings, kp=settings.kp * kp * way, kv=60.0, tn=0.012))
    assert better.report.margins.S_worst < low.report.margins.S_worst


def test_a_factor_that_is_named_makes_an_unstable_loop_stable(folder):
    settings = replace(load_gains(folder / "gains.toml"), kv=60.0, tn=0.012)
    record = read_one(folder / "moving.npz", settings)
    for factor in (0.02, 20.0):
        found = check_drive([record], replace(settings, kp=settings.kp * factor))
        assert not found.report.nominally_stable
        assert found.stiffness is None
        assert "Lower the gain" not in one_line(str(found))
        named = float(
            re.search(r"([\d.]+) times the present kp makes it stable", one_line(str(found)))[1]
        )
        assert (named > 1) == (factor < 1)
        assert check_drive(
            [record], replace(settings, kp=settings.kp * factor * named)
        ).report.nominally_stable


def test_a_lost_sample_is_cut_out_by_the_option_that_the_refusal_names(run, folder):
    record = nlfrf.load_record(folder / "moving.npz")
    u, y = (np.delete(np.tile(one[0, 0], 4), 9000) for one in (record.u / 52.8, record.y))
    np.savez(folder / "lost.npz", u=u, y=y, fs=4000.0)
    code, _, refused = run("lost.npz gains.toml --period 4000")
    assert code == 2
    assert "--resample leaves that period out" in refused
    code, page, _ = run("lost.npz gains.toml --period 4000 --resample")
    assert (code, "STATISTICALLY ROBUST" in page) == (3, True)
