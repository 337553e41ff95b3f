"""What stays of a discovery: the report, the recording for Rerun, and the improved model."""

from __future__ import annotations

from pathlib import Path

import viser

from emaviz.page.identify.controls import recording_link
from emaviz.page.page import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import add_html, html


class DiscoveryKeep:
    """Three buttons, and what they have written."""

    def __init__(self, page: Page, discovering: Discovering, viewer: ViewerHost | None) -> None:
        self._discovering, self._viewer = discovering, viewer
        self._asked: viser.ClientHandle | None = None  # who is sent the file
        gui = page.server.gui
        for label, suffix, icon, hint in (
            ("Save the report", ".html", viser.Icon.FILE_TEXT, "One HTML file that opens offline"),
            ("Record the discovery", ".rrd", viser.Icon.DEVICE_FLOPPY, "An .rrd file for the Rerun viewer"),
            ("Save the improved model", ".toml", viser.Icon.TOPOLOGY_STAR, "An actuator file; Compare lists it"),
        ):
            button = gui.add_button(label, icon=icon, hint=hint)
            button.on_click(lambda event, suffix=suffix: self._ask(event.client, suffix))
        self._links = add_html(gui)
        events = discovering.events
        events.kept.connect(lambda path: page.screen.post(f"kept {path.suffix}", lambda: self._kept(path)))
        events.verified.connect(lambda path, text: page.screen.post("verified", lambda: self._name(path, text)))

    def clear(self) -> None:
        """Another model is shown: what was kept of the one before is told no more."""
        self._links.content = ""

    def _ask(self, client: viser.ClientHandle | None, suffix: str) -> None:
        self._asked = client
        self._discovering.keep(suffix)

    def _kept(self, path: Path) -> None:
        if path.suffix == ".rrd":
            self._links.content = recording_link(self._viewer, path)
            return
        self._name(path, "simulating it again …" if path.suffix == ".toml" else "")
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)

    def _name(self, path: Path, text: str) -> None:
        """Where a file is kept, and what is to be said of it."""
        name = ", ".join(filter(None, (self._discovering.folder.name_of(path), text)))
        self._links.content = html(
            '<div style="padding:2px 10px;font-size:13px">Also kept in the data folder: {}</div>', name
        )
