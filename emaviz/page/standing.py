"""Above a result: whether it still is of what is chosen, what a session lacks, and a press of the tab's Start."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from typing import Any

import viser

from ema_model.text import COLOURS
from emaviz.page.workspaces import Workspaces
from emaviz.server.viser_private import id_of
from emaviz.session.inputs import Provenance
from emaviz.session.worker import Worker
from emaviz.text.html import Html, HtmlPiece, add_html, html

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

    def __init__(self, provenance: Provenance, title: str, workspace: str, saved: bool) -> None:
        """title, workspace: the tab's; saved: a session's file says that the result was there."""
        self.provenance, self.title, self.workspace, self.saved = provenance, title, workspace, saved
        self._start: Any = None
        self._forget: list[Callable[[], object]] = []
        self._places: list[HtmlPiece] = []

    def add(self, gui: viser.GuiApi) -> None:
        """Here, where what follows in the same tab or folder is the result."""
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

    def add(self, provenance: Provenance, title: str, workspace: str, *, saved: bool) -> Standing:
        """A tab's, as `Standing`."""
        self._all.append(Standing(provenance, title, workspace, saved))
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
