"""The Library tab."""

from __future__ import annotations

import math
from typing import Any

import viser

from ema_model.effects import CATALOGUE, Effect, find
from ema_model.faults import HEALTHY
from ema_model.simulation.run import RUNS, WithEffect
from emaviz.figures.discovery import EffectCharts, picture, small_picture
from emaviz.page.discover_candidate import about
from emaviz.page.panel import JobLine
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import LONG_LABELS
from emaviz.page.tab import Shared, Tab
from emaviz.page.window_layout import COLUMNS, NEXT_COLUMN
from emaviz.page.workspaces import Page, Workspace
from emaviz.scene.playback import motion
from emaviz.server.viser_private import selector_of
from emaviz.session.explore import Library
from emaviz.text.html import BOX, add_html, html, mathml, note, unescaped

# --- an effect opened: its text, its equation, and what each parameter does -------------------------------------------

WORKSPACE = Workspace("library", "Library", viser.Icon.BOOK, 8)

_FIRST = "cogging_torque"  # shown until another one is chosen


class EffectPage:
    """An effect on the right: what it is, a slider for each parameter, the run with and without it."""

    def __init__(self, page: Page, library: Library, strip: PlaybackStrip) -> None:
        self._page, self._library, self._strip = page, library, strip
        self._name = ""
        self.best_runs: dict[str, str] = {}  # by effect, where it shows most
        self._sliders: dict[str, Any] = {}
        gui = page.server.gui
        add_html(gui, COLUMNS)
        self._title = add_html(gui, note("Choose an effect on the left."))
        self._text = add_html(gui)
        self._run = gui.add_dropdown("Run", tuple(RUNS), visible=False)
        self._place = gui.add_folder("Parameters", visible=False)
        with self._place:
            add_html(gui, LONG_LABELS)
        self._picture = add_html(gui)
        add_html(gui, NEXT_COLUMN)  # a signal and its difference stay together
        self._status = add_html(gui)
        self._charts = EffectCharts(gui, page.session.actuator.axes)
        page.measuring.add(self._charts.handles, self._charts.lines, self._charts.zoom)
        page.workspaces.heights.add(self._charts.handles)
        page.workspaces.entered.connect(self._enter)
        page.changed(self._run, self._ask, at_once=True)

    def _enter(self, workspace: str) -> None:
        """A first visit finds an effect opened."""
        if workspace == WORKSPACE.name and not self._name:
            self.open(_FIRST)

    def open(self, name: str) -> None:
        """Shows an effect, and runs it; on the screen's thread."""
        effect = find(name, self._page.session.actuator.axes)
        self._name = name
        self._title.content = html(
            '<div {}><div style="font-size:17px;font-weight:600">{}</div>'
            '<div style="font-size:16px;padding:6px 0">{}</div></div>',
            BOX,
            effect.title,
            mathml(effect.equation, "inline"),
        )
        self._text.content = about(effect, equation=False)
        self._run.value = next(run for run in RUNS if run == self.best_runs.get(name, self._run.value))
        self._run.visible = self._place.visible = True
        for slider in self._sliders.values():
            slider.remove()
        with self._place:
            self._sliders = {parameter.name: self._slider(effect, i) for i, parameter in enumerate(effect.parameters)}
        self._ask()

    def show(self, felt: WithEffect) -> None:
        """A run of it; on the screen's thread."""
        if felt.name == self._name:
            with self._page.server.atomic():
                self._charts.show(felt)
                axes = self._page.session.actuator.axes
                self._picture.content = picture(find(felt.name, axes), felt, axes)
            self._strip.put(motion(felt.with_it, HEALTHY, self._page.session.actuator), WORKSPACE.name)

    def say(self, text: str) -> None:
        """What goes on."""
        self._status.content = note(text) if text else ""

    def _slider(self, effect: Effect, index: int) -> Any:
        """From nothing to somewhat more than a strong case; whole numbers in steps."""
        one = effect.parameters[index]
        gui = self._page.server.gui
        if index == 0:
            middle, most = effect.severities[1], 1.25 * max(effect.severities)
            low, high = max(one.low, 0.0), min(one.high, most)
        elif one.name == effect.phase:
            middle, low, high = one.default, one.low, one.high
        else:
            middle, most = one.default, 3.0 * max(abs(one.default), 0.01 * (one.high - one.low))
            low, high = max(one.low, -most), min(one.high, most)
        low, high = min(low, middle), max(high, middle)
        if one.integer:
            slider = gui.add_slider(one.label, int(one.low), int(min(one.high, 48)), 1, int(middle))
        else:
            step = float(f"{(high - low) / 400.0:.0e}")
            low, high = min(_inwards(low), middle), max(-_inwards(-high), middle)
            slider = gui.add_slider(one.label, low, high, step, middle, hint=one.meaning)
        self._page.changed(slider, self._ask, at_once=True)
        return slider

    def _ask(self) -> None:
        if self._name:
            settings = {name: float(slider.value) for name, slider in self._sliders.items()}
            self._page.checked(lambda: self._library.feel(self._name, settings, str(self._run.value)), self._run)


