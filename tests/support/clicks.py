"""Counts what a person clicks: a button, a place on a chart, an entry of a list; to open the list is a click, too."""

from __future__ import annotations

from typing import Any


class Clicks:
    """On one page."""

    def __init__(self, page: Any) -> None:
        self._page = page
        self.count = 0

    def click(self, what: Any) -> None:
        """A control or a link."""
        what.click()
        self.count += 1

    def at(self, x: float, y: float) -> None:
        """A place in the window."""
        self._page.mouse.click(x, y)
        self.count += 1

    def choose(self, label: str, option: str) -> None:
        """An entry of a list, which is opened first: two clicks."""
        self.click(self._page.get_by_label(label, exact=True))
        self.click(self._page.get_by_role("option", name=option, exact=True))

    def select(self, field: Any, option: str) -> None:
        """The same of a list that the browser itself draws."""
        field.select_option(option)
        self.count += 2
