"""What a discovery has found: the ladder, the residuals, the actuator, the next experiment."""

from __future__ import annotations

import io
from collections.abc import Callable, Sequence
from contextlib import suppress
from typing import Any

import numpy as np
import plotly.graph_objects as go
import viser

from ema_model.commands import command
from ema_model.discovery.result import Candidate, Experiment
from ema_model.discovery.snapshot import Look
from ema_model.discovery.words import (
    FLOOR_NOTE,
    Track,
    effect_title,
    headline,
    in_percent,
    next_experiment,
    per_recording,
    sentences,
    so_far,
    tracks,
)
from ema_model.effects import CATALOGUE
from ema_model.errors import InputError
from ema_model.faults import HEALTHY
from ema_model.quantities import in_sentence, number
from ema_model.recordings import SIGNALS, Measurement
from emaviz.figures import discovery
from emaviz.figures.discovery import equation
from emaviz.page.discover_candidate import CARDS, CONFIG, Cards, EffectView
from emaviz.page.panel import Example, KeepButtons, Keeps
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import IN_PAIRS
from emaviz.page.window_layout import ALL_COLUMNS, PLOTS_EARLY
from emaviz.page.workspaces import Page, Workspace
from emaviz.scene.playback import motion
from emaviz.session import discovery_source
from emaviz.session.discover import Discovering
from emaviz.session.discovery_entries import Entry
from emaviz.text.html import BOX, Html, add_html, begin, boxed, explained, html, joined, note, waiting
from emaviz.text.verdicts import folded, large, of_discovery, shown, warned

WORKSPACE = Workspace("discover", "Discover", viser.Icon.BULB, 4, lower=True)


# --- suggested next test: the command and load that tell rivals apart; into Explore, or as CSV for a rig --------------

_RATE_HZ = 10_000.0
_ASK = "Of all tests that the actuator can follow, the one that would tell the two best candidates apart."


class NextTest:
    """A folder of the panel on the right.  load(experiment, client) takes a test, and the window, to Explore."""

    def __init__(
        self, page: Page, discovering: Discovering, load: Callable[[Experiment, viser.ClientHandle | None], None]
    ) -> None:
        self._page, self._discovering = page, discovering
        gui = page.server.gui
        self._folder = gui.add_folder("Suggested next test", visible=False)
        with self._folder:
            self._text = add_html(gui, note(_ASK))
            self._find = gui.add_button("Find the best test", icon=viser.Icon.FLASK)
            self._load = gui.add_button("Load it into Explore", icon=viser.Icon.ADJUSTMENTS, visible=False)
            self._csv = gui.add_button(
                "Command as CSV", icon=viser.Icon.FILE_SPREADSHEET, color="gray", visible=False, hint="For a test rig"
            )
        page.pressed_by(self._load, lambda client: self._with(lambda one: load(one, client)))
        page.pressed_by(self._csv, self._send)
        page.screen.hear(discovering.events.unsuggested, self._nothing)

    def connect(self, ask: Callable[[Callable[[], bool], Any], None]) -> None:
        """ask(begin, button) starts a step."""
        self._page.pressed(self._find, lambda: ask(self._discovering.suggest, self._find))

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._find.disabled = busy

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        self._folder.visible = look is not None and look.assessment is not None
        told = next_experiment(look.found) if look is not None else []
        self._load.visible = self._csv.visible = bool(told)
        self._find.color = "gray" if told else None
        if told:
            more = joined(html("<div>{}</div>", text) for text in told[1:])
            self._text.content = html("<div {}><b>{}</b>{}</div>", BOX, told[0], more)
        else:
            self._text.content = note(_ASK)

    def _nothing(self) -> None:
        self._text.content = note("No test that the actuator can follow would tell the two apart.")

    def _with(self, act: Callable[[Experiment], object]) -> None:
        one = self._discovering.experiment
        if one is not None:
            act(one)

    def _send(self, client: viser.ClientHandle | None) -> None:
        if client is not None:
            self._with(lambda one: client.send_file_download("next-test.csv", as_csv(one), save_immediately=True))


