"""What stays of followed flights: the report, which the browser also saves, and the recording for Rerun."""

from __future__ import annotations

from pathlib import Path

import viser

from emaviz.page.identify.controls import recording_link
from emaviz.page.page import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.track.following import Following
from emaviz.text.html import add_html, html


class TrackKeep:
    """Two buttons, and what they have written."""

    def __init__(self, page: Page, following: Following, viewer: ViewerHost | None) -> None:
        self._following, self._viewer = following, viewer
        self._asked: viser.ClientHandle | None = None  # who is sent the report
        gui = page.server.gui
        report = gui.add_button("Save report", icon=viser.Icon.FILE_TEXT, hint="One HTML file that opens offline")
        record = gui.add_button("Record", icon=viser.Icon.DEVICE_FLOPPY, hint="An .rrd file for the Rerun viewer")
        self._links = add_html(gui)

        def save(event: viser.GuiEvent[viser.GuiButtonHandle]) -> None:
            self._asked = event.client
            page.ask("track report", lambda: following.save(".html"))

        report.on_click(save)
        record.on_click(lambda _: page.ask("track record", lambda: following.save(".rrd")))
        following.events.kept.connect(lambda path: page.screen.post("track kept", lambda: self._kept(path)))

    def clear(self) -> None:
        """Other flights are shown: what was kept of those before is told no more."""
        self._links.content = ""

    def _kept(self, path: Path) -> None:
        if path.suffix == ".rrd":
            self._links.content = recording_link(self._viewer, path)
            return
        name = self._following.folder.name_of(path)
        self._links.content = html(
            '<div style="padding:2px 10px;font-size:13px">Also kept in the data folder: {}</div>', name
        )
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)
