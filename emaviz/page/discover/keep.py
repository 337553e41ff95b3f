"""What stays of a discovery: the report, the recording for Rerun, and the improved model."""

from __future__ import annotations

from pathlib import Path

import viser

from emaviz.page.kept import KeepButtons, Keeps
from emaviz.page.page import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.discover.discovering import Discovering

_MODEL = ".toml"
_BUTTONS = (
    Keeps("Save report", ".html", viser.Icon.FILE_TEXT, "One HTML file that opens offline"),
    Keeps("Record", ".rrd", viser.Icon.DEVICE_FLOPPY, "An .rrd file for the Rerun viewer"),
    Keeps("Save model", _MODEL, viser.Icon.TOPOLOGY_STAR, "The improved model as an actuator file; Compare lists it"),
)


class DiscoveryKeep(KeepButtons):
    """Three buttons, and what they have written; of the model also whether it is what was found."""

    def __init__(self, page: Page, discovering: Discovering, viewer: ViewerHost | None) -> None:
        events = discovering.events
        super().__init__(
            page,
            "discovery",
            discovering.folder,
            viewer,
            events.kept,
            lambda suffix, _: discovering.keep(suffix),
            discovering.provenance,
            *_BUTTONS,
        )
        events.verified.connect(lambda path, text: page.screen.post("verified", lambda: self.name(path, text)))

    def said_at_once(self, path: Path) -> str:
        """The model is read back and simulated again."""
        return "simulating it again …" if path.suffix == _MODEL else ""
