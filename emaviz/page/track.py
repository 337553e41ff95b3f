"""The Track tab."""

from __future__ import annotations

import json
from collections.abc import Callable, Mapping, Sequence
from functools import partial
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.errors import InputError
from ema_model.faults import BY_NAME
from ema_model.quantities import in_sentence
from ema_model.text import COLOURS
from ema_model.tracking.flights import Flight
from ema_model.tracking.track import TRACKED, History, Tracked, headline, hindsight
from ema_model.tracking.trends import LEAST_FLIGHTS
from emaviz.page.compare import WORKSPACE as COMPARE
from emaviz.page.panel import (
    RECORD,
    REPORT,
    Cleared,
    Example,
    FolderChoice,
    JobLine,
    KeepButtons,
    Lead,
    Leads,
    PracticeButtons,
    Seal,
)
from emaviz.page.share import Place
from emaviz.page.style import LONG_LABELS, unseen_field
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS, NEXT_COLUMN
from emaviz.page.workspaces import Page, Workspace
from emaviz.server.viser_private import Inside, id_of
from emaviz.session.compare import Comparing
from emaviz.session.jobs import Worker
from emaviz.session.session_file import Part
from emaviz.session.track import Following
from emaviz.text.html import BOX, DIM, Html, add_html, begin, boxed, html, joined, note, waiting
from emaviz.text.verdicts import warned, whole
from emaviz.views import tracking
from emaviz.views.tracking import CLICKED

# --- a click on a flight in its chart ---------------------------------------------------------------------------------
# A click on a flight in its chart: the page knows which point is hovered, and tells it through an unseen field.

WORKSPACE = Workspace("track", "Track", viser.Icon.TIMELINE, 6, share=0.66, lower=True)

_BETWEEN = "|"  # after it stands the time, so that a second click on a flight is another text
_SCRIPT = """
(() => {
  const field = FIELD, chart = CHART;
  if (window.__emavizFlights) document.removeEventListener('click', window.__emavizFlights, true);
  window.__emavizFlights = (event) => {
    const plot = event.target.closest?.('.js-plotly-plot');
    if (plot?.layout?.meta !== chart) return;
    const name = plot._hoverdata?.[0]?.text;
    const row = document.querySelector(`label[for="${field}"]`)?.closest('.mantine-Flex-root');
    const input = row?.querySelector('input');
    if (!name || !input) return;
    Object.getOwnPropertyDescriptor(HTMLInputElement.prototype, 'value').set.call(input, name + 'BETWEEN' + Date.now());
    input.dispatchEvent(new Event('input', { bubbles: true }));
  };
  document.addEventListener('click', window.__emavizFlights, true);
})();
"""


class FlightClicks:
    """clicked(name, window): called with a flight's name and the window in which it was clicked, on the screen."""

    def __init__(self, page: Page, clicked: Callable[[str, viser.ClientHandle | None], None]) -> None:
        gui = page.server.gui
        field: Any = gui.add_text("Flight clicked", "")
        add_html(gui, unseen_field(id_of(field)))

        def told(event: viser.GuiEvent[Any]) -> None:
            name = str(field.value).partition(_BETWEEN)[0]
            if event.client is not None and name:
                page.screen.post("flight clicked", lambda: clicked(name, event.client))

        field.on_update(told)
        script = _SCRIPT.replace("FIELD", json.dumps(id_of(field))).replace("CHART", json.dumps(CLICKED))
        Inside(page.server).run(script.replace("BETWEEN", _BETWEEN))


# --- from a flight to its comparison: the same recording, alone, on Compare -------------------------------------------

_TO = COMPARE.name


class FlightLead:
    """A button for the flight that is chosen, and the way for one that is clicked."""

    def __init__(
        self, page: Page, comparing: Comparing, following: Following, chosen: Callable[[], Flight | None]
    ) -> None:
        self._page, self._comparing, self._following, self._chosen = page, comparing, following, chosen
        hint = "Opens its recording on Compare; so does a click on a point above"
        Leads(page, [Lead("Compare this flight", viser.Icon.ARROWS_DIFF, hint, _TO, self._take)])

    def follow(self, client: viser.ClientHandle | None) -> None:
        """As the button does, with the window that asked; on the screen's thread."""
        if self._page.checked(self._take):
            self._page.workspaces.go(_TO, client)

    def _take(self) -> None:
        flight, comparing = self._chosen(), self._comparing
        if flight is None:
            raise InputError("no flight is chosen")
        if self._following.job.running:
            raise InputError("flights are being identified; stop that first")
        name, actuator = self._following.file_of(flight), comparing.session.actuator.name
        if comparing.actuator_name != actuator:
            comparing.choose_actuator(actuator)
        for other in [other for other in comparing.opened if other != name]:
            comparing.remove(other)
        comparing.add(name)


