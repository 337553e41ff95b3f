"""The Compare tab: its files, options, actuators, and what stays of a comparison."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from functools import partial
from pathlib import Path
from typing import Any

import msgspec
import viser

from ema_model.actuator.describe import DRIVES
from ema_model.actuator.parameters import KINDS, on_axes
from ema_model.comparison import Comparison
from ema_model.errors import InputError
from ema_model.quantities import KINDS as AXES
from ema_model.quantities import Axes
from ema_model.recordings import SIGNALS
from ema_model.recordings.formats import FORMATS
from ema_model.text import COLOURS
from emaviz.page.compare_columns import MappingStep, health_card, recordings_list
from emaviz.page.compare_result import WORKSPACE, ResultPanel
from emaviz.page.panel import RECORD, REPORT, JobLine, KeepButtons, Lead, Leads
from emaviz.page.share import Place
from emaviz.page.style import LONG_LABELS, unseen
from emaviz.page.tab import COLUMNS, FIT, MISSING, Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS as WINDOW_COLUMNS
from emaviz.page.workspaces import Bound, Page
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import id_of
from emaviz.session.compare import COMPARABLE, LAY_OUT, MAP, OPEN, Comparing
from emaviz.session.data_folder import ACTUATOR_SUFFIX
from emaviz.session.discover import Discovering
from emaviz.session.files import UPLOADED, Description, Opened, Question
from emaviz.session.session_file import Part
from emaviz.session.settings import taken
from emaviz.text.html import Html, HtmlPiece, add_html, html, joined, note

# --- what a comparison is asked for: the actuator, what may be calibrated, the signals' weights, the window -----------


class AskedControls:
    """Folders of the Compare tab."""

    def __init__(self, page: Page, comparing: Comparing, uploads: Uploads) -> None:
        self._page, self._comparing = page, comparing
        gui = page.server.gui
        with gui.add_folder("Weights and window"):
            self._signals = {name: self._signal(name) for name in COMPARABLE}
            self._windowed = gui.add_checkbox("Only a window of time", False)
            self._from = gui.add_number("From [s]", 0.0, step=0.01, visible=False)
            self._to = gui.add_number("To [s]", 1.0, step=0.01, visible=False)
        with gui.add_folder("Model"):
            self._actuator = gui.add_dropdown(
                "Actuator", comparing.actuators(), initial_value=comparing.session.actuator.name
            )
            uploads.add_button("Upload an actuator file", ACTUATOR_SUFFIX, icon=viser.Icon.UPLOAD, color="gray")
            NewActuator(page, comparing, self.choose)
            calibrate = gui.add_checkbox("Calibrate it first", comparing.calibrate)
            self._free_folder = gui.add_folder("What the calibration may move", expand_by_default=False)
        self._free: list[Any] = []
        self._list_free()
        self._calibrate = page.bind(calibrate, lambda: comparing.calibrate, self._set_calibrate, at_once=True)
        page.changed_to(self._actuator, self.choose)
        for control in (self._windowed, self._from, self._to):
            page.changed(control, self._set_window, at_once=True)

    def choose(self, name: str) -> None:
        """Takes an actuator, just uploaded; on the screen's thread."""
        if self._page.checked(lambda: self._comparing.choose_actuator(name), self._actuator):
            self.show_actuator()

    def show_actuator(self) -> None:
        """The controls as the session's part has it; on the screen's thread."""
        self._actuator.options = self._comparing.actuators()
        self._actuator.value = self._comparing.actuator_name
        self._list_free()

    def show_settings(self) -> None:
        """All controls as the session's part has them; on the screen's thread."""
        comparing = self._comparing
        window = comparing.window_s
        self._calibrate.show()
        self._free_folder.visible = comparing.calibrate
        for one in self._signals.values():
            one.show()
        self._windowed.value = window is not None
        self._from.visible = self._to.visible = window is not None
        if window is not None:
            self._from.value, self._to.value = window
        self.show_actuator()

    def show_signals(self) -> None:
        """Only the signals that every recording has can be chosen."""
        known = self._comparing.signals_available()
        for name, one in self._signals.items():
            one.control.disabled = name not in known
        if self._comparing.actuator_name != self._actuator.value:
            self.show_actuator()

    def _signal(self, name: str) -> Bound:
        comparing = self._comparing

        def weight() -> float:
            return comparing.weights.get(name, 0.0)

        hint = "Weight in the calibration: 1 is what its noise says, 0 leaves it out"
        gui = self._page.server.gui
        box = gui.add_number(SIGNALS[name].title, weight(), min=0.0, step=0.1, hint=hint, disabled=True)
        return self._page.bind(box, weight, partial(comparing.set_weight, name), at_once=True)

    def _set_calibrate(self, calibrate: bool) -> None:
        self._comparing.calibrate = calibrate
        self._free_folder.visible = calibrate

    def _set_window(self) -> None:
        self._from.visible = self._to.visible = bool(self._windowed.value)
        if self._windowed.value:
            self._page.checked(lambda: self._comparing.set_window(self._from.value, self._to.value), self._to)
        else:
            self._comparing.window_s = None

    def _list_free(self) -> None:
        """A box for every parameter that has a tolerance; the actuator's file says which are on."""
        for box in self._free:
            box.remove()
        self._free = []
        gui, actuator = self._page.server.gui, self._comparing.actuator
        with self._free_folder:
            for path, tolerance in actuator.tolerances.items():
                one, value = on_axes(path, actuator.axes), actuator.value(path)
                hint = f"{one.path}: {value:.4g} ± {tolerance.sigma:.2g} {one.unit}".rstrip() + " (1 σ)"
                box = gui.add_checkbox(one.title, path in self._comparing.free, hint=hint)
                free, set_free = partial(self._is_free, path), partial(self._comparing.set_free, path)
                self._page.bind(box, free, set_free, at_once=True)
                self._free.append(box)

    def _is_free(self, path: str) -> bool:
        return path in self._comparing.free