def as_csv(one: Experiment) -> bytes:
    """time_s, command_rad and load_torque_Nm, as a measurement has them."""
    time_s = np.arange(round(one.duration_s * _RATE_HZ)) / _RATE_HZ
    demand = command(one.command, one.settings).at(time_s)
    table = np.column_stack([time_s, demand, np.full_like(time_s, one.load_torque_Nm)])
    text = io.StringIO()
    np.savetxt(text, table, delimiter=",", header="time_s,command_rad,load_torque_Nm", comments="", fmt="%.9g")
    return text.getvalue().encode()


# --- the 3D actuator with a recording that was fitted: as measured, or as the model has it before and after -----------

_SHOWN = ("as measured", "calibrated model", "improved model")


class ActuatorSwitch:
    """A dropdown; track() is the recording that is looked at, which plays on Discover's own clock."""

    def __init__(
        self, page: Page, discovering: Discovering, track: Callable[[], Track | None], strip: PlaybackStrip
    ) -> None:
        self._page, self._discovering, self._track, self._strip = page, discovering, track, strip
        self._shown: tuple[object, ...] = ()
        self._choice = page.server.gui.add_dropdown("3D actuator", _SHOWN, hint="What it plays")
        page.changed(self._choice, self.refresh)

    def refresh(self) -> None:
        """Plays what is chosen of the present recording; on the screen's thread."""
        track, chosen = self._track(), str(self._choice.value)
        if (track, chosen) == self._shown:
            return
        self._shown = (track, chosen)
        shown = None
        look = self._discovering.look
        if track is not None and look is not None:
            with suppress(InputError):  # without a position, the actuator cannot be shown with it
                shown = motion(run_of(track, chosen), HEALTHY, look.found.actuator)
        self._strip.put(shown, WORKSPACE.name)


def run_of(track: Track, shown: str) -> Measurement:
    """A recording's blocks as a run; what was not measured is the last model's.  InputError without a position."""
    of = {_SHOWN[0]: track.measured, _SHOWN[1]: track.models[0], _SHOWN[2]: track.models[-1]}[shown]
    signals = {**track.models[-1], **track.measured, **of}
    missing = {"current_A", "motor_position_rad", "user_position_rad"} - signals.keys()
    if missing:
        raise InputError(f"{track.name}: {min(missing)} was not fitted, so that the actuator cannot be shown with it")
    time_s, motor = track.time_s, signals["motor_position_rad"]
    return Measurement({"time_s": time_s, "motor_speed_rad_s": np.gradient(motor, time_s), **signals}, track.name)


# --- two discoveries side by side -------------------------------------------------------------------------------------


class SideBySide:
    """A folder over the whole width, there while another discovery is chosen to stand beside the one that is shown."""

    def __init__(self, page: Page) -> None:
        gui = page.server.gui
        self._folder = gui.add_folder("Side by side", visible=False)
        with self._folder:
            add_html(gui, IN_PAIRS + ALL_COLUMNS)
            self._told = [add_html(gui) for _ in range(2)]
            self._ladders = [gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.5) for _ in range(2)]

    def show(self, both: Sequence[Entry]) -> None:
        """Two that have a picture; of fewer nothing is shown."""
        looks = [(one, one.look) for one in both if one.look is not None]
        self._folder.visible = len(looks) == 2
        if not self._folder.visible:
            return
        for (entry, look), told, ladder in zip(looks, self._told, self._ladders):
            title = html("<b>{}. {}</b>", entry.number, entry.subject)
            found = boxed(equation(look.found, look.added)) if look.removable else Html()
            said = large(headline(look.found), of_discovery(look.found))
            told.content = html("<div {}>{}{}{}</div>", BOX, title, said, found)
            ladder.figure = discovery.error_ladder(look.found)


# --- discover's panel on the right ------------------------------------------------------------------------------------
# Discover's panel on the right: the answer so far, the ladder, the opened candidate, the equation, what is left.

