"""A dropdown of the data folder's folders, read anew whenever its tab is entered."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

from emaviz.page.page import Page

_NONE = "–"


class FolderChoice:
    """The chosen folder stays as long as it is there; else the first one is taken."""

    def __init__(
        self,
        page: Page,
        label: str,
        hint: str,
        listed: Callable[[], dict[str, str]],
        chosen: Callable[[], str],
        take: Callable[[str], None],
    ) -> None:
        """listed(): names by title; chosen(): the one taken; take(name): another one, on the screen's thread."""
        self._page, self._listed, self._chosen, self._take_name = page, listed, chosen, take
        self._names: dict[str, str] = {}
        self._what = label
        self.control: Any = page.server.gui.add_dropdown(label, (_NONE,), hint=hint)
        self.control.on_update(lambda event: event.client and self._ask())

    @property
    def empty(self) -> bool:
        """Whether there is none to choose."""
        return not self._names

    def refresh(self) -> None:
        """Reads the list again."""
        self._names = self._listed()
        options = tuple(self._names) or (_NONE,)
        if tuple(self.control.options) != options:
            self.control.options = options
        title = next((title for title, name in self._names.items() if name == self._chosen()), None)
        if title is not None:
            self.control.value = title
        elif self._names:
            self._take(options[0])

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self.refresh()
        self._take(next(title for title, one in self._names.items() if one == name))

    def _ask(self) -> None:
        """As it is chosen now: the list may be about to be read again."""
        title = str(self.control.value)
        self._page.screen.post(f"folder of {self._what}", lambda: self._take(title))

    def _take(self, title: str) -> None:
        name = self._names.get(title)
        if name is not None and self.control.value != title:
            self.control.value = title
        if name is not None and name != self._chosen():
            self._take_name(name)
