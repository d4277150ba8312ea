"""The documentation builds without warnings, says what it should, and a browser shows it without asking the network."""

import inspect
import os
import re
import subprocess
import sys

import pytest

from docs import api, gallery
from tests.support.browser import browser


@pytest.fixture(scope="module")
def built():
    """The built pages; the examples have run before, or run now, in this process."""
    for name in gallery.names():
        gallery.outputs(name)
    out = gallery.ROOT / "build" / "docs"
    command = [sys.executable, "-m", "sphinx", "-W", "--keep-going", "-q", "-d", "build/doctrees", "docs", str(out)]
    done = subprocess.run(
        command, cwd=gallery.ROOT, env=os.environ | {"MPLBACKEND": "Agg"}, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stderr
    return out


def test_every_public_name_and_example_has_a_page(built):
    index = (built / "generated" / "api" / "index.html").read_text(encoding="utf-8")
    for module, name, thing in [*api.things(), *api.pictures()]:
        page = (built / "generated" / "api" / f"{module}.{name}.html").read_text(encoding="utf-8")
        assert f"{module}.{name}.html" in index
        assert f'id="{module}.{name}"' in page, "the page documents another name"
        assert inspect.getdoc(thing)
    for name in gallery.names():
        page = (built / "generated" / "examples" / f"{name}.html").read_text(encoding="utf-8")
        printed = (gallery.shown_folder(name)[0] / "printed.txt").read_text(encoding="utf-8")
        assert re.sub(r"[<>&\"']", "", printed.splitlines()[0])[:20].strip()[:8] in page
        assert "<img" in page
        if (gallery.outputs(name) / "printed.txt").read_text(encoding="utf-8").startswith("skipped"):
            assert "below stands what the example drew" in page
            assert "STATISTICALLY ROBUST" in page


def test_a_browser_shows_it(built, tmp_path):
    with browser(tmp_path / "profile") as page:
        for name in ("index.html", "generated/examples/index.html", "generated/examples/04_compare_grids.html"):
            page.open(built / name)
            assert page.errors == [], name
            outside = [url for url in page.requests if not url.startswith(("file://", "data:"))]
            assert outside == [], name
            assert page.run("[...document.images].every(i => i.complete && i.naturalWidth > 0)"), name
            assert page.run("document.documentElement.scrollWidth <= innerWidth + 1"), name


def test_every_card_shows_one_picture_that_says_something(built):
    cards = (built / "generated" / "examples" / "index.html").read_text(encoding="utf-8")
    for name in gallery.names():
        if list(gallery.outputs(name).glob("*.png")):
            assert f'src="heroes/{name}.png"' in cards
            assert (built / "generated" / "examples" / "heroes" / f"{name}.png").stat().st_size > 4000


def test_equations_are_drawn_by_the_browser_itself(built):
    page = (built / "guide" / "primer.html").read_text(encoding="utf-8")
    assert page.count("<math") >= 10
    assert not re.search(r"<script[^>]*(mathjax|http)", page, re.IGNORECASE)


def tasks():
    """(what, target) of the rows of the page that says where each task is."""
    rows = (gallery.ROOT / "docs" / "howto" / "index.md").read_text(encoding="utf-8")
    return re.findall(r"^\| (?!how do I)(.+?) \| \[.*?\]\((.+?)\) \|$", rows, re.MULTILINE)


def test_forty_tasks_are_two_clicks_away(built):
    """From the first page to the list of tasks, and from there to the page of each."""
    assert len(tasks()) >= 40
    assert len({what for what, _ in tasks()}) == len(tasks())
    assert 'href="howto/index.html"' in (built / "index.html").read_text(encoding="utf-8")
    listed = (built / "howto" / "index.html").read_text(encoding="utf-8")
    for what, target in tasks():
        page = re.sub(r"\.(md|rst)$", ".html", target)
        assert f'href="{page}"' in listed, what
        assert (built / "howto" / page).resolve().is_file(), what


def test_a_search_finds_what_an_engineer_calls_it(built, tmp_path):
    wanted = {
        "bode phase": "guide/primer.html",
        "backlash": "guide/primer.html",
        "PLC": "howto/csv_to_pid.html",
        "MIMO": "howto/machines.html",
        "closed loop reference": "howto/closed_loop.html",
        "gain margin": "generated/api/robust.disk_margin.html",
        "biquads": "howto/index.html",
    }
    with browser(tmp_path / "profile") as page:
        for words, target in wanted.items():
            page.open(built / "index.html")
            address = (built / "search.html").resolve().as_uri() + "?q=" + words.replace(" ", "+")
            page.ask("Page.navigate", url=address)
            found = page.run(
                "new Promise(done => { const look = () => { const hits = [...document.querySelectorAll('ul.search a')];"
                " if (document.querySelector('.search-summary')?.textContent.match(/finished|did not/))"
                " done(hits.map(a => a.getAttribute('href').split('?')[0])); else setTimeout(look, 50); }; look(); })"
            )
            assert target in [hit.split("#")[0] for hit in found], words
            assert page.errors == [], words


def test_names_lead_to_their_kin_types_guide_and_examples(built):
    page = (built / "generated" / "api" / "robust.check.html").read_text(encoding="utf-8")
    for target in (
        "robust.worst_case.html",
        "robust.UncertaintyModel.html",
        "guide/bounds.html",
        "10_check_and_certificate.html",
    ):
        assert target in page, target
    for module, name, _ in [*api.things(), *api.pictures()]:
        assert "Beside it" in (built / "generated" / "api" / f"{module}.{name}.html").read_text(encoding="utf-8"), name


def test_docstrings_are_plain_text_with_emphasis_and_code():
    assert api.escaped("|G| and b* are *not* `|x|`, np_ is") == r"\|G\| and b\* are *not* `|x|`, np\_ is"
