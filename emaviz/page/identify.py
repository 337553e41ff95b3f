"""The Identify tab: what is searched, how, what was found (faults, the swarm, the landscape), and where one goes on."""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import msgspec
import numpy as np
import viser

from ema_model.errors import InputError, quoted
from ema_model.faults import FAULTS, HEALTHY, NAMES, vector
from ema_model.identification.run import (
    ALGORITHMS,
    CORRECTED,
    algorithm_title,
    facts,
    in_one_line,
    landscape_words,
    verdict,
    way_sentences,
    why_best,
)
from ema_model.identification.search import POINTS, Landscape, Way
from ema_model.identification.uncertainty import Suggestion
from ema_model.recordings import write_measurement
from ema_model.simulation.plant import FITNESSES
from emaviz.figures import identification
from emaviz.figures.identification import LiveConvergence, LiveFit, Row, colour, fault_bars, named, table
from emaviz.page.explore import ExploreTab, take_separating
from emaviz.page.panel import RECORD, REPORT, Example, JobLine, recording_link
from emaviz.page.playback import PlaybackStrip
from emaviz.page.runs import RunsTab
from emaviz.page.share import Place
from emaviz.page.style import IN_PAIRS
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS, NEXT_COLUMN
from emaviz.page.workspaces import Page, Workspace
from emaviz.recording.viewer import ViewerHost
from emaviz.scene.playback import PLAYED, motion
from emaviz.session.compare import Comparing
from emaviz.session.discover import Discovering
from emaviz.session.identify import Frame, Race, Track, ends
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part, ResultFiles
from emaviz.session.settings import SLIDERS, Settings, limits, taken
from emaviz.text.html import Html, add_html, begin, explained, html, joined, note, waiting
from emaviz.text.verdicts import sure_words

WORKSPACE = Workspace("identify", "Identify", viser.Icon.SEARCH, 2)

# --- how the swarm is looked at ---------------------------------------------------------------------------------------
# How the swarm is looked at: as points over two k or as lines across all eight, live or at an earlier iteration.

_PLANE, _LINES = "points over two k", "lines across all k"
_NAMES = tuple(fault.label for fault in FAULTS)


class SwarmView:
    """The picture and its controls, which `appear` with the first race."""

    def __init__(self, page: Page) -> None:
        self._page = page
        self._race: Race | None = None
        self._chosen = False  # by hand, which two k
        gui = page.server.gui
        self._folder = gui.add_folder("Population", visible=False)
        with self._folder:
            add_html(gui, NEXT_COLUMN)
            self._picture = add_html(gui, identification.plane([], 0, 5))
        self._kind = gui.add_dropdown("Population view", (_PLANE, _LINES), visible=False)
        self._x = gui.add_dropdown("Horizontal axis", _NAMES, initial_value=_NAMES[0], visible=False)
        self._y = gui.add_dropdown("Vertical axis", _NAMES, initial_value=_NAMES[5], visible=False)
        self._iteration = gui.add_slider(
            "Iteration", 0, 150, 1, 150, disabled=True, visible=False, hint="Looks back once it is over"
        )
        for entry in (self._kind, self._iteration):
            page.changed(entry, self._changed)
        for entry in (self._x, self._y):
            page.changed(entry, self._choose)

    def appear(self) -> None:
        """There is something to look at."""
        for one in (self._folder, self._kind, self._iteration):
            one.visible = True
        self._show_axes()

    def show(self, race: Race, begun: bool) -> None:
        """Draws a race as it stands; on the screen's thread."""
        self._race = race
        over = all(track.answer is not None for track in race.tracks.values())
        last = max((len(track.rmse) - 1 for track in race.tracks.values()), default=1)
        last = max(last, 1)
        if begun and race.truth is not None and not self._chosen:
            x, y = telling(race.truth)
            self._x.value, self._y.value = _NAMES[x], _NAMES[y]
        reach = last if over else max(track.iterations for track in race.tracks.values())
        if self._iteration.max != reach:
            self._iteration.value = min(self._iteration.value, reach)
            self._iteration.max = reach
        if over:
            self._iteration.value = last
        self._iteration.disabled = not over
        self._draw(last)

    def _choose(self) -> None:
        self._chosen = True
        self._changed()

    def _changed(self) -> None:
        self._show_axes()
        self._draw(int(self._iteration.value) if not self._iteration.disabled else 10**9)

    def _show_axes(self) -> None:
        self._x.visible = self._y.visible = self._kind.value != _LINES

    def _draw(self, iteration: int) -> None:
        race = self._race
        if race is None:
            self._picture.content = (
                identification.lines([]) if self._kind.value == _LINES else identification.plane([], *self._axes())
            )
            return
        swarms, trails = [], []
        for track in list(race.tracks.values()):
            frame = at_iteration(track, iteration)
            if frame is None:
                continue
            swarms.append(identification.Swarm(track.algorithm, colour(track.algorithm), frame.population, frame.k))
            trails.append(np.array([one.k for one in list(track.frames) if one.iteration <= frame.iteration]))
        if self._kind.value == _LINES:
            self._picture.content = identification.lines(swarms, race.truth)
        else:
            self._picture.content = identification.plane(swarms, *self._axes(), race.truth, trails)

    def _axes(self) -> tuple[int, int]:
        return _place(self._x.value, 0), _place(self._y.value, 5)


