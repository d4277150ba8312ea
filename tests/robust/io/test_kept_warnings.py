"""Every page that is made from a record shows what was warned of it, and claims no probability
without a word.
"""

import json
import re
import sys
import warnings
from dataclasses import replace
from html import escape

import control
import numpy as np
import pytest
from scipy.io import loadmat

import nlfrf
import robust
from nlfrf import DataWarning, Record, identify, multisine
from robust import DesignWarning, UncertaintyModel, check, cli, fit_nominal, uncertainty
from robust.models import Origin
from tests.support.shaped_loops import content_of

HOSTILE = 'channel "<b>&co" stood still'
CONDITION = "subject to the warnings, "
PLANT = control.ss(
    control.tf([1.0], [1 / 125.6**2, 0.1 / 125.6, 1.0])
)  # the resonance of `recorded`
MASS = control.ss(control.tf([1.0], [1.0, 0.4, 80e3]))


def recorded(level=np.inf, n_periods=2):
    """A resonance at 20 Hz behind a weak cube; below a level the input is clipped, so that its
    peaks are low.
    """
    ms = multisine(fs=512, n_samples=1024, f_min=2, f_max=60, rms=1, rng=3)
    w, s = 2 * np.pi * 20, 2j * np.pi * np.fft.rfftfreq(1024, 1 / 512)
    u = np.clip(ms.u[0], -level, level)
    y = np.fft.irfft(np.fft.rfft(u + 0.02 * u**3) * w**2 / (s**2 + 0.1 * w * s + w**2), 1024)
    y = np.stack([y] * n_periods) + 1e-3 * np.random.default_rng(4).standard_normal(
        (n_periods, 1024)
    )
    return Record(
        u=np.stack([u] * n_periods)[None], y=y[None], fs=512, lines=ms.lines, hold="band-limited"
    )


