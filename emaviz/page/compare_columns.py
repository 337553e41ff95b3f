"""Import: a file that is compared, its card, raw lines and layout, and every column in one table with what it is."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Collection, Iterable, Mapping
from dataclasses import replace
from functools import partial
from itertools import pairwise
from typing import Any

import msgspec
import numpy as np
import viser

from ema_model.errors import InputError, quoted
from ema_model.recordings import SIGNALS, ColumnMapping, MappedColumn
from ema_model.recordings.column_mapping import WITHOUT_DELAY, unit_in_name
from ema_model.recordings.column_names import known_units
from ema_model.recordings.formats.text_layout import ENCODINGS, Hints
from ema_model.recordings.health import Finding, Health
from ema_model.text import COLOURS
from emaviz.page.style import IN_PAIRS, unseen_field
from emaviz.page.window_layout import TWO_COLUMNS_PX
from emaviz.page.workspaces import Page
from emaviz.server.viser_private import Inside, id_of, selector_of
from emaviz.session.compare import Comparing
from emaviz.session.files import Array, Opened
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
            page.pressed(button, partial(self._choose, i))

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
            page.changed(control, self._say)

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


# --- the table: a row a column, which is edited where it stands -------------------------------------------------------
# One piece of HTML: a hundred columns with four of viser's controls each would take the page seconds.  Its fields tell
# what is edited through an unseen field, and are drawn anew from the mapping.

_MOST_COLUMNS = 200
_WIDE_PX, _HIGH_PX, _BINS = 220, 34, 110  # of a column's drawing, and how many parts it has, each from min to max
_BEFORE_UNIT = re.compile(r"(?=[\[(])")
_SURE, _UNSURE = 0.8, 0.6
_BETWEEN = "|"  # after it stands the time, so that the same edit twice is another text
_SCRIPT = """
(() => {
  window.emavizColumns?.abort();
  const heard = window.emavizColumns = new AbortController(), on = { capture: true, signal: heard.signal };
  const clicked = ['plot', 'sign'];
  const act = (event) => {
    const at = event.target.closest?.('.emaviz-map [data-do]');
    if (!at || clicked.includes(at.dataset.do) !== (event.type === 'click')) return;
    const row = document.querySelector('label[for="FIELD"]')?.closest('.mantine-Flex-root');
    const input = row?.querySelector('input'), column = at.closest('tr').dataset.column;
    if (!input) return;
    const said = { table: +at.closest('.emaviz-map').dataset.table, column: +column, what: at.dataset.do,
                   value: at.value ?? '' };
    const text = JSON.stringify(said) + 'BETWEEN' + Date.now();
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, text);
    input.dispatchEvent(new Event('input', { bubbles: true }));
    if (said.what === 'plot' && !at.closest('.drawn'))  // it is drawn below, and may be out of sight
      setTimeout(() => [...document.querySelectorAll('.js-plotly-plot')].find(one => one.checkVisibility())
        ?.scrollIntoView({ block: 'nearest', behavior: 'smooth' }), 600);
    if (event.type !== 'click')  // the keyboard stays where it was, though the table is drawn anew
      setTimeout(() => document.querySelector(`.emaviz-map tr[data-column="${column}"] [data-do=${said.what}]`)
        ?.focus({ preventScroll: true }), 400);
  };
  document.addEventListener('change', act, on);
  document.addEventListener('click', act, on);
})();
"""
_STYLE = unescaped(
    "<style>.emaviz-map{width:100%;border-collapse:collapse;font-size:12.5px;line-height:1.3}"
    ".emaviz-map th{text-align:left;font-weight:400;opacity:.65;padding:2px 8px}"
    ".emaviz-map td{padding:3px 8px;border-top:1px solid rgba(134,142,150,.3);overflow-wrap:anywhere}"
    ".emaviz-map td:first-child{min-width:7.5em}"
    ".emaviz-map .aside td:not(:nth-child(3)){opacity:.6}"
    ".emaviz-map :is(select,input){font:inherit;color:inherit;background:var(--mantine-color-body);height:26px;"
    "border:1px solid rgba(134,142,150,.6);border-radius:4px;padding:0 4px;max-width:100%}"
    ".emaviz-map input{width:64px}"
    ".emaviz-map button{font:inherit;color:inherit;background:none;border:1px solid rgba(134,142,150,.6);"
    "border-radius:4px;height:26px;min-width:32px;cursor:pointer}"
    ".emaviz-map [data-do=plot]{padding:0;border:0;height:34px;width:220px;text-align:left;"
    "color:var(--mantine-primary-color-light-color,#2f6fde)}"
    f"@media(max-width:{TWO_COLUMNS_PX - 1}px){{.emaviz-map .why{{display:none}}"
    ".emaviz-map [data-do=plot]{width:120px}.emaviz-map :is(td,th){padding-left:5px;padding-right:5px}}"
    ".emaviz-map .drawn [data-do=plot]{outline:2px solid #2f6fde;outline-offset:2px}"
    ".emaviz-map svg{display:block}.emaviz-map small{opacity:.75;white-space:nowrap}</style>"
)


class Edit(msgspec.Struct, frozen=True):
    """What somebody did in the table."""

    table: int  # that was shown then
    column: int
    what: str  # plot, signal, unit, sign, late
    value: str = ""


class ColumnTable:
    """edited(edit): called on the screen's thread with what was done in the table that is shown."""

    def __init__(self, page: Page, edited: Callable[[Edit], None], beside: Callable[[], Any]) -> None:
        """beside(): the control beside which it is said what is refused."""
        gui = page.server.gui
        self.piece = add_html(gui, visible=False)
        self.number = 0  # of the file that is shown
        self._drawn: tuple[dict[str, Array] | None, list[Html]] = None, []
        field: Any = gui.add_text("Column edited", "")
        add_html(gui, unseen_field(id_of(field)))

        def told(event: viser.GuiEvent[Any]) -> None:
            text = str(field.value)
            if event.client is not None and text:
                said = text.rpartition(_BETWEEN)[0]
                page.ask(f"mapping {text}", lambda: edited(_read(said)), beside())

        field.on_update(told)
        Inside(page.server).run(_SCRIPT.replace("FIELD", id_of(field)).replace("BETWEEN", _BETWEEN))

    def show(self, opened: Opened, plotted: str) -> None:
        """The columns of a file; plotted: the one that is drawn large below."""
        if opened.columns is not self._drawn[0]:
            self.number += 1
            self._drawn = opened.columns, [drawing(values) for values in list(opened.columns.values())[:_MOST_COLUMNS]]
        self.piece.content = table(opened, self.number, self._drawn[1], plotted)
        self.piece.visible = bool(opened.columns)