# --- track's panel on the right ---------------------------------------------------------------------------------------
# Track's panel on the right: one sentence, k over the flights, the life that remains, and what was said when.

_CONFIG = {"displayModeBar": False}
_NONE = "–"
_STEPS = (
    "Choose a folder of flights on the left, or a challenge to practise on; set the threshold that ends the life.",
    Html("Press <b>Track</b>: the faults of each flight are identified."),
    "You see which fault drifts and how many flights remain, as a distribution, today and at any earlier flight.",
)
_ASPECTS = (0.66, 0.42, 0.48)  # of the figures, height over width: the first stands beside the others
_SO_FAR_ASPECT = 0.45  # of the figure of flights that are too few to follow


_EXAMPLE = "Run an example", "A life of sixty flights: made in the data folder, then tracked, which takes some minutes."


_TITLE, _WAITING = "Identifying the flights", "The first are drawn as soon as they are identified."


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
        self._by_hand = False  # whether somebody has chosen the k that is shown
        self.run_example: Callable[[], object] = lambda: None
        self._empty = begin(
            "No flights are tracked yet", _STEPS, Example(page, *_EXAMPLE, lambda: self.run_example()).html
        )
        self._told = add_html(gui, self._empty)
        self._so_far = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=_SO_FAR_ASPECT, visible=False)
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
        page.changed(self._today, self._draw, on=slow)
        page.changed(self._fault, self._choose, at_once=True)

    def busy(self, busy: bool) -> None:
        """Whether a run goes on: where no flight is shown yet, it is said that it does."""
        if self._told.content in (self._empty, waiting(_TITLE, _WAITING)):
            self._told.content = waiting(_TITLE, _WAITING) if busy else self._empty

    def show_first(self, flights: Sequence[Flight], count: int) -> None:
        """The first flights, before there are enough to follow; count: in all."""
        self.show(None)
        if not flights:  # an empty chart tells nothing
            self._told.content = waiting(_TITLE, _WAITING)
            return
        left_out = sum(bool(one.excluded) for one in flights)
        more = f", {left_out} of them not usable" if left_out else ""
        told = f"{len(flights)} of {count} flights are identified{more}. A trend is looked for from {LEAST_FLIGHTS} on."
        self._told.content = html('<div {}><div style="font-size:16px;padding:4px 0">{}</div></div>', BOX, told)
        self._so_far.figure, self._so_far.visible = tracking.k_so_far(flights, count), True

    def show(self, history: History | None) -> None:
        """Followed flights, as they are known at their end; None for none."""
        before, self._history = self._history, history
        self._so_far.visible = False
        begun = before is None or history is None or before.flights[:1] != history.flights[:1]
        asked = before is None or history is None or begun or before.thresholds != history.thresholds
        last = history.last if history is not None else None
        for folder in (self._life, self._words, self._save):
            folder.visible = last is not None
        if begun:
            self._seal.show()
        if history is None or last is None:
            self._told.content = self._empty
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
            self._by_hand = self._by_hand and not asked
            if not self._by_hand:
                self._fault.value = BY_NAME[_first(last)].label
            if asked:
                self._kept.clear()
        self._draw()

    def place(self) -> Place:
        """What is shown, for an address."""
        if self._history is None or self._history.last is None:
            return {}
        then = [] if self._today.value >= self._today.max else [str(int(self._today.value))]
        return {"k": [self._faults[str(self._fault.value)]], "today": then}

    def go_to(self, place: Place) -> None:
        """As `place` gave it; nothing before flights are followed."""
        if self._history is None or self._history.last is None:
            return
        for name in place.get("k", ()):
            if name in self._faults.values():
                self._fault.value, self._by_hand = BY_NAME[name].label, True
        days = [int(one) for one in place.get("today", ()) if one.isdecimal()]
        first, last = min(self._history.looks), max(self._history.looks)
        self._today.value = int(min(max(first, *days), last) if days else last)
        self._draw()

    def _choose(self) -> None:
        self._by_hand = True
        self._slow.post("today", self._draw)

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
            tracking.k_over_flights(then, name, last=last, levels=levels(history, name, number)),
            tracking.remaining_life(one.remaining_flights, came=history.came(number, name).crossed)
            if one.remaining_flights is not None
            else tracking.none(one.reason or ""),
            tracking.predicted_life(history, name, number),
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
    return {n: (one.level, *one.level_interval90) for n, one in shown.items()}


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
    return max(every, key=lambda one: (one.remaining_flights is not None, one.trend, one.threshold is not None)).name