# --- a form that makes an actuator's file -----------------------------------------------------------------------------
# A form that makes an actuator's file: its axes, controller and drive, then each parameter with its meaning.

_BOX = Html('style="padding:0 10px 6px;font-size:12.5px;line-height:1.4"')
_BELOW = Html('style="padding:0 10px 8px;margin-top:-6px;font-size:12px;line-height:1.35;opacity:.75"')


class NewActuator:
    """A folder of the Compare tab.  take(name) chooses the actuator that was made; it runs on the screen's thread."""

    def __init__(self, page: Page, comparing: Comparing, take: Callable[[str], None]) -> None:
        self._page, self._comparing, self._take = page, comparing, take
        self._fields: dict[str, Any] = {}  # by the parameter's path
        self._about: list[HtmlPiece] = []
        gui = page.server.gui
        with gui.add_folder("New actuator", expand_by_default=False):
            self._name = gui.add_text("Name", "New actuator")
            self._motor = gui.add_dropdown("Motor is", AXES, hint="Whether the motor turns or is a linear motor")
            self._user = gui.add_dropdown("User is", AXES, hint="Whether what it moves turns or slides")
            self._controller = gui.add_dropdown("Controller", tuple(DRIVES))
            self._drive = gui.add_dropdown("Drive", tuple(KINDS["inverter"]))
            self._kinds = add_html(gui)
            self._place = gui.add_folder("Parameters")
            self._button = gui.add_button(
                "Make this actuator", icon=viser.Icon.PLUS, hint="Its file goes to the data folder"
            )
            self._told = add_html(gui)
        for control in (self._motor, self._user, self._controller, self._drive):
            page.changed(control, self._ask)
        page.pressed(self._button, self._make)
        self._ask()

    def _description(self) -> Description:
        return Description(
            str(self._name.value),
            Axes(str(self._motor.value), str(self._user.value)),
            str(self._controller.value),
            str(self._drive.value),
            {path: str(field.value) for path, field in self._fields.items()},
            self._comparing.sample_rate_Hz,
        )

    def _ask(self) -> None:
        """The kinds in words, and a field for each parameter that such an actuator has; answers stay."""
        said = self._description()
        answers, drives = said.answers, said.drives
        self._drive.visible = bool(drives)
        if drives and tuple(self._drive.options) != drives:
            self._drive.options, self._drive.value = drives, drives[0]
        kinds = {"controller": said.controller} | ({"inverter": str(self._drive.value)} if drives else {})
        meanings = joined(html("<div><b>{}</b>: {}</div>", kind, KINDS[what][kind]) for what, kind in kinds.items())
        self._kinds.content = html("<div {}>{}</div>", _BOX, meanings)
        with self._page.server.atomic():
            for one in (*self._fields.values(), *self._about):
                one.remove()
            gui = self._page.server.gui
            with self._place:
                self._about = [add_html(gui, LONG_LABELS + html("<div {}>{}</div>", _BOX, _HOW))]
                self._fields = {}
                for one in self._description().questions:
                    label = f"{one.title} [{one.unit}]" if one.unit else one.title
                    self._fields[one.path] = gui.add_text(label, answers.get(one.path, ""))
                    self._about.append(add_html(gui, _about(one)))

    def _make(self) -> None:
        name, doubts = self._description().save(self._comparing.folder)
        self._take(name)
        lines = joined(html('<div style="color:{}">▲ {}</div>', COLOURS["warning"], line) for line in doubts)
        self._told.content = html("<div {}><b>{}</b> is made, and chosen above.{}</div>", _BOX, name, lines)


