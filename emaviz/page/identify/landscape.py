"""Identify's Landscape tab: the cost over two chosen k around an answer, simulated on demand."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import viser

from ema_model.errors import InputError
from ema_model.faults import FAULTS
from ema_model.identification.landscape import POINTS, Landscape, Way, extent, slices, ways
from ema_model.identification.run import ALGORITHMS
from ema_model.quantities.numbers import amount
from emaviz.figures import landscape as drawn
from emaviz.page.identify.swarm import telling
from emaviz.page.page import Page
from emaviz.session.race import Race
from emaviz.session.worker import Steps, Worker
from emaviz.text.html import Html, add_html, html, joined

_BEST = "the answer"
_WHOLE, _CLOSE = "all of 0 … 1", "close to it"
_NAMES = tuple(fault.label for fault in FAULTS)
_CONFIG = {"displayModeBar": False, "responsive": False}
_BOX = Html('style="padding:2px 12px;font-size:12.5px;line-height:1.45"')


class LandscapeView:
    """Its controls, the map and what it says.  Figures are drawn on the slow screen's thread."""

    def __init__(self, page: Page, slow: Worker) -> None:
        self._page, self._slow = page, slow
        self._race: Race | None = None
        self._stop = False
        self._by_hand = False  # which two k
        self._ways: Mapping[str, Way] = {}
        self._plot: Any = None
        gui = page.server.gui
        self._x: Any = gui.add_dropdown("Map across", _NAMES, initial_value=_NAMES[0])
        self._y: Any = gui.add_dropdown("Map upwards", _NAMES, initial_value=_NAMES[5])
        self._through: Any = gui.add_dropdown("Through", (_BEST,), hint="The other six k are held at this place's")
        self._extent: Any = gui.add_dropdown("Shown", (_WHOLE, _CLOSE))
        self._draw = gui.add_button("Draw the landscape", icon=viser.Icon.MAP_2, disabled=True)
        self._halt = gui.add_button("Stop drawing", icon=viser.Icon.PLAYER_STOP, color="red", visible=False)
        self._bar = gui.add_progress_bar(0.0, visible=False)
        self._said = add_html(gui, _note("Once something is identified, its cost over two k can be drawn here."))
        self._place = gui.add_folder("Map", visible=False)
        self._words = add_html(gui)
        for entry in (self._x, self._y):
            entry.on_update(lambda event: event.client and self._chosen())
        self._draw.on_click(lambda _: page.screen.post("landscape", self._begin))
        self._halt.on_click(lambda _: self._ask_to_stop())

    def answered(self, race: Race) -> None:
        """A race is over; on the screen's thread."""
        self._race, self._ways = race, {}
        self._place.visible = False
        self._words.content = ""
        best = race.best
        self._draw.disabled = best is None or best.k is None
        if best is None or best.k is None:
            return
        others = [ALGORITHMS.get(name, name) for name in race.tracks if race.tracks[name] is not best]
        self._through.options = (_BEST, *(f"where {title} ended" for title in others))
        self._through.value = _BEST
        if not self._by_hand:
            x, y = telling(best.k if race.truth is None else race.truth)
            self._x.value, self._y.value = _NAMES[x], _NAMES[y]
        self._said.content = _note(f"{POINTS} × {POINTS} simulations, the other six k held.")

    def _chosen(self) -> None:
        self._by_hand = True

    def _ask_to_stop(self) -> None:
        self._stop = True

    # --- the simulations --------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        """Starts what the controls ask for, or says why not."""
        race = self._race
        if race is None or race.best is None:
            return

        def tried() -> None:
            x, y = (_NAMES.index(str(entry.value)) for entry in (self._x, self._y))
            if x == y:
                raise InputError("a landscape needs two different k; choose another one across or upwards")
            steps = self._steps(race, x, y, self._place_held(race), self._extent.value == _CLOSE)
            self._stop = False
            if not self._page.session.worker.start(steps):
                self._page.notify("One at a time", "A long calculation is running; stop it first.", "yellow")
                return
            self._busy(True)

        self._page.checked(tried)

    def _place_held(self, race: Race) -> np.ndarray:
        """(8,): where the chosen search ended, or the answer."""
        best = race.best
        assert best is not None and best.k is not None
        for name, k in ends(race).items():
            if self._through.value == f"where {ALGORITHMS.get(name, name)} ended":
                return k
        return best.k

    def _steps(self, race: Race, x: int, y: int, through: np.ndarray, close: bool) -> Steps:
        """On the compute thread, a few rows each."""
        assert race.best is not None and race.best.k is not None
        interval = race.best.answer.uncertainty.interval90 if race.best.answer is not None else None
        across, upwards = (extent(through, k, interval, close) for k in (x, y))
        found: Landscape | None = None
        try:
            yield
            if not self._ways:
                self._ways = ways(race.objective, ends(race), race.best.k)
            for found in slices(race.objective, through, x, y, across, upwards):
                self._show(race, found)
                yield
                if self._stop:
                    break
        finally:
            self._page.screen.post("landscape over", lambda: self._over(race, found))

    # --- what is shown ----------------------------------------------------------------------------------------------

    def _show(self, race: Race, found: Landscape) -> None:
        self._page.screen.post("landscape share", lambda: self._tell(found))
        self._slow.post("landscape", lambda: self._draw_map(race, found))

    def _tell(self, found: Landscape) -> None:
        self._bar.value = 100.0 * found.share

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

    def _over(self, race: Race, found: Landscape | None) -> None:
        self._busy(False)
        if found is None or race is not self._race:
            return
        stopped = "" if found.share == 1.0 else f"Stopped at {100.0 * found.share:.0f} %. "
        held = ", ".join(f"{FAULTS[i].name} {found.through[i]:.3f}" for i in range(8) if i not in (found.x, found.y))
        known = found.rmse_A[np.isfinite(found.rmse_A)]
        range_ = f" From {amount(known.min(), 'A')} to {amount(known.max(), 'A')}." if len(known) else ""
        self._said.content = _note(f"{stopped}Held: {held}.{range_}")
        said = drawn.sentences(self._ways)
        self._words.content = joined(html("<div {}>{}</div>", _BOX, line) for line in said)

    def _busy(self, busy: bool) -> None:
        with self._page.server.atomic():
            self._draw.visible, self._halt.visible, self._bar.visible = not busy, busy, busy
            self._bar.value = 0.0


def ends(race: Race) -> dict[str, np.ndarray]:
    """Where each search of a race ended, before any fit, (8,)."""
    return {name: track.last.k for name, track in race.tracks.items() if track.last is not None}


def _note(text: str) -> Html:
    return html("<div {}>{}</div>", _BOX, text)
