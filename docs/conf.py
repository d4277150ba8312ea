"""Sphinx: `make docs` builds build/docs from the pages here, the docstrings, and the examples as they ran."""

import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import nlfrf  # noqa: E402
from docs import api, commands, gallery  # noqa: E402

project = "nlfrf and robust"
author = "The nlfrf developers"
copyright = author
version = release = nlfrf.__version__
extensions = ["sphinx.ext.autodoc", "sphinx.ext.napoleon", "myst_parser"]
exclude_patterns = ["_static"]
default_role = "code"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False
napoleon_custom_sections = [("Fields", "params_style"), ("Warns", "params_style")]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
autodoc_preserve_defaults = True
myst_enable_extensions = ["colon_fence"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"nlfrf and robust {release}"
html_static_path = ["_static"]
html_css_files = ["gallery.css"]
html_copy_source = False
html_show_sphinx = False
pygments_style = "default"


def setup(app):
    """Write the pages that are made from the code before Sphinx looks for pages."""
    generated = HERE / "generated"
    api.write_pages(generated / "api")
    commands.write_page(generated / "commands.md")
    gallery.write_pages(generated / "examples")
    app.connect("autodoc-process-docstring", api.escape_docstring, priority=400)
