"""The Discover tab: which recordings, the run, the candidates as cards, and the steps so far."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import viser

from ema_model.discovery import Candidate
from ema_model.discovery.shown.labels import effect_title, rung_title
from ema_model.discovery.steps.snapshot import Look
from ema_model.effects import CATALOGUE
from ema_model.faults import CAUSES
from ema_model.quantities.numbers import number
from emaviz.page.discover import cards
from emaviz.page.discover.entries import EntriesControl
from emaviz.page.discover.guide import Guide
from emaviz.page.discover.own_effect import OwnEffect
from emaviz.page.discover.result import DiscoveryPanel
from emaviz.page.discover.source import SourceControls
from emaviz.page.job_line import JobLine
from emaviz.page.page import Page
from emaviz.page.standing import Standing
from emaviz.server.uploads import Uploads
from emaviz.server.viser_private import id_of
from emaviz.session.discover.discovering import Discovering
from emaviz.text.html import add_html
from emaviz.text.notes import boxed, note

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
        self._entries = EntriesControl(page, discovering)
        self._guide = Guide(page, discovering, lambda: self.source.choose_first())
        self.source = SourceControls(page, discovering, uploads, self._chosen, self._source_shown)
        self._start = gui.add_button("Start", icon=viser.Icon.PLAYER_PLAY)
        self._all = gui.add_button(
            "Find all",
            icon=viser.Icon.WAND,
            visible=False,
            hint="Adds, step by step, every effect and fault that the data support",
        )
        self._line = JobLine(page, discovering.job)
        self._cards_folder = gui.add_folder("What may be missing", visible=False)
        with self._cards_folder:
            self._style = add_html(gui)
            self._hint = add_html(gui)
            self._worth = [self._slot() for _ in range(8)]
        self._steps = gui.add_folder("The model so far", visible=False)
        with self._steps:
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
        discovering, post = self._discovering, self._page.screen.post
        self._start.on_click(lambda _: self._begin())
        self._undo.on_click(lambda _: self._page.screen.post("undo", self._step_back))
        self._all.on_click(lambda _: self.ask(discovering.find_all, self._all))
        for i, button in enumerate(self._removes):
            button.on_click(lambda _, i=i: self._remove(i))
        self._result.connect(self.ask, lambda: self._open(None))
        self._own.connect(self.ask)
        events, job = discovering.events, discovering.job
        job.began.connect(lambda _: post("discover began", lambda: self._busy(True)))
        events.looked.connect(lambda look: post("looked", lambda: self._show(look)))
        job.ended.connect(lambda _: post("discover ended", self._ended))

    # --- what is asked ----------------------------------------------------------------------------------------------

    def _chosen(self) -> None:
        """Another source is chosen; on the screen's thread."""
        self._opened = None
        self._line.say("")

    def _source_shown(self) -> None:
        self._show_start()
        self._guide.show(self._look, self._opened)

    def ask(self, begin: Callable[[], bool], button: Any) -> None:
        """Begins a step, or says why not, beside the button that asks for it."""
        self._page.begins(begin, button)

    def _begin(self) -> None:
        if not self._page.begins(self._discovering.start, self._start):
            self._discovering.provenance.refused()

    def _forget_errors(self) -> None:
        """What was said of measurements that are not chosen any more."""
        self._page.say_beside(self._start, "")
        if not self._discovering.running:
            self._line.say("")

    def _step_back(self) -> None:
        self._page.checked(self._discovering.undo, self._undo)

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
            for control in (self._undo, self._all, *self._removes):
                control.disabled = busy
            self.source.busy(busy)
            self._entries.busy(busy)
            if self._look is not None and not busy:
                self._undo.disabled = self._look.steps < 2
            self._own.busy(busy)
            self._result.busy(busy)

    def _ended(self) -> None:
        self._busy(False)
        self._guide.show(self._look, self._opened)

    # --- what is known ----------------------------------------------------------------------------------------------

    def _show(self, look: Look | None) -> None:
        self._look = look
        if look is None or (self._opened is not None and look.candidate(self._opened) is None):
            self._opened = None
        with self._page.server.atomic():
            for one in (self._all, self._steps, self._cards_folder):
                one.visible = look is not None
            self._draw_model(look)
            self._draw_cards(look)
            self._own.show(look)
            self._result.show(look)
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
        button.on_click(lambda _: self._page.screen.post("card", lambda: self._click(button)))
        return button

    def _click(self, button: Any) -> None:
        one = next((one for uuid, one in self._shown() if uuid == id_of(button)), None)
        if one is not None:
            self._open(None if one.name == self._opened else one.name)

    def _open(self, name: str | None) -> None:
        self._opened = name
        self._style.content = cards.style(self._look, self._shown(), name)
        self._result.open(name)
        self._guide.show(self._look, name)

    def _groups(self) -> list[tuple[Any, list[Any], list[Candidate]]]:
        known = self._look.assessment.candidates if self._look and self._look.assessment else ()
        worth = self._look.promising[: len(self._worth)] if self._look else []
        never = [one for one in known if one.untestable_reason]
        little = [one for one in known if one not in worth and one not in never]
        return [
            (self._cards_folder, self._worth, worth),
            (self._little_folder, self._little, little),
            (self._never_folder, self._never, never),
        ]

    def _shown(self) -> list[tuple[str, Candidate | None]]:
        found: list[tuple[str, Candidate | None]] = []
        for _, slots, ones in self._groups():
            found += [(id_of(slot), one) for slot, one in zip(slots, ones)]
        return found

    def _draw_cards(self, look: Look | None) -> None:
        for folder, slots, ones in self._groups():
            if folder is not self._cards_folder:
                folder.visible = bool(ones)
            for i, slot in enumerate(slots):
                slot.visible = i < len(ones)
                if i < len(ones) and look is not None:
                    slot.label = cards.label(look, ones[i])
        self._style.content = cards.style(look, self._shown(), self._opened)
        self._hint.content = note(self._advice(look))

    @staticmethod
    def _advice(look: Look | None) -> str:
        if look is None:
            return ""
        if look.assessment is None:
            return "Analysing the residual and scoring the library's effects and the actuator's faults …"
        if look.promising:
            return "The bar is the share of the error that it would remove. Click a card to see why, and to add it."
        if look.assessment.left.explanation is not None and not look.found.at_floor:
            return "No candidate explains the residual: try its curve, or an expression of your own, below."
        return "No candidate would reduce the error significantly."


def _so_far(look: Look) -> str:
    """The steps with their errors: 'Calibrated 1.69 → + Cogging torque 0.757 × floor'."""
    axes = look.found.actuator.axes
    steps = (f"{rung_title(rung.change, axes)} {number(rung.rmse)}" for rung in look.found.ladder)
    return f"{' → '.join(steps)} × floor"
