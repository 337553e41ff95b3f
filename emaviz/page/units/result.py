"""Units' panel on the right: what differs in words, each unit's parameters, which model suits which, what lacks."""

from __future__ import annotations

from typing import Any

import plotly.graph_objects as go

from ema_model.units.result import UnitsCompared
from ema_model.units.words import document_of, lacking, notes, rests_on, sentences
from emaviz.figures import transfer_matrix, unit_parameters
from emaviz.page.inset import COLUMNS, NEXT_COLUMN, PLOTS_EARLY
from emaviz.page.page import Page
from emaviz.page.practice import Seal
from emaviz.page.units.keep import UnitsKeep
from emaviz.session.units.comparing_units import ComparingUnits
from emaviz.text.html import Html, add_html, html, joined
from emaviz.text.notes import BOX, DIM, begin
from emaviz.text.sentence import begun
from emaviz.text.told import warned, whole
from emaviz.text.verdict import MEANINGS, of_units

_CONFIG = {"displayModeBar": False}
_STEPS = (
    "Choose a folder of units on the left, or a challenge to practise on.",
    Html("Press <b>Compare units</b>: one model is fitted to all units; where a unit differs, a parameter is its own."),
    "You see which unit differs from the rest, in which parameter and by how much, checked on held-out recordings.",
)
_BESIDE_PX = 200  # of a window, what stands above and below the parameters
_WIDTH_PX = 540  # of a figure on a usual panel, by which its share of height is made
_HEAD_PX, _ROW_PX, _FEWEST_ROWS = 110, 34, 4  # of the matrix


class UnitsResult:
    """Everything here is built and changed on the screen's thread."""

    def __init__(self, page: Page, comparing: ComparingUnits) -> None:
        self._page, self._comparing = page, comparing
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._told = add_html(gui, begin("No units are compared yet", _STEPS))
        add_html(gui, PLOTS_EARLY)
        self._matrix = gui.add_folder("The model of one unit on another", visible=False)
        with self._matrix:
            self._transfer: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=0.6)
        self._seal = Seal(page, comparing.practice, lambda: comparing.chosen, lambda: comparing.found)
        self._words = gui.add_folder("All results in numbers", visible=False, expand_by_default=False)
        with self._words:
            self._document = add_html(gui)
        self._save = gui.add_folder("Keep it", visible=False)
        with self._save:
            self._keep = UnitsKeep(page, comparing)
        self._figures = gui.add_folder("Parameters of each unit", visible=False)
        with self._figures:
            add_html(gui, NEXT_COLUMN)
            self._parameters: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=1.0)

    def show(self, found: UnitsCompared | None) -> None:
        """An answer; None for none."""
        with self._page.server.atomic():
            for folder in (self._figures, self._matrix, self._words, self._save):
                folder.visible = found is not None
            self._keep.clear()
            self._seal.show()
            if found is None:
                self._told.content = begin("No units are compared yet", _STEPS)
                return
            self._told.content = said(found)
            self._parameters.figure = unit_parameters.figure(found)
            least, usual, most = (one(found) for one in unit_parameters.HEIGHTS_PX)
            self._page.workspaces.heights.set_figure(self._parameters, least, usual, most, _BESIDE_PX)
            self._transfer.figure = transfer_matrix.figure(found)
            rows = max(len(found.units), _FEWEST_ROWS)
            self._transfer.aspect = (_HEAD_PX + _ROW_PX * rows) / _WIDTH_PX
            self._document.content = whole(document_of(found))


def said(found: UnitsCompared) -> Html:
    """The sentences, what the answer rests on, warnings, and which recordings lack."""
    return html(
        '<div {}><div style="font-size:16px;font-weight:600;color:{};padding:4px 0">{}</div><div {}>{}</div>{}{}</div>',
        BOX,
        MEANINGS[of_units(found)],
        joined(html("<div>{}</div>", begun(line, found.units)) for line in sentences(found)),
        DIM,
        rests_on(found),
        warned(notes(found), found.units),
        _listed([begun(line, found.units) for line in lacking(found)]),
    )


def _listed(lines: list[str]) -> Html:
    if not lines:
        return Html()
    items = joined(html("<div>{}</div>", line) for line in lines)
    return html('<details style="padding-top:4px"><summary style="cursor:pointer">{}</summary>{}</details>',
                "What the recordings do not tell", items)  # fmt: skip