# --- the Track tab: a folder of flights, thresholds, and the run ------------------------------------------------------

_HALFWAY = 0.5  # from healthy to the end of a k's range, where a threshold begins
_ABOUT = (
    "A folder of recordings of one unit, one for each flight, named in their order (flight_0001, 2026-05-03 …), "
    "inside the data folder."
)


class TrackPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(self, page: Page, following: Following, result: TrackResult, standing: Standing) -> None:
        self._page, self._following, self._result = page, following, result
        self._example_asked = False
        result.run_example = self._run_example
        gui, screen, job, events = page.server.gui, page.screen, following.job, following.events
        add_html(gui, note(_ABOUT))
        hint = "Folders of the data folder that hold recordings"
        self._folder = FolderChoice(page, "Flights", hint, self._listed, lambda: following.chosen, self._take_folder)
        self._practice = PracticeButtons(page, following.practice, self.choose)
        with gui.add_folder("End of life"):
            add_html(gui, LONG_LABELS)
            self._faults = {BY_NAME[name].label: name for name in TRACKED}
            self._fault: Any = gui.add_dropdown("Fault", tuple(self._faults))
            self._ends = gui.add_checkbox("With a threshold", False)
            self._threshold = gui.add_number("Threshold", 0.5, min=0.0, max=1.0, step=0.001, disabled=True)
            self._all = add_html(gui)
        self._start = gui.add_button("Track", icon=viser.Icon.TIMELINE, disabled=True)
        self._line = JobLine(page, job, WORKSPACE, pauses="it")
        watch = gui.add_checkbox(
            "Add new flights", following.watching, hint="Files that arrive in the folder add a point each"
        )
        self._left_out = add_html(gui)
        page.changed(self._fault, self._show_fault)
        for control in (self._ends, self._threshold):
            page.changed(control, self._ask_threshold, at_once=True)
        page.bind(watch, lambda: following.watching, partial(setattr, following, "watching"))
        page.pressed(self._start, self._begin)
        page.disable_while(job, self._folder.control, self._fault, self._ends)
        standing.connect(self._start, self._forget_errors)
        screen.hear(job.began, lambda _: self._practice.fold())
        screen.follow(job, self._busy)
        screen.hear(events.followed, result.show, kind=self)
        screen.hear(events.began, result.show_first, kind=self)
        screen.hear(events.left_out, self._show_left_out)
        self.refresh()

    def refresh(self) -> None:
        """Reads the data folder's list again; the chosen one stays as long as it exists."""
        self._folder.refresh()
        self._start.disabled = self._following.job.running or self._folder.empty

    # --- what is asked ----------------------------------------------------------------------------------------------

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self._folder.choose(name)
        if self._example_asked:
            self._example_asked = False
            self._begin()

    def _run_example(self) -> None:
        """The first challenge: its recordings are made, then tracked."""
        practice = self._following.practice
        self._example_asked = self._page.begins(lambda: practice.open(practice.shipped[0]), self._start)

    def show(self) -> None:
        """What is chosen, as a session's file says; its flights are shown once they are followed."""
        following = self._following
        self._result.show(None)
        self.refresh()
        self._practice.show(following.chosen)
        self._show_thresholds()
        self._show_left_out()

    def _listed(self) -> dict[str, str]:
        following = self._following
        found = following.folder.folders().items()
        listed = {f"{name} ({count})" if name != "." else f"the data folder ({count})": name for name, count in found}
        if following.is_elsewhere and following.chosen not in listed.values():
            listed[f"{following.chosen} (not in the data folder)"] = following.chosen  # of a session
        return listed

    def _take_folder(self, name: str) -> None:
        if self._page.checked(lambda: self._following.choose(name), self._folder.control):
            self._result.show(None)
            self._practice.show(name)
            self._show_thresholds()
            self._line.say("")
            self._show_left_out()
        else:
            self.refresh()

    def _show_fault(self) -> None:
        name = self._faults[str(self._fault.value)]
        known = self._following.thresholds.get(name)
        self._ends.value = known is not None
        self._threshold.disabled = known is None
        healthy = BY_NAME[name].healthy
        self._threshold.value = healthy + _HALFWAY * (1.0 - healthy) if known is None else known

    def _ask_threshold(self) -> None:
        """As the controls are now: a fault that was chosen just before has yet to be shown."""
        value = self._threshold.value if self._ends.value else None
        self._page.screen.post("threshold", lambda: self._take_threshold(value))

    def _take_threshold(self, value: Any) -> None:
        name, following = self._faults[str(self._fault.value)], self._following
        taken = self._page.checked(lambda: following.set_threshold(name, value), self._threshold)
        self._show_fault()
        if not taken:
            return
        self._tell_thresholds()
        if following.history is not None and not following.job.running:
            self._begin()  # what is identified stays, so that this takes a moment

    def _show_thresholds(self) -> None:
        """Of the chosen flights, which a challenge may bring."""
        known = self._following.thresholds
        if known and self._faults[str(self._fault.value)] not in known:
            self._fault.value = BY_NAME[next(iter(known))].label
        self._show_fault()
        self._tell_thresholds()

    def _tell_thresholds(self) -> None:
        told = [
            html("<b>{}</b> {} at {:g}", one, in_sentence(BY_NAME[one].title), at)
            for one, at in sorted(self._following.thresholds.items())
        ]
        self._all.content = boxed(joined(told, "<br>")) if told else ""

    # --- the run ----------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        if not self._page.begins(self._following.begin, self._start):
            self._following.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of flights that are not there any more."""
        self._page.say_beside(self._start, "")
        self._show_left_out()
        self._line.forget_refusal()

    def _busy(self, busy: bool) -> None:
        self._result.busy(busy)
        self._threshold.disabled = busy or not self._ends.value
        self._show_left_out()
        self.refresh()

    def _show_left_out(self) -> None:
        lines = self._following.complaints
        if lines:
            self._following.provenance.refused()
        self._left_out.content = boxed(warned(lines)) if lines else ""


# --- the Track tab: k over the flights of a unit, what drifts, and what life remains ----------------------------------


class TrackTab(Tab):
    """Leads to Compare, with a flight."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        following = self.following = Following(self.page.session, shared.comparing.folder, shared.files)
        self._standing = self.standing(self.following.provenance)
        with right.add_tab("Flights", viser.Icon.TIMELINE):
            self._standing.add(self.page.server.gui)
            self.result = TrackResult(
                self.page,
                shared.slow_screen,
                lambda chosen: FlightLead(self.page, shared.comparing, self.following, chosen),
                lambda: Seal(self.page, following.practice, lambda: following.chosen, lambda: following.last),
                lambda: KeepButtons(
                    self.page,
                    following.folder,
                    shared.viewer,
                    following.events.kept,
                    lambda suffix, _: following.save(suffix),
                    following.provenance,
                    REPORT,
                    RECORD,
                ),
            )

    def build(self) -> None:
        """Which flights, and where the life ends."""
        self.panel = TrackPanel(self.page, self.following, self.result, self._standing)

    def refresh_files(self) -> None:
        """What may be followed."""
        self.panel.refresh()

    def place(self) -> Place:
        """The folder of flights, the k that is shown, and today."""
        return {"flights": [self.following.chosen], **self.result.place()}

    def go_to(self, place: Place) -> None:
        """Chooses the flights; of those that are followed, shows the k on the day."""
        for name in place.get("flights", ())[:1]:
            if name != self.following.chosen:
                self.following.folder.inner(name)
                self.panel.choose(name)
        self.result.go_to(place)

    def kept(self) -> dict[str, Part]:
        """The flights, as they were identified."""
        return {"track": Part(self.following.saved, self._restore)}

    def _restore(self, saved: Any, _: Mapping[str, str]) -> None:
        self.following.restore(saved)
        self.panel.show()

    def close(self) -> None:
        """Ends the watch of the folder."""
        self.following.close()