_HOW = html(
    "A number, or one with its tolerance, 1 σ: <code>1e-4 ± 5%</code>, <code>0 ± 0.02</code>; <code>3.5 fixed</code> "
    "is not calibrated. What is left empty is guessed. The model's step and the filter of a measured motion fit the "
    "loop, and the sampling of the measurements that are open."
)


def _about(one: Question) -> Html:
    other = f", also {one.other}" if one.other else ""
    usual = html(" Usual tolerance: {}.", one.tolerance) if one.tolerance else ""
    return html("<div {}>{}{}. Left empty: {}.{}</div>", _BELOW, one.meaning, other, one.empty, usual)


# --- which recordings are held out, to judge the model by -------------------------------------------------------------


class HeldOutControls:
    """A box for each recording, and a button for the one that suggests itself."""

    def __init__(self, page: Page, comparing: Comparing) -> None:
        self._page, self._comparing = page, comparing
        gui = page.server.gui
        self._folder = gui.add_folder("Hold out for validation", visible=False)
        self._boxes: dict[str, Bound] = {}
        with self._folder:
            add_html(gui, LONG_LABELS)
            self._told = add_html(gui)
            self._take = gui.add_button("Hold it out", icon=viser.Icon.EYE_OFF, visible=False)
        page.pressed(self._take, self._take_proposal)

    def show(self) -> None:
        """As the session has it; on the screen's thread."""
        comparing = self._comparing
        names = list(comparing.opened) if len(comparing.opened) > 1 else []
        if list(self._boxes) != names:
            for one in self._boxes.values():
                one.control.remove()
            with self._folder:
                self._boxes = {name: self._box(name) for name in names}
        for one in self._boxes.values():
            one.show()
        one = comparing.proposal
        self._take.visible = one is not None
        if one is not None:
            self._take.label = f"Hold out {Path(one.name).name}"
            text = f"Proposed: {Path(one.name).name}, since {one.why}. It then shows whether a model is right, or bent."
        elif comparing.held_out:
            text = "What is held out is not fitted: a model that is right fits it as well."
        else:
            text = "All are fitted. One that is held out would show whether a model is right, or bent to what it saw."
        self._told.content = note(text)
        self._folder.visible = bool(names)

    def _box(self, name: str) -> Bound:
        comparing = self._comparing
        box = self._page.server.gui.add_checkbox(Path(name).name, False)
        return self._page.bind(box, lambda: name in comparing.held_out, partial(comparing.hold_out, name), at_once=True)

    def _take_proposal(self) -> None:
        one = self._comparing.proposal
        if one is not None:
            self._comparing.hold_out(one.name, True)
            self._comparing.asking.ask(by_hand=False)  # it was compared without, or is being


# --- what a session's file holds of Compare: the recordings, and what is asked of them --------------------------------


class Asked(msgspec.Struct, frozen=True):
    """As it is saved."""

    files: tuple[str, ...]  # names in the data folder
    actuator: str
    calibrate: bool
    free: frozenset[str]  # parameters that a calibration may move, by path
    weights: dict[str, float]  # of the signals to fit
    window_s: tuple[float, float] | None = None
    held_out: frozenset[str] = frozenset()  # of the files


