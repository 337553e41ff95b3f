"""Identify's panel on the right: convergence and swarm, the answer, and the table of all runs."""

from __future__ import annotations

import time
from collections.abc import Callable
from typing import Any

import numpy as np
import viser

from ema_model.faults import HEALTHY, NAMES
from ema_model.identification.next_experiment import Suggestion
from ema_model.identification.run import ALGORITHMS
from emaviz.figures.convergence import LiveConvergence
from emaviz.figures.fault_bars import fault_bars
from emaviz.figures.fitted_current import LiveFit
from emaviz.figures.identified_table import Row, table
from emaviz.page.identify import WORKSPACE
from emaviz.page.identify.landscape import LandscapeView
from emaviz.page.identify.swarm import SwarmView
from emaviz.page.inset import COLUMNS
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.standing import Standing
from emaviz.scene.motion import PLAYED, motion
from emaviz.session.identify.race import Race, Track
from emaviz.session.worker import Worker
from emaviz.text.html import Html, add_html
from emaviz.text.identification import sure_words
from emaviz.text.notes import begin

_BEST = "the best"
_STEPS = (
    "Set faults on Explore, or choose a measurement of the data folder on the left.",
    Html("Press <b>Identify</b>: the search runs the model for a population of faults until its current fits."),
    "You get k1 … k8 in physical units, each with its 90 % interval, and which of them are faults.",
)
_SEARCH, _ANSWER = "Search", "Answer"  # tabs: the second comes forward once it is there
_LEAST_S = 0.1  # between two pictures of a swarm, which browsers in software draw slowly
_MOST_ROWS = 200


