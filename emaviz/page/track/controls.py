"""The Track tab: a folder of flights, thresholds, and the run."""

from __future__ import annotations

from typing import Any

import viser

from ema_model.faults import BY_NAME
from ema_model.quantities.titles import in_sentence
from ema_model.tracking.track import TRACKED
from emaviz.page.folder_choice import FolderChoice
from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.page.practice import PracticeButtons
from emaviz.page.standing import Standing
from emaviz.page.style import LONG_LABELS
from emaviz.page.track.result import TrackResult
from emaviz.session.track.following import Following
from emaviz.text.html import add_html, html, joined
from emaviz.text.notes import boxed, note
from emaviz.text.told import warned

_HALFWAY = 0.5  # from healthy to the end of a k's range, where a threshold begins
_ABOUT = (
    "A folder of recordings of one unit, one for each flight, named in their order (flight_0001, 2026-05-03 …), "
    "inside the data folder."
)


class TrackPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(self, page: Page, following: Following, result: TrackResult, standing: Standing) -> None:
        self._page, self._following, self._result = page, following, result
        gui, post = page.server.gui, page.screen.post
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
        self._line = JobLine(page, following.job, pauses="it")
        self._watch = gui.add_checkbox(
            "Add new flights",
            following.watching,
            hint="Files that arrive in the folder add a point each",
        )
        self._left_out = add_html(gui)
        self._fault.on_update(lambda event: event.client and post("fault", self._show_fault))
        for control in (self._ends, self._threshold):
            control.on_update(lambda event: event.client and self._ask_threshold())
        self._watch.on_update(lambda event: event.client and self._take_watch())
        self._start.on_click(lambda _: post("track", self._begin))
        standing.connect(self._start, self._forget_errors)
        following.job.began.connect(lambda _: post("track began", lambda: self._busy(True)))
        following.job.ended.connect(lambda _: post("track ended", lambda: self._busy(False)))
        following.events.followed.connect(lambda history: post("followed", lambda: result.show(history)))
        following.events.left_out.connect(lambda: post("left out", self._show_left_out))
        self.refresh()

    def refresh(self) -> None:
        """Reads the data folder's list again; the chosen one stays as long as it exists."""
        self._folder.refresh()
        self._start.disabled = self._following.job.running or self._folder.empty

    # --- what is asked ----------------------------------------------------------------------------------------------

    def choose(self, name: str) -> None:
        """A folder by its name; on the screen's thread."""
        self._folder.choose(name)

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

    def _take_watch(self) -> None:
        self._following.watching = bool(self._watch.value)

    # --- the run ----------------------------------------------------------------------------------------------------

    def _begin(self) -> None:
        if not self._page.begins(self._following.begin, self._start):
            self._following.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of flights that are not there any more."""
        self._page.say_beside(self._start, "")
        self._show_left_out()
        if not self._following.job.running:
            self._line.say("")

    def _busy(self, busy: bool) -> None:
        if busy:
            self._practice.fold()
        with self._page.server.atomic():
            self._start.disabled = busy
            for control in (self._folder.control, self._fault, self._ends):
                control.disabled = busy
            self._threshold.disabled = busy or not self._ends.value
        self._show_left_out()
        self.refresh()

    def _show_left_out(self) -> None:
        lines = self._following.complaints
        if lines:
            self._following.provenance.refused()
        self._left_out.content = boxed(warned(lines)) if lines else ""
