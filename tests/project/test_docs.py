"""The documentation builds without warnings, says what it should, and a browser shows it without
asking the network.
"""

import html
import inspect
import os
import re
import subprocess
import sys

import pytest

from docs import api, gallery
from tests.support.browser import browser

pytestmark = pytest.mark.docs


@pytest.fixture(scope="module")
def built():
    """The built pages, made once in a run of the tests; an example that a test has run is not run
    again.
    """
    out = gallery.ROOT / "build" / "docs"
    command = [
        sys.executable,
        "-m",
        "sphinx",
        "-W",
        "--keep-going",
        "-q",
        "-d",
        "build/doctrees",
        "docs",
        str(out),
    ]
    settings = {
        "cwd": gallery.ROOT,
        "env": os.environ | {"MPLBACKEND": "Agg"},
        "capture_output": True,
        "text": True,
    }
    out.parent.mkdir(exist_ok=True)
    this_run, last = os.environ.get("PYTEST_XDIST_TESTRUNUID", ""), out.parent / "docs.run"
    with gallery.only_one(out.parent / "docs.lock"):  # two processes of the suite share the folder
        if this_run and last.is_file() and last.read_text(encoding="utf-8") == this_run:
            return out
        last.unlink(missing_ok=True)
        done = subprocess.run(command, check=False, **settings)
        assert done.returncode == 0, done.stderr
        last.write_text(this_run, encoding="utf-8")
    return out


def page_of(built, full):
    """The page of a public name."""
    return (built / "generated" / "api" / f"{full}.html").read_text(encoding="utf-8")


def test_every_public_name_has_a_page(built):
    index = (built / "generated" / "api" / "index.html").read_text(encoding="utf-8")
    for module, name, thing in [*api.things(), *api.pictures()]:
        page = page_of(built, f"{module}.{name}")
        assert f'href="{module}.{name}.html' in index
        assert f'id="{module}.{name}"' in page, "the page documents another name"
        assert inspect.getdoc(thing)
        assert 'class="viewcode-link' in page, f"{name} does not lead to its source"


def test_the_reference_begins_with_what_most_scripts_need(built):
    index = (built / "generated" / "api" / "index.html").read_text(encoding="utf-8")
    listed = re.findall(r'<tr class="row-\w+"><td><p><a [^>]*title="([\w.]+)"', index)
    assert listed[0] == "nlfrf.identify"
    assert tuple(listed[: len(api.FIRST)]) == api.FIRST


def test_every_example_has_a_page_with_what_it_printed_its_time_and_its_files(built):
    folder = built / "generated" / "examples"
    for name in gallery.names():
        page = (folder / f"{name}.html").read_text(encoding="utf-8")
        first = gallery.printed(name).splitlines()[0]
        assert first.strip() in html.unescape(re.sub(r"<.*?>", "", page)), name
        assert "<img" in page
        assert "Total running time of the script" in page or gallery.lacks_records(name)
        for kind in ("py", "ipynb"):
            (target,) = set(re.findall(rf'href="(\S+/{name}\.{kind})"', page))
            assert (folder / target).resolve().is_file()


def test_an_example_without_its_records_shows_what_it_once_gave(monkeypatch, tmp_path):
    monkeypatch.setenv("NLFRF_DATA", str(tmp_path))
    for name in gallery.WHERE:
        source = ["the script"]
        gallery.show_stored_outputs(None, f"{gallery.HERE}/{name}", source)
        assert "were not there when this page was built" in source[0]
        assert f"/_static/{name}/printed.txt" in source[0]
        assert "STATISTICALLY ROBUST" in gallery.printed(name)
        assert not re.search(gallery.settings()["filename_pattern"], f"{os.sep}{name}.py")
    assert re.search(gallery.settings()["filename_pattern"], f"{os.sep}01_identify_then_design.py")


def test_a_browser_shows_it(built, tmp_path):
    with browser(tmp_path / "profile") as page:
        for name in (
            "index.html",
            "generated/examples/index.html",
            "generated/examples/04_compare_grids.html",
        ):
            page.open(built / name)
            assert page.errors == [], name
            outside = [url for url in page.requests if not url.startswith(("file://", "data:"))]
            assert outside == [], name
            assert page.run("[...document.images].every(i => i.complete && i.naturalWidth > 0)"), (
                name
            )
            assert page.run("document.documentElement.scrollWidth <= innerWidth + 1"), name


def test_every_card_shows_one_picture_that_says_something(built):
    cards = (built / "generated" / "examples" / "index.html").read_text(encoding="utf-8")
    for name in gallery.names():
        assert f"sphx_glr_{name}_thumb.png" in cards
        assert (built / "_images" / f"sphx_glr_{name}_thumb.png").stat().st_size > 4000


