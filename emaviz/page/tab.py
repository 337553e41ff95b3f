"""A tab: its controls on the left, its result on the right, and what it has in common with the others."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import viser

from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.standing import Standing, Standings
from emaviz.page.workspaces import Workspace
from emaviz.recording.viewer import ViewerHost
from emaviz.server.uploads import Uploads
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare import Comparing
from emaviz.session.discover.discovering import Discovering
from emaviz.session.inputs import Provenance, results_part
from emaviz.session.saved import Part
from emaviz.session.worker import Worker

AnyTab = TypeVar("AnyTab", bound="Tab")


@dataclass(frozen=True)
class Shared:
    """Handed to every tab."""

    page: Page
    strip: PlaybackStrip  # the actuator and its clock
    comparing: Comparing
    discovering: Discovering
    campaigns: Campaigns
    viewer: ViewerHost | None
    uploads: Uploads
    slow_screen: Worker  # draws what nobody watches while dragging
    files: Worker  # reads and packs files
    standings: Standings  # of the tabs' results
    tabs: dict[type[Tab], Tab] = field(default_factory=dict)

    def tab(self, kind: type[AnyTab]) -> AnyTab:
        """Another tab, for what leads there; known once the page is built."""
        return cast(AnyTab, self.tabs[kind])

    def take(self, path: Path) -> None:
        """A file came from the browser: to the tab that takes its kind; on the server's thread."""
        self.taken()[path.suffix.lower()](path)
        self.page.screen.post("files", self._refresh_files)

    def enter(self, name: str) -> None:
        """A window came to a workspace; on the screen's thread."""
        for tab in self.tabs.values():
            if tab.workspace.name == name:
                tab.refresh_files()

    def _refresh_files(self) -> None:
        for tab in self.tabs.values():
            tab.refresh_files()

    def taken(self) -> dict[str, Callable[[Path], None]]:
        """By suffix, what takes such a file."""
        return {suffix: take for tab in self.tabs.values() for suffix, take in tab.takes().items()}

    def kept(self) -> dict[str, Part]:
        """What a session's file holds, by name.  `restore` is called on the screen's thread."""
        settings = self.page.session.settings

        def restore(saved: Any, names: Mapping[str, str]) -> None:
            if isinstance(saved, dict) and saved.get("source"):
                saved = {**saved, "source": names.get(str(saved["source"]), saved["source"])}
            settings.restore(saved)
            for tab in self.tabs.values():
                tab.show_settings()

        parts = {"settings": Part(settings.saved, restore)}
        for tab in self.tabs.values():
            parts |= tab.kept()
        parts["results"] = results_part(self.standings.provenances)
        return parts | {"look": Part(self.strip.saved, lambda saved, _: self.strip.restore(saved))}


class Tab(ABC):
    """One workspace of the page, found by its folder, whose `tab.py` defines it."""

    workspace: ClassVar[Workspace]

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        """Builds the result in the panel on the right."""
        self.shared, self.page, self.right = shared, shared.page, right

    def standing(self, provenance: Provenance, *, saved: bool = True) -> Standing:
        """Of a result of this tab; saved: a session's file says that it was there."""
        return self.shared.standings.add(provenance, self.workspace.title, self.workspace.name, saved=saved)

    @abstractmethod
    def build(self) -> None:
        """Builds the controls here, on the left, once the results of all tabs are there."""

    def show_settings(self) -> None:
        """The session's settings have changed: shows them."""
        return

    def refresh_files(self) -> None:
        """Reads the data folder's lists again: a window came here, or a file from one; on the screen's thread."""
        return

    def close(self) -> None:
        """Ends what was started here."""
        return

    def kept(self) -> dict[str, Part]:
        """What a session's file holds of it, by name."""
        return {}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """By suffix, what takes a file that was uploaded or dropped anywhere; called on the server's thread."""
        return {}
