"""The report to hand over: what was found, in one file that asks nobody for anything, and that a
browser shows.
"""

import base64
import re
import sys
from dataclasses import replace
from functools import cache
from html import unescape
from html.parser import HTMLParser

import control
import numpy as np
import pytest

import robust
from nlfrf import Record, identify, multisine
from robust import (
    UncertaintyModel,
    check,
    cli,
    fit_nominal,
    frd,
    ncfsyn,
    performance_weight,
    sampled,
    save,
    uncertainty,
)
from robust.models import Origin
from robust.reports import write_report
from tests.support.browser import browser

SECTIONS = [
    "verdict",
    "record",
    "bla",
    "opinion",
    "nominal",
    "set",
    "loop",
    "check",
    "worst",
    "settings",
]


def recorded(level=1.0):
    """A resonance behind a cube, with noise, two periods."""
    ms = multisine(fs=512, n_samples=1024, f_min=0.5, f_max=60, rms=level, rng=3)
    w = 2 * np.pi * 20
    s = 2j * np.pi * np.fft.rfftfreq(1024, 1 / 512)
    G = w**2 / (s**2 + 0.1 * w * s + w**2)
    u = ms.u[0]
    y = np.fft.irfft(np.fft.rfft(u + 0.02 * u**3) * G, 1024)
    y = np.stack([y, y]) + 1e-3 * np.random.default_rng(4).standard_normal((2, 1024))
    return Record(u=np.stack([u, u])[None], y=y[None], fs=512, lines=ms.lines, hold="band-limited")


@cache
def rig_record():
    return recorded()


@cache
def rig_bla():
    return identify(rig_record())


@cache
def rig_fit():
    return fit_nominal(rig_bla(), n_poles=2, n_zeros=0)


@cache
def rig_model():
    return uncertainty(rig_bla(), rig_fit(), order=3)


@cache
def rig_controller():
    plant = sampled(rig_model().nominal, 1 / 512)
    return ncfsyn(plant, robust.shaping.crossover_weight(plant, 2 * np.pi * 2)).K


W_P = performance_weight(2 * np.pi * 0.3, M_S=2.5, A=1e-2)


class Reader(HTMLParser):
    """Text, ids, pictures and every address a page names."""

    def __init__(self, text):
        super().__init__()
        self.words, self.ids, self.images, self.addresses, self.open = [], [], [], [], []
        self.feed(text)
        assert not self.open, f"not closed: {self.open}"

    def handle_starttag(self, tag, attrs):
        attrs = dict(attrs)
        if tag not in ("meta", "img", "br", "link"):
            self.open.append(tag)
        if "id" in attrs:
            self.ids.append(attrs["id"])
        if tag == "img" and "src" in attrs:
            self.images.append(attrs)
        self.addresses += [
            attrs[a] for a in ("src", "href", "action", "data", "srcset") if a in attrs
        ]

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, text):
        if self.open and self.open[-1] not in ("style", "script"):
            self.words.append(text)

    @property
    def text(self):
        return " ".join(" ".join(self.words).split())


@pytest.fixture(scope="module")
def whole(tmp_path_factory):
    """A report of a whole run, made once."""
    path = tmp_path_factory.mktemp("report") / "report.html"
    report = write_report(
        path,
        rig_model(),
        rig_controller(),
        bla=rig_bla(),
        record=rig_record(),
        nominal=rig_fit(),
        w_P=W_P,
        title="A <bench> & its loop",
        notes="Second try",
    )
    return path, report


def test_it_tells_the_whole_run(whole):
    path, report = whole
    page = Reader(path.read_text(encoding="utf-8"))
    assert page.ids == SECTIONS
    assert "A <bench> & its loop" in page.text  # escaped where it must be
    assert "Second try" in page.text
    for said in (
        report.reason,
        report.proved,
        report.not_proved,
        report.next_step,
        report.context,
        str(rig_model()),
    ):
        assert " ".join(said.split()) in page.text
    for number in (report.margins.disk, 1 / report.margins.rs, np.max(report.curves.rp)):
        assert f"{number:.4g}" in page.text
    for certificate in report.proofs.certificates:
        assert certificate.method in page.text
    assert f"numpy {np.__version__}" in page.text
    assert "rms 1, crest factor" in page.text
    assert "512 Hz" in page.text


