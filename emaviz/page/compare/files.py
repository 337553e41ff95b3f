"""A file that is compared: its card, raw lines, layout and columns."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import Any

import viser

from ema_model.errors import InputError, quoted
from ema_model.quantities.unit_conversion import known_units
from ema_model.recordings import SIGNALS, ColumnMapping, MappedColumn
from ema_model.recordings.column_mapping import WITHOUT_DELAY
from ema_model.recordings.formats.text_layout import ENCODINGS, Hints
from ema_model.recordings.health import Finding, Health
from ema_model.text import COLOURS
from emaviz.page.workspaces import Page
from emaviz.server.viser_private import selector_of
from emaviz.session.compare import Comparing
from emaviz.session.files import Opened
from emaviz.text.html import Html, add_html, html, joined, unescaped

# --- short pieces of HTML on the Compare tab --------------------------------------------------------------------------
# Short pieces of HTML on the Compare tab: the list of recordings, the mapping's table, the data health card.

_MARKS = {"good": ("✓", COLOURS["good"]), "note": ("●", COLOURS["note"]), "warning": ("▲", COLOURS["warning"])}
_CARDS_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')
_DIM = Html('style="opacity:.65"')


def recordings_list(opened: Iterable[Opened]) -> Html:
    """A line for each recording: what it is and how its data are."""
    rows = []
    for one in opened:
        if one.measurement is None or one.health is None:
            mark, text = _mark("warning"), "no table is found in it" if one.problem else "columns to be checked"
        else:
            m = one.measurement
            mark = _mark(one.health.severity)
            length = f"{m.samples:,} samples".replace(",", " ")
            text = f"{length}, a static map" if m.is_map else f"{m.duration_s:.3g} s, {length}"
        rows.append(html("<div>{} <b>{}</b> <span {}>{}</span></div>", mark, one.path.name, _DIM, text))
    return html("<div {}>{}</div>", _CARDS_BOX, joined(rows) or html("<span {}>None yet.</span>", _DIM))


def mapping_table(mapping: ColumnMapping) -> Html:
    """Signal ← column [unit], sign, and how sure the guess is; below it, what is left aside and why."""
    rows = []
    for entry in mapping.entries:
        signal = SIGNALS[entry.signal]
        unit = entry.unit or signal.unit
        sure = f"{100.0 * entry.confidence:.0f} %"
        colour = (
            COLOURS["good"] if entry.confidence >= 0.8 else COLOURS["warning"] if entry.confidence < 0.6 else "inherit"
        )
        rows.append(
            html(
                '<tr title="{}"><td><b>{}</b></td>'
                '<td style="overflow-wrap:anywhere">← {}{}</td>'
                '<td style="white-space:nowrap">{}</td>'
                '<td style="text-align:right;color:{};white-space:nowrap">{}</td></tr>',
                entry.reason,
                signal.title,
                entry.column,
                _done(entry),
                unit or "–",
                colour,
                sure,
            )
        )
    aside = joined(
        html('<div style="overflow-wrap:anywhere"><b>{}</b>: {}</div>', column, why)
        for column, why in mapping.unmapped[:12]
    )
    more = html("<div>… and {} more</div>", len(mapping.unmapped) - 12) if len(mapping.unmapped) > 12 else ""
    left = html('<div style="padding-top:6px"><span {}>Left aside</span>{}{}</div>', _DIM, aside, more) if aside else ""
    table = _table((("signal", "left"), ("column", "left"), ("unit", "left"), ("sure", "right")), rows)
    return html("<div {}>{}{}</div>", _CARDS_BOX, table, left)


def _done(entry: MappedColumn) -> str:
    """What is done to a column's numbers beside its unit, and to its time."""
    factor = entry.sign * entry.scale
    offset = f" {'+' if entry.offset > 0.0 else '−'} {abs(entry.offset):.6g}" if entry.offset else ""
    delay = f", {abs(1e3 * entry.delay_s):.6g} ms {'late' if entry.delay_s > 0.0 else 'early'}" if entry.delay_s else ""
    return (f" × {factor:.6g}".replace("-", "−") if factor != 1.0 else "") + offset + delay


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


