"""A tab of an analysis, made of what that states and of its view: options on the left, the view's sections right.

A tab's own file says which analysis, and what to say before there is an answer.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import plotly.graph_objects as go
import viser

from ema_model.actuator import Actuator
from ema_model.analyses import analyses
from ema_model.quantities import in_sentence
from ema_model.recordings.measurement import Measurement
from ema_model.result import Result
from ema_model.text import Document, Lines
from emaviz.page.panel import RECORD, REPORT, Example, JobLine, KeepButtons, Keeps
from emaviz.page.share import Place
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS, NEXT_COLUMN
from emaviz.page.workspaces import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.session.analysis import Analysing
from emaviz.session.session_file import Part
from emaviz.text.html import BOX, add_html, begin, html, note, waiting
from emaviz.text.verdicts import large, whole
from emaviz.views import ANSWER, Figures, Section, View, Words, view_for

_CONFIG = {"displayModeBar": False}
_WIDTH_PX = 540  # of a figure on a usual panel, by which its share of height is made
_TABLE = Keeps("Save table", ".csv", viser.Icon.TABLE, "The numbers of the figures as columns")


class AnalysisResult:
    """The panel on the right.  Everything here is built and changed on the screen's thread."""

    def __init__(
        self,
        page: Page,
        analysing: Analysing,
        view: View[Any],
        before: str,
        meanwhile: str,
        viewer: ViewerHost | None,
    ) -> None:
        """before: HTML that stands there while there is no answer; meanwhile: what is said while it is computed."""
        self._page, self._analysing, self._view, self._before = page, analysing, view, before
        self._meanwhile = meanwhile
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._told = add_html(gui, before)
        self._sections = {
            one.anchor: gui.add_folder(one.title, visible=False) for one in view.sections if one != ANSWER
        }
        self._drawn: list[Any] = []  # of the answer that is shown
        self._save = gui.add_folder("Keep it", visible=False)
        with self._save:
            self._keep = KeepButtons(
                page,
                analysing.comparing.folder,
                viewer,
                analysing.events.kept,
                lambda suffix, _: analysing.save(suffix),
                analysing.provenance,
                REPORT,
                RECORD,
                _TABLE,
            )

    def busy(self, busy: bool) -> None:
        """Whether a run goes on: where there is no answer yet, it is said that it does."""
        if self._analysing.result is None:
            self._told.content = waiting(self._analysing.job.title, self._meanwhile) if busy else self._before

    def show(self, result: Result | None) -> None:
        """An answer; None for none."""
        with self._page.server.atomic():
            for one in self._drawn:
                one.remove()
            self._drawn = []
            self._keep.clear()
            self._save.visible = result is not None
            for folder in self._sections.values():
                folder.visible = False
            if result is None:
                self._told.content = self._before
                return
            title = self._view.title(result)
            told = html("<div {}>{}</div>", BOX, large(title, self._view.meaning(result)))
            self._told.content = told + whole(_below(title, result.document))
            for section in self._view.sections:
                if section.anchor in self._sections:
                    self._draw(section, result)

    def _draw(self, section: Section[Any], result: Result) -> None:
        """One section, where the result has something for it."""
        folder = self._sections[section.anchor]
        with folder:
            drawn = [one for part in section.parts for one in self._part(part, result)]
            if drawn and not self._drawn:  # the figures stand beside the words
                drawn.append(add_html(self._page.server.gui, NEXT_COLUMN))
        folder.visible = bool(drawn)
        self._drawn += drawn

    def _part(self, part: Words[Any] | Figures[Any], result: Result) -> list[Any]:
        gui: Any = self._page.server.gui
        if isinstance(part, Words):
            return [add_html(gui, whole(Document(part.of(result))))]
        aspect = part.height(result) / _WIDTH_PX
        figures: Sequence[go.Figure] = [one for row in part.of(result) for one in row]
        return [gui.add_plotly(one, config=_CONFIG, aspect=aspect) for one in figures]


