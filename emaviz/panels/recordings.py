"""The Recordings tab: what past identifications left, newest first."""

from __future__ import annotations

from pathlib import Path

from emaviz.panels.identify import recording_link
from emaviz.panels.page import Page
from emaviz.recording.viewer import ViewerHost

_SHOWN = 40


class RecordingsPanel:
    """A list of links."""

    def __init__(self, page: Page, viewer: ViewerHost | None, folder: Path) -> None:
        self._viewer = viewer
        self._folder = folder
        gui = page.server.gui
        gui.add_markdown(f"Recordings in `{folder}`, newest first. Each opens in the Rerun viewer, without a network.")
        self._list = gui.add_html("")
        self.refresh()
        page.session.events.identified.append(lambda *_: page.screen.post("recordings", self.refresh))

    def refresh(self) -> None:
        """Reads the folder again."""
        files = sorted(self._folder.glob("*.rrd"), key=lambda p: p.stat().st_mtime, reverse=True)
        links = [recording_link(self._viewer, path) for path in files[:_SHOWN]]
        more = f"<div style='padding:2px 10px'>… and {len(files) - _SHOWN} more</div>" if len(files) > _SHOWN else ""
        self._list.content = "".join(links) + more or "<div style='padding:2px 10px'>None yet.</div>"