def _table(heads: Iterable[tuple[str, str]], rows: Iterable[str]) -> Html:
    """Heads are (text, side); rows are ready."""
    head = joined(
        html('<th style="text-align:{};font-weight:400;opacity:.65">{}</th>', side, text) for text, side in heads
    )
    style = "width:100%;border-collapse:collapse;font-variant-numeric:tabular-nums"
    return html('<table style="{}"><tr>{}</tr>{}</table>', style, head, joined(rows))


def _mark(severity: str) -> Html:
    sign, colour = _MARKS[severity]
    return html('<span style="color:{}" title="{}">{}</span>', colour, severity, sign)


# --- the first lines of a text as they stand in the file --------------------------------------------------------------
# The first lines of a text as they stand in the file, of which a click names the one with the columns' names.

_SHOWN = 20
_ABOVE = 15  # lines shown above a header that stands further down
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
        self.header = gui.add_dropdown("Header in line", [_FOUND], visible=False)
        self._encoding = gui.add_dropdown("Encoding", [_FOUND], visible=False)
        hint = "of a file without a time, in samples a second; 0 where a column is the time"
        self.rate = gui.add_number("Rate [Hz]", 0.0, min=0.0, max=1e9, step=1.0, hint=hint, visible=False)
        for control in (self.header, self._encoding, self.rate):
            control.on_update(lambda event: event.client and page.screen.post("layout", self._say))

    def show(self, opened: Opened) -> None:
        """As a file was read; nothing for one that is no text.  On the screen's thread."""
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


# --- the mapping step: which column is which signal, corrected one column at a time, with a preview -------------------

NOT_USED = "not used"
_MOST_COLUMNS = 200