def _read(text: str) -> Edit:
    try:
        return msgspec.json.decode(text, type=Edit)
    except msgspec.DecodeError:
        raise InputError("the page said nothing that this table knows; load it again") from None


def table(opened: Opened, number: int, drawings: list[Html], plotted: str) -> Html:
    """A row a column, in the file's order."""
    by_column = {entry.column: entry for entry in opened.mapping.entries}
    why = dict(opened.mapping.unmapped)
    rows = [
        _row(i, name, drawing, by_column.get(name), why.get(name, ""), name == plotted)
        for i, (name, drawing) in enumerate(zip(opened.columns, drawings))
    ]
    heads = ("Column of the file", "Its numbers (click: large)", "Quantity", "Unit in the file", "Sign")
    head = joined(html("<th>{}</th>", one) for one in (*heads, "Late by [ms]", "Sure"))
    more = len(opened.columns) - len(rows)
    left = html("<div>… and {} more columns, which are not shown</div>", more) if more > 0 else ""
    return _STYLE + html(
        '<div style="padding:0 6px 6px;overflow-x:auto"><table class="emaviz-map" data-table="{}">'
        "<thead><tr>{}</tr></thead><tbody>{}</tbody></table>{}</div>",
        number,
        head,
        joined(rows),
        left,
    )


def _row(place: int, name: str, drawing: Html, entry: MappedColumn | None, why: str, plotted: bool) -> Html:
    classes = " ".join(filter(None, ("aside" if entry is None else "", "drawn" if plotted else "")))
    fields = _fields(entry)
    return html(
        '<tr data-column="{}" class="{}"><td><b>{}</b>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td><td>{}</td>'
        "<td>{}</td></tr>",
        place,
        classes,
        _broken(name),
        "" if entry is None else html("<br><small>{}</small>", done(entry)) if done(entry) else "",
        html('<button data-do="plot" title="Draws {} below">{}</button>', name, drawing),
        _select("signal", _quantities(), "" if entry is None else entry.signal, f"What {name} is"),
        *fields,
        html('<span class="why" style="opacity:.8">{}</span>', why) if entry is None else _sure(entry),
    )


def _broken(name: str) -> Html:
    """A column's name, whose lines end before its unit rather than within it."""
    return joined(_BEFORE_UNIT.split(name), "<wbr>")