class AnalysisPanel:
    """The controls on the left: a list for each option, and the run."""

    def __init__(self, tab: AnalysisTab, analysing: Analysing, result: AnalysisResult, standing: Standing) -> None:
        page, workspace = tab.page, tab.workspace
        self._page, self._analysing, self._result = page, analysing, result
        gui, screen, job, events = page.server.gui, page.screen, analysing.job, analysing.comparing.events
        add_html(gui, note(tab.about))
        self._given = add_html(gui)
        self._options: dict[str, Any] = {}
        for option, one in analysing.analysis.options.items():
            control: Any = gui.add_dropdown(one.title, tuple(one.choices.values()), hint=_capital(one.help))
            page.changed_to(control, partial(self._choose, option))
            self._options[option] = control
        self._start = gui.add_button(analysing.analysis.title, icon=workspace.icon)
        self._line = JobLine(page, job, workspace)
        page.pressed(self._start, self._begin)
        page.disable_while(job, self._start, *self._options.values())
        standing.connect(self._start, self._forget_errors)
        screen.follow(job, result.busy)
        screen.hear(analysing.events.found, result.show)
        screen.hear_any((events.opened, events.removed), self.refresh)
        self.refresh()

    def refresh(self) -> None:
        """Says what Compare has now."""
        of = self._analysing.comparing
        subject = of.inputs(as_read=True).subject
        told = f"{subject}, beside {of.actuator_name}" if subject else "no recording is chosen there yet"
        self._given.content = note(f"What Compare has: {told}.")

    def show(self) -> None:
        """Options and answer, as a session's file says."""
        for option, one in self._analysing.analysis.options.items():
            self._options[option].value = one.choices[self._analysing.chosen[option]]
        self.refresh()
        self._result.show(self._analysing.result)

    def _choose(self, option: str, title: str) -> None:
        titles = self._analysing.analysis.options[option].choices
        self._analysing.choose(option, next((value for value, one in titles.items() if one == title), title))

    def _begin(self) -> None:
        if not self._page.begins(self._analysing.begin, self._start):
            self._analysing.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of recordings that are not chosen any more."""
        self._page.say_beside(self._start, "")
        self._line.forget_refusal()


class AnalysisTab(Tab):
    """Base of the tabs of analyses."""

    analysis: ClassVar[str]  # its name
    about: ClassVar[str]  # what it is for, above the controls
    steps: ClassVar[Sequence[str]]  # to an answer, while there is none
    meanwhile: ClassVar[str] = "The recordings are analysed."  # what is done while it runs
    example: ClassVar[tuple[str, str] | None] = None  # its button, and what that does
    record_example: ClassVar[Callable[[Actuator], Measurement]]  # of the standard actuator, where there is an example

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        of = analyses()[self.analysis]
        self.analysing = Analysing(of, shared.comparing, shared.files)
        self._standing = self.standing(self.analysing.provenance)
        shipped = None if self.example is None else Example(self.page, *self.example, self._run_example).html
        before = begin(f"There is no {in_sentence(of.title)} yet", self.steps, shipped)
        with right.add_tab(of.title, self.workspace.icon):
            self._standing.add(self.page.server.gui)
            self.result = AnalysisResult(
                self.page, self.analysing, view_for(of.result), before, self.meanwhile, shared.viewer
            )

    def build(self) -> None:
        """The options, and the run."""
        self.panel = AnalysisPanel(self, self.analysing, self.result, self._standing)

    def _run_example(self) -> None:
        assert self.example is not None, "its button was pressed"
        title, _ = self.example
        record, name = type(self).record_example, f"{self.analysis}-example.parquet"
        self.page.begins(lambda: self.analysing.begin_example(record, name), title=title)

    def refresh_files(self) -> None:
        """What Compare has."""
        self.panel.refresh()

    def place(self) -> Place:
        """The options."""
        return {name: [value] for name, value in self.analysing.chosen.items()}

    def go_to(self, place: Place) -> None:
        """Takes those of an address."""
        for name in self.analysing.chosen:
            for value in place.get(name, ())[:1]:
                self.analysing.choose(name, value)
        self.panel.show()

    def kept(self) -> dict[str, Part]:
        """The options and the answer."""
        return {self.analysis: Part(self.analysing.saved, self._restore)}

    def _restore(self, saved: Any, _: Mapping[str, str]) -> None:
        self.analysing.restore(saved)
        self.panel.show()

    def close(self) -> None:
        """Ends the run."""
        self.analysing.job.stop()


def _below(title: str, told: Document) -> Document:
    """The document below its headline, which is not said twice."""
    first, *others = told.blocks
    if isinstance(first, Lines) and first.lines[:1] == [title]:
        return Document([replace(first, lines=first.lines[1:]), *others])
    return told


def _capital(text: str) -> str:
    return text[:1].upper() + text[1:]
