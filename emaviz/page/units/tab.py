"""The Units tab: what units of one type differ in."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import viser

from emaviz.page.tab import Shared, Tab
from emaviz.page.units import WORKSPACE
from emaviz.page.units.controls import UnitsPanel
from emaviz.page.units.result import UnitsResult
from emaviz.session.saved import Part
from emaviz.session.units.comparing_units import ComparingUnits


class UnitsTab(Tab):
    """A folder of units, a folder of recordings each."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.comparing = ComparingUnits(self.page.session, shared.comparing.folder, shared.files)
        self._standing = self.standing(self.comparing.provenance)
        with right.add_tab("Units", WORKSPACE.icon):
            self._standing.add(self.page.server.gui)
            self.result = UnitsResult(self.page, self.comparing)

    def build(self) -> None:
        """Which units, what is held out, and the run."""
        self.panel = UnitsPanel(self.page, self.comparing, self.result, self._standing)

    def refresh_files(self) -> None:
        """What may be compared."""
        self.panel.refresh()

    def kept(self) -> dict[str, Part]:
        """What is chosen, and the answer."""
        return {"units": Part(self.comparing.saved, self._restore, self.comparing.files)}

    def _restore(self, saved: Any, names: Mapping[str, str]) -> None:
        self.comparing.restore(saved, names)
        self.panel.show()

    def close(self) -> None:
        """Ends the run."""
        self.comparing.job.stop()