def _fields(entry: MappedColumn | None) -> tuple[Html, Html, Html]:
    """Unit, sign and delay of a column that is used."""
    if entry is None:
        return Html("–"), Html(), Html()
    units = {one: one for one in units_of(entry)}
    unit = _select("unit", units, entry.unit or si(entry.signal), f"Unit of {entry.column} in the file")
    sign = html(
        '<button data-do="sign" title="Turns its sign" aria-label="Sign of {}">{}</button>',
        entry.column,
        "−" if entry.sign < 0 else "+",
    )
    if entry.signal in WITHOUT_DELAY:
        return unit, sign, Html()
    late = html(
        '<input data-do="late" type="number" step="any" value="{}" aria-label="{} is late by, ms" '
        'title="It is moved back by as much: a delay of its clock, or of its sensor">',
        f"{1e3 * entry.delay_s:.9g}",
        entry.column,
    )
    return unit, sign, late


def _select(what: str, options: Mapping[str, str], chosen: str, label: str) -> Html:
    made = joined(
        html('<option value="{}"{}>{}</option>', value, Html(" selected") if value == chosen else "", title)
        for value, title in options.items()
    )
    return html('<select data-do="{}" aria-label="{}">{}</select>', what, label, made)


def _sure(entry: MappedColumn) -> Html:
    """How sure it is that this is what the column is, and why."""
    good, bad = entry.confidence >= _SURE, entry.confidence < _UNSURE
    colour = COLOURS["good"] if good else COLOURS["warning"] if bad else "inherit"
    share = f"{100.0 * entry.confidence:.0f} %"
    said = '<b style="color:{};white-space:nowrap" title="{}">{}</b> <span class="why" style="opacity:.8">{}</span>'
    return html(said, colour, entry.reason, share, entry.reason)


def done(entry: MappedColumn) -> str:
    """What is done to a column's numbers beside its unit, sign and delay."""
    offset = f"{'+' if entry.offset > 0.0 else '−'} {abs(entry.offset):.6g}" if entry.offset else ""
    return " ".join(filter(None, (f"× {entry.scale:.6g}".replace("-", "−") if entry.scale != 1.0 else "", offset)))


def drawing(values: Array) -> Html:
    """A column over its samples, as small as a line of text, and from where to where its numbers go."""
    values = np.asarray(values, dtype=float)
    good = np.isfinite(values)
    if not good.any():
        return html("<small>no number in it</small>")
    low, high = float(values[good].min()), float(values[good].max())
    edges = np.linspace(0, len(values), min(_BINS, len(values)) + 1).astype(int)
    points: list[str] = []
    for i, (first, last) in enumerate(pairwise(edges)):
        part = values[first:last][good[first:last]]
        x = (i + 0.5) / (len(edges) - 1) * _WIDE_PX
        for y in dict.fromkeys((float(part.min()), float(part.max()))) if len(part) else ():
            height = 0.5 if high == low else (y - low) / (high - low)
            points.append(f"{x:.0f},{1 + (1.0 - height) * (_HIGH_PX - 14):.1f}")
    look = 'fill="none" stroke="currentColor" stroke-width="1" vector-effect="non-scaling-stroke"'
    line = f'<polyline points="{" ".join(points)}" {look}/>'
    missing = "" if good.all() else f", {100.0 * float(np.mean(~good)):.3g} % missing"
    text = f"{low:.4g} … {high:.4g}{missing}".replace("-", "−") if high > low else f"always {low:.4g}{missing}"
    size = f'width="100%" height="{_HIGH_PX - 12}" viewBox="0 0 {_WIDE_PX} {_HIGH_PX - 12}" preserveAspectRatio="none"'
    svg = f'<svg {size} aria-hidden="true">{line}</svg>'
    return unescaped(svg) + html("<small>{}</small>", text)


def _quantities() -> dict[str, str]:
    """Their titles, by signal; none first."""
    return {"": "not used"} | {name: title(name) for name in SIGNALS}


def title(signal: str) -> str:
    """Of a quantity, with its SI unit; the linear ones have the rotary ones' titles."""
    one = SIGNALS[signal]
    return f"{one.title} [{one.unit}]" if one.unit else one.title


def si(signal: str) -> str:
    """Its SI unit."""
    return SIGNALS[signal].unit or "–"


def units_of(entry: MappedColumn) -> list[str]:
    """The signal's own unit first, then those that are converted."""
    own = si(entry.signal)
    others = [name for name in known_units(SIGNALS[entry.signal].unit) if not replace(entry, unit=name).converter.is_si]
    return list(dict.fromkeys([own, *([entry.unit] if entry.unit else []), *others]))


