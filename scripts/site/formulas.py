"""Formulas as MathML, which browsers draw themselves: no script and no font of another host."""

from __future__ import annotations

from typing import Any

from docutils import nodes
from latex2mathml.converter import convert

# an accent that is drawn apart touches the letter if the browser has no font for formulas
HAT = '<mover accent="true"><mi>u</mi><mo>&#x0005E;</mo></mover>'
WHOLE = '<mi style="font-style: italic">û</mi>'


def inline(translator: Any, node: nodes.Element) -> None:
    """A formula in a line."""
    translator.body.append(convert(node.astext()).replace(HAT, WHOLE))
    raise nodes.SkipNode


def display(translator: Any, node: nodes.Element) -> None:
    """Formulas on their own, one a line."""
    lines = [line for line in node.astext().splitlines() if line.strip()]
    formulas = "".join(convert(line, display="block") for line in lines)
    translator.body.append(f'<div class="math">{formulas.replace(HAT, WHOLE)}</div>')
    raise nodes.SkipNode
