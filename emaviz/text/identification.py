"""How sure an identification is, on the page."""

from __future__ import annotations

from ema_model.identification.run import Identification
from ema_model.identification.words import remarks
from ema_model.text import COLOURS
from emaviz.text.html import Html, html, joined
from emaviz.text.notes import boxed


def sure_words(answer: Identification | None) -> Html:
    """HTML below the bars; empty while a search runs."""
    if answer is None:
        return Html()
    return joined(
        boxed(html('<b style="color:{}">{}</b>: {}', COLOURS[one.severity], _capital(one.head), one.line))
        for one in remarks(answer)
    )


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