class IdentifyResult:
    """Drawn on the screen's thread, what changes slowly on the slow one's; strip: its clock, for what is identified."""

    def __init__(
        self,
        page: Page,
        slow: Worker,
        panel: viser.PanelHandle,
        strip: PlaybackStrip,
        standing: Standing,
        to_explore: Callable[[Suggestion], None],
    ) -> None:
        """to_explore(run): sets a run there."""
        self._page, self._slow, self._strip, self._to_explore = page, slow, strip, to_explore
        self._race: Race | None = None
        self._begun: Race | None = None  # of which something was drawn
        self._separating: Suggestion | None = None
        self._drawn_at = 0.0
        self.rows: list[Row] = []
        gui = page.server.gui
        with panel.add_tab(_SEARCH, viser.Icon.CHART_DOTS):
            standing.add(gui)
            add_html(gui, COLUMNS)
            self._empty: Any = add_html(gui, begin("Nothing is identified yet", _STEPS))
            self._convergence = LiveConvergence(gui)
            self._convergence.handle.visible = False
            page.workspaces.heights.add([self._convergence.handle], spare_px=160, beside_px=332)
            self._swarm = SwarmView(page)
        with panel.add_tab(_ANSWER, viser.Icon.TARGET_ARROW):
            standing.add(gui)
            self._whose = gui.add_dropdown("Algorithm shown", (_BEST, *ALGORITHMS.values()))
            self._bars = add_html(gui, fault_bars(HEALTHY, page.session.actuator))
            self._sure = add_html(gui)
            self._try = gui.add_button(
                "Set that command in Explore",
                icon=viser.Icon.ADJUSTMENTS,
                color="gray",
                visible=False,
                hint="The run that would tell them apart; then identify again",
            )
            self._fit = LiveFit(gui)
            page.workspaces.heights.add(self._fit.handles, spare_px=30)
        with panel.add_tab("Landscape", viser.Icon.MAP_2):
            standing.add(gui)
            self._landscape = LandscapeView(page, slow)
        with panel.add_tab("History", viser.Icon.TABLE):
            self._table = add_html(gui, table([]))
            self._clear_table: Any = gui.add_button(
                "Clear the table", icon=viser.Icon.ERASER, color="gray", visible=False
            )
        self._try.on_click(lambda event: page.screen.post("separating", lambda: self._try_separating(event.client)))
        self._whose.on_update(lambda _: slow.post("answer", self._draw_answer))
        self._clear_table.on_click(lambda _: page.screen.post("runs", self._clear))
        page.workspaces.entered.connect(lambda name: name == WORKSPACE.name and self.draw())

    # --- from the compute thread ------------------------------------------------------------------------------------

    def progressed(self, race: Race) -> None:
        """A race has gone on; on any thread."""
        self._race = race
        if self._page.workspaces.anyone(WORKSPACE.name):  # what nobody sees is not drawn
            self._page.screen.post("swarm", lambda: self._draw(race, soon=False))
            self._slow.post("answer", self._draw_answer)

    # --- on the screen's thread -------------------------------------------------------------------------------------

    def draw(self) -> None:
        """Everything as it stands now."""
        if self._race is not None:
            self._draw(self._race, soon=True)
            self._slow.post("answer", self._draw_answer)

    def finished(self, race: Race) -> None:
        """The race is over: its last picture, and its rows in the table."""
        self._draw(race, soon=True)
        self._slow.post("answer", self._draw_answer)
        self._landscape.answered(race)
        best = race.best
        if best is not None and best.k is not None and all(name in race.measurement for name in PLAYED):
            self._strip.put(motion(race.measurement, _seen(best), self._page.session.actuator), WORKSPACE.name)
        self._page.workspaces.bring_forward(WORKSPACE.name, _SEARCH, _ANSWER)
        performance = race.performance()
        number = 1 + max((row.race for row in self.rows), default=0)
        settings = race.settings
        self.show_rows(
            [
                *self.rows,
                *(
                    Row(
                        number,
                        race.source,
                        one.algorithm,
                        settings.population,
                        settings.iterations,
                        settings.fitness,
                        settings.seed,
                        one.error_percent,
                        one.rmse,
                        one.evaluations,
                        one.elapsed_s,
                        performance.get(one.algorithm),
                        one.stopped,
                        one.corrected_rmse,
                    )
                    for one in race.answers
                ),
            ]
        )

    def show_rows(self, rows: list[Row]) -> None:
        """The table of runs."""
        self.rows = rows[-_MOST_ROWS:]
        self._table.content = table(self.rows)
        self._clear_table.visible = bool(self.rows)

    def _clear(self) -> None:
        self.show_rows([])

    def _try_separating(self, client: viser.ClientHandle | None) -> None:
        run = self._separating
        if run is not None and self._page.checked(lambda: self._to_explore(run), self._try):
            self._page.notify("Explore has the command", "On Identify, press Identify again.", "green")
            self._page.workspaces.go("explore", client)

    def _show_search(self) -> None:
        """From the first race on, in place of what to do."""
        if self._empty.visible:
            self._empty.visible, self._convergence.handle.visible = False, True
            self._swarm.appear()

    def _draw(self, race: Race, soon: bool) -> None:
        begun = race is not self._begun
        if not (begun or soon or time.monotonic() - self._drawn_at > _LEAST_S):
            return
        self._drawn_at = time.monotonic()
        self._race = self._begun = race
        longest = max(track.iterations for track in race.tracks.values())
        with self._page.server.atomic():
            self._show_search()
            self._convergence.begin(tuple(race.tracks), longest)
            errors = {name: race.errors_of(track) for name, track in race.tracks.items()}
            self._convergence.show(errors, corrected=race.error is not None)
            self._swarm.show(race, begun)

    def _draw_answer(self) -> None:
        race = self._race
        if race is None:
            return
        chosen = next((name for name, title in ALGORITHMS.items() if title == self._whose.value), None)
        track = race.tracks.get(chosen or "") or race.best
        if track is None or track.k is None:
            return
        sure = track.answer.uncertainty if track.answer is not None else None
        bars: dict[str, Any] = {}
        if sure is not None:
            bars = {"interval90": sure.interval90, "alarms": sure.alarms}
            bars |= {"detectable": sure.detectable, "adequate": sure.adequate}
        fitted = {name: one.current_A for name, one in race.tracks.items() if one.current_A is not None}
        with self._page.server.atomic():
            self._bars.content = fault_bars(track.k, self._page.session.actuator, race.truth, **bars)
            self._sure.content = sure_words(track.answer)
            self._separating = sure.separated_by if sure is not None else None
            self._try.visible = self._separating is not None
            self._fit.show(race.time_s, race.measured_A, fitted)


def _seen(track: Track) -> np.ndarray:
    """k (8,) as the actuator shows it: of an answer the faults that are seen, and the direction of an eccentricity."""
    assert track.k is not None, "it has searched"
    if track.answer is None:
        return track.k
    alarms = track.answer.uncertainty.alarms
    seen = [name in alarms or (name == NAMES[6] and NAMES[5] in alarms) for name in NAMES]
    return np.where(seen, track.k, HEALTHY)
