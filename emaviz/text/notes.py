"""Small texts between the page's controls."""

from __future__ import annotations

from emaviz.text.html import Html, html

BOX = Html('style="padding:2px 12px 6px;font-size:13px;line-height:1.45"')
DIM = Html('style="opacity:.65"')


def boxed(content: str) -> Html:
    """Plain text or HTML, as wide as the controls' names."""
    return html("<div {}>{}</div>", BOX, content)


def note(text: str) -> Html:
    """A line of small print."""
    return boxed(html("<span {}>{}</span>", DIM, text))