_STEPS = (
    "Choose measurements on the left: those of Compare, or one of the challenges.",
    Html(
        "Press <b>Find what is missing</b> below a comparison, or <b>Start</b> here: every effect of the library and "
        "every fault is held beside what the calibrated model leaves, and ranked."
    ),
    "Add an effect: the error falls, also on what was held out. Then save the improved model, or use it in Explore.",
)
_EXAMPLE = "Run an example", "The first bench run of an actuator: three recordings, and one that is held out."
_WAITING = "The model is calibrated, by a comparison of the same if there is one; then what it leaves is looked at."
HOME = Keeps(
    "Take it home",
    ".zip",
    viser.Icon.PACKAGE_EXPORT,
    "The improved model as C, FMU, MJCF and Python in one .zip, each replayed on the recordings with its loss",
)
_LADDER_PX = 215, 290, 330, 685  # least, in one column, most, and what a window holds beside it


class DiscoveryPanel:
    """Everything here is built and changed on the screen's thread.

    keep() adds what saves a discovery, load(test, client) puts a test into Explore; strip: its clock, for the recording
    on the 3D actuator; leads() adds what may follow.
    """

    def __init__(
        self,
        page: Page,
        discovering: Discovering,
        strip: PlaybackStrip,
        keep: Callable[[], KeepButtons],
        leads: Callable[[], object],
        load: Callable[[Any, viser.ClientHandle | None], None],
    ) -> None:
        self._page, self._discovering = page, discovering
        self._look: Look | None = None
        self._titles: dict[str, str] = {}
        gui = page.server.gui
        self._run_example: Callable[[], object] = lambda: None
        example = Example(page, *_EXAMPLE, lambda: self._run_example())
        self._empty = begin("No discovery yet", _STEPS, example.html)
        add_html(gui, CARDS)
        self._headline = add_html(gui, self._empty)
        self.beside = SideBySide(page)
        self._effect = EffectView(page, discovering)  # below the sentence, in one column too
        add_html(gui, PLOTS_EARLY)
        self._keep_folder = gui.add_folder("Keep it", visible=False)
        with self._keep_folder:  # where it is seen without scrolling
            self._kept = keep()
            leads()
        self._ladder: Any = gui.add_plotly(go.Figure(), config=CONFIG, visible=False)
        page.workspaces.heights.set_figure(self._ladder, *_LADDER_PX)
        self._truth_folder = gui.add_folder("The challenge's truth", visible=False)
        with self._truth_folder:
            self._reveal = gui.add_button("Reveal the truth", icon=viser.Icon.EYE, color="gray")
            self._truth = add_html(gui)
        self._model_folder = gui.add_folder("The improved model", visible=False)
        with self._model_folder:
            self._equation = add_html(gui)
            self._kept.add(HOME)
        self._next = NextTest(page, discovering, load)
        self._left_folder = gui.add_folder("Remaining residual", visible=False, expand_by_default=False)
        with self._left_folder:
            self._left: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.5, visible=False)
        self._cards = Cards(page, discovering)
        self._before_folder = gui.add_folder("Before and after", visible=False)
        with self._before_folder:
            self._recording = gui.add_dropdown("Measurement", ["–"])
            self._signal = gui.add_dropdown("Signal", ["–"])
            self._actuator = ActuatorSwitch(page, discovering, self._track, strip)
            self._residual: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.5, visible=False)
            self._explained: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.6, visible=False)
        for control in (self._recording, self._signal):
            page.changed(control, self._draw_residual)
        page.pressed(self._reveal, self._show_truth)

    def connect(
        self, ask: Callable[..., None], open_card: Callable[[str | None], None], example: Callable[[], object]
    ) -> None:
        """ask(begin, button) starts a step; open_card(name) opens a candidate, or closes it, on the screen's thread.

        example(): begins a discovery of something shipped.
        """
        self._run_example = example
        self._effect.connect(ask, lambda: open_card(None))
        self._cards.connect(ask, open_card)
        self._next.connect(ask)

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        if self._look is None:
            self._headline.content = waiting(self._discovering.job.title, _WAITING) if busy else self._empty
        self._effect.busy(busy)
        self._cards.busy(busy)
        self._next.busy(busy)

    def open(self, name: str | None) -> None:
        """Opens a candidate, or closes it."""
        self._effect.open(self._look, name)
        self._cards.open(name)

    def show(self, look: Look | None) -> None:
        """A story as it stands."""
        if look is None or self._look is None or look.found.actuator is not self._look.found.actuator:
            self._kept.clear()  # what was saved is of another model
        self._look = look
        for folder in (self._before_folder, self._keep_folder):
            folder.visible = look is not None
        self._truth_folder.visible = look is not None and self._discovering.source.challenge is not None
        self._model_folder.visible = look is not None and bool(look.removable)
        self._left_folder.visible = look is not None and look.found.unknown is not None
        self._ladder.visible = look is not None
        self._cards.show(look)
        self._next.show(look)
        if not self._discovering.source.revealed:
            self._truth.content = ""
        if look is None:
            self._headline.content = (
                waiting(self._discovering.job.title, _WAITING) if self._discovering.running else self._empty
            )
            self._actuator.refresh()
            return
        found = look.found
        self._headline.content = answer(look)
        self._ladder.figure = discovery.error_ladder(found)
        self._equation.content = boxed(equation(found, look.added))
        named = all(one.name in CATALOGUE for one in look.added)
        self._left_folder.label = "Remaining residual" if named else "Unexplained residual"
        if self._left_folder.visible:
            self._left.figure, self._left.visible = discovery.missing_curve(found), True
        self._titles = {SIGNALS[name].title: name for name in found.ladder[0].signals}
        names = [f"{i + 1}. {name}" for i, name in enumerate(look.reach)]
        for dropdown, options in ((self._recording, names), (self._signal, list(self._titles))):
            if list(dropdown.options) != options:
                dropdown.options = options
        self._draw_residual()
        self._draw_explained(look)
        if self._discovering.source.revealed:
            self._show_truth()

    def _draw_residual(self) -> None:
        if self._look is None:
            return
        signal = self._titles.get(str(self._signal.value)) or self._look.primary
        track = self._track()
        if track is not None:
            self._residual.figure = discovery.residual_steps(track, signal)
            self._residual.visible = True
        self._actuator.refresh()

    def _track(self) -> Track | None:
        """The recording that is looked at."""
        if self._look is None:
            return None
        options, runs = list(self._recording.options), tracks(self._look.found)
        at = options.index(self._recording.value) if self._recording.value in options else 0
        return runs[min(at, len(runs) - 1)]

    def _draw_explained(self, look: Look) -> None:
        self._explained.visible = look.assessment is not None and bool(look.explained_before)
        if look.assessment is not None and self._explained.visible:
            self._explained.figure = discovery.explained_steps(look.explained_before, look.assessment.left.explained)

    def _show_truth(self) -> None:
        if self._look is not None:
            told = discovery_source.document_of(self._discovering.source.reveal(), self._look.found, self._look.added)
            self._truth.content = boxed(joined(map(shown, told.blocks)))
            self._discovering.events.revealed()


