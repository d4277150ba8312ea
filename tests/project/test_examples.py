"""Every example runs, says what it should, and leaves its pictures; each is run once, for the
gallery too.
"""

import contextlib
import io
import re
import runpy
import subprocess
import sys
import warnings

import matplotlib.figure
import numpy as np
import pytest

import robust
from docs import gallery
from docs.gallery import EXAMPLES, names, outputs, printed, title_and_text

#: What each must have printed, as patterns in order.
PRINTED = {
    "00_thirty_lines": [
        r"BLA on 148 lines",
        r"\|W T\| < 1 at every frequency: holds \(scaled KYP lemma\)",
        r"statistically robust",
        r"picture: .*loop\.png",
    ],
    "01_identify_then_design": [
        r"3 poles taken",
        # one: a second lies above the band, where the data show none
        r"zeros rad/s: \S+ \(std \S+\)\n",
        r"static gain: 1\.1\d+e-05 m/N \(relative std 0\.0\d+\)",
        r"STATISTICALLY ROBUST: this controller keeps every linear plant of the set stable",
        r"report\.html and report\.txt have the whole result",
    ],
    "02_design_an_experiment": [
        r"0\.25 Hz +4\.00 s +148 +4",
        r"as drawn: crest factor 3\.5\d",
        r"best of some draws: crest factor 3\.1\d",
        r"seven realisations of two periods",
    ],
    "03_identify_one_record": [
        r"\(1, 4, 8192\)",
        r"(9\d|100) % of the lines of another record lie inside",
        "second opinion",
    ],
    "04_compare_grids": [
        r"odd-odd .* -2\d\.\d .* detection lines, uncorrected",  # the paper's 20 dB
        r"odd-odd .* 9\d\.\d % .* identify: roughness",
        r"special-odd .* identify: detection, calibrated",
        r"random-odd",
    ],
    "05_levels_as_a_family": [
        r"0\.25 N alone: crossover up to",
        "all three: crossover up to 1 Hz of 64",
    ],
    "06_from_bla_to_weights": [
        r"3 poles (?:(?!poles)[\s\S])*\(taken\)",
        r"inverse-multiplicative",
        r"of 148 lines outside",
    ],
    "07_shape_by_hand": [
        r"a gain .* inf",
        r"a notch over the resonance +stable +0\.\d+ +0\.\d+",
        r"STATISTICALLY ROBUST",
        r"demand met\s+for\s+the\s+whole\s+set",
    ],
    "08_hinf_loop_shaping": [
        r"shaped plants are 0\.\d+ apart",
        r"mixed sensitivity: gamma 0\.\d+",
        r"--- mixed sensitivity ---\nverdict: +STATISTICALLY ROBUST",
        r"demand met\s+for\s+the\s+whole\s+set",
    ],
    "09_pid_from_the_frf": [
        r"PID +\d{7,8} .* limits met: True",
        r"not found: \|",
        r"on the measured lines only",
        r"STATISTICALLY ROBUST",
        r"PID +0\.\d\d\d s .* 0\.000 um",
    ],
    "10_check_and_certificate": [
        r"--- shaped ---\nverdict: +STATISTICALLY ROBUST",
        r"robust performance at all frequencies: yes",
        r"--- integrator ---\nverdict: +NOT ROBUST",
        (
            r"--- twice the integrator ---\nverdict: +NOT ROBUST[^-]*\nbecause: +unstable: the"
            r" nominal loop"
        ),
        r"the set contains this plant: its error is at most 0\.\d+",
        r"nominal plant: after two seconds y still oscillates by 0\.000",
        r"that plant of the set: after two seconds y still oscillates by 0\.[1-9]",
    ],
    "11_skogestad_postlethwaite": [
        r"book +0\.33 1 5\.25 +here 0\.33 1\.01 5\.25",
        r"book +yes, no +here True, False",
        r"largest gain .* book +0\.31 +here 0\.31\n",
        r"extreme plant itself .* book +0\.58 +here 0\.58\n",
        r"gamma_min +book +2\.34 +here 2\.339",
        r"Example 2\.17.*of order two, from the FRF +book +1\.37 +here 1\.[34]\d",
        r"book +3\.162 3 1 +here 3\.162 3\.000 1\.000",
        r"book +0\.5 0\.53 5\.78 +here 0\.50 0\.53 5\.78",
    ],
    "12_matlab_and_back": [
        "response equal to the bit: True",
        r"largest difference: 0\n",
        "weight equal to the bit: True",
        "Octave",
        "STATISTICALLY ROBUST",
    ],
    "14_friction_rig_in_closed_loop": [
        r"one level +statistically robust +refuted +hard +[1-9]\d* +0 +0 +0\n",
        # promised, and it fails
        r"one level +statistically robust +refuted +very hard +\d+ +\d+ +[1-9]",
        r"one level +statistically robust +proved +very hard +[1-9]\d* +0 +0 +0\n",
        r"one level +not robust +refuted +hard +\d+ +\d+ +[1-9]",
        r"three levels +statistically robust +refuted +hard +[1-9]\d* +0 +0 +0\n",
        r"three levels +not robust +proved +very hard +[1-9]\d* +0 +0 +0\n",
        r"promised by the check, and surely running away: from kicks of 0\.\d+ to 0\.\d+ m/s",
    ],
    "20_tune_a_cascade": [
        r"tuned three blocks: met",
        r"into the drive: Kv = ",
        r"0\.025 N rms: statistically robust",
        r"2\.5 N rms: statistically robust",
    ],
    "19_design_with_a_proof": [
        r"shaped for 40 Hz +statistically robust +refuted (?s:.*?)the rig: 0\.01\d*, ",
        r"shaped for 120 Hz +statistically robust +proved (?s:.*?)the rig: all",
        r"PID, proved +statistically robust +proved (?s:.*?) class 2: all",
    ],
    "18_proof_with_friction": [
        r"K0\s+=\s+9\d\.\d+\s+kN/m,",
        (
            r"--- PID ---\nproved: +Comes to rest from every state with"
            r" every\s+Maxwell-slip\s+friction"
        ),
        r"--- integrator alone ---\nrefuted: +the sliding loop is unstable",
        r"runs away: +certain after a kick of 0\.2\d\d m/s",
        r"refuted for the class:\s+with a spring of\s+9\d\.\d+\s+kN/m",
        r"PID +proved +a friction of the class +0 of 12",
        r"integrator alone +refuted +a friction of the class +[1-9]",
        r"too much damping, late +refuted +a friction of the class +[1-9]",
    ],
    "15_several_uncertainties": [
        r"one disc over the levels (9|10)\.\d, the rest 0\.[89]",
        r" 1\.00 Hz +1\.\d\d +1\.[01]\d",
        r"The loop of [12] Hz:\nverdict: +STATISTICALLY ROBUST",
        r"certificate: robust stability at all frequencies: yes",
    ],
    "24_schedule_over_position": [
        r"left-out point: 0\.\d+ of the weight",
        r"tuned two blocks: met",
        r"coefficients in float32 change \|K\| by at most \d(\.\d)?e-0[67] of itself",
        r"stability on every trajectory, for every operator within the weight: proved, rigorous",
        r"grows at \d+\.?\d* m/s(?: with Delta = [+-]1)?: to and fro",
        r"stability on every trajectory: proved, rigorous\n",
        r"schedule: at most 0\.[1-3]\d mm .*\ncontroller of the middle: at most 0\.[4-9]\d mm",
    ],
    "23_learn_from_trial_to_trial": [
        (
            r"friction rig ---\nlearns everything up to 60 Hz .*\nfactor per trial: .* at every"
            r" frequency: proved"
        ),
        r"\d{2,} times lower",
        (
            r"servo axis ---\nlearns everything up to 60 Hz .*\nfactor per trial: .* at every"
            r" frequency: proved"
        ),
        r"\d{1,} times lower",
    ],
    "22_family_of_matrix_plants": [
        r"inverse-(in|out)put +0\.\d\d\d at .*\ninverse-(in|out)put",
        "8 plants that were given, each inside, systems at all frequencies",
        r"proved below 0\.\d+ at all\s+frequencies",
        r"verdict: +ROBUST",
        r"robust performance at all frequencies: yes, scaled KYP, proved, rigorous",
        r"robust performance: proved, rigorous\nverified: True",
    ],
    "16_two_axis_stage": [
        r"FRF matrix of 2 outputs by 2 inputs on 147 lines",
        r"nominal model: 4 poles, sampled at 512 Hz",
        r"--- careful ---\nverdict: +STATISTICALLY ROBUST",
        r"robust stability at all frequencies: yes",
        r"--- greedy ---\nverdict: +NOT ROBUST",
        r"breaking perturbation: 0\.99\d+ and 1\.00\d+",
        r"careful, 0 ms late: off by 0\.\d+ um after 1\.1 s, swings by 0\.\d+ um",
        r"greedy, 0 ms late: off by 0\.\d+ um after 1\.1 s, swings by 0\.\d+ um",
        r"careful, 0\.5 ms late: off by 0\.\d+ um after 1\.1 s, swings by 0\.\d+ um",
        r"greedy, 0\.5 ms late: off by \d\d\d\d?\.\d+ um after 1\.1 s, swings by \d\d\d\d\.\d+ um",
    ],
    "17_measured_mirror": [
        r"the same phases \(psi\)",
        r"bound of the first set.*\n +9[3-7]\.\d % of the entries and 9[2-8]\.\d % of the matrices",
        (
            r"bound of the second set.*\n +9[3-7]\.\d % of the entries and 9[2-8]\.\d % of the"
            r" matrices"
        ),
        r"--- 70 Hz ---\nverdict: +STATISTICALLY ROBUST",
        r"robust stability at all frequencies: yes",
        r"--- 140 Hz ---\nverdict: +NOT ROBUST",
        r"breaking perturbation: 0\.99\d+ and 1\.00\d+",
    ],
    "13_motor_bench": [r"(?s:60 lines.*warning: .*odd-odd.*STATISTICALLY ROBUST)"],
    "21_servo_axis_in_an_afternoon": [
        r"take, as rms of the force set point: .*\(sticks\), .*\(bends\), .*\(slides\)",
        r"--- the gains of the autotuner ---",
        r"max \|S\|: +[56]\.\d+ at",
        r"--- gains with more margin ---",
        r"proved: +Comes to rest from every state",
        r"max \|S\|: +1\.[678]\d* at",
        r"in motion, after the friction doubled ---\nvalidation: 0 of",
        r"at rest, after the friction doubled ---\nmass m: +1[12]\.",
        r"break-away force Fs: +39\.\d+ \+- ",
        r"\n2[12](\.\d)? um off with the force read before, 4[34](\.\d)? um with that read later",
    ],
}