def test_no_address_leaves_the_file(whole):
    page = Reader(whole[0].read_text(encoding="utf-8"))
    assert len(page.images) >= 14
    assert all(
        address.startswith(("data:image/svg+xml;base64,", "#")) for address in page.addresses
    )
    for image in page.images:
        svg = base64.b64decode(image["src"].partition(",")[2]).decode("utf-8")
        assert svg.lstrip().startswith("<?xml")
        assert not re.search(r'(xlink:)?href="(?!#)', svg), "a picture points out of itself"
        assert image["alt"]
    assert [a for a in page.addresses if a.startswith("#")] == [f"#{name}" for name in SECTIONS]


def test_the_same_run_gives_the_same_pictures(whole, tmp_path):
    path, report = whole
    write_report(tmp_path / "r.html", rig_model(), rig_controller(), w_P=W_P, report=report)
    images, again = (
        [image["src"] for image in Reader(one.read_text(encoding="utf-8")).images]
        for one in (path, tmp_path / "r.html")
    )
    assert len(again) >= 5
    assert again[-5:] == images[-5:]


def test_a_browser_shows_it(whole, tmp_path):
    with browser(tmp_path / "profile") as page:
        page.open(whole[0])
        assert page.errors == []
        assert [url for url in page.requests if not url.startswith(("file://", "data:"))] == []
        assert [url for url in page.requests if url.startswith("file://")] == [
            whole[0].resolve().as_uri()
        ]
        shown = page.run(
            "[...document.querySelectorAll('main img')].map(i => {const b ="
            " i.getBoundingClientRect(); return [i.complete, i.naturalWidth, b.width, b.height]})"
        )
        assert len(shown) >= 14
        for complete, natural, width, height in shown:
            assert complete
            assert natural > 200
            assert width > 200
            assert height > 100
        # nothing is cut off at the side, on a desk or on a telephone
        for width in (1300, 390):
            page.resize(width)
            assert page.run("document.documentElement.scrollWidth <= innerWidth + 1"), width
        # a picture is enlarged by a click, zoomed by keys, and put away
        page.run("document.querySelector('button.zoom').click()")
        assert page.run("document.querySelector('dialog').open")
        for _ in range(2):
            page.run(
                "document.querySelector('dialog').dispatchEvent(new KeyboardEvent('keydown', {key:"
                " '+'}))"
            )
        assert "scale(1.96)" in page.run("document.querySelector('dialog img').style.transform")
        page.run("document.querySelector('dialog button').click()")
        assert not page.run("document.querySelector('dialog').open")
        pdf = page.pdf()
        assert pdf.startswith(b"%PDF")
        assert 4 <= len(re.findall(rb"/Type\s*/Page\b", pdf)) <= 14
        # the page itself forbids what would leave it
        page.run("fetch('https://localhost/').catch(() => 0)")
        assert any("Content Security Policy" in error for error in page.errors)


