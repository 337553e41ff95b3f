"""The Discover tab: what is taken, the guide, and what stays of a discovery."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any

import viser

from ema_model.actuator import Actuator
from ema_model.challenges import Challenge
from ema_model.discovery import Candidate
from ema_model.discovery.result import Experiment
from ema_model.discovery.snapshot import Look
from ema_model.discovery.words import effect_title, rung_title
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError, quoted
from ema_model.faults import CAUSES
from ema_model.quantities import number
from emaviz.page import discover_candidate
from emaviz.page.discover_candidate import OwnEffect
from emaviz.page.discover_result import HOME, WORKSPACE, DiscoveryPanel, SideBySide
from emaviz.page.explore import ExploreTab, take_experiment
from emaviz.page.panel import JobLine, KeepButtons, Keeps, Lead, Leads
from emaviz.page.share import Place
from emaviz.page.tab import Shared, Standing, Tab
from emaviz.page.window_layout import COLUMNS
from emaviz.page.workspaces import Page
from emaviz.recording.viewer import ViewerHost
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import id_of
from emaviz.session.data_folder import CHALLENGE_SUFFIX
from emaviz.session.discover import Discovering
from emaviz.session.discovery_source import COMPARED
from emaviz.session.session_file import Part
from emaviz.text.html import DIM, Html, add_html, boxed, html, note, said

# --- the recordings of a discovery ------------------------------------------------------------------------------------
# The recordings of a discovery: Compare's, some of them held out, or a challenge, which may be a sealed file.

_STARS = "●○"
_SEALED = "Sealed: "  # before the names of such files


class SourceControls:
    """The top of the Discover tab.

    chosen() is called when another source is chosen, shown() when more is known of it; both on the screen's thread.
    """

    def __init__(
        self,
        page: Page,
        discovering: Discovering,
        uploads: Uploads,
        chosen: Callable[[], None],
        shown: Callable[[], None],
    ) -> None:
        self._page, self._discovering, self._chosen, self._shown = page, discovering, chosen, shown
        self._look: Look | None = None
        self._shipped = {COMPARED: ""} | {
            f"{_STARS[0] * one.grade}{_STARS[1] * (5 - one.grade)} {one.title}": name
            for name, one in discovering.source.challenges.items()
        }
        self._names = self._listed()
        gui, hear_any = page.server.gui, page.screen.hear_any
        self._source = gui.add_dropdown(
            "Measurements", tuple(self._names), hint="Of Compare, or of a challenge: ● to ●●●●● say how hard"
        )
        uploads.add_button("Open a sealed challenge", CHALLENGE_SUFFIX, icon=viser.Icon.LOCK_OPEN, color="gray")
        self._about = add_html(gui)
        page.changed(self._source, self._take)
        hear_any([discovering.sealing.sealed], self._refresh)
        compare = discovering.comparing.events
        hear_any([compare.opened, compare.removed, compare.held], lambda: self.show(self._look))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._source.disabled = busy

    # --- the choice -------------------------------------------------------------------------------------------------

    def choose(self, title: str) -> None:
        """A source by its title; on the screen's thread."""
        self._source.value = title
        self._take()

    def choose_first(self) -> None:
        """The first challenge."""
        self.choose(next(title for title, name in self._names.items() if name))

    def uploaded(self, path: Path) -> None:
        """A sealed challenge came from the browser: it is chosen; on any thread."""

        def take() -> None:
            self._refresh()
            name = self._discovering.folder.name_of(path)
            self.choose(next(title for title, known in self._names.items() if known == name))

        self._page.screen.post("sealed uploaded", take)

    def _take(self) -> None:
        name = self._names.get(str(self._source.value), "")
        if self._page.checked(lambda: self._discovering.choose(name), self._source):
            self._chosen()
            self.show(None)
        else:
            self._refresh()

    def _listed(self) -> dict[str, str]:
        """The sources' names by their titles: Compare's recordings, the shipped challenges, the sealed ones."""
        return self._shipped | {_SEALED + name.partition("/")[2]: name for name in self._discovering.source.sealed}

    def _refresh(self) -> None:
        """Reads the list of sealed challenges again, and names what is chosen."""
        self._names = self._listed()
        if list(self._source.options) != list(self._names):
            self._source.options = list(self._names)
        chosen = self._discovering.source.chosen
        title = next((title for title, name in self._names.items() if name == chosen), COMPARED)
        if self._source.value != title:
            self._source.value = title

    # --- what is known of it ----------------------------------------------------------------------------------------

    def show(self, look: Look | None) -> None:
        """The story that the recordings belong to, and which may be held out; on the screen's thread."""
        self._look = look
        self._refresh()
        challenge = self._discovering.source.challenge
        opened = self._discovering.source.compared
        if challenge is not None:
            self._about.content = about(challenge, folded=look is not None)
        else:
            held = [Path(name).name for name in opened if name in self._discovering.source.held_out]
            fitted = [Path(name).name for name in opened if name not in self._discovering.source.held_out]
            self._about.content = note(
                f"The measurements and the actuator of Compare. {of_files(fitted, held)}"
                if opened
                else "Open measurements on Compare first, or choose a challenge."
            )
        self._shown()


