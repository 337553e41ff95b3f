"""An effect opened: its text, its equation, and what each parameter does."""

from __future__ import annotations

import math
from typing import Any

from ema_model.effects import Effect, find
from ema_model.faults import HEALTHY
from ema_model.simulation.with_effect import RUNS, WithEffect
from emaviz.figures.effect_residual import picture
from emaviz.figures.effect_signature import EffectCharts
from emaviz.page.discover.effect import about
from emaviz.page.inset import COLUMNS, NEXT_COLUMN
from emaviz.page.library import WORKSPACE
from emaviz.page.page import Page
from emaviz.page.playback import PlaybackStrip
from emaviz.page.style import LONG_LABELS
from emaviz.scene.motion import motion
from emaviz.session.library import Library
from emaviz.text.html import add_html, html
from emaviz.text.mathml import mathml
from emaviz.text.notes import BOX, note

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
        page.workspaces.heights.add(self._charts.handles)
        page.workspaces.entered.connect(self._enter)
        self._run.on_update(lambda event: event.client and self._ask())

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
        elif one.name in ("phase_rad", "angle_rad"):
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
        slider.on_update(lambda event: event.client and self._ask())
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
