"""The discoveries so far, to go from one to the other."""

from __future__ import annotations

from typing import Any

import viser

from emaviz.page.page import Page
from emaviz.session.discover.discovering import Discovering

_NEW = "New"


class EntriesControl:
    """A dropdown, there once something was discovered."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._choice: Any = page.server.gui.add_dropdown(
            "Discovery", (_NEW,), visible=False, hint="Each is kept as it was left, and comes back at once"
        )
        self._choice.on_update(self._changed)

    def show(self) -> None:
        """The list as it is now; on the screen's thread."""
        entries = self._discovering.entries
        words = [_NEW, *(one.words for one in reversed(entries.all))]
        if list(self._choice.options) != words:
            self._choice.options = words
        current = _NEW if entries.current is None else entries.current.words
        if self._choice.value != current:
            self._choice.value = current
        self._choice.visible = bool(entries.all)

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._choice.disabled = busy

    def _changed(self, event: viser.GuiEvent[Any]) -> None:
        if event.client is not None:
            chosen = str(self._choice.value)
            self._page.screen.post("discovery", lambda: self._take(chosen))

    def _take(self, chosen: str) -> None:
        discovering = self._discovering
        entry = next((one for one in discovering.entries.all if one.words == chosen), None)
        if entry is None:
            self._page.checked(lambda: discovering.choose(discovering.source.chosen), self._choice)
        else:
            self._page.checked(lambda: discovering.show(entry), self._choice)
        self.show()
