"""A file that is compared: its card, raw lines, layout and columns."""

from __future__ import annotations

from collections.abc import Collection, Iterable
from dataclasses import replace
from typing import Any

import viser

from ema_model.errors import quoted
from ema_model.recordings.formats.text_layout import ENCODINGS, Hints
from ema_model.recordings.health import Finding, Health
from ema_model.text import COLOURS
from emaviz.page.style import IN_PAIRS
from emaviz.page.workspaces import Page
from emaviz.server.viser_private import selector_of
from emaviz.session.compare import Comparing
from emaviz.session.files import Opened
from emaviz.text.html import Html, add_html, html, joined, unescaped

# --- short pieces of HTML on the Compare tab --------------------------------------------------------------------------
# Short pieces of HTML on the Compare tab: the list of recordings, the data health card.

_MARKS = {"good": ("✓", COLOURS["good"]), "note": ("●", COLOURS["note"]), "warning": ("▲", COLOURS["warning"])}
_SAYS = {"good": "in order", "note": "something to know of the data", "warning": "look at the data's health"}
_CARDS_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')
_DIM = Html('style="opacity:.65"')


def recordings_list(opened: Iterable[Opened], held_out: Collection[str] = ()) -> Html:
    """A line for each recording: what it is and how its data are; held_out: names of those that are not fitted."""
    rows = []
    for one in opened:
        if one.measurement is None or one.health is None:
            mark, text = _mark("warning"), "no table is found in it" if one.problem else "columns to be checked"
        else:
            m = one.measurement
            mark = _mark(one.health.severity)
            length = f"{m.samples:,} samples".replace(",", " ")
            text = f"{length}, a static map" if m.is_map else f"{m.duration_s:.3g} s, {length}"
            text += ", held out" if one.name in held_out else ""
        rows.append(html("<div>{} <b>{}</b> <span {}>{}</span></div>", mark, one.path.name, _DIM, text))
    return html("<div {}>{}</div>", _CARDS_BOX, joined(rows) or html("<span {}>None yet.</span>", _DIM))


def health_card(health: Health) -> Html:
    """What to know of the data, warnings first; what was found in order stands folded below."""
    lines = {severity: [_finding(f) for f in health.findings if f.severity == severity] for severity in _MARKS}
    told = joined(lines["warning"] + lines["note"])
    good = lines["good"]
    if not good:
        return html("<div {}>{}</div>", _CARDS_BOX, told)
    summary = html("{} {} {} in order", _mark("good"), len(good), "others are" if told else "checks are")
    folded = html('<details><summary style="cursor:pointer">{}</summary>{}</details>', summary, joined(good))
    return html("<div {}>{}{}</div>", _CARDS_BOX, told, folded)


def _finding(finding: Finding) -> Html:
    return html(
        '<div style="display:flex;gap:6px;padding:1px 0"><span style="flex:none;width:14px">'
        "{}</span><span>{}</span></div>",
        _mark(finding.severity),
        finding.sentence,
    )


def _mark(severity: str) -> Html:
    sign, colour = _MARKS[severity]
    return html('<span style="color:{}" title="{}">{}</span>', colour, _SAYS[severity], sign)


# --- the first lines of a text as they stand in the file --------------------------------------------------------------
# The first lines of a text as they stand in the file, of which a click names the one with the columns' names.

_SHOWN = 12
_ABOVE = 8  # lines shown above a header that stands further down
_MOST = 300  # characters of a line; the panel's width cuts it as well
_RAW_LINES_BOX = Html('style="padding:0 12px 4px;font-size:13px;line-height:1.45"')
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
            _RAW_LINES_BOX,
        )

    def hide(self) -> None:
        """No file is read here now."""
        for one in (self._about, self._style, *self._buttons):
            one.visible = False

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


# --- how a text was understood, and what somebody says instead --------------------------------------------------------
# How a text was understood, and what somebody says instead: the line with the columns' names, and the encoding.

_FOUND = "found by itself"
_MOST_LINES = 200
_LAYOUT_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')


class LayoutControls:
    """Of a text two dropdowns, of any file its rate; a change reads it anew, one that does not fit is taken back."""

    def __init__(self, page: Page, comparing: Comparing) -> None:
        self._page, self._comparing = page, comparing
        self._name = ""
        gui = page.server.gui
        self._told = add_html(gui, visible=False)
        self.folder = gui.add_folder("How the file is read")  # in which somebody may add a button
        with self.folder:
            add_html(gui, IN_PAIRS)
            self.header = gui.add_dropdown("Header line", [_FOUND], visible=False)
            self._encoding = gui.add_dropdown("Encoding", [_FOUND], visible=False)
            hint = "of a file without a time, in samples a second; 0 where a column is the time"
            self.rate = gui.add_number("Rate [Hz]", 0.0, min=0.0, max=1e9, step=1.0, hint=hint, visible=False)
        for control in (self.header, self._encoding, self.rate):
            control.on_update(lambda event: event.client and page.screen.post("layout", self._say))

    def hide(self) -> None:
        """No file is read here now."""
        self._told.visible = self.folder.visible = False

    def show(self, opened: Opened) -> None:
        """As a file was read; nothing for one that is no text.  On the screen's thread."""
        self.folder.visible = True
        self._name, head, said = opened.name, opened.head, opened.hints
        for control in (self._told, self.header, self._encoding):
            control.visible = head is not None
        self.rate.visible = said.rate_Hz is not None or "time_s" not in {
            entry.signal for entry in opened.mapping.entries
        }
        self.rate.value = said.rate_Hz or 0.0
        if head is None:
            return
        what = "As said" if said != Hints() else "Found"
        told = html("{}: {}.", what, head.told) if head.told else "No line with the columns' names is found."
        why = html('<span style="color:{};overflow-wrap:anywhere">▲ {}</span>', COLOURS["warning"], opened.problem)
        self._told.content = html("<div {}>{}</div>", _LAYOUT_BOX, why if opened.problem else told)
        _offer(self.header, range(1, min(len(head.lines), _MOST_LINES) + 1), said.header_line)
        _offer(self._encoding, ENCODINGS.values(), said.encoding and ENCODINGS.get(said.encoding, said.encoding))

    def _say(self) -> None:
        line, encoding = str(self.header.value), str(self._encoding.value)
        names = {title: name for name, title in ENCODINGS.items()}
        said = Hints(
            None if line == _FOUND else int(line),
            None if encoding == _FOUND else names.get(encoding, encoding),
            self.rate.value or None,
        )
        self._comparing.use_layout(self._name, said)


def _offer(dropdown: viser.GuiDropdownHandle[str], choices: Iterable[object], said: object) -> None:
    """The choices and what was said, which is shown."""
    options = list(dict.fromkeys(map(str, [_FOUND, *choices, *([said] if said else [])])))
    if list(dropdown.options) != options:
        dropdown.options = options
    dropdown.value = str(said) if said else _FOUND