def kept(comparing: Comparing, shown: Callable[[], None]) -> Part:
    """shown(): called when what is asked was restored, before the recordings are opened."""

    def save() -> dict[str, Any]:
        own = comparing
        asked = Asked(
            tuple(own.opened),
            own.actuator_name,
            own.calibrate,
            frozenset(own.free),
            own.weights,
            own.window_s,
            frozenset(own.held_out),
        )
        return msgspec.to_builtins(asked, order="sorted")

    def restore(saved: Any, names: Mapping[str, str]) -> None:
        asked: Asked = taken(Asked, saved, "part of Compare")
        actuator = asked.actuator
        if actuator.startswith(UPLOADED):
            name = actuator.removeprefix(UPLOADED)
            actuator = UPLOADED + names.get(name, name)
        comparing.choose_actuator(actuator)
        comparing.calibrate = asked.calibrate
        for path in comparing.actuator.tolerances:
            comparing.set_free(path, path in asked.free)
        comparing.weights = {}
        for name, weight in asked.weights.items():
            comparing.set_weight(name, weight)
        comparing.window_s = None
        if asked.window_s is not None:
            comparing.set_window(*asked.window_s)
        files = [names.get(name, name) for name in asked.files]
        comparing.comparison = None  # of what was there before
        comparing.provenance.clear()
        shown()
        for name in [name for name in comparing.opened if name not in files]:
            comparing.remove(name)
        comparing.take_held_out([names.get(name, name) for name in asked.held_out], files)
        for name in files:
            comparing.add(name)

    return Part(save, restore)


# --- where one goes from a comparison: to what is missing from the model, or to the faults in its recordings ----------


def leads(page: Page, discovering: Discovering) -> Leads:
    """Two buttons, below the answer."""
    comparing, session = discovering.comparing, page.session

    def to_identify() -> None:
        names = [name for name, one in comparing.opened.items() if one.measurement is not None]
        if not names:
            raise InputError("no measurement is open here any more; add one first")
        if comparing.actuator != session.actuator:
            raise InputError(
                f"Identify knows {session.actuator.name}, the actuator that the app was started with; start it with "
                f"--actuator to identify faults of {comparing.actuator.name}"
            )
        session.settings.set("source", names[0])

    return Leads(
        page,
        [
            Lead(
                "Find what is missing",
                viser.Icon.BULB,
                "Every effect of the library and every fault beside what is left, on this calibration",
                "discover",
                discovering.follow_compare,
                discovering.go_on,
            ),
            Lead(
                "Identify faults",
                viser.Icon.SEARCH,
                "Takes the first of these measurements to Identify",
                "identify",
                to_identify,
                colour="gray",
            ),
        ],
    )


# --- the Compare tab: recordings in, their columns and health, what is compared, and the run --------------------------

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
            self._held = HeldOutControls(page, comparing)
        self.to_columns, self.to_fit = (gui.add_button(step) for step in ("To the columns", "To the fit"))
        add_html(gui, unseen([id_of(self.to_columns), id_of(self.to_fit)]))
        self._mapping = result.step
        self._start = gui.add_button("Compare", icon=viser.Icon.ARROWS_DIFF)
        self._line = JobLine(page, comparing.job, WORKSPACE)
        self._health_folder = gui.add_folder("Data health", visible=False)
        with self._health_folder:
            self._health = add_html(gui)
        self.asked = AskedControls(page, comparing, uploads)
        page.pressed(self._add_it, self._add)
        page.changed_to(self._which, self._show)
        for button in (self._columns, self.to_columns):
            page.pressed(button, self._open_columns)
        page.pressed(self.to_fit, self._close_columns)
        page.pressed(self._remove, self._remove_shown)
        page.pressed(self._start, comparing.ask)
        page.disable_while(comparing.job, self._start)  # while it runs it is asked for already
        standing.connect(self._start, self._forget_errors)
        events, hear = comparing.events, page.screen.hear
        hear(events.opened, self._opened, each=lambda opened: opened.name)
        hear(events.refused, self._open_columns)
        hear(events.failed, self._failed, each=lambda what, name, why: what)
        hear(events.held, self._show_held_out)
        hear(events.removed, self._removed)
        hear(events.compared, self._compared)
        hear(events.missing, self._missing)
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

    def _compared(self, found: Comparison) -> None:
        """Shows it; the columns that somebody is at, of another file, stay on the screen, with what was changed."""
        self._result.show(found)
        self._mapping.redraw()

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
        if not self._comparing.opened:
            self._result.forget_preview()
            if not self._comparing.running:
                self._line.say("")

    def _show(self, name: str | None) -> None:
        """One of the recordings in the cards below the list."""
        everything = dict(self._comparing.opened)
        opened = everything.get(name or "")
        self._shown = opened.name if opened is not None else None
        self._show_held_out()
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

    def _show_held_out(self) -> None:
        self._list.content = recordings_list(self._comparing.opened.values(), self._comparing.held_out)
        self._held.show()

    def _open_columns(self) -> None:
        opened = self._comparing.opened.get(self._shown or "")
        if opened is not None:
            self._mapping.show(opened)

    def _close_columns(self) -> None:
        """Back to the comparison, if there is one; edits that were not used are given up."""
        opened = self._comparing.opened.get(self._shown or "")
        if opened is not None and opened.measurement is not None:
            self._mapping.hide()
            self._result.end_preview()

    # --- the run ----------------------------------------------------------------------------------------------------

    def _missing(self, why: str, by_hand: bool) -> None:
        """What a comparison lacks: beside the button, or, where nobody pressed it, in the line below."""
        self._page.say_beside(self._start, why if by_hand else "")
        if why:
            self._comparing.provenance.refused()
        if why and not by_hand:
            self._line.say(why, refuses=True)

    def _forget_errors(self) -> None:
        """What was said of a comparison that nobody asks for any more."""
        self._page.say_beside(self._start, "")
        self._line.forget_refusal()