def test_the_letters_of_a_card_can_be_read(tmp_path):
    """The axes alone, in few inches: a card is 320 pixels wide at least, and its text 9 pixels high
    or more.
    """
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot as plt

    figure, axes = plt.subplots(2, 2, figsize=(14, 9), layout="constrained")
    for ax in axes.flat:
        ax.loglog([1, 10, 1000], [1e-6, 1e-3, 1e-5], label="a curve")
        ax.set(
            xlabel="frequency [Hz]",
            ylabel="motion left, over the motion in the burst (at most one)",
            title="A title that is longer than a card is wide, by far, "
            + "and longer than two rows of it" * 2,
        )
        ax.legend()
    figure.suptitle("of all")
    gallery.save_axes(figure, 3, tmp_path / "card.png")
    assert plt.imread(tmp_path / "card.png").shape[1::-1] == gallery.THUMBNAIL
    ax, whole = axes[1, 1], figure.bbox
    texts = [ax.title, ax.xaxis.label, ax.yaxis.label, *ax.get_xticklabels(), *ax.get_yticklabels()]
    assert min(text.get_fontsize() for text in texts) / 72 / gallery.CARD_INCHES[0] * 320 >= 9
    box = ax.get_tightbbox()
    assert 0 <= box.x0 < box.x1 <= whole.width
    assert 0 <= box.y0 < box.y1 <= whole.height
    assert [ax.get_visible() for ax in figure.axes].count(True) == 1
    plt.close(figure)


def test_equations_are_drawn_by_the_browser_itself(built):
    page = (built / "guide" / "primer.html").read_text(encoding="utf-8")
    assert page.count("<math") >= 10
    assert not re.search(r"<script[^>]*(mathjax|http)", page, re.IGNORECASE)


def page_source(name):
    """A hand-written page as Sphinx reads it, with links to what is built."""
    source = [(gallery.ROOT / "docs" / f"{name}.md").read_text(encoding="utf-8")]
    api.link_to_pages(None, name, source)
    return source[0]


def tasks():
    """(what, target) of the rows of the page that says where each task is."""
    rows = page_source("howto/index")
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


def test_the_front_page_says_what_it_is_and_how_to_begin(built, tmp_path):
    """In one screen of a laptop: the picture, the line that installs, a first result; the groups of
    the sidebar.
    """
    page = (built / "index.html").read_text(encoding="utf-8")
    captions = re.findall(r'<p class="caption"[^>]*><span class="caption-text">(.*?)</span>', page)
    assert captions == ["Start", "How to", "Understand", "Reference"]
    assert "pip install" in re.sub(r"<.*?>", "", page)
    with browser(tmp_path / "profile") as opened:
        opened.ask(
            "Emulation.setDeviceMetricsOverride",
            width=1400,
            height=1000,
            deviceScaleFactor=1,
            mobile=False,
        )
        opened.open(built / "index.html")
        shown = "[...document.querySelectorAll('article img, article pre')]"
        assert opened.run(f"Math.max(...{shown}.map(e => e.getBoundingClientRect().bottom))") < 1080


def test_every_link_of_a_page_leads_to_a_file_of_a_clone():
    """Pages under generated/ exist only where the documentation was built."""
    pages = [
        page for page in (gallery.ROOT / "docs").rglob("*.md") if "generated" not in page.parts
    ]
    assert len(pages) > 20
    for page in pages:
        for target in re.findall(r"(?<!!)\]\(([^)\s#]+)[^)]*\)", page.read_text(encoding="utf-8")):
            if "://" not in target:
                there = (page.parent / target).resolve()
                assert there.exists(), (page, target)
                assert "generated" not in there.parts, (page, target)


def test_the_paper_cites_what_it_lists_and_states_what_was_measured():
    folder = gallery.ROOT / "docs" / "paper"
    paper = (folder / "paper.md").read_text(encoding="utf-8")
    listed = re.findall(
        r"^@\w+\{(\w+),", (folder / "paper.bib").read_text(encoding="utf-8"), re.MULTILINE
    )
    assert set(re.findall(r"@(\w+)", paper)) == set(listed)
    quality = paper.split("# Quality of the results")[1].split("# References")[0]
    measured = (gallery.ROOT / "docs" / "guide" / "measured.md").read_text(encoding="utf-8")
    numbers = re.findall(r"\b\d[\d.]*\d", quality)
    assert len(numbers) > 15
    assert [number for number in numbers if number not in measured] == []