def test_parts_that_are_not_there_are_named(undrawn, tmp_path):
    lti = UncertaintyModel(
        control.tf([1], [1, 1]),
        control.tf([0.1], [1]),
        "multiplicative",
        np.array([1.0, 2.0]),
        np.array([0.05, 0.05]),
    )
    report = write_report(tmp_path / "r.html", lti, 2.0)
    text = Reader((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert report.verdict in text
    assert "not given to this report" in text
    assert "none claimed" in text


@pytest.mark.parametrize(
    ("model", "K", "words"),
    [
        (rig_model, lambda: 1e4 * rig_controller(), "not stable: no margin is given"),
        (
            lambda: uncertainty(rig_bla(), frd(rig_bla()), order=2),
            lambda: 0.05,
            "the plant is known on its lines only",
        ),
    ],
)
def test_bad_controllers_and_bare_frfs_are_reported_too(undrawn, model, K, words, tmp_path):
    write_report(tmp_path / "r.html", model(), K(), bla=rig_bla())
    assert words in unescape((tmp_path / "r.html").read_text(encoding="utf-8"))


def test_a_family_of_records(undrawn, tmp_path):
    records = [rig_record(), recorded(1.5)]
    blas = [identify(record) for record in records]
    model = uncertainty(blas, fit_nominal(blas, n_poles=2, n_zeros=0), order=3)
    write_report(tmp_path / "r.html", model, rig_controller(), record=records)
    text = Reader((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert "BLA of record 1" in text
    assert "excitation of record 2" in text
    assert "lines in the set, record 2" in text


def test_refusals_leave_no_file(undrawn, tmp_path):
    with pytest.raises(ValueError, match=r"path must end in \.html, got 'report\.pdf'"):
        write_report(tmp_path / "report.pdf", rig_model(), rig_controller())
    with pytest.raises(ValueError, match="model must be an UncertaintyModel"):
        write_report(tmp_path / "report.html", rig_bla(), rig_controller())
    with pytest.raises(FileNotFoundError, match="existing folder"):
        write_report(
            tmp_path / "nowhere" / "report.html", rig_model(), 0.01, report=check(rig_model(), 0.01)
        )
    assert list(tmp_path.iterdir()) == []


def test_the_command(undrawn, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    save(rig_model(), "m.json")
    save(rig_controller(), "K.json")
    save(rig_record(), "record.npz")
    command = (
        "robust report m.json K.json --record record.npz --bandwidth 0.3 --peak 2.5 -o r.html"
        " --title Bench"
    )
    monkeypatch.setattr(sys, "argv", command.split())
    with pytest.raises(SystemExit) as stop:
        cli.main()
    said = capsys.readouterr()
    assert not stop.value.code, said.err
    assert "verdict: statistically robust" in said.out
    text = Reader((tmp_path / "r.html").read_text(encoding="utf-8")).text
    assert "Bench: statistically robust" in text
    assert "level from detection" in text


def test_the_command_with_a_proof_for_friction(undrawn, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    rig = control.ss(control.tf([1], [1, 0.4, 80e3]))
    lines = np.array([10.0, 1000.0])
    model = UncertaintyModel(
        rig, control.tf([0.02], [1]), "multiplicative", lines, np.array([0.01, 0.01])
    )
    save(model, "m.json")
    save(control.ss([[1.0]], [[1.0]], [[400.0]], [[0.0]], 1e-3), "K.json")
    monkeypatch.setattr(
        sys,
        "argv",
        [
            "robust",
            "report",
            "m.json",
            "K.json",
            "--stiffness",
            "64e3",
            "--force",
            "1",
            "-o",
            "r.html",
        ],
    )
    with pytest.raises(SystemExit) as stop:
        cli.main()
    said = capsys.readouterr()
    assert stop.value.code == 1, said.err  # the verdict of the friction is the worse one
    assert "\nfriction: refuted\n" in said.out
    assert "Two verdicts" in (tmp_path / "r.html").read_text(encoding="utf-8")


@pytest.mark.filterwarnings("ignore")  # of the models, which are not looked at
def test_no_name_of_a_file_becomes_a_part_of_the_page(undrawn, tmp_path):
    """Names, units, source and title, all hostile: as many scripts as without, no handler, no
    image.
    """
    evil = (
        "</script><script>alert(1)</script><img src=x onerror=alert(1)>\"'&lt; ]]>--><svg"
        " onload=alert(1)>"
    )

    class Seen(HTMLParser):
        def __init__(self, path):
            super().__init__()
            self.found = []
            self.feed(path.read_text(encoding="utf-8"))

        def handle_starttag(self, tag, attrs):
            handlers = [name for name, _ in attrs if name.startswith("on")]
            if tag in ("script", "img", "iframe", "object", "embed") or handlers:
                self.found.append((tag, *handlers))

    def pages(text):
        ms = multisine(fs=256, n_samples=256, f_min=2, f_max=100, rng=2)
        u = np.repeat(ms.u[:, None], 2, axis=1)
        names = {"u_name": text, "y_name": text, "u_unit": text, "y_unit": text}
        record = Record(u=u, y=u + 0.05 * u**3, fs=256, lines=ms.lines, **names)
        bla = identify(record)
        model = replace(
            uncertainty(bla, fit_nominal(bla, n_poles=1)),
            origin=Origin(source=text, extrapolation=text),
        )
        K = control.tf([0.3], [1, 0.1])
        write_report(tmp_path / "r.html", model, K, bla=bla, record=record, title=text, notes=text)
        robust.shaping.write_shaping_page(tmp_path / "s.html", model)
        return [Seen(tmp_path / name).found for name in ("r.html", "s.html")]

    assert pages(evil) == pages("plain")