def of_files(fitted: list[str], held: list[str]) -> str:
    """'Fitted: chirp, sine. Held out: unseen.'"""
    return " ".join(f"{what}: {', '.join(names)}." for what, names in (("Fitted", fitted), ("Held out", held)) if names)


def about(challenge: Challenge, folded: bool) -> Html:
    """Title, story and recordings; folded once they are read, as the cards want their place."""
    files = of_files([one.stem for one in challenge.training], [one.stem for one in challenge.holdout])
    told = html("<b>{}.</b> {}<div {}>{}</div>", challenge.title, challenge.story, DIM, files)
    if folded:
        told = html(
            '<details><summary style="cursor:pointer"><b>{}</b>: the story</summary>{}</details>', challenge.title, told
        )
    return boxed(told)


# --- the guided first challenge: one short text at a time, chosen by how far the story is -----------------------------

STEPS = 6


def step(look: Look | None, running: bool, opened: str | None, revealed: bool) -> tuple[int, Html]:
    """The number of the step, 1 … STEPS, and what to do."""
    if look is None and not running:
        return 1, Html(
            "Read the challenge's story below. Then press <b>Start</b>: the model is calibrated to the measurements."
        )
    if look is not None and look.removable and look.assessment is None:
        return 4, Html(
            "The effect is in the model, and all its parameters are fitted anew; what that leaves is compared with "
            "the library again."
        )
    if look is None or look.assessment is None:
        return 2, Html(
            "The model's parameters move within their tolerances until it fits as well as it can; then every effect "
            "of the library is compared with the residual. This takes some seconds."
        )
    if not look.removable and opened is None:
        return 3, html(
            "Even calibrated, the error is <b>{} times the floor</b>: physics is missing. "
            "Click the <b>first card</b> below: its bar is how probable it is that this is missing.",
            number(look.rmse),
        )
    if not look.removable:
        name = effect_title(opened or "")
        return 4, html(
            "On the right, {} would follow the orange line, and the blue points are what the model lacks. "
            "Where the two lie together, this is it. Press <b>Add it to the model</b>.",
            name.lower(),
        )
    if not look.found.at_floor:
        return 5, Html(
            "The ladder fell, but not to the floor. Take the step back with <b>Undo</b>, or add the next card."
        )
    if not revealed:
        unseen = look.found.unseen
        also = ", on the measurement that was not fitted as well" if unseen is not None and not unseen.is_above else ""
        return 5, html(
            "The ladder on the right has fallen <b>to the floor</b>{}. "
            "Press <b>Reveal the truth</b> on the right to compare.",
            also,
        )
    return 6, Html(
        "That is the whole story: see where a model fails, learn what is missing, add it, watch the error fall. "
        "Choose the next challenge, or open measurements of your own on <b>Compare</b>."
    )