# --- the Compare tab: the model beside measurements -------------------------------------------------------------------


class CompareTab(Tab):
    """Takes measurements and actuator files from the browser."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._standing = self.standing(shared.comparing.provenance)
        with right.add_tab("Comparison", viser.Icon.ARROWS_DIFF):
            add_html(self.page.server.gui, WINDOW_COLUMNS)
            shared.correction.add(WORKSPACE.name)
            self._standing.add(self.page.server.gui)
            self.result = ResultPanel(
                self.page,
                shared.strip,
                lambda preview: MappingStep(self.page, shared.comparing, preview),
                self._leads,
                lambda: KeepButtons(
                    self.page,
                    shared.comparing.folder,
                    shared.viewer,
                    shared.comparing.events.kept,
                    lambda suffix, _: shared.comparing.save(suffix),
                    shared.comparing.provenance,
                    REPORT,
                    RECORD,
                ),
                self._run_example,
            )

    def _run_example(self) -> None:
        self.shared.comparing.open_example()
        self.panel.asked.show_actuator()

    def _leads(self) -> None:
        first, *_ = leads(self.page, self.shared.discovering).buttons
        self.shared.correction.leads(MISSING, first)

    def build(self) -> None:
        """Recordings in, what is compared, and the run."""
        self.panel = ComparePanel(self.page, self.shared.comparing, self.result, self.shared.uploads, self._standing)
        for step, button in ((COLUMNS, self.panel.to_columns), (FIT, self.panel.to_fit)):
            self.shared.correction.leads(step, button)

    def refresh_files(self) -> None:
        """What may be added."""
        self.panel.refresh_files()

    def place(self) -> Place:
        """The measurements, the actuator where it is not the app's, and the chosen region."""
        comparing, region = self.shared.comparing, self.result.selected
        found: dict[str, Sequence[str]] = {"file": list(comparing.opened)}
        if comparing.actuator_name != comparing.session.actuator.name:
            found["actuator"] = [comparing.actuator_name]
        if comparing.held_out:
            found["held"] = [name for name in comparing.opened if name in comparing.held_out]
        return found if region is None else {**found, "region": [f"{region + 1}"]}

    def go_to(self, place: Place) -> None:
        """Opens the measurements, which are compared, unless that is done; then chooses the region."""
        comparing, files = self.shared.comparing, list(place.get("file", ()))
        region = next((int(one) - 1 for one in place.get("region", ()) if one.isdecimal()), None)
        name = next(iter(place.get("actuator", ())), comparing.session.actuator.name)
        for one in files:
            comparing.folder.measurement(one)  # all of them, before what is open gives way
        if files and (files != list(comparing.opened) or name != comparing.actuator_name):
            comparing.choose_actuator(name)
            self.panel.asked.show_settings()
            self.result.wanted = region
            for one in [one for one in comparing.opened if one not in files]:
                comparing.remove(one)
            comparing.take_held_out([one for one in place.get("held", ()) if one in files], files)
            for one in files:
                comparing.add(one)
        elif region is not None and comparing.comparison is not None:
            if region != self.result.selected:
                self.result.select(region)
        else:
            self.result.wanted = region

    def kept(self) -> dict[str, Part]:
        """What is opened and asked."""

        def shown() -> None:
            self.result.clear()
            self.panel.asked.show_settings()

        return {"compare": kept(self.shared.comparing, shown)}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Measurements and actuator files."""
        return {**dict.fromkeys(FORMATS, self.panel.take), ACTUATOR_SUFFIX: self.panel.take}