# --- the import step: how the file is read, and what its columns are --------------------------------------------------


class MappingStep:
    """Stands across the whole width of Compare's panel.

    preview(opened, plotted) draws the signals as mapped, and a column as it stands in the file; on the screen's thread.
    """

    def __init__(self, page: Page, comparing: Comparing, preview: Callable[[Opened, str], None]) -> None:
        self._comparing, self._preview = comparing, preview
        self._opened: Opened | None = None
        self._plotted = ""
        gui = page.server.gui
        self._layout = LayoutControls(page, comparing)
        with self._layout.folder:
            self.use = gui.add_button("Use these columns", icon=viser.Icon.CHECK)
        self._table = ColumnTable(page, self._edit, lambda: self.use)
        self._lines: RawLines | None = None
        self._page = page
        page.pressed(self.use, self._apply)
        self.hide()

    def add_lines(self) -> None:
        """A text's first lines, at this place of the page."""
        self._lines = RawLines(self._page, self._comparing)

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
        if self._plotted not in opened.columns:
            self._plotted = ""
        self._layout.show(opened)
        if self._lines is not None:
            self._lines.show(opened)
        self.use.visible = bool(opened.columns)
        self.redraw()

    def hide(self) -> None:
        """Closes the step."""
        self._opened, self._plotted = None, ""
        self._layout.hide()
        if self._lines is not None:
            self._lines.hide()
        self._table.piece.visible = False

    def _edit(self, edit: Edit) -> None:
        """What was done in the table, into the mapping."""
        opened = self._opened
        if opened is None or edit.table != self._table.number:
            return  # of a file that gave way meanwhile
        names = list(opened.columns)[:_MOST_COLUMNS]
        if not 0 <= edit.column < len(names):
            raise InputError("there is no such column; choose one of the table")
        column = names[edit.column]
        if edit.what == "plot":
            self._plotted = "" if self._plotted == column else column
        elif edit.what == "signal":
            self._opened = replace(opened, mapping=self._with(column, edit.value))
        else:
            entry = next((one for one in opened.mapping.entries if one.column == column), None)
            if entry is None:
                raise InputError(f"{column}: say first what it is")
            changed = _changed(entry, edit)
            entries = tuple(changed if one is entry else one for one in opened.mapping.entries)
            self._opened = replace(opened, mapping=replace(opened.mapping, entries=entries))
        self.redraw()

    def _with(self, column: str, signal: str) -> ColumnMapping:
        """The mapping with this column as that signal, or as none; who was it before is left aside."""
        if signal and signal not in SIGNALS:
            raise InputError("there is no such quantity; choose one of the list")
        others = [one for one in self.mapping.entries if column != one.column and signal != one.signal]
        given_up = [one.column for one in self.mapping.entries if one.signal == signal and one.column != column]
        aside = dict(self.mapping.unmapped) | {name: "left aside by you" for name in given_up}
        if signal:
            aside.pop(column, None)
            unit = unit_in_name(column, signal)
            others.append(MappedColumn(signal, column, unit, reason="chosen by you"))
        else:
            aside[column] = "left aside by you"
        order = list(SIGNALS)
        return ColumnMapping(tuple(sorted(others, key=lambda one: order.index(one.signal))), tuple(aside.items()))

    def redraw(self) -> None:
        """As the columns are read now, where a file is at this step."""
        if self._opened is not None:
            self._table.show(self._opened, self._plotted)
            self._preview(self._opened, self._plotted)

    def _apply(self) -> None:
        if self._opened is not None:
            self._comparing.use_mapping(self._opened.name, self.mapping)


def _changed(entry: MappedColumn, edit: Edit) -> MappedColumn:
    """An entry with another unit, sign or delay; InputError for a value that is none."""
    chosen: dict[str, Any] = {"confidence": 1.0, "reason": "chosen by you", "rivals": ()}
    if edit.what == "unit":
        if edit.value not in units_of(entry):
            raise InputError(f"{entry.column}: there is no such unit of it; choose one of the list")
        return replace(entry, unit="" if edit.value == si(entry.signal) else edit.value, **chosen)
    if edit.what == "sign":
        return replace(entry, sign=-entry.sign, **chosen)
    try:
        late_ms = float(edit.value or 0.0)
    except ValueError:
        late_ms = math.nan
    if edit.what != "late" or not math.isfinite(late_ms):
        raise InputError(f"{entry.column}: late by how many ms? Give a number")
    return replace(entry, delay_s=late_ms / 1e3, **chosen)
