"""A tab: controls on the left, its result on the right, what stands above it, and the flow over several tabs."""

from __future__ import annotations

import json
import threading
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar, TypeVar, cast

import viser

from ema_model.quantities import number
from ema_model.text import COLOURS
from emaviz.page.panel import RECORD
from emaviz.page.playback import PlaybackStrip
from emaviz.page.share import VIEW, Place, Sharing, share_line
from emaviz.page.workspaces import Page, Workspace, Workspaces
from emaviz.recording.viewer import ViewerHost
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import id_of
from emaviz.session.campaigns import Campaigns
from emaviz.session.compare import Comparing
from emaviz.session.discover import Discovering
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part, Provenance, results_part
from emaviz.text.html import Html, HtmlPiece, add_html, html, joined, unescaped

# --- model correction, one flow over Compare and Discover: its four steps at the top of both, and where it stands -----
# Columns → fit and regions → what is missing → the ladder and the improved model. Each step leads to where it is done;
# the next one is marked.

COLUMNS, FIT, MISSING, IMPROVED = range(4)
TITLES = ("Columns", "Fit and regions", "What is missing", "Ladder and model")
_STYLE = unescaped(
    "<style>.emaviz-flow{display:flex;gap:4px;padding:4px 10px 6px;font-size:12.5px;line-height:1.25}"
    ".emaviz-flow a{flex:1 1 0;min-width:0;font:inherit;color:inherit;text-align:left;cursor:pointer;"
    "padding:4px 8px;border:0;border-top:3px solid rgba(134,142,150,.35);background:rgba(134,142,150,.08)}"
    ".emaviz-flow a[aria-disabled]{cursor:default;opacity:.55}.emaviz-flow .done{border-top-color:#0c8599}"
    ".emaviz-flow .next{border-top-color:#f08c00;background:rgba(240,140,0,.14)}"
    ".emaviz-flow .here{outline:1.5px solid currentColor;outline-offset:-1.5px}"
    ".emaviz-flow span{display:block;opacity:.75;overflow-wrap:anywhere}</style>"
)


@dataclass(frozen=True)
class Stage:
    """A step as it stands."""

    text: str  # what is known of it: '4 measurements', '3.69 × floor'
    done: bool = False
    can: bool = True  # whether it can be gone to


def stages(discovering: Discovering, of_compare: bool) -> tuple[Stage, ...]:
    """The four of them, as the session stands; of_compare: of its recordings, whatever is discovered meanwhile."""
    comparing, challenge = discovering.comparing, discovering.source.challenge
    aside = of_compare and challenge is not None  # Discover has a challenge
    challenge, look = None if aside else challenge, None if aside else discovering.look
    opened = list(comparing.opened.values())
    unclear = [one for one in opened if one.measurement is None]
    held = sum(one.name in comparing.held_out for one in opened)
    files = f"{len(opened)} measurement{'' if len(opened) == 1 else 's'}{f', {held} held out' if held else ''}"
    compared = comparing.comparison
    columns = Stage("to be checked" if unclear else files if opened else "no file yet", bool(opened) and not unclear)
    fit = Stage("–", can=bool(opened))
    if challenge is not None:
        columns = Stage("of a challenge", True, bool(opened))
        fit = Stage("calibrated" if look is not None else "–", look is not None, bool(opened))
    elif compared is not None:
        fit = Stage(f"error {number(compared.over_floor)} × floor", comparing.finished is not None)
    elif comparing.running:
        fit = Stage("calibrating …")
    can = look is not None or compared is not None
    missing, improved = Stage("click to look" if can else "–", can=can), Stage("–", can=look is not None)
    if look is not None:
        known, count = look.assessment is not None, len(look.promising)
        told = f"{count} candidate{'' if count == 1 else 's'}" if count else "nothing more"
        missing = Stage(told if known else "scoring …", known and not count)
        if look.removable:
            unseen = look.found.ladder[-1].holdout_rmse
            also = "" if unseen is None else f", held out {number(unseen)}"
            improved = Stage(f"{number(look.rmse)}{also} × floor", look.found.at_floor)
    elif discovering.running and not aside:
        missing = Stage("looking …")
    return columns, fit, missing, improved


class Correction:
    """The line of steps.  Everything here is done on the screen's thread."""

    def __init__(self, page: Page, discovering: Discovering) -> None:
        self._page, self._discovering = page, discovering
        self._lines: list[tuple[str, HtmlPiece]] = []  # each with the workspace that it stands in
        self._ways: dict[int, str] = {}  # what a click on a step runs, where that is not the way to its workspace
        events, jobs = discovering.comparing.events, (discovering.comparing.job, discovering.job)
        page.screen.hear_any(
            [
                *(events.opened, events.removed, events.held, events.compared, discovering.events.looked),
                *(happens for job in jobs for happens in (job.began, job.ended)),
            ],
            self.refresh,
        )

    def add(self, workspace: str) -> None:
        """Here, at the top of a tab."""
        add_html(self._page.server.gui, _STYLE)
        self._lines.append((workspace, add_html(self._page.server.gui)))
        self.refresh()

    def leads(self, step: int, button: Any) -> None:
        """A click on a step presses this button."""
        self._ways[step] = f"document.getElementById('{id_of(button)}')?.click()"

    def refresh(self) -> None:
        """As the session stands now."""
        for workspace, piece in self._lines:
            found = stages(self._discovering, workspace == "compare")
            following = next((i for i, one in enumerate(found) if not one.done), None)
            content = _line(found, following, self._at(workspace), lambda step, at=workspace: self._way(step, at))
            if piece.content != content:
                piece.content = content

    def _at(self, workspace: str) -> tuple[int, ...]:
        """The steps that a workspace shows now."""
        look = self._discovering.look
        if workspace == "compare":
            return (FIT,) if self._discovering.comparing.comparison is not None else (COLUMNS,)
        return (MISSING, IMPROVED) if look is not None and look.removable else (MISSING,)

    def _way(self, step: int, workspace: str) -> str:
        """What a click on a step runs: it goes to its workspace, and presses there what shows it, or begins it."""
        to = "compare" if step in (COLUMNS, FIT) else "discover"
        go = f"window.emavizViews?.go({json.dumps(to)})"
        begun = self._discovering.is_of_compare or (workspace == to and self._discovering.look is not None)
        if step not in self._ways or (step == MISSING and begun):
            return go
        return self._ways[step] if step == MISSING else f"{go};{self._ways[step]}"  # whose button goes there itself


def _line(found: tuple[Stage, ...], following: int | None, here: tuple[int, ...], way: Callable[[int], str]) -> Html:
    steps = joined(
        html(
            '<a role="link" tabindex="0" class="{}"{}><b>{} {}</b><span>{}{}</span></a>',
            " ".join(
                word for word, so in (("done", one.done), ("next", place == following), ("here", place in here)) if so
            ),
            html(' onclick="{}"', way(place)) if one.can else Html(' aria-disabled="true"'),
            place + 1,
            TITLES[place],
            "✓ " if one.done else "",
            one.text,
        )
        for place, one in enumerate(found)
    )
    return html('<nav class="emaviz-flow emaviz-all-columns" aria-label="Model correction">{}</nav>', steps)


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
    """One workspace of the page, found by its file."""

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
