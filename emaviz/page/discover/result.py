"""Discover's panel on the right: the answer so far, the ladder, the opened candidate, the equation, what is left."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import plotly.graph_objects as go
import viser

from ema_model.discovery.shown.tables import per_recording
from ema_model.discovery.shown.tracks import Track, tracks
from ema_model.discovery.steps.snapshot import Look
from ema_model.discovery.words import FLOOR_NOTE, headline, sentences, so_far
from ema_model.effects import CATALOGUE
from ema_model.faults import BY_NAME
from ema_model.recordings import SIGNALS
from emaviz.figures import error_ladder, explained_steps, missing_curve, residual_steps
from emaviz.figures.model_equation import equation
from emaviz.page.discover.actuator import ActuatorSwitch
from emaviz.page.discover.effect import CONFIG, EffectView
from emaviz.page.discover.next_experiment import NextTest
from emaviz.page.inset import COLUMNS, NEXT_COLUMN
from emaviz.page.kept import Cleared
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.session.discover import beside_truth
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import Html, add_html, html, joined
from emaviz.text.notes import BOX, begin, boxed
from emaviz.text.told import folded, large, shown, warned
from emaviz.text.verdict import of_discovery

_STEPS = (
    "Choose measurements on the left: those of Compare, or one of the challenges.",
    Html("Press <b>Start</b>: the model is calibrated, and its residual is compared with every effect of the library."),
    "Add an effect: the error falls, also on what was held out. Then save the improved model, or use it in Explore.",
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
        keep: Callable[[], Cleared],
        leads: Callable[[], object],
        load: Callable[[Any, viser.ClientHandle | None], None],
    ) -> None:
        self._page, self._discovering = page, discovering
        self._look: Look | None = None
        self._titles: dict[str, str] = {}
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._headline = add_html(gui, begin("No discovery yet", _STEPS))
        self._keep_folder = gui.add_folder("Keep it", visible=False)
        with self._keep_folder:  # where it is seen without scrolling
            self._kept = keep()
            leads()
        self._ladder: Any = gui.add_plotly(go.Figure(), config=CONFIG, visible=False)
        page.workspaces.heights.set_figure(self._ladder, *_LADDER_PX)
        self._effect = EffectView(page, discovering)
        self._truth_folder = gui.add_folder("The challenge's truth", visible=False)
        with self._truth_folder:
            self._reveal = gui.add_button("Reveal the truth", icon=viser.Icon.EYE, color="gray")
            self._truth = add_html(gui)
        self._model_folder = gui.add_folder("The improved model", visible=False)
        with self._model_folder:
            self._equation = add_html(gui)
        self._before_folder = gui.add_folder("Before and after", visible=False)
        with self._before_folder:
            add_html(gui, NEXT_COLUMN)
            self._recording = gui.add_dropdown("Measurement", ["–"])
            self._signal = gui.add_dropdown("Signal", ["–"])
            self._actuator = ActuatorSwitch(page, discovering, self._track, strip)
            self._residual: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.5, visible=False)
            self._explained: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.6, visible=False)
        self._left_folder = gui.add_folder("Remaining residual", visible=False, expand_by_default=False)
        with self._left_folder:
            self._left: Any = gui.add_plotly(go.Figure(), config=CONFIG, aspect=0.5, visible=False)
        self._next = NextTest(page, discovering, load)
        self._recording.on_update(lambda event: event.client and page.screen.post("residual", self._draw_residual))
        self._signal.on_update(lambda event: event.client and page.screen.post("residual", self._draw_residual))
        self._reveal.on_click(lambda _: page.screen.post("reveal", self._revealed))

    def connect(self, ask: Callable[[Callable[[], bool], Any], None], close: Callable[[], None]) -> None:
        """ask(begin, button) starts a step; close() closes the opened card."""
        self._effect.connect(ask, close)
        self._next.connect(ask)

    def busy(self, busy: bool) -> None:
        """Whether a step runs."""
        self._effect.busy(busy)
        self._next.busy(busy)

    def open(self, name: str | None) -> None:
        """Opens a candidate, or closes it."""
        self._effect.open(self._look, name)

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
        self._next.show(look)
        if not self._discovering.source.revealed:
            self._truth.content = ""
        if look is None:
            self._headline.content = begin("No discovery yet", _STEPS)
            self._actuator.refresh()
            return
        found = look.found
        self._headline.content = answer(look)
        self._ladder.figure = error_ladder.figure(found)
        self._equation.content = boxed(equation(found, look.added))
        named = all(one.name in CATALOGUE for one in look.added)
        self._left_folder.label = "Remaining residual" if named else "Unexplained residual"
        if self._left_folder.visible:
            self._left.figure, self._left.visible = missing_curve.figure(found), True
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
            self._residual.figure = residual_steps.figure(track, signal)
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
            self._explained.figure = explained_steps.figure(look.explained_before, look.assessment.left.explained)

    def _revealed(self) -> None:
        self._page.checked(self._show_truth, self._reveal)

    def _show_truth(self) -> None:
        if self._look is not None:
            told = beside_truth.document_of(self._discovering.source.reveal(), self._look.found, self._look.added)
            self._truth.content = boxed(joined(map(shown, told.blocks)))
            self._discovering.events.revealed()


def answer(look: Look) -> Html:
    """The verdict in words, its warnings, and what 1 means."""
    found = look.found
    meaning = of_discovery(found)
    if look.assessment is None:
        first, others, meaning = so_far(found), ["Analysing the residual …"], "open"
    elif not look.added and not found.faults and look.promising and not found.not_claimed:
        # Nothing was added, of which a verdict could speak, and nothing was tried in vain.
        left = look.assessment.left.explanation
        best, meaning = look.promising[0].name, "warning"
        may_be_worn = any(name in BY_NAME for name in (best, *look.assessment.alike.get(best, ())))
        first = "Physics is missing, or the actuator has a fault." if may_be_worn else "Physics is missing."
        others = [sentences(found)[0], *([left.sentence] if left is not None else [])]
    else:
        first, others = headline(found), sentences(found)
    return html(
        '<div {}>{}{}{}<div style="opacity:.65;font-size:12px" title="{}">The floor is what noise and the model\'s own '
        "limits leave: 1 on the ladder.</div>{}</div>",
        BOX,
        large(first, meaning),
        joined(html("<div>{}</div>", text) for text in others),
        warned(found.warnings),
        FLOOR_NOTE,
        folded("Each measurement", per_recording(found)),
    )
