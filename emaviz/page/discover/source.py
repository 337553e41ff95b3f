"""The recordings of a discovery: Compare's, some of them held out, or a challenge, which may be a sealed file."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Any

import viser

from ema_model.challenges import Challenge
from ema_model.discovery.steps.snapshot import Look
from emaviz.page.page import Page
from emaviz.server.uploads import Uploads
from emaviz.session.data_folder import CHALLENGE_SUFFIX
from emaviz.session.discover.discovering import Discovering
from emaviz.session.discover.source import COMPARED
from emaviz.text.html import Html, add_html, html
from emaviz.text.notes import DIM, boxed, note

_STARS = "●○"
_SEALED = "Sealed: "  # before the names of such files


class SourceControls:
    """The top of the Discover tab.

    chosen() is called when another source is chosen, shown() when more is known of it; both on the screen's thread.
    """

    def __init__(
        self,
        page: Page,
        discovering: Discovering,
        uploads: Uploads,
        chosen: Callable[[], None],
        shown: Callable[[], None],
    ) -> None:
        self._page, self._discovering, self._chosen, self._shown = page, discovering, chosen, shown
        self._look: Look | None = None
        self._shipped = {COMPARED: ""} | {
            f"{_STARS[0] * one.grade}{_STARS[1] * (5 - one.grade)} {one.title}": name
            for name, one in discovering.source.challenges.items()
        }
        self._names = self._listed()
        gui, post = page.server.gui, page.screen.post
        self._source = gui.add_dropdown("Measurements", tuple(self._names), hint="Of Compare, or of a challenge")
        uploads.add_button("Open a sealed challenge", CHALLENGE_SUFFIX, icon=viser.Icon.LOCK_OPEN, color="gray")
        self._about = add_html(gui)
        self._held = gui.add_folder("Hold out for validation", visible=False, expand_by_default=False)
        self._boxes: list[Any] = []
        self._source.on_update(lambda event: event.client and post("source", self._take))
        discovering.sealing.sealed.connect(lambda _: post("sealed listed", self._refresh))
        compare = discovering.comparing.events
        compare.opened.connect(lambda _: post("discover source", lambda: self.show(self._look)))
        compare.removed.connect(lambda: post("discover source", lambda: self.show(self._look)))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._source.disabled = busy

    # --- the choice -------------------------------------------------------------------------------------------------

    def choose(self, title: str) -> None:
        """A source by its title; on the screen's thread."""
        self._source.value = title
        self._take()

    def choose_first(self) -> None:
        """The first challenge."""
        self.choose(next(title for title, name in self._names.items() if name))

    def uploaded(self, path: Path) -> None:
        """A sealed challenge came from the browser: it is chosen; on any thread."""

        def take() -> None:
            self._refresh()
            name = self._discovering.folder.name_of(path)
            self.choose(next(title for title, known in self._names.items() if known == name))

        self._page.screen.post("sealed uploaded", take)

    def _take(self) -> None:
        name = self._names.get(str(self._source.value), "")
        if self._page.checked(lambda: self._discovering.choose(name), self._source):
            self._chosen()
            self.show(None)
        else:
            self._refresh()

    def _listed(self) -> dict[str, str]:
        """The sources' names by their titles: Compare's recordings, the shipped challenges, the sealed ones."""
        return self._shipped | {_SEALED + name.partition("/")[2]: name for name in self._discovering.source.sealed}

    def _refresh(self) -> None:
        """Reads the list of sealed challenges again, and names what is chosen."""
        self._names = self._listed()
        if list(self._source.options) != list(self._names):
            self._source.options = list(self._names)
        chosen = self._discovering.source.chosen
        title = next((title for title, name in self._names.items() if name == chosen), COMPARED)
        if self._source.value != title:
            self._source.value = title

    # --- what is known of it ----------------------------------------------------------------------------------------

    def show(self, look: Look | None) -> None:
        """The story that the recordings belong to, and which may be held out; on the screen's thread."""
        self._look = look
        self._refresh()
        challenge = self._discovering.source.challenge
        opened = self._discovering.source.compared
        if challenge is not None:
            self._about.content = about(challenge, folded=look is not None)
        else:
            self._about.content = note(
                "The measurements and the actuator of Compare."
                if opened
                else "Open measurements on Compare first, or choose a challenge."
            )
        self._held.visible = challenge is None and len(opened) > 1
        for box in self._boxes:
            box.remove()
        self._boxes = []
        if self._held.visible:
            with self._held:
                for name in opened:
                    box = self._page.server.gui.add_checkbox(Path(name).name, name in self._discovering.source.held_out)
                    box.on_update(lambda _, name=name, box=box: self._hold_out(name, bool(box.value)))
                    self._boxes.append(box)
        self._shown()

    def _hold_out(self, name: str, held: bool) -> None:
        self._discovering.source.hold_out(name, held)
        self._shown()


def about(challenge: Challenge, folded: bool) -> Html:
    """Title, story and recordings; folded once they are read, as the cards want their place."""
    files = f"Fitted: {', '.join(p.stem for p in challenge.training)}. "
    files += f"Held out: {', '.join(p.stem for p in challenge.holdout)}."
    told = html("<b>{}.</b> {}<div {}>{}</div>", challenge.title, challenge.story, DIM, files)
    if folded:
        told = html(
            '<details><summary style="cursor:pointer"><b>{}</b>: the story</summary>{}</details>', challenge.title, told
        )
    return boxed(told)