class Guide:
    """A box on top of the tab, there while its challenge is shown; begin() chooses that, on the screen's thread."""

    def __init__(self, page: Page, discovering: Discovering, begin: Callable[[], None]) -> None:
        self._discovering, self._begin = discovering, begin
        self._on = False
        self._challenge = ""  # that it speaks of
        self._last: tuple[Look | None, str | None] = (None, None)
        gui = page.server.gui
        self._offer = gui.add_button("Guided first challenge", icon=viser.Icon.SCHOOL, hint="About three minutes")
        self._folder = gui.add_folder("Guide", visible=False)
        with self._folder:
            self._text = add_html(gui)
            end = gui.add_button("Leave the guide", icon=viser.Icon.X, color="gray")
        page.pressed(self._offer, self._start)
        page.pressed(end, self._end)
        page.screen.hear_any([discovering.events.revealed, discovering.job.began], self.refresh)

    def show(self, look: Look | None, opened: str | None) -> None:
        """The story is here now; on the screen's thread."""
        self._last = (look, opened)
        self.refresh()

    def refresh(self) -> None:
        """Says what is to be done now; on the screen's thread."""
        here = self._on and self._discovering.source.chosen == self._challenge
        self._folder.visible = here
        self._offer.visible = not self._on and self._last[0] is None
        if here:
            look, opened = self._last
            at, text = step(look, self._discovering.running, opened, self._discovering.source.revealed)
            line = said(html("<b>Step {} of {}.</b> {}", at, STEPS, text))
            if self._text.content != line:
                self._text.content = line

    def _start(self) -> None:
        self._begin()
        self._on = True
        self._challenge = self._discovering.source.chosen
        self.refresh()

    def _end(self) -> None:
        self._on = False
        self.refresh()


# --- the discoveries so far, to go from one to the other --------------------------------------------------------------

_NEW, _ALONE = "New", "–"


class EntriesControl:
    """A dropdown, there once something was discovered, and one for a second that is to stand beside the first."""

    def __init__(self, page: Page, discovering: Discovering, beside: SideBySide) -> None:
        self._discovering, self._both = discovering, beside
        self._choice: Any = page.server.gui.add_dropdown(
            "Discovery", (_NEW,), visible=False, hint="Each is kept as it was left, and comes back at once"
        )
        self._beside: Any = page.server.gui.add_dropdown(
            "Beside", (_ALONE,), visible=False, hint="Another discovery, side by side with this one"
        )
        page.changed_to(self._choice, self._take)
        page.changed(self._beside, self._show_both)

    def show(self) -> None:
        """The list as it is now; on the screen's thread."""
        entries = self._discovering.entries
        words = [_NEW, *(one.words for one in reversed(entries.all))]
        if list(self._choice.options) != words:
            self._choice.options = words
        current = _NEW if entries.current is None else entries.current.words
        if self._choice.value != current:
            self._choice.value = current
        self._choice.visible = bool(entries.all)
        others = [one.words for one in reversed(entries.all) if one.look is not None and one is not entries.current]
        if list(self._beside.options) != [_ALONE, *others]:
            chosen = str(self._beside.value)
            self._beside.options = [_ALONE, *others]
            self._beside.value = chosen if chosen in others else _ALONE
        self._beside.visible = bool(others) and entries.current is not None
        self._show_both()

    def _show_both(self) -> None:
        entries = self._discovering.entries
        other = next((one for one in entries.all if one.words == str(self._beside.value)), None)
        self._both.show([one for one in (entries.current, other) if one is not None])

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._choice.disabled = busy

    def _take(self, chosen: str) -> None:
        discovering = self._discovering
        entry = next((one for one in discovering.entries.all if one.words == chosen), None)
        try:
            if entry is None:
                discovering.choose(discovering.source.chosen)
            else:
                discovering.show(entry)
        finally:
            self.show()


# --- what stays of a discovery: the report, the recording for Rerun, and the improved model ---------------------------

