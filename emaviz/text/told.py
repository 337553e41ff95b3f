"""What a result says, on the page: its document's blocks, and how an answer begins."""

from __future__ import annotations

from collections.abc import Iterable

from ema_model.text import COLOURS, Block, Document, Table
from emaviz.text.html import Html, html, joined, unescaped
from emaviz.text.sentence import begun
from emaviz.text.verdict import MEANINGS, Meaning


def shown(block: Block | None) -> Html:
    """A block of a document, escaped by itself; nothing for none."""
    return Html() if block is None else unescaped(block.html)


def whole(told: Document) -> Html:
    """All that a result says, as a notebook shows it: its blocks escape what is not theirs."""
    return html('<div style="padding:2px 12px;font-size:12.5px;overflow-x:auto">{}</div>', unescaped(told.html))


def folded(title: str, told: Table | None) -> Html:
    """A table below its title, which opens it; nothing for none."""
    if told is None:
        return Html()
    return html('<details><summary style="cursor:pointer">{}</summary>{}</details>', title, shown(told))


def large(text: str, meaning: Meaning) -> Html:
    """The answer in one line."""
    style = f"font-size:16px;font-weight:600;color:{MEANINGS[meaning]};padding:4px 0"
    return html('<div style="{}">{}</div>', style, text)


def warned(warnings: Iterable[str], names: Iterable[str] = ()) -> Html:
    """A line for each warning; names that may stand first in one stay as they are written."""
    style = f"color:{COLOURS['warning']};overflow-wrap:anywhere"
    return joined(html('<div style="{}">▲ {}</div>', style, begun(text, names)) for text in warnings)