def test_examples_are_short_and_have_a_title():
    for name in names():
        lines = (EXAMPLES / f"{name}.py").read_text().splitlines()
        assert sum(any(c.isalpha() for c in line) for line in lines if line != "# %%") <= 115, name
        title, text = title_and_text(name)
        assert 10 < len(title) < 94, name
        assert text, name
    assert set(PRINTED) <= set(names())


#: Examples that `make test` runs, one path each; `make docs` runs the others.
FIRST = {
    *(
        "00_thirty_lines",
        "01_identify_then_design",
        "03_identify_one_record",
        "09_pid_from_the_frf",
    ),
}
EACH = [pytest.param(name, marks=() if name in FIRST else pytest.mark.docs) for name in names()]


@pytest.mark.parametrize("name", EACH)
def test_example(name):
    text, place = printed(name), 0
    for pattern in PRINTED.get(name, ["[0-9]"]):
        found = re.compile(pattern).search(text, place)
        assert found, (
            f"{name} did not print {pattern!r} after {text[:place][-60:]!r}, but\n{text[place:]}"
        )
        place = found.start()
    pictures = list(outputs(name).glob("*.png"))
    assert pictures
    assert all(picture.stat().st_size > 10_000 for picture in pictures)


@pytest.mark.parametrize("name", EACH)
def test_what_an_example_prints_fits_a_hundred_columns(name):
    assert [line for line in printed(name).splitlines() if len(line) > 100] == []