class MappingStep:
    """A folder of the Compare tab.  preview(opened) draws the signals as mapped; it runs on the screen's thread."""

    def __init__(self, page: Page, comparing: Comparing, preview: Callable[[Opened], None]) -> None:
        self._page, self._comparing, self._preview = page, comparing, preview
        self._opened: Opened | None = None
        gui = page.server.gui
        self.folder = gui.add_folder("Columns", visible=False)
        with self.folder:
            self._layout = LayoutControls(page, comparing)
            self._table = add_html(gui)
            self._column = gui.add_dropdown("Column", [NOT_USED])
            titles = [NOT_USED, *(_title(name) for name in SIGNALS)]
            self._signal = gui.add_dropdown("is", titles)
            self._unit = gui.add_dropdown("in", [NOT_USED])
            self._turned = gui.add_checkbox("Sign turned", False)
            self._late = gui.add_number(
                "Late by [ms]", 0.0, step=0.001, hint="Moved back by as much: a delay of its clock, or of its sensor"
            )
            self.use = gui.add_button("Use these columns", icon=viser.Icon.CHECK)
        self._column.on_update(lambda event: self._later(event, "column", self._show_column))
        self._signal.on_update(lambda event: self._later(event, "signal", lambda: self._edit(new_signal=True)))
        self._unit.on_update(lambda event: self._later(event, "unit", self._edit))
        self._turned.on_update(lambda event: self._later(event, "sign", self._edit))
        self._late.on_update(lambda event: self._later(event, "delay", self._edit))
        self.use.on_click(lambda _: self._apply())

    @property
    def header(self) -> Any:
        """The control that says where a text's columns are named."""
        return self._layout.header

    @property
    def mapping(self) -> ColumnMapping:
        """As it stands now."""
        return ColumnMapping() if self._opened is None else self._opened.mapping

    def show(self, opened: Opened) -> None:
        """Opens the step for a file; on the screen's thread."""
        self._opened = opened
        self._layout.show(opened)
        names = list(opened.columns)[:_MOST_COLUMNS]
        for control in (self._table, self._column, self._signal, self.use):
            control.visible = bool(names)
        if names:
            first = next((name for name, _ in opened.mapping.unmapped if name in names), names[0])
            self._column.options, self._column.value = names, first
        self._show_column()
        self.folder.visible = True
        self._draw()

    def hide(self) -> None:
        """Closes the step."""
        self._opened = None
        self.folder.visible = False

    def _later(self, event: viser.GuiEvent[Any], control: str, job: Callable[[], None]) -> None:
        """A person has moved a control: what follows is done on the screen's thread, one at a time."""
        if event.client is not None:  # else it was set from here
            self._page.ask(f"mapping's {control}", job, event.target)

    def _entry(self) -> MappedColumn | None:
        return next((e for e in self.mapping.entries if e.column == self._column.value), None)

    def _show_column(self) -> None:
        """The chosen column's signal, unit, sign and delay into the controls."""
        entry = self._entry()
        self._signal.value = NOT_USED if entry is None else _title(entry.signal)
        units = [NOT_USED] if entry is None else _units(entry)
        self._unit.options = units
        self._unit.value = units[0] if entry is None else entry.unit or _si(entry.signal)
        self._turned.value = entry is not None and entry.sign < 0
        self._late.value = 0.0 if entry is None else float(f"{1e3 * entry.delay_s:.9g}")
        for control in (self._unit, self._turned):
            control.visible = entry is not None
        self._late.visible = entry is not None and entry.signal not in WITHOUT_DELAY

    def _edit(self, new_signal: bool = False) -> None:
        """The controls into the mapping."""
        if self._opened is None:
            return
        column = self._column.value
        if column not in self._opened.columns:
            raise InputError(f"no column {quoted(column, 40)!r}; choose one of the list")
        signal = next((name for name in SIGNALS if _title(name) == self._signal.value), None)
        others = tuple(e for e in self.mapping.entries if column != e.column and signal != e.signal)
        given_up = [e.column for e in self.mapping.entries if e.signal == signal and e.column != column]
        aside = dict(self.mapping.unmapped) | {name: "left aside by you" for name in given_up}
        if signal is None:
            aside[column] = "left aside by you"
            entries = others
        else:
            aside.pop(column, None)
            entries = (*others, self._edited(signal, new_signal))
        order = list(SIGNALS)
        mapping = ColumnMapping(tuple(sorted(entries, key=lambda e: order.index(e.signal))), tuple(aside.items()))
        self._opened = replace(self._opened, mapping=mapping)
        self._show_column()
        self._draw()

    def _edited(self, signal: str, new_signal: bool) -> MappedColumn:
        """The chosen column as this signal; what has no control here stays as it was said."""
        late_s = 0.0 if signal in WITHOUT_DELAY else self._late.value / 1e3
        before = self._entry()
        if new_signal or before is None:
            return MappedColumn(signal, self._column.value, delay_s=late_s, reason="chosen by you")
        unit = "" if self._unit.value in (NOT_USED, _si(signal)) else self._unit.value
        chosen = {"confidence": 1.0, "reason": "chosen by you", "rivals": ()}
        return replace(before, unit=unit, sign=-1 if self._turned.value else 1, delay_s=late_s, **chosen)

    def _draw(self) -> None:
        if self._opened is not None:
            self._table.content = mapping_table(self.mapping)
            self._preview(self._opened)

    def _apply(self) -> None:
        if self._opened is not None:
            self._comparing.use_mapping(self._opened.name, self.mapping)


def _title(signal: str) -> str:
    """A signal in a dropdown; the linear ones have the rotary ones' titles."""
    one = SIGNALS[signal]
    return f"{one.title} [{one.unit}]" if one.unit else one.title


def _si(signal: str) -> str:
    return SIGNALS[signal].unit or "–"


def _units(entry: MappedColumn) -> list[str]:
    """The signal's own unit first, then those that are converted."""
    own = _si(entry.signal)
    others = [name for name in known_units(SIGNALS[entry.signal].unit) if not replace(entry, unit=name).converter.is_si]
    return list(dict.fromkeys([own, *([entry.unit] if entry.unit else []), *others]))
