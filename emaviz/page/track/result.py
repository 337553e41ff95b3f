"""Track's panel on the right: one sentence, k over the flights, the life that remains, and what was said when."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.faults import BY_NAME
from ema_model.text import COLOURS
from ema_model.tracking.flight import Flight
from ema_model.tracking.history import History
from ema_model.tracking.result import Tracked
from ema_model.tracking.track import TRACKED
from ema_model.tracking.words import headline, hindsight
from emaviz.figures import k_over_flights, predicted_life, remaining_life
from emaviz.page.inset import COLUMNS, NEXT_COLUMN
from emaviz.page.kept import Cleared
from emaviz.page.page import Page
from emaviz.page.practice import Seal
from emaviz.page.style import LONG_LABELS
from emaviz.page.track.click import FlightClicks
from emaviz.page.track.leads import FlightLead
from emaviz.session.worker import Worker
from emaviz.text.html import Html, add_html, html
from emaviz.text.notes import BOX, DIM, begin
from emaviz.text.told import whole

_CONFIG = {"displayModeBar": False}
_NONE = "–"
_STEPS = (
    "Choose a folder of flights on the left, or a challenge to practise on; set the threshold that ends the life.",
    Html("Press <b>Track</b>: the faults of each flight are identified."),
    "You see which fault drifts and how many flights remain, as a distribution, today and at any earlier flight.",
)
_ASPECTS = (0.66, 0.42, 0.48)  # of the figures, height over width: the first stands beside the others


class TrackResult:
    """Drawn on the slow screen's thread while "today" is dragged, else on the screen's."""

    def __init__(
        self,
        page: Page,
        slow: Worker,
        lead: Callable[[Callable[[], Flight | None]], FlightLead],
        seal: Callable[[], Seal],
        keep: Callable[[], Cleared],
    ) -> None:
        """lead(chosen): adds the way to a flight's comparison; seal(): a challenge's; keep(): what saves the answer."""
        self._page, self._slow = page, slow
        self._history: History | None = None
        gui = page.server.gui
        self._told = add_html(gui, begin("No flights are tracked yet", _STEPS))
        self._life = gui.add_folder("The unit's life", visible=False)
        with self._life:
            add_html(gui, COLUMNS + LONG_LABELS)
            self._faults = {BY_NAME[name].label: name for name in TRACKED}
            self._fault: Any = gui.add_dropdown("Shown", tuple(self._faults))
            self._today = gui.add_slider(
                "Today, after flight", min=1, max=2, step=1, initial_value=2, hint="Drag it back: what was said then"
            )
            flights = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=_ASPECTS[0])
            self._flight: Any = gui.add_dropdown("Flight", (_NONE,))
            self._lead = lead(self._chosen)
            FlightClicks(page, self._clicked)
            add_html(gui, NEXT_COLUMN)
            self._plots = [flights, *(gui.add_plotly(go.Figure(), config=_CONFIG, aspect=one) for one in _ASPECTS[1:])]
        self._seal = seal()
        self._words = gui.add_folder("All results in words", visible=False, expand_by_default=False)
        with self._words:
            self._document = add_html(gui)
        self._save = gui.add_folder("Keep it", visible=False)
        with self._save:
            self._kept = keep()
        self._today.on_update(lambda event: event.client and slow.post("today", self._draw))
        self._fault.on_update(lambda event: event.client and slow.post("today", self._draw))

    def show(self, history: History | None) -> None:
        """Followed flights, as they are known at their end; None for none."""
        before, self._history = self._history, history
        begun = before is None or history is None or before.flights[:1] != history.flights[:1]
        asked = before is None or history is None or begun or before.thresholds != history.thresholds
        last = history.last if history is not None else None
        for folder in (self._life, self._words, self._save):
            folder.visible = last is not None
        if begun:
            self._seal.show()
        if history is None or last is None:
            self._told.content = begin("No flights are tracked yet", _STEPS)
            return
        at_end = begun or self._today.value >= self._today.max
        first, end = min(history.looks), max(history.looks)
        with self._page.server.atomic():
            self._today.min, self._today.max = min(first, end - 1), end
            if at_end:
                self._today.value = end
            names = [one.name for one in reversed(last.flights)]
            if list(self._flight.options) != names:
                self._flight.options = names
                self._flight.value = names[0]
            if asked:
                self._fault.value = BY_NAME[_first(last)].label
                self._kept.clear()
        self._draw()

    def _chosen(self) -> Flight | None:
        last = self._history.last if self._history is not None else None
        return next((one for one in last.flights if one.name == self._flight.value), None) if last else None

    def _clicked(self, name: str, client: viser.ClientHandle | None) -> None:
        if name in self._flight.options:
            self._flight.value = name
            self._lead.follow(client)

    def _draw(self) -> None:
        history = self._history
        last = history.last if history is not None else None
        if history is None or last is None:
            return
        name, number = self._faults[str(self._fault.value)], int(self._today.value)
        number = max(n for n in history.looks if n <= max(number, min(history.looks)))
        then = history.looks[number]
        one = then.faults[name]
        figures = [
            k_over_flights.figure(then, name, last=last, levels=levels(history, name, number)),
            remaining_life.figure(one.remaining, came=history.came(number, name).crossed)
            if one.remaining is not None
            else remaining_life.none(one.reason),
            predicted_life.figure(history, name, number),
        ]
        told = said(then, name, history)
        with self._page.server.atomic():
            for plot, figure in zip(self._plots, figures):
                plot.figure = figure
            self._told.content = told
            if self._flight.value != then.flights[-1].name:
                self._flight.value = then.flights[-1].name
            self._document.content = whole(then.document)


def levels(history: History, name: str, number: int) -> dict[int, tuple[float, float, float]]:
    """Level of a k, and its 90 % interval, as they were known after each flight up to a number."""
    shown = {n: look.faults[name] for n, look in history.looks.items() if n <= number}
    return {n: (one.level, *one.level90) for n, one in shown.items()}


def said(then: Tracked, name: str, history: History) -> str:
    """The sentence of the day, and what came."""
    number = len(then.flights)
    later = hindsight(then.faults[name], history.came(number, name))
    drifts = then.trusted and any(one.trend for one in then.faults.values())
    colour = COLOURS["warning" if drifts or not then.trusted else "good"]
    return html(
        '<div {}><div style="font-size:16px;font-weight:600;color:{};padding:4px 0">{}</div><div {}>{}</div>{}</div>',
        BOX,
        colour,
        headline(then),
        DIM,
        f"After {then.flights[-1].name}: {number} flights, {len(then.usable)} of them usable",
        html("<div>{}</div>", later[:1].upper() + later[1:]) if later else "",
    )


def _first(last: Tracked) -> str:
    """The k to show first: one with a remaining life, a trend or a threshold, in this order."""
    every = list(last.faults.values())
    return max(every, key=lambda one: (one.remaining is not None, one.trend, one.threshold is not None)).name
