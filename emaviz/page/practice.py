"""Challenges on a tab: a button for each, the story of the one that is chosen, and its seal."""

from __future__ import annotations

from collections.abc import Callable

import viser

from ema_model.text import InWords
from emaviz.page.page import Page
from emaviz.session.practice import Practice
from emaviz.text.html import add_html, html, joined
from emaviz.text.notes import BOX, boxed
from emaviz.text.told import large


class PracticeButtons:
    """On the left.  chosen(name): called with the folder's name once its recordings are there, on the screen."""

    def __init__(self, page: Page, practice: Practice, chosen: Callable[[str], None]) -> None:
        self._practice = practice
        self._folder = ""
        gui = page.server.gui
        self._story = add_html(gui)
        with gui.add_folder("Challenges to practise on", expand_by_default=False):
            for one in practice.shipped:
                button = gui.add_button(
                    f"{one.title} {'●' * one.grade}{'○' * (5 - one.grade)}",
                    icon=viser.Icon.LOCK,
                    color="gray",
                    hint="Its recordings are made in the data folder, in some seconds",
                )
                button.on_click(
                    lambda _, one=one, button=button: page.ask(
                        "challenge", lambda: page.begins(lambda: practice.open(one), button)
                    )
                )
        practice.made.connect(lambda name: page.screen.post("challenge made", lambda: chosen(name)))

    def show(self, folder: str) -> None:
        """The story of the challenge in a folder, if it holds one."""
        self._folder = folder
        one = self._practice.held(folder)
        self._story.content = "" if one is None else boxed(html("<b>{}.</b> {}", one.title, one.story))

    def fold(self) -> None:
        """The story gives way to a run and its result; a click on its title opens it."""
        one = self._practice.held(self._folder)
        if one is not None:
            told = '<details><summary style="cursor:pointer"><b>{}</b>: the story</summary>{}</details>'
            self._story.content = boxed(html(told, one.title, one.story))


class Seal:
    """On the right.  found(): what was found, of what the challenge is about."""

    def __init__(
        self, page: Page, practice: Practice, folder: Callable[[], str], found: Callable[[], InWords | None]
    ) -> None:
        self._practice, self._folder, self._found = practice, folder, found
        gui = page.server.gui
        self._place = gui.add_folder("The sealed truth", visible=False)
        with self._place:
            button = gui.add_button("Open the seal", icon=viser.Icon.LOCK_OPEN, color="gray")
            self._told = add_html(gui)
        button.on_click(lambda _: page.ask("seal", self._open, button))

    def show(self) -> None:
        """Something else is shown: the seal is closed again."""
        self._place.visible = self._practice.held(self._folder()) is not None
        self._told.content = ""

    def _open(self) -> None:
        told = self._practice.reveal(self._folder(), self._found())
        lines = joined(html("<div>{}</div>", line) for line in told.lines)
        verdict = html("")
        if told.agrees is not None:
            verdict = large("The answer agrees.", "good") if told.agrees else large("The answer differs.", "bad")
        self._told.content = html("<div {}>{}{}</div>", BOX, verdict, lines)
