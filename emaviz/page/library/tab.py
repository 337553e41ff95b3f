"""The Library tab: every effect, and what it does."""

from __future__ import annotations

import viser

from emaviz.page.library import WORKSPACE
from emaviz.page.library.controls import LibraryPanel
from emaviz.page.library.effect import EffectPage
from emaviz.page.tab import Shared, Tab
from emaviz.session.library import Library


class LibraryTab(Tab):
    """Cards on the left, the opened effect on the right."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._library = Library(self.page.session)
        with right.add_tab("Effect", viser.Icon.BOOK):
            self._effect = EffectPage(self.page, self._library, shared.strip)

    def build(self) -> None:
        """Search and cards."""
        LibraryPanel(self.page, self._library, self._effect)
