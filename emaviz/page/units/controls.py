"""The Units tab: a folder of units, the recordings to hold out, the actuator, and the run."""

from __future__ import annotations

from typing import Any

from emaviz.page.folder_choice import FolderChoice
from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.page.practice import PracticeButtons
from emaviz.page.standing import Standing
from emaviz.page.units import WORKSPACE
from emaviz.page.units.result import UnitsResult
from emaviz.session.units.comparing_units import ComparingUnits
from emaviz.text.html import add_html
from emaviz.text.notes import note

_ABOUT = (
    "A folder inside the data folder with a folder for each unit of one type, each with recordings of the same "
    "commands. One model is fitted to all; where a unit differs, and held-out recordings agree, a parameter is its own."
)


class UnitsPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(self, page: Page, comparing: ComparingUnits, result: UnitsResult, standing: Standing) -> None:
        self._page, self._comparing, self._result = page, comparing, result
        gui, post = page.server.gui, page.screen.post
        add_html(gui, note(_ABOUT))
        hint = "Folders of the data folder that hold units"
        self._folder = FolderChoice(page, "Units", hint, self._listed, lambda: comparing.chosen, self._take_folder)
        self._practice = PracticeButtons(page, comparing.practice, self.choose)
        self._rule = gui.add_text(
            "Hold out",
            comparing.rule,
            hint="Recordings of such a name are not fitted, but check the result: *unseen*; empty for none",
        )
        self._actuator: Any = gui.add_dropdown("Actuator", (comparing.actuator_name,), hint="The units' type")
        self._start = gui.add_button("Compare units", icon=WORKSPACE.icon, disabled=True)
        self._line = JobLine(page, comparing.job, pauses="it")
        self._rule.on_update(lambda event: event.client and post("units rule", self._take_rule))
        self._actuator.on_update(lambda event: event.client and post("units actuator", self._take_actuator))
        self._start.on_click(lambda _: post("compare units", self._begin))
        standing.connect(self._start, self._forget_errors)
        comparing.job.began.connect(lambda _: post("units began", lambda: self._busy(True)))
        comparing.job.ended.connect(lambda _: post("units ended", lambda: self._busy(False)))
        comparing.events.compared.connect(lambda found: post("units compared", lambda: result.show(found)))
        self.refresh()

    def refresh(self) -> None:
        """Reads the data folder's lists again; what is chosen stays as long as it exists."""
        comparing = self._comparing
        self._folder.refresh()
        actuators = tuple(comparing.actuators())
        if tuple(self._actuator.options) != actuators:
            self._actuator.options = actuators
            self._actuator.value = comparing.actuator_name
        self._start.disabled = comparing.job.running or self._folder.empty

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self._folder.choose(name)

    def show(self) -> None:
        """What is chosen and its answer, as a session's file says."""
        comparing = self._comparing
        self._rule.value = comparing.rule
        self.refresh()
        self._actuator.value = comparing.actuator_name
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

    def _take_rule(self) -> None:
        self._comparing.rule = str(self._rule.value)

    def _take_actuator(self) -> None:
        comparing = self._comparing
        if not self._page.checked(lambda: comparing.choose_actuator(str(self._actuator.value)), self._actuator):
            self._actuator.value = comparing.actuator_name

    def _begin(self) -> None:
        if not self._page.begins(self._comparing.begin, self._start):
            self._comparing.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of units that are not chosen any more."""
        self._page.say_beside(self._start, "")
        if not self._comparing.job.running:
            self._line.say("")

    def _busy(self, busy: bool) -> None:
        if busy:
            self._practice.fold()
        with self._page.server.atomic():
            for control in (self._start, self._folder.control, self._rule, self._actuator):
                control.disabled = busy
        self.refresh()