def at_iteration(track: Track, iteration: int) -> Frame | None:
    """The swarm then, or the last one that is kept from before; the newest while the race runs."""
    frames = [frame for frame in list(track.frames) if frame.iteration <= iteration]
    if track.last is not None and track.last.iteration <= iteration:
        last = track.last
        return Frame(last.iteration, last.population.astype(np.float32), last.k, last.rmse)
    return frames[-1] if frames else None


def telling(truth: np.ndarray) -> tuple[int, int]:
    """The two k that are farthest from healthy: there one sees most."""
    away = np.abs(truth - HEALTHY)
    away[6] *= truth[5]  # a phase of no eccentricity means nothing
    first, second = np.argsort(-away, kind="stable")[:2]
    return (int(first), int(second)) if away[second] > 0.0 else (int(first), 5 if first != 5 else 0)


def _place(name: str, default: int) -> int:
    return _NAMES.index(name) if name in _NAMES else default


# --- identify's Landscape tab: the cost over two chosen k around an answer, simulated on demand -----------------------

_LANDSCAPE_BEST = "the answer"
_WHOLE, _CLOSE = "all of 0 … 1", "close to it"
_LANDSCAPE_STEPS = (
    Html("Press <b>Identify</b> on the left, and wait for the answer."),
    Html("Choose two of k1 … k8 here, and press <b>Draw the landscape</b>: the search's cost is simulated over both."),
    "You see whether the answer lies in a narrow valley, in a long one, or beside another that fits as well.",
)
_CONFIG = {"displayModeBar": False, "responsive": False}


class LandscapeView:
    """Its controls, the map and what it says.  Figures are drawn on the slow screen's thread."""

    def __init__(self, page: Page, slow: Worker) -> None:
        self._page, self._slow, self._landscapes = page, slow, page.session.identifying.landscapes
        self._race: Race | None = None
        self._by_hand = False  # which two k
        self._plot: Any = None
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._x: Any = gui.add_dropdown("Horizontal k", _NAMES, initial_value=_NAMES[0])
        self._y: Any = gui.add_dropdown("Vertical k", _NAMES, initial_value=_NAMES[5])
        self._through: Any = gui.add_dropdown(
            "Through", (_LANDSCAPE_BEST,), hint="The other six k are held at this place's"
        )
        self._extent: Any = gui.add_dropdown("Shown", (_WHOLE, _CLOSE))
        self._draw = gui.add_button("Draw the landscape", icon=viser.Icon.MAP_2, disabled=True)
        self._line = JobLine(page, self._landscapes.job, WORKSPACE, stop="Stop drawing")
        self._first = add_html(gui, begin("No landscape yet", _LANDSCAPE_STEPS))
        self._show_controls(False)
        self._place = gui.add_folder("Map", visible=False)
        with self._place:
            add_html(gui, NEXT_COLUMN)
        self._words = add_html(gui)
        for entry in (self._x, self._y):
            page.changed(entry, self._chosen, at_once=True)
        page.pressed(self._draw, self._begin)
        page.screen.follow(self._landscapes.job, self._busy)
        slow.hear(self._landscapes.grown, self._draw_map, kind="landscape")
        page.screen.hear(self._landscapes.drawn, self._say_ways)

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
        self._through.options = (_LANDSCAPE_BEST, *(f"where {title} ended" for title in others))
        self._through.value = _LANDSCAPE_BEST
        if not self._by_hand:
            x, y = telling(best.k if race.truth is None else race.truth)
            self._x.value, self._y.value = _NAMES[x], _NAMES[y]
        self._line.say(f"{POINTS} × {POINTS} simulations, the other six k held.")
        if (drawn := race.landscape) is not None:
            self._x.value, self._y.value = _NAMES[drawn.x], _NAMES[drawn.y]
            self._line.say(landscape_words(drawn))
            self._slow.post("landscape", lambda: self._draw_map(race, drawn))
            self._say_ways(race, race.ways)

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
        figure = identification.landscape_figure(found, identification.Marks(best.k, sure, race.truth, ends(race)))
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


