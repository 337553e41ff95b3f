"""The guided first challenge: one short text at a time, chosen by how far the story is."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ema_model.discovery.shown.labels import effect_title
from ema_model.discovery.steps.snapshot import Look
from ema_model.quantities.numbers import number
from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import Html, add_html, html, said

STEPS = 6


def step(look: Look | None, running: bool, opened: str | None, revealed: bool) -> tuple[int, Html]:
    """The number of the step, 1 … STEPS, and what to do."""
    if look is None and not running:
        return 1, Html(
            "Read the challenge's story below. Then press <b>Start</b>: the model is calibrated to the measurements."
        )
    if look is not None and look.removable and look.assessment is None:
        return 4, Html(
            "The effect is in the model, and all its parameters are fitted anew; what that leaves is compared with "
            "the library again."
        )
    if look is None or look.assessment is None:
        return 2, Html(
            "The model's parameters move within their tolerances until it fits as well as it can; then every effect "
            "of the library is compared with the residual. This takes some seconds."
        )
    if not look.removable and opened is None:
        return 3, html(
            "Even calibrated, the error is <b>{} times the floor</b>: physics is missing. "
            "Click the <b>first card</b> below: its bar is the share of the error that it would take away.",
            number(look.rmse),
        )
    if not look.removable:
        name = effect_title(opened or "")
        return 4, html(
            "On the right, {} would follow the orange line, and the blue points are what the model lacks. "
            "Where the two lie together, this is it. Press <b>Add it to the model</b>.",
            name.lower(),
        )
    if not look.found.at_floor:
        return 5, Html(
            "The ladder fell, but not to the floor. Take the step back with <b>Undo</b>, or add the next card."
        )
    if not revealed:
        return 5, Html(
            "The ladder on the right has fallen <b>to the floor</b>, on the measurement that was not fitted as well. "
            "Press <b>Reveal the truth</b> on the right to compare."
        )
    return 6, Html(
        "That is the whole story: see where a model fails, learn what is missing, add it, watch the error fall. "
        "Choose the next challenge, or open measurements of your own on <b>Compare</b>."
    )


class Guide:
    """A box on top of the tab, there while its challenge is shown; begin() chooses that, on the screen's thread."""

    def __init__(self, page: Page, discovering: Discovering, begin: Callable[[], None]) -> None:
        self._discovering, self._begin = discovering, begin
        self._on = False
        self._challenge = ""  # that it speaks of
        self._last: tuple[Look | None, str | None] = (None, None)
        gui = page.server.gui
        self._offer = gui.add_button("Guided first challenge", icon=viser.Icon.SCHOOL, hint="About three minutes")
        self._folder = gui.add_folder("Guide", visible=False)
        with self._folder:
            self._text = add_html(gui)
            end = gui.add_button("Leave the guide", icon=viser.Icon.X, color="gray")
        self._offer.on_click(lambda _: page.screen.post("guide", self._start))
        end.on_click(lambda _: page.screen.post("guide", self._end))
        discovering.events.revealed.connect(lambda: page.screen.post("guide", self.refresh))
        discovering.job.began.connect(lambda _: page.screen.post("guide", self.refresh))

    def show(self, look: Look | None, opened: str | None) -> None:
        """The story is here now; on the screen's thread."""
        self._last = (look, opened)
        self.refresh()

    def refresh(self) -> None:
        """Says what is to be done now; on the screen's thread."""
        here = self._on and self._discovering.source.chosen == self._challenge
        self._folder.visible = here
        self._offer.visible = not self._on and self._last[0] is None
        if here:
            look, opened = self._last
            at, text = step(look, self._discovering.running, opened, self._discovering.source.revealed)
            line = said(html("<b>Step {} of {}.</b> {}", at, STEPS, text))
            if self._text.content != line:
                self._text.content = line

    def _start(self) -> None:
        self._begin()
        self._on = True
        self._challenge = self._discovering.source.chosen
        self.refresh()

    def _end(self) -> None:
        self._on = False
        self.refresh()
