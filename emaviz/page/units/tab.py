"""The Units tab: what units of one type differ in."""

from __future__ import annotations

import viser

from emaviz.page.tab import Shared, Tab
from emaviz.page.units import WORKSPACE
from emaviz.page.units.controls import UnitsPanel
from emaviz.page.units.result import UnitsResult
from emaviz.session.units.comparing_units import ComparingUnits


class UnitsTab(Tab):
    """A folder of units, a folder of recordings each."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.comparing = ComparingUnits(self.page.session, shared.comparing.folder, shared.files)
        with right.add_tab("Units", WORKSPACE.icon):
            self.result = UnitsResult(self.page, self.comparing)

    def build(self) -> None:
        """Which units, what is held out, and the run."""
        self.panel = UnitsPanel(self.page, self.comparing, self.result)

    def close(self) -> None:
        """Ends the run."""
        self.comparing.job.stop()