def next_step(look: Look, best: Candidate) -> str:
    """'Next: cogging torque, 97 % probable, would bring the error from 3.47 to about 2.98 times the floor.'"""
    name, probable = in_sentence(effect_title(best.name)), in_percent(look.probability(best))
    before, after = number(look.rmse), number(look.predicted_rmse(best))
    would = f"would bring the error from {before} to about {after} times the floor"
    return f"Next: {name}, {probable} probable, {'explains a part of what is left' if before == after else would}."


def answer(look: Look) -> Html:
    """The verdict in words, its warnings, and what 1 means."""
    found = look.found
    meaning = of_discovery(found)
    if look.assessment is None:
        first, _, more = so_far(found).partition(". ")
        first, others, meaning = (
            f"{first.rstrip('.')}.",
            [*([more] if more else []), "Analysing the residual …"],
            "open",
        )
    elif look.promising and not found.not_claimed:  # nothing was tried in vain
        best, meaning = look.promising[0], "warning"
        first = next_step(look, best)
        left = look.assessment.left.explanation
        more = [left.sentence] if left is not None and not look.removable else []
        others = [*([headline(found)] if look.removable else []), sentences(found)[0], *more]
    else:
        first, others = headline(found), sentences(found)
    told = joined([*(html("<div>{}</div>", text) for text in others), warned(found.warnings)])
    return html(
        '<div {}>{}{}<div style="opacity:.65;font-size:12px" title="{}">The floor is what noise and the model\'s own '
        "limits leave: 1 on the ladder.</div>{}</div>",
        BOX,
        large(first, meaning),
        explained(told),
        FLOOR_NOTE,
        folded("Each measurement", per_recording(found)),
    )
