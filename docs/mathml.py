"""Equations as MathML, which browsers draw by themselves: nothing is fetched, nothing runs."""

from __future__ import annotations

from typing import Any

from docutils.utils.math.latex2mathml import tex2mathml


def inline(self: Any, node: Any) -> None:
    """An equation in a line."""
    self.body.append(tex2mathml(node.astext(), as_block=False))
    raise_skip()


def block(self: Any, node: Any) -> None:
    """An equation of its own."""
    self.body.append(f'<div class="math">{tex2mathml(node.astext(), as_block=True)}</div>')
    raise_skip()


def raise_skip() -> None:
    """Nothing below the node is to be visited."""
    from docutils.nodes import SkipNode

    raise SkipNode


def setup(app: Any) -> dict[str, bool]:
    """The renderer "mathml"."""
    app.add_html_math_renderer("mathml", (inline, None), (block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
