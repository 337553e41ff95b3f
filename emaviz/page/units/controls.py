"""The Units tab: a folder of units, the recordings to hold out, the actuator, and the run."""

from __future__ import annotations

from typing import Any

from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.page.practice import PracticeButtons
from emaviz.page.units import WORKSPACE
from emaviz.page.units.result import UnitsResult
from emaviz.session.units.comparing_units import ComparingUnits
from emaviz.text.html import add_html
from emaviz.text.notes import note

_NONE = "–"
_ABOUT = (
    "A folder inside the data folder with a folder for each unit of one type, each with recordings of the same "
    "commands. What differs is freed where the data pay for it, and confirmed by what is held out."
)


class UnitsPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(self, page: Page, comparing: ComparingUnits, result: UnitsResult) -> None:
        self._page, self._comparing, self._result = page, comparing, result
        self._names: dict[str, str] = {}
        gui, post = page.server.gui, page.screen.post
        add_html(gui, note(_ABOUT))
        self._folder: Any = gui.add_dropdown("Units", (_NONE,), hint="Folders of the data folder that hold units")
        self._practice = PracticeButtons(page, comparing.practice, self.choose)
        self._rule = gui.add_text(
            "Hold out", comparing.rule, hint="Recordings of such a name judge what was found: *unseen*; empty for none"
        )
        self._actuator: Any = gui.add_dropdown("Actuator", (comparing.actuator_name,), hint="The units' type")
        self._start = gui.add_button("Compare units", icon=WORKSPACE.icon, disabled=True)
        self._line = JobLine(page, comparing.job, pauses="it")
        self._folder.on_update(lambda event: event.client and self._ask_folder())
        self._rule.on_update(lambda event: event.client and post("units rule", self._take_rule))
        self._actuator.on_update(lambda event: event.client and post("units actuator", self._take_actuator))
        self._start.on_click(lambda _: page.ask("compare units", lambda: page.begins(comparing.begin)))
        comparing.job.began.connect(lambda _: post("units began", lambda: self._busy(True)))
        comparing.job.ended.connect(lambda _: post("units ended", lambda: self._busy(False)))
        comparing.events.compared.connect(lambda found: post("units compared", lambda: result.show(found)))
        page.workspaces.entered.connect(lambda name: name == WORKSPACE.name and self.refresh())
        self.refresh()

    def refresh(self) -> None:
        """Reads the data folder's lists again; what is chosen stays as long as it exists."""
        comparing = self._comparing
        self._names = {
            f"{'the data folder' if name == '.' else name} ({count} unit{'s' if count > 1 else ''})": name
            for name, count in comparing.fleets().items()
        }
        options = tuple(self._names) or (_NONE,)
        if tuple(self._folder.options) != options:
            self._folder.options = options
        chosen = next((title for title, name in self._names.items() if name == comparing.chosen), None)
        if chosen is not None:
            self._folder.value = chosen
        elif self._names:
            self._take_folder(options[0])
        actuators = tuple(comparing.actuators())
        if tuple(self._actuator.options) != actuators:
            self._actuator.options = actuators
            self._actuator.value = comparing.actuator_name
        self._start.disabled = comparing.job.running or not self._names

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self.refresh()
        self._take_folder(next(title for title, one in self._names.items() if one == name))

    def _ask_folder(self) -> None:
        """As it is chosen now: the list may be about to be read again."""
        title = str(self._folder.value)
        self._page.screen.post("units", lambda: self._take_folder(title))

    def _take_folder(self, title: str) -> None:
        name = self._names.get(title)
        if name is not None and self._folder.value != title:
            self._folder.value = title
        if name is not None and name != self._comparing.chosen:
            self._page.checked(lambda: self._comparing.choose(name))
            self._practice.show(self._comparing.chosen)
            self._result.show(None)
            self._line.say("")

    def _take_rule(self) -> None:
        self._comparing.rule = str(self._rule.value)

    def _take_actuator(self) -> None:
        comparing = self._comparing
        if not self._page.checked(lambda: comparing.choose_actuator(str(self._actuator.value))):
            self._actuator.value = comparing.actuator_name

    def _busy(self, busy: bool) -> None:
        with self._page.server.atomic():
            for control in (self._start, self._folder, self._rule, self._actuator):
                control.disabled = busy
        self.refresh()
