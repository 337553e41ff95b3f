"""The first lines of a text as they stand in the file, of which a click names the one with the columns' names."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

from ema_model.errors import quoted
from emaviz.page.page import Page
from emaviz.server.viser_private import selector_of
from emaviz.session.compare.comparing import Comparing
from emaviz.session.opened import Opened
from emaviz.text.html import Html, add_html, html, unescaped

_SHOWN = 20
_ABOVE = 15  # lines shown above a header that stands further down
_MOST = 300  # characters of a line; the panel's width cuts it as well
_BOX = Html('style="padding:0 12px 4px;font-size:13px;line-height:1.45"')
_LINE = (
    "height:19px!important;min-height:0!important;padding:0 6px!important;border-radius:0;border:0;font-weight:400;"
    "font-size:12px;font-family:ui-monospace,SFMono-Regular,Menlo,Consolas,monospace;color:inherit!important;"
)
_RESTING = "background:rgba(134,142,150,.08)!important;"
_CHOSEN = "background:rgba(47,111,222,.22)!important;box-shadow:inset 3px 0 #2f6fde;"
_UNITS = "background:rgba(47,111,222,.09)!important;box-shadow:inset 3px 0 rgba(47,111,222,.45);"


class RawLines:
    """A list of buttons, one a line; a click reads the file anew.  Everything is drawn on the screen's thread."""

    def __init__(self, page: Page, comparing: Comparing) -> None:
        self._page, self._comparing = page, comparing
        self._name, self._first, self._header = "", 0, 0
        gui = page.server.gui
        self._about = add_html(gui, visible=False)
        self._style = add_html(gui, visible=False)
        self._buttons: list[Any] = [gui.add_button("–", visible=False) for _ in range(_SHOWN)]
        for i, button in enumerate(self._buttons):
            button.on_click(lambda _, i=i: page.screen.post("header line", lambda: self._choose(i)))

    def show(self, opened: Opened) -> None:
        """The lines of a file, with its header among them; none of one that is no text."""
        head = opened.head
        lines = head.lines if head is not None else ()
        layout = head.layout if head is not None and not opened.problem else None
        self._header = header = layout.header_line if layout is not None else 0
        self._name, self._first = opened.name, header - _ABOVE if header > _SHOWN else 0
        marks = {header: _CHOSEN} | ({layout.units_line: _UNITS} if layout is not None and layout.units_line else {})
        rules = []
        for i, button in enumerate(self._buttons):
            number = self._first + i + 1
            button.visible = number <= len(lines)
            if button.visible:
                button.label = f"{number:3}  {_cut(lines[number - 1])}"
                rules.append(_styled(selector_of(button), marks.get(number, _RESTING)))
        self._style.content = unescaped(f"<style>{''.join(rules)}</style>")
        self._style.visible = self._about.visible = bool(lines)
        self._about.content = html(
            "<div {}>The file's lines: <b>click the one with the columns' names</b> where another is marked, or none."
            "</div>",
            _BOX,
        )

    def _choose(self, row: int) -> None:
        opened, line = self._comparing.opened.get(self._name), self._first + row + 1
        if opened is not None and line != self._header:
            self._comparing.use_layout(opened.name, replace(opened.hints, header_line=line))


def _cut(line: str) -> str:
    """As one sees it, tabs as they are."""
    return "\t".join(quoted(cell) for cell in line[: _MOST + 1].split("\t"))[:_MOST] + "…" * (len(line) > _MOST)


def _styled(one: str, colours: str) -> str:
    """viser's buttons are tall and in the middle; these are lines of a text, one close below another."""
    return (
        f"{one}{{{_LINE}{colours}}}div:has(> {one}){{padding-bottom:0!important}}"
        f"{one} .mantine-Button-inner{{justify-content:flex-start}}"
        f"{one} .mantine-Button-label{{white-space:pre;text-overflow:ellipsis;display:block;line-height:19px;"
        "text-box:normal}"
    )
