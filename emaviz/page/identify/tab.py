"""The Identify tab: what is searched, how, and where one goes on."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import msgspec
import viser

from ema_model.errors import InputError, quoted
from ema_model.faults import vector
from ema_model.identification.run import ALGORITHMS, facts, in_one_line, verdict, why_best
from ema_model.recordings import write_measurement
from ema_model.simulation.plant import FITNESSES
from emaviz.figures.identification import Row, named
from emaviz.page.explore.tab import ExploreTab, take_separating
from emaviz.page.identify import WORKSPACE
from emaviz.page.identify.result import IdentifyResult
from emaviz.page.panel import RECORD, REPORT, JobLine, recording_link
from emaviz.page.runs import RunsTab
from emaviz.page.share import Place
from emaviz.page.style import IN_PAIRS
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.workspaces import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.compare import Comparing
from emaviz.session.discover.discovering import Discovering
from emaviz.session.identify import Race
from emaviz.session.inputs import ResultFiles
from emaviz.session.session_file import Part
from emaviz.session.settings import SLIDERS, Settings, limits, taken
from emaviz.text.html import Html, add_html, explained, html, joined

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
            self._population = gui.add_number("Population", settings.population, **of("population"), step=1)
            self._iterations = gui.add_number("Iterations", settings.iterations, **of("iterations"), step=1)
            self._fitness: Any = gui.add_dropdown(
                "Fitness",
                FITNESSES,
                initial_value=settings.fitness,
                hint="What a search makes small, the current's rms error: filtered compares means over 0.5 ms, without "
                "the inverter's ripple, which the model does not have; raw every sample, as the thesis does",
            )
            self._seed = gui.add_number("Seed", settings.seed, min=0, step=1)  # a maximum would be put in silently
        for entry, name in (
            (self._population, "population"),
            (self._iterations, "iterations"),
            (self._fitness, "fitness"),
            (self._seed, "seed"),
        ):
            self._listen(entry, partial(settings.set, name))
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
        self._source.on_update(lambda event: event.client and page.screen.post("identify source", self._take_source))
        for tick in self._ticks.values():
            tick.on_update(lambda event: event.client and page.screen.post("algorithms", self._take_algorithms))
        self._start.on_click(lambda _: self.begin())
        standing.connect(self._start, self._forget_errors)
        self._watch.on_click(lambda event: page.screen.post("watch", lambda: self._watch_growing(event.client)))
        self._missing.on_click(
            lambda event: page.screen.post("to discover", lambda: self._look_for_missing(event.client))
        )
        identifying, post = page.session.identifying, page.screen.post
        identifying.progressed.connect(self._progressed)
        identifying.identified.connect(lambda race: post("identification", lambda: self._draw_answer(race)))
        identifying.brought.connect(lambda race: post("identification", lambda: self._draw_answer(race, brought=True)))
        identifying.job.began.connect(lambda _: post("search began", self._began))
        identifying.job.rests.connect(lambda _: post("search rests", result.draw))
        identifying.job.ended.connect(lambda _: post("search ended", self._ended))
        comparing.events.opened.connect(lambda _: page.screen.post("sources", self.refresh_sources))
        self.refresh_sources()

    # --- what is asked ----------------------------------------------------------------------------------------------

    def refresh_sources(self) -> None:
        """Reads the data folder's list again; the chosen one stays as long as it exists."""
        names = (PLANT, *self._comparing.folder.measurements())
        if tuple(self._source.options) != names:
            self._source.options = names
        self._source.value = self._page.session.settings.source or PLANT

    def show_settings(self) -> None:
        """Sets the controls to what the session holds; on the screen's thread."""
        settings = self._page.session.settings
        self.refresh_sources()
        for name, tick in self._ticks.items():
            tick.value = name in settings.algorithms
        self._population.value, self._iterations.value = settings.population, settings.iterations
        self._fitness.value, self._seed.value = settings.fitness, settings.seed

    def _take_source(self) -> None:
        name = str(self._source.value)
        settings = self._page.session.settings
        if not self._page.checked(lambda: settings.set("source", SLIDERS if name == PLANT else name), self._source):
            self.refresh_sources()

    def _take_algorithms(self) -> None:
        settings = self._page.session.settings
        chosen, last = [name for name, tick in self._ticks.items() if tick.value], [*self._ticks.values()][-1]
        if not self._page.checked(lambda: settings.set("algorithms", chosen), last):
            for name, tick in self._ticks.items():
                tick.value = name in settings.algorithms

    def _listen(self, entry: Any, setter: Callable[[Any], None]) -> None:
        def changed(_: Any) -> None:
            self._page.checked(lambda: setter(entry.value), entry)

        entry.on_update(changed)

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

    def _progressed(self, race: Race) -> None:
        self._result.progressed(race)
        self._page.screen.post("identification", lambda: self._draw(race))

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

    def _draw_answer(self, race: Race, *, brought: bool = False) -> None:
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
        if brought:
            self._line.say(in_one_line(best.answer) if best is not None and best.answer is not None else "")
            self._result.brought(race)
        else:
            self._result.finished(race)
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