def test_what_the_first_example_leaves():
    folder = outputs("01_identify_then_design")
    assert robust.load(folder / "model.json").perturbation == "statistical"
    assert robust.load(folder / "controller.json").dt == 1e-3
    for name in ("record.npz", "bla.npz", "report.html", "report.txt"):
        assert (folder / name).stat().st_size > 0
    # what limits the loop was measured: stability and performance alike
    text = (folder / "report.txt").read_text(encoding="utf-8")
    f = [float(one) for one in re.findall(r"^(?:max rs|performance): +\S+ at (\S+) Hz", text, re.M)]
    band = robust.load(folder / "model.json").omega[[0, -1]] / (2 * np.pi)
    assert len(f) == 2
    assert band[0] < min(f) <= max(f) < band[1]


def run(name, *arguments):
    """Run an example as a script in this process, with other options than the gallery; what it
    printed.
    """
    out = io.StringIO()
    with (
        contextlib.redirect_stdout(out),
        warnings.catch_warnings(),
        pytest.MonkeyPatch.context() as patch,
    ):
        # what python-control is told by a newer NumPy
        warnings.filterwarnings("ignore", category=DeprecationWarning, module=r"control\.")
        patch.setattr(sys, "argv", [f"{name}.py", *arguments])
        with contextlib.suppress(SystemExit):
            runpy.run_path(str(EXAMPLES / f"{name}.py"), run_name="__main__")
    return out.getvalue()


