"""The Library tab: all effects, searchable, each with a picture of what it does; one opens on the right."""

from __future__ import annotations

from typing import Any

import viser

from ema_model.effects import CATALOGUE, Effect
from ema_model.simulation.with_effect import WithEffect
from emaviz.figures.effect_signature import small_picture
from emaviz.page.job_line import JobLine
from emaviz.page.library.effect import EffectPage
from emaviz.page.page import Page
from emaviz.server.viser_private import selector_of
from emaviz.session.library import Library
from emaviz.text.html import add_html, unescaped
from emaviz.text.notes import note

_CARD = (
    "height:auto!important;min-height:52px;padding:4px 9px;font-weight:400;font-size:12px;"
    "background-color:rgba(134,142,150,.10)!important;color:inherit!important;"
)
_LABEL = "display:block;height:auto;overflow:visible;white-space:pre-line;text-align:left;line-height:1.3;width:100%"


class LibraryPanel:
    """Search and cards on the left."""

    def __init__(self, page: Page, library: Library, opened: EffectPage) -> None:
        self._page, self._library, self._effect = page, library, opened
        self._pictures: dict[str, str] = {}
        gui = page.server.gui
        self._search = gui.add_text("Search", "", hint="In names, equations and explanations")
        self._draw = gui.add_button(
            "Simulate all for their thumbnails",
            icon=viser.Icon.PHOTO,
            hint="Each where it shows most; the first time, the library is compiled, which takes some seconds",
        )
        JobLine(page, library.job)
        self._style = add_html(gui)
        self._cards = {name: self._card(effect) for name, effect in CATALOGUE.items()}
        self._none = add_html(gui, note("No effect of the library has this."), visible=False)
        self._draw_style()
        self._search.on_update(lambda event: event.client and page.screen.post("search", self._filter))
        self._draw.on_click(lambda _: self._run_all())
        library.events.said.connect(lambda text: page.screen.post("library says", lambda: opened.say(text)))
        library.events.drawn.connect(lambda felt: page.screen.post(f"drawn {felt.name}", lambda: self._drawn(felt)))
        library.events.felt.connect(lambda felt: page.screen.post("felt", lambda: opened.show(felt)))

    def _card(self, effect: Effect) -> Any:
        button = self._page.server.gui.add_button(f"{effect.title}\n{effect.shows}")
        button.on_click(lambda _: self._page.screen.post("open effect", lambda: self._effect.open(effect.name)))
        return button

    def _filter(self) -> None:
        words = str(self._search.value)[:100].lower().split()
        shown = 0
        with self._page.server.atomic():
            for name, button in self._cards.items():
                fits = all(word in _text(CATALOGUE[name]) for word in words)
                shown += fits
                if button.visible != fits:
                    button.visible = fits
            self._none.visible = shown == 0

    def _run_all(self) -> None:
        self._page.begins(self._library.draw_all, self._draw)

    def _drawn(self, felt: WithEffect) -> None:
        self._pictures[felt.name] = small_picture(felt)
        self._effect.best_runs[felt.name] = felt.run
        self._draw.color = "gray"
        self._draw_style()

    def _draw_style(self) -> None:
        rules = []
        for name, button in self._cards.items():
            one = selector_of(button)
            picture = self._pictures.get(name, "")
            if picture:
                picture = f'background-image:url("{picture}")!important;background-repeat:no-repeat!important;'
                picture += "background-position:right 6px center!important;background-size:120px 44px!important;"
                picture += "padding-right:130px!important;"
            rules.append(f"{one}{{{_CARD}{picture}}}{one} .mantine-Button-inner{{justify-content:flex-start}}")
            rules.append(f"{one} .mantine-Button-label{{{_LABEL}}}{one} .mantine-Button-label::first-line")
            rules.append("{font-weight:600;font-size:13.5px}")
        self._style.content = unescaped(f"<style>{''.join(rules)}</style>")


def _text(effect: Effect) -> str:
    parts = (effect.title, effect.name, effect.equation, effect.explanation, effect.shows, effect.mistaken_for)
    return " ".join(parts).lower()
