"""Small texts between the page's controls."""

from __future__ import annotations

from collections.abc import Sequence

from emaviz.text.html import Html, html, joined

BOX = Html('style="padding:2px 12px 6px;font-size:13px;line-height:1.45"')
DIM = Html('style="opacity:.65"')


_CARD = (
    "max-width:600px;margin:7vh auto 0;padding:18px 26px 20px;border:1px dashed rgba(134,142,150,.6);"
    "border-radius:8px;font-size:14px;line-height:1.55"
)


def begin(title: str, steps: Sequence[str]) -> Html:
    """Where there is no result yet: what to do, and what comes of it."""
    rows = joined(html('<li style="padding:3px 0">{}</li>', step) for step in steps)
    return html(
        '<div class="emaviz-all-columns" style="{}">'
        '<div style="font-size:17px;font-weight:600;padding-bottom:6px">{}</div>'
        '<ol style="margin:0;padding-left:20px">{}</ol></div>',
        _CARD,
        title,
        rows,
    )


def boxed(content: str) -> Html:
    """Plain text or HTML, as wide as the controls' names."""
    return html("<div {}>{}</div>", BOX, content)


def note(text: str) -> Html:
    """A line of small print."""
    return boxed(html("<span {}>{}</span>", DIM, text))
