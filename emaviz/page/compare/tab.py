"""The Compare tab: the model beside measurements."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import viser

from ema_model.recordings.formats import FORMATS
from emaviz.page.compare import WORKSPACE
from emaviz.page.compare.controls import ComparePanel
from emaviz.page.compare.keep import KeepControls
from emaviz.page.compare.kept import kept
from emaviz.page.compare.leads import leads
from emaviz.page.compare.raw_lines import RawLines
from emaviz.page.compare.result import ResultPanel
from emaviz.page.tab import Shared, Tab
from emaviz.session.data_folder import ACTUATOR_SUFFIX
from emaviz.session.saved import Part


class CompareTab(Tab):
    """Takes measurements and actuator files from the browser."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._standing = self.standing(shared.comparing.provenance)
        with right.add_tab("Comparison", viser.Icon.ARROWS_DIFF):
            self._standing.add(self.page.server.gui)
            self.result = ResultPanel(
                self.page,
                shared.strip,
                lambda: RawLines(self.page, shared.comparing),
                lambda: leads(self.page, shared.discovering),
                lambda: KeepControls(self.page, shared.comparing, shared.viewer),
            )

    def build(self) -> None:
        """Recordings in, what is compared, and the run."""
        self.panel = ComparePanel(self.page, self.shared.comparing, self.result, self.shared.uploads, self._standing)

    def refresh_files(self) -> None:
        """What may be added."""
        self.panel.refresh_files()

    def kept(self) -> dict[str, Part]:
        """What is opened and asked."""

        def shown() -> None:
            self.result.clear()
            self.panel.asked.show_settings()

        return {"compare": kept(self.shared.comparing, shown)}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Measurements and actuator files."""
        return {**dict.fromkeys(FORMATS, self.panel.take), ACTUATOR_SUFFIX: self.panel.take}