# --- identify's panel on the right: convergence and swarm, the answer, and the table of all runs ----------------------

_BEST = "the best"
_STEPS = (
    "Set faults on Explore, or choose a measurement of the data folder on the left.",
    Html("Press <b>Identify</b>: the search runs the model for a population of faults until its current fits."),
    "You get k1 … k8 in physical units, each with its 90 % interval, and which of them are faults.",
)
_SEARCH, _ANSWER = "Search", "Answer"  # tabs: the second comes forward once it is there
_LEAST_S = 0.1  # between two pictures of a swarm, which browsers in software draw slowly
_MOST_ROWS = 200


_EXAMPLE = "Run an example", "Friction, backlash and eccentricity are set on Explore's sliders, and found again."


_WAITING = "The model is run for a population of faults until its current is the measured one."


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
        example: Callable[[], object],
    ) -> None:
        """to_explore(run): sets a run there; example(): identifies faults of the sliders' plant."""
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
            shipped = Example(page, *_EXAMPLE, example)
            self._nothing = begin("Nothing is identified yet", _STEPS, shipped.html)
            self._empty: Any = add_html(gui, self._nothing)
            self._convergence = LiveConvergence(gui)
            self._convergence.handle.visible = False
            page.workspaces.heights.add([self._convergence.handle], spare_px=160, beside_px=332)
            self._swarm = SwarmView(page)
        with panel.add_tab(_ANSWER, viser.Icon.TARGET_ARROW):
            standing.add(gui)
            self._sure = add_html(gui)  # the sentence first
            self._whose = gui.add_dropdown("Algorithm shown", (_BEST, *ALGORITHMS.values()))
            self._bars = add_html(gui, fault_bars(HEALTHY, page.session.actuator))
            self._try = gui.add_button(
                "Set that command in Explore",
                icon=viser.Icon.ADJUSTMENTS,
                color="gray",
                visible=False,
                hint="The run that would tell them apart; then identify again",
            )
            self._fit = LiveFit(gui)
            page.measuring.add(self._fit.handles, self._fit.lines, self._fit.zoom)
            page.workspaces.heights.add(self._fit.handles, spare_px=30)
        with panel.add_tab("Landscape", viser.Icon.MAP_2):
            standing.add(gui)
            self._landscape = LandscapeView(page, slow)
        with panel.add_tab("History", viser.Icon.TABLE):
            self._table = add_html(gui, table([]))
            self._clear_table: Any = gui.add_button(
                "Clear the table", icon=viser.Icon.ERASER, color="gray", visible=False
            )
        page.pressed_by(self._try, self._try_separating)
        page.changed(self._whose, self._draw_answer, on=slow)
        page.pressed(self._clear_table, lambda: self.show_rows([]))
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

    def brought(self, race: Race) -> None:
        """One of a session, as it was: its last picture, its answer, and its landscape."""
        self._draw(race, soon=True)
        self._slow.post("answer", self._draw_answer)
        self._landscape.answered(race)
        best = race.best
        if best is not None and best.k is not None and all(name in race.measurement for name in PLAYED):
            self._strip.put(motion(race.measurement, _seen(best), self._page.session.actuator), WORKSPACE.name)

    def finished(self, race: Race) -> None:
        """The race is over: the same, and its rows in the table."""
        self.brought(race)
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

    def _try_separating(self, client: viser.ClientHandle | None) -> None:
        run = self._separating
        if run is not None:
            self._to_explore(run)
            self._page.notify("Explore has the command", "On Identify, press Identify again.", "green")
            self._page.workspaces.go("explore", client)

    def _show_search(self) -> None:
        """From the first race on, in place of what to do."""
        if self._empty.visible:
            self._empty.visible, self._convergence.handle.visible = False, True
            self._swarm.appear()

    def busy(self, busy: bool) -> None:
        """Whether a search goes on: until it has told something, it is said that it does."""
        if self._empty.visible:
            self._empty.content = waiting("Searching for the faults", _WAITING) if busy else self._nothing

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


