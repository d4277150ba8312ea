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
        printed = (gallery.outputs(name) / "printed.txt").read_text(encoding="utf-8")
        assert re.sub(r"[<>&\"']", "", printed.splitlines()[0])[:20].strip()[:8] in page
        assert ("<img" in page) == (not printed.startswith("skipped"))


def test_a_browser_shows_it(built, tmp_path):
    with browser(tmp_path / "profile") as page:
        for name in ("index.html", "generated/examples/index.html", "generated/examples/04_compare_grids.html"):
            page.open(built / name)
            assert page.errors == [], name
            outside = [url for url in page.requests if not url.startswith(("file://", "data:"))]
            assert outside == [], name
            assert page.run("[...document.images].every(i => i.complete && i.naturalWidth > 0)"), name
            assert page.run("document.documentElement.scrollWidth <= innerWidth + 1"), name


def test_docstrings_are_plain_text_with_emphasis_and_code():
    assert api.escaped("|G| and b* are *not* `|x|`, np_ is") == r"\|G\| and b\* are *not* `|x|`, np\_ is"
