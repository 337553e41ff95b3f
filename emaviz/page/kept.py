"""Buttons that keep what is shown in the data folder, and what they have written; the browser saves it as well."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Protocol

import viser

from emaviz.page.page import Page
from emaviz.page.style import IN_ROW
from emaviz.page.viewer_links import recording_link
from emaviz.recording.viewer import ViewerHost
from emaviz.session.data_folder import DataFolder
from emaviz.session.inputs import Provenance
from emaviz.session.signal import Signal
from emaviz.text.html import add_html, html


class Cleared(Protocol):
    """Forgets what it has said of files that were kept of what was shown before."""

    def clear(self) -> None:
        """To be called on the screen's thread."""


@dataclass(frozen=True)
class Keeps:
    """A button, and the file that it asks for."""

    label: str
    suffix: str
    icon: viser.IconName
    hint: str


REPORT = Keeps("Save report", ".html", viser.Icon.FILE_TEXT, "One HTML file that opens offline")
RECORD = Keeps("Record", ".rrd", viser.Icon.DEVICE_FLOPPY, "An .rrd file for the Rerun viewer")


class KeepButtons:
    """The buttons, and a line of the last file; a recording's line leads to the viewer."""

    def __init__(
        self,
        page: Page,
        what: str,
        folder: DataFolder,
        viewer: ViewerHost | None,
        kept: Signal[[Path]],
        save: Callable[[str, Any], object],
        provenance: Provenance,
        *buttons: Keeps,
    ) -> None:
        """what: is kept, a word that no other tab has; save(suffix, button): asks for the file; kept: it is written.

        provenance: of the result, which is written as it was computed.
        """
        self._provenance = provenance
        self._folder, self._viewer, self._save = folder, viewer, save
        self._asked: viser.ClientHandle | None = None  # who is sent the file
        gui = page.server.gui
        add_html(gui, IN_ROW)
        for one in buttons:
            button = gui.add_button(one.label, icon=one.icon, hint=one.hint)
            button.on_click(lambda event, suffix=one.suffix, button=button: self._ask(event.client, suffix, button))
        self._links = add_html(gui)
        kept.connect(lambda path: page.screen.post(f"{what} kept {path.suffix}", lambda: self._kept(path)))

    def clear(self) -> None:
        """Something else is shown: what was kept before is told no more."""
        self._links.content = ""

    def name(self, path: Path, text: str = "") -> None:
        """Where a file is kept, and what is to be said of it."""
        name = ", ".join(filter(None, (self._folder.name_of(path), self._provenance.note(), text)))
        self._links.content = html(
            '<div style="padding:2px 10px;font-size:13px">Also kept in the data folder: {}</div>', name
        )

    def said_at_once(self, path: Path) -> str:
        """What is to be said of a file that has just been written."""
        return ""

    def _ask(self, client: viser.ClientHandle | None, suffix: str, button: Any) -> None:
        self._asked = client
        self._save(suffix, button)

    def _kept(self, path: Path) -> None:
        if path.suffix == RECORD.suffix:
            self._links.content = recording_link(self._viewer, path)
            return
        self.name(path, self.said_at_once(path))
        if self._asked is not None:
            self._asked.send_file_download(path.name, path.read_bytes(), save_immediately=True)
