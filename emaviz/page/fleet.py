"""The Units tab: the units of one type, in what they differ, and models on each other's recordings."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.fleet.result import UnitsCompared, document_of, lacking, notes, rests_on, sentences
from emaviz.page.panel import REPORT, Example, FolderChoice, JobLine, KeepButtons, Keeps, PracticeButtons, Seal
from emaviz.page.share import Place
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS, NEXT_COLUMN, PLOTS_EARLY
from emaviz.page.workspaces import Page, Workspace
from emaviz.session.fleet import TYPE, ComparingUnits
from emaviz.session.session_file import Part
from emaviz.text.html import BOX, DIM, Html, add_html, begin, html, joined, note, waiting
from emaviz.text.verdicts import MEANINGS, begun, of_units, warned, whole
from emaviz.views import fleet

# --- what stays of compared units: the report, and the type as an actuator's file -------------------------------------

WORKSPACE = Workspace("units", "Units", viser.Icon.LAYOUT_GRID, 5, share=0.66, lower=True)

_TYPE = Keeps(
    "Save the type as an actuator",
    TYPE,
    viser.Icon.DEVICE_FLOPPY,
    "Means as values, and how far a further unit may be from them as tolerances",
)


# --- units' panel on the right ----------------------------------------------------------------------------------------
# Units' panel on the right: what differs in words, each unit's parameters, which model suits which, what lacks.

_CONFIG = {"displayModeBar": False}
_STEPS = (
    "Choose a folder of units on the left, or a challenge to practise on.",
    Html("Press <b>Compare units</b>: one model is fitted to all units; where a unit differs, a parameter is its own."),
    "You see which unit differs from the rest, in which parameter and by how much, checked on held-out recordings.",
)
_BESIDE_PX = 200  # of a window, what stands above and below the parameters
_WIDTH_PX = 540  # of a figure on a usual panel, by which its share of height is made
_HEAD_PX, _ROW_PX, _FEWEST_ROWS = 110, 34, 4  # of the matrix


_EXAMPLE = "Run an example", "Six units of one type, of which two differ: made in the data folder, then compared."


_WAITING = "One model is fitted to all units; then a unit that differs has a parameter of its own."


class UnitsResult:
    """Everything here is built and changed on the screen's thread."""

    def __init__(self, page: Page, comparing: ComparingUnits) -> None:
        self._page, self._comparing = page, comparing
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self.run_example: Callable[[], object] = lambda: None
        self._empty = begin(
            "No units are compared yet", _STEPS, Example(page, *_EXAMPLE, lambda: self.run_example()).html
        )
        self._told = add_html(gui, self._empty)
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
            self._keep = KeepButtons(
                page,
                comparing.folder,
                None,
                comparing.events.kept,
                lambda suffix, _: comparing.save(suffix),
                comparing.provenance,
                REPORT,
                _TYPE,
            )
        self._figures = gui.add_folder("Parameters of each unit", visible=False)
        with self._figures:
            add_html(gui, NEXT_COLUMN)
            self._parameters: Any = gui.add_plotly(go.Figure(), config=_CONFIG, aspect=1.0)

    def busy(self, busy: bool) -> None:
        """Whether a run goes on: where there is no answer yet, it is said that it does."""
        if self._comparing.found is None:
            self._told.content = waiting(self._comparing.job.title, _WAITING) if busy else self._empty

    def show(self, found: UnitsCompared | None) -> None:
        """An answer; None for none."""
        with self._page.server.atomic():
            for folder in (self._figures, self._matrix, self._words, self._save):
                folder.visible = found is not None
            self._keep.clear()
            self._seal.show()
            if found is None:
                self._told.content = self._empty
                return
            self._told.content = said(found)
            self._parameters.figure = fleet.unit_parameters(found)
            least, usual, most = (one(found) for one in fleet.HEIGHTS_PX)
            self._page.workspaces.heights.set_figure(self._parameters, least, usual, most, _BESIDE_PX)
            self._transfer.figure = fleet.transfer_matrix(found)
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


# --- the Units tab: a folder of units, the recordings to hold out, the actuator, and the run --------------------------

_ABOUT = (
    "A folder inside the data folder with a folder for each unit of one type, each with recordings of the same "
    "commands. One model is fitted to all; where a unit differs, and held-out recordings agree, a parameter is its own."
)


class UnitsPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(self, page: Page, comparing: ComparingUnits, result: UnitsResult, standing: Standing) -> None:
        self._page, self._comparing, self._result = page, comparing, result
        self._example_asked = False
        result.run_example = self._run_example
        gui, screen, job = page.server.gui, page.screen, comparing.job
        add_html(gui, note(_ABOUT))
        hint = "Folders of the data folder that hold units"
        self._folder = FolderChoice(page, "Units", hint, self._listed, lambda: comparing.chosen, self._take_folder)
        self._practice = PracticeButtons(page, comparing.practice, self.choose)
        hint = "Recordings of such a name are not fitted, but check the result: *unseen*; empty for none"
        rule = gui.add_text("Hold out", comparing.rule, hint=hint)
        actuator: Any = gui.add_dropdown("Actuator", (comparing.actuator_name,), hint="The units' type")
        self._rule = page.bind(rule, lambda: comparing.rule, partial(setattr, comparing, "rule"))
        self._actuator = page.bind(actuator, lambda: comparing.actuator_name, comparing.choose_actuator)
        self._start = gui.add_button("Compare units", icon=WORKSPACE.icon, disabled=True)
        self._line = JobLine(page, job, WORKSPACE, pauses="it")
        page.pressed(self._start, self._begin)
        page.disable_while(job, self._folder.control, rule, actuator)
        standing.connect(self._start, self._forget_errors)
        screen.hear(job.began, lambda _: self._practice.fold())
        screen.follow(job, self._busy)
        screen.hear(comparing.events.compared, result.show)
        self.refresh()

    def refresh(self) -> None:
        """Reads the data folder's lists again; what is chosen stays as long as it exists."""
        comparing = self._comparing
        self._folder.refresh()
        actuators = tuple(comparing.actuators())
        if tuple(self._actuator.control.options) != actuators:
            self._actuator.control.options = actuators
            self._actuator.show()
        self._start.disabled = comparing.job.running or self._folder.empty

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self._folder.choose(name)
        if self._example_asked:
            self._example_asked = False
            self._begin()

    def _run_example(self) -> None:
        """The first challenge: its recordings are made, then compared."""
        practice = self._comparing.practice
        self._example_asked = self._page.begins(lambda: practice.open(practice.shipped[0]), self._start)

    def show(self) -> None:
        """What is chosen and its answer, as a session's file says."""
        comparing = self._comparing
        self._rule.show()
        self.refresh()
        self._actuator.show()
        self._practice.show(comparing.chosen)
        if comparing.found is not None:
            self._practice.fold()
        self._result.show(comparing.found)

    def _listed(self) -> dict[str, str]:
        comparing = self._comparing
        listed = {
            f"{'the data folder' if name == '.' else name} ({count} unit{'s' if count > 1 else ''})": name
            for name, count in comparing.fleets().items()
        }
        if comparing.found is not None and comparing.chosen not in listed.values():
            listed[f"{comparing.chosen} (not in the data folder)"] = comparing.chosen  # of a session
        return listed

    def _take_folder(self, name: str) -> None:
        self._page.checked(lambda: self._comparing.choose(name), self._folder.control)
        self._practice.show(self._comparing.chosen)
        self._result.show(None)
        self._line.say("")

    def _begin(self) -> None:
        if not self._page.begins(self._comparing.begin, self._start):
            self._comparing.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of units that are not chosen any more."""
        self._page.say_beside(self._start, "")
        self._line.forget_refusal()

    def _busy(self, busy: bool) -> None:
        self._result.busy(busy)
        self.refresh()


# --- the Units tab: what units of one type differ in ------------------------------------------------------------------


class UnitsTab(Tab):
    """A folder of units, a folder of recordings each."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self.comparing = ComparingUnits(self.page.session, shared.comparing.folder, shared.files)
        self._standing = self.standing(self.comparing.provenance)
        with right.add_tab("Units", WORKSPACE.icon):
            self._standing.add(self.page.server.gui)
            self.result = UnitsResult(self.page, self.comparing)

    def build(self) -> None:
        """Which units, what is held out, and the run."""
        self.panel = UnitsPanel(self.page, self.comparing, self.result, self._standing)

    def refresh_files(self) -> None:
        """What may be compared."""
        self.panel.refresh()

    def place(self) -> Place:
        """The folder of units."""
        return {"units": [self.comparing.chosen]}

    def go_to(self, place: Place) -> None:
        """Chooses it."""
        for name in place.get("units", ())[:1]:
            if name != self.comparing.chosen:
                self.comparing.folder.inner(name)
                self.panel.choose(name)

    def kept(self) -> dict[str, Part]:
        """What is chosen, and the answer."""
        return {"units": Part(self.comparing.saved, self._restore, self.comparing.files)}

    def _restore(self, saved: Any, names: Mapping[str, str]) -> None:
        self.comparing.restore(saved, names)
        self.panel.show()

    def close(self) -> None:
        """Ends the run."""
        self.comparing.job.stop()