_MODEL = ".toml"
_BUTTONS = (
    Keeps("Save report", ".html", viser.Icon.FILE_TEXT, "One HTML file that opens offline"),
    Keeps("Record", ".rrd", viser.Icon.DEVICE_FLOPPY, "An .rrd file for the Rerun viewer"),
    Keeps("Save model", _MODEL, viser.Icon.TOPOLOGY_STAR, "The improved model as an actuator file; Compare lists it"),
)


class DiscoveryKeep(KeepButtons):
    """Buttons, and what they have written; of the model also whether it is what was found, and what a tool loses."""

    def __init__(self, page: Page, discovering: Discovering, viewer: ViewerHost | None) -> None:
        events, self._discovering = discovering.events, discovering
        super().__init__(
            page,
            discovering.folder,
            viewer,
            events.kept,
            self._write,
            discovering.provenance,
            *_BUTTONS,
        )
        page.screen.hear(events.verified, self.name)

    def _write(self, suffix: str, button: Any) -> None:
        if suffix == HOME.suffix:
            self._page.begins(self._discovering.take_home, button)
        else:
            self._discovering.keep(suffix)

    def said_at_once(self, path: Path) -> str:
        """The model is read back and simulated again."""
        return "simulating it again …" if path.suffix == _MODEL else ""


# --- where one goes from a discovery: with the improved model to Explore ----------------------------------------------


def leads(page: Page, discovering: Discovering, take_plant: Callable[[str, Actuator], None]) -> Leads:
    """A button, beside those that save it; take_plant(name, actuator): Explore takes it."""

    def to_explore() -> None:
        look, entry = discovering.look, discovering.entries.current
        if look is None or entry is None:
            raise InputError("nothing is discovered yet; press Start first")
        take_plant(f"improved model of discovery {entry.number}, {entry.at:%H:%M}", look.found.actuator)

    return Leads(
        page,
        [
            Lead(
                "Use in Explore",
                viser.Icon.ADJUSTMENTS,
                "Explore's plant takes this improved model; the monitor there stays the file's",
                "explore",
                to_explore,
            )
        ],
    )


# --- the Discover tab: which recordings, the run, the candidates as cards, and the steps so far -----------------------

_MOST_ADDED = 6 + len(CAUSES)