def shown(make, *args, **kwargs):
    """What a function made, and the texts that it showed."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        made = make(*args, **kwargs)
    assert all(one.filename == __file__ for one in caught)
    return made, [str(one.message) for one in caught]


@pytest.fixture(scope="module")
def run():
    """BLA, nominal, model, controller and report of a record that is warned of, and all that was
    shown of them.
    """
    record = replace(shown(recorded, 1.0)[0], warnings=(HOSTILE,))  # whose clipped input is known
    bla, said = shown(identify, record)
    nominal, of_fit = shown(fit_nominal, bla, n_poles=3, n_zeros=0)
    model, of_model = shown(uncertainty, bla, nominal, order=2)
    K = control.ss(control.sample_system(control.tf([0.05], [0.1, 1]), 0.002))
    report, of_check = shown(check, model, K)
    return bla, nominal, model, K, report, [HOSTILE, *said, *of_fit, *of_model, *of_check]


def test_they_pass_from_record_to_report_each_once(run):
    bla, nominal, model, _, report, said = run
    assert any("the 95 % bound may hold half the time" in text for text in said)
    assert any("a pole where nothing was measured" in text for text in said)
    assert bla.warnings[0] == HOSTILE
    assert nominal.warnings[: len(bla.warnings)] == bla.warnings
    assert model.warnings[: len(nominal.warnings)] == nominal.warnings
    assert report.warnings == tuple(dict.fromkeys(said))
    assert len(report.warnings) == len(said)  # none twice


def test_the_check_prints_them_under_a_verdict_that_names_the_condition(run):
    report = run[4]
    words = " ".join(str(report).split())
    verdict = words[: words.index("warning: ")]
    assert verdict.index(CONDITION) < verdict.index("95 % probability")
    for text in report.warnings:
        assert words.count(f"warning: {' '.join(text.split())}") == 1
    assert any(CONDITION in text for text in report.confidence)
    unstable = check(run[2], control.ss([], [], [], [[1e6]]))
    assert unstable.warnings == run[2].warnings
    assert "warning:" in str(unstable)


def test_a_sound_record_leaves_no_word_of_it_on_any_page(tmp_path, undrawn):
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        bla = identify(recorded())
        model = uncertainty(bla, fit_nominal(bla, n_poles=2, n_zeros=0), order=3)
        K = control.ss([], [], [], [[0.05]])
        report = robust.reports.write_report(tmp_path / "r.html", model, K, bla=bla)
    page = (tmp_path / "r.html").read_text(encoding="utf-8")
    assert "95 % probability" in page
    assert report.warnings == model.warnings == ()
    assert not re.search("warning", f"{page.partition('</style>')[2]}{report}{model}", re.I)
    robust.save(model, tmp_path / "m.json")
    assert "warnings" not in json.loads((tmp_path / "m.json").read_text())
    robust.save(report, tmp_path / "c.json")
    assert "warnings" not in json.loads((tmp_path / "c.json").read_text())


def shown_on(path):
    """The list under the verdict of a page, as it stands in the file."""
    page = path.read_text(encoding="utf-8")
    return page, re.findall(
        r"<li>(.*)</li>", page[page.index("<header>") : page.index("</header>")]
    )


def test_the_page_shows_each_escaped(run, tmp_path, undrawn):
    bla, nominal, model, K, report, _ = run
    robust.reports.write_report(
        tmp_path / "r.html", model, K, bla=bla, nominal=nominal, report=report
    )
    page, listed = shown_on(tmp_path / "r.html")
    assert listed == [escape(text).replace("&quot;", "&#34;") for text in report.warnings]
    assert "<b>" not in page
    for claim in re.finditer("95 % probability", page):
        assert "ubject to the warnings, " in page[claim.start() - 120 : claim.start()]


@pytest.mark.parametrize("checked_before", [False, True])
def test_the_page_of_an_older_model_shows_what_its_bla_knows(
    run, tmp_path, undrawn, checked_before
):
    bla, nominal, model, K, *_ = run
    older = replace(model, warnings=())
    given = {"report": check(older, K)} if checked_before else {}
    report = robust.reports.write_report(
        tmp_path / "r.html", older, K, bla=bla, nominal=nominal, **given
    )
    assert set(report.warnings) >= {*bla.warnings, *nominal.warnings}
    page, listed = shown_on(tmp_path / "r.html")
    assert len(listed) == len(report.warnings)
    assert CONDITION in page[page.index("banner statistically") : page.index("<ul>")]


def test_what_the_check_itself_warns_of_is_in_its_report():
    model = uncertainty(identify(recorded()), PLANT, order=2, above="flat")
    unknown = replace(model.origin.hold, kind="unknown")
    model = replace(model, origin=replace(model.origin, hold=unknown))
    report, said = shown(check, model, control.ss([], [], [], [[0.05]], 1 / 512))
    assert "hold of the record" in said[0]
    assert report.warnings == tuple(said)


def test_files_of_models_keep_them(run, tmp_path):
    model = run[2]
    robust.save(model, tmp_path / "m.json")
    read, said = shown(robust.load, tmp_path / "m.json")
    assert read.warnings == model.warnings
    assert said == []
    assert f"subject to {len(model.warnings)} warnings" in str(read)
    content = json.loads((tmp_path / "m.json").read_text())
    del content["warnings"]
    (tmp_path / "older.json").write_text(json.dumps(content))
    assert robust.load(tmp_path / "older.json").warnings == ()
    (tmp_path / "bad.json").write_text(json.dumps(content | {"warnings": "one"}))
    with pytest.raises(ValueError, match="warnings"):
        robust.load(tmp_path / "bad.json")


def test_of_several_channels_too(tmp_path, undrawn):
    ms = multisine(fs=256, n_samples=256, f_min=1, f_max=60, n_inputs=2, rng=1)
    u = ms.u[:, :, None]  # one period: noise counts as distortion, which is warned of
    y = np.stack([2 * u[0] + 0.1 * u[0] ** 3 + u[1], u[1] + 0.1 * u[1] ** 3])
    frm, said = shown(identify, Record(u=u, y=y, fs=256, lines=ms.lines))
    assert said
    plant = control.ss([], [], [], [[2.3, 1.0], [0.0, 1.3]])
    model = uncertainty(frm, plant, form="auto", order=1, above="flat")
    robust.save(model, tmp_path / "m.json")
    read = robust.load(tmp_path / "m.json")
    assert read.warnings == frm.warnings == tuple(said)
    report = robust.reports.write_report(
        tmp_path / "r.html", read, control.ss([], [], [], 0.1 * np.eye(2))
    )
    assert report.warnings == read.warnings
    assert shown_on(tmp_path / "r.html")[1] == [escape(text) for text in said]
    assert CONDITION in str(report)


def test_a_certificate_keeps_them_and_verify_prints_them(run, tmp_path):
    _, _, model, K, report, _ = run
    robust.save(report, tmp_path / "c.json")
    found = robust.io.verify_certificate(tmp_path / "c.json", model=model, K=K)
    assert found.verified
    assert found.warnings == report.warnings
    words = " ".join(str(found).split())
    assert all(f"warning: {text}" in words for text in report.warnings)
    content = json.loads((tmp_path / "c.json").read_text())
    content["warnings"] = content["warnings"][1:]
    (tmp_path / "changed.json").write_text(json.dumps(content))
    with pytest.raises(ValueError, match="digest does not fit"):
        robust.io.verify_certificate(tmp_path / "changed.json")


@pytest.fixture
def printed_by(tmp_path, monkeypatch, capsys):
    """Run a command that succeeds in a folder; gives what it printed, and the warnings it showed."""
    monkeypatch.chdir(tmp_path)

    def run_one(words):
        monkeypatch.setattr(sys, "argv", words.split())
        with pytest.raises(SystemExit) as stop:
            cli.main()
        assert not stop.value.code
        printed = capsys.readouterr()
        return printed.out, [
            line.removeprefix("robust: warning: ") for line in printed.err.splitlines()
        ]

    return run_one


def test_a_proof_with_friction_keeps_what_its_model_is_subject_to(tmp_path, printed_by):
    model = UncertaintyModel(
        MASS,
        0.1,
        "multiplicative",
        np.array([1.0, 2.0]),
        np.array([0.05, 0.05]),
        origin=Origin(unit="m/N"),
        warnings=(HOSTILE,),
    )
    robust.save(model, tmp_path / "m.json")
    PD = control.ss([[0.0]], [[1.0]], [[-60e3]], [[80e3]], 1e-3)  # 20 kN/m and 60 Ns/m at 1 kHz
    robust.save(PD, tmp_path / "K.json", delay=0.0)
    printed, said = printed_by("robust prove m.json K.json --stiffness 64e3 -o proof.txt")
    assert said == [HOSTILE]
    for text in (printed, (tmp_path / "proof.txt").read_text(encoding="utf-8")):
        assert text.count(f"\nwarning: {HOSTILE}\n") == 1
    found = robust.io.verify_certificate(tmp_path / "proof.certificate.json")
    assert found.verified
    assert found.warnings == (HOSTILE,)


def test_a_command_says_again_what_stands_in_the_files_that_it_reads(run, tmp_path, printed_by):
    nlfrf.save(run[0], tmp_path / "bla.npz")
    _, said = printed_by("robust model bla.npz --poles 3 --zeros 0 --order 2 -o m.json")
    read = robust.load(tmp_path / "m.json")
    assert said == [*read.warnings]
    assert read.warnings == run[2].warnings
    assert read.warnings[: len(run[0].warnings)] == run[0].warnings


def test_the_page_to_shape_a_loop_in_has_them(run, tmp_path):
    robust.shaping.write_shaping_page(tmp_path / "shape.html", run[2])
    assert content_of(tmp_path / "shape.html")["warnings"] == [*run[2].warnings]
    assert "<b>" not in (tmp_path / "shape.html").read_text(encoding="utf-8")


def test_warnings_as_errors_stop_and_an_ignored_one_is_kept(run):
    bla, nominal = run[:2]
    with warnings.catch_warnings():
        warnings.simplefilter("error", DesignWarning)
        with pytest.raises(DesignWarning, match="a pole where nothing was measured"):
            fit_nominal(bla, n_poles=3, n_zeros=0)
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", DesignWarning)
        assert fit_nominal(bla, n_poles=3, n_zeros=0).warnings == nominal.warnings
    record, _ = shown(recorded, 1.0)
    with warnings.catch_warnings():
        warnings.simplefilter("error", DataWarning)
        with pytest.raises(DataWarning, match="half the time"):
            identify(record)


def test_exports_and_validations_keep_them(run, tmp_path):
    bla, _, model, _, report, _ = run
    nlfrf.export_csv(bla, tmp_path / "bla.csv")
    head = (tmp_path / "bla.csv").read_text(encoding="utf-8").splitlines()
    assert head[: len(bla.warnings)] == [
        f"# warning: {' '.join(text.split())}" for text in bla.warnings
    ]
    assert head[len(bla.warnings)].startswith("f [Hz],Re G")
    robust.io.export_matlab(model, tmp_path / "m.mat")
    held = loadmat(tmp_path / "m.mat", simplify_cells=True)["content"]["warnings"]
    assert np.atleast_1d(held).tolist() == list(model.warnings)
    assert f"% warning: {HOSTILE}\n" in (tmp_path / "load_m.m").read_text(encoding="utf-8")
    seen = robust.validate(model, replace(bla, warnings=("of another day",)))
    assert seen.warnings == (*model.warnings, "of another day")
    assert f"warning: {HOSTILE}" in str(seen)
    assert report.warnings[0] == HOSTILE
    bare = replace(bla, warnings=())
    nlfrf.export_csv(bare, tmp_path / "bare.csv")
    assert (tmp_path / "bare.csv").read_text(encoding="utf-8").startswith("f [Hz],Re G")
    robust.io.export_matlab(replace(model, warnings=()), tmp_path / "bare.mat")
    assert "warnings" not in loadmat(tmp_path / "bare.mat", simplify_cells=True)["content"]
