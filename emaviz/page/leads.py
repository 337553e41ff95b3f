"""Buttons that take what is shown to the workspace where one goes on with it."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import viser

from emaviz.page.page import Page


@dataclass(frozen=True)
class Lead:
    """take(): hands over what is shown, on the screen's thread; InputError says why that cannot be."""

    label: str
    icon: viser.IconName
    hint: str
    to: str  # the workspace's name
    take: Callable[[], Any]


class Leads:
    """A button for each; the window that has asked goes along."""

    def __init__(self, page: Page, leads: Sequence[Lead]) -> None:
        self._page = page
        for one in leads:
            self._add(one)

    def _add(self, lead: Lead) -> None:
        button = self._page.server.gui.add_button(lead.label, icon=lead.icon, hint=lead.hint)

        def follow(event: viser.GuiEvent[Any]) -> None:
            def taken() -> None:
                if self._page.checked(lead.take, button):
                    self._page.workspaces.go(lead.to, event.client)

            self._page.screen.post(f"lead {lead.label}", taken)

        button.on_click(follow)