def _inwards(low: float) -> float:
    """A lower end with four digits, not below it: −3.141 for −π, which a slider would write in full."""
    if low == 0.0:
        return low
    grain = 10.0 ** (math.floor(math.log10(abs(low))) - 3)
    return round(math.ceil(low / grain - 1e-9) * grain, 12)


# --- the Library tab: all effects, searchable, each with a picture of what it does; one opens on the right ------------

_CARD = (
    "height:auto!important;min-height:52px;padding:4px 9px;font-weight:400;font-size:12px;"
    "background-color:rgba(134,142,150,.10)!important;color:inherit!important;"
)
_LABEL = "display:block;height:auto;overflow:visible;white-space:pre-line;text-align:left;line-height:1.3;width:100%"


class LibraryPanel:
    """Search and cards on the left."""

    def __init__(self, page: Page, library: Library, opened: EffectPage) -> None:
        self._page, self._effect = page, opened
        self._pictures: dict[str, str] = {}
        gui = page.server.gui
        self._search = gui.add_text("Search", "", hint="In names, equations and explanations")
        self._draw = gui.add_button(
            "Simulate all for their thumbnails",
            icon=viser.Icon.PHOTO,
            hint="Each where it shows most; the first time, the library is compiled, which takes some seconds",
        )
        JobLine(page, library.job, WORKSPACE)
        self._style = add_html(gui)
        self._cards = {name: self._card(effect) for name, effect in CATALOGUE.items()}
        self._none = add_html(gui, note("No effect of the library has this."), visible=False)
        self._draw_style()
        page.changed(self._search, self._filter)
        page.pressed(self._draw, lambda: page.begins(library.draw_all, self._draw))
        page.screen.hear(library.events.said, opened.say)
        page.screen.hear(library.events.drawn, self._drawn, each=lambda felt: felt.name)
        page.screen.hear(library.events.felt, opened.show)

    def _card(self, effect: Effect) -> Any:
        button = self._page.server.gui.add_button(f"{effect.title}\n{effect.shows}")
        self._page.pressed(button, lambda: self._effect.open(effect.name))
        return button

    def _filter(self) -> None:
        words = str(self._search.value)[:100].lower().split()
        shown = 0
        with self._page.server.atomic():
            for name, button in self._cards.items():
                fits = all(word in _text(CATALOGUE[name]) for word in words)
                shown += fits
                if button.visible != fits:
                    button.visible = fits
            self._none.visible = shown == 0

    def _drawn(self, felt: WithEffect) -> None:
        self._pictures[felt.name] = small_picture(felt)
        self._effect.best_runs[felt.name] = felt.run
        self._draw.color = "gray"
        self._draw_style()

    def _draw_style(self) -> None:
        rules = []
        for name, button in self._cards.items():
            one = selector_of(button)
            picture = self._pictures.get(name, "")
            if picture:
                picture = f'background-image:url("{picture}")!important;background-repeat:no-repeat!important;'
                picture += "background-position:right 6px center!important;background-size:120px 44px!important;"
                picture += "padding-right:130px!important;"
            rules.append(f"{one}{{{_CARD}{picture}}}{one} .mantine-Button-inner{{justify-content:flex-start}}")
            rules.append(f"{one} .mantine-Button-label{{{_LABEL}}}{one} .mantine-Button-label::first-line")
            rules.append("{font-weight:600;font-size:13.5px}")
        self._style.content = unescaped(f"<style>{''.join(rules)}</style>")


def _text(effect: Effect) -> str:
    parts = (effect.title, effect.name, effect.equation, effect.explanation, effect.shows, effect.mistaken_for)
    return " ".join(parts).lower()


# --- the Library tab: every effect, and what it does ------------------------------------------------------------------


class LibraryTab(Tab):
    """Cards on the left, the opened effect on the right."""

    workspace = WORKSPACE

    def __init__(self, shared: Shared, right: viser.PanelHandle) -> None:
        super().__init__(shared, right)
        self._library = Library(self.page.session)
        with right.add_tab("Effect", viser.Icon.BOOK):
            self._effect = EffectPage(self.page, self._library, shared.strip)

    def build(self) -> None:
        """Search and cards."""
        LibraryPanel(self.page, self._library, self._effect)
