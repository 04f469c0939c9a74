"""Equations as MathML, which browsers show by themselves: the site loads nothing from elsewhere."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert
from sphinx.application import Sphinx


def inline(self: Any, node: nodes.math) -> None:
    self.body.append(convert(node.astext()))
    raise nodes.SkipNode


def block(self: Any, node: nodes.math_block) -> None:
    self.body.append(f"<div class='equation'>{convert(node.astext(), display='block')}</div>")
    raise nodes.SkipNode


def setup(app: Sphinx) -> dict[str, bool]:
    app.add_node(nodes.math, override=True, html=(inline, None))
    app.add_node(nodes.math_block, override=True, html=(block, None))
    return {"parallel_read_safe": True, "parallel_write_safe": True}
