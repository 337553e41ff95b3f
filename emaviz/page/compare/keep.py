"""What stays of a comparison: the report, which the browser also saves, and the recording for Rerun."""

from __future__ import annotations

from emaviz.page.kept import RECORD, REPORT, KeepButtons
from emaviz.page.page import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.compare.comparing import Comparing


class KeepControls(KeepButtons):
    """Two buttons, and what they have written."""

    def __init__(self, page: Page, comparing: Comparing, viewer: ViewerHost | None) -> None:
        super().__init__(
            page,
            "comparison",
            comparing.folder,
            viewer,
            comparing.events.kept,
            lambda suffix, _: comparing.save(suffix),
            comparing.provenance,
            REPORT,
            RECORD,
        )