# --- the Identify tab: what is identified, by which algorithms, and the race that one watches -------------------------

PLANT = "The plant of Explore's sliders"
_WHY = '<details style="opacity:.75"><summary style="cursor:pointer">★ why it is the best</summary>{}</details>'


class IdentifyPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(
        self,
        page: Page,
        comparing: Comparing,
        viewer: ViewerHost | None,
        result: IdentifyResult,
        standing: Standing,
        *,
        open_viewer: Callable[[str, str], None],
        to_discover: Callable[[Race], None],
    ) -> None:
        """open_viewer(url, name): on the right of Recordings; to_discover(race): takes its recording there."""
        self._page, self._comparing, self._viewer, self._result = page, comparing, viewer, result
        self._race: Race | None = None
        self._open_viewer, self._to_discover = open_viewer, to_discover
        gui, settings, of = page.server.gui, page.session.settings, partial(limits, Settings)
        self._source: Any = gui.add_dropdown(
            "Identify", (PLANT,), hint="The sliders' plant, whose faults are known, or a measurement of the data folder"
        )
        with gui.add_folder("Algorithms, one or several at once"):
            add_html(gui, IN_PAIRS)
            self._ticks = {
                name: gui.add_checkbox(title, name in settings.algorithms) for name, title in ALGORITHMS.items()
            }
            population = gui.add_number("Population", settings.population, **of("population"), step=1)
            iterations = gui.add_number("Iterations", settings.iterations, **of("iterations"), step=1)
            fitness: Any = gui.add_dropdown(
                "Fitness",
                FITNESSES,
                initial_value=settings.fitness,
                hint="What a search makes small, the current's rms error: filtered compares means over 0.5 ms, without "
                "the inverter's ripple, which the model does not have; raw every sample, as the thesis does",
            )
            seed = gui.add_number("Seed", settings.seed, min=0, step=1)  # a maximum would be put in silently
        self._bound = [
            page.bind(control, partial(getattr, settings, name), partial(settings.set, name), at_once=True)
            for control, name in (
                (population, "population"),
                (iterations, "iterations"),
                (fitness, "fitness"),
                (seed, "seed"),
            )
        ]
        self._start = gui.add_button("Identify", icon=viser.Icon.SEARCH)
        self._line = JobLine(page, page.session.identifying.job, WORKSPACE, pauses="the search")
        self._line.say("Finds the faults from the current alone.")
        self._text = add_html(gui)
        self._link = add_html(gui)
        self._watch = gui.add_button(
            "Watch it in Rerun, here",
            icon=viser.Icon.EYE,
            color="gray",
            visible=False,
            hint="The run while it is written, on the right",
        )
        self._missing = gui.add_button(
            "Look for the missing physics",
            icon=viser.Icon.BULB,
            color="orange",
            visible=False,
            hint="The model does not fit: takes the same measurement to Discover",
        )
        self._chosen = page.bind(self._source, lambda: settings.source or PLANT, self._take_source)
        for tick in self._ticks.values():
            page.changed(tick, self._take_algorithms)
        page.pressed(self._start, self.begin)
        standing.connect(self._start, self._forget_errors)
        page.pressed_by(self._watch, self._watch_growing)
        page.pressed_by(self._missing, self._look_for_missing)
        identifying, hear = page.session.identifying, page.screen.hear
        identifying.progressed.connect(result.progressed)
        hear(identifying.progressed, self._draw, kind=self)
        hear(identifying.identified, self._draw_answer, kind=self)
        hear(identifying.brought, self._bring_answer, kind=self)
        hear(identifying.job.began, lambda _: self._began())
        hear(identifying.job.rests, lambda _: result.draw())
        hear(identifying.job.ended, lambda _: self._ended())
        page.screen.hear_any([comparing.events.opened], self.refresh_sources)
        self.refresh_sources()

    # --- what is asked ----------------------------------------------------------------------------------------------

    def refresh_sources(self) -> None:
        """Reads the data folder's list again; the chosen one stays as long as it exists."""
        names = (PLANT, *self._comparing.folder.measurements())
        if tuple(self._source.options) != names:
            self._source.options = names
        self._chosen.show()

    def show_settings(self) -> None:
        """Sets the controls to what the session holds; on the screen's thread."""
        settings = self._page.session.settings
        self.refresh_sources()
        for name, tick in self._ticks.items():
            tick.value = name in settings.algorithms
        for one in self._bound:
            one.show()

    def _take_source(self, name: str) -> None:
        self._page.session.settings.set("source", SLIDERS if name == PLANT else name)

    def _take_algorithms(self) -> None:
        settings = self._page.session.settings
        chosen, last = [name for name, tick in self._ticks.items() if tick.value], [*self._ticks.values()][-1]
        if not self._page.checked(lambda: settings.set("algorithms", chosen), last):
            for name, tick in self._ticks.items():
                tick.value = name in settings.algorithms

    # --- the race ---------------------------------------------------------------------------------------------------

    def begin(self) -> None:
        """The search, as the controls say."""
        if not self._page.begins(self._page.session.identify, self._start):
            self._page.session.identifying.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of what is not identified any more."""
        self._page.say_beside(self._start, "")
        if not self._page.session.identifying.job.running:
            self._line.say("")

    def _began(self) -> None:
        self._start.disabled = True
        self._text.content = self._link.content = ""
        self._missing.visible = False
        self._result.busy(True)

    def _ended(self) -> None:
        self._result.busy(False)
        self._start.disabled = self._watch.visible = False

    def _watch_growing(self, client: viser.ClientHandle | None) -> None:
        race = self._race
        if self._viewer is not None and race is not None and race.growing is not None:
            self._open_viewer(self._viewer.url_of(race.growing.name), race.growing.name)
            self._page.workspaces.go("runs", client)

    def _look_for_missing(self, client: viser.ClientHandle | None) -> None:
        race = self._race
        if race is not None and self._page.checked(lambda: self._to_discover(race)):
            self._page.workspaces.go("discover", client)

    def _draw(self, race: Race) -> None:
        lines = []
        for name, track in race.tracks.items():
            if not track.rmse or len(race.tracks) == 1:  # of one alone the job's own line tells as much
                continue
            at = f"iteration {len(track.rmse) - 1} of {track.iterations}"
            if track.answer is not None:
                at = "done"
            elif track.fitting is not None:
                at = f"searched; {track.fitting[0]}"
            lines.append(_line(html("{} · {} · uncorrected error {:.4f} A", named(name), at, track.rmse[-1])))
        if race.growing is not None and race is not self._race:
            self._link.content = recording_link(self._viewer, race.growing, "Watch it live ↗")
            self._watch.visible = self._viewer is not None
        self._race = race
        self._text.content = explained(joined(lines))

    def _draw_answer(self, race: Race) -> None:
        self._say_answer(race)
        self._result.finished(race)

    def _bring_answer(self, race: Race) -> None:
        """One of a session."""
        self._say_answer(race)
        best = race.best
        self._line.say(in_one_line(best.answer) if best is not None and best.answer is not None else "")
        self._result.brought(race)

    def _say_answer(self, race: Race) -> None:
        best = race.best
        lines = []
        for answer in race.answers:
            star = "★ " if best is not None and len(race.tracks) > 1 and answer is best.answer else ""
            told = [*facts(answer), *([verdict(answer)] if len(race.tracks) > 1 else [])]
            lines.append(_line(html("{}{} · {}", star, named(answer.algorithm), " · ".join(told))))
        if best is not None and best.answer is not None and len(race.answers) > 1:
            others = [answer for answer in race.answers if answer is not best.answer]
            lines.append(_line(html(_WHY, why_best(best.answer, others))))
        self._text.content = explained(joined(lines))
        self._race = race
        self._missing.visible = best is not None and best.answer is not None and not best.answer.uncertainty.adequate
        if race.path is not None:
            self._link.content = recording_link(self._viewer, race.path, "Open this run in Rerun ↗")


def _line(inner: str) -> Html:
    return html('<div style="padding:1px 10px;font-size:13px;line-height:1.4">{}</div>', inner)


# --- from an identification that does not fit to Discover: the same recording, opened there ---------------------------

_NAME = "identified plant.csv"  # of the sliders' plant, which has no file yet


def take_to_discover(page: Page, discovering: Discovering, race: Race) -> None:
    """Opens the race's recording on Compare, alone, and chooses Compare's recordings on Discover.

    The sliders' plant is written into the data folder first.
    Raises InputError if that cannot be done; on the screen's thread.
    """
    comparing = discovering.comparing
    if discovering.running:
        raise InputError("Discover is busy with a step; stop it there first")
    name = race.settings.source
    if not name:
        path = comparing.folder.place(_NAME)
        try:
            write_measurement(race.measurement, path)
        except OSError as error:
            raise InputError(f"{path.name}: cannot be written ({error.strerror}); check the disk") from None
        name = comparing.folder.name_of(path)
    actuator = comparing.session.actuator.name
    if comparing.actuator_name != actuator:
        comparing.choose_actuator(actuator)
    for other in [other for other in comparing.opened if other != name]:
        comparing.remove(other)
    comparing.add(name)
    discovering.choose("")
    page.notify("Discover has the measurement", f"{name}: press Start.", "green")


# --- the Identify tab: the search for the faults, watched, and its answer ---------------------------------------------


_FAULTS = {"k1": 0.25, "k2": 0.7, "k6": 0.5}  # of the example


class IdentifyTab(Tab):
    """Leads to Explore for the next run, to Recordings for the viewer, to Discover where the model does not fit."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        identifying, worker = self.page.session.identifying, self.page.session.worker
        provenance = identifying.provenance
        self._standing = self.standing(provenance)

        def write(suffix: str) -> None:
            def keep() -> None:
                files.came(identifying.keep(suffix))

            worker.post(f"identify {suffix}", keep)

        files = provenance.files = ResultFiles((REPORT.suffix, RECORD.suffix), lambda: provenance.of, write)
        self.result = IdentifyResult(
            self.page,
            shared.slow_screen,
            right,
            shared.strip,
            self._standing,
            lambda run: take_separating(shared.tab(ExploreTab).panel, run),
            self._run_example,
        )

    def build(self) -> None:
        """What is identified, and how."""
        shared = self.shared
        self.panel = IdentifyPanel(
            self.page,
            shared.comparing,
            shared.viewer,
            self.result,
            self._standing,
            open_viewer=lambda url, name: shared.tab(RunsTab).follow(url, name),
            to_discover=partial(take_to_discover, self.page, shared.discovering),
        )
        shared.tab(RunsTab).result.run_example = self._run_example

    def _run_example(self) -> None:
        """Faults that the sliders' plant then has, and their search."""
        settings = self.page.session.settings
        settings.set("k", list(vector(_FAULTS)))
        settings.set("source", SLIDERS)
        for tab in self.shared.tabs.values():
            tab.show_settings()
        self.page.session.refresh()
        self.panel.begin()

    def place(self) -> Place:
        """The recording of the answer."""
        race = self.page.session.identifying.race
        return {} if race is None or race.path is None else {"run": [race.path.name]}

    def go_to(self, place: Place) -> None:
        """The answer, while it is here."""
        for run in place.get("run", ())[:1]:
            if [run] != self.place().get("run"):
                raise InputError(f"this answer is not shown any more; its recording is on Runs: {quoted(run, 100)}")

    def show_settings(self) -> None:
        """Of the search."""
        self.panel.show_settings()

    def refresh_files(self) -> None:
        """What may be identified."""
        self.panel.refresh_sources()

    def kept(self) -> dict[str, Part]:
        """The table of runs."""
        return {"runs": Part(lambda: msgspec.to_builtins(self.result.rows), self._restore)}

    def _restore(self, saved: Any, _: Mapping[str, str]) -> None:
        self.result.show_rows(taken(list[Row], saved, "table of runs"))