class DiscoverPanel:
    """The tab's controls.  `result` is the panel on the right."""

    def __init__(
        self, page: Page, discovering: Discovering, result: DiscoveryPanel, uploads: Uploads, standing: Standing
    ) -> None:
        self._page, self._discovering, self._result = page, discovering, result
        self._look: Look | None = None
        self._opened: str | None = None
        gui = page.server.gui
        self._entries = EntriesControl(page, discovering, result.beside)
        self._guide = Guide(page, discovering, lambda: self.source.choose_first())
        self.source = SourceControls(page, discovering, uploads, self._chosen, self._source_shown)
        self._start = gui.add_button("Start", icon=viser.Icon.PLAYER_PLAY)
        self._line = JobLine(page, discovering.job, WORKSPACE)
        self._steps = gui.add_folder("The model so far", visible=False)
        with self._steps:
            self._style = add_html(gui)
            self._model = add_html(gui)
            self._removes = [
                gui.add_button("Remove", icon=viser.Icon.X, color="gray", visible=False) for _ in range(_MOST_ADDED)
            ]
            self._undo = gui.add_button("Undo the last step", icon=viser.Icon.ARROW_BACK_UP, color="gray")
        self._little_folder = gui.add_folder("Little effect on the error", visible=False, expand_by_default=False)
        with self._little_folder:
            self._little = [self._slot() for _ in (*CATALOGUE, *CAUSES)]
        self._never_folder = gui.add_folder("Not seen in these measurements", visible=False, expand_by_default=False)
        with self._never_folder:
            self._never = [self._slot() for _ in (*CATALOGUE, *CAUSES)]
        self._own = OwnEffect(page, discovering)
        standing.connect(self._start, self._forget_errors)
        self._listen()
        self.source.show(None)

    def _listen(self) -> None:
        page, events, job = self._page, self._discovering.events, self._discovering.job
        page.pressed(self._start, self._begin)
        page.pressed(self._undo, self._discovering.undo)
        for i, button in enumerate(self._removes):
            page.pressed(button, partial(self._remove, i))
        self._result.connect(self.ask, self._turn, self._run_example)
        self._own.connect(self.ask)
        page.screen.hear(job.began, lambda _: self._busy(True))
        page.screen.hear(events.looked, self._show)
        page.screen.hear(job.ended, lambda _: self._ended())

    # --- what is asked ----------------------------------------------------------------------------------------------

    def show_entries(self) -> None:
        """Which discovery is shown; on the screen's thread."""
        self._entries.show()

    def _chosen(self) -> None:
        """Another source is chosen; on the screen's thread."""
        self._opened = None
        self._line.say("")

    def _source_shown(self) -> None:
        self._show_start()
        self._guide.show(self._look, self._opened)

    def ask(self, begin: Callable[[], bool], button: Any, title: str = "") -> None:
        """Begins a step, or says why not, beside the button that asks for it."""
        self._page.begins(begin, button, title, title)

    def _begin(self) -> None:
        if not self._page.begins(self._discovering.start, self._start, "Discover"):
            self._discovering.provenance.refused()

    def _run_example(self) -> None:
        self.source.choose_first()
        self._begin()

    def _forget_errors(self) -> None:
        """What was said of measurements that are not chosen any more."""
        self._page.say_beside(self._start, "")
        if not self._discovering.running:
            self._line.say("")

    def _remove(self, index: int) -> None:
        look = self._look
        if look is not None and index < len(look.removable):
            self.ask(lambda: self._discovering.remove(look.removable[index]), self._removes[index])

    def _show_start(self, busy: bool = False) -> None:
        """To be pressed where there is something to begin with, or to take again."""
        discovering = self._discovering
        unready = not discovering.source.ready and discovering.provenance.missing is None
        self._start.disabled = busy or discovering.running or unready

    # --- the run ----------------------------------------------------------------------------------------------------

    def _busy(self, busy: bool) -> None:
        with self._page.server.atomic():
            self._show_start(busy)
            self._start.visible = not busy
            self._undo.disabled = busy
            self.source.busy(busy)
            self._entries.busy(busy)
            if self._look is not None and not busy:
                self._undo.disabled = self._look.steps < 2
            self._wait(busy)

    def _wait(self, busy: bool) -> None:
        """Whether a step runs that does not give way to another."""
        self._own.busy(busy)
        self._result.busy(busy)
        for control in self._removes:
            control.disabled = busy

    def _ended(self) -> None:
        self._busy(False)
        self._guide.show(self._look, self._opened)

    # --- what is known ----------------------------------------------------------------------------------------------

    def _show(self, look: Look | None) -> None:
        self._look = look
        if look is None or (self._opened is not None and look.candidate(self._opened) is None):
            self._opened = None
        with self._page.server.atomic():
            self._steps.visible = look is not None
            self._draw_model(look)
            self._draw_cards(look)
            self._own.show(look)
            self._result.show(look)
            if self._discovering.is_refining:
                self._wait(False)
            if self._opened is None:
                self._result.open(None)
            else:
                self._open(self._opened)
        self._entries.show()
        self._start.label, self._start.color = ("Start", None) if look is None else ("Start again", "gray")
        self.source.show(look)

    def _draw_model(self, look: Look | None) -> None:
        added = look.removable if look is not None else ()
        for i, button in enumerate(self._removes):
            button.visible = i < len(added)
            if i < len(added):
                button.label = f"Remove {effect_title(added[i])}"
        self._undo.disabled = look is None or look.steps < 2 or self._discovering.running
        if look is not None:
            self._model.content = boxed(_so_far(look))

    def _slot(self) -> Any:
        button = self._page.server.gui.add_button("", visible=False)
        self._page.pressed(button, lambda: self._click(button))
        return button

    def _click(self, button: Any) -> None:
        one = next((one for uuid, one in self._shown() if uuid == id_of(button)), None)
        if one is not None:
            self._turn(one.name)

    def _turn(self, name: str | None) -> None:
        """Opens a candidate, or closes the one that is open."""
        self._open(None if name == self._opened else name)

    def _open(self, name: str | None) -> None:
        self._opened = name
        self._style.content = discover_candidate.style(self._look, self._shown(), name)
        self._result.open(name)
        self._guide.show(self._look, name)

    def _groups(self) -> list[tuple[Any, list[Any], list[Candidate]]]:
        known = self._look.assessment.candidates if self._look and self._look.assessment else ()
        worth = self._look.promising[: discover_candidate.MOST] if self._look else []
        never = [one for one in known if one.obstacle]
        little = [one for one in known if one not in worth and one not in never]
        return [(self._little_folder, self._little, little), (self._never_folder, self._never, never)]

    def _shown(self) -> list[tuple[str, Candidate | None]]:
        found: list[tuple[str, Candidate | None]] = []
        for _, slots, ones in self._groups():
            found += [(id_of(slot), one) for slot, one in zip(slots, ones)]
        return found

    def _draw_cards(self, look: Look | None) -> None:
        for folder, slots, ones in self._groups():
            folder.visible = bool(ones)
            for i, slot in enumerate(slots):
                slot.visible = i < len(ones)
                if i < len(ones) and look is not None:
                    slot.label = discover_candidate.label(look, ones[i])
        self._style.content = discover_candidate.style(look, self._shown(), self._opened)