def test_the_first_example_takes_a_file(tmp_path, monkeypatch):
    monkeypatch.setattr(
        matplotlib.figure.Figure, "savefig", lambda *_, **__: None
    )  # drawn already, once
    record = outputs("01_identify_then_design") / "record.npz"
    text = run(
        "01_identify_then_design",
        str(record),
        "--discard",
        "0",
        "--poles",
        "2",
        "--out",
        str(tmp_path),
    )
    assert "nominal model: 2 poles" in text
    assert (tmp_path / "report.html").is_file()


@pytest.mark.docs
def test_processes_that_share_the_controllers_change_nothing(tmp_path):
    name = "14_friction_rig_in_closed_loop"
    few = ["--crossovers", "1", "--gains", "2", "--processes"]
    said = run(name, *few, "1", "--out", str(tmp_path / "1"))
    command = [
        sys.executable,
        str(EXAMPLES / f"{name}.py"),
        *few,
        "2",
        "--out",
        str(tmp_path / "2"),
    ]
    done = subprocess.run(command, capture_output=True, text=True, check=True, timeout=600)
    assert said == done.stdout
    assert said.count("statistically robust") >= 3  # a burst a row


@pytest.mark.parametrize("name", ["13_motor_bench", "17_measured_mirror"])
def test_what_needs_records_says_where_it_looked(name, tmp_path):
    said = run(name, "--data", str(tmp_path), "--out", str(tmp_path / "out"))
    assert said.startswith(f"skipped: there is no {tmp_path}")
    assert not (tmp_path / "out").exists()


def test_a_change_in_any_module_runs_the_examples_again(tmp_path, monkeypatch):
    """Modules lie in packages: a picture of yesterday's code would say nothing about today's."""
    for folder in ("examples", "robust/plot", "nlfrf"):
        (tmp_path / folder).mkdir(parents=True)
    (tmp_path / "examples" / "01_one.py").write_text("")
    (tmp_path / "robust" / "plot" / "loops.py").write_text("old")
    monkeypatch.setattr(gallery, "ROOT", tmp_path)
    monkeypatch.setattr(gallery, "EXAMPLES", tmp_path / "examples")
    before = gallery.made_from("01_one")
    (tmp_path / "robust" / "plot" / "loops.py").write_text("new")
    assert gallery.made_from("01_one") != before
