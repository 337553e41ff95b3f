"""A tab: its controls on the left, its result on the right, and what stands above a result."""

from __future__ import annotations

import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import viser

from ema_model.text import COLOURS
from emaviz.page.correction import Correction
from emaviz.page.panel import RECORD
from emaviz.page.playback import PlaybackStrip
from emaviz.page.share import VIEW, Place, Sharing, share_line
from emaviz.page.workspaces import Page, Workspace, Workspaces
from emaviz.recording.viewer import ViewerHost
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import id_of
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare import Comparing
from emaviz.session.discover.discovering import Discovering
from emaviz.session.inputs import Provenance, results_part
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part
from emaviz.text.html import Html, HtmlPiece, add_html, html

# --- above a result: whether it still is of what is chosen, what a session lacks, and a press of the tab's Start ------

_LOOK_S = 0.5  # between two looks at what is chosen
_BOX = (
    "margin:4px 10px 8px;padding:7px 12px;font-size:13.5px;line-height:1.45;overflow-wrap:anywhere;border-radius:6px;"
    "border:1px solid currentColor;display:flex;gap:12px;align-items:center;justify-content:space-between"
)
_BUTTON = (
    "font:inherit;font-weight:600;color:inherit;background:none;border:1px solid currentColor;border-radius:4px;"
    "padding:2px 12px;cursor:pointer;white-space:nowrap"
)
_PRESS = "document.getElementById('{}')?.click()"
_GREY = Html("<style>div:has(> .emaviz-out-of-date) ~ div{opacity:.5;filter:grayscale(.8)}</style>")


class Standing:
    """Of one tab.  Everything here is done on the screen's thread."""

    def __init__(
        self, provenance: Provenance, title: str, workspace: str, saved: bool, place: Callable[[], Place]
    ) -> None:
        """title, workspace: the tab's; saved: a session's file says that the result was there; place(): its address."""
        self.provenance, self.title, self.workspace, self.saved = provenance, title, workspace, saved
        self._place = place
        self._links: list[HtmlPiece] = []
        self._start: Any = None
        self._forget: list[Callable[[], object]] = []
        self._places: list[HtmlPiece] = []

    def add(self, gui: viser.GuiApi) -> None:
        """Here, where what follows in the same tab or folder is the result."""
        self._links.append(add_html(gui))
        self._places.append(add_html(gui, visible=False))

    def connect(self, start: Any, forget: Callable[[], object] = lambda: None) -> None:
        """start: the button that computes it; forget(): takes away what was said of what is not chosen any more."""
        self._start = start
        self._forget.append(forget)

    @property
    def line(self) -> str:
        """What is to be said of the result; '' for nothing."""
        return self.provenance.line(self._start.label if self._start is not None else "")

    def refresh(self) -> None:
        """Says how things stand now."""
        if self.provenance.forget_error():
            for forget in self._forget:
                forget()
        line = self.line
        content = self._banner(line) if line else Html()
        for place in self._places:
            if place.content != content:
                place.content, place.visible = content, bool(line)
        links = Html() if self.provenance.of is None else share_line(self.workspace, self._place(), self._kinds())
        for one in self._links:
            if one.content != links:
                one.content = links

    def _kinds(self) -> list[str]:
        kinds = [] if self.provenance.files is None else list(self.provenance.files.kinds)
        return kinds + ([VIEW] if RECORD.suffix in kinds else [])

    def _banner(self, line: str) -> Html:
        press = Html()
        if self._start is not None and not self.provenance.computing:
            pressed = _PRESS.format(id_of(self._start))
            press = html('<button style="{}" onclick="{}">{}</button>', _BUTTON, pressed, "Compute again")
        grey = _GREY if self.provenance.of is not None else ""
        return html(
            '<div class="emaviz-out-of-date emaviz-all-columns" role="status" style="{};color:{}"><div>▲ {}</div>{}{}'
            "</div>",
            _BOX,
            COLOURS["warning"],
            line,
            press,
            grey,
        )


class Standings:
    """Of all tabs that have one; those that a window shows are looked at anew all the time."""

    def __init__(self, screen: Worker, workspaces: Workspaces) -> None:
        self._screen, self._workspaces = screen, workspaces
        self._all: list[Standing] = []
        self._closed = threading.Event()
        workspaces.entered.connect(lambda _: self.refresh())
        threading.Thread(target=self._look, name="emaviz-standings", daemon=True).start()

    def add(
        self, provenance: Provenance, title: str, workspace: str, place: Callable[[], Place], *, saved: bool
    ) -> Standing:
        """A tab's, as `Standing`."""
        self._all.append(Standing(provenance, title, workspace, saved, place))
        return self._all[-1]

    def close(self) -> None:
        """Ends the thread."""
        self._closed.set()

    def refresh(self) -> None:
        """All that a window shows; on the screen's thread."""
        for one in self._all:
            if self._workspaces.anyone(one.workspace):
                one.refresh()

    def provenances(self) -> Mapping[str, Provenance]:
        """Those that a session's file knows, by the tabs' names."""
        return {one.workspace: one.provenance for one in self._all if one.saved}

    def lines(self) -> dict[str, str]:
        """What is to be said of each tab, by its title."""
        return {one.title: line for one in self._all if one.saved and (line := one.line)}

    def _look(self) -> None:
        while not self._closed.wait(_LOOK_S):
            self._screen.post("standings", self.refresh)


# --- a tab: its controls on the left, its result on the right, and what it has in common with the others --------------

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
    sharing: Sharing  # addresses of what tabs show
    correction: Correction  # the steps from a file to an improved model
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
        if saved:
            self.shared.sharing.results[self.workspace.name] = provenance
        title, name = self.workspace.title, self.workspace.name
        return self.shared.standings.add(provenance, title, name, self.place, saved=saved)

    def place(self) -> Place:
        """What is shown here, for an address; nothing, where that is always the same."""
        return {}

    def go_to(self, place: Place) -> None:
        """Shows what an address says, as `place` gave it; InputError where it is not there any more."""
        return

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
