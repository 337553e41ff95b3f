"""The Compare tab: recordings in, their columns and health, what is compared, and the run."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import viser

from ema_model.recordings.formats import FORMATS
from emaviz.page.compare.cards import health_card, recordings_list
from emaviz.page.compare.mapping import MappingStep
from emaviz.page.compare.options import AskedControls
from emaviz.page.compare.result import ResultPanel
from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.page.standing import Standing
from emaviz.server.uploads import Uploads
from emaviz.session.actuators import UPLOADED
from emaviz.session.compare.comparing import Comparing
from emaviz.session.compare.events import LAY_OUT, MAP, OPEN
from emaviz.session.data_folder import ACTUATOR_SUFFIX
from emaviz.session.opened import Opened
from emaviz.text.html import Html, add_html

_NONE = "–"


class ComparePanel:
    """The tab's controls.  `result` is the panel on the right, which shows previews and the comparison."""

    def __init__(
        self, page: Page, comparing: Comparing, result: ResultPanel, uploads: Uploads, standing: Standing
    ) -> None:
        self._page, self._comparing, self._result = page, comparing, result
        self._shown: str | None = None
        self._asked_at: Any = None  # by which control the last file was asked for
        self._complains: dict[str, str] = {}  # of which file something is said, by what was done with it
        gui = page.server.gui
        gui.add_markdown("Upload a measurement of a test bench, or **drop it anywhere** on the page.")
        self._upload = uploads.add_button("Upload a measurement", ",".join(FORMATS), icon=viser.Icon.UPLOAD)
        self._choice = gui.add_dropdown("Data folder", [_NONE])
        self._add_it = gui.add_button("Add this file", icon=viser.Icon.PLUS, color="gray")
        with gui.add_folder("Measurements"):
            self._list = add_html(gui, recordings_list([]))
            self._which = gui.add_dropdown("Shown", [_NONE], visible=False)
            self._columns = gui.add_button("Columns…", icon=viser.Icon.TABLE, color="gray", visible=False)
            self._remove = gui.add_button("Remove", icon=viser.Icon.X, color="gray", visible=False)
        self._mapping = MappingStep(page, comparing, result.preview)
        self._start = gui.add_button("Compare", icon=viser.Icon.ARROWS_DIFF)
        self._line = JobLine(page, comparing.job)
        self._health_folder = gui.add_folder("Data health", visible=False)
        with self._health_folder:
            self._health = add_html(gui)
        self.asked = AskedControls(page, comparing, uploads)
        self._add_it.on_click(lambda _: self._add())
        self._which.on_update(lambda event: event.client and self._post_show(str(self._which.value)))
        self._columns.on_click(lambda _: page.screen.post("columns", self._open_columns))
        self._remove.on_click(lambda _: self._remove_shown())
        self._start.on_click(lambda _: comparing.ask())
        standing.connect(self._start, self._forget_errors)
        events = comparing.events
        events.opened.connect(lambda opened: page.screen.post(f"opened {opened.name}", lambda: self._opened(opened)))
        events.refused.connect(lambda: page.screen.post("columns", self._open_columns))
        events.failed.connect(
            lambda what, name, why: page.screen.post(f"failed to {what}", lambda: self._failed(what, name, why))
        )
        events.removed.connect(lambda: page.screen.post("removed", self._removed))
        events.compared.connect(lambda found: page.screen.post("compared", lambda: result.show(found)))
        events.missing.connect(lambda why, by_hand: page.screen.post("missing", lambda: self._missing(why, by_hand)))
        comparing.job.began.connect(lambda _: page.screen.post("compare runs", self._show_running))
        comparing.job.ended.connect(lambda _: page.screen.post("compare runs", self._show_running))
        self.refresh_files()

    def refresh_files(self) -> None:
        """Reads the data folder's list again."""
        names = self._comparing.folder.measurements() or [_NONE]
        if list(self._choice.options) != names:
            self._choice.options = names

    # --- files ------------------------------------------------------------------------------------------------------

    def take(self, path: Path) -> None:
        """A measurement or an actuator file came from the browser; on the server's thread."""
        name = self._comparing.folder.name_of(path)
        if path.suffix.lower() == ACTUATOR_SUFFIX:
            self._page.screen.post("actuator", lambda: self.asked.choose(UPLOADED + name))
        else:
            self._open(name, self._upload)

    def _add(self) -> None:
        name = str(self._choice.value)
        if name != _NONE:
            self._open(name, self._add_it)

    def _open(self, name: str, asked_at: Any) -> None:
        """Large files take seconds: says so, until more can be said."""
        self._asked_at = asked_at
        if not self._comparing.running:
            self._page.screen.post("reading", lambda: self._line.say(f"Reading {name} …"))
        self._comparing.add(name)

    def _remove_shown(self) -> None:
        if self._shown is not None:
            self._comparing.remove(self._shown)

    def _opened(self, opened: Opened) -> None:
        self._show(opened.name)
        if opened.measurement is None:
            todo = Html("Check which column is which signal, then press <b>Use these columns</b>.")
            self._line.say(Html("Click the line with the columns' names, on the right.") if opened.problem else todo)
            return
        if self._comparing.comparison is None:
            self._result.preview(opened)
        self._comparing.asking.ask(by_hand=False)

    def _failed(self, what: str, name: str, why: str) -> None:
        """Beside what was asked for; no reason takes it away."""
        self._complains[what] = name if why else ""
        if what == OPEN and why and not self._comparing.running:
            self._line.say("")
        if what == OPEN:  # beside the control that was used last, and no longer beside the other
            for control in (self._upload, self._add_it):
                self._page.say_beside(control, why if control is (self._asked_at or self._add_it) else "")
            return
        control = {MAP: self._mapping.use, LAY_OUT: self._mapping.header}.get(what)
        if control is not None:
            self._page.say_beside(control, why)

    def _removed(self) -> None:
        """What was said of a file goes with it."""
        for what, name in self._complains.items():
            if name and name not in self._comparing.opened and what != OPEN:
                self._failed(what, "", "")
        self._show(next(reversed(self._comparing.opened), None))

    def _post_show(self, name: str) -> None:
        self._page.screen.post("shown", lambda: self._show(name))

    def _show(self, name: str | None) -> None:
        """One of the recordings in the cards below the list."""
        everything = dict(self._comparing.opened)
        opened = everything.get(name or "")
        self._shown = opened.name if opened is not None else None
        self._list.content = recordings_list(everything.values())
        self._which.visible = len(everything) > 1
        if everything:
            self._which.options = list(everything)
            self._which.value = self._shown or next(iter(everything))
        for control in (self._columns, self._remove):
            control.visible = opened is not None
        self.asked.show_signals()
        card = opened.health if opened is not None else None
        self._health_folder.visible = card is not None
        self._health.content = "" if card is None else health_card(card)
        if opened is not None and opened.measurement is None:
            self._mapping.show(opened)
        else:
            self._mapping.hide()
            self._result.end_preview()

    def _open_columns(self) -> None:
        opened = self._comparing.opened.get(self._shown or "")
        if opened is not None:
            self._mapping.show(opened)

    # --- the run ----------------------------------------------------------------------------------------------------

    def _missing(self, why: str, by_hand: bool) -> None:
        """What a comparison lacks: beside the button, or, where nobody pressed it, in the line below."""
        self._page.say_beside(self._start, why if by_hand else "")
        if why:
            self._comparing.provenance.refused()
        if why and not by_hand:
            self._line.say(why)

    def _forget_errors(self) -> None:
        """What was said of a comparison that nobody asks for any more."""
        self._page.say_beside(self._start, "")
        if not self._comparing.running:
            self._line.say("")

    def _show_running(self) -> None:
        """While one runs it is asked for already; else a press is carried out, or says what is missing."""
        self._start.disabled = self._comparing.running
