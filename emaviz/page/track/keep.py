"""What stays of followed flights: the report, which the browser also saves, and the recording for Rerun."""

from __future__ import annotations

from typing import Any

from emaviz.page.kept import RECORD, REPORT, KeepButtons
from emaviz.page.page import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.track.following import Following


class TrackKeep(KeepButtons):
    """Two buttons, and what they have written."""

    def __init__(self, page: Page, following: Following, viewer: ViewerHost | None) -> None:
        def save(suffix: str, button: Any) -> None:
            page.ask(f"track {suffix}", lambda: following.save(suffix), button)

        super().__init__(
            page, "track", following.folder, viewer, following.events.kept, save, following.provenance, REPORT, RECORD
        )
