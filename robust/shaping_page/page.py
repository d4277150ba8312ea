"""One HTML file to shape a loop in: it holds its curves, its style and its script, and asks nobody for anything."""

from __future__ import annotations

import json
import os
from html import escape
from importlib.resources import files
from typing import Any

from nlfrf.shared.whole_files import path_of, write_text
from robust.shaping_page.content import page_content
from robust.shaping_page.words import Told

__all__ = ["page_text", "script", "style", "write_shaping_page"]

PAGE = """<!DOCTYPE html>
<html lang="en">
<head>
<meta charset="utf-8">
<meta name="viewport" content="width=device-width, initial-scale=1">
<meta name="generator" content="robust: page to shape a loop in">
<meta http-equiv="Content-Security-Policy"
 content="default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data: blob:">
<title>{title}</title>
<style>
{style}
</style>
</head>
<body class="shaping-sheet">
<main id="shaping"></main>
<noscript>This page computes as you drag: allow it to run its own script. It sends nothing to anybody.</noscript>
<script type="application/json" id="content">{content}</script>
<script type="module">
{script}
globalThis.shaping = start(document.getElementById("shaping"), JSON.parse(document.getElementById("content").text));
</script>
</body>
</html>
"""


def write_shaping_page(
    path: str | os.PathLike[str],
    model: Any,
    *,
    w_P: Any = None,
    K: Any = None,
    dt: float = 0.0,
    delay: float = 0.0,
    title: str = "Shape a loop",
) -> None:
    """Write a page to shape a loop in by hand: gain, integrator, lead, notch, roll-off dragged on |L|, live.

    One HTML file that runs in any browser, needs no server and sends no request. It shows |L| between its bounds,
    Nyquist with the discs of the set, rs, rp, S, T, the step response and a verdict *on a grid*, for several models at
    once; it writes PID gains, the Python to paste, and the command that proves. The page itself proves nothing.

    Parameters
    ----------
    path : path
        The ``.html`` file; written whole or not at all.
    model : UncertaintyModel or list of them
        The plant, or one for each level.
    w_P : control.StateSpace or TransferFunction, optional
        Performance weight.
    K : control.StateSpace, TransferFunction or float, optional
        Controller to begin with; what is shaped is multiplied to it.
    dt : float
        Sampling time [s] of the controller; 0 for that of K or of a sampled model, else continuous.
    delay : float
        Computation delay [s], as in `check`.
    title : str
        Heading.

    Raises
    ------
    ValueError
        A path that does not end in .html, a model on an FRF or of a form the page cannot compute with, sampling times
        that differ.
    FileNotFoundError
        A folder that does not exist.

    References
    ----------
    SP 2.6 (loop shaping), 7.5 and 7.6 (rs and rp).

    Examples
    --------
    >>> import tempfile
    >>> from pathlib import Path
    >>> import control
    >>> import numpy as np
    >>> from robust import UncertaintyModel
    >>> G, w = control.tf([1], [1, 1]), control.tf([0.2], [1])
    >>> model = UncertaintyModel(G, w, "multiplicative", np.array([1.0, 2.0]), np.array([0.1, 0.2]))
    >>> with tempfile.TemporaryDirectory() as folder:
    ...     write_shaping_page(Path(folder, "shape.html"), model, delay=0.1)
    ...     text = Path(folder, "shape.html").read_text(encoding="utf-8")
    >>> "default-src 'none'" in text, "src=" in text          # it may ask for nothing, and does not
    (True, False)
    """
    path = path_of(path)
    if path.suffix.lower() not in (".html", ".htm"):
        raise ValueError(f"path must end in .html, got {path.name!r}")
    write_text(path, page_text(page_content(model, w_P=w_P, K=K, dt=dt, delay=delay, told=Told(title=title))))


def page_text(content: dict[str, Any]) -> str:
    """The page, as text."""
    # "<" cannot end the script element that holds the content
    text = json.dumps(content, allow_nan=False, separators=(",", ":")).replace("<", "\\u003c")
    return PAGE.format(title=escape(content["title"]), style=style(), content=text, script=script())


def script() -> str:
    """The module of JavaScript that page and notebook share: `start(element, content, changed)`."""
    return "\n".join(part(name) for name in ("uplot/uPlot.iife.min.js", "arithmetic.js", "view.js"))


def style() -> str:
    """Its style sheet."""
    return "\n".join(part(name) for name in ("uplot/uPlot.min.css", "shape.css"))


def part(name: str) -> str:
    """A file of this wing; a closing tag inside would end the element that holds it."""
    text = files("robust.shaping_page").joinpath(name).read_text(encoding="utf-8")
    return text.replace("</script", "<\\/script").replace("</style", "<\\/style")
