"""How a text was understood, and what somebody says instead: the line with the columns' names, and the encoding."""

from __future__ import annotations

from collections.abc import Iterable

import viser

from ema_model.recordings.formats.text_layout import ENCODINGS, Hints
from ema_model.text import COLOURS
from emaviz.page.page import Page
from emaviz.session.compare.comparing import Comparing
from emaviz.session.opened import Opened
from emaviz.text.html import Html, add_html, html

_FOUND = "found by itself"
_MOST_LINES = 200
_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')


class LayoutControls:
    """Two dropdowns; a change reads the file anew, and one that does not fit is told and taken back."""

    def __init__(self, page: Page, comparing: Comparing) -> None:
        self._page, self._comparing = page, comparing
        self._name = ""
        gui = page.server.gui
        self._told = add_html(gui, visible=False)
        self.header = gui.add_dropdown("Header in line", [_FOUND], visible=False)
        self._encoding = gui.add_dropdown("Encoding", [_FOUND], visible=False)
        for control in (self.header, self._encoding):
            control.on_update(lambda event: event.client and page.screen.post("layout", self._say))

    def show(self, opened: Opened) -> None:
        """As a file was read; nothing for one that is no text.  On the screen's thread."""
        self._name, head, said = opened.name, opened.head, opened.hints
        for control in (self._told, self.header, self._encoding):
            control.visible = head is not None
        if head is None:
            return
        what = "As said" if said != Hints() else "Found"
        told = html("{}: {}.", what, head.told) if head.told else "No line with the columns' names is found."
        why = html('<span style="color:{};overflow-wrap:anywhere">▲ {}</span>', COLOURS["warning"], opened.problem)
        self._told.content = html("<div {}>{}</div>", _BOX, why if opened.problem else told)
        _offer(self.header, range(1, min(len(head.lines), _MOST_LINES) + 1), said.header_line)
        _offer(self._encoding, ENCODINGS.values(), said.encoding and ENCODINGS.get(said.encoding, said.encoding))

    def _say(self) -> None:
        line, encoding = str(self.header.value), str(self._encoding.value)
        names = {title: name for name, title in ENCODINGS.items()}
        said = Hints(
            None if line == _FOUND else int(line), None if encoding == _FOUND else names.get(encoding, encoding)
        )
        self._comparing.use_layout(self._name, said)


def _offer(dropdown: viser.GuiDropdownHandle[str], choices: Iterable[object], said: object) -> None:
    """The choices and what was said, which is shown."""
    options = list(dict.fromkeys(map(str, [_FOUND, *choices, *([said] if said else [])])))
    if list(dropdown.options) != options:
        dropdown.options = options
    dropdown.value = str(said) if said else _FOUND