def _so_far(look: Look) -> str:
    """The steps with their errors: 'Calibrated 1.69 → + Cogging torque 0.757 × floor'."""
    axes = look.found.actuator.axes
    steps = (f"{rung_title(rung.change, axes)} {number(rung.rmse)}" for rung in look.found.ladder)
    return f"{' → '.join(steps)} × floor"


# --- the Discover tab: what the model lacks, step by step -------------------------------------------------------------


class DiscoverTab(Tab):
    """Takes sealed challenges from the browser; leads to Explore for the next experiment."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._standing = self.standing(shared.discovering.provenance)
        with right.add_tab("Discovery", viser.Icon.BULB):
            add_html(self.page.server.gui, COLUMNS)
            shared.correction.add(WORKSPACE.name)
            self._standing.add(self.page.server.gui)
            self.result = DiscoveryPanel(
                self.page,
                shared.discovering,
                shared.strip,
                lambda: DiscoveryKeep(self.page, shared.discovering, shared.viewer),
                lambda: leads(
                    self.page, shared.discovering, lambda *model: shared.tab(ExploreTab).panel.take_plant(*model)
                ),
                self._load_experiment,
            )

    def build(self) -> None:
        """Which recordings, the run, and the steps."""
        shared = self.shared
        self.panel = DiscoverPanel(self.page, shared.discovering, self.result, shared.uploads, self._standing)

    def place(self) -> Place:
        """The number of the discovery."""
        entry = self.shared.discovering.entries.current
        return {} if entry is None else {"discovery": [str(entry.number)]}

    def go_to(self, place: Place) -> None:
        """Shows it, as it was left."""
        discovering = self.shared.discovering
        for asked in place.get("discovery", ())[:1]:
            entry = next((one for one in discovering.entries.all if str(one.number) == asked), None)
            if entry is None:
                raise InputError(f"there is no discovery {quoted(asked, 20)} here any more; load its session on Runs")
            discovering.show(entry)
            self.panel.show_entries()

    def kept(self) -> dict[str, Part]:
        """Every discovery, with the files that they need."""
        discovering = self.shared.discovering
        return {"discovery": Part(discovering.saved, discovering.restore, discovering.files)}

    def takes(self) -> dict[str, Callable[[Path], None]]:
        """Sealed challenges."""
        return {CHALLENGE_SUFFIX: self.panel.source.uploaded}

    def _load_experiment(self, one: Experiment, client: viser.ClientHandle | None) -> None:
        explore = self.shared.tab(ExploreTab)
        take_experiment(explore.panel, one)
        self.page.workspaces.go(explore.workspace.name, client)
