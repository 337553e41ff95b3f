"""Identify's Landscape tab: the cost over two chosen k around an answer, simulated on demand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser

from ema_model.faults import FAULTS
from ema_model.identification.landscape import POINTS, Landscape, Way
from ema_model.identification.run import algorithm_title
from ema_model.identification.words import CORRECTED, way_sentences
from emaviz.figures import landscape as drawn
from emaviz.page.identify.swarm import telling
from emaviz.page.inset import COLUMNS, NEXT_COLUMN
from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.session.identify.landscape import Landscapes, ends
from emaviz.session.identify.race import Race
from emaviz.session.worker import Worker
from emaviz.text.html import Html, add_html, joined
from emaviz.text.notes import begin, note

_BEST = "the answer"
_WHOLE, _CLOSE = "all of 0 … 1", "close to it"
_STEPS = (
    Html("Press <b>Identify</b> on the left, and wait for the answer."),
    Html("Choose two of k1 … k8 here, and press <b>Draw the landscape</b>: the search's cost is simulated over both."),
    "You see whether the answer lies in a narrow valley, in a long one, or beside another that fits as well.",
)
_NAMES = tuple(fault.label for fault in FAULTS)
_CONFIG = {"displayModeBar": False, "responsive": False}


class LandscapeView:
    """Its controls, the map and what it says.  Figures are drawn on the slow screen's thread."""

    def __init__(self, page: Page, slow: Worker) -> None:
        self._page, self._landscapes = page, Landscapes(page.session.worker)
        self._race: Race | None = None
        self._by_hand = False  # which two k
        self._plot: Any = None
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._x: Any = gui.add_dropdown("Horizontal k", _NAMES, initial_value=_NAMES[0])
        self._y: Any = gui.add_dropdown("Vertical k", _NAMES, initial_value=_NAMES[5])
        self._through: Any = gui.add_dropdown("Through", (_BEST,), hint="The other six k are held at this place's")
        self._extent: Any = gui.add_dropdown("Shown", (_WHOLE, _CLOSE))
        self._draw = gui.add_button("Draw the landscape", icon=viser.Icon.MAP_2, disabled=True)
        self._line = JobLine(page, self._landscapes.job, stop="Stop drawing")
        self._first = add_html(gui, begin("No landscape yet", _STEPS))
        self._show_controls(False)
        self._place = gui.add_folder("Map", visible=False)
        with self._place:
            add_html(gui, NEXT_COLUMN)
        self._words = add_html(gui)
        for entry in (self._x, self._y):
            entry.on_update(lambda event: event.client and self._chosen())
        self._draw.on_click(lambda _: page.screen.post("landscape", self._begin))
        landscapes, post = self._landscapes, page.screen.post
        landscapes.job.began.connect(lambda _: post("landscape runs", lambda: self._busy(True)))
        landscapes.job.ended.connect(lambda _: post("landscape runs", lambda: self._busy(False)))
        landscapes.grown.connect(lambda *found: slow.post("landscape", lambda: self._draw_map(*found)))
        landscapes.drawn.connect(lambda *found: post("landscape ways", lambda: self._say_ways(*found)))

    def answered(self, race: Race) -> None:
        """A race is over; on the screen's thread."""
        self._race = race
        self._place.visible = False
        self._words.content = ""
        best = race.best
        self._show_controls(best is not None and best.k is not None)
        if best is None or best.k is None:
            return
        others = [algorithm_title(name) for name in race.tracks if race.tracks[name] is not best]
        self._through.options = (_BEST, *(f"where {title} ended" for title in others))
        self._through.value = _BEST
        if not self._by_hand:
            x, y = telling(best.k if race.truth is None else race.truth)
            self._x.value, self._y.value = _NAMES[x], _NAMES[y]
        self._line.say(f"{POINTS} × {POINTS} simulations, the other six k held.")

    def _show_controls(self, shown: bool) -> None:
        """Of the landscape of an answer; before there is one, how to get there."""
        self._draw.disabled, self._first.visible = not shown, not shown
        for control in (self._x, self._y, self._through, self._extent, self._draw):
            control.visible = shown
        if not shown:
            self._line.say("")

    def _chosen(self) -> None:
        self._by_hand = True

    # --- the simulations --------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Starts what the controls ask for, or says why not."""
        race = self._race
        if race is None or race.best is None:
            return
        x, y = (_NAMES.index(str(entry.value)) for entry in (self._x, self._y))
        through, close = self._place_held(race), self._extent.value == _CLOSE
        self._page.begins(lambda: self._landscapes.draw(race, x, y, through, close), self._draw)

    def _place_held(self, race: Race) -> np.ndarray:
        """(8,): where the chosen search ended, or the answer."""
        best = race.best
        assert best is not None and best.k is not None
        for name, k in ends(race).items():
            if self._through.value == f"where {algorithm_title(name)} ended":
                return k
        return best.k

    # --- what is shown ----------------------------------------------------------------------------------------------

    def _draw_map(self, race: Race, found: Landscape) -> None:
        best = race.best
        if race is not self._race or best is None or best.k is None:
            return
        sure = best.answer.uncertainty.interval90 if best.answer is not None and best.answer.polished else None
        figure = drawn.figure(found, drawn.Marks(best.k, sure, race.truth, ends(race)))
        with self._page.server.atomic():
            if self._plot is None:
                with self._place:
                    self._plot = self._page.server.gui.add_plotly(figure, config=_CONFIG, aspect=1.0)
            else:
                self._plot.figure = figure
            self._place.visible = True

    def _say_ways(self, race: Race, found: Mapping[str, Way]) -> None:
        if race is self._race:
            best = race.best
            fitted = best.algorithm if best is not None and best.answer is not None and best.answer.polished else ""
            self._words.content = joined(note(line) for line in (*way_sentences(found, fitted), CORRECTED))

    def _busy(self, busy: bool) -> None:
        self._draw.visible = not busy
