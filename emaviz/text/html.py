"""Text on the page: what comes from files and people is shown as it is, and never becomes markup.

A name of a file, a column or an actuator, an expression, an error that quotes them: all are plain text.  `html` puts
them into a template of ours, escaped.  `add_html` is the one place from which the page gets HTML: what was not made by
`html` is plain text to it, and shown letter by letter.  Markdown on the page is for texts of our own alone, as its
renderer takes HTML and turns bare addresses into links.
"""

from __future__ import annotations

import string
from collections.abc import Iterable
from html import escape as _escape
from typing import TYPE_CHECKING, Any, LiteralString

from ema_model.text import Document, Table

if TYPE_CHECKING:
    import viser


class Html(str):
    """Text that is HTML already: literals of ours, and what the functions below return.  Foreign text never is."""

    __slots__ = ()

    def __new__(cls, literal: LiteralString = "") -> Html:
        return str.__new__(cls, literal)

    def __add__(self, other: str) -> Html:
        return unescaped(str.__add__(self, escape(other)))

    def __radd__(self, other: str) -> Html:
        return unescaped(str.__add__(escape(other), self))


def unescaped(text: str) -> Html:
    """Text that is taken for HTML as it is: for style sheets and drawings, made of numbers and colours of ours."""
    return str.__new__(Html, text)


def escape(value: object) -> Html:
    """As HTML shows it, in an element or in a quoted attribute; HTML stays what it is."""
    return value if isinstance(value, Html) else unescaped(_escape(str(value), quote=True))


def html(template: LiteralString, *values: object, **named: object) -> Html:
    """A template as of `str.format`, its values escaped; only a literal can be one, so no name gets into it."""
    return unescaped(_ESCAPING.vformat(template, values, named))


def joined(parts: Iterable[str], between: LiteralString = "") -> Html:
    """Pieces one after another, escaped where they are plain text."""
    return unescaped(between.join(escape(part) for part in parts))


def table_of(told: Table | None, title: str) -> Html:
    """A table of a result's document, folded below its title; nothing for none."""
    if told is None:
        return Html()
    remarks = told.remarks or [""] * len(told.rows)
    lines = []
    for i, (row, remark) in enumerate(zip(((told.title, *told.head), *told.rows), ("", *remarks))):
        shade = ";font-weight:400;opacity:.65" if i == 0 else ""
        sides = ("left", *(["right"] * len(told.head)))
        cells = [html('<td style="text-align:{}{}">{}</td>', side, shade, text) for side, text in zip(sides, row)]
        lines.append(html('<tr>{}<td style="padding-left:8px;opacity:.65">{}</td></tr>', joined(cells), remark))
    style = "width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums"
    return html(
        '<details><summary style="cursor:pointer">{} <span style="opacity:.65">{}</span></summary>'
        '<table style="{}">{}</table></details>',
        title,
        told.unit,
        style,
        joined(lines),
    )


def document_html(told: Document) -> Html:
    """All that a result says, as a notebook shows it: its blocks escape what is not theirs."""
    return html('<div style="padding:2px 12px;font-size:12.5px;overflow-x:auto">{}</div>', unescaped(told.html))


def add_html(gui: viser.GuiApi, content: str = "", *, visible: bool = True) -> HtmlPiece:
    """A piece of the page; plain text is shown as it is."""
    return HtmlPiece(gui.add_html(_sent(content), visible=visible))


class HtmlPiece:
    """A piece of the page that can be written anew."""

    def __init__(self, handle: viser.GuiHtmlHandle) -> None:
        self._handle: Any = handle

    @property
    def content(self) -> Html:
        """What it shows.  Plain text that is set is escaped."""
        return unescaped(self._handle.content)

    @content.setter
    def content(self, content: str) -> None:
        self._handle.content = _sent(content)

    def remove(self) -> None:
        """Takes it off the page."""
        self._handle.remove()

    @property
    def visible(self) -> bool:
        """Whether it is seen."""
        return self._handle.visible

    @visible.setter
    def visible(self, visible: bool) -> None:
        self._handle.visible = visible


def said(text: str) -> Html:
    """A line or more in the page's ordinary size, as below a button; nothing for no text."""
    return html('<div style="padding:0 12px 10px;font-size:14px;line-height:1.55">{}</div>', text) if text else Html()


def _sent(content: str) -> str:
    """What goes to the browser, which viser packs only as a `str` and no kind of it."""
    return str(escape(content))


class _Escaping(string.Formatter):
    def format_field(self, value: Any, format_spec: str) -> str:
        return escape(value if isinstance(value, Html) and not format_spec else format(value, format_spec))


_ESCAPING = _Escaping()
