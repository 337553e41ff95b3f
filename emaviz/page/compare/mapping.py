"""The mapping step: which column is which signal, corrected one column at a time, with a preview."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from typing import Any

import viser

from ema_model.errors import InputError, quoted
from ema_model.quantities.units import known_units
from ema_model.recordings import SIGNALS, ColumnMapping, MappedColumn
from ema_model.recordings.columns.mapping import WITHOUT_DELAY
from emaviz.page.compare.cards import mapping_table
from emaviz.page.compare.layout import LayoutControls
from emaviz.page.page import Page
from emaviz.session.compare.comparing import Comparing
from emaviz.session.opened import Opened
from emaviz.text.html import add_html

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
