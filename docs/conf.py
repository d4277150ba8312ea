"""Sphinx: `make docs` builds build/docs from the pages here, the docstrings, and the examples as
they ran.
"""

import os
import sys
from pathlib import Path

HERE = Path(__file__).resolve().parent
sys.path.insert(0, str(HERE.parent))

import nlfrf  # noqa: E402
from docs import api, commands, drawings, gallery  # noqa: E402

project = "nlfrf and robust"
author = "The nlfrf developers"
copyright = author
version = release = nlfrf.__version__
extensions = [
    *("sphinx.ext.autodoc", "sphinx.ext.autosummary", "sphinx.ext.napoleon", "sphinx.ext.viewcode"),
    *(
        "sphinx.ext.intersphinx",
        "sphinx_gallery.gen_gallery",
        "sphinx_copybutton",
        "myst_parser",
        "docs.mathml",
    ),
]
html_math_renderer = "mathml"
exclude_patterns = ["_static", "generated/backreferences", "paper"]
templates_path = ["_templates"]
# What an engineer calls a function whose name differs: the search lists its page first.
autosummary_context = {"index_entries": {"robust.margins.disk_margin": "gain margin"}}
sphinx_gallery_conf = gallery.settings()
copybutton_prompt_text = r">>> |\.\.\. |\$ "
copybutton_prompt_is_regexp = True
default_role = "code"
napoleon_google_docstring = False
napoleon_use_rtype = False
napoleon_use_param = False
napoleon_custom_sections = [("Fields", "params_style"), ("Warns", "params_style")]
autodoc_member_order = "bysource"
autodoc_typehints = "none"
myst_enable_extensions = ["colon_fence", "dollarmath"]
myst_heading_anchors = 3
html_theme = "furo"
html_title = f"nlfrf and robust {release}"
html_static_path = ["_static"]
html_css_files = ["gallery.css"]
html_copy_source = False
html_show_search_summary = False  # they are fetched, which a page opened from a folder may not do
# Links into other people's documentation need their inventories, which need the network: only where
# it is asked for.
intersphinx_timeout = 10
intersphinx_mapping = (
    {
        "python": ("https://docs.python.org/3", None),
        "numpy": ("https://numpy.org/doc/stable", None),
        "scipy": ("https://docs.scipy.org/doc/scipy", None),
        "matplotlib": ("https://matplotlib.org/stable", None),
        "control": ("https://python-control.readthedocs.io/en/latest", None),
    }
    if os.environ.get("DOCS_LINKS")
    else {}
)
html_show_sphinx = False
pygments_style = "default"


def setup(app):
    """Write the pages that are made from the code before Sphinx looks for pages."""
    generated = HERE / "generated"
    api.write_index(generated / "api" / "index.rst")
    commands.write_page(generated / "commands.md")
    for name in gallery.names():
        gallery.outputs(name)
    drawings.draw_all(generated / "drawings")
    app.connect("autodoc-process-docstring", api.escape_docstring, priority=400)
    app.connect("autodoc-process-docstring", api.add_uses, priority=600)
    app.connect("doctree-read", api.leave_out_of_contents, priority=100)
    app.connect("source-read", gallery.show_stored_outputs)
    app.connect("source-read", api.link_to_pages)