def test_links_to_the_tree_become_links_to_pages():
    source = [
        "[`tune`](../../robust/x.py), [all](../examples), [2](../../examples/02_a.py),"
        " [it](../../robust/y.py)"
    ]
    api.link_to_pages(None, "howto/index", source)
    assert source == [
        "[`tune`](../generated/api/robust.tune.rst), [all](../generated/examples/index.rst), "
        "[2](../generated/examples/02_a.rst), [it](../../robust/y.py)"
    ]
    source = ["[`structured_text`](../robust/drive/plc.py)"]
    api.link_to_pages(None, "faq", source)
    assert source == ["[`structured_text`](generated/api/robust.servo.structured_text.rst)"]


def questions():
    """(question, target of each link in its answer) of the page of questions."""
    text = page_source("faq")
    parts = re.findall(r"^\*\*(.+?)\*\*\n(.*?)(?=^\*\*|\Z)", text, re.MULTILINE | re.DOTALL)
    return [(question, re.findall(r"\]\(([^)]+)\)", answer)) for question, answer in parts]


def test_questions_of_the_desk_are_answered_within_two_clicks(built):
    assert 'href="faq.html"' in (built / "index.html").read_text(encoding="utf-8")
    page = (built / "faq.html").read_text(encoding="utf-8")
    assert len(questions()) >= 12
    for asked in (
        "How long",
        "which level",
        "How many periods",
        "statistically robust",
        "TwinCAT",
        "another confidence",
    ):
        assert any(asked in question for question, _ in questions()), asked
    for question, targets in questions():
        assert targets, question
        for target in targets:
            path = re.sub(r"\.(md|rst)", ".html", target)
            assert f'href="{path}"' in page, target
            file, _, anchor = path.partition("#")
            assert not anchor or f'id="{anchor}"' in (built / file).read_text(encoding="utf-8"), (
                target
            )


def test_a_search_finds_what_an_engineer_calls_it(built, tmp_path):
    wanted = {
        "bode phase": "guide/primer.html",
        "backlash": "guide/primer.html",
        "PLC": "howto/csv_to_pid.html",
        "MIMO": "howto/machines.html",
        "closed loop reference": "howto/closed_loop.html",
        "gain margin": "generated/api/robust.margins.disk_margin.html",
        "biquads": "howto/csv_to_pid.html",
        "statistically robust": "guide/bounds.html",
        "tune a PID": "howto/csv_to_pid.html",
        "choose the amplitude": "howto/which_signal.html",
        "a weight of my own": "howto/own_weight.html",
        "all functions": "generated/api/index.html",
        "hand the model to python-control": "howto/python_control.html",
    }
    with browser(tmp_path / "profile") as page:
        for words, target in wanted.items():
            page.open(built / "index.html")
            address = (built / "search.html").resolve().as_uri() + "?q=" + words.replace(" ", "+")
            page.ask("Page.navigate", url=address)
            found = page.wait(
                "new Promise(done => { const look = () => { const hits ="
                " [...document.querySelectorAll('ul.search a')]; if"
                " (document.querySelector('.search-summary')?.textContent.match(/finished|did"
                " not/)) done(hits.map(a => a.getAttribute('href').split('?')[0])); else"
                " setTimeout(look, 50); }; look(); })"
            )
            assert target in [hit.split("#")[0] for hit in found][:3], words
            assert page.errors == [], words


def test_a_name_leads_to_what_returns_it_to_the_guide_and_to_examples(built):
    page = page_of(built, "robust.check")
    for target in (
        "guide/bounds.html",
        "10_check_and_certificate.html",
        "_modules/robust/analysis/robustness.html",
    ):
        assert target in page, target
    assert "robust.check.html" in page_of(built, "robust.RobustnessReport")
    assert "robust.uncertainty.html" in page_of(built, "robust.UncertaintyModel")


def test_a_signature_shows_values_and_an_author_is_no_list_item(built):
    for module, name, _ in [*api.things(), *api.pictures()]:
        page = page_of(built, f"{module}.{name}")
        defaults = re.findall(r'<span class="default_value">(.*?)</span></em>', page)
        assert not [
            one for one in defaults if re.fullmatch(r"[A-Z][A-Z_]+", re.sub("<.*?>", "", one))
        ], name
        assert '<ol class="upperalpha' not in page, name


def test_docstrings_are_plain_text_with_emphasis_and_code():
    assert (
        api.escaped("|G| and b* are *not* `|x|`, np_ is")
        == r"\|G\| and b\* are *not* `|x|`, np\_ is"
    )
    assert api.escaped("A. Rantzer, SCL 28, 1996.") == r"A\. Rantzer, SCL 28, 1996."
